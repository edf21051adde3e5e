"""Interfaces of curved fields lie within 20 um of their level sets, vertices and faces."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from manifold3d import Manifold

import planner
from benchmarks import interfaces
from benchmarks.audit import audit
from planner.cutting.pieces import Pieces, split
from planner.fields.basic import FunctionField
from planner.fields.solved import over_cells
from planner.formats.mesh_file import decode_stl
from planner.grading import printability
from planner.grading.check import interfaces_cancel
from planner.mesh.distance import triangle_tree
from planner.mesh.mesh import Mesh, join_shells
from planner.mesh.part import moved_to_corner
from planner.voxels.columns import Grid

WITHIN_MM = 0.02


def part(solid: Manifold) -> Mesh:
    mesh = solid.to_mesh()
    return moved_to_corner(
        Mesh(np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts))
    )[0]


BALL = part(Manifold.sphere(10.0, 64))
BOX = part(Manifold.cube([24.0, 16.0, 12.0]))


def radius(mesh: Mesh):
    centre = mesh.bounds_mm.mean(axis=0)
    return lambda p: np.sqrt(((p - centre) ** 2).sum(axis=1)) / 16.0


def helicoid(mesh: Mesh):
    centre = mesh.bounds_mm.mean(axis=0) + np.array([0.0, 20.0, 0.0])  # its axis is outside
    return lambda p: (
        0.5 + 0.35 * np.arctan2(*(p - centre)[:, :2].T) % np.pi / np.pi + p[:, 2] / 60.0 - 0.25
    )


def wave(mesh: Mesh):
    return lambda p: p[:, 2] / 14.0 + 0.1 * np.sin(p[:, 0] / 3.0) * np.cos(p[:, 1] / 4.0)


def table(mesh: Mesh):
    """A table with a row every 4 mm, linear between them along each axis."""
    x, y, z = np.meshgrid(*[np.arange(8.0)] * 3, indexing="ij")
    values = 0.2 + 0.07 * x + 0.02 * np.sqrt(y + 1.0) + 0.01 * z
    return over_cells(Grid((-1.0, -1.0, -1.0), (4.0, 4.0, 4.0), (8, 8, 8)), values)


def ridge(mesh: Mesh):
    """A distance with one crease, a plane aslant: the nearer of two walls."""
    low = mesh.bounds_mm[0]
    return lambda p: np.minimum(p[:, 0] - low[0], 0.8 * (p[:, 1] - low[1]) + 2.0) / 16.0


def off_mm(pieces: Pieces, field: FunctionField, levels: np.ndarray) -> list[np.ndarray]:
    """How far corners of faces lie, and middles, by the field's own slope."""

    def distance(points: np.ndarray, level: np.ndarray) -> np.ndarray:
        step = 1e-4
        ahead = [field.values(points + step * axis) for axis in np.eye(3)]
        behind = [field.values(points - step * axis) for axis in np.eye(3)]
        slope = np.linalg.norm((np.array(ahead) - behind) / (2.0 * step), axis=0)
        return np.abs(field.values(points) - level) / slope

    corners = pieces.vertices[pieces.cap_faces].astype(float)
    level = levels[pieces.cap_level]
    ends = distance(corners.reshape(-1, 3), np.repeat(level, 3))
    return [ends, distance(corners.mean(axis=1), level)]


@pytest.mark.parametrize(
    ("mesh", "make"),
    [(BALL, radius), (BOX, radius), (BOX, helicoid), (BOX, wave), (BOX, table)],
    ids=["radius in a ball", "radius in a box", "helicoid", "wave", "table"],
)
def test_interfaces_are_within_a_stated_distance(mesh: Mesh, make) -> None:
    field, levels = FunctionField("function", make(mesh)), np.array([0.15, 0.3, 0.45, 0.6])
    pieces = split(mesh, field, levels, pitch_mm=0.5, within_mm=WITHIN_MM)
    ends, middles = off_mm(pieces, field, levels)
    assert len(middles) > 100
    # Corners keep off the grid's vertices by a thousandth of an edge of at most 2 sqrt(3) mm; where
    # a face ends at the part's surface its corners lie anywhere in it.
    assert np.quantile(ends, 0.5) < 0.2 * WITHIN_MM
    assert np.quantile(ends, 0.99) < WITHIN_MM
    assert ends.max() < 2.0 * WITHIN_MM
    assert np.quantile(middles, 0.99) < WITHIN_MM
    assert middles.max() < 1.5 * WITHIN_MM  # where the slope changes within a tetrahedron
    soups = [pieces.vertices[pieces.shell_faces([i])] for i in range(pieces.count)]
    soups = [soup for soup in soups if len(soup)]
    assert all(audit(soup).sound for soup in soups)
    assert interfaces_cancel(join_shells(soups), mesh)


