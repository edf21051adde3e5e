"""Which truths a tier holds, and how each is drawn.

The draw never looks at the design's conditions: who knows the design knows nothing of the truth.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np

from benchmarks.withheld.reality.confounded import ELSEWHERE, SCENARIOS, Scenario
from benchmarks.withheld.reality.design import Design
from benchmarks.withheld.reality.effects import EFFECTS, UNCLAIMED, Effect, Form, Set, Shape

__all__ = ["LABS", "TIERS", "Cause", "Tier", "draw_causes", "drawn_cause", "scenario_of"]


@dataclass(frozen=True)
class Tier:
    """A kind of campaign.

    Attributes
    ----------
    scatter_factor, freedom
        Of the noise: times the nominal, and Student's degrees of freedom (0 is the normal).
    level_scatter
        Range of the scatter of specimens' levels alone, in place of the set's.
    fitted
        Whether the palette is another law family's fit to three noisy specimens a grade.
    stray
        Whether one specimen's force is off by a factor of its own.
    sensor_share
        Range of the load cell's white noise over each specimen's largest force, where curves
        differ by that and their level alone.
    negligible
        Whether what is hidden is smaller than the scatter: the right answer is "none".
    """

    meaning: str
    scatter_factor: float = 1.0
    freedom: int = 0
    level_scatter: tuple[float, float] | None = None
    fitted: bool = False
    stray: bool = False
    sensor_share: tuple[float, float] | None = None
    negligible: bool = False


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
    "fitted-none": Tier("no effect; a palette fitted to three noisy specimens", fitted=True),
    "fitted": Tier("one effect; a palette fitted to three noisy specimens", fitted=True),
    "stray": Tier("one effect, and one specimen that is off by a factor", stray=True),
    "levels": Tier("no effect; levels scatter by 10 to 30 %", level_scatter=(0.1, 0.3)),
    "below-scatter": Tier("what differs is less than specimens scatter by", negligible=True),
    "toes": Tier("slack that is taken up bit by bit, to each specimen its own"),
    "gauge": Tier("a gauge length that is off by any factor"),
    "fill": Tier("force falls along a further column, as a gain would have it"),
    "lab": Tier("a batch's gain beside rate and temperature"),
    "three": Tier("pounds in some files, slack of soft grades, and one law that is off"),
    "noisy": Tier("one effect; a noisy load cell", sensor_share=(0.001, 0.005)),
    "noisy-none": Tier("no effect; a noisy load cell", sensor_share=(0.001, 0.005)),
    "elsewhere": Tier("one effect, all tests at another condition than the palette's"),
}
"""Tiers by name; the order is part of the seeds."""

LABS = tuple(TIERS)[list(TIERS).index("fitted-none") :]
"""Tiers of what other labs' measurements have shown."""

_RESTRICTED: Mapping[str, tuple[Scenario, ...]] = {
    "confounded": SCENARIOS, "elsewhere": ELSEWHERE
}  # fmt: skip
"""Designs of tiers that do not have the full one, by turns."""

_ALIKE = frozenset({frozenset({"cross-section", "skin"})})
"""Pairs that would be one effect with another number in the full design too."""

_CANCELLING = (
    ("cross-section", "composition-offset"),
    ("cross-section", "strain-scale"),
    ("skin", "strain-scale"),
    ("skin", "composition-offset"),
    ("strain-scale", "composition-offset"),
)
_CLEAR = 6.0
_STRATA = ((1.0, 2.0), (2.0, 4.0), (4.0, 20.0))
_STRATUM_SHARES = (0.1, 0.3, 0.6)


@dataclass(frozen=True)
class Cause:
    """An effect in one form and shape, and how visible it should be if its range allows.

    Or its size, whatever that shows.
    """

    effect: Effect
    form: Form
    shape: Shape
    wanted_snr: float
    size: float | None = None

    def opposite(self) -> "Cause | None":
        """Return the same with the other sign, if it has one."""
        if "sign" not in self.shape:
            return None
        flipped = -float(self.shape["sign"])  # type: ignore[arg-type]  # a number by that name
        return replace(self, shape={**self.shape, "sign": flipped})


def scenario_of(tier: str, turn: int) -> Scenario | None:
    """Return the restricted design of a campaign, if its tier has any; others have the full one."""
    among = _RESTRICTED.get(tier)
    return None if among is None else among[turn % len(among)]


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
        case "none" | "none-t4" | "none-scatter" | "fitted-none" | "levels" | "noisy-none":
            return ()
        case "library" | "other" | "fitted" | "stray" | "noisy":
            if tier in LABS:  # beside what the palette, a stray or noise hides
                tier, wanted = "library", max(wanted, _CLEAR)
            effect = EFFECTS[ids[turn % len(ids)]]
            return (drawn_cause(effect, tier, set_name, design, wanted, rng),)
        case "unclaimed":
            effect = UNCLAIMED[sorted(UNCLAIMED)[turn % len(UNCLAIMED)]]
            return (drawn_cause(effect, "other", set_name, design, wanted, rng),)
        case "confounded" | "elsewhere":
            assert scenario is not None
            member = scenario.members[turn // len(_RESTRICTED[tier]) % len(scenario.members)]
            form = member.find()
            shape = {**form.draw(rng, design), **member.fixed}
            return (Cause(EFFECTS[member.effect], form, shape, max(wanted, 4.0)),)
        case "below-scatter":
            return (replace(sized(UNCLAIMED["operator"], design, rng), size=None),)
        case "toes":
            return (sized(EFFECTS["grip-slack"], design, rng),)
        case "gauge":
            return (sized(EFFECTS["strain-scale"], design, rng),)
        case "fill":
            return (sized(UNCLAIMED["tray"], design, rng),)
        case "lab":
            physical = [
                drawn_cause(EFFECTS[i], "library", set_name, design, rng.uniform(6.0, 15.0), rng)
                for i in ("rate", "temperature")
            ]
            return (*physical, sized(EFFECTS["force-scale"], design, rng))
        case "three":
            law = drawn_cause(EFFECTS["material-law"], "library", set_name, design, 10.0, rng)
            scale, slack = (EFFECTS[i] for i in ("force-scale", "grip-slack"))
            return (law, sized(scale, design, rng, 1), sized(slack, design, rng, 1))
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


def sized(effect: Effect, design: Design, rng: np.random.Generator, number: int = 0) -> Cause:
    """Draw an effect as other labs' measurements have it: its size is drawn, not what it shows."""
    form = effect.measured[number]
    size = float(np.exp(rng.uniform(np.log(form.low), np.log(form.high))))
    return Cause(effect, form, form.draw(rng, design), 0.0, size)


def _draw_snr(rng: np.random.Generator) -> float:
    low, high = np.log(_STRATA[int(rng.choice(len(_STRATA), p=_STRATUM_SHARES))])
    return float(np.exp(rng.uniform(low, high)))
