"""A shape that is wanted of a part's surface: how far places of the surface are off it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from planner.errors import ArgumentError
from planner.mesh.distance import TriangleTree, closest, triangle_tree
from planner.mesh.mesh import Mesh, weld
from planner.numerics import BoolArray, FloatArray
from planner.simulation.element import shape_functions

if TYPE_CHECKING:
    from planner.simulation.cut_cells import CutCells

__all__ = ["ShapeGoal", "WantedShape"]


_SAME = 1e-4
"""Of the part's size: corners of triangles that are one vertex, in files of single precision."""


@dataclass(frozen=True, eq=False)
class WantedShape:
    """Where a part's surface is to be.

    Attributes
    ----------
    rest, moved : (k, 3, 3), optional
        The part's triangles and where each is wanted, if the shape is a moved copy of them.
    surface
        The shape, to which the nearest place counts otherwise.
    greatest_mm
        The longest way that a place of the surface has to it.
    note
        How places were matched.
    """

    text: str
    selector: str
    weight: float
    surface: Mesh
    greatest_mm: float
    note: str
    rest: Mesh | None = None
    moved: FloatArray | None = None

    @classmethod
    def of(
        cls, text: str, selector: str, weight: float, moved: FloatArray, part: FloatArray
    ) -> "WantedShape":
        """Return a shape by the triangles of its surface.

        Parameters
        ----------
        moved, part : (k, 3, 3)
            Of the shape, and of the part as in its file.

        Raises
        ------
        ArgumentError
            The shape is the part as it is, or so far away that it is that of another part.
        """
        size = float(np.ptp(part.reshape(-1, 3), axis=0).max())
        surface, rest = _mesh(moved), None
        if len(moved) == len(part) and _matched(part, moved, size):
            corners = np.arange(3 * len(part), dtype=np.int32).reshape(-1, 3)
            rest = Mesh(part.reshape(-1, 3), corners)
            greatest = float(np.linalg.norm(moved - part, axis=2).max())
            note = f"{text}: its triangles are those of the part, which go up to {greatest:.4g} mm"
        else:
            own = _mesh(part)
            nearest, _ = closest(triangle_tree(surface), own.vertices)
            way = np.linalg.norm(nearest - own.vertices, axis=1)
            greatest = float(way.max())
            note = (
                f"{text}: its {len(moved)} triangles are not the part's {len(part)}, so that each "
                f"place is to come to the nearest of the shape, up to {greatest:.4g} mm away, "
                f"{way.mean():.3g} mm on the mean; a copy with the part's own triangles tells more"
            )
        if not 1e-5 * size < greatest < 3.0 * size:
            raise ArgumentError(
                f"`target` {text}: the shape is {greatest:.3g} mm from the part, which is "
                f"{size:.4g} mm long; give the part's surface as it is to be under the load, in "
                "the same place"
            )
        own_moved = None if rest is None else moved
        return cls(text, selector, weight, surface, greatest, note, rest, own_moved)


def _mesh(triangles: FloatArray) -> Mesh:
    vertices, faces = weld(triangles.astype(np.float32))
    return Mesh(vertices.astype(np.float64), faces)


def _matched(part: FloatArray, moved: FloatArray, size: float) -> bool:
    """Tell whether triangles are one surface, moved: what meets in the one meets in the other."""
    steps = np.rint(part.reshape(-1, 3) / (_SAME * size))
    _, vertex = np.unique(steps, axis=0, return_inverse=True)
    corners, count = moved.reshape(-1, 3), np.bincount(vertex.ravel())
    mean = [np.bincount(vertex.ravel(), column) / count for column in corners.T]
    apart = corners - np.stack(mean, axis=1)[vertex.ravel()]
    return bool(np.abs(apart).max() < 10.0 * _SAME * size)


class Deviation(NamedTuple):
    """How far places of a surface are off, over the longest way, and what changes that.

    Attributes
    ----------
    rms, largest : float
        Over the longest way; the mean is over the area.
    off : (m,)
        Whose sum of squares is that of the mean, times the weight.
    rows : callable
        From the places' displacements by each unknown, (V, 3, n), to the changes of `off`, (m, n).
    off_mm : (V,)
        Of each place; 0 where the shape does not count.
    """

    rms: float
    largest: float
    off: FloatArray
    rows: Callable[[FloatArray], FloatArray]
    off_mm: FloatArray


