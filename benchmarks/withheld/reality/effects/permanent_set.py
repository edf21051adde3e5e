"""Permanent set: after a stretch the specimen stays longer.

Size: share of the largest strain that stays, at strain 0.3. Loading beyond that strain goes on
along the palette's curve.
"""

from dataclasses import replace

import numpy as np

from benchmarks.withheld.reality.bench import Bench
from benchmarks.withheld.reality.design import Design
from benchmarks.withheld.reality.effects.form import Effect, Form, Shape, number

__all__ = ["EFFECT"]

_REFERENCE_STRAIN = 0.3


def _proportional(bench: Bench, size: float, shape: Shape) -> Bench:
    return replace(bench, set_strain=lambda peak: size * peak)


def _quadratic(bench: Bench, size: float, shape: Shape) -> Bench:
    return replace(
        bench,
        set_strain=lambda peak: size * peak * np.minimum(peak / _REFERENCE_STRAIN, 2.0),
    )


def _above_threshold(bench: Bench, size: float, shape: Shape) -> Bench:
    start, power = number(shape, "start_strain"), number(shape, "power")
    full = size * _REFERENCE_STRAIN / (_REFERENCE_STRAIN - start) ** power
    return replace(
        bench,
        set_strain=lambda peak: np.minimum(full * np.maximum(peak - start, 0.0) ** power, peak / 2),
    )


def _saturating(bench: Bench, size: float, shape: Shape) -> Bench:
    """Quick at first and then spent, and larger in harder mixtures."""
    strain = number(shape, "strain")
    full = size * _REFERENCE_STRAIN / -np.expm1(-_REFERENCE_STRAIN / strain)
    hard = 0.6 + 0.8 * np.clip(bench.coordinate, 0.0, 1.0)
    return replace(
        bench,
        set_strain=lambda peak: np.minimum(full * hard * -np.expm1(-peak / strain), peak / 2),
    )


def _root(bench: Bench, size: float, shape: Shape) -> Bench:
    full = size * np.sqrt(_REFERENCE_STRAIN)
    return replace(bench, set_strain=lambda peak: np.minimum(full * np.sqrt(peak), peak / 2))


def _of_soft(bench: Bench, size: float, shape: Shape) -> Bench:
    """A power of the strain, and larger in softer mixtures."""
    power = number(shape, "power")
    soft = 1.3 - 0.8 * np.clip(bench.coordinate, 0.0, 1.0)
    return replace(
        bench,
        set_strain=lambda peak: np.minimum(
            size * soft * _REFERENCE_STRAIN * (peak / _REFERENCE_STRAIN) ** power, peak / 2
        ),
    )


def _draw_threshold(rng: np.random.Generator, design: Design) -> Shape:
    return {"start_strain": float(rng.uniform(0.02, 0.1)), "power": float(rng.uniform(0.8, 1.8))}


def _draw_saturating(rng: np.random.Generator, design: Design) -> Shape:
    return {"strain": float(rng.uniform(0.1, 0.4))}


def _draw_power(rng: np.random.Generator, design: Design) -> Shape:
    return {"power": float(rng.uniform(0.7, 1.6))}


EFFECT = Effect(
    "permanent-set",
    stage=1,
    where=("branch", "protocol"),
    library={
        "development": (Form("proportional", 0.01, 0.2, _proportional),),
        "validation": (Form("root", 0.01, 0.2, _root),),
        "final": (Form("quadratic", 0.01, 0.25, _quadratic),),
    },
    other={
        "development": (Form("above-threshold", 0.01, 0.2, _above_threshold, _draw_threshold),),
        "validation": (Form("of-soft", 0.01, 0.2, _of_soft, _draw_power),),
        "final": (Form("saturating", 0.01, 0.2, _saturating, _draw_saturating),),
    },
)
