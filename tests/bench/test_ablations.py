"""The diagnosis with parts taken out: what is taken out is, and nothing else is changed."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.withheld.ablated import FULL, VARIANTS, problem_of
from benchmarks.withheld.ablations import COLUMNS, ablation_rows, main
from benchmarks.withheld.reality.__main__ import main as reality
from benchmarks.withheld.scoring import CampaignTruth, read_answer, score
from planner.gap.campaign_folder import read_campaign
from planner.gap.evidence.problem import Problem
from planner.gap.evidence.weigh import Priors


@pytest.fixture(scope="module")
def problem(tmp_path_factory: pytest.TempPathFactory) -> Problem:
    folder = tmp_path_factory.mktemp("made") / "c"
    made = ["make", "--set", "development", "--tier", "library", "--count", "1", "--seed", "41"]
    assert reality([*made, "--specimens", "20", "-o", str(folder)]) == 0
    (campaign,) = folder.iterdir()
    everything_else = tuple(
        id for id in ("rate", "temperature", "moisture", "ageing", "orientation", "interface-bleed")
    )
    return problem_of(read_campaign(campaign), everything_else)[0]


def test_without_specimen_effects_only_the_sensor_is_left(problem: Problem) -> None:
    less, priors = VARIANTS["without specimen effects"](problem, Priors())
    assert priors == Priors()
    assert less.noise.batch.shape[1] == 0
    assert problem.noise.batch.shape[1] == 2
    for before, after in zip(problem.noise.blocks, less.noise.blocks, strict=True):
        # a diagonal, but for deviations of 1e-12
        assert after == pytest.approx(np.diag(np.diag(after)), abs=1e-12)
        assert (np.diag(after) < np.diag(before) + 1e-15).all()
    # Whitened figures are the residual over each one's own deviation
    sd = np.sqrt(np.concatenate([np.diag(b) for b in less.noise.blocks]))
    assert less.target == pytest.approx(problem.residual / sd, rel=1e-6, abs=1e-9)
    assert less.nuisances.shape == (len(sd), problem.nuisances.shape[1] - 2)


def test_fixed_base_parameters_leave_camera_and_batches(problem: Problem) -> None:
    less, _ = VARIANTS["fixed base parameters"](problem, Priors())
    assert less.calibrations == ()
    gone = problem.nuisances.shape[1] - less.nuisances.shape[1]
    assert gone >= len(problem.calibrations)
    # What stays of the calibration is about strains of the camera
    force = ~problem.table.is_field
    assert not less.calibration[force].any()
    assert problem.calibration[force, :gone].any(axis=0).all()
    assert np.array_equal(less.patterns, problem.patterns)
    assert np.array_equal(less.nuisances, problem.nuisances[:, gone:])


def test_priors_without_unknown_and_flat(problem: Problem) -> None:
    _, none = VARIANTS["without unknown"](problem, Priors())
    assert (none.unknown, none.beside) == (1e-12, 1e-12)
    same, flat = VARIANTS["flat priors"](problem, Priors())
    assert same is problem
    n = len({b.effect.id for b in problem.signed_forms})
    assert flat.none == flat.unknown == pytest.approx(flat.single / n)
    assert flat.pair / (n * (n - 1) / 2) == pytest.approx(flat.none)
    assert flat.none + flat.unknown + flat.single + flat.pair == pytest.approx(1.0)


def test_a_row_counts_each_measure_where_it_has_a_meaning() -> None:
    def scored(verdict: str, *effects: str, tier: str = "library") -> object:
        document = {
            "verdict": verdict,
            "ranking": [{"effects": verdict.split("+"), "probability": 0.9}],
            "class": [],
            "where": [],
            "gap": {},
        }
        own = frozenset({effects})
        truth = CampaignTruth(tier, effects, own, frozenset(), 5.0, 9.0, 0.2, 0.03, 0.01)
        return score("c", read_answer(document, "c"), truth)

    scores = [
        scored("rate", "rate"),
        scored("skin", "rate"),
        scored("skin", "rate", tier="confounded"),
        scored("none", tier="none"),
        scored("unknown", "operator", tier="unclaimed"),
        scored("rate+skin", "rate", "skin", tier="pair"),
    ]
    (row,) = ablation_rows({FULL: scores})  # type: ignore[dict-item]
    cells = dict(zip(COLUMNS, row, strict=True))
    assert cells["one effect: top-1 %"].startswith("50 ")
    assert cells["two: both %"].startswith("100 ")
    assert cells["none: false alarm %"].startswith("0 ")
    assert cells["unclaimed: unknown %"].startswith("100 ")
    assert cells["sure but wrong %"].startswith("33 ")  # the confounded one counts here
    assert cells["P(truth)"] == "0.60"


def test_a_folder_that_is_there_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["--set", "development", "--seed", "1", "-o", str(tmp_path)]) == 2
    assert "--resume" in capsys.readouterr().err
