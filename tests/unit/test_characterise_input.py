"""Records that no figure should rest on: refused, or corrected in sight."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

import planner
from planner.errors import ArgumentError, FileError
from planner.formats.specimens import read_specimens
from planner.materials.characterise import Curve
from planner.materials.study import Study, read_study
from planner.numerics import FloatArray

STRAIN = np.linspace(0.0, 0.8, 81)
STRESS = 0.5 * (1.0 + STRAIN - (1.0 + STRAIN) ** -2.0)
TIME = np.arange(81) * 0.1


def study(tmp_path: Path, columns: Mapping[str, FloatArray], **options: float) -> Study:
    path = tmp_path / "s.csv"
    lines = [",".join(columns)]
    lines += [",".join(f"{v:.9g}" for v in row) for row in zip(*columns.values(), strict=True)]
    path.write_text("\n".join(lines) + "\n")
    return read_study([path], **options)  # type: ignore[arg-type]  # sizes alone


def only(found: Study) -> Curve:
    ((curve,),) = found.groups.values()
    return curve


NOISE = 0.002 * np.random.default_rng(1).standard_normal(81)

LOOP = np.concatenate([STRAIN, STRAIN[::-1]])
LOOP_STRESS = np.concatenate([STRESS, 0.8 * STRESS[::-1]])

STEPS = np.concatenate([np.append(STRAIN[k:k + 20], np.full(20, STRAIN[k + 19]))
                        for k in (0, 20, 40, 60)])  # fmt: skip
RELAXED = 0.5 * (1.0 + STEPS - (1.0 + STEPS) ** -2.0)
RELAXED *= 1.0 - 0.3 * (np.arange(160) % 40 >= 20)

CYCLE = np.abs(np.sin(6 * STRAIN)) + STRAIN


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"strain": 100 * STRAIN, "stress_MPa": STRESS}, "in per cent"),
        ({"strain": 20 * STRAIN, "stress_MPa": 60 * STRESS}, "per cent is likely"),
        ({"strain": 3 * STRAIN, "stress_MPa": 30 * STRESS}, "per cent is likely"),
        ({"strain": 25 * STRAIN, "stress_MPa": 5 * STRESS}, "per cent is likely"),
        ({"strain": LOOP, "stress_MPa": LOOP_STRESS}, "falls back .* behind the peak"),
        ({"strain": STEPS, "stress_MPa": RELAXED}, "while strain stands, as in a relaxation test"),
        ({"strain": LOOP[:121], "stress_MPa": LOOP_STRESS[:121]}, "falls back .* behind the peak"),
        ({"strain": -STRAIN / 4, "stress_MPa": -STRESS}, "as in compression"),
        ({"strain": STRAIN, "stress_MPa": 2000 * STRESS}, "psi or kPa"),
        ({"strain": STRAIN[:3], "stress_MPa": STRESS[:3]}, "the record has 3 points"),
        ({"strain": STRAIN, "stress_MPa": NOISE}, "never loads"),
        ({"strain": STRAIN, "stress_MPa": 0 * STRESS}, "never loads"),
        ({"strain": 0 * STRAIN, "stress_MPa": STRESS}, "strain stands at 0"),
        ({"stress_MPa": STRAIN, "strain": STRESS + NOISE}, "swapped"),
        ({"stress_MPa": STRAIN, "strain": STRESS}, "swapped"),
        (
            {"strain": CYCLE, "stress_MPa": 0.5 * CYCLE + NOISE},
            "falls back .* before the peak",
        ),
    ],
    ids=["per-cent", "per-cent-rigid", "per-cent-brittle",
         "per-cent-tough", "loading-unloading", "steps", "unloading-in-part", "compression", "psi",
         "three-points", "noise", "zero", "no-strain",
         "swapped-noisy", "swapped", "cyclic"],
)  # fmt: skip
def test_refused(tmp_path: Path, columns: dict[str, FloatArray], message: str) -> None:
    with pytest.raises(FileError, match=message) as caught:
        study(tmp_path, columns)
    assert "specimen s" in str(caught.value)


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"strain": 10 * STRAIN, "displacement_mm": STRAIN, "stress_MPa": STRESS}, "per cent"),
        ({"strain": STRAIN, "stress_MPa": 145.0377 * STRESS, "force_N": 6 * STRESS}, "psi"),
        ({"strain": STRAIN, "stress_MPa": STRESS, "force_N": 6 * STRESS / 4.448222}, "lbf"),
        ({"strain": STRAIN, "stress_MPa": 6 * STRESS, "force_N": 6 * STRESS}, "correct the size"),
        (
            {"strain": STRAIN, "stress_MPa": (1.0 + STRAIN) * STRESS, "force_N": 6 * STRESS},
            "leave one out by --columns",
        ),
    ],
    ids=["per-cent", "psi", "lbf", "section-of-one", "true-stress"],
)
def test_columns_that_contradict_each_other_name_the_slip(
    tmp_path: Path, columns: dict[str, FloatArray], message: str
) -> None:
    with pytest.raises(FileError, match=message):
        study(tmp_path, columns, width_mm=3, thickness_mm=2, gauge_mm=10)


def test_time_that_falls_back_is_left_out_in_sight(tmp_path: Path) -> None:
    time = TIME.copy()
    time[40] = 0.0
    found = study(tmp_path, {"time_s": time, "strain": STRAIN, "stress_MPa": STRESS})
    assert "time does not rise at line 42" in " ".join(found.notes)


def test_negative_tension_is_turned_in_sight(tmp_path: Path) -> None:
    found = study(tmp_path, {"time_s": TIME - 1.0, "strain": STRAIN, "stress_MPa": -STRESS})
    assert only(found).stress_MPa.max() > 0.0
    assert "sign was turned" in " ".join(found.notes)


def test_a_broken_tail_is_cut_in_sight(tmp_path: Path) -> None:
    strain = np.linspace(0.0, 1.0, 101)
    stress = np.concatenate([STRESS, [0.3 * STRESS[-1]], np.zeros(19)])
    found = study(tmp_path, {"strain": strain, "stress_MPa": stress})
    # 1e-8: nine digits in the text.
    assert only(found).strain[-1] == pytest.approx(0.8, abs=1e-8)
    assert "breaks at strain 0.8; 20 points behind it are cut" in " ".join(found.notes)


def test_a_break_ahead_of_a_later_load_is_asked(tmp_path: Path) -> None:
    """As where the crosshead runs against its stop behind the break."""
    strain = np.linspace(0.0, 1.0, 101)
    stress = np.concatenate([STRESS, np.full(15, -0.01), STRESS[-1] * np.linspace(0.5, 9, 5)])
    found = study(tmp_path, {"strain": strain, "stress_MPa": stress})
    assert "bears nothing from strain 0.81 on" in " ".join(found.notes)


def test_a_strain_that_springs_back_at_rupture_is_no_unloading(tmp_path: Path) -> None:
    """An extensometer falls back when the specimen is broken and bears nothing."""
    strain = np.concatenate([STRAIN, np.linspace(0.5, 0.1, 10)])
    found = study(tmp_path, {"strain": strain, "stress_MPa": np.append(STRESS, np.zeros(10))})
    # 1e-8: nine digits in the text.
    assert only(found).strain[-1] == pytest.approx(0.8, abs=1e-8)


def test_a_strain_that_jitters_beside_a_smooth_load_is_not_swapped(tmp_path: Path) -> None:
    """Measured optically: noise of 0.2 % of the range, a smooth curved load."""
    strain = np.linspace(0.0, 0.8, 801)
    jitter = 0.01 + strain + 0.0016 * np.random.default_rng(3).standard_normal(801)
    assert np.max(np.maximum.accumulate(jitter) - jitter) > 1e-3 * 0.8
    found = study(tmp_path, {"strain (mm/mm)": jitter, "stress_MPa": np.tanh(2 * strain)})
    assert len(only(found).strain) == 801


def test_points_in_compression_are_left_out_in_sight(tmp_path: Path) -> None:
    """A curve through compression and tension gives the tension's figures."""
    strain = np.append(-0.4 + STRAIN[:40], STRAIN)
    stress = 0.5 * (1.0 + strain - (1.0 + strain) ** -2.0)
    found = study(tmp_path, {"strain (mm/mm)": strain, "stress_MPa": stress})
    # 1e-8: nine digits in the text.
    np.testing.assert_allclose(only(found).strain, STRAIN, atol=1e-8)
    assert "40 points up to strain 0 are left out, for strain is negative there (from -0.4)" in (
        " ".join(found.notes)
    )


