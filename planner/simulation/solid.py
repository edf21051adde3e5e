"""Equilibrium of a soft solid on cut cells: large rotations, nearly incompressible, graded."""

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from planner.materials.marlow import POISSON, MarlowTable
from planner.numerics import BoolArray, FloatArray, IntArray
from planner.simulation.cut_cells import CutCells, carrier
from planner.simulation.element import LOCAL, SIX, advance, assemble, observe, shape_functions
from planner.simulation.loads import Conditions, Pressure, couple
from planner.simulation.sparse_cholesky import Analysis, Factor, NotPositiveDefinite, factor, reused

__all__ = ["Body", "Equilibrium", "LostStabilityError", "Mechanics", "spread"]


_PENALTY = 1e6
"""Stiffness of a support over that of a cell of the material held: what it yields is 1e-6 of a
cell's own deformation, and a double still holds ten digits of the rest."""

_STABILISER = 1e-5
"""Stiffness of cut cells against fields that are not linear, over that of a full cell.

A linear field costs nothing, whatever the cut. A turned cantilever of one and a half cells'
thickness is less than 1e-3 softer at 1e-6, and 3e-3 stiffer at 1e-3 (tests). A wall of a twelfth
of a cell is 36 % stiffer than a beam at 1e-4, 10 % at 1e-5, and 5 % at 1e-6."""

_SLOPE, _LINE = 1e-3, 1e-6
"""Of it, against fields that are linear, where a piece has its points in a line or in a plane (the
least variance over half a cell): it does not resist all of them."""

_SPREAD = 0.03
"""A pressure varies along an axis of a piece if its material spreads that much along it, as a
standard deviation over half a cell (0.577 in a full one). Columns hold together what spreads by
0.035 and more: without its pressure across, a wall would bend 5 to 30 times too far."""

_AT_POINTS = 0.25
"""Bulk modulus of full cells that answers to the volume at each point, not to its linear part in
the cell, over the shear modulus. Numerical: without, a block slid together loses stability at 26 to
32 %; from 0.25 on at 43 to 50 %, as cells do that are compressible at every point. In cut cells as
well it would make the finger, whose walls are thinner than its cells, 1.5 % stiffer."""

# ------------------------------------------------------------------------------------------------
# The surface: places where supports hold and loads push, each in the cell whose material it bounds.


_CORNERS = np.array([[4.0, 1.0, 1.0], [1.0, 4.0, 1.0], [1.0, 1.0, 4.0]]) / 6.0
"""Three points of a triangle, exact for squares: a quadratic displacement times a constant load."""


class _FacetPoints(NamedTuple):
    """Quadrature points of facets of the surface.

    Attributes
    ----------
    starts : (cells + 1,)
        Points of one cell lie together: where each cell's begin.
    cell : (n,), shape : (n, 27), gradient : (n, 27, 3)
        The cell of each, and its shape functions there.
    area_mm2, size_mm2 : (n, 3), (n,)
        Outward area vector, and its length.
    """

    starts: IntArray
    cell: IntArray
    shape: FloatArray
    gradient: FloatArray
    area_mm2: FloatArray
    size_mm2: FloatArray

    def by_cell(self) -> Iterator[tuple[int, slice]]:
        """Yield each cell, and which points are in it."""
        for a, b in itertools.pairwise(self.starts.tolist()):
            yield int(self.cell[a]), slice(a, b)


_CLOSED = 1e-6
"""Area vectors of a closed surface add up to less of its area. Numerical: single precision's."""


def _facet_points(cells: CutCells, facets: BoolArray) -> _FacetPoints:
    """Return the points of the facets that are marked, (F,), of the cells' surface."""
    corners, area = cells.surface.triangles[facets], cells.surface.area_vectors_mm2[facets]
    size = np.linalg.norm(area, axis=1)
    corners, area, size = (v[size > 0.0] for v in (corners, area, size))
    places = np.einsum("pc,fcx->fpx", _CORNERS, corners).reshape(-1, 3)
    thirds = np.repeat(area / 3.0, 3, axis=0)
    inward, lattice = -thirds / np.repeat(size / 3.0, 3)[:, None], (cells.origin_mm, cells.cell_mm)
    cell, local, _ = cells.material.locate(*lattice, cells.index, places, inward)
    order = np.argsort(cell, kind="stable")
    cell = cell[order]
    shape, gradient = shape_functions(local[order], cells.cell_mm)
    starts = np.append(np.flatnonzero(np.diff(cell, prepend=-1)), len(cell))
    out = thirds[order]
    return _FacetPoints(starts, cell, shape, gradient, out, np.linalg.norm(out, axis=1))


