"""Units taken for others, caught by palette, replicates or ladder; honest labs are not accused."""

import json
import math
import re
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest

import planner
from planner.cli import run
from planner.errors import UnknownNameError
from planner.formats.units import QUANTITY_UNITS, unit_near
from planner.materials.laws import make_law
from planner.materials.unit_slips import batch_apart
from planner.palette import Palette
from planner.printers import palette_of

POUND_N = QUANTITY_UNITS["force"]["lbf"]
ELASTOMERS = ("FLX9740", "FLX9750", "FLX9760", "FLX9770", "FLX9785", "FLX9795")
SIZES = ["--width-mm", "3", "--thickness-mm", "2", "--gauge-mm", "15"]


@pytest.fixture(scope="module")
def palette() -> Palette:
    return palette_of()


def write_record(
    path: Path, palette: Palette, material: str, *, force: float = 1.0, travel: float = 1.0
) -> None:
    """A record of a palette's material whose numbers are in `force` newtons and `travel` mm."""
    law = palette.resolve(material)
    strain = np.linspace(0.0, law.elongation_at_break, 81)
    load_N = 6.0 * make_law(law.law).nominal_stress_MPa(1.0 + strain)
    rows = "".join(
        f"{15.0 * e / travel:.9f},{f / force:.9f}\n" for e, f in zip(strain, load_N, strict=True)
    )
    path.write_text(f"Travel (mm),Load (N)\n{rows}", encoding="utf-8")


def write_study(
    folder: Path, palette: Palette, off: Mapping[str, Mapping[str, float]], *, replicates: int = 2
) -> None:
    """Two prints a material, 5 % apart; what `off` names is in other units."""
    for material in ELASTOMERS:
        for n in range(replicates):
            units = {"force": 1.0, "travel": 1.0, **off.get(material, {})}
            scatter = {"force": units["force"] * (1.0 + 0.05 * n), "travel": units["travel"]}
            write_record(folder / f"{material}-{n + 1}.csv", palette, material, **scatter)


def options(said: str) -> list[str]:
    found = re.search(r"--unit-of ('[^']+'|\S+?),? or --no-compare", said)
    assert found is not None
    return ["--unit-of", *shlex.split(found[1])]


@pytest.mark.parametrize(
    ("batch", "unit", "quantity"),
    [
        (ELASTOMERS[:5], "lbf", "force"),
        (("FLX9760", "FLX9785"), "lbf", "force"),
        (("FLX9750",), "kgf", "force"),
        (("FLX9770", "FLX9785", "FLX9795"), "kN", "force"),
        (("FLX9760", "FLX9770"), "in", "travel"),
    ],
)
def test_a_batch_in_another_unit_is_a_finding_that_says_how_to_read_it(
    tmp_path: Path, palette: Palette, capsys, batch: Sequence[str], unit: str, quantity: str
) -> None:
    kind = "force" if quantity == "force" else "length"
    write_study(tmp_path, palette, {m: {quantity: QUANTITY_UNITS[kind][unit]} for m in batch})
    command = ["characterise", str(tmp_path), *SIZES]
    assert run(command) == 1
    (said,) = (s for s in capsys.readouterr().err.splitlines() if "finding" in s)
    own = "N" if quantity == "force" else "mm"
    assert f"was {unit} taken for {own}" in said
    assert "the palette connex3-tango-vero, while " in said
    for material in ELASTOMERS:
        assert (material in said.partition("palette")[0]) == (material in batch)
    assert run([*command, *options(said)]) == 0
    assert f"{quantity} is read in the unit {unit}" in capsys.readouterr().err
    assert run([*command, "--no-compare"]) == 0


def test_honest_tests_of_the_palettes_materials_are_none(
    tmp_path: Path, palette: Palette, capsys
) -> None:
    write_study(tmp_path, palette, {})
    assert run(["characterise", str(tmp_path), *SIZES]) == 0
    assert "taken for" not in capsys.readouterr().err


