"""One explanation of a campaign, fitted."""

from dataclasses import dataclass, replace

import numpy as np

from planner.arrays import FloatArray
from planner.gap.effects.effect import Values
from planner.gap.evidence.nodes import Branch

__all__ = ["Candidate"]


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """Effects in one form each, at their best parameters.

    Attributes
    ----------
    effects
        Ids, sorted; () for none.
    branches, places
        Of each effect, in that order; a place is (s, shapes...).
    gain
        Log likelihood above that of no effect.
    log_evidence
        Above that of no effect, of this form alone.
    members : (n,) or None
        Which specimens it holds for, 1 or 0, where it holds for some only.
    log_gain
        What these specimens' force is off by, as a logarithm.
    """

    effects: tuple[str, ...]
    branches: tuple[Branch, ...] = ()
    places: tuple[tuple[float, ...], ...] = ()
    gain: float = 0.0
    log_evidence: float = 0.0
    members: FloatArray | None = None
    log_gain: float = 0.0

    def values(self) -> list[tuple[Branch, Values]]:
        """Return the branches with their parameters' values."""
        pairs = zip(self.branches, self.places, strict=True)
        return [(branch, branch.values(place)) for branch, place in pairs]

    @property
    def flat(self) -> FloatArray:
        """All places one after another."""
        return np.array([x for place in self.places for x in place])

    def at(self, flat: tuple[float, ...], gain: float, log_evidence: float) -> "Candidate":
        """Return the candidate moved to another place."""
        places, first = [], 0
        for place in self.places:
            places.append(tuple(flat[first : first + len(place)]))
            first += len(place)
        return replace(self, places=tuple(places), gain=gain, log_evidence=log_evidence)
