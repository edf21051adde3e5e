"""Several bodies in one part: which lie inside which, which way out, and overlaps united."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.arrays import BoolArray, FloatArray
from planner.errors import MeshError
from planner.geometry.mesh import measure
from planner.geometry.repair import turn
from planner.geometry.topology import Topology
from planner.geometry.weld import repeats_index, weld

__all__ = ["Arranged", "arrange_bodies"]

_FLAT = 1e-9  # of area times extent: far below any printable thickness, far above rounding
_OVERLAP = 1e-7  # of the bodies' volume: less than this is touching


@dataclass(frozen=True, eq=False)
class Arranged:
    """Bodies the right way out, that do not overlap; faces is empty when none has volume."""

    vertices: FloatArray
    faces: NDArray[np.int32]
    notes: tuple[str, ...]


def arrange_bodies(vertices: FloatArray, topology: Topology, *, touching: bool = False) -> Arranged:
    """Turn bodies the right way out and unite those that overlap.

    An outermost body turned inside out is turned over with all that lies inside it. Inside a
    solid, an inward body is a cavity and an outward one an overlap; inside a cavity every body
    is solid. Overlapping solids are united.

    Parameters
    ----------
    vertices, topology
        A closed mesh.
    touching
        Bodies share edges by position: unite them even where they only touch.

    Raises
    ------
    MeshError
        Bodies overlap and cannot be united.
    """
    volume, area, bounds, _ = measure(vertices, topology.faces, topology.body, topology.bodies)
    extent = (bounds[:, 1] - bounds[:, 0]).max(axis=1)
    full = np.abs(volume) > _FLAT * area * extent
    notes = []
    if not full.all() and full.any():
        notes.append(f"{int((~full).sum())} of {len(full)} bodies without volume dropped")
    pairs = _box_pairs(bounds, full, touching)
    parent = _parents(vertices, topology, volume, bounds, pairs)
    outward = _outward(volume, parent)
    turned = full & (outward != (volume > 0.0))
    body = topology.body
    faces = turn(topology.faces, turned[body]) if turned.any() else topology.faces
    if turned.any():
        notes.append(_turned_note(turned, full))
    keep = full[body]
    if pairs and outward[full].sum() > 1:
        solid = np.where(outward | (parent < 0), np.arange(len(full)), parent)
        met = np.zeros(len(full), dtype=np.bool_)
        for i, j in pairs:
            if solid[i] != solid[j]:
                met[[solid[i], solid[j]]] = True
        groups = [
            faces[keep & (solid[body] == number)] for number in np.flatnonzero(met & outward & full)
        ]
        united = _unite(vertices, groups, touching) if len(groups) > 1 else None
        if united is not None:
            rest = vertices[faces[keep & ~met[solid[body]]]]
            soup: FloatArray = np.concatenate([rest, united.triangles])
            points, welded = weld(soup)
            welded = welded[~repeats_index(welded)]
            if not touching and not Topology(welded).closed:  # what was united touches the rest
                return arrange_bodies(vertices, topology, touching=True)
            return Arranged(points, welded, (*notes, united.note))
    return Arranged(vertices, faces if keep.all() else faces[keep], tuple(notes))


def _turned_note(turned: BoolArray, full: BoolArray) -> str:
    if turned[full].all():
        return "the part was inside out: turned"
    return f"{int(turned.sum())} of {int(full.sum())} bodies were inside out: turned"


def _box_pairs(bounds: FloatArray, full: BoolArray, touching: bool) -> list[tuple[int, int]]:
    """Return the pairs of bodies whose bounding boxes overlap, by a sweep along x."""
    if touching:  # boxes that only touch count as well
        bounds = np.stack([bounds[:, 0], np.nextafter(bounds[:, 1], np.inf)], axis=1)
    order = np.flatnonzero(full)
    order = order[np.argsort(bounds[order, 0, 0], kind="stable")]
    low, high = bounds[order, 0], bounds[order, 1]
    pairs = []
    for i, stop in enumerate(np.searchsorted(low[:, 0], high[:, 0]).tolist()):
        later = slice(i + 1, max(stop, i + 1))
        overlap = ((low[later] < high[i]) & (high[later] > low[i])).all(axis=1)
        pairs += [(int(order[i]), int(order[i + 1 + k])) for k in np.flatnonzero(overlap)]
    return pairs


def _parents(
    vertices: FloatArray,
    topology: Topology,
    volume: FloatArray,
    bounds: FloatArray,
    pairs: list[tuple[int, int]],
) -> NDArray[np.int64]:
    """Return the smallest body around each body, -1 for the outermost."""
    parent = np.full(len(volume), -1)
    size = np.abs(volume)
    for pair in pairs:
        outer, inner = pair if size[pair[0]] > size[pair[1]] else pair[::-1]
        inside = (bounds[outer, 0] <= bounds[inner, 0]) & (bounds[outer, 1] >= bounds[inner, 1])
        nearer = parent[inner] < 0 or size[outer] < size[parent[inner]]
        if not (inside.all() and nearer):
            continue
        probes = np.unique(topology.faces[topology.body == inner])
        probes = probes[np.linspace(0, len(probes) - 1, min(5, len(probes))).astype(np.int64)]
        wall = vertices[topology.faces[topology.body == outer]]
        if np.median([abs(_winding_number(vertices[p], wall)) for p in probes]) > 0.5:
            parent[inner] = outer
    return parent


def _winding_number(point: FloatArray, triangles: FloatArray) -> float:
    """How often a closed surface encloses a point: its solid angle (Van Oosterom 1983) / 4 pi."""
    a, b, c = (triangles - point).transpose(1, 0, 2)
    la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
    above = np.einsum("ij,ij->i", a, np.cross(b, c))
    below = la * lb * lc + lc * np.einsum("ij,ij->i", a, b)
    below += lb * np.einsum("ij,ij->i", a, c) + la * np.einsum("ij,ij->i", b, c)
    return float(np.arctan2(above, below).sum() / (2.0 * np.pi))


def _outward(volume: FloatArray, parent: NDArray[np.int64]) -> BoolArray:
    """Decide from the outermost inwards which bodies are solid and which are cavities."""
    outward = volume > 0.0
    over = np.zeros(len(volume), dtype=np.bool_)  # turned over with the outermost body
    for body in np.argsort(-np.abs(volume), kind="stable"):
        around = parent[body]
        if around < 0:
            over[body] = volume[body] < 0.0
            outward[body] = True
        else:
            over[body] = over[around]
            outward[body] = (outward[body] != over[body]) or not outward[around]
    return outward


@dataclass(frozen=True, eq=False)
class _United:
    triangles: FloatArray
    note: str


def _unite(vertices: FloatArray, groups: list[NDArray[np.int32]], touching: bool) -> _United | None:
    """Unite solids; None where they do not overlap after all."""
    import manifold3d

    solids = [_manifold(vertices, faces) for faces in groups]
    whole = manifold3d.Manifold.batch_boolean(solids, manifold3d.OpType.Add)
    if whole.status() != manifold3d.Error.NoError or whole.is_empty():
        raise MeshError("its bodies overlap and cannot be united; unite them in the CAD program")
    alone = sum(solid.volume() for solid in solids)
    shared = alone - whole.volume()
    if shared <= _OVERLAP * alone and not touching:
        return None
    mesh = whole.to_mesh64()
    points = np.asarray(mesh.vert_properties, dtype=np.float64)[:, :3]
    verb = "overlapped" if shared > _OVERLAP * alone else "touched"
    size = f" ({shared:.4g} mm3 counted twice)" if shared > _OVERLAP * alone else ""
    return _United(
        points[np.asarray(mesh.tri_verts, dtype=np.int64)],
        f"{len(groups)} bodies {verb}{size}: united",
    )


def _manifold(vertices: FloatArray, faces: NDArray[np.int32]) -> Any:
    import manifold3d

    used, index = np.unique(faces, return_inverse=True)
    mesh = manifold3d.Mesh64(
        np.ascontiguousarray(vertices[used]), index.reshape(-1, 3).astype(np.uint64)
    )
    solid = manifold3d.Manifold(mesh)
    if solid.status() != manifold3d.Error.NoError:
        raise MeshError(
            "its bodies may overlap, and one of them cannot be united with the others "
            f"({solid.status().name}); unite them in the CAD program"
        )
    return solid
