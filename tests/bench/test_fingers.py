"""Campaigns of made-up fingers: what the solid does with other laws, and what is found of it."""

import json

import numpy as np
import pytest

from benchmarks.withheld.fingers import (
    FOLDER,
    LOADED,
    TEMPERATURES_C,
    RATES_mm_s,
    campaign,
    softer,
    stiffer,
)
from planner.gap.diagnose import diagnose
from planner.simulation.part_response import PartResponse, force_factor

TRUTHS = json.loads((FOLDER / "truths.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", LOADED)
def test_shares_say_what_the_solid_does(name: str) -> None:
    """Solved anew with laws that are graded softer, or stiffer point by point by their rates."""
    response = PartResponse.read(FOLDER / f"{name}.json")
    last = response.strain[-1] / response.displacement_mm[-1]
    changes = {f"{at:g} C": softer(response.coordinate, at) for at in TEMPERATURES_C}
    changes |= {f"{r:g} mm/s": stiffer(response.coordinate, r * last) for r in RATES_mm_s}
    for condition, change in changes.items():
        displacement, force = np.array(TRUTHS[f"{name}, {condition}"])
        before, strain, share = response.at(displacement)
        said = force_factor(np.broadcast_to(np.exp(change), strain.shape), share) - 1.0
        true = force / before - 1.0
        # Second order in changes of up to 30 %; bins average over rates. Forces have 7 digits.
        np.testing.assert_allclose(said, true, rtol=0.05, atol=1e-3, err_msg=condition)


@pytest.mark.parametrize(
    ("effect", "closed"),
    [
        pytest.param("temperature", 0.9, marks=pytest.mark.long),
        pytest.param("machine-compliance", 0.95, marks=pytest.mark.long),
        pytest.param("rate", 0.6, marks=pytest.mark.long),
    ],
)
def test_the_withheld_effect_is_named(effect: str, closed: float) -> None:
    """Rate's course bends more than any form does: a companion may stand beside it."""
    found = diagnose(campaign(effect, 1))
    named = sum(h.probability for h in found.ranking if effect in h.effects)
    assert effect in found.verdict.split("+")
    assert named > 0.8
    assert found.gap.closed is not None
    assert found.gap.closed > closed
