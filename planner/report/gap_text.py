"""A diagnosis in plain words: for the terminal, and above the figures of the report."""

import math
import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from planner.formats.tensile import SPECIMEN_COLUMNS
from planner.gap.diagnosis import (
    Detectable,
    Diagnosis,
    Experiment,
    FoundEffect,
    Gap,
    Hypothesis,
    QualityProblem,
    name_of,
)
from planner.gap.effects import EFFECTS

__all__ = [
    "TextSection",
    "axis_words",
    "headline",
    "listed",
    "meaning",
    "number_words",
    "p_value",
    "percent",
    "probability",
    "scope",
    "sentence",
    "setting",
    "title",
    "unit_of",
    "verdict_sections",
    "verdict_text",
]


# ------------------------------------------------------------------------------------------------
# Effects, axes and figures of a diagnosis in words.


_AXES: Mapping[str, str] = {
    **{name: column.title for name, column in SPECIMEN_COLUMNS.items()},
    "branch": "branch of the path",
    "material": "material or design",
    "position": "position along the bar",
    "specimen": "single specimens",
    "strain": "strain",
    "time": "time",
}

_UNITS: Mapping[str, str] = {
    "_mm_s": "mm/s", "_per_s": "1/s", "_MPa": "MPa", "_mm": "mm", "_days": "days", "_C": "°C",
    "_h": "h", "_s": "s", "_N": "N",
}  # fmt: skip


def title(effect: str) -> str:
    """Return the name that an effect has in a heading."""
    if effect == "unknown":
        return "something unknown"
    return EFFECTS[effect].title if effect in EFFECTS else effect


def axis_words(axis: str) -> str:
    """Return an axis in words; a column that planner does not know keeps its name."""
    return _AXES.get(axis, f"column {axis}")


def listed(words: Sequence[str], most: int | None = None, last: str = "and") -> str:
    """Write a list in a sentence, a long one in short."""
    if most is not None and len(words) > most:
        return f"{', '.join(words[:most])} {last} {len(words) - most} more"
    if len(words) < 2:
        return "".join(words)
    return f"{', '.join(words[:-1])} {last} {words[-1]}"


def percent(share: float, digits: int = 2) -> str:
    """Write a share in per cent: 0.214 is "21 %", 0.034 is "3.4 %"."""
    return f"{number_words(100.0 * share, digits)} %" if math.isfinite(share) else "open"


def number_words(value: float, digits: int = 3) -> str:
    """Write a figure with so many significant digits, whole numbers in full."""
    if not math.isfinite(value):
        return "open"
    if value == 0.0:
        return "0"
    rounded = float(f"{value:.{digits - 1}e}")
    power = math.floor(math.log10(abs(rounded)))
    if -4 <= power < 6:
        return f"{rounded:.{max(0, digits - 1 - power)}f}"
    mantissa, _, exponent = f"{rounded:.{digits - 1}e}".partition("e")
    return f"{mantissa}e{int(exponent)}"


def probability(value: float) -> str:
    """Write a probability without claiming certainty."""
    if value > 0.995:
        return "above 0.99"
    if value < 0.005:
        return "below 0.01"
    return f"{value:.2f}"


def p_value(p: float) -> str:
    """Write a p-value with one digit where it is small, which is all that it is known to."""
    return f"p = {number_words(p, 2 if p >= 0.01 else 1)}"


def setting(column: str, value: object) -> str:
    """Write what a specimen has on an axis: "temperature 35 °C", "material FLX9760"."""
    words, unit = axis_words(column), unit_of(column)
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return f"{words} {value:.4g} {unit}".rstrip()
    return f"{words} {value}"


def unit_of(column: str) -> str:
    """Return the unit that a column's name ends in, "" for none."""
    return next((unit for end, unit in _UNITS.items() if column.endswith(end)), "")


