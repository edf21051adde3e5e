"""Optimal design: which specimens tell effects apart, and which test to do next."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import accumulate, combinations, pairwise
from pathlib import Path
from typing import Any

import numpy as np
import scipy.linalg
from scipy.special import ndtr

from planner.errors import ArgumentError, PaletteError, as_count, as_texts, within
from planner.formats.specimens import SPECIMEN_COLUMNS
from planner.gap.campaign import Campaign, Specimen, stated
from planner.gap.diagnosis import Experiment, Hypothesis
from planner.gap.effect import Effect, Parameter, untestable
from planner.gap.effects import EFFECTS, STEPS, effect_named, effects_for
from planner.gap.evidence.posterior_mode import Likelihood
from planner.gap.evidence.problem import Candidate, Problem, SignedForm, node_weights, searched
from planner.gap.evidence.weigh import (
    ALIKE_COSINE,
    UNKNOWN,
    Priors,
    Weighed,
    detectable_sizes,
    needed_nats,
)
from planner.gap.noise import Calibration, NoisyFeatures, calibration_columns, calibrations_of
from planner.gap.observations import ObservationModel
from planner.gap.virtual import (
    BAR_SHARE,
    HOLD_S,
    synthetic_campaign,
    virtual_specimen,
    virtual_strain,
)
from planner.glance import counted, one_line
from planner.numerics import FloatArray, IntArray, one_blas_thread
from planner.palette import Material, Palette, Reference
from planner.printers import Printer, load_printer, palette_of
from planner.simulation.bar import ProfileDesign
from planner.simulation.bar_solver import Setup, predict

__all__ = ["CampaignDesign", "design_campaign", "next_experiments"]


# ------------------------------------------------------------------------------------------------
# Tests one step away from a reference: what a campaign may hold, and what a lab could do next.


_Change = Mapping[str, Any]
"""By column: its new value."""


def _rounded(value: float) -> float:
    return float(f"{value:.3g}")


def _changed(step: Mapping[str, str], reference: Mapping[str, Any]) -> dict[str, Any]:
    """Return the new values of a step's columns; see `effects.toml`."""
    return {name: _altered(to, reference[name]) for name, to in step.items()}


def _altered(to: str, value: Any) -> Any:
    sign, _, figure = to.partition(" ")
    if not figure:
        return next(word for word in to.split("|") if word != value)
    by = float(figure)
    return {"+": value + by, "*": value * by, "~": _rounded(value * by)}[sign]


_CROSSED = (
    ("rate", "temperature"), ("temperature", "soak"), ("age", "soak"), ("rate", "cyclic"),
    ("temperature", "cyclic"),
)  # fmt: skip


def _specimen(
    palette: Palette, reference: Mapping[str, Any], change: _Change, **options: Any
) -> Specimen:
    """Return the reference with a change, pulled at its strain rate where that does not change.

    Parameters
    ----------
    reference, change
        Fields of `Specimen`.
    options
        Of `virtual_specimen`.
    """
    fields = {**reference, **change}
    if "rate_mm_s" not in change:
        fields["rate_mm_s"] *= fields["gauge_mm"] / reference["gauge_mm"]
    return virtual_specimen(palette, **fields, **options)


def _striped(name: str, gauge_mm: float, *mixtures: float) -> ProfileDesign:
    """Return a bar of mixtures, each as long as the others."""
    edges = np.repeat(np.linspace(0.0, 1.0, len(mixtures) + 1), 2)[1:-1]
    return ProfileDesign(name, edges * gauge_mm, np.repeat(mixtures, 2))


