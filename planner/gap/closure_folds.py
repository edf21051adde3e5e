"""Which tests to leave out together, so that what is predicted is another condition."""

from collections.abc import Hashable

import numpy as np

from planner.arrays import BoolArray
from planner.gap.campaign import Campaign
from planner.gap.conditions import TOLERANCES, levels

__all__ = ["Fold", "folds_of"]

Fold = tuple[str, BoolArray]
"""What is left out, in words, and the specimens, (n,)."""

_CATEGORIES = ("orientation", "protocol", "batch", "material")
MOST_FOLDS = 16
LARGEST_SHARE = 0.5


def folds_of(campaign: Campaign) -> tuple[Fold, ...]:
    """Return the folds: each level of each column that leaves most specimens in, once.

    Where nothing varies, replicates are left out one at a time; with one specimen there is no fold.
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
        for level in dict.fromkeys(cells):
            out = np.array([c == level for c in cells])
            if level is None or not 0 < out.sum() <= LARGEST_SHARE * n:
                continue
            if out.tobytes() not in seen:
                seen.add(out.tobytes())
                found.append((name, out))
    if not found and n > 1:
        found = [("specimen", np.arange(n) == k) for k in range(min(n, MOST_FOLDS))]
    # Evenly chosen where there are many, so that every column keeps some.
    if len(found) > MOST_FOLDS:
        chosen = np.linspace(0, len(found) - 1, MOST_FOLDS).round().astype(int)
        found = [found[k] for k in chosen.tolist()]
    return tuple(found)