def sentence(words: str) -> str:
    """Return words with a capital and a full stop, unless they end in one or in a question."""
    words = words.strip()
    if words and words[0].islower() and "_" not in words.partition(" ")[0]:
        words = words[0].upper() + words[1:]
    return words if words.endswith((".", "?", "!")) else words + "."


# ------------------------------------------------------------------------------------------------
# How large the effects of a verdict are, and how large one had to be to be seen, in words.


_SPECIMENS = 6
_SEEN = 8
_LOG_STRESS = "of ln stress"


def _size_words(effects: Sequence[FoundEffect]) -> Iterator[str]:
    """Yield a sentence an effect: its parameters with their 90 % intervals."""
    for effect in effects:
        sizes = []
        for name, value in effect.parameters.items():
            unit = effect.units.get(name, "1")
            ends = effect.interval.get(name)
            words = meaning(effect.id, effect.form, name)
            within = "" if ends is None else f" (90 % interval {_span(name, words, unit, ends)})"
            sizes.append(f"{_label(name, words)} {_shown(name, words, unit, value)}{within}")
        of = ""
        if effect.specimens:
            of = f" (in {listed(effect.specimens, most=_SPECIMENS)} only)"
        form = f", as {effect.form}" if effect.form else ""
        yield f"{effect.id}{form}{of}: {'; '.join(sizes)}."


def _detectable_words(detectable: Sequence[Detectable]) -> Iterator[str]:
    """Yield the smallest size of each effect that would have been seen, the first few alone."""
    seen = [d for d in detectable if d.size is not None]
    for d in seen[:_SEEN]:
        words = meaning(d.id, "", d.parameter)
        assert d.size is not None
        size = _shown(d.parameter, words, d.unit, d.size)
        yield f"{d.id} from {_label(d.parameter, words)} {size}."
    if len(seen) > _SEEN:
        yield f"{len(seen) - _SEEN} more of these are in diagnosis.json."
    blind = [d.id for d in detectable if d.size is None]
    if blind:
        yield f"Not seen at any size that it may have: {listed(blind)}."


def meaning(effect: str, form: str, parameter: str) -> str:
    """Return what a parameter means, as the effect's form says it; "" where none does."""
    forms = EFFECTS[effect].forms if effect in EFFECTS else ()
    own_first = sorted(forms, key=lambda f: f.name != form)
    known = (p.meaning for one in own_first for p in one.parameters if p.name == parameter)
    return next(known, "")


def _shown(name: str, words: str, unit: str, value: float) -> str:
    """Return a value as a lab writes it: logarithms as ratios or per cent, units beside figures."""
    if name.startswith("log_"):
        return f"{number_words(math.exp(value))} times"
    if words.startswith(_LOG_STRESS):
        return f"{'+' if value > 0.0 else ''}{percent(math.expm1(value))}"
    return number_words(value) if unit in ("1", "") else f"{number_words(value)} {unit}"


def _label(name: str, words: str) -> str:
    """Name a parameter with its meaning, if that says more."""
    if name.startswith("log_"):
        name = name.removeprefix("log_")
        words = words.removeprefix("ln of ")
    elif words.startswith(_LOG_STRESS):
        words = "of stress" + words.removeprefix(_LOG_STRESS)
    if not words:
        return name
    if words.startswith(f"{name} "):
        return words
    return f"{name} {words}" if words.startswith("of ") else f"{name} ({words})"


def _span(name: str, words: str, unit: str, ends: tuple[float, float]) -> str:
    low, high = (_shown(name, words, unit, end) if math.isfinite(end) else "open" for end in ends)
    # A unit that both ends share is written once.
    for suffix in (f" {unit}", " %", " times"):
        if low.endswith(suffix) and high.endswith(suffix):
            return f"{low.removesuffix(suffix)} to {high}"
    return f"{low} to {high}"


# ------------------------------------------------------------------------------------------------
# The verdict in plain words: for the terminal, and above the figures of the report.


