"""What an effect of the bench is: a size, a shape drawn at random, and what it does to a bench."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from benchmarks.withheld.reality.bench import Bench, FloatArray
from benchmarks.withheld.reality.design import Design

__all__ = [
    "Apply",
    "Draw",
    "Effect",
    "Form",
    "Set",
    "Shape",
    "constant",
    "listed",
    "number",
    "sign",
]

Set = Literal["development", "final", "validation"]
Shape = Mapping[str, float | list[float] | str]
Apply = Callable[[Bench, float, Shape], Bench]
Draw = Callable[[np.random.Generator, Design], Shape]


def constant(rng: np.random.Generator, design: Design) -> Shape:
    """Draw nothing: the form has its size alone."""
    return {}


def sign(rng: np.random.Generator) -> float:
    """Draw -1 or 1."""
    return float(rng.choice((-1.0, 1.0)))


@dataclass(frozen=True)
class Form:
    """One functional form of an effect.

    Attributes
    ----------
    low, high
        Range of its size in this set; what the size means stands in the effect's file.
    apply
        Of a bench, a size and a shape: the bench with the effect.
    draw
        Draws the rest of its parameters.
    """

    name: str
    low: float
    high: float
    apply: Apply
    draw: Draw = constant


@dataclass(frozen=True)
class Effect:
    """One unmodelled effect.

    Attributes
    ----------
    id
        The contract's effect id, or one of the bench's own that no library claims.
    where
        Axes of which the gap truly varies along at least one.
    library, other
        Forms as a textbook has them, and forms as it does not; by set.
    measured
        Forms as other labs' measurements have them, of any size within their range.
    stage
        Effects are applied from the printed composition (0) to the sensor (4).
    """

    id: str
    stage: int
    where: tuple[str, ...]
    library: Mapping[Set, tuple[Form, ...]]
    other: Mapping[Set, tuple[Form, ...]]
    measured: tuple[Form, ...] = ()


def number(shape: Shape, name: str) -> float:
    """Return a scalar of the shape."""
    value = shape[name]
    assert isinstance(value, float)
    return value


def listed(shape: Shape, name: str, bench: Bench) -> FloatArray:
    """Return the values of a per-specimen list that belong to a bench's specimens."""
    return np.asarray(shape[name], dtype=np.float64)[bench.design.number]
