"""Which specimens to test so that effects can be told apart, and how well they will be."""

from planner.gap.design.candidates import Size, may_take_bars
from planner.gap.design.design_campaign import BATCHES, CampaignDesign, design_campaign
from planner.gap.design.power import Expected

__all__ = ["BATCHES", "CampaignDesign", "Expected", "Size", "design_campaign", "may_take_bars"]
