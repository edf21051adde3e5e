"""Which tests to leave out together, so that what is predicted is another condition."""

from collections.abc import Collection, Hashable, Sequence
from dataclasses import dataclass

import numpy as np

from planner.arrays import BoolArray
from planner.gap.campaign import Campaign
from planner.gap.conditions import TOLERANCES, levels
from planner.gap.specimen import Specimen

__all__ = ["Fold", "conditions_out", "held_out_words", "levels_out"]


@dataclass(frozen=True, slots=True, eq=False)
class Fold:
    """What is left out.

    Attributes
    ----------
    name
        The column.
    out : (n,)
        Specimens that take no part.
    judged : (n,)
        Those of them whose direction and material some other specimen has: what is said of one
        that was not tested is a guess.
    """

    name: str
    out: BoolArray
    judged: BoolArray


LEAST_LEVELS = 3
MOST_FOLDS = 10
MOST_LEVELS = 6
LARGEST_SHARE = 0.5


def conditions_out(campaign: Campaign, tests: Sequence[Sequence[int]]) -> tuple[Fold, ...]:
    """Return folds that leave each condition out once, with all that were tested in it.

    Where there are more than `MOST_FOLDS` conditions, several are left out together. With one
    condition, specimens are left out one at a time, or a few; with one specimen there is no fold.

    Parameters
    ----------
    tests
        Places of the specimens of each condition.
    """
    specimens = campaign.specimens
    groups: list[Sequence[int]] = [t for t in tests if t]
    name = "condition"
    if len(groups) < 2:
        groups, name = [[k] for k in range(len(specimens))], "specimen"
    if len(groups) < 2:
        return ()
    count = min(len(groups), MOST_FOLDS)
    order = np.arange(len(specimens))
    found = []
    for k in range(count):
        out = np.isin(order, [place for group in groups[k::count] for place in group])
        # Of specimens one at a time, what is said of another material or direction has to do.
        judged = _judged(specimens, out) if name == "condition" else out
        if judged.any():
            found.append(Fold(name, out, judged))
    if not found and name == "condition":
        # Every condition has a material or a direction of its own.
        return conditions_out(campaign, ())
    return tuple(found)


def levels_out(campaign: Campaign, names: Collection[str]) -> tuple[Fold, ...]:
    """Return folds that leave whole levels of a column out: what is predicted lies beyond.

    A column with two levels is left as it is: without one of them nothing could be learned of the
    other.

    Parameters
    ----------
    names
        The columns; others leave nothing out.
    """
    specimens = campaign.specimens
    n = len(specimens)
    found: list[Fold] = []
    seen: set[bytes] = set()
    columns: dict[str, tuple[Hashable, ...]] = {
        name: levels([getattr(s, name) for s in specimens], *tolerance)
        for name, tolerance in TOLERANCES.items()
        if name in names
    }
    if "orientation" in names:
        columns["orientation"] = tuple(s.orientation for s in specimens)
    for name, cells in columns.items():
        known = [c for c in dict.fromkeys(cells) if c is not None]
        if len(known) < LEAST_LEVELS:
            continue
        for level in known:
            out = np.array([c == level for c in cells])
            if not 0 < out.sum() <= LARGEST_SHARE * n or out.tobytes() in seen:
                continue
            seen.add(out.tobytes())
            judged = _judged(specimens, out)
            if judged.any():
                found.append(Fold(name, out, judged))
    # Evenly chosen where there are many, so that every column keeps some.
    if len(found) > MOST_LEVELS:
        chosen = np.linspace(0, len(found) - 1, MOST_LEVELS).round().astype(int)
        found = [found[k] for k in chosen.tolist()]
    return tuple(found)


def held_out_words(folds: Sequence[Fold], tests: int) -> str:
    """Return what is left out at a time: "15 conditions left out, one or two at a time"."""
    if folds[0].name == "specimen":
        return f"{sum(int(f.out.sum()) for f in folds)} specimens left out one at a time"
    most = -(-tests // MOST_FOLDS)
    if most == 1:
        return "leave one condition out"
    return f"{tests} conditions left out, up to {most} at a time"


def _judged(specimens: Sequence[Specimen], out: BoolArray) -> BoolArray:
    judged = out.copy()
    for name in ("orientation", "material"):
        cells = [getattr(s, name) for s in specimens]
        known = {cell for cell, left_out in zip(cells, out, strict=True) if not left_out}
        judged &= np.array([cell in known for cell in cells])
    return judged
