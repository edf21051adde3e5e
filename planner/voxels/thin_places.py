"""Places of a closed solid, or of the space around one, that are thinner than a limit.

Found on a voxel grid by opening the solid with a ball as wide as the limit, then measured by
inscribed balls between the solid's own triangles, so that nothing of the limit or more is reported.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain, islice, pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.mesh.distance import triangle_tree
from planner.mesh.mesh import Mesh, number_groups, unite
from planner.numerics import FloatArray, IntArray, as_point, inner_kernel, kernel
from planner.voxels.columns import MOST_VOXELS, Columns, Grid, columns_of, snap

__all__ = [
    "SOUND",
    "ThinPlace",
    "longest_checked_mm",
    "room_mm",
    "space_around_mm",
    "thin_solid_places",
    "thin_space_places",
    "thinnest_first",
]


# ------------------------------------------------------------------------------------------------
# Erosion, dilation and components of voxel sets, 64 voxels a word.
#
# A set is an array of words (rows, columns, words) with room around it: `_ROOM` empty columns on
# either side of each row and one empty word at either end of each column. What lies beyond the
# rows counts as empty.


_Bits = NDArray[np.uint64]

_ROOM = 6
"""Empty columns on either side: the largest radius in voxels that `morph` takes."""


def empty_set(rows: int, columns: int, voxels: int) -> _Bits:
    """Return an empty set for columns of so many voxels."""
    return np.zeros((rows, columns + 2 * _ROOM, (voxels + 63) // 64 + 2), np.uint64)


def ball(radius: int) -> IntArray:
    """Return a ball of voxels as lines: row and column offset, half-length; longest first.

    The ball holds the offsets (i, j, k) with i² + j² + k² <= radius².
    """
    reach = range(-radius, radius + 1)
    lines = [
        (i, j, int(np.sqrt(radius**2 - i**2 - j**2)))
        for i in reach
        for j in reach
        if i**2 + j**2 <= radius**2
    ]
    return np.array(sorted(lines, key=lambda line: -line[2]), dtype=np.int64)


@kernel
def _add_runs(bits: _Bits, offsets: IntArray, start: IntArray, stop: IntArray) -> None:
    """Add the runs of whole rows of columns."""
    columns = bits.shape[1] - 2 * _ROOM
    for c in range(len(offsets) - 1):
        row, column = c // columns, _ROOM + c % columns
        for r in range(offsets[c], offsets[c + 1]):
            for word in range(start[r] >> 6, ((stop[r] - 1) >> 6) + 1):
                low = max(start[r] - (word << 6), 0)
                high = min(stop[r] - (word << 6), 64)
                mask = ~np.uint64(0) >> np.uint64(64 - (high - low))
                bits[row, column, 1 + word] |= mask << np.uint64(low)


def morph(source: _Bits, lines: IntArray, dilate: bool, within: _Bits) -> _Bits:
    """Erode a set by a `ball`, or dilate what is left of one.

    Dilation is the erosion of the complement. A line of half-length m erodes as m steps of
    half-length one, which are taken once for all lines of a row.

    Parameters
    ----------
    within
        A set; words in which it has nothing stay empty.
    """
    out = np.zeros(source.shape, np.uint64)
    flip = ~np.uint64(0) if dilate else np.uint64(0)
    reach = int(lines[:, 2].max())
    # Of rows about the present one: eroded along their columns by 0, 1, ... steps.
    eroded = np.zeros((2 * reach + 1, reach + 1, source[0].size), np.uint64)
    along = source.reshape(len(source), -1)
    at = np.empty(len(lines), np.int64)
    _morph(along, lines, flip, within, out, eroded, eroded.ravel(), at)
    return out


@kernel
def _morph(
    source: Any, lines: Any, flip: Any, within: Any, out: Any, eroded: Any, flat: Any, at: Any
) -> None:
    rows, columns, words = within.shape
    held, reach = eroded.shape[0], eroded.shape[1] - 1
    one, top = np.uint64(1), np.uint64(63)
    for row in range(-reach, rows):
        ahead, own = row + reach, (row + reach) % held
        if ahead < rows:
            for w in range(source.shape[1]):
                eroded[own, 0, w] = source[ahead, w] ^ flip
            # A word's neighbours are those of its column: at either end a column is empty.
            for step in range(1, reach + 1):
                eroded[own, step, 0] = eroded[own, step, -1] = flip
                for w in range(1, source.shape[1] - 1):
                    here = eroded[own, step - 1, w]
                    up = (here << one) | (eroded[own, step - 1, w - 1] >> top)
                    down = (here >> one) | (eroded[own, step - 1, w + 1] << top)
                    eroded[own, step, w] = here & up & down
        if row < 0:
            continue
        count, beyond = 0, False
        for i in range(len(lines)):
            if 0 <= row + lines[i, 0] < rows:
                size = (row + lines[i, 0]) % held * (reach + 1) + lines[i, 2]
                at[count] = (size * columns + lines[i, 1]) * words
                count += 1
            else:
                beyond = True
        for column in range(_ROOM, columns - _ROOM):
            for word in range(words):
                if within[row, column, word] == 0:
                    continue
                here = np.uint64(0) if beyond and flip == 0 else ~np.uint64(0)
                place = column * words + word
                for i in range(count):
                    if here == 0:
                        break
                    here &= flat[at[i] + place]
                out[row, column, word] = here ^ flip


def grow(grown: _Bits, within: _Bits, steps: int) -> int:
    """Grow a set in place within another, step by step; return how many words are not filled.

    Steps take in the 6 neighbours across faces and the 18 across faces and edges by turns,
    beginning with the 6: an octagonal ball whose radius is true to 13 %.
    """
    columns, words = grown.shape[1:]
    place, value = np.empty(grown.size, np.int64), np.empty(grown.size, np.uint64)
    return int(_grow(grown.ravel(), within.ravel(), columns * words, words, steps, place, value))


@kernel
def _grow(
    grown: Any, within: Any, row: Any, column: Any, steps: Any, place: Any, value: Any
) -> Any:
    # A set's words one after the other, with so many to the next row and column.
    one, top, todo = np.uint64(1), np.uint64(63), 0
    for at in range(grown.size):
        if within[at] & ~grown[at] != 0:
            place[todo] = at
            todo += 1
    for step in range(steps):
        for i in range(todo):
            at = place[i]
            above = at - row if at >= row else at
            below = at + row if at + row < grown.size else at
            new = np.uint64(0)
            for v in range(-1, 2):
                along = grown[at + v]
                cross = grown[above + v] | grown[below + v]
                cross |= grown[at - column + v] | grown[at + column + v]
                if v == 0:
                    new |= cross
                if step % 2 == 1:
                    along |= cross
                    if v == 0:
                        new |= grown[above - column] | grown[above + column]
                        new |= grown[below - column] | grown[below + column]
                if v < 0:
                    new |= along >> top
                elif v > 0:
                    new |= along << top
                else:
                    new |= along | (along << one) | (along >> one)
            value[i] = new & within[at]
        left, changed = 0, False
        for i in range(todo):
            at = place[i]
            changed |= grown[at] != value[i]
            grown[at] = value[i]
            if value[i] != within[at]:
                place[left] = at
                left += 1
        todo = left
        if not changed and step % 2 == 1:
            break
    return todo


def _runs_of(bits: _Bits, low: int, high: int) -> IntArray:
    """Return the runs of rows low <= row < high: (n, 4) int32 of row, column, start, stop."""
    runs = np.empty((_list_runs(bits, low, high, np.empty((0, 4), np.int32)), 4), np.int32)
    _list_runs(bits, low, high, runs)
    return runs


@kernel
def _list_runs(bits: Any, low: Any, high: Any, runs: Any) -> Any:
    # With room for none: counts them. Otherwise fills.
    one, ends = np.uint64(1), 0
    for row in range(low, high):
        for column in range(_ROOM, bits.shape[1] - _ROOM):
            before = np.uint64(0)
            for w in range(bits.shape[2]):
                word, voxel = bits[row, column, w], 64 * (w - 1)
                turns = word ^ (word << one | before)
                before = word >> np.uint64(63)
                while turns != 0:
                    if turns & one == 1:
                        if runs.shape[0] > 0:
                            run = runs[ends // 2]
                            run[0], run[1], run[2 + ends % 2] = row, column - _ROOM, voxel
                        ends += 1
                    turns >>= one
                    voxel += 1
    return ends // 2


def _members(runs: IntArray, bits: _Bits) -> IntArray:
    """Return the first, the middle and the last voxel of each run that are in a set.

    (n, 3) int32, -1 where a run has none in the set.
    """
    found = np.full((len(runs), 3), -1, np.int32)
    _find_members(runs, bits, np.empty(64 * bits.shape[2], np.int32), found)
    return found


@kernel
def _find_members(runs: IntArray, bits: _Bits, held: IntArray, found: IntArray) -> None:
    for r in range(len(runs)):
        row, column, n = runs[r, 0], runs[r, 1] + _ROOM, 0
        for w in range(runs[r, 2] >> 6, ((runs[r, 3] - 1) >> 6) + 1):
            word = bits[row, column, 1 + w]
            if word == 0:
                continue
            for voxel in range(max(w << 6, runs[r, 2]), min((w + 1) << 6, runs[r, 3])):
                if word >> np.uint64(voxel & 63) & np.uint64(1) == 1:
                    held[n] = voxel
                    n += 1
        if n > 0:
            found[r, 0], found[r, 1], found[r, 2] = held[0], held[n // 2], held[n - 1]


def _components(runs: IntArray) -> IntArray:
    """Return for each run the number of its component, 26-connected, by first appearance.

    Runs rise by row, column and start, as from `runs_of`.
    """
    parent = np.arange(len(runs), dtype=np.int32)
    width = int(runs[:, 1].max(initial=0)) + 3
    key = runs[:, 0].astype(np.int64) * width + runs[:, 1] + 1
    _touching(np.ascontiguousarray(runs), key, width, parent, np.zeros(4, np.int64))
    return number_groups(parent)


@kernel
def _touching(runs: Any, key: Any, width: Any, parent: Any, pointer: Any) -> None:
    n = len(runs)
    for r in range(n):
        for s in range(4):  # the three columns of the row before, and the column before
            line = key[r] - 1 if s == 3 else key[r] - width - 1 + s
            p = pointer[s]
            while p < n and key[p] < line:
                p += 1
            pointer[s] = p
            while p < n and key[p] == line and runs[p, 2] <= runs[r, 3]:
                if runs[p, 3] >= runs[r, 2]:
                    unite(parent, np.int32(p), np.int32(r))
                p += 1


# ------------------------------------------------------------------------------------------------
# The limit, and the grid that a solid is looked at on.


SOUND = 0.98
"""Of a limit: what is drawn at the limit comes out rounded."""

FINEST_RADIUS = 5  # of the ball in voxels: the pitch is the ball's diameter / 11
_COARSEST_RADIUS = 2
_NARROWEST = 3  # voxels: nothing thinner takes the ball of the coarsest radius
_SAMPLES = 8  # voxels that a place brings to be measured at
_DEEP = 0.75  # of its runs lie less deep than they
_SET_BYTES = 6 << 20  # of one set of a slab without its halo; about ten live at once
_LEAST_ROWS = 16  # of such a slab, or the halo would cost most of the time
_MOST_WORK = {5: 500_000, 4: 1_000_000, 3: 4_000_000}
"""Columns times lines of a ball of a radius that may be spent; the coarsest may cost all."""


@dataclass(frozen=True)
class Raster:
    """A grid for a solid, and the ball that opens it.

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


