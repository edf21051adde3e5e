"""A Yeoh law nearest to a tensile curve among those that are stable up to its break."""

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
_FARTHEST = 1.1
"""Times the strain up to which stability is asked. Chosen: a solver's first guess near the break is
not lost yet; with 2 a law that goes to strain 0.3 is a third worse."""

_SLIGHTEST = 0.02
"""Least tangent over the stress of the curve's own. Chosen: enough that Newton's method of any
solver converges; without it the programme would go to the brink of instability."""

_REST = (0.98, 1.0133)
"""Between which the modulus at rest over the curve's own is held: 2 %, also where a reader of the
law takes it for incompressible, which at Poisson's ratio 0.49 adds 0.67 %."""

_BEYOND = 3.0
"""The error beyond the strain that matters may grow with this power of the strain. Chosen: the
square costs a third more error before, the fourth power gains next to nothing there."""


@dataclass(frozen=True, slots=True)
class StableYeoh:
    """C10, C20, C30 in MPa, and the largest relative error of stress up to the strain asked."""

    coefficients_MPa: tuple[float, float, float]
    error: float

    def nominal_stress_MPa(self, stretch: FloatArray) -> FloatArray:
        """Return the stress of an incompressible tensile test."""
        y = stretch**2 + 2.0 / stretch - 3.0
        c1, c2, c3 = self.coefficients_MPa
        slope = c1 + y * (2.0 * c2 + y * 3.0 * c3)
        return np.asarray(2.0 * (stretch - stretch**-2) * slope)


def stable_yeoh(
    strain: FloatArray, stress_MPa: FloatArray, modulus_MPa: float, to_strain: float
) -> StableYeoh:
    """Fit a tensile curve up to its break, nearest up to a strain.

    Parameters
    ----------
    strain, stress_MPa : (n,)
        Engineering strains, rising from above 0 to the break, and nominal stresses above 0.
    modulus_MPa
        At rest.
    to_strain
        Up to where the error is least; beyond, it may grow. Up to this stretch in two directions
        alike, and up to the break in one, the law is stable in every mode.
    """
    from scipy.optimize import linprog

    strain = np.asarray(strain, dtype=np.float64)
    y, slope = _invariant(strain), stress_MPa / (2.0 * (1.0 + strain - (1.0 + strain) ** -2))
    fit = _columns(y) / slope[:, None]
    both = 1.0 + _FARTHEST * to_strain  # a sheet stretched in two directions
    most = max(float(_invariant(_FARTHEST * strain[-1])), 2.0 * both**2 + both**-4 - 3.0)
    far = most * np.linspace(0.0, 1.0, _POINTS + 1)[1:] ** 2
    own = np.interp(far, y, slope)
    positive = _columns(far) / own[:, None]
    stable = positive + _curvatures(far) * _reach(far)[:, None] / own[:, None]
    allowed, none = np.maximum(strain / to_strain, 1.0)[:, None] ** _BEYOND, np.zeros((_POINTS, 1))
    low, high = _REST
    found = linprog(
        [0.0, 0.0, 0.0, 1.0],
        A_ub=np.vstack(
            [
                np.hstack([fit, -allowed]),
                np.hstack([-fit, -allowed]),
                np.hstack([-positive, none]),
                np.hstack([-stable, none]),
            ]
        ),
        b_ub=np.concatenate([np.ones(len(y)), -np.ones(len(y)), np.full(2 * _POINTS, -_SLIGHTEST)]),
        bounds=[
            (modulus_MPa / 6.0 * low, modulus_MPa / 6.0 * high),
            *2 * [(None, None)],
            (0, None),
        ],
    )
    c1, c2, c3, error = np.asarray(found.x).tolist()
    return StableYeoh((c1, c2, c3), error)


def _invariant(strain: FloatArray) -> FloatArray:
    """Return I1 - 3 of tensile strains."""
    return np.asarray(strain * strain * (strain + 3.0) / (1.0 + strain))


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
