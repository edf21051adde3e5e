"""Stiffness of a periodic cell of voxels, incompressible, by Fourier transforms.

Strains are compatible and free of divergence, and Γ is the orthogonal projection on such fields:
the equilibrium of stresses 2 µ (E + e) is Γ µ (E + e) = 0 with Γ e = e, a symmetric positive
system that conjugate gradients solve in a number of steps that depends on the contrast of moduli
alone (Moulinec and Suquet 1998; Zeman and others 2010). Derivatives are differences on the
rotated grid (Willot 2015): displacements at voxels' corners, strains at their centres. Its wave
vectors are real up to a phase, so Γ needs no complex directions, and layers along an axis are
exact.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import fft

from planner.errors import ArgumentError
from planner.numerics import FloatArray

_TOLERANCE = 1e-6  # of the residual: the modulus, an energy, is then right to its square
_MOST_STEPS = 2000
_MANY = 1 << 22  # values from which a second thread pays
# Components are kept as xx, yy, zz, yz, xz, xy.
_PLACES = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))
_WEIGHT = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])
# An orthonormal basis of tensors without trace.
_BASIS = np.array(
    [
        [2.0, -1.0, -1.0, 0.0, 0.0, 0.0],
        [0.0, 1.0, -1.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
    ]
) / np.sqrt([[6.0], [2.0], [2.0], [2.0], [2.0]])


@dataclass(frozen=True, slots=True, eq=False)
class CellSolution:
    """What a mean strain makes of a cell.

    Attributes
    ----------
    stress_MPa : (6,)
        Mean stress without its pressure: xx, yy, zz, yz, xz, xy.
    strain : (6, nx, ny, nz)
        Strain in each voxel.
    steps
        Of conjugate gradients.
    """

    stress_MPa: FloatArray
    strain: FloatArray
    steps: int


def solve_cell(
    shear_MPa: FloatArray, mean_strain: ArrayLike, tolerance: float = _TOLERANCE
) -> CellSolution:
    """Find the strains of a cell of incompressible voxels under a mean strain.

    Parameters
    ----------
    shear_MPa : (nx, ny, nz)
        Shear modulus of each voxel, above 0.
    mean_strain : (6,)
        xx, yy, zz, yz, xz, xy (tensor components), of trace 0.
    tolerance
        Of the residual, relative.

    Raises
    ------
    ArgumentError
        A modulus that is not above 0, a mean strain of another shape or with a trace, or no
        solution within 2000 steps: a contrast beyond any pair of solids.
    """
    double = 2.0 * np.asarray(shear_MPa, dtype=np.float64)
    mean = np.asarray(mean_strain, dtype=np.float64)
    if double.ndim != 3 or not (np.isfinite(double).all() and (double > 0.0).all()):
        raise ArgumentError("shear moduli must be finite and above 0, one a voxel of (nx, ny, nz)")
    if mean.shape != (6,) or abs(float(mean[:3].sum())) > 1e-9 * float(np.abs(mean).max()):
        raise ArgumentError(f"mean strain {mean.tolist()}: give 6 components of trace 0")
    waves = _waves(double.shape)
    strain = np.broadcast_to(mean[:, None, None, None], (6, *double.shape)).copy()
    residual = -_project(double * strain, waves)
    way = residual.copy()
    square = _dot(residual, residual)
    limit = tolerance**2 * _dot(double * strain, double * strain)
    steps = 0
    while square > limit:
        if steps == _MOST_STEPS:
            raise ArgumentError(
                f"a cell with shear moduli from {double.min() / 2:g} to {double.max() / 2:g} MPa "
                f"was not solved in {steps} steps; give phases of less contrast"
            )
        pushed = _project(double * way, waves)
        length = square / _dot(way, pushed)
        strain += length * way
        residual -= length * pushed
        before, square = square, _dot(residual, residual)
        way *= square / before
        way += residual
        steps += 1
    stress = (double * strain).mean(axis=(1, 2, 3))
    stress[:3] -= stress[:3].mean()
    return CellSolution(stress, strain, steps)


def effective_stiffness_MPa(shear_MPa: FloatArray, tolerance: float = _TOLERANCE) -> FloatArray:
    """Return the stiffness of a cell, (5, 5), on an orthonormal basis of tensors without trace.

    Of one material it is 2 µ times the identity.
    """
    columns = [solve_cell(shear_MPa, mean, tolerance).stress_MPa for mean in _BASIS]
    found = (_BASIS * _WEIGHT) @ np.array(columns).T
    return np.asarray(0.5 * (found + found.T))


def youngs_modulus_MPa(stiffness_MPa: FloatArray, direction: ArrayLike) -> float:
    """Return the modulus in tension along a direction, from `effective_stiffness_MPa`."""
    n = np.asarray(direction, dtype=np.float64)
    n = n / np.linalg.norm(n)
    pull = np.array([n[i] * n[j] for i, j in _PLACES])
    along = (_BASIS * _WEIGHT) @ pull  # the trace has no part in it
    return float(1.0 / (along @ np.linalg.solve(stiffness_MPa, along)))


def _dot(a: FloatArray, b: FloatArray) -> float:
    return float((_WEIGHT * np.einsum("cxyz,cxyz->c", a, b)).sum())


def _waves(shape: tuple[int, ...]) -> FloatArray:
    """Return unit wave vectors of the rotated grid, (3, nx, ny, nz // 2 + 1); 0 where none is."""
    half = [np.pi * fft.fftfreq(n) for n in shape[:2]] + [np.pi * fft.rfftfreq(shape[2])]
    sines = np.meshgrid(*map(np.sin, half), indexing="ij", sparse=True)
    cosines = np.meshgrid(*map(np.cos, half), indexing="ij", sparse=True)
    k = np.stack(
        [sines[i] * cosines[(i + 1) % 3] * cosines[(i + 2) % 3] for i in range(3)]
    )  # fmt: skip
    length = np.sqrt((k**2).sum(axis=0))
    k = np.divide(k, length, out=np.zeros_like(k), where=length > 1e-12)
    return np.asarray(k)


def _project(field: FloatArray, k: FloatArray) -> FloatArray:
    """Return the part of a symmetric tensor field that is the strain of an isochoric motion."""
    workers = 2 if field.size > _MANY else 1
    t: NDArray[np.complex128] = fft.rfftn(field, axes=(1, 2, 3), workers=workers)
    w = np.stack(
        [
            t[0] * k[0] + t[5] * k[1] + t[4] * k[2],
            t[5] * k[0] + t[1] * k[1] + t[3] * k[2],
            t[4] * k[0] + t[3] * k[1] + t[2] * k[2],
        ]
    )
    w -= k * (w * k).sum(axis=0)
    for c, (i, j) in enumerate(_PLACES):
        t[c] = k[i] * w[j] + k[j] * w[i]
    return np.asarray(fft.irfftn(t, s=field.shape[1:], axes=(1, 2, 3), workers=workers))