def test_flat_fields_take_few_triangles() -> None:
    """A cube's section, where no finer one is needed; five times fewer than at the pitch."""
    field, levels = FunctionField("function", radius(BALL)), np.array([0.3, 0.45])
    divided = split(BALL, field, levels, pitch_mm=0.25, within_mm=WITHIN_MM)
    fine = split(BALL, field, levels, pitch_mm=0.25)
    assert 4 * len(divided.cap_faces) < len(fine.cap_faces)


def test_a_crease_is_followed_to_the_deepest_division() -> None:
    field, levels = FunctionField("function", ridge(BOX)), np.array([0.3, 0.45])
    pieces = split(BOX, field, levels, pitch_mm=0.5, within_mm=WITHIN_MM)
    _, middles = off_mm(pieces, field, levels)
    assert middles.max() < 2.0 * WITHIN_MM
    assert np.quantile(middles, 0.99) < WITHIN_MM


def test_levels_close_together_do_not_cross() -> None:
    """Faces of the next level lie above those of the one below, however near they are."""
    levels = np.array([0.3, 0.3002, 0.3005, 0.45])
    field = FunctionField("function", radius(BALL))
    pieces = split(BALL, field, levels, pitch_mm=0.5, within_mm=WITHIN_MM)
    volume = pieces.measures.volume_mm3
    assert (volume > 0.0).all()
    wanted = 4.0 * np.pi * (16.0 * 0.3) ** 2 * 16.0 * np.diff(levels[:3])
    # Bands of 3 and 5 um; each level may move by a thousandth of an edge, 0.5 mm long there.
    np.testing.assert_allclose(volume[1:3], wanted, rtol=0.15)


def corner(mesh: Mesh):
    """Distances from three walls, whose creases meet along a line and in a point."""
    low = mesh.bounds_mm[0]
    return lambda p: (p - low).min(axis=1) / 12.0


@pytest.mark.parametrize("make", [ridge, corner])
def test_creases_take_few_triangles(make) -> None:
    """Edges are divided where they meet a crease, and little else is."""
    field, levels = FunctionField("function", make(BOX)), np.array([0.15, 0.3, 0.45])
    plain = split(BOX, field, levels, pitch_mm=2.0)
    pieces = split(BOX, field, levels, pitch_mm=0.5, within_mm=WITHIN_MM)
    assert len(pieces.cap_faces) < 12 * len(plain.cap_faces)
    assert_near_and_sound(pieces, field, levels, BOX)


def assert_near_and_sound(
    pieces: Pieces, field: FunctionField, levels: np.ndarray, mesh: Mesh
) -> None:
    ends, middles = off_mm(pieces, field, levels)
    assert np.quantile(ends, 0.99) < WITHIN_MM
    assert np.quantile(middles, 0.99) < WITHIN_MM
    soups = [pieces.vertices[pieces.shell_faces([i])] for i in range(pieces.count)]
    assert all(audit(soup).sound for soup in soups)
    assert interfaces_cancel(join_shells(soups), mesh)


def depth(mesh: Mesh):
    """How deep points lie below a part's surface."""
    tree = triangle_tree(mesh)

    def below(points: np.ndarray) -> np.ndarray:
        distance, outside = tree.distances(points)
        return np.where(outside, -distance, distance) / 2.0

    return below


def zigzag(mesh: Mesh):
    """Up and down along a line aslant, every 1.7 mm: edges of cubes of 2 mm meet two creases."""
    way = np.array([0.8, 0.5, 0.33]) / np.linalg.norm([0.8, 0.5, 0.33])
    return lambda p: 0.5 + 0.4 * np.abs((p @ way / 1.7) % 2.0 - 1.0)


