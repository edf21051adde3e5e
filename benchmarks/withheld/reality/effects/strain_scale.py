"""Strain scale: the length that stretches is not the gauge length on the drawing.

Size: relative error of the length, at a gauge length of 25 mm; the sign is drawn where a form
allows both.
"""

from dataclasses import replace

import numpy as np

from benchmarks.withheld.reality.bench import Bench
from benchmarks.withheld.reality.design import Design
from benchmarks.withheld.reality.effects.form import Effect, Form, Shape, number, sign

__all__ = ["EFFECT"]

_REFERENCE_GAUGE_MM = 25.0
_REFERENCE_WIDTH_MM = 6.0


def _factor(bench: Bench, size: float, shape: Shape) -> Bench:
    return replace(bench, element_mm=bench.element_mm * (1.0 + number(shape, "sign") * size))


def _fillets(bench: Bench, size: float, shape: Shape) -> Bench:
    """The shoulders stretch too: a length that is added, whatever the gauge."""
    added = size * _REFERENCE_GAUGE_MM / bench.design.gauge_mm
    return replace(bench, element_mm=bench.element_mm * (1.0 + added)[:, None])


def _encoder(bench: Bench, size: float, shape: Shape) -> Bench:
    """An encoder whose scale error comes with the travel."""
    travel = bench.motion.displacement_mm
    scale = -np.expm1(-travel / number(shape, "travel_mm"))
    return replace(
        bench, lost_mm=bench.lost_mm + number(shape, "sign") * size * travel * (0.5 + 0.5 * scale)
    )


def _other_length(bench: Bench, size: float, shape: Shape) -> Bench:
    """Between other marks than was said, by any factor; its size is the factor's logarithm."""
    return replace(bench, element_mm=bench.element_mm * np.exp(number(shape, "sign") * size))


def _wide_shoulders(bench: Bench, size: float, shape: Shape) -> Bench:
    """The shoulders stretch too, the farther the wider the specimen is."""
    wide = bench.design.width_mm / _REFERENCE_WIDTH_MM
    added = size * _REFERENCE_GAUGE_MM / bench.design.gauge_mm * wide ** number(shape, "power")
    return replace(bench, element_mm=bench.element_mm * (1.0 + added)[:, None])


def _draw(rng: np.random.Generator, design: Design) -> Shape:
    return {"sign": sign(rng)}


def _draw_encoder(rng: np.random.Generator, design: Design) -> Shape:
    return {"sign": sign(rng), "travel_mm": float(rng.uniform(2.0, 8.0))}


def _draw_shoulders(rng: np.random.Generator, design: Design) -> Shape:
    return {"power": float(rng.uniform(0.3, 1.0))}


EFFECT = Effect(
    "strain-scale",
    stage=3,
    where=("gauge_mm", "strain"),
    library={
        "development": (Form("factor", 0.03, 0.2, _factor, _draw),),
        "validation": (Form("factor", 0.05, 0.18, _factor, _draw),),
        "final": (Form("factor", 0.04, 0.25, _factor, _draw),),
    },
    other={
        "development": (Form("fillets", 0.03, 0.2, _fillets),),
        "validation": (Form("wide-shoulders", 0.04, 0.2, _wide_shoulders, _draw_shoulders),),
        "final": (Form("encoder", 0.04, 0.2, _encoder, _draw_encoder),),
    },
    measured=(Form("other-length", 0.5, 1.2, _other_length, _draw),),
)
