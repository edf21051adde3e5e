"""Algorithm 1 of Hemleben's thesis: a law's coefficients as quadratics of the material index."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from planner.errors import ArgumentError, PaletteError
from planner.glance import brief
from planner.materials.fit import MaterialFit, sample_of
from planner.materials.laws import make_law
from planner.materials.mixtures import CoefficientModel, interpolated
from planner.numerics import FloatArray, students_t
from planner.palette import Material, Palette

__all__ = [
    "LiteralCurve",
    "QuadraticCoefficients",
    "QuadraticStudy",
    "algorithm_one",
    "literal_stress_MPa",
    "mixtures_without",
    "normalised_rmse",
    "quadratic_study",
    "quadratics_through",
    "without",
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


@dataclass(frozen=True, slots=True, eq=False)
class QuadraticCoefficients:
    """c_j(m) = q2 m² + q1 m + q0 for the six coefficients of eq. 3.8.

    Parameters
    ----------
    rows : (6, 3)
        (q2, q1, q0) of c1 to c6.
    """

    rows: FloatArray

    def coefficients(self, coordinate: ArrayLike) -> FloatArray:
        """Return c1 to c6 along the last axis."""
        m = np.asarray(coordinate, dtype=np.float64)[..., np.newaxis]
        return np.asarray(np.polyval(np.array(self.rows).T, m))

    def literal_stress_MPa(self, coordinate: ArrayLike, strain: ArrayLike) -> FloatArray:
        """Return the stress as printed, at strains above 0 that broadcast with `coordinate`."""
        return literal_stress_MPa(self.coefficients(coordinate), strain)


# ------------------------------------------------------------------------------------------------
# Algorithm 1 of Hemleben's thesis: each material's coefficients (lines 1 to 3), their quadratics in
# the coordinate (4 and 5), and these fitted to all curves at once (6 and 7).
#
# Kept to reproduce the source and to be compared with; planning uses
# `planner.materials.mixtures`.


_START = (0.0788, -0.0216, 1.9908, 0.6354, 1.6999, -0.2853)
"""c1 to c6 that lines 1 to 3 start from: the medians of the thesis' Table 3.2, whose own start is
not printed."""


@dataclass(frozen=True, slots=True)
class LiteralCurve:
    """One material's curve over the range in which eq. 3.8 is taken to hold.

    Parameters
    ----------
    coordinate
        On the palette, m.
    strain, stress_MPa
        Engineering strain above 0, at which eq. 3.8 diverges, and nominal stress.
    """

    coordinate: float
    strain: FloatArray
    stress_MPa: FloatArray


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
    """

    c: tuple[float, ...]
    half: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class QuadraticFit:
    """What Algorithm 1 came to.

    Attributes
    ----------
    squared_error_MPa2
        Sum over all points of all curves, unweighted, of `model`.
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
        half = students_t(level, freedom + 1) * np.sqrt(found.fun / freedom * inverse)
    return LiteralFit(tuple(found.x.tolist()), tuple(half.tolist()))


def _slopes(c: FloatArray, strain: FloatArray) -> FloatArray:
    """Return the derivatives of eq. 3.8 by its six coefficients, a row a strain."""
    columns = []
    with np.errstate(over="ignore", invalid="ignore"):
        for factor, exponent in c.reshape(3, 2):
            up, down = strain**exponent, 0.5 * (4.0 / strain) ** (exponent / 2.0)
            by_exponent = np.log(strain) * up - 0.5 * np.log(4.0 / strain) * down
            columns += [up - down, factor * by_exponent]
    return np.stack(columns, axis=1)


def quadratics_through(coordinates: ArrayLike, coefficients: ArrayLike) -> QuadraticCoefficients:
    """Return the least-squares quadratic of each coefficient (lines 4 and 5).

    Parameters
    ----------
    coordinates
        m of the materials: n of them, three different ones at least.
    coefficients
        c1 to c6 of each, shape (n, 6).
    """
    m = np.asarray(coordinates, dtype=np.float64)
    rows = np.linalg.lstsq(np.vander(m, 3), np.asarray(coefficients), rcond=None)[0].T
    return QuadraticCoefficients(rows)


def algorithm_one(curves: Sequence[LiteralCurve], start: QuadraticCoefficients) -> QuadraticFit:
    """Lower the pooled squared error from `start` as the thesis does (lines 6 and 7).

    The simplex over the 18 numbers is a local search that usually ends at its limit.

    Raises
    ------
    ArgumentError
        The error at `start` is not finite.
    """
    error = _pooled(curves, 2)
    first = np.array(start.rows).ravel()
    if not math.isfinite(error(first)):
        raise ArgumentError("the pooled error at the start is not finite; give another start")
    found = _simplex(error, first)
    model = QuadraticCoefficients(found.x.reshape(6, 3))
    return QuadraticFit(model, float(found.fun), int(found.nfev), bool(found.success))


def _simplex(error: Callable[[FloatArray], float], first: FloatArray) -> Any:
    """Search as Matlab's fminsearch does, whose defaults are scipy's too.

    Nelder and Mead's: a first simplex 5 % wide, tolerances of 1e-4 on numbers and error, at most
    200 evaluations and iterations a number.
    """
    from scipy.optimize import minimize

    limit = 200 * first.size
    # So many steps part from the last bit on, in which processors differ.
    start = np.array([float(f"{number:.9g}") for number in first])
    limits: Any = {"xatol": 1e-4, "fatol": 1e-4, "maxiter": limit, "maxfev": limit}
    return minimize(error, start, method="Nelder-Mead", options=limits)


def _pooled(curves: Sequence[LiteralCurve], degree: int) -> Callable[[FloatArray], float]:
    """Return the pooled squared error as a function of the numbers of six polynomials in m.

    The powers of eq. 3.8 are taken as exponentials of logarithms found once, for speed.
    """
    powers = np.vander([curve.coordinate for curve in curves], degree + 1)
    which = np.repeat(np.arange(len(curves)), [len(curve.strain) for curve in curves])
    measured = np.concatenate([curve.stress_MPa for curve in curves])
    up = np.log(np.concatenate([curve.strain for curve in curves]))
    down = math.log(2.0) - up / 2.0

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


# ------------------------------------------------------------------------------------------------
# Algorithm 1 whole, on the tests that the palette was fitted to: its elastic materials, whose
# curves are taken from the end of their slack to their largest stress, as for the palette's laws.
# What it comes to is held against the palette's laws and against `CoefficientModel`.


_NEAR_REST = 1e-3
"""Strain at which stress near rest is told: below what a crosshead resolves, above where eq. 3.8
is no number."""

_POINTS = 201
_FEWEST = 3
"""Different coordinates that a quadratic needs."""


@dataclass(frozen=True, slots=True)
class Errors:
    """How a prediction compares with a material's points.

    Attributes
    ----------
    r2
        As in the thesis' Table 4.1; below 0 a constant is better.
    nrmse
        Root mean square error over the largest stress.
    """

    r2: float
    nrmse: float


@dataclass(frozen=True, slots=True, eq=False)
class QuadraticRow:
    """One elastic material in both ways.

    Attributes
    ----------
    curve
        The points of all its specimens.
    fit
        Eq. 3.8 by itself (lines 1 to 3).
    errors
        Of eq. 3.8 fitted to the material (``own``), of the quadratics of all materials (line 7,
        ``quadratics``) and of the palette's ``law``; and of what is made of the other materials
        alone: Algorithm 1's lines 4 to 7 (``quadratics_without``), and the palette's mixtures
        (``mixtures_without``). None at an end of the ladder, or where too few are left.
    model_without
        The quadratics of the others.
    near_rest_MPa, law_near_rest_MPa
        Stress of the quadratics and of the law at a strain of a thousandth.
    """

    id: str
    curve: LiteralCurve
    fit: LiteralFit
    errors: Mapping[str, Errors | None]
    model_without: QuadraticCoefficients | None
    near_rest_MPa: float
    law_near_rest_MPa: float


@dataclass(frozen=True, slots=True, eq=False)
class QuadraticStudy:
    """What Algorithm 1 makes of a study.

    Attributes
    ----------
    rows
        The elastic materials from soft to hard.
    through
        The quadratics of the coefficients themselves (line 5).
    quadratics
        Those fitted to all curves (line 7).
    falls_at
        Coordinate and strain where the quadratics' stress first falls from softer to harder; None
        where it rises everywhere between the materials, at strains that all were tested to.
    """

    rows: tuple[QuadraticRow, ...]
    through: QuadraticCoefficients
    quadratics: QuadraticFit
    falls_at: tuple[float, float] | None

    __repr__ = brief

    def remarks(self) -> Iterator[str]:
        """Say what the comparison shows, one sentence each."""
        yield self._without()
        worst = max(self.rows, key=lambda row: abs(row.near_rest_MPa - row.law_near_rest_MPa))
        yield (
            f"at rest the quadratics are not free of stress: at strain {_NEAR_REST:g} they give "
            f"{worst.id} {worst.near_rest_MPa:.3g} MPa, the palette's law "
            f"{worst.law_near_rest_MPa:.3g} MPa (eq. 3.8 was fitted from strain "
            f"{worst.curve.strain.min():.2g} on)"
        )
        if self.falls_at is not None:
            m, strain = self.falls_at
            yield (
                f"the quadratics' stress falls where the material gets harder: first at m {m:.3g}, "
                f"strain {strain:.3g}"
            )
        if not self.quadratics.converged:
            yield (
                f"Algorithm 1 stops at its limit of {self.quadratics.evaluations} evaluations, not "
                "at a minimum"
            )

    def _without(self) -> str:
        what = "a material left out and predicted by the others"
        kinds = ("quadratics_without", "mixtures_without")
        pairs = [[row.errors[kind] for kind in kinds] for row in self.rows]
        both = [(one.nrmse, other.nrmse) for one, other in pairs if one and other]
        if not (errors := [one.nrmse for one, _ in pairs if one]):
            return f"{what}: not known, that takes {_FEWEST + 1} elastic materials"
        own, *mixtures = 100.0 * np.mean(both, axis=0) if both else [100 * np.mean(errors)]
        off = f"{what}: quadratics {own:.2g} % of its largest stress off"
        if mixtures:
            return f"{off}, planner's mixtures {mixtures[0]:.2g} % (mean of {len(both)})"
        return f"{off}; planner makes no mixtures of the others, whose laws cross"

    def document(self) -> dict[str, Any]:
        """Return the comparison as plain values."""
        found = asdict(self.quadratics)
        return {
            "materials": [_row_document(row) for row in self.rows],
            "quadratics_through_coefficients": self.through.rows.tolist(),
            "quadratics": found.pop("model")["rows"].tolist(),
            **found,
            "falls_at": self.falls_at
            and dict(zip(("coordinate", "strain"), self.falls_at, strict=True)),
            "remarks": list(self.remarks()),
        }


def _row_document(row: QuadraticRow) -> dict[str, Any]:
    ends = list(zip(row.fit.c, row.fit.half, strict=True))
    return {
        "id": row.id,
        "coordinate": row.curve.coordinate,
        "strain": [float(row.curve.strain.min()), float(row.curve.strain.max())],
        "coefficients": list(row.fit.c),
        "coefficients_low": [_known(c - half) for c, half in ends],
        "coefficients_high": [_known(c + half) for c, half in ends],
        "r2": {kind: one and _known(one.r2) for kind, one in row.errors.items()},
        "nrmse": {kind: one and _known(one.nrmse) for kind, one in row.errors.items()},
        "near_rest_MPa": _known(row.near_rest_MPa),
        "law_near_rest_MPa": row.law_near_rest_MPa,
    }


def _known(value: float) -> float | None:
    """Return a figure as JSON holds it: what overflowed, or is not determined, is null."""
    return value if math.isfinite(value) else None


def quadratic_study(
    palette: Palette, fits: Mapping[str, MaterialFit], level: float = 0.95
) -> QuadraticStudy:
    """Run Algorithm 1 on the curves that a palette's elastic materials were fitted to.

    Parameters
    ----------
    fits
        By material id.
    level
        Coverage of the coefficients' intervals.

    Raises
    ------
    ArgumentError
        Fewer than three elastic materials that were pulled.
    """
    pulled = [m for m in palette.materials if not fits[m.id].compressed]
    elastic = [m for m in pulled if m.deformation == "elastic"]
    if len(elastic) < _FEWEST:
        names = ", ".join(m.id for m in elastic) or "none"
        raise ArgumentError(
            f"`coefficients` quadratic: that needs {_FEWEST} elastic materials at least; the tests "
            f"have {len(elastic)} in tension ({names})"
        )
    curves = [_curve(m, fits[m.id]) for m in elastic]
    single = [individual_fit(curve, level) for curve in curves]
    through = quadratics_through([c.coordinate for c in curves], [fit.c for fit in single])
    found = algorithm_one(curves, through)
    rows = []
    for k, (material, curve, fit) in enumerate(zip(elastic, curves, single, strict=True)):
        model, others = found.model, _model_without(curves, single, k)
        law, mixed = make_law(material.law), mixtures_without(palette, material)
        m, x = curve.coordinate, curve.strain
        predicted = {
            "own": literal_stress_MPa(fit.c, x),
            "quadratics": model.literal_stress_MPa(m, x),
            "law": law.nominal_stress_MPa(1.0 + x),
            "quadratics_without": None if others is None else others.literal_stress_MPa(m, x),
            "mixtures_without": None if mixed is None else mixed.nominal_stress_MPa(m, 1.0 + x),
        }
        errors = {way: None if p is None else _errors(curve, p) for way, p in predicted.items()}
        rest = float(model.literal_stress_MPa(m, _NEAR_REST))
        law_rest = float(law.nominal_stress_MPa(1.0 + _NEAR_REST))
        rows.append(QuadraticRow(material.id, curve, fit, errors, others, rest, law_rest))
    return QuadraticStudy(tuple(rows), through, found, _falls_at(found.model, curves))


def _curve(material: Material, fit: MaterialFit) -> LiteralCurve:
    sample = sample_of(fit.curves)
    return LiteralCurve(material.coordinate, sample.stretch - 1.0, sample.stress_MPa)


def _errors(curve: LiteralCurve, predicted: FloatArray) -> Errors:
    measured = curve.stress_MPa
    # Powers of eq. 3.8 may overflow where it was not fitted: an infinite error says so.
    with np.errstate(over="ignore", invalid="ignore"):
        return Errors(r_squared(measured, predicted), normalised_rmse(measured, predicted))


def _model_without(
    curves: Sequence[LiteralCurve], fits: Sequence[LiteralFit], out: int
) -> QuadraticCoefficients | None:
    """Return lines 4 to 7 without a material between others, if enough are left to begin at."""
    if out in (0, len(curves) - 1) or len(curves) <= _FEWEST:
        return None
    kept = [curve for k, curve in enumerate(curves) if k != out]
    own = [fit.c for k, fit in enumerate(fits) if k != out]
    with suppress(ArgumentError):
        return algorithm_one(kept, quadratics_through([c.coordinate for c in kept], own)).model
    return None


def mixtures_without(palette: Palette, material: Material) -> CoefficientModel | None:
    """Return the mixtures without a material; None at an end, or where the others' laws cross."""
    if material in (palette.materials[0], palette.materials[-1]):
        return None
    with suppress(PaletteError):
        return without(palette, material.id)
    return None


