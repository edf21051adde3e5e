"""Cells that a surface cuts from a Cartesian lattice, with positive quadrature in each."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from planner.errors import ArgumentError, MeshError, positive
from planner.mesh.mesh import Mesh, connected, number_groups, unite
from planner.numerics import BoolArray, FloatArray, IntArray, free_kernel, inner_kernel, kernel
from planner.voxels.columns import MOST_VOXELS, Columns, Grid, iterate_columns, join

__all__ = ["COLUMNS_ACROSS", "MOMENTS", "CutCells", "cut_cells", "halve_long_edges"]


COLUMNS_ACROSS = 24
"""Columns of material sampled along an edge of a cell."""

_DEGREE = 6
MOMENTS = (_DEGREE + 1) * (_DEGREE + 2) * (_DEGREE + 3) // 6
"""Monomials of total degree up to 6 in three variables, which the quadrature integrates exactly."""

_MOST_COLUMNS = 1 << 26
# Lattice columns over the bounding box: 12 bytes each, 0.8 GB.

_FEWEST_ALONG = 2
# Cells along the part's longest side. With one cell there is nothing to bend.

_NEARLY_NOTHING = 0.01
# of a cell's volume. A body of less, which hangs on nothing, is what columns make of the edge of
# a blade, and far below what a cell resolves; the material dropped is told.

_PLAIN_STEP = 1e-6
# of a cell: a point this close to a face of its cell is in the cell that its material is in.


# ------------------------------------------------------------------------------------------------
# The cells of a part.
#
# Material is sampled by exact columns along z, on a square lattice turned about z by an angle
# whose tangent, the golden ratio, is badly approximable: walls along x or y then gain and lose
# columns evenly, where a lattice along the walls would misjudge all of them by the same share of
# a pitch. A column belongs to the cell that its place is in, and stands for an equal share of that
# cell's footprint, so that full cells are exact. Along z runs end within 1/16384 of the part's
# height. What is exact from there on is exact for this sampled material: the moments of a piece
# converge with the spacing of columns, faster than its first power.


@dataclass(frozen=True, eq=False)
class CutCells:
    """Cartesian cells that a closed surface cuts, with positive quadrature over the material.

    Each connected piece of material in a cell of the lattice is a cell here: where two walls stand
    in one, it is there twice, with nodes of its own for each wall. Pieces of neighbouring cells
    share the nodes of their common face exactly when material connects them through it, so that
    one quadratic field runs through each body. A skin that lies on a face, thinner than the
    columns hold together (0.06 of a cell), belongs to the piece on the face's other side.

    The quadrature is exact for polynomials of total degree 6 over a cut cell; in a full one it is
    Gauss's, of 27 points. Cut ones have 27 points as well, save the odd flat piece. Points lie in
    the bounding box of their piece: not all of them in material, where the piece is not convex.

    Attributes
    ----------
    origin_mm : (3,)
        Lower corner of cell (0, 0, 0), which is that of the part's bounding box.
    cell_mm : (3,)
        Edges of a cell: the bounding box divided evenly.
    index : (n, 3) int32
        Place of each cell in the lattice, x slowest.
    nodes : (n, 27) int32
        Nodes of each cell: local node i + 3 j + 9 k with i, j, k in 0..2 along x, y, z.
    node_mm : (N, 3)
        Their places.
    body : (n,) int32
        Number of the connected body each cell belongs to.
    offsets : (n + 1,) int64
        Cell c has the quadrature points ``offsets[c]`` to ``offsets[c + 1]``.
    points : (Q, 3)
        In the cell's own coordinates: -1..1, and as far as 1.12 where a skin belongs to it.
    weights_mm3 : (Q,)
        All above 0; their sum is the volume.
    surface
        The part's surface, its long edges halved until none is longer than half a cell.
    triangle : (F,) int32
        The part's own triangle that each facet of `surface` is of.
    vertex_cell : (V,) int32
        The cell each vertex of `surface` bounds.
    vertex_local : (V, 3)
        Its place there, in the cell's own coordinates: -1..1, a little more on skins.
    dropped_mm3
        Volume of specks that hang on nothing and are left out.
    material
        The columns, from which `locate` finds cells.
    """

    origin_mm: FloatArray
    cell_mm: FloatArray
    index: NDArray[np.int32]
    nodes: NDArray[np.int32]
    node_mm: FloatArray
    body: NDArray[np.int32]
    offsets: NDArray[np.int64]
    points: FloatArray
    weights_mm3: FloatArray
    surface: Mesh
    triangle: NDArray[np.int32]
    dropped_mm3: float
    material: "Material" = field(repr=False)
    vertex_cell: NDArray[np.int32] = field(init=False)
    vertex_local: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        cell, local = self.locate(self.surface.vertices, _inward(self.surface))
        object.__setattr__(self, "vertex_cell", cell)
        object.__setattr__(self, "vertex_local", local)

    @property
    def volume_mm3(self) -> float:
        """Volume of the material."""
        return float(np.sum(self.weights_mm3))

    def locate(
        self, points_mm: FloatArray, inward: FloatArray
    ) -> tuple[NDArray[np.int32], FloatArray]:
        """Find the cell, and the place in it, of points on the surface.

        A point is in the piece of its own cell whose material is nearest to it, seen from a
        column's spacing inwards. Where its cell has no material as near as a neighbour has (it
        was thinner than the columns see), it is in the neighbour, and its place a little outside.

        Parameters
        ----------
        points_mm : (k, 3)
            On the surface, or close to it.
        inward : (k, 3)
            Unit vectors from there into the material.

        Returns
        -------
        cell : (k,) int32
        local : (k, 3)
            In the cell's own coordinates: -1..1, and beyond where the piece goes on or is nearest.
        """
        material = self.material
        place = (points_mm - self.origin_mm) / self.cell_mm
        counts = np.array(material.counts)
        own = np.clip(np.floor(place + _PLAIN_STEP * inward), 0, counts - 1).astype(np.int64)
        step = material.frame[2]
        target = points_mm - self.origin_mm + step * inward
        target[:, 2] *= material.voxels / self.cell_mm[2]
        cell = np.empty(len(points_mm), np.int32)
        _nearest(
            *material.lines, material.frame, material.piece, np.array(counts),
            self.cell_mm[2] / material.voxels, own, target, cell,
        )  # fmt: skip
        found = self.index[cell]
        local = 2.0 * (place - found) - 1.0
        inside = (found == own).all(axis=1)
        local[inside] = np.clip(local[inside], -1.0, 1.0)
        return cell, local


def cut_cells(
    mesh: Mesh,
    cell_mm: float,
    *,
    columns_across: int = COLUMNS_ACROSS,
    most_cells: int = 100_000,
    threads: int = 2,
) -> CutCells:
    """Cut a closed surface into cells.

    Parameters
    ----------
    mesh
        Closed, outward surface.
    cell_mm
        Wanted edge of a cell; the bounding box is divided evenly into cells no longer than that.
    columns_across
        Columns of material sampled along an edge of a cell.
    most_cells
        Refuse a part that has more.
    threads
        Number of threads; the result does not depend on it.

    Raises
    ------
    ArgumentError
        `cell_mm` is not positive, too large or too small for the part.
    MeshError
        The surface is open, or no material is found in it.
    """
    positive(cell_mm, "`cell_mm`")
    low, high = mesh.bounds_mm
    extent = high - low
    if not np.max(extent) > (_FEWEST_ALONG - 1) * cell_mm:
        raise ArgumentError(
            f"`cell_mm` {cell_mm:g}: the part is {_by(extent)} mm; at least {_FEWEST_ALONG} cells "
            f"along its longest side are needed: {np.max(extent) / _FEWEST_ALONG:.3g} or less"
        )
    if not np.min(extent) > 0:
        raise MeshError(f"the part is {_by(extent)} mm, which holds no material; give a solid")
    counts = np.maximum(np.ceil(extent / cell_mm - 1e-6), 1.0)
    columns = np.sum(extent[:2]) * np.hypot(*extent[:2]) * (columns_across / cell_mm) ** 2
    fewest = max(mesh.volume_mm3, 0.0) / cell_mm**3
    if max(counts) * columns_across * 1.5 > MOST_VOXELS or columns > _MOST_COLUMNS:
        raise ArgumentError(
            f"`cell_mm` {cell_mm:g}: {_by(counts)} cells across the part are more than can be "
            "sampled; choose a larger cell"
        )
    if fewest > most_cells:
        raise _too_many(cell_mm, fewest, most_cells)
    cells = tuple(int(n) for n in counts)
    material = _sample(mesh, low, extent, cells, columns_across)
    pieces = _pieces(material, extent / counts)
    if not len(pieces.index):
        raise MeshError(
            f"no material is found in the part at `cell_mm` {cell_mm:g}: its walls are thinner "
            f"than {material.frame[2]:.2g} mm; choose a smaller cell, or check the part's unit"
        )
    if len(pieces.index) > most_cells:
        raise _too_many(cell_mm, len(pieces.index), most_cells)
    size = extent / counts
    offsets, points, weights = _quadrature(pieces, size, threads)
    surface, triangle = halve_long_edges(mesh, float(np.min(size)) / 2)
    return CutCells(
        low, size, pieces.index, pieces.nodes, low + pieces.node_place * (size / 2), pieces.body,
        offsets, points, weights, surface, triangle, pieces.dropped * float(np.prod(size)),
        pieces.material,
    )  # fmt: skip


def _by(sizes: FloatArray) -> str:
    return " x ".join(f"{s:.4g}" for s in sizes)


def _too_many(cell_mm: float, cells: float, most: int) -> ArgumentError:
    return ArgumentError(
        f"`cell_mm` {cell_mm:g}: the part has at least {cells:.0f} cells, and {most} are possible; "
        f"choose a larger cell, about {cell_mm * (cells / most) ** (1 / 3):.2g} or more"
    )


# ------------------------------------------------------------------------------------------------
# Material as columns, and where each stands.


@dataclass(frozen=True, eq=False)
class Material:
    """Columns of material, cut into segments by the cells' faces.

    Attributes
    ----------
    columns
        In the turned frame; z in steps of which each cell has `voxels`.
    counts
        Cells along x, y, z.
    voxels
        Steps along z in a cell.
    frame : (9,)
        u and v of the first column, spacing, cosine and sine of the turn, and the scale
        of x and y in cells a mm; u, v and x, y are from the part's lower corner.
    foot : (columns,) int32
        Footprint each column stands in, ``i counts[1] + j``; -1 outside the bounding box.
    per_foot : (footprints,) int64
        Columns that stand in each.
    first : (runs,) int64
        First segment of each run; the others follow upwards, one a cell.
    piece : (segments,) int32
        Cell (of `CutCells`) that each segment belongs to; -1 where it is dropped.
    """

    columns: Columns
    counts: tuple[int, ...]
    voxels: int
    frame: FloatArray
    foot: NDArray[np.int32]
    per_foot: NDArray[np.int64]
    first: NDArray[np.int64]
    piece: NDArray[np.int32]

    @property
    def lines(self) -> tuple[Any, Any, Any, Any, Any, int, int]:
        """What loops over segments begin with."""
        c = self.columns
        return (c.offsets, c.start, c.stop, self.first, self.foot, c.grid.shape[0], self.voxels)


def _sample(
    mesh: Mesh, low: FloatArray, extent: FloatArray, cells: tuple[int, ...], across: int
) -> Material:
    golden = (1.0 + np.sqrt(5.0)) / 2.0
    cos, sin = 1.0 / np.sqrt(1.0 + golden**2), golden / np.sqrt(1.0 + golden**2)
    x, y, z = (mesh.vertices - low).T
    turned = Mesh(np.stack([cos * x + sin * y, cos * y - sin * x, z], axis=1), mesh.faces)
    size = extent / cells
    pitch = float(min(size[:2])) / across
    # the lattice covers the turned bounding box, so that all footprints are whole
    u = (0.0, cos * extent[0] + sin * extent[1])
    v = (-sin * extent[0], cos * extent[1])
    nu, nv = (int(np.ceil((b - a) / pitch)) for a, b in (u, v))
    voxels = (MOST_VOXELS - 1) // cells[2]
    grid = Grid((u[0], v[0], 0.0), (pitch, pitch, size[2] / voxels), (nu, nv, voxels * cells[2]))
    columns = join(list(iterate_columns(turned, grid)))
    if columns.faults.open_columns:
        raise MeshError(
            f"the surface is open: {columns.faults.open_columns} lines along z go in and do not "
            "come out, or come out twice; repair the part first"
        )
    frame = np.array(
        [u[0] + pitch / 2, v[0] + pitch / 2, pitch, cos, sin, 1.0 / size[0], 1.0 / size[1]]
    )
    foot = np.empty(nu * nv, np.int32)
    _find_feet(frame, nu, cells[0], cells[1], foot)
    runs = np.diff(columns.offsets)
    reach = (columns.stop - 1) // voxels - columns.start // voxels + 1
    reach[np.repeat(foot < 0, runs)] = 0
    first = np.append(0, np.cumsum(reach, dtype=np.int64))
    piece = np.arange(first[-1], dtype=np.int32)
    per_foot = np.bincount(foot[foot >= 0], minlength=cells[0] * cells[1])
    return Material(columns, cells, voxels, frame, foot, per_foot, first[:-1], piece)


@inner_kernel
def _column_place(frame: Any, nu: Any, c: Any) -> Any:
    # x and y of a column in cells.
    u, v = frame[0] + (c % nu) * frame[2], frame[1] + (c // nu) * frame[2]
    return (frame[3] * u - frame[4] * v) * frame[5], (frame[4] * u + frame[3] * v) * frame[6]


@kernel
def _find_feet(frame: Any, nu: Any, cells_x: Any, cells_y: Any, foot: Any) -> None:
    for c in range(foot.size):
        x, y = _column_place(frame, nu, c)
        i, j = int(np.floor(x)), int(np.floor(y))
        foot[c] = i * cells_y + j if 0 <= i < cells_x and 0 <= j < cells_y else -1


# ------------------------------------------------------------------------------------------------
# Pieces, and the nodes they share.


@dataclass(frozen=True, eq=False)
class _Pieces:
    """Connected pieces of material in the cells, in the order of `CutCells`."""

    material: Material  # with its segments told to pieces
    index: NDArray[np.int32]
    nodes: NDArray[np.int32]
    node_place: NDArray[np.int32]  # in halves of a cell
    body: NDArray[np.int32]
    full: BoolArray  # whether the piece is all of its cell, and nothing else
    dropped: float  # volume left out, in cells


def _pieces(material: Material, size: FloatArray) -> _Pieces:
    parent = material.piece.copy()
    _join_within(*material.lines, parent)
    piece = number_groups(parent)
    n = int(piece.max(initial=-1)) + 1
    filled, cell, ends = np.zeros(n, np.int64), np.zeros(n, np.int64), np.empty((n, 2, 3))
    ends[:, 0], ends[:, 1] = np.inf, -np.inf
    _fill(*material.lines, material.frame, np.array(material.counts), piece, filled, cell, ends)
    place = np.stack(np.unravel_index(cell, material.counts), axis=1)
    share = filled / (material.per_foot[cell // material.counts[2]] * material.voxels)
    last, pairs = np.full((n, 10), -1, np.int32), np.empty((0, 2), np.int32)
    many = _pairs_across(*material.lines, material.counts[1], piece, last.copy(), pairs)
    pairs = np.empty((many, 2), np.int32)
    _pairs_across(*material.lines, material.counts[1], piece, last, pairs)
    pairs = np.unique(pairs, axis=0)
    body = connected(n, *pairs.T)

    thin = (material.frame[3] + material.frame[4]) * material.frame[2] / size
    flat = np.stack([ends[:, 1] <= place + thin, ends[:, 0] >= place + 1 - thin], axis=2)
    into = _merge_skins(pairs, place, flat, share)
    kept = (into == np.arange(n)) & (np.bincount(body, share)[body] >= _NEARLY_NOTHING)
    order = np.flatnonzero(kept)
    order = order[np.argsort(cell[order], kind="stable")]
    number = np.full(n, -1, np.int32)
    number[order] = np.arange(len(order))
    own = np.arange(27 * n, dtype=np.int32)
    pairs = np.unique(into[pairs], axis=0)
    _join_nodes(pairs, place, own)
    index = place[order].astype(np.int32)
    nodes, node_place = _number_nodes(number_groups(own).reshape(n, 27)[order], index)
    bodies = np.unique(body[order], return_inverse=True)[1].astype(np.int32)
    full = (share == 1.0) & (np.bincount(into, minlength=n) == 1)
    dropped = float(np.sum(share[number[into] < 0]))
    told = replace(material, piece=number[into[piece]])
    return _Pieces(told, index, nodes, node_place, bodies, full[order], dropped)


@kernel
def _join_within(
    offsets: Any, start: Any, stop: Any, first: Any, foot: Any, nu: Any, voxels: Any, piece: Any
) -> None:
    # Join segments of neighbouring columns that touch within a cell.
    for c in range(foot.size):
        for side in range(2):
            d = c + (nu if side else 1)
            if foot[c] < 0 or d >= foot.size or (not side and d % nu == 0) or foot[d] != foot[c]:
                continue
            r, s = offsets[c], offsets[d]
            while r < offsets[c + 1] and s < offsets[d + 1]:
                low, high = max(start[r], start[s]), min(stop[r], stop[s])
                if low < high:
                    for k in range(low // voxels, (high - 1) // voxels + 1):
                        one = first[r] + k - start[r] // voxels
                        unite(piece, one, first[s] + k - start[s] // voxels)
                if stop[r] < stop[s]:
                    r += 1
                else:
                    s += 1


@kernel
def _pairs_across(
    offsets: Any,
    start: Any,
    stop: Any,
    first: Any,
    foot: Any,
    nu: Any,
    voxels: Any,
    cells_y: Any,
    piece: Any,
    last: Any,
    pairs: Any,
) -> Any:
    # Pairs of pieces that touch across cells, as many as there is room for; how many there are.
    # `last` is what each piece was paired with last on each side, which spares most repeats.
    n = 0
    for c in range(foot.size):
        if foot[c] < 0:
            continue
        for r in range(offsets[c], offsets[c + 1]):
            for s in range(first[r], first[r] + (stop[r] - 1) // voxels - start[r] // voxels):
                p, q = piece[s], piece[s + 1]
                if last[p, 9] != q:
                    last[p, 9] = q
                    if n < pairs.shape[0]:
                        pairs[n, 0], pairs[n, 1] = min(p, q), max(p, q)
                    n += 1
        for side in range(2):
            d = c + (nu if side else 1)
            if d >= foot.size or (not side and d % nu == 0) or foot[d] < 0 or foot[d] == foot[c]:
                continue
            dx = foot[d] // cells_y - foot[c] // cells_y
            way = 3 * dx + foot[d] % cells_y - foot[c] % cells_y + 4
            r, s = offsets[c], offsets[d]
            while r < offsets[c + 1] and s < offsets[d + 1]:
                low, high = max(start[r], start[s]), min(stop[r], stop[s])
                if low < high:
                    for k in range(low // voxels, (high - 1) // voxels + 1):
                        p = piece[first[r] + k - start[r] // voxels]
                        q = piece[first[s] + k - start[s] // voxels]
                        if last[p, way] != q:
                            last[p, way] = q
                            if n < pairs.shape[0]:
                                pairs[n, 0], pairs[n, 1] = min(p, q), max(p, q)
                            n += 1
                if stop[r] < stop[s]:
                    r += 1
                else:
                    s += 1
    return n


@kernel
def _fill(
    offsets: Any,
    start: Any,
    stop: Any,
    first: Any,
    foot: Any,
    nu: Any,
    voxels: Any,
    frame: Any,
    counts: Any,
    piece: Any,
    filled: Any,
    cell: Any,
    ends: Any,
) -> None:
    # How much of its cell each piece fills, which cell that is, and its bounds, in cells.
    for c in range(foot.size):
        if foot[c] < 0:
            continue
        x, y = _column_place(frame, nu, c)
        for r in range(offsets[c], offsets[c + 1]):
            for k in range(start[r] // voxels, (stop[r] - 1) // voxels + 1):
                p = piece[first[r] + k - start[r] // voxels]
                low, high = max(start[r], k * voxels), min(stop[r], (k + 1) * voxels)
                filled[p] += high - low
                cell[p] = foot[c] * counts[2] + k
                ends[p, 0, 0], ends[p, 1, 0] = min(ends[p, 0, 0], x), max(ends[p, 1, 0], x)
                ends[p, 0, 1], ends[p, 1, 1] = min(ends[p, 0, 1], y), max(ends[p, 1, 1], y)
                ends[p, 0, 2] = min(ends[p, 0, 2], low / voxels)
                ends[p, 1, 2] = max(ends[p, 1, 2], high / voxels)


def _merge_skins(
    pairs: NDArray[np.int32], place: IntArray, flat: BoolArray, share: FloatArray
) -> NDArray[np.int32]:
    """Tell which piece each piece is made part of: its own number, or that of a neighbour.

    Where a wall ends just beyond a face of the lattice, what is beyond is a skin on that face,
    thinner than the lattice of columns holds together: it would be many cells of a column
    each. Such a skin belongs to the piece that it lies on, whose field goes on through it.
    Only where it lies on one piece alone: a skin that bridges two walls is a cell of its own.

    Parameters
    ----------
    pairs
        Pieces that touch across a face.
    place
        Cell each is in.
    flat : (n, 3, 2)
        Whether it lies wholly at the lower, or the upper face of its cell along each axis.
    """
    into = np.arange(len(place), dtype=np.int32)
    skin, base = np.unique(np.concatenate([pairs, pairs[:, ::-1]]), axis=0).T
    step = place[skin] - place[base]
    axis = np.argmax(np.abs(step), axis=1)
    side = (np.take_along_axis(step, axis[:, None], axis=1)[:, 0] < 0).astype(np.int64)
    lies = flat[skin, axis, side] & (np.sum(np.abs(step), axis=1) == 1)
    skin, base, on = skin[lies], base[lies], (6 * skin.astype(np.int64) + 2 * axis + side)[lies]
    _, which, repeats = np.unique(on, return_inverse=True, return_counts=True)
    alone = repeats[which] == 1
    skin, base = skin[alone], base[alone]
    waiting = np.zeros(len(place), np.bool_)
    waiting[skin] = True
    while True:  # a skin on a skin, at an edge of the lattice, goes where that one went
        target = into[base]
        away = place[skin] - place[target]
        near = (away == 0) | ((away == 1) & flat[skin, :, 0]) | ((away == -1) & flat[skin, :, 1])
        found = np.flatnonzero(waiting[skin] & ~waiting[base] & near.all(axis=1))
        if not len(found):
            return into
        found = found[np.lexsort((target[found], share[target[found]]))]
        into[skin[found]] = target[found]  # the last of several counts: the largest
        waiting[skin[found]] = False


@kernel
def _join_nodes(pairs: Any, place: Any, parent: Any) -> None:
    # Join the nodes that the cells of each pair have in common.
    for n in range(pairs.shape[0]):
        p, q = pairs[n, 0], pairs[n, 1]
        dx = place[q, 0] - place[p, 0]
        dy = place[q, 1] - place[p, 1]
        dz = place[q, 2] - place[p, 2]
        if p == q or (dx == 0 and dy == 0 and dz == 0):
            continue
        for a in range(27):
            i, j, k = a % 3 - 2 * dx, a // 3 % 3 - 2 * dy, a // 9 - 2 * dz
            if 0 <= i <= 2 and 0 <= j <= 2 and 0 <= k <= 2:
                unite(parent, 27 * p + a, 27 * q + i + 3 * j + 9 * k)


def _number_nodes(
    group: NDArray[np.int32], index: NDArray[np.int32]
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    # Number nodes by their place, x slowest; those at one place by the first cell that has them.
    a = np.arange(27)
    local = np.stack([a % 3, a // 3 % 3, a // 9], axis=1)
    place = (2 * index[:, None] + local).reshape(-1, 3)
    _, at, node = np.unique(group, return_index=True, return_inverse=True)
    x, y, z = place[at].T
    order = np.lexsort((at, z, y, x))
    number = np.empty(len(order), np.int32)
    number[order] = np.arange(len(order))
    return number[node.reshape(group.shape)], place[at[order]].astype(np.int32)


# ------------------------------------------------------------------------------------------------
# Quadrature.
#
# The material of a cut piece is a discrete measure: 4 Gauss points along each segment. Its moments
# up to degree 6 are met by 27 points, as many as a full cell has: 108 numbers for 84 equations.
# Newton's method finds them (the step of least length, no weight below zero and no point out of
# the piece's box), from the Gauss points of a box stretched to where the material is.
#
# Where that does not end (flat or odd pieces), Tchakaloff's theorem does: points of the measure
# itself, at most as many as there are moments, carry them with positive weights. They are found by
# halving: points in twice as many groups as there are moments; the groups' own moments are
# linearly dependent, and weight is moved along that dependence until one group has none, again
# and again. Each round drops half of the groups.


_CHUNK = 32  # pieces that a thread takes at once


def _quadrature(
    pieces: _Pieces, size: FloatArray, threads: int
) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
    material, n = pieces.material, len(pieces.index)
    full = pieces.full
    nodes, gauss = np.polynomial.legendre.leggauss(3)
    a = np.arange(27)
    local = np.stack([nodes[a % 3], nodes[a // 3 % 3], nodes[a // 9]], axis=1)
    weight = gauss[a % 3] * gauss[a // 3 % 3] * gauss[a // 9] / 8

    cut = np.cumsum(~full, dtype=np.int32) - np.int32(1)
    cut[full] = -1
    many = int(np.count_nonzero(~full))
    where = cut[material.piece]
    where[material.piece < 0] = -1
    begin = np.append(0, np.cumsum(np.bincount(where[where >= 0], minlength=many)))
    segments = np.empty((int(begin[-1]), 3), np.int32)
    index = pieces.index[~full]
    _gather(*material.lines, where, index[:, 2].copy(), begin[:-1].copy(), segments)

    points, weights = np.zeros((many, MOMENTS, 3)), np.zeros((many, MOMENTS))
    used = np.zeros(many, np.int64)
    rule = np.stack(np.polynomial.legendre.leggauss(4))
    share = 1.0 / material.per_foot[material.foot]  # of a column outside of all: not asked for

    def work(first: int) -> None:
        chunk = slice(first, min(first + _CHUNK, many))
        most = int(np.max(np.diff(begin[first : chunk.stop + 1])))
        _compress(
            segments, begin, first, chunk.stop, material.frame, material.columns.grid.shape[0],
            material.voxels, share, index, rule, np.empty((4 * most, 4)),
            np.empty((MOMENTS, 2 * MOMENTS)), np.empty((MOMENTS, MOMENTS)),
            np.empty((4 * _SETTLED, MOMENTS)), points, weights, used,
        )  # fmt: skip

    with ThreadPoolExecutor(max(1, threads)) as pool:
        for _ in pool.map(work, range(0, many, _CHUNK)):
            pass
    counts = np.full(n, 27)
    counts[~full] = used
    offsets = np.append(0, np.cumsum(counts))
    is_full = np.repeat(full, counts)
    kept = np.arange(MOMENTS) < used[:, None]
    all_points, all_weights = np.empty((offsets[-1], 3)), np.empty(offsets[-1])
    all_points[is_full] = np.tile(local, (n - many, 1))
    all_weights[is_full] = np.tile(weight, n - many)
    all_points[~is_full] = points[kept]
    all_weights[~is_full] = weights[kept]
    return offsets, all_points, all_weights * float(np.prod(size))


@kernel
def _gather(
    offsets: Any,
    start: Any,
    stop: Any,
    first: Any,
    foot: Any,
    nu: Any,
    voxels: Any,
    where: Any,
    layer: Any,
    cursor: Any,
    segments: Any,
) -> None:
    # Segments (column, low, high) of each piece that `where` numbers, one piece after the other.
    for c in range(foot.size):
        if foot[c] >= 0:
            for r in range(offsets[c], offsets[c + 1]):
                for k in range(start[r] // voxels, (stop[r] - 1) // voxels + 1):
                    p = where[first[r] + k - start[r] // voxels]
                    if p >= 0:
                        s = cursor[p]
                        segments[s, 0] = c
                        segments[s, 1] = max(start[r], k * voxels) - layer[p] * voxels
                        segments[s, 2] = min(stop[r], (k + 1) * voxels) - layer[p] * voxels
                        cursor[p] += 1


_SETTLED = 27
"""Points of a cut piece, unless they cannot be found."""

_OUTERMOST = 0.8611363115940526
# of the four Gauss points between -1 and 1.

_STRAY = 0.05
# How far points are moved off the places of Gauss's, of the box's half edge. On these Newton's
# method cannot begin: the square of Legendre's third polynomial is zero there, and so is its
# slope. Any stray from 0.02 to 0.2 does.


@free_kernel
def _compress(
    segments: Any,
    begin: Any,
    first: Any,
    stop: Any,
    frame: Any,
    nu: Any,
    voxels: Any,
    share: Any,
    index: Any,
    rule: Any,
    measure: Any,
    table: Any,
    normal: Any,
    slopes: Any,
    points: Any,
    weights: Any,
    used: Any,
) -> None:
    # The quadrature of pieces first..stop: `points`, `weights` (in cells) and how many are `used`.
    middle, half, turn = np.empty(3), np.empty(3), np.empty((3, 3))
    line, moment = np.empty((7, 7)), np.empty(table.shape[0])
    place, weight = np.empty((_SETTLED, 3)), np.empty(_SETTLED)
    wide = frame[2] * min(frame[5], frame[6])  # half a column's width, of the local -1..1
    for p in range(first, stop):
        n, mass = 0, 0.0
        for s in range(begin[p], begin[p + 1]):
            x, y = _column_place(frame, nu, segments[s, 0])
            bottom = 2.0 * segments[s, 1] / voxels - 1.0
            top = 2.0 * segments[s, 2] / voxels - 1.0
            for g in range(rule.shape[1]):
                measure[n, 0] = 2.0 * (x - index[p, 0]) - 1.0
                measure[n, 1] = 2.0 * (y - index[p, 1]) - 1.0
                measure[n, 2] = (top + bottom + (top - bottom) * rule[0, g]) / 2.0
                measure[n, 3] = (top - bottom) * rule[1, g] / 4.0 * share[segments[s, 0]]
                mass += measure[n, 3]
                n += 1
        _find_box(measure, n, wide, middle, half, turn)
        _into_box(measure, n, middle, half, turn, False)
        for t in range(moment.size):
            moment[t] = 0.0
        for q in range(n):
            for axis in range(3):
                _legendre(measure[q, axis], line[axis], line[3])
            _add_products(moment, measure[q, 3] / mass, line[0], line[1], line[2])
        settled = False
        for trial in range(_TRIALS):
            _guess(measure, n, place, weight, trial)
            settled = n > _SETTLED and _settle(moment, place, weight, line, normal, slopes)
            if settled:
                break
        if settled:
            n = _SETTLED
            for q in range(n):
                for axis in range(3):
                    measure[q, axis] = place[q, axis]
                measure[q, 3] = mass * weight[q]
        else:
            n = _recombine(measure, n, table, line)
        _into_box(measure, n, middle, half, turn, True)
        used[p] = n
        for q in range(n):
            for axis in range(3):
                points[p, q, axis] = measure[q, axis]
            weights[p, q] = measure[q, 3]


@inner_kernel
def _find_box(measure: Any, n: Any, wide: Any, middle: Any, half: Any, turn: Any) -> Any:
    # The box that holds a piece: along the piece's principal axes (the rows of `turn`), or along
    # the cell's where that is not much smaller.
    mean, spread = np.zeros(3), np.zeros((3, 3))
    mass = 0.0
    for q in range(n):
        mass += measure[q, 3]
        for a in range(3):
            mean[a] += measure[q, 3] * measure[q, a]
            for b in range(3):
                spread[a, b] += measure[q, 3] * measure[q, a] * measure[q, b]
    for a in range(3):
        for b in range(3):
            spread[a, b] = spread[a, b] / mass - mean[a] * mean[b] / mass**2
            turn[a, b] = 1.0 if a == b else 0.0
    for sweep in range(18):  # Jacobi's rotations, six times about each axis
        a, b = sweep % 3, (sweep + 1) % 3
        if abs(spread[a, b]) < 1e-14:
            continue
        lean = (spread[b, b] - spread[a, a]) / (2.0 * spread[a, b])
        tan = (1.0 if lean >= 0.0 else -1.0) / (abs(lean) + np.sqrt(lean * lean + 1.0))
        cos = 1.0 / np.sqrt(tan * tan + 1.0)
        sin = tan * cos
        for k in range(3):
            spread[k, a], spread[k, b] = (
                cos * spread[k, a] - sin * spread[k, b],
                sin * spread[k, a] + cos * spread[k, b],
            )
        for k in range(3):
            spread[a, k], spread[b, k] = (
                cos * spread[a, k] - sin * spread[b, k],
                sin * spread[a, k] + cos * spread[b, k],
            )
            turn[a, k], turn[b, k] = (
                cos * turn[a, k] - sin * turn[b, k],
                sin * turn[a, k] + cos * turn[b, k],
            )
    aligned = np.zeros((3, 3))
    for a in range(3):
        aligned[a, a] = 1.0
    whole = _bounds(measure, n, wide, aligned, middle, half)
    if _bounds(measure, n, wide, turn, middle, half) > _MUCH_SMALLER * whole:
        for a in range(3):
            for b in range(3):
                turn[a, b] = aligned[a, b]
        _bounds(measure, n, wide, turn, middle, half)


@inner_kernel
def _bounds(measure: Any, n: Any, wide: Any, turn: Any, middle: Any, half: Any) -> Any:
    # The box along the rows of `turn` about all segments, each a pillar as `wide` as its column.
    volume = 1.0
    for a in range(3):
        low, high = np.inf, -np.inf
        for q in range(0, n, 4):
            across = turn[a, 0] * measure[q, 0] + turn[a, 1] * measure[q, 1]
            rise = (measure[q + 3, 2] - measure[q, 2]) / (2.0 * _OUTERMOST)
            for z in (-rise, rise):
                at = across + turn[a, 2] * ((measure[q + 3, 2] + measure[q, 2]) / 2.0 + z)
                low, high = min(low, at), max(high, at)
        middle[a] = (high + low) / 2.0
        half[a] = (high - low) / 2.0 + wide * np.sqrt(turn[a, 0] ** 2 + turn[a, 1] ** 2)
        volume *= half[a]
    return volume


@inner_kernel
def _into_box(measure: Any, n: Any, middle: Any, half: Any, turn: Any, back: Any) -> Any:
    # From the cell's coordinates to those of the box, -1..1, or back.
    at = np.empty(3)
    for q in range(n):
        for a in range(3):
            at[a] = middle[a] + half[a] * measure[q, a] if back else measure[q, a]
        for a in range(3):
            if back:
                measure[q, a] = turn[0, a] * at[0] + turn[1, a] * at[1] + turn[2, a] * at[2]
            else:
                x = turn[a, 0] * at[0] + turn[a, 1] * at[1] + turn[a, 2] * at[2]
                measure[q, a] = (x - middle[a]) / half[a]


_SIZE = np.sqrt(2.0 * np.arange(8) + 1.0)
_RISE = _SIZE[1:] * _SIZE[:-1] / np.arange(1, 8)
_FALL = np.append(0.0, _RISE[1:] / _RISE[:-1])
# Legendre polynomials of mean square 1 over -1..1: next = rise x this - fall previous.


@inner_kernel
def _legendre(x: Any, value: Any, slope: Any) -> Any:
    value[0], slope[0] = 1.0, 0.0
    value[1], slope[1] = _RISE[0] * x, _RISE[0]
    for d in range(1, 6):
        value[d + 1] = _RISE[d] * x * value[d] - _FALL[d] * value[d - 1]
        slope[d + 1] = _RISE[d] * (value[d] + x * slope[d]) - _FALL[d] * slope[d - 1]


@inner_kernel
def _add_products(row: Any, factor: Any, x: Any, y: Any, z: Any) -> Any:
    # Add factor x[a] y[b] z[c] to all moments, those of a + b + c up to 6.
    t = 0
    for a in range(7):
        for b in range(7 - a):
            f = factor * x[a] * y[b]
            for c in range(7 - a - b):
                row[t + c] += f * z[c]
            t += 7 - a - b


@inner_kernel
def _guess(measure: Any, n: Any, place: Any, weight: Any, trial: Any) -> Any:
    # 27 points like the material: along x three places as Gauss's are to mean and spread; the
    # material divided between them, the same along y for each share, and along z for theirs. Then
    # each a little aside, evenly to all sides (multiples of powers of an irrational number).
    group = np.zeros(n, np.int64)
    total, mean, spread = np.empty(28), np.empty(28), np.empty(28)
    weight[0] = 1.0
    for axis in range(3):
        groups = 3**axis
        total[:], mean[:], spread[:] = 0.0, 0.0, 0.0
        for q in range(n):
            x, w = measure[q, axis], measure[q, 3]
            for g in (group[q], 27):  # 27: all of the material, for shares that have none
                total[g] += w
                mean[g] += w * x
                spread[g] += w * x * x
        for g in range(28):
            if total[g] > 0.0:
                mean[g] /= total[g]
                spread[g] = np.sqrt(max(spread[g] / total[g] - mean[g] ** 2, 0.0025))
        for q in range(n):
            g = group[q]
            away = (measure[q, axis] - mean[g]) / spread[g]
            # shares of 5, 8 and 5 of 18 where it is even
            group[q] = 3 * g + (0 if away < -0.7698 else 1 if away < 0.7698 else 2)
        for g in range(groups - 1, -1, -1):
            of = g if total[g] > 0.0 else 27
            for k in range(2, -1, -1):
                for before in range(axis):
                    place[3 * g + k, before] = place[g, before]
                x = mean[of] + (k - 1) * np.sqrt(1.8) * spread[of]
                place[3 * g + k, axis] = min(max(x, -0.97), 0.97)
                weight[3 * g + k] = weight[g] * (8.0 if k == 1 else 5.0) / 18.0
    for q in range(27):
        for axis in range(3):
            aside = 2.0 * ((27 * trial + q + 1) * 0.8191725134 ** (axis + 1) % 1.0) - 1.0
            place[q, axis] = min(max(place[q, axis] + _STRAY * aside, -0.97), 0.97)


_STEPS = 40
# Newton steps before it is given up: 11 are usual.

_TRIALS = 3
# Starts before the theorem is called for.

_MUCH_SMALLER = 0.7
# A box along a piece's axes is taken from this share of the cell-aligned box on: of a wall aslant
# it is a small part, and of a nearly full cell it would stick out.

_MET = 1e-12
# Largest error of a moment, of the mass; Newton's last step usually ends near 1e-15.


@inner_kernel
def _settle(moment: Any, place: Any, weight: Any, line: Any, normal: Any, slopes: Any) -> Any:
    """Move points in the box -1..1, and change their weights, until they have the moments."""
    many, moments = weight.size, moment.size
    miss, trial_miss, answer = np.empty(moments), np.empty(moments), np.empty(moments)
    trial, trial_weight = np.empty((many, 3)), np.empty(many)
    step = np.empty((many, 4))
    error = _miss(moment, place, weight, line, miss)
    for _ in range(_STEPS):
        worst = 0.0
        for t in range(moments):
            worst = max(worst, abs(miss[t]))
        if worst < _MET:
            return True
        # slopes of the moments by each weight and each place, in units of the weight and of the
        # room to the box's sides
        for q in range(many):
            for axis in range(3):
                _legendre(place[q, axis], line[axis], line[3 + axis])
            x, y, z, w = line[0], line[1], line[2], weight[q]
            for k in range(4):
                for t in range(moments):
                    slopes[4 * q + k, t] = 0.0
            _add_products(slopes[4 * q], w, x, y, z)
            _add_products(slopes[4 * q + 1], w * _room(place[q, 0]), line[3], y, z)
            _add_products(slopes[4 * q + 2], w * _room(place[q, 1]), x, line[4], z)
            _add_products(slopes[4 * q + 3], w * _room(place[q, 2]), x, y, line[5])
        _solve_normal(slopes, miss, normal, answer)
        most = 1.0
        for q in range(many):
            for k in range(4):
                move = 0.0
                for t in range(moments):
                    move += slopes[4 * q + k, t] * answer[t]
                if k == 0:
                    move *= weight[q]
                    room = weight[q] if move < 0.0 else np.inf
                else:
                    x = place[q, k - 1]
                    move *= _room(x)
                    room = 1.0 - x if move > 0.0 else 1.0 + x
                step[q, k] = move
                if 0.9 * room < most * abs(move):
                    most = 0.9 * room / abs(move)
        better = False
        for _ in range(6):
            for q in range(many):
                trial_weight[q] = weight[q] + most * step[q, 0]
                for axis in range(3):
                    trial[q, axis] = place[q, axis] + most * step[q, 1 + axis]
            trial_error = _miss(moment, trial, trial_weight, line, trial_miss)
            if trial_error < error * (1.0 - 1e-3 * most):
                better = True
                break
            most /= 2.0
        if not better:
            return False
        for t in range(moments):
            miss[t] = trial_miss[t]
        for q in range(many):
            weight[q] = trial_weight[q]
            for axis in range(3):
                place[q, axis] = trial[q, axis]
        error = trial_error
    return False


@inner_kernel
def _room(x: Any) -> Any:
    return np.sqrt((1.0 - x) * (1.0 + x))


@inner_kernel
def _miss(moment: Any, place: Any, weight: Any, line: Any, miss: Any) -> Any:
    # What the moments lack, and the length of that.
    for t in range(miss.size):
        miss[t] = moment[t]
    for q in range(weight.size):
        for axis in range(3):
            _legendre(place[q, axis], line[axis], line[3])
        _add_products(miss, -weight[q], line[0], line[1], line[2])
    square = 0.0
    for t in range(miss.size):
        square += miss[t] ** 2
    return np.sqrt(square)


@inner_kernel
def _solve_normal(slopes: Any, miss: Any, normal: Any, answer: Any) -> Any:
    # slopes' slopes answer = miss, by Cholesky's factors from the left; all inner loops run along
    # rows, so that they are done several numbers at a time.
    n = miss.size
    trace = 0.0
    for i in range(n):
        row = normal[i]
        for j in range(i, n):
            row[j] = 0.0
        for v in range(0, slopes.shape[0], 4):
            s0, s1, s2, s3 = slopes[v], slopes[v + 1], slopes[v + 2], slopes[v + 3]
            f0, f1, f2, f3 = s0[i], s1[i], s2[i], s3[i]
            for j in range(i, n):
                row[j] += (f0 * s0[j] + f1 * s1[j]) + (f2 * s2[j] + f3 * s3[j])
        trace += row[i]
    for i in range(n):
        normal[i, i] += 1e-12 * trace  # points that fall together leave it singular
        answer[i] = miss[i]
    for k in range(n):
        row = normal[k]
        scale = 1.0 / np.sqrt(row[k])
        for j in range(k, n):
            row[j] *= scale
        answer[k] /= row[k]
        for i in range(k + 1, n):
            answer[i] -= answer[k] * row[i]
            target, f = normal[i], row[i]
            for j in range(i, n):
                target[j] -= f * row[j]
    for k in range(n - 1, -1, -1):
        row = normal[k]
        for j in range(k + 1, n):
            answer[k] -= row[j] * answer[j]
        answer[k] /= row[k]


_DEPENDENT = 1e-13
# A moment that no group has more of than this, once what the moments before it explain is taken
# away, is theirs by rounding.


@inner_kernel
def _recombine(measure: Any, n: Any, table: Any, line: Any) -> Any:
    """Leave at most as many points (x, y, z, weight) as there are moments; return how many."""
    moments, most = table.shape
    factor = np.empty(most)
    column = np.empty(moments)
    member = np.empty(most, np.int64)
    mass = np.empty(most)
    left = np.empty(most)
    while True:
        groups = min(n, most)
        for g in range(groups):
            low, high = g * n // groups, (g + 1) * n // groups
            column[:] = 0.0
            mass[g] = 0.0
            for q in range(low, high):
                w = measure[q, 3]
                mass[g] += w
                for axis in range(3):
                    _legendre(measure[q, axis], line[axis], line[3])
                _add_products(column, w, line[0], line[1], line[2])
            for t in range(moments):
                table[t, g] = column[t] / mass[g]
            member[g], left[g] = g, mass[g]
        _eliminate(table, groups, member, left, factor)
        kept = 0
        for g in range(groups):
            if left[g] > 0.0:
                scale = left[g] / mass[g]
                for q in range(g * n // groups, (g + 1) * n // groups):
                    measure[kept, 0] = measure[q, 0]
                    measure[kept, 1] = measure[q, 1]
                    measure[kept, 2] = measure[q, 2]
                    measure[kept, 3] = measure[q, 3] * scale
                    kept += 1
        done = groups == n
        n = kept
        if done:
            return n


@inner_kernel
def _eliminate(table: Any, groups: Any, member: Any, left: Any, factor: Any) -> Any:
    """Move weight between groups, moments unchanged, until those with weight are independent.

    `table` (moments, groups) is destroyed; `left` holds the weights by group, `member` which
    group a column stands for.
    """
    moments = table.shape[0]
    active, rank = groups, 0
    # a basis: for each moment in turn the group that has most of it; its column is then a unit
    # vector and leaves the table
    for t in range(moments):
        best, at = _DEPENDENT, -1
        for g in range(active):
            if abs(table[t, g]) > best:
                best, at = abs(table[t, g]), g
        if at < 0:
            continue
        active -= 1
        for s in range(moments):
            table[s, at], table[s, active] = table[s, active], table[s, at]
        member[at], member[active] = member[active], member[at]
        pivot = table[t, active]
        # rows of the basis stand at the top; what they displace there is explained
        source, displaced = table[rank], table[t]
        for g in range(active):
            held = displaced[g] / pivot
            displaced[g] = source[g]
            source[g] = held
        for s in range(moments):
            if s < rank or s > t:
                f = table[s, active]
                if f != 0.0:
                    target = table[s]
                    for g in range(active):
                        target[g] -= f * source[g]
        factor[rank] = member[active]
        rank += 1
    # the groups that are left, one by one: all of its weight to the basis, or, where a member of
    # the basis would come below zero, as much as empties that one, which it then replaces
    for g in range(active - 1, -1, -1):
        j = member[g]
        down, up = np.inf, np.inf
        i_down, i_up = -1, -1
        for i in range(rank):
            d = table[i, g]
            w = left[int(factor[i])]
            if d < 0.0 and w < -d * down:
                down, i_down = -w / d, i
            elif d > 0.0 and w < d * up:
                up, i_up = w / d, i
        if down >= left[j]:
            for i in range(rank):
                b = int(factor[i])
                left[b] = max(left[b] + left[j] * table[i, g], 0.0)
            left[j] = 0.0
            continue
        step, leaves = down, i_down
        if i_up >= 0 and abs(table[i_up, g]) > abs(table[i_down, g]):
            step, leaves = -up, i_up
        for i in range(rank):
            b = int(factor[i])
            left[b] = max(left[b] + step * table[i, g], 0.0)
        left[j] -= step
        left[int(factor[leaves])] = 0.0
        factor[leaves] = j
        pivot = table[leaves, g]
        source = table[leaves]
        for h in range(g):
            source[h] /= pivot
        for i in range(rank):
            if i != leaves and table[i, g] != 0.0:
                f = table[i, g]
                target = table[i]
                for h in range(g):
                    target[h] -= f * source[h]
    return rank


# ------------------------------------------------------------------------------------------------
# The surface, fine enough to follow the cells.
#
# How often an edge is halved is told by its length alone, so that the triangles on both its sides
# agree and a closed surface stays closed. A triangle with three edges to halve makes four of its
# own shape. One with a short edge, as the long thin ones of CAD are, is cut across into a
# triangle and a strip, and the strip across again: to bisect its sides one by one would make 3^k
# triangles of it, where 2^k do.


class _Shapes(NamedTuple):
    """Triangles (n, 3), or strips (n, 4) whose second and fourth edge are long."""

    corners: NDArray[np.int32]
    halvings: IntArray  # of the edge from each corner to the next
    parent: IntArray  # the triangle that each is of

    def turned(self, chosen: BoolArray, first: IntArray) -> "_Shapes":
        """Return some, begun at another corner."""
        turn = (first[chosen, None] + np.arange(self.corners.shape[1])) % self.corners.shape[1]
        return _Shapes(
            np.take_along_axis(self.corners[chosen], turn, axis=1),
            np.take_along_axis(self.halvings[chosen], turn, axis=1),
            self.parent[chosen],
        )


def halve_long_edges(mesh: Mesh, longest_mm: float) -> tuple[Mesh, NDArray[np.int32]]:
    """Halve edges of a surface until none is longer than so much.

    A closed surface stays closed. Also returned: which triangle of the mesh each new one is of.
    """
    vertices, faces = mesh.vertices, mesh.faces
    triangle = np.arange(len(faces), dtype=np.int32)
    while True:
        corners = vertices[faces]
        length = np.sqrt(np.sum((np.roll(corners, -1, axis=1) - corners) ** 2, axis=2))
        if not (length > longest_mm).any():
            break
        with np.errstate(divide="ignore"):
            halvings = np.ceil(np.maximum(np.log2(length / longest_mm), 0.0)).astype(np.int64)
        halvings[length > longest_mm] = np.maximum(halvings[length > longest_mm], 1)
        vertices, faces, parent = _halve(vertices, _Shapes(faces, halvings, triangle))
        triangle = parent.astype(np.int32)
    if len(faces) == len(mesh.faces):
        return mesh, triangle
    return Mesh(vertices, faces), triangle


def _halve(vertices: FloatArray, whole: _Shapes) -> tuple[FloatArray, NDArray[np.int32], IntArray]:
    none = np.empty((0, 4), np.int32)
    triangles, strips = whole, _Shapes(none, none, none[:, 0])
    while triangles.halvings.any() or strips.halvings.any():
        tails, heads = (
            np.concatenate([np.roll(shapes.corners, -step, axis=1).ravel() for shapes in both])
            for both, step in (((triangles, strips), 0), ((triangles, strips), 1))
        )
        marked = np.concatenate([triangles.halvings.ravel(), strips.halvings.ravel()]) > 0
        ends = np.sort(np.stack([tails, heads], axis=1)[marked], axis=1)
        edges, at = np.unique(ends, axis=0, return_inverse=True)
        middle = np.full(len(marked), -1, np.int32)
        middle[marked] = len(vertices) + at.ravel()
        vertices = np.concatenate([vertices, vertices[edges].mean(axis=1)])
        split = triangles.corners.size
        triangles, strips = _cut(
            triangles, middle[:split].reshape(-1, 3), strips, middle[split:].reshape(-1, 4)
        )
    a, b, c, d = strips.corners.T
    one = np.sum((vertices[a] - vertices[c]) ** 2, axis=1)
    near = (one <= np.sum((vertices[b] - vertices[d]) ** 2, axis=1))[:, None]
    halves = (
        np.where(near, np.stack([a, b, c], axis=1), np.stack([a, b, d], axis=1)),
        np.where(near, np.stack([a, c, d], axis=1), np.stack([b, c, d], axis=1)),
    )
    faces = np.concatenate([triangles.corners, *halves]).astype(np.int32)
    parent = np.concatenate([triangles.parent, strips.parent, strips.parent])
    order = np.argsort(parent, kind="stable")
    return vertices, faces[order], parent[order]


def _cut(
    triangles: _Shapes,
    middle: NDArray[np.int32],
    strips: _Shapes,
    strip_middle: NDArray[np.int32],
) -> tuple[_Shapes, _Shapes]:
    # Cut each shape once, at the middles of its edges that are to be halved (-1 elsewhere).
    count = np.count_nonzero(middle >= 0, axis=1)
    made = [triangles.turned(count == 0, count)]
    made_strips: list[_Shapes] = []

    def add(of: _Shapes, corners: tuple[IntArray, ...], halvings: tuple[Any, ...]) -> None:
        into = made if len(corners) == 3 else made_strips
        left = [np.broadcast_to(k, of.parent.shape) for k in halvings]
        into.append(_Shapes(np.stack(corners, axis=1), np.stack(left, axis=1), of.parent))

    def begun(of: _Shapes, at: NDArray[np.int32], chosen: BoolArray, first: IntArray) -> Any:
        shapes, middles = of.turned(chosen, first), of._replace(corners=at).turned(chosen, first)
        return shapes, shapes.corners.T, shapes.halvings.T - 1, middles.corners.T

    some, (a, b, c), (k, m, n), (ab, bc, ca) = begun(triangles, middle, count == 3, 0 * count)
    add(some, (a, ab, ca), (k, m, n))
    add(some, (ab, b, bc), (k, m, n))
    add(some, (ca, bc, c), (k, m, n))
    add(some, (bc, ca, ab), (k, m, n))
    short = np.argmin(middle >= 0, axis=1)
    some, (a, b, c), (_, m, n), (_, bc, ca) = begun(triangles, middle, count == 2, short)
    add(some, (ca, bc, c), (0, m, n))
    add(some, (a, b, bc, ca), (0, m, 0, n))
    long = np.argmax(middle >= 0, axis=1)
    some, (a, b, c), (k, _, _), (ab, _, _) = begun(triangles, middle, count == 1, long)
    add(some, (a, ab, c), (k, 0, 0))
    add(some, (ab, b, c), (k, 0, 0))

    count = np.count_nonzero(strip_middle >= 0, axis=1)
    made_strips.append(strips.turned(count == 0, count))
    some, (a, b, c, d), (_, m, _, n), (_, bc, _, da) = begun(
        strips, strip_middle, count == 2, 0 * count
    )
    add(some, (a, b, bc, da), (0, m, 0, n))
    add(some, (da, bc, c, d), (0, m, 0, n))
    long = np.argmax(strip_middle >= 0, axis=1)
    some, (a, b, c, d), (k, _, _, _), (ab, _, _, _) = begun(strips, strip_middle, count == 1, long)
    add(some, (a, ab, d), (k, 0, 0))
    add(some, (ab, c, d), (0, 0, 0))
    add(some, (ab, b, c), (k, 0, 0))
    return _joined(made), _joined(made_strips)


def _joined(shapes: list[_Shapes]) -> _Shapes:
    return _Shapes(*(np.concatenate(parts) for parts in zip(*shapes, strict=True)))


# ------------------------------------------------------------------------------------------------
# Which cell a point of the surface is in.


def _inward(mesh: Mesh) -> FloatArray:
    # Unit vectors at vertices against the surface's outward normal, by area of the triangles.
    corners = mesh.triangles
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    total = np.zeros_like(mesh.vertices)
    for corner in range(3):
        for axis in range(3):
            total[:, axis] -= np.bincount(
                mesh.faces[:, corner], normal[:, axis], minlength=len(total)
            )
    length = np.sqrt(np.sum(total**2, axis=1, keepdims=True))
    return total / np.where(length > 0.0, length, 1.0)


@kernel
def _nearest(
    offsets: Any,
    start: Any,
    stop: Any,
    first: Any,
    foot: Any,
    nu: Any,
    voxels: Any,
    frame: Any,
    piece: Any,
    counts: Any,
    voxel_mm: Any,
    own: Any,
    target: Any,
    cell: Any,
) -> None:
    # The piece of the segment nearest to each target (x and y in mm, z in steps), in rings of
    # columns about it. One in the point's own cell is preferred when it is nearer than the
    # nearest of all and a diagonal of the lattice.
    nv = foot.size // nu
    pitch = frame[2]
    slack = np.sqrt(2.0) * pitch
    for n in range(cell.size):
        x, y, z = target[n, 0], target[n, 1], target[n, 2]
        u = (frame[3] * x + frame[4] * y - frame[0]) / pitch
        v = (frame[3] * y - frame[4] * x - frame[1]) / pitch
        i0 = min(max(int(np.floor(u + 0.5)), 0), nu - 1)
        j0 = min(max(int(np.floor(v + 0.5)), 0), nv - 1)
        mine = own[n, 0] * counts[1] + own[n, 1]
        low, high = own[n, 2] * voxels, (own[n, 2] + 1) * voxels
        best, best_own = np.inf, np.inf
        found, found_own = -1, -1
        for ring in range(max(nu, nv)):
            if (ring - 0.5) * pitch > best + slack:
                break
            for j in range(max(j0 - ring, 0), min(j0 + ring, nv - 1) + 1):
                step = 1 if abs(j - j0) == ring else max(2 * ring, 1)
                for i in range(i0 - ring, i0 + ring + 1, step):
                    if i < 0 or i >= nu or foot[j * nu + i] < 0:
                        continue
                    c = j * nu + i
                    across = pitch * pitch * ((i - u) ** 2 + (j - v) ** 2)
                    for r in range(offsets[c], offsets[c + 1]):
                        k0, k1 = start[r] // voxels, (stop[r] - 1) // voxels
                        if piece[first[r]] < 0:
                            continue
                        at = min(max(z, start[r]), stop[r])
                        away = np.sqrt(across + ((z - at) * voxel_mm) ** 2)
                        if away < best:
                            k = min(max(int(at // voxels), k0), k1)
                            best, found = away, piece[first[r] + k - k0]
                        if foot[c] == mine and start[r] < high and stop[r] > low:
                            at = min(max(z, start[r], low), stop[r], high)
                            away = np.sqrt(across + ((z - at) * voxel_mm) ** 2)
                            if away < best_own:
                                best_own, found_own = away, piece[first[r] + own[n, 2] - k0]
        cell[n] = found_own if best_own <= best + slack else found
