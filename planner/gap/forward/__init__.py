"""The forward model: what a campaign's specimens would show, effect by effect, stage by stage."""

from planner.gap.forward.setup import RELAXATION_TIMES_s, Setup
from planner.gap.forward.solve import Prediction, predict

__all__ = ["RELAXATION_TIMES_s", "Prediction", "Setup", "predict"]
