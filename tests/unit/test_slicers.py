"""What slicers read of a 3MF, by a plain XML parser: objects, parts, extruders, triangles."""

import json
import re
import xml.etree.ElementTree as ET
import zipfile
from pathlib import Path

import numpy as np
import pytest

from planner.cli import run
from planner.errors import ArgumentError
from planner.formats.threemf import (
    Constituent,
    ThreemfObject,
    decode_threemf,
    encode_threemf,
    needs_one_mesh,
    read_threemf,
)
from planner.grading.check import check

CORE = "{http://schemas.microsoft.com/3dmanufacturing/core/2015/02}"
CURA = "http://software.ultimaker.com/xml/cura/3mf/2015/10"
POINTS = np.array([[0, 0, 0], [10, 0, 0], [0, 10, 0], [0, 0, 10]], dtype=np.float32)
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]], dtype=np.int32)
MIXTURE = (Constituent("Tango", "#102030", 0.5), Constituent("Vero", "#FFEEDD", 0.5))


def shells():
    """A soft shell, a hard one, a mixture, and one more that is soft."""
    each = [("a<&>", "Tango", ()), ("b", "Vero", ()), ("c", "", MIXTURE), ("d", "Tango", ())]
    return [
        ThreemfObject(
            name,
            POINTS + np.float32(20 * k),
            FACES,
            material,
            {"Tango": "#102030", "Vero": "#FFEEDD", "": ""}[material],
            {"coordinate": "0.5"},
            mixture,
        )
        for k, (name, material, mixture) in enumerate(each)
    ]


def parsed(data, tmp_path):
    """Return the model and every part of the archive, read without planner and lib3mf."""
    (tmp_path / "x.3mf").write_bytes(data)
    with zipfile.ZipFile(tmp_path / "x.3mf") as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    return ET.fromstring(parts["3D/3dmodel.model"]), parts


def settings(element):
    return {each.get("key"): each.get("value") for each in element.findall("metadata")}


def test_bambu_finds_each_component_with_its_filament(tmp_path):
    model, parts = parsed(encode_threemf(shells(), "finger"), tmp_path)
    (item,) = model.iter(f"{CORE}item")
    components = [c.get("objectid") for c in model.iter(f"{CORE}component")]
    (whole,) = ET.fromstring(parts["Metadata/model_settings.config"]).findall("object")
    assert whole.get("id") == item.get("objectid")
    assert settings(whole) == {"name": "finger"}
    found = whole.findall("part")
    assert [part.get("id") for part in found] == components
    assert {part.get("subtype") for part in found} == {"normal_part"}
    assert [settings(part) for part in found] == [
        {"name": name, "extruder": number}
        for name, number in zip(("a<&>", "b", "c", "d"), "1231", strict=True)
    ]


def test_cura_finds_each_mesh_with_its_extruder(tmp_path):
    _, parts = parsed(encode_threemf(shells(), "finger"), tmp_path)
    xml = parts["3D/3dmodel.model"].decode()
    prefix = re.search(f'xmlns:(\\w+)="{CURA}"', xml)[1]
    numbers = re.findall(f'<metadata name="{prefix}:extruder_nr"[^>]*>(\\d)<', xml)
    assert numbers == ["0", "1", "2", "0"]


def test_prusaslicer_finds_one_mesh_cut_into_volumes(tmp_path):
    model, parts = parsed(encode_threemf(shells(), "finger", one_mesh=True), tmp_path)
    (mesh,) = model.iter(f"{CORE}object")
    (item,) = model.iter(f"{CORE}item")
    (whole,) = ET.fromstring(parts["Metadata/Slic3r_PE_model.config"]).findall("object")
    assert whole.get("id") == mesh.get("id") == item.get("objectid")
    found = whole.findall("volume")
    assert [(v.get("firstid"), v.get("lastid")) for v in found] == [
        ("0", "3"),
        ("4", "7"),
        ("8", "11"),
        ("12", "15"),
    ]
    assert [settings(volume) for volume in found] == [
        {"name": name, "volume_type": "ModelPart", "extruder": number}
        for name, number in zip(("a<&>", "b", "c", "d"), "1231", strict=True)
    ]
    triangles = list(mesh.iter(f"{CORE}triangle"))
    corners = [[int(t.get(v)) for v in ("v1", "v2", "v3")] for t in triangles]
    assert np.array_equal(corners, np.concatenate([FACES + 4 * k for k in range(4)]))
    default = (mesh.get("pid"), mesh.get("pindex"))
    materials = [(t.get("pid", default[0]), t.get("p1", default[1])) for t in triangles]
    assert [len(set(materials[k : k + 4])) for k in (0, 4, 8, 12)] == [1, 1, 1, 1]
    assert materials[0] == materials[12]
    assert len(set(materials)) == 3


