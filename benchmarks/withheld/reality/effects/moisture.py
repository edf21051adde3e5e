"""Moisture: water that has come in plasticises; how much came in depends on time and thickness.

Size: relative loss of stiffness at saturation.
"""

import numpy as np

from benchmarks.withheld.reality.bench import Bench, FloatArray
from benchmarks.withheld.reality.design import Design
from benchmarks.withheld.reality.effects.form import Effect, Form, Shape, number

__all__ = ["EFFECT"]


def _plate_uptake(time_over_square: FloatArray) -> FloatArray:
    """Return the uptake of a plate by Fick's series, of D t / thickness²."""
    odd = 2.0 * np.arange(40) + 1.0
    decay = np.exp(-(odd**2) * np.pi**2 * time_over_square[:, None])
    series = 8.0 / np.pi**2 * np.sum(decay / odd**2, axis=1)
    return np.where(time_over_square > 0.0, 1.0 - series, 0.0)


def _soaked_h(bench: Bench) -> FloatArray:
    return np.maximum(bench.design.soak_h - bench.palette.soak_h, 0.0)


def _root_time(bench: Bench, size: float, shape: Shape) -> Bench:
    thin = 3.0 / bench.design.thickness_mm
    uptake = np.minimum(1.0, thin * np.sqrt(_soaked_h(bench) / number(shape, "saturation_h")))
    return bench.stiffened(1.0 - size * uptake)


def _fick(bench: Bench, size: float, shape: Shape) -> Bench:
    scaled = number(shape, "diffusion_mm2_h") * _soaked_h(bench)
    return bench.stiffened(1.0 - size * _plate_uptake(scaled / bench.design.thickness_mm**2))


def _two_stage(bench: Bench, size: float, shape: Shape) -> Bench:
    soaked, first = _soaked_h(bench), number(shape, "first_share")
    scaled = number(shape, "diffusion_mm2_h") * soaked / bench.design.thickness_mm**2
    swelling = 1.0 - np.exp(-soaked / number(shape, "swelling_h"))
    return bench.stiffened(1.0 - size * (first * _plate_uptake(scaled) + (1.0 - first) * swelling))


def _two_sided(bench: Bench, size: float, shape: Shape) -> Bench:
    """Water enters by the edges too, and the modulus falls exponentially with it."""
    scaled = number(shape, "diffusion_mm2_h") * _soaked_h(bench)
    through = 1.0 - _plate_uptake(scaled / bench.design.thickness_mm**2)
    across = 1.0 - _plate_uptake(scaled / bench.design.width_mm**2)
    uptake = 1.0 - through * across
    power = number(shape, "power")
    return bench.stiffened((1.0 - size) ** (uptake**power))


def _first_order(bench: Bench, size: float, shape: Shape) -> Bench:
    uptake = -np.expm1(-_soaked_h(bench) / number(shape, "uptake_h"))
    return bench.stiffened(1.0 - size * uptake)


def _front(bench: Bench, size: float, shape: Shape) -> Bench:
    """A sharp front from both faces: what it has passed is soft, the rest as printed."""
    passed_mm = 2.0 * np.sqrt(number(shape, "diffusion_mm2_h") * _soaked_h(bench))
    wet = np.minimum(passed_mm / bench.design.thickness_mm, 1.0)
    return bench.stiffened(1.0 - size * wet ** number(shape, "power"))


def _draw_saturation(rng: np.random.Generator, design: Design) -> Shape:
    return {"saturation_h": float(rng.uniform(12.0, 40.0))}


def _draw_diffusion(rng: np.random.Generator, design: Design) -> Shape:
    return {"diffusion_mm2_h": float(np.exp(rng.uniform(np.log(0.03), np.log(0.2))))}


def _draw_two_stage(rng: np.random.Generator, design: Design) -> Shape:
    return {
        **_draw_diffusion(rng, design),
        "first_share": float(rng.uniform(0.5, 0.8)),
        "swelling_h": float(rng.uniform(20.0, 80.0)),
    }


def _draw_two_sided(rng: np.random.Generator, design: Design) -> Shape:
    return {**_draw_diffusion(rng, design), "power": float(rng.uniform(0.8, 1.5))}


def _draw_uptake(rng: np.random.Generator, design: Design) -> Shape:
    return {"uptake_h": float(np.exp(rng.uniform(np.log(3.0), np.log(30.0))))}


EFFECT = Effect(
    "moisture",
    stage=1,
    where=("soak_h",),
    library={
        "development": (Form("root-time", 0.02, 0.35, _root_time, _draw_saturation),),
        "validation": (Form("first-order", 0.03, 0.35, _first_order, _draw_uptake),),
        "final": (Form("fick", 0.03, 0.4, _fick, _draw_diffusion),),
    },
    other={
        "development": (Form("two-stage", 0.02, 0.35, _two_stage, _draw_two_stage),),
        "validation": (Form("front", 0.03, 0.4, _front, _draw_two_sided),),
        "final": (Form("two-sided", 0.03, 0.4, _two_sided, _draw_two_sided),),
    },
)
