"""Optimal design: which specimens tell effects apart, and which test to do next."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise, product
from typing import Any

import numpy as np
import scipy.linalg
from scipy.special import logsumexp, ndtr
from threadpoolctl import threadpool_limits

from planner.errors import ArgumentError, PaletteError
from planner.gap.campaign import Campaign, Specimen
from planner.gap.diagnosis import Experiment, Hypothesis
from planner.gap.effect import Effect, stated, untestable
from planner.gap.effects import EFFECTS, effect_named, effects_for
from planner.gap.evidence.posterior import UNKNOWN, WIDTH_NATS, detectable_sizes
from planner.gap.evidence.problem import Problem, applied, set_up
from planner.gap.evidence.surrogate import (
    Candidate,
    Elimination,
    SignedForm,
    Whitened,
    interpolated_features,
    node_weights,
    whiten,
)
from planner.gap.evidence.weigh import Priors, Weighed
from planner.gap.noise import (
    Calibration,
    calibration_columns,
    calibrations,
    place_on_path,
    specimen_noise,
    step,
)
from planner.gap.observations import BRANCHES, observation_model
from planner.gap.quality import predicted_stress_MPa
from planner.gap.virtual import (
    BAR_SHARE,
    HOLD_S,
    synthetic_campaign,
    virtual_specimen,
    virtual_strain,
)
from planner.numerics import FloatArray, IntArray
from planner.palette import Material, Palette
from planner.simulation.bar import ProfileDesign
from planner.simulation.bar_solver import Setup, predict
from planner.simulation.simulate import loading_path

__all__ = [
    "BATCHES",
    "CampaignDesign",
    "Expected",
    "SpecimenSize",
    "Trial",
    "candidates_of",
    "design_campaign",
    "filled",
    "information",
    "may_take_bars",
    "next_experiments",
    "trials_of",
]


# ------------------------------------------------------------------------------------------------
# Conditions that a campaign may have: one step from the reference each, and a few crossed.


_Change = Mapping[str, Any]

_WARMER_K = (10.0, 17.0, -8.0)
_SOAKED_H = (4.0, 24.0, 72.0)
_OLDER_DAYS = (30.0, 110.0)
_FASTER = (10.0, 0.1)


@dataclass(frozen=True, slots=True)
class SpecimenSize:
    """Of the usual specimen's gauge section."""

    width_mm: float = 6.0
    thickness_mm: float = 3.0
    gauge_mm: float = 25.0


def may_take_bars(effects: Sequence[str]) -> bool:
    """Return whether graded bars are among the candidates."""
    return any("bars" in EFFECTS[id].changes for id in effects if id in EFFECTS)


def _strain_of(palette: Palette) -> float:
    """Return how far coupons are pulled, whichever of the palette's elastic materials are chosen.

    Raises
    ------
    PaletteError
        The palette has no elastic material.
    """
    return virtual_strain(palette, [m.id for m in _elastic(palette)])


