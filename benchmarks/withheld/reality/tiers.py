"""Which truths a tier holds, and how each is drawn.

The draw never looks at the design's conditions: who knows the design knows nothing of the truth.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np

from benchmarks.withheld.reality.confounded import SCENARIOS, Scenario
from benchmarks.withheld.reality.design import Design
from benchmarks.withheld.reality.effects import EFFECTS, UNCLAIMED, Effect, Form, Set, Shape

__all__ = ["TIERS", "Cause", "Tier", "draw_causes", "drawn_cause", "scenario_of"]


@dataclass(frozen=True)
class Tier:
    """A kind of campaign.

    Attributes
    ----------
    scatter_factor, freedom
        Of the noise: times the nominal, and Student's degrees of freedom (0 is the normal).
    """

    meaning: str
    scatter_factor: float = 1.0
    freedom: int = 0


TIERS: Mapping[str, Tier] = {
    "library": Tier("one effect, in a textbook's form"),
    "other": Tier("one effect, in another form"),
    "none": Tier("no effect"),
    "none-t4": Tier("no effect, specimens and sensors with heavy tails", freedom=4),
    "none-scatter": Tier("no effect, 1.6 times the scatter", scatter_factor=1.6),
    "pair": Tier("two effects, both visible"),
    "cancelling": Tier("two effects that all but cancel in the mean"),
    "confounded": Tier("one effect, in a design that cannot tell it from others"),
    "unclaimed": Tier("one effect that no library knows, along a further column"),
}
"""Tiers by name; the order is part of the seeds."""

_ALIKE = frozenset({frozenset({"cross-section", "skin"})})
"""Pairs that would be one effect with another number in the full design too."""

_CANCELLING = (
    ("cross-section", "composition-offset"),
    ("cross-section", "strain-scale"),
    ("skin", "strain-scale"),
    ("skin", "composition-offset"),
    ("strain-scale", "composition-offset"),
)
_STRATA = ((1.0, 2.0), (2.0, 4.0), (4.0, 20.0))
_STRATUM_SHARES = (0.1, 0.3, 0.6)


@dataclass(frozen=True)
class Cause:
    """An effect in one form and shape, and how visible it should be if its range allows."""

    effect: Effect
    form: Form
    shape: Shape
    wanted_snr: float

    def opposite(self) -> "Cause | None":
        """Return the same with the other sign, if it has one."""
        if "sign" not in self.shape:
            return None
        flipped = -float(self.shape["sign"])  # type: ignore[arg-type]  # a number by that name
        return replace(self, shape={**self.shape, "sign": flipped})


def scenario_of(tier: str, turn: int) -> Scenario | None:
    """Return the restricted design of a confounded campaign; other tiers have the full one."""
    return SCENARIOS[turn % len(SCENARIOS)] if tier == "confounded" else None


def draw_causes(
    tier: str,
    set_name: Set,
    design: Design,
    scenario: Scenario | None,
    turn: int,
    rng: np.random.Generator,
) -> tuple[Cause, ...]:
    """Draw what is hidden: nothing, one cause or two.

    Single effects take turns, so that a set holds each of them as often as any other.
    """
    ids = sorted(EFFECTS)
    wanted = _draw_snr(rng)
    match tier:
        case "none" | "none-t4" | "none-scatter":
            return ()
        case "library" | "other":
            effect = EFFECTS[ids[turn % len(ids)]]
            return (drawn_cause(effect, tier, set_name, design, wanted, rng),)
        case "unclaimed":
            effect = UNCLAIMED[sorted(UNCLAIMED)[turn % len(UNCLAIMED)]]
            return (drawn_cause(effect, "other", set_name, design, wanted, rng),)
        case "confounded":
            assert scenario is not None
            member = scenario.members[turn // len(SCENARIOS) % len(scenario.members)]
            form = member.find()
            shape = {**form.draw(rng, design), **member.fixed}
            return (Cause(EFFECTS[member.effect], form, shape, max(wanted, 4.0)),)
    pair = _CANCELLING[int(rng.integers(len(_CANCELLING)))]
    while tier == "pair":
        first, second = rng.choice(len(ids), 2, replace=False)
        pair = ids[first], ids[second]
        if frozenset(pair) not in _ALIKE:
            break
    kind = "library" if rng.uniform() < 0.5 else "other"
    return tuple(
        drawn_cause(EFFECTS[i], kind, set_name, design, float(rng.uniform(5.0, 15.0)), rng)
        for i in pair
    )


def drawn_cause(
    effect: Effect,
    kind: str,
    set_name: Set,
    design: Design,
    wanted_snr: float,
    rng: np.random.Generator,
) -> Cause:
    """Draw a form of the effect ("library" or "other") and its shape."""
    assert set_name in get_args(Set)
    forms = (effect.library if kind == "library" else effect.other)[set_name]
    form = forms[int(rng.integers(len(forms)))]
    return Cause(effect, form, form.draw(rng, design), wanted_snr)


def _draw_snr(rng: np.random.Generator) -> float:
    low, high = np.log(_STRATA[int(rng.choice(len(_STRATA), p=_STRATUM_SHARES))])
    return float(np.exp(rng.uniform(low, high)))
