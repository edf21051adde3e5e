"""Records that no figure should rest on: refused, or corrected in sight."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from planner.errors import FileError
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

CYCLE = np.abs(np.sin(6 * STRAIN)) + STRAIN


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"strain": 100 * STRAIN, "stress_MPa": STRESS}, "in per cent"),
        ({"strain": 20 * STRAIN, "stress_MPa": 60 * STRESS}, "per cent is likely"),
        ({"strain": 3 * STRAIN, "stress_MPa": 30 * STRESS}, "per cent is likely"),
        ({"strain": 25 * STRAIN, "stress_MPa": 5 * STRESS}, "per cent is likely"),
        ({"strain": LOOP, "stress_MPa": LOOP_STRESS}, "falls back .* behind the peak"),
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
         "per-cent-tough", "loading-unloading", "unloading-in-part", "compression", "psi",
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
    ],
    ids=["per-cent", "psi", "lbf"],
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
    assert only(found).time_s is None
    assert "time does not rise at line 42" in " ".join(found.notes)


def test_negative_time_and_tension_are_turned_in_sight(tmp_path: Path) -> None:
    found = study(tmp_path, {"time_s": TIME - 1.0, "strain": STRAIN, "stress_MPa": -STRESS})
    time = only(found).time_s
    assert time is not None
    assert time[0] == 0.0
    assert only(found).stress_MPa.max() > 0.0
    assert "sign was turned" in " ".join(found.notes)
    assert "starts at -1 s" in " ".join(found.notes)


def test_a_broken_tail_is_cut_in_sight(tmp_path: Path) -> None:
    strain = np.linspace(0.0, 1.0, 101)
    stress = np.concatenate([STRESS, [0.3 * STRESS[-1]], np.zeros(19)])
    found = study(tmp_path, {"strain": strain, "stress_MPa": stress})
    # 1e-8: nine digits in the text.
    assert only(found).strain[-1] == pytest.approx(0.8, abs=1e-8)
    assert "breaks at strain 0.8; 20 points behind it are cut" in " ".join(found.notes)


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
        ({"time_s": TIME[::-1]}, "time must rise"),
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
