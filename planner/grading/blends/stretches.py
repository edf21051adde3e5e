"""Stretches of the field over which the target stays between the same two materials."""

import itertools
import math
from dataclasses import dataclass

import numpy as np

from planner.grading.bands import distinct_positions
from planner.grading.profile import Profile

__all__ = ["Stretch", "stretches"]

_SAME = 1e-9  # relative: a target this near to a material's modulus is that


@dataclass(frozen=True, slots=True)
class Stretch:
    """A stretch of the field between two neighbouring materials.

    Attributes
    ----------
    start, stop
        Field values.
    lower, upper
        Places of the materials from soft (0) to hard; the same where the target is one material's
        modulus, or beyond the softest or the hardest.
    target_MPa
        Lowest and highest target.
    ends_MPa
        Targets where it begins and ends.
    run
        How many jumps of the target lie before it.
    """

    start: float
    stop: float
    lower: int
    upper: int
    target_MPa: tuple[float, float]
    ends_MPa: tuple[float, float]
    run: int

    @property
    def rising(self) -> bool:
        """Whether the target is not lower at the end than at the beginning."""
        return self.ends_MPa[1] >= self.ends_MPa[0]


def stretches(profile: Profile, moduli_MPa: tuple[float, ...]) -> tuple[Stretch, ...]:
    """Divide the field where the target passes the modulus of a material.

    Parameters
    ----------
    moduli_MPa
        Of the catalogue materials, strictly rising.
    """
    cuts = [u for modulus in moduli_MPa for u in profile.crossings(modulus)]
    jumps = [a for a, b in itertools.pairwise(profile.positions) if a == b]
    found = []
    for start, stop in itertools.pairwise(distinct_positions([*cuts, *jumps])):
        low, high = profile.interval_MPa(start, stop)
        lower, upper = _neighbours(low, high, moduli_MPa)
        inner = 1e-9 * (stop - start)  # a jump's own value is that after it
        ends = [float(profile.modulus_MPa(u)) for u in (start, stop - inner)]
        run = sum(jump <= start + inner for jump in jumps)
        found.append(Stretch(start, stop, lower, upper, (low, high), (ends[0], ends[1]), run))
    return tuple(found)


def _neighbours(low: float, high: float, moduli_MPa: tuple[float, ...]) -> tuple[int, int]:
    place = int(np.searchsorted(moduli_MPa, math.sqrt(low * high)))
    if place == 0:
        return 0, 0
    if place == len(moduli_MPa):
        return place - 1, place - 1
    for grade in (place - 1, place):
        if all(math.isclose(e, moduli_MPa[grade], rel_tol=_SAME) for e in (low, high)):
            return grade, grade
    return place - 1, place
