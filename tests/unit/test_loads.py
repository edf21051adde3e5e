"""Loads and supports: selectors, units, cavities, and what is refused."""

import re

import numpy as np
import pytest

from benchmarks.interfaces import BOX, FACES
from planner.errors import ArgumentError
from planner.formats.mesh_file import read_mesh
from planner.mesh.mesh import Mesh, weld
from planner.mesh.part import make_part
from planner.simulation.loads import (
    Conditions,
    LoadCase,
    couple,
    read_conditions,
)


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> np.ndarray:
    """Return the triangles of a box, each cut into 64: (768, 3, 3)."""
    triangles = (np.array(low) + BOX * (np.array(high) - low))[FACES]
    for _ in range(3):
        a, b, c = triangles.transpose(1, 0, 2)
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        triangles = np.concatenate(
            [np.stack(t, 1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        )
    return triangles


def mesh(*triangles: np.ndarray) -> Mesh:
    return Mesh(*weld(np.concatenate(triangles)))


BEAM = mesh(box((3.1, -2.0, 0.0), (100.1, 2.0, 4.0)))
HOLLOW = mesh(box((0, 0, 0), (10, 10, 10)), box((2, 2, 2), (8, 8, 8))[:, ::-1])


def read(surface: Mesh = BEAM, **given: object) -> Conditions:
    return read_conditions(surface, LoadCase(**{"fix": ["x=min"], "gravity": "-z", **given}))  # type: ignore[arg-type]


def area_mm2(surface: Mesh, facets: np.ndarray) -> float:
    return Mesh(surface.vertices, surface.faces[facets]).area_mm2


# --- selectors


@pytest.mark.parametrize(
    ("selector", "expected_mm2"),
    [
        ("x=max", 16.0),
        ("X = 100.1 mm", 16.0),
        ("z=4", 97.0 * 4.0),
        ("y<=-2", 97.0 * 4.0),
        ("x<51.6", 48.5 * 16.0 + 16.0),
        ("x>51.6 and normal:+z within 20", 48.5 * 4.0),
        ("normal:0,3,0 within 1 deg", 97.0 * 4.0),
        ("box:200,-3,5,51.6,3,-1", 48.5 * 16.0 + 16.0),
        ("near:100.1,0,2,1.5 and x=max", 7.5),  # of 1.5² pi = 7.07
    ],
)
def test_a_selector_catches_its_faces(selector: str, expected_mm2: float) -> None:
    facets = read(load=[f"{selector}: 0,0,1 N"]).forces[0].facets
    assert area_mm2(BEAM, facets) == pytest.approx(expected_mm2, rel=1e-9)


@pytest.mark.parametrize(
    ("selector", "says"),
    [
        ("x<0.2", "catches no face: the part's x goes from 3.1 to 100.1 mm"),
        ("x>0.2", "catches every face of the part: x goes from 3.1 to 100.1 mm, y goes"),
        ("x=50", "none lies in the plane at 50 mm; the part's x goes from 3.1 to 100.1 mm: take"),
        ("x=mid", "'mid' is no place|'x=mid' selects nothing"),
        ("box:0,0,9,9,9,10", "catches no face: the part's x goes"),
        ("box:0,0,9", "must be 6 figures in mm, parted by commas"),
        ("near:0,0,2,1", "the nearest is .* mm off, at (3.1, "),
        ("normal:1,1,1 within 5", "the nearest is turned 54.7° off"),
        ("normal:up within 5", "'up' is not a direction"),
        ("normal:+z", "write normal:DIRECTION within DEGREES"),
        ("x=max and z=2.1 and x<5", "catches no face"),
        ("x=max and x<5", "none is in all terms at once (x=max: 128, x<5: "),
        ("normal:+z within 1.2.3", "write normal:DIRECTION within DEGREES"),
        ("cavty", "'cavty' selects nothing; did you mean cavity?"),
        ("knob:1,2", "selects nothing; there are x<1"),
    ],
)
def test_a_selector_that_selects_nothing_useful_says_what_is_there(
    selector: str, says: str
) -> None:
    says = "|".join(re.escape(one).replace(r"\.\*", ".*") for one in says.split("|"))
    with pytest.raises(ArgumentError, match=says) as error:
        read(load=[f"{selector}: 0,0,1 N"])
    assert f"`load` {selector}" in str(error.value)


# --- figures and units


@pytest.mark.parametrize(
    ("given", "value"),
    [
        ({"load": ["x=max: 0,0,-500 mN"]}, (0.0, 0.0, -0.5)),
        ({"load": ["x=max: 1e-3, 0 ,+.5kN"]}, (1.0, 0.0, 500.0)),
        ({"pressure": ["z=max: 20 kPa"]}, 0.02),
        ({"pressure": ["z=max: -1 psi"]}, -0.006894757),
        ({"move": ["x=max: 5,free,0 mm"]}, (5.0, None, 0.0)),
        ({"move": ["x=max: free,free,500 um"]}, (None, None, 0.5)),
    ],
)
def test_figures_are_taken_with_their_units(given: dict[str, list[str]], value: object) -> None:
    read_ = read(**given)
    (got,) = (
        *(force.force_N for force in read_.forces),
        *(pressure.pressure_MPa for pressure in read_.pressures),
        *(support.displacement_mm for support in read_.supports[1:]),
    )
    assert got == pytest.approx(value)


@pytest.mark.parametrize(
    ("option", "text", "says"),
    [
        ("load", "x=max: 0,0,-0.5", "the unit is missing; write it behind the figures"),
        ("load", "x=max: 0,0,-0.5 kPa", "'kPa' is no unit of force, which is one of stress"),
        ("load", "x=max: 0,0,-0.5 Nn", "'Nn' is no unit of force; did you mean N?"),
        ("load", "x=max: 0,-0.5 N", "'0,-0.5 N' must be 3 figures, parted by commas"),
        ("load", "x=max: 0 N,0,-0.5 N", "must be 3 figures"),
        ("load", "x=max", "it must be SELECTOR: FIGURES UNIT, as in 'x=min: 0,0,-0.5 N'"),
        ("load", "x=max: 0,0,0 N", "a force of 0"),
        ("load", "x=max: 0,free,1 N", "`move` alone takes 'free'"),
        ("load", "x=max: 0,0,1e999 N", "figures must be finite"),
        ("load", "x=min: 0,0,1 N", "all of its faces are held along z by supports (x=min)"),
        ("moment", "x=max: 0,0,1 mm", "'mm' is no unit of moment, which is one of length"),
        (
            "moment",
            "x=max: 0,0,1 N",
            "'N' is no unit of moment, which is one of force; there are N mm",
        ),
        ("moment", "x=max: 0,0,0 N mm", "a moment of 0"),
        ("moment", "x=min: 0,0,1 N mm", "all of its faces are held by supports (x=min)"),
        ("pressure", "z=max: 20", "the unit is missing"),
        ("pressure", "z=max: 0 kPa", "a pressure of 0"),
        ("move", "x=max: free,free,free mm", "all of it is free"),
        ("move", "x=max: 5,0,0", "the unit is missing"),
    ],
)
def test_figures_that_cannot_be_meant_are_refused(option: str, text: str, says: str) -> None:
    with pytest.raises(ArgumentError, match=re.escape(says)) as error:
        read(**{option: [text]})
    assert f"`{option}` x=" in str(error.value) or f"`{option}` z=" in str(error.value)


def test_gravity_is_a_direction() -> None:
    assert read(gravity="0,0,-2").gravity == (0.0, 0.0, -1.0)
    with pytest.raises(ArgumentError, match="`gravity`: axis 'down' is not a direction"):
        read(gravity="down")


# --- the cavity


def test_a_closed_void_is_a_cavity() -> None:
    facets = read(HOLLOW, pressure=["cavity: 1 kPa"]).pressures[0].facets
    assert area_mm2(HOLLOW, facets) == pytest.approx(6 * 36.0)


@pytest.mark.parametrize(
    "held", [{"fix": ["x=max"]}, {"fix": ["x>96"]}, {"fix": [], "move": ["x=max: 0,0,0 mm"]}]
)
def test_the_fingers_channel_closes_when_its_held_end_is_capped(held: dict[str, list[str]]) -> None:
    """The channel is what is left of the surface inside of its walls, without the end's ring."""
    finger = make_part(read_mesh("samples/finger.stl").triangles, name="finger").mesh
    facets = read(finger, pressure=["cavity: 20 kPa"], **held).pressures[0].facets
    assert np.count_nonzero(facets) == 754
    low, high = finger.triangles[facets].min((0, 1)), finger.triangles[facets].max((0, 1))
    assert (low > finger.bounds_mm[0]).all()
    assert (high[1:] < finger.bounds_mm[1, 1:]).all()
    assert high[0] == finger.bounds_mm[1, 0]


@pytest.mark.parametrize(("surface", "fix"), [(BEAM, "x=min"), (BEAM, "normal:-x within 5")])
def test_pressure_without_a_cavity_is_refused(surface: Mesh, fix: str) -> None:
    with pytest.raises(ArgumentError, match="the part has no cavity: no closed void, and no"):
        read(surface, fix=[fix], pressure=["cavity: 20 kPa"])


def test_a_tube_is_a_cavity_once_both_ends_are_capped() -> None:
    """A square tube along x: corners at radius 2 and 1, eight walls, and a ring at each end."""
    square = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], float)
    at = np.array([[[[x, *(size * c)] for c in square] for size in (2, 1)] for x in (0, 10)])
    triangles = []
    for i in range(4):
        j = (i + 1) % 4
        quads = (
            (at[0, 0, i], at[0, 0, j], at[1, 0, j], at[1, 0, i]),  # outside
            (at[0, 1, j], at[0, 1, i], at[1, 1, i], at[1, 1, j]),  # inside
            (at[0, 0, j], at[0, 0, i], at[0, 1, i], at[0, 1, j]),  # the ring at x = 0
            (at[1, 0, i], at[1, 0, j], at[1, 1, j], at[1, 1, i]),
        )
        triangles += [t for a, b, c, d in quads for t in ((a, c, b), (a, d, c))]
    tube = mesh(np.array(triangles)[:, ::-1])
    assert tube.volume_mm3 == pytest.approx(120.0)
    with pytest.raises(ArgumentError, match="none closes when x=max is capped; fix the face"):
        read(tube, fix=["x=max"], pressure=["cavity: 20 kPa"])
    both = {"fix": ["x=max"], "move": ["x=min: 0,free,free mm"]}
    facets = read(tube, pressure=["cavity: 20 kPa"], **both).pressures[0].facets
    assert area_mm2(tube, facets) == pytest.approx(80.0)


