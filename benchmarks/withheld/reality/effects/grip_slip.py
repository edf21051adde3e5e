"""Grip slip: the specimen creeps out of the grips as the pull grows, and stays out.

Size: travel lost per line load (force over width), mm per N/mm.
"""

from dataclasses import replace

import numpy as np

from benchmarks.withheld.reality.bench import Bench, FloatArray
from benchmarks.withheld.reality.design import Design
from benchmarks.withheld.reality.effects.form import Effect, Form, Shape, listed, number

__all__ = ["EFFECT"]


def _above_threshold(bench: Bench, size: float, shape: Shape) -> Bench:
    width, start = bench.design.width_mm, number(shape, "start_N_mm")

    def slip_mm(force: FloatArray) -> tuple[FloatArray, FloatArray]:
        load = force / width
        return size * np.maximum(load - start, 0.0), np.where(load > start, size / width, 0.0)

    return replace(bench, slip_mm=slip_mm)


def _power(bench: Bench, size: float, shape: Shape) -> Bench:
    width, power = bench.design.width_mm, number(shape, "power")

    def slip_mm(force: FloatArray) -> tuple[FloatArray, FloatArray]:
        load = np.maximum(force / width, 1e-9)
        return size * load**power, size * power * load ** (power - 1.0) / width

    return replace(bench, slip_mm=slip_mm)


def _stick_slip(bench: Bench, size: float, shape: Shape) -> Bench:
    """Steps: the grip holds, then gives by one step's worth."""
    width, step = bench.design.width_mm, number(shape, "step_N_mm")
    relative = listed(shape, "relative", bench)

    def slip_mm(force: FloatArray) -> tuple[FloatArray, FloatArray]:
        turn = 2.0 * np.pi * np.maximum(force, 0.0) / width / step
        travelled = relative * size * step / (2.0 * np.pi) * (turn - 0.9 * np.sin(turn))
        return travelled, relative * size * (1.0 - 0.9 * np.cos(turn)) / width

    return replace(bench, slip_mm=slip_mm)


def _running(bench: Bench, size: float, shape: Shape) -> Bench:
    """Hardly any until the friction of that specimen's grip is spent, then ever faster."""
    width = bench.design.width_mm
    hold = number(shape, "hold_N_mm") * listed(shape, "relative", bench)

    def slip_mm(force: FloatArray) -> tuple[FloatArray, FloatArray]:
        over = np.maximum(force, 0.0) / width / hold
        return size * hold * over**2 / (1.0 + over), size / width * over * (2.0 + over) / (
            1.0 + over
        ) ** 2

    return replace(bench, slip_mm=slip_mm)


def _proportional(bench: Bench, size: float, shape: Shape) -> Bench:
    width = bench.design.width_mm
    return replace(
        bench, slip_mm=lambda force: (size * force / width, np.full_like(force, 1.0) * size / width)
    )


def _catching(bench: Bench, size: float, shape: Shape) -> Bench:
    """Quick at first, until the teeth have caught that specimen."""
    width = bench.design.width_mm
    hold = number(shape, "hold_N_mm") * listed(shape, "relative", bench)

    def slip_mm(force: FloatArray) -> tuple[FloatArray, FloatArray]:
        over = np.maximum(force, 0.0) / width / hold
        return size * hold * np.log1p(over), size / width / (1.0 + over)

    return replace(bench, slip_mm=slip_mm)


def _relative(rng: np.random.Generator, design: Design) -> list[float]:
    return [float(v) for v in np.exp(rng.normal(0.0, 0.3, len(design)))]


def _draw_start(rng: np.random.Generator, design: Design) -> Shape:
    return {"start_N_mm": float(rng.uniform(0.05, 0.5))}


def _draw_power(rng: np.random.Generator, design: Design) -> Shape:
    return {"power": float(rng.uniform(0.7, 1.4))}


def _draw_step(rng: np.random.Generator, design: Design) -> Shape:
    return {"step_N_mm": float(rng.uniform(0.2, 1.0)), "relative": _relative(rng, design)}


def _draw_hold(rng: np.random.Generator, design: Design) -> Shape:
    return {"hold_N_mm": float(rng.uniform(0.3, 2.0)), "relative": _relative(rng, design)}


EFFECT = Effect(
    "grip-slip",
    stage=3,
    where=("material", "branch", "strain", "specimen"),
    library={
        "development": (Form("above-threshold", 0.01, 0.3, _above_threshold, _draw_start),),
        "validation": (Form("proportional", 0.01, 0.3, _proportional),),
        "final": (Form("power", 0.01, 0.3, _power, _draw_power),),
    },
    other={
        "development": (Form("stick-slip", 0.01, 0.3, _stick_slip, _draw_step),),
        "validation": (Form("catching", 0.01, 0.4, _catching, _draw_hold),),
        "final": (Form("running", 0.01, 0.4, _running, _draw_hold),),
    },
)
