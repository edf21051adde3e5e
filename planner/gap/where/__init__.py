"""Where the gap lies: along which column, branch, strain, time or place it varies."""

from planner.gap.where.localise import localise
from planner.gap.where.noise import Noise

__all__ = ["Noise", "localise"]
