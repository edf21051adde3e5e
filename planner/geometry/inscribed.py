"""The largest ball inside a surface near a point."""

import numpy as np

from planner.arrays import FloatArray, IntArray
from planner.geometry.kernel import kernel

__all__ = ["inscribed_ball"]


@kernel
def inscribed_ball(
    vertices: FloatArray,
    faces: IntArray,
    point: FloatArray,
    normal: FloatArray,
    low: float,
    high: float,
    step: float,
    reach: float,
) -> tuple[FloatArray, float]:
    """Climb from a point to the centre of the largest ball that fits there.

    The ball keeps inside the surface and between the planes normal . x = low and high. The
    search halves its step from `step` to a sixteenth of it, which is its precision, and stays
    within `step` of where it starts along each axis.

    Parameters
    ----------
    reach
        Radius in mm beyond which the size of a ball is of no interest.

    Returns
    -------
    centre, radius_mm
        Where no ball fits, the radius is zero.
    """
    near = np.empty(len(faces), np.int64)
    around = reach + 2 * step
    n = 0
    for f in range(len(faces)):
        apart = False
        for axis in range(3):
            a = vertices[faces[f, 0], axis] - point[axis]
            b = vertices[faces[f, 1], axis] - point[axis]
            c = vertices[faces[f, 2], axis] - point[axis]
            apart |= min(a, b, c) > around or max(a, b, c) < -around
        if not apart:
            near[n] = f
            n += 1
    near = near[:n]
    best = _depth(vertices, faces, near, point, normal, low, high, reach)
    centre, start, trial = np.empty(3), np.empty(3), np.empty(3)
    for axis in range(3):
        centre[axis] = point[axis]
    size = step / 2
    while size >= step / 16:
        moved = False
        for axis in range(3):
            start[axis] = centre[axis]
        for neighbour in range(27):
            strayed, digits = False, neighbour
            for axis in range(3):
                trial[axis] = start[axis] + (digits % 3 - 1) * size
                strayed |= abs(trial[axis] - point[axis]) > step
                digits //= 3
            if strayed:
                continue
            depth = _depth(vertices, faces, near, trial, normal, low, high, reach)
            if depth > best + 1e-9:
                moved, best = True, depth
                for axis in range(3):
                    centre[axis] = trial[axis]
        if not moved:
            size /= 2
    return centre, max(best, 0.0)


@kernel
def _depth(
    vertices: FloatArray,
    faces: IntArray,
    near: IntArray,
    point: FloatArray,
    normal: FloatArray,
    low: float,
    high: float,
    reach: float,
) -> float:
    # Distance to the surface, negative outside. Among triangles that share the nearest point
    # (an edge, a corner) the one seen least edge-on tells the side.
    nearest, inside, facing = reach * reach, True, 0.0
    a, b, c = np.empty(3), np.empty(3), np.empty(3)
    for f in near:
        for axis in range(3):
            a[axis] = vertices[faces[f, 0], axis] - point[axis]
            b[axis] = vertices[faces[f, 1], axis] - point[axis]
            c[axis] = vertices[faces[f, 2], axis] - point[axis]
        u, v, w = _nearest_weights(a, b, c)
        distance, height, square = 0.0, 0.0, 0.0
        for axis in range(3):
            i, j = (axis + 1) % 3, (axis + 2) % 3
            towards = u * a[axis] + v * b[axis] + w * c[axis]
            n = (b[i] - a[i]) * (c[j] - a[j]) - (b[j] - a[j]) * (c[i] - a[i])
            distance += towards * towards
            height += n * towards
            square += n * n
        if distance > nearest * (1 + 1e-9) + 1e-18 or square == 0.0:
            continue
        cosine = height / np.sqrt(square * max(distance, 1e-300))
        if distance < nearest * (1 - 1e-9) - 1e-18 or abs(cosine) > facing:
            facing = abs(cosine)
            inside = cosine >= 0.0
        nearest = min(nearest, distance)
    along = point[0] * normal[0] + point[1] * normal[1] + point[2] * normal[2]
    depth = np.sqrt(nearest) if inside else -np.sqrt(nearest)
    return float(min(depth, along - low, high - along))


@kernel
def _nearest_weights(a: FloatArray, b: FloatArray, c: FloatArray) -> tuple[float, float, float]:
    # Weights of the corners in the triangle's point nearest to the origin, by the Voronoi
    # regions of corners, edges and face (Ericson 2004, Real-Time Collision Detection, 5.1.5).
    d1, d2, d3, d4, d5, d6 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for axis in range(3):
        ab, ac = b[axis] - a[axis], c[axis] - a[axis]
        d1, d2 = d1 - ab * a[axis], d2 - ac * a[axis]
        d3, d4 = d3 - ab * b[axis], d4 - ac * b[axis]
        d5, d6 = d5 - ab * c[axis], d6 - ac * c[axis]
    if d1 <= 0 and d2 <= 0:
        return 1.0, 0.0, 0.0
    if d3 >= 0 and d4 <= d3:
        return 0.0, 1.0, 0.0
    if d6 >= 0 and d5 <= d6:
        return 0.0, 0.0, 1.0
    on_ab, on_ac, on_bc = d1 * d4 - d3 * d2, d5 * d2 - d1 * d6, d3 * d6 - d5 * d4
    if on_ab <= 0 and d1 >= 0 and d3 <= 0 and d1 > d3:
        return -d3 / (d1 - d3), d1 / (d1 - d3), 0.0
    if on_ac <= 0 and d2 >= 0 and d6 <= 0 and d2 > d6:
        return -d6 / (d2 - d6), 0.0, d2 / (d2 - d6)
    beyond_b, beyond_c = d4 - d3, d5 - d6
    if on_bc <= 0 and beyond_b >= 0 and beyond_c >= 0 and beyond_b + beyond_c > 0:
        return 0.0, beyond_c / (beyond_b + beyond_c), beyond_b / (beyond_b + beyond_c)
    total = on_ab + on_ac + on_bc
    if total <= 0:
        return 1.0, 0.0, 0.0
    return on_bc / total, on_ac / total, on_ab / total
