"""Grading like an earlier plan: the targets in MPa stay, what meets them changes."""

import json
from dataclasses import replace
from pathlib import Path

import manifold3d as m3
import numpy as np
import pytest

import planner
from planner.cli import run
from planner.errors import ArgumentError, PlannerError
from planner.fields.parse import Setting, build_field, field_text
from planner.mesh.mesh import Mesh
from planner.palette import LawParameters, Palette

BAR = m3.Manifold.cube([40.0, 8.0, 6.0]).to_mesh()
MESH = (np.asarray(BAR.vert_properties[:, :3]), np.asarray(BAR.tri_verts))
ENDS = {"from_": "Tango", "to": "FLX9795"}


def softer(palette: Palette, factor: float) -> Palette:
    """Every law with its stress times a factor: as a correction for a warmer place leaves it."""

    def scaled(law: LawParameters) -> LawParameters:
        own = {
            name: tuple(v * factor for v in values) if name.endswith("_MPa") else values
            for name, values in law.parameters.items()
        }
        return replace(law, parameters=own)

    changed = tuple(replace(m, law=scaled(m.law), published=None) for m in palette.materials)
    return replace(palette, name="softer", materials=changed).known_by("1" * 64)


@pytest.fixture(scope="module")
def palette() -> Palette:
    return planner.load_printer("connex3").palette()


@pytest.fixture(scope="module")
def first() -> planner.Plan:
    return planner.grade(MESH, **ENDS, axis="x")


def test_ends_given_as_materials_move_with_the_palette_and_no_cut_moves(first, palette) -> None:
    """What --like is for: without it a correction leaves the print as it was."""
    again = planner.grade(MESH, **ENDS, axis="x", palette=softer(palette, 0.65))
    cuts, cuts_again = ([r.field for r in plan.regions] for plan in (first, again))
    assert np.asarray(cuts_again) == pytest.approx(np.asarray(cuts), abs=1e-9)


def test_the_targets_stay_and_the_cuts_move_to_meet_them(first, palette) -> None:
    """A factor f on all stiffness moves each cut of a log profile by ln(f) / ln(E1/E0)."""
    plan = planner.grade(MESH, like=first, palette=softer(palette, 0.65))
    low, high = first.gradient.profile["moduli_MPa"]
    shift = np.log(0.65) / np.log(high / low)
    cut = {r.material: r.field[1] for r in first.regions[:-1]}
    moved = {r.material: r.field[1] for r in plan.regions[:-1] if r.material in cut}
    assert len(moved) > 4
    for material, at in moved.items():
        # 1e-8: nine digits of moduli that a plan keeps, were it read from a file.
        assert at == pytest.approx(cut[material] + shift, abs=1e-8)
    assert plan.gradient.profile == first.gradient.profile
    assert plan.gradient.field == first.gradient.field
    # The softest is needed nowhere any more: its neighbour, softened, is nearer to 0.36 MPa.
    assert plan.regions[0].material == "FLX9740"
    # Within half a step between neighbours everywhere: ln(26.0 / 7.8) / 2 is the widest.
    assert max(abs(np.log1p(e)) for r in plan.regions for e in r.error) < 0.61


def test_with_the_same_palette_it_is_the_same_print(first, tmp_path: Path) -> None:
    """From the file too, whose moduli are rounded: no target falls out of the palette's reach."""
    folder = first.write(tmp_path / "bar")
    for like in (first, folder, folder / "plan.json"):
        plan = planner.grade(MESH, like=like)
        assert plan.unreachable == ()
        found, expected = ([r.field for r in p.regions] for p in (plan, first))
        assert np.asarray(found) == pytest.approx(np.asarray(expected), abs=1e-8)
        assert [r.material for r in plan.regions] == [r.material for r in first.regions]


def test_a_plan_says_what_it_follows(first, palette, tmp_path: Path) -> None:
    folder = first.write(tmp_path / "bar")
    plan = planner.grade(MESH, like=folder, palette=softer(palette, 0.65))
    again = planner.read_plan(plan.write(tmp_path / "again"))
    gradient = json.loads((tmp_path / "again" / "plan.json").read_text())["gradient"]
    scale = planner.list_materials(palette=palette)
    ends = [f"{scale.modulus_of(id):.9g}MPa" for id in ("TangoPlus", "FLX9795")]
    assert [gradient["from"], gradient["to"]] == ends
    assert gradient["like"]["palette"]["name"] == "connex3-tango-vero"
    assert (gradient["like"]["from"], gradient["like"]["to"]) == ("TangoPlus", "FLX9795")
    assert len(gradient["like"]["plan_sha256"]) == 64
    assert again.json() == (tmp_path / "again" / "plan.json").read_bytes()
    assert "like" not in first.document()["gradient"]
    assert not plan.warnings