def test_all_in_another_unit_is_a_warning_alone(tmp_path: Path, palette: Palette, capsys) -> None:
    write_study(tmp_path, palette, {m: {"force": 9.80665} for m in ELASTOMERS})
    assert run(["characterise", str(tmp_path), *SIZES]) == 0
    said = capsys.readouterr().err
    assert "warning: FLX9740, FLX9750" in said
    assert "was kgf taken for N, or is a size wrong?" in said


def test_the_last_grade_alone_is_a_warning(tmp_path: Path, palette: Palette, capsys) -> None:
    """A lab may honestly soften one end of the ladder by much, so that it is no error."""
    write_study(tmp_path, palette, {"FLX9795": {"force": POUND_N}})
    assert run(["characterise", str(tmp_path), *SIZES]) == 0
    said = capsys.readouterr().err
    assert "warning: FLX9795 is 4.5 times below the palette" in said
    assert (
        "was lbf taken for N, or is a size wrong? Give --unit-of force=lbf:FLX9795, or --no-compare"
        in said
    )


def test_fit_says_the_same(tmp_path: Path, palette: Palette, capsys, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "tests").mkdir()
    write_study(tmp_path / "tests", palette, {"FLX9760": {"force": 9.80665}}, replicates=1)
    assert run(["fit", "tests", *SIZES, "--law", "neo-hookean", "--json"]) == 1
    findings = json.loads(capsys.readouterr().out)["findings"]
    assert [f for f in findings if "Give --unit-of force=kgf:FLX9760" in f]


@pytest.mark.parametrize("name", ["Lbf=N", "force=stone", "force=lbf:nobody"])
def test_a_unit_specimen_or_quantity_that_is_not_there(
    tmp_path: Path, palette: Palette, name: str
) -> None:
    write_study(tmp_path, palette, {})
    with pytest.raises(UnknownNameError, match="no "):
        planner.characterise([tmp_path], unit_of=name, width_mm=3, thickness_mm=2, gauge_mm=15)


def test_a_column_that_is_not_there(tmp_path: Path, palette: Palette, capsys) -> None:
    write_study(tmp_path, palette, {})
    assert run(["characterise", str(tmp_path), *SIZES, "--unit-of", "stress=psi"]) == 2
    assert "no column of stress" in capsys.readouterr().err


# ------------------------------------------------------------------------------------------------
# Replicates in mixed units, and a ladder of materials that no palette knows.


def test_replicates_in_mixed_units_name_the_unit(tmp_path: Path, palette: Palette, capsys) -> None:
    for n, force in enumerate((1.0, 1.0, POUND_N), start=1):
        write_record(tmp_path / f"own-{n}.csv", palette, "FLX9760", force=force)
    command = ["characterise", str(tmp_path), *SIZES]
    assert run(command) == 1
    said = capsys.readouterr().err
    assert "own-3 is 4.45 times below the other specimens: was lbf taken for N, or" in said
    assert said.count("finding: ") == 1  # what follows from it is not told again
    palette_file = str(tmp_path.parent / f"{tmp_path.name}.toml")
    assert run(["fit", *command[1:], "-o", palette_file]) == 1
    assert capsys.readouterr().err.count("finding: ") == 1
    assert run([*command, "--unit-of", "force=lbf:own-3"]) == 0


def test_fractions_taken_for_per_cent_are_told_with_an_option_that_there_is(
    tmp_path: Path, palette: Palette, capsys
) -> None:
    law = palette.resolve("FLX9760")
    strain = np.linspace(0.0, law.elongation_at_break, 81)
    stress = make_law(law.law).nominal_stress_MPa(1.0 + strain)
    rows = "".join(f"{e:.9f},{s:.9f}\n" for e, s in zip(strain, stress, strict=True))
    path = tmp_path / "FLX9760.csv"
    path.write_text(f"Strain (%),Stress (MPa)\n{rows}", encoding="utf-8")
    assert run(["characterise", str(path)]) == 0
    said = capsys.readouterr().err
    assert "were fractions taken for %?" in said
    assert run(["characterise", str(path), *options(said)]) == 0
    assert "taken for" not in capsys.readouterr().err


