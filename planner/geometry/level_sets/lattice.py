"""Positions as integers, and the sign of a volume decided exactly.

Two surfaces are compared, a part's and that of the level sets. Where a vertex of one lies in a
face of the other, or two edges meet, the volume is zero; the level sets then count as moved by
(ε, ε², ε³) with ε as small as one likes (simulation of simplicity, Edelsbrunner and Mücke 1990).
Every decision is that of this moved surface, so decisions never contradict each other.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.arrays import Float32Array, FloatArray
from planner.geometry.cut import LATTICE_MM
from planner.geometry.kernel import inner_kernel

__all__ = ["Lattice", "lattice_for"]

_BITS = 29  # of a coordinate: products of three differences then stay within two words


class Lattice:
    """Integer coordinates about an origin.

    Attributes
    ----------
    origin_mm : (3,) float64
        Where the integers are zero, on the lattice itself.
    unit_mm : float
        A power of two; `LATTICE_MM` for what fits a tray.
    """

    def __init__(self, origin_mm: FloatArray, unit_mm: float) -> None:
        self.origin_mm = origin_mm
        self.unit_mm = unit_mm

    def integers(self, points_mm: FloatArray | Float32Array) -> NDArray[np.int64]:
        """Round positions (n, 3) to the lattice."""
        moved = np.asarray(points_mm, dtype=np.float64) - self.origin_mm
        return np.rint(moved / self.unit_mm).astype(np.int64)

    def rounded(self, points_mm: FloatArray) -> Float32Array:
        """Round positions to values that both the lattice and float32 hold."""
        return (np.rint(points_mm / self.unit_mm) * self.unit_mm + 0.0).astype(np.float32)


def lattice_for(bounds_mm: FloatArray, margin_mm: float) -> Lattice:
    """Return the finest lattice on which a box and a margin about it can be decided."""
    low, high = bounds_mm[0] - margin_mm, bounds_mm[1] + margin_mm
    unit_mm = LATTICE_MM
    while float((high - low).max()) / unit_mm >= 2**_BITS:
        unit_mm *= 2.0
    return Lattice(np.floor(low / unit_mm) * unit_mm, unit_mm)


@inner_kernel
def volume_sign(nx: Any, ny: Any, nz: Any, dx: Any, dy: Any, dz: Any) -> Any:
    """Sign of n . d for |n| < 2^61 and |d| < 2^30, exactly, in two words of 64 bits."""
    low = (nx & 0x7FFFFFFF) * dx + (ny & 0x7FFFFFFF) * dy + (nz & 0x7FFFFFFF) * dz
    high = (nx >> 31) * dx + (ny >> 31) * dy + (nz >> 31) * dz + (low >> 31)
    if high != 0:
        return 1 if high > 0 else -1
    return 1 if (low & 0x7FFFFFFF) > 0 else 0


@inner_kernel
def first_sign(nx: Any, ny: Any, nz: Any) -> Any:
    """Sign of n . (ε, ε², ε³)."""
    for n in (nx, ny, nz):
        if n != 0:
            return 1 if n > 0 else -1
    return 0


@inner_kernel
def side_of_level(level: Any, corner: Any, points: Any, at: Any, normal: Any) -> Any:
    """Tell on which side of a face of the level sets, moved, a vertex of the part lies."""
    nx, ny, nz = normal
    sign = volume_sign(
        nx, ny, nz,
        points[at, 0] - level[corner, 0],
        points[at, 1] - level[corner, 1],
        points[at, 2] - level[corner, 2],
    )  # fmt: skip
    return sign if sign != 0 else -first_sign(nx, ny, nz)


@inner_kernel
def side_of_part(points: Any, corner: Any, level: Any, at: Any, normal: Any) -> Any:
    """Tell on which side of a face of the part a vertex of the level sets, moved, lies."""
    nx, ny, nz = normal
    sign = volume_sign(
        nx, ny, nz,
        level[at, 0] - points[corner, 0],
        level[at, 1] - points[corner, 1],
        level[at, 2] - points[corner, 2],
    )  # fmt: skip
    return sign if sign != 0 else first_sign(nx, ny, nz)


@inner_kernel
def turn_of_edges(points: Any, p: Any, q: Any, level: Any, u: Any, v: Any) -> Any:
    """Sign of (q - p) x (v - u) . (u - p) for an edge of the part and one of the level sets."""
    ax, ay, az = (
        points[q, 0] - points[p, 0],
        points[q, 1] - points[p, 1],
        points[q, 2] - points[p, 2],
    )
    bx, by, bz = level[v, 0] - level[u, 0], level[v, 1] - level[u, 1], level[v, 2] - level[u, 2]
    nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    sign = volume_sign(
        nx, ny, nz,
        level[u, 0] - points[p, 0], level[u, 1] - points[p, 1], level[u, 2] - points[p, 2],
    )  # fmt: skip
    return sign if sign != 0 else first_sign(nx, ny, nz)


@inner_kernel
def face_normal(points: Any, a: Any, b: Any, c: Any) -> Any:
    """Return the normal of a triangle of integer positions, twice its area long."""
    ux, uy, uz = (
        points[b, 0] - points[a, 0],
        points[b, 1] - points[a, 1],
        points[b, 2] - points[a, 2],
    )
    vx, vy, vz = (
        points[c, 0] - points[a, 0],
        points[c, 1] - points[a, 1],
        points[c, 2] - points[a, 2],
    )
    return uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
