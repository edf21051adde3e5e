"""Cross-section: parts print larger than drawn.

Size: what is added to a dimension, both sides together, mm.
"""

from dataclasses import replace

import numpy as np

from benchmarks.withheld.reality.bench import Bench
from benchmarks.withheld.reality.design import Design
from benchmarks.withheld.reality.effects.form import Effect, Form, Shape, number

__all__ = ["EFFECT"]


def _resized(bench: Bench, wider: float, thicker: float, lost_mm2: float) -> Bench:
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


def _draw_share(rng: np.random.Generator, design: Design) -> Shape:
    return {"thickness_share": float(rng.uniform(0.4, 1.0))}


def _draw_radius(rng: np.random.Generator, design: Design) -> Shape:
    return {"radius_mm": float(rng.uniform(0.1, 0.4))}


def _draw_flow(rng: np.random.Generator, design: Design) -> Shape:
    return {"flow_mm": float(rng.uniform(0.5, 3.0))}


EFFECT = Effect(
    "cross-section",
    stage=2,
    where=("width_mm", "thickness_mm"),
    library={
        "development": (Form("oversize", 0.05, 0.3, _oversize),),
        "final": (Form("oversize-two", 0.06, 0.35, _oversize_two, _draw_share),),
    },
    other={
        "development": (Form("rounded", 0.06, 0.3, _rounded, _draw_radius),),
        "final": (Form("levelled", 0.08, 0.4, _levelled, _draw_flow),),
    },
)
