"""The forward model: what a campaign's specimens would show, effect by effect, stage by stage."""

from planner.gap.forward.law_tables import LawTables, law_tables
from planner.gap.forward.setup import RELAXATION_TIMES_s, Setup
from planner.gap.forward.solve import Prediction, predict, predict_all

__all__ = [
    "LawTables",
    "Prediction",
    "RELAXATION_TIMES_s",
    "Setup",
    "law_tables",
    "predict",
    "predict_all",
]
