"""Composition offset: the mixture on the tray is not the mixture that was asked for.

Size: the largest shift on the coordinate m; the sign is drawn.
"""

from dataclasses import replace

import numpy as np

from benchmarks.withheld.reality.bench import Bench, FloatArray
from benchmarks.withheld.reality.design import Design
from benchmarks.withheld.reality.effects.form import Effect, Form, Shape, number, sign

__all__ = ["EFFECT"]


def _shifted(bench: Bench, shift: FloatArray) -> Bench:
    span = bench.law.coordinates
    return replace(bench, coordinate=np.clip(bench.coordinate + shift, span[0], span[-1]))


def _constant(bench: Bench, size: float, shape: Shape) -> Bench:
    return _shifted(bench, np.full_like(bench.coordinate, number(shape, "sign") * size))


def _proportional(bench: Bench, size: float, shape: Shape) -> Bench:
    return _shifted(bench, number(shape, "sign") * size * bench.coordinate)


def _dot_gain(bench: Bench, size: float, shape: Shape) -> Bench:
    """Droplets of one resin spread over the other: nothing at the ends, most in between."""
    m = np.clip(bench.coordinate, 0.0, 1.0)
    return _shifted(bench, number(shape, "sign") * size * 4.0 * m * (1.0 - m))


def _skewed_gain(bench: Bench, size: float, shape: Shape) -> Bench:
    m = np.clip(bench.coordinate, 0.0, 1.0)
    a = number(shape, "skew")
    largest = a**a / (1.0 + a) ** (1.0 + a)
    return _shifted(bench, number(shape, "sign") * size * m**a * (1.0 - m) / largest)


def _of_soft(bench: Bench, size: float, shape: Shape) -> Bench:
    """One jet in so many of the soft resin is blocked, or drips."""
    soft = 1.0 - np.clip(bench.coordinate, 0.0, 1.0)
    return _shifted(bench, number(shape, "sign") * size * soft)


def _contrast(bench: Bench, size: float, shape: Shape) -> Bench:
    """Mixtures lie nearer to each other than was asked for, or farther apart."""
    m = np.clip(bench.coordinate, 0.0, 1.0)
    middle = number(shape, "middle")
    return _shifted(bench, number(shape, "sign") * size * (m - middle) / max(middle, 1.0 - middle))


def _draw(rng: np.random.Generator, design: Design) -> Shape:
    return {"sign": sign(rng)}


def _draw_skewed(rng: np.random.Generator, design: Design) -> Shape:
    return {"sign": sign(rng), "skew": float(rng.uniform(0.5, 2.5))}


def _draw_contrast(rng: np.random.Generator, design: Design) -> Shape:
    return {"sign": sign(rng), "middle": float(rng.uniform(0.2, 0.7))}


EFFECT = Effect(
    "composition-offset",
    stage=0,
    where=("material", "position"),
    library={
        "development": (Form("constant", 0.01, 0.12, _constant, _draw),),
        "validation": (Form("of-soft", 0.02, 0.15, _of_soft, _draw),),
        "final": (Form("proportional", 0.02, 0.18, _proportional, _draw),),
    },
    other={
        "development": (Form("dot-gain", 0.01, 0.12, _dot_gain, _draw),),
        "validation": (Form("contrast", 0.02, 0.15, _contrast, _draw_contrast),),
        "final": (Form("skewed-gain", 0.02, 0.15, _skewed_gain, _draw_skewed),),
    },
)