@dataclass(frozen=True)
class _Place:
    """A connected set of thin voxels, before it is measured.

    Attributes
    ----------
    low, high
        Smallest voxel, and one past the largest, along the grid's axes.
    alone
        Whether it touches no other voxel of the solid.
    core : (n, 3)
        The voxel that lies furthest from the surface, among those that count; and up to `_SAMPLES`
        spread over it, where it is deep, each as far from the surface as its column goes.
    """

    low: IntArray
    high: IntArray
    voxels: int
    alone: bool
    core: IntArray


def raster_for(
    low_mm: FloatArray, high_mm: FloatArray, limit_mm: float, finest: int | None = None
) -> Raster:
    """Choose a grid for a box and a limit: the finest that is cheap in memory and time.

    Parameters
    ----------
    finest
        Largest radius of the ball in voxels; `FINEST_RADIUS` by default.
    """
    order = np.argsort(high_mm - low_mm, kind="stable")
    for radius in range(finest or FINEST_RADIUS, _COARSEST_RADIUS - 1, -1):
        pitch = limit_mm / (2 * radius + 1)
        nx, ny, nz = (np.ceil((high_mm - low_mm)[order] / pitch).astype(np.int64) + 2).tolist()
        row_bytes = (nx + 2 * _ROOM) * (nz // 64 + 3) * 8
        rows = _SET_BYTES // row_bytes
        work = nx * ny * len(ball(radius))
        small = rows >= min(_LEAST_ROWS, ny) and max(nx, ny, nz) <= MOST_VOXELS
        if small and work <= _MOST_WORK.get(radius, 0):
            break
    grid = Grid(as_point(low_mm[order] - pitch), (pitch, pitch, pitch), (nx, ny, nz))
    return Raster(order, grid, radius, max(min(rows, ny), _LEAST_ROWS))


def longest_checked_mm(limit_mm: float) -> float:
    """Return the longest extent of a solid that can be looked at for a limit."""
    return (MOST_VOXELS - 3) * limit_mm / (2 * _COARSEST_RADIUS + 1)


# ------------------------------------------------------------------------------------------------
# Voxels of a solid that no ball of a given size reaches, gathered into places.


def _surely_sound(mesh: Mesh, limit_mm: float) -> bool:
    """Tell, at little cost, that nothing of a solid is thinner than a limit.

    The coarsest ball, on voxels of which no thinner solid takes it: where it leaves nothing that
    extends by two thirds of the limit, a finer one hardly leaves what extends by one and a half.
    """
    wide_mm = limit_mm * (2 * _COARSEST_RADIUS + 1) / _NARROWEST
    raster = raster_for(mesh.bounds_mm[0], mesh.bounds_mm[1], wide_mm, _COARSEST_RADIUS)
    slabs = _windows(_opened(_solid_words(mesh, raster), raster), raster, _NARROWEST)
    for first, last, low, (region, opened) in slabs:
        reached = opened.copy()
        grow(reached, region, _NARROWEST - 1)
        if (~reached & region)[first - low : last - low].any():
            return False
    return True


_Window = tuple[int, int, int, tuple[_Bits, ...]]
"""First and last row of interest, the window's own first row, and its sets."""


def _places_in(words: Iterator[tuple[_Bits, ...]], raster: Raster) -> list[_Place]:
    """Return the places of a set that the raster's ball does not reach.

    Opening by the ball leaves slivers at every convex edge; a place counts from the voxels on
    that lie further than `Raster.reach` steps inside the set from what the ball reaches, and
    extends back to it. A sharp corner, where such voxels take up less than the ball's radius in
    every direction, does not count.

    Parameters
    ----------
    words
        The set, slab by slab of `Raster.slab_rows` rows.
    """
    halo = 2 * raster.reach + 1  # rows that bear on a slab, once it is opened
    slabs = _windows(_opened(words, raster), raster, halo)
    # New memory costs as much as a pass over it.
    scratch = [empty_set(raster.slab_rows + 2 * halo, *raster.grid.shape[::2]) for _ in range(3)]
    found = [_thin_runs(window, raster, scratch) for window in slabs]
    return _gather(np.concatenate(found), raster.radius)


def _thin_runs(window: _Window, raster: Raster, scratch: list[_Bits]) -> IntArray:
    # runs of places in a window's rows of interest, as `_gather` takes them
    first, last, low, (region, opened) = window
    core, place, other = (each[: len(region)] for each in scratch)
    core[...] = opened
    if not grow(core, region, raster.reach):
        return np.empty((0, 9), np.int32)
    np.bitwise_and(np.invert(core, out=core), region, out=core)
    place[...] = core
    np.bitwise_and(np.invert(opened, out=other), region, out=other)
    grow(place, other, raster.reach)
    runs = _runs_of(place, first - low, last - low)
    np.bitwise_and(np.invert(place, out=other), region, out=other)
    grow(other, region, 2)
    other &= place
    touching = _members(runs, other)[:, 0] >= 0
    counting = _members(runs, core)
    depth, voxel = _deepest(runs, region, core, raster.radius)
    runs[:, 0] += low
    columns = [runs, touching[:, None], depth[:, None], voxel[:, None], counting[:, ::2]]
    return np.concatenate(columns, axis=1, dtype=np.int32)  # a skin has a million of them


def _deepest(runs: IntArray, region: _Bits, core: _Bits, radius: int) -> tuple[IntArray, IntArray]:
    # per run: the radius of the largest ball around a core voxel, and the voxel (-1: no core)
    voxel = _members(runs, core)[:, 1]
    depth = np.where(voxel >= 0, 0, -1)
    for size in range(1, radius + 1):
        inner = _members(runs, morph(region, ball(size), False, core) & core)[:, 1]
        if not (inner >= 0).any():
            break
        voxel = np.where(inner >= 0, inner, voxel)
        depth = np.where(inner >= 0, size, depth)
    return depth, voxel


def _gather(runs: IntArray, shortest: int) -> list[_Place]:
    # columns of runs: row, column, start, stop, touching, depth, voxel, first and last of core
    number = _components(np.ascontiguousarray(runs[:, :4]))
    order = np.argsort(number, kind="stable")
    places = []
    for own in np.split(order, np.flatnonzero(np.diff(number[order])) + 1):
        # Column by column: a skin has a million runs.
        row, column, start, stop, touching, depth = (runs[own, k] for k in range(6))
        has_core = depth >= 0
        if not has_core.any():
            continue
        alone = not touching.any()
        in_core, depth = own[has_core], depth[has_core]
        length = runs[in_core, 8].max() - runs[in_core, 7].min()
        longest = max(np.ptp(row[has_core]), np.ptp(column[has_core]), length)
        if not alone and longest + 1 < shortest:
            continue
        deepest = in_core[depth == depth.max()]
        # runs along a plate lie at all depths of it: it is as thick as the deeper ones have it
        deep = in_core[depth >= np.quantile(depth, _DEEP)]
        spread = np.unique(np.linspace(0, len(deep) - 1, _SAMPLES).astype(np.int64))
        seen = np.append(deepest[len(deepest) // 2], deep[spread])
        low = np.array([column.min(), row.min(), start.min()])
        high = np.array([column.max() + 1, row.max() + 1, stop.max()])
        voxels, core = int((stop - start).sum()), runs[seen][:, [1, 0, 6]]
        places.append(_Place(low, high, voxels, alone, core))
    return places


def _windows(chunks: Iterator[tuple[_Bits, ...]], raster: Raster, halo: int) -> Iterator[_Window]:
    # slabs with a halo
    rows, base, top = raster.grid.shape[1], 0, 0
    held = list[_Bits]()
    for first in range(0, rows, raster.slab_rows):
        last = min(first + raster.slab_rows, rows)
        low, high = max(first - halo, 0), min(last + halo, rows)
        for part in held:  # each in one piece, or numpy would copy it aside first
            kept = part[low - base : top - base].reshape(-1)
            part.reshape(-1)[: kept.size] = kept
        base = low
        while top < high:
            chunk = next(chunks)
            if not held:
                most = 2 * (raster.slab_rows + halo)
                held = [np.empty((most, *part.shape[1:]), np.uint64) for part in chunk]
            for part, more in zip(held, chunk, strict=True):
                part[top - base : top - base + len(more)] = more
            top += len(chunk[0])
        yield first, last, low, tuple(part[: high - low] for part in held)


def _opened(words: Iterator[tuple[_Bits, ...]], raster: Raster) -> Iterator[tuple[_Bits, ...]]:
    # a set's voxels and those of them that the ball reaches, slab by slab
    lines = ball(raster.radius)
    for first, last, low, (region,) in _windows(words, raster, 2 * raster.radius):
        opened = morph(morph(region, lines, False, region), lines, True, region)
        yield region[first - low : last - low], opened[first - low : last - low]


# ------------------------------------------------------------------------------------------------
# A closed mesh as sets of voxels, however thin it is.
#
# A voxel belongs to the solid when its centre does. Where the solid is thinner than a voxel it may
# hold no centre; there the voxels that its triangles pass through are taken instead. They are told
# by their neighbourhood: a solid at least 1.74 voxels thick has a centre within one voxel of every
# point of its surface.


_CELL = 2.0  # voxels: edge of the cells that a triangle is looked at in
_POINTS = 7  # drawn along either edge of a cell and half a cell beyond it
_BESIDE = 3  # rows on either side of a slab that cells reaching into it are told by


def _solid_words(mesh: Mesh, raster: Raster) -> Iterator[tuple[_Bits, ...]]:
    """Draw a closed mesh on a raster, slab by slab of `Raster.slab_rows` rows."""
    way = round(np.linalg.det(np.eye(3)[raster.order]))  # -1 of a mirror image: faces turn around
    along, grid = mesh.vertices.take(raster.order, axis=1), raster.grid
    faces = np.ascontiguousarray(mesh.faces[:, ::way])
    corners = (along - np.asarray(grid.origin_mm)) / np.asarray(grid.pitch_mm)
    rows = np.clip(np.floor(corners[:, 1]), -1, MOST_VOXELS).astype(np.int16).take(faces.T)
    lowest, highest = rows.min(axis=0), rows.max(axis=0)
    slabs = columns_of(snap(along, grid), faces, grid, slab_rows=raster.slab_rows, shortest=1)
    nothing = empty_set(_BESIDE, grid.shape[0], grid.shape[2])
    before, start = nothing, 0
    for held, after in pairwise(chain(map(_words_drawn, slabs), [nothing])):
        beside = np.concatenate([after[:_BESIDE], nothing[len(after) :]])
        stop = start + len(held)
        near = np.flatnonzero((highest >= start - _BESIDE) & (lowest <= stop + _BESIDE))
        drawn = np.concatenate([before, held, beside])
        side, at = np.empty((2, 3))
        _sheets(corners, faces, near, start, drawn, held, side, at)
        yield (held,)
        before, start = drawn[len(held) :][:_BESIDE].copy(), stop


def _words_drawn(slab: Columns) -> _Bits:
    bits = empty_set(slab.rows, slab.grid.shape[0], slab.grid.shape[2])
    _add_runs(bits, slab.offsets, slab.start, slab.stop)
    return bits


@kernel
def _sheets(
    corners: Any, faces: Any, members: Any, first_row: Any, drawn: Any, found: Any, side: Any,
    at: Any,
) -> None:  # fmt: skip
    # Marks in `found` the voxels of triangles near which none is `drawn`; that has `_BESIDE` rows
    # more at either end. Triangles are looked at in cells of up to two voxels, in strips along
    # their longest side; also in those cells whose middle lies beside the slab, as they may reach
    # into it.
    rows, columns = found.shape[0], found.shape[1] - 2 * _ROOM
    voxels = (found.shape[2] - 2) * 64
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
        strips: Any = 1
        if longest > _CELL * _CELL:
            along = 0.5 * (longest + side[(j + 2) % 3] - side[(j + 1) % 3])
            height = np.sqrt(max(side[(j + 2) % 3] - along * along / longest, 0.0))
            strips = max(np.int64(np.ceil(height / _CELL)), 1)
        for i in range(strips):
            up = (i + 0.5) / strips
            cells: Any = max(np.int64(np.ceil(np.sqrt(longest) * (1.0 - i / strips) / _CELL)), 1)
            y = (1.0 - up) * corners[a, 1] + up * corners[c, 1] - first_row
            slope = (1.0 - up) * (corners[b, 1] - corners[a, 1])
            first: Any = 0
            last = cells
            if abs(slope) > 1e-6:
                low, high = (-3.0 - y) / slope, (rows + 3.0 - y) / slope
                first = max(np.int64(np.floor(min(low, high) * cells)) - 1, 0)
                last = min(np.int64(np.ceil(max(low, high) * cells)) + 1, cells)
            for k in range(first, last):
                for p in range(-1, _POINTS * _POINTS):  # the middle, and if nothing is near, all
                    over, rise = k + 0.5, i + 0.5
                    if p >= 0:
                        over = k - 0.5 + 2.0 * (p // _POINTS) / (_POINTS - 1)
                        rise = i - 0.5 + 2.0 * (p % _POINTS) / (_POINTS - 1)
                    over, rise = min(max(over / cells, 0.0), 1.0), min(max(rise / strips, 0.0), 1.0)
                    for d in range(3):  # so far along ab, and then towards c
                        foot = corners[a, d] + over * (corners[b, d] - corners[a, d])
                        at[d] = np.floor(foot + rise * (corners[c, d] - foot))
                    row = np.int64(at[1]) - first_row
                    column, voxel = np.int64(at[0]), np.int64(at[2])
                    beyond = not (0 <= column < columns and 0 <= voxel < voxels)
                    if p < 0:
                        if beyond or not -2 <= row < rows + 2:
                            break
                        if _near(drawn, row + _BESIDE, column + _ROOM, voxel):
                            break
                    elif not beyond and 0 <= row < rows:
                        bit = np.uint64(1) << np.uint64(voxel & 63)
                        found[row, column + _ROOM, 1 + (voxel >> 6)] |= bit


@inner_kernel
def _near(drawn: Any, row: Any, column: Any, voxel: Any) -> Any:
    # Whether any of the 27 voxels around one is in the set.
    for i in (0, -1, 1):
        for j in (0, -1, 1):
            for k in (0, -1, 1):
                word = drawn[row + i, column + j, 1 + ((voxel + k) >> 6)]
                if word >> np.uint64((voxel + k) & 63) & np.uint64(1) == 1:
                    return True
    return False


# ------------------------------------------------------------------------------------------------
# Places, measured.


@dataclass(frozen=True)
class ThinPlace:
    """A place thinner than a limit, over a length of more than the limit.

    Attributes
    ----------
    place_mm
        Where it has `size_mm`.
    size_mm
        Upper quartile of the diameters of balls that fit at points spread over its middle.
    extent_mm, volume_mm3
        Bounding box and volume, in whole voxels.
    alone
        Whether it is a piece by itself.
    """

    place_mm: tuple[float, float, float]
    size_mm: float
    extent_mm: tuple[float, float, float]
    volume_mm3: float
    alone: bool


def thin_solid_places(
    mesh: Mesh, limit_mm: float, *, listed: int, widest_passed_mm: float = 0, least_mm3: float = 0
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
    least_mm3
        Volume of all places together from which on there are any.

    Returns
    -------
    places : list of ThinPlace
        Up to `listed`, by falling volume.
    more : int
        Places that were found and not measured.
    """
    if _surely_sound(mesh, limit_mm):
        return [], 0
    raster = raster_for(mesh.bounds_mm[0], mesh.bounds_mm[1], limit_mm)
    widest = widest_passed_mm / raster.grid.pitch_mm[0]
    places = [
        place
        for place in _places_in(_solid_words(mesh, raster), raster)
        if np.sort(place.high - place.low)[2 if place.alone else 1] >= widest
    ]
    if sum(place.voxels for place in places) * raster.grid.voxel_mm3 < least_mm3:
        return [], 0
    places.sort(key=lambda p: (-p.voxels, *p.low.tolist()))
    waiting = iter(places)
    measured = (_measured(mesh, raster, place, limit_mm) for place in waiting)
    found = list(islice(filter(None, measured), listed))
    return found, len(list(waiting))


def space_around_mm(limit_mm: float) -> float:
    """Return how much longer the box is that `thin_space_places` looks at than the solid."""
    return 8.0 * limit_mm


def thin_space_places(mesh: Mesh, limit_mm: float, *, listed: int) -> tuple[list[ThinPlace], int]:
    """Find where empty space between surfaces of a closed solid, or within, is narrow.

    As `thin_solid_places`, of a box around the solid without the solid.
    """
    from manifold3d import Manifold

    size_mm = np.ptp(mesh.bounds_mm, axis=0) + space_around_mm(limit_mm)
    box = Manifold.cube(size_mm, True).translate(mesh.bounds_mm.mean(axis=0)).to_mesh64()
    vertices = np.concatenate([box.vert_properties, mesh.vertices])
    faces = np.concatenate([box.tri_verts, mesh.faces[:, ::-1] + len(box.vert_properties)])
    return thin_solid_places(Mesh(vertices, faces), limit_mm, listed=listed)


_WAYS = np.indices((3, 3, 3)).reshape(3, 27).T[:, None, ::-1] - 1.0
"""Steps to a place's neighbours and to itself, (27, 1, 3), along x first."""


def room_mm(
    mesh: Mesh, points_mm: FloatArray, step_mm: float, limit_mm: float
) -> tuple[FloatArray, FloatArray]:
    """Climb from points (n, 3) to the largest balls that fit there; return centres and diameters.

    The search halves its step from half of `step_mm` to a sixteenth of it, which is its precision,
    and stays within `step_mm` of where it starts along each axis. Diameters of the limit and more
    are not told apart; where no ball fits, they are zero.
    """
    reach_mm = 0.55 * limit_mm  # the size of a ball beyond is of no interest
    around_mm = reach_mm + 2.0 * step_mm
    along = mesh.triangles.T.copy()  # by axis, each in one piece: many times as fast
    low, high = along.min(axis=1), along.max(axis=1)
    near = np.zeros(len(mesh.faces), dtype=np.bool_)
    for point in points_mm:
        at = point[:, None]
        near |= ((low <= at + around_mm) & (high >= at - around_mm)).all(axis=0)
    if not near.any():
        return points_mm, np.full(len(points_mm), 2.0 * reach_mm)
    tree = triangle_tree(Mesh(mesh.vertices, mesh.faces[near]))

    def depth_mm(places_mm: FloatArray) -> FloatArray:
        found, outside = tree.distances(places_mm.reshape(-1, 3))
        found = np.where(found < reach_mm, np.where(outside, -found, found), reach_mm)
        return found.reshape(places_mm.shape[:-1])

    centres, best = points_mm.copy(), depth_mm(points_mm)
    size_mm = np.full(len(points_mm), step_mm / 2)
    while len(left := np.flatnonzero(size_mm >= step_mm / 16)):
        trials = centres[left] + _WAYS * size_mm[left, None]
        strayed = (np.abs(trials - points_mm[left]) > step_mm).any(axis=2)
        moved = np.zeros(len(left), dtype=np.bool_)
        for trial, found in zip(trials, np.where(strayed, -np.inf, depth_mm(trials)), strict=True):
            better = found > best[left] + 1e-9
            centres[left[better]], best[left[better]] = trial[better], found[better]
            moved |= better
        size_mm[left[~moved]] /= 2
    return centres, 2.0 * np.maximum(best, 0.0)


def thinnest_first(thickness_mm: FloatArray) -> IntArray:
    """Sort so that of equal thicknesses the first comes first, though processors round apart."""
    return np.argsort(thickness_mm.round(_SAME_DIGITS), kind="stable")


_SAME_DIGITS = 6
"""Of mm: far above what rounding moves, far below what anyone prints."""


def _measured(mesh: Mesh, raster: Raster, place: _Place, limit_mm: float) -> ThinPlace | None:
    pitch_mm = raster.grid.pitch_mm[0]
    points = np.empty(place.core.shape)
    points[:, raster.order] = raster.grid.centre_mm(place.core)  # in the mesh's axes
    centres, diameters = room_mm(mesh, points, 1.5 * pitch_mm, limit_mm)
    order = thinnest_first(diameters)
    middle = order[3 * len(order) // 4]  # points at its rim have less room
    if diameters[middle] >= SOUND * limit_mm:
        return None
    extent = np.empty(3)
    extent[raster.order] = (place.high - place.low) * pitch_mm
    size_mm, volume_mm3 = float(diameters[middle]), place.voxels * raster.grid.voxel_mm3
    return ThinPlace(as_point(centres[middle]), size_mm, as_point(extent), volume_mm3, place.alone)