def _falls_at(
    model: QuadraticCoefficients, curves: Sequence[LiteralCurve]
) -> tuple[float, float] | None:
    m = np.linspace(curves[0].coordinate, curves[-1].coordinate, _POINTS)
    first = max(float(c.strain.min()) for c in curves)
    strain = np.linspace(first, min(float(c.strain.max()) for c in curves), _POINTS)
    falls = np.diff(model.literal_stress_MPa(m[:, np.newaxis], strain), axis=0) <= 0.0
    if not falls.any():
        return None
    at, when = np.argwhere(falls)[0].tolist()
    return float(m[at]), float(strain[when])


def without(palette: Palette, material: str) -> CoefficientModel:
    """Return the coefficient model of a palette without one material."""
    kept = tuple(m for m in palette.materials if m.id != material)
    return CoefficientModel(replace(interpolated(palette), materials=kept), chosen=True)


def normalised_rmse(measured: FloatArray, predicted: FloatArray) -> float:
    """Return the root mean square error over the largest measured value."""
    return float(np.sqrt(np.mean((predicted - measured) ** 2)) / np.max(measured))


def r_squared(measured: FloatArray, predicted: FloatArray) -> float:
    """Return 1 - Σ(measured - predicted)² / Σ(measured - mean)²; below 0 a constant is better."""
    scatter = np.sum((measured - measured.mean()) ** 2)
    return float(1.0 - np.sum((measured - predicted) ** 2) / scatter)
