"""Random parts along random curved fields, at random and awkward levels: every shell is sound."""

import manifold3d as m3
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from planner.cutting.pieces import split
from planner.errors import PlannerError
from planner.fields.parse import Setting, build_field
from planner.grading.check import shell_checks
from planner.mesh.mesh import join_shells
from planner.mesh.part import make_part, moved_to_corner

KINDS = ("ball", "ring", "drilled", "thin walls", "pitted", "boxes")
counted = {"shells": 0}


def solid(kind, rng):
    if kind == "ball":
        return m3.Manifold.sphere(1, int(rng.integers(4, 30)))
    if kind == "ring":
        ring = m3.CrossSection.circle(0.3, int(rng.integers(4, 16))).translate((1, 0))
        return m3.Manifold.revolve(ring, int(rng.integers(5, 30)))
    if kind == "drilled":
        drill = m3.Manifold.cylinder(4, 0.3, 0.3, 16, True)
        return m3.Manifold.sphere(1, 24) - drill - drill.rotate([90, 0, 0])
    found = m3.Manifold.cube([1, 0.7, 0.6])
    if kind == "thin walls":
        return found - m3.Manifold.cube([0.94, 0.64, 0.6]).translate([0.03, 0.03, 0.03])
    for _ in range(int(rng.integers(1, 4))):
        if kind == "pitted":
            ball = m3.Manifold.sphere(rng.uniform(0.1, 0.4), int(rng.integers(4, 24)))
            found -= ball.translate(rng.uniform(0, 1, 3))
        else:  # sides on a lattice of 0.1: many faces lie in planes of others
            box = m3.Manifold.cube(np.round(rng.uniform(0.2, 1, 3), 1))
            found += box.translate(np.round(rng.uniform(-0.5, 0.9, 3), 1))
    return found


def field_text(mesh, rng):
    low, high = mesh.bounds_mm
    size = high - low
    at = " ".join(f"{v:.4f}" for v in low + rng.uniform(-0.2, 1.2, 3) * size)
    axis = "xyz"[rng.integers(3)]
    k = "xyz".index(axis)
    start = f"{axis}<{low[k] + 0.2 * size[k]:.4f}"
    kinds = (
        f"radial: point={at}",
        f"radial: line={at} 1 2 3",
        "distance: surface",
        f"expression: 0.5 + 0.5*sin({4 / size[0]:.4g}*x)*cos({4 / size[1]:.4g}*y)",
        f"expression: ({axis} - {low[k]:.6f})/{size[k]:.6f}",
        f"min(radial: point={at}; distance: surface)",
        f"max(axis: {axis}; radial: point={at})",
        f"geodesic: start={start}",
        f"harmonic: from={start}, to={axis}>{low[k] + 0.8 * size[k]:.4f}",
    )
    return kinds[rng.integers(len(kinds))]


@pytest.mark.slow
@settings(max_examples=50, deadline=None, derandomize=True, database=None)
@given(st.sampled_from(KINDS), st.integers(0, 2**32 - 1))
def test_every_shell_is_sound(kind, seed):
    rng = np.random.default_rng(seed)
    found = solid(kind, rng)
    if rng.random() < 0.5:
        found = found.rotate(rng.uniform(0, 360, 3).tolist())
    raw = found.scale((rng.uniform(0.5, 2, 3) * 10 ** rng.uniform(0.3, 1.9)).tolist()).to_mesh()
    corners = np.asarray(raw.vert_properties)[:, :3].astype(np.float64)
    corners += rng.uniform(-400, 400, 3)
    try:
        mesh, _ = moved_to_corner(make_part(corners[np.asarray(raw.tri_verts)], name=kind).mesh)
    except PlannerError:
        assume(False)  # bodies that touch along an edge: refused before any cut
    pitch_mm = float(np.ptp(mesh.bounds_mm, axis=0).max()) / rng.uniform(6, 25)
    try:
        field = build_field(field_text(mesh, rng), Setting(mesh, (0.0, 0.0, 0.0), pitch_mm))
    except PlannerError:
        assume(False)  # a region that holds nothing of a coarse part
    at = field.values(mesh.vertices[rng.integers(len(mesh.vertices), size=2)])
    levels = np.concatenate([rng.uniform(0.02, 0.98, int(rng.integers(1, 5))), at])
    if rng.random() < 0.4:
        levels = np.append(levels, levels[0] + 0.003)
    levels = np.sort(levels[(levels > 0.001) & (levels < 0.999)])
    levels = levels[np.diff(levels, prepend=0.0) > 1e-3]
    assume(len(levels))
    pieces = split(mesh, field, levels, pitch_mm=pitch_mm)
    soups = [pieces.vertices[pieces.shell_faces([i])] for i in range(pieces.count)]
    soups = [soup for soup in soups if len(soup)]
    counted["shells"] += len(soups)
    checks = shell_checks(join_shells(soups), mesh)
    assert {name: check for name, check in checks.items() if not check.ok} == {}


@pytest.mark.slow
def test_there_were_a_hundred_of_them():
    if not counted["shells"]:
        pytest.skip("the sweep above was not run in this process")
    assert counted["shells"] >= 100
