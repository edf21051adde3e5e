"""Each grade predicted by the others: the thesis' coefficient model against the consistent one.

The reference is a grade's own published curve from its onset to the break, and the figure of
merit the root mean square error of the stress over that curve, divided by its largest stress.
"""

from dataclasses import dataclass, replace

import numpy as np

from planner.materials.algorithm_one import (
    LiteralCurve,
    QuadraticCoefficients,
    algorithm_one,
    literal_stress_MPa,
    normalised_rmse,
    quadratics_through,
    without,
)
from planner.materials.mixtures import CoefficientModel
from planner.numerics import FloatArray
from planner.palette import Palette
from printers.connex3.thesis import Published, Thesis
from printers.connex3.toe import correct

__all__ = [
    "HeldOut",
    "held_out",
    "literal_without",
    "published_curve",
]

STRAIN_STEP = 0.0025
"""Between points of a curve: a crosshead of constant speed, read at a constant rate."""


@dataclass(frozen=True, slots=True)
class HeldOut:
    """How far models are off a grade that took no part; each the normalised RMSE.

    The consistent model knows the nominal hardness of the grade, which is in its name, and nothing
    else of it; without the hardness it has the coordinate alone.

    Attributes
    ----------
    literal
        Algorithm 1, over crosshead strain.
    literal_toe_off
        Algorithm 1 run on curves whose toes are taken off.
    consistent
        `CoefficientModel`, toes taken off.
    consistent_crosshead
        `CoefficientModel` moved right by a toe interpolated from the neighbours' over m, so that
        nothing of the grade itself is known.
    even, even_crosshead
        As the two before, without the hardness.
    straight, straight_crosshead
        ln(secant modulus) straight over the coordinate between the grades beside.
    """

    id: str
    literal: float
    literal_toe_off: float
    consistent: float
    consistent_crosshead: float
    even: float
    even_crosshead: float
    straight: float
    straight_crosshead: float


def published_curve(thesis: Thesis, published: Published, *, toe_off: bool = False) -> LiteralCurve:
    """Return a grade's curve regenerated from Table 3.2, from its onset to the break."""
    corrected = correct(published)
    end = published.elongation_at_break
    points = round((end - corrected.onset) / STRAIN_STEP) + 1
    strain = np.linspace(corrected.onset, end, points)
    return LiteralCurve(
        thesis.coordinate(published),
        strain - corrected.toe if toe_off else strain,
        literal_stress_MPa(published.c, strain),
    )


def literal_without(
    thesis: Thesis, left_out: Published | None, *, toe_off: bool = False
) -> QuadraticCoefficients:
    """Return Algorithm 1 of all elastomers but one, started as the thesis does."""
    kept = [p for p in thesis.elastomers if p != left_out]
    start = quadratics_through([thesis.coordinate(p) for p in kept], [p.c for p in kept])
    curves = [published_curve(thesis, p, toe_off=toe_off) for p in kept]
    return algorithm_one(curves, start).model


def held_out(thesis: Thesis, palette: Palette, published: Published) -> HeldOut:
    """Return the models' errors for an elastomer with elastomers on both sides."""
    m = thesis.coordinate(published)
    place = thesis.elastomers.index(published)
    neighbours = [correct(thesis.elastomers[k]).toe for k in (place - 1, place + 1)]
    model = without(palette, published.id)
    even = without(replace(palette, hardness=()), published.id)
    beside = tuple(palette.materials[k] for k in (place - 1, place + 1))
    straight = CoefficientModel(replace(palette, materials=beside, hardness=()))
    crosshead = published_curve(thesis, published)
    toe_off = published_curve(thesis, published, toe_off=True)

    def literal(curve: LiteralCurve, *, toe_off: bool) -> float:
        quadratics = literal_without(thesis, published, toe_off=toe_off)
        return normalised_rmse(curve.stress_MPa, quadratics.literal_stress_MPa(m, curve.strain))

    def consistent(model: CoefficientModel, strain: FloatArray) -> float:
        predicted = model.nominal_stress_MPa(m, 1.0 + np.maximum(strain, 0.0))
        return normalised_rmse(crosshead.stress_MPa, predicted)

    moved = crosshead.strain - float(np.mean(neighbours))
    return HeldOut(
        id=published.id,
        literal=literal(crosshead, toe_off=False),
        literal_toe_off=literal(toe_off, toe_off=True),
        consistent=consistent(model, toe_off.strain),
        consistent_crosshead=consistent(model, moved),
        even=consistent(even, toe_off.strain),
        even_crosshead=consistent(even, moved),
        straight=consistent(straight, toe_off.strain),
        straight_crosshead=consistent(straight, moved),
    )
