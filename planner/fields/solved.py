"""Fields computed over the part's cells: steady flow, shortest ways, tables of values."""

import math
from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from planner.errors import ArgumentError
from planner.fields.basic import FieldRegion, FunctionField, Quantity, Ramp
from planner.glance import place_text
from planner.mesh.mesh import Mesh
from planner.numerics import BoolArray, FloatArray, Point, inner_kernel, kernel
from planner.voxels.columns import Grid, dense, voxelize

__all__ = ["cells_of", "geodesic_field", "harmonic_field", "over_cells", "points_field"]


# ------------------------------------------------------------------------------------------------
# Values at the cells of a grid that lie in the part, as a field.


_MOST_CELLS = 3_000_000
"""Of the part's box, for what is solved over all of it."""

_CRUMB = 1e-3  # of all cells


def over_cells(grid: Grid, values: FloatArray) -> Quantity:
    """Return values (nx, ny, nz) at cell centres as a function of points (n, 3).

    It is linear between centres along each axis; beyond the outermost as at them.
    """
    origin, pitch = np.array(grid.origin_mm), np.array(grid.pitch_mm)

    def at(points_mm: FloatArray) -> FloatArray:
        found = np.empty(len(points_mm))
        _interpolate(np.require(points_mm, np.float64, ["C", "W"]), origin, pitch, values, found)
        return found

    return at


def cells_of(mesh: Mesh, pitch_mm: float) -> tuple[Grid, BoolArray]:
    """Return a grid over the part and which of its cells (nx, ny, nz) have their centre in it.

    Walls thinner than a cell keep one cell along z.
    """
    columns = voxelize(mesh, pitch_mm, shortest=1)
    return columns.grid, np.ascontiguousarray(dense(columns))


def _solved_cells(
    mesh: Mesh, pitch_mm: float, field: str, regions: Mapping[str, FieldRegion], origin_mm: Point
) -> tuple[float, Grid, BoolArray, list[BoolArray]]:
    """Return a pitch to solve at, the cells, and those that each region holds.

    The pitch is the shells', or as fine as `_MOST_CELLS` allow. Messages give places as seen from
    `origin_mm`: where the part's own origin lies.

    Raises
    ------
    ArgumentError
        A region holds nothing of the part.
    """
    pitch_mm = max(pitch_mm, math.cbrt(np.ptp(mesh.bounds_mm, axis=0).prod() / _MOST_CELLS))
    grid, inside = cells_of(mesh, pitch_mm)
    centres, found = grid.centre_mm(np.argwhere(inside)), list[BoolArray]()
    for key, region in regions.items():
        found.append(np.zeros_like(inside))
        found[-1][inside] = region.holds(centres)
        if not found[-1].any():
            low, high = map(place_text, mesh.bounds_mm - origin_mm)
            raise ArgumentError(
                f"field {field}: the region {key}= holds nothing of the part, not the middle of a "
                f"cell of {pitch_mm:.3g} mm; give it that thickness or more. The part reaches "
                f"{low.removesuffix(' mm')} to {high}"
            )
    return pitch_mm, grid, inside, found


def _reached_cells(
    inside: BoolArray, seeds: BoolArray, grid: Grid, origin_mm: Point, lost: str
) -> BoolArray:
    """Keep the cells (nx, ny, nz) that are connected to seeds.

    Crumbs are left out: a few cells at a corner that touch no other.

    Raises
    ------
    ArgumentError
        A larger body has no seed: what is `lost`, its place instead of {}.
    """
    from scipy import ndimage

    body, bodies = ndimage.label(inside)
    size = np.bincount(body.ravel(), minlength=bodies + 1)
    known = np.isin(np.arange(bodies + 1), body[seeds])
    size[known], size[0] = 0, 0
    worst = int(np.argmax(size))
    if size[worst] > _CRUMB * np.count_nonzero(inside):
        place = place_text(grid.centre_mm(np.argwhere(body == worst)[0]) - origin_mm)
        raise ArgumentError(
            f"field {lost.replace('{}', place)}; name a region in each body, or take a finer "
            "`pitch_mm` if a wall is thinner than a cell"
        )
    return np.asarray(known[body])


