"""What a screen shows of shells: positions rounded, triangles few enough, colours told apart."""

import bisect
import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from planner.glance import channels
from planner.mesh.mesh import cancel_opposite, compact, face_normal
from planner.numerics import Float32Array, FloatArray, IntArray, kernel
from planner.report.svg import ramp

__all__ = ["ScreenGrid", "Shown", "colours_told_apart", "shown", "thinned"]


# ------------------------------------------------------------------------------------------------
# Shells as a screen needs them: 16 bits a coordinate, and no more triangles than it can turn.
#
# Positions are moved to the points of a grid, all shells alike. That takes closed shells to closed
# shells, and neighbours that fit triangle for triangle to neighbours that fit: moving the vertices
# of a sum of triangles does not open its boundary, and what collapses has no boundary of its own.


_MOST_TRIANGLES = 400_000
"""Shown at most: a processor of two cores, without a graphics card, has so many on the screen after
3.2 s (headless Chromium, SwiftShader), of the 5 s that a page may take."""

_Indexed: TypeAlias = tuple[Float32Array | FloatArray, IntArray]
"""Vertices (n, 3) in mm and faces (m, 3)."""


_STEPS = 65535
"""Positions along the longest edge of a box: what 16 bits count."""


@dataclass(frozen=True, slots=True, eq=False)
class ScreenGrid:
    """The grid over a box that positions are counted on: 0 to `_STEPS` along its longest edge."""

    origin_mm: FloatArray
    step_mm: float

    @classmethod
    def over(cls, points_mm: Sequence[Float32Array | FloatArray]) -> "ScreenGrid":
        """Return the grid over the box of sets of points (n, 3), of which some may be empty."""
        axes = np.concatenate(points_mm).T
        low, high = (np.array(list(map(find, axes)), np.float64) for find in (np.min, np.max))
        return cls(low, float((high - low).max()) / _STEPS or 1.0)

    def counts(self, points_mm: Float32Array | FloatArray) -> NDArray[np.int64]:
        """Return the nearest points of the grid, (n, 3)."""
        return np.floor((points_mm - self.origin_mm) / self.step_mm + 0.5).astype(np.int64)


@dataclass(frozen=True, slots=True, eq=False)
class Shown:
    """Shells for display: a vertex lies at ``origin_mm + step_mm * point``.

    Attributes
    ----------
    shells
        Points (n, 3) uint16, distinct, and faces (m, 3) of each.
    triangles, of
        Shown, and of how many.
    moved_mm
        How far a vertex lies from its place at most.
    """

    origin_mm: FloatArray
    step_mm: float
    shells: tuple[tuple[NDArray[np.uint16], IntArray], ...]
    triangles: int
    of: int
    moved_mm: float

    @property
    def simplified(self) -> bool:
        """Whether triangles were left out, and not positions rounded alone."""
        return self.moved_mm > self.step_mm


def shown(shells: Sequence[_Indexed], most: int = _MOST_TRIANGLES) -> Shown:
    """Return shells for display, with at most about so many triangles, and at least one shell."""
    grid = ScreenGrid.over([vertices for vertices, _ in shells])
    step_mm = grid.step_mm
    places = (grid.counts(vertices).T for vertices, _ in shells)
    packed = [x << 32 | y << 16 | z for x, y, z in places]
    keys, at = np.unique(np.concatenate(packed), return_inverse=True)
    points = np.stack([keys >> 32, (keys >> 16) & 0xFFFF, keys & 0xFFFF], axis=1)
    begin = itertools.accumulate((len(vertices) for vertices, _ in shells), initial=0)
    faces = [at.take(b + f).astype(np.int32) for b, (_, f) in zip(begin, shells, strict=False)]
    of, moved_mm = sum(map(len, faces)), step_mm * 0.75**0.5
    if of > most:
        taken = _coarse(points, faces, most)
        away = points - points.take(taken, axis=0)
        moved_mm += step_mm * float(np.sqrt((away**2).sum(axis=1).max()))
        faces = [taken.take(f) for f in faces]
    own = [compact(f.compress(cancel_opposite(f), axis=0), len(points)) for f in faces]
    kept = tuple((points.take(used, axis=0).astype(np.uint16), f) for used, f in own)
    return Shown(grid.origin_mm, step_mm, kept, sum(len(f) for _, f in kept), of, moved_mm)


def thinned(
    vertices: FloatArray, faces: NDArray[np.int32], most: int
) -> tuple[IntArray, NDArray[np.int32]]:
    """Return which vertices of a closed surface to keep, and its faces in terms of those alone.

    Parameters
    ----------
    most
        Triangles that are left, at most about so many.
    """
    if len(faces) > most:
        faces = _coarse(ScreenGrid.over([vertices]).counts(vertices), [faces], most)[faces]
        faces = faces[cancel_opposite(faces)]
    return compact(faces, len(vertices))


