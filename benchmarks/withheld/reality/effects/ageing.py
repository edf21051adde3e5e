"""Ageing: the print goes on curing, or degrades, after the palette was measured.

Size: relative change of stiffness half a year after printing; the sign is drawn.
"""

from collections.abc import Callable

import numpy as np

from benchmarks.withheld.reality.bench import Bench, FloatArray
from benchmarks.withheld.reality.design import Design
from benchmarks.withheld.reality.effects.form import Effect, Form, Shape, number, sign

__all__ = ["EFFECT"]

_HALF_YEAR_DAYS = 180.0


def _changed(
    bench: Bench, size: float, shape: Shape, progress: Callable[[FloatArray], FloatArray]
) -> Bench:
    fresh = bench.palette.age_days
    ages = np.array([fresh, _HALF_YEAR_DAYS])
    start, end = progress(ages)
    done = (progress(bench.design.age_days) - start) / (end - start)
    return bench.stiffened(1.0 + number(shape, "sign") * size * done)


def _log_time(bench: Bench, size: float, shape: Shape) -> Bench:
    return _changed(bench, size, shape, np.log)


def _saturating(bench: Bench, size: float, shape: Shape) -> Bench:
    tau = number(shape, "tau_days")
    return _changed(bench, size, shape, lambda age: -np.expm1(-age / tau))


def _stretched(bench: Bench, size: float, shape: Shape) -> Bench:
    tau, beta = number(shape, "tau_days"), number(shape, "beta")
    return _changed(bench, size, shape, lambda age: -np.expm1(-((age / tau) ** beta)))


def _cure_then_decay(bench: Bench, size: float, shape: Shape) -> Bench:
    """Dark cure in the first weeks, against a slow loss that wins later."""
    tau, beta, loss = (number(shape, name) for name in ("tau_days", "beta", "loss"))

    def progress(age: FloatArray) -> FloatArray:
        return -np.expm1(-((age / tau) ** beta)) - loss * (1.0 - 1.0 / (1.0 + age / 400.0))

    return _changed(bench, size, shape, progress)


def _hyperbolic(bench: Bench, size: float, shape: Shape) -> Bench:
    tau = number(shape, "tau_days")
    return _changed(bench, size, shape, lambda age: age / (age + tau))


def _two_cures(bench: Bench, size: float, shape: Shape) -> Bench:
    """A cure that is over within days, and one that never ends."""
    tau, slow = number(shape, "tau_days"), number(shape, "slow_share")

    def progress(age: FloatArray) -> FloatArray:
        return (1.0 - slow) * -np.expm1(-4.0 * age / tau) + slow * np.log1p(age / tau)

    return _changed(bench, size, shape, progress)


def _draw_sign(rng: np.random.Generator, design: Design) -> Shape:
    return {"sign": sign(rng)}


def _draw_tau(rng: np.random.Generator, design: Design) -> Shape:
    return {"sign": sign(rng), "tau_days": float(rng.uniform(20.0, 90.0))}


def _draw_stretched(rng: np.random.Generator, design: Design) -> Shape:
    return {**_draw_tau(rng, design), "beta": float(rng.uniform(0.4, 0.7))}


def _draw_cure(rng: np.random.Generator, design: Design) -> Shape:
    return {**_draw_stretched(rng, design), "loss": float(rng.uniform(0.1, 0.4))}


def _draw_two_cures(rng: np.random.Generator, design: Design) -> Shape:
    return {**_draw_tau(rng, design), "slow_share": float(rng.uniform(0.3, 0.7))}


EFFECT = Effect(
    "ageing",
    stage=1,
    where=("age_days",),
    library={
        "development": (Form("log-time", 0.02, 0.25, _log_time, _draw_sign),),
        "validation": (Form("hyperbolic", 0.03, 0.3, _hyperbolic, _draw_tau),),
        "final": (Form("saturating", 0.03, 0.35, _saturating, _draw_tau),),
    },
    other={
        "development": (Form("stretched", 0.02, 0.25, _stretched, _draw_stretched),),
        "validation": (Form("two-cures", 0.03, 0.3, _two_cures, _draw_two_cures),),
        "final": (Form("cure-then-decay", 0.03, 0.3, _cure_then_decay, _draw_cure),),
    },
)