@pytest.mark.parametrize(
    ("mesh", "make", "levels", "most"),
    [
        (part(Manifold.cube([6.0, 4.0, 1.8]).rotate([20.0, 30.0, 0.0])), depth,
         [0.1, 0.25, 0.4], 8_000),
        (part(Manifold.cube([9.0, 7.0, 5.0])), zigzag, [0.55, 0.62, 0.7, 0.8], 10_000),
    ],
    ids=["a wall thinner than a cube", "several creases on an edge"],
)  # fmt: skip
def test_creases_near_each_other_take_few_triangles(mesh: Mesh, make, levels, most: int) -> None:
    """Halving alone, in the middle, took 18,730 and 15,739."""
    field, levels = FunctionField("function", make(mesh)), np.array(levels)
    pieces = split(mesh, field, levels, pitch_mm=0.5, within_mm=WITHIN_MM)
    assert len(pieces.cap_faces) < most
    assert_near_and_sound(pieces, field, levels, mesh)


def test_a_cavity_whose_surface_no_level_meets_is_on_its_side_of_the_level() -> None:
    """Undivided, the grid tells its corners 0.13 to 0.23 in place of 0: the other side."""
    size, cavity = np.array([14.0, 10.0, 8.0]), np.array([10.4, 6.4, 4.4])
    hollow = Manifold.cube(size.tolist()) - Manifold.cube(cavity.tolist()).translate([1.8] * 3)
    mesh = part(hollow.rotate([10.0, 20.0, 30.0]))
    field = FunctionField("function", depth(mesh))
    pieces = split(mesh, field, np.array([0.1]), pitch_mm=0.8, within_mm=WITHIN_MM)
    # It lies 0.2 mm deep. Round edges of the offset cavity take less than the tolerance.
    inner, outer = size - 0.4, cavity + 0.4
    skins = size.prod() - inner.prod() + outer.prod() - cavity.prod()
    level_mm2 = pieces.measures.area_mm2[1] / 2.0
    assert pieces.volumes_mm3[0] == pytest.approx(skins, abs=WITHIN_MM * level_mm2)


def shells_of(folder: Path) -> list[np.ndarray]:
    document = json.loads((folder / "plan.json").read_text())
    files = dict.fromkeys(region["file"] for region in document["regions"])
    return [decode_stl((folder / file).read_bytes(), file) for file in files]


def shared(soups: list[np.ndarray]) -> np.ndarray:
    """Triangles that two shells have, as one of them has them."""
    seen: dict[bytes, np.ndarray] = {}
    found = []
    for triangle in np.concatenate(soups):
        key = triangle[np.lexsort(triangle.T)].tobytes()
        if key in seen:
            found.append(triangle)
        seen[key] = triangle
    return np.array(found, dtype=float)


def radial(points: np.ndarray) -> np.ndarray:
    return np.sqrt(((points - [20.0, 30.0, 10.0]) ** 2).sum(axis=-1)) / 50.0


def wall(points: np.ndarray) -> np.ndarray:
    """Depth below the surface of a block of 24 x 16 x 12 mm, where it is inside."""
    return np.minimum(points, [24.0, 16.0, 12.0] - points).min(axis=-1) / 6.0


def wavy(points: np.ndarray) -> np.ndarray:
    return 0.1 + points[..., 2] / 16.0 + 0.08 * np.sin(points[..., 0] / 3.0)


SAID = {
    "radial": ("radial: point=20 30 10, from=0, to=50", radial, 1.0 / 50.0, None),
    "distance": ("distance: surface, to=6", wall, 1.0 / 6.0, None),
    "expression": ("expression: 0.1 + z/16 + 0.08*sin(x/3)", wavy, None, None),
    "a coarse pitch": ("radial: point=20 30 10, from=0, to=50", radial, 1.0 / 50.0, 4.0),
}


