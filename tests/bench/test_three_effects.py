"""Pounds in some files, slack of the soft grades and one law that is off, in one campaign."""

from pathlib import Path

import pytest

from benchmarks.withheld.reality.__main__ import main as reality
from planner.gap.campaign_folder import read_campaign
from planner.gap.diagnose import diagnose


@pytest.mark.slow
def test_what_is_best_beside_two_others_is_found_though_it_is_not_best_beside_one(
    tmp_path: Path,
) -> None:
    """Beside the pounds an offset of the load cell imitates slack, until the law is there too."""
    made, truth = tmp_path / "made", tmp_path / "truth.json"
    command = ["make", "--set", "development", "--tier", "three", "--count", "1", "--seed", "91"]
    assert reality([*command, "--truth", str(truth), "-o", str(made)]) == 0
    (folder,) = made.iterdir()
    found = diagnose(read_campaign(folder), seed=1).ranking
    (true,) = (h for h in found if h.effects == ("force-scale", "grip-slack", "material-law"))
    # Within what its forms, none of which is quite planner's, and a seed may do to it: .28 now,
    # and not even weighed where only what goes with the best single effect is followed.
    assert true.probability > 0.1