def spread(cells: CutCells, at: _FacetPoints, forces: FloatArray) -> FloatArray:
    """Return the nodal forces, (N, 3), of forces at points, (n, 3)."""
    each = at.shape[:, :, None] * forces[:, None, :]
    return _summed(cells.nodes[at.cell], each, len(cells.node_mm))


def _summed(nodes: IntArray, values: FloatArray, count: int) -> FloatArray:
    """Return the sums at nodes of values, (..., 3), that belong to nodes, (...)."""
    flat = nodes.ravel()
    return np.stack([np.bincount(flat, along, count) for along in values.reshape(-1, 3).T], axis=1)


_LEVI_CIVITA = np.cross(np.eye(3)[:, None], np.eye(3))
"""ε_ijk, by i, j, k: the cross product of axes i and j along k."""


class _Held(NamedTuple):
    """A support as springs."""

    points: _FacetPoints
    stiffness: FloatArray  # (n,) of each point, N/mm
    springs: list[FloatArray]  # (27, 27) of each cell, alike along each axis
    axes: FloatArray  # (3,) 1 where held
    target_mm: FloatArray  # (3,)


# ------------------------------------------------------------------------------------------------
# Interfaces.


# Cells of different materials are held together by springs, so that displacements may kink where
# they meet (A. and P. Hansbo, An unfitted finite element method, based on Nitsche's method, for
# elliptic interface problems, Comput. Methods Appl. Mech. Eng. 191 (2002) 5537). What opens evenly
# or linearly over an interface is held stiffly. What is left, curved over a cell, is held as softly
# as accuracy allows: held stiffly at all places, an interface aslant in its cells locks.

_STIFF, _SOFT = 1e5, 20.0
"""Times the softer material's Young's modulus over a cell's edge. Numerical: layers aslant at
contrast 950 are 4 % too stiff with 1e5 throughout; bonded ones, 0.3 of a cell thick, are 9 % too
soft with 1 instead of 20, and 6 % with 1e3 throughout."""

_FLAT = 0.05
"""Of a cell: an interface that spreads less along an axis has no slope along it."""


def _springs(cells: CutCells, modulus_MPa: FloatArray) -> FloatArray:
    """Return the springs between the nodes of cells that meet, (m, 54, 54), N/mm."""
    met, stiff = cells.interface, modulus_MPa / float(cells.cell_mm.mean())
    shapes = [shape_functions(met.local[:, s], cells.cell_mm)[0] for s in (0, 1)]
    roots = np.sqrt(met.area_mm2)[:, None]
    jumps = roots * np.concatenate([shapes[0], -shapes[1]], axis=1)
    out = np.empty((len(met.cells), 54, 54))
    for k, (a, b) in enumerate(itertools.pairwise(met.starts.tolist())):
        root, jump = roots[a:b], jumps[a:b]
        slope = met.local[a:b, 0] - met.local[a:b, 0].mean(axis=0)
        linear, size, _ = np.linalg.svd(root * np.column_stack([np.ones(b - a), slope]), False)
        even = linear[:, : min(np.count_nonzero(size > _FLAT * size[0]), 3)].T @ jump
        out[k] = stiff[k] * (_SOFT * jump.T @ jump + _STIFF * even.T @ even)
    return out


# ------------------------------------------------------------------------------------------------
# Newton's method over steps of the load.


