"""What a campaign's figures scatter by when nothing is hidden: specimens, batches, calibration."""

from planner.gap.noise.blocks import SpecimenNoise, specimen_noise
from planner.gap.noise.calibration import calibration_columns
from planner.gap.noise.estimate import estimate_scatter
from planner.gap.noise.scatter import Scatter

__all__ = [
    "Scatter",
    "SpecimenNoise",
    "calibration_columns",
    "estimate_scatter",
    "specimen_noise",
]
