"""What no library claims: a gap that lies along a column of the table that has no physics there.

Size: relative change of force, from one operator to the other or from end to end of the tray.
"""

from dataclasses import replace

import numpy as np

from benchmarks.withheld.reality.bench import Bench
from benchmarks.withheld.reality.design import Design
from benchmarks.withheld.reality.effects.form import Effect, Form, Set, Shape, number, sign

__all__ = ["OPERATOR", "TRAY"]

_TRAY_MM = 490.0


def _operator(bench: Bench, size: float, shape: Shape) -> Bench:
    careless = np.where(bench.design.operator == "B", number(shape, "sign") * size, 0.0)
    return replace(bench, gain=bench.gain * (1.0 + careless)[:, None])


def _tray(bench: Bench, size: float, shape: Shape) -> Bench:
    along = bench.design.tray_x_mm / _TRAY_MM - 0.5
    return bench.stiffened(1.0 + number(shape, "sign") * size * along)


def _lamp(bench: Bench, size: float, shape: Shape) -> Bench:
    """A lamp that is weak towards both ends of the tray."""
    along = 2.0 * bench.design.tray_x_mm / _TRAY_MM - 1.0
    return bench.stiffened(1.0 + number(shape, "sign") * size * (along**2 - 1.0 / 3.0))


def _halves(bench: Bench, size: float, shape: Shape) -> Bench:
    """Two heads, each of which prints one half of the tray."""
    right = np.where(bench.design.tray_x_mm > 0.5 * _TRAY_MM, 0.5, -0.5)
    return bench.stiffened(1.0 + number(shape, "sign") * size * right)


def _fill(bench: Bench, size: float, shape: Shape) -> Bench:
    """Ever less material is printed, from one end of the tray to the other."""
    along = bench.design.tray_x_mm / _TRAY_MM
    return replace(bench, gain=bench.gain * (1.0 - size * along)[:, None])


def _draw(rng: np.random.Generator, design: Design) -> Shape:
    return {"sign": sign(rng)}


_BY_OPERATOR: dict[Set, tuple[Form, ...]] = {
    "development": (Form("operator", 0.04, 0.25, _operator, _draw),),
    "validation": (Form("operator", 0.06, 0.25, _operator, _draw),),
    "final": (Form("operator", 0.05, 0.3, _operator, _draw),),
}
_BY_TRAY: dict[Set, tuple[Form, ...]] = {
    "development": (Form("tray", 0.06, 0.4, _tray, _draw),),
    "validation": (Form("halves", 0.06, 0.3, _halves, _draw),),
    "final": (Form("lamp", 0.06, 0.4, _lamp, _draw),),
}
OPERATOR = Effect(
    "operator", 4, ("operator",), _BY_OPERATOR, _BY_OPERATOR,
    measured=(Form("operator", 0.002, 0.03, _operator, _draw),),
)  # fmt: skip
TRAY = Effect(
    "tray", 1, ("tray_x_mm",), _BY_TRAY, _BY_TRAY, measured=(Form("fill", 0.4, 0.9, _fill, _draw),)
)