def _spread_values(values: FloatArray, known: BoolArray, layers: int = 3) -> None:
    """Continue values, in place, into a few layers of cells around those that are known.

    Each new cell takes the mean of its known neighbours; what lies farther takes the mean of all.
    """
    from scipy import ndimage

    mean = float(values[known].mean())
    held, spread = np.pad(known, 1), np.pad(np.where(known, values, 0.0), 1)  # 0 where not held
    inner = (slice(1, -1), slice(1, -1), slice(1, -1))
    for _ in range(layers):
        beside = np.argwhere(ndimage.maximum_filter(held[inner], 3) & ~held[inner])
        total, count = np.zeros((2, len(beside)))
        for step in np.ndindex(3, 3, 3):
            neighbour = tuple((beside + step).T)
            total += spread[neighbour]
            count += held[neighbour]
        cell = tuple((beside + 1).T)
        spread[cell], held[cell] = total / count, True
    values[...] = np.where(held, spread, mean)[inner]


@kernel
def _interpolate(points: Any, origin: Any, pitch: Any, values: Any, found: Any) -> None:
    cell, at_corner = np.empty((2, 3), dtype=np.int64)
    share = np.empty(3)
    for p in range(points.shape[0]):
        for d in range(3):
            at = (points[p, d] - origin[d]) / pitch[d] - 0.5
            at = min(max(at, 0.0), float(values.shape[d] - 1))
            cell[d] = min(int(at), max(values.shape[d] - 2, 0))
            share[d] = at - cell[d]
        total = 0.0
        for corner in range(8):
            weight = 1.0
            for d in range(3):
                upper = corner >> d & 1
                weight *= share[d] if upper else 1.0 - share[d]
                at_corner[d] = min(cell[d] + upper, values.shape[d] - 1)
            total += weight * values[at_corner[0], at_corner[1], at_corner[2]]
        found[p] = total


# ------------------------------------------------------------------------------------------------
# The field of a steady flow between two regions: gradients that follow a bent part.


_COARSEST = 20_000  # cells; below, nothing is gained by a coarser grid
_PRECISION = 1e-7  # of the field's range, root mean square of the residual


def harmonic_field(
    mesh: Mesh, start: FieldRegion, end: FieldRegion, pitch_mm: float, origin_mm: Point
) -> FunctionField:
    """Solve Laplace's equation in a part: 0 in one region, 1 in another.

    No flow leaves through the rest of the surface. The surface is one of cells, so a level lies
    within about a cell of the true one, and falls with the cells at first order.

    Messages give places as seen from `origin_mm`: where the part's own origin lies.

    Raises
    ------
    ArgumentError
        A region that holds no cell of the part, regions that share one, or a body of the part
        that has none of either.
    """
    pitch_mm, grid, inside, held = _solved_cells(
        mesh, pitch_mm, "harmonic", {"from": start, "to": end}, origin_mm
    )
    if len(both := np.argwhere(held[0] & held[1])):
        shared = place_text(grid.centre_mm(both[0]) - origin_mm)
        raise ArgumentError(
            f"field harmonic: the regions from= and to= share {shared}; they must lie apart"
        )
    fixed = np.where(held[0], 0.0, np.where(held[1], 1.0, np.nan))
    lost = "harmonic: the body at {} touches neither region"
    reached = _reached_cells(inside, np.isfinite(fixed), grid, origin_mm, lost)
    values = _solve_laplace(reached, fixed)
    _spread_values(values, reached)
    says = {"from": dict(start.says), "to": dict(end.says), "cells_mm": pitch_mm}
    return FunctionField("harmonic", over_cells(grid, values), says)