class LostStabilityError(Exception):
    """No stable equilibrium was found beyond a share of the load.

    Attributes
    ----------
    share
        Of the load, that was reached.
    place_mm
        Where the stiffness failed, or None where the iteration did not settle.
    state : Equilibrium, optional
        That at this share, of `Mechanics.follow`.
    """

    def __init__(self, share: float, place_mm: FloatArray | None, state: Any = None) -> None:
        super().__init__(f"no stable equilibrium beyond {share:.4g} of the load")
        self.share, self.place_mm, self.state = share, place_mm, state


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
    """

    share: float
    displacement_mm: FloatArray
    strain: FloatArray
    stress_MPa: FloatArray
    pressure: FloatArray


class _Sensitivity(NamedTuple):
    """Derivatives of a response, at the quadrature points.

    Attributes
    ----------
    log_modulus : (Q,)
        Over ln W' and ln κ there together, as Poisson's ratio at rest ties them.
    coordinate : (Q,)
        Over m there, by stiffness and by weight.
    """

    log_modulus: FloatArray
    coordinate: FloatArray


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
    densities : ((k,), (k,)), optional
        Coordinates of materials and their densities, g/cm³, for gravity.
    """

    cells: CutCells
    table: MarlowTable
    coordinate: FloatArray
    poisson: float = POISSON
    stabiliser_MPa: FloatArray | None = None
    densities: tuple[FloatArray, FloatArray] | None = None

    @cached_property
    def shear_modulus_MPa(self) -> FloatArray:
        """At rest, (Q,)."""
        return self.table.shear_modulus_MPa(self.coordinate)

    @cached_property
    def cell_shear_MPa(self) -> FloatArray:
        """Mean over each cell, (n,)."""
        cells = self.cells
        total = np.add.reduceat(cells.weights_mm3 * self.shear_modulus_MPa, cells.offsets[:-1])
        return np.asarray(total / self.cells.cell_volume_mm3)

    @cached_property
    def spread(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Variances of each cell's material, (n, 3), rising, their axes, and points from means."""
        cells = self.cells
        starts = cells.offsets[:-1]
        volume = self.cells.cell_volume_mm3
        mean = np.add.reduceat(cells.weights_mm3[:, None] * cells.points, starts) / volume[:, None]
        away = cells.points - mean[cells.cell_of]
        square = cells.weights_mm3[:, None, None] * away[:, :, None] * away[:, None, :]
        return *np.linalg.eigh(np.add.reduceat(square, starts) / volume[:, None, None]), away

    @cached_property
    def pressure_basis(self) -> FloatArray:
        """Orthonormal over each cell's material: 1, and axes along which it spreads, (Q, 4)."""
        variance, axes, away = self.spread
        scale = np.where(variance > _SPREAD**2, 1.0 / np.sqrt(np.maximum(variance, 1e-12)), 0.0)
        turned = (axes * scale[:, None, :])[self.cells.cell_of]
        return np.column_stack([np.ones(len(away)), np.einsum("qi,qij->qj", away, turned)])

    def pressure_MPa(self, coefficients: FloatArray) -> FloatArray:
        """Return the cells' pressure at the points, (Q,), of `Equilibrium.pressure`."""
        each = coefficients[self.cells.cell_of]
        return np.asarray(np.einsum("qr,qr->q", each, self.pressure_basis))


def _onward(before: Equilibrium, state: Equilibrium, share: float) -> Equilibrium:
    """Return a state along the line through two others: Newton's method sets out from there."""
    ahead = (share - state.share) / (state.share - before.share)
    moved = {
        name: getattr(state, name) + ahead * (getattr(state, name) - getattr(before, name))
        for name in ("displacement_mm", "strain", "stress_MPa", "pressure")
    }
    return replace(state, **moved)


_RUN = 20_000
"""Points at a time: 30 MB for each of their fields."""

_THREADS = 2
_MOST_ITERATIONS = 40
_SMALLEST_STEP = 1.0 / 64.0
_SETTLED = 1e-6
_FALLS = 0.1
"""Of the change before: a larger one is not made with the factor before. Newton's last changes fall
by ten times and more; one that falls less may send slivers astray."""

Progress = Callable[[float, int, float], None]
"""Called with the share of the load, the iteration, and the residual over the forces."""


class Mechanics:
    """A body with its supports and loads: equilibria and their derivatives.

    Parameters
    ----------
    analysis
        Of the cells' matrix; another body on the same cells may share it.
    like : Mechanics, optional
        Of the same cells, with other materials or conditions: places of loads and supports, and
        memory, are shared; only one of both can be at work at a time. Of other cells: memory alone.
    rests
        The last factor of the body at rest, by what holds it: shared by load cases, it serves the
        first iteration of each, and all of one that is linear.
    """

    _matrices: FloatArray
    _first: tuple[float, FloatArray] | None = None  # a share of the load, and what it does at rest

    def __init__(
        self,
        body: Body,
        conditions: Conditions,
        analysis: Analysis,
        *,
        like: "Mechanics | None" = None,
        rests: dict[object, Factor] | None = None,
    ) -> None:
        cells, shape = body.cells, (len(body.cells.nodes), 27, 6, 27)
        self.body, self.conditions, self.analysis, self.rests = body, conditions, analysis, rests
        memory = reused(math.prod(shape), None if like is None else like._matrices)
        self._matrices = memory.reshape(shape)
        like = like if like is not None and like.body.cells is cells else None
        below, share = body.table.places(body.coordinate)
        ratio = 2.0 * (1.0 + body.poisson) / (3.0 * (1.0 - 2.0 * body.poisson))
        self.basis = body.pressure_basis
        starts = cells.offsets[:-1]
        full_mm3 = float(np.prod(cells.cell_mm))
        cut = cells.cell_volume_mm3 < (1.0 - 1e-9) * full_mm3
        own = np.where(cut, 0.0, _AT_POINTS)[cells.cell_of] * body.shear_modulus_MPa
        self.bulk = ratio * body.shear_modulus_MPa
        self.cell_bulk = self.bulk - own  # what the cells' pressures answer with
        outer = (cells.weights_mm3 / self.cell_bulk)[:, None, None]
        outer = outer * self.basis[:, :, None] * self.basis[:, None, :]
        gram = np.add.reduceat(outer, starts)
        missing = np.einsum("nii->ni", gram) == 0.0
        gram[:, range(4), range(4)] += missing
        self.compliance = np.linalg.inv(gram)
        self.compliance[:, range(4), range(4)] -= missing
        stabiliser = body.stabiliser_MPa
        self.held_by_MPa = body.cell_shear_MPa if stabiliser is None else stabiliser
        hold = np.where(cut, _STABILISER * self.held_by_MPa * full_mm3 ** (1.0 / 3.0), 0.0)
        flat = body.spread[0][:, 0] < _LINE
        self.stabiliser = np.stack([hold, _SLOPE * np.where(flat, hold, 0.0)], axis=1)
        linear = np.column_stack([np.ones(27), LOCAL - 1.0])
        sloped = linear[:, 1:] @ np.linalg.pinv(linear[:, 1:])
        self.roughness = np.stack([np.eye(27) - linear @ np.linalg.pinv(linear), sloped])
        self.table = (body.table.log_slope_MPa, body.table.step, below, share, own)
        # Nodes of the table below and above the mixture at each point, (2, Q).
        self._beside = np.stack([below, np.minimum(below + 1, len(body.table.coordinate) - 1)])
        lower, upper = body.table.coordinate[self._beside]
        softer, harder = body.table.log_slope_MPa[:, 0, 0][self._beside]
        self._gap = np.maximum(upper - lower, 1e-12)
        self.bulk_over_m = (harder - softer) / self._gap  # d ln κ / dm at each point, (Q,)
        each = cells.nodes, cells.offsets, cells.points, cells.weights_mm3, cells.cell_mm
        self.geometry = (*each, int(np.diff(cells.offsets).max()))  # the most points of a cell
        self._places: dict[bytes, _FacetPoints] = {} if like is None else like._places
        softer = body.cell_shear_MPa[cells.interface.cells].min(axis=1)  # of cells that meet
        self.softer_MPa = 2.0 * (1.0 + body.poisson) * softer  # Young's modulus at rest
        if like is None:
            self.springs = _springs(cells, self.softer_MPa)
        elif like.body is body:
            self.springs = like.springs
        else:
            self.springs = like.springs * (self.softer_MPa / like.softer_MPa)[:, None, None]
        self._build_loads()

    def points_of(self, facets: BoolArray) -> _FacetPoints:
        """Return the quadrature points of facets, as `_facet_points`; kept for the next time."""
        key = np.packbits(facets).tobytes()
        if key not in self._places:
            self._places[key] = _facet_points(self.body.cells, facets)
        return self._places[key]

    def _carried(self, at: _FacetPoints, nodal: FloatArray) -> FloatArray:
        """Return at points of facets, (n, 3), what is given at the nodes, (N, 3)."""
        return np.asarray(np.einsum("na,nai->ni", at.shape, nodal[self.body.cells.nodes[at.cell]]))

    def place_mm(self, at: _FacetPoints, u: FloatArray | float = 0.0) -> FloatArray:
        """Return where points of facets are, (n, 3), displaced by `u`, (N, 3), or at rest."""
        return self._carried(at, self.body.cells.node_mm + u)

    def arm_mm(self, at: _FacetPoints, u: FloatArray | float = 0.0) -> FloatArray:
        """Return the same from the middle of all, by their area."""
        place, size = self.place_mm(at, u), at.size_mm2
        return np.asarray(place - size @ place / size.sum())

    def couple(
        self, facets: BoolArray, moment: FloatArray, u: FloatArray | float = 0.0
    ) -> tuple[_FacetPoints, FloatArray]:
        """Return the points of facets, and forces there that come to a moment (`loads.couple`)."""
        at = self.points_of(facets)
        return at, couple(at.size_mm2, self.place_mm(at, u), moment)

    def _build_loads(self) -> None:
        cells, conditions = self.body.cells, self.conditions
        self.dead = np.zeros((len(cells.node_mm), 3))
        for force in conditions.forces:
            self.dead += self.mean_weights(self.points_of(force.facets), np.array(force.force_N))
        for moment in conditions.moments:
            self.dead += spread(cells, *self.couple(moment.facets, np.array(moment.moment_N_mm)))
        if conditions.gravity is not None and self.body.densities is not None:
            density = np.interp(self.body.coordinate, *self.body.densities)
            self.dead += np.outer(self._weight @ density, conditions.gravity)
        self.held = []
        for support in conditions.supports:
            at = self.points_of(support.facets)
            modulus = 3.0 * self.held_by_MPa[at.cell]
            stiffness = _PENALTY * modulus / float(cells.cell_mm.min()) * at.size_mm2
            axes = np.array([0.0 if d is None else 1.0 for d in support.displacement_mm])
            target = np.array([d or 0.0 for d in support.displacement_mm])
            springs = [(at.shape[k].T * stiffness[k]) @ at.shape[k] for _, k in at.by_cell()]
            self.held.append(_Held(at, stiffness, springs, axes, target))

    @cached_property
    def _weight(self) -> Any:
        """Force at each node along gravity, N, of 1 g/cm³ at each point: sparse, (N, Q)."""
        cells = self.body.cells
        # g/cm³ mm³ = 1e-6 kg
        shape = shape_functions(cells.points, cells.cell_mm)[0] * 9.80665e-6
        shape *= cells.weights_mm3[:, None]
        return carrier(cells, cells.cell_of, shape).T

    def weight_over_m(self, share: float) -> Any:
        """Return how the nodes' forces along gravity change with m at each point: sparse (N, Q)."""
        coordinate, density = self.body.densities or (np.arange(2.0), np.zeros(2))
        above = np.clip(np.searchsorted(coordinate, self.body.coordinate), 1, len(coordinate) - 1)
        slope = (np.diff(density) / np.diff(coordinate))[above - 1]
        return self._weight.multiply(share * slope).tocsr()

    # -------------------------------------------------------------------------------------------

    def at_rest(self) -> Equilibrium:
        """Return the state without load."""
        cells = self.body.cells
        none = np.zeros((len(cells.points), 6))
        still, pressure = np.zeros((len(cells.node_mm), 3)), np.zeros((len(cells.nodes), 4))
        return Equilibrium(0.0, still, none, none, pressure)

    def state_like(self, other: "Mechanics", state: Equilibrium) -> Equilibrium:
        """Return the state of a body on other cells, from which `equilibrated` may set out.

        Displacements are interpolated; strains and stresses are those of the nearest points, since
        those of interpolated displacements are so rough that the stiffness is not positive.
        """
        cells, there = self.body.cells, other.body.cells
        nearest = np.asarray(there.tree.query(cells.points_mm)[1])
        p = other.body.pressure_MPa(state.pressure)[nearest]
        each = (cells.weights_mm3 * p)[:, None] * self.basis
        pressure = np.add.reduceat(each, cells.offsets[:-1]) / cells.cell_volume_mm3[:, None]
        u = there.interpolated(cells.node_mm, state.displacement_mm)
        strain, stress = state.strain[nearest], state.stress_MPa[nearest]
        return Equilibrium(state.share, u, strain, stress, pressure)

    def _run(self, function: Callable[..., None], *arguments: Any) -> None:
        """Call a kernel on runs of cells, of about equal work."""
        offsets = self.body.cells.offsets
        cuts = np.searchsorted(offsets, np.linspace(0, offsets[-1], 4 * _THREADS + 1))
        cuts[-1] = len(offsets) - 1
        runs = itertools.pairwise(np.unique(cuts).tolist())
        given = (self.geometry, self.table, self.basis, self.compliance, *arguments)
        with ThreadPoolExecutor(_THREADS) as pool:
            for job in [pool.submit(function, *run, *given) for run in runs]:
                job.result()

    def _assembled(self, state: Equilibrium, share: float) -> tuple[FloatArray, float]:
        """Fill the matrices; return the residual (N, 3), loads minus forces, and their size."""
        cells = self.body.cells
        u = state.displacement_mm
        forces = np.empty((len(cells.nodes), 81))
        self._run(
            assemble, self.stabiliser, self.roughness, u, state.strain, state.stress_MPa,
            state.pressure, self._matrices, forces,
        )  # fmt: skip
        inner = _summed(cells.nodes, forces, len(cells.node_mm))
        size = float(np.sqrt(np.sum(forces * forces)))
        linked = cells.nodes[cells.interface.cells].reshape(-1, 54)
        inner += _summed(linked, self.springs @ u[linked], len(cells.node_mm))
        outer = share * self.dead
        for pressure in self.conditions.pressures:
            outer = outer + self.push(pressure, share, u, tangent=True)
        for held in self.held:
            outer = outer + self._hold(held, share, u)
        return outer - inner, max(size, float(np.linalg.norm(outer)))

    def push(
        self, pressure: Pressure, share: float, u: FloatArray, *, tangent: bool = False
    ) -> FloatArray:
        """Return the nodal forces of a pressure; add the symmetric part of its tangent if asked.

        Those of a closed surface balance. Slopes at points, which jump from cell to cell, leave a
        rest, which is spread evenly over the area.
        """
        cells, at = self.body.cells, self.points_of(pressure.facets)
        p = share * pressure.pressure_MPa
        F = np.eye(3) + np.einsum("nai,nak->nik", u[cells.nodes[at.cell]], at.gradient)
        cofactor = np.cross(F[:, [1, 2, 0]], F[:, [2, 0, 1]])
        push = -p * np.einsum("nik,nk->ni", cofactor, at.area_mm2)
        size = at.size_mm2
        if np.linalg.norm(at.area_mm2.sum(axis=0)) < _CLOSED * size.sum():
            push -= np.outer(size / size.sum(), push.sum(axis=0))
        if tangent:
            # d cof F / dF, with ε_ijk ε_IJK F_kK A_I = ε_ijk (A × F_k)_J.
            crossed = np.cross(at.area_mm2[:, None, :], F)  # (n, k, J): A x F_k
            turned = -p * np.einsum("ijk,nkJ->nijJ", _LEVI_CIVITA, crossed)
            for cell, near in at.by_cell():
                right = np.einsum("nijJ,nbJ->nijb", turned[near], at.gradient[near])
                block = np.tensordot(at.shape[near], right, (0, 0))  # rows a i, columns j b
                symmetric = 0.5 * (block + block.transpose(3, 2, 1, 0))
                self._matrices[cell] += symmetric[:, [0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2]]
        return spread(cells, at, push)

    def _hold(self, held: _Held, share: float, u: FloatArray) -> FloatArray:
        """Return the nodal forces of a support; add its stiffness."""
        at = held.points
        for (cell, _), springs in zip(at.by_cell(), held.springs, strict=True):
            for axis in np.flatnonzero(held.axes).tolist():
                self._matrices[cell, :, axis] += springs
        return spread(self.body.cells, at, self._reaction(held, share, u))

    def _reaction(self, held: _Held, share: float, u: FloatArray) -> FloatArray:
        """Return the force of a support on the body at each of its points, (n, 3)."""
        place = self._carried(held.points, u)
        return np.asarray(held.stiffness[:, None] * held.axes * (share * held.target_mm - place))

    def _factored(self, into: Factor | None, *, at_rest: bool, share: float) -> Factor:
        """Return the factor of the matrices; of the body at rest, the one that is kept.

        Raises
        ------
        LostStabilityError
            The stiffness is not positive beyond the share of the load that was reached.
        """
        # A pressure has a stiffness of its own from the first.
        rests = {} if self.rests is None or self.conditions.pressures else self.rests
        supports = self.conditions.supports
        key = tuple((s.facets.tobytes(), *(d is None for d in s.displacement_mm)) for s in supports)
        if at_rest and key in rests:
            return rests[key]
        into = None if into in rests.values() else into
        try:
            made = factor(self.analysis, self._matrices, self.springs, into=into)
        except NotPositiveDefinite as failed:
            raise LostStabilityError(share, self.body.cells.node_mm[failed.node]) from failed
        if at_rest:
            rests.clear()
            rests[key] = made
        return made

    def small(self, share: float) -> Equilibrium:
        """Return what a small share of the load does, as if the body answered linearly.

        Raises
        ------
        LostStabilityError
            The stiffness at rest is not positive.
        """
        rest = self.at_rest()
        if self._first is None:
            residual, _ = self._assembled(rest, share)
            change = self._factored(None, at_rest=True, share=0.0).solve(residual.ravel())
            self._first = share, change.reshape(-1, 3)
        at, change = self._first
        return replace(rest, share=share, displacement_mm=share / at * change)

    # -------------------------------------------------------------------------------------------

    def equilibrated(
        self,
        state: Equilibrium,
        share: float,
        progress: Progress = lambda share, iteration, residual: None,
        into: Factor | None = None,
        *,
        near: bool = False,
        settled: float = _SETTLED,
        tangent: bool = True,
    ) -> tuple[Equilibrium, Factor]:
        """Return the equilibrium at a share of the load, from a state nearby, and its factor.

        The memory of `into`, a factor that is needed no more, of whatever cells, is taken for that;
        where it is `near`, of almost this state and material, it gives the first change before.
        `settled` is the largest last change of a displacement over the largest displacement, and
        residual over forces: Newton's next change would be about its square. Where changes fall so
        fast that the next one is foretold to be below that, the residual does not matter. Without
        `tangent` the last change is made with the factor before: it is of a state nearby, and the
        change off by as little.

        Raises
        ------
        LostStabilityError
            The stiffness is not positive on the way, or the iteration does not settle.
        """
        u, strain = state.displacement_mm.copy(), state.strain.copy()
        stress, pressure = state.stress_MPa.copy(), state.pressure.copy()
        moved, factored = 0.0, into
        for iteration in range(1, _MOST_ITERATIONS + 1):
            residual, size = self._assembled(Equilibrium(share, u, strain, stress, pressure), share)
            error = float(np.linalg.norm(residual)) / max(size, 1e-300)
            progress(share, iteration, error)
            at_rest = iteration == 1 and not u.any()
            is_last = iteration > 1 and error <= settled
            kept = factored is not None and ((near and iteration == 1) or (is_last and not tangent))
            if factored is not None and kept:
                change = factored.solve(residual.ravel()).reshape(-1, 3)
                # A sliver may answer quite otherwise than it did before.
                kept = iteration == 1 or float(np.abs(change).max()) < _FALLS * moved
            if factored is None or not kept:
                factored = self._factored(factored, at_rest=at_rest, share=state.share)
                change = factored.solve(residual.ravel()).reshape(-1, 3)
            if not np.isfinite(change).all():
                raise LostStabilityError(state.share, None)
            # A pressure has a stiffness, which grows with it.
            if at_rest and not kept and not self.conditions.pressures:
                self._first = share, change
            self._run(advance, u, change, strain, stress, pressure)
            u = u + change
            largest = max(float(np.abs(u).max()), 1e-300)
            before, moved = moved, float(np.abs(change).max())
            # Changes go as squares of those before: next comes moved³ / before².
            quick = (moved / largest) ** 3 <= (settled * before / largest) ** 2
            if moved <= settled * largest and (
                error <= settled or moved <= 1e-9 * largest or quick
            ):
                return Equilibrium(share, u, strain, stress, pressure), factored
            if iteration > 12 and moved > before > 0.1 * largest:
                break  # it wanders
        raise LostStabilityError(state.share, None)

    def follow(
        self,
        shares: Sequence[float],
        progress: Progress = lambda share, iteration, residual: None,
        *,
        settled: float = _SETTLED,
        tangents: bool = True,
        halves: bool = True,
    ) -> Iterator[tuple[Equilibrium, Factor]]:
        """Yield the equilibria at rising shares of the load; steps are halved where they must be.

        The factor of each is good until the next is asked for; without `tangents` it is only the
        last one's that is of its state. `settled` as of `equilibrated`. Without `halves` it is
        given up where a step fails.

        Raises
        ------
        LostStabilityError
            After the last stable state of those was yielded; it has the last that was found.
        """
        state, before, factored = self.at_rest(), None, None
        for share in shares:
            step = share - state.share
            while True:
                target = share if share - state.share - step < 1e-9 else state.share + step
                try:
                    start = state if before is None else _onward(before, state, target)
                    found = self.equilibrated(
                        start, target, progress, factored, settled=settled,
                        tangent=tangents or target not in shares[:-1],
                    )  # fmt: skip
                except LostStabilityError as lost:
                    before, step = None, 0.5 * step
                    if step < _SMALLEST_STEP or not halves:
                        raise LostStabilityError(state.share, lost.place_mm, state) from lost
                    continue
                before, (state, factored) = state, found
                if target == share:
                    break
            yield state, factored

    def tangent(self, state: Equilibrium) -> Factor:
        """Return the factor of the stiffness at an equilibrium."""
        self._assembled(state, state.share)
        return self._factored(None, at_rest=False, share=state.share)

    # -------------------------------------------------------------------------------------------

    def mean(self, points: _FacetPoints, u: FloatArray) -> FloatArray:
        """Return the mean displacement of facets by area, (3,)."""
        size = points.size_mm2
        return np.asarray(size @ self._carried(points, u) / size.sum())

    def mean_weights(self, points: _FacetPoints, direction: FloatArray) -> FloatArray:
        """Return the nodal weights, (N, 3), of the mean displacement along a direction."""
        share = points.size_mm2 / points.size_mm2.sum()
        return spread(self.body.cells, points, np.outer(share, direction))

    def place_weights(self, place_mm: FloatArray, direction: FloatArray) -> FloatArray:
        """Return the nodal weights, (N, 3), of the displacement of a place along a direction.

        It is carried by the material nearest to it.
        """
        cells = self.body.cells
        return np.outer(carrier(cells, *cells.nearest(place_mm[None])).toarray(), direction)

    def turn_weights(self, facets: BoolArray, u: FloatArray, axis: FloatArray) -> FloatArray:
        """Return the nodal weights, (N, 3), of how far displaced facets turn about an axis."""
        at, rates = self.couple(facets, axis, u)
        return spread(self.body.cells, at, np.degrees(rates))

    def turn_deg(self, facets: BoolArray, u: FloatArray) -> FloatArray:
        """Return how facets have turned, (3,): an axis, times the angle of the best fit."""
        from scipy.spatial.transform import Rotation

        at = self.points_of(facets)
        arms = self.arm_mm(at, u), self.arm_mm(at)
        found, _ = Rotation.align_vectors(*arms, weights=at.size_mm2)
        return np.asarray(found.as_rotvec(degrees=True))

    def reactions(self, state: Equilibrium) -> list[FloatArray]:
        """Return the force of each support on the body, (3,) each."""
        u = state.displacement_mm
        return [self._reaction(held, state.share, u).sum(axis=0) for held in self.held]

    def reaction_weights(self, support: int, direction: FloatArray) -> FloatArray:
        """Return the derivative of a support's force along a direction over displacements."""
        held = self.held[support]
        forces = -held.stiffness[:, None] * held.axes * direction
        return spread(self.body.cells, held.points, forces)

    def observe(self, state: Equilibrium, adjoint: FloatArray | None = None) -> "Observed":
        """Return invariants and strains at the points, and the work on an adjoint field."""
        count = len(self.body.cells.points)
        seen = Observed(np.empty(count), np.empty((count, 6)), *np.empty((3, count)))
        field = np.zeros_like(state.displacement_mm) if adjoint is None else adjoint
        self._run(observe, self.cell_bulk, state.displacement_mm, state.pressure, field, *seen)
        return seen._replace(over_m=seen.over_m / self._gap)

    def sensitivity(
        self, state: Equilibrium, factored: Factor, weights: FloatArray
    ) -> _Sensitivity:
        """Return the derivatives of the response weights : displacements over the materials.

        The load is held. `factored` belongs to the state.
        """
        adjoint = factored.solve(weights.ravel()).reshape(-1, 3)
        seen, gravity = self.observe(state, adjoint), self.conditions.gravity
        over_m = -seen.isochoric * seen.over_m - seen.volumetric * self.bulk_over_m
        if gravity is not None:
            over_m += self.weight_over_m(state.share).T @ (adjoint @ np.array(gravity))
        return _Sensitivity(-seen.isochoric - seen.volumetric, over_m)

    def runs(self, u: FloatArray) -> Iterator[tuple[slice, IntArray, FloatArray, FloatArray]]:
        """Yield runs of points with their nodes, their shapes' gradients, and F = I + du/dX."""
        cells = self.body.cells
        for first in range(0, len(cells.points), _RUN):
            run = slice(first, first + _RUN)
            nodes = cells.nodes[cells.cell_of[run]]
            gradient = shape_functions(cells.points[run], cells.cell_mm)[1]
            yield run, nodes, gradient, np.eye(3) + np.einsum("qai,qaj->qij", u[nodes], gradient)

    def nodal_forces(self, u: FloatArray, stress: FloatArray) -> FloatArray:
        """Return the nodal forces, (N, 3), of second Piola-Kirchhoff stresses times volumes."""
        out = np.zeros_like(u)
        for run, nodes, gradient, F in self.runs(u):
            pulls = gradient @ (F @ stress[run][:, SIX]).transpose(0, 2, 1)
            out += _summed(nodes, pulls, len(out))
        return out

    def energy_mJ(self, state: Equilibrium) -> float:
        """Return the energy stored in the material, and where materials meet in a cell, N mm."""
        cells, springs = self.body.cells, self.springs
        u = state.displacement_mm[cells.nodes[cells.interface.cells].reshape(-1, 54)]
        return float(cells.weights_mm3 @ self.energy_MPa(state) + 0.5 * np.vdot(u, springs @ u))

    def energy_MPa(self, state: Equilibrium) -> FloatArray:
        """Return the energy stored at the points over the volume at rest, N mm / mm³, (Q,)."""
        seen, table = self.observe(state), self.body.table
        place = np.minimum(seen.x / table.step, table.energy_MPa.shape[1] - 1.001)
        i = place.astype(np.int64)
        t = place - i
        over, nodes, share = table.energy_MPa, self._beside, self.table[3]
        energy = (1.0 - t) * over[nodes, i] + t * over[nodes, i + 1]
        isochoric = seen.x**2 * energy[0] ** (1.0 - share) * energy[1] ** share  # as W' is
        p = self.body.pressure_MPa(state.pressure)
        volumetric = p * p / self.cell_bulk + self.table[4] * (seen.growth - 1.0) ** 2
        return np.asarray(isochoric + 0.5 * volumetric)


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
        d ln W' / dm.
    """

    x: FloatArray
    strain: FloatArray
    isochoric: FloatArray
    volumetric: FloatArray
    over_m: FloatArray

    @property
    def growth(self) -> FloatArray:
        """Volume over that at rest, (Q,)."""
        return np.asarray(np.linalg.det(np.eye(3) + 2.0 * self.strain[:, SIX]) ** 0.5)

    def largest_stretch(self) -> tuple[FloatArray, FloatArray]:
        """Return the largest principal stretch at the points, and its direction.

        Its derivative over the strain is the direction's square over the stretch.
        """
        values, vectors = np.linalg.eigh(np.eye(3) + 2.0 * self.strain[:, SIX])
        return np.sqrt(np.maximum(values[:, 2], 0.0)), vectors[:, :, 2]
