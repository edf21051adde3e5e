"""Voxels of a band of a mesh that no ball of a given size reaches, gathered into places."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from planner.arrays import BoolArray, FloatArray, IntArray
from planner.geometry.columns import MOST_VOXELS, Columns, Grid, iterate_columns
from planner.geometry.labels import label_by_planes
from planner.geometry.mesh import Mesh
from planner.geometry.morphology import (
    ROOM,
    Bits,
    active_words,
    add_runs,
    ball,
    components,
    empty_set,
    grow,
    members,
    morph,
    runs_of,
)

__all__ = ["Band", "Place", "Raster", "places_in", "raster_for", "thin_places", "turned"]

FINEST_RADIUS = 5  # of the ball in voxels: the pitch is the ball's diameter / 11
COARSEST_RADIUS = 2
SAMPLES = 8
"""Voxels that a place brings to be measured at."""

_SET_BYTES = 6 << 20  # of one set of a slab without its halo; about ten live at once
_LEAST_ROWS = 16  # of such a slab, or the halo would cost most of the time
MOST_WORK = {5: 2_500_000, 4: 4_000_000, 3: 200_000_000}
"""What `raster_for` may spend on a region with a ball of a radius; the coarsest may cost all."""


@dataclass(frozen=True)
class Band:
    """The part of a mesh with low <= normal . x < high, in mm; infinite where no plane cuts."""

    normal: FloatArray
    low_mm: float
    high_mm: float


@dataclass(frozen=True)
class Raster:
    """A grid for a band, and the ball that opens it.

    Attributes
    ----------
    order
        Axes of the mesh that are the grid's x, y and z: the longest is z, along which runs lie.
    radius
        Of the ball, in voxels.
    slab_rows
        Rows that are worked on at once, without their halo.
    """

    order: IntArray
    grid: Grid
    radius: int
    slab_rows: int

    @property
    def reach(self) -> int:
        """How many voxels a place extends from sound material before it counts."""
        return 2 * self.radius + 1

    @property
    def halo(self) -> int:
        """Rows on either side of a slab that bear on it, once it is opened."""
        return 2 * self.reach + 1

    def position_mm(self, voxel: IntArray) -> FloatArray:
        """Return the centre of a voxel in the mesh's axes."""
        position = np.empty(3)
        position[self.order] = self.grid.centre_mm(voxel)
        return position


@dataclass(frozen=True)
class Place:
    """A connected set of thin voxels.

    Attributes
    ----------
    deepest
        The voxel that lies furthest from the surface, among those that count.
    low, high
        Smallest voxel, and one past the largest, along the grid's axes.
    alone
        Whether it touches no other voxel of the band.
    core : (n, 3)
        Up to `SAMPLES` voxels spread over it, each as far from the surface as its column goes.
    """

    deepest: IntArray
    low: IntArray
    high: IntArray
    voxels: int
    alone: bool
    core: IntArray


