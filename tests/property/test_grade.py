"""Whatever the part, gradient and place: every check of the plan holds, and the folder's too."""

import itertools

import manifold3d as m3
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import planner
from planner.formats.mesh_file import decode_stl

SHELL_CHECKS = ("shells_unsound", "volume_error", "interfaces_unmatched", "overlap")
IDS = [m.id for m in planner.load_printer("connex3").palette().materials]


@st.composite
def solids(draw: st.DrawFn) -> m3.Manifold:
    """A boolean of two simple bodies, turned and moved."""
    size = draw(st.floats(4.0, 60.0))
    first = m3.Manifold.sphere(size / 2, 4 * draw(st.integers(2, 9)))
    kind = draw(st.sampled_from(["box", "tube", "two", "hole"]))
    if kind == "box":
        solid = m3.Manifold.cube([size, 0.7 * size, 0.4 * size], True)
    elif kind == "tube":
        outer = m3.Manifold.cylinder(size, size / 3, size / 4, 24, True)
        solid = outer - m3.Manifold.cylinder(2 * size, size / 6, size / 6, 16, True)
    elif kind == "two":
        solid = first + first.translate([1.5 * size, 0.1 * size, 0.0])
    else:
        solid = first - m3.Manifold.sphere(size / 4, 20)
    angles = draw(st.tuples(*[st.floats(0.0, 90.0)] * 3))
    place = draw(st.tuples(*[st.floats(-300.0, 300.0)] * 3))
    return solid.rotate(list(angles)).translate(list(place))


def _arrays(solid: m3.Manifold) -> tuple[np.ndarray, np.ndarray]:
    mesh = solid.to_mesh()
    return np.asarray(mesh.vert_properties[:, :3]), np.asarray(mesh.tri_verts)


@settings(deadline=None, derandomize=True, max_examples=15)
@given(
    solid=solids(),
    ends=st.lists(st.sampled_from(IDS), min_size=2, max_size=2, unique=True),
    axis=st.sampled_from(["x", "-y", "z", "1,1,0", "0.2,-1,0.7"]),
    profile=st.sampled_from(["log", "linear", "smooth", "steps:4"]),
    bands=st.none() | st.integers(1, 12),
)
def test_every_shell_of_every_part_is_sound(solid, ends, axis, profile, bands) -> None:
    plan = planner.grade(
        _arrays(solid), from_=ends[0], to=ends[1], axis=axis, profile=profile, bands=bands
    )
    assert {name: plan.checks[name].ok for name in SHELL_CHECKS} == dict.fromkeys(
        SHELL_CHECKS, True
    )
    assert plan.checks["voxel_volume_error"].ok
    volume = sum(region.volume_mm3 for region in plan.regions)
    assert volume == pytest.approx(plan.part.volume_mm3, rel=1e-6)
    moduli = [region.modulus_MPa for region in plan.regions]
    rising = IDS.index(ends[0]) < IDS.index(ends[1])
    assert moduli == sorted(moduli, reverse=not rising)
    assert len({shell.file for shell in plan.shells}) == len({r.material for r in plan.regions})


@settings(deadline=None, derandomize=True, max_examples=5)
@given(solid=solids(), axis=st.sampled_from(["x", "0.3,1,-0.2"]))
def test_neighbours_do_not_overlap(solid, axis) -> None:
    """Against manifold3d's exact booleans, of shells as their files hold them."""
    plan = planner.grade(_arrays(solid), from_="Tango", to="Vero", axis=axis)
    bodies = []
    for shell in plan.shells:
        mesh = m3.Mesh(shell.vertices, np.asarray(shell.faces, dtype=np.uint32))
        assert decode_stl(shell.stl, shell.file).shape == (len(shell.faces), 3, 3)
        bodies.append(m3.Manifold(mesh))
        assert bodies[-1].status() == m3.Error.NoError
    for softer, harder in itertools.pairwise(bodies):
        # manifold3d snaps within 1e-5 of the extent at these places, hence not exactly 0.
        assert (softer ^ harder).volume() <= 1e-9 * plan.part.volume_mm3 + 1e-9
