"""Repairs of a welded mesh that have one possible outcome, tried until the mesh is closed."""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.arrays import BoolArray, FloatArray
from planner.geometry.contacts import part_at_crowded_edges
from planner.geometry.topology import CROWDED, OPEN, Topology, consistent_winding
from planner.geometry.weld import cancel_opposite, repeats_index

__all__ = ["TOLERANCE", "Repaired", "close_mesh"]

TOLERANCE = 1e-5
"""How far a repair may move a vertex, as a share of the part's largest extent."""

_MOST_BORDERS = 5000


@dataclass(frozen=True, eq=False)
class Repaired:
    """A mesh and what was done to it.

    Attributes
    ----------
    notes
        One sentence a repair.
    touching
        Bodies met at shared edges and were given vertices of their own: unite them.
    """

    vertices: FloatArray
    topology: Topology
    notes: tuple[str, ...] = ()
    touching: bool = False


def close_mesh(vertices: FloatArray, faces: NDArray[np.int32]) -> Repaired | None:
    """Make a mesh closed and consistently wound, if plain repairs do.

    Each repair is kept only where it changes something; none is kept unless the mesh is closed
    in the end: pairs of opposite faces, bodies that share the vertices of an edge at which they
    touch, faces that occur twice, border vertices within `TOLERANCE` of each other or of
    another border edge, and faces turned over.

    Parameters
    ----------
    vertices, faces
        Welded mesh without repeated indices.

    Returns
    -------
    Repaired or None
        None where the mesh stays open or crowded at edges.
    """
    state = Repaired(vertices, Topology(faces))
    # Where faces balance at each edge, bodies touch or coincide and no face may go.
    steps = (_opposites, _touching, _duplicates, _near_vertices, _junctions, _winding, _touching)
    for repair in steps:
        if state.topology.closed:
            break
        state = repair(state) or state
    return state if state.topology.closed else None


def _next(state: Repaired, faces: NDArray[np.int32], note: str) -> Repaired:
    return Repaired(state.vertices, Topology(faces), (*state.notes, note))


def _counted(count: int, one: str, many: str) -> str:
    return f"{count} {one if count == 1 else many}"


def _duplicates(state: Repaired) -> Repaired | None:
    """Drop faces on the same vertices, the same way round, as an earlier one."""
    faces = state.topology.faces
    if len(state.topology.edges(CROWDED)) == 0:
        return None
    shift = np.argmin(faces, axis=1)[:, np.newaxis]
    turned = np.take_along_axis(faces, (shift + np.arange(3)) % 3, axis=1)
    order = np.lexsort(turned.T)
    again = np.zeros(len(faces), dtype=np.bool_)
    again[order[1:]] = (turned[order[1:]] == turned[order[:-1]]).all(axis=1)
    count = int(again.sum())
    if count == 0:
        return None
    note = _counted(count, "triangle that occurs", "triangles that occur") + " twice dropped"
    return _next(state, faces[~again], note)


def _opposites(state: Repaired) -> Repaired | None:
    """Drop pairs of opposite faces: walls without thickness, or between bodies face to face."""
    faces = state.topology.faces
    keep = cancel_opposite(faces)
    count = int((~keep).sum()) // 2
    if count == 0 or not keep.any():
        return None
    pairs = _counted(count, "pair of opposite triangles", "pairs of opposite triangles")
    return _next(state, faces[keep], f"{pairs} dropped: a wall without thickness")


