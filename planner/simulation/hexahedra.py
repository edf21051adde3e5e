"""A part as equal hexahedra of 20 nodes: the cells of a lattice that are at least half full."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.errors import ArgumentError, positive
from planner.mesh.mesh import Mesh
from planner.numerics import BoolArray, FloatArray, IntArray
from planner.voxels.columns import MOST_VOXELS, Grid, dense, iterate_columns

__all__ = ["FACE_NODES", "Hexahedra", "fitting_cell_mm", "hexahedra"]


_ACROSS = 7
"""Columns along a cell's edge that tell how full it is. Numerical: odd, so that a wall along the
lattice fills half a cell exactly where the middle column says so; with 6 a finger gained 2 %."""

_MOST_CELLS = 300_000
"""Chosen: 1.3 million nodes and a file of 150 MB, beyond what solvers of a workstation take."""

_NEAR, _TRIALS = 1.15, 9
"""Chosen: cells of a seventh more or less are as good to the user."""

_SPECK = 0.01
"""Cells that no face joins to the rest are left out where they are less than this share of all.
Chosen: what a surface grazes comes to single cells, and a body of a part is more."""

# Corners of a cell counterclockwise, below before above; then the middles of edges: below, above,
# upright. It is the order of C3D20 in Abaqus and CalculiX, and of VTK's quadratic hexahedron.
_LOCAL = np.array(
    [
        (0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2),
        (1, 0, 0), (2, 1, 0), (1, 2, 0), (0, 1, 0), (1, 0, 2), (2, 1, 2), (1, 2, 2), (0, 1, 2),
        (0, 0, 1), (2, 0, 1), (2, 2, 1), (0, 2, 1),
    ]
)  # fmt: skip

# Faces by their numbers there, 1 to 6: -z, +z, -y, +x, +y, -x.
_NORMALS = np.array([(0, 0, -1), (0, 0, 1), (0, -1, 0), (1, 0, 0), (0, 1, 0), (-1, 0, 0)])
FACE_NODES = np.array(
    [np.flatnonzero(((_LOCAL - 1) @ normal) == 1) for normal in _NORMALS], dtype=np.int64
)
"""Local nodes of each face, (6, 8), four corners before four middles."""


@dataclass(frozen=True, eq=False)
class Hexahedra:
    """Cells of a lattice over a part's bounding box.

    Attributes
    ----------
    cell_mm : (3,)
        Edges: the bounding box divided evenly.
    middle_mm : (n, 3)
    nodes : (n, 20)
    node_mm : (N, 3)
    outer : (m, 2)
        Cell and face, 0 to 5, of each face that only one cell has.
    outer_mm, outer_normal : (m, 3)
        Their middles, and which way is out.
    pieces
        Bodies that no face joins.
    dropped_mm3
        Of specks left out.
    """

    cell_mm: FloatArray
    middle_mm: FloatArray
    nodes: NDArray[np.int64]
    node_mm: FloatArray
    outer: NDArray[np.int64]
    outer_mm: FloatArray
    outer_normal: FloatArray
    pieces: int
    dropped_mm3: float

    @property
    def cell_mm3(self) -> float:
        """Volume of one."""
        return float(np.prod(self.cell_mm))

    @property
    def volume_mm3(self) -> float:
        """Volume of all."""
        return len(self.nodes) * self.cell_mm3


def fitting_cell_mm(surface: Mesh, about_mm: float) -> float:
    """Return the edge near a wanted one whose cells come nearest to the part's volume.

    Walls gain or lose up to half a cell on either side; between one edge and another that is a
    seventh longer the volume of a finger's cells swings by several percent.
    """
    wanted = surface.volume_mm3
    off = {}
    for edge_mm in about_mm * np.geomspace(1.0 / _NEAR, _NEAR, _TRIALS):
        low, edges, shape = _lattice(surface, float(edge_mm))
        full = _fill(surface, low, edges, shape) >= 0.5
        off[float(edge_mm)] = abs(full.sum() * np.prod(edges) - wanted)
    return min(off, key=lambda edge_mm: off[edge_mm])


def hexahedra(surface: Mesh, cell_mm: float) -> Hexahedra:
    """Fill a closed surface with cells of about an edge.

    Raises
    ------
    ArgumentError
        There are too many, or none is half full.
    """
    low, edges, (nx, ny, nz) = _lattice(surface, positive(cell_mm, "`cell_mm`"))
    full = _fill(surface, low, edges, (nx, ny, nz)) >= 0.5
    kept, pieces = _joined(full)
    index = np.argwhere(kept)
    if not len(index):
        raise ArgumentError(
            f"`cell_mm` {cell_mm:g}: no cell is half full, the part's walls are thinner; take "
            "smaller ones"
        )
    places = 2 * index[:, None] + _LOCAL
    width = np.array([2 * nx + 1, 2 * ny + 1, 2 * nz + 1])
    key = (places[..., 2] * width[1] + places[..., 1]) * width[0] + places[..., 0]
    used, nodes = np.unique(key, return_inverse=True)
    at = np.stack([used % width[0], used // width[0] % width[1], used // (width[0] * width[1])], 1)
    outer = _outer(kept, index)
    normal = _NORMALS[outer[:, 1]].astype(np.float64)
    middle = low + (index + 0.5) * edges
    return Hexahedra(
        cell_mm=edges,
        middle_mm=middle,
        nodes=nodes.reshape(-1, 20).astype(np.int64),
        node_mm=low + 0.5 * at * edges,
        outer=outer,
        outer_mm=middle[outer[:, 0]] + 0.5 * normal * edges,
        outer_normal=normal,
        pieces=pieces,
        dropped_mm3=float((full.sum() - len(index)) * np.prod(edges)),
    )


def _lattice(surface: Mesh, cell_mm: float) -> tuple[FloatArray, FloatArray, tuple[int, int, int]]:
    """Return the lower corner, edges, and cells along x, y, z."""
    low, high = surface.bounds_mm
    nx, ny, nz = (max(int(n), 1) for n in np.ceil((high - low) / cell_mm - 1e-6))
    most = surface.volume_mm3 / cell_mm**3
    if most > _MOST_CELLS or max(nx, ny, nz) * _ACROSS > MOST_VOXELS:
        raise ArgumentError(
            f"`cell_mm` {cell_mm:g}: the part would come to {most:.3g} cells; up to {_MOST_CELLS} "
            "are possible: take larger ones"
        )
    return low, (high - low) / (nx, ny, nz), (nx, ny, nz)


def _fill(
    surface: Mesh, low: FloatArray, edges: FloatArray, shape: tuple[int, int, int]
) -> FloatArray:
    """Return how full each cell is, 0 to 1."""
    nx, ny, nz = shape
    ox, oy, oz = low.tolist()
    px, py, pz = (edges / _ACROSS).tolist()
    grid = Grid((ox, oy, oz), (px, py, pz), (nx * _ACROSS, ny * _ACROSS, nz * _ACROSS))
    share = np.empty(shape)
    for slab in iterate_columns(surface, grid, slab_rows=_ACROSS):
        inside = dense(slab).reshape(nx, _ACROSS, _ACROSS, nz, _ACROSS)
        share[:, slab.first_row // _ACROSS] = inside.mean(axis=(1, 2, 4))
    return share


def _joined(full: BoolArray) -> tuple[BoolArray, int]:
    """Return the cells without specks, and how many bodies they make."""
    from scipy.ndimage import label

    number, _ = label(full)
    size = np.bincount(number.ravel())
    size[0] = 0
    large = size >= _SPECK * max(int(size.sum()), 1)
    large[0] = False
    return large[number], int(large.sum())


def _outer(kept: BoolArray, index: IntArray) -> NDArray[np.int64]:
    padded = np.pad(kept, 1)
    found = []
    for face, normal in enumerate(_NORMALS):
        beside = padded[tuple((index + 1 + normal).T)]
        cells = np.flatnonzero(~beside)
        found.append(np.stack([cells, np.full(len(cells), face)], axis=1))
    together = np.concatenate(found)
    return together[np.lexsort(together.T[::-1])]