def test_a_conversion_too_many_is_undone(tmp_path: Path, palette: Palette, capsys) -> None:
    for n, force in enumerate((1.0, 1.0, 1.0 / POUND_N), start=1):
        write_record(tmp_path / f"own-{n}.csv", palette, "FLX9760", force=force)
    command = ["characterise", str(tmp_path), *SIZES]
    assert run(command) == 1
    said = capsys.readouterr().err
    assert (
        "was N converted as if it were lbf, or is a size wrong? Give --unit-of force=0.224809:own-3"
        in said
    )
    assert run([*command, "--unit-of", "force=0.224809:own-3"]) == 0


def test_a_ladder_out_of_order_names_the_unit(tmp_path: Path, palette: Palette, capsys) -> None:
    """Own names with coordinates; one of five in pounds-force."""
    listing = "specimen,material,file,width_mm,thickness_mm,gauge_mm,coordinate\n"
    for n, material in enumerate(ELASTOMERS[:5]):
        force = POUND_N if n == 2 else 1.0
        write_record(tmp_path / f"s{n}.csv", palette, material, force=force)
        listing += f"s{n},Own{n},s{n}.csv,3,2,15,{n / 4}\n"
    (tmp_path / "specimens.csv").write_text(listing, encoding="utf-8")
    assert run(["characterise", str(tmp_path)]) == 1
    said = capsys.readouterr().err
    assert "times softer than Own1, whose coordinate is lower" in said
    assert "was lbf taken for N, or is a size wrong? Give --unit-of force=lbf:Own2" in said
    assert run(["characterise", str(tmp_path), "--unit-of", "force=lbf:Own2"]) == 0


# ------------------------------------------------------------------------------------------------
# False alarms: labs whose materials differ from the palette honestly.


def honest(kind: str, rng: np.random.Generator, m: np.ndarray, sd: np.ndarray) -> np.ndarray:
    """ln of measured over expected stiffness: the lab as a whole, along the ladder, each alone."""
    lab, tilt = rng.normal(0.0, math.log(2.0) / 1.96, 2)
    each = 0.2 * (rng.standard_t(4, len(m)) if kind == "heavy" else rng.normal(size=len(m)))
    found = lab + tilt * (m - m.mean()) + each + rng.normal(0.0, sd)
    if kind == "warm":  # the hardest is softened by a factor of 3, the soft ones hardly
        found -= math.log(3.0) * m**3
    if kind == "one":
        found[rng.integers(len(m))] += rng.choice([-1.0, 1.0]) * math.log(2.0)
    return found


@pytest.mark.parametrize(("kind", "most"), [("plain", 1), ("heavy", 20), ("warm", 20), ("one", 20)])
def test_honest_labs_are_not_accused(palette: Palette, kind: str, most: int) -> None:
    """Of 1000 labs: at most one as the rule promises, and 2 % where its model does not hold."""
    elastic = [material for material in palette.materials if material.deformation == "elastic"]
    m = np.array([material.coordinate for material in elastic])
    sd = np.hypot([material.modulus_log_sd for material in elastic], 0.05)
    rng = np.random.default_rng(20)
    accused = warned = 0
    for _ in range(1000):
        some = np.sort(rng.choice(len(m), rng.integers(3, len(m) + 1), replace=False))
        batch = batch_apart(m[some], honest(kind, rng, m[some], sd[some]), sd[some] ** 2)
        # The reach of a unit's factor is the rule's.
        if batch is not None and unit_near("force", -batch.shift, 1.0, 0.35) is not None:
            warned += 1
            accused += batch.sure and len(batch.members) < len(some)
    assert accused <= most
    # A warning asks less: at most one lab in ten, in the worst of these worlds.
    assert warned <= 100