def candidates_of(
    palette: Palette, effects: Sequence[str], size: SpecimenSize
) -> tuple[Specimen, ...]:
    """Return one planned specimen a condition, those at the palette's own conditions first.

    Every change is tried on the softest, a middle and the hardest elastic material, for effects
    may differ along the palette. Batches are left open.

    Raises
    ------
    PaletteError
        The palette has no elastic material.
    """
    grades = _elastic(palette)
    three = [grades[k] for k in dict.fromkeys([len(grades) // 2, 0, len(grades) - 1])]
    wanted = {group for id in effects for group in EFFECTS[id].changes}
    changes: list[_Change] = [{"material": m.id} for m in three]
    if "materials" in wanted:
        changes += [{"material": m.id} for m in grades if m.id not in {t.id for t in three}]
    base = _design_reference(palette, size)
    for group in _GROUPS:
        if group in wanted:
            steps = _design_steps(group, base, palette, size)
            changes += [{"material": m.id, **step} for step in steps for m in three]
    for first, second in _CROSSED:
        if {first, second} <= wanted:
            a, b = (_design_steps(g, base, palette, size)[0] for g in (first, second))
            changes.append({"material": three[0].id, **a, **b})
    if "bars" in wanted and len(grades) > 1:
        changes += _bars(grades, size, crossed="rate" in wanted)
    strain = _strain_of(palette)
    found = []
    for number, change in enumerate(changes):
        fields = {**base, **change}
        gauge = fields.pop("gauge_mm")
        if "rate_mm_s" not in change:  # a longer gauge, pulled at the same strain rate
            fields["rate_mm_s"] = _design_round(fields["rate_mm_s"] * gauge / size.gauge_mm)
        found.append(
            virtual_specimen(
                palette, id=f"C{number:03d}", gauge_mm=gauge, strain=strain, camera=True, **fields
            )
        )
    return tuple(found)


_GROUPS = (
    "rate", "relaxation", "temperature", "soak", "age", "orientation", "section", "gauge",
    "cyclic", "soak-section",
)  # fmt: skip
_CROSSED = (
    ("rate", "temperature"), ("temperature", "soak"), ("age", "soak"), ("rate", "cyclic"),
    ("temperature", "cyclic"),
)  # fmt: skip


def _design_reference(palette: Palette, size: SpecimenSize) -> dict[str, Any]:
    r = stated(palette.reference)
    assert r.strain_rate_per_s is not None
    return {
        "width_mm": size.width_mm,
        "thickness_mm": size.thickness_mm,
        "gauge_mm": size.gauge_mm,
        "rate_mm_s": _design_round(r.strain_rate_per_s * size.gauge_mm),
        "temperature_C": r.temperature_C,
        "soak_h": r.soak_h,
        "age_days": r.age_days,
        "orientation": r.orientation,
        "protocol": "monotonic",
    }


def _design_steps(
    group: str, base: Mapping[str, Any], palette: Palette, size: SpecimenSize
) -> list[dict[str, Any]]:
    """Return what to change of the reference, one step each."""
    match group:
        case "rate":
            return [{"rate_mm_s": _design_round(base["rate_mm_s"] * f)} for f in _FASTER]
        case "relaxation" | "cyclic":
            return [{"protocol": group}]
        case "temperature":
            return [{"temperature_C": base["temperature_C"] + k} for k in _WARMER_K]
        case "soak":
            return [{"soak_h": base["soak_h"] + h} for h in _SOAKED_H]
        case "soak-section":
            thin = {"thickness_mm": 0.5 * size.thickness_mm}
            return [{**thin, "soak_h": base["soak_h"] + _SOAKED_H[0]}, thin]
        case "age":
            return [{"age_days": base["age_days"] + d} for d in _OLDER_DAYS]
        case "orientation":
            return [{"orientation": o} for o in "zyx" if o != base["orientation"]]
        case "section":
            return [
                {"thickness_mm": 0.5 * size.thickness_mm},
                {"width_mm": _design_round(size.width_mm / 0.6)},
                {
                    "width_mm": _design_round(0.6 * size.width_mm),
                    "thickness_mm": 2.0 * size.thickness_mm,
                },
            ]
        case "gauge":
            return [{"gauge_mm": _design_round(1.8 * size.gauge_mm)}]
    raise AssertionError(group)


def _bars(grades: Sequence[Material], size: SpecimenSize, *, crossed: bool) -> list[_Change]:
    """Return bars of one step, of stripes, and of a ramp."""
    soft, middle, hard = (grades[k].coordinate for k in (0, len(grades) // 2, -1))
    gauge = size.gauge_mm
    half = np.array([0.0, 0.5, 0.5, 1.0]) * gauge
    edges = np.repeat(np.linspace(0.0, 1.0, 7), 2)[1:-1] * gauge
    designs = [
        ProfileDesign("step-middle-hard", half, np.repeat([middle, hard], 2)),
        ProfileDesign("step-soft-middle", half, np.repeat([soft, middle], 2)),
        ProfileDesign("stripes", edges, np.repeat([middle, hard] * 3, 2)),
        ProfileDesign("ramp", np.array([0.0, gauge]), np.array([soft, hard])),
    ]
    changes: list[_Change] = [{"profile": design} for design in designs]
    if crossed:
        changes.append({"profile": designs[0], "protocol": "relaxation"})
    return changes


def _elastic(palette: Palette) -> list[Material]:
    grades = [m for m in palette.materials if m.deformation == "elastic"]
    if not grades:
        raise PaletteError(
            f"palette {palette.name}: no elastic material; a campaign is planned for elastomers"
        )
    return grades


def _design_round(value: float) -> float:
    return float(f"{value:.3g}")


# ------------------------------------------------------------------------------------------------
# What a planned campaign would show of each effect, and what it could not tell apart.


_ALIKE = 0.95
"""Cosine of patterns above which two effects are one to the diagnosis."""

_SHAPES = (-1.0, 0.0, 1.0)
_FIELD = BRANCHES.index("field")


@dataclass(frozen=True, slots=True)
class Expected:
    """What is to be expected of one effect.

    Attributes
    ----------
    parameter, unit
        Of its first form's size.
    smallest
        That would be named rather than no effect; None if not even the largest would.
    usual
        The middle of its prior.
    probability
        That an effect of this size is named, no other beside it.
    alike
        Effects of those that were asked for whose pattern is the same to 0.95.
    others
        Further effects of the library of which that is true.
    """

    id: str
    parameter: str
    unit: str
    smallest: float | None
    usual: float
    probability: float
    alike: tuple[str, ...]
    others: tuple[str, ...]


def _usual_place(branch: SignedForm) -> list[float]:
    """Return the place of a branch at the middle of its form's prior."""
    size = branch.form.size
    return [float(np.sqrt(size.usual / size.high)), *[0.0] * branch.shapes]


def _usual_patterns(problem: Problem, ids: Sequence[str]) -> FloatArray:
    """Return whitened patterns of effects at the middle of their priors, (N, k).

    Every form has one, all forms of an effect together weighing as one.
    """
    nodes = problem.whitened.columns[:, problem.nodes]
    patterns = []
    for id in ids:
        branches = [b for b in problem.branches if b.effect.id == id and b.sign > 0.0]
        for b in branches:
            own = nodes[:, b.first : b.first + b.nodes]
            patterns.append(own @ node_weights(b, _usual_place(b)) / np.sqrt(len(branches)))
    return np.stack(patterns, axis=1)


def _batch_level(problem: Problem) -> FloatArray:
    """Return the whitened pattern of a batch one deviation off, (N,)."""
    force = np.where(problem.table.branch == _FIELD, 0.0, problem.sensitivity)
    return whiten((problem.scatter.batch * force)[:, None], problem.noise, 0).columns[:, 0]


def _elimination_of(problem: Problem, weight: FloatArray, batches: int) -> Elimination:
    """Return inner products with nuisances integrated out, batches among them.

    Parameters
    ----------
    weight : (n,)
        How many specimens there are of each condition, spread evenly over the batches.
    """
    gram = problem.whitened.gram(weight)
    level = _batch_level(problem)
    rows = np.repeat(weight, np.diff(problem.whitened.first_row)) / batches
    cross = np.tile((rows * level) @ problem.whitened.columns, (batches, 1))
    own = np.eye(batches) * float((rows * level) @ level)
    return gram.eliminate(extra=(cross, own))


def _expected_of(
    problem: Problem, elimination: Elimination, asked: Sequence[str], testable: Sequence[str]
) -> tuple[Expected, ...]:
    """Return what to expect of the effects that were asked for.

    An effect is named if its expected evidence makes up for the odds against it and beats that of
    every other testable effect at its best parameters; both are taken to be normally distributed
    about what is expected.
    """
    priors = Priors()
    sizes = {d.id: d for d in detectable_sizes(problem, elimination, priors)}
    needed = float(np.log(priors.none * len(testable) / priors.single)) + WIDTH_NATS
    m = elimination.products[problem.nodes, problem.nodes]
    rivals = {id: _combinations(problem, id) for id in testable}
    found = []
    for id in asked:
        first = next(b for b in problem.branches if b.effect.id == id)
        pattern = np.zeros(len(m))
        pattern[first.first : first.first + first.nodes] = node_weights(first, _usual_place(first))
        length2 = float(pattern @ m @ pattern)
        named = float(ndtr(np.sqrt(length2) - np.sqrt(2.0 * needed)))
        cosines = _cosines(m, pattern, length2, {k: v for k, v in rivals.items() if k != id})
        for cosine in cosines.values():
            left = length2 * (1.0 - min(cosine, 1.0) ** 2)
            named = min(named, float(ndtr(0.5 * np.sqrt(max(left, 0.0)))))
        size = first.form.size
        alike = tuple(k for k, cosine in cosines.items() if cosine > _ALIKE)
        found.append(
            Expected(
                id=id,
                parameter=size.name,
                unit=size.unit,
                smallest=sizes[id].size,
                usual=size.usual,
                probability=named,
                alike=tuple(k for k in alike if k in asked),
                others=tuple(k for k in alike if k not in asked),
            )
        )
    return tuple(found)


def _combinations(problem: Problem, id: str) -> FloatArray:
    """Return combinations of nodes that stand for an effect: sizes, shapes, forms, signs."""
    total = problem.nodes.stop - problem.nodes.start
    rows = []
    for b in problem.branches:
        if b.effect.id != id:
            continue
        for size in (max(b.least, 0.3), _usual_place(b)[0], 1.0):
            for shape in product(_SHAPES, repeat=b.shapes):
                row = np.zeros(total)
                row[b.first : b.first + b.nodes] = node_weights(b, [size, *shape])
                rows.append(row)
    return np.array(rows)


def _cosines(
    m: FloatArray, pattern: FloatArray, length2: float, rivals: Mapping[str, FloatArray]
) -> dict[str, float]:
    """Return how alike each rival can be, nuisances projected out."""
    along = m @ pattern
    found = {}
    for id, rows in rivals.items():
        lengths = np.einsum("ki,ij,kj->k", rows, m, rows, optimize=True)
        usable = lengths > 1e-9
        if not usable.any() or length2 <= 0.0:
            continue
        cosines = (rows @ along)[usable] / np.sqrt(lengths[usable] * length2)
        found[id] = float(cosines.max())
    return found


# ------------------------------------------------------------------------------------------------
# Choosing conditions one after the other, so that they tell most of every effect.


_ROUNDS = 2
"""A condition is chosen so often at most."""


def _information_of_pairs(problem: Problem, asked: Sequence[str], copies: int) -> FloatArray:
    """Return what one condition of each candidate tells, (candidates, X, X).

    Inner products of the effects' patterns at their usual size, one a form, then of all
    nuisances: calibration of the laws, courses, and the level that the batches share.

    Parameters
    ----------
    copies
        Specimens of a condition, one a batch.
    """
    patterns = _usual_patterns(problem, asked)
    nuisances = problem.whitened.columns[:, -problem.whitened.nuisances :]
    # The mean level of batches is what all conditions share.
    level = _batch_level(problem)[:, None] / np.sqrt(copies)
    whole = Whitened(
        np.concatenate([patterns, nuisances, level], axis=1),
        problem.whitened.first_row,
        nuisances.shape[1] + 1,
    )
    edges = whole.first_row.tolist()
    parts = [whole.columns[a:b].T @ whole.columns[a:b] for a, b in pairwise(edges)]
    return copies * np.stack(parts)


def information(pairs: FloatArray, counts: IntArray, forms: Sequence[int]) -> float:
    """Return what chosen conditions tell of the effects in nats, the other effects being possible.

    Of each effect ln det of the information on its forms' sizes, all else being uncertain by a
    prior deviation of 1; an effect of many forms weighs no more than another.

    Parameters
    ----------
    pairs : (candidates, X, X)
        Of `_information_of_pairs`, effects first.
    counts : (candidates,)
        How often each is chosen.
    forms
        How many patterns each effect has.
    """
    total = np.tensordot(counts.astype(np.float64), pairs, axes=1)
    total[np.diag_indices(len(total))] += 1.0
    factor = scipy.linalg.cho_factor(total, lower=True, check_finite=False)
    inverse = scipy.linalg.cho_solve(factor, np.eye(len(total), sum(forms)), check_finite=False)
    told, first = 0.0, 0
    for count in forms:
        own = inverse[first : first + count, first : first + count]
        told -= 0.5 * float(np.linalg.slogdet(own)[1]) / count
        first += count
    return told


def _testable(problem: Problem, pairs: FloatArray, effects: Sequence[Effect]) -> IntArray:
    """Return how often to choose each candidate, so that every effect can be tested at all.

    The first candidate, at the palette's own conditions, is among them.
    """
    campaign = problem.campaign
    forms = [len(e.forms) for e in effects]
    counts: IntArray = np.zeros(len(campaign.specimens), dtype=np.int64)
    counts[0] = 1

    def lacking(chosen: IntArray) -> int:
        some = tuple(campaign.specimens[k] for k in np.flatnonzero(chosen))
        trial = replace(campaign, specimens=some)
        return sum(untestable(e, trial) is not None for e in effects)

    while missing := lacking(counts):
        steps = list(_choice_steps(counts, 1))
        better = [step for step in steps if lacking(step) < missing] or steps
        if not better:
            break
        counts = _best(better, pairs, forms)
    return counts


def filled(counts: IntArray, conditions: int, pairs: FloatArray, forms: Sequence[int]) -> IntArray:
    """Return the choice with as many more as make up a number of conditions."""
    while counts.sum() < conditions and (steps := list(_choice_steps(counts, _ROUNDS))):
        counts = _best(steps, pairs, forms)
    return counts


def _choice_steps(counts: IntArray, most: int) -> Iterator[IntArray]:
    """Yield every choice with one condition more."""
    for place in np.flatnonzero(counts < most).tolist():
        more = counts.copy()
        more[place] += 1
        yield more


def _best(steps: Sequence[IntArray], pairs: FloatArray, forms: Sequence[int]) -> IntArray:
    """Return the first of the steps that tell most."""
    # Rounded, so that the last bits of another machine choose no other condition.
    told = [round(information(pairs, step, forms), 6) for step in steps]
    return steps[told.index(max(told))]


# ------------------------------------------------------------------------------------------------
# A campaign that tells effects apart, within a budget of specimens.


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
    size: SpecimenSize | None = None,
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
    asked = tuple(effect_named(id, library, "`effects`").id for id in effects)
    size = SpecimenSize() if size is None else size
    _check(asked, budget, size)
    # Small matrices: more threads only change the last digits.
    with threadpool_limits(1, user_api="blas"):
        return _designed(palette, library, asked, budget, printer, size, progress)


def _check(asked: Sequence[str], budget: int, size: SpecimenSize) -> None:
    if not asked:
        raise ArgumentError("`effects`: none; name those to tell apart, as in rate,moisture")
    double = next((id for id in asked if asked.count(id) > 1), None)
    if double is not None:
        raise ArgumentError(f"`effects`: {double} stands twice; name each effect once")
    if budget > _MOST:
        raise ArgumentError(f"`budget` {budget}: it must be at most {_MOST} specimens")
    for name in ("width_mm", "thickness_mm", "gauge_mm"):
        value = getattr(size, name)
        if not 0.1 <= value <= 1000.0:
            raise ArgumentError(f"`{name}` {value:g}: it must be from 0.1 to 1000")


def _designed(
    palette: Palette,
    library: Mapping[str, Effect],
    asked: Sequence[str],
    budget: int,
    printer: str,
    size: SpecimenSize,
    progress: Callable[[str], None] | None,
) -> CampaignDesign:
    say = progress or (lambda what: None)
    candidates = candidates_of(palette, asked, size)
    say("forward model of all candidates")
    problem = _problem(palette, printer, candidates, tuple(library.values()))
    say("choosing conditions")
    pairs = _information_of_pairs(problem, asked, BATCHES)
    counts = _testable(problem, pairs, [library[id] for id in asked])
    least = BATCHES * int(counts.sum())
    if budget < least:
        raise ArgumentError(
            f"`budget` {budget}: too few specimens to test {', '.join(asked)}: it takes at least "
            f"{least}, {least // BATCHES} conditions in {BATCHES} batches; raise the budget, or "
            "ask for fewer effects"
        )
    counts = filled(counts, budget // BATCHES, pairs, [len(library[id].forms) for id in asked])
    campaign = _campaign(palette, printer, candidates, counts, asked)
    testable_ids = [id for id, e in library.items() if untestable(e, campaign) is None]
    elimination = _elimination_of(problem, BATCHES * counts.astype(np.float64), BATCHES)
    return CampaignDesign(
        campaign=campaign,
        expected=_expected_of(problem, elimination, asked, testable_ids),
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
    made = synthetic_campaign(plan, (), np.random.default_rng(0), scatter=0.0)
    made = replace(made, covariates=())
    return set_up(made, observation_model(made), effects)


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
        notes=_instructions(specimens, _strain_of(palette)),
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


# ------------------------------------------------------------------------------------------------
# Tests that a lab could do next: one change from the reference each.


_PREPARATION_H = 0.5
"""Printing, cleaning, mounting: of a person's time, a specimen."""

_WAITING_SHARE = 0.02
"""Of an hour in which a specimen soaks or ages, what it costs."""

_STRAIN = 0.3


@dataclass(frozen=True, slots=True)
class Trial:
    """A test: what differs from the reference, the specimen as if tested, and its hours."""

    change: Mapping[str, Any]
    specimen: Specimen
    hours: float


def trials_of(campaign: Campaign, setup: Setup) -> tuple[Trial, ...]:
    """Return the candidate tests of a campaign, each of one specimen."""
    reference = _next_reference(campaign, setup)
    grades = [m for m in campaign.palette.materials if m.deformation == "elastic"]
    soft, middle, hard = grades[0].id, grades[len(grades) // 2].id, grades[-1].id
    r = setup.reference
    rate = reference.rate_mm_s or 1.0
    usual: Any = stated(r)
    temperature, soak, age = usual.temperature_C, usual.soak_h, usual.age_days
    width, thickness = reference.width_mm or 6.0, reference.thickness_mm or 3.0
    changes: list[dict[str, Any]] = [
        {"protocol": "monotonic"},
        {"rate_mm_s": _next_round(rate * 10.0)},
        {"rate_mm_s": _next_round(rate / 10.0)},
        {"temperature_C": temperature + 15.0},
        {"temperature_C": temperature - 8.0},
        {"soak_h": soak + 24.0},
        {"age_days": age + 60.0},
        {"orientation": "z" if (r.orientation or "x") != "z" else "x"},
        {"orientation": "y" if (r.orientation or "x") != "y" else "x"},
        {"width_mm": 2.0 * width},
        {"thickness_mm": 0.5 * thickness},
        {"gauge_mm": _next_round(1.8 * reference.gauge_mm)},
        {"protocol": "cyclic"},
        {"protocol": "relaxation"},
        {"material": soft},
        {"material": middle},
        {"material": hard},
        {"material": soft, "protocol": "cyclic"},
        {"material": hard, "protocol": "cyclic"},
        {"profile": f"{soft} to {hard} in one step, strain along the bar"},
    ]
    trials = []
    for number, change in enumerate(changes):
        if all(getattr(reference, k, None) == v for k, v in change.items()):
            continue
        specimen = _specimen(reference, change, number, campaign.palette, soft, hard)
        trials.append(Trial(change, specimen, _hours(specimen, age)))
    return tuple(trials)


def _trial_campaign(campaign: Campaign, trials: tuple[Trial, ...]) -> Campaign:
    """Return the trials as a campaign, measured as the palette predicts."""
    specimens = tuple(t.specimen for t in trials)
    return replace(campaign, specimens=specimens, covariates=(), remarks=())


def _next_reference(campaign: Campaign, setup: Setup) -> Specimen:
    """Return the coupon that stands nearest to the palette's conditions, most usual in size."""
    r = setup.reference
    coupons = [s for s in campaign.specimens if s.profile is None] or list(campaign.specimens)

    def departures(s: Specimen) -> int:
        rate = None if s.rate_mm_s is None else s.rate_mm_s / s.gauge_mm
        near = (
            rate is None
            or r.strain_rate_per_s is None
            or (abs(np.log(rate / r.strain_rate_per_s)) < 0.3)
        )
        same = sum(
            getattr(s, name) not in (None, getattr(r, name))
            for name in ("temperature_C", "soak_h", "age_days", "orientation")
        )
        sizes = [(o.width_mm, o.thickness_mm, o.gauge_mm) for o in coupons]
        usual = max(set(sizes), key=sizes.count)
        return int(not near) + same + int((s.width_mm, s.thickness_mm, s.gauge_mm) != usual)

    best = min(coupons, key=departures)
    rate = best.rate_mm_s
    if r.strain_rate_per_s is not None:
        rate = r.strain_rate_per_s * best.gauge_mm
    return replace(
        best,
        profile=None,
        material=best.material or campaign.palette.materials[0].id,
        measured_width_mm=None,
        measured_thickness_mm=None,
        width_mm=best.width_mm or best.measured_width_mm or 6.0,
        thickness_mm=best.thickness_mm or best.measured_thickness_mm or 3.0,
        rate_mm_s=rate or 1.0,
        temperature_C=r.temperature_C,
        soak_h=r.soak_h,
        age_days=r.age_days,
        orientation=r.orientation,
        protocol="monotonic",
        strain_field=None,
        covariates={},
        batch=None,
    )


def _specimen(
    reference: Specimen,
    change: Mapping[str, Any],
    number: int,
    palette: Palette,
    soft: str,
    hard: str,
) -> Specimen:
    fields = {k: v for k, v in change.items() if k != "profile"}
    specimen = replace(reference, id=f"trial-{number:02d}", **fields)
    scale = specimen.gauge_mm / reference.gauge_mm
    rate = (specimen.rate_mm_s or 1.0) * (scale if "rate_mm_s" not in change else 1.0)
    strain = min(_STRAIN, 0.6 * palette.resolve(specimen.material or soft).elongation_at_break)
    if "profile" in change:
        x = np.array([0.0, 0.5, 0.5, 1.0]) * specimen.gauge_mm
        ends = [palette.resolve(soft).coordinate, palette.resolve(hard).coordinate]
        design = ProfileDesign("step", x, np.repeat(ends, 2))
        specimen = replace(specimen, material=None, profile=design)
        strain = 0.5 * _STRAIN
    path = loading_path(
        specimen.protocol or "monotonic",
        to_displacement_mm=strain * specimen.gauge_mm,
        rate_mm_s=rate,
        hold_s=HOLD_S,
    )
    area = (specimen.width_mm or 1.0) * (specimen.thickness_mm or 1.0)
    at = np.maximum(path.displacement_mm / specimen.gauge_mm, 1e-9)
    force = predicted_stress_MPa(specimen, palette, at) * area
    return replace(
        specimen,
        rate_mm_s=rate,
        time_s=path.time_s,
        displacement_mm=path.displacement_mm,
        force_N=force,
    )


def _hours(specimen: Specimen, least_days: float) -> float:
    test_h = float(specimen.time_s[-1]) / 3600.0
    waiting = (specimen.soak_h or 0.0) + 24.0 * max((specimen.age_days or 0.0) - least_days, 0.0)
    return _PREPARATION_H + test_h + _WAITING_SHARE * waiting


def _next_round(value: float) -> float:
    return float(f"{value:.3g}")


# ------------------------------------------------------------------------------------------------
# Choose the tests that tell most per hour.


_HYPOTHESES = 6
_DRAWS = 64
_TOLD_APART = 2.0
"""Standard deviations between what two hypotheses predict, at which a test splits them."""

_LEAST_SHARE = 0.02
"""No hypothesis among those weighed is taken to be less probable than this: a test that would
overturn the verdict is worth something."""


def next_experiments(
    problem: Problem, weighed: Weighed, ranking: Sequence[Hypothesis], rng: np.random.Generator
) -> tuple[Experiment, ...]:
    """Return the three tests with the largest expected information per hour.

    The information is that between the hypothesis and the measured figures, by sampling, among the
    most probable hypotheses at their best parameters.
    """
    known = [h for h in ranking if h.effects != UNKNOWN and h.effects in weighed.best]
    known = known[:_HYPOTHESES]
    if len(known) < 2:
        return ()
    share = np.maximum([h.probability for h in known], _LEAST_SHARE)
    share /= share.sum()
    candidates = [weighed.best[h.effects] for h in known]
    trials = trials_of(problem.campaign, problem.observed.setup)
    means, covariances = _predicted(problem, candidates, trials)
    found = []
    widest = max(mean.shape[1] for mean in means)
    noise = rng.standard_normal((len(known) * _DRAWS, widest))
    for trial, mean, covariance in zip(trials, means, covariances, strict=True):
        gain, distance = _information(mean, covariance, share, noise)
        splits = sorted(
            combinations(range(len(known)), 2),
            key=lambda p: -float(distance[p] * share[list(p)].min()),
        )
        named = tuple(
            (_name(known[a]), _name(known[b]))
            for a, b in splits[:3]
            if distance[a, b] > _TOLD_APART
        )
        found.append(Experiment(dict(trial.change), named, gain, trial.hours, _detail(trial)))
    found.sort(key=lambda e: -e.expected_gain_nats / e.hours)
    return tuple(found[:3])


def _predicted(
    problem: Problem, candidates: Sequence[Candidate], trials: Sequence[Trial]
) -> tuple[list[FloatArray], list[FloatArray]]:
    """Return, of each trial, the hypotheses' figures (K, d) and their covariance (d, d)."""
    observed = observation_model(_trial_campaign(problem.campaign, tuple(trials)))
    table, laws = observed.table, observed.laws
    ways = calibrations(problem.campaign.palette, observed.setup)
    setups = [observed.setup, *(way.applied(observed.setup, step(way)) for way in ways)]
    # One by one: a subset's gain holds for new specimens with the share it has of old ones.
    setups += [applied(c, observed.setup) for c in candidates]
    raw = np.stack([observed.predicted(predict(s, laws)) for s in setups])
    for k, candidate in enumerate(candidates):
        if candidate.members is not None and candidate.log_gain:
            raw[1 + len(ways) + k] *= np.exp(candidate.log_gain * candidate.members.mean())
    figures = table.transformed(raw)
    shared = calibration_columns(ways, figures[1 : 1 + len(ways)], figures[0])
    known, sizes = _known_laws(problem, candidates, ways)
    learned = figures[1 + len(ways) :] + sizes @ shared.T
    sensor = np.full(len(trials), float(np.median(problem.observed.sensor_sd_N)))
    path = place_on_path(table, observed.setup.time_s.shape[1] - 1)
    noise = specimen_noise(
        table, table.sensitivity(raw[0]), problem.scatter, sensor, np.full(len(trials), -1), path
    )
    by_specimen = dict(zip(np.unique(table.specimen).tolist(), range(len(noise.rows)), strict=True))
    means, covariances = [], []
    for place in range(len(trials)):
        rows = noise.rows[by_specimen[place]]
        means.append(learned[:, rows])
        own = noise.blocks[by_specimen[place]]
        covariances.append(own + shared[rows] @ known @ shared[rows].T)
    return means, covariances


def _known_laws(
    problem: Problem, candidates: Sequence[Candidate], ways: Sequence[Calibration]
) -> tuple[FloatArray, FloatArray]:
    """Return what the campaign has taught about the trials' ways of being off.

    Materials that it tested are known much better than the palette says, and each hypothesis has
    its own idea of them: covariance (q, q), and sizes under each hypothesis (K, q), in deviations.
    """
    white = problem.whitened
    kept = white.columns.shape[1] - white.nuisances
    j = white.columns[:, kept:]
    inverse = np.linalg.inv(j.T @ j + np.eye(j.shape[1]))
    by_name = {(way.material, way.kind): k for k, way in enumerate(problem.ways) if way.material}
    pairs = [(k, by_name.get((way.material, way.kind))) for k, way in enumerate(ways)]
    at = [k for k, of in pairs if of is not None]
    taken = [of for _, of in pairs if of is not None]
    known = np.eye(len(ways))
    known[np.ix_(at, at)] = inverse[np.ix_(taken, taken)]
    sizes = np.zeros((len(candidates), len(ways)))
    nodes = white.columns[:, problem.nodes]
    for row, candidate in zip(sizes, candidates, strict=True):
        left = white.columns[:, 0] - interpolated_features(candidate, nodes.T)
        if candidate.members is not None:
            left -= white.columns[:, problem.gains] @ (candidate.log_gain * candidate.members)
        row[at] = (inverse @ (j.T @ left))[taken]
    return known, sizes


def _information(
    mean: FloatArray, covariance: FloatArray, share: FloatArray, noise: FloatArray
) -> tuple[float, FloatArray]:
    """Return the mutual information in nats, and distances between hypotheses in deviations."""
    factor = np.linalg.cholesky(covariance)
    white = scipy.linalg.solve_triangular(factor, mean.T, lower=True).T
    distance = np.sqrt(np.sum((white[:, None] - white[None]) ** 2, axis=2))
    count, d = white.shape
    drawn = np.repeat(white, _DRAWS, axis=0) + noise[:, :d]
    log = -0.5 * np.sum((drawn[:, None] - white[None]) ** 2, axis=2) + np.log(share)
    own = log[np.arange(count * _DRAWS), np.repeat(np.arange(count), _DRAWS)]
    gain = own - logsumexp(log, axis=1) - np.repeat(np.log(share), _DRAWS)
    # Of a sample it may come out below nought, which information is not.
    return max(float(np.repeat(share, _DRAWS) @ gain / _DRAWS), 0.0), distance


def _name(hypothesis: Hypothesis) -> str:
    return "+".join(hypothesis.effects) or "none"


def _detail(trial: Trial) -> str:
    what = ", ".join(f"{name} {value}" for name, value in trial.change.items())
    return f"one specimen of the usual kind with {what}; about {trial.hours:.1f} h"