def test_a_crosshead_below_its_datum_counts_upwards(tmp_path: Path) -> None:
    travel = {"displacement_mm": -40.0 + 30.0 * STRAIN, "force_N": 6.0 * STRESS}
    found = study(tmp_path, travel, width_mm=3, thickness_mm=2, gauge_mm=30)
    # 1e-8: nine digits in the text.
    assert only(found).strain[-1] == pytest.approx(0.8, abs=1e-8)


def test_a_yield_drop_is_no_tail(tmp_path: Path) -> None:
    stress = np.where(STRAIN < 0.1, 300 * STRAIN, 30 - 20 * (STRAIN - 0.1))
    found = study(tmp_path, {"strain": STRAIN, "stress_MPa": stress})
    assert len(only(found).strain) == 81


def test_true_measures_are_turned_to_nominal_ones(tmp_path: Path) -> None:
    columns = {"True strain": np.log1p(STRAIN), "true_stress_MPa": STRESS * (1.0 + STRAIN)}
    curve = only(study(tmp_path, columns))
    # 1e-8: nine digits in the text.
    np.testing.assert_allclose(curve.strain, STRAIN, atol=1e-8)
    np.testing.assert_allclose(curve.stress_MPa, STRESS, atol=1e-8)


def test_travel_counts_from_an_unloaded_start_only(tmp_path: Path) -> None:
    travel = {"displacement_mm": 40.0 + 10.0 * STRAIN, "force_N": 6.0 * STRESS}
    found = study(tmp_path, travel, width_mm=3, thickness_mm=2, gauge_mm=10)
    assert only(found).strain[0] == 0.0
    assert "counted from its first value, 40 mm" in " ".join(found.notes)
    cut = {"displacement_mm": 10.0 * STRAIN[9:], "force_N": 6.0 * STRESS[9:]}
    found = study(tmp_path, cut, width_mm=3, thickness_mm=2, gauge_mm=10)
    # 1e-8: nine digits in the text.
    assert only(found).strain[0] == pytest.approx(STRAIN[9], abs=1e-8)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"strain": STRAIN[1:]}, "differ in shape"),
        ({"strain": STRAIN[:4], "stress_MPa": STRESS[:4]}, "has 4 points"),
        ({"stress_MPa": np.where(STRAIN == 0.0, np.nan, STRESS)}, "stress_MPa is nan at point 1"),
    ],
)
def test_a_curve_refuses_what_no_fit_should_see(
    changes: dict[str, FloatArray], message: str
) -> None:
    values = {"strain": STRAIN, "stress_MPa": STRESS} | changes
    with pytest.raises(FileError, match=message):
        Curve("s", **values)  # type: ignore[arg-type]  # arrays alone


