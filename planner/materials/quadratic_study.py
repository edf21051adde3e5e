"""The thesis' coefficient model on a study's own tests, beside the palette's mixtures."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from planner.errors import ArgumentError, PaletteError
from planner.glance import brief
from planner.materials.algorithm_one import (
    LiteralCurve,
    LiteralFit,
    QuadraticCoefficients,
    QuadraticFit,
    algorithm_one,
    individual_fit,
    literal_stress_MPa,
    pooled_squared_error_MPa2,
    quadratics_through,
)
from planner.materials.fit import sample_of
from planner.materials.fit_intervals import MaterialFit
from planner.materials.laws import make_law
from planner.materials.mixtures import CoefficientModel, interpolated
from planner.numerics import FloatArray
from planner.palette import Material, Palette

__all__ = [
    "QuadraticRow",
    "QuadraticStudy",
    "mixtures_without",
    "normalised_rmse",
    "quadratic_study",
    "r_squared",
    "without",
]


# ------------------------------------------------------------------------------------------------
# Algorithm 1 whole, on the tests that the palette was fitted to: its elastic materials, whose
# curves are taken from the end of their slack to their largest stress, as for the palette's laws.
# What it comes to is held against the palette's laws and against `CoefficientModel`.


_NEAR_REST = 1e-3
"""Strain at which stress near rest is told: below what a crosshead resolves, above where eq. 3.8
is no number."""

_PLACES = 201
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
    own, quadratics, law
        Errors of eq. 3.8 fitted to the material, of the quadratics of all materials (line 7), and
        of the palette's law.
    quadratics_without, mixtures_without
        Errors of what is made of the other materials alone: Algorithm 1's lines 4 to 7, and the
        palette's mixtures. None at an end of the ladder, or where too few are left.
    model_without
        The quadratics of the others.
    near_rest_MPa, law_near_rest_MPa
        Stress of the quadratics and of the law at a strain of a thousandth.
    """

    id: str
    curve: LiteralCurve
    fit: LiteralFit
    own: Errors
    quadratics: Errors
    law: Errors
    quadratics_without: Errors | None
    mixtures_without: Errors | None
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

    def mean_without(self) -> tuple[float, float, int] | None:
        """Return mean errors, over materials left out, of quadratics and mixtures, and how many.

        Over the materials that both predict; None where there is none.
        """
        both = [
            (row.quadratics_without.nrmse, row.mixtures_without.nrmse)
            for row in self.rows
            if row.quadratics_without is not None and row.mixtures_without is not None
        ]
        if not both:
            return None
        quadratics, mixtures = np.mean(both, axis=0).tolist()
        return quadratics, mixtures, len(both)

    def remarks(self) -> tuple[str, ...]:
        """Return what the comparison shows, one sentence each."""
        said = [self._without()]
        worst = max(self.rows, key=lambda row: abs(row.near_rest_MPa - row.law_near_rest_MPa))
        said.append(
            f"at rest the quadratics are not free of stress: at strain {_NEAR_REST:g} they give "
            f"{worst.id} {worst.near_rest_MPa:.3g} MPa, the palette's law "
            f"{worst.law_near_rest_MPa:.3g} MPa (eq. 3.8 was fitted from strain "
            f"{worst.curve.strain.min():.2g} on)"
        )
        if self.falls_at is not None:
            m, strain = self.falls_at
            said.append(
                f"the quadratics' stress falls where the material gets harder: first at m {m:.3g}, "
                f"strain {strain:.3g}"
            )
        if not self.quadratics.converged:
            said.append(
                f"Algorithm 1 stops at its limit of {self.quadratics.evaluations} evaluations, not "
                "at a minimum"
            )
        return tuple(said)

    def _without(self) -> str:
        what = "a material left out and predicted by the others"
        mean = self.mean_without()
        if mean is not None:
            quadratics, mixtures, count = mean
            return (
                f"{what}: quadratics {100 * quadratics:.2g} % of its largest stress off, planner's "
                f"mixtures {100 * mixtures:.2g} % (mean of {count})"
            )
        errors = [r.quadratics_without.nrmse for r in self.rows if r.quadratics_without is not None]
        if not errors:
            return f"{what}: not known, that takes {_FEWEST + 1} elastic materials"
        return (
            f"{what}: quadratics {100 * float(np.mean(errors)):.2g} % of its largest stress off; "
            "planner makes no mixtures of the others, whose laws cross"
        )

    def document(self) -> dict[str, Any]:
        """Return the comparison as plain values."""
        return {
            "materials": [_row_document(row) for row in self.rows],
            "quadratics_through_coefficients": [list(row) for row in self.through.rows],
            "quadratics": [list(row) for row in self.quadratics.model.rows],
            "squared_error_MPa2": self.quadratics.squared_error_MPa2,
            "evaluations": self.quadratics.evaluations,
            "converged": self.quadratics.converged,
            "falls_at": self.falls_at
            and {"coordinate": self.falls_at[0], "strain": self.falls_at[1]},
            "remarks": list(self.remarks()),
        }


