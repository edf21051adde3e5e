"""Blends as a user asks for them: dithered cells, bands in turn, mixtures."""

import json
from dataclasses import replace
from pathlib import Path

import lib3mf
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from manifold3d import Manifold

import planner
from benchmarks.audit import audit
from planner.cli import run
from planner.cutting.pieces import split
from planner.errors import ArgumentError, FileError
from planner.fields.basic import AxisField
from planner.formats.threemf import read_threemf
from planner.grading.check import interfaces_cancel
from planner.grading.dither import (
    DitherField,
    affordable_cells,
    count_cells,
    dither_cells,
    dither_pieces,
    own_volumes,
)
from planner.grading.profile import Profile, dithered_profile, stiffness_scale
from planner.grading.regions import blend_segments
from planner.materials.mixtures import TwoPhases
from planner.mesh.mesh import Mesh, join_shells
from planner.mesh.part import moved_to_corner
from planner.simulation.bar import read_profile

SAMPLES = Path(__file__).parents[2] / "samples"
LADDER = (1.0, 2.0, 4.0, 10.0)


def part(solid):
    mesh = solid.to_mesh()
    return moved_to_corner(
        Mesh(np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts))
    )[0]


def bar(length=20.0):
    """A bar of 3 mm by 3 mm as vertices and faces."""
    mesh = Manifold.cube([length, 3, 3]).to_mesh()
    return np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts)


def dealt(mesh, profile, cell_mm, axis=(1.0, 0.0, 0.0)):
    along = blend_segments(profile, LADDER)
    n = np.array(axis) / np.linalg.norm(axis)
    reach = mesh.vertices @ n
    field = AxisField(tuple(n.tolist()), float(reach.min()), float(np.ptp(reach)))
    pieces = dither_pieces(along)
    return DitherField(field, profile, LADDER, along, pieces, mesh.bounds_mm[0], cell_mm)


def check(mesh, field):
    """Cut, and audit every piece and every material as readers see them."""
    pieces = split(mesh, field, field.levels, pitch_mm=field.cell_mm, follow=False)
    grades = np.array([piece.grade for piece in field.pieces])
    members = [np.flatnonzero(grades == g) for g in sorted(set(grades.tolist()))]
    soups = [pieces.vertices[pieces.shell_faces(own)] for own in members]
    soups = [soup for soup in soups if len(soup)]
    assert all(audit(soup).sound for soup in soups)
    assert interfaces_cancel(join_shells(soups), mesh)
    return pieces


SOLIDS = {
    "box": lambda: Manifold.cube([9, 4, 3]),
    "turned box": lambda: Manifold.cube([7, 4, 3]).rotate([10, 20, 30]),
    "drilled ball": lambda: Manifold.sphere(3, 24) - Manifold.cylinder(8, 1, 1, 16, True),
}
PROFILES = {
    "even": Profile("even", (0, 1), (2.8, 2.8), "log"),
    "rising": Profile("rising", (0, 1), (1, 10), "log"),
    "falling": Profile("falling", (0, 1), (12, 0.9), "linear"),
    "there and back": Profile("there", (0, 0.5, 1), (1.5, 7, 1.5), "smooth"),
    "jumps": Profile("jumps", (0, 0.4, 0.4, 1), (1.4, 1.4, 7, 7), "log"),
}


@pytest.mark.parametrize("solid", SOLIDS)
def test_shells_of_dealt_cells_are_sound_and_fit(solid):
    mesh = part(SOLIDS[solid]())
    for profile in PROFILES.values():
        check(mesh, dealt(mesh, profile, 0.5, (1.0, 0.3, 0.2)))


@settings(max_examples=20, deadline=None, derandomize=True)
@given(
    st.floats(0.35, 1.3),
    st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 0.2),
    st.lists(st.floats(0.7, 14.0), min_size=2, max_size=4),
    st.floats(0.0, 300.0),
)
def test_any_cells_anywhere_make_sound_shells(cell_mm, axis, moduli, away):
    mesh = part(Manifold.cube([5, 3, 2.5]).rotate([0, 0, 17]).translate([away, 0, 0]))
    positions = tuple(np.linspace(0, 1, len(moduli)).tolist())
    check(mesh, dealt(mesh, Profile("any", positions, tuple(moduli), "log"), cell_mm, axis))


