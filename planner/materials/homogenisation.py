"""The modulus of two phases: bounds, cells of a dither, and solved periodic cells."""

from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import fft

from planner.errors import ArgumentError
from planner.numerics import FloatArray

__all__ = [
    "dither_table",
    "dithered_fraction",
    "dithered_modulus_MPa",
    "effective_stiffness_MPa",
    "hashin_shtrikman_MPa",
    "reuss_MPa",
    "reuss_share",
    "solve_cell",
    "voigt_MPa",
    "youngs_modulus_MPa",
]


# ------------------------------------------------------------------------------------------------
# Bounds on the modulus of a mixture of two phases, both incompressible.
#
# Elastomers change their volume a thousand times less readily than their shape, and the laws that
# planning uses are incompressible throughout: Poisson's ratio is 1/2, the bulk modulus infinite,
# and E = 3 µ for the phases and for what they make. Hashin and Shtrikman's bounds on µ are then
# bounds on E. `poisson_ratio` lets one see what a compressible pair would have.


def voigt_MPa(soft_MPa: ArrayLike, hard_MPa: ArrayLike, fraction: ArrayLike) -> FloatArray:
    """Return the arithmetic mean: phases side by side along the load, equal strain."""
    soft, hard = np.asarray(soft_MPa, dtype=np.float64), np.asarray(hard_MPa, dtype=np.float64)
    f = np.asarray(fraction, dtype=np.float64)
    return np.asarray((1.0 - f) * soft + f * hard)


def reuss_MPa(soft_MPa: ArrayLike, hard_MPa: ArrayLike, fraction: ArrayLike) -> FloatArray:
    """Return the harmonic mean: layers across the load, equal stress."""
    f = np.asarray(fraction, dtype=np.float64)
    return np.asarray(1.0 / ((1.0 - f) / np.asarray(soft_MPa) + f / np.asarray(hard_MPa)))


def reuss_share(soft_MPa: float, hard_MPa: float, compliance_per_MPa: ArrayLike) -> FloatArray:
    """Return the share of the harder layer at which layers have a mean compliance, 0 to 1.

    The inverse of `reuss_MPa`; compliances beyond those of the layers are clamped to them.
    """
    wanted = np.asarray(compliance_per_MPa, dtype=np.float64)
    share = (1.0 / soft_MPa - wanted) / (1.0 / soft_MPa - 1.0 / hard_MPa)
    return np.clip(share, 0.0, 1.0)


def hashin_shtrikman_MPa(
    soft_MPa: ArrayLike, hard_MPa: ArrayLike, fraction: ArrayLike, poisson_ratio: float = 0.5
) -> tuple[FloatArray, FloatArray]:
    """Return the bounds on the modulus of any isotropic mixture (Hashin and Shtrikman 1963).

    Parameters
    ----------
    soft_MPa, hard_MPa
        Young's moduli of the phases, the softer first.
    fraction
        Volume fraction of the harder one.
    poisson_ratio
        Of both phases, 0 to 1/2.
    """
    f = np.asarray(fraction, dtype=np.float64)
    soft, hard = np.asarray(soft_MPa, dtype=np.float64), np.asarray(hard_MPa, dtype=np.float64)
    if poisson_ratio == 0.5:
        low = _mixed(soft, hard, f, 0.4 / soft)
        high = _mixed(hard, soft, 1.0 - f, 0.4 / hard)
        return low, high
    shear = [e / (2.0 * (1.0 + poisson_ratio)) for e in (soft, hard)]
    bulk = [e / (3.0 * (1.0 - 2.0 * poisson_ratio)) for e in (soft, hard)]
    bounds = []
    for a, b, share in ((0, 1, f), (1, 0, 1.0 - f)):
        k, g = bulk[a], shear[a]
        of_shear = 6.0 * (k + 2.0 * g) / (5.0 * g * (3.0 * k + 4.0 * g))
        mixed_shear = _mixed(g, shear[b], share, of_shear)
        mixed_bulk = _mixed(k, bulk[b], share, 3.0 / (3.0 * k + 4.0 * g))
        bounds.append(9.0 * mixed_bulk * mixed_shear / (3.0 * mixed_bulk + mixed_shear))
    return bounds[0], bounds[1]


