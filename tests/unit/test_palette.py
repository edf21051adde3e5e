"""The palette file: what it becomes, how names resolve, and what is refused with which words."""

import copy
import json
import math
import pickle
import re
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest

import planner
from planner.errors import ArgumentError, PaletteError, UnknownNameError
from planner.materials.mixtures import CoefficientModel
from planner.palette import LawParameters, Palette, encode_palette, load_palette, parse_palette
from planner.printers import load_printer

SOUND = """
schema = 1
name = "two"
kind = "palette"
[reference]
temperature_C = 23.0
[[material]]
id = "Soft-1"
coordinate = 0.0
elongation_at_break = 0.8
density_g_cm3 = 1.1
aliases = ["Tango"]
[material.law]
model = "ogden"
mu_MPa = [0.9, -0.1]
alpha = [2.0, -1.4]
[[material]]
id = "Stiff"
coordinate = 1.0
elongation_at_break = 0.2
density_g_cm3 = 1.2
deformation = "plastic"
[material.law]
model = "linear"
modulus_MPa = 100
"""


def parse(text: str) -> Palette:
    return parse_palette(text.encode(), name="two.toml")


def test_a_sound_file() -> None:
    palette = parse(SOUND)
    soft, stiff = palette.materials
    assert (soft.id, soft.coordinate, soft.aliases) == ("Soft-1", 0.0, ("Tango",))
    assert dict(soft.law.parameters) == {"mu_MPa": (0.9, -0.1), "alpha": (2.0, -1.4)}
    assert dict(stiff.law.parameters) == {"modulus_MPa": (100.0,)}
    assert (soft.deformation, stiff.deformation) == ("elastic", "plastic")
    assert palette.reference.temperature_C == 23.0
    assert palette.reference.soak_h is None
    # SHA-256 is the file's: another byte, another sum.
    assert len(palette.sha256) == 64
    assert parse(SOUND + "\n").sha256 != palette.sha256
    # What is changed is no file's.
    assert replace(palette, materials=palette.materials[:1]).sha256 == ""


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("schema = 1", "schema = 2", "schema is 2"),
        ('name = "two"', 'nam = "two"', "unknown field `nam`"),
        ('kind = "palette"', 'kind = "printer"', "`$.kind`; it may be palette"),
        ("temperature_C = 23.0", 'orientation = "w"', "it may be x, y or z"),
        ('aliases = ["Tango"]', 'deformation = "stiff"', "it may be elastic or plastic"),
        ("temperature_C", "temprature_C", "unknown field `temprature_C`"),
        ("coordinate = 1.0", "coordinate = 0.0", "coordinate of Stiff is 0, not above 0"),
        ("coordinate = 1.0", "coordinate = nan", "coordinate nan: it must be a finite number"),
        ("elongation_at_break = 0.2", "elongation_at_break = 0.0", "elongation_at_break is 0"),
        ("density_g_cm3 = 1.2", "density_g_cm3 = -1.2", "density_g_cm3 is -1.2"),
        ("density_g_cm3 = 1.2", "density_g_cm3 = 1200", "below 25, in g/cm3"),
        ("elongation_at_break = 0.2", "elongation_at_break = 170.0", "170 % are 1.7"),
        ("temperature_C = 23.0", "temperature_C = nan", "reference.temperature_C"),
        ("temperature_C = 23.0", "temperature_C = -300.0", "reference.temperature_C"),
        ("temperature_C = 23.0", "strain_rate_per_s = 0.0", "reference.strain_rate_per_s"),
        ("temperature_C = 23.0", "strain_rate_per_s = inf", "reference.strain_rate_per_s"),
        ("temperature_C = 23.0", "soak_h = -1.0", "reference.soak_h"),
        ('id = "Stiff"', 'id = "a/b"', "the id goes into file names"),
        ('id = "Stiff"', 'id = "Soft-1"', "'Soft-1' names both Soft-1 and Soft-1"),
        ('id = "Stiff"', 'id = "TANGO"', "'TANGO' names both Soft-1 and TANGO"),
        (
            'model = "linear"',
            'model = "gent"',
            "model is 'gent'; did you mean ogden? it must be one of linear",
        ),
        ("modulus_MPa = 100", "E = 100", "unknown key 'E'; linear takes modulus_MPa"),
        ("modulus_MPa = 100", "", "'modulus_MPa' is missing"),
        ("modulus_MPa = 100", 'modulus_MPa = "100"', "modulus_MPa '100': it must be a finite"),
        ("modulus_MPa = 100", "modulus_MPa = inf", "modulus_MPa inf: it must be a finite"),
        ("modulus_MPa = 100", "modulus_MPa = [1.0, 2.0]", "has 2 values; linear takes 1"),
        ("alpha = [2.0, -1.4]", "alpha = [2.0]", "must be of one length"),
        ('aliases = ["Tango"]', 'colour = "red"', "colour is 'red'"),
        ("schema = 1", "schema = ", "not a TOML file"),
    ],
)
def test_a_fault_is_named(old: str, new: str, words: str) -> None:
    assert SOUND.count(old) == 1
    with pytest.raises(PaletteError, match=re.escape(words)) as caught:
        parse(SOUND.replace(old, new))
    assert "two.toml" in str(caught.value)


