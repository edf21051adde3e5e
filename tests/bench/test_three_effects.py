"""Three effects in one campaign: what is looked for beside what, and how far all of it closes."""

import json
from pathlib import Path

import pytest

from benchmarks.withheld.reality.__main__ import main as reality
from planner.gap.campaign_folder import read_campaign
from planner.gap.diagnose import diagnose
from planner.gap.diagnosis import Diagnosis

TRUE = ("force-scale", "grip-slack", "material-law")
"""Pounds in some files, slack of soft grades, and one law that is off."""


def diagnosed(folder: Path, tier: str, seed: int, index: int = 0, specimens: int = 30) -> Diagnosis:
    made, truth = folder / "made", folder / "truth.json"
    command = ["make", "--set", "development", "--tier", tier, "--seed", f"{seed}"]
    command += ["--count", f"{index + 1}", "--truth", str(truth), "-o", str(made)]
    command += ["--specimens", f"{specimens}"]
    assert reality(command) == 0
    of = {told["index"]: id for id, told in json.loads(truth.read_text())["campaigns"].items()}
    return diagnose(read_campaign(made / of[index]), seed=1)


@pytest.mark.slow
def test_what_is_best_beside_two_others_is_found_though_it_is_not_best_beside_one(
    tmp_path: Path,
) -> None:
    """Beside the pounds an offset of the load cell imitates slack, until the law is there too."""
    found = diagnosed(tmp_path, "three", 91).ranking
    (true,) = (h for h in found if h.effects == TRUE)
    # Not even weighed where only what goes with the best single effect is followed. It was .28
    # while forces at rest counted as surer than they are; now .007, 24 nats behind the offset.
    assert true.probability > 0.001


@pytest.mark.long
def test_what_is_soft_is_not_taken_for_what_was_written_in_pounds(tmp_path: Path) -> None:
    """A model that may be far off counts 22 of 60 specimens as written in pounds, for 15 that are.

    Then an offset explained what these seven leave.
    """
    found = diagnosed(tmp_path, "three", 98, index=1, specimens=60)
    assert found.ranking[0].effects == TRUE
    # .72; the slack alone, of sizes that differ from specimen to specimen, has .16.
    assert found.ranking[0].probability > 0.6


@pytest.mark.long
def test_a_gain_of_one_batch_beside_other_effects_is_known_of_what_is_left_out(
    tmp_path: Path,
) -> None:
    """Folds that took it for a gain of all specimens closed next to nothing of such a gap."""
    found = diagnosed(tmp_path, "lab", 93, index=1)
    assert found.verdict == "force-scale+rate+temperature"
    gap = found.gap
    assert gap.after is not None
    assert gap.floor is not None
    assert gap.closed is not None
    # Replicates are one of each batch: what they differ by is scatter, of 2.9 %, and not the gain.
    # The true effects leave 2.6 %; 10.8 % is left where the gain is not known.
    assert 0.02 < gap.floor < 0.04
    assert gap.floor < gap.after < 0.04
    assert 0.9 < gap.closed < 1.0
