"""Places of a solid, or of the space around one, that are thinner than a limit."""

import itertools
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from planner.errors import ArgumentError
from planner.fields.basic import Field, PlanarField
from planner.mesh.distance import inscribed_ball
from planner.mesh.mesh import Mesh
from planner.numerics import BoolArray, FloatArray, IntArray, inner_kernel, kernel
from planner.voxels.columns import MOST_VOXELS, Columns, Grid, iterate_columns, label_by_planes
from planner.voxels.morphology import (
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

__all__ = [
    "SOUND",
    "PlanarBand",
    "ThinPlace",
    "ThinWall",
    "longest_checked_mm",
    "raster_for",
    "room_mm",
    "thin_places",
    "thin_solid_places",
    "thin_space_places",
    "thin_walls",
]


# ------------------------------------------------------------------------------------------------
# Voxels of a band of a mesh that no ball of a given size reaches, gathered into places.


FINEST_RADIUS = 5  # of the ball in voxels: the pitch is the ball's diameter / 11
_COARSEST_RADIUS = 2
_SAMPLES = 8
"""Voxels that a place brings to be measured at."""

_SET_BYTES = 6 << 20  # of one set of a slab without its halo; about ten live at once
_LEAST_ROWS = 16  # of such a slab, or the halo would cost most of the time
MOST_WORK = {5: 2_500_000, 4: 4_000_000, 3: 200_000_000}
"""What `raster_for` may spend on a region with a ball of a radius; the coarsest may cost all."""


@dataclass(frozen=True)
class PlanarBand:
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
class ThinVoxels:
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
        Up to `_SAMPLES` voxels spread over it, each as far from the surface as its column goes.
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
    for radius in range(FINEST_RADIUS, _COARSEST_RADIUS - 1, -1):
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


def thin_places(mesh: Mesh, band: PlanarBand, raster: Raster) -> list[ThinVoxels]:
    """Return the places of a band that the raster's ball does not reach.

    Opening by the ball leaves slivers at every convex edge; a place counts from the voxels on
    that lie further than `Raster.reach` steps inside the band from what the ball reaches, and
    extends back to it. A sharp corner, where such voxels take up less than the ball's radius in
    every direction, does not count.
    """
    return _places_in(_chunks(mesh, band, raster), raster)


def _places_in(words: Iterator[tuple[Bits, ...]], raster: Raster) -> list[ThinVoxels]:
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


def _gather(runs: IntArray, shortest: int) -> list[ThinVoxels]:
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
        spread = np.linspace(0, len(core) - 1, _SAMPLES).astype(np.int64)
        places.append(
            ThinVoxels(
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


def _chunks(mesh: Mesh, band: PlanarBand, raster: Raster) -> Iterator[tuple[Bits, ...]]:
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


def _thin_voxels(
    mesh: Mesh, band: PlanarBand, raster: Raster, turn: tuple[int, int, int]
) -> IntArray:
    # voxels (n, 3) in the raster's axes where columns along another axis are one voxel thick
    found = [np.empty((0, 3), np.int64)]
    for slab in iterate_columns(*_turned(mesh, raster, turn), shortest=1):
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
    mesh: Mesh, band: PlanarBand, raster: Raster, rows: int
) -> Iterator[tuple[Columns, BoolArray]]:
    # columns along the raster's z, with the runs that lie in the band
    planes = np.array([band.low_mm, band.high_mm])
    cuts = planes[np.isfinite(planes)]
    along, grid = _turned(mesh, raster, (0, 1, 2))
    for slab in iterate_columns(along, grid, slab_rows=rows, shortest=1):
        labelled = label_by_planes(slab, band.normal[raster.order], cuts)
        yield labelled, labelled.label == int(np.isfinite(band.low_mm))


def _turned(mesh: Mesh, raster: Raster, turn: tuple[int, int, int]) -> tuple[Mesh, Grid]:
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


# ------------------------------------------------------------------------------------------------
# A closed mesh as sets of voxels for `planner.voxels.thin_places`, however thin it is.
#
# A voxel belongs to the solid when its centre does. Where the solid is thinner than a voxel it may
# hold no centre; there the voxels that its triangles pass through are taken instead. They are told
# by their neighbourhood: a solid at least 1.74 voxels thick has a centre within one voxel of every
# point of its surface.


_CELL = 2.0  # voxels: edge of the cells that a triangle is looked at in
_POINTS = 7  # drawn along either edge of a cell and half a cell beyond it
_BESIDE = 3  # rows on either side of a slab that cells reaching into it are told by


def _solid_words(mesh: Mesh, raster: Raster) -> Iterator[tuple[Bits, ...]]:
    """Draw a closed mesh on a raster, slab by slab of `Raster.slab_rows` rows."""
    along, grid = _turned(mesh, raster, (0, 1, 2))
    corners = (along.vertices - np.asarray(grid.origin_mm)) / np.asarray(grid.pitch_mm)
    # rows are below 2^14: sorting whole ones takes a few passes over them
    row = np.clip(np.floor(corners[:, 1]), -1, MOST_VOXELS).astype(np.int16)
    one, two, three = (row[along.faces[:, i]] for i in range(3))
    first = np.minimum(np.minimum(one, two), three)
    order = np.argsort(first, kind="stable").astype(np.int32)
    last = np.maximum.accumulate(np.maximum(np.maximum(one, two), three)[order])
    first = first[order]
    slabs = iterate_columns(along, grid, slab_rows=raster.slab_rows, shortest=1)
    nothing = empty_set(_BESIDE, grid.shape[0], grid.shape[2])
    before, held, start = nothing, _words_drawn(next(slabs)), 0
    while True:
        slab = next(slabs, None)
        after = nothing if slab is None else _words_drawn(slab)
        beside = np.concatenate([after[:_BESIDE], nothing[len(after) :]])
        stop = start + len(held)
        low = int(np.searchsorted(last, start - _BESIDE))
        near = order[low : np.searchsorted(first, stop + _BESIDE, side="right")]
        sheets = np.zeros_like(held)
        _sheets(corners, along.faces, near, start, before, held, beside, sheets)
        yield (held | sheets,)
        if slab is None:
            return
        before = np.concatenate([before, held])[-_BESIDE:].copy()
        held, start = after, stop


def _words_drawn(slab: Columns) -> Bits:
    bits = empty_set(slab.rows, slab.grid.shape[0], slab.grid.shape[2])
    every = np.ones(len(slab.start), dtype=np.bool_)
    add_runs(bits, 0, slab.offsets, slab.start, slab.stop, every)
    return bits


@kernel
def _sheets(
    corners: Any, faces: Any, members: Any, first_row: Any, before: Any, here: Any, after: Any,
    found: Any,
) -> None:  # fmt: skip
    # Marks in `found` the voxels of triangles near which there is none. Triangles are looked at
    # in cells of up to two voxels, in strips along their longest side; also in those cells whose
    # middle lies beside the slab, as they may reach into it.
    rows, columns = here.shape[0], here.shape[1] - 2 * ROOM
    voxels = (here.shape[2] - 2) * 64
    side, at = np.empty(3), np.empty(3)
    for m in members:
        longest, j = -1.0, 0
        for e in range(3):
            one, other = faces[m, e], faces[m, (e + 1) % 3]
            side[e] = 0.0
            for d in range(3):
                side[e] += (corners[one, d] - corners[other, d]) ** 2
            if side[e] > longest:
                longest, j = side[e], e
        a, b, c = faces[m, j], faces[m, (j + 1) % 3], faces[m, (j + 2) % 3]
        along = 0.5 * (longest + side[(j + 2) % 3] - side[(j + 1) % 3])
        height = np.sqrt(max(side[(j + 2) % 3] - along * along / max(longest, 1e-300), 0.0))
        strips = max(int(np.ceil(height / _CELL)), 1)
        for i in range(strips):
            up = (i + 0.5) / strips
            cells = max(int(np.ceil(np.sqrt(longest) * (1.0 - i / strips) / _CELL)), 1)
            y = (1.0 - up) * corners[a, 1] + up * corners[c, 1] - first_row
            slope = (1.0 - up) * (corners[b, 1] - corners[a, 1])
            first, last = 0, cells
            if abs(slope) > 1e-6:
                low, high = (-3.0 - y) / slope, (rows + 3.0 - y) / slope
                first = max(int(np.floor(min(low, high) * cells)) - 1, 0)
                last = min(int(np.ceil(max(low, high) * cells)) + 1, cells)
            for k in range(first, last):
                _at(corners, a, b, c, (k + 0.5) / cells, up, at)
                row, column, voxel = int(at[1]) - first_row, int(at[0]), int(at[2])
                if not -2 <= row < rows + 2:
                    continue
                if not (0 <= column < columns and 0 <= voxel < voxels):
                    continue
                if _near(before, here, after, row, column + ROOM, voxel):
                    continue
                for p in range(_POINTS):
                    for q in range(_POINTS):
                        over = (k - 0.5 + 2.0 * p / (_POINTS - 1)) / cells
                        rise = (i - 0.5 + 2.0 * q / (_POINTS - 1)) / strips
                        over, rise = min(max(over, 0.0), 1.0), min(max(rise, 0.0), 1.0)
                        _at(corners, a, b, c, over, rise, at)
                        row, column, voxel = int(at[1]) - first_row, int(at[0]), int(at[2])
                        if not 0 <= row < rows:
                            continue
                        if 0 <= column < columns and 0 <= voxel < voxels:
                            bit = np.uint64(1) << np.uint64(voxel & 63)
                            found[row, column + ROOM, 1 + (voxel >> 6)] |= bit


@inner_kernel
def _at(corners: Any, a: Any, b: Any, c: Any, over: Any, up: Any, at: Any) -> None:
    # The point so far along ab, and then towards c.
    for d in range(3):
        foot = corners[a, d] + over * (corners[b, d] - corners[a, d])
        at[d] = np.floor(foot + up * (corners[c, d] - foot))


@inner_kernel
def _near(before: Any, here: Any, after: Any, row: Any, column: Any, voxel: Any) -> Any:
    # Whether any of the 27 voxels around one is in the set.
    for i in range(3):
        at = row + (0 if i == 0 else (-1 if i == 1 else 1))
        for j in range(3):
            beside = column + (0 if j == 0 else (-1 if j == 1 else 1))
            for k in range(voxel - 1, voxel + 2):
                word, bit = 1 + (k >> 6), np.uint64(k & 63)
                if at < 0:
                    value = before[at + _BESIDE, beside, word]
                elif at >= here.shape[0]:
                    value = after[at - here.shape[0], beside, word]
                else:
                    value = here[at, beside, word]
                if (value >> bit) & np.uint64(1) == 1:
                    return True
    return False


# ------------------------------------------------------------------------------------------------
# Places where a closed solid, or the space around one, is thinner than a limit.
#
# Found on a voxel grid as in `planner.voxels.thin_places`, then measured by inscribed balls
# between the solid's own triangles, so that nothing of the limit or more is reported.


SOUND = 0.98
"""Of a limit: what is drawn at the limit comes out rounded."""

_MOST_WORK = {5: 500_000, 4: 1_000_000, 3: 4_000_000}
_EVERYWHERE = np.array([0.0, 0.0, 1.0]), -np.inf, np.inf


@dataclass(frozen=True)
class ThinPlace:
    """A place thinner than a limit, over a length of more than the limit.

    Attributes
    ----------
    place_mm
        Where it has `size_mm`.
    size_mm, least_mm
        Upper quartile and least of the diameters of balls that fit at points spread over it.
    extent_mm, volume_mm3
        Bounding box and volume, in whole voxels.
    alone
        Whether it is a piece by itself.
    """

    place_mm: tuple[float, float, float]
    size_mm: float
    least_mm: float
    extent_mm: tuple[float, float, float]
    volume_mm3: float
    alone: bool


def thin_solid_places(
    mesh: Mesh, limit_mm: float, *, listed: int, widest_passed_mm: float = 0.0
) -> tuple[list[ThinPlace], int]:
    """Find where a closed solid is thinner than a limit.

    The grid's pitch is limit / 11 for parts of some millimetres, / 9 and / 7 up to a few
    centimetres, and / 5 beyond. What is as thick as the limit is never reported. A layer thinner
    than 0.85 of it (0.8, 0.75, 0.6 on coarser grids) always is, in whatever direction it lies,
    if it reaches further than the limit; in between it depends on how it lies on the grid. Sharp
    edges down to about 40 degrees pass.

    Parameters
    ----------
    widest_passed_mm
        Places that extend less than this in two directions pass, and separate pieces that do so
        in all three: edges that taper, where level sets graze a surface.

    Returns
    -------
    places : list of ThinPlace
        Up to `listed`, by falling volume.
    more : int
        Places that were found and not measured.
    """
    raster = raster_for(mesh.bounds_mm[0], mesh.bounds_mm[1], limit_mm, _MOST_WORK)
    widest = widest_passed_mm / raster.grid.pitch_mm[0]
    places = [
        place
        for place in _places_in(_solid_words(mesh, raster), raster)
        if np.sort(place.high - place.low)[2 if place.alone else 1] >= widest
    ]
    places.sort(key=lambda p: (-p.voxels, *p.low.tolist()))
    found: list[ThinPlace] = []
    for seen, place in enumerate(places):
        if len(found) == listed:
            return found, len(places) - seen
        measured = _measured(mesh, raster, place, limit_mm)
        if measured is not None:
            found.append(measured)
    return found, 0


def thin_space_places(mesh: Mesh, limit_mm: float, *, listed: int) -> tuple[list[ThinPlace], int]:
    """Find where empty space between surfaces of a closed solid, or within, is narrow.

    As `thin_solid_places`, of a box around the solid without the solid.
    """
    margin_mm = 4.0 * limit_mm
    corners = np.array(np.meshgrid([0, 1], [0, 1], [0, 1], indexing="ij")).reshape(3, 8).T
    low, high = mesh.bounds_mm + np.array([[-margin_mm], [margin_mm]])
    box = np.array(
        [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
         [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]],
        dtype=np.int32,
    )  # fmt: skip
    around = Mesh(
        np.concatenate([low + corners * (high - low), mesh.vertices]),
        np.concatenate([box, mesh.faces[:, ::-1] + np.int32(8)]),
    )
    return thin_solid_places(around, limit_mm, listed=listed)


def room_mm(
    mesh: Mesh, points_mm: FloatArray, step_mm: float, limit_mm: float
) -> tuple[FloatArray, FloatArray]:
    """Return centres (n, 3) and diameters of the largest balls that fit near points (n, 3).

    Diameters of the limit and more are not told apart; outside the solid they are zero.
    """
    reach_mm = 0.55 * limit_mm
    around = reach_mm + 2.5 * step_mm
    low, high = points_mm.min(axis=0) - around, points_mm.max(axis=0) + around
    near = np.empty(len(mesh.faces), dtype=np.int64)
    near = near[: _within(mesh.vertices, mesh.faces, low, high, near)]
    faces = mesh.faces[near]
    centres, diameters = np.empty((len(points_mm), 3)), np.empty(len(points_mm))
    for i, point in enumerate(points_mm):
        centres[i], radius = inscribed_ball(
            mesh.vertices, faces, np.ascontiguousarray(point), *_EVERYWHERE, step_mm, reach_mm
        )
        diameters[i] = 2.0 * radius
    return centres, diameters


def _measured(mesh: Mesh, raster: Raster, place: ThinVoxels, limit_mm: float) -> ThinPlace | None:
    pitch_mm = raster.grid.pitch_mm[0]
    voxels: IntArray = np.concatenate([place.deepest[None], place.core])
    points = np.array([raster.position_mm(voxel) for voxel in voxels])
    centres, diameters = room_mm(mesh, points, 1.5 * pitch_mm, limit_mm)
    order = np.argsort(diameters, kind="stable")
    middle = order[3 * len(order) // 4]  # points at its rim have less room
    if diameters[middle] >= SOUND * limit_mm:
        return None
    extent = np.empty(3)
    extent[raster.order] = (place.high - place.low) * pitch_mm
    x, y, z = centres[middle].tolist()
    return ThinPlace(
        place_mm=(x, y, z),
        size_mm=float(diameters[middle]),
        least_mm=float(diameters[order[0]]),
        extent_mm=(float(extent[0]), float(extent[1]), float(extent[2])),
        volume_mm3=place.voxels * raster.grid.voxel_mm3,
        alone=place.alone,
    )


@kernel
def _within(vertices: Any, faces: Any, low: Any, high: Any, found: Any) -> Any:
    # Faces whose boxes meet a box.
    n = 0
    for f in range(faces.shape[0]):
        apart = False
        for d in range(3):
            a, b, c = vertices[faces[f, 0], d], vertices[faces[f, 1], d], vertices[faces[f, 2], d]
            apart |= min(a, b, c) > high[d] or max(a, b, c) < low[d]
        if not apart:
            found[n] = f
            n += 1
    return n


# ------------------------------------------------------------------------------------------------
# Places where a material's region is too thin, or too small, to print.
#
# The region of a material is opened by a ball on a voxel grid: what no ball of the minimum wall
# reaches is thin. At a convex edge this leaves a sliver that is no defect, so a place counts only
# where it extends further than one minimum wall from sound material, measured inside the region,
# over a length of half a minimum wall: that lets pass the edges and corners of a box, sharp edges
# down to about 40 degrees, and the corners of obliquely cut bands.


_SOUND = 0.98  # of the minimum wall: walls drawn at the minimum come out rounded


@dataclass(frozen=True)
class ThinWall:
    """A place that may not print.

    Attributes
    ----------
    kind
        "thin-wall": thinner than the minimum wall. "fragment": a separate piece of material that
        is smaller than the minimum wall in every direction.
    label
        Index of the piece that holds `place_mm`.
    place_mm
        Centre of the largest ball that fits into the place.
    size_mm
        Diameter of that ball: the thickness at the place's thickest point.
    extent_mm, volume_mm3
        Bounding box and volume of the place, in whole voxels.
    more
        Places of this material that were found beyond this one and are not listed.
    """

    kind: Literal["thin-wall", "fragment"]
    label: int
    place_mm: tuple[float, float, float]
    size_mm: float
    extent_mm: tuple[float, float, float]
    volume_mm3: float
    more: int = 0


@dataclass(frozen=True)
class _Region:
    """Adjacent pieces of one material, and the extent of the part that they take up."""

    material: Hashable
    first: int
    band: PlanarBand
    thickness_mm: float
    inner_mm: FloatArray  # planes between its pieces


def longest_checked_mm(minimum_wall_mm: float) -> float:
    """Return the longest extent of a part whose walls `thin_walls` can check."""
    return (MOST_VOXELS - 3) * minimum_wall_mm / (2 * _COARSEST_RADIUS + 1)


def thin_walls(
    mesh: Mesh,
    field: Field,
    levels: Sequence[float],
    materials: Sequence[Hashable],
    minimum_wall_mm: float,
    *,
    limit: int = 20,
) -> tuple[ThinWall, ...]:
    """Find what is thinner than the minimum wall in the region of each material.

    Adjacent pieces of one material are one region. Places that touch are one finding.

    The grid's pitch is minimum_wall / 11 for small parts (a dog-bone), / 7 up to a cube of about
    200 mm (for a wall of 0.6 mm), and / 5 beyond, which keeps to some seconds and less than 1 GB.
    A wall of the minimum or more is never reported, in whatever direction it lies; one below
    0.85 of it (0.8, 0.75, 0.6 at / 9, / 7, / 5) always is, if it reaches further than a minimum
    wall; in between it depends on how it lies on the grid. Sheets thinner than the pitch are
    found; pins and fragments thinner than it may be missed. Sizes are short of the true ones by
    at most 0.02 minimum walls, 0.04 on the coarsest grid.

    Parameters
    ----------
    field, levels
        A field with planar level sets and the levels that divide the mesh into pieces.
    materials
        What each piece is made of, len(levels) + 1.
    limit
        Largest number of findings for a material, the largest places first; the last of them
        tells how many `more` there are.

    Returns
    -------
    tuple of Finding
        By material in order of the pieces, and by falling volume.

    Raises
    ------
    ArgumentError
        The wall or limit is not positive, the counts do not match, the field is not planar, or
        a region is longer than `longest_checked_mm`.
    """
    if not (0 < minimum_wall_mm < np.inf and limit > 0):
        raise ArgumentError(
            f"minimum wall is {minimum_wall_mm} mm and limit {limit}; both must be positive"
        )
    if len(materials) != len(levels) + 1:
        raise ArgumentError(
            f"{len(levels)} levels make {len(levels) + 1} pieces, and there are {len(materials)} "
            "materials; give one for each piece"
        )
    found: dict[Hashable, list[ThinWall]] = {}
    unlisted: dict[Hashable, int] = {}
    for region in _regions(mesh, field, levels, materials):
        findings, rest = _thin_walls_of(mesh, region, minimum_wall_mm, limit)
        found.setdefault(region.material, []).extend(findings)
        unlisted[region.material] = unlisted.get(region.material, 0) + rest
    listed: list[ThinWall] = []
    for material, findings in found.items():
        findings.sort(key=lambda f: (-f.volume_mm3, f.label, f.place_mm))
        more = unlisted[material] + max(len(findings) - limit, 0)
        listed += findings[:limit]
        if more:
            listed[-1] = replace(listed[-1], more=more)
    return tuple(listed)


def _regions(
    mesh: Mesh, field: Field, levels: Sequence[float], materials: Sequence[Hashable]
) -> list[_Region]:
    if not isinstance(field, PlanarField):
        raise ArgumentError(
            f"field {field.name!r}: its level sets are not planes, and walls can be checked "
            "along planar fields only; use an axis"
        )
    planes = [field.plane(float(level)) for level in levels]
    normal = np.asarray(planes[0][0] if planes else (0.0, 0.0, 1.0), dtype=np.float64)
    terms = mesh.vertices[mesh.faces.ravel()] * normal
    along = terms[:, 0] + terms[:, 1] + terms[:, 2]
    start, end = float(along.min()), float(along.max())
    cuts = [-np.inf, *(float(offset) for _, offset in planes), np.inf]
    regions = []
    for material, group in itertools.groupby(range(len(materials)), key=materials.__getitem__):
        pieces = list(group)
        low, high = cuts[pieces[0]], cuts[pieces[-1] + 1]
        band = PlanarBand(
            normal, low if low > start else -float(np.inf), high if high < end else float(np.inf)
        )
        thickness = min(high, end) - max(low, start)
        if thickness > 0:
            inner = np.array(cuts[pieces[0] + 1 : pieces[-1] + 1])
            regions.append(_Region(material, pieces[0], band, thickness, inner))
    return regions


def _thin_walls_of(
    mesh: Mesh, region: _Region, wall_mm: float, limit: int
) -> tuple[list[ThinWall], int]:
    """Return up to `limit` findings of a region, and how many places were not looked at."""
    raster = raster_for(*_bounds(mesh, region.band), wall_mm)
    drawn = _regions_drawn(region, raster.grid.pitch_mm[0])
    places = thin_places(mesh, drawn, raster)
    places.sort(key=lambda p: (-p.voxels, *p.low.tolist()))
    share = min(1.0, region.thickness_mm / raster.grid.pitch_mm[0])
    findings: list[ThinWall] = []
    for seen, place in enumerate(places):
        if len(findings) == limit:
            return findings, len(places) - seen
        finding = _measure(mesh, region, raster, place, wall_mm, share)
        if finding is not None:
            findings.append(finding)
    return findings, 0


def _bounds(mesh: Mesh, band: PlanarBand) -> tuple[FloatArray, FloatArray]:
    # of the part of the bounding box between the band's planes, by interval arithmetic
    low, high = mesh.bounds_mm
    terms = np.sort(np.stack([low * band.normal, high * band.normal]), axis=0)
    narrow_low, narrow_high = low.copy(), high.copy()
    for axis, n in enumerate(band.normal):
        if abs(n) > 1e-6:
            others = terms.sum(axis=1) - terms[:, axis]
            ends = sorted([(band.low_mm - others[1]) / n, (band.high_mm - others[0]) / n])
            narrow_low[axis] = min(max(low[axis], ends[0]), high[axis])
            narrow_high[axis] = max(min(high[axis], ends[1]), low[axis])
    return narrow_low, narrow_high


def _regions_drawn(region: _Region, pitch_mm: float) -> PlanarBand:
    # a band thinner than a voxel is drawn one voxel thick, so that no centre misses it
    band = region.band
    spare = max(pitch_mm - region.thickness_mm, 0.0)
    if np.isfinite(band.low_mm) and np.isfinite(band.high_mm):
        spare /= 2
    return PlanarBand(band.normal, band.low_mm - spare, band.high_mm + spare)


def _measure(
    mesh: Mesh, region: _Region, raster: Raster, place: ThinVoxels, wall_mm: float, share: float
) -> ThinWall | None:
    pitch = raster.grid.pitch_mm[0]
    band = region.band
    centre, radius = inscribed_ball(
        mesh.vertices,
        mesh.faces,
        raster.position_mm(place.deepest),
        band.normal,
        band.low_mm,
        band.high_mm,
        1.5 * pitch,
        wall_mm,
    )
    if 2 * radius >= _SOUND * wall_mm:
        return None
    extent = np.empty(3)
    extent[raster.order] = (place.high - place.low) * pitch
    x, y, z = centre.tolist()
    along = x * band.normal[0] + y * band.normal[1] + z * band.normal[2]
    small = place.alone and bool((extent - pitch < wall_mm).all())  # between voxel centres
    return ThinWall(
        kind="fragment" if small else "thin-wall",
        label=region.first + int(np.searchsorted(region.inner_mm, along, side="right")),
        place_mm=(x, y, z),
        size_mm=float(2 * radius),
        extent_mm=(float(extent[0]), float(extent[1]), float(extent[2])),
        volume_mm3=place.voxels * raster.grid.voxel_mm3 * share,
    )
