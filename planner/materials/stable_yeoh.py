"""A Yeoh law nearest to a tensile curve among those that are stable at every strain."""

from dataclasses import dataclass

import numpy as np

from planner.numerics import FloatArray

__all__ = ["StableYeoh", "stable_yeoh"]


# With an energy W of the first invariant alone the stress of a tensile test is
#
#     P = 2 W'(I1) (l - l^-2),   W' = C10 + 2 C20 (I1 - 3) + 3 C30 (I1 - 3)²,
#
# linear in the coefficients. In principal logarithmic strains, their sum 0, the second derivative
# of W along n is 4 W' S + 4 W'' T² with S = sum l² n² and T = sum l² n; by Cauchy and Schwarz
# T² <= S (I1 - 9 / I2). So the material is stable in Drucker's sense wherever
#
#     W' > 0  and  W' + W'' (I1 - 9 / I2) > 0.
#
# Where W'' < 0 the second is the harder, and hardest where I2 is largest: at a given I1 that is
# stretch in two directions alike. Both are linear in the coefficients, so that the law whose
# largest relative error of stress is least is the solution of a linear programme.

_POINTS = 60
_FARTHEST = 10.0
"""Times the curve's largest I1 - 3, up to which stability is asked at points; farther out the
highest coefficient, which is not negative, decides. Numerical: beyond, it outweighs the others."""

_SLIGHTEST = 0.02
"""Least tangent over the stress of the curve's own. Chosen: enough that Newton's method of any
solver converges; without it the programme would go to the brink of instability."""


@dataclass(frozen=True, slots=True)
class StableYeoh:
    """C10, C20, C30 in MPa, and the largest relative error of stress against the curve."""

    coefficients_MPa: tuple[float, float, float]
    error: float

    def nominal_stress_MPa(self, stretch: FloatArray) -> FloatArray:
        """Return the stress of an incompressible tensile test."""
        y = stretch**2 + 2.0 / stretch - 3.0
        c1, c2, c3 = self.coefficients_MPa
        slope = c1 + y * (2.0 * c2 + y * 3.0 * c3)
        return np.asarray(2.0 * (stretch - stretch**-2) * slope)


def stable_yeoh(strain: FloatArray, stress_MPa: FloatArray) -> StableYeoh:
    """Fit a tensile curve.

    Parameters
    ----------
    strain, stress_MPa : (n,)
        Engineering strains above 0, and nominal stresses above 0.
    """
    from scipy.optimize import linprog

    stretch = 1.0 + np.asarray(strain, dtype=np.float64)
    y = stretch**2 + 2.0 / stretch - 3.0
    slope = stress_MPa / (2.0 * (stretch - stretch**-2))
    fit = _columns(y) / slope[:, None]
    far = float(y.max()) * np.linspace(0.0, 1.0, _POINTS + 1)[1:] ** 2 * _FARTHEST
    own = np.interp(far, y, slope)
    positive = _columns(far) / own[:, None]
    stable = positive + _curvatures(far) * _reach(far)[:, None] / own[:, None]
    one, n = np.ones((len(y), 1)), len(far)
    found = linprog(
        [0.0, 0.0, 0.0, 1.0],
        A_ub=np.vstack(
            [
                np.hstack([fit, -one]),
                np.hstack([-fit, -one]),
                np.hstack([-positive, np.zeros((n, 1))]),
                np.hstack([-stable, np.zeros((n, 1))]),
            ]
        ),
        b_ub=np.concatenate([np.ones(len(y)), -np.ones(len(y)), np.full(2 * n, -_SLIGHTEST)]),
        bounds=[(0.0, None), (None, None), (0.0, None), (0.0, None)],
    )
    c1, c2, c3, error = np.asarray(found.x).tolist()
    return StableYeoh((c1, c2, c3), error)


def _columns(y: FloatArray) -> FloatArray:
    """Return W' of each coefficient alone."""
    return np.stack([np.ones_like(y), 2.0 * y, 3.0 * y * y], axis=1)


def _curvatures(y: FloatArray) -> FloatArray:
    """Return W'' of each coefficient alone."""
    return np.stack([np.zeros_like(y), np.full_like(y, 2.0), 6.0 * y], axis=1)


def _reach(y: FloatArray) -> FloatArray:
    """Return I1 - 9 / I2 at I1 = 3 + y of a sheet stretched in two directions alike."""
    stretch = np.geomspace(1.0, 1.0 + np.sqrt(3.0 + float(y.max())), 4001)
    first = 2.0 * stretch**2 + stretch**-4 - 3.0
    return 3.0 + y - 9.0 / np.interp(y, first, stretch**4 + 2.0 * stretch**-2)
