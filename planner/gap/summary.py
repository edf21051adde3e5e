"""A diagnosis in words, three sentences and figures; where a campaign stands, what comes next."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from shlex import quote
from typing import Any

from planner.errors import ArgumentError, PlannerError, refused
from planner.formats.files import path_within
from planner.formats.specimens import SPECIMEN_COLUMNS
from planner.formats.tensile import read_tensile
from planner.gap.campaign import named
from planner.gap.campaign_folder import CURVES, SPECIMENS, has_curves, read_campaign_file, read_list
from planner.gap.diagnosis import SIGNIFICANT, Diagnosis, Gap, Hypothesis, Location, read_diagnosis
from planner.gap.effects import EFFECTS
from planner.glance import format_number, one_line

__all__ = [
    "Standing",
    "axis_words",
    "best_of",
    "campaign_standing",
    "clear_places",
    "next_command",
    "number_words",
    "p_value",
    "percent",
    "probability",
    "sentence",
    "summary_of",
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


def axis_words(axis: str) -> str:
    """Return an axis in words; a column that planner does not know keeps its name."""
    return _AXES.get(axis, f"column {axis}")


def percent(share: float) -> str:
    """Write a share in per cent: 0.214 is "21 %", 0.034 is "3.4 %"."""
    return f"{number_words(100.0 * share, 2)} %" if isfinite(share) else "open"


def number_words(value: float, digits: int = 3) -> str:
    """Write a figure with so many significant digits; an open end of an interval is "open"."""
    return format_number(float(f"{value:.{digits - 1}e}"), digits) if isfinite(value) else "open"


def probability(value: float) -> str:
    """Write a probability without claiming certainty."""
    if value > 0.995:
        return "above 0.99"
    return "below 0.01" if value < 0.005 else f"{value:.2f}"


def p_value(p: float) -> str:
    """Write a p-value with one digit where it is small, which is all that it is known to."""
    return number_words(p, 2 if p >= 0.01 else 1)


def sentence(words: str) -> str:
    """Return words with a capital and a full stop, unless they end in one or in a question."""
    words = words.strip()
    if words and words[0].islower() and "_" not in words.partition(" ")[0]:
        words = words[0].upper() + words[1:]
    return words if words.endswith((".", "?", "!")) else words + "."


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
    return next((h for h in diagnosis.ranking if h.name == diagnosis.verdict), Hypothesis((), 0.0))


def _where(d: Diagnosis) -> str:
    if not d.where:
        return "Where a gap lies cannot be told, as there is nothing to compare."
    if clear := clear_places(d):
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
        f"it is {axis_words(near.axis)} (p = {p_value(near.p)})."
    )


def _cause(d: Diagnosis) -> str:
    best, effects = best_of(d), d.verdict.split("+")
    chance = f"probability {probability(best.probability)}"
    sure = next((words for least, words in _SURE if best.probability >= least), None)
    if d.verdict == "none" and d.remainder:
        return (
            f"No cause that could be tested is likelier than none ({chance}), but a gap along "
            f"{axis_words(d.remainder[0].axis)} is more than scatter: look for what differs there."
        )
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
        likeliest = next((h for h in d.ranking if h.name not in ("none", "unknown")), None)
        if likeliest is not None and likeliest.effects in d.same_class:
            return (
                f"The cause is unknown ({chance}); of the effects that could be tested here, "
                f"{likeliest.name} is likeliest ({probability(likeliest.probability)})."
            )
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
    floor = "there are no replicates to say how much of that is scatter"
    some = [id for one in d.effect for id in one.specimens]
    if gap.floor is not None:
        but = " once that gain is taken out" if some else ""
        floor = f"replicates differ by {percent(gap.floor)}{but}"
    laws = gap.recalibration_only
    refitted = "" if laws is None else f", by {percent(laws)} with its laws refitted"
    if d.verdict == "none" and d.remainder:
        return f"Nothing that could be tested closes it: {before}{refitted}, and {floor}."
    if gap.floor is not None and gap.before <= gap.floor and d.verdict == "none":
        return f"Nothing to explain: the prints repeat no better than this: {before}, and {floor}."
    if d.verdict == "none":
        beyond = "; what is beyond lies within the doubt about its calibration"
        within = "" if gap.floor is None else beyond
        return f"No effect is needed: {before}{refitted}, and {floor}{within}."
    if d.verdict == "unknown":
        said = "Refitted laws close most of it" if gap.laws_close_it else "Nothing known closes it"
        return f"{said}: {before}{refitted}, and {floor}."
    if gap.after is None:
        return (
            "How far it closes cannot be checked, as no condition can be left out of the fit: "
            f"{before}, and {floor}."
        )
    if some and gap.after > 0.5 * gap.before:
        return (
            f"How far it closes cannot be checked: what {named(some)} alone have, the others do "
            f"not tell of where these are left out. Before, {before}, and {floor}."
        )
    added = "it is" if len(d.verdict.split("+")) == 1 else "they are"
    missed = f"{percent(gap.after)} of a specimen's largest force"
    if gap.negative_transfer:
        by_chance = gap.closed_interval is not None and gap.closed_interval[1] > 0.0
        so = ", which may be chance: more tests would tell" if by_chance else ": do not use it"
        return (
            f"Once {added} added, tests that were left out of the fit are predicted worse, by "
            f"{missed} in place of {percent(gap.before)}{so}."
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


# ------------------------------------------------------------------------------------------------
# Where a campaign stands: what is measured, what is missing, which diagnosis, what comes next.


@dataclass(frozen=True, slots=True)
class Standing:
    """What a campaign's folder has and lacks; of a diagnosis alone, what that says.

    Attributes
    ----------
    listed, missing
        Specimens of the list, and those of them without a curve; none of a diagnosis alone.
    unknown
        By column: the specimens whose cell of that condition is empty.
    diagnosis, verdict
        The folder of a diagnosis of these specimens, within the campaign's or beside it.
    next
        The command that comes next; "" where specimens are to be measured first.
    """

    campaign: str
    listed: tuple[str, ...]
    missing: tuple[str, ...]
    unknown: Mapping[str, tuple[str, ...]]
    diagnosis: str | None
    verdict: str | None
    next: str

    @one_line
    def __repr__(self) -> str:
        measured = len(self.listed) - len(self.missing)
        stands = f"{measured} of {len(self.listed)} specimens measured"
        return f"{self.campaign}: {stands if self.listed else self.verdict}; {self.next}"

    def document(self) -> dict[str, Any]:
        """Return it as ``--json`` prints it."""
        return {"schema": 1, **{name: getattr(self, name) for name in self.__dataclass_fields__}}


def campaign_standing(campaign: str | Path) -> Standing:
    """Say where a campaign stands: what is measured, what is missing, and what comes next.

    Parameters
    ----------
    campaign
        Its folder, with campaign.toml and specimens.csv; or a diagnosis, its folder or its file.

    Returns
    -------
    Standing
        With the next command.

    Raises
    ------
    FileError
        Neither a campaign nor a diagnosis, or a list or curves that cannot be read.

    Examples
    --------
    >>> planner.campaign_standing("lab").missing  # doctest: +SKIP
    ('D03a', 'D03b')
    """
    with refused(ArgumentError, f"campaign {campaign!r}", "give its folder", TypeError):
        folder = Path(campaign)
    diagnosed = (folder / "diagnosis.json").is_file() and not (folder / "campaign.toml").is_file()
    if folder.is_file() or diagnosed:
        found = read_diagnosis(folder)
        command = next_command(found, folder)
        return Standing(found.campaign, (), (), {}, str(folder), found.verdict, command)
    file = read_campaign_file(folder)
    rows, _, _ = read_list(path_within(folder, SPECIMENS))
    listed = tuple(row.specimen for row in rows)
    tables = read_tensile(path_within(folder, CURVES)) if has_curves(folder) else ()
    curves = {table.specimen for table in tables}
    missing = tuple(
        row.specimen
        for row in rows
        if not (path_within(folder, row.file).is_file() if row.file else row.specimen in curves)
    )
    unknown = {
        name: ids
        for name, column in SPECIMEN_COLUMNS.items()
        if not column.is_size
        and (ids := tuple(row.specimen for row in rows if getattr(row, name) is None))
    }
    names = {"campaign.toml", file.palette, SPECIMENS, CURVES, "fields.csv"}
    names |= {name for row in rows for name in (row.file, row.profile)}
    read = (path for name in names if name and (path := folder / name).is_file())
    since = max(path.stat().st_mtime for path in read)
    diagnoses = _diagnoses_of(folder, file.name, len(listed) - len(missing), since)
    *_, at, diagnosis = max(diagnoses, key=lambda one: one[:2], default=(0, 0.0, None, None))
    command = ""
    if not missing and diagnosis is not None:
        command = next_command(diagnosis, at, folder)
    elif not missing:
        whole = folder.resolve()
        target = _from_here(whole.parent / f"{whole.name}-diagnosis")
        again = " --force" if (target / "diagnosis.json").is_file() else ""
        command = f"planner gap diagnose {quote(str(folder))} -o {quote(str(target))}{again}"
    found_at, verdict = (None, None) if diagnosis is None else (str(at), diagnosis.verdict)
    return Standing(file.name, listed, missing, unknown, found_at, verdict, command)


def next_command(
    found: Diagnosis, at: Path | None, campaign: Path | None = None, asked: str = ""
) -> str:
    """Return the command that follows from a verdict, with the options that it needs; "" for none.

    Conditions of use are the last ones that were tested, to be replaced by the part's own.

    Parameters
    ----------
    at
        The folder or file of the diagnosis; None where none was written.
    campaign
        Its folder, if it is known.
    asked
        The options that it was diagnosed with.
    """
    if found.unit_of:
        # What is said of a specimen last holds.
        units = "".join(f" --unit-of {quote(unit.text)}" for unit in found.unit_of)
        return f"planner gap diagnose {quote(str(campaign or Path('CAMPAIGN')))}{asked}{units}"
    effects = [EFFECTS[one.id] for one in found.effect if one.id in EFFECTS]
    if not effects or at is None:
        return ""
    # What comes with advice of its own, as a wrong gauge length, changes no palette: it is told.
    if all(effect.advice for effect in effects):
        return f"planner gap correct {quote(str(at))}"
    use = ""
    for condition in dict.fromkeys(effect.condition for effect in effects if effect.condition):
        if levels := found.tested.get(condition):
            level = levels[-1] if isinstance(levels[-1], str) else f"{levels[-1]:.4g}"
            use += f" --{condition.removeprefix('strain_').replace('_', '-')} {level}"
    return f"planner gap correct {quote(str(at))}{use} -o palette-corrected.toml"


def _diagnoses_of(
    folder: Path, campaign: str, measured: int, since: float
) -> Iterator[tuple[int, float, Path, Diagnosis]]:
    """Yield diagnoses below the campaign or beside it: specimens, when, where, and what they say.

    Of so many specimens, or of fewer: what cannot be compared is left out of a diagnosis. What is
    older than the last measurement is of an earlier state, or of a campaign of that name before
    this one: designs for the same effects are called alike.
    """
    above = folder.resolve().parent
    for file in sorted([*folder.glob("*/diagnosis.json"), *above.glob("*/diagnosis.json")]):
        try:
            found = read_diagnosis(file)
        except PlannerError:
            continue
        written = file.stat().st_mtime
        if written >= since and found.campaign == campaign and found.specimens <= measured:
            yield found.specimens, written, _from_here(file.parent), found


def _from_here(path: Path) -> Path:
    return path.relative_to(here) if path.is_relative_to(here := Path.cwd()) else path
