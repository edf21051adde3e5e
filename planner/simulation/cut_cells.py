"""Cells that a surface cuts from a Cartesian lattice, with positive quadrature in each."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.errors import ArgumentError, MeshError, positive
from planner.mesh.mesh import Mesh, number_groups, order_edges, unite
from planner.numerics import FloatArray, IntArray, free_kernel, inner_kernel, kernel
from planner.voxels.columns import MOST_VOXELS, Columns, Grid, iterate_columns, join

__all__ = ["COLUMNS_ACROSS", "MOMENTS", "CutCells", "cut_cells"]


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
    one quadratic field runs through each body.

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
        In the cell's own coordinates, -1..1.
    weights_mm3 : (Q,)
        All above 0; their sum is the volume.
    surface
        The part's surface, its long edges halved until none is longer than half a cell.
    triangle : (F,) int32
        The part's own triangle that each facet of `surface` is of.
    vertex_cell : (V,) int32
        The cell each vertex of `surface` bounds.
    vertex_local : (V, 3)
        Its place there, in the cell's own coordinates.
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
            In the cell's own coordinates, -1..1.
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
    pieces = _pieces(material)
    if not len(pieces.index):
        raise MeshError(
            f"no material is found in the part at `cell_mm` {cell_mm:g}: its walls are thinner "
            f"than {material.frame[2]:.2g} mm; choose a smaller cell, or check the part's unit"
        )
    if len(pieces.index) > most_cells:
        raise _too_many(cell_mm, len(pieces.index), most_cells)
    size = extent / counts
    offsets, points, weights = _quadrature(pieces, size, threads)
    surface, triangle = _halve_long_edges(mesh, float(np.min(size)) / 2)
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
    return Material(columns, cells, voxels, frame, foot, first[:-1], piece)


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
    share: FloatArray  # of the cell that is filled: 1.0 exactly where all of it is
    columns: NDArray[np.int64]  # that stand in the cell's footprint
    dropped: float  # volume left out, in cells


def _pieces(material: Material) -> _Pieces:
    nx, ny, nz = material.counts
    parent = material.piece.copy()
    no_nodes = np.empty((0, 27), np.int32)
    _join_segments(*material.lines, ny, parent, no_nodes, no_nodes[:, 0], no_nodes)
    piece = number_groups(parent)
    n = int(piece.max(initial=-1)) + 1
    filled, place = np.zeros(n, np.int64), np.zeros(n, np.int64)
    _fill(*material.lines, nz, piece, filled, place)
    columns = np.bincount(material.foot[material.foot >= 0], minlength=nx * ny)[place // nz]
    share = filled / (columns * material.voxels)
    # nodes: each piece has its own, then those of connected faces become one
    own = np.arange(27 * n, dtype=np.int32)
    body = np.arange(n, dtype=np.int32)
    _join_segments(
        *material.lines, ny, piece, own.reshape(n, 27), body, np.full((n, 10), -1, np.int32)
    )
    body = number_groups(body)
    kept = np.bincount(body, share)[body] >= _NEARLY_NOTHING
    order = np.flatnonzero(kept)
    order = order[np.argsort(place[order], kind="stable")]
    number = np.full(n, -1, np.int32)
    number[order] = np.arange(len(order))
    index = np.stack(np.unravel_index(place[order], material.counts), axis=1).astype(np.int32)
    nodes, node_place = _number_nodes(number_groups(own).reshape(n, 27)[order], index)
    bodies = np.unique(body[order], return_inverse=True)[1].astype(np.int32)
    told = Material(
        material.columns, material.counts, material.voxels, material.frame, material.foot,
        material.first, number[piece],
    )  # fmt: skip
    dropped = float(np.sum(share[~kept]))
    return _Pieces(told, index, nodes, node_place, bodies, share[order], columns[order], dropped)


@kernel
def _join_segments(
    offsets: Any,
    start: Any,
    stop: Any,
    first: Any,
    foot: Any,
    nu: Any,
    voxels: Any,
    cells_y: Any,
    piece: Any,
    nodes: Any,
    body: Any,
    last: Any,
) -> None:
    # Without `nodes`: join segments of neighbouring columns that touch within a cell (`piece` is
    # their union-find). With them: join nodes and bodies of pieces that touch across cells; `last`
    # is the piece that each one was joined to last on each side, which spares most of the work.
    across = nodes.size > 0
    flat = nodes.ravel()
    for c in range(foot.size):
        if foot[c] < 0:
            continue
        if across:
            for r in range(offsets[c], offsets[c + 1]):
                for s in range(first[r], first[r] + (stop[r] - 1) // voxels - start[r] // voxels):
                    if last[piece[s], 9] != piece[s + 1]:
                        last[piece[s], 9] = piece[s + 1]
                        _join_nodes(flat, piece[s], piece[s + 1], 0, 0, 1)
                        unite(body, piece[s], piece[s + 1])
        for side in range(2):
            d = c + (nu if side else 1)
            if d >= foot.size or (side == 0 and d % nu == 0) or foot[d] < 0:
                continue
            if (foot[d] != foot[c]) != across:
                continue
            dx = foot[d] // cells_y - foot[c] // cells_y
            dy = foot[d] % cells_y - foot[c] % cells_y
            way = 3 * dx + dy + 4
            r, s = offsets[c], offsets[d]
            while r < offsets[c + 1] and s < offsets[d + 1]:
                low, high = max(start[r], start[s]), min(stop[r], stop[s])
                if low < high:
                    for k in range(low // voxels, (high - 1) // voxels + 1):
                        one = first[r] + k - start[r] // voxels
                        other = first[s] + k - start[s] // voxels
                        if not across:
                            unite(piece, one, other)
                        elif last[piece[one], way] != piece[other]:
                            last[piece[one], way] = piece[other]
                            _join_nodes(flat, piece[one], piece[other], dx, dy, 0)
                            unite(body, piece[one], piece[other])
                if stop[r] < stop[s]:
                    r += 1
                else:
                    s += 1


@inner_kernel
def _join_nodes(parent: Any, p: Any, q: Any, dx: Any, dy: Any, dz: Any) -> Any:
    # Join the nodes that piece p and piece q, so many cells on, have in common.
    for a in range(27):
        i, j, k = a % 3 - 2 * dx, a // 3 % 3 - 2 * dy, a // 9 - 2 * dz
        if 0 <= i <= 2 and 0 <= j <= 2 and 0 <= k <= 2:
            unite(parent, 27 * p + a, 27 * q + i + 3 * j + 9 * k)


@kernel
def _fill(
    offsets: Any,
    start: Any,
    stop: Any,
    first: Any,
    foot: Any,
    nu: Any,
    voxels: Any,
    cells_z: Any,
    piece: Any,
    filled: Any,
    place: Any,
) -> None:
    # How much of its cell each piece fills, and which cell that is.
    for c in range(foot.size):
        if foot[c] >= 0:
            for r in range(offsets[c], offsets[c + 1]):
                for k in range(start[r] // voxels, (stop[r] - 1) // voxels + 1):
                    p = piece[first[r] + k - start[r] // voxels]
                    low, high = max(start[r], k * voxels), min(stop[r], (k + 1) * voxels)
                    filled[p] += high - low
                    place[p] = foot[c] * cells_z + k


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
# The material of a cut piece is a discrete measure: 4 Gauss points along each segment. By
# Tchakaloff's theorem at most as many of them as there are moments carry these exactly, with
# positive weights. They are found by halving: points in twice as many groups as there are
# moments; the groups' own moments are linearly dependent, and weight is moved along that
# dependence until one group has none, again and again. Each round drops half of the groups.


_CHUNK = 32  # pieces that a thread takes at once


def _quadrature(
    pieces: _Pieces, size: FloatArray, threads: int
) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
    material, n = pieces.material, len(pieces.index)
    full = pieces.share == 1.0
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
    _gather(*material.lines, where, begin[:-1].copy(), segments)

    points, weights = np.zeros((many, MOMENTS, 3)), np.zeros((many, MOMENTS))
    used = np.zeros(many, np.int64)
    columns, index = pieces.columns[~full], pieces.index[~full]
    line, line_weight = np.polynomial.legendre.leggauss(4)
    rule = np.stack([line, line_weight])

    def work(first: int) -> None:
        chunk = slice(first, min(first + _CHUNK, many))
        most = int(np.max(np.diff(begin[first : chunk.stop + 1])))
        _compress(
            segments, begin, first, chunk.stop, material.frame, material.columns.grid.shape[0],
            material.voxels, columns, index, rule, np.empty((4 * most, 4)),
            np.empty((MOMENTS, 2 * MOMENTS)), points, weights, used,
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
                        segments[s, 1] = max(start[r] - k * voxels, 0)
                        segments[s, 2] = min(stop[r] - k * voxels, voxels)
                        cursor[p] += 1


@free_kernel
def _compress(
    segments: Any,
    begin: Any,
    first: Any,
    stop: Any,
    frame: Any,
    nu: Any,
    voxels: Any,
    columns: Any,
    index: Any,
    rule: Any,
    measure: Any,
    table: Any,
    points: Any,
    weights: Any,
    used: Any,
) -> None:
    for p in range(first, stop):
        n = 0
        for s in range(begin[p], begin[p + 1]):
            x, y = _column_place(frame, nu, segments[s, 0])
            half = (segments[s, 2] - segments[s, 1]) / voxels  # of the cell's local -1..1
            middle = (segments[s, 2] + segments[s, 1]) / voxels - 1.0
            for g in range(rule.shape[1]):
                measure[n, 0] = 2.0 * (x - index[p, 0]) - 1.0
                measure[n, 1] = 2.0 * (y - index[p, 1]) - 1.0
                measure[n, 2] = middle + half * rule[0, g]
                measure[n, 3] = half * rule[1, g] / (2.0 * columns[p])
                n += 1
        n = _recombine(measure, n, table)
        used[p] = n
        for q in range(n):
            for axis in range(3):
                points[p, q, axis] = measure[q, axis]
            weights[p, q] = measure[q, 3]


_DEPENDENT = 1e-13
# A moment that no group has more of than this, once what the moments before it explain is taken
# away, is theirs by rounding.


@inner_kernel
def _recombine(measure: Any, n: Any, table: Any) -> Any:
    """Leave at most as many points (x, y, z, weight) as there are moments; return how many."""
    moments, most = table.shape
    factor = np.empty(most)
    column = np.empty(moments)
    member = np.empty(most, np.int64)
    mass = np.empty(most)
    left = np.empty(most)
    legendre = np.empty((3, 7))
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
                    x = measure[q, axis]
                    legendre[axis, 0], legendre[axis, 1] = 1.0, x
                    for d in range(2, 7):
                        legendre[axis, d] = (
                            (2 * d - 1) * x * legendre[axis, d - 1]
                            - (d - 1) * legendre[axis, d - 2]
                        ) / d
                t = 0
                for degree in range(7):
                    for a in range(degree + 1):
                        wx = w * legendre[0, a]
                        for b in range(degree - a + 1):
                            column[t] += wx * legendre[1, b] * legendre[2, degree - a - b]
                            t += 1
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


def _halve_long_edges(mesh: Mesh, longest_mm: float) -> tuple[Mesh, NDArray[np.int32]]:
    # Split triangles at the middles of long edges, until there are none; the same edge is split
    # at the same place for both its triangles, so that a closed surface stays closed.
    vertices, faces = mesh.vertices, mesh.faces
    triangle = np.arange(len(faces), dtype=np.int32)
    while True:
        tail, head = vertices[faces], vertices[faces[:, [1, 2, 0]]]
        long = np.sqrt(np.sum((head - tail) ** 2, axis=2)) > longest_mm
        if not long.any():
            break
        order, starts, _ = order_edges(faces)
        edge = np.empty(faces.size, np.int64)
        edge[order] = np.repeat(np.arange(len(starts)), np.diff(starts, append=len(order)))
        cut, at = np.unique(edge.reshape(-1, 3)[long], return_inverse=True)
        middle = np.full(faces.shape, -1, np.int32)
        middle[long] = len(vertices) + at
        half = order[starts[cut]]
        ends = faces.ravel()[half], faces[:, [1, 2, 0]].ravel()[half]
        vertices = np.concatenate([vertices, (vertices[ends[0]] + vertices[ends[1]]) / 2])
        faces, parent = _split(vertices, faces, middle)
        triangle = triangle[parent]
    if len(faces) == len(mesh.faces):
        return mesh, triangle
    return Mesh(vertices, faces), triangle


def _split(
    vertices: FloatArray, faces: NDArray[np.int32], middle: NDArray[np.int32]
) -> tuple[NDArray[np.int32], IntArray]:
    marked = middle >= 0
    count = np.count_nonzero(marked, axis=1)
    # turn each triangle so that the one marked, or the one not marked of two others, comes first
    first = np.where(count == 1, np.argmax(marked, axis=1), np.argmin(marked, axis=1))
    turn = (first[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(faces, turn, axis=1).T
    ab, bc, ca = np.take_along_axis(middle, turn, axis=1).T
    # two marked: a triangle at c, and a quadrangle, cut by its shorter diagonal
    one = np.sum((vertices[a] - vertices[bc]) ** 2, axis=1)
    other = np.sum((vertices[b] - vertices[ca]) ** 2, axis=1)
    near = one <= other
    made = [
        (count == 0, (a, b, c)),
        (count == 1, (a, ab, c)),
        (count == 1, (ab, b, c)),
        (count == 2, (bc, c, ca)),
        ((count == 2) & near, (a, b, bc)),
        ((count == 2) & near, (a, bc, ca)),
        ((count == 2) & ~near, (a, b, ca)),
        ((count == 2) & ~near, (b, bc, ca)),
        (count == 3, (a, ab, ca)),
        (count == 3, (ab, b, bc)),
        (count == 3, (bc, c, ca)),
        (count == 3, (ab, bc, ca)),
    ]
    parent = np.concatenate([np.flatnonzero(chosen) for chosen, _ in made])
    new = np.concatenate([np.stack(corners, axis=1)[chosen] for chosen, corners in made])
    order = np.argsort(parent, kind="stable")
    return new[order].astype(np.int32), parent[order]


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