def _near_vertices(state: Repaired) -> Repaired | None:
    """Join border vertices within the tolerance."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    border = np.unique(state.topology.edges(OPEN))
    if not 0 < len(border) <= _MOST_BORDERS:
        return None
    points = state.vertices[border]
    tolerance = _tolerance_mm(state.vertices)
    pairs = cKDTree(points).query_pairs(tolerance, output_type="ndarray")
    if len(pairs) == 0:
        return None
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=2 * (len(border),))
    _, group = connected_components(graph, directed=False)
    _, first = np.unique(group, return_index=True)
    target = first[group]
    moved = np.linalg.norm(points - points[target], axis=1)
    if moved.max() > 2.0 * tolerance:  # a chain of near vertices is no point
        return None
    index = np.arange(len(state.vertices), dtype=np.int32)
    index[border] = border[target]
    faces = index[state.topology.faces]
    count = int((target != np.arange(len(border))).sum())
    vertices = _counted(count, "border vertex", "border vertices")
    note = f"{vertices} joined to others at most {moved.max():.2g} mm away"
    return _next(state, faces[~repeats_index(faces)], note)


def _junctions(state: Repaired) -> Repaired | None:
    """Divide border faces at vertices that lie on their edges."""
    count = 0
    for _ in range(3):  # a face has three edges, one is divided at a time
        faces, divided = _divide(state)
        if divided == 0:
            break
        count += divided
        state = Repaired(state.vertices, Topology(faces), state.notes)
    if count == 0:
        return None
    junctions = _counted(count, "edge that ends", "edges that end")
    note = f"{junctions} on the middle of another joined to it"
    return _next(state, state.topology.faces, note)


def _divide(state: Repaired) -> tuple[NDArray[np.int32], int]:
    faces = state.topology.faces
    half = np.flatnonzero(state.topology.twin == OPEN)
    if not 0 < len(half) <= _MOST_BORDERS:
        return faces, 0
    tolerance = _tolerance_mm(state.vertices)
    border = np.unique(state.topology.edges(OPEN))
    points = state.vertices[border]
    gone = np.zeros(len(faces), dtype=np.bool_)
    added: list[tuple[int, int, int]] = []
    for e in half:
        f, j = divmod(int(e), 3)
        a, b, c = (int(faces[f, (j + k) % 3]) for k in range(3))
        start, along = state.vertices[a], state.vertices[b] - state.vertices[a]
        length = float(np.linalg.norm(along))
        if gone[f] or length <= 2.0 * tolerance:
            continue
        offset = points - start
        place = offset @ along / length
        distance = np.linalg.norm(offset - place[:, np.newaxis] * (along / length), axis=1)
        on = (distance <= tolerance) & (place > tolerance) & (place < length - tolerance)
        on &= border != c
        if not on.any():
            continue
        between = border[on][np.argsort(place[on], kind="stable")]
        chain = [a, *between.tolist(), b]
        added += [(p, q, c) for p, q in itertools.pairwise(chain)]
        gone[f] = True
    more = np.array(added, dtype=np.int32).reshape(-1, 3)
    return np.concatenate([faces[~gone], more]), int(gone.sum())


def _winding(state: Repaired) -> Repaired | None:
    """Turn faces over until neighbours agree."""
    topology = state.topology
    if not topology.two_faced:
        return None
    turned = consistent_winding(topology)
    if turned is None:
        return None
    triangles = _counted(int(turned.sum()), "triangle was", "triangles were")
    return _next(state, turn(topology.faces, turned), f"{triangles} turned over: now all agree")


def turn(faces: NDArray[np.int32], which: BoolArray) -> NDArray[np.int32]:
    """Reverse some faces, (m,) bool."""
    return np.where(which[:, np.newaxis], faces[:, ::-1], faces)


def _touching(state: Repaired) -> Repaired | None:
    """Give bodies that meet at crowded edges vertices of their own."""
    crowded = len(state.topology.edges(CROWDED))
    if not 0 < crowded <= _MOST_BORDERS or len(state.topology.edges(OPEN)):
        return None
    apart = part_at_crowded_edges(state.vertices, state.topology)
    if apart is None:
        return None
    topology = Topology(apart[1])
    if not topology.closed:
        return None
    return Repaired(apart[0], topology, state.notes, touching=True)


def _tolerance_mm(vertices: FloatArray) -> float:
    return TOLERANCE * float(np.ptp(vertices, axis=0).max())
