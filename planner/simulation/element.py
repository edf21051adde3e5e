"""The solid's element: Q2/P1 hexahedra, cut or whole, in large strains."""

from typing import Any

import numpy as np

from planner.numerics import FloatArray, inner_kernel, kernel

__all__ = ["LOCAL", "SIX", "advance", "assemble", "observe", "shape_functions"]


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
# In full cells a little of κ answers to the volume at each point (`solid._AT_POINTS`): with none,
# they fold within themselves where they are compressed by 30 %.
#
# The unknowns of Newton's method are displacements, pressures and, at every quadrature point,
# strain E and stress S as variables of their own. They are eliminated too, and the matrix has the
# size and the residual of the displacements' own, but it is taken where the linearised strains are,
# and with stresses that satisfy the linearised law: bending then takes 4 to 6 iterations instead
# of hundreds. D. Magisano, L. Leonetti, G. Garcea, How to improve efficiency and robustness of the
# Newton method in geometrically non-linear structural problem discretized via displacement-based
# finite elements, Comput. Methods Appl. Mech. Eng. 313 (2017) 986, doi 10.1016/j.cma.2016.10.023.
#
# Symmetric tensors are rows of six: 11, 22, 33, 12, 23, 13.


LOCAL = np.stack(np.unravel_index(np.arange(27), (3, 3, 3))[::-1], axis=1)
"""Place of each node of a cell along x, y, z: 0, 1 or 2; x fastest."""

_PAIRS = np.array([(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)])
SIX = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2]])
"""Which of a symmetric tensor's six components stands where in its matrix."""


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
        outer = np.einsum("nk,nj,ni->nkji", along_z, along_y, along_x)
        return np.asarray(outer.reshape(len(local), 27))

    gradient = np.stack([product(dx, y, z), product(x, dy, z), product(x, y, dz)], axis=2)
    return product(x, y, z), gradient


@inner_kernel
def _gradients(local: Any, cell_mm: Any, out: Any) -> None:
    """Write the gradients per mm of the 27 shape functions at a place, (3, 27)."""
    value, slope = np.empty((3, 3)), np.empty((3, 3))
    for axis in range(3):
        s = local[axis]
        value[axis, 0], value[axis, 1] = 0.5 * s * (s - 1.0), 1.0 - s * s
        value[axis, 2] = 0.5 * s * (s + 1.0)
        slope[axis, 0], slope[axis, 1] = (s - 0.5), -2.0 * s
        slope[axis, 2] = s + 0.5
        for node in range(3):
            slope[axis, node] *= 2.0 / cell_mm[axis]
    for k in range(3):
        for j in range(3):
            for i in range(3):
                a = i + 3 * j + 9 * k
                out[0, a] = slope[0, i] * value[1, j] * value[2, k]
                out[1, a] = value[0, i] * slope[1, j] * value[2, k]
                out[2, a] = value[0, i] * value[1, j] * slope[2, k]


@inner_kernel
def law_at(table: Any, step: Any, below: Any, share: Any, x: Any) -> Any:
    """Return ln W' of `MarlowTable`, its derivative over x, and its step from node to node, at x.

    The last, over the gap of the nodes, is the derivative over the coordinate.
    """
    i = min(int(x / step), table.shape[1] - 2)
    t = x / step - i
    above = min(below + 1, table.shape[0] - 1)
    if t > 1.0:  # beyond the table W' stays
        last = table.shape[1] - 1
        a, b = table[below, last, 0], table[above, last, 0]
        return a + share * (b - a), 0.0, b - a
    rest = 1.0 - t
    h00, h01 = (1.0 + 2.0 * t) * rest * rest, t * t * (3.0 - 2.0 * t)
    h10, h11 = step * t * rest * rest, -step * t * t * rest
    d01, d10, d11 = 6.0 * t * rest / step, rest * (1.0 - 3.0 * t), t * (3.0 * t - 2.0)
    a0, a1 = table[below, i, 0], table[below, i + 1, 0]
    p0, p1 = table[below, i, 1], table[below, i + 1, 1]
    b0, b1 = table[above, i, 0], table[above, i + 1, 0]
    q0, q1 = table[above, i, 1], table[above, i + 1, 1]
    a = h00 * a0 + h01 * a1 + h10 * p0 + h11 * p1
    b = h00 * b0 + h01 * b1 + h10 * q0 + h11 * q1
    da = d01 * (a1 - a0) + d10 * p0 + d11 * p1
    db = d01 * (b1 - b0) + d10 * q0 + d11 * q1
    return a + share * (b - a), da + share * (db - da), b - a