def test_volume_fractions_are_those_wanted():
    """An even target, so that nothing but the pattern decides."""
    mesh = part(Manifold.cube([10, 10, 10]))
    for target in (2.3, 3.2):
        field = dealt(mesh, Profile("even", (0, 1), (target, target), "log"), 0.4)
        counted = count_cells(mesh, field)
        volumes = check(mesh, field).volumes_mm3
        achieved = volumes[1] / volumes.sum()
        # 15000 cells, less than half a tile: what is seen of it is even within a thousandth.
        assert achieved == pytest.approx(float(counted.wanted[0]), abs=0.002)
        modulus = float(TwoPhases(2.0, 4.0).dithered_MPa(achieved))
        assert modulus == pytest.approx(target, rel=0.006)


def test_a_tally_of_cells_is_near_the_exact_volumes():
    mesh = part(Manifold.sphere(4, 40))
    field = dealt(mesh, PROFILES["there and back"], 0.5)
    exact = check(mesh, field).volumes_mm3
    counted = count_cells(mesh, field)
    # Cells at the surface are counted by 27 of their points.
    np.testing.assert_allclose(
        counted.volume_mm3.sum(axis=0), exact, rtol=0, atol=0.02 * exact.sum()
    )
    assert counted.cells.sum() * 0.5**3 == pytest.approx(mesh.volume_mm3, rel=0.01)


def test_own_volumes_fill_space():
    rng = np.random.default_rng(2)
    label = rng.integers(0, 2, (7, 8, 9)).astype(np.int16)
    inner = own_volumes(np.pad(label, 1, mode="wrap"))[1:-1, 1:-1, 1:-1]
    # On a periodic block what one cell loses another gains.
    padded = np.pad(label, 2, mode="wrap")
    assert own_volumes(padded)[2:-2, 2:-2, 2:-2].sum() == pytest.approx(label.size, rel=0.02)
    assert inner.min() > 0.0


def test_a_material_that_comes_back_is_not_walled_in():
    """Where the target turns round, cells of one material are joined, without sheets between."""
    mesh = part(Manifold.cube([8, 3, 3]))
    field = dealt(mesh, PROFILES["there and back"], 0.5)
    assert [(piece.run, piece.grade) for piece in field.pieces] == [(0, 0), (0, 1), (0, 2), (0, 3)]
    jumping = dealt(mesh, PROFILES["jumps"], 0.5)
    assert [(p.run, p.grade) for p in jumping.pieces] == [(0, 0), (0, 1), (1, 2), (1, 3)]


def test_cells_are_dealt_evenly():
    cell = np.argwhere(np.ones((64, 64, 64), dtype=bool))
    hard = dither_cells(np.full(len(cell), 0.37), cell)
    assert hard.mean() == pytest.approx(0.37, abs=1.0 / 32**3)