_WIDTH = 88
_INDENT = "  "
_PLACES = 3
_PROBLEMS = 6
_EXPERIMENTS = 3
_WORTH_NAMING = 0.05
_UNKNOWN_SHARE = 0.2
_SIGNIFICANT = 0.05
_UNIT = re.compile(r"(?<=\d) (?=(?:%|mm|N|K|°C|h|s|nats|days|times|decade)\b|%)")
_SURE = ((0.97, "almost certainly"), (0.85, "very likely"), (0.6, "probably"))


@dataclass(frozen=True, slots=True)
class TextSection:
    """A heading and the sentences below it; a list has each of them on its own."""

    heading: str
    sentences: tuple[str, ...]
    is_list: bool = False


def verdict_text(diagnosis: Diagnosis, *, width: int = _WIDTH) -> str:
    """Return the verdict as text: headings, indented sentences, no line wider than `width`."""
    lines = [*textwrap.wrap(headline(diagnosis), width), *textwrap.wrap(scope(diagnosis), width)]
    for section in verdict_sections(diagnosis):
        lines += ["", section.heading]
        blocks = section.sentences if section.is_list else (" ".join(section.sentences),)
        for block in blocks:
            lead = f"{_INDENT}- " if section.is_list else _INDENT
            follow = " " * len(lead)
            lines += textwrap.wrap(
                _UNIT.sub("\xa0", block),  # a figure and its unit stay on one line
                max(width, 20),
                initial_indent=lead,
                subsequent_indent=follow,
                break_on_hyphens=False,
            )
    return "\n".join(lines).replace("\xa0", " ")


def headline(diagnosis: Diagnosis) -> str:
    """Return the verdict in one line."""
    verdict = diagnosis.verdict
    words = {
        "none": "no gap that needs an explanation",
        "unknown": "a gap that no effect here explains",
    }.get(verdict, " + ".join(map(title, verdict.split("+"))))
    chance = probability(_best(diagnosis).probability)
    more = f": {words}" if words != verdict else ""
    return f"Verdict: {verdict} (probability {chance}){more}"


def verdict_sections(diagnosis: Diagnosis) -> tuple[TextSection, ...]:
    """Return the verdict section by section, those with nothing to say left out."""
    d = diagnosis
    sections = (
        TextSection("What it is", tuple(_what(d))),
        TextSection("How large it is", tuple(_size_words(d.effect)), is_list=True),
        TextSection("What would have been seen", tuple(_seen(d)), is_list=True),
        TextSection("Where it lies", tuple(_where(d)), is_list=True),
        TextSection("How far it closes", tuple(_how_far(d))),
        TextSection("What these data cannot tell apart", tuple(_same_class(d))),
        TextSection("What remains", tuple(_remainder(d))),
        TextSection("What could not be tested", tuple(_not_testable(d)), is_list=True),
        TextSection("Data to look at", tuple(_quality(d.data_quality)), is_list=True),
        TextSection("Limits of this campaign", tuple(map(sentence, d.limitations)), is_list=True),
        TextSection("What to test next", tuple(_next(d.next_experiments)), is_list=True),
    )
    return tuple(s for s in sections if s.sentences)


def scope(diagnosis: Diagnosis) -> str:
    """Return what was diagnosed, in one line."""
    d = diagnosis
    count = f"{d.specimens} specimen{'s' if d.specimens != 1 else ''}"
    tests = f"{d.tests} test{'s' if d.tests != 1 else ''}"
    return f"{d.campaign or 'campaign'}: {count} in {tests}, held against palette {d.palette}"


def _best(diagnosis: Diagnosis) -> Hypothesis:
    """Return the verdict with its probability, 0 where the ranking lacks it."""
    found = (h for h in diagnosis.ranking if h.name == diagnosis.verdict)
    return next(found, Hypothesis((), 0.0))


