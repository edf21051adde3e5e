"""Machine compliance: frame, load cell and grips give, and give it back.

Size: travel per force, mm/N.
"""

from dataclasses import replace

import numpy as np

from benchmarks.withheld.reality.bench import Bench, FloatArray
from benchmarks.withheld.reality.design import Design
from benchmarks.withheld.reality.effects.form import Effect, Form, Shape, number

__all__ = ["EFFECT"]


def _linear(bench: Bench, size: float, shape: Shape) -> Bench:
    return replace(bench, compliance_mm=lambda force: (size * force, np.full_like(force, size)))


def _stiffening(bench: Bench, size: float, shape: Shape) -> Bench:
    """Joints that close: the first newtons give more."""
    more, force_N = number(shape, "more"), number(shape, "closing_N")

    def compliance_mm(force: FloatArray) -> tuple[FloatArray, FloatArray]:
        first = np.tanh(force / force_N)
        slope = size * (1.0 + more * (1.0 - first**2))
        return size * (force + more * force_N * first), slope

    return replace(bench, compliance_mm=compliance_mm)


def _hertz(bench: Bench, size: float, shape: Shape) -> Bench:
    """Contacts that flatten, in series with a linear frame: force to a power below 1."""
    power, share, force_N = 2.0 / 3.0, number(shape, "contact_share"), 20.0

    def compliance_mm(force: FloatArray) -> tuple[FloatArray, FloatArray]:
        smooth = np.sqrt(force**2 + 0.01**2)
        contact = force * (smooth / force_N) ** (power - 1.0)
        slope = (smooth / force_N) ** (power - 1.0) * (1.0 + (power - 1.0) * force**2 / smooth**2)
        return size * ((1.0 - share) * force + share * contact), size * (
            1.0 - share + share * slope
        )

    return replace(bench, compliance_mm=compliance_mm)


def _yielding(bench: Bench, size: float, shape: Shape) -> Bench:
    """A frame that gives ever more, as a belt's teeth climb."""
    more, force_N = number(shape, "more"), number(shape, "climbing_N")

    def compliance_mm(force: FloatArray) -> tuple[FloatArray, FloatArray]:
        over = np.abs(force) / force_N
        slope = size * (1.0 + more * over * (2.0 + over) / (1.0 + over) ** 2)
        return size * force * (1.0 + more * over / (1.0 + over)), slope

    return replace(bench, compliance_mm=compliance_mm)


def _draw_closing(rng: np.random.Generator, design: Design) -> Shape:
    return {"more": float(rng.uniform(0.5, 2.0)), "closing_N": float(rng.uniform(2.0, 15.0))}


def _draw_contact(rng: np.random.Generator, design: Design) -> Shape:
    return {"contact_share": float(rng.uniform(0.3, 0.8))}


def _draw_climbing(rng: np.random.Generator, design: Design) -> Shape:
    return {"more": float(rng.uniform(0.5, 2.0)), "climbing_N": float(rng.uniform(5.0, 40.0))}


EFFECT = Effect(
    "machine-compliance",
    stage=3,
    where=("material", "width_mm", "thickness_mm", "gauge_mm", "strain"),
    library={
        "development": (Form("linear", 1 / 300, 1 / 25, _linear),),
        "validation": (Form("linear", 1 / 280, 1 / 22, _linear),),
        "final": (Form("linear", 1 / 250, 1 / 20, _linear),),
    },
    other={
        "development": (Form("stiffening", 1 / 300, 1 / 25, _stiffening, _draw_closing),),
        "validation": (Form("yielding", 1 / 280, 1 / 22, _yielding, _draw_climbing),),
        "final": (Form("hertz", 1 / 250, 1 / 20, _hertz, _draw_contact),),
    },
)
