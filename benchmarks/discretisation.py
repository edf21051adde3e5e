"""Random layered, graded and walled parts: the error that is told against the true one.

python -m benchmarks.discretisation [COUNT [SEED]]

True is the answer in cells of half the size, to a small load, as what is told is. Told bounds it in
nine parts of ten, and is at most four times as large in half of them.
"""

import sys
from collections.abc import Iterator

import manifold3d
import numpy as np

import planner
from planner.materials.marlow import marlow_table
from planner.materials.mixtures import CoefficientModel
from planner.numerics import one_blas_thread
from planner.simulation.loads import read_conditions
from planner.simulation.part import Solid as PlannedSolid
from planner.simulation.part import default_cell_mm, open_solid
from planner.simulation.solid import Body, Mechanics
from planner.simulation.sparse_cholesky import analyse

Solid = manifold3d.Manifold
MATERIALS = ("Tango", "FLX9750", "FLX9770", "FLX9785", "FLX9795", "RGD8430", "Vero")
FEWER = 1.6
"""Times the default cell, so that half of it stays quick."""


def mesh_of(solid: Solid) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices and faces."""
    made = solid.to_mesh64()
    return np.array(made.vert_properties)[:, :3], np.array(made.tri_verts)


def bar(draw: np.random.Generator) -> Solid:
    """A bar or a rod along x, at any place."""
    length, wide, high = draw.uniform(20, 60), draw.uniform(4, 12), draw.uniform(4, 12)
    if draw.random() < 0.4:
        return Solid.cylinder(length, wide / 2, circular_segments=48).rotate((0, 90, 0))
    return Solid.cube((length, wide, high))


def walled(draw: np.random.Generator) -> Solid:
    """A tube, a box or a bellows along x, with walls of 1 to 2.5 mm."""
    wall, length, wide = draw.uniform(1, 2.5), draw.uniform(25, 60), draw.uniform(10, 18)
    kind = draw.integers(3)
    if kind == 0:
        tube = Solid.cylinder(length, wide / 2, circular_segments=48)
        tube -= Solid.cylinder(length, wide / 2 - wall, circular_segments=48)
        return tube.rotate((0, 90, 0))
    if kind == 1:
        inner = (length - 2 * wall, wide - 2 * wall, 0.7 * wide - 2 * wall)
        return Solid.cube((length, wide, 0.7 * wide)) - Solid.cube(inner).translate((wall,) * 3)
    folds = int(draw.integers(2, 5))
    x = np.linspace(0, length, 2 * folds + 1)
    radius = np.where(np.arange(2 * folds + 1) % 2, wide / 2 + 3, wide / 2)
    outer, inner = (np.stack([radius - inset, x], axis=1) for inset in (0.0, wall))
    profile = manifold3d.CrossSection([np.concatenate([outer, inner[::-1]])])
    return Solid.revolve(profile, 48).rotate((0, 90, 0))


def parts(count: int, seed: int) -> Iterator[tuple[str, planner.Plan, dict[str, str]]]:
    """Return plans and loads: layered, graded and walled in turn."""
    for number in range(count):
        draw = np.random.default_rng([seed, number])
        kind = ("layered", "graded", "walled")[number % 3]
        solid = walled(draw) if kind == "walled" else bar(draw)
        solid = solid.rotate((float(draw.uniform(0, 90) * (draw.random() < 0.3)), 0.0, 0.0))
        solid = solid.translate(tuple(draw.uniform(0, 5, 3)))
        axis = str(draw.choice(["x", "x", "z"]))
        if kind == "layered":
            layers = int(draw.integers(2, 6))
            ends = np.concatenate([[0], np.sort(draw.uniform(0, 1, layers - 1)), [1]])
            ends = np.maximum.accumulate(ends + 0.02 * np.arange(layers + 1))
            ends /= ends[-1]
            used = [str(m) for m in draw.choice(MATERIALS, layers)]
            profile = [(float(e), m) for k, m in enumerate(used) for e in (ends[k], ends[k + 1])]
            plan = planner.grade(mesh_of(solid), axis=axis, profile=profile, snap_mm=0, name=kind)
        else:
            ends = [str(m) for m in draw.choice(MATERIALS, 2, replace=False)]
            blend = "mix" if draw.random() < 0.2 else "nearest"
            plan = planner.grade(
                mesh_of(solid), axis=axis, from_=ends[0], to=ends[1], blend=blend, name=kind
            )
        load = str(draw.choice(["0,0,-0.01 N", "0,0.01,0 N", "0.01,0,0 N"]))
        on: dict[str, str] = {"load": f"x=max: {load}"}
        if draw.random() < 0.2:
            on = {"moment": "x=max: 0.05,0,0 N mm"}
        yield kind, plan, {"fix": "x=min", **on}


def figure(solid: PlannedSolid, on: planner.LoadCase, edge_mm: float) -> np.ndarray:
    """Return how the loaded faces move or turn, in cells of a size, under a small load."""
    cells, coordinate = solid.cut(edge_mm)
    body = Body(cells, marlow_table(CoefficientModel(solid.palette)), coordinate)
    conditions = read_conditions(cells.surface, on)
    analysis = analyse(cells.nodes, cells.node_mm, cells.interface.cells)
    mechanics = Mechanics(body, conditions, analysis)
    moved = mechanics.small(1e-3).displacement_mm
    if conditions.moments:
        return mechanics.turn_deg(conditions.moments[0].facets, moved)
    return mechanics.mean(mechanics.points_of(conditions.forces[0].facets), moved)


@one_blas_thread()
def told_and_true(plan: planner.Plan, on: dict[str, str]) -> tuple[float, float, float]:
    """Return the cells' edge, and the largest error of a figure: as it is told, and as it is."""
    case = planner.LoadCase(**on)  # type: ignore[arg-type]
    solid = open_solid(plan, None, None, None, None)
    edge_mm = FEWER * default_cell_mm(solid.surface)
    (found,) = planner.simulate_part(plan, case, cell_mm=edge_mm, steps=1)
    assert found.discretisation is not None
    here, there = (figure(solid, case, edge) for edge in (edge_mm, edge_mm / 2))
    return edge_mm, found.discretisation.largest, abs(float(here @ there) / float(here @ here) - 1)


def main(count: int = 40, seed: int = 1) -> None:
    ratios = []
    print(f"{'':10}{'cells, mm':>10}{'told, %':>10}{'true, %':>10}")
    for kind, plan, on in parts(count, seed):
        edge_mm, told, true = told_and_true(plan, on)
        ratios.append(told / true)
        print(f"{kind:10}{edge_mm:10.2f}{100 * told:10.3f}{100 * true:10.3f}", flush=True)
    bounds, near = np.mean(np.array(ratios) >= 1.0), np.mean(np.array(ratios) <= 4.0)
    print(f"told bounds true in {bounds:.0%} of {count}, and is at most 4 times it in {near:.0%}")
    sys.exit(0 if bounds >= 0.9 and near >= 0.5 else 1)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
