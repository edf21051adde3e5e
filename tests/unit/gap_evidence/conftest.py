"""One campaign in which every effect of the library can show, made ready for weighing."""

import pytest

from planner.gap.effect import untestable
from planner.gap.effects import effects_for
from planner.gap.evidence.problem import Problem
from planner.gap.observations import ObservationModel

CONDITIONS = (
    {}, {"rate_mm_s": 8.5}, {"temperature_C": 35.0}, {"soak_h": 24.0}, {"age_days": 60.0},
    {"orientation": "z"}, {"protocol": "cyclic"}, {"protocol": "relaxation"},
    {"thickness_mm": 1.5},
)  # fmt: skip


@pytest.fixture(scope="session")
def everything(planned, imitated, step_bar) -> Problem:
    rows = [{"material": m, **c} for m in ("TangoPlus", "FLX9760") for c in CONDITIONS]
    rows.append({"profile": step_bar, "gauge_mm": 32.0})
    campaign = imitated(planned(more=rows, camera=True))
    effects = [e for e in effects_for(campaign.palette).values() if not untestable(e, campaign)]
    return Problem(campaign, ObservationModel(campaign), effects)
