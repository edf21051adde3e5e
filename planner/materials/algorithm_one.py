"""Algorithm 1 of Hemleben's thesis: a law's coefficients as quadratics of the material index."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from planner.errors import ArgumentError
from planner.numerics import FloatArray

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

__all__ = [
    "LiteralCurve",
    "LiteralFit",
    "QuadraticCoefficients",
    "QuadraticFit",
    "algorithm_one",
    "individual_fit",
    "literal_stress_MPa",
    "pooled_squared_error_MPa2",
    "quadratics_through",
]


# ------------------------------------------------------------------------------------------------
# Eq. 3.8: P = Σ c_i (x^c_j - 2^(c_j-1) x^(-c_j/2)), (i, j) = (1, 2), (3, 4), (5, 6), x the strain.
#
# From S. Hemleben, Modeling a Spectrum of 3D Printed Materials for Soft Robots, Oregon State
# University, 2017. What the thesis calls λ is the engineering strain x = stretch - 1, and the
# factor 2^(c-1) comes of (2/√λ)^c in place of 2 (1/√λ)^c in the energy. Hence the stress neither
# vanishes nor stays finite at rest; palettes tell the strains between which it holds.


def literal_stress_MPa(c: ArrayLike, strain: ArrayLike) -> FloatArray:
    """Return eq. 3.8 at strains above 0, wherever they are; infinite where a power overflows.

    Parameters
    ----------
    c
        Six coefficients along the last axis; the other axes broadcast with `strain`.
    """
    c = np.asarray(c, dtype=np.float64)
    x = np.asarray(strain, dtype=np.float64)
    stress: FloatArray = np.zeros(np.broadcast_shapes(c.shape[:-1], x.shape))
    with np.errstate(over="ignore", invalid="ignore"):
        for i in (0, 2, 4):
            a, b = c[..., i], c[..., i + 1]
            stress = stress + a * (x**b - 2.0 ** (b - 1.0) * x ** (-b / 2.0))
    return stress


# ------------------------------------------------------------------------------------------------
# The thesis' coefficient model: each coefficient of eq. 3.8 a quadratic in the coordinate.
#
# Kept to reproduce the source; planning uses `planner.materials.mixtures`.


@dataclass(frozen=True, slots=True)
class QuadraticCoefficients:
    """c_j(m) = q2 m² + q1 m + q0 for the six coefficients of `OgdenThesis`.

    Parameters
    ----------
    rows
        (q2, q1, q0) of c1 to c6.
    """

    rows: tuple[tuple[float, float, float], ...]

    def coefficients(self, coordinate: ArrayLike) -> FloatArray:
        """Return c1 to c6 along the last axis."""
        m = np.asarray(coordinate, dtype=np.float64)[..., np.newaxis]
        q2, q1, q0 = np.array(self.rows).T
        return np.asarray((q2 * m + q1) * m + q0)

    def literal_stress_MPa(self, coordinate: ArrayLike, strain: ArrayLike) -> FloatArray:
        """Return the stress as printed, at strains above 0 that broadcast with `coordinate`."""
        return literal_stress_MPa(self.coefficients(coordinate), strain)


# ------------------------------------------------------------------------------------------------
# Algorithm 1 of Hemleben's thesis: each material's coefficients (lines 1 to 3), their quadratics in
# the coordinate (4 and 5), and these fitted to all curves at once (6 and 7).
#
# Kept to reproduce the source and to be compared with; planning uses
# `planner.materials.mixtures`.


_LN2 = math.log(2.0)

_START = (0.0788, -0.0216, 1.9908, 0.6354, 1.6999, -0.2853)
"""c1 to c6 that lines 1 to 3 start from: the medians of the thesis' Table 3.2, whose own start is
not printed."""


@dataclass(frozen=True, slots=True)
class LiteralCurve:
    """One material's curve over the range in which eq. 3.8 is taken to hold.

    Parameters
    ----------
    coordinate
        Place on the palette, m.
    strain, stress_MPa
        Engineering strain, above 0, and nominal stress.

    Raises
    ------
    ArgumentError
        The arrays are empty, differ in length or hold what is not finite, or a strain is not
        above 0.
    """

    coordinate: float
    strain: FloatArray
    stress_MPa: FloatArray

    def __post_init__(self) -> None:
        shapes = (np.shape(self.strain), np.shape(self.stress_MPa))
        if len(set(shapes)) > 1 or len(shapes[0]) != 1 or shapes[0][0] == 0:
            raise ArgumentError(
                f"curve at coordinate {self.coordinate:g}: strain and stress have shapes "
                f"{shapes[0]} and {shapes[1]}; give two rows of one length, not empty"
            )
        if not np.isfinite(np.hstack([self.coordinate, self.strain, self.stress_MPa])).all():
            raise ArgumentError(
                f"curve at coordinate {self.coordinate:g}: a value is not finite; take it out"
            )
        if np.min(self.strain) <= 0.0:
            raise ArgumentError(
                f"curve at coordinate {self.coordinate:g}: strain {np.min(self.strain):g}; "
                "eq. 3.8 diverges at rest, so give strains above 0 only"
            )


@dataclass(frozen=True, slots=True)
class LiteralFit:
    """Eq. 3.8 fitted to one material.

    Attributes
    ----------
    c
        c1 to c6.
    half
        Half of each coefficient's interval, as Matlab's confint has it: from the slopes at the
        fit, points taken as independent. Hence too narrow for another specimen, and as wide as it
        likes where terms stand in for one another.
    squared_error_MPa2
        Sum of squared stress errors.
    evaluations, converged
        As in `QuadraticFit`, of the simplex (line 3).
    """

    c: tuple[float, ...]
    half: tuple[float, ...]
    squared_error_MPa2: float
    evaluations: int
    converged: bool


@dataclass(frozen=True, slots=True)
class QuadraticFit:
    """What Algorithm 1 came to.

    Attributes
    ----------
    squared_error_MPa2
        `pooled_squared_error_MPa2` of `model`.
    evaluations
        How often the error was computed.
    converged
        Whether the search met its tolerances before its limits.
    """

    model: QuadraticCoefficients
    squared_error_MPa2: float
    evaluations: int
    converged: bool


def individual_fit(curve: LiteralCurve, level: float = 0.95) -> LiteralFit:
    """Fit eq. 3.8 to one material as the thesis does (lines 1 to 3).

    Levenberg and Marquardt's method first, with the limits of Matlab's curve fitting (tolerances
    of 1e-6, 600 evaluations), then the simplex on the sum of squared errors, both unweighted. All
    materials start alike but for their size of stress: three terms stand in for one another, and
    coefficients of terms in another order would have no course in m.

    Raises
    ------
    ArgumentError
        The curve has no more points than coefficients.
    """
    from scipy.optimize import least_squares
    from scipy.stats import t as student

    freedom = len(curve.strain) - 6
    if freedom < 1:
        raise ArgumentError(
            f"curve at coordinate {curve.coordinate:g}: {len(curve.strain)} points do not "
            "determine the six coefficients of eq. 3.8; give more"
        )

    start = np.array(_START)
    shape = literal_stress_MPa(start, curve.strain)
    # sums, as dot products end in bits that differ between processors
    start[::2] *= float(np.sum(shape * curve.stress_MPa)) / float(np.sum(shape * shape))

    def residuals(c: FloatArray) -> FloatArray:
        # Large numbers in place of infinite ones, which the method turns back from.
        return np.nan_to_num(literal_stress_MPa(c, curve.strain) - curve.stress_MPa)

    fitted = least_squares(residuals, start, method="lm", ftol=1e-6, xtol=1e-6, max_nfev=600)
    found = _simplex(_pooled([curve], 0), fitted.x)
    slopes = _slopes(found.x, curve.strain)
    half = np.full(6, np.inf)
    if np.isfinite(slopes).all():
        inverse = np.maximum(np.diag(np.linalg.pinv(slopes.T @ slopes)), 0.0)
        half = float(student.ppf(0.5 + level / 2.0, freedom)) * np.sqrt(
            found.fun / freedom * inverse
        )
    return LiteralFit(
        c=tuple(float(v) for v in found.x),
        half=tuple(float(v) for v in half),
        squared_error_MPa2=float(found.fun),
        evaluations=int(found.nfev),
        converged=bool(found.success),
    )


def _slopes(c: FloatArray, strain: FloatArray) -> FloatArray:
    """Return the derivatives of eq. 3.8 by its six coefficients, a row a strain."""
    columns = []
    with np.errstate(over="ignore", invalid="ignore"):
        for factor, exponent in c.reshape(3, 2):
            up, down = strain**exponent, 0.5 * (4.0 / strain) ** (exponent / 2.0)
            columns.append(up - down)
            columns.append(factor * (np.log(strain) * up - 0.5 * np.log(4.0 / strain) * down))
    return np.stack(columns, axis=1)


def quadratics_through(coordinates: ArrayLike, coefficients: ArrayLike) -> QuadraticCoefficients:
    """Return the least-squares quadratic of each coefficient (lines 4 and 5).

    Parameters
    ----------
    coordinates
        m of the materials: n of them, three different ones at least.
    coefficients
        c1 to c6 of each, shape (n, 6).

    Raises
    ------
    ArgumentError
        Other shapes, or fewer than three coordinates.
    """
    m = np.asarray(coordinates, dtype=np.float64)
    c = np.asarray(coefficients, dtype=np.float64)
    if m.ndim != 1 or c.shape != (len(m), 6):
        raise ArgumentError(
            f"coordinates of shape {m.shape} and coefficients of shape {c.shape}: "
            "give n coordinates and six coefficients for each, (n, 6)"
        )
    _check_coordinates(m)
    rows = np.linalg.lstsq(np.vander(m, 3), c, rcond=None)[0].T
    return _model(np.asarray(rows, dtype=np.float64))


def pooled_squared_error_MPa2(
    model: QuadraticCoefficients, curves: Sequence[LiteralCurve]
) -> float:
    """Return the sum of squared stress errors over all points of all curves, unweighted."""
    return _pooled(curves, 2)(np.array(model.rows).ravel())


def algorithm_one(curves: Sequence[LiteralCurve], start: QuadraticCoefficients) -> QuadraticFit:
    """Lower the pooled squared error from `start` as the thesis does (lines 6 and 7).

    The simplex over the 18 numbers is a local search that usually ends at its limit.

    Raises
    ------
    ArgumentError
        Fewer than three different coordinates, or the error at `start` is not finite.
    """
    _check_coordinates(np.array([curve.coordinate for curve in curves]))
    error = _pooled(curves, 2)
    first = np.array(start.rows).ravel()
    if not math.isfinite(error(first)):
        raise ArgumentError("the pooled error at the start is not finite; give another start")
    found = _simplex(error, first)
    return QuadraticFit(
        model=_model(found.x.reshape(6, 3)),
        squared_error_MPa2=float(found.fun),
        evaluations=int(found.nfev),
        converged=bool(found.success),
    )


def _simplex(error: Callable[[FloatArray], float], first: FloatArray) -> "OptimizeResult":
    """Search as Matlab's fminsearch does, whose defaults are scipy's too.

    Nelder and Mead's: a first simplex 5 % wide, tolerances of 1e-4 on numbers and error, at most
    200 evaluations and iterations a number.
    """
    from scipy.optimize import minimize

    limit = 200 * first.size
    return minimize(
        error,
        # So many steps part from the last bit on, in which processors differ.
        np.array([float(f"{number:.9g}") for number in first]),
        method="Nelder-Mead",
        options={"xatol": 1e-4, "fatol": 1e-4, "maxiter": limit, "maxfev": limit},
    )


def _pooled(curves: Sequence[LiteralCurve], degree: int) -> Callable[[FloatArray], float]:
    """Return the pooled squared error as a function of the numbers of six polynomials in m.

    The powers of eq. 3.8 are taken as exponentials of logarithms found once, for speed.
    """
    powers = np.vander([curve.coordinate for curve in curves], degree + 1)
    which = np.repeat(np.arange(len(curves)), [len(curve.strain) for curve in curves])
    measured = np.concatenate([curve.stress_MPa for curve in curves])
    up = np.log(np.concatenate([curve.strain for curve in curves]))
    down = _LN2 - up / 2.0

    def error(numbers: FloatArray) -> float:
        c = np.einsum("km,cm->kc", powers, numbers.reshape(6, degree + 1))[which].T
        residual = -measured
        # A simplex may stray to where a power overflows: an infinite error, which it leaves.
        with np.errstate(over="ignore", invalid="ignore"):
            for factor, exponent in (c[0:2], c[2:4], c[4:6]):
                bracket = np.exp(exponent * up) - 0.5 * np.exp(exponent * down)
                residual = residual + factor * bracket
            total = float(np.square(residual).sum())
        return total if math.isfinite(total) else math.inf

    return error


def _model(rows: FloatArray) -> QuadraticCoefficients:
    return QuadraticCoefficients(tuple((float(a), float(b), float(c)) for a, b, c in rows))


def _check_coordinates(coordinates: FloatArray) -> None:
    different = len(np.unique(coordinates))
    if different < 3:
        raise ArgumentError(
            f"{different} different coordinates: a quadratic needs at least 3; add materials"
        )
