"""Fill loops with triangles between their nodes."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.arrays import Float32Array
from planner.geometry.cut import LATTICE_MM, squared_height
from planner.geometry.kernel import inner_kernel, kernel
from planner.geometry.level_sets.loops import Loops

__all__ = ["fill_loops"]

_MOST_COVERED = 24  # corners of a loop whose triangulations are compared


def fill_loops(
    loops: Loops, points_mm: Float32Array, normals: NDArray[np.float64]
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]:
    """Triangulate what loops enclose; loops of one face and label enclose it together.

    Parameters
    ----------
    points_mm : (nodes, 3) float32
        Positions.
    normals : (m, 3) float64
        Of the faces, of any length.

    Returns
    -------
    faces : (t, 3) int32
        Triangles between nodes.
    label, source : (t,) int32
        Of the loops.
    """
    size = np.diff(loops.starts)
    key = loops.face.astype(np.int64) * (int(loops.label.max(initial=0)) + 1) + loops.label
    order = np.argsort(key, kind="stable")
    first = np.append(True, np.diff(key[order]) > 0)[: len(order)]
    group = np.cumsum(first) - 1
    together = np.bincount(group, minlength=1)[group]
    alone = np.zeros(len(size), dtype=np.bool_)
    alone[order] = together == 1
    simple = np.flatnonzero(alone & (size <= _MOST_COVERED))
    triangles = int(np.maximum(size[simple] - 2, 0).sum())
    faces = np.empty((triangles, 3), dtype=np.int32)
    owner = np.empty(triangles, dtype=np.int32)
    most = _MOST_COVERED
    _cover(
        simple, loops.nodes, loops.starts, loops.face, points_mm, normals, faces, owner,
        np.empty((most, 2)), np.empty((most, most)), np.empty((most, most), dtype=np.int32),
        np.empty((most, 2), dtype=np.int32),
    )  # fmt: skip
    found, owners = [faces], [owner]
    rest = np.ones(len(size), dtype=np.bool_)
    rest[simple] = False  # a loop of two nodes encloses nothing
    rest[size < 3] = False
    ranked = order[rest[order]]
    for several in np.split(ranked, np.flatnonzero(np.diff(key[ranked])) + 1):
        if len(several):
            more = _by_sweep(loops, several, points_mm, normals[loops.face[several[0]]])
            found.append(more)
            owners.append(np.full(len(more), several[0], dtype=np.int32))
    faces, owner = np.concatenate(found), np.concatenate(owners)
    return faces, loops.label[owner], loops.face[owner]


def _by_sweep(
    loops: Loops, several: NDArray[np.int64], points_mm: Float32Array, normal: NDArray[np.float64]
) -> NDArray[np.int32]:
    from manifold3d import triangulate

    drop = int(np.argmax(np.abs(normal)))
    u, v = (drop + 1) % 3, (drop + 2) % 3
    if normal[drop] < 0:
        u, v = v, u
    outlines = [loops.nodes[loops.starts[i] : loops.starts[i + 1]] for i in several.tolist()]
    flat = [points_mm[outline][:, [u, v]].astype(np.float64) for outline in outlines]
    local = triangulate(flat, epsilon=LATTICE_MM)
    faces: NDArray[np.int32] = np.concatenate(outlines)[local].reshape(-1, 3)
    return faces


@kernel
def _cover(
    chosen: Any, nodes: Any, starts: Any, loop_face: Any, points: Any, normals: Any, faces: Any,
    owner: Any, flat: Any, best: Any, middle: Any, stack: Any,
) -> None:  # fmt: skip
    """Of all triangulations of a loop take the one whose thinnest triangle is thickest.

    By dynamic programming over the loop's stretches (Klincsek 1980). Triangles that are turned
    over count as thinner than any other; where none is, they cover the loop's inside once.
    """
    written = 0
    for loop in chosen:
        first, count = starts[loop], starts[loop + 1] - starts[loop]
        if count < 3:
            continue
        normal = normals[loop_face[loop]]
        drop = 0
        for d in range(1, 3):
            if abs(normal[d]) > abs(normal[drop]):
                drop = d
        u, v = (drop + 1) % 3, (drop + 2) % 3
        if normal[drop] < 0.0:
            u, v = v, u
        for i in range(count):
            flat[i, 0], flat[i, 1] = points[nodes[first + i], u], points[nodes[first + i], v]
            best[i, (i + 1) % count] = np.inf
        for length in range(2, count):
            for i in range(count - length):
                k = i + length
                best[i, k], middle[i, k] = -np.inf, i + 1
                for j in range(i + 1, k):
                    value = min(best[i, j], best[j, k])
                    if value <= best[i, k]:
                        continue
                    height = squared_height(
                        points, nodes[first + i], nodes[first + j], nodes[first + k]
                    )
                    if not _turn(flat, i, j, k) > 0.0:
                        height = -1.0 - height
                    value = min(value, height)
                    if value > best[i, k]:
                        best[i, k], middle[i, k] = value, j
        stack[0, 0], stack[0, 1] = 0, count - 1
        size = 1
        while size > 0:
            size -= 1
            i, k = stack[size, 0], stack[size, 1]
            j = middle[i, k]
            faces[written, 0] = nodes[first + i]
            faces[written, 1] = nodes[first + j]
            faces[written, 2] = nodes[first + k]
            owner[written] = loop
            written += 1
            if j > i + 1:
                stack[size, 0], stack[size, 1] = i, j
                size += 1
            if k > j + 1:
                stack[size, 0], stack[size, 1] = j, k
                size += 1


@inner_kernel
def _turn(flat: Any, a: Any, b: Any, c: Any) -> Any:
    return (flat[b, 0] - flat[a, 0]) * (flat[c, 1] - flat[a, 1]) - (flat[b, 1] - flat[a, 1]) * (
        flat[c, 0] - flat[a, 0]
    )
