"""Algorithm 1 of Hemleben's thesis: a law's coefficients as quadratics of the material index."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from planner.errors import ArgumentError
from planner.numerics import FloatArray
from printers.connex3.thesis import literal_stress_MPa

__all__ = [
    "LiteralCurve",
    "QuadraticCoefficients",
    "QuadraticFit",
    "algorithm_one",
    "pooled_squared_error_MPa2",
    "quadratics_through",
]


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
# Algorithm 1 of Hemleben's thesis: quadratics in the coordinate, fitted to all curves at once.
#
# Kept to reproduce the source and to be compared with; planning uses
# `planner.materials.mixtures`.


_LN2 = math.log(2.0)


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
    return _pooled(curves)(np.array(model.rows).ravel())


def algorithm_one(curves: Sequence[LiteralCurve], start: QuadraticCoefficients) -> QuadraticFit:
    """Lower the pooled squared error from `start` as the thesis does (lines 6 and 7).

    Nelder and Mead's simplex over the 18 numbers with the defaults of Matlab's fminsearch, which
    are scipy's too: a first simplex 5 % wide, tolerances of 1e-4 on numbers and error, at most
    200 evaluations and iterations a number. It is a local search that usually ends at that limit.

    Raises
    ------
    ArgumentError
        Fewer than three different coordinates, or the error at `start` is not finite.
    """
    from scipy.optimize import minimize

    _check_coordinates(np.array([curve.coordinate for curve in curves]))
    error = _pooled(curves)
    first = np.array(start.rows).ravel()
    if not math.isfinite(error(first)):
        raise ArgumentError("the pooled error at the start is not finite; give another start")
    limit = 200 * first.size
    found = minimize(
        error,
        first,
        method="Nelder-Mead",
        options={"xatol": 1e-4, "fatol": 1e-4, "maxiter": limit, "maxfev": limit},
    )
    return QuadraticFit(
        model=_model(found.x.reshape(6, 3)),
        squared_error_MPa2=float(found.fun),
        evaluations=int(found.nfev),
        converged=bool(found.success),
    )


def _pooled(curves: Sequence[LiteralCurve]) -> Callable[[FloatArray], float]:
    """Return the pooled squared error as a function of the 18 numbers.

    The powers of eq. 3.8 are taken as exponentials of logarithms found once, for speed.
    """
    powers = np.vander([curve.coordinate for curve in curves], 3)
    which = np.repeat(np.arange(len(curves)), [len(curve.strain) for curve in curves])
    measured = np.concatenate([curve.stress_MPa for curve in curves])
    up = np.log(np.concatenate([curve.strain for curve in curves]))
    down = _LN2 - up / 2.0

    def error(numbers: FloatArray) -> float:
        c = (powers @ numbers.reshape(6, 3).T)[which].T
        residual = -measured
        # A simplex may stray to where a power overflows: an infinite error, which it leaves.
        with np.errstate(over="ignore", invalid="ignore"):
            for factor, exponent in (c[0:2], c[2:4], c[4:6]):
                bracket = np.exp(exponent * up) - 0.5 * np.exp(exponent * down)
                residual = residual + factor * bracket
            total = float(residual @ residual)
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