def _mixed(matrix: FloatArray, other: FloatArray, share: FloatArray, of: FloatArray) -> FloatArray:
    """Return matrix + share / (1 / (other - matrix) + (1 - share) of), without dividing by zero."""
    step = other - matrix
    return np.asarray(matrix + share * step / (1.0 + (1.0 - share) * of * step))


# ------------------------------------------------------------------------------------------------
# Modulus of cells of two materials dealt by the blue-noise tile, and back.
#
# Between Hashin and Shtrikman's bounds E- and E+ the modulus is E-^(1-w) E+^w, with w from a table
# that `benchmarks/calibrate_dither.py` solves on the very pattern, corners bevelled, by
# `planner.materials.homogenisation`. Phases are taken as linear, each with its secant
# modulus at the working strain; strains within a cell of two elastomers differ, so at finite strain
# this is an approximation.


_NODES = 513


@dataclass(frozen=True, slots=True)
class DitherTable:
    """Where the modulus lies between the bounds.

    Attributes
    ----------
    volume
        Volume fractions of the harder phase, rising.
    contrast
        Harder modulus over softer one, rising.
    place
        w at each volume and contrast.
    error
        Largest relative error of a modulus, of any direction, at each contrast. Most of it is that
        cells are bevelled along one diagonal of their cubes, in which the pattern is stiffest.
    """

    volume: tuple[float, ...]
    contrast: tuple[float, ...]
    place: tuple[tuple[float, ...], ...]
    error: tuple[float, ...]

    def error_at(self, contrast: float) -> float:
        """Return the largest relative error at a contrast; beyond the largest it is not known."""
        return float(np.interp(np.log(contrast), np.log(self.contrast), self.error))


@cache
def dither_table() -> DitherTable:
    """Return the table that planner brings."""
    path = files("planner.materials") / "dithered.json"
    return msgspec.json.decode(path.read_bytes(), type=DitherTable)


def dithered_modulus_MPa(soft_MPa: float, hard_MPa: float, volume: ArrayLike) -> FloatArray:
    """Return the modulus of a dithered mixture.

    Parameters
    ----------
    soft_MPa, hard_MPa
        Moduli of the phases, the softer first. Beyond the table's largest contrast its last
        column is used, and the bounds alone are sure.
    volume
        Volume fraction of the harder phase, 0 to 1.
    """
    v = np.asarray(volume, dtype=np.float64)
    low, high = hashin_shtrikman_MPa(soft_MPa, hard_MPa, v)
    table = dither_table()
    contrasts = np.log(table.contrast)
    contrast = np.clip(np.log(hard_MPa / soft_MPa), contrasts[0], contrasts[-1])
    column = [float(np.interp(contrast, contrasts, row)) for row in table.place]
    w = np.interp(v, table.volume, column)
    return np.asarray(low ** (1.0 - w) * high**w)


def dithered_fraction(soft_MPa: float, hard_MPa: float, modulus_MPa: ArrayLike) -> FloatArray:
    """Return the volume fraction of the harder phase that gives a modulus.

    The inverse of `dithered_modulus_MPa` within 1e-6: it rises with the modulus, from exactly 0 at
    the softer phase's to exactly 1 at the harder one's, and stays there beyond.
    """
    volume = np.linspace(0.0, 1.0, _NODES)
    ladder = np.log(dithered_modulus_MPa(soft_MPa, hard_MPa, volume))
    wanted = np.log(np.asarray(modulus_MPa, dtype=np.float64))
    found = np.interp(wanted, ladder, volume)
    found = np.where(wanted <= np.log(soft_MPa), 0.0, found)
    return np.asarray(np.where(wanted >= np.log(hard_MPa), 1.0, found))


# ------------------------------------------------------------------------------------------------
# Stiffness of a periodic cell of voxels, incompressible, by Fourier transforms.
#
# Strains are compatible and free of divergence, and Γ is the orthogonal projection on such fields:
# the equilibrium of stresses 2 µ (E + e) is Γ µ (E + e) = 0 with Γ e = e, a symmetric positive
# system that conjugate gradients solve in a number of steps that depends on the contrast of moduli
# alone (Moulinec and Suquet 1998; Zeman and others 2010). Derivatives are differences on the
# rotated grid (Willot 2015): displacements at voxels' corners, strains at their centres. Its wave
# vectors are real up to a phase, so Γ needs no complex directions, and layers along an axis are
# exact.


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
