"""Orientation: a gauge across the jets' travel or across the layers is not the palette's.

Size: relative change of stiffness along z; y has a share of it.
"""

import numpy as np

from benchmarks.withheld.reality.base_law import STRAINS
from benchmarks.withheld.reality.bench import Bench, FloatArray
from benchmarks.withheld.reality.design import Design
from benchmarks.withheld.reality.effects.form import Effect, Form, Shape, number, sign

__all__ = ["EFFECT"]


def _turned(bench: Bench, shape: Shape) -> FloatArray:
    across = np.where(bench.design.orientation == "y", number(shape, "y_share"), 0.0)
    return number(shape, "sign") * np.where(bench.design.orientation == "z", 1.0, across)


def _factors(bench: Bench, size: float, shape: Shape) -> Bench:
    return bench.stiffened(1.0 + size * _turned(bench, shape))


def _fading(bench: Bench, size: float, shape: Shape) -> Bench:
    """Layers that the first stretch aligns: the difference fades with strain."""
    fade = np.exp(-STRAINS / number(shape, "fade_strain"))
    return bench.stiffened(1.0 + size * _turned(bench, shape)[:, None, None] * fade)


def _by_mixture(bench: Bench, size: float, shape: Shape) -> Bench:
    """Interfaces between droplets of two resins: strongest where the mixture is even."""
    even = 0.4 + 2.4 * np.clip(bench.coordinate * (1.0 - bench.coordinate), 0.0, None)
    grown = 0.6 + 0.8 * STRAINS / (STRAINS + 0.15)
    change = size * _turned(bench, shape)[:, None, None] * even[:, :, None] * grown
    return bench.stiffened(np.exp(change))


def _growing(bench: Bench, size: float, shape: Shape) -> Bench:
    """Layers that part as they are stretched."""
    grown = 0.4 + 0.6 * -np.expm1(-STRAINS / number(shape, "parting_strain"))
    return bench.stiffened(1.0 + size * _turned(bench, shape)[:, None, None] * grown)


def _draw(rng: np.random.Generator, design: Design) -> Shape:
    return {"sign": -1.0, "y_share": float(rng.uniform(0.2, 0.7))}


def _draw_signed(rng: np.random.Generator, design: Design) -> Shape:
    return {"sign": sign(rng), "y_share": float(rng.uniform(-0.3, 0.5))}


def _draw_fading(rng: np.random.Generator, design: Design) -> Shape:
    return {**_draw(rng, design), "fade_strain": float(rng.uniform(0.15, 0.5))}


def _draw_two(rng: np.random.Generator, design: Design) -> Shape:
    return {"sign": sign(rng), "y_share": float(rng.uniform(0.3, 1.0))}


def _draw_growing(rng: np.random.Generator, design: Design) -> Shape:
    return {**_draw_two(rng, design), "parting_strain": float(rng.uniform(0.1, 0.3))}


EFFECT = Effect(
    "orientation",
    stage=1,
    where=("orientation",),
    library={
        "development": (Form("factors", 0.03, 0.3, _factors, _draw),),
        "validation": (Form("two-factors", 0.04, 0.3, _factors, _draw_two),),
        "final": (Form("signed-factors", 0.04, 0.35, _factors, _draw_signed),),
    },
    other={
        "development": (Form("fading", 0.04, 0.35, _fading, _draw_fading),),
        "validation": (Form("growing", 0.04, 0.35, _growing, _draw_growing),),
        "final": (Form("by-mixture", 0.03, 0.35, _by_mixture, _draw_signed),),
    },
)
