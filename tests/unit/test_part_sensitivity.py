"""What a part's shares say of other laws, against the solid solved anew with those laws."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import planner
from benchmarks.interfaces import BOX, FACES
from planner.errors import ArgumentError, FileError
from planner.materials.marlow import MarlowTable, marlow_table, uniaxial_strain
from planner.materials.mixtures import CoefficientModel
from planner.numerics import FloatArray
from planner.printers import load_printer
from planner.simulation.part import open_solid
from planner.simulation.part_response import PartResponse, force_factor
from planner.simulation.response import (
    LoadedPart,
    followed,
    loaded_part,
    part_response,
    response_of,
)

PALETTE = load_printer("connex3").palette()
TABLE = marlow_table(CoefficientModel(PALETTE))
STEPS = (0.02, 0.25, 0.5, 0.75, 1.0)
LOADS = {
    "pulled": {"move": "x=max: 4,0,0 mm"},
    "bent": {"move": "x=max: 0,0,6 mm"},
    "bent by a weight": {"load": "x=max: 0,0,-0.1 N"},
}


@pytest.fixture(scope="module", params=LOADS, ids=str)
def loaded(request: pytest.FixtureRequest) -> tuple[LoadedPart, PartResponse]:
    """A strip of three grades one after the other, held at one end."""
    plan = planner.grade(
        ([24.0, 6.0, 4.0] * BOX, FACES), axis="x", from_="FLX9740", to="FLX9760", name="strip"
    )
    case = planner.LoadCase(fix="x=min", **LOADS[request.param])
    part = loaded_part(open_solid(plan, None, None, None, PALETTE), case, cell_mm=4.0)
    return part, response_of(part, followed(part, TABLE, STEPS), log_sd=0.02)


def changed(by_m: Callable[[FloatArray], FloatArray], bend: float = 0.0) -> MarlowTable:
    """Laws times exp(by_m(coordinate) + bend tanh(x)), x = sqrt(I1 - 3)."""
    laws = TABLE.log_slope_MPa.copy()
    x = TABLE.step * np.arange(laws.shape[1])
    laws[..., 0] += by_m(TABLE.coordinate)[:, None] + bend * np.tanh(x / 0.1)
    laws[..., 1] += bend / 0.1 / np.cosh(np.minimum(x / 0.1, 300.0)) ** 2
    return replace(TABLE, log_slope_MPa=laws)


def none(m: FloatArray) -> FloatArray:
    return np.zeros_like(m)


@pytest.mark.parametrize(
    ("by_m", "bend", "within"),
    [
        # Of the change: all laws alike are exact, but for cubics between steps.
        (lambda m: none(m) - 0.3, 0.0, 1e-3),
        # Second order is a tenth of a change whose third differs from the rest by 0.3, at most.
        (lambda m: -0.6 + 0.9 * m, 0.0, 0.1),
        (lambda m: 0.3 * np.exp(-(((m - 0.333) / 0.1) ** 2)), 0.0, 0.1),
        (none, 0.3, 0.1),
    ],
    ids=["alike", "graded", "one grade", "with strain"],
)
def test_shares_say_what_other_laws_do(
    loaded: tuple[LoadedPart, PartResponse],
    by_m: Callable[[FloatArray], FloatArray],
    bend: float,
    within: float,
) -> None:
    part, response = loaded
    anew = followed(part, changed(by_m, bend), STEPS, sensitive=False)
    known = anew.displacement_mm <= response.displacement_mm[-1]
    before, strain, share = response.at(anew.displacement_mm[known])
    first_invariant = strain**2 * (strain + 3.0) / (1.0 + strain)
    np.testing.assert_allclose(uniaxial_strain(np.sqrt(first_invariant)), strain, atol=1e-12)
    ratio = np.exp(by_m(response.coordinate) + bend * np.tanh(np.sqrt(first_invariant) / 0.1))
    after = before * force_factor(ratio, share)
    true = anew.force_N[known]
    assert np.abs(true / before - 1.0).max() > 0.02
    np.testing.assert_allclose(after / before - 1.0, true / before - 1.0, rtol=within, atol=2e-3)


def test_shares_are_whole_before_they_are_made_so(loaded: tuple[LoadedPart, PartResponse]) -> None:
    _, response = loaded
    np.testing.assert_allclose(response.share.sum(axis=1), 1.0, rtol=1e-9)
    assert response.thickness_mm == pytest.approx(2 * 24 * 6 * 4 / (2 * (24 * 6 + 24 * 4 + 24)))


def test_larger_cells_tell_how_sure_a_force_is() -> None:
    plan = planner.grade(
        ([24.0, 6.0, 4.0] * BOX, FACES), axis="x", from_="FLX9740", to="FLX9760", name="strip"
    )
    how = {"fix": ["x=min"], "move": "x=max: 2,0,0 mm", "cell_mm": 4.0}
    assert 0.01 < part_response(plan, PALETTE, **how).log_sd < 0.1
    with pytest.raises(ArgumentError, match="x=maximum"):
        part_response(plan, PALETTE, **(how | {"move": "x=maximum: 2,0,0 mm"}))


def test_a_campaign_s_plan_is_simulated_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("planner.simulation.response._CELLS", 20)
    plan = planner.grade(
        ([24.0, 6.0, 4.0] * BOX, FACES), axis="x", from_="FLX9740", to="FLX9760", name="strip"
    )
    plan.write(tmp_path / "strip")
    (tmp_path / "campaign.toml").write_text(
        'schema = 1\nname = "strips"\nprinter = "connex3"\npalette = "connex3-tango-vero"\n'
    )
    rows = "".join(f'S{k},strip,"x=min","x=max: 2,0,0 mm"\n' for k in range(2))
    (tmp_path / "specimens.csv").write_text("specimen,part,fix,move\n" + rows)
    time = np.linspace(0.0, 1.8, 20)
    curves = "".join(f"S{k},{t:g},{t:g},{(1.0 + 0.01 * k) * t:g}\n" for k in range(2) for t in time)
    (tmp_path / "curves.csv").write_text("specimen,time_s,displacement_mm,force_N\n" + curves)
    first, second = planner.read_campaign(tmp_path).specimens
    assert first.part is second.part
    assert first.part is not None
    response = first.part.response
    assert response.name == "strip"
    assert response.displacement_mm[-1] == pytest.approx(2.0, rel=1e-3)
    # Three grades in series of 8 mm each, clamped: their secants at about 8 % of strain.
    assert 1.0 < response.force_N[-1] < 4.0
    (tmp_path / "specimens.csv").write_text(
        'specimen,part,fix,move\nS0,strip,x=min,"x=middle: 2,0,0 mm"\n'
    )
    with pytest.raises(FileError, match="specimen S0: part strip: `move` x=middle") as caught:
        planner.read_campaign(tmp_path)
    assert "\n" not in str(caught.value)
