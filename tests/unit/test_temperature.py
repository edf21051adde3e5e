"""Temperature by grade: fitted from tests at two temperatures, told in between, doubted beyond."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import planner
from planner.cli import run
from planner.errors import ArgumentError, PaletteError
from planner.grading.profile import at_temperature
from planner.materials.laws import make_law, secant_modulus_MPa
from planner.materials.mixtures import CoefficientModel
from planner.materials.palette_study import PaletteStudy
from planner.palette import (
    Palette,
    Reading,
    encode_palette,
    load_palette,
    parse_palette,
    write_palette,
)

COLD_C, WARM_C, SCATTER = 25.0, 35.0, 0.02
GRADES = {"soft": (0.0, 0.4, 0.5), "middle": (0.4, 1.2, 0.6), "stiff": (1.0, 4.0, 0.85)}
"""Coordinate, shear modulus in MPa at 25 degC, and the factor on stress at 35 degC."""


def lab(folder: Path, temperatures_C: tuple[float, ...]) -> Path:
    """Write neo-Hookean specimens, three a grade and temperature, that scatter in level."""
    rng = np.random.default_rng(7)
    folder.mkdir()
    rows = ["specimen,file,material,coordinate,temperature_C,density_g_cm3"]
    strain = np.linspace(0.0, 0.8, 120)
    for grade, (coordinate, mu_MPa, factor) in GRADES.items():
        for temperature_C in temperatures_C:
            for number in range(3):
                name = f"{grade}-{temperature_C:g}-{number}"
                level = factor ** ((temperature_C - COLD_C) / (WARM_C - COLD_C))
                level *= np.exp(SCATTER * rng.standard_normal())
                stress = level * mu_MPa * (1.0 + strain - (1.0 + strain) ** -2.0)
                table = np.column_stack([strain, stress])
                (folder / f"{name}.csv").write_text(
                    "strain (-),stress (MPa)\n"
                    + "\n".join(f"{e:.6f},{s:.8f}" for e, s in table)
                    + "\n"
                )
                rows.append(f"{name},{name}.csv,{grade},{coordinate},{temperature_C},1.14")
    (folder / "specimens.csv").write_text("\n".join(rows) + "\n")
    return folder


def fitted(folder: Path) -> PaletteStudy:
    return planner.fit([folder], law="neo-hookean", compare=False)


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> PaletteStudy:
    return fitted(lab(tmp_path_factory.mktemp("t") / "both", (COLD_C, WARM_C)))


def test_a_warmed_palette_is_known_by_the_file_that_it_makes(
    both: PaletteStudy, tmp_path: Path
) -> None:
    """So that a plan of it is no plan of the palette that was not warmed."""
    write_palette(both.palette, tmp_path / "lab.toml")
    cold = load_palette(tmp_path / "lab.toml")
    warm, _ = at_temperature(30.0, palette=cold)
    write_palette(warm, tmp_path / "warm.toml")
    assert warm.sha256 == load_palette(tmp_path / "warm.toml").sha256 != cold.sha256


def test_fit_gives_each_grade_its_own_factor(both: PaletteStudy) -> None:
    table = both.palette.temperature
    assert table is not None
    assert table.coordinate == (0.0, 0.4, 1.0)
    assert (table.low_C, table.high_C) == ((COLD_C,) * 3, (WARM_C,) * 3)
    # Two means of three specimens that scatter by 2 %.
    sd = 0.02 * (2.0 / 3.0) ** 0.5
    off = np.log(table.factor) - np.log([factor for *_, factor in GRADES.values()])
    assert (np.abs(off) < 3.0 * sd).all()
    # Pooled of four degrees of freedom, widened by 2.78 / 1.96.
    assert all(0.4 * sd < one < 3.5 * sd for one in table.log_sd)
    said = [note for note in both.notes if "warming multiplies" in note]
    assert len(said) == len(table.factor)
    assert f"soft by {table.factor[0]:.3g} from 25 to 35 degC (95 % " in said[0]
    assert any(note.startswith("laws are of 25 degC") for note in both.notes)
    assert not any("temperature_C differs" in note for note in both.notes)


def test_the_laws_are_those_of_the_tests_at_one_temperature(
    both: PaletteStudy, tmp_path: Path
) -> None:
    alone = fitted(lab(tmp_path / "cold", (COLD_C,)))
    assert alone.palette.temperature is None
    assert both.palette.reference.temperature_C == COLD_C
    for one, other in zip(both.palette.materials, alone.palette.materials, strict=True):
        (mu,), (mean,) = one.law.parameters["mu_MPa"], other.law.parameters["mu_MPa"]
        assert mu == pytest.approx(mean, rel=0.05)  # other draws of the same 2 % of scatter
        assert both.fits[one.id].characteristics.n == 3


def test_other_loadings_count_at_the_laws_temperature(tmp_path: Path) -> None:
    """A compressed specimen of 35 degC had half the weight in the law of 25 degC."""
    folder, strain = lab(tmp_path / "lab", (COLD_C,)), np.linspace(0.0, 0.3, 60)
    alone = fitted(folder)
    stress = 0.2 * (1.0 - strain - (1.0 - strain) ** -2.0)
    (folder / "pushed.csv").write_text(
        "strain (-),stress (MPa)\n"
        + "\n".join(f"{-e:.6f},{s:.8f}" for e, s in zip(strain, stress, strict=True))
    )
    listed = folder / "specimens.csv"
    head, *rows = listed.read_text().splitlines()
    rows = [f"{row},tension" for row in rows]
    for temperature_C, weighs in ((WARM_C, False), (COLD_C, True)):
        pushed = f"pushed,pushed.csv,soft,0.0,{temperature_C},1.14,compression"
        listed.write_text("\n".join([f"{head},mode", *rows, pushed]))
        both = fitted(folder)
        assert (both.fits["soft"].law != alone.fits["soft"].law) is weighs
        said = "specimen pushed: tested at 35 degC, where tension of soft was at 25; left out"
        assert (said in both.notes) is not weighs


def test_what_is_left_out_has_no_say_in_the_temperature(tmp_path: Path) -> None:
    """Others' 25 degC made a specimen of no known temperature the only one of the soft grade."""
    folder = lab(tmp_path / "lab", (COLD_C,))
    listed = folder / "specimens.csv"
    rows = listed.read_text()
    for number, instead in enumerate(("", "33.0", "43.0")):
        one = f"soft-25-{number}.csv,soft,0.0,"
        assert one in rows
        rows = rows.replace(f"{one}25.0", one + instead)
    listed.write_text(rows)
    found = planner.fit([folder], law="neo-hookean", compare=False, leave_out=["middle", "stiff"])
    assert found.palette.reference.temperature_C == 33.0
    table = found.palette.temperature
    assert table is not None
    assert (table.low_C, table.high_C) == ((33.0,), (43.0,))


