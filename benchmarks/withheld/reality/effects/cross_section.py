"""Cross-section: parts print larger than drawn.

Size: what is added to a dimension, both sides together, mm.
"""

from dataclasses import replace

import numpy as np

from benchmarks.withheld.reality.bench import Bench, FloatArray
from benchmarks.withheld.reality.design import Design
from benchmarks.withheld.reality.effects.form import Effect, Form, Shape, number

__all__ = ["EFFECT"]


def _resized(bench: Bench, wider: float, thicker: float, lost_mm2: float | FloatArray) -> Bench:
    design = bench.design
    true = (design.width_mm + wider) * (design.thickness_mm + thicker) - lost_mm2
    nominal = design.width_mm * design.thickness_mm
    return replace(bench, area_mm2=bench.area_mm2 * true / nominal)


def _oversize(bench: Bench, size: float, shape: Shape) -> Bench:
    return _resized(bench, size, size, 0.0)


def _oversize_two(bench: Bench, size: float, shape: Shape) -> Bench:
    return _resized(bench, size, size * number(shape, "thickness_share"), 0.0)


def _rounded(bench: Bench, size: float, shape: Shape) -> Bench:
    radius = number(shape, "radius_mm")
    return _resized(bench, size, size, (4.0 - np.pi) * radius**2)


def _levelled(bench: Bench, size: float, shape: Shape) -> Bench:
    """The roller levels the height; the width flows out at the foot, as a trapezium."""
    height = bench.design.thickness_mm
    foot = 0.5 * size * (1.0 + height / (height + number(shape, "flow_mm")))
    true = (bench.design.width_mm + foot) * (height + 0.4 * size)
    nominal = bench.design.width_mm * height
    return replace(bench, area_mm2=bench.area_mm2 * true / nominal)


def _wider(bench: Bench, size: float, shape: Shape) -> Bench:
    return _resized(bench, size, 0.0, 0.0)


def _footed(bench: Bench, size: float, shape: Shape) -> Bench:
    """The first layers flow out sideways under the weight of the rest."""
    foot_mm = np.minimum(number(shape, "foot_mm"), bench.design.thickness_mm)
    return _resized(bench, 0.4 * size, 0.4 * size, -size * foot_mm)


def _draw_share(rng: np.random.Generator, design: Design) -> Shape:
    return {"thickness_share": float(rng.uniform(0.4, 1.0))}


def _draw_radius(rng: np.random.Generator, design: Design) -> Shape:
    return {"radius_mm": float(rng.uniform(0.1, 0.4))}


def _draw_flow(rng: np.random.Generator, design: Design) -> Shape:
    return {"flow_mm": float(rng.uniform(0.5, 3.0))}


def _draw_foot(rng: np.random.Generator, design: Design) -> Shape:
    return {"foot_mm": float(rng.uniform(0.3, 1.2))}


EFFECT = Effect(
    "cross-section",
    stage=2,
    where=("width_mm", "thickness_mm"),
    library={
        "development": (Form("oversize", 0.05, 0.3, _oversize),),
        "validation": (Form("wider", 0.1, 0.5, _wider),),
        "final": (Form("oversize-two", 0.06, 0.35, _oversize_two, _draw_share),),
    },
    other={
        "development": (Form("rounded", 0.06, 0.3, _rounded, _draw_radius),),
        "validation": (Form("footed", 0.06, 0.35, _footed, _draw_foot),),
        "final": (Form("levelled", 0.08, 0.4, _levelled, _draw_flow),),
    },
)
