"""Take apart solids that meet at an edge: faces pair up around it so that each bounds solid."""

import numpy as np
from numpy.typing import NDArray

from planner.arrays import FloatArray
from planner.geometry.topology import CROWDED, Topology

__all__ = ["part_at_crowded_edges"]

_DIGITS = 9  # of an angle in radians: faces nearer than that lie on each other
_HALF_TURN = round(np.pi, _DIGITS)


def part_at_crowded_edges(
    vertices: FloatArray, topology: Topology
) -> tuple[FloatArray, NDArray[np.int32]] | None:
    """Give each of the surfaces that meet at crowded edges vertices of its own.

    Around an edge of more than two faces, those between which there is solid belong together.

    Parameters
    ----------
    vertices, topology
        A mesh without open edges.

    Returns
    -------
    vertices, faces
        Positions as before, those on contacts repeated; None where the faces at an edge do not
        pair up.
    """
    faces = topology.faces
    twin = topology.twin.astype(np.int64)
    crowded: dict[tuple[int, int], list[int]] = {}
    for half in np.flatnonzero(twin == CROWDED).tolist():
        a, b = _ends(faces, half)
        crowded.setdefault((min(a, b), max(a, b)), []).append(half)
    for edge, halves in crowded.items():
        pairs = _pairs(vertices, faces, edge, halves)
        if pairs is None:
            return None
        for one, other in pairs:
            twin[one], twin[other] = other, one
    corner = _corner_groups(twin)
    groups, index = np.unique(corner, return_inverse=True)
    original = np.zeros(len(groups), dtype=np.int64)
    original[index] = faces.ravel()
    return vertices[original], index.reshape(-1, 3).astype(np.int32)


def _ends(faces: NDArray[np.int32], half: int) -> tuple[int, int]:
    face, corner = divmod(half, 3)
    return int(faces[face, corner]), int(faces[face, (corner + 1) % 3])


def _pairs(
    vertices: FloatArray, faces: NDArray[np.int32], edge: tuple[int, int], halves: list[int]
) -> list[tuple[int, int]] | None:
    """Pair the half-edges at an edge across the solid between their faces.

    With angles that grow from the first to the second axis across the edge, a face that runs
    along the edge has its solid before it, one that runs against it behind it: as brackets
    close and open.
    """
    along = vertices[edge[1]] - vertices[edge[0]]
    along = along / np.linalg.norm(along)
    first = np.cross(along, np.eye(3)[int(np.argmin(np.abs(along)))])
    second = np.cross(along, first)
    around = []
    for half in halves:
        face, corner = divmod(half, 3)
        arm = vertices[faces[face, (corner + 2) % 3]] - vertices[edge[0]]
        angle = round(float(np.arctan2(arm @ second, arm @ first)), _DIGITS)
        angle = abs(angle) if angle == -_HALF_TURN else angle
        opens = _ends(faces, half) != edge
        around.append((angle, opens, half))  # of equal angles the closing one first
    around.sort()
    balance = np.cumsum([1 if opens else -1 for _, opens, _ in around])
    if balance[-1] != 0:
        return None
    start = int(np.argmin(balance)) + 1
    pairs: list[tuple[int, int]] = []
    opened: list[int] = []
    closed: list[int] = []
    for _, opens, half in around[start:] + around[:start]:
        (opened if opens else closed).append(half)
        if len(opened) == len(closed):  # out of the solid again
            # Where several solids overlap, files hold one after the other: pair in that order.
            pairs += zip(sorted(opened), sorted(closed), strict=True)
            opened, closed = [], []
    return pairs


def _corner_groups(twin: NDArray[np.int64]) -> NDArray[np.int32]:
    """Join the corners of faces that are neighbours around a vertex."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    half = np.arange(len(twin))
    after = half - half % 3 + (half + 1) % 3
    graph = coo_array((np.ones(len(twin)), (half, after[twin])), shape=2 * (len(twin),))
    groups: NDArray[np.int32] = connected_components(graph, directed=False)[1]
    return groups
