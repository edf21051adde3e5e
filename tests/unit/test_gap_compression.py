"""Compressed specimens: negative travel and force, from the record to the diagnosis."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planner.errors import FileError
from planner.gap.campaign import Campaign, Specimen
from planner.gap.campaign_folder import read_campaign, write_campaign
from planner.gap.diagnose import diagnose
from planner.gap.observations import BRANCHES, ObservationModel
from planner.gap.quality import examine
from planner.gap.segments import path_of
from planner.gap.virtual import read_design
from planner.materials.laws import make_law
from planner.palette import LawParameters, Material, Palette, Reference
from planner.printers import load_printer
from planner.simulation.bar_solver import predict

PALETTE = Palette(
    "rubbers",
    (
        Material("A40", 0.0, 2.0, 1.1, LawParameters("yeoh", {"c_MPa": (0.17, -0.004, 4e-4)})),
        Material("A60", 1.0, 1.5, 1.1,
                 LawParameters("ogden", {"mu_MPa": (0.5, -0.1), "alpha": (2.0, -2.0)})),
    ),
    Reference(0.03, 23.0, 0.0, 9.0, "x"),
)  # fmt: skip
GAUGE_MM, AREA_mm2 = 10.0, 100.0


def button(
    id: str, material: str = "A40", *, rate_mm_s: float = 0.3, rng: np.random.Generator,
    protocol: str = "monotonic", strain: float = -0.4, rise: float = 0.06, rows: int = 160,
) -> Specimen:  # fmt: skip
    """A rubber of the palette's law, stiffer by `rise` a factor e of its rate: 2 % of scatter."""
    once = abs(strain) * GAUGE_MM / rate_mm_s
    time = np.linspace(0.0, once, rows)
    travel = strain * GAUGE_MM * time / once
    if protocol == "cyclic":
        time = np.linspace(0.0, 4.0 * once, 4 * rows)
        travel = strain * GAUGE_MM * (1.0 - np.abs(1.0 - time / once % 2.0))
    elif protocol == "relaxation":
        time = np.linspace(0.0, 6.0 * once, 6 * rows)
        travel = strain * GAUGE_MM * np.minimum(time / once, 1.0)
    law = make_law(PALETTE.resolve(material).law)
    force = AREA_mm2 * law.nominal_stress_MPa(1.0 + travel / GAUGE_MM)
    force = force * (rate_mm_s / GAUGE_MM / 0.03) ** rise * np.exp(0.02 * rng.normal())
    force = force + 1e-3 * np.abs(force).max() * rng.normal(size=len(force))
    return Specimen(
        id, time, travel, force, GAUGE_MM, material=material, width_mm=10.0, thickness_mm=10.0,
        rate_mm_s=rate_mm_s, temperature_C=23.0, soak_h=0.0, age_days=9.0, protocol=protocol,
        batch="A", orientation="x",
    )  # fmt: skip


def campaign(*specimens: Specimen) -> Campaign:
    return Campaign("buttons", "any", PALETTE, specimens)


def of(protocol: str, *, seed: int = 0, strain: float = -0.4) -> list[Specimen]:
    rng = np.random.default_rng(seed)
    return [
        button(f"{protocol[0]}{k}{m}{'+' if strain > 0.0 else ''}", m, rng=rng, protocol=protocol,
               strain=strain)
        for m in ("A40", "A60")
        for k in range(3)
    ]  # fmt: skip


@pytest.mark.parametrize("protocol", ["monotonic", "cyclic", "relaxation"])
def test_nothing_is_wrong_with_compression(protocol: str) -> None:
    specimens = of(protocol)
    whole = campaign(*specimens)
    assert examine(whole, ObservationModel(whole)) == ()
    pounds = [replace(s, force_N=s.force_N / 4.4482) for s in specimens[:1]]
    mixed = campaign(*pounds, *specimens[1:])
    (problem,) = examine(mixed, ObservationModel(mixed))
    assert "lbf taken for N" in problem.problem