@dataclass(frozen=True, eq=False)
class ShapeGoal:
    """A wanted shape, for the surface of a part in cells.

    Attributes
    ----------
    share : (V,)
        Of the area that counts, at each vertex.
    target_mm : (V, 3), optional
        Where each is wanted.
    """

    wanted: WantedShape
    place_mm: FloatArray
    carried: Any
    share: FloatArray
    target_mm: FloatArray | None
    tree: TriangleTree
    normal: FloatArray

    @classmethod
    def on(cls, wanted: WantedShape, cells: "CutCells", facets: BoolArray | None) -> "ShapeGoal":
        """Pose a shape on the surface of cells; facets of it that count, or all."""
        from scipy.sparse import csr_matrix

        surface = cells.surface
        shape = shape_functions(cells.vertex_local, cells.cell_mm)[0]
        ends = 27 * np.arange(len(shape) + 1)
        nodes = cells.nodes[cells.vertex_cell].ravel()
        carried = csr_matrix((shape.ravel(), nodes, ends), (len(shape), len(cells.node_mm)))
        area = np.linalg.norm(surface.area_vectors_mm2, axis=1)
        area = area if facets is None else area * facets
        share = np.bincount(surface.faces.ravel(), np.repeat(area, 3), len(surface.vertices))
        target = None
        if wanted.rest is not None and wanted.moved is not None:
            place, which = closest(triangle_tree(wanted.rest), surface.vertices)
            target = carried_along(wanted.rest.triangles[which], wanted.moved[which], place)
        normal = wanted.surface.area_vectors_mm2
        normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
        return cls(
            wanted, surface.vertices, carried, share / share.sum(), target,
            triangle_tree(wanted.surface), normal,
        )  # fmt: skip

    def deviation(self, displacement_mm: FloatArray) -> Deviation:
        """Return how far the surface is off under the nodes' displacements, (N, 3)."""
        place = self.place_mm + self.carried @ displacement_mm
        greatest = self.wanted.greatest_mm
        scale = np.sqrt(self.share * self.wanted.weight) / greatest
        if self.target_mm is not None:
            apart = place - self.target_mm
            off_mm = np.linalg.norm(apart, axis=1)
            off = (scale[:, None] * apart).ravel()

            def rows(moved: FloatArray) -> FloatArray:
                return (scale[:, None, None] * moved).reshape(-1, moved.shape[2])
        else:
            nearest, which = closest(self.tree, place)
            apart = place - nearest
            off_mm = np.linalg.norm(apart, axis=1)
            far = off_mm > 1e-9 * greatest
            along: FloatArray = self.normal[which]
            along[far] = apart[far] / off_mm[far, None]
            off = scale * off_mm

            def rows(moved: FloatArray) -> FloatArray:
                return np.asarray(scale[:, None] * np.einsum("vi,vin->vn", along, moved))

        counts = self.share > 0.0
        rms = float(np.sqrt(self.share @ off_mm**2)) / greatest
        return Deviation(rms, float(off_mm[counts].max()) / greatest, off, rows, off_mm * counts)


def carried_along(rest: FloatArray, moved: FloatArray, place: FloatArray) -> FloatArray:
    """Return where places of triangles, (n, 3), go as these are moved, (n, 3, 3)."""
    one, other, to = rest[:, 1] - rest[:, 0], rest[:, 2] - rest[:, 0], place - rest[:, 0]
    aa, ab, bb = (np.sum(p * q, axis=1) for p, q in ((one, one), (one, other), (other, other)))
    a, b = np.sum(one * to, axis=1), np.sum(other * to, axis=1)
    det = np.maximum(aa * bb - ab * ab, 1e-300)
    v, w = (bb * a - ab * b) / det, (aa * b - ab * a) / det
    return np.asarray(np.einsum("nc,nci->ni", np.stack([1.0 - v - w, v, w], axis=1), moved))
