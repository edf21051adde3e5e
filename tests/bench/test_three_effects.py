"""Three effects in one campaign: what is looked for beside what, and how far all of it closes."""

from pathlib import Path

import pytest

from benchmarks.withheld.reality.__main__ import main as reality
from planner.gap.campaign_folder import read_campaign
from planner.gap.diagnose import diagnose
from planner.gap.diagnosis import Diagnosis


def diagnosed(folder: Path, tier: str, seed: int) -> Diagnosis:
    made, truth = folder / "made", folder / "truth.json"
    command = ["make", "--set", "development", "--tier", tier, "--count", "1", "--seed", f"{seed}"]
    assert reality([*command, "--truth", str(truth), "-o", str(made)]) == 0
    (campaign,) = made.iterdir()
    return diagnose(read_campaign(campaign), seed=1)


@pytest.mark.slow
def test_what_is_best_beside_two_others_is_found_though_it_is_not_best_beside_one(
    tmp_path: Path,
) -> None:
    """Beside the pounds an offset of the load cell imitates slack, until the law is there too."""
    found = diagnosed(tmp_path, "three", 91).ranking
    (true,) = (h for h in found if h.effects == ("force-scale", "grip-slack", "material-law"))
    # Within what its forms, none of which is quite planner's, and a seed may do to it: .28 now,
    # and not even weighed where only what goes with the best single effect is followed.
    assert true.probability > 0.1


@pytest.mark.slow
def test_a_gain_of_one_batch_beside_other_effects_is_known_of_what_is_left_out(
    tmp_path: Path,
) -> None:
    """Folds that took it for a gain of all closed 40 % of such a gap, of 83 % that can be."""
    found = diagnosed(tmp_path, "lab", 93)
    assert found.verdict == "force-scale+rate+temperature"
    gap = found.gap
    assert gap.after is not None
    assert gap.floor is not None
    assert gap.closed is not None
    # Replicates are one of each batch: what they differ by is not the gain. Twice the scatter.
    assert gap.floor < gap.after < 2.0 * gap.floor < 0.5 * gap.before
    assert 0.7 < gap.closed < 1.0
