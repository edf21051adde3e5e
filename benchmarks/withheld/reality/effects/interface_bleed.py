"""Interface bleed: droplets of neighbouring materials mix across their boundary.

Size: the standard deviation of the kernel along the gauge, mm. Only graded bars feel it.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from benchmarks.withheld.reality.bench import Bench, FloatArray
from benchmarks.withheld.reality.design import Design
from benchmarks.withheld.reality.effects.form import Effect, Form, Shape, number, sign

__all__ = ["EFFECT"]

_PITCH_MM = 0.02
_REACH = 8.0


def _blurred(bench: Bench, size: float, kernel: Callable[[FloatArray], FloatArray]) -> Bench:
    design = bench.design
    if not (design.profile >= 0).any():
        return bench
    reach = np.ceil(_REACH * size / _PITCH_MM) * _PITCH_MM
    offset = np.linspace(-reach, reach, 2 * round(reach / _PITCH_MM) + 1)
    weight = kernel(offset)
    weight = weight / weight.sum()
    change = np.zeros_like(bench.coordinate)
    for row, number_of_profile in enumerate(design.profile):
        profile = design.profiles[number_of_profile]
        x = np.arange(-reach, profile.length_mm + reach + _PITCH_MM / 2, _PITCH_MM)
        # `profile.at` holds the end values: the gauge goes on into the shoulders
        wide = profile.at(np.arange(x[0] - reach, x[-1] + reach + _PITCH_MM / 2, _PITCH_MM))
        mixed = np.convolve(wide, weight, mode="valid")[: len(x)]
        centre = bench.centre_mm[row]
        change[row] = np.interp(centre, x, mixed) - profile.at(centre)
    return replace(bench, coordinate=bench.coordinate + change)


def _gaussian(bench: Bench, size: float, shape: Shape) -> Bench:
    return _blurred(bench, size, lambda x: np.exp(-0.5 * (x / size) ** 2))


def _exponential(bench: Bench, size: float, shape: Shape) -> Bench:
    return _blurred(bench, size, lambda x: np.exp(-np.sqrt(2.0) * np.abs(x) / size))


def _two_gaussians(bench: Bench, size: float, shape: Shape) -> Bench:
    """Droplets that mostly stay, and a few that travel far."""
    far, share = number(shape, "far"), number(shape, "far_share")
    near = size / np.sqrt(1.0 - share + share * far**2)

    def kernel(x: FloatArray) -> FloatArray:
        wide = np.exp(-0.5 * (x / (near * far)) ** 2)
        both: FloatArray = (1.0 - share) * np.exp(-0.5 * (x / near) ** 2) + share / far * wide
        return both

    return _blurred(bench, size, kernel)


def _one_sided(bench: Bench, size: float, shape: Shape) -> Bench:
    """Material that the roller drags along its travel, and never back."""
    towards = number(shape, "sign")
    return _blurred(
        bench, size, lambda x: np.where(towards * x >= 0.0, np.exp(-np.abs(x) / size), 0.0)
    )


def _box(bench: Bench, size: float, shape: Shape) -> Bench:
    half = np.sqrt(3.0) * size
    return _blurred(bench, size, lambda x: np.clip((half - np.abs(x)) / _PITCH_MM + 0.5, 0.0, 1.0))


def _long_tailed(bench: Bench, size: float, shape: Shape) -> Bench:
    """Droplets that splash: no farthest distance."""
    power = number(shape, "power")
    return _blurred(bench, size, lambda x: (1.0 + (x / size) ** 2) ** -power)


def _draw_two(rng: np.random.Generator, design: Design) -> Shape:
    return {"far": float(rng.uniform(2.5, 4.0)), "far_share": float(rng.uniform(0.1, 0.35))}


def _draw_side(rng: np.random.Generator, design: Design) -> Shape:
    return {"sign": sign(rng)}


def _draw_tail(rng: np.random.Generator, design: Design) -> Shape:
    return {"power": float(rng.uniform(1.3, 2.2))}


EFFECT = Effect(
    "interface-bleed",
    stage=0,
    where=("position", "profile", "material"),
    library={
        "development": (Form("gaussian", 0.1, 0.8, _gaussian),),
        "validation": (Form("box", 0.1, 0.9, _box),),
        "final": (Form("exponential", 0.1, 1.0, _exponential),),
    },
    other={
        "development": (Form("two-gaussians", 0.1, 0.8, _two_gaussians, _draw_two),),
        "validation": (Form("long-tailed", 0.1, 0.7, _long_tailed, _draw_tail),),
        "final": (Form("one-sided", 0.1, 1.0, _one_sided, _draw_side),),
    },
)