# --- moments


def test_a_couple_is_the_moment_and_no_force() -> None:
    """Of any selection: the traction is linear in the place, so that three figures fix it."""
    rng = np.random.default_rng(3)
    for _ in range(20):
        weight, place = rng.random(9), rng.normal(size=(9, 3)) * [30.0, 3.0, 1.0] + 40.0
        moment = rng.normal(size=3)
        pulls = couple(weight, place, moment)
        np.testing.assert_allclose(pulls.sum(axis=0), 0.0, atol=1e-12)
        np.testing.assert_allclose(np.cross(place, pulls).sum(axis=0), moment, rtol=1e-9)


def test_a_couple_on_a_square_is_the_stress_of_a_beam() -> None:
    """About an axis in the plane M z / I along the normal; about the normal, M r / (2 I) around."""
    points, weight = np.polynomial.legendre.leggauss(4)
    y, z = (2.0 * grid.ravel() for grid in np.meshgrid(points, points))  # a square of 4 mm
    area = 4.0 * np.outer(weight, weight).ravel()
    place = np.stack([np.full(16, 7.0), y, z], axis=1)
    second = 4.0**4 / 12.0
    bent = couple(area, place, np.array([0.0, 5.0, 0.0])) / area[:, None]
    np.testing.assert_allclose(bent, np.outer(z, [5.0 / second, 0.0, 0.0]), atol=1e-12)
    twisted = couple(area, place, np.array([5.0, 0.0, 0.0])) / area[:, None]
    around = np.stack([0.0 * y, -z, y], axis=1) * 5.0 / (2.0 * second)
    np.testing.assert_allclose(twisted, around, atol=1e-12)