@inner_kernel
def _law(strain: Any, law: Any, at: Any, p: Any, ci: Any, stress: Any, c: Any) -> Any:
    """Write C⁻¹, the stress without p's and the tangent c; return J, J - 1 and d ln W'/dm.

    At a point and its cell's pressure. 4 d²(W + p J) / dC² = c[0] I⊗I + c[1] (I⊗C⁻¹ + C⁻¹⊗I) +
    c[2] C⁻¹⊗C⁻¹ + c[3] K, K D = C⁻¹ D C⁻¹; the last returned is the change of ln W' over a gap
    of the table's nodes.
    """
    table, step, below, share, bulk = law
    xx, yy, zz = 1.0 + 2.0 * strain[0], 1.0 + 2.0 * strain[1], 1.0 + 2.0 * strain[2]
    d, e, f = 2.0 * strain[3], 2.0 * strain[4], 2.0 * strain[5]
    # J - 1 and 1 - C⁻¹ by what C has over 1: differences would leave rounding times the moduli.
    s, t, u = 2.0 * strain[0], 2.0 * strain[1], 2.0 * strain[2]
    more = s + t + u + s * t + t * u + s * u - d * d - e * e - f * f
    more += s * (t * u - e * e) - d * (d * u - e * f) + f * (d * e - t * f)
    det = 1.0 + more
    ci[0], ci[1], ci[2] = (yy * zz - e * e) / det, (xx * zz - f * f) / det, (xx * yy - d * d) / det
    ci[3], ci[4], ci[5] = (e * f - d * zz) / det, (d * f - xx * e) / det, (d * e - yy * f) / det
    J = np.sqrt(det)
    growth = more / (1.0 + J)
    trace = xx + yy + zz
    thin = det ** (-1.0 / 3.0)
    # A rounding at rest may fall below 3; the law's slope over I1 has 1 / x in it.
    x = np.sqrt(max(thin * trace - 3.0, 1e-20))
    log, over_x, over_m = law_at(table, step, below[at], share[at], x)
    first = np.exp(log)
    second = first * over_x / (2.0 * x)
    stress[0] = (more - (t + u + t * u - e * e)) / det
    stress[1] = (more - (s + u + s * u - f * f)) / det
    stress[2] = (more - (s + t + s * t - d * d)) / det
    stress[3], stress[4], stress[5] = -ci[3], -ci[4], -ci[5]
    own = bulk[at] * growth
    for k in range(6):
        stress[k] = 2.0 * first * thin * (stress[k] - (s + t + u) / 3.0 * ci[k]) + own * J * ci[k]
    p += own
    c[0] = 4.0 * second * thin * thin
    c[1] = -trace / 3.0 * c[0] - 4.0 / 3.0 * first * thin
    c[2] = trace * trace / 9.0 * c[0] + 4.0 / 9.0 * trace * first * thin + p * J
    c[2] += bulk[at] * det
    c[3] = 4.0 / 3.0 * trace * first * thin - 2.0 * p * J
    return J, growth, over_m


@inner_kernel
def _slopes(field: Any, nodes: Any, gradient: Any, out: Any) -> None:
    """Write the gradient of a field (N, 3) at a point, (3, 3)."""
    out[:] = 0.0
    for a in range(27):
        n = nodes[a]
        for i in range(3):
            for k in range(3):
                out[i, k] += field[n, i] * gradient[k, a]


@inner_kernel
def _strained(F: Any, slopes: Any, k: Any) -> Any:
    """Return component k of the strain's first change along a field."""
    i, j = _PAIRS[k, 0], _PAIRS[k, 1]
    change = 0.0
    for m in range(3):
        change += 0.5 * (F[m, i] * slopes[m, j] + F[m, j] * slopes[m, i])
    return change


@inner_kernel
def _deform(u: Any, nodes: Any, gradient: Any, F: Any, strain: Any) -> None:
    """Write F = I + du/dX and the strain (Fᵀ F - I) / 2 of displacements at a point."""
    _slopes(u, nodes, gradient, F)
    for k in range(6):
        i, j = _PAIRS[k, 0], _PAIRS[k, 1]
        dot = F[0, i] * F[0, j] + F[1, i] * F[1, j] + F[2, i] * F[2, j]
        strain[k] = 0.5 * (F[i, j] + F[j, i] + dot)
    for i in range(3):
        F[i, i] += 1.0


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
                inner += ci[SIX[i, m]] * d[SIX[m, n]] * ci[SIX[n, j]]
        unit = 1.0 if k < 3 else 0.0
        out[k] = unit * (c[0] * trace + c[1] * dot) + ci[k] * (c[1] * trace + c[2] * dot)
        out[k] += c[3] * inner


