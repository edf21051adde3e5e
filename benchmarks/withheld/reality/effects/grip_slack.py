"""Grip slack: the first travel straightens specimen and grips before anything is stretched.

Size: mean slack over the gauge length; every specimen has its own.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from benchmarks.withheld.reality.bench import Bench, FloatArray
from benchmarks.withheld.reality.design import Design
from benchmarks.withheld.reality.effects.form import Effect, Form, Shape, listed, number

__all__ = ["EFFECT"]


def _taken_up(
    bench: Bench, size: float, shape: Shape, share: Callable[[FloatArray], FloatArray]
) -> Bench:
    """Lose `share` of the slack at travel over slack; its slope must not exceed 1."""
    slack = size * listed(shape, "relative", bench) * bench.design.gauge_mm
    slack = np.maximum(slack, 1e-6)[:, None]
    return replace(
        bench, lost_mm=bench.lost_mm + slack * share(bench.motion.displacement_mm / slack)
    )


def _dead(bench: Bench, size: float, shape: Shape) -> Bench:
    return _taken_up(bench, size, shape, lambda ratio: np.minimum(ratio, 1.0))


def _exponential(bench: Bench, size: float, shape: Shape) -> Bench:
    return _taken_up(bench, size, shape, lambda ratio: -np.expm1(-ratio))


def _two_grips(bench: Bench, size: float, shape: Shape) -> Bench:
    """One grip seats at once, the other over three times the travel."""
    return _taken_up(
        bench,
        size,
        shape,
        lambda ratio: 0.5 * (np.tanh(1.2 * ratio) - np.expm1(-ratio / 3.0)),
    )


def _slow(bench: Bench, size: float, shape: Shape) -> Bench:
    return _taken_up(bench, size, shape, lambda ratio: ratio / (ratio + 1.5))


def _hyperbolic_tangent(bench: Bench, size: float, shape: Shape) -> Bench:
    return _taken_up(bench, size, shape, np.tanh)


def _seating(bench: Bench, size: float, shape: Shape) -> Bench:
    """A part is taken up dead, the rest as the jaws bed into the specimen."""
    dead = number(shape, "dead_share")
    return _taken_up(
        bench,
        size,
        shape,
        lambda ratio: dead * np.minimum(ratio, 1.0) + (1.0 - dead) * np.tanh(ratio / 2.5),
    )


def _draw(rng: np.random.Generator, design: Design) -> Shape:
    sd = float(rng.uniform(0.2, 0.45))
    return {"relative": [float(v) for v in np.exp(rng.normal(0.0, sd, len(design)))]}


def _toe(bench: Bench, size: float, shape: Shape) -> Bench:
    """Strands are drawn taut one after the other, evenly up to twice the mean slack."""
    return _taken_up(
        bench, size, shape, lambda ratio: np.where(ratio < 2.0, ratio - 0.25 * ratio**2, 1.0)
    )


def _draw_quarter(rng: np.random.Generator, design: Design) -> Shape:
    return {"relative": [float(v) for v in np.exp(rng.normal(0.0, 0.25, len(design)))]}


def _draw_soft(rng: np.random.Generator, design: Design) -> Shape:
    """Of the softer half of the grades alone; bars have none."""
    relative = np.exp(rng.normal(0.0, 0.25, len(design)))
    soft = design.coordinate <= np.nanmedian(np.unique(design.coordinate))
    return {"relative": [float(v) for v in np.where(soft, relative, 0.0)]}


def _draw_seating(rng: np.random.Generator, design: Design) -> Shape:
    return {**_draw(rng, design), "dead_share": float(rng.uniform(0.2, 0.7))}


EFFECT = Effect(
    "grip-slack",
    stage=3,
    where=("strain", "specimen"),
    library={
        "development": (Form("dead", 0.003, 0.04, _dead, _draw),),
        "validation": (Form("hyperbolic-tangent", 0.004, 0.045, _hyperbolic_tangent, _draw),),
        "final": (Form("exponential", 0.004, 0.05, _exponential, _draw),),
    },
    other={
        "development": (Form("two-grips", 0.003, 0.04, _two_grips, _draw),),
        "validation": (Form("seating", 0.004, 0.045, _seating, _draw_seating),),
        "final": (Form("slow", 0.004, 0.05, _slow, _draw),),
    },
    measured=(
        Form("toe", 0.01, 0.02, _toe, _draw_quarter),
        Form("toe-of-soft", 0.015, 0.03, _toe, _draw_soft),
    ),
)