@pytest.mark.parametrize(
    ("unit", "factor"), [("N mm", 1.0), ("Nm", 1e3), ("mN·m", 1.0), ("lbf inch", 112.9848)]
)
def test_a_moment_has_a_unit_of_force_and_one_of_length(unit: str, factor: float) -> None:
    (moment,) = read(moment=f"x=max: 0,2,0 {unit}").moments
    assert moment.moment_N_mm == pytest.approx((0.0, 2.0 * factor, 0.0), rel=1e-6)


# --- what is watched


def test_faces_are_watched_along_several_axes() -> None:
    """What is said twice is told once; a target may stand there."""
    seen = read(watch=["x=max", "x=max ux", "x=max uz = -3 mm", " x=max", "x=max"]).watched
    assert [(w.selector, w.axis) for w in seen] == [("x=max", None), ("x=max", 0), ("x=max", 2)]
    assert LoadCase(["x=max uz=-3 mm", "x=max fz=2 N", "shape: a.csv"]).watched_targets == (
        "x=max uz=-3 mm",
    )


# --- supports


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"fix": []}, "nothing holds the part, .* its x goes from 3.1"),
        (
            {"fix": [], "move": ["z=min: free,free,0 mm"]},
            "the part can still move along x and y and turn about z;",
        ),
        (
            {"fix": [], "move": ["z=min: free,free,0 mm", "x=min: 0,free,free mm"]},
            "the part can still move along y;",
        ),
        (
            {"fix": [], "move": ["near:3.1,0,0,3 and x=min: 0,free,free mm", "z=min: 0,0,free mm"]},
            "still move along z",
        ),
        ({"fix": ["x=min", " x = min"]}, "it is given twice"),
        ({"move": ["x=min: 5,0,0 mm"]}, "contradict each other: .* by 0 and 5 mm along x"),
        ({"fix": ["x<50"], "move": ["x>=50: 5,0,0 mm"]}, "both are on the part at"),
        ({"gravity": None}, "nothing loads the part"),
        ({"gravity": None, "move": ["x=max: 0,0,free mm"]}, "nothing loads the part"),
    ],
)
def test_supports_that_do_not_hold_or_agree_are_refused(
    given: dict[str, object], says: str
) -> None:
    with pytest.raises(ArgumentError, match=says):
        read(**given)


