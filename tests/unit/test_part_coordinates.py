"""What a plan prints at a place: its field, or its shells, in the part's own coordinates."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import planner
from benchmarks.interfaces import BOX, FACES
from planner.errors import ArgumentError, FileError
from planner.formats.mesh_file import read_mesh
from planner.mesh.distance import triangle_tree
from planner.mesh.mesh import Topology
from planner.mesh.part import make_part
from planner.plan import read_shells
from planner.printers import load_printer
from planner.simulation.bar import united
from planner.simulation.part import open_solid

PALETTE = load_printer("connex3").palette()
ENDS = {"from_": "Tango", "to": "FLX9795", "pitch_mm": 2.0}
CORNER = np.array([7.0, -3.0, 2.0])
SIZE = np.array([40.0, 12.0, 10.0])


def graded(**options: object) -> planner.Plan:
    return planner.grade((CORNER + SIZE * BOX, FACES), name="box", **{**ENDS, **options})  # type: ignore[arg-type]


def filling(plan: planner.Plan) -> Callable[[np.ndarray], np.ndarray]:
    return open_solid(plan, None, None, None, None).filling


def by_x(points: np.ndarray) -> np.ndarray:
    return (points[:, 0] - CORNER[0]) / SIZE[0]


@pytest.fixture(scope="module")
def points() -> np.ndarray:
    return CORNER + SIZE * np.random.default_rng(3).random((400, 3))


@pytest.mark.parametrize(
    "options",
    [
        {"axis": "x"},
        {"axis": "-1,2,0", "blend": "mix", "bands": 7},
        {"axis": "x", "blend": "bands:2"},
        {"field": "radial: point=7 -3 2, to=30"},
        {"field": "min(axis: x; distance: surface, to=6)", "pitch_mm": 0.5},
        {"field": "harmonic: from=x<8, to=x>46"},
        {"field": "distance: box=6 -4 1 8 10 13"},  # of faces: the shells are looked at
        {"field": by_x},
    ],
    ids=lambda options: "a function" if options == {"field": by_x} else str(options),
)
def test_a_place_is_of_the_shell_that_holds_it(
    options: dict[str, object], points: np.ndarray
) -> None:
    """Level sets are drawn on a grid, so that a place beside one may be on either side."""
    plan = graded(**options)
    found = filling(plan)(points)
    placed = points + plan.part.translation_mm
    alike = np.zeros(len(points), bool)
    beside = np.full(len(points), np.inf)
    for file, soup in read_shells(plan):
        distance, outside = triangle_tree(united({file: soup})).distances(placed)
        of_file = [r.coordinate for r in plan.regions if r.file == file]
        alike |= ~outside & (np.abs(found[:, None] - of_file) < 1e-9).any(axis=1)
        beside = np.minimum(beside, distance)
    assert (alike | (beside < 1.0)).all()
    assert np.count_nonzero(alike) > 0.9 * len(points)


def test_dithered_cells_count_as_their_mixture(points: np.ndarray) -> None:
    """The coordinate rises along the axis from end to end, without the grades' steps."""
    plan = graded(axis="x", blend="dither", cell_mm=2.0)
    along = points[np.argsort(points[:, 0])]
    found = filling(plan)(along)
    assert (np.diff(found) >= 0.0).all()
    assert len(np.unique(np.round(found, 9))) > 0.9 * len(found)
    with pytest.raises(ArgumentError, match="no mixture is known; grade it with another `blend`"):
        filling(graded(field=by_x, blend="dither", cell_mm=2.0))


@pytest.mark.parametrize(
    "options", [{"axis": "x"}, {"axis": "1,1,0", "blend": "dither", "cell_mm": 2.0}], ids=str
)
def test_the_outer_surface_of_a_plan_is_the_parts(options: dict[str, object]) -> None:
    surface = open_solid(graded(**options), None, None, None, None).surface
    assert Topology(surface.faces).closed
    assert surface.volume_mm3 == pytest.approx(SIZE.prod(), rel=1e-6)  # float32
    assert surface.area_mm2 == pytest.approx(2 * (40 * 12 + 40 * 10 + 12 * 10), rel=1e-6)
    np.testing.assert_allclose(surface.bounds_mm, [CORNER, CORNER + SIZE], atol=1e-5)


def test_a_real_part_read_from_its_folder(samples: Path, tmp_path: Path) -> None:
    """The same from the folder; an altered or missing shell is told."""
    mesh = make_part(read_mesh(samples / "finger.stl").triangles, name="finger").mesh
    plan = planner.grade(samples / "finger.stl", from_="Tango", to="FLX9795", axis="x")
    folder = plan.write(tmp_path / "finger-graded")
    solid = open_solid(str(folder), None, None, None, None)
    assert solid.surface.volume_mm3 == pytest.approx(mesh.volume_mm3, rel=1e-6)
    inside = np.array([[1.0, 5.0, 2.0], [96.0, 5.0, 2.0]])  # at both ends, in the floor
    ends = [PALETTE.resolve(name).coordinate for name in ("Tango", "FLX9795")]
    np.testing.assert_array_equal(solid.filling(inside), ends)
    np.testing.assert_array_equal(filling(plan)(inside), ends)
    shell = folder / plan.regions[2].file
    shell.write_bytes(shell.read_bytes()[:-50] + bytes(50))
    with pytest.raises(FileError, match="not what the plan was written with"):
        open_solid(folder, None, None, None, None)


def test_shells_of_another_part_are_told() -> None:
    plan = graded(axis="x")
    other = dataclasses.replace(plan.part, volume_mm3=1.01 * plan.part.volume_mm3)
    with pytest.raises(FileError, match="the shells of box make up 4800 mm3, the part is 4848 mm3"):
        filling(dataclasses.replace(plan, part=other))


@pytest.mark.parametrize(
    ("source", "material", "unit", "says"),
    [
        ("mesh", None, None, "`material` is missing: a mesh has none of its own; give one, as"),
        ("nowhere", None, None, "nowhere: no such file"),
        ("mesh", "FLX976", None, "FLX9760"),
        ("plan", "FLX9760", None, "`material` FLX9760: it goes with a mesh"),
        ("plan", None, "cm", "`unit` cm: it goes with a mesh"),
    ],
)
def test_a_mesh_has_one_material_and_a_plan_its_own(
    source: str, material: str | None, unit: str | None, says: str
) -> None:
    mesh = CORNER + SIZE * BOX, FACES
    given = graded(axis="x") if source == "plan" else mesh if source == "mesh" else source
    if says == "FLX9760":
        assert (open_solid(given, material, unit, None, None).filling(np.zeros((2, 3))) > 0).all()
        return
    with pytest.raises(planner.PlannerError, match=says):
        open_solid(given, material, unit, None, None)