@pytest.mark.parametrize(
    ("column", "cold", "warm", "told"),
    [
        ("age_days", "9", "60", "age_days differs between temperatures (9 at the palette's, 60"),
        (
            "orientation",
            "x",
            "z",
            "orientation differs between temperatures (x at the palette's, z",
        ),
        ("age_days", "9", "9", ""),
        ("age_days", "9", "", ""),
    ],
)
def test_what_else_differs_between_temperatures_is_told(
    tmp_path: Path, column: str, cold: str, warm: str, told: str
) -> None:
    """What warming does cannot be told from what came with it."""
    folder = lab(tmp_path / "lab", (COLD_C, WARM_C))
    listed = folder / "specimens.csv"
    head, *rows = listed.read_text().splitlines()
    lines = [f"{head},{column}", *(f"{row},{warm if ',35.0,' in row else cold}" for row in rows)]
    listed.write_text("\n".join(lines) + "\n")
    notes = " ".join(note for note in fitted(folder).notes if "between temperatures" in note)
    assert notes.startswith(told)
    assert bool(notes) is bool(told)


def test_one_name_left_out_is_no_list_of_letters(tmp_path: Path) -> None:
    found = planner.fit(
        [lab(tmp_path / "lab", (COLD_C,))], law="neo-hookean", compare=False, leave_out="soft"
    )
    assert [material.id for material in found.palette.materials] == ["middle", "stiff"]


def test_a_search_has_a_start(tmp_path: Path) -> None:
    with pytest.raises(ArgumentError, match=r"`starts` 0: it must be a whole number from 1"):
        planner.fit([lab(tmp_path / "lab", (COLD_C,))], starts=0)


def moduli(palette: Palette) -> np.ndarray:
    return np.array([float(secant_modulus_MPa(make_law(m.law), 0.1)) for m in palette.materials])