def test_without_colours_shades_go_from_soft_to_hard() -> None:
    """From yellow to blue, each its own; where one is stated, the others are grey."""
    assert [m.colour for m in parse(SOUND).materials] == ["#FBD724", "#0D0887"]
    told = SOUND.replace('aliases = ["Tango"]', 'aliases = ["Tango"]\ncolour = "#0000ff"')
    assert sorted(m.colour for m in parse(told).materials) == ["#0000FF", "#808080"]


@pytest.mark.parametrize(
    "lists",
    [
        ("[0.0, 1.0]", "[30.0, 60.0, 90.0]"),
        ("[0.0]", "[30.0]"),
        ("[0.0, 1.0]", "[60.0, 30.0]"),
        ("[1.0, 1.0]", "[30.0, 60.0]"),
        ("[0.0, 1.0]", "[30.0, 100.0]"),
        ("[0.0, nan]", "[30.0, 60.0]"),
    ],
)
def test_a_scale_of_hardness_rises_or_is_refused(lists: tuple[str, str]) -> None:
    table = "\n[hardness]\ncoordinate = {}\nshore_A = {}\n"
    sound = parse(SOUND + table.format("[0.0, 1.0]", "[30.0, 60.0]"))
    assert sound.hardness == ((0.0, 30.0), (1.0, 60.0))
    with pytest.raises(PaletteError, match=r"two\.toml: hardness: .* both rising"):
        parse(SOUND + table.format(*lists))


@pytest.mark.parametrize(
    "lists", [("[0.0, 0.5]", "[0.1]"), ("[0.5, 0.0]", "[0.1, 0.2]"), ("[0.0]", "[-0.1]"),
              ("[nan]", "[0.1]"), ("[0.0]", "[nan]")],
)  # fmt: skip
def test_deviations_by_strain_rise_with_it_or_are_refused(lists: tuple[str, str]) -> None:
    table = "\n[material.uncertainty]\nspecimens = 3\nstrain = {}\nlog_sd = {}\n"
    sound = CoefficientModel(parse(SOUND + table.format("[0.0, 0.5]", "[0.2, 0.1]")))
    assert sound.own_log_sds(0.05, 1.96)[:, 1] == pytest.approx([0.19, 0.19])
    with pytest.raises(PaletteError, match=r"'Stiff': uncertainty: strain and log_sd must be"):
        parse(SOUND + table.format(*lists))


def test_no_material_is_refused() -> None:
    with pytest.raises(PaletteError, match="needs at least one"):
        parse('schema = 1\nname = "none"\nkind = "palette"\nmaterial = []')


def test_a_missing_file_and_one_that_is_no_text_are_refused(tmp_path: Path) -> None:
    with pytest.raises(PaletteError, match="cannot be read"):
        load_palette(tmp_path / "none.toml")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(PaletteError, match="not a TOML file"):
        load_palette(tmp_path / "binary.toml")


