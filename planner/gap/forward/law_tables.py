"""The palette's laws as tables, for solvers that call them a million times.

The logarithm of the secant modulus (nominal stress over strain) of every material stands on a
uniform grid of strain, as cubics through values and slopes; a mixture is linear between its two
neighbours in that logarithm, as everywhere in planner. Nothing is asked of the order of the
materials' stiffness, so that palettes whose laws cross can be diagnosed too.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from planner.arrays import FloatArray, IntArray
from planner.errors import PaletteError
from planner.materials.laws import Law, OgdenThesis, make_law
from planner.materials.stiffness import secant_modulus_MPa
from planner.palette import Palette
from planner.simulation.response import FARTHEST

__all__ = ["STRAIN_END", "LawTables", "law_tables"]

STRAIN_END = 3.0
"""The tables' last strain; from there on the stress goes on straight."""

_INTERVALS = 1500
_SLIGHTEST = 0.02
"""Least tangent over secant beyond a law's end, so that its stress goes on rising there."""


@dataclass(frozen=True, slots=True, eq=False)
class LawTables:
    """ln(secant modulus) of every material of a palette over strain.

    Attributes
    ----------
    coordinate : (M,)
        Of the materials, rising.
    strain_step
        Width of an interval.
    cubics : (M, intervals, 4)
        In the place within the interval, 0 to 1; the secant in MPa.
    sound_strain : (M,)
        Where each law ends: it ceases to rise there, or it is `FARTHEST` times the elongation at
        break. Beyond, the stress rises straight on.
    """

    coordinate: FloatArray
    strain_step: float
    cubics: FloatArray
    sound_strain: FloatArray

    def bracket(self, coordinate: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
        """Return the materials below and above, and how far between; clipped to the palette."""
        c = self.coordinate
        m = np.clip(coordinate, c[0], c[-1])
        lower = np.clip(np.searchsorted(c, m, side="right") - 1, 0, max(len(c) - 2, 0))
        upper = np.minimum(lower + 1, len(c) - 1)
        gap = np.where(upper > lower, c[upper] - c[lower], 1.0)
        return lower, upper, (m - c[lower]) / gap

    def stress_MPa(self, coordinate: ArrayLike, strain: ArrayLike) -> FloatArray:
        """Return the nominal stress of mixtures at strains of 0 and above; both broadcast."""
        m, e = np.broadcast_arrays(
            np.asarray(coordinate, dtype=np.float64), np.asarray(strain, dtype=np.float64)
        )
        inside = np.minimum(e, STRAIN_END)
        lower, upper, t = self.bracket(m)
        place = inside / self.strain_step
        interval = np.minimum(place.astype(np.int64), self.cubics.shape[1] - 1)
        s = place - interval
        softer, harder = self.cubics[lower, interval], self.cubics[upper, interval]
        c0, c1, c2, c3 = np.moveaxis(softer + t[..., None] * (harder - softer), -1, 0)
        secant = np.exp(c0 + s * (c1 + s * (c2 + s * c3)))
        slope = (c1 + s * (2.0 * c2 + s * 3.0 * c3)) / self.strain_step
        tangent = secant * (1.0 + inside * slope)
        return np.asarray(secant * inside + tangent * (e - inside))


def law_tables(palette: Palette) -> LawTables:
    """Tabulate a palette's laws.

    Raises
    ------
    PaletteError
        A law that does not rise from rest: nothing can be predicted with it.
    """
    nodes = np.linspace(0.0, STRAIN_END, _INTERVALS + 1)
    tables = []
    for material in palette.materials:
        law = make_law(material.law)
        farthest = FARTHEST * material.elongation_at_break
        table = None if isinstance(law, OgdenThesis) else _cubics(law, nodes, farthest)
        if table is None:
            raise PaletteError(
                f"palette {palette.name}: material {material.id!r}: law: {material.law.model} "
                "is not stress-free at rest or does not rise from there; give a law that does"
            )
        tables.append(table)
    return LawTables(
        coordinate=np.array([m.coordinate for m in palette.materials]),
        strain_step=float(nodes[1]),
        cubics=np.stack([cubics for cubics, _ in tables]),
        sound_strain=np.array([end for _, end in tables]),
    )


def _cubics(law: Law, strain: FloatArray, farthest: float) -> tuple[FloatArray, float] | None:
    """Return ln(secant) as a cubic an interval, and where the law ends; None if at rest."""
    h = float(strain[1])
    with np.errstate(all="ignore"):
        secant = secant_modulus_MPa(law, strain)
        tangent = law.tangent_MPa(1.0 + strain)
    sound = (secant > 0.0) & (tangent > 0.0) & np.isfinite(secant) & np.isfinite(tangent)
    sound &= strain <= max(farthest, 5.0 * h)
    last = len(strain) - 1 if sound.all() else int(np.argmin(sound)) - 1
    if last < 4:
        return None
    end = float(strain[last])
    rise = max(float(tangent[last]), _SLIGHTEST * float(secant[last]))
    beyond = strain[last:]
    secant[last:] = (secant[last] * end + rise * (beyond - end)) / beyond
    tangent[last:] = rise
    g = np.log(secant)
    slope = np.empty_like(g)
    # d ln(P / strain) = T / P - 1 / strain, 0 / 0 at rest: there from the values beside it.
    slope[1:] = (tangent[1:] / secant[1:] - 1.0) / strain[1:] * h
    slope[0] = (-25.0 * g[0] + 48.0 * g[1] - 36.0 * g[2] + 16.0 * g[3] - 3.0 * g[4]) / 12.0
    step = np.diff(g)
    cubics = np.stack(
        [
            g[:-1],
            slope[:-1],
            3.0 * step - 2.0 * slope[:-1] - slope[1:],
            slope[:-1] + slope[1:] - 2.0 * step,
        ],
        axis=1,
    )
    return cubics, end