def raster_for(
    low_mm: FloatArray,
    high_mm: FloatArray,
    diameter_mm: float,
    most_work: Mapping[int, int] = MOST_WORK,
) -> Raster:
    """Choose a grid for a box and a ball: the finest that is cheap in memory and time.

    Parameters
    ----------
    most_work
        By the ball's radius in voxels: columns times lines of the ball.
    """
    order = np.argsort(high_mm - low_mm, kind="stable")
    for radius in range(FINEST_RADIUS, COARSEST_RADIUS - 1, -1):
        pitch = diameter_mm / (2 * radius + 1)
        origin = low_mm[order] - pitch
        shape = np.ceil((high_mm - low_mm)[order] / pitch).astype(np.int64) + 2
        row_bytes = (int(shape[0]) + 2 * ROOM) * (int(shape[2]) // 64 + 3) * 8
        rows = _SET_BYTES // row_bytes
        work = int(shape[0]) * int(shape[1]) * len(ball(radius))
        small = rows >= min(_LEAST_ROWS, int(shape[1])) and int(shape.max()) <= MOST_VOXELS
        if small and work <= most_work.get(radius, 0):
            break
    x, y, z = (float(o) for o in origin)
    nx, ny, nz = (int(n) for n in shape)
    grid = Grid((x, y, z), (pitch, pitch, pitch), (nx, ny, nz))
    return Raster(order, grid, radius, max(min(rows, ny), _LEAST_ROWS))


def thin_places(mesh: Mesh, band: Band, raster: Raster) -> list[Place]:
    """Return the places of a band that the raster's ball does not reach.

    Opening by the ball leaves slivers at every convex edge; a place counts from the voxels on
    that lie further than `Raster.reach` steps inside the band from what the ball reaches, and
    extends back to it. A sharp corner, where such voxels take up less than the ball's radius in
    every direction, does not count.
    """
    return places_in(_chunks(mesh, band, raster), raster)


def places_in(words: Iterator[tuple[Bits, ...]], raster: Raster) -> list[Place]:
    """Return the places of a set that the raster's ball does not reach; see `thin_places`.

    Parameters
    ----------
    words
        The set, slab by slab of `Raster.slab_rows` rows.
    """
    found = []
    slabs = _windows(_opened(words, raster), raster, raster.halo)
    for first, last, low, (region, opened) in slabs:
        reached = opened.copy()
        if not grow(reached, region, raster.reach):
            continue
        core = region & ~reached
        place, thin = core.copy(), region & ~opened
        grow(place, thin, raster.reach)
        runs = runs_of(place, first - low, last - low)
        if len(runs):
            beside = region & ~place
            grow(beside, region, 2)
            touching = members(runs, place & beside)[:, 0] >= 0
            counting = members(runs, core)
            depth, voxel = _deepest(runs, region, core, raster.radius)
            runs[:, 0] += low
            table = [runs, touching, depth, voxel, counting[:, [0, 2]]]
            found.append(np.column_stack(table).astype(np.int64))
    return _gather(np.concatenate(found), raster.radius) if found else []


def _deepest(runs: IntArray, region: Bits, core: Bits, radius: int) -> tuple[IntArray, IntArray]:
    # per run: the radius of the largest ball around a core voxel, and the voxel (-1: no core)
    active = active_words(region, radius)
    voxel = members(runs, core)[:, 1]
    depth = np.where(voxel >= 0, 0, -1)
    for size in range(1, radius + 1):
        inner = members(runs, morph(region, ball(size), False, region, active) & core)[:, 1]
        if not (inner >= 0).any():
            break
        voxel = np.where(inner >= 0, inner, voxel)
        depth = np.where(inner >= 0, size, depth)
    return depth, voxel


def _gather(runs: IntArray, shortest: int) -> list[Place]:
    # columns of runs: row, column, start, stop, touching, depth, voxel, first and last of core
    number = components(np.ascontiguousarray(runs[:, :4]))
    order = np.argsort(number, kind="stable")
    places = []
    for group in np.split(runs[order], np.flatnonzero(np.diff(number[order])) + 1):
        core = group[group[:, 5] >= 0]
        if not len(core):
            continue
        alone = not group[:, 4].any()
        longest = max(np.ptp(core[:, 0]), np.ptp(core[:, 1]), core[:, 8].max() - core[:, 7].min())
        if not alone and longest + 1 < shortest:
            continue
        deepest = core[core[:, 5] == core[:, 5].max()]
        row, column, _, _, _, _, voxel = deepest[len(deepest) // 2, :7]
        spread = np.linspace(0, len(core) - 1, SAMPLES).astype(np.int64)
        places.append(
            Place(
                deepest=np.array([column, row, voxel]),
                low=group[:, [1, 0, 2]].min(axis=0),
                high=group[:, [1, 0, 3]].max(axis=0) + np.array([1, 1, 0]),
                voxels=int((group[:, 3] - group[:, 2]).sum()),
                alone=alone,
                core=core[np.unique(spread)][:, [1, 0, 6]],
            )
        )
    return places


def _windows(
    chunks: Iterator[tuple[Bits, ...]], raster: Raster, halo: int
) -> Iterator[tuple[int, int, int, tuple[Bits, ...]]]:
    # slabs with a halo: rows first to last of interest, the window's first row, and its sets
    rows = raster.grid.shape[1]
    held, base = next(chunks), 0
    for first in range(0, rows, raster.slab_rows):
        last = min(first + raster.slab_rows, rows)
        low, high = max(first - halo, 0), min(last + halo, rows)
        parts = [tuple(part[low - base :] for part in held)]
        until = base + len(held[0])
        while until < high:
            parts.append(next(chunks))
            until += len(parts[-1][0])
        if len(parts) > 1:
            held = tuple(np.concatenate(pieces) for pieces in zip(*parts, strict=True))
        else:
            held = parts[0]
        base = low
        yield first, last, low, tuple(part[: high - low] for part in held)


def _opened(words: Iterator[tuple[Bits, ...]], raster: Raster) -> Iterator[tuple[Bits, ...]]:
    # a set's voxels and those of them that the ball reaches, slab by slab
    lines = ball(raster.radius)
    windows = _windows(words, raster, 2 * raster.radius)
    for first, last, low, (region,) in windows:
        active = active_words(region, raster.radius)
        eroded = morph(region, lines, False, region, active)
        opened = morph(eroded, lines, True, region, active)
        yield region[first - low : last - low], opened[first - low : last - low]


def _chunks(mesh: Mesh, band: Band, raster: Raster) -> Iterator[tuple[Bits, ...]]:
    # the band's voxels; sheets thinner than a voxel come from columns along the other two axes
    columns, _, voxels = raster.grid.shape
    sheets = np.concatenate(
        [_thin_voxels(mesh, band, raster, turn) for turn in ((2, 1, 0), (0, 2, 1))]
    )
    sheets = sheets[np.argsort(sheets[:, 1], kind="stable")]
    for slab, wanted in _band_columns(mesh, band, raster, raster.slab_rows):
        bits = empty_set(slab.rows, columns, voxels)
        add_runs(bits, 0, slab.offsets, slab.start, slab.stop, wanted)
        ends = np.searchsorted(sheets[:, 1], [slab.first_row, slab.first_row + slab.rows])
        column, row, voxel = sheets[ends[0] : ends[1]].T
        words = (row - slab.first_row, ROOM + column, 1 + (voxel >> 6))
        np.bitwise_or.at(bits, words, np.uint64(1) << (voxel & 63).astype(np.uint64))
        yield (bits,)


def _thin_voxels(mesh: Mesh, band: Band, raster: Raster, turn: tuple[int, int, int]) -> IntArray:
    # voxels (n, 3) in the raster's axes where columns along another axis are one voxel thick
    found = [np.empty((0, 3), np.int64)]
    for slab in iterate_columns(*turned(mesh, raster, turn), shortest=1):
        thin = np.flatnonzero(slab.stop - slab.start == 1)
        column = np.searchsorted(slab.offsets, thin, side="right") - 1
        row, i = np.divmod(column, slab.grid.shape[0])
        voxels = np.empty((len(thin), 3), np.int64)
        voxels[:, turn] = np.column_stack([i, row + slab.first_row, slab.start[thin]])
        x, y, z = (raster.grid.centre_mm(voxels) * band.normal[raster.order]).T
        along = x + y + z
        found.append(voxels[(along >= band.low_mm) & (along < band.high_mm)])
    return np.concatenate(found)


def _band_columns(
    mesh: Mesh, band: Band, raster: Raster, rows: int
) -> Iterator[tuple[Columns, BoolArray]]:
    # columns along the raster's z, with the runs that lie in the band
    planes = np.array([band.low_mm, band.high_mm])
    cuts = planes[np.isfinite(planes)]
    along, grid = turned(mesh, raster, (0, 1, 2))
    for slab in iterate_columns(along, grid, slab_rows=rows, shortest=1):
        labelled = label_by_planes(slab, band.normal[raster.order], cuts)
        yield labelled, labelled.label == int(np.isfinite(band.low_mm))


def turned(mesh: Mesh, raster: Raster, turn: tuple[int, int, int]) -> tuple[Mesh, Grid]:
    """Return mesh and grid with the raster's axes in another order."""
    axes = raster.order[list(turn)]
    odd = np.linalg.det(np.eye(3)[axes]) < 0  # a mirror image: turn the faces around
    grid = raster.grid
    x, y, z = turn
    return Mesh(mesh.vertices[:, axes], mesh.faces[:, ::-1] if odd else mesh.faces), Grid(
        (grid.origin_mm[x], grid.origin_mm[y], grid.origin_mm[z]),
        grid.pitch_mm,
        (grid.shape[x], grid.shape[y], grid.shape[z]),
    )
