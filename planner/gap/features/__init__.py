"""A campaign's curves, reduced to a dozen figures a specimen."""

from planner.gap.features.table import BRANCHES, FeatureTable

__all__ = ["BRANCHES", "FeatureTable"]