RUBBER_STRAIN = np.linspace(0.0, 0.8, 81)
RUBBER_MPa = 1.0 - np.exp(-RUBBER_STRAIN)


def test_travel_under_a_preload_counts_from_no_load(tmp_path: Path) -> None:
    """The tangent at a load of 9 % of the peak meets zero 0.0012 from where the curve does."""
    loaded = slice(5, None)
    columns = {"displacement_mm": 12.5 + 25.0 * RUBBER_STRAIN, "stress_MPa": RUBBER_MPa}
    found = study(tmp_path, {name: of[loaded] for name, of in columns.items()}, gauge_mm=25.0)
    assert only(found).strain[0] == pytest.approx(RUBBER_STRAIN[5], abs=0.003)
    assert "counted from no load, by a line through its first 6 rows" in " ".join(found.notes)


def test_travel_under_a_preload_that_is_held_counts_from_its_first_value(tmp_path: Path) -> None:
    rows = [5] * 10 + [*range(6, 81)]
    columns = {"displacement_mm": 100.0 + 25.0 * RUBBER_STRAIN, "stress_MPa": RUBBER_MPa}
    found = study(tmp_path, {name: of[rows] for name, of in columns.items()}, gauge_mm=25.0)
    assert only(found).strain[0] == pytest.approx(0.0, abs=1e-8)
    assert "displacement counted from its first value, 101.2 mm" in " ".join(found.notes)


def test_travel_that_counts_from_no_load_stays_though_its_first_row_lies_behind(
    tmp_path: Path,
) -> None:
    columns = {"displacement_mm": 25.0 * RUBBER_STRAIN[1:], "stress_MPa": RUBBER_MPa[1:]}
    found = study(tmp_path, columns, gauge_mm=25.0)
    assert only(found).strain[0] == pytest.approx(RUBBER_STRAIN[1], abs=1e-8)