@pytest.mark.parametrize(
    ("name", "material"),
    [
        ("TangoPlus", "TangoPlus"),
        ("tango", "TangoPlus"),
        ("Vero", "VeroWhitePlus"),
        (" verowhite ", "VeroWhitePlus"),
        ("flx9750-dm", "FLX9750"),
        ("FLX976", "FLX9760"),
        ("FLX 9795", "FLX9795"),
        ("RGD8430", "RGD8430"),
        ("RGD835", "VeroWhitePlus"),
    ],
)
def test_names_of_the_connex3(name: str, material: str) -> None:
    assert load_printer("connex3").palette().resolve(name).id == material


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("FLX", "ambiguous"),
        ("FLX9755", "did you mean"),
        ("", "it has TangoPlus"),
        ("Agilus30", "no material 'Agilus30'"),
    ],
)
def test_names_that_stand_for_nothing_or_too_much(name: str, words: str) -> None:
    with pytest.raises(UnknownNameError, match=words):
        load_printer("connex3").palette().resolve(name)


@pytest.mark.parametrize("resins", [("Rubber", "Glass"), ()])
def test_the_3mf_names_the_resins_of_the_palette(resins: tuple[str, ...], tmp_path: Path) -> None:
    """Its own; else the printer's, and what the printer does not know (Soft-1 is its Tango)."""
    head = f"base_resins = {list(resins)}\n[reference]"
    path = tmp_path / "two.toml"
    path.write_text(SOUND.replace("[reference]", head, 1))
    part = Path(__file__).parents[2] / "samples" / "finger.stl"
    plan = planner.grade(part, from_="Soft-1", to="Stiff", palette=path)
    expected = ", ".join(resins or (*load_printer("connex3").base_resins, "Stiff"))
    assert {shell.properties["base_resins"] for shell in plan.shells} == {expected}
    loaded = ", ".join(f"**{resin}**" for resin in expected.split(", "))
    assert f"Resins to load: {loaded}; support" in plan.howto()


def test_a_law_stays_as_it_was_read(tmp_path: Path) -> None:
    """Changed in place, it was planned with under the file's hash, and read again from the file."""
    (tmp_path / "two.toml").write_text(SOUND)
    palette = load_palette(tmp_path / "two.toml")
    law = palette.resolve("Stiff").law
    for change in (
        lambda held: held.update(modulus_MPa=(5.0,)),
        lambda held: held.__setitem__("modulus_MPa", (5.0,)),
        lambda held: held.pop("modulus_MPa"),
        lambda held: held.clear(),
    ):
        with pytest.raises(TypeError, match="make another LawParameters"):
            change(law.parameters)
    assert json.loads(json.dumps(asdict(law)))["parameters"] == {"modulus_MPa": [100.0]}
    given = {"modulus_MPa": (3.0,)}
    made = LawParameters("linear", given)
    given["modulus_MPa"] = (4.0,)
    assert made.parameters == {"modulus_MPa": (3.0,)}
    for same in (copy.deepcopy(palette), pickle.loads(pickle.dumps(palette))):
        assert same == palette == load_palette(tmp_path / "two.toml")


def test_what_is_no_palette_is_not_written(tmp_path: Path) -> None:
    """A fit in place of its palette ended in an AttributeError that told neither."""
    fitted = planner.fit([Path(__file__).parents[2] / "samples" / "tensile"], law="neo-hookean")
    with pytest.raises(ArgumentError, match=r"PaletteStudy.*give a Palette.* as its `palette`"):
        planner.write_palette(fitted, tmp_path / "lab.toml")  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())
    planner.write_palette(fitted.palette, tmp_path / "lab.toml")
    assert load_palette(tmp_path / "lab.toml") == fitted.palette.known_by(
        load_palette(tmp_path / "lab.toml").sha256
    )


