"""Equilibrium of a soft solid on cut cells: large rotations, nearly incompressible, graded."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from planner.materials.marlow import MarlowTable, law_at
from planner.numerics import BoolArray, FloatArray, IntArray, free_kernel, inner_kernel

if TYPE_CHECKING:
    from planner.simulation.cut_cells import CutCells
    from planner.simulation.loads import Conditions
    from planner.simulation.sparse_cholesky import Analysis, Factor

__all__ = [
    "Body",
    "Equilibrium",
    "FacetPoints",
    "LostStability",
    "Mechanics",
    "Sensitivity",
    "facet_points",
    "shape_functions",
]


# ------------------------------------------------------------------------------------------------
# The element: displacements quadratic along each axis (27 nodes), a pressure that is linear in a
# cell and jumps between cells (Q2/P1). With C = Fᵀ F, J² = det C and I1 = J^(-2/3) tr C, the
# energy of a body is
#
#     Π = ∫ W(I1) + p (J - 1) - p² / (2 κ) dV - work of the loads,
#
# stationary over displacements and pressures; pressures are eliminated cell by cell. The bulk
# modulus κ belongs to Poisson's ratio at rest.
#
# The unknowns of Newton's method are displacements, pressures and, at every quadrature point,
# strain E and stress S as variables of their own. They are eliminated too, and the matrix has the
# size and the residual of the displacements' own, but it is taken where the linearised strains are,
# and with stresses that satisfy the linearised law: bending then takes 10 to 20 iterations instead
# of hundreds. D. Magisano, L. Leonetti, G. Garcea, How to improve efficiency and robustness of the
# Newton method in geometrically non-linear structural problem discretized via displacement-based
# finite elements, Comput. Methods Appl. Mech. Eng. 313 (2017) 986, doi 10.1016/j.cma.2016.10.023.
#
# Symmetric tensors are rows of six: 11, 22, 33, 12, 23, 13.


POISSON = 0.49
"""Of every mixture; rubbers have 0.4999, which makes no visible difference to a part that bends,
rigid grades 0.38 to 0.4, where the difference is one of per cents in what hardly deforms."""

_PENALTY = 1e4
"""Stiffness of a support over that of a cell of the material held: what it yields is 1e-4 of a
cell's own deformation, and a double still holds twelve digits of the rest."""

_STABILISER = 1e-4
"""Stiffness of cut cells against fields that are not linear, over that of a full cell.

A linear field costs nothing, whatever the cut. The finger's compliance moves by less than 1e-3
between 1e-3 and 1e-6 (tests)."""

_SPREAD = 0.12
"""A pressure varies along an axis of a piece if its material spreads that much along it, as a
standard deviation over half a cell (0.577 in a full one): flakes lock otherwise."""

_PAIRS = np.array([(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)])
_SIX = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2]])


