"""What could not be tested, but would look like the verdict."""

import pytest

from planner.gap.diagnose import confounders_of
from planner.gap.diagnosis import Untestable
from planner.gap.effects import EFFECTS

RATE = Untestable("rate", "rate_mm_s was 1 in all specimens and no specimen was held at a strain")


def test_a_rate_that_was_not_varied_may_be_what_the_branches_show() -> None:
    (sentence,) = confounders_of(("permanent-set", "softening"), (RATE,))
    assert sentence.startswith(f"rate could not be tested ({RATE.reason}), but shows along branch")
    assert "as permanent-set and softening do" in sentence
    assert "two speeds that differ tenfold" in sentence
    assert "hold a specimen" in sentence


def test_only_the_effects_that_share_an_axis_are_named() -> None:
    (sentence,) = confounders_of(("orientation", "softening"), (RATE,))
    assert "as softening does" in sentence
    assert "orientation" not in sentence


@pytest.mark.parametrize("effects", [(), ("unknown",), ("cross-section",)])
def test_nothing_is_said_of_a_verdict_along_other_axes(effects: tuple[str, ...]) -> None:
    assert confounders_of(effects, (RATE,)) == ()


def test_what_cannot_have_acted_is_no_look_alike() -> None:
    """Without unloading there is no set, without a bar no boundary to bleed over."""
    never = (
        Untestable("permanent-set", "no specimen was unloaded"),
        Untestable("interface-bleed", "there is no graded bar"),
    )
    assert confounders_of(("grip-slack", "composition-offset"), never) == ()


@pytest.mark.parametrize("id", EFFECTS)
def test_every_effect_has_a_test_that_settles_it(id: str) -> None:
    """Against one with the same axes, whatever those are."""
    needs = (*EFFECTS[id].covariates, *EFFECTS[id].channels)
    said = confounders_of((id,), (Untestable(id, "reason"),))
    if needs and not {"unloading", "bar"} & set(needs):
        assert "to settle it, " in said[0]
    else:
        assert len(said) == (0 if needs else 1)
