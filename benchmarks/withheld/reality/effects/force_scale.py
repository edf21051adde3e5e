"""Force scale: a load cell with a wrong gain, or a file in other units; of all or some specimens.

Size: relative gain error; for a unit mix-up, the factor less 1.
"""

from dataclasses import replace

import numpy as np

from benchmarks.withheld.reality.bench import Bench
from benchmarks.withheld.reality.design import Design
from benchmarks.withheld.reality.effects.form import Effect, Form, Shape, listed, number, sign

__all__ = ["EFFECT"]

POUND_FORCE_N = 4.4482216152605


def _gain(bench: Bench, size: float, shape: Shape) -> Bench:
    gain = 1.0 + number(shape, "sign") * size * listed(shape, "affected", bench)
    return replace(bench, gain=bench.gain * gain[:, None])


def _time_gain(bench: Bench, size: float, shape: Shape) -> Bench:
    """A gain that settles while the amplifier warms up."""
    settled = -np.expm1(-bench.motion.time_s / number(shape, "warm_s"))
    part = number(shape, "sign") * size * listed(shape, "affected", bench)[:, None]
    return replace(bench, gain=bench.gain * (1.0 + part * (0.6 + 0.4 * settled)))


def _travel_gain(bench: Bench, size: float, shape: Shape) -> Bench:
    """A hinge that turns with the travel, so that the cell sees ever less of the pull."""
    travel = bench.motion.displacement_mm / number(shape, "travel_mm")
    part = number(shape, "sign") * size * listed(shape, "affected", bench)[:, None]
    return replace(bench, gain=bench.gain * (1.0 + part * (1.0 + travel**2) / (1.5 + travel**2)))


def _fading_gain(bench: Bench, size: float, shape: Shape) -> Bench:
    """A gain that is off most at the start, while a filter settles."""
    left = np.exp(-bench.motion.time_s / number(shape, "settle_s"))
    part = number(shape, "sign") * size * listed(shape, "affected", bench)[:, None]
    return replace(bench, gain=bench.gain * (1.0 + part * (0.55 + 0.45 * left)))


def _all(rng: np.random.Generator, design: Design) -> Shape:
    return {"sign": sign(rng), "affected": [1.0] * len(design)}


def _some(rng: np.random.Generator, design: Design) -> Shape:
    count = max(2, round(rng.uniform(0.15, 0.4) * len(design)))
    affected = np.zeros(len(design))
    affected[rng.permutation(len(design))[:count]] = 1.0
    return {"sign": sign(rng), "affected": [float(a) for a in affected]}


def _units(rng: np.random.Generator, design: Design) -> Shape:
    return {**_some(rng, design), "sign": 1.0}


def _warming(rng: np.random.Generator, design: Design) -> Shape:
    return {**_all(rng, design), "warm_s": float(rng.uniform(5.0, 60.0))}


def _hinge(rng: np.random.Generator, design: Design) -> Shape:
    return {**_some(rng, design), "travel_mm": float(rng.uniform(3.0, 10.0))}


def _of_batch(rng: np.random.Generator, design: Design) -> Shape:
    """Of one batch, as if another lab had tested it."""
    affected = design.batch == rng.choice(np.unique(design.batch))
    return {"sign": sign(rng), "affected": [float(a) for a in affected]}


def _settling(rng: np.random.Generator, design: Design) -> Shape:
    return {**_some(rng, design), "settle_s": float(rng.uniform(10.0, 90.0))}


EFFECT = Effect(
    "force-scale",
    stage=4,
    where=("specimen", "batch"),
    library={
        "development": (
            Form("gain", 0.03, 0.2, _gain, _all),
            Form("gain-of-some", 0.05, 0.3, _gain, _some),
        ),
        "validation": (
            Form("gain", 0.05, 0.25, _gain, _all),
            Form("gain-of-batch", 0.06, 0.3, _gain, _of_batch),
        ),
        "final": (
            Form("gain-of-some", 0.06, 0.35, _gain, _some),
            Form("pounds-of-some", POUND_FORCE_N - 1.0, POUND_FORCE_N - 1.0, _gain, _units),
        ),
    },
    other={
        "development": (Form("warming-gain", 0.04, 0.2, _time_gain, _warming),),
        "validation": (Form("fading-gain", 0.06, 0.3, _fading_gain, _settling),),
        "final": (Form("hinge-gain", 0.06, 0.3, _travel_gain, _hinge),),
    },
    measured=(
        Form("gain-of-batch", 0.15, 0.4, _gain, _of_batch),
        Form("pounds-of-some", POUND_FORCE_N - 1.0, POUND_FORCE_N - 1.0, _gain, _units),
    ),
)