def test_each_body_must_be_held() -> None:
    """A void's walls belong to the body around it; a second body beside it is on its own."""
    two = mesh(
        box((0, 0, 0), (10, 10, 10)),
        box((2, 2, 2), (8, 8, 8))[:, ::-1],
        box((0, 0, 20), (4, 4, 24)),
    )
    says = r"the body from \(0, 0, 20\) to \(4, 4, 24\) mm can still move along x and y and z"
    with pytest.raises(ArgumentError, match=says):
        read(two, fix=["z=min"])
    assert len(read(two, fix=["x=min"]).supports) == 1


def test_a_motion_along_no_axis_is_named_by_its_direction() -> None:
    """A plate whose one face, at 45 degrees to x and y, is held along z turns about that face."""
    turned = BEAM.vertices @ np.array([[1, 1, 0], [-1, 1, 0], [0, 0, np.sqrt(2)]]) / np.sqrt(2)
    hinge = ["normal:1,1,0 within 5: free,free,0 mm"]
    says = r"still move along x and y and turn about z and \(-?0.71, -?0.71, 0\);"
    with pytest.raises(ArgumentError, match=says):
        read(Mesh(turned, BEAM.faces), fix=[], move=hinge)


def test_a_name_that_was_given_is_not_made_for_another() -> None:
    one, two = LoadCase(fix="x=min"), LoadCase(fix="x=max", name="case 1")
    assert [case.name for case in LoadCase.named((one, two))] == ["unnamed case 1", "case 1"]
    assert [case.name for case in LoadCase.named((one, one))] == ["case 1", "case 2"]
    assert LoadCase.named(one) == LoadCase.named(iter([one])) == (one,)
    assert LoadCase.named(two, one) == LoadCase.named((one, two))


def test_the_minus_of_print_is_a_minus() -> None:
    """A load copied from a page was refused with an example that looks the same."""
    printed = {
        "load": "x=max: 0,\N{MINUS SIGN}0.5,\N{MINUS SIGN}1e-3 N",
        "target": "z=max uz=\N{MINUS SIGN}2 mm",
    }
    typed = {key: text.replace("\N{MINUS SIGN}", "-") for key, text in printed.items()}
    assert LoadCase(fix="x>\N{MINUS SIGN}3", **printed) == LoadCase(fix="x>-3", **typed)
    assert read(gravity="\N{MINUS SIGN}z").gravity == read(gravity="-z").gravity
    named = "shape: a\N{MINUS SIGN}b.csv"
    assert LoadCase(target=named).target == (named,)