@pytest.fixture(scope="module")
def plans(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plans")
    found = {}
    for blend, more in (
        ("nearest", {}),
        ("dither", {"cell_mm": 0.5}),
        ("bands:4", {}),
        ("mix", {"bands": 6}),
    ):
        plan = planner.grade(bar(), from_="FLX9760", to="FLX9785", blend=blend, name="bar", **more)
        found[blend] = plan, plan.write(folder / blend.replace(":", "-"))
    return found


@pytest.mark.parametrize("blend", ["dither", "bands:4", "mix"])
def test_plans_hold_and_read_back(plans, blend):
    plan, folder = plans[blend]
    failed = {name for name, one in plan.checks.items() if not one.ok}
    assert not failed - {"places_too_thin", "thinnest_band_mm"}
    certificate = planner.check(folder)
    assert not certificate.problems
    assert all(one.ok for one in certificate.checks.values())
    back = planner.read_plan(folder)
    assert back.gradient.blend["kind"] == blend.split(":")[0]
    assert [region.printed for region in back.regions] == [r.printed for r in plan.regions]
    volume = sum(region.volume_mm3 for region in back.regions)
    assert volume == pytest.approx(180.0, rel=1e-6)
    assert ("Only a printer whose software" in (folder / "HOWTO.md").read_text()) == (
        blend == "mix"
    )
    document = json.loads((folder / "plan.json").read_text())
    assert all(("material" in r) != (blend == "mix" and "blend" in r) for r in document["regions"])


def test_a_nearest_plan_says_nothing_of_blends(plans):
    document = json.loads((plans["nearest"][1] / "plan.json").read_text())
    assert "blend" not in document["gradient"]
    assert not any("blend" in region for region in document["regions"])


def test_what_a_dithered_region_says(plans):
    plan, _ = plans["dither"]
    pairs = [(r.blend["lower"], r.blend["upper"], r.material) for r in plan.regions]
    assert pairs == [
        ("FLX9760", "FLX9770", "FLX9760"),
        ("FLX9760", "FLX9770", "FLX9770"),
        ("FLX9770", "FLX9785", "FLX9770"),
        ("FLX9770", "FLX9785", "FLX9785"),
    ]
    for soft, hard in zip(plan.regions[::2], plan.regions[1::2], strict=True):
        assert soft.blend == hard.blend
        assert soft.field == hard.field
        achieved = hard.volume_mm3 / (soft.volume_mm3 + hard.volume_mm3)
        assert soft.blend["volume_fraction"] == pytest.approx(achieved)
        low, high = soft.blend["bounds_MPa"]
        assert soft.blend["reuss_MPa"] < low <= soft.modulus_MPa <= high < soft.blend["voigt_MPa"]
        assert soft.blend["fraction"] == [0.0, 1.0]


def test_a_dithered_bar_is_as_stiff_as_its_target(plans):
    """Between nearest and truth: all blends come to the same force, that of the target."""
    force = {
        name: planner.simulate(folder, to_strain=0.02).force_N[-1]
        for name, (_, folder) in plans.items()
    }
    scale = stiffness_scale(planner.load_printer("connex3").palette(), 0.1)
    soft, hard = scale.modulus_of("FLX9760"), scale.modulus_of("FLX9785")
    u = (np.arange(2000) + 0.5) / 2000
    series = 1.0 / np.mean(1.0 / (soft * (hard / soft) ** u))
    ratio = force["dither"] / (9.0 * series * 0.02)
    # Secants at 2 % are not those at 10 %: 12 % for these grades, the same for every blend.
    assert ratio == pytest.approx(1.0, abs=0.15)
    assert force["bands:4"] == pytest.approx(force["dither"], rel=0.01)
    assert force["mix"] == pytest.approx(force["dither"], rel=0.03)


def test_along_a_dithered_plan_the_coordinate_follows_the_target(plans):
    plan, folder = plans["dither"]
    palette = planner.load_printer("connex3").palette()
    u, coordinate = dithered_profile(plan, palette)
    assert (np.diff(coordinate) >= 0).all()
    assert coordinate[[0, -1]].tolist() == pytest.approx([3 / 6, 5 / 6])
    model = stiffness_scale(palette, 0.1).model
    target = model.modulus_MPa(coordinate, 0.1)
    ends = model.modulus_MPa(np.array([3 / 6, 5 / 6]), 0.1)
    np.testing.assert_allclose(np.log(target), np.interp(u, [0, 1], np.log(ends)), atol=1e-6)
    design, _ = read_profile(folder, palette=palette, gauge_mm=20.0)
    np.testing.assert_allclose(design.at(u * 20.0), coordinate, atol=1e-6)
    for moduli in ([1.0, 1.0], [-1.0, 2.0], [0.0, 2.0], [1.0, float("inf")], [2.0]):
        altered = tuple(
            replace(region, blend={**region.blend, "moduli_MPa": moduli}) for region in plan.regions
        )
        with pytest.raises(FileError, match="not that of dithered cells"):
            dithered_profile(replace(plan, regions=altered), palette)


def test_mixtures_in_a_3mf_as_lib3mf_reads_them(plans):
    plan, folder = plans["mix"]
    wrapper = lib3mf.get_wrapper()
    model = wrapper.CreateModel()
    reader = model.QueryReader("3mf")
    reader.SetStrictModeActive(True)
    reader.ReadFromFile(str(folder / "bar.3mf"))
    assert reader.GetWarningCount() == 0
    groups = model.GetCompositeMaterials()
    assert groups.MoveNext()
    group = groups.GetCurrentCompositeMaterials()
    assert group.GetCount() == sum(region.blend is not None for region in plan.regions)
    for entry in group.GetAllPropertyIDs():
        ratios = [part.MixingRatio for part in group.GetComposite(entry)]
        assert sum(ratios) == pytest.approx(1.0, abs=1e-6)
    objects = {item.name: item for item in read_threemf(folder / "bar.3mf").objects}
    for region in plan.regions:
        item = objects[Path(region.file).stem]
        assert item.material_name == region.printed
        if region.blend:
            lower, upper = item.constituents
            assert (lower.name, upper.name) == (region.blend["lower"], region.blend["upper"])
            assert upper.share == pytest.approx(region.blend["fraction"], abs=1e-6)
            assert region.file.endswith(f"_{lower.name}-{100 * lower.share:.1f}_{upper.name}-"
                                        f"{100 * upper.share:.1f}.stl")  # fmt: skip


@pytest.mark.parametrize("profile", ["steps:4", "grades"])
def test_a_modulus_that_is_kept_over_a_stretch_is_mixed_as_it_is(profile):
    """Shares are kept to 0.1 %, which is 0.4 % of the modulus between the farthest neighbours."""
    plan = planner.grade(bar(60.0), from_="Tango", to="Vero", blend="mix", profile=profile)
    assert max(abs(e) for region in plan.regions for e in region.error) < 0.004
    assert len(plan.regions) == (4 if profile == "steps:4" else 10)


def test_mixtures_follow_the_target_within_a_tenth():
    plan = planner.grade(bar(60.0), from_="Tango", to="Vero", blend="mix", name="bar")
    assert max(abs(e) for region in plan.regions for e in region.error) < 0.1
    assert plan.regions[0].material == "TangoPlus"
    assert plan.regions[-1].material == "VeroWhitePlus"
    coordinates = [region.coordinate for region in plan.regions]
    assert coordinates == sorted(coordinates)


def test_differences_name_the_blend(plans):
    from planner.grading.check import diff

    same = planner.read_plan(plans["dither"][1])
    assert diff(same, planner.read_plan(plans["dither"][1])) == ()
    found = diff(planner.read_plan(plans["nearest"][1]), same)
    assert ("blend", "kind nearest") in [(d.what, d.before) for d in found]


def test_same_input_same_bytes(plans):
    again = planner.grade(
        bar(), from_="FLX9760", to="FLX9785", blend="dither", cell_mm=0.5, name="bar"
    )
    assert again.json() == plans["dither"][0].json()
    assert [s.stl for s in again.shells] == [s.stl for s in plans["dither"][0].shells]


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"blend": "dithr"}, "did you mean dither"),
        ({"blend": "bands"}, "did you mean bands:N"),
        ({"blend": "mixed"}, "did you mean mix"),
        ({"blend": 3}, "no such blend"),
        ({"blend": "bands:0"}, "1 to 1000"),
        ({"blend": "bands:many"}, "1 to 1000"),
        ({"blend": "bands:900"}, "thinner than a layer"),
        ({"blend": "dither", "bands": 4}, "goes with `blend` nearest or mix"),
        ({"blend": "bands:2", "bands": 4}, "write `blend` bands:N"),
        ({"blend": "mix", "bands": 100}, "up to 99"),
        ({"cell_mm": 0.5}, "goes with `blend` dither"),
        ({"blend": "dither", "cell_mm": 0.0}, "above 0"),
        ({"blend": "dither", "cell_mm": 0.01}, "take `cell_mm` 0"),
    ],
)
def test_blends_that_cannot_be(options, reason):
    with pytest.raises(ArgumentError, match=reason):
        planner.grade(bar(), from_="FLX9760", to="FLX9785", name="bar", **options)