@pytest.mark.parametrize("one_mesh", [False, True])
def test_settings_are_declared_parts_of_a_strict_file(one_mesh, follows_to_the_letter, tmp_path):
    data = encode_threemf(shells(), "finger", one_mesh=one_mesh)
    assert follows_to_the_letter(data)
    assert decode_threemf(data, "x").remarks == ()
    assert data == encode_threemf(shells(), "finger", one_mesh=one_mesh)
    _, parts = parsed(data, tmp_path)
    (name,) = [name for name in parts if name.endswith(".config")]
    relations = ET.fromstring(parts["3D/_rels/3dmodel.model.rels"])
    assert [relation.get("Target") for relation in relations] == [f"/{name}"]
    types = ET.fromstring(parts["[Content_Types].xml"])
    kinds = {each.get("Extension"): each.get("ContentType") for each in types}
    assert kinds["config"] == "application/xml"


def test_one_mesh_is_read_back_by_material():
    whole = decode_threemf(encode_threemf(shells(), "finger", one_mesh=True), "x").objects
    soft, hard, mixed = whole
    assert [item.material_name for item in whole] == ["Tango", "Vero", "Tango-50.0_Vero-50.0"]
    assert [item.name for item in whole] == ["finger"] * 3
    assert mixed.constituents == MIXTURE
    for item, places in ((soft, (0, 3)), (hard, (1,)), (mixed, (2,))):
        expected = np.concatenate([(POINTS + np.float32(20 * k))[FACES] for k in places])
        # lib3mf rounds once to text and once back: one unit in the last place
        off = np.abs(item.vertices[item.faces] - expected).max()
        assert off <= np.spacing(np.float32(70.0))


@pytest.fixture(scope="module")
def folders(finger_plan, tmp_path_factory):
    root = tmp_path_factory.mktemp("for")
    return {
        s: finger_plan.write(root / (s or "none"), slicer=s) for s in (None, "cura", "prusaslicer")
    }


def test_only_the_3mf_depends_on_the_slicer(folders):
    def content(slicer):
        root = folders[slicer]
        return {p.relative_to(root): p.read_bytes() for p in root.rglob("*") if p.is_file()}

    plain, cura, prusa = content(None), content("cura"), content("prusaslicer")
    assert plain == cura
    differ = {str(name) for name in plain if plain[name] != prusa[name]}
    assert differ == {"finger.3mf", "plan.json"}  # which lists the 3MF's hash
    plans = [json.loads(files[Path("plan.json")]) for files in (plain, prusa)]
    for plan in plans:
        assert plan["files_sha256"].pop("finger.3mf")
    assert plans[0] == plans[1]
    assert plain.keys() == prusa.keys()


def test_a_folder_for_prusaslicer_is_sound_and_an_altered_one_is_not(folders):
    root = folders["prusaslicer"]
    assert check(root).ok
    # Two materials' names swapped: the shells are then of the wrong ones.
    model = read_threemf(root / "finger.3mf")
    names = [item.material_name for item in model.objects]
    names[3], names[4] = names[4], names[3]
    swapped = [
        ThreemfObject(name, item.vertices, item.faces, name, item.colour)
        for name, item in zip(names, model.objects, strict=True)
    ]
    (root / "finger.3mf").write_bytes(encode_threemf(swapped, "finger", one_mesh=True))
    problems = check(root).problems
    assert [text.split(" is ")[0] for text in problems] == [
        "finger.3mf: its content",
        "finger.3mf: object finger",
        "finger.3mf: object finger",
    ]


def test_a_slip_in_the_slicers_name(samples, capsys):
    assert [needs_one_mesh(name) for name in ("PrusaSlicer", "orca")] == [True, False]
    with pytest.raises(ArgumentError, match="did you mean bambu"):
        needs_one_mesh("bamboo")
    assert run(["grade", str(samples / "finger.stl"), "--for", "prusaslicr"]) == 2
    assert "did you mean prusaslicer?" in capsys.readouterr().err