def _what(diagnosis: Diagnosis) -> Iterator[str]:
    best, effects = _best(diagnosis), diagnosis.verdict.split("+")
    sure = next((words for least, words in _SURE if best.probability >= least), None)
    clauses = "; and ".join(EFFECTS[e].clause if e in EFFECTS else e for e in effects)
    if diagnosis.verdict == "none":
        yield (
            "What was measured agrees with the palette within the scatter of specimens and the "
            "uncertainty of the palette's own calibration."
        )
    elif diagnosis.verdict == "unknown":
        yield (
            "The measurements differ from the palette in a way that none of the effects weighed "
            "here, alone or in pairs, reproduces."
        )
        yield "Look at where it lies before blaming any cause."
    elif sure is None:
        pair = " a pair" if len(effects) > 1 else ""
        yield f"No explanation is sure; the best is{pair}: {clauses}."
    elif len(effects) > 1:
        yield f"{len(effects)} effects are {sure} at work: {clauses}."
    else:
        yield f"The cause is {sure} this: {clauses}."
    if diagnosis.verdict != "unknown" and best.with_unknown >= _UNKNOWN_SHARE:
        yield (
            f"Even so, {percent(best.with_unknown)} of that probability asks for something "
            "unknown beside it."
        )
    others = [
        f"{h.name} ({probability(h.probability)})"
        for h in diagnosis.ranking
        if h.name != diagnosis.verdict and h.probability >= _WORTH_NAMING
    ]
    if others:
        yield f"Less probable, but not ruled out: {listed(others, most=4)}."


def _seen(diagnosis: Diagnosis) -> Iterator[str]:
    if diagnosis.verdict == "none":
        yield from _detectable_words(diagnosis.detectable)


def _where(diagnosis: Diagnosis) -> Iterator[str]:
    clear = [place for place in diagnosis.where if place.p < _SIGNIFICANT]
    for place in clear[:_PLACES]:
        low, high = place.share_interval
        detail = f": {place.detail}" if place.detail else ""
        yield sentence(
            f"{axis_words(place.axis)}, {percent(place.share)} of the gap beyond scatter "
            f"({percent(low)} to {percent(high)}, {p_value(place.p)}){detail}"
        )
    if len(clear) > _PLACES:
        yield sentence(f"also along {listed([axis_words(p.axis) for p in clear[_PLACES:]])}")
    if diagnosis.where and not clear:
        least = min(diagnosis.where, key=lambda place: place.p)
        yield (
            f"Along no axis beyond chance; the nearest to it is {axis_words(least.axis)} "
            f"({p_value(least.p)})."
        )


def _how_far(diagnosis: Diagnosis) -> Iterator[str]:
    gap, named = diagnosis.gap, diagnosis.named
    floor = ""
    if gap.floor is not None:
        floor = f"; replicates differ by {percent(gap.floor)}, which no model can beat"
    yield (
        f"The palette alone misses the force by {percent(gap.before)} of a test's largest, in root "
        f"mean square{floor}."
    )
    if gap.floor is None:
        yield (
            "There are no replicates to say how far any model could get, so how much of the gap "
            "closes cannot be said."
        )
    if gap.after is not None:
        yield _closed(gap, gap.after, named)
        if gap.held_out:
            yield sentence(f"Held out: {gap.held_out}")
    elif named:
        yield (
            "How far the effect closes it could not be checked on tests that it was not fitted "
            "to: this campaign has too few conditions to leave one out."
        )
    if named and gap.extrapolated is not None and gap.extrapolated_before is not None:
        worse = gap.extrapolated > gap.extrapolated_before
        yield (
            "Where whole levels are left out, so that the effect is carried beyond what was "
            f"tested, it misses by {percent(gap.extrapolated)}, and the palette alone by "
            f"{percent(gap.extrapolated_before)}"
            f"{': do not use it beyond the conditions tested' if worse else ''}."
        )
    baselines = [
        f"{percent(value)} {words}"
        for value, words in (
            (gap.recalibration_only, "after refitting the palette's laws without any effect"),
            (gap.generic, "with a flexible regression that knows no physics"),
        )
        if value is not None
    ]
    if baselines:
        yield f"For comparison: {listed(baselines)}."
    refitted = math.inf if gap.recalibration_only is None else gap.recalibration_only
    if named and gap.after is not None and not gap.negative_transfer and refitted <= gap.after:
        yield (
            "Refitting the laws does as well as the effect: what is off may be the palette, "
            "or what the effect does to all its materials alike."
        )


