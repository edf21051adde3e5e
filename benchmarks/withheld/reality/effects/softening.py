"""Softening (Mullins): below the largest strain so far the material is weaker than when new.

Size: largest share of the stress that is lost. The first loading is the palette's in every form,
and a reload meets it again at the largest strain.
"""

from collections.abc import Callable
from dataclasses import replace
from math import erf

import numpy as np

from benchmarks.withheld.reality.bench import Bench, FloatArray
from benchmarks.withheld.reality.design import Design
from benchmarks.withheld.reality.effects.form import Effect, Form, Shape, number

__all__ = ["EFFECT"]

_LEAST_WORK_MPa = 1e-12
_erf = np.vectorize(erf, otypes=[np.float64])


def _by_ratio(
    bench: Bench, size: float, loss: Callable[[FloatArray], tuple[FloatArray, FloatArray]]
) -> Bench:
    """Lose `loss` (with its slope) of 1 - work over largest work."""

    def damage(work: FloatArray, largest: FloatArray) -> tuple[FloatArray, FloatArray]:
        largest = np.maximum(largest, _LEAST_WORK_MPa)
        lost, slope = loss(1.0 - work / largest)
        return 1.0 - size * lost, size * slope / largest

    return replace(bench, damage=damage)


def _tanh(bench: Bench, size: float, shape: Shape) -> Bench:
    width = number(shape, "width")
    scale = 1.0 / np.tanh(1.0 / width)

    def loss(below: FloatArray) -> tuple[FloatArray, FloatArray]:
        value = np.tanh(below / width)
        return scale * value, scale * (1.0 - value**2) / width

    return _by_ratio(bench, size, loss)


def _error_function(bench: Bench, size: float, shape: Shape) -> Bench:
    width = number(shape, "width")
    scale = 1.0 / erf(1.0 / width)

    def loss(below: FloatArray) -> tuple[FloatArray, FloatArray]:
        slope = 2.0 / np.sqrt(np.pi) * np.exp(-((below / width) ** 2)) / width
        return scale * _erf(below / width), scale * slope

    return _by_ratio(bench, size, loss)


def _damage(bench: Bench, size: float, shape: Shape) -> Bench:
    """Continuum damage d(largest work), on a law whose first loading is the palette's."""
    beta = number(shape, "beta")
    reference = _reference_work(bench) * number(shape, "work_share")

    def kept(work: FloatArray) -> tuple[FloatArray, FloatArray]:
        scaled = np.maximum(work, _LEAST_WORK_MPa) / reference
        fade = np.exp(-(scaled**beta))
        slope = -size * fade * beta * scaled ** (beta - 1.0) / reference
        return 1.0 - size * (1.0 - fade), slope

    def damage(work: FloatArray, largest: FloatArray) -> tuple[FloatArray, FloatArray]:
        now, slope = kept(work)
        worst, _ = kept(largest)
        return worst / now, -worst * slope / now**2

    return replace(bench, damage=damage)


def _grown_loss(bench: Bench, size: float, shape: Shape) -> Bench:
    """A loss that grows with the largest work, and is taken back by a power of the work."""
    power, half = number(shape, "power"), number(shape, "half") * _reference_work(bench)

    def damage(work: FloatArray, largest: FloatArray) -> tuple[FloatArray, FloatArray]:
        largest = np.maximum(largest, _LEAST_WORK_MPa)
        ratio = np.clip(work / largest, 1e-6, 1.0)
        depth = size * largest / (largest + half)
        slope = depth * power * ratio ** (power - 1.0) / largest
        return 1.0 - depth * (1.0 - ratio**power), slope

    return replace(bench, damage=damage)


def _reference_work(bench: Bench) -> FloatArray:
    """Return about the work to strain 0.3 of every element's material, MPa."""
    secant = bench.law.secant_MPa(bench.coordinate)[..., 60]
    return 0.5 * secant * 0.3**2


def _power(bench: Bench, size: float, shape: Shape) -> Bench:
    power = number(shape, "power")

    def loss(below: FloatArray) -> tuple[FloatArray, FloatArray]:
        below = np.maximum(below, 0.0)
        return below**power, power * below ** (power - 1.0)

    return _by_ratio(bench, size, loss)


def _of_hard(bench: Bench, size: float, shape: Shape) -> Bench:
    """A loss that is larger the harder the mixture, and levels off below the largest work."""
    width = number(shape, "width")
    hard = 0.4 + 0.6 * np.clip(bench.coordinate, 0.0, 1.0)

    def damage(work: FloatArray, largest: FloatArray) -> tuple[FloatArray, FloatArray]:
        largest = np.maximum(largest, _LEAST_WORK_MPa)
        fade = np.exp(-(1.0 - work / largest) / width)
        return 1.0 - size * hard * (1.0 - fade), size * hard * fade / width / largest

    return replace(bench, damage=damage)


def _draw_width(rng: np.random.Generator, design: Design) -> Shape:
    return {"width": float(rng.uniform(0.3, 0.9))}


def _draw_damage(rng: np.random.Generator, design: Design) -> Shape:
    return {"beta": float(rng.uniform(0.6, 1.2)), "work_share": float(rng.uniform(0.2, 0.6))}


def _draw_grown(rng: np.random.Generator, design: Design) -> Shape:
    return {"power": float(rng.uniform(0.5, 1.0)), "half": float(rng.uniform(0.1, 0.4))}


def _draw_power(rng: np.random.Generator, design: Design) -> Shape:
    return {"power": float(rng.uniform(1.0, 1.8))}


EFFECT = Effect(
    "softening",
    stage=1,
    where=("branch", "protocol"),
    library={
        "development": (Form("tanh", 0.04, 0.5, _tanh, _draw_width),),
        "validation": (Form("power", 0.05, 0.5, _power, _draw_power),),
        "final": (Form("error-function", 0.05, 0.6, _error_function, _draw_width),),
    },
    other={
        "development": (Form("continuum-damage", 0.05, 0.6, _damage, _draw_damage),),
        "validation": (Form("of-hard", 0.06, 0.6, _of_hard, _draw_width),),
        "final": (Form("grown-loss", 0.05, 0.6, _grown_loss, _draw_grown),),
    },
)
