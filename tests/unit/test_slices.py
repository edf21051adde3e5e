"""Slices hold each shell's voxels, each once, and say so; bad input leaves nothing behind."""

import csv
import hashlib
import io
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

import planner
from planner.cli import run
from planner.errors import ArgumentError, FileError, OutputError, UnknownNameError
from planner.formats.mesh_file import decode_stl, encode_stl
from planner.mesh.mesh import Mesh, weld
from planner.slices import _distinct_colours
from planner.voxels.columns import Grid, iterate_columns


@pytest.fixture(scope="module")
def dogbone(dogbone_plan: planner.Plan, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return dogbone_plan.write(tmp_path_factory.mktemp("plans") / "dogbone")


@pytest.fixture(scope="module")
def curved(samples: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    plan = planner.grade(
        samples / "finger.stl", from_="Tango", to="Vero", field="radial: point=40 0 0", pitch_mm=2.0
    )
    return plan.write(tmp_path_factory.mktemp("plans") / "finger")


def shells_of(folder: Path) -> list[Mesh]:
    meshes = []
    for file in sorted((folder / "stl").iterdir()):
        vertices, faces = weld(decode_stl(file.read_bytes(), file.name).astype(np.float32))
        meshes.append(Mesh(vertices.astype(float), faces))
    return meshes


def with_shells(folder: Path, target: Path, meshes: list[Mesh]) -> Path:
    """A plan whose first shells are other bodies; the others are gone."""
    shutil.copytree(folder, target)
    document = json.loads((target / "plan.json").read_text())
    document["regions"] = document["regions"][: len(meshes)]
    for region, mesh in zip(document["regions"], meshes, strict=True):
        data = encode_stl(mesh.vertices.astype(np.float32), mesh.faces, "test")
        (target / region["file"]).write_bytes(data)
        region["sha256"] = hashlib.sha256(data).hexdigest()
    (target / "plan.json").write_text(json.dumps(document))
    return target


def images(folder: Path) -> np.ndarray:
    files = sorted(folder.glob("layer_*.png"))
    return np.stack([np.asarray(Image.open(file).convert("RGBA")) for file in files])


def labels(folder: Path) -> np.ndarray:
    """Labels (layers, ny, nx) from the images' colours, as slices.json explains them."""
    pixels, document = images(folder), json.loads((folder / "slices.json").read_text())
    label = np.full(pixels.shape[:3], -1)
    label[(pixels == document["images"]["nothing"]).all(-1)] = 0
    for material in document["materials"]:
        label[(pixels == material["rgba"]).all(-1)] = material["label"]
    assert label.min() >= 0
    return label


def by_columns(mesh: Mesh, grid: Grid) -> np.ndarray:
    """Voxels by layer, counted along z."""
    counts = np.zeros(grid.shape[2] + 1, int)
    for columns in iterate_columns(mesh, grid):
        counts += np.bincount(columns.start, minlength=len(counts))
        counts -= np.bincount(columns.stop, minlength=len(counts))
    return np.cumsum(counts)[:-1]


def winding(points: np.ndarray, mesh: Mesh) -> np.ndarray:
    """Winding numbers by solid angles (van Oosterom and Strackee, 1983)."""
    total = np.zeros(len(points))
    for corners in mesh.triangles:
        a, b, c = (corners[i] - points for i in range(3))
        la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
        spat = np.einsum("ij,ij->i", a, np.cross(b, c))
        ab, bc, ca = ((u * v).sum(1) for u, v in ((a, b), (b, c), (c, a)))
        total += 2 * np.arctan2(spat, la * lb * lc + ab * lc + bc * la + ca * lb)
    return np.rint(total / (4 * np.pi)).astype(int)


@pytest.mark.parametrize("pitch", [(0.4, 0.5, 0.25), 0.5, 1.0, (0.7, 2.0, 0.1)])
@pytest.mark.parametrize("which", ["dogbone", "curved"])
def test_counts_are_those_of_columns(
    which: str, pitch: object, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    """By layer and material, exactly. At 0.5 and 1 mm many faces pass through voxel centres."""
    folder = request.getfixturevalue(which)
    stack = planner.write_slices(folder, tmp_path / "s", pitch_mm=pitch)
    expected = np.stack([by_columns(mesh, stack.grid) for mesh in shells_of(folder)], axis=1)
    assert np.array_equal(stack.voxels, expected)
    assert stack.ok
    whole = sum(c.voxels for c in iterate_columns(joined(shells_of(folder)), stack.grid))
    assert stack.voxels.sum() == whole  # none lost between shells


def joined(meshes: list[Mesh]) -> Mesh:
    before = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    faces = [m.faces + n for m, n in zip(meshes, before, strict=False)]
    return Mesh(np.concatenate([m.vertices for m in meshes]), np.concatenate(faces))


def test_the_files_agree_with_one_another(dogbone: Path, tmp_path: Path) -> None:
    stack = planner.write_slices(dogbone, tmp_path / "s", pitch_mm=(0.6, 0.5, 0.4))
    document = json.loads((tmp_path / "s" / "slices.json").read_text())
    label = labels(tmp_path / "s")
    assert label.shape == tuple(reversed(document["grid"]["shape"]))
    assert document["files"] == sorted(p.name for p in (tmp_path / "s").glob("*.png"))
    assert (
        document["plan"]["sha256"]
        == hashlib.sha256((dogbone / "plan.json").read_bytes()).hexdigest()
    )
    rows = list(csv.DictReader(io.StringIO((tmp_path / "s" / "layers.csv").read_text())))
    for material in document["materials"]:
        drawn = (label == material["label"]).sum(axis=(1, 2))
        assert [int(row[material["material"]]) for row in rows] == drawn.tolist()
        assert material["voxels"] == drawn.sum()
        # a voxel is 0.12 mm³, and the file keeps nine digits
        assert material["volume_mm3"] == pytest.approx(0.12 * material["voxels"], rel=1e-8)
    assert [float(row["z_mm"]) for row in rows] == pytest.approx(1.2 + 0.4 * np.arange(len(rows)))
    assert stack.files == tuple(document["files"])


def test_a_pixel_is_the_material_at_its_centre(curved: Path, tmp_path: Path) -> None:
    """Against winding numbers by solid angles, which know no grid: 150 voxels at random."""
    stack = planner.write_slices(curved, tmp_path / "s", pitch_mm=(0.31, 0.47, 0.23))
    label = labels(tmp_path / "s")
    random = np.random.default_rng(0)
    voxels = random.integers(0, stack.grid.shape, (150, 3))
    found = label[tuple(voxels[:, ::-1].T)]
    points = stack.grid.centre_mm(voxels)
    for number, mesh in enumerate(shells_of(curved), 1):
        near = np.minimum(points - mesh.bounds_mm[0], mesh.bounds_mm[1] - points).min(1) >= 0
        assert not (found[~near] == number).any()
        assert np.array_equal(found[near] == number, winding(points[near], mesh) == 1)
    assert len(np.unique(found)) > 5


def test_volumes_close_in_on_the_shells(dogbone: Path, tmp_path: Path) -> None:
    """The part is 4 mm thick and straight-sided in z: 0.1 mm divides it, and the outline errs by
    far less than the half pixel along its whole length that would be 1 %."""
    stack = planner.write_slices(dogbone, tmp_path / "s", pitch_mm=0.1)
    volume = sum(mesh.volume_mm3 for mesh in shells_of(dogbone))
    assert stack.voxels.sum() * stack.grid.voxel_mm3 == pytest.approx(volume, rel=1e-3)


def test_two_wedges_that_share_a_face_through_centres(dogbone: Path, tmp_path: Path) -> None:
    """A box cut along its diagonal plane, which holds voxel centres: each goes to one wedge."""
    corners = np.array([[x, y, z] for x in (0, 6) for y in (0, 4) for z in (0, 6)], float) + 1.0
    low = [[0, 2, 6], [0, 6, 4], [0, 1, 3], [0, 3, 2], [1, 4, 6], [1, 6, 3], [0, 4, 1], [2, 3, 6]]
    high = [[5, 4, 6], [5, 6, 7], [5, 7, 3], [5, 3, 1], [1, 6, 4], [1, 3, 6], [5, 1, 4], [7, 6, 3]]
    wedges = [Mesh(corners, np.array(faces)) for faces in (low, high)]
    assert [wedge.volume_mm3 for wedge in wedges] == pytest.approx([72.0, 72.0])
    folder = with_shells(dogbone, tmp_path / "plan", wedges)
    stack = planner.write_slices(folder, tmp_path / "s", pitch_mm=1.0)
    k, _, i = np.indices((6, 4, 6))
    assert stack.ok
    assert stack.voxels.sum() == 144
    label = labels(tmp_path / "s")
    assert (label[i + k < 5] == 1).all()
    assert (label[i + k > 5] == 2).all()
    assert (label[i + k == 5] == 2).all()  # as if each centre were a little higher


def test_shells_that_overlap_are_a_finding(dogbone: Path, tmp_path: Path, capsys) -> None:
    box = Mesh(*_box())
    folder = with_shells(
        dogbone, tmp_path / "plan", [box, Mesh(box.vertices + np.array([2, 0, 0]), box.faces)]
    )
    assert run(["slices", str(folder), "-o", str(tmp_path / "s"), "--pitch", "0.5"]) == 1
    # 2 of 4 mm in x are shared: 2 x 4 x 4 mm at 0.125 mm³ a voxel
    assert "256 voxels lie in more than one shell" in capsys.readouterr().err
    document = json.loads((tmp_path / "s" / "slices.json").read_text())
    assert document["overlapping_voxels"] == 256
    assert sum(m["voxels"] for m in document["materials"]) == 512 + 512 - 256


def _box() -> tuple[np.ndarray, np.ndarray]:
    import trimesh

    box = trimesh.creation.box((4, 4, 4))
    return np.asarray(box.vertices) + 5.0, np.asarray(box.faces)


def test_layers_for_scripts_are_the_images(dogbone: Path, tmp_path: Path) -> None:
    pitch = (0.5, 0.5, 0.4)
    planner.write_slices(dogbone, tmp_path / "s", pitch_mm=pitch)
    layers = list(planner.iterate_layers(dogbone, pitch_mm=pitch))
    assert np.array_equal(np.stack([layer.label for layer in layers]), labels(tmp_path / "s"))
    assert [layer.index for layer in layers] == list(range(len(layers)))
    assert layers[0].materials[0] == "TangoPlus"
    assert layers[3].z_mm == pytest.approx(1.0 + 3.5 * 0.4)


def test_same_bytes_however_it_is_cut_and_wherever_it_is(dogbone: Path, tmp_path: Path) -> None:
    shutil.copytree(dogbone, tmp_path / "elsewhere")
    planner.write_slices(dogbone, tmp_path / "a", pitch_mm=0.3)
    planner.write_slices(tmp_path / "elsewhere", tmp_path / "b", pitch_mm=0.3, slab_layers=2)
    a, b = ({p.name: p.read_bytes() for p in (tmp_path / n).iterdir()} for n in "ab")
    assert a == b


def test_indexed_images_have_the_same_colours_in_fewer_bytes(dogbone: Path, tmp_path: Path) -> None:
    planner.write_slices(dogbone, tmp_path / "rgba", pitch_mm=0.2)
    planner.write_slices(dogbone, tmp_path / "indexed", pitch_mm=0.2, indexed=True)
    assert np.array_equal(images(tmp_path / "rgba"), images(tmp_path / "indexed"))
    sizes = [
        sum(p.stat().st_size for p in (tmp_path / n).glob("*.png")) for n in ("indexed", "rgba")
    ]
    assert sizes[0] < sizes[1]


def test_the_printers_own_pitch_by_default(dogbone: Path, tmp_path: Path) -> None:
    """42 x 42 x 30 µm, from one corner of the part to the other."""
    layer = next(planner.iterate_layers(dogbone))
    assert layer.label.shape == (453, 2739)  # 19 and 115 mm, rounded up
    assert layer.z_mm == pytest.approx(1.015)


@pytest.mark.parametrize(
    "wished",
    [["#FF0000"] * 3, ["#102030", "#112131", "#FFFFFF", "#FEFEFE"], ["#808080"] * 40],
)
def test_colours_are_told_apart(wished: list[str]) -> None:
    given = _distinct_colours(wished)
    assert given[0] == (*bytes.fromhex(wished[0][1:]), 255)
    for n, a in enumerate(given):
        for b in given[:n]:
            assert (
                np.linalg.norm(np.subtract(a, b)) >= 8.0
            )  # of 255: told apart by a program, if not by an eye


@pytest.mark.parametrize("blend", ["mix", "dither"])
def test_blended_plans(blend: str, samples: Path, tmp_path: Path) -> None:
    """Mixtures are materials of their own, in the 3MF's colours; dealt cells leave no gap."""
    part = samples / "dogbone.stl"
    options = {"bands": 3} if blend == "mix" else {"cell_mm": 1.5}
    plan = planner.grade(part, from_="Tango", to="FLX9750", axis="x", blend=blend, **options)
    stack = planner.write_slices(plan.write(tmp_path / "plan"), tmp_path / "s", pitch_mm=0.5)
    colours = {shell.material: shell.colour for shell in plan.shells}
    found = {m.material: "#" + bytes(m.rgba[:3]).hex().upper() for m in stack.materials}
    assert found == colours
    # however it is divided, the part is the same voxels
    whole = planner.grade(part, from_="Tango", to="FLX9750", axis="x").write(tmp_path / "whole")
    plain = planner.write_slices(whole, tmp_path / "w", pitch_mm=0.5)
    assert np.array_equal(stack.voxels.sum(axis=1), plain.voxels.sum(axis=1))


def test_colours_that_differ_stay(dogbone: Path, tmp_path: Path) -> None:
    palette = planner.load_printer("connex3").palette()
    stack = planner.write_slices(dogbone, tmp_path / "s", pitch_mm=1.0)
    colours = {m.id: m.colour for m in palette.materials}
    for each in stack.materials:
        assert colours[each.material] == "#" + bytes(each.rgba[:3]).hex().upper()


@pytest.mark.parametrize(
    ("pitch", "reason"),
    [
        ("42um", "did you mean 0.042"),
        ("0.042x0.042x0.03", "did you mean 0.042,0.042,0.03"),
        ("42,42,30", "did you mean 0.042,0.042,0.03"),
        ("0.042,0.03", "2 lengths"),
        ("fine", "in mm without a unit"),
        ("0", "must be above 0"),
        ("-1", "must be above 0"),
        ("nan", "must be a finite number"),
        ("inf", "must be a finite number"),
        ("0.0001", "choose a coarser pitch"),
        ("300", "more than the part's"),
    ],
)
def test_pitches_that_are_none(
    pitch: str, reason: str, dogbone: Path, tmp_path: Path, capsys
) -> None:
    assert run(["slices", str(dogbone), "-o", str(tmp_path / "s"), f"--pitch={pitch}"]) == 2
    error = capsys.readouterr().err
    assert reason in error
    assert error.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("layers", [1, 3])
def test_a_part_of_whole_layers_has_as_many(layers: int, tmp_path: Path, capsys) -> None:
    """Its height is no sum of powers of two: STL files round it."""
    body = trimesh.creation.box((12.0, 4.0, 0.03 * layers))
    plan = planner.grade((body.vertices, body.faces), from_="Tango", to="Vero", axis="x")
    folder = plan.write(tmp_path / "thin")
    assert f" mm, {layers} layer{'s' if layers > 1 else ''} of 30 um" in plan.notes
    assert planner.write_slices(folder, tmp_path / "s").grid.shape[2] == layers
    # Millimetres and no micrometres: what is thinner than a layer is told so.
    body = trimesh.creation.box((12.0, 4.0, 0.02))
    plan = planner.grade((body.vertices, body.faces), from_="Tango", to="Vero", axis="x")
    with pytest.raises(ArgumentError, match=r"z is 0\.03 mm, more than the part's 0\.02 mm$"):
        planner.write_slices(plan.write(tmp_path / "less"), tmp_path / "t")


def test_a_shell_that_was_altered_or_is_missing(dogbone: Path, tmp_path: Path) -> None:
    folder = tmp_path / "plan"
    shutil.copytree(dogbone, folder)
    shell = sorted((folder / "stl").iterdir())[1]
    data = bytearray(shell.read_bytes())
    data[200] ^= 1
    shell.write_bytes(data)
    with pytest.raises(FileError, match="not what the plan was written with"):
        planner.write_slices(folder, tmp_path / "s", pitch_mm=1.0)
    shell.unlink()
    with pytest.raises(FileError, match=r"No such file.*grade the part again"):
        planner.write_slices(folder, tmp_path / "s", pitch_mm=1.0)
    assert not (tmp_path / "s").exists()


def test_plans_folders_and_printers_that_are_none(dogbone: Path, tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"no plan\.json"):
        planner.write_slices(tmp_path, tmp_path / "s")
    with pytest.raises(UnknownNameError, match="did you mean connex3"):
        planner.write_slices(dogbone, tmp_path / "s", printer="conex3")
    with pytest.raises(OutputError, match="plan's own folder"):
        planner.write_slices(dogbone, dogbone / "slices", pitch_mm=1.0)
    with pytest.raises(OutputError, match=r"holds no slices\.json"):
        planner.write_slices(dogbone, dogbone, force=True)
    for pitch_mm in ("fine", [1.0, 2.0], {}):
        with pytest.raises(
            ArgumentError, match=r"must be a finite number|give one in mm, or three"
        ):
            planner.write_slices(dogbone, tmp_path / "s", pitch_mm=pitch_mm)
    with pytest.raises(ArgumentError, match="slab_layers"):
        planner.write_slices(dogbone, tmp_path / "s", slab_layers=0)
    for wrong in ({"slab_layers": 2.5}, {"printer": 3}, {"scheduler": 3, "pitch_mm": 0.5}):
        with pytest.raises((ArgumentError, UnknownNameError), match=next(iter(wrong))):
            planner.write_slices(dogbone, tmp_path / "s", **wrong)
    planner.write_slices(dogbone, tmp_path / "s", pitch_mm=1.0)
    with pytest.raises(OutputError, match="`force`"):
        planner.write_slices(dogbone, tmp_path / "s", pitch_mm=0.5)
    planner.write_slices(dogbone, tmp_path / "s", pitch_mm=2.0, force=True)
    assert len(list((tmp_path / "s").glob("*.png"))) == 2


def test_a_printer_that_is_not_installed(dogbone: Path, tmp_path: Path) -> None:
    """The pitch then has to be given; colours come from the plan's own 3MF."""
    folder = tmp_path / "plan"
    shutil.copytree(dogbone, folder)
    text = (folder / "plan.json").read_text().replace('"connex3"', '"elsewhere"')
    (folder / "plan.json").write_text(text)
    with pytest.raises(UnknownNameError, match="`pitch_mm`"):
        planner.write_slices(folder, tmp_path / "s")
    stack = planner.write_slices(folder, tmp_path / "s", pitch_mm=1.0)
    known = planner.write_slices(dogbone, tmp_path / "t", pitch_mm=1.0)
    assert [m.rgba for m in stack.materials] == [m.rgba for m in known.materials]


def test_the_command_prints_a_document_and_nothing_else(
    dogbone: Path, tmp_path: Path, capsys
) -> None:
    command = ["slices", str(dogbone), "-o", str(tmp_path / "s"), "--pitch", "0.5,0.5,0.4"]
    assert run([*command, "--json"]) == 0
    out = capsys.readouterr()
    written = json.loads((tmp_path / "s" / "slices.json").read_bytes())
    assert set(written.pop("files_sha256")) == {*written["files"], "layers.csv"}
    assert json.loads(out.out) == written
    assert out.err == ""
    assert run([*command, "--quiet", "--force"]) == 0
    assert capsys.readouterr() == ("", "")
    assert run([*command, "--force"]) == 0
    assert "10 layers of 230 x 38 pixels" in capsys.readouterr().out


def test_a_stop_on_the_way_leaves_nothing(dogbone: Path, tmp_path: Path) -> None:
    def stop(done: int, of: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        planner.write_slices(dogbone, tmp_path / "s", pitch_mm=0.5, slab_layers=1, progress=stop)
    assert list(tmp_path.iterdir()) == []


def test_a_cluster_that_cannot_be_used(
    dogbone: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "distributed", None)
    with pytest.raises(ArgumentError, match="pip install distributed"):
        planner.write_slices(dogbone, tmp_path / "s", pitch_mm=1.0, scheduler="tcp://127.0.0.1:1")
    assert list(tmp_path.iterdir()) == []