def _closed(gap: Gap, after: float, named: bool) -> str:
    model = "With the effect added" if named else "With the best explanation of each fold"
    misses = f"{model} it misses tests that took no part in the fit by {percent(after)}"
    if gap.negative_transfer:
        return f"{misses}: the effect makes predictions worse, so do not use it."
    if gap.closed is None:
        return f"{misses}."
    if gap.closed <= 0.0:
        return f"{misses}, which closes nothing."
    within = ""
    if gap.closed_interval is not None:
        low, high = gap.closed_interval
        within = f" (90 % interval {percent(low)} to {percent(high)})"
    return f"{misses}, which closes {percent(gap.closed)} of what can be closed{within}."


def _same_class(diagnosis: Diagnosis) -> Iterator[str]:
    others = [name for name in map(name_of, diagnosis.same_class) if name != diagnosis.verdict]
    if not others:
        return
    if diagnosis.verdict == "none":
        causes = [name for name in others if name != "unknown"]
        along = f"by {listed(causes, last='or')}" if causes else ""
        unknown = "along no known effect" if "unknown" in others else ""
        small = " or ".join(filter(None, (along, unknown)))
        yield f"These data do not exclude a small gap {small}."
    else:
        words = {"none": "no gap at all", "unknown": "an unknown cause"}
        named = listed([words.get(name, name) for name in others], last="or")
        what = "An unknown cause" if diagnosis.verdict == "unknown" else diagnosis.verdict
        yield f"{what} looks the same here as {named}; take them as one answer."
    splits = {tuple(sorted(pair)) for x in diagnosis.next_experiments for pair in x.splits}
    if any(tuple(sorted((diagnosis.verdict, other))) in splits for other in others):
        yield "The tests proposed below would split them."


def _remainder(diagnosis: Diagnosis) -> Iterator[str]:
    if not diagnosis.remainder:
        return
    yield f"{'Beside the effect, a' if diagnosis.named else 'A'} gap above scatter remains:"
    places = [
        f"along {axis_words(p.axis)} ({p_value(p.p)})"
        + (f", {p.detail.rstrip('.')}" if p.detail else "")
        for p in diagnosis.remainder
    ]
    yield "; ".join(places) + "."


def _not_testable(diagnosis: Diagnosis) -> Iterator[str]:
    reasons: dict[str, list[str]] = {}
    for untestable in diagnosis.not_testable:
        reasons.setdefault(untestable.reason, []).append(untestable.id)
    for reason, ids in reasons.items():
        yield f"{listed(ids)}{': ' + reason.rstrip('.') if reason else ''}."


def _quality(problems: tuple[QualityProblem, ...]) -> Iterator[str]:
    for q in problems[:_PROBLEMS]:
        yield sentence(f"{q.specimen or 'All specimens'}: {q.problem}")
    if len(problems) > _PROBLEMS:
        yield f"{len(problems) - _PROBLEMS} more of these are in diagnosis.json."


def _next(experiments: tuple[Experiment, ...]) -> Iterator[str]:
    for x in experiments[:_EXPERIMENTS]:
        change = listed([setting(key, value) for key, value in x.change.items()])
        what = x.detail.rstrip(".") or f"test with {change}"
        hours = f", about {number_words(x.hours, 2)} h" if x.hours > 0.0 and not x.detail else ""
        splits = listed([f"{a} from {b}" for a, b in x.splits], most=2)
        telling = f"tells {splits}; " if splits else ""
        gain = f"expected gain {number_words(x.expected_gain_nats, 2)} nats"
        yield sentence(f"{what} ({telling}{gain}{hours})")
