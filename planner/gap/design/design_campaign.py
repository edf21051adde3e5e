"""A campaign that tells effects apart, within a budget of specimens."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from planner.arrays import IntArray
from planner.errors import ArgumentError
from planner.gap.campaign import Campaign
from planner.gap.design.candidates import Size, candidates_of, strain_of
from planner.gap.design.choice import filled, information_of_pairs, testable
from planner.gap.design.power import Expected, elimination_of, expected_of
from planner.gap.effects import Effect, effects_for, untestable
from planner.gap.evidence.problem import Problem, set_up
from planner.gap.forward.mount import mount
from planner.gap.imitation import imitate
from planner.gap.imitation.stated_effect import effect_named
from planner.gap.planned.planned_specimen import BAR_SHARE, HOLD_S
from planner.gap.specimen import Specimen
from planner.palette import Palette

__all__ = ["BATCHES", "CampaignDesign", "design_campaign"]

BATCHES = 2
"""Every condition is printed once a batch, so that no condition goes with a batch."""

_MOST = 400


@dataclass(frozen=True, slots=True)
class CampaignDesign:
    """A campaign to be measured.

    Attributes
    ----------
    campaign
        Its specimens; forces are stand-ins.
    expected
        One an effect that was asked for, in that order.
    conditions
        How many there are.
    least
        Specimens with which every effect can be tested at all.
    left_over
        Specimens of the budget that make no further pair.
    needs_camera
        Whether strains along bars are counted on.
    """

    campaign: Campaign
    expected: tuple[Expected, ...]
    conditions: int
    least: int
    left_over: int
    needs_camera: bool


def design_campaign(
    palette: Palette,
    effects: Sequence[str],
    budget: int,
    *,
    printer: str = "connex3",
    size: Size | None = None,
    progress: Callable[[str], None] | None = None,
) -> CampaignDesign:
    """Return a campaign of at most `budget` specimens that tells effects apart.

    Conditions are chosen one after the other from one step off the palette's own and a few
    crossed ones: first what makes every effect testable, then what adds most to what is told of
    the effects, laws' calibration, courses and batches being uncertain (D-optimal for each
    effect, all counting alike). Nothing is drawn by lot.

    Raises
    ------
    UnknownNameError
        No effect of that id.
    ArgumentError
        No effect, one twice, a budget that cannot do, or a size out of bounds.
    PaletteError
        The palette has no elastic material, or a law that nothing can be predicted with.
    """
    library = effects_for(palette)
    asked = tuple(effect_named(id, library, "--effects").id for id in effects)
    size = Size() if size is None else size
    _check(asked, budget, size)
    # Small matrices: more threads only change the last digits.
    with threadpool_limits(1, user_api="blas"):
        return _designed(palette, library, asked, budget, printer, size, progress)


def _check(asked: Sequence[str], budget: int, size: Size) -> None:
    if not asked:
        raise ArgumentError("--effects: none; name those to tell apart, as in rate,moisture")
    double = next((id for id in asked if asked.count(id) > 1), None)
    if double is not None:
        raise ArgumentError(f"--effects: {double} stands twice; name each effect once")
    if budget > _MOST:
        raise ArgumentError(f"--budget {budget}: it must be at most {_MOST} specimens")
    for name in ("width_mm", "thickness_mm", "gauge_mm"):
        value = getattr(size, name)
        if not 0.1 <= value <= 1000.0:
            option = name.replace("_", "-")
            raise ArgumentError(f"--{option} {value:g}: it must be from 0.1 to 1000")


def _designed(
    palette: Palette,
    library: Mapping[str, Effect],
    asked: Sequence[str],
    budget: int,
    printer: str,
    size: Size,
    progress: Callable[[str], None] | None,
) -> CampaignDesign:
    say = progress or (lambda what: None)
    candidates = candidates_of(palette, asked, size)
    say("forward model of all candidates")
    problem = _problem(palette, printer, candidates, tuple(library.values()))
    say("choosing conditions")
    pairs = information_of_pairs(problem, asked, BATCHES)
    counts = testable(problem, pairs, [library[id] for id in asked])
    least = BATCHES * int(counts.sum())
    if budget < least:
        raise ArgumentError(
            f"--budget {budget}: too few specimens to test {', '.join(asked)}: it takes at least "
            f"{least}, {least // BATCHES} conditions in {BATCHES} batches; raise the budget, or "
            "ask for fewer effects"
        )
    counts = filled(counts, budget // BATCHES, pairs, [len(library[id].forms) for id in asked])
    campaign = _campaign(palette, printer, candidates, counts, asked)
    testable_ids = [id for id, e in library.items() if untestable(e, campaign) is None]
    elimination = elimination_of(problem, BATCHES * counts.astype(np.float64), BATCHES)
    return CampaignDesign(
        campaign=campaign,
        expected=expected_of(problem, elimination, asked, testable_ids),
        conditions=int((counts > 0).sum()),
        least=least,
        left_over=budget - len(campaign.specimens),
        needs_camera=any(s.profile is not None for s in campaign.specimens),
    )


def _problem(
    palette: Palette, printer: str, candidates: tuple[Specimen, ...], effects: Sequence[Effect]
) -> Problem:
    """Return the candidates as a campaign that was measured without any effect.

    Forces have the sensors' noise, so that figures are as uncertain as they will be.
    """
    plan = Campaign("candidates", printer, palette, candidates)
    made = imitate(plan, (), np.random.default_rng(0), scatter=0.0)
    made = replace(made, covariates=())
    return set_up(made, mount(made), effects)


def _campaign(
    palette: Palette,
    printer: str,
    candidates: Sequence[Specimen],
    counts: IntArray,
    asked: Sequence[str],
) -> Campaign:
    """Return the chosen conditions with a specimen a batch each."""
    specimens = []
    for number, place in enumerate(np.flatnonzero(counts).tolist(), start=1):
        for copy in range(int(counts[place]) * BATCHES):
            batch = copy % BATCHES + 1
            specimens.append(
                replace(candidates[place], id=f"D{number:02d}{'abcdefgh'[copy]}", batch=f"{batch}")
            )
    return Campaign(
        name=f"to tell {', '.join(asked)} apart",
        printer=printer,
        palette=palette,
        specimens=tuple(specimens),
        notes=_instructions(specimens, strain_of(palette)),
    )


def _instructions(specimens: Sequence[Specimen], strain: float) -> str:
    """Return what the list of specimens does not say."""
    lines = ["DESIGNED by planner gap design; nothing is measured yet"]
    pull = f"pull coupons to a strain of {strain:.3g}"
    if any(s.profile is not None for s in specimens):
        pull += f", bars to {BAR_SHARE * strain:.3g}"
    lines.append(pull)
    if any(s.protocol == "relaxation" for s in specimens):
        lines.append(f"relaxation holds for {HOLD_S:g} s")
    lines.append("print each batch as one tray, and test in an order drawn by lot")
    return "; ".join(lines) + "."