def _elastic(palette: Palette) -> tuple[list[Material], list[Material]]:
    """Return the elastic materials; and of them the softest, a middle and the hardest.

    Raises
    ------
    PaletteError
        There is none.
    """
    if not (grades := [m for m in palette.materials if m.deformation == "elastic"]):
        raise PaletteError(
            f"palette {palette.name}: no elastic material; a campaign is planned for elastomers"
        )
    return grades, [grades[0], grades[len(grades) // 2], grades[-1]]


# ------------------------------------------------------------------------------------------------
# Conditions that a campaign may have: one step from the palette's own each, and a few crossed.


_USUAL_SIZE: Mapping[str, float] = {"width_mm": 6.0, "thickness_mm": 3.0, "gauge_mm": 25.0}
"""Of the usual specimen's gauge section. Convention: some 6 by 25 mm, as ASTM D412's die C."""


def candidates_of(
    palette: Palette, effects: Sequence[str], size: Mapping[str, float] = _USUAL_SIZE
) -> tuple[Specimen, ...]:
    """Return one planned specimen a condition, those at the palette's own conditions first.

    Every change is tried on the softest, a middle and the hardest elastic material, for effects
    may differ along the palette. Batches are left open.
    """
    grades, (soft, middle, hard) = _elastic(palette)
    three = list(dict.fromkeys(m.id for m in (middle, soft, hard)))
    wanted = {name for id in effects for name in EFFECTS[id].changes}
    conditions = asdict(stated(palette.reference))
    rate_per_s = conditions.pop("strain_rate_per_s")
    reference: dict[str, Any] = {**size, **conditions, "protocol": "monotonic"}
    reference["rate_mm_s"] = _rounded(rate_per_s * size["gauge_mm"])
    steps = {name: [_changed(one, reference) for one in ways] for name, ways in STEPS.items()}
    changes: list[_Change] = [{"material": id} for id in three]
    if "materials" in wanted:
        changes += [{"material": m.id} for m in grades if m.id not in three]
    for name in (name for name in steps if name in wanted):
        changes += [{"material": id, **step} for step in steps[name] for id in three]
    for first, second in _CROSSED:
        if {first, second} <= wanted:
            changes.append({"material": three[0], **steps[first][0], **steps[second][0]})
    if "bars" in wanted and len(grades) > 1:
        gauge_mm, (low, mid, high) = size["gauge_mm"], (m.coordinate for m in (soft, middle, hard))
        bars = [
            _striped("step-middle-hard", gauge_mm, mid, high),
            _striped("step-soft-middle", gauge_mm, low, mid),
            _striped("stripes", gauge_mm, *[mid, high] * 3),
            ProfileDesign("ramp", np.array([0.0, gauge_mm]), np.array([low, high])),
        ]
        changes += [{"profile": bar} for bar in bars]
        if "rate" in wanted:
            changes.append({"profile": bars[0], "protocol": "relaxation"})
    strain = virtual_strain(palette, [m.id for m in grades])  # whichever are chosen
    return tuple(
        _specimen(palette, reference, change, id=f"C{number:03d}", strain=strain, camera=True)
        for number, change in enumerate(changes)
    )


# ------------------------------------------------------------------------------------------------
# What a planned campaign would show of each effect, and what it could not tell apart.


@dataclass(frozen=True, slots=True)
class Expected:
    """What is to be expected of one effect.

    Attributes
    ----------
    size
        Of its first form.
    smallest
        That would be named rather than no effect; None if not even the largest would.
    probability
        That an effect of middling size is named, no other beside it.
    alike
        Effects of those that were asked for whose pattern is the same to 0.95.
    others
        Further effects of the library of which that is true.
    """

    id: str
    size: Parameter
    smallest: float | None
    probability: float
    alike: tuple[str, ...]
    others: tuple[str, ...]


def _usual_weights(problem: Problem, form: SignedForm) -> FloatArray:
    """Return the weights of all nodes that stand for a form at the middle of its prior, (k,)."""
    size, weights = form.form.size, np.zeros(problem.nodes.shape[1])
    weights[form.own] = node_weights((np.sqrt(size.usual / size.high), *[0.0] * form.shapes))
    return weights


def _batch_level(problem: Problem) -> FloatArray:
    """Return the whitened pattern of the batches' mean a deviation off, (N,).

    That is what all conditions share: of every one there are as many specimens in each batch.
    """
    force = np.where(problem.table.is_field, 0.0, problem.sensitivity)
    return problem.noise.whiten(problem.scatter.batch / np.sqrt(_BATCHES) * force)


def _expected_of(
    problem: Problem, m: FloatArray, asked: Sequence[str], testable: Sequence[str]
) -> Iterator[Expected]:
    """Yield what to expect of the effects that were asked for.

    An effect is named if its expected evidence makes up for the odds against it and beats that of
    every other testable effect at its best place, as the diagnosis looks for it; both are taken to
    be normally distributed about what is expected.

    Parameters
    ----------
    m : (nodes, nodes)
        Inner products of all nodes, what is uncertain besides integrated out.
    """
    priors = Priors()
    sizes = {d.id: d for d in detectable_sizes(problem, m, priors)}
    needed = needed_nats(priors, len(testable))
    for id in asked:
        first = next(b for b in problem.signed_forms if b.effect.id == id)
        pattern = _usual_weights(problem, first)
        length2 = float(pattern @ m @ pattern)
        named = float(ndtr(np.sqrt(length2) - np.sqrt(2.0 * needed)))
        rivals = dict.fromkeys((k for k in testable if k != id), 0.0)
        for rival in searched(problem.signed_forms, m @ pattern, m):
            (k,) = rival.effects
            if k in rivals:
                rivals[k] = max(rivals[k], min(2.0 * rival.gain, length2))
        nearest = max(rivals.values(), default=-np.inf)
        named = min(named, float(ndtr(0.5 * np.sqrt(length2 - nearest))))
        alike = tuple(k for k, explained in rivals.items() if explained > ALIKE_COSINE**2 * length2)
        yield Expected(
            id=id,
            size=first.form.size,
            smallest=sizes[id].size,
            probability=named,
            alike=tuple(k for k in alike if k in asked),
            others=tuple(k for k in alike if k not in asked),
        )


# ------------------------------------------------------------------------------------------------
# Choosing conditions one after the other, so that they tell most of every effect.


_ROUNDS = 2
"""A condition is chosen so often at most. Chosen: four specimens of it in two batches; further ones
tell of the scatter alone."""


@dataclass(frozen=True, slots=True, eq=False)
class Information:
    """What candidates tell of effects, however often each is chosen.

    Attributes
    ----------
    pairs : (candidates, X, X)
        Of one specimen a batch of each: inner products of the effects' patterns at their usual
        size, one a form, then of all nuisances.
    forms
        How many patterns each effect has.
    """

    pairs: FloatArray
    forms: Sequence[int]

    def nats(self, counts: IntArray) -> float:
        """Return what chosen conditions tell of the effects, the other effects being possible.

        Of each effect ln det of the information on its forms' sizes, all else being uncertain by
        a prior deviation of 1; an effect of many forms weighs no more than another.

        Parameters
        ----------
        counts : (candidates,)
            How often each is chosen.
        """
        total = np.tensordot(counts.astype(np.float64), self.pairs, axes=1)
        total[np.diag_indices(len(total))] += 1.0
        factor = scipy.linalg.cho_factor(total, lower=True, check_finite=False)
        of_effects = np.eye(len(total), sum(self.forms))
        inverse = scipy.linalg.cho_solve(factor, of_effects, check_finite=False)
        blocks = (inverse[a:b, a:b] for a, b in pairwise(accumulate(self.forms, initial=0)))
        return sum(-0.5 / len(block) * float(np.linalg.slogdet(block)[1]) for block in blocks)

    def best(self, choices: Sequence[IntArray]) -> IntArray:
        """Return the first of the choices that tell most."""
        # Rounded, so that the last bits of another machine choose no other condition.
        return max(choices, key=lambda counts: round(self.nats(counts), 6))

    def filled(self, counts: IntArray, conditions: int) -> IntArray:
        """Return the choice with as many more as make up a number of conditions."""
        while counts.sum() < conditions and (more := _one_more(counts, _ROUNDS)):
            counts = self.best(more)
        return counts


def _information_of(problem: Problem, asked: Sequence[Effect]) -> Information:
    """Return what each candidate tells, a specimen a batch.

    Nuisances are calibration of the laws, courses, and the level that the batches share. Every form
    has a pattern, all forms of an effect together weighing as one.
    """
    weights = []
    for effect in asked:
        forms = [b for b in problem.signed_forms if b.effect.id == effect.id and b.sign > 0.0]
        weights += [_usual_weights(problem, b) / np.sqrt(len(forms)) for b in forms]
    patterns = problem.nodes @ np.stack(weights, axis=1)
    columns = np.concatenate([patterns, problem.nuisances, _batch_level(problem)[:, None]], axis=1)
    parts = [columns[rows].T @ columns[rows] for rows in problem.noise.rows]
    return Information(_BATCHES * np.stack(parts), [len(effect.forms) for effect in asked])


def _testable(problem: Problem, told: Information, effects: Sequence[Effect]) -> IntArray:
    """Return how often to choose each candidate, so that every effect can be tested at all.

    The first candidate, at the palette's own conditions, is among them.
    """
    campaign = problem.campaign
    counts: IntArray = np.zeros(len(campaign.specimens), dtype=np.int64)
    counts[0] = 1

    def lacking(chosen: IntArray) -> int:
        some = (campaign.specimens[k] for k in np.flatnonzero(chosen))
        trial = replace(campaign, specimens=tuple(some))
        return sum(untestable(e, trial) is not None for e in effects)

    while (missing := lacking(counts)) and (choices := _one_more(counts, 1)):
        counts = told.best([c for c in choices if lacking(c) < missing] or choices)
    return counts


def _one_more(counts: IntArray, most: int) -> list[IntArray]:
    """Return every choice with one condition more."""
    return list(counts + np.eye(len(counts), dtype=counts.dtype)[counts < most])


# ------------------------------------------------------------------------------------------------
# A campaign that tells effects apart, within a budget of specimens.


_BATCHES = 2
"""In which every condition is printed once, so that none goes with a batch. Chosen: the fewest that
tell batches from scatter."""

_SMALLEST_mm, _LARGEST_mm = 0.1, 1000.0
"""Of a specimen's size. Convention: no tensile specimen is beyond, to catch slips of units."""

_MOST = 400
"""Specimens of a budget. Convention: months of a lab's work, to catch slips."""


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

    @one_line
    def __repr__(self) -> str:
        asked, specimens = ", ".join(e.id for e in self.expected), len(self.campaign.specimens)
        held = f"{counted(specimens, 'specimen')}, {counted(self.conditions, 'condition')}"
        return f"for {asked}: {held}; {'ok' if self.ok else 'not sure'}"

    @property
    def ok(self) -> bool:
        """Whether every effect will rather be named than missed, and be told from the others."""
        return all(not e.alike and e.probability >= 0.5 for e in self.expected)

    def document(self) -> dict[str, Any]:
        """Return what is to be measured, and what is expected of it, as JSON holds it."""
        return {
            "specimens": len(self.campaign.specimens),
            "conditions": self.conditions,
            "least": self.least,
            "left_over": self.left_over,
            "needs_strain_fields": self.needs_camera,
            "notes": self.campaign.notes,
            "expected": [
                {
                    "effect": e.id,
                    "parameter": e.size.name,
                    "unit": e.size.unit,
                    "smallest": None if e.smallest is None else _rounded(e.smallest),
                    "usual": _rounded(e.size.usual),
                    "probability": round(e.probability, 3),
                    "alike": list(e.alike),
                    "alike_others": list(e.others),
                }
                for e in self.expected
            ],
        }


def design_campaign(
    effects: str | Sequence[str],
    budget: int,
    *,
    printer: str | Printer = "connex3",
    palette: str | Path | Palette | None = None,
    width_mm: float = _USUAL_SIZE["width_mm"],
    thickness_mm: float = _USUAL_SIZE["thickness_mm"],
    gauge_mm: float = _USUAL_SIZE["gauge_mm"],
    progress: Callable[[str], None] | None = None,
) -> CampaignDesign:
    """Choose the specimens that tell effects apart, and say how sure the diagnosis will be.

    Conditions are chosen one after the other from one step off the palette's own and a few
    crossed ones: first what makes every effect testable, then what adds most to what is told of
    the effects, laws' calibration, courses and batches being uncertain (D-optimal for each
    effect, all counting alike). Nothing is drawn by lot.

    Parameters
    ----------
    effects
        Ids, or one text with commas between them: ``"rate,moisture"``.
    budget
        Specimens at most, of both batches.
    printer, palette
        By name, file or value; the printer's default palette if not given.
    width_mm, thickness_mm, gauge_mm
        Of the usual specimen.
    progress
        Called with the name of each stage as it begins.

    Returns
    -------
    CampaignDesign
        `write_campaign` writes its campaign with ``measured=False``, to be filled in.

    Raises
    ------
    UnknownNameError
        No effect of that id, no such printer or palette.
    ArgumentError
        No effect, one twice, a budget that cannot do, or a size out of bounds.
    PaletteError
        The palette has no elastic material, or a law that nothing can be predicted with.

    Examples
    --------
    >>> made = planner.design_campaign("rate,moisture", 16)  # doctest: +SKIP
    >>> planner.write_campaign(made.campaign, "lab", measured=False)  # doctest: +SKIP
    """
    machine = load_printer(printer)
    palette = palette_of(palette, machine)
    library = effects_for(palette)
    named = effects.split(",") if isinstance(effects, str) else as_texts(effects, "`effects`")
    asked = tuple(effect_named(id, library, "`effects`").id for id in map(str.strip, named) if id)
    size = {"width_mm": width_mm, "thickness_mm": thickness_mm, "gauge_mm": gauge_mm}
    if not asked:
        raise ArgumentError("`effects`: none; name those to tell apart, as in rate,moisture")
    if (double := next((id for id in asked if asked.count(id) > 1), None)) is not None:
        raise ArgumentError(f"`effects`: {double} stands twice; name each effect once")
    as_count(budget, "`budget`", _MOST)
    size = {name: within(v, f"`{name}`", _SMALLEST_mm, _LARGEST_mm) for name, v in size.items()}
    say = progress or (lambda what: None)
    plan = Campaign("candidates", machine.name, palette, candidates_of(palette, asked, size))
    # Small matrices: more threads only change the last digits.
    with one_blas_thread():
        say("forward model of all candidates")
        # As measured without any effect: with the sensors' noise figures are as uncertain as ever.
        made = synthetic_campaign(plan, (), np.random.default_rng(0), scatter=0.0)
        made = replace(made, covariates=())
        problem = Problem(made, ObservationModel(made), tuple(library.values()))
        say("choosing conditions")
        told = _information_of(problem, [library[id] for id in asked])
        counts = _testable(problem, told, [library[id] for id in asked])
        least = _BATCHES * int(counts.sum())
        if budget < least:
            raise ArgumentError(
                f"`budget` {budget}: too few specimens to test {', '.join(asked)}: it takes at "
                f"least {least}, {least // _BATCHES} conditions in {_BATCHES} batches; raise the "
                "budget, or ask for fewer effects"
            )
        counts = told.filled(counts, budget // _BATCHES)
        campaign = _campaign(plan, counts, asked)
        testable = [id for id, e in library.items() if untestable(e, campaign) is None]
        # As many specimens of each condition, spread evenly over the batches.
        likelihood = Likelihood(problem, weight=_BATCHES * counts.astype(np.float64))
        level = _batch_level(problem)[:, None]
        m = likelihood.elimination(problem.target, level, problem.nodes).products[1:, 1:]
        return CampaignDesign(
            campaign=campaign,
            expected=tuple(_expected_of(problem, m, asked, testable)),
            conditions=int((counts > 0).sum()),
            least=least,
            left_over=budget - len(campaign.specimens),
            needs_camera=any(s.profile is not None for s in campaign.specimens),
        )


def _campaign(plan: Campaign, counts: IntArray, asked: Sequence[str]) -> Campaign:
    """Return the chosen conditions with a specimen a batch each."""
    specimens = tuple(
        replace(
            plan.specimens[place],
            id=f"D{number:02d}{'abcdefgh'[copy]}",
            batch=f"{copy % _BATCHES + 1}",
        )
        for number, place in enumerate(np.flatnonzero(counts).tolist(), start=1)
        for copy in range(int(counts[place]) * _BATCHES)
    )
    strain = virtual_strain(plan.palette, [m.id for m in _elastic(plan.palette)[0]])
    bars = any(s.profile is not None for s in specimens)
    held = any(s.protocol == "relaxation" for s in specimens)
    notes = (  # what the list of specimens does not say
        "DESIGNED by planner gap design; nothing is measured yet; "
        f"pull coupons to a strain of {strain:.3g}"
        f"{f', bars to {BAR_SHARE * strain:.3g}' if bars else ''}; "
        f"{f'relaxation holds for {HOLD_S:g} s; ' if held else ''}"
        "print each batch as one tray, and test in an order drawn by lot."
    )
    return replace(plan, name=f"to tell {', '.join(asked)} apart", specimens=specimens, notes=notes)


# ------------------------------------------------------------------------------------------------
# Tests that a lab could do next: one change from the reference each.


_PREPARATION_H = 0.5
"""A person's time for a specimen. Chosen: printing, cleaning, mounting."""

_WAITING_SHARE = 0.02
"""What an hour costs in which a specimen soaks or ages. Chosen: a day of waiting counts as half an
hour of work."""


@dataclass(frozen=True, slots=True)
class Trial:
    """A test: what differs from the reference, a specimen on its way, and the test's hours."""

    change: Mapping[str, Any]
    specimen: Specimen
    hours: float

    def experiment(self, splits: tuple[tuple[str, str], ...], gain_nats: float) -> Experiment:
        """Return the test as it is proposed, for what it splits and tells."""
        s, bar = self.specimen, self.specimen.profile
        cells: dict[str, Any] = {"material": s.material, "profile": None}
        cells |= {name: getattr(s, name) for name in SPECIMEN_COLUMNS}
        cells["protocol"] = f"{s.protocol} compression" if s.pushed else s.protocol
        cells["to_strain"] = _rounded(float(s.strain.max()))
        design: dict[str, tuple[float, ...]] = {}
        if bar is not None:
            cells["profile"] = f"profiles/{bar.name}.csv"
            design = {name: tuple(getattr(bar, name).tolist()) for name in ("x_mm", "coordinate")}
        row = {name: cell for name, cell in cells.items() if cell is not None}
        what = ", ".join(f"{name} {value}" for name, value in self.change.items())
        tests = f"{_BATCHES} {'compressed ' if s.pushed else ''}specimens with {what}"
        detail = f"{tests}, all else as where the palette was measured; about {self.hours:.1f} h"
        return Experiment(self.change, splits, gain_nats, self.hours, detail, _BATCHES, row, design)


def trials_of(campaign: Campaign, setup: Setup) -> tuple[Trial, ...]:
    """Return the candidate tests of a campaign, each of `_BATCHES` specimens, loaded like most.

    Raises
    ------
    PaletteError
        The palette has no elastic material.
    """
    pushed = 2 * sum(s.pushed for s in campaign.specimens) > len(campaign.specimens)
    alike = tuple(s for s in campaign.specimens if s.pushed is pushed)
    palette = campaign.palette
    reference = _usual_coupon(replace(campaign, specimens=alike), setup.reference)
    _, (soft, middle, hard) = _elastic(palette)
    known = reference | asdict(stated(setup.reference))
    ways: list[_Change] = [
        *(_changed(step, known) for steps in STEPS.values() for step in steps),
        *({"material": m.id} for m in (soft, middle, hard)),
        *({"material": m.id, "protocol": "cyclic"} for m in (soft, hard)),
        # A bar of two materials is pulled: pushed, its soft end gives way sideways.
        *([] if pushed else [{"profile": f"{soft.id}-to-{hard.id}"}]),
    ]
    trials = []
    for number, change in enumerate(ways):
        if all(reference.get(name) == value for name, value in change.items()):
            continue
        material, fields = change.get("material", reference["material"]), change
        strain = virtual_strain(palette, [material])
        if "profile" in change:
            ends = soft.coordinate, hard.coordinate
            bar = _striped(change["profile"], reference["gauge_mm"], *ends)
            strain, fields = virtual_strain(palette, ()), {"profile": bar, "material": None}
        specimen = _specimen(
            palette, reference, fields, id=f"trial-{number:02d}", strain=strain, steps=100,
            pushed=pushed,
        )  # fmt: skip
        # A test's specimens wait together.
        waiting = 24.0 * max((specimen.age_days or 0.0) - known["age_days"], 0.0)
        waiting += specimen.soak_h or 0.0
        hours = _BATCHES * (_PREPARATION_H + float(specimen.time_s[-1]) / 3600.0)
        trials.append(Trial(change, specimen, hours + _WAITING_SHARE * waiting))
    return tuple(trials)


def _usual_coupon(campaign: Campaign, own: Reference) -> dict[str, Any]:
    """Return the coupon most usual in material and size, as at the palette's conditions."""
    coupons = [s for s in campaign.specimens if s.material] or list(campaign.specimens)
    kinds = [(s.material, s.width_mm, s.thickness_mm, s.gauge_mm) for s in coupons]
    usual = coupons[kinds.index(max(kinds, key=kinds.count))]
    gauge_mm = usual.gauge_mm if usual.part is None else _USUAL_SIZE["gauge_mm"]
    own_per_s = own.strain_rate_per_s
    rate = usual.rate_mm_s if own_per_s is None else own_per_s * gauge_mm
    conditions = ("temperature_C", "soak_h", "age_days", "orientation")
    return {
        "material": usual.material or campaign.palette.materials[0].id,
        **{
            name: getattr(usual, name) or getattr(usual, f"measured_{name}") or _USUAL_SIZE[name]
            for name in ("width_mm", "thickness_mm")
        },
        "gauge_mm": gauge_mm,
        "rate_mm_s": rate or 1.0,
        **{name: getattr(own, name) for name in conditions},
        "protocol": "monotonic",
        "time_recorded": usual.time_recorded,
    }


# ------------------------------------------------------------------------------------------------
# Choose the tests that tell most per hour.


_TOLD_APART = 2.0
"""Standard deviations between what two hypotheses predict, at which a test splits them. Convention:
the usual level."""

_LEAST_SHARE = 0.02
"""Of the most probable one: hypotheses below it take no part, but for the second, which counts so
much. Numerical: each adds hardly more to what a test is expected to tell."""


def next_experiments(
    problem: Problem, weighed: Weighed, ranking: Sequence[Hypothesis]
) -> tuple[Experiment, ...]:
    """Return the three tests with the largest expected information per hour.

    The information is that between the hypothesis and the measured figures, among the most
    probable hypotheses at their best parameters. Tests are planned for elastomers: of rigid
    materials alone there is none to propose.
    """
    known = [h for h in ranking if h.effects != UNKNOWN and h.effects in weighed.best]
    least = _LEAST_SHARE * known[0].probability if known else 0.0
    known = [h for n, h in enumerate(known) if n < 2 or h.probability >= least]
    rigid = all(m.deformation != "elastic" for m in problem.campaign.palette.materials)
    if len(known) < 2 or rigid:
        return ()
    share = np.maximum([h.probability for h in known], least)
    share /= share.sum()
    candidates = [weighed.best[h.effects] for h in known]
    trials = trials_of(problem.campaign, problem.model.setup)
    found = []
    for trial, figures in zip(trials, _predicted(weighed, candidates, trials), strict=True):
        gain, distance = _information(*figures, share)
        pairs = combinations(range(len(known)), 2)
        splits = sorted(pairs, key=lambda p: -float(distance[p] * share[list(p)].min()))
        apart = [pair for pair in splits[:3] if distance[pair] > _TOLD_APART]
        named = tuple((known[a].name, known[b].name) for a, b in apart)
        found.append(trial.experiment(named, gain))
    found.sort(key=lambda e: -e.expected_gain_nats / e.hours)
    first: dict[str, Experiment] = {}  # what is planned for two reasons is one test
    for one in found:
        first.setdefault(str((sorted(one.row.items()), one.design)), one)
    return tuple(first.values())[:3]


def _predicted(
    weighed: Weighed, candidates: Sequence[Candidate], trials: Sequence[Trial]
) -> list[tuple[FloatArray, FloatArray]]:
    """Return, of each trial, the hypotheses' figures (K, d) and their covariance (d, d).

    Figures are means over the trial's specimens, which differ by their own scatter.
    """
    problem, specimens = weighed.plain.problem, tuple(t.specimen for t in trials)
    campaign = replace(problem.campaign, specimens=specimens, covariates=(), remarks=())
    model = ObservationModel(campaign)
    table, laws = model.table, model.laws
    calibrations = tuple(calibrations_of(problem.campaign.palette, model.setup))
    setups = [model.setup, *(calibration.applied(model.setup) for calibration in calibrations)]
    # One by one: a subset's gain holds for new specimens with the share it has of old ones.
    setups += [c.applied(model.setup) for c in candidates]
    raw = np.stack([model.predicted(predict(s, laws)) for s in setups])
    for k, candidate in enumerate(candidates):
        if candidate.members is not None and candidate.log_gain:
            raw[1 + len(calibrations) + k] *= np.exp(candidate.log_gain * candidate.members.mean())
    figures = table.transformed(raw)
    shared = calibration_columns(calibrations, figures[1 : 1 + len(calibrations)] - figures[0])
    known, sizes = _known_laws(weighed, candidates, calibrations)
    learned = figures[1 + len(calibrations) :] + sizes @ shared.T
    sensor = np.tile(np.nanmedian(problem.model.sensor_sd_N, axis=0), (len(trials), 1))
    features = NoisyFeatures(table, table.sensitivity(raw[0]), sensor, np.full(len(trials), -1))
    noise = features.noise(problem.scatter)
    return [
        (learned[:, rows], block / _BATCHES + shared[rows] @ known @ shared[rows].T)
        for rows, block in zip(noise.rows, noise.blocks, strict=True)
    ]


def _known_laws(
    weighed: Weighed, candidates: Sequence[Candidate], calibrations: Sequence[Calibration]
) -> tuple[FloatArray, FloatArray]:
    """Return what the campaign has taught about the trials' ways of being off.

    Materials that it tested are known much better than the palette says, and each hypothesis has
    its own idea of them: covariance (q, q), and sizes under each hypothesis (K, q), in deviations.
    """
    own, new = (
        {(one.material, one.kind): k for k, one in enumerate(of) if one.material}
        for of in (weighed.plain.problem.calibrations, calibrations)
    )
    at, taken = [new[key] for key in new if key in own], [own[key] for key in new if key in own]
    known = np.eye(len(calibrations))
    sizes = np.zeros((len(candidates), len(calibrations)))
    for row, candidate in zip(sizes, candidates, strict=True):
        mean, covariance = weighed.mode_of(candidate).likelihood.laws_off(candidate)
        row[at] = mean[taken]
        known[np.ix_(at, at)] = covariance[np.ix_(taken, taken)]
    return known, sizes


def _information(
    mean: FloatArray, covariance: FloatArray, share: FloatArray
) -> tuple[float, FloatArray]:
    """Return the mutual information in nats, and distances between hypotheses in deviations.

    It follows from pairs of hypotheses alone, between the bounds of Kolchinsky and Tracey (Entropy
    19, 361, 2017): to a tenth for two, and exactly where all are alike or all are far apart.
    """
    white = scipy.linalg.solve_triangular(np.linalg.cholesky(covariance), mean.T, lower=True).T
    squares = np.sum((white[:, None] - white[None]) ** 2, axis=2)
    # The bounds have a half and an eighth in place of a quarter.
    gain = -share @ np.log(np.exp(-0.25 * squares) @ share)
    return max(float(gain), 0.0), np.sqrt(squares)