@kernel
def assemble(
    first: int, last: int, cells: Any, law: Any, basis: FloatArray, compliance: FloatArray,
    stabiliser: FloatArray, roughness: FloatArray,
    u: FloatArray, strain: FloatArray, stress: FloatArray, pressure: FloatArray,
    matrices: FloatArray, forces: FloatArray,
) -> None:  # fmt: skip
    """Write the matrices, as `sparse_cholesky.factor` has them, and forces (n, 81) of cells.

    compliance : (n, 4, 4)
        Inverse of ∫ ψψ / κ of the pressures' basis ψ, (Q, 4).
    stabiliser : (n, 2), roughness : (2, 27, 27)
        Stiffness against what is not linear, and against slopes.
    strain, stress : (Q, 6), pressure : (n, 4)
        Where Newton's method is.
    """
    nodes, offsets, points, weights, cell_mm, most = cells
    gradient, right = np.empty((most, 3, 27)), np.empty((most, 3, 6, 27))
    left, flat = gradient.reshape(3 * most, 27), right.reshape(3 * most, 162)
    Fs, cis, isos = np.empty((most, 3, 3)), np.empty((most, 6)), np.empty((most, 6))
    gaps, coefficients, Js = np.empty((most, 6)), np.empty((most, 4)), np.empty(most)
    volumetric = np.empty((3, 4, 27))
    H, B, A = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    along, full, actual, swell = np.empty(3), np.empty(6), np.empty(6), np.empty(27)
    for c in range(first, last):
        begin, count = offsets[c], offsets[c + 1] - offsets[c]
        right_side = np.zeros(4)
        for q in range(count):
            at = begin + q
            _gradients(points[at], cell_mm, gradient[q])
            _deform(u, nodes[c], gradient[q], Fs[q], actual)
            for k in range(6):
                gaps[q, k] = actual[k] - strain[at, k]
            p = np.dot(pressure[c], basis[at])
            Js[q], growth, _ = _law(strain[at], law, at, p, cis[q], isos[q], coefficients[q])
            swelling = growth + Js[q] * _double(cis[q], gaps[q])
            for r in range(4):
                right_side[r] += weights[at] * swelling * basis[at, r]
        new = np.dot(compliance[c], right_side)
        volumetric[:] = 0.0
        force = forces[c]
        force[:] = 0.0
        for q in range(count):
            at = begin + q
            w, F, ci, co, J = weights[at], Fs[q], cis[q], coefficients[q], Js[q]
            gx, gy, gz = gradient[q, 0], gradient[q, 1], gradient[q, 2]
            p = np.dot(new, basis[at])
            _tangent_times(ci, co, gaps[q], full)
            for k in range(6):
                full[k] += isos[q, k] + p * J * ci[k]
            for i in range(3):
                for k in range(3):
                    H[i, k] = F[i, 0] * ci[SIX[0, k]] + F[i, 1] * ci[SIX[1, k]]
                    H[i, k] += F[i, 2] * ci[SIX[2, k]]
            for i in range(3):
                for j in range(3):
                    B[i, j] = H[i, 0] * F[j, 0] + H[i, 1] * F[j, 1] + H[i, 2] * F[j, 2]
                    A[i, j] = F[i, 0] * full[SIX[0, j]] + F[i, 1] * full[SIX[1, j]]
                    A[i, j] = w * (A[i, j] + F[i, 2] * full[SIX[2, j]])
            for i in range(3):
                for a in range(27):
                    force[3 * a + i] += A[i, 0] * gx[a] + A[i, 1] * gy[a] + A[i, 2] * gz[a]
                    swell[a] = H[i, 0] * gx[a] + H[i, 1] * gy[a] + H[i, 2] * gz[a]
                for r in range(4):
                    value = w * J * basis[at, r]
                    for a in range(27):
                        volumetric[i, r, a] += value * swell[a]
            for row in range(3):
                for k in range(6):
                    i, j = _PAIRS[k, 0], _PAIRS[k, 1]
                    for m in range(3):
                        value = co[0] * F[i, row] * F[j, m] + co[2] * H[i, row] * H[j, m]
                        value += co[1] * (F[i, row] * H[j, m] + H[i, row] * F[j, m])
                        value += 0.5 * co[3] * (B[i, j] * ci[SIX[row, m]] + H[i, m] * H[j, row])
                        if i == j:
                            value += stress[at, SIX[row, m]]
                        along[m] = w * value
                    to, x, y, z = right[q, row, k], along[0], along[1], along[2]
                    for b in range(27):
                        to[b] = x * gx[b] + y * gy[b] + z * gz[b]
        matrix = matrices[c]
        np.dot(left[: 3 * count].T, flat[: 3 * count], matrix.reshape(27, 162))
        for a in range(27):
            for k in range(6):
                i, j = _PAIRS[k, 0], _PAIRS[k, 1]
                to = matrix[a, k]
                for r in range(4):
                    value = 0.0
                    for s in range(4):
                        value += compliance[c, r, s] * volumetric[i, s, a]
                    for b in range(27):
                        to[b] += value * volumetric[j, r, b]
        if stabiliser[c, 0] > 0.0:
            for a in range(27):
                for b in range(27):
                    hold = stabiliser[c, 0] * roughness[0, a, b]
                    hold += stabiliser[c, 1] * roughness[1, a, b]
                    for i in range(3):
                        matrix[a, i, b] += hold
                        force[3 * a + i] += hold * u[nodes[c, b], i]