def _coarse(points: IntArray, faces: Sequence[IntArray], most: int) -> NDArray[np.int32]:
    """Return the vertex that each one moves to, so that about `most` triangles are left.

    Vertices move within the cells of a grid, and only among those that the same shells have: an
    interface stays on itself, and layers thinner than a cell stay apart. A surface has two
    triangles a vertex, so that triangles fall as occupied cells do. Of a cell's vertices the
    sharpest stays, so that edges, corners and the rims of interfaces stay where they are, and flat
    faces flat. Sharp is the area about a vertex, of each shell, that its mean plane does not have.
    """
    shared = _shared(len(points), faces)
    share = most / sum(map(len, faces))
    sizes = sorted({round(2.0 ** (n / 8.0)) for n in range(8, 121)})  # a cell's edge in steps

    def few(size: int) -> bool:
        return _distinct(_cells(points, shared, size)) <= share * len(points)

    size = sizes[bisect.bisect_left(sizes, True, hi=len(sizes) - 1, key=few)]
    cells = _cells(points, shared, size)
    sharp = np.zeros((len(points), 4))
    for f in faces:
        _add_areas(points, np.require(f, np.int32, ["C", "W"]), sharp)
    sharpness = sharp[:, 0] - np.sqrt((sharp[:, 1:] ** 2).sum(axis=1))
    order = np.lexsort((-sharpness, cells))  # by cell, the sharpest first
    starts = np.flatnonzero(np.append(True, np.diff(cells[order]) != 0))
    taken = np.empty(len(points), np.int32)
    taken[order] = np.repeat(order[starts], np.diff(starts, append=len(order)))
    return taken


@kernel
def _add_areas(points: Any, faces: Any, sums: Any) -> None:
    """Add twice the area of each face, and its normal times that, to the sums of its corners."""
    for f in range(faces.shape[0]):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        x, y, z = face_normal(points, a, b, c)
        nx, ny, nz = float(x), float(y), float(z)
        area = np.sqrt(nx * nx + ny * ny + nz * nz)
        for corner in (a, b, c):
            sums[corner, 0] += area
            sums[corner, 1] += nx
            sums[corner, 2] += ny
            sums[corner, 3] += nz


def _distinct(cells: IntArray) -> int:
    """Estimate how many cells there are, within a per cent or so: count a sixteenth of them."""
    spread = cells * np.int64(0x1E3779B97F4A7C15)  # wraps around
    return 16 * len(np.unique(cells[spread & (15 << 59) == 0]))


def _shared(count: int, faces: Sequence[IntArray]) -> IntArray:
    """Return by vertex a number of the set of shells that have it."""
    shells = np.zeros(count, np.int64)
    for number, f in enumerate(faces):
        shells[f] |= 1 << number % _BITS
    return np.asarray(np.unique(shells, return_inverse=True)[1] % _SETS)


_BITS, _SETS = 62, 1 << 15
"""Shells and sets of shells told apart; of more, some that are far from each other count as one."""


def _cells(points: IntArray, shared: IntArray, size: int) -> IntArray:
    x, y, z = (points // size).T
    return np.asarray(shared << 48 | x << 32 | y << 16 | z)


# ------------------------------------------------------------------------------------------------
# Colours that everyone can tell apart, the colour-blind included.


_JUST_NOTICEABLE = 0.02
"""Of the distance in Oklab, by CSS Color 4, section 13.2."""

_SCALE = (
    "#FDC527", "#FCA338", "#F58C46", "#E76F5A", "#D8576B", "#C5407E", "#AE2892", "#900DA4",
    "#7201A8", "#5302A3", "#38049A",
)  # fmt: skip
"""From soft to hard where a palette's own colours are too alike: lightness falls all the way
(the colour map "plasma" of matplotlib, CC0)."""

# How a colour looks without one kind of cone: Machado, Oliveira and Fernandes 2009, severity 1,
# on linear light.
_BLIND = (
    ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    ((0.152286, 1.052583, -0.204868), (0.114503, 0.786281, 0.099216),
     (-0.003882, -0.048116, 1.051998)),
    ((0.367322, 0.860646, -0.227968), (0.280085, 0.672501, 0.047413),
     (-0.011820, 0.042940, 0.968881)),
    ((1.255528, -0.076749, -0.178779), (-0.078411, 0.930809, 0.147602),
     (0.004733, 0.691367, 0.303900)),
)  # fmt: skip

# Oklab of linear light (Ottosson 2020): to cones, and from their cube roots.
_CONES = np.array(
    [[0.4122214708, 0.5363325363, 0.0514459929], [0.2119034982, 0.6806995451, 0.1073969566],
     [0.0883024619, 0.2817188376, 0.6299787005]]
)  # fmt: skip
_LAB = np.array(
    [[0.2104542553, 0.7936177850, -0.0040720468], [1.9779984951, -2.4285922050, 0.4505937099],
     [0.0259040371, 0.7827717662, -0.8086757660]]
)  # fmt: skip


def colours_told_apart(colours: Sequence[str]) -> tuple[str, ...]:
    """Return these colours "#RRGGBB", or others where two of them look alike.

    Two look alike where someone, colour-blind or not, just notices their difference or does not.
    The scale from soft to hard that takes their place does so only where all of it is told apart.
    """
    own = tuple(colours)
    if _least_distance(own) >= _JUST_NOTICEABLE:
        return own
    last = len(_SCALE) - 1
    scale = tuple(ramp(_SCALE, range(last + 1), np.linspace(0.0, last, len(own))))
    return scale if _least_distance(scale) >= _JUST_NOTICEABLE else own


def _least_distance(colours: Sequence[str]) -> float:
    share = np.array([channels(colour) for colour in colours]).reshape(-1, 3) / 255.0
    light = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    seen = np.clip(light @ np.swapaxes(_BLIND, 1, 2), 0.0, 1.0)  # by each kind of eyes
    lab = np.cbrt(seen @ _CONES.T) @ _LAB.T
    one, other = np.triu_indices(len(colours), 1)
    return float(np.linalg.norm(lab[:, one] - lab[:, other], axis=2).min(initial=np.inf))
