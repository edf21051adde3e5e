"""How much of an effect each mixture shows: most at one place on the palette, less around it."""

import numpy as np

from planner.arrays import FloatArray
from planner.gap.effects.effect import Parameter
from planner.gap.forward.setup import Setup

__all__ = ["PEAK", "mixture_share", "place_on_palette"]

PEAK = Parameter("peak", 0.0, 1.0, "mixture that shows most of it, softest 0 to hardest 1")

_WIDTH = 0.7
"""Of the trend, over the palette's range: a mixture at the other end shows an eighth."""


def place_on_palette(setup: Setup) -> FloatArray:
    """Return each slice's coordinate from 0, the palette's softest, to 1, its hardest, (S,)."""
    low, high = setup.coordinate_range
    return (setup.coordinate - low) / max(high - low, 1e-12)


def mixture_share(setup: Setup, peak: float) -> FloatArray:
    """Return the share of an effect in each slice, (S,), 1 at the place `peak`."""
    return np.exp(-(((place_on_palette(setup) - peak) / _WIDTH) ** 2))
