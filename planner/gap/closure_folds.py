"""Which tests to leave out together, so that what is predicted is another condition."""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np

from planner.arrays import BoolArray
from planner.gap.campaign import Campaign
from planner.gap.conditions import TOLERANCES, levels
from planner.gap.specimen import Specimen

__all__ = ["Fold", "folds_of", "held_out_words"]


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


_CATEGORIES = ("protocol", "batch")
_REPEATED = ("batch",)
"""Columns whose levels repeat one another, so that two of them are enough."""

LEAST_LEVELS = 3
MOST_FOLDS = 12
REPLICATE_FOLDS = 4
LARGEST_SHARE = 0.5


def folds_of(campaign: Campaign) -> tuple[Fold, ...]:
    """Return the folds: each level of each column that leaves most specimens in, once.

    A column with two levels is left as it is: without one of them nothing could be learned of the
    other. Where no fold holds out a specimen, replicates are left out one at a time; with one
    specimen there is no fold.
    """
    specimens = campaign.specimens
    n = len(specimens)
    found: list[Fold] = []
    seen: set[bytes] = set()
    columns: dict[str, tuple[Hashable, ...]] = {
        name: levels([getattr(s, name) for s in specimens], *tolerance)
        for name, tolerance in TOLERANCES.items()
    }
    for name in _CATEGORIES:
        columns[name] = tuple(getattr(s, name) for s in specimens)
    for name, cells in columns.items():
        known = [c for c in dict.fromkeys(cells) if c is not None]
        if len(known) < LEAST_LEVELS and name not in _REPEATED:
            continue
        for level in known:
            out = np.array([c == level for c in cells])
            if not 0 < out.sum() <= LARGEST_SHARE * n or out.tobytes() in seen:
                continue
            seen.add(out.tobytes())
            judged = _judged(specimens, out)
            if judged.any():
                found.append(Fold(name, out, judged))
    held = np.any([f.judged for f in found], axis=0) if found else np.zeros(n, dtype=bool)
    if n > 1 and not held.all():
        found += _replicates(specimens, held)
    # Evenly chosen where there are many, so that every column keeps some.
    if len(found) > MOST_FOLDS:
        chosen = np.linspace(0, len(found) - 1, MOST_FOLDS).round().astype(int)
        found = [found[k] for k in chosen.tolist()]
    return tuple(found)


def held_out_words(folds: Sequence[Fold]) -> str:
    """Return what is left out at a time: "2 batches left out one at a time"."""
    parts = []
    for name in dict.fromkeys(fold.name for fold in folds):
        mine = [fold for fold in folds if fold.name == name]
        several = any(fold.out.sum() > 1 for fold in mine)
        what = {
            "specimen": "group{s} of specimens" if several else "specimen{s}",
            "batch": "batch{es}",
        }.get(name, f"level{{s}} of {name}")
        many = len(mine) > 1
        parts.append(f"{len(mine)} {what.format(s='s' * many, es='es' * many)}")
    listed = " and ".join(filter(None, (", ".join(parts[:-1]), *parts[-1:])))
    return f"{listed} left out{' one at a time' if len(folds) > 1 else ''}"


def _replicates(specimens: Sequence[Specimen], held: BoolArray) -> list[Fold]:
    """Return folds over specimens that no other fold holds out, a few at a time."""
    rest = np.flatnonzero(~held)
    count = min(len(rest), REPLICATE_FOLDS if held.any() else MOST_FOLDS)
    order = np.arange(len(specimens))
    outs = [np.isin(order, rest[k::count]) for k in range(count)]
    return [Fold("specimen", out, out) for out in outs]


def _judged(specimens: Sequence[Specimen], out: BoolArray) -> BoolArray:
    judged = out.copy()
    for name in ("orientation", "material"):
        cells = [getattr(s, name) for s in specimens]
        known = {cell for cell, left_out in zip(cells, out, strict=True) if not left_out}
        judged &= np.array([cell in known for cell in cells])
    return judged
