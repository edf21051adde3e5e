"""Campaigns with stated effects by planner's own model: to teach, to practise, to check power."""

from planner.gap.imitation.imitate import SCATTER, imitate
from planner.gap.imitation.stated_effect import StatedEffect, stated_effect

__all__ = ["SCATTER", "StatedEffect", "imitate", "stated_effect"]
