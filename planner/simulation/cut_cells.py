"""Cells that a surface cuts from a Cartesian lattice, with positive quadrature in each."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from planner.errors import ArgumentError, MeshError, positive
from planner.glance import sized
from planner.mesh.halve import halve_long_edges
from planner.mesh.mesh import Mesh, connected, order_rows, repeats_index, sorted_corners
from planner.numerics import BoolArray, FloatArray, IntArray
from planner.simulation.cell_quadrature import quadrature
from planner.simulation.element import LOCAL, shape_functions
from planner.simulation.inner_corners import contacts, opposed, parted
from planner.simulation.material_columns import SampledMaterial, sample
from planner.voxels.columns import MOST_VOXELS

__all__ = ["FEWEST_ALONG", "MOST_CELLS", "CutCells", "Shells", "carrier", "cut_cells"]


_COLUMNS_ACROSS = 24
"""Columns of material sampled along an edge of a cell."""

_MOST_COLUMNS = 1 << 26
# Lattice columns over the bounding box: 12 bytes each, 0.8 GB.

FEWEST_ALONG = 2
"""Cells along the longest side of a part: with one there is nothing to bend."""

MOST_CELLS = 100_000
"""Of a part. A solution takes about 90 GB there."""

_NEARLY_NOTHING = 0.01
# of a cell's volume. A body of less, which hangs on nothing, is what columns make of the edge of
# a blade, and far below what a cell resolves; the material dropped is told.

# ------------------------------------------------------------------------------------------------
# Materials that touch, and where they do.


class Shells(NamedTuple):
    """Closed surfaces, each of one material, that share the triangles between them.

    Attributes
    ----------
    mesh
        All of them on one set of vertices: triangles where two touch stand there twice, reversed.
    shell : (F,) int32
        Which shell each face bounds, from 0.
    modulus_MPa : (shells,)
        Of their materials: those nearest to each other are joined where too many share a cell.
    """

    mesh: Mesh
    shell: NDArray[np.int32]
    modulus_MPa: FloatArray

    @property
    def each(self) -> list[Mesh]:
        """The shells one by one."""
        vertices, faces = self.mesh.vertices, self.mesh.faces
        return [Mesh(vertices, faces[self.shell == k]) for k in range(len(self.modulus_MPa))]


class _Interface(NamedTuple):
    """Where cells of different materials meet.

    Attributes
    ----------
    cells : (m, 2) int32
        Pairs of cells.
    starts : (m + 1,)
        Pair k has the points ``starts[k]`` to ``starts[k + 1]``.
    local : (k, 2, 3)
        Places in both cells, in their own coordinates.
    area_mm2 : (k,)
    """

    cells: NDArray[np.int32]
    starts: IntArray
    local: FloatArray
    area_mm2: FloatArray


# ------------------------------------------------------------------------------------------------
# The cells of a part.


_APART = 10.0
# Between cells of the lattice, whose own coordinates go to 1.2: none is nearest to another's.


@dataclass(frozen=True, eq=False)
class CutCells:
    """Cartesian cells that a closed surface cuts, with positive quadrature over the material.

    Each connected piece of one material in a cell of the lattice is a cell here: where two walls
    stand in one, it is there twice, with nodes of its own for each wall. Pieces of neighbouring
    cells share the nodes of their common face exactly when material connects them through it, so
    that one quadratic field runs through each body of a material. A skin that lies on a face,
    thinner than the columns hold together (0.06 of a cell), belongs to the piece on the face's
    other side.

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
    shares : (n, shells)
        Of each cell's volume, that are of each shell: 1 of one, save where more than four materials
        share a cell of the lattice. There those of nearest moduli that touch are joined.
    interface
        Where cells of different shells meet.
    offsets : (n + 1,) int64
        Cell c has the quadrature points ``offsets[c]`` to ``offsets[c + 1]``.
    points : (Q, 3)
        In the cell's own coordinates: -1..1, and up to 1.16 where a skin belongs to it.
    weights_mm3 : (Q,)
        All above 0; their sum is the volume.
    surface
        The part's surface, its long edges halved until none is longer than half a cell.
    vertex_cell : (V,) int32
        The cell each vertex of `surface` bounds.
    vertex_local : (V, 3)
        Its place there, in the cell's own coordinates: -1..1, a little more on skins.
    dropped_mm3
        Volume of specks that hang on nothing and are left out.
    material
        The columns, from which `SampledMaterial.locate` finds cells.
    """

    origin_mm: FloatArray
    cell_mm: FloatArray
    index: NDArray[np.int32]
    nodes: NDArray[np.int32]
    node_mm: FloatArray
    shares: FloatArray
    interface: _Interface
    offsets: NDArray[np.int64]
    points: FloatArray
    weights_mm3: FloatArray
    surface: Mesh
    dropped_mm3: float
    material: SampledMaterial = field(repr=False)
    vertex_cell: NDArray[np.int32]
    vertex_local: FloatArray

    @cached_property
    def cell_of(self) -> IntArray:
        """Cell of each quadrature point, (Q,)."""
        return np.repeat(np.arange(len(self.index)), np.diff(self.offsets))

    @property
    def points_mm(self) -> FloatArray:
        """Places of the quadrature points, (Q, 3)."""
        place = self.index[self.cell_of] + 0.5 * (self.points + 1.0)
        return np.asarray(self.origin_mm + place * self.cell_mm)

    @cached_property
    def cell_volume_mm3(self) -> FloatArray:
        """Volume of the material in each cell, (n,)."""
        return np.asarray(np.add.reduceat(self.weights_mm3, self.offsets[:-1]))

    @property
    def volume_mm3(self) -> float:
        """Volume of the material."""
        return float(np.sum(self.weights_mm3))

    def nearest(self, places_mm: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return the cells of the material nearest to places, (n,), and their shapes there."""
        cell = self.cell_of[self.tree.query(places_mm)[1]]
        corner = self.origin_mm + self.index[cell] * self.cell_mm
        local = np.clip(2.0 * (places_mm - corner) / self.cell_mm - 1.0, -1.5, 1.5)
        return cell, shape_functions(local, self.cell_mm)[0]

    @cached_property
    def tree(self) -> Any:
        """To find the nearest of `points_mm`."""
        from scipy.spatial import KDTree

        return KDTree(self.points_mm)

    def interpolated(self, places_mm: FloatArray, nodal: FloatArray) -> FloatArray:
        """Return at places, (n, 3), what is given at the nodes, (N, k), in the nearest material."""
        cell, shape = self.nearest(places_mm)
        return np.asarray(np.einsum("na,nak->nk", shape, nodal[self.nodes[cell]]))

    def nearest_points(self, places_mm: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
        """Return the nearest quadrature point of places in the part, its cell, and the place in it.

        Of all pieces of material that share a place of the lattice, the one with that point.
        """
        from scipy.spatial import cKDTree

        tree = cKDTree(self.points + _APART * self.index[self.cell_of])
        scaled = (places_mm - self.origin_mm) / self.cell_mm
        index = np.clip(np.floor(scaled), self.index.min(axis=0), self.index.max(axis=0))
        _, point = tree.query(2.0 * (scaled - index) - 1.0 + _APART * index)
        cell = self.cell_of[point]
        local = 2.0 * (scaled - self.index[cell]) - 1.0
        return np.asarray(point), cell, np.clip(local, -1.0, 1.0)


def carrier(cells: CutCells, cell: IntArray, shape: FloatArray) -> Any:
    """Return what takes values at nodes to places, by their cells and shapes: sparse (n, N)."""
    from scipy.sparse import csr_matrix

    nodes, ends = cells.nodes[cell].ravel(), 27 * np.arange(len(shape) + 1)
    return csr_matrix((shape.ravel(), nodes, ends), (len(shape), len(cells.node_mm)))


def cut_cells(
    mesh: Mesh,
    cell_mm: float,
    *,
    shells: Shells | None = None,
    shift: float = 0.0,
    like: CutCells | None = None,
) -> CutCells:
    """Cut a closed surface into cells.

    Parameters
    ----------
    mesh
        Closed, outward surface.
    cell_mm
        Wanted edge of a cell; the bounding box is divided evenly into cells no longer than that.
    shells
        What fills the surface, if it is of several materials.
    shift
        Share of a cell, 0 to 1, by which the lattice begins before the bounding box, which then
        has one cell more along each axis.
    like
        Cells of that size of nearly the same surface, to save work.

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
    if np.max(extent) < FEWEST_ALONG * cell_mm:
        raise ArgumentError(
            f"`cell_mm` {cell_mm:g}: the part is {sized(extent)} mm; at least {FEWEST_ALONG} cells "
            f"along its longest side are needed: {np.max(extent) / FEWEST_ALONG:.3g} or less"
        )
    if not np.min(extent) > 0:
        raise MeshError(f"the part is {sized(extent)} mm, which holds no material; give a solid")
    counts = np.maximum(np.ceil(extent / cell_mm - 1e-6), 1.0)
    columns = np.sum(extent[:2]) * np.hypot(*extent[:2]) * (_COLUMNS_ACROSS / cell_mm) ** 2
    fewest = max(mesh.volume_mm3, 0.0) / cell_mm**3
    if max(counts) * _COLUMNS_ACROSS * 1.5 > MOST_VOXELS or columns > _MOST_COLUMNS:
        raise ArgumentError(
            f"`cell_mm` {cell_mm:g}: {sized(counts)} cells across the part are more than can be "
            "sampled; choose a larger cell"
        )
    if fewest > MOST_CELLS:
        raise _too_many(cell_mm, fewest)
    size = extent / counts
    if shift:
        low, counts = low - shift * size, counts + 1.0
        extent = counts * size
    cells = tuple(int(n) for n in counts)
    each = [mesh] if shells is None else shells.each
    surface, _ = halve_long_edges(mesh, float(np.min(size)) / 2)
    told, halves = parted(sample(each, low, extent, cells, _COLUMNS_ACROSS), surface, low, size)
    return _filled(told, halves, low, size, shells, surface, cell_mm, like)


def _too_many(cell_mm: float, cells: float) -> ArgumentError:
    larger_mm = cell_mm * (cells / MOST_CELLS) ** (1 / 3)
    return ArgumentError(
        f"`cell_mm` {cell_mm:g}: the part has at least {cells:.0f} cells, and {MOST_CELLS} are "
        f"possible; choose a larger cell, about {larger_mm:.2g} or more"
    )


# ------------------------------------------------------------------------------------------------
# Pieces, and the nodes they share.


def _filled(
    material: SampledMaterial, halves: FloatArray, low: FloatArray, size: FloatArray,
    shells: Shells | None, surface: Mesh, cell_mm: float, like: CutCells | None,
) -> CutCells:  # fmt: skip
    """Return cells of the connected pieces of material, `halves` those that planes have parted."""
    piece, n = material.piece, len(halves)
    cell, shell = material.pieces()
    filled, ends = material.measured()
    place = np.stack(np.unravel_index(cell, material.counts), axis=1)
    share = filled / (material.per_foot[cell // material.counts[2]] * material.voxels)
    thin = (material.frame[3] + material.frame[4]) * material.frame[2] / size
    touching = material.touching(material.shell, piece)
    within = np.equal(*material.cell[touching].T)
    pairs, is_firm = _touch_across(material, touching[~within], thin)
    apart = opposed(pairs, halves, (place[pairs].mean(axis=1) + 0.5) * size, size)
    pairs, is_firm = pairs[~apart], is_firm[~apart]
    firm = _without_skins(pairs, is_firm, place, np.ptp(ends, axis=1))
    flat = np.stack([ends[:, 1] <= place + thin, ends[:, 0] >= place + 1 - thin], axis=2)
    into = _merge_skins(pairs, place, flat, share)
    met = []
    if shells is not None:
        told = replace(material, piece=into[piece])
        meet, *where = _meeting(told, low, size, place, shells)
        joined = _join_nearest(meet, cell, shell, np.log(shells.modulus_MPa))
        into, met = joined[into], [(joined[meet], *where)]
    met.append(contacts(replace(material, piece=into[piece]), touching[within], place, size))
    meet, local, area = (np.concatenate(each) for each in zip(*met, strict=True))
    body = connected(n, *np.concatenate([pairs, meet]).T)
    kept = (into == np.arange(n)) & (np.bincount(body, share)[body] >= _NEARLY_NOTHING)
    order = np.flatnonzero(kept)
    order = order[np.argsort(cell[order], kind="stable")]
    if not len(order):
        raise MeshError(
            f"no material is found in the part at `cell_mm` {cell_mm:g}: its walls are thinner "
            f"than {material.frame[2]:.2g} mm; choose a smaller cell, or check the part's unit"
        )
    if len(order) > MOST_CELLS:
        raise _too_many(cell_mm, len(order))
    number = np.full(n, -1, np.int32)
    number[order] = np.arange(len(order))
    index = place[order].astype(np.int32)
    nodes, node_place = _number_nodes(_joined_nodes(into[firm], place)[order], index)
    whole = (share == 1.0) & (np.bincount(into, minlength=n) == 1)
    told = replace(material, piece=number[into[piece]])
    offsets, points, weights = quadrature(told, index, whole[order], like)
    shares = np.zeros((len(order) + 1, int(shell.max()) + 1))
    np.add.at(shares, (number[into], shell), share)
    shares = shares[:-1] / shares[:-1].sum(axis=1, keepdims=True)
    cell_mm3 = float(np.prod(size))
    vertex_cell, vertex_local, _ = told.locate(low, size, index, surface.vertices, _inward(surface))
    return CutCells(
        low, size, index, nodes, low + node_place * (size / 2), shares,
        _interface(number[meet], local, area), offsets, points, weights * cell_mm3, surface,
        float(np.sum(share[number[into] < 0])) * cell_mm3, told, vertex_cell, vertex_local,
    )  # fmt: skip


_MOST_MATERIALS = 4
"""In a cell of the lattice. Chosen: each has nodes of its own."""


def _join_nearest(
    meet: NDArray[np.int32], cell: IntArray, shell: NDArray[np.int32], log_modulus: FloatArray
) -> NDArray[np.int32]:
    """Tell which piece each is joined with: of a group of like moduli, where they touch."""
    rank = np.argsort(np.argsort(log_modulus))
    key, at = np.unique(cell * len(rank) + rank[shell], return_inverse=True)
    of, modulus = key // len(rank), np.sort(log_modulus)[key % len(rank)]
    gap = np.where(np.diff(of, prepend=-1) > 0, np.inf, np.diff(modulus, prepend=0.0))
    widest = np.lexsort((-gap, of))
    nth = (np.arange(len(key)) - np.searchsorted(of, of))[np.argsort(widest)]
    group = np.cumsum(nth < _MOST_MATERIALS)[at]
    pairs = meet[group[meet[:, 0]] == group[meet[:, 1]]]
    parent = connected(len(cell), *pairs.T)
    return np.unique(parent, return_index=True)[1].astype(np.int32)[parent]


_ASTRAY = 3.0
# Spacings of columns: a shell that is farther from a point where it is said to touch is there so
# thin that no column meets it.


_ACROSS = 0.25
"""Of a cell: triangles no longer than that have one point each, where both sides are coupled."""


def _meeting(
    material: SampledMaterial, low: FloatArray, size: FloatArray, place: IntArray, shells: Shells
) -> tuple[NDArray[np.int32], FloatArray, FloatArray]:
    """Return pieces on both sides of points where shells touch, (k, 2), places there, and areas."""
    faces, shell = shells.mesh.faces, shells.shell
    order, starts = order_rows(*sorted_corners(faces))
    pairs = starts[np.diff(starts, append=len(order)) == 2]
    one, other = order[pairs], order[pairs + 1]
    apart = (shell[one] != shell[other]) & ~repeats_index(faces[one])
    one, other = one[apart], other[apart]
    touching = Mesh(shells.mesh.vertices, faces[one])
    fine, of = halve_long_edges(touching, _ACROSS * float(np.min(size)))
    area = np.linalg.norm(fine.area_vectors_mm2, axis=1)
    wide = area > 0.0
    area, of, middle = area[wide], of[wide], fine.triangles.mean(axis=1)[wide]
    out = fine.area_vectors_mm2[wide] / area[:, None]
    (at_one, local_one, off_one), (at_other, local_other, off_other) = (
        material.locate(low, size, place, middle, way, shell[side][of])
        for side, way in ((one, -out), (other, out))
    )
    near = np.maximum(off_one, off_other) <= _ASTRAY * material.frame[2]
    pairs, local = np.stack([at_one, at_other], axis=1), np.stack([local_one, local_other], axis=1)
    return pairs[near], local[near], area[near]


def _interface(pairs: NDArray[np.int32], local: FloatArray, area_mm2: FloatArray) -> _Interface:
    """Put points of each pair of cells together; a cell of -1 is none."""
    turn = np.argsort(pairs, axis=1)
    pairs = np.take_along_axis(pairs, turn, axis=1)
    local = np.take_along_axis(local, turn[:, :, None], axis=1)
    order = np.lexsort(pairs.T[::-1])
    order = order[(pairs[order, 0] >= 0) & (pairs[order, 0] < pairs[order, 1])]
    cells, starts = np.unique(pairs[order], axis=0, return_index=True)
    return _Interface(cells, np.append(starts, len(order)), local[order], area_mm2[order])


def _touch_across(
    material: SampledMaterial, touching: NDArray[np.int32], margin: FloatArray
) -> tuple[NDArray[np.int32], BoolArray]:
    """Find pairs of pieces that touch across a face, and which do away from its edges.

    Parameters
    ----------
    touching : (k, 2)
        Segments of one shell that touch, in different cells.
    margin : (3,)
        How far from the edges, in cells.
    """
    column, low, high = material.segments[touching].transpose(2, 1, 0)
    firm = np.ones(len(touching), np.bool_)
    feet = np.divmod(material.foot[column], material.counts[1])
    for along, foot, off in zip(material.xy(touching[:, 0]), feet, margin[:2], strict=True):
        away = along - np.floor(along)
        firm &= (foot[0] != foot[1]) | ((off <= away) & (away <= 1.0 - off))
    flat = int(margin[2] * material.voxels)
    bottom = low[0] // material.voxels * material.voxels
    away = (high.min(axis=0) > bottom + flat) & (low.max(axis=0) < bottom + material.voxels - flat)
    firm &= away | (column[0] == column[1])
    one, other = material.piece[touching].T
    ends = np.minimum(one, other), np.maximum(one, other)
    order, starts = order_rows(*ends)
    return np.stack(ends, axis=1)[order[starts]], np.logical_or.reduceat(firm[order], starts)


def _without_skins(
    pairs: NDArray[np.int32], is_firm: BoolArray, place: IntArray, span: FloatArray
) -> NDArray[np.int32]:
    """Leave out pairs that touch only in a skin along an edge, and beyond that edge firmly.

    Where the ground of a gap lies just above a face of the lattice, two walls on it touch across
    the next face in a skin: with nodes in common, the gap could not open as far as the cells are
    high. What the skin lies on joins them. Slivers, which are less than half a cell along the face,
    have nodes in common: they hold each other.
    """
    from scipy.sparse import coo_array

    n, firm, loose = len(place), pairs[is_firm], pairs[~is_firm]
    ends = np.concatenate([firm, firm[:, ::-1]])
    beside = coo_array((np.ones(len(ends), np.float32), tuple(ends.T)), (n, n)).tocsr()
    one, other = loose.T
    around = (beside[one] @ beside).multiply(beside[other]).sum(axis=1) > 0
    walls = (np.minimum(span[one], span[other]) >= 0.5) | (place[one] != place[other])
    return np.concatenate([firm, loose[~(around & walls.all(axis=1))]])


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


def _joined_nodes(pairs: NDArray[np.int32], place: IntArray) -> NDArray[np.int32]:
    """Return groups of the pieces' own nodes, (n, 27): one where cells of a pair have it both."""
    one, other = np.unique(pairs, axis=0).T
    step = place[other] - place[one]
    there = LOCAL - 2 * step[:, None]
    shared = ((there >= 0) & (there <= 2)).all(axis=2) & step.any(axis=1)[:, None]
    pair, node = np.nonzero(shared)
    beyond = 27 * other[pair] + there[shared] @ [1, 3, 9]
    return connected(27 * len(place), 27 * one[pair] + node, beyond).reshape(-1, 27)


def _number_nodes(
    group: NDArray[np.int32], index: NDArray[np.int32]
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    # Number nodes by their place, x slowest; those at one place by the first cell that has them.
    place = (2 * index[:, None] + LOCAL).reshape(-1, 3)
    _, at, node = np.unique(group, return_index=True, return_inverse=True)
    x, y, z = place[at].T
    order = np.lexsort((at, z, y, x))
    number = np.argsort(order).astype(np.int32)
    return number[node.reshape(group.shape)], place[at[order]].astype(np.int32)


# ------------------------------------------------------------------------------------------------
# Which cell a point of the surface is in.


def _inward(mesh: Mesh) -> FloatArray:
    """Return unit vectors at vertices against the surface's outward normal, by triangles' area."""
    against = np.repeat(-mesh.area_vectors_mm2, 3, axis=0)
    corner, count = mesh.faces.ravel(), len(mesh.vertices)
    total = np.stack([np.bincount(corner, along, count) for along in against.T], axis=1)
    return np.asarray(total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-300))
