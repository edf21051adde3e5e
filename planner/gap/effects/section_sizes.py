"""Width and thickness of every slice, as drawn."""

import numpy as np

from planner.arrays import FloatArray
from planner.gap.forward.setup import Setup

__all__ = ["section_sizes_mm"]


def section_sizes_mm(setup: Setup) -> tuple[FloatArray, FloatArray]:
    """Return width and thickness, (S,); a bar's design goes before the test's own size."""
    width, thickness = setup.on_slices(setup.width_mm), setup.on_slices(setup.thickness_mm)
    for test, design in enumerate(setup.designs):
        if design is None or (design.width_mm is None and design.thickness_mm is None):
            continue
        slices = slice(setup.first_slice[test], setup.first_slice[test + 1])
        for size, along in ((width, design.width_mm), (thickness, design.thickness_mm)):
            if along is not None:
                size[slices] = np.interp(setup.x_mm[slices], design.x_mm, along)
    return width, thickness