def test_its_loading_is_a_loading_and_its_law_that_of_stretches_below_one() -> None:
    one = button("a", rng=np.random.default_rng(0), protocol="cyclic", rise=0.0)
    kinds = [segment.kind for segment in path_of(one).segments]
    assert kinds == ["loading", "unloading", "reloading", "unloading"]
    model = ObservationModel(campaign(one, button("b", rng=np.random.default_rng(1), rise=0.0)))
    raw = model.predicted(predict(model.setup, model.laws))
    # Where the record starts there is no load yet.
    first = (model.table.branch == BRANCHES.index("loading")) & (model.table.step > 0)
    assert (model.table.measured_raw[first] < 0.0).all()
    assert (model.table.strain[first] > 0.0).all()
    # Levels of 2 % of scatter, seeded: neither is off by three deviations.
    np.testing.assert_allclose(raw[first], model.table.measured_raw[first], rtol=0.06)
    assert model.limitations == ()


def test_a_law_of_tension_is_said_to_be_extrapolated() -> None:
    pulled = of("monotonic", strain=0.4)
    assert not [s for s in campaign(*pulled).limitations if "extrapolated" in s]
    pushed = of("monotonic")[:2]
    (said,) = (s for s in campaign(*pulled, *pushed).limitations if "extrapolated" in s)
    assert said.startswith(
        "specimens m0A40, m1A40: compressed, to a strain of 0.4; a palette's laws"
    )


def test_it_counts_to_a_strain_of_seven_tenths() -> None:
    far = button("a", rng=np.random.default_rng(0), strain=-0.8)
    model = ObservationModel(campaign(far))
    assert model.setup.travel_mm[0, -1] == pytest.approx(0.7 * GAUGE_MM)
    assert "to a strain of -0.7" in model.limitations[0]


def test_tension_is_no_replicate_of_compression_and_has_a_column() -> None:
    both = campaign(*of("monotonic"), *of("monotonic", strain=0.4))
    assert len(ObservationModel(both).tests) == 4
    told = both.with_modes()
    assert told.covariates == ("mode",)
    assert {s.covariates["mode"] for s in told.specimens} == {"tension", "compression"}
    assert campaign(*of("monotonic")).with_modes().covariates == ()


def test_a_folder_of_compression_is_read_as_such(tmp_path) -> None:
    again = read_campaign(write_campaign(campaign(*of("monotonic")), tmp_path / "c"))
    assert all(s.pushed for s in again.specimens)
    assert "are negative; it is compared as compressed" in again.limitations[0]


def written(
    folder: Path,
    specimen: Specimen,
    *,
    force: float,
    travel: float,
    column: str = "",
    cell: str = "",
) -> Path:
    """A folder of one button, `force` and `travel` being the signs that its channels get."""
    turned = replace(
        specimen,
        force_N=force * specimen.force_N,
        displacement_mm=travel * specimen.displacement_mm,
    )
    write_campaign(campaign(turned), folder)
    if column:
        first, row = (folder / "specimens.csv").read_text().splitlines()
        heads, cells = first.split(","), row.split(",")
        if column in heads:
            cells[heads.index(column)] = cell
        else:
            heads, cells = [*heads, column], [*cells, cell]
        (folder / "specimens.csv").write_text(f"{','.join(heads)}\n{','.join(cells)}\n")
    return folder


@pytest.mark.parametrize(
    ("force", "travel", "column", "cell"),
    [
        (1.0, 1.0, "", ""),
        (-1.0, 1.0, "", ""),
        (1.0, -1.0, "", ""),
        (-1.0, -1.0, "mode", "compression"),
        (-1.0, -1.0, "mode", "uc"),
        (-1.0, -1.0, "Mode", "compression"),
        (-1.0, 1.0, "test", "Uniaxial compression"),
        (-1.0, -1.0, "protocol", "compression"),
        (-1.0, -1.0, "protocol", "monotonic compression"),
    ],
)
@pytest.mark.parametrize("preload", [False, True])
def test_each_convention_of_compression_is_read_alike(
    tmp_path: Path, force: float, travel: float, column: str, cell: str, preload: bool
) -> None:
    one = button("a", rng=np.random.default_rng(0))
    if preload:
        one = replace(one, force_N=one.force_N - 0.05 * np.abs(one.force_N).max())
    folder = written(tmp_path / "c", one, force=force, travel=travel, column=column, cell=cell)
    (read,) = read_campaign(folder).specimens
    assert read.pushed
    assert read.protocol == "monotonic"
    # Files hold 9 digits.
    np.testing.assert_allclose(read.force_N, one.force_N, rtol=1e-7, atol=1e-7)
    np.testing.assert_allclose(read.displacement_mm, one.displacement_mm, rtol=1e-7, atol=1e-7)