def test_a_palette_at_another_temperature(both: PaletteStudy) -> None:
    palette, table = both.palette, both.palette.temperature
    assert table is not None
    warm, notes = at_temperature(WARM_C, palette=palette)
    # 1e-8: palettes hold nine digits, as their files do.
    np.testing.assert_allclose(moduli(warm) / moduli(palette), table.factor, rtol=1e-8)
    assert warm.reference.temperature_C == WARM_C
    for before, after, sd in zip(palette.materials, warm.materials, table.log_sd, strict=True):
        assert after.modulus_log_sd == pytest.approx(np.hypot(before.modulus_log_sd, sd))
    assert len(notes) == 1  # no extrapolation
    # Half-way in temperature: the root; half-way in m between grades: the mean of ln factors.
    between = replace(palette.materials[1], id="between", coordinate=0.7)
    four = (*palette.materials[:2], between, palette.materials[2])
    half, _ = at_temperature(30.0, palette=replace(palette, materials=four))
    ratio = np.log(moduli(half)[2] / moduli(palette)[1])
    assert ratio == pytest.approx(0.25 * np.log(table.factor[1:]).sum())
    # At its own temperature nothing changes.
    same, _ = at_temperature(COLD_C, palette=palette)
    assert [m.law for m in same.materials] == [m.law for m in palette.materials]


@pytest.mark.parametrize("at_strain", [0.0, 0.1, 0.5])
def test_intervals_are_a_palettes_own_at_its_temperature_and_wider_elsewhere(
    both: PaletteStudy, at_strain: float
) -> None:
    """The deviations at strains went, so that those at rest shrank where laws are least sure."""
    soft = both.palette.materials[0]
    other = Reading("other", soft.law.stiffened(1.3), 0.1)
    palette = replace(
        both.palette, materials=(replace(soft, readings=(other,)), *both.palette.materials[1:])
    )

    def deviations(temperature_C: float) -> np.ndarray:
        warm, _ = at_temperature(temperature_C, palette=palette)
        read = parse_palette(encode_palette(warm), name="warm")
        return CoefficientModel(read).own_log_sds(at_strain, 1.96)

    own = CoefficientModel(palette).own_log_sds(at_strain, 1.96)
    # Files hold nine digits.
    np.testing.assert_allclose(deviations(COLD_C), own, rtol=1e-8)
    table = palette.temperature
    assert table is not None
    wider = np.hypot(own, table.log_sd)
    np.testing.assert_allclose(deviations(WARM_C)[:, 1:], wider[:, 1:], rtol=1e-8)
    # Of the other reading: its own deviation is wider, how far it lies off is not.
    far = np.log(1.3) / 1.96
    assert deviations(WARM_C)[1, 0] == pytest.approx(far + np.hypot(0.1, table.log_sd[0]))


def test_extrapolation_is_told(both: PaletteStudy) -> None:
    _, hot = at_temperature(60.0, palette=both.palette)
    assert any("60 degC is an extrapolation" in note for note in hot)
    beyond = replace(both.palette.materials[-1], id="rigid", coordinate=1.5)
    more = replace(both.palette, materials=(*both.palette.materials, beyond))
    warm, notes = at_temperature(30.0, palette=more)
    assert any(note.startswith("rigid: beyond the grades") for note in notes)
    ratios = moduli(warm) / moduli(more)
    assert ratios[3] == pytest.approx(ratios[2])


def test_files(both: PaletteStudy, tmp_path: Path) -> None:
    data = encode_palette(both.palette)
    again = parse_palette(data, name="again").temperature
    table = both.palette.temperature
    assert again is not None
    assert table is not None
    np.testing.assert_allclose(again.factor, table.factor, rtol=1e-8)
    for before, after in (
        (b"high_C = [35.0", b"high_C = [25.0"),
        (b"factor = [", b"factor = [0.5, "),
        (b"factor = [", b"factor = [-"),
    ):
        with pytest.raises(PaletteError, match="temperature: coordinate, low_C, high_C, factor"):
            parse_palette(data.replace(before, after), name="bad")
    with pytest.raises(PaletteError, match="unknown field `factors`"):
        parse_palette(data.replace(b"factor =", b"factors ="), name="bad")
    with pytest.raises(PaletteError, match=r"needs \[reference\] temperature_C and a table"):
        at_temperature(30.0)


def test_command(both: PaletteStudy, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    own, warm = tmp_path / "lab.toml", tmp_path / "warm.toml"
    write_palette(both.palette, own)
    command = ["materials", "--palette", str(own), "-o", str(warm)]
    assert run(command) == 2
    assert "give --temperature-C" in capsys.readouterr().err
    assert run([*command, "--temperature-C", "35"]) == 0
    assert "at 35 degC, of stress at 25 degC: soft 0.49" in "".join(capsys.readouterr())
    np.testing.assert_allclose(
        moduli(load_palette(warm)), moduli(at_temperature(35.0, palette=own)[0]), rtol=1e-8
    )
    assert run(["materials", "--palette", str(own), "--temperature-C", "35", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["materials"]
    assert told[0]["modulus_MPa"] == pytest.approx(moduli(load_palette(warm))[0], rel=1e-8)