def test_a_strain_that_begins_elsewhere_counts_from_no_load(tmp_path: Path) -> None:
    found = study(tmp_path, {"strain": 0.5 + RUBBER_STRAIN, "stress_MPa": RUBBER_MPa})
    assert only(found).strain[0] == pytest.approx(0.0, abs=1e-8)
    assert "strain counted from its first value, 0.5" in " ".join(found.notes)


@pytest.mark.parametrize("values", [{40: 0.0}, {40: 3.0}, {20: -0.2, 21: -0.2}])
def test_a_point_that_leaps_out_is_no_break(tmp_path: Path, values: dict[int, float]) -> None:
    stress = STRESS + NOISE
    stress[list(values)] = list(values.values())
    curve = only(study(tmp_path, {"strain": STRAIN, "stress_MPa": stress}))
    assert curve.strain[-1] == STRAIN[-1]
    assert len(curve.strain) == len(STRAIN) - len(values)
    leap = "1 point leaps" if len(values) == 1 else "2 points leap"
    assert any(f"{leap} out of the record" in note for note in curve.notes)


def test_a_break_at_the_end_is_one(tmp_path: Path) -> None:
    stress = STRESS + NOISE
    stress[-2:] = 0.0
    curve = only(study(tmp_path, {"strain": STRAIN, "stress_MPa": stress}))
    assert curve.strain[-1] == STRAIN[-3]
    assert any("breaks at strain" in note for note in curve.notes)


HEADED = "specimen,material,file,{}\na,M,s.csv,8\n"


@pytest.mark.parametrize("heading", ["Temperature (K)", "temperature_K", "Width (in)", "width_cm"])
def test_a_condition_in_a_unit_of_its_own_is_refused(tmp_path: Path, heading: str) -> None:
    """It would be lost without a word, and specimens that differ would count as replicates."""
    (tmp_path / "specimens.csv").write_text(HEADED.format(heading), encoding="utf-8")
    with pytest.raises(FileError, match="its unit is not understood; give the values as"):
        study(tmp_path, {"strain": STRAIN, "stress_MPa": STRESS})


def test_a_size_in_its_own_unit_is_read(tmp_path: Path) -> None:
    head = "specimen,material,file,Width (mm),Thickness [mm],Temperature (°C)"
    (tmp_path / "specimens.csv").write_text(f"{head}\na,M,s.csv,6,2,35\n", encoding="utf-8")
    found = study(tmp_path, {"strain": STRAIN, "force_N": 12.0 * STRESS})
    assert only(found).stress_MPa[-1] == pytest.approx(STRESS[-1])
    (row,) = read_specimens(tmp_path / "specimens.csv")
    assert (row.width_mm, row.thickness_mm, row.temperature_C) == (6.0, 2.0, 35.0)


def test_replicates_may_be_numbered_from_nought(tmp_path: Path) -> None:
    rows = "".join(f"{e:.9g},{s:.9g}\n" for e, s in zip(STRAIN, STRESS, strict=True))
    for number in range(3):
        (tmp_path / f"R-{number}.csv").write_text(f"strain,stress_MPa\n{rows}")
    assert list(read_study(sorted(tmp_path.glob("*.csv"))).groups) == ["R"]


def warm_and_cold(tmp_path: Path) -> Path:
    """Two specimens of one rubber at each of two temperatures, warm ones half as stiff."""
    rows = ["specimen,material,file,temperature_C"]
    for number, (warm, share) in enumerate([(23, 1.0), (23, 1.01), (40, 0.5), (40, 0.505)]):
        rows.append(f"{number},M,{number}.csv,{warm}")
        lines = [f"{e:.9g},{share * s:.9g}" for e, s in zip(STRAIN, STRESS, strict=True)]
        (tmp_path / f"{number}.csv").write_text("\n".join(["strain,stress_MPa", *lines]))
    (tmp_path / "specimens.csv").write_text("\n".join(rows))
    return tmp_path


def test_figures_that_mix_temperatures_say_so(tmp_path: Path) -> None:
    found = planner.characterise(warm_and_cold(tmp_path))  # a folder as such, as in all commands
    assert found.materials[0].n == 4
    assert any("temperature_C differs between specimens (23 to 40)" in n for n in found.notes)