def test_without_a_density_masses_are_unknown(samples: Path, tmp_path: Path) -> None:
    text = SOUND.replace("density_g_cm3 = 1.2\n", "")
    (tmp_path / "two.toml").write_text(text)
    palette = parse(text)
    assert [m.density_g_cm3 for m in palette.materials] == [1.1, None]
    assert b"density_g_cm3 = 1.1\n" in encode_palette(palette)
    assert encode_palette(palette).count(b"density") == 1
    for blend in (None, "mix"):
        plan = planner.grade(
            samples / "dogbone.stl", from_="Soft-1", to="Stiff", axis="x", blend=blend,
            palette=tmp_path / "two.toml",
        )  # fmt: skip
        masses = {region.printed: region.mass_g for region in plan.regions}
        assert {name for name, mass in masses.items() if mass is not None} == {"Soft-1"}
        assert "\n| all | | - | |" in plan.howto()
        assert plan.mass_g is None
        plan.write(tmp_path / "out", force=True)
        document = json.loads((tmp_path / "out/plan.json").read_text())
        unknown = [region["mass_g"] is None for region in document["regions"]]
        assert unknown == [region.mass_g is None for region in plan.regions]
        assert planner.check(tmp_path / "out").problems == ()
    with pytest.raises(ArgumentError, match="tells no density"):
        planner.export(
            tmp_path / "out", to="calculix", palette=tmp_path / "two.toml", cell_mm=4.0,
            fix=["x=min"], gravity="-z",
        )  # fmt: skip
    stiff = palette.materials[1]
    for program in ("abaqus", "ansys", "febio"):
        assert "dens" not in planner.law_block(stiff, program).lower()


_LAW = LawParameters("neo-hookean", {"mu_MPa": 1.0})


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"law": {"model": "neo-hookean", "mu_MPa": 1.0}}, "must be LawParameters(model"),
        ({"coordinate": math.nan}, "material 'mid': coordinate nan: it must be a finite number"),
        ({"coordinate": "0.5"}, "coordinate '0.5': it must be a finite number"),
        ({"coordinate": 0.0}, "coordinate of mid is 0, not above 0 of soft; list materials from"),
        ({"coordinate": 2.0}, "coordinate of hard is 1, not above 2 of mid"),
        ({"elongation_at_break": -1.0}, "elongation_at_break is -1.0; it must be above 0"),
        ({"density_g_cm3": 0.0}, "density_g_cm3 is 0.0; it must be above 0"),
        ({"modulus_log_sd": -0.1}, "modulus_log_sd is -0.1; it must be from 0"),
        ({"id": "soft"}, "'soft' names both soft and soft"),
        ({"id": "../x"}, "the id goes into file names"),
        ({"colour": "red"}, "colour is 'red'; write it as '#RRGGBB'"),
    ],
)
def test_a_palette_made_in_a_script_is_held_to_what_a_file_is(
    change: dict[str, Any], words: str
) -> None:
    """They were taken as they were: two materials at one place gave a force of NaN."""
    each = [
        {"id": name, "coordinate": m, "elongation_at_break": 1.0, "density_g_cm3": 1.1, "law": _LAW}
        for name, m in (("soft", 0.0), ("mid", 0.5), ("hard", 1.0))
    ]
    assert planner.Palette("own", [planner.Material(**one) for one in each])  # a list will do
    each[1] |= change
    with pytest.raises(ArgumentError, match=re.escape(words)):
        planner.Palette("own", [planner.Material(**one) for one in each])


@pytest.mark.parametrize(
    ("model", "given", "words"),
    [
        ("mooney", {"mu_MPa": 1.0}, "law: model is 'mooney'; it must be one of linear"),
        ("neo-hookean", {"mu": 1.0}, "law: unknown key 'mu'; neo-hookean takes mu_MPa"),
        ("neo-hookean", {}, "law: 'mu_MPa' is missing"),
        ("neo-hookean", {"mu_MPa": math.nan}, "law: mu_MPa nan: it must be a finite number"),
        ("yeoh", {"c_MPa": (1.0, 2.0)}, "law: c_MPa has 2 values; yeoh takes 3"),
        ("ogden", {"mu_MPa": (), "alpha": ()}, "mu_MPa has 0 values; ogden takes one or more"),
        ("neo-hookean", 1.0, "1.0: give parameters by symbol; neo-hookean takes mu_MPa"),
    ],
)
def test_a_law_made_in_a_script_is_held_to_what_a_file_is(
    model: str, given: Any, words: str
) -> None:
    with pytest.raises(ArgumentError, match=re.escape(words)):
        LawParameters(model, given)
    assert _LAW.parameters == {"mu_MPa": (1.0,)}
    for none in ((), "abc", 3):
        with pytest.raises(ArgumentError, match="material"):
            planner.Palette("own", none)  # type: ignore[arg-type]