@kernel
def advance(
    first: int, last: int, cells: Any, law: Any, basis: FloatArray, compliance: FloatArray,
    u: FloatArray, change: FloatArray,
    strain: FloatArray, stress: FloatArray, pressure: FloatArray,
) -> None:  # fmt: skip
    """Move strains, stresses and pressures of cells along with a change of the displacements."""
    nodes, offsets, points, weights, cell_mm, most = cells
    gradient, F, G = np.empty((3, 27)), np.empty((3, 3)), np.empty((3, 3))
    cis, isos, gaps = np.empty((most, 6)), np.empty((most, 6)), np.empty((most, 6))
    coefficients, Js, actual, full = np.empty((most, 4)), np.empty(most), np.empty(6), np.empty(6)
    moved = np.empty((most, 6))
    for c in range(first, last):
        begin, count = offsets[c], offsets[c + 1] - offsets[c]
        right_side = np.zeros(4)
        for q in range(count):
            at = begin + q
            _gradients(points[at], cell_mm, gradient)
            _deform(u, nodes[c], gradient, F, actual)
            _slopes(change, nodes[c], gradient, G)
            for k in range(6):
                i, j = _PAIRS[k, 0], _PAIRS[k, 1]
                square = 0.0
                for m in range(3):
                    square += 0.5 * G[m, i] * G[m, j]
                linear = _strained(F, G, k)
                gaps[q, k] = actual[k] + linear - strain[at, k]
                moved[q, k] = actual[k] + linear + square
            p = np.dot(pressure[c], basis[at])
            Js[q], growth, _ = _law(strain[at], law, at, p, cis[q], isos[q], coefficients[q])
            swelling = growth + Js[q] * _double(cis[q], gaps[q])
            for r in range(4):
                right_side[r] += weights[at] * swelling * basis[at, r]
        np.dot(compliance[c], right_side, pressure[c])
        for q in range(count):
            at = begin + q
            p = np.dot(pressure[c], basis[at])
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
                J, _, _ = _law(moved[q], law, at, p, cis[q], isos[q], full)
                for k in range(6):
                    strain[at, k] = moved[q, k]
                    stress[at, k] = isos[q, k] + p * J * cis[q, k]


@kernel
def observe(
    first: int, last: int, cells: Any, law: Any, basis: FloatArray, compliance: FloatArray,
    bulk: FloatArray, u: FloatArray, pressure: FloatArray, adjoint: FloatArray,
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
    nodes, offsets, points, weights, cell_mm, _ = cells
    gradient, F, G = np.empty((3, 27)), np.empty((3, 3)), np.empty((3, 3))
    ci, iso, work, tangent = np.empty(6), np.empty(6), np.empty(6), np.empty(4)
    for c in range(first, last):
        turned = np.zeros(4)
        for q in range(offsets[c], offsets[c + 1]):
            actual = strain[q]
            _gradients(points[q], cell_mm, gradient)
            _deform(u, nodes[c], gradient, F, actual)
            _slopes(adjoint, nodes[c], gradient, G)
            for k in range(6):
                work[k] = _strained(F, G, k)
            J, growth, over_m[q] = _law(actual, law, q, 0.0, ci, iso, tangent)
            trace = 3.0 + 2.0 * (actual[0] + actual[1] + actual[2])
            invariant[q] = np.sqrt(max(trace * J ** (-2.0 / 3.0) - 3.0, 0.0))
            volumetric[q] = weights[q] * law[4][q] * growth * J * _double(ci, work)
            isochoric[q] = weights[q] * _double(iso, work) - volumetric[q]
            for r in range(4):
                turned[r] += weights[q] * J * _double(ci, work) * basis[q, r]
        y = np.dot(compliance[c], turned)
        for q in range(offsets[c], offsets[c + 1]):
            p, back = np.dot(pressure[c], basis[q]), np.dot(y, basis[q])
            volumetric[q] += weights[q] * p * back / bulk[q]