def test_a_fit_says_which_conditions_are_unknown_and_refuses_kg_m3(tmp_path: Path) -> None:
    folder = warm_and_cold(tmp_path)
    options = {"law": "neo-hookean", "starts": 2, "compare": False}
    (told,) = (n for n in planner.fit(folder, **options).notes if "conditions unknown" in n)
    assert told.startswith(
        "reference conditions unknown: strain_rate_per_s, soak_h, age_days, orientation"
    )
    with pytest.raises(ArgumentError, match=r"in g/cm3: 1140 kg/m3 are 1.14"):
        planner.fit(folder, density={"M": 1140.0}, **options)


def test_specimens_that_are_numbered_anew_in_each_material(tmp_path: Path) -> None:
    lines = ["material,specimen,stretch ratio,stress (MPa)"]
    for material, of in (("A", 1.0), ("B", 2.0)):
        for number in (1, 2):
            pairs = zip(STRAIN[::4], STRESS[::4], strict=True)
            lines += [f"{material},{number},{1.0 + e:.9g},{of * s:.9g}" for e, s in pairs]
    (tmp_path / "long.csv").write_text("\n".join(lines))
    groups = read_study([tmp_path / "long.csv"]).groups
    assert {m: [c.specimen for c in curves] for m, curves in groups.items()} == {
        "A": ["A-1", "A-2"],
        "B": ["B-1", "B-2"],
    }


@pytest.mark.parametrize(("width_mm", "told"), [(6.0, True), (10.1, False)])
def test_a_size_that_overrules_the_files_head_is_told(
    tmp_path: Path, width_mm: float, *, told: bool
) -> None:
    rows = "".join(f"{2 * k},{0.5 * k}\n" for k in range(12))
    text = f"Width,10,mm\nThickness,3,mm\nGauge length,25,mm\n\nTravel (mm),Load (N)\n{rows}"
    (tmp_path / "s.csv").write_text(text)
    found = read_study([tmp_path / "s.csv"], width_mm=width_mm)
    said = "s.csv: its head gives width_mm 10; 6 counts, from --width-mm"
    assert any(note.endswith(said) for note in found.notes) == told
    ((curve,),) = found.groups.values()
    assert curve.stress_MPa[-1] == pytest.approx(5.5 / (3.0 * width_mm))


def test_a_hold_at_the_end_is_no_break(tmp_path: Path) -> None:
    held = np.full(40, STRAIN[-1])
    relaxed = STRESS[-1] * (0.7 + 0.3 * np.exp(-np.arange(40) / 10.0))
    columns = {"strain": np.append(STRAIN, held), "stress_MPa": np.append(STRESS, relaxed)}
    for more, told in ((columns, True), ({"strain": STRAIN, "stress_MPa": STRESS}, False)):
        ((one,),) = (m.specimens for m in planner.characterise(study(tmp_path, more)).materials)
        said = "it ends in a hold of 41 points at strain 0.8; it was not pulled to its break"
        assert any(said in note for note in one.notes) == told


def test_rows_from_the_largest_load_down_are_no_compression(tmp_path: Path) -> None:
    """As papers sort them, by stretch; its strains would count from the largest."""
    stretch = np.linspace(0.6, 1.0, 81)
    columns = {"stretch": stretch, "stress_MPa": 0.5 * (stretch - stretch**-2.0)}
    with pytest.raises(FileError, match="stress begins at its peak of"):
        study(tmp_path, columns, mode="compression")  # type: ignore[arg-type]
    columns = {name: values[::-1] for name, values in columns.items()}
    found = study(tmp_path, columns, mode="compression")  # type: ignore[arg-type]
    ((curve,),) = found.other_modes.values()
    # 1e-8: nine digits in the text.
    np.testing.assert_allclose(curve.strain, columns["stretch"] - 1.0, atol=1e-8)


@pytest.mark.parametrize("fallen", [0.0, 0.03])
def test_a_coarse_strain_and_a_short_hold_are_no_steps(tmp_path: Path, fallen: float) -> None:
    """Strain to a hundredth of its range, and a wait that costs 3 % of the load."""
    strain = np.round(np.linspace(0.0, 0.8, 2001), 2)
    stress = 0.5 * (1.0 + strain - (1.0 + strain) ** -2.0)
    stress[1000:1100] -= fallen * stress[-1] * np.linspace(0.0, 1.0, 100)
    strain[1000:1100] = strain[1000]
    assert len(only(study(tmp_path, {"strain": strain, "stress_MPa": stress})).strain) > 1900
