"""Honesty with little data: what a campaign cannot tell is not said with confidence.

Effects are large here, so that a diagnosis is tempted.
"""

from dataclasses import replace
from typing import Any

import pytest

from planner.gap.campaign import Campaign
from planner.gap.diagnose import diagnose
from planner.gap.diagnosis import Diagnosis

SURE = 0.8
BOTH = ("TangoPlus", "FLX9760")
EFFECTS = ("rate:rise=0.25,form=power-law", "rate:form=prony,share=0.6", "temperature:slope=0.05")
COLUMNS = ("rate_mm_s", "temperature_C", "soak_h", "age_days", "orientation", "protocol", "batch")


def sure_of(found: Diagnosis) -> str | None:
    """Return the verdict if it is an effect by name, with confidence."""
    named = found.verdict not in ("none", "unknown")
    return found.verdict if named and found.ranking[0].probability > SURE else None


def said(found: Diagnosis) -> str:
    return " | ".join(found.limitations)


ONE = [
    ("monotonic", "grip-slack"),
    ("cyclic", "softening"),
    ("cyclic", "rate:form=prony,share=0.6"),
    pytest.param(("relaxation", "rate:form=prony,share=0.6"), marks=pytest.mark.slow),
]


@pytest.fixture(scope="module", params=ONE, ids=lambda p: "-".join(p))
def of_one(planned, imitated, request) -> Diagnosis:
    protocol, effect = request.param
    plan = planned(more=[{"material": "FLX9760", "protocol": protocol}])
    return diagnose(imitated(plan, effect))


def test_one_specimen_has_its_limits_said(of_one: Diagnosis) -> None:
    assert "one specimen only" in said(of_one)
    assert "no cause can be named" in said(of_one)
    assert "no two specimens were made and tested alike" in said(of_one)
    assert (of_one.gap.closed, of_one.gap.floor) == (None, None)
    assert len(of_one.not_testable) > 5


def test_one_specimen_names_nothing(of_one: Diagnosis) -> None:
    assert sure_of(of_one) is None


@pytest.fixture(scope="module", params=["two rates, rate", "alike, grip-slack"])
def of_two(planned, imitated, request) -> Diagnosis:
    if request.param.startswith("two"):
        plan = planned(material=["FLX9760"], rate_mm_s=[0.85, 8.5])
        return diagnose(imitated(plan, EFFECTS[0]))
    return diagnose(imitated(planned(2, batches=1, material=["FLX9760"]), "grip-slack"))


def test_two_tests_tell_no_two_causes(of_two: Diagnosis) -> None:
    assert all(len(h.effects) < 2 for h in of_two.ranking)


def test_two_specimens_have_their_limits_said(of_two: Diagnosis) -> None:
    assert "2 specimens cannot tell causes apart" in said(of_two)


def test_two_specimens_name_nothing(of_two: Diagnosis) -> None:
    assert sure_of(of_two) is None


def several(planned: Any) -> Campaign:
    """One specimen of each of eight conditions."""
    one_by_one: tuple[dict[str, Any], ...] = (
        {}, {"rate_mm_s": 8.5}, {"temperature_C": 35.0}, {"soak_h": 24.0},
    )  # fmt: skip
    plan: Campaign = planned(more=[{"material": m, **c} for m in BOTH for c in one_by_one])
    return plan


@pytest.mark.slow
@pytest.mark.parametrize("effect", [EFFECTS[0], pytest.param(EFFECTS[2], marks=pytest.mark.long)])
def test_without_replicates_nothing_wrong_is_named(planned, imitated, effect: str) -> None:
    """Large effects may be seen without; how far they close cannot be known."""
    found = diagnose(imitated(several(planned), effect))
    assert "without replicates the scatter between specimens is assumed" in said(found)
    assert sure_of(found) in (None, effect.partition(":")[0])
    assert (found.gap.floor, found.gap.closed) == (None, None)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.long)])
def test_without_replicates_nothing_is_named_where_there_is_nothing(
    planned, imitated, seed: int
) -> None:
    """Even if specimens scatter by one and a half times what is usual."""
    assert sure_of(diagnose(imitated(several(planned), scatter=0.045, seed=seed))) is None


@pytest.mark.slow
@pytest.mark.parametrize("effect", [EFFECTS[0], "composition-offset", "cross-section"])
def test_one_material_does_not_tell_mixtures_from_sections(planned, imitated, effect: str) -> None:
    """Off by as much everywhere: of many causes, and none of them named."""
    plan = planned(3, material=["FLX9760"], rate_mm_s=[0.085, 0.85, 8.5])
    found = diagnose(imitated(plan, effect))
    reasons = {u.id: u.reason for u in found.not_testable}
    assert "there is one material only" in reasons.values()
    assert "interface-bleed" in reasons
    assert sure_of(found) in (None, effect.partition(":")[0])
    if not effect.startswith("rate"):
        assert sure_of(found) is None


@pytest.mark.slow
def test_coupons_say_nothing_of_bars(planned, imitated) -> None:
    plan = planned(2, material=["TangoPlus", "FLX9760", "FLX9785"], rate_mm_s=[0.85, 8.5])
    found = diagnose(imitated(plan, "interface-bleed"))
    assert {u.id: u.reason for u in found.not_testable}["interface-bleed"] == (
        "there is no graded bar"
    )
    assert sure_of(found) is None


@pytest.mark.slow
@pytest.mark.parametrize("effect", ["temperature:slope=0.05", "moisture", "orientation"])
def test_with_every_column_missing_no_cause_by_column_is_named(
    planned, imitated, effect: str
) -> None:
    """Half of the specimens were hot, wet or turned, and nobody wrote it down."""
    plan = planned(2, material=list(BOTH), temperature_C=[23.0, 38.0], soak_h=[0.0], age_days=[9.0])
    changed = {"moisture": {"soak_h": 24.0},
               "orientation": {"orientation": "z"}}.get(effect, {})  # fmt: skip
    specimens = tuple(
        s if s.temperature_C == 23.0 else replace(s, **changed) for s in plan.specimens
    )
    measured = imitated(replace(plan, specimens=specimens), effect)
    blank = tuple(replace(s, **dict.fromkeys(COLUMNS)) for s in measured.specimens)
    found = diagnose(replace(measured, specimens=blank))
    for name in COLUMNS:
        assert f"{name} is unknown for all specimens" in said(found)
    assert effect.partition(":")[0] in {u.id for u in found.not_testable}
    if found.effect:  # the hot ones bear half of the force: what can be told is which they are
        (gain,) = found.effect
        assert gain.id == "force-scale"
        hot = [s.id for s in measured.specimens if s.temperature_C == 38.0]
        assert sorted(gain.specimens) == sorted(hot)
    else:
        assert sure_of(found) is None


@pytest.mark.slow
def test_all_at_another_temperature_than_the_palettes_may_be_that(planned, imitated) -> None:
    """Nothing varies with it, so that a gain looks the same: one answer, and neither is sure."""
    grades = ("TangoPlus", "FLX9750", "FLX9770", "FLX9795")
    warm = [{"material": m, "temperature_C": 35.0, "batch": b} for m in grades for b in "AB"]
    found = diagnose(imitated(planned(more=warm * 2), "temperature"))
    assert {("temperature",), ("force-scale",)} <= set(found.same_class)
    assert sure_of(found) is None
    assert "temperature" not in {one.id for one in found.not_testable}