def _row_document(row: QuadraticRow) -> dict[str, Any]:
    kinds = ("own", "quadratics", "law", "quadratics_without", "mixtures_without")
    errors: dict[str, Errors | None] = {kind: getattr(row, kind) for kind in kinds}
    ends = list(zip(row.fit.c, row.fit.half, strict=True))
    return {
        "id": row.id,
        "coordinate": row.curve.coordinate,
        "strain": [float(row.curve.strain.min()), float(row.curve.strain.max())],
        "coefficients": list(row.fit.c),
        "coefficients_low": [_known(c - half) for c, half in ends],
        "coefficients_high": [_known(c + half) for c, half in ends],
        "r2": {kind: one and _known(one.r2) for kind, one in errors.items()},
        "nrmse": {kind: one and _known(one.nrmse) for kind, one in errors.items()},
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
        Fewer than three elastic materials.
    """
    elastic = [m for m in palette.materials if m.deformation == "elastic"]
    if len(elastic) < _FEWEST:
        names = ", ".join(m.id for m in elastic) or "none"
        raise ArgumentError(
            f"`coefficients` quadratic: that needs {_FEWEST} elastic materials at least; the tests "
            f"have {len(elastic)} ({names})"
        )
    curves = [_curve(m, fits[m.id]) for m in elastic]
    single = [individual_fit(curve, level) for curve in curves]
    through = quadratics_through([c.coordinate for c in curves], [fit.c for fit in single])
    found = algorithm_one(curves, through)
    rows = []
    for place, (material, curve, fit) in enumerate(zip(elastic, curves, single, strict=True)):
        model, others = found.model, _model_without(curves, single, place)
        law = make_law(material.law)
        rows.append(
            QuadraticRow(
                id=material.id,
                curve=curve,
                fit=fit,
                own=_errors(curve, literal_stress_MPa(fit.c, curve.strain)),
                quadratics=_errors(curve, model.literal_stress_MPa(curve.coordinate, curve.strain)),
                law=_errors(curve, law.nominal_stress_MPa(1.0 + curve.strain)),
                quadratics_without=None
                if others is None
                else _errors(curve, others.literal_stress_MPa(curve.coordinate, curve.strain)),
                mixtures_without=_mixtures_without(palette, material, curve),
                model_without=others,
                near_rest_MPa=float(model.literal_stress_MPa(curve.coordinate, _NEAR_REST)),
                law_near_rest_MPa=float(law.nominal_stress_MPa(1.0 + _NEAR_REST)),
            )
        )
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
    curves: Sequence[LiteralCurve], fits: Sequence[LiteralFit], place: int
) -> QuadraticCoefficients | None:
    """Return lines 4 to 7 without a material between others; None if they begin at no number."""
    others = [k for k in range(len(curves)) if k != place]
    if place in (0, len(curves) - 1) or len(others) < _FEWEST:
        return None
    kept = [curves[k] for k in others]
    start = quadratics_through([c.coordinate for c in kept], [fits[k].c for k in others])
    if not math.isfinite(pooled_squared_error_MPa2(start, kept)):
        return None
    return algorithm_one(kept, start).model


def _mixtures_without(palette: Palette, material: Material, curve: LiteralCurve) -> Errors | None:
    """Return the errors of the mixtures of a palette without one of its inner materials."""
    model = mixtures_without(palette, material)
    if model is None:
        return None
    return _errors(curve, model.nominal_stress_MPa(material.coordinate, 1.0 + curve.strain))


def mixtures_without(palette: Palette, material: Material) -> CoefficientModel | None:
    """Return the mixtures without a material; None at an end, or where the others' laws cross."""
    if material in (palette.materials[0], palette.materials[-1]):
        return None
    try:
        return without(palette, material.id)
    except PaletteError:
        return None


def _falls_at(
    model: QuadraticCoefficients, curves: Sequence[LiteralCurve]
) -> tuple[float, float] | None:
    m = np.linspace(curves[0].coordinate, curves[-1].coordinate, _PLACES)
    strain = np.linspace(
        max(float(c.strain.min()) for c in curves),
        min(float(c.strain.max()) for c in curves),
        _PLACES,
    )
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
