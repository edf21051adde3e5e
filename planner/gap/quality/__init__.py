"""What is wrong with a campaign's data, before any effect is blamed for its gap."""

from planner.gap.quality.examine import examine
from planner.gap.quality.problem import Kind, Problem

__all__ = ["Kind", "Problem", "examine"]
