"""Skin: the outer layer is cured otherwise, or mixed with support material.

Size: depth of the layer times its relative change of stiffness, mm; the sign is drawn.
"""

import numpy as np

from benchmarks.withheld.reality.base_law import STRAINS
from benchmarks.withheld.reality.bench import Bench, FloatArray
from benchmarks.withheld.reality.design import Design
from benchmarks.withheld.reality.effects.form import Effect, Form, Shape, number, sign

__all__ = ["EFFECT"]


def _all_round(bench: Bench) -> FloatArray:
    """Return the perimeter over the area, 1/mm."""
    return 2.0 / bench.design.width_mm + 2.0 / bench.design.thickness_mm


def _layer(bench: Bench, size: float, shape: Shape) -> Bench:
    return bench.stiffened(1.0 + number(shape, "sign") * size * _all_round(bench))


def _faces(bench: Bench, size: float, shape: Shape) -> Bench:
    """Only the two faces that lie on and under support."""
    return bench.stiffened(1.0 + number(shape, "sign") * size * 2.0 / bench.design.thickness_mm)


def _fading_inwards(bench: Bench, size: float, shape: Shape) -> Bench:
    """A cure that fades exponentially with depth, from all four sides."""
    depth = number(shape, "depth_mm")
    through = size / bench.design.thickness_mm * -np.expm1(-bench.design.thickness_mm / depth)
    across = size / bench.design.width_mm * -np.expm1(-bench.design.width_mm / depth)
    return bench.stiffened(1.0 + number(shape, "sign") * 2.0 * (through + across))


def _cracking(bench: Bench, size: float, shape: Shape) -> Bench:
    """A skin that cracks as it is stretched, and carries less and less."""
    whole = 0.35 + 0.65 * np.exp(-STRAINS / number(shape, "crack_strain"))
    change = number(shape, "sign") * size * _all_round(bench)
    return bench.stiffened(1.0 + change[:, None, None] * whole)


def _sides(bench: Bench, size: float, shape: Shape) -> Bench:
    """Only the two sides, which the support's resin wets."""
    return bench.stiffened(1.0 + number(shape, "sign") * size * 2.0 / bench.design.width_mm)


def _taut(bench: Bench, size: float, shape: Shape) -> Bench:
    """A skin that is slack at first, and carries more and more."""
    carried = 0.4 + 0.6 * -np.expm1(-STRAINS / number(shape, "taut_strain"))
    change = number(shape, "sign") * size * _all_round(bench)
    return bench.stiffened(1.0 + change[:, None, None] * carried)


def _draw(rng: np.random.Generator, design: Design) -> Shape:
    return {"sign": sign(rng)}


def _draw_depth(rng: np.random.Generator, design: Design) -> Shape:
    return {"sign": sign(rng), "depth_mm": float(rng.uniform(0.1, 0.5))}


def _draw_crack(rng: np.random.Generator, design: Design) -> Shape:
    return {"sign": sign(rng), "crack_strain": float(rng.uniform(0.1, 0.3))}


def _draw_taut(rng: np.random.Generator, design: Design) -> Shape:
    return {"sign": sign(rng), "taut_strain": float(rng.uniform(0.05, 0.2))}


EFFECT = Effect(
    "skin",
    stage=1,
    where=("thickness_mm", "width_mm"),
    library={
        "development": (Form("layer", 0.02, 0.2, _layer, _draw),),
        "validation": (Form("sides", 0.05, 0.4, _sides, _draw),),
        "final": (Form("faces", 0.03, 0.25, _faces, _draw),),
    },
    other={
        "development": (Form("fading-inwards", 0.02, 0.2, _fading_inwards, _draw_depth),),
        "validation": (Form("taut", 0.03, 0.25, _taut, _draw_taut),),
        "final": (Form("cracking", 0.03, 0.25, _cracking, _draw_crack),),
    },
)
