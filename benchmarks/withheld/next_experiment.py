"""One campaign's next test, done: the one that the diagnosis suggests, and one at random."""

import json
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.withheld.ablated import problem_of, weighed_answer
from benchmarks.withheld.reality.more import FurtherTest, further_of
from benchmarks.withheld.reality.palette_file import PaletteFile, read_palette
from benchmarks.withheld.reality.writing import write_campaign
from planner.gap.campaign import Campaign
from planner.gap.campaign_folder import read_campaign
from planner.gap.design import Trial, trials_of
from planner.gap.diagnose import diagnose
from planner.gap.evidence.weigh import Priors
from planner.gap.observations import ObservationModel
from planner.palette import Palette

__all__ = ["as_test", "equal_cost", "next_answers"]

_ALIKE_COST = 0.1
"""Hours that differ by this share are the same cost."""

_SEED = 20


def next_answers(
    truth_file: Path, palette_file: Path, replicates: int, folder: Path, without: tuple[str, ...]
) -> dict[str, Any]:
    """Return documents of a campaign before and after a further test.

    ``before`` is there always, ``suggested`` and ``random`` where the class has several members
    and a test is suggested. Random is a candidate test of the same cost, evenly drawn.
    """
    with threadpool_limits(1, user_api="blas"):
        campaign = read_campaign(folder)
        before = diagnose(campaign, without=without).document()
        if len(before["class"]) < 2 or not before["next_experiments"]:
            return {"before": before}
        trials = trials_of(campaign, ObservationModel(campaign).setup)
        suggested = before["next_experiments"][0]
        first = next(t for t in trials if dict(t.change) == suggested["change"])
        # Of the campaign's own name, so that neither order nor company changes it
        rng = np.random.default_rng([_SEED, zlib.crc32(folder.name.encode())])
        others = equal_cost(trials, first)
        chance = others[int(rng.integers(len(others)))]
        lab = (
            read_palette(palette_file.read_text(encoding="utf-8")),
            json.loads(truth_file.read_text(encoding="utf-8")),
        )
        done: dict[str, Any] = {"before": before}
        for name, trial in (("suggested", first), ("random", chance)):
            test = as_test(trial, campaign.palette)
            more = _measured(lab, folder.name, [test] * replicates)
            answer = weighed_answer(*_weighing(more, without))
            done[name] = {"change": dict(trial.change), "hours": trial.hours, "document": answer}
        return done


def equal_cost(trials: Sequence[Trial], trial: Trial) -> list[Trial]:
    """Return the other trials that cost as much, or the one that comes nearest."""
    others = [t for t in trials if t is not trial]

    def apart(other: Trial) -> float:
        return abs(other.hours / trial.hours - 1.0)

    alike = [t for t in others if apart(t) <= _ALIKE_COST]
    return alike or [min(others, key=apart)]


def as_test(trial: Trial, palette: Palette) -> FurtherTest:
    """Return a trial as the lab is asked to do it."""
    s = trial.specimen
    if s.profile is None:
        materials: tuple[str, ...] = (str(s.material),)
    else:
        at = {m.coordinate: m.id for m in palette.materials}
        ends = s.profile.coordinate[[0, -1]].tolist()
        materials = tuple(at[min(at, key=lambda c: abs(c - end))] for end in ends)
    known: Mapping[str, float | None] = {
        "width_mm": s.width_mm,
        "thickness_mm": s.thickness_mm,
        "rate_mm_s": s.rate_mm_s,
        "temperature_C": s.temperature_C,
        "soak_h": s.soak_h,
        "age_days": s.age_days,
    }
    sizes = {name: float(value) for name, value in known.items() if value is not None}
    return FurtherTest(
        materials=materials,
        gauge_mm=s.gauge_mm,
        orientation=s.orientation or "x",
        protocol=s.protocol or "monotonic",
        **sizes,
    )


def _weighing(campaign: Campaign, without: tuple[str, ...]) -> tuple[Any, Priors, tuple[str, ...]]:
    problem, reasons = problem_of(campaign, without)
    return problem, Priors(), reasons


def _measured(
    lab: tuple[PaletteFile, Mapping[str, Any]], name: str, tests: Sequence[FurtherTest]
) -> Campaign:
    palette, truth = lab
    with TemporaryDirectory() as folder:
        write_campaign(further_of(palette, truth, name, tests), Path(folder) / name)
        return read_campaign(Path(folder) / name)
