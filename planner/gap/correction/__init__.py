"""A palette for the conditions of use, from what a diagnosis has found."""

from planner.gap.correction.corrected_palette import (
    CONDITION_EFFECTS,
    PRINT_EFFECTS,
    Correction,
    corrected_palette,
)

__all__ = ["CONDITION_EFFECTS", "PRINT_EFFECTS", "Correction", "corrected_palette"]