def test_cells_too_small_or_too_large_are_findings():
    small = planner.grade(bar(4.0), from_="FLX9760", to="FLX9770", blend="dither", cell_mm=0.3)
    assert any("undistorted" in finding.message for finding in small.findings)
    steep = planner.grade(bar(6.0), from_="Tango", to="Vero", blend="dither", cell_mm=1.4)
    assert not steep.checks["volume_fraction_error"].ok
    assert any("too steep" in finding.message for finding in steep.findings)
    whole = planner.grade(bar(), from_="FLX9760", to="FLX9785", blend="dither", cell_mm=100.0)
    assert any("thicker than the part" in finding.message for finding in whole.findings)


def test_thin_bands_of_a_curved_field_are_findings():
    options = {"from_": "FLX9760", "to": "FLX9785", "blend": "bands:3", "pitch_mm": 0.5}
    plan = planner.grade(bar(8.0), field="radial: point=0 0 0, from=1, to=5", **options)
    thin = [finding for finding in plan.findings if finding.kind == "thin-band"]
    assert thin
    assert all(finding.size_mm < 0.42 for finding in thin)
    assert "radial" in plan.gradient.field["name"]


def test_mixtures_say_that_they_are_not_calibrated(plans):
    assert any("not calibrated" in warning for warning in plans["mix"][0].warnings)
    assert not plans["nearest"][0].warnings


