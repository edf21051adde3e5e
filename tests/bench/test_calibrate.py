"""The calibration of the diagnosis' last step finds what made the cases."""

from collections.abc import Iterator

import numpy as np
import pytest

from benchmarks.withheld.calibrate import Case, calibrated, mean_log_score, priors_of, vector
from benchmarks.withheld.scoring import UNKNOWN
from planner.gap.evidence.weigh import Evidence, Priors

SHOWN = 3.0
START = Priors(
    none=0.66, single=0.054, pair=0.0017, unknown=0.2843, beside=0.05, axes=0.5, claimed=0.2,
    imitated=1e-3, temperature=1.0,
)  # fmt: skip
"""Priors that hardly name anything."""

NAMES = ("rate", "skin", "moisture", "ageing")


def cases(shares: dict[str, float], count: int, p: Priors = START) -> Iterator[Case]:
    """Yield campaigns of kinds in these shares, with evidence as a Bayesian would find it.

    Each hypothesis with a cause has a figure of its own, normal about 0, about `SHOWN` where it is
    the truth.
    """
    rng = np.random.default_rng(5)
    log_prior = {((), ""): p.none} | {((n,), ""): p.single * (1 - p.beside) / 4 for n in NAMES}
    log_prior |= {((), "every test"): (1 - p.axes) * p.unknown}
    log_prior = {key: float(np.log(value)) for key, value in log_prior.items()}
    for number in range(count):
        kind = rng.choice(list(shares), p=list(shares.values()))
        name = str(rng.choice(NAMES))
        truth = {"none": (), "unknown": UNKNOWN}.get(kind, (name,))
        shown = ((), "") if kind == "none" else ((), "every test")
        shown = ((name,), "") if kind == "single" else shown
        figures = {key: float(rng.normal()) for key in log_prior}
        figures[shown] += SHOWN
        gains = {key: SHOWN * (x - 0.5 * SHOWN) for key, x in figures.items()}
        gains[(), ""] = 0.0
        evidence = Evidence(log_prior, gains)
        yield Case(f"c{number}", "all", truth, evidence, frozenset(), p)


def test_priors_are_the_vector_that_they_came_from() -> None:
    start = Priors()
    again = priors_of(vector(start), START)
    total = sum(getattr(start, k) for k in ("none", "single", "pair", "unknown"))
    for name in ("none", "single", "pair", "unknown"):
        assert getattr(again, name) == pytest.approx(getattr(start, name) / total)
    assert vector(again) == pytest.approx(vector(start))
    assert again.temperature == START.temperature != start.temperature


@pytest.mark.long
def test_shares_of_kinds_are_found() -> None:
    """From priors a tenth of which are single effects, of cases half of which are."""
    start = START
    made = list(cases({"none": 0.25, "single": 0.5, "unknown": 0.25}, 300))
    found = calibrated(made, start)
    assert mean_log_score(made, found) > mean_log_score(made, start) + 0.1
    # Odds of 150 to 75 are known to a seventh
    assert found.single / found.none == pytest.approx(2.0, rel=0.3)


@pytest.mark.long
def test_what_is_right_already_stays() -> None:
    start = START
    shares = {"none": 0.66, "single": 0.055, "unknown": 0.285}  # the priors' own, without pairs
    found = calibrated(list(cases(shares, 400)), start)
    # 22 single effects among 400: known to a fifth
    assert found.none == pytest.approx(start.none, rel=0.25)


def test_priors_that_evidence_was_written_with_do_not_matter() -> None:
    shares = {"none": 0.4, "single": 0.4, "unknown": 0.2}
    there = [mean_log_score(list(cases(shares, 50, p)), START) for p in (START, Priors())]
    assert there[0] == pytest.approx(there[1], rel=1e-12)
