"""Force offset: the load cell was not zero at rest, or does not stay so.

Size: newtons.
"""

from dataclasses import replace

import numpy as np

from benchmarks.withheld.reality.bench import Bench
from benchmarks.withheld.reality.design import Design
from benchmarks.withheld.reality.effects.form import Effect, Form, Shape, listed, number, sign

__all__ = ["EFFECT"]


def _constant(bench: Bench, size: float, shape: Shape) -> Bench:
    offset = np.full((len(bench.design), 1), number(shape, "sign") * size)
    return replace(bench, offset_N=bench.offset_N + offset)


def _each_its_own(bench: Bench, size: float, shape: Shape) -> Bench:
    offset = number(shape, "sign") * size * listed(shape, "relative", bench)[:, None]
    return replace(bench, offset_N=bench.offset_N + offset)


def _drifting(bench: Bench, size: float, shape: Shape) -> Bench:
    drift = 1.0 + bench.motion.time_s / number(shape, "drift_s")
    offset = number(shape, "sign") * size * np.minimum(drift, 3.0)
    return replace(bench, offset_N=bench.offset_N + offset)


def _settling(bench: Bench, size: float, shape: Shape) -> Bench:
    """A cell that was touched: the offset dies away over the test, not to nothing."""
    fade = 0.4 + 0.6 * np.exp(-bench.motion.time_s / number(shape, "fade_s"))
    offset = number(shape, "sign") * size * listed(shape, "relative", bench)[:, None] * fade
    return replace(bench, offset_N=bench.offset_N + offset)


def _cable(bench: Bench, size: float, shape: Shape) -> Bench:
    """A cable that hangs on the crosshead, and is lifted with it."""
    lifted = bench.motion.displacement_mm / number(shape, "lift_mm")
    offset = number(shape, "sign") * size * (0.6 + lifted / (1.0 + lifted))
    return replace(bench, offset_N=bench.offset_N + offset)


def _draw(rng: np.random.Generator, design: Design) -> Shape:
    return {"sign": sign(rng)}


def _draw_each(rng: np.random.Generator, design: Design) -> Shape:
    relative = np.clip(rng.normal(1.0, 0.35, len(design)), 0.2, 1.8)
    return {"sign": sign(rng), "relative": [float(v) for v in relative]}


def _draw_drift(rng: np.random.Generator, design: Design) -> Shape:
    return {"sign": sign(rng), "drift_s": float(rng.uniform(10.0, 120.0))}


def _draw_fade(rng: np.random.Generator, design: Design) -> Shape:
    return {**_draw_each(rng, design), "fade_s": float(rng.uniform(5.0, 60.0))}


def _draw_lift(rng: np.random.Generator, design: Design) -> Shape:
    return {"sign": sign(rng), "lift_mm": float(rng.uniform(3.0, 15.0))}


EFFECT = Effect(
    "force-offset",
    stage=4,
    where=("strain", "material", "time"),
    library={
        "development": (Form("constant", 0.03, 0.6, _constant, _draw),),
        "validation": (Form("constant", 0.05, 0.7, _constant, _draw),),
        "final": (Form("each-its-own", 0.04, 0.8, _each_its_own, _draw_each),),
    },
    other={
        "development": (Form("drifting", 0.03, 0.5, _drifting, _draw_drift),),
        "validation": (Form("cable", 0.04, 0.6, _cable, _draw_lift),),
        "final": (Form("settling", 0.05, 0.8, _settling, _draw_fade),),
    },
)