def test_a_place_of_the_platen_that_goes_down_is_compression(tmp_path: Path) -> None:
    one = button("a", rng=np.random.default_rng(0))
    placed = replace(one, displacement_mm=one.displacement_mm + 55.0)
    (read,) = read_campaign(written(tmp_path / "c", placed, force=1.0, travel=1.0)).specimens
    np.testing.assert_allclose(read.displacement_mm, one.displacement_mm, atol=1e-7)


@pytest.mark.parametrize(("force", "travel"), [(1.0, -1.0), (-1.0, 1.0)])
def test_a_pull_with_one_channel_turned_stays_a_pull(
    tmp_path: Path, force: float, travel: float
) -> None:
    one = button("a", rng=np.random.default_rng(0), strain=0.4)
    again = read_campaign(written(tmp_path / "c", one, force=force, travel=travel))
    assert not again.specimens[0].pushed
    assert "is negative in tension; its sign was turned" in again.limitations[0]


def test_a_push_that_counts_as_a_pull_is_doubted(tmp_path: Path) -> None:
    one = button("a", rng=np.random.default_rng(0))
    again = read_campaign(written(tmp_path / "c", one, force=-1.0, travel=-1.0))
    assert not again.specimens[0].pushed
    assert "the curve bends as in compression" in again.limitations[0]


def test_what_is_said_to_be_pulled_is_pulled(tmp_path: Path) -> None:
    one = button("a", rng=np.random.default_rng(0), strain=0.4)
    folder = written(tmp_path / "c", one, force=-1.0, travel=-1.0, column="mode", cell="tension")
    assert not read_campaign(folder).specimens[0].pushed


def test_what_was_stretched_in_two_directions_is_not_taken_for_a_pull(tmp_path: Path) -> None:
    one = button("a", rng=np.random.default_rng(0), strain=0.4)
    folder = written(tmp_path / "c", one, force=1.0, travel=1.0, column="mode", cell="equibiaxial")
    with pytest.raises(FileError, match="mode is 'equibiaxial'; a campaign is of tension and"):
        read_campaign(folder)


@pytest.mark.slow
def test_a_rubber_at_three_rates_is_diagnosed_and_told_in_sizes() -> None:
    rng = np.random.default_rng(1)
    specimens = [
        button(f"{m}-{rate:g}-{k}", m, rate_mm_s=rate, rng=rng)
        for m in ("A40", "A60")
        for rate in (0.03, 0.3, 3.0)
        for k in range(3)
    ]
    found = diagnose(campaign(*specimens))
    assert found.verdict == "rate"
    (effect,) = found.effect
    # 0.06 a factor e is 0.138 a decade; three levels of 2 % of scatter each.
    assert effect.parameters["rise"] == pytest.approx(0.138, abs=0.02)
    assert found.where[0].axis == "rate_mm_s"
    assert "above prediction at 3 mm/s" in found.where[0].detail
    assert found.data_quality == ()
    assert found.next_experiments
    for next_test in found.next_experiments:
        assert str(next_test.row["protocol"]).endswith("compression")
        assert "compressed specimens" in next_test.detail
    assert found.traces is not None
    assert found.traces.label[0].startswith("A40, compressed")
    assert np.nanmin(found.traces.measured_N[:, -1]) > 0.0
    assert (
        np.corrcoef(found.traces.residual_before, np.log([s.rate_mm_s for s in specimens]))[0, 1]
        > 0.9
    )


def test_a_list_of_compression_is_planned_as_such(tmp_path: Path) -> None:
    one = button("a", rng=np.random.default_rng(0))
    cell = "cyclic compression"
    folder = written(tmp_path / "c", one, force=1.0, travel=1.0, column="protocol", cell=cell)
    printer, listed = load_printer("connex3"), folder / "specimens.csv"
    (planned,) = read_design(listed, PALETTE, printer=printer, camera=False).specimens
    assert planned.pushed
    assert planned.protocol == "cyclic"
    # With curves they go the way that these went.
    plan = read_design(folder, PALETTE, printer=printer, camera=False)
    assert all(s.pushed for s in plan.specimens)
