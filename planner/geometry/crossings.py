"""Find where a closed surface crosses itself, by rays along z."""

from dataclasses import dataclass

import numpy as np

from planner.arrays import FloatArray, IntArray
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
    y0, y1, y2 = (mesh.vertices[corner, 1] for corner in mesh.faces.T)
    bottom, top = np.minimum(np.minimum(y0, y1), y2), np.maximum(np.maximum(y0, y1), y2)
    face, row = _covered(bottom, top, first[1], step[1])
    ray, z, way = _cross(mesh, face, row, first, step)
    order = np.lexsort((-way, z, ray))  # of equal heights the entry first
    ray, z = ray[order], z[order]
    inside = np.cumsum(way[order])  # the sum over each ray is zero
    length = np.where(ray[1:] == ray[:-1], np.diff(z), 0.0)
    wrong = ((inside[:-1] > 1) | (inside[:-1] < 0)) & (length > _TOUCH * float((high - low).max()))
    if not wrong.any():
        return None
    worst = int(np.argmax(np.where(wrong, length, 0.0)))
    x, y = first + step * np.array([ray[worst] % _RAYS, ray[worst] // _RAYS])
    return Crossing(
        place_mm=(float(x), float(y), float((z[worst] + z[worst + 1]) / 2)),
        times_inside=int(inside[worst]),
        length_mm=float(length[worst]),
        volume_mm3=float(length[wrong].sum() * step[0] * step[1]),
    )


def _cross(
    mesh: Mesh, face: IntArray, row: IntArray, first: FloatArray, step: FloatArray
) -> tuple[IntArray, FloatArray, IntArray]:
    """Ray, height and way (1 in, -1 out) of the crossings of faces with rows of rays.

    A row of rays meets a triangle between its edge that runs up and its edge that runs down;
    a shared edge gives both of its triangles the same bound, so that no ray slips through.
    """
    x, y, _ = mesh.vertices.T
    corners, height = mesh.faces[face], first[1] + row * step[1]
    up, down = np.zeros(len(face)), np.zeros(len(face))
    for tail, head in ((0, 1), (1, 2), (2, 0)):
        p, q = corners[:, tail], corners[:, head]
        rising = y[p] <= height
        crossed = np.flatnonzero(rising != (y[q] <= height))
        p, q = np.minimum(p, q)[crossed], np.maximum(p, q)[crossed]
        at = x[p] + (x[q] - x[p]) * ((height[crossed] - y[p]) / (y[q] - y[p]))
        rising = rising[crossed]
        up[crossed[rising]], down[crossed[~rising]] = at[rising], at[~rising]
    span, column = _covered(np.minimum(up, down), np.maximum(up, down), first[0], step[0])
    way = np.where(up < down, 1, -1)[span]
    heights = _height(mesh.vertices[corners[span]], first[0] + column * step[0], height[span])
    return row[span] * _RAYS + column, heights, way


def _covered(
    low: FloatArray, high: FloatArray, first: float, step: float
) -> tuple[IntArray, IntArray]:
    """All pairs of an interval and a ray in it: low <= first + ray * step < high."""
    begin, end = _first_ray(low, first, step), _first_ray(high, first, step)
    count = np.maximum(end - begin, 0)
    owner = np.repeat(np.arange(len(low)), count)
    return owner, np.arange(len(owner)) - (np.cumsum(count) - count - begin)[owner]


def _first_ray(value: FloatArray, first: float, step: float) -> IntArray:
    """Smallest ray with first + ray * step >= value, judged by that expression."""
    ray = np.clip(np.ceil((value - first) / step), 0.0, _RAYS)
    ray -= first + (ray - 1.0) * step >= value
    ray += first + ray * step < value
    settled: IntArray = np.clip(ray, 0.0, _RAYS).astype(np.int64)
    return settled


def _height(corners: FloatArray, x: FloatArray, y: FloatArray) -> FloatArray:
    a, b, c = corners.transpose(1, 2, 0)
    ux, uy, vx, vy = b[0] - a[0], b[1] - a[1], c[0] - a[0], c[1] - a[1]
    area = ux * vy - uy * vx
    low, high = corners[:, :, 2].min(axis=1), corners[:, :, 2].max(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        s = ((x - a[0]) * vy - (y - a[1]) * vx) / area
        t = (ux * (y - a[1]) - uy * (x - a[0])) / area
        z = np.clip(a[2] + s * (b[2] - a[2]) + t * (c[2] - a[2]), low, high)
    heights: FloatArray = np.where(area == 0.0, (low + high) / 2.0, z)
    return heights
