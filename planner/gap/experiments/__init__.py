"""Which test to do next."""

from planner.gap.experiments.choose import next_experiments

__all__ = ["next_experiments"]
