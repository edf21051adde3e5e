"""Force or travel in another unit than the file says: how it is said, hinted at, and mended."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import planner
from planner.errors import ArgumentError, FileError, UnknownNameError
from planner.formats.units import QUANTITY_UNITS, UnitOf
from planner.gap.campaign import Campaign
from planner.gap.diagnosis import FoundEffect
from planner.gap.quality import merged_units, suggested_units
from planner.materials.study import stated_units

_LBF = QUANTITY_UNITS["force"]["lbf"]


@pytest.fixture(scope="session")
def plain(planned, imitated) -> Campaign:
    """Two materials at two rates, two of each, nothing hidden."""
    plan = planned(2, material=["TangoPlus", "FLX9760"], rate_mm_s=[0.85, 8.5])
    made: Campaign = imitated(plan)
    specimens = tuple(replace(s, id=s.id.removeprefix("SIM-")) for s in made.specimens)
    return replace(made, specimens=specimens)


def in_pounds(campaign: Campaign, ids: tuple[str, ...] = ()) -> Campaign:
    """The lab exported pounds-force under a heading of newtons."""
    specimens = tuple(
        replace(s, force_N=s.force_N / _LBF) if not ids or s.id in ids else s
        for s in campaign.specimens
    )
    return replace(campaign, specimens=specimens)


@pytest.fixture
def written(tmp_path: Path) -> Callable[[Campaign], Path]:
    return lambda campaign: planner.write_campaign(campaign, tmp_path / "lab")


@pytest.mark.parametrize("ids", [(), ("S001", "S002")])
def test_reading_in_the_stated_unit_gives_the_forces_back(plain, written, ids) -> None:
    """To the nine digits that a campaign is written with."""
    folder = written(in_pounds(plain, ids))
    back = planner.read_campaign(folder, unit_of=UnitOf("force", "lbf", ids).text)
    for old, new in zip(plain.specimens, back.specimens, strict=True):
        np.testing.assert_allclose(new.force_N, old.force_N, rtol=1e-8)
    assert any("force is read in the unit lbf" in remark for remark in back.remarks)


def test_a_unit_replaces_that_of_the_heading(plain, written) -> None:
    folder = written(plain)
    curves = folder / "curves.csv"
    curves.write_text(curves.read_text().replace("force_N", "force_lbf", 1))
    whole = planner.read_campaign(folder, unit_of=["force=lbf", "force=N:S000"])
    force = whole.specimen("S000").force_N
    np.testing.assert_allclose(force, plain.specimen("S000").force_N, rtol=1e-8)
    assert whole.specimen("S000").force_unit_N == 1.0
    assert whole.specimen("S001").force_unit_N == _LBF


@pytest.mark.parametrize(
    ("stated", "error", "said"),
    [
        ("lbf", ArgumentError, "force=lbf:S1,S2"),
        ("forse=lbf", UnknownNameError, "did you mean force?"),
        ("force=lbff:A", UnknownNameError, "did you mean lbf?"),
        ("force=-2:A", UnknownNameError, "how many N it has"),
        ("travel=inn", UnknownNameError, "did you mean in?"),
        ("force=lbf:A,FLX9740-l", UnknownNameError, "did you mean FLX9740-1?"),
    ],
)
def test_what_is_not_understood_is_named(stated: str, error: type[Exception], said: str) -> None:
    with pytest.raises(error) as caught:
        stated_units(stated, {"A": "FLX9740", "FLX9740-1": "FLX9740"})
    assert said in str(caught.value)
    assert stated.partition(":")[0] in str(caught.value)


def test_a_stress_has_no_unit_of_force(plain, written) -> None:
    folder = written(plain)
    curves = folder / "curves.csv"
    curves.write_text(curves.read_text().replace("force_N", "stress_MPa", 1))
    assert planner.read_campaign(folder).specimen("S000").force_unit_N is None
    with pytest.raises(FileError, match="no column of force"):
        planner.read_campaign(folder, unit_of="force=lbf:S000")


def test_units_go_with_a_folder(plain: Campaign) -> None:
    with pytest.raises(ArgumentError, match="`unit_of` goes with the folder"):
        planner.diagnose(plain, unit_of="force=lbf")


def gain(value: float, **more: object) -> FoundEffect:
    ends = {"log_gain": (value - 0.01, value + 0.01)}
    return FoundEffect("force-scale", "other-unit", {"log_gain": value}, ends, {}, **more)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("found", "unit"),
    [
        (gain(-np.log(_LBF)), "lbf"),
        (gain(-np.log(9.7)), "kgf"),  # 1 % off, by the load cell's own gain
        (gain(-np.log(1000.0)), "kN"),
        (gain(np.log(1000.0)), "mN"),
        (gain(np.log(_LBF)), "0.224809"),  # newtons divided by 0.2248 somewhere
        (gain(0.4), None),
        (FoundEffect("strain-scale", "inch", {"log_factor": np.log(25.4)}, {}, {}), "in"),
        (FoundEffect("strain-scale", "ends", {"length": 3.0}, {}, {}), None),
    ],
)
def test_gains_hint_at_units(plain: Campaign, found: FoundEffect, unit: str | None) -> None:
    quantity = "travel" if found.id == "strain-scale" else "force"
    expected = [] if unit is None else [UnitOf(quantity, unit)]
    assert list(suggested_units([found], plain.specimens)) == expected


def test_units_hint_at_the_specimens_that_have_them(plain: Campaign) -> None:
    """Where the heading said pounds and the numbers are newtons, to read N mends it."""
    found = gain(np.log(_LBF), specimens=("S001", "S003"))
    labelled = [replace(s, force_unit_N=_LBF if s.id == "S001" else 1.0) for s in plain.specimens]
    assert list(suggested_units([found], labelled)) == [
        UnitOf("force", "N", ("S001",)),
        UnitOf("force", "0.224809", ("S003",)),
    ]


def test_a_gain_of_some_hints_at_the_unit_that_they_are_in(plain: Campaign) -> None:
    """As a verdict states it: by its factor, and not by its logarithm."""
    ends, some = {"factor": (0.2236, 0.2260)}, ("S001", "S003")
    found = FoundEffect("force-scale", "of-some-specimens", {"factor": 1 / _LBF}, ends, {}, some)
    assert list(suggested_units([found], plain.specimens)) == [UnitOf("force", "lbf", some)]


def test_units_are_told_once() -> None:
    one, two, every = (UnitOf("force", "lbf", ids) for ids in (("A",), ("B", "A"), ()))
    assert merged_units([one, two]) == (UnitOf("force", "lbf", ("A", "B")),)
    assert merged_units([one, every]) == merged_units([every, two]) == (every,)


@pytest.mark.slow
@pytest.mark.parametrize("ids", [pytest.param((), marks=pytest.mark.long), ("S003",)])
def test_what_the_diagnosis_hints_at_mends_it(plain, written, ids) -> None:
    folder = written(in_pounds(plain, ids))
    off = planner.diagnose(folder)
    assert UnitOf("force", "lbf", ids) in off.unit_of
    mended = planner.diagnose(folder, unit_of=[unit.text for unit in off.unit_of])
    assert (mended.verdict, mended.unit_of) == ("none", ())
    # What is left is what the lab scatters by: a few per cent of a force that was off by 77 %.
    assert mended.gap.before < 0.1
    # One that is off alone is a stray, which says nothing of how large the gap is.
    assert ids or off.gap.before > 3.0 * mended.gap.before