def test_the_command_shows_the_blend(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    part = str(SAMPLES / "dogbone.stl")
    options = [
        "--from",
        "FLX9760",
        "--to",
        "FLX9785",
        "--blend",
        "dither",
        "--cell",
        "1.5",
        "-o",
        "d",
    ]
    assert run(["grade", part, *options]) == 0
    assert "% FLX9770 in FLX9760" in capsys.readouterr().out
    assert run(["grade", part, "--from", "Tango", "--to", "Vero", "--blend", "mixt"]) == 2
    assert "did you mean mix" in capsys.readouterr().err


def test_cells_that_are_not_stated_are_affordable_and_pass_their_own_checks() -> None:
    """Half a litre in cells of 0.42 mm would have 10^8 triangles."""
    ladder = Profile("log", (0.0, 1.0), (LADDER[0], LADDER[-1]), "log")
    boxes = map(trimesh.creation.box, ((20.0, 10.0, 10.0), (120.0, 80.0, 50.0)))
    small, mesh = (Mesh(box.vertices, box.faces.astype(np.int32)) for box in boxes)
    cells = dealt(small, ladder, 0.42)
    assert affordable_cells(small, cells, stated=False) is cells
    large = dealt(mesh, ladder, 0.42)
    fitting = affordable_cells(mesh, large, stated=False)
    assert fitting.cell_mm > 0.42
    assert affordable_cells(mesh, fitting, stated=True) is fitting
    with pytest.raises(ArgumentError, match=f"take `cell_mm` {fitting.cell_mm:g} or larger"):
        affordable_cells(mesh, large, stated=True)
    # Where no smaller cell could print, none is advised.
    thin = planner.grade(
        trimesh.creation.box((4.0, 0.8, 0.9)), from_="Tango", to="Vero", blend="dither"
    )
    (found,) = (f for f in thin.findings if f.kind == "cell")
    assert "take --blend nearest" in found.message
    stated = planner.grade(
        trimesh.creation.box((10.0, 2.0, 2.0)),
        from_="Tango", to="Vero", blend="dither", cell_mm=1.5,
    )  # fmt: skip
    cells = [f.message for f in stated.findings if f.kind == "cell"]
    assert any("take a smaller --cell, down to 0.42" in message for message in cells)