def _solve_laplace(inside: BoolArray, fixed: FloatArray) -> FloatArray:
    """Solve Laplace's equation on cells, (nx, ny, nz); NaN outside.

    Conjugate gradients with the diagonal as preconditioner, started from the solution on cells
    twice as large.

    Parameters
    ----------
    inside
        Cells to solve on; no flow leaves them.
    fixed
        Given values, NaN elsewhere.
    """
    guess = _from_coarser(inside, fixed) if np.count_nonzero(inside) > _COARSEST else 0.5
    place = np.argwhere(inside) + 1
    number = np.full(np.add(inside.shape, 2), -1, dtype=np.int32)  # with a border
    number[tuple(place.T)] = np.arange(len(place), dtype=np.int32)
    neighbours = np.empty((len(place), 6), dtype=np.int32)
    forth = np.eye(3, dtype=np.int64)
    for way, step in enumerate((*forth, *-forth)):
        neighbours[:, way] = number[tuple((place + step).T)]
    given = fixed[inside]
    free = np.isnan(given)
    x = np.where(free, guess, given)
    _conjugate_gradients(neighbours, free, x, np.empty((4, len(x))), _PRECISION)
    values = np.full(inside.shape, np.nan)
    values[inside] = np.clip(x, np.nanmin(given), np.nanmax(given))
    return values


