"""Erosion, dilation and components of voxel sets, 64 voxels a word.

A set is an array of words (rows, columns, words) with room around it: `ROOM` empty columns on
either side of each row and one empty word at either end of each column. What lies beyond the
rows counts as empty.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.mesh.mesh import number_groups, unite
from planner.numerics import BoolArray, IntArray, inner_kernel, kernel

__all__ = [
    "ROOM",
    "Bits",
    "active_words",
    "add_runs",
    "ball",
    "components",
    "empty_set",
    "grow",
    "members",
    "morph",
    "runs_of",
]


Bits = NDArray[np.uint64]

ROOM = 6
"""Empty columns on either side: the largest radius in voxels that `morph` takes."""


def empty_set(rows: int, columns: int, voxels: int) -> Bits:
    """Return an empty set for columns of so many voxels."""
    return np.zeros((rows, columns + 2 * ROOM, (voxels + 63) // 64 + 2), np.uint64)


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
def add_runs(
    bits: Bits,
    first_row: int,
    offsets: IntArray,
    start: IntArray,
    stop: IntArray,
    wanted: BoolArray,
) -> None:
    """Add the runs marked in `wanted` of whole rows of columns, from row `first_row` on."""
    columns = bits.shape[1] - 2 * ROOM
    for c in range(len(offsets) - 1):
        row, column = first_row + c // columns, ROOM + c % columns
        for r in range(offsets[c], offsets[c + 1]):
            if wanted[r]:
                for word in range(start[r] >> 6, ((stop[r] - 1) >> 6) + 1):
                    low = max(start[r] - (word << 6), 0)
                    high = min(stop[r] - (word << 6), 64)
                    mask = ~np.uint64(0) >> np.uint64(64 - (high - low))
                    bits[row, column, 1 + word] |= mask << np.uint64(low)


def active_words(region: Bits, radius: int) -> BoolArray:
    """Return which words of a set erosion by a ball can change, or opening after it.

    The others are empty, or full and more than the radius away from any gap. Beyond the rows
    counts as full here, to save work on rows that are a mere halo: let real ends be empty rows.
    """
    interior = region == ~np.uint64(0)
    if not interior.any():  # a thin wall
        return np.asarray(region != 0)
    some = np.uint64((1 << radius) - 1)
    first, last = some, some << np.uint64(64 - radius)
    interior[:, :, 1:] &= region[:, :, :-1] & last == last
    interior[:, :, :-1] &= region[:, :, 1:] & first == first
    for axis in (0, 1):
        before = interior.copy()
        at = np.moveaxis(interior, axis, 0)
        beside = np.moveaxis(before, axis, 0)
        for shift in range(1, radius + 1):
            at[shift:] &= beside[:-shift]
            at[:-shift] &= beside[shift:]
    return np.asarray((region != 0) & ~interior)


def morph(source: Bits, lines: IntArray, dilate: bool, region: Bits, active: BoolArray) -> Bits:
    """Erode a region by a `ball`, or dilate what is left of it.

    Dilation is the erosion of the complement. A line of half-length m erodes as m steps of
    half-length one, so lines are taken longest first and a step is made between lengths.

    Parameters
    ----------
    source
        The region, or the eroded region to dilate.
    active
        From `active_words` of the region; the result is the region in all other words.
    """
    out = np.zeros_like(source)
    line, step = np.empty((2, source.shape[2]), np.uint64)
    flip = ~np.uint64(0) if dilate else np.uint64(0)
    _morph(source, lines, flip, region, active, out, line, step)
    return out


@kernel
def _morph(
    source: Any, lines: Any, flip: Any, region: Any, active: Any, out: Any, line: Any, step: Any
) -> Any:
    one, top = np.uint64(1), np.uint64(63)
    rows, columns, words = source.shape
    for row in range(rows):
        for column in range(ROOM, columns - ROOM):
            end = 0
            while end < words:
                first = end
                while first < words and not active[row, column, first]:
                    out[row, column, first] = region[row, column, first]
                    first += 1
                end = first
                while end < words and active[row, column, end]:
                    end += 1
                if first == end:
                    continue
                if end - first == 1:  # the usual case at a surface across the columns
                    here = _morph_word(source, lines, flip, row, column, first)
                    out[row, column, first] = here ^ flip
                    continue
                low, high = first - 1, end + 1  # bits come from one word further at most
                for w in range(low, high):
                    line[w] = ~np.uint64(0)
                length = lines[0, 2]
                for i in range(len(lines)):
                    while length > lines[i, 2]:
                        for w in range(first, end):
                            here = line[w]
                            up = (here << one) | (line[w - 1] >> top)
                            down = (here >> one) | (line[w + 1] << top)
                            step[w] = here & up & down
                        line[low] &= line[low] << one
                        line[end] &= line[end] >> one
                        for w in range(first, end):
                            line[w] = step[w]
                        length -= 1
                    at, beside = row + lines[i, 0], column + lines[i, 1]
                    if 0 <= at < rows:
                        for w in range(low, high):
                            line[w] &= source[at, beside, w] ^ flip
                    elif flip == 0:
                        for w in range(low, high):
                            line[w] = 0
                for w in range(first, end):
                    out[row, column, w] = line[w] ^ flip


@inner_kernel
def _morph_word(source: Any, lines: Any, flip: Any, row: Any, column: Any, word: Any) -> Any:
    # `morph` of one word, with its two neighbours in registers
    one, top = np.uint64(1), np.uint64(63)
    before = here = after = ~np.uint64(0)
    length = lines[0, 2]
    for i in range(len(lines)):
        while length > lines[i, 2]:
            up, down = (here << one) | (before >> top), (here >> one) | (after << top)
            before &= before << one
            after &= after >> one
            here &= up & down
            length -= 1
        at, beside = row + lines[i, 0], column + lines[i, 1]
        if 0 <= at < len(source):
            before &= source[at, beside, word - 1] ^ flip
            here &= source[at, beside, word] ^ flip
            after &= source[at, beside, word + 1] ^ flip
        elif flip == 0:
            before = here = after = np.uint64(0)
    return here


def grow(grown: Bits, within: Bits, steps: int) -> int:
    """Grow a set in place within another, step by step; return how many words are not filled.

    Steps take in the 6 neighbours across faces and the 18 across faces and edges by turns,
    beginning with the 6: an octagonal ball whose radius is true to 13 %.
    """
    inner = np.s_[:, ROOM:-ROOM, 1:-1]
    left = (within[inner] & ~grown[inner]) != 0
    at = np.unravel_index(
        np.flatnonzero(left), left.shape
    )  # few of many, 3 times as fast as by axes
    place = np.stack(at, axis=1) + np.array([0, ROOM, 1])
    return int(_grow(grown, within, steps, place, np.empty(len(place), np.uint64)))


@kernel
def _grow(grown: Any, within: Any, steps: Any, place: Any, value: Any) -> Any:
    one, top = np.uint64(1), np.uint64(63)
    last, todo = grown.shape[0] - 1, place.shape[0]
    for step in range(steps):
        for i in range(todo):
            row, c, w = place[i, 0], place[i, 1], place[i, 2]
            above, below = max(row - 1, 0), min(row + 1, last)
            new = np.uint64(0)
            for v in range(w - 1, w + 2):
                along = grown[row, c, v]
                cross = grown[above, c, v] | grown[below, c, v]
                cross |= grown[row, c - 1, v] | grown[row, c + 1, v]
                if v == w:
                    new |= cross
                if step % 2 == 1:
                    along |= cross
                    if v == w:
                        new |= grown[above, c - 1, v] | grown[above, c + 1, v]
                        new |= grown[below, c - 1, v] | grown[below, c + 1, v]
                if v < w:
                    new |= along >> top
                elif v > w:
                    new |= along << top
                else:
                    new |= along | (along << one) | (along >> one)
            value[i] = new & within[row, c, w]
        left, changed = 0, False
        for i in range(todo):
            row, c, w = place[i, 0], place[i, 1], place[i, 2]
            changed |= grown[row, c, w] != value[i]
            grown[row, c, w] = value[i]
            if value[i] != within[row, c, w]:
                place[left, 0], place[left, 1], place[left, 2] = row, c, w
                left += 1
        todo = left
        if not changed and step % 2 == 1:
            break
    return todo


@kernel
def runs_of(bits: Bits, low: int, high: int) -> IntArray:
    """Return the runs of rows low <= row < high: (n, 4) int32 of row, column, start, stop."""
    columns, words = bits.shape[1], bits.shape[2]
    runs = np.empty((64, 4), np.int32)
    n = 0
    for row in range(low, high):
        for column in range(ROOM, columns - ROOM):
            inside = False
            for w in range(1, words):  # the empty last word ends the last run
                word = bits[row, column, w]
                if word == (~np.uint64(0) if inside else np.uint64(0)):
                    continue
                for b in range(64):
                    if ((word >> np.uint64(b)) & np.uint64(1) == 1) == inside:
                        continue
                    voxel = (w - 1) * 64 + b
                    if inside:
                        runs[n, 3] = voxel
                        n += 1
                    else:
                        if n == len(runs):
                            longer = np.empty((2 * n, 4), np.int32)
                            for r in range(n):
                                for i in range(4):
                                    longer[r, i] = runs[r, i]
                            runs = longer
                        runs[n, 0], runs[n, 1], runs[n, 2] = row, column - ROOM, voxel
                    inside = not inside
    return runs[:n]


@kernel
def members(runs: IntArray, bits: Bits) -> IntArray:
    """Return the first, the middle and the last voxel of each run that are in a set.

    (n, 3) int32, -1 where a run has none in the set.
    """
    found = np.empty((len(runs), 3), np.int32)
    for r in range(len(runs)):
        for i in range(3):
            found[r, i] = -1
        row, column = runs[r, 0], runs[r, 1] + ROOM
        n = 0
        for wanted in (0, 1):
            # count first, then stop at the middle one
            middle, n = n // 2, 0
            for w in range(runs[r, 2] >> 6, ((runs[r, 3] - 1) >> 6) + 1):
                word = bits[row, column, 1 + w]
                voxel = max(w << 6, runs[r, 2])
                word >>= np.uint64(voxel & 63)
                while word != 0 and voxel < runs[r, 3]:
                    if word & np.uint64(1) == 1:
                        if wanted == 0:
                            if n == 0:
                                found[r, 0] = voxel
                            found[r, 2] = voxel
                        elif n == middle:
                            found[r, 1] = voxel
                        n += 1
                    word >>= np.uint64(1)
                    voxel += 1
                if wanted == 1 and found[r, 1] >= 0:
                    break
            if n == 0:
                break
    return found


def components(runs: IntArray) -> IntArray:
    """Return for each run the number of its component, 26-connected, by first appearance.

    Runs rise by row, column and start, as from `runs_of`.
    """
    parent = np.arange(len(runs), dtype=np.int32)
    _touching(np.ascontiguousarray(runs), parent)
    return number_groups(parent)


@kernel
def _touching(runs: Any, parent: Any) -> None:
    n = len(runs)
    key = np.empty(n, np.int64)
    width = 0
    for r in range(n):
        width = max(width, runs[r, 1] + 3)
    for r in range(n):
        key[r] = runs[r, 0] * width + runs[r, 1] + 1
    pointer = np.zeros(4, np.int64)
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