def test_targets_out_of_reach_are_said(first, palette, tmp_path: Path, capsys) -> None:
    """Twice as stiff, the palette begins above the softest target; the command exits with 1."""
    stiff = tmp_path / "stiff.toml"
    planner.write_palette(softer(palette, 2.0), stiff)
    folder = first.write(tmp_path / "bar")
    part = tmp_path / "bar.stl"
    _write_bar(part)
    command = ["grade", str(part), "--like", str(folder), "--palette", str(stiff)]
    assert run([*command, "-o", str(tmp_path / "out")]) == 1
    told = capsys.readouterr().err
    assert "target 0.359 .. 0.719 MPa at field 0.000 .. 0.164 is out of reach" in told
    doubled = 2.0 * planner.list_materials(palette=palette).modulus_of("TangoPlus")
    assert f"the nearest is TangoPlus with {doubled:.3g} MPa" in told


def test_another_part_is_a_warning(first) -> None:
    longer = (MESH[0] * [1.5, 1.0, 1.0], MESH[1])
    plan = planner.grade(longer, like=first)
    assert any("not the part of the plan" in warning for warning in plan.warnings)
    # The gradient lies where it lay: it ends 40 mm along, and what is beyond has the last target.
    assert plan.gradient.field == first.gradient.field
    anew = planner.grade(longer, like=first, axis="x")
    assert anew.gradient.field["span_mm"] == pytest.approx(60.0)


@pytest.mark.parametrize(
    "options",
    [
        {"bands": 4},
        {"blend": "bands:3"},
        {"blend": "dither", "cell_mm": 1.0},
        {"blend": "mix"},
        {"profile": "steps:3"},
        {"profile": planner.Profile("mine", (0, 0.4, 1), (0.5, 2, 5), "linear")},
        {"at_strain": 0.2},
        {"axis": (1, 1, 0)},
        {"tolerance": 1.3},
    ],
)
def test_every_option_of_the_earlier_plan_is_taken(options) -> None:
    ends = {} if isinstance(options.get("profile"), planner.Profile) else ENDS
    old = planner.grade(MESH, **{"axis": "x", **ends, **options})
    new = planner.grade(MESH, like=old)
    assert new.gradient.profile == old.gradient.profile
    assert new.gradient.blend == old.gradient.blend
    assert new.gradient.bands == old.gradient.bands
    assert replace(new.stiffness, alternatives={}) == replace(old.stiffness, alternatives={})
    assert "without --bands" not in new.stiffness.alternatives  # nobody gave it
    for name, value in old.gradient.field.items():
        assert new.gradient.field[name] == (value if name == "name" else pytest.approx(value))
    assert [r.printed for r in new.regions] == [r.printed for r in old.regions]
    limits = [plan.checks["worst_stiffness_error"].limit for plan in (new, old)]
    assert limits == [options.get("tolerance", 2.0)] * 2


def test_options_beside_it_win(first) -> None:
    plan = planner.grade(MESH, like=first, axis="-x", bands=5, profile="linear")
    assert plan.gradient.bands == 5
    assert plan.gradient.field["direction"] == [-1.0, 0.0, 0.0]
    assert plan.gradient.profile["shape"] == "linear"
    assert plan.gradient.profile["moduli_MPa"] == first.gradient.profile["moduli_MPa"]
    mixed = planner.grade(MESH, like=plan, blend="dither")
    assert mixed.gradient.blend["kind"] == "dither"
    assert mixed.gradient.bands is None
    wide = planner.grade(MESH, like=planner.grade(MESH, **ENDS, tolerance=1.3), tolerance=3)
    assert wide.checks["worst_stiffness_error"].limit == 3.0


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"from_": "Tango"}, "`from_` Tango contradicts `like`.*leave out one"),
        ({"to": 7.0}, "`to` 7.0 contradicts `like`"),
        ({"at_strain": 0.2}, "secant moduli up to a strain of 0.1"),
        ({"axis": "x", "field": "axis: x"}, "not both"),
        ({"like": 3}, "3: give `like` as a planner.Plan"),
        ({"like": "nowhere"}, "no such file or folder"),
    ],
)
def test_contradictions_are_refused(first, options, reason) -> None:
    with pytest.raises(PlannerError, match=reason):
        planner.grade(MESH, **{"like": first, **options})


