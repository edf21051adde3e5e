"""Find where a closed surface crosses itself, by rays along z."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from planner.geometry.kernel import kernel
from planner.geometry.mesh import Mesh

__all__ = ["Crossing", "find_crossing"]

_RAYS = 128
_SHIFT = (0.5 + 0.0822871, 0.5 - 0.0673913)  # off the lattices that designed parts lie on
_TOUCH = 1e-6


@dataclass(frozen=True, slots=True)
class Crossing:
    """Where a surface crosses itself.

    Attributes
    ----------
    place_mm
        Middle of the longest stretch found.
    times_inside
        How often the surface encloses that place; an ordinary solid does once.
    length_mm
        Of that stretch, along z.
    volume_mm3
        Estimate of all that is enclosed other than once.
    """

    place_mm: tuple[float, float, float]
    times_inside: int
    length_mm: float
    volume_mm3: float


def find_crossing(mesh: Mesh) -> Crossing | None:
    """Follow 128 x 128 rays along z and find stretches enclosed twice or negatively.

    What is smaller than 1/128 of the extent along x or y may be missed, and overlaps up to a
    millionth of the extent deep count as touching: this is a test of samples, not a proof.

    Parameters
    ----------
    mesh : Mesh
        Closed: every directed edge once, and its reverse once.

    Returns
    -------
    Crossing or None
        None where every stretch is enclosed once or not at all.
    """
    low, high = mesh.bounds_mm
    step = (high - low)[:2] / _RAYS
    if not (step > 0.0).all():
        return None
    first = low[:2] + step * np.array(_SHIFT)
    arguments = (mesh.vertices, mesh.faces, first, step)
    count = _cross(*arguments, np.empty(0, np.int32), np.empty(0), np.empty(0, np.int8))
    ray, z, way = np.empty(count, np.int32), np.empty(count), np.empty(count, np.int8)
    _cross(*arguments, ray, z, way)
    order = np.lexsort((-way, z, ray))  # of equal heights the entry first
    ray, z = ray[order], z[order]
    inside = np.cumsum(way[order])  # the sum over each ray is zero
    length = np.where(ray[1:] == ray[:-1], np.diff(z), 0.0)
    wrong = ((inside[:-1] > 1) | (inside[:-1] < 0)) & (length > _TOUCH * float((high - low).max()))
    if not wrong.any():
        return None
    worst = int(np.argmax(np.where(wrong, length, 0.0)))
    row, column = divmod(int(ray[worst]), _RAYS)
    x, y = first + step * np.array([column, row])
    return Crossing(
        place_mm=(float(x), float(y), float((z[worst] + z[worst + 1]) / 2)),
        times_inside=int(inside[worst]),
        length_mm=float(length[worst]),
        volume_mm3=float(length[wrong].sum() * step[0] * step[1]),
    )


@kernel
def _cross(vertices: Any, faces: Any, first: Any, step: Any, ray: Any, z: Any, way: Any) -> Any:
    """Write the rays' crossings where there is room, and count them.

    A row of rays meets a triangle between its edge that runs up and its edge that runs down;
    a shared edge gives both of its triangles the same bound, so that no ray slips through.
    """
    n = 0
    for f in range(faces.shape[0]):
        a, b, c = vertices[faces[f, 0]], vertices[faces[f, 1]], vertices[faces[f, 2]]
        top, bottom = max(a[1], b[1], c[1]), min(a[1], b[1], c[1])
        row = max(0, int(np.ceil((bottom - first[1]) / step[1])) - 1)
        last = min(_RAYS - 1, int(np.floor((top - first[1]) / step[1])) + 1)
        while row <= last:
            y = first[1] + row * step[1]
            row += 1
            if not bottom <= y < top:
                continue
            up = down = 0.0
            for j in range(3):
                i0, i1 = faces[f, j], faces[f, (j + 1) % 3]
                low, high = min(i0, i1), max(i0, i1)
                p, q = vertices[low], vertices[high]
                if (p[1] <= y) == (q[1] <= y):
                    continue
                x = p[0] + (q[0] - p[0]) * ((y - p[1]) / (q[1] - p[1]))
                if vertices[i0, 1] <= y:
                    up = x
                else:
                    down = x
            left, right = min(up, down), max(up, down)
            column = max(0, int(np.ceil((left - first[0]) / step[0])) - 1)
            final = min(_RAYS - 1, int(np.floor((right - first[0]) / step[0])) + 1)
            while column <= final:
                x = first[0] + column * step[0]
                if left <= x < right:
                    if n < z.shape[0]:
                        ray[n] = (row - 1) * _RAYS + column
                        z[n] = _height(a, b, c, x, y)
                        way[n] = 1 if up < down else -1
                    n += 1
                column += 1
    return n


@kernel
def _height(a: Any, b: Any, c: Any, x: Any, y: Any) -> Any:
    ux, uy, vx, vy = b[0] - a[0], b[1] - a[1], c[0] - a[0], c[1] - a[1]
    area = ux * vy - uy * vx
    low, high = min(a[2], b[2], c[2]), max(a[2], b[2], c[2])
    if area == 0.0:
        return (low + high) / 2
    s = ((x - a[0]) * vy - (y - a[1]) * vx) / area
    t = (ux * (y - a[1]) - uy * (x - a[0])) / area
    return min(max(a[2] + s * (b[2] - a[2]) + t * (c[2] - a[2]), low), high)
