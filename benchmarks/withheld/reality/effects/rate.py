"""Rate: part of the stress fades, so that a slow or a held test is softer than the palette's.

Size: the share of the short-time stress that fades (relaxation forms), or the exponent of the rate
(power). A pull at the reference rate finds the palette's curve: relaxation acts on the law that
the palette's own test relaxed to it (`solver`), and the power is of the ratio of rates.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from benchmarks.withheld.reality.bench import Bench, FloatArray
from benchmarks.withheld.reality.design import Design
from benchmarks.withheld.reality.effects.form import Effect, Form, Shape, number

__all__ = ["EFFECT"]


def _fading(bench: Bench, decay: Callable[[FloatArray], FloatArray], size: float) -> Bench:
    return replace(bench, relaxation=lambda time_s: 1.0 - size + size * decay(time_s))


def _everywhere(bench: Bench) -> Bench:
    return replace(bench, memory_share=np.ones_like(bench.coordinate))


def _most_in_mixtures(bench: Bench) -> Bench:
    share = np.exp(-(((bench.coordinate - 0.35) / 0.7) ** 2))
    return replace(bench, memory_share=share)


def _prony(bench: Bench, size: float, shape: Shape) -> Bench:
    tau_s = number(shape, "tau_s")
    return _fading(_everywhere(bench), lambda t: np.exp(-t / tau_s), size)


def _power(bench: Bench, size: float, shape: Shape) -> Bench:
    design, motion = bench.design, bench.motion
    ramp = (design.strain_rate_per_s / bench.palette.strain_rate_per_s) ** size
    held = motion.direction == 0
    held[:, 0] = False
    start = np.where(held, np.inf, motion.time_s)
    start = np.max(np.where(np.isinf(start), 0.0, start), axis=1, keepdims=True)
    hold = np.where(held, (motion.time_s / np.maximum(start, 1e-9)), 1.0) ** -size
    return replace(bench, time_factor=bench.time_factor * ramp[:, None] * hold)


def _stretched(bench: Bench, size: float, shape: Shape) -> Bench:
    tau_s, beta = number(shape, "tau_s"), number(shape, "beta")
    return _fading(_most_in_mixtures(bench), lambda t: np.exp(-((t / tau_s) ** beta)), size)


def _fractional(bench: Bench, size: float, shape: Shape) -> Bench:
    tau_s, order = number(shape, "tau_s"), number(shape, "order")
    return _fading(_most_in_mixtures(bench), lambda t: (1.0 + t / tau_s) ** -order, size)


def _most_in_soft(bench: Bench) -> Bench:
    share = 1.0 - 0.7 * np.clip(bench.coordinate, 0.0, 1.0)
    return replace(bench, memory_share=share)


def _two_terms(bench: Bench, size: float, shape: Shape) -> Bench:
    tau_s = number(shape, "tau_s")
    return _fading(
        _everywhere(bench),
        lambda t: 0.5 * np.exp(-t / tau_s) + 0.5 * np.exp(-t / (8.0 * tau_s)),
        size,
    )


def _logistic(bench: Bench, size: float, shape: Shape) -> Bench:
    """A spectrum that is even in the logarithm of time: Cole and Cole's in the time domain."""
    tau_s, order = number(shape, "tau_s"), number(shape, "order")
    return _fading(_most_in_soft(bench), lambda t: 1.0 / (1.0 + (t / tau_s) ** order), size)


def _draw_tau(rng: np.random.Generator, design: Design) -> Shape:
    return {"tau_s": float(np.exp(rng.uniform(np.log(2.0), np.log(60.0))))}


def _draw_stretched(rng: np.random.Generator, design: Design) -> Shape:
    return {**_draw_tau(rng, design), "beta": float(rng.uniform(0.35, 0.6))}


def _draw_fractional(rng: np.random.Generator, design: Design) -> Shape:
    tau_s = float(np.exp(rng.uniform(np.log(0.1), np.log(4.0))))
    return {"tau_s": tau_s, "order": float(rng.uniform(0.2, 0.5))}


def _draw_short(rng: np.random.Generator, design: Design) -> Shape:
    return {"tau_s": float(np.exp(rng.uniform(np.log(1.0), np.log(20.0))))}


def _draw_logistic(rng: np.random.Generator, design: Design) -> Shape:
    return {**_draw_tau(rng, design), "order": float(rng.uniform(0.5, 0.9))}


EFFECT = Effect(
    "rate",
    stage=1,
    where=("rate_mm_s", "time", "branch"),
    library={
        "development": (Form("prony", 0.05, 0.6, _prony, _draw_tau),),
        "validation": (Form("two-terms", 0.06, 0.6, _two_terms, _draw_short),),
        "final": (Form("power", 0.02, 0.25, _power),),
    },
    other={
        "development": (Form("stretched", 0.05, 0.6, _stretched, _draw_stretched),),
        "validation": (Form("logistic", 0.08, 0.7, _logistic, _draw_logistic),),
        "final": (Form("fractional", 0.08, 0.7, _fractional, _draw_fractional),),
    },
)