def shape_functions(local: FloatArray, cell_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the 27 shape functions (n, 27) and their gradients per mm (n, 27, 3).

    Parameters
    ----------
    local : (n, 3)
        Places in the cell, -1 to 1.
    """
    s = local[:, None, :]
    node = np.array([-1.0, 0.0, 1.0])[None, :, None]
    value = np.where(node == 0.0, 1.0 - s * s, 0.5 * s * (s + node))  # (n, 3 nodes, 3 axes)
    slope = np.where(node == 0.0, -2.0 * s, s + 0.5 * node) * (2.0 / cell_mm)
    x, y, z = value[..., 0], value[..., 1], value[..., 2]
    dx, dy, dz = slope[..., 0], slope[..., 1], slope[..., 2]

    def product(along_x: FloatArray, along_y: FloatArray, along_z: FloatArray) -> FloatArray:
        return np.einsum("nk,nj,ni->nkji", along_z, along_y, along_x).reshape(len(local), 27)

    gradient = np.stack([product(dx, y, z), product(x, dy, z), product(x, y, dz)], axis=2)
    return product(x, y, z), gradient


@inner_kernel
def _gradients(local: Any, cell_mm: Any, out: Any) -> None:
    """Write the gradients per mm of the 27 shape functions at a place, (27, 3)."""
    value, slope = np.empty((3, 3)), np.empty((3, 3))
    for axis in range(3):
        s = local[axis]
        value[axis, 0], value[axis, 1] = 0.5 * s * (s - 1.0), 1.0 - s * s
        value[axis, 2] = 0.5 * s * (s + 1.0)
        slope[axis, 0], slope[axis, 1] = (s - 0.5), -2.0 * s
        slope[axis, 2] = s + 0.5
        slope[axis] *= 2.0 / cell_mm[axis]
    for k in range(3):
        for j in range(3):
            for i in range(3):
                a = i + 3 * j + 9 * k
                out[a, 0] = slope[0, i] * value[1, j] * value[2, k]
                out[a, 1] = value[0, i] * slope[1, j] * value[2, k]
                out[a, 2] = value[0, i] * value[1, j] * slope[2, k]


@inner_kernel
def _law(strain: Any, table: Any, step: Any, below: Any, share: Any, ci: Any, stress: Any) -> Any:
    """Write the inverse of C and the isochoric stress; return J, the coefficients and d ln W'/dm.

    4 d²W / dC² = c1 I⊗I + c2 (I⊗C⁻¹ + C⁻¹⊗I) + c3 C⁻¹⊗C⁻¹ + c4 K, K D = C⁻¹ D C⁻¹; the last
    returned is the change of ln W' over a gap of the table's nodes.
    """
    a, b, c = 1.0 + 2.0 * strain[0], 1.0 + 2.0 * strain[1], 1.0 + 2.0 * strain[2]
    d, e, f = 2.0 * strain[3], 2.0 * strain[4], 2.0 * strain[5]
    det = a * (b * c - e * e) - d * (d * c - e * f) + f * (d * e - b * f)
    ci[0], ci[1], ci[2] = (b * c - e * e) / det, (a * c - f * f) / det, (a * b - d * d) / det
    ci[3], ci[4], ci[5] = (e * f - d * c) / det, (d * f - a * e) / det, (d * e - b * f) / det
    J = np.sqrt(det)
    trace = a + b + c
    thin = det ** (-1.0 / 3.0)
    # A rounding at rest may fall below 3; the law's slope over I1 has 1 / x in it.
    x = np.sqrt(max(thin * trace - 3.0, 1e-20))
    log, over_x, over_m = law_at(table, step, below, share, x)
    first = np.exp(log)
    second = first * over_x / (2.0 * x)
    for k in range(6):
        unit = 1.0 if k < 3 else 0.0
        stress[k] = 2.0 * first * thin * (unit - trace / 3.0 * ci[k])
    c1 = 4.0 * second * thin * thin
    c2 = -trace / 3.0 * c1 - 4.0 / 3.0 * first * thin
    c3 = trace * trace / 9.0 * c1 + 4.0 / 9.0 * trace * first * thin
    c4 = 4.0 / 3.0 * trace * first * thin
    return J, c1, c2, c3, c4, over_m


@inner_kernel
def _deform(u: Any, nodes: Any, gradient: Any, F: Any, strain: Any) -> None:
    """Write F = I + du/dX and the strain (Fᵀ F - I) / 2 of displacements at a point."""
    for i in range(3):
        for k in range(3):
            F[i, k] = 1.0 if i == k else 0.0
    for a in range(27):
        n = nodes[a]
        for i in range(3):
            for k in range(3):
                F[i, k] += u[n, i] * gradient[a, k]
    for k in range(6):
        i, j = _PAIRS[k, 0], _PAIRS[k, 1]
        dot = F[0, i] * F[0, j] + F[1, i] * F[1, j] + F[2, i] * F[2, j]
        strain[k] = 0.5 * (dot - (1.0 if i == j else 0.0))


@inner_kernel
def _double(a: Any, b: Any) -> Any:
    """Return a : b of two symmetric tensors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + 2.0 * (a[3] * b[3] + a[4] * b[4] + a[5] * b[5])


@inner_kernel
def _tangent_times(ci: Any, c: Any, d: Any, out: Any) -> None:
    """Write c1 tr(D) I + c2 (I (C⁻¹:D) + C⁻¹ tr D) + c3 C⁻¹ (C⁻¹:D) + c4 C⁻¹ D C⁻¹."""
    trace, dot = d[0] + d[1] + d[2], _double(ci, d)
    for k in range(6):
        i, j = _PAIRS[k, 0], _PAIRS[k, 1]
        inner = 0.0
        for m in range(3):
            for n in range(3):
                inner += ci[_SIX[i, m]] * d[_SIX[m, n]] * ci[_SIX[n, j]]
        unit = 1.0 if k < 3 else 0.0
        out[k] = unit * (c[0] * trace + c[1] * dot) + ci[k] * (c[1] * trace + c[2] * dot)
        out[k] += c[3] * inner


@free_kernel
def _assemble(
    first: int, last: int,
    nodes: IntArray, offsets: IntArray, points: FloatArray, weights: FloatArray, cell_mm: FloatArray,
    table: FloatArray, step: float, below: IntArray, share: FloatArray,
    basis: FloatArray, compliance: FloatArray, stabiliser: FloatArray, roughness: FloatArray,
    u: FloatArray, strain: FloatArray, stress: FloatArray, pressure: FloatArray,
    matrices: FloatArray, forces: FloatArray,
) -> None:  # fmt: skip
    """Write the matrices (n, 81, 81) and forces (n, 81) of cells `first` to `last`.

    compliance : (n, 4, 4)
        Inverse of ∫ ψψ / κ of the pressures' basis ψ, (Q, 4).
    strain, stress : (Q, 6), pressure : (n, 4)
        Where Newton's method is.
    """
    most = 0
    for c in range(first, last):
        most = max(most, offsets[c + 1] - offsets[c])
    gradient = np.empty((most, 27, 3))
    left, right = np.empty((3 * most, 27)), np.empty((3 * most, 243))
    Fs, cis, isos = np.empty((most, 3, 3)), np.empty((most, 6)), np.empty((most, 6))
    gaps, coefficients, Js = np.empty((most, 6)), np.empty((most, 4)), np.empty(most)
    block, volumetric = np.empty((27, 243)), np.empty((81, 4))
    H, B, full = np.empty((3, 3)), np.empty((3, 3)), np.empty(6)
    A = np.empty((3, 3))
    actual = np.empty(6)
    for c in range(first, last):
        begin, count = offsets[c], offsets[c + 1] - offsets[c]
        right_side, new = np.zeros(4), np.zeros(4)
        for q in range(count):
            at = begin + q
            _gradients(points[at], cell_mm, gradient[q])
            _deform(u, nodes[c], gradient[q], Fs[q], actual)
            Js[q], c1, c2, c3, c4, _ = _law(
                strain[at], table, step, below[at], share[at], cis[q], isos[q]
            )
            p = 0.0
            for r in range(4):
                p += pressure[c, r] * basis[at, r]
            coefficients[q, 0], coefficients[q, 1] = c1, c2
            coefficients[q, 2], coefficients[q, 3] = c3 + p * Js[q], c4 - 2.0 * p * Js[q]
            for k in range(6):
                gaps[q, k] = actual[k] - strain[at, k]
            swelling = Js[q] * (1.0 + _double(cis[q], gaps[q])) - 1.0
            for r in range(4):
                right_side[r] += weights[at] * basis[at, r] * swelling
        for r in range(4):
            for s in range(4):
                new[r] += compliance[c, r, s] * right_side[s]
        volumetric[:] = 0.0
        force = forces[c]
        force[:] = 0.0
        for q in range(count):
            at = begin + q
            w, F, ci, co, J = weights[at], Fs[q], cis[q], coefficients[q], Js[q]
            p = 0.0
            for r in range(4):
                p += new[r] * basis[at, r]
            _tangent_times(ci, co, gaps[q], full)
            for k in range(6):
                full[k] += isos[q, k] + p * J * ci[k]
            for i in range(3):
                for k in range(3):
                    H[i, k] = F[i, 0] * ci[_SIX[0, k]] + F[i, 1] * ci[_SIX[1, k]]
                    H[i, k] += F[i, 2] * ci[_SIX[2, k]]
            for i in range(3):
                for j in range(3):
                    B[i, j] = H[i, 0] * F[j, 0] + H[i, 1] * F[j, 1] + H[i, 2] * F[j, 2]
                    A[i, j] = F[i, 0] * full[_SIX[0, j]] + F[i, 1] * full[_SIX[1, j]]
                    A[i, j] = w * (A[i, j] + F[i, 2] * full[_SIX[2, j]])
            g = gradient[q]
            for a in range(27):
                for i in range(3):
                    force[3 * a + i] += A[i, 0] * g[a, 0] + A[i, 1] * g[a, 1] + A[i, 2] * g[a, 2]
                    swell = w * J * (H[i, 0] * g[a, 0] + H[i, 1] * g[a, 1] + H[i, 2] * g[a, 2])
                    for r in range(4):
                        volumetric[3 * a + i, r] += swell * basis[at, r]
            for row in range(3):
                for b in range(27):
                    left[3 * q + row, b] = g[b, row]
                for i in range(3):
                    for j in range(3):
                        for m in range(3):
                            value = co[0] * F[i, row] * F[j, m] + co[2] * H[i, row] * H[j, m]
                            value += co[1] * (F[i, row] * H[j, m] + H[i, row] * F[j, m])
                            value += (
                                0.5 * co[3] * (B[i, j] * ci[_SIX[row, m]] + H[i, m] * H[j, row])
                            )
                            if i == j:
                                value += stress[at, _SIX[row, m]]
                            A[j, m] = w * value
                        for b in range(27):
                            right[3 * q + row, 27 * (3 * i + j) + b] = (
                                A[j, 0] * g[b, 0] + A[j, 1] * g[b, 1] + A[j, 2] * g[b, 2]
                            )
        np.dot(left[: 3 * count].T, right[: 3 * count], block)
        matrix = matrices[c]
        stiff = np.dot(volumetric, np.dot(compliance[c], volumetric.T))
        for a in range(27):
            for i in range(3):
                for b in range(27):
                    for j in range(3):
                        matrix[3 * a + i, 3 * b + j] = (
                            block[a, 27 * (3 * i + j) + b] + stiff[3 * a + i, 3 * b + j]
                        )
        if stabiliser[c] > 0.0:
            for a in range(27):
                for b in range(27):
                    hold = stabiliser[c] * roughness[a, b]
                    for i in range(3):
                        matrix[3 * a + i, 3 * b + i] += hold
                        force[3 * a + i] += hold * u[nodes[c, b], i]


@free_kernel
def _advance(
    first: int, last: int,
    nodes: IntArray, offsets: IntArray, points: FloatArray, weights: FloatArray, cell_mm: FloatArray,
    table: FloatArray, step: float, below: IntArray, share: FloatArray,
    basis: FloatArray, compliance: FloatArray,
    u: FloatArray, change: FloatArray,
    strain: FloatArray, stress: FloatArray, pressure: FloatArray,
) -> None:  # fmt: skip
    """Move strains, stresses and pressures of cells along with a change of the displacements."""
    most = 0
    for c in range(first, last):
        most = max(most, offsets[c + 1] - offsets[c])
    gradient, F, G = np.empty((27, 3)), np.empty((3, 3)), np.empty((3, 3))
    cis, isos, gaps = np.empty((most, 6)), np.empty((most, 6)), np.empty((most, 6))
    coefficients, Js, actual, full = np.empty((most, 4)), np.empty(most), np.empty(6), np.empty(6)
    moved, both = np.empty((most, 6)), np.empty(6)
    for c in range(first, last):
        begin, count = offsets[c], offsets[c + 1] - offsets[c]
        right_side = np.zeros(4)
        for q in range(count):
            at = begin + q
            _gradients(points[at], cell_mm, gradient)
            _deform(u, nodes[c], gradient, F, actual)
            G[:] = 0.0
            for a in range(27):
                n = nodes[c, a]
                for i in range(3):
                    for k in range(3):
                        G[i, k] += change[n, i] * gradient[a, k]
            for k in range(6):
                i, j = _PAIRS[k, 0], _PAIRS[k, 1]
                linear, square = 0.0, 0.0
                for m in range(3):
                    linear += 0.5 * (F[m, i] * G[m, j] + F[m, j] * G[m, i])
                    square += 0.5 * G[m, i] * G[m, j]
                gaps[q, k] = actual[k] + linear - strain[at, k]
                both[k] = actual[k] + linear
                moved[q, k] = actual[k] + linear + square
            Js[q], c1, c2, c3, c4, _ = _law(
                strain[at], table, step, below[at], share[at], cis[q], isos[q]
            )
            p = 0.0
            for r in range(4):
                p += pressure[c, r] * basis[at, r]
            coefficients[q, 0], coefficients[q, 1] = c1, c2
            coefficients[q, 2], coefficients[q, 3] = c3 + p * Js[q], c4 - 2.0 * p * Js[q]
            swelling = Js[q] * (1.0 + _double(cis[q], gaps[q])) - 1.0
            for r in range(4):
                right_side[r] += weights[at] * basis[at, r] * swelling
        for r in range(4):
            pressure[c, r] = 0.0
            for s in range(4):
                pressure[c, r] += compliance[c, r, s] * right_side[s]
        for q in range(count):
            at = begin + q
            p = 0.0
            for r in range(4):
                p += pressure[c, r] * basis[at, r]
            _tangent_times(cis[q], coefficients[q], gaps[q], full)
            for k in range(6):
                stress[at, k] = isos[q, k] + p * Js[q] * cis[q, k] + full[k]
                strain[at, k] += gaps[q, k]
            # A linearised strain need not be one of any body: such a point takes the actual one.
            e = strain[at]
            a, b, d = 1.0 + 2.0 * e[0], 1.0 + 2.0 * e[1], 2.0 * e[3]
            minor = a * b - d * d
            det = minor * (1.0 + 2.0 * e[2]) + 8.0 * e[3] * e[4] * e[5]
            det -= 4.0 * (a * e[4] * e[4] + b * e[5] * e[5])
            if a < 0.04 or minor < 0.02 or det < 0.1 or det > 10.0:
                for k in range(6):
                    strain[at, k] = moved[q, k]
                J, c1, c2, c3, c4, _ = _law(
                    moved[q], table, step, below[at], share[at], cis[q], isos[q]
                )
                for k in range(6):
                    stress[at, k] = isos[q, k] + p * J * cis[q, k]


@free_kernel
def _observe(
    first: int, last: int,
    nodes: IntArray, offsets: IntArray, points: FloatArray, weights: FloatArray, cell_mm: FloatArray,
    table: FloatArray, step: float, below: IntArray, share: FloatArray,
    basis: FloatArray, compliance: FloatArray, bulk: FloatArray,
    u: FloatArray, pressure: FloatArray, adjoint: FloatArray,
    invariant: FloatArray, strain: FloatArray,
    isochoric: FloatArray, volumetric: FloatArray, over_m: FloatArray,
) -> None:  # fmt: skip
    """Write, of points of cells: x = sqrt(I1 - 3), strains, what an adjoint makes of the law.

    isochoric, volumetric : (Q,)
        Work of the stresses of W and of p on the adjoint field, times the point's volume: the
        derivative of the residual times the adjoint over ln W' and over ln κ there.
    over_m : (Q,)
        Change of ln W' over a gap of the table's nodes.
    """
    gradient, F, G = np.empty((27, 3)), np.empty((3, 3)), np.empty((3, 3))
    ci, iso, actual, work = np.empty(6), np.empty(6), np.empty(6), np.empty(6)
    for c in range(first, last):
        turned, y = np.zeros(4), np.zeros(4)
        for q in range(offsets[c], offsets[c + 1]):
            _gradients(points[q], cell_mm, gradient)
            _deform(u, nodes[c], gradient, F, actual)
            G[:] = 0.0
            for a in range(27):
                n = nodes[c, a]
                for i in range(3):
                    for k in range(3):
                        G[i, k] += adjoint[n, i] * gradient[a, k]
            for k in range(6):
                i, j = _PAIRS[k, 0], _PAIRS[k, 1]
                work[k] = 0.0
                for m in range(3):
                    work[k] += 0.5 * (F[m, i] * G[m, j] + F[m, j] * G[m, i])
            J, _, _, _, _, over_m[q] = _law(actual, table, step, below[q], share[q], ci, iso)
            trace = 3.0 + 2.0 * (actual[0] + actual[1] + actual[2])
            invariant[q] = np.sqrt(max(trace * J ** (-2.0 / 3.0) - 3.0, 0.0))
            isochoric[q] = weights[q] * _double(iso, work)
            for r in range(4):
                turned[r] += weights[q] * J * _double(ci, work) * basis[q, r]
            for k in range(6):
                strain[q, k] = actual[k]
        for r in range(4):
            for s in range(4):
                y[r] += compliance[c, r, s] * turned[s]
        for q in range(offsets[c], offsets[c + 1]):
            p, back = 0.0, 0.0
            for r in range(4):
                p += pressure[c, r] * basis[q, r]
                back += y[r] * basis[q, r]
            volumetric[q] = weights[q] * p * back / bulk[q]


# ------------------------------------------------------------------------------------------------
# The surface: places where supports hold and loads push, each in the cell whose material it bounds.


_CORNERS = np.array([[4.0, 1.0, 1.0], [1.0, 4.0, 1.0], [1.0, 1.0, 4.0]]) / 6.0
"""Three points of a triangle, exact for squares: a quadratic displacement times a constant load."""


class FacetPoints(NamedTuple):
    """Quadrature points of facets of the surface.

    Attributes
    ----------
    cell : (n,), shape : (n, 27), gradient : (n, 27, 3)
        The cell of each, and its shape functions there.
    area_mm2 : (n, 3)
        Outward area vector.
    facet : (n,)
    """

    cell: IntArray
    shape: FloatArray
    gradient: FloatArray
    area_mm2: FloatArray
    facet: IntArray


def facet_points(cells: "CutCells", facets: BoolArray) -> FacetPoints:
    """Return the points of the facets that are marked, (F,), of the cells' surface."""
    which = np.flatnonzero(facets)
    corners = cells.surface.triangles[which]
    area = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(area, axis=1)
    which, corners, area, size = (v[size > 0.0] for v in (which, corners, area, size))
    places = np.einsum("pc,fcx->fpx", _CORNERS, corners).reshape(-1, 3)
    cell, local = cells.locate(places, np.repeat(-area / size[:, None], 3, axis=0))
    shape, gradient = shape_functions(local, cells.cell_mm)
    thirds = np.repeat(area / 3.0, 3, axis=0)
    return FacetPoints(cell, shape, gradient, thirds, np.repeat(which, 3))


def spread(cells: "CutCells", at: FacetPoints, forces: FloatArray) -> FloatArray:
    """Return the nodal forces, (N, 3), of forces at points, (n, 3)."""
    each = at.shape[:, :, None] * forces[:, None, :]
    return _summed(cells.nodes[at.cell], each, len(cells.node_mm))


def _summed(nodes: IntArray, values: FloatArray, count: int) -> FloatArray:
    """Return the sums at nodes of values, (..., 3), that belong to nodes, (...)."""
    flat = nodes.ravel()
    columns = values.reshape(-1, 3).T
    return np.stack([np.bincount(flat, column, count) for column in columns], axis=1)


@free_kernel
def _add_products(cell: IntArray, left: FloatArray, right: FloatArray, out: FloatArray) -> None:
    """Add the symmetric part of left[a] right[b, i, j] to row 3 a + i, column 3 b + j."""
    for n in range(cell.size):
        matrix = out[cell[n]]
        for a in range(27):
            for b in range(27):
                for i in range(3):
                    for j in range(3):
                        value = 0.5 * left[n, a] * right[n, b, i, j]
                        matrix[3 * a + i, 3 * b + j] += value
                        matrix[3 * b + j, 3 * a + i] += value


_LEVI_CIVITA = (
    (0, 1, 2, 1.0), (1, 2, 0, 1.0), (2, 0, 1, 1.0), (0, 2, 1, -1.0), (2, 1, 0, -1.0), (1, 0, 2, -1.0)
)  # fmt: skip


class _Held(NamedTuple):
    """A support as springs."""

    points: FacetPoints
    stiffness: FloatArray  # (n,) of each point, N/mm
    axes: FloatArray  # (3,) 1 where held
    target_mm: FloatArray  # (3,)


class _Pushed(NamedTuple):
    """A pressure on facets."""

    points: FacetPoints
    pressure_MPa: float


# ------------------------------------------------------------------------------------------------
# Newton's method over steps of the load.


class LostStability(Exception):
    """No stable equilibrium was found beyond a share of the load.

    Attributes
    ----------
    share
        Of the load, that was reached.
    place_mm
        Where the stiffness failed, or None where the iteration did not settle.
    """

    def __init__(self, share: float, place_mm: FloatArray | None) -> None:
        super().__init__(f"no stable equilibrium beyond {share:.4g} of the load")
        self.share, self.place_mm = share, place_mm


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """A state of a body.

    Attributes
    ----------
    share
        Of the load.
    displacement_mm : (N, 3)
    strain, stress_MPa : (Q, 6)
        Green-Lagrange's and second Piola-Kirchhoff's.
    pressure : (n, 4)
        Coefficients of the cells' pressure bases.
    iterations
        That it took.
    """

    share: float
    displacement_mm: FloatArray
    strain: FloatArray
    stress_MPa: FloatArray
    pressure: FloatArray
    iterations: int = 0


class Sensitivity(NamedTuple):
    """Derivatives of a response, at the quadrature points.

    Attributes
    ----------
    log_stress : (Q,)
        Over ln W' there, Poisson's ratio at rest fixed for `log_bulk`.
    log_bulk : (Q,)
        Over ln κ there.
    over_m : (Q,)
        d ln W' / dm there, at the strain there.
    bulk_over_m : (Q,)
        d ln κ / dm.
    """

    log_stress: FloatArray
    log_bulk: FloatArray
    over_m: FloatArray
    bulk_over_m: FloatArray

    @property
    def coordinate(self) -> FloatArray:
        """Over the coordinate at each point, (Q,)."""
        return self.log_stress * self.over_m + self.log_bulk * self.bulk_over_m


@dataclass(frozen=True, eq=False)
class Body:
    """Cells filled with materials.

    Attributes
    ----------
    coordinate : (Q,)
        Of the mixture at every quadrature point.
    stabiliser_MPa : (n,), optional
        Shear modulus of each cell that scales its stabilisation; by default that of its mixture.
        A design keeps it while it varies the coordinate.
    """

    cells: "CutCells"
    table: MarlowTable
    coordinate: FloatArray
    poisson: float = POISSON
    stabiliser_MPa: FloatArray | None = None

    @cached_property
    def shear_modulus_MPa(self) -> FloatArray:
        """At rest, (Q,)."""
        return self.table.shear_modulus_MPa(self.coordinate)

    @cached_property
    def cell_shear_MPa(self) -> FloatArray:
        """Mean over each cell, (n,)."""
        cells = self.cells
        total = np.add.reduceat(cells.weights_mm3 * self.shear_modulus_MPa, cells.offsets[:-1])
        return np.asarray(total / self.cell_mm3)

    @cached_property
    def cell_mm3(self) -> FloatArray:
        """Volume of material in each cell, (n,)."""
        return np.asarray(np.add.reduceat(self.cells.weights_mm3, self.cells.offsets[:-1]))

    @cached_property
    def pressure_basis(self) -> FloatArray:
        """Orthonormal over each cell's material: 1, and axes along which it spreads, (Q, 4)."""
        cells = self.cells
        starts, counts = cells.offsets[:-1], np.diff(cells.offsets)
        volume = self.cell_mm3
        mean = np.add.reduceat(cells.weights_mm3[:, None] * cells.points, starts) / volume[:, None]
        away = cells.points - np.repeat(mean, counts, axis=0)
        square = cells.weights_mm3[:, None, None] * away[:, :, None] * away[:, None, :]
        spread = np.add.reduceat(square, starts) / volume[:, None, None]
        variance, axes = np.linalg.eigh(spread)
        scale = np.where(variance > _SPREAD**2, 1.0 / np.sqrt(np.maximum(variance, 1e-12)), 0.0)
        turned = axes * scale[:, None, :]
        basis = np.ones((len(cells.points), 4))
        basis[:, 1:] = np.einsum("qi,qij->qj", away, np.repeat(turned, counts, axis=0))
        return basis


_THREADS = 2
_MOST_ITERATIONS = 40
_SMALLEST_STEP = 1.0 / 64.0
_SETTLED = 1e-6
"""Largest last change of a displacement over the largest displacement, and residual over forces:
Newton's next change would be about its square."""

Progress = Callable[[float, int, float], None]
"""Called with the share of the load, the iteration, and the residual over the forces."""


class Mechanics:
    """A body with its supports and loads: equilibria and their derivatives.

    Parameters
    ----------
    analysis
        Of the cells' matrix; another body on the same cells may share it.
    densities : (Q,), optional
        g/cm³ at the quadrature points, for gravity.
    """

    def __init__(
        self,
        body: Body,
        conditions: "Conditions",
        analysis: "Analysis",
        *,
        densities: FloatArray | None = None,
    ) -> None:
        cells = body.cells
        self.body, self.conditions, self.analysis = body, conditions, analysis
        below, share = body.table.places(body.coordinate)
        ratio = 2.0 * (1.0 + body.poisson) / (3.0 * (1.0 - 2.0 * body.poisson))
        self.bulk = ratio * body.shear_modulus_MPa
        self.basis = body.pressure_basis
        starts = cells.offsets[:-1]
        outer = (cells.weights_mm3 / self.bulk)[:, None, None]
        outer = outer * self.basis[:, :, None] * self.basis[:, None, :]
        gram = np.add.reduceat(outer, starts)
        missing = np.einsum("nii->ni", gram) == 0.0
        gram[:, range(4), range(4)] += missing
        self.compliance = np.linalg.inv(gram)
        self.compliance[:, range(4), range(4)] -= missing
        held_by = body.cell_shear_MPa if body.stabiliser_MPa is None else body.stabiliser_MPa
        full_mm3 = float(np.prod(cells.cell_mm))
        cut = body.cell_mm3 < (1.0 - 1e-9) * full_mm3
        self.stabiliser = np.where(cut, _STABILISER * held_by * full_mm3 ** (1.0 / 3.0), 0.0)
        i = np.arange(27)
        linear = np.stack([np.ones(27), i % 3 - 1.0, i // 3 % 3 - 1.0, i // 9 - 1.0], axis=1)
        self.roughness = np.eye(27) - linear @ np.linalg.pinv(linear)
        self.table = (body.table.log_slope_MPa, body.table.step, below, share)
        self.geometry = (
            np.ascontiguousarray(cells.nodes, dtype=np.int32),
            np.ascontiguousarray(cells.offsets, dtype=np.int64),
            np.ascontiguousarray(cells.points),
            np.ascontiguousarray(cells.weights_mm3),
            np.ascontiguousarray(cells.cell_mm),
        )
        self._build_loads(densities)
        self._matrices = np.empty((len(cells.nodes), 81, 81))

    def _build_loads(self, densities: FloatArray | None) -> None:
        cells, conditions = self.body.cells, self.conditions
        self.forces: list[FloatArray] = []
        for force in conditions.forces:
            at = facet_points(cells, force.facets)
            size = np.linalg.norm(at.area_mm2, axis=1)
            share = (size / size.sum())[:, None]
            self.forces.append(spread(cells, at, share * np.array(force.force_N)))
        self.dead = sum(self.forces, np.zeros((len(cells.node_mm), 3)))
        if conditions.gravity is not None and densities is not None:
            self.dead = self.dead + self._weight(densities, np.array(conditions.gravity))
        self.pushed = [
            _Pushed(facet_points(cells, p.facets), p.pressure_MPa) for p in conditions.pressures
        ]
        self.held = []
        wide = float(cells.cell_mm.min())
        for support in conditions.supports:
            at = facet_points(cells, support.facets)
            modulus = 3.0 * self.body.cell_shear_MPa[at.cell]
            if self.body.stabiliser_MPa is not None:
                modulus = 3.0 * self.body.stabiliser_MPa[at.cell]
            stiffness = _PENALTY * modulus / wide * np.linalg.norm(at.area_mm2, axis=1)
            axes = np.array([0.0 if d is None else 1.0 for d in support.displacement_mm])
            target = np.array([d or 0.0 for d in support.displacement_mm])
            self.held.append(_Held(at, stiffness, axes, target))

    def _weight(self, densities: FloatArray, direction: FloatArray) -> FloatArray:
        """Return the nodal forces of gravity, (N, 3)."""
        cells = self.body.cells
        total = np.zeros((len(cells.node_mm), 3))
        share = cells.weights_mm3 * densities * 1e-6 * 9.80665  # g/cm³ mm³ = 1e-6 kg
        for c in range(0, len(cells.nodes), 512):  # shape functions of some cells at a time
            rows = slice(cells.offsets[c], cells.offsets[min(c + 512, len(cells.nodes))])
            shape = shape_functions(cells.points[rows], cells.cell_mm)[0] * share[rows, None]
            which = np.repeat(np.arange(len(cells.nodes)), np.diff(cells.offsets))[rows]
            np.add.at(total, cells.nodes[which], shape[:, :, None] * direction)
        return total

    # -------------------------------------------------------------------------------------------

    def at_rest(self) -> Equilibrium:
        """Return the state without load."""
        cells = self.body.cells
        count = len(cells.points)
        return Equilibrium(
            0.0,
            np.zeros((len(cells.node_mm), 3)),
            np.zeros((count, 6)),
            np.zeros((count, 6)),
            np.zeros((len(cells.nodes), 4)),
        )

    def _shares(self) -> Iterator[tuple[int, int]]:
        """Divide the cells into runs of about equal work."""
        offsets = self.body.cells.offsets
        cuts = np.searchsorted(offsets, np.linspace(0, offsets[-1], 4 * _THREADS + 1))
        cuts[-1] = len(offsets) - 1
        for first, last in zip(cuts[:-1].tolist(), cuts[1:].tolist(), strict=True):
            if last > first:
                yield first, last

    def _run(self, function: Callable[..., None], *arguments: Any) -> None:
        with ThreadPoolExecutor(_THREADS) as pool:
            for job in [pool.submit(function, a, b, *arguments) for a, b in self._shares()]:
                job.result()

    def _assembled(self, state: Equilibrium, share: float) -> tuple[FloatArray, float]:
        """Fill the matrices; return the residual (N, 3), loads minus forces, and their size."""
        cells = self.body.cells
        u = state.displacement_mm
        forces = np.empty((len(cells.nodes), 81))
        self._run(
            _assemble, *self.geometry, *self.table, self.basis, self.compliance, self.stabiliser,
            self.roughness, u, state.strain, state.stress_MPa, state.pressure, self._matrices,
            forces,
        )  # fmt: skip
        inner = _summed(cells.nodes, forces, len(cells.node_mm))
        size = float(np.sqrt(np.sum(forces * forces)))
        outer = share * self.dead
        for pushed in self.pushed:
            outer = outer + self._push(pushed, share, u, tangent=True)
        for held in self.held:
            outer = outer + self._hold(held, share, u, tangent=True)
        return outer - inner, max(size, float(np.linalg.norm(share * self.dead)))

    def _push(self, pushed: _Pushed, share: float, u: FloatArray, *, tangent: bool) -> FloatArray:
        """Return the nodal forces of a pressure; add the symmetric part of its tangent."""
        cells, at = self.body.cells, pushed.points
        p = share * pushed.pressure_MPa
        F = np.eye(3) + np.einsum("nai,nak->nik", u[cells.nodes[at.cell]], at.gradient)
        cofactor = np.empty_like(F)
        for i in range(3):
            cofactor[:, i] = np.cross(F[:, (i + 1) % 3], F[:, (i + 2) % 3])
        push = -p * np.einsum("nik,nk->ni", cofactor, at.area_mm2)
        if tangent:
            # d cof F / dF, with ε_ijk ε_IJK F_kK A_I = ε_ijk (A × F_k)_J.
            crossed = np.cross(at.area_mm2[:, None, :], F)  # (n, k, J): A x F_k, sign below
            turned = np.zeros((len(at.cell), 3, 3, 3))
            for i, j, k, sign in _LEVI_CIVITA:
                turned[:, i, j] -= sign * crossed[:, k]
            slope = p * np.einsum("nijJ,nbJ->nbij", turned, at.gradient)
            _add_products(at.cell, at.shape, slope, self._matrices)
        return spread(cells, at, push)

    def push(self, pushed: _Pushed, share: float, u: FloatArray) -> FloatArray:
        """Return the whole force of a pressure on the body, (3,)."""
        return self._push(pushed, share, u, tangent=False).sum(axis=0)

    def _hold(self, held: _Held, share: float, u: FloatArray, *, tangent: bool) -> FloatArray:
        """Return the nodal forces of a support; add its stiffness."""
        cells, at = self.body.cells, held.points
        if tangent:
            springs = (held.stiffness[:, None] * at.shape)[:, :, None, None] * np.diag(held.axes)
            _add_products(at.cell, at.shape, springs, self._matrices)
        return spread(cells, at, self._reaction(held, share, u))

    def _reaction(self, held: _Held, share: float, u: FloatArray) -> FloatArray:
        """Return the force of a support on the body at each of its points, (n, 3)."""
        place = np.einsum(
            "na,nai->ni", held.points.shape, u[self.body.cells.nodes[held.points.cell]]
        )
        return held.stiffness[:, None] * held.axes * (share * held.target_mm - place)

    # -------------------------------------------------------------------------------------------

    def settle(
        self, state: Equilibrium, share: float, progress: "Progress | None" = None
    ) -> "tuple[Equilibrium, Factor]":
        """Return the equilibrium at a share of the load, from a state nearby, and its factor.

        Raises
        ------
        LostStability
            The stiffness is not positive on the way, or the iteration does not settle.
        """
        from planner.simulation.sparse_cholesky import NotPositiveDefinite, factor

        cells = self.body.cells
        u, strain = state.displacement_mm.copy(), state.strain.copy()
        stress, pressure = state.stress_MPa.copy(), state.pressure.copy()
        done = 0.0
        for iteration in range(1, _MOST_ITERATIONS + 1):
            here = Equilibrium(share, u, strain, stress, pressure, iteration)
            residual, size = self._assembled(here, share)
            error = float(np.linalg.norm(residual)) / max(size, 1e-300)
            if progress is not None:
                progress(share, iteration, error)
            try:
                factored = factor(self.analysis, self._matrices)
            except NotPositiveDefinite as failed:
                raise LostStability(state.share, cells.node_mm[failed.node]) from failed
            change = factored.solve(residual.ravel()).reshape(-1, 3)
            if not np.isfinite(change).all():
                raise LostStability(state.share, None)
            self._run(
                _advance, *self.geometry, *self.table, self.basis, self.compliance, u, change,
                strain, stress, pressure,
            )  # fmt: skip
            u = u + change
            largest = float(np.abs(u).max())
            moved, before = float(np.abs(change).max()), done
            done = moved
            if moved <= _SETTLED * largest and (error <= _SETTLED or moved <= 1e-9 * largest):
                return Equilibrium(share, u, strain, stress, pressure, iteration), factored
            if iteration > 12 and moved > before > 0.1 * largest:
                break  # it wanders
        raise LostStability(state.share, None)

    def follow(
        self, shares: Sequence[float], progress: "Progress | None" = None
    ) -> "Iterator[tuple[Equilibrium, Factor]]":
        """Yield the equilibria at rising shares of the load; steps are halved where they must be.

        Raises
        ------
        LostStability
            After the last stable state was yielded.
        """
        state = self.at_rest()
        for share in shares:
            step = share - state.share
            while True:
                target = min(share, state.share + step)
                if share - target < 1e-9:
                    target = share
                try:
                    state, factored = self.settle(state, target, progress)
                except LostStability:
                    step *= 0.5
                    if step < _SMALLEST_STEP:
                        raise
                    continue
                if target == share:
                    break
            yield state, factored

    # -------------------------------------------------------------------------------------------

    def mean(self, points: FacetPoints, u: FloatArray) -> FloatArray:
        """Return the mean displacement of facets by area, (3,)."""
        size = np.linalg.norm(points.area_mm2, axis=1)
        place = np.einsum("na,nai->ni", points.shape, u[self.body.cells.nodes[points.cell]])
        return np.asarray(size @ place / size.sum())

    def mean_weights(self, points: FacetPoints, direction: FloatArray) -> FloatArray:
        """Return the nodal weights, (N, 3), of the mean displacement along a direction."""
        size = np.linalg.norm(points.area_mm2, axis=1)
        return spread(self.body.cells, points, (size / size.sum())[:, None] * direction)

    def reactions(self, state: Equilibrium) -> list[FloatArray]:
        """Return the force of each support on the body, (3,) each."""
        return [
            self._reaction(h, state.share, state.displacement_mm).sum(axis=0) for h in self.held
        ]

    def reaction_weights(self, support: int, direction: FloatArray) -> FloatArray:
        """Return the derivative of a support's force along a direction over displacements."""
        held = self.held[support]
        pull = -held.stiffness[:, None] * held.axes * direction
        return spread(self.body.cells, held.points, pull)

    def observe(self, state: Equilibrium, adjoint: FloatArray | None = None) -> "Observed":
        """Return invariants and strains at the points, and the work on an adjoint field."""
        cells = self.body.cells
        count = len(cells.points)
        x, iso, vol, over_m = (np.empty(count) for _ in range(4))
        strain = np.empty((count, 6))
        field = np.zeros_like(state.displacement_mm) if adjoint is None else adjoint
        self._run(
            _observe, *self.geometry, *self.table, self.basis, self.compliance, self.bulk,
            state.displacement_mm, state.pressure, field, x, strain, iso, vol, over_m,
        )  # fmt: skip
        return Observed(x, strain, iso, vol, over_m)

    def sensitivity(
        self, state: Equilibrium, factored: "Factor", weights: FloatArray
    ) -> Sensitivity:
        """Return the derivatives of the response weights : displacements over the materials.

        The load is held. `factored` belongs to the state.
        """
        adjoint = factored.solve(weights.ravel()).reshape(-1, 3)
        seen = self.observe(state, adjoint)
        table, below = self.body.table, self.table[2]
        above = np.minimum(below + 1, len(table.coordinate) - 1)
        gap = np.maximum(table.coordinate[above] - table.coordinate[below], 1e-12)
        rest = table.log_slope_MPa[:, 0, 0]
        return Sensitivity(
            -seen.isochoric, -seen.volumetric, seen.over_m / gap, (rest[above] - rest[below]) / gap
        )

    def energy_mJ(self, state: Equilibrium) -> float:
        """Return the energy stored in the material, N mm."""
        seen = self.observe(state)
        table = self.body.table
        _, _, below, share = self.table
        above = np.minimum(below + 1, len(table.coordinate) - 1)
        place = np.minimum(seen.x / table.step, table.energy_MPa.shape[1] - 1.001)
        i = place.astype(np.int64)
        t = place - i
        # W goes as x²: between two values its square root is the straighter.
        energy = [
            np.square(
                (1.0 - t) * np.sqrt(table.energy_MPa[k, i])
                + t * np.sqrt(table.energy_MPa[k, i + 1])
            )
            for k in (below, above)
        ]
        isochoric = (1.0 - share) * energy[0] + share * energy[1]
        cells = self.body.cells
        pressure = np.repeat(state.pressure, np.diff(cells.offsets), axis=0)
        p = np.einsum("qr,qr->q", pressure, self.basis)
        return float(cells.weights_mm3 @ (isochoric + p * p / (2.0 * self.bulk)))


class Observed(NamedTuple):
    """What `Mechanics.observe` finds at the quadrature points.

    Attributes
    ----------
    x : (Q,)
        sqrt(I1 - 3).
    strain : (Q, 6)
        Green-Lagrange's.
    isochoric, volumetric : (Q,)
        Work of both stresses on the adjoint field, N mm.
    over_m : (Q,)
        Change of ln W' over a gap of the table's nodes.
    """

    x: FloatArray
    strain: FloatArray
    isochoric: FloatArray
    volumetric: FloatArray
    over_m: FloatArray