@pytest.mark.parametrize(("text", "field", "slope", "pitch_mm"), SAID.values(), ids=SAID)
def test_a_plan_says_what_its_files_show(tmp_path, text, field, slope, pitch_mm) -> None:
    """Measured again from the bytes of the shells, by formulas of this file."""
    mesh = Manifold.cube([24.0, 16.0, 12.0]).to_mesh()
    block = np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts)
    plan = planner.grade(
        block, from_="Tango", to="Vero", field=text, bands=4, pitch_mm=pitch_mm, tolerance=1000
    )
    check, folder = plan.checks["interface_error_um"], plan.write(tmp_path / "out")
    triangles = shared(shells_of(folder)) - np.array(plan.part.translation_mm)
    places = np.concatenate([triangles, triangles.mean(axis=1, keepdims=True)], axis=1)
    if slope is None:
        x = triangles.mean(axis=1)[:, 0]
        slope = np.sqrt(1.0 / 16.0**2 + (0.08 / 3.0 * np.cos(x / 3.0)) ** 2)
    levels = np.array([0.25, 0.5, 0.75])
    nearest = levels[np.abs(field(places)[:, 3:] - levels).argmin(axis=1)]
    off = 1e3 * np.abs(field(places) - nearest[:, None]).max(axis=1) / slope
    area = np.linalg.norm(
        np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1
    )
    order = np.argsort(off)
    share = np.cumsum(area[order]) / area.sum()
    kept = [off[order[np.searchsorted(share, s)]] for s in (0.9, 0.99)]
    if pitch_mm is None:
        assert check.ok
        assert check.limit == 20.0
        assert kept[1] <= 20.0
        assert check.value == pytest.approx(kept[1], rel=0.1, abs=0.3)
        assert not any("interfaces" in said for said in plan.warnings)
    else:
        assert check.limit == 1e3 * pitch_mm / 2.0
        assert check.value == pytest.approx(kept[0], rel=0.1)
        assert kept[1] > 20.0
        (told,) = [said for said in plan.warnings if "interfaces" in said]
        within = 100.0 * share[np.searchsorted(off[order], 20.0) - 1]
        assert f"over {within:.0f} %" in told or f"over {np.floor(within):.0f} %" in told
        assert "without --pitch" in told
    written = json.loads((folder / "plan.json").read_text())["checks"]["interface_error_um"]
    assert written["value"] == pytest.approx(check.value)


def test_none_within_20_um_is_told_as_0_per_cent(monkeypatch: pytest.MonkeyPatch) -> None:
    far = np.array([0.4, 0.52]), np.array([0.6, 0.4])
    monkeypatch.setattr(printability, "_interface_distances_mm", lambda part: far)
    monkeypatch.setattr(printability, "_lost_at_the_surface", lambda part: [])
    part = SimpleNamespace(within_mm=np.inf, pitch_mm=4.0)
    _, (told,) = printability._interfaces(part, [])
    assert "over 0 % of their area, and 520 um or more off" in told


def test_a_band_at_the_surface_that_cells_are_too_large_for_is_found() -> None:
    """The softest lies within 0.38 mm of a face: between it and the first cells of 1 mm."""
    given = {"from_": "Tango", "to": "Vero", "field": "distance: box=-9 -9 -9 29 21 0, to=10"}
    box = interfaces.BOX * [20.0, 12.0, 6.0], interfaces.FACES
    coarse = planner.grade(box, pitch_mm=1.0, **given)
    assert "TangoPlus" not in {region.material for region in coarse.regions}
    told = [finding.message for finding in coarse.findings if finding.kind == "pitch"]
    assert any("hold nothing of TangoPlus" in message for message in told)
    fine = planner.grade(box, pitch_mm=0.3, **given)
    assert fine.regions[0].material == "TangoPlus"
    assert not any("hold nothing" in finding.message for finding in fine.findings)


def test_thin_walls_are_within_reach_and_flat_places_take_few_triangles() -> None:
    """Walls of 1.8 mm aslant, whose creases lie nearer to each other than cells are long."""
    cavity = Manifold.cube([10.4, 6.4, 4.4]).translate([1.8, 1.8, 1.8])
    mesh = part((Manifold.cube([14, 10, 8]) - cavity).rotate([10, 20, 30]))
    field, levels = FunctionField("function", depth(mesh)), np.array([0.1, 0.25, 0.4, 0.55, 0.7])
    pieces = split(mesh, field, levels, pitch_mm=0.5, within_mm=WITHIN_MM)
    _, middles = off_mm(pieces, field, levels)
    area = np.linalg.norm(Mesh(pieces.vertices, pieces.cap_faces).area_vectors_mm2, axis=1)
    assert area[middles < WITHIN_MM].sum() > 0.99 * area.sum()
    assert len(pieces.cap_faces) < 60_000
    soups = [pieces.vertices[pieces.shell_faces([i])] for i in range(pieces.count)]
    assert all(audit(soup).sound for soup in soups if len(soup))
    assert interfaces_cancel(join_shells([soup for soup in soups if len(soup)]), mesh)