def _from_coarser(inside: BoolArray, fixed: FloatArray) -> FloatArray:
    """Return values at inside cells from a solution on cells twice as large.

    Those are inside where any of the eight is, fixed by their mean.
    """
    shape = tuple((n + 1) // 2 for n in inside.shape)
    room = [(0, 2 * m - n) for m, n in zip(shape, inside.shape, strict=True)]
    blocks = (shape[0], 2, shape[1], 2, shape[2], 2)
    any_inside: BoolArray = np.asarray(np.pad(inside, room).reshape(blocks).any(axis=(1, 3, 5)))
    known = np.pad(np.isfinite(fixed), room).reshape(blocks).sum(axis=(1, 3, 5))
    total = np.pad(np.nan_to_num(fixed), room).reshape(blocks).sum(axis=(1, 3, 5))
    coarse = _solve_laplace(any_inside, np.where(known > 0, total / np.maximum(known, 1), np.nan))
    _spread_values(coarse, any_inside, 1)
    twice = Grid((0.0, 0.0, 0.0), (2.0, 2.0, 2.0), coarse.shape)
    return over_cells(twice, coarse)(np.argwhere(inside).astype(np.float64) + 0.5)


@kernel
def _conjugate_gradients(neighbours: Any, free: Any, x: Any, work: Any, precision: Any) -> None:
    """Improve `x` at free cells until the residual falls below the precision.

    `work` holds the residual, the way to go, its image, and one over the number of neighbours,
    which is 0 for cells that do not move.
    """
    n = x.size
    residual, way, image, inverse = work[0], work[1], work[2], work[3]
    energy, unknowns = 0.0, 0
    for i in range(n):
        residual[i] = way[i] = inverse[i] = 0.0
        if not free[i]:
            continue
        total, count = 0.0, 0
        for m in range(6):
            j = neighbours[i, m]
            if j >= 0:
                total += x[j] - x[i]
                count += 1
        if count > 0:
            unknowns += 1
            inverse[i] = 1.0 / count
            residual[i] = total
            way[i] = total * inverse[i]
            energy += total * way[i]
    enough = precision * precision * unknowns
    for _ in range(20000):
        if energy <= enough:
            return
        curvature = 0.0
        for i in range(n):
            if inverse[i] > 0.0:
                own, total = way[i], 0.0
                for m in range(6):
                    j = neighbours[i, m]
                    if j >= 0:
                        total += own - way[j]
                image[i] = total
                curvature += own * total
        if curvature <= 0.0:
            return
        length = energy / curvature
        fresh = 0.0
        for i in range(n):
            if inverse[i] > 0.0:
                x[i] += length * way[i]
                residual[i] -= length * image[i]
                fresh += residual[i] * residual[i] * inverse[i]
        turn = fresh / energy
        energy = fresh
        for i in range(n):
            way[i] = residual[i] * inverse[i] + turn * way[i]


# ------------------------------------------------------------------------------------------------
# The shortest way through the part from a region.


_Ends = tuple[float | None, float | None]
"""Where a field is 0 and 1, if that is stated."""


def geodesic_field(
    mesh: Mesh, start: FieldRegion, pitch_mm: float, ends: _Ends, origin_mm: Point
) -> FunctionField:
    """Measure shortest ways within a part from a region, on cells (Theta*, Nash et al. 2007).

    Ways go by middles of cells: they are too long by about a cell from the start, and by half a
    cell for each radian that they bend along a curved wall.

    Messages give places as seen from `origin_mm`: where the part's own origin lies.

    Raises
    ------
    ArgumentError
        The region holds nothing of the part, or a body of the part cannot be reached from it.
    """
    pitch_mm, grid, inside, (seeds,) = _solved_cells(
        mesh, pitch_mm, "geodesic", {"start": start}, origin_mm
    )
    lost = "geodesic: no way leads from start= to {} within the part"
    reached = _reached_cells(inside, seeds, grid, origin_mm, lost)
    cells = pitch_mm * _shortest_ways(reached, seeds)
    ramp = Ramp.over(cells[reached], 0.0 if ends[0] is None else ends[0], ends[1])
    _spread_values(cells, reached)
    says = {"start": dict(start.says), "cells_mm": pitch_mm}
    return ramp.along(over_cells(grid, cells), "geodesic", says)


_BLOCKED, _QUEUED, _FRESH = -3, -2, -1
"""What a cell without a way yet has for the cell where its way bends last."""


def _shortest_ways(inside: BoolArray, seeds: BoolArray) -> FloatArray:
    """Return how long the shortest ways from seeds are within cells (nx, ny, nz), in cells."""
    parent = np.pad(np.where(inside, _FRESH, _BLOCKED), 1, constant_values=_BLOCKED)
    first, (_, row, tube) = np.flatnonzero(np.pad(seeds, 1)), parent.shape
    parent.flat[first], length = first, np.zeros(parent.size)
    near, queue = np.array((row * tube, tube, 1)), np.resize(first, np.count_nonzero(inside))
    _walk(length, parent.ravel(), queue, len(first), np.append(near, -near), row, tube)
    # Facets and kinks of less than a cell are levelled; what rises evenly stays as it is.
    value: FloatArray = length.reshape(parent.shape)[1:-1, 1:-1, 1:-1]
    for axis in range(3):
        along = np.moveaxis(value, axis, 0)
        free, fixed = (np.moveaxis(of, axis, 0) for of in (inside, seeds))
        level = free[:-2] & free[1:-1] & free[2:] & ~fixed[1:-1]
        along[1:-1] += np.where(level, 0.25 * (along[:-2] + along[2:]) - 0.5 * along[1:-1], 0.0)
    return value


@inner_kernel
def _steps(x: Any, y: Any, row: Any, tube: Any) -> Any:
    x_row, y_row = x // tube, y // tube
    return y_row // row - x_row // row, y_row % row - x_row % row, y % tube - x % tube


@inner_kernel
def _apart(x: Any, y: Any, row: Any, tube: Any) -> Any:
    i, j, k = _steps(x, y, row, tube)
    return np.sqrt(float(i * i + j * j + k * k))


@inner_kernel
def _sees(parent: Any, x: Any, bend: Any, row: Any, tube: Any) -> Any:
    """Tell whether cells beside the straight line join x to the bend, by faces.

    No more is asked where all cells that the line may enter go straight to that bend.
    """
    i, j, k = _steps(x, bend, row, tube)
    forth = (row * tube if i > 0 else -row * tube, tube if j > 0 else -tube, 1 if k > 0 else -1)
    left = i, j, k = abs(i), abs(j), abs(k)
    whole, lit = (max(i, 1), max(j, 1), max(k, 1)), True
    while x != bend:
        # The step that is due first; where a wall is, another that is due less than one on.
        behind = max((i - 0.5) / whole[0], (j - 0.5) / whole[1], (k - 0.5) / whole[2])
        due, to = 0.0, 0
        for d in range(3):
            if left[d] > behind * whole[d]:
                there = parent[x + forth[d]]
                lit = lit and there == bend
                if there != _BLOCKED and (left[d] - 0.5) / whole[d] > due:
                    due, to = (left[d] - 0.5) / whole[d], d
        if lit or due == 0.0:
            return lit
        x, left = x + forth[to], (i - (to == 0), j - (to == 1), k - (to == 2))
        i, j, k = left
    return True


@kernel
def _walk(length: Any, parent: Any, queue: Any, count: Any, near: Any, row: Any, tube: Any) -> None:
    """Find shortest ways in order of rising length, as strings that are pulled tight.

    A way is straight from bend to bend, at middles of cells. A cell goes straight to where a
    neighbour's way bends last, if it sees that, or bends in the neighbour (Theta*), or beside that
    bend where it is shorter.
    """
    limit = 0.0
    while count > 0:
        limit, kept, at = limit + 0.5, 0, 0
        while at < count:
            x, at = queue[at], at + 1
            if parent[x] < 0 and length[x] < limit:
                best, bend = np.inf, x
                for n in range(18):
                    # Where a neighbour's way bends last, the neighbours, and beside the best bend.
                    y = parent[x + near[n]] if n < 6 else near[n % 6] + (x if n < 12 else bend)
                    if y < 0 or y == bend or parent[y] < 0:
                        continue
                    whole = length[y] + _apart(x, y, row, tube)
                    begin, end = (x, y) if n < 6 else (y, x)  # where a wall is likelier to be soon
                    if whole < best - 1e-9 and _sees(parent, begin, end, row, tube):
                        best, bend = whole, y
                length[x] = best
                if best < limit:
                    parent[x] = bend
            if length[x] >= limit:  # for later
                queue[kept], kept = x, kept + 1
                continue
            for y in x + near:
                if parent[y] == _FRESH:
                    parent[y], queue[count], count = _QUEUED, y, count + 1
                    length[y] = length[parent[x]] + _apart(y, parent[x], row, tube)
        count = kept


# ------------------------------------------------------------------------------------------------
# Values at scattered points, from a file.


_NEAREST = (8, 32, 128)
"""Neighbours that tell a slope: the nearest; more where those lie flat, as on grids that are finer
one way. Chosen: 128 reach across steps six times as long one way, or thirty times two ways."""

_FLAT = 0.1
"""Of how far neighbours spread along one direction over another, below which values tell of no
slope along it. Chosen: below, an uneven grid makes a slope of what its values bend."""

_SLOPES_AT_ONCE = 1 << 14  # some 50 MB where neighbours are many


def points_field(
    says: Mapping[str, Any], points_mm: FloatArray, quantity: FloatArray, ends: _Ends
) -> FunctionField:
    """Build the field of scattered values: a mean of planes, those of nearer points weighing more.

    Each goes through a point's value, sloped as its eight neighbours lie, or as many as do not lie
    flat; weights fall to nothing at the ninth nearest (modified Shepard, Franke and Nielson 1980).
    So the field is continuous, keeps each point's value at the point, and is linear where values
    are; it stays within the range of all values. Points that repeat a place take their mean.

    Raises
    ------
    ArgumentError
        Fewer than four places.
    """
    from scipy.spatial import KDTree

    places, which, count = np.unique(points_mm, axis=0, return_inverse=True, return_counts=True)
    if len(places) < 4:
        few = f"{says['file']} has {len(places)} places"
        raise ArgumentError(f"field points: {few}; it needs 4 or more")
    mean = np.bincount(which.ravel(), weights=quantity) / count
    tree, slopes = KDTree(places), np.zeros_like(places)
    nearest = partial(tree.query, k=min(_NEAREST[0] + 1, len(places)))
    for flat in np.array_split(np.arange(len(places)), len(places) // _SLOPES_AT_ONCE + 1):
        for most in _NEAREST:
            near = np.asarray(tree.query(places[flat], k=min(most + 1, len(places)))[1])[:, 1:]
            far, rises = places[near] - places[flat, None], mean[near] - mean[flat, None]
            slopes[flat] = np.einsum("nij,nj->ni", np.linalg.pinv(far, rcond=_FLAT), rises)
            flat = flat[np.linalg.matrix_rank(far, rtol=_FLAT) < 3]

    def at(points_mm: FloatArray) -> FloatArray:
        distance, which = map(np.asarray, nearest(points_mm))
        reach = distance[:, -1:] * (1.0 + 1e-12) + 1e-300
        weight = np.square(np.maximum(reach - distance, 0.0) / (reach * (distance + 1e-12)))
        weight /= weight.sum(axis=1, keepdims=True)
        own = mean[which]
        planes = np.einsum("nkj,nkj->nk", points_mm[:, None] - places[which], slopes[which]) + own
        return np.asarray(np.clip((weight * planes).sum(axis=1), mean.min(), mean.max()))

    return Ramp.over(mean, *ends).along(at, "points", says, length=False)
