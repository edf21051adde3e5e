"""Cameras of other facets: a campaign without any effect shows none, however its bars are seen."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.withheld.reality.campaign import make_campaign
from benchmarks.withheld.reality.fields import Camera
from benchmarks.withheld.reality.palette_file import read_palette
from benchmarks.withheld.reality.writing import write_campaign
from planner import diagnose
from planner.gap.campaign_folder import read_campaign
from planner.gap.evidence.problem import Problem
from planner.gap.observations import ObservationModel

ROOT = Path(__file__).parents[2]
PALETTE = read_palette(
    (ROOT / "printers/connex3/palettes/connex3-tango-vero.toml").read_text(encoding="utf-8")
)
CAMERAS = [
    pytest.param(
        Camera(facet, spacing, stated), marks=[pytest.mark.long] * (stated and facet < 3.0)
    )
    for facet in (0.0, 0.6, 1.2, 3.0)
    for spacing in (1.0, 0.5)
    for stated in (False, True)
]


def written(camera: Camera, folder: Path, index: int = 0) -> Path:
    campaign = make_campaign(PALETTE, "development", "none", 30, 5, index, camera)
    folder.mkdir()
    write_campaign(campaign, folder)
    return folder


@pytest.mark.parametrize("camera", CAMERAS, ids=str)
def test_strains_of_a_clean_campaign_have_no_bias(camera: Camera, tmp_path: Path) -> None:
    """Steps every 2 mm, places each millimetre: many lie on a step."""
    campaign = read_campaign(written(camera, tmp_path / "c"))
    problem = Problem(campaign, ObservationModel(campaign), [])
    table, noise = problem.table, problem.noise
    covariance = problem.calibration @ problem.calibration.T
    for rows, block in zip(noise.rows, noise.blocks, strict=True):
        covariance[rows, rows] += block
    field = table.is_field
    inverse = np.linalg.inv(covariance[np.ix_(field, field)])
    far = (inverse @ problem.residual[field]) / np.sqrt(np.diagonal(inverse))
    # Of 120 figures and more; the lab's slices and law are not planner's, to half of the noise.
    assert 0.5 < np.mean(far**2) < 1.5
    assert np.abs(far).max() < 4.0


@pytest.mark.parametrize(
    "camera", [pytest.param(Camera(0.0, 1.0), marks=pytest.mark.long), Camera(3.0, 0.5)], ids=str
)
def test_nothing_is_found_where_nothing_is_hidden(camera: Camera, tmp_path: Path) -> None:
    assert diagnose(written(camera, tmp_path / "c")).verdict == "none"
