"""What a diagnosis says in three sentences, and its names and figures in words."""

import math
from collections.abc import Iterator, Mapping

from planner.formats.specimens import SPECIMEN_COLUMNS
from planner.gap.diagnosis import SIGNIFICANT, Diagnosis, Gap, Hypothesis, Location
from planner.gap.effects import EFFECTS

__all__ = [
    "axis_words",
    "best_of",
    "cause_words",
    "clear_places",
    "errors_of",
    "number_words",
    "p_value",
    "percent",
    "probability",
    "sentence",
    "summary_of",
    "unit_of",
]


# ------------------------------------------------------------------------------------------------
# Effects, axes and figures in words.


_AXES: Mapping[str, str] = {
    **{name: column.title for name, column in SPECIMEN_COLUMNS.items()},
    "branch": "the way of loading",
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


def _title(effect: str) -> str:
    """Return the name that an effect has in a heading."""
    names = {"none": "no gap", "unknown": "an unknown cause"}
    return EFFECTS[effect].title if effect in EFFECTS else names.get(effect, effect)


def cause_words(name: str) -> str:
    """Return a hypothesis in words: "no gap", "water uptake", "strain rate + water uptake"."""
    return " + ".join(_title(e) for e in name.split("+"))


def axis_words(axis: str) -> str:
    """Return an axis in words; a column that planner does not know keeps its name."""
    return _AXES.get(axis, f"column {axis}")


def unit_of(column: str) -> str:
    """Return the unit that a column's name ends in, "" for none."""
    return next((unit for end, unit in _UNITS.items() if column.endswith(end)), "")


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


def sentence(words: str) -> str:
    """Return words with a capital and a full stop, unless they end in one or in a question."""
    words = words.strip()
    if words and words[0].islower() and "_" not in words.partition(" ")[0]:
        words = words[0].upper() + words[1:]
    return words if words.endswith((".", "?", "!")) else words + "."


def errors_of(diagnosis: Diagnosis) -> Iterator[tuple[str, float]]:
    """Yield each error that is known with its name, what replicates differ by last."""
    gap = diagnosis.gap
    for words, error in (
        ("palette alone", gap.before),
        ("laws refitted, nothing added", gap.recalibration_only),
        ("regression without any physics", gap.generic),
        # Without an effect there is nothing to add, and the error is the palette's own.
        ("with the verdict's effects", gap.after if diagnosis.named else None),
        ("scatter between replicates", gap.floor),
    ):
        if error is not None:
            yield words, error


# ------------------------------------------------------------------------------------------------
# Three sentences: where the gap lies, what causes it, how far it closes once that is added.


_SURE = ((0.97, "almost certainly"), (0.85, "very likely"), (0.6, "probably"))
"""From which probability on a cause is told in which words. Convention: words for what is shown
beside as a figure."""


def summary_of(diagnosis: Diagnosis) -> tuple[str, str, str]:
    """Return where the gap lies, what causes it, and how far it closes once that is added."""
    return _where(diagnosis), _cause(diagnosis), _how_far(diagnosis)


def clear_places(diagnosis: Diagnosis) -> list[Location]:
    """Return the places of the gap that are beyond chance."""
    return [place for place in diagnosis.where if place.p < SIGNIFICANT]


def best_of(diagnosis: Diagnosis) -> Hypothesis:
    """Return the verdict with its probability, 0 where the ranking lacks it."""
    found = (h for h in diagnosis.ranking if h.name == diagnosis.verdict)
    return next(found, Hypothesis((), 0.0))


def _where(d: Diagnosis) -> str:
    if not d.where:
        return "Where a gap lies cannot be told, as there is nothing to compare."
    clear = clear_places(d)
    if clear:
        place = clear[0]
        detail = f": {place.detail}" if place.detail else ""
        what = "The clearest difference" if d.verdict == "none" else "The gap"
        if place.axis == "strain":  # what all specimens have in common, over strain
            return sentence(f"{what} shows on average over all specimens{detail}")
        return sentence(f"{what} goes with {axis_words(place.axis)}{detail}")
    if d.verdict == "none":
        return "No gap beyond chance goes with any condition that this campaign has."
    near = min(d.where, key=lambda place: place.p)
    return (
        "The gap goes with no single condition clearly enough to be more than chance; nearest to "
        f"it is {axis_words(near.axis)} ({p_value(near.p)})."
    )


def _cause(d: Diagnosis) -> str:
    best, effects = best_of(d), d.verdict.split("+")
    chance = f"probability {probability(best.probability)}"
    sure = next((words for least, words in _SURE if best.probability >= least), None)
    if d.verdict == "none":
        return (
            f"It {'needs' if sure else 'may need'} no cause ({chance}): what was measured agrees "
            "with the palette within the scatter of specimens and the doubt about the palette's "
            "own calibration."
        )
    if d.verdict == "unknown" and sure is None:
        return (
            f"No cause is sure; likeliest is one that none of the effects tested here stands for "
            f"({chance})."
        )
    if d.verdict == "unknown":
        return (
            f"The cause is unknown ({chance}): no effect that could be tested here explains what "
            "was measured, alone or with a second one."
        )
    clauses = "; and ".join(EFFECTS[e].clause if e in EFFECTS else e for e in effects)
    unsure = "No cause is sure; the likeliest"
    # Named causes together are the likeliest kind. A file may have no ranking.
    if any(h.name in ("none", "unknown") for h in d.ranking[:1]):
        named = sum(h.probability for h in d.ranking if h.name not in ("none", "unknown"))
        some = "that an effect tested here is at work has"
        unsure = f"No cause is sure: {some} probability {probability(named)}, and the likeliest"
    if len(effects) == 1:
        cause = f"The cause is {sure}" if sure else f"{unsure} is"
        return f"{cause} that {clauses} ({d.verdict}, {chance})."
    count = "Two" if len(effects) == 2 else "Three"
    cause = f"{count} causes are {sure} at work" if sure else f"{unsure} are {count.casefold()}"
    return f"{cause}: {clauses} ({d.verdict}, {chance})."


def _how_far(d: Diagnosis) -> str:
    gap = d.gap
    before = f"the palette misses the force by {percent(gap.before)} of a specimen's largest"
    if gap.floor is None:
        floor = "there are no replicates to say how much of that is scatter"
    else:
        floor = f"replicates differ by {percent(gap.floor)}"
    if gap.floor is not None and gap.before <= gap.floor and d.verdict == "none":
        return f"Nothing to explain: the prints repeat no better than this: {before}, and {floor}."
    if d.verdict == "none":
        within = ""
        if gap.floor is not None and gap.before > gap.floor and not d.remainder:
            within = "; what is beyond lies within the doubt about its calibration"
        return f"There is nothing to close: {before}, and {floor}{within}."
    if d.verdict == "unknown":
        return f"Nothing known closes it: {before}, and {floor}."
    if gap.after is None:
        return (
            "How far it closes cannot be checked, as no condition can be left out of the fit: "
            f"{before}, and {floor}."
        )
    added = "it is" if len(d.verdict.split("+")) == 1 else "they are"
    missed = f"{percent(gap.after)} of a specimen's largest force"
    if gap.negative_transfer:
        return (
            f"Once {added} added, tests that were left out of the fit are predicted worse, by "
            f"{missed} in place of {percent(gap.before)}: do not use it."
        )
    change = "falls" if gap.after < gap.before else "changes"
    return (
        f"Once {added} added, the error on tests that were left out of the fit {change} from "
        f"{percent(gap.before)} to {missed}; {floor}{_closed(gap, gap.after)}."
    )


def _closed(gap: Gap, after: float) -> str:
    if gap.floor is None:
        return ""
    if after <= gap.floor:
        return ", so that all is closed that can be"
    if gap.closed is None:
        return ", so that there is hardly a gap to close"
    if gap.closed <= 0.0:
        return ", so that nothing is closed"
    within = ""
    if gap.closed_interval is not None:
        low, high = (percent(min(max(end, 0.0), 1.0)) for end in gap.closed_interval)
        within = f" (90 % interval {low.removesuffix(' %')} to {high})"
    return f", so that {percent(min(gap.closed, 1.0))} of what can be closed is closed{within}"