def test_a_palette_that_the_printer_has_not_must_be_given(first, palette) -> None:
    warm = planner.grade(MESH, like=first, palette=softer(palette, 0.65))
    with pytest.raises(ArgumentError, match="palette softer"):
        planner.grade(MESH, like=warm)


# ------------------------------------------------------------------------------------------------
# Ends as moduli: the same path.


@pytest.mark.parametrize(
    ("from_", "to"),
    [
        (0.5, 7.0),
        ("0.5MPa", "7 MPa"),
        ("500kPa", "0.007GPa"),
        ("5e2 kpa", 7),
        ("0.5 N/mm2", "7 N/mm²"),
        ("5 bar", "7e6 Pa"),
    ],
)
def test_ends_may_be_moduli(from_, to) -> None:
    plan = planner.grade(MESH, from_=from_, to=to)
    assert plan.gradient.profile["moduli_MPa"] == pytest.approx([0.5, 7.0])
    assert (plan.gradient.start, plan.gradient.end) == ("0.5MPa", "7MPa")


def test_materials_and_moduli_may_be_mixed(tmp_path: Path) -> None:
    part = tmp_path / "bar.stl"
    _write_bar(part)
    out = tmp_path / "out"
    assert run(["grade", str(part), "--from", "Tango", "--to", "7MPa", "-o", str(out), "-q"]) == 0
    assert planner.read_plan(out).gradient.start == "TangoPlus"
    assert planner.read_plan(out).gradient.end == "7MPa"


@pytest.mark.parametrize(
    ("end", "reason"),
    [
        ("0.5", "write a decimal point and its unit"),
        ("0.5foo", "write a decimal point and its unit"),
        ("0.5N", "write a decimal point and its unit"),
        ("0.5mPa", "write a decimal point and its unit"),
        ("0,5MPa", "write a decimal point and its unit"),
        ("1,5 N/mm²", "write a decimal point and its unit"),
        ("-1MPa", "above 0"),
        (0.0, "above 0"),
        (float("nan"), "finite"),
        ("7MPa", "are one"),
        ([], "finite number"),
    ],
)
def test_ends_that_cannot_be(end, reason) -> None:
    with pytest.raises(ArgumentError, match=reason):
        planner.grade(MESH, from_=end, to=7.0)


# ------------------------------------------------------------------------------------------------
# A field read back from what a plan says of it.


@pytest.mark.parametrize(
    "field",
    [
        "axis: -1,2,0.5",
        "radial: line=0 6 6 1 0 0, to=5",
        "radial: point=0 6 6",
        "distance: surface, to=2",
        "distance: box=-1 -1 -1 41 0.5 7",
        "distance: hole=20 8 3",
        "distance: plane=0 0 0 0 0 1, from=1, to=5",
        "harmonic: from=x<4, to=ball 38 6 6 6",
        "geodesic: start=box -1 -1 -1 3 20 20",
        "expression: 0.5 + 0.5*sin(2*pi*x/40)",
        "max(axis: x; clamp(radial: point=0 6 6, to=12; 0.2; 0.8))",
        "blend(axis: x; axis: z; 0.25)",
    ],
)
def test_a_field_is_built_again_from_its_description(field) -> None:
    """At another place, too: positions are moved with the part, to roundings of the shift."""
    vertices, faces = MESH[0].astype(float), MESH[1].astype(np.int64)
    here, there = (1.0, 2.0, 3.0), (5.0, 5.0, 1.0)
    first, second = (Setting(Mesh(vertices + np.array(at), faces), at, 0.5) for at in (here, there))
    old = build_field(field, first)
    text = field_text(json.loads(json.dumps(old.description())), here)
    points = np.random.default_rng(1).uniform([0, 0, 0], [40, 8, 6], (200, 3))
    again = build_field(text, second).values(points + there)
    assert again == pytest.approx(old.values(points + here), abs=1e-9)


@pytest.mark.parametrize(
    ("says", "reason"),
    [
        ({"name": "table", "file": "a.csv", "sha256": ""}, "a.csv, which plan.json does not hold"),
        ({"name": "function", "function": "f"}, "made of f, which plan.json does not hold"),
        ({"name": "axis"}, "give the field again"),
        ({}, "give the field again"),
    ],
)
def test_a_field_that_a_plan_does_not_hold_must_be_given(says, reason) -> None:
    with pytest.raises(PlannerError, match=reason):
        field_text(says, (0.0, 0.0, 0.0))


def _write_bar(path: Path) -> None:
    from planner.formats.mesh_file import encode_stl

    path.write_bytes(encode_stl(MESH[0].astype(np.float32), MESH[1], "bar"))
