"""Shares of a count, with the interval that so few trials leave."""

import math
from dataclasses import dataclass
from statistics import NormalDist

__all__ = ["Rate", "wilson"]


def wilson(hits: int, of: int, level: float = 0.95) -> tuple[float, float]:
    """Return Wilson's score interval of a share (J. Am. Stat. Assoc. 22, 1927).

    It stays within 0 and 1 and keeps its level for few trials and for shares near either end.
    No trial leaves everything open.
    """
    if of == 0:
        return 0.0, 1.0
    z = NormalDist().inv_cdf(0.5 + 0.5 * level)
    share, z2 = hits / of, z * z / of
    centre = (share + 0.5 * z2) / (1.0 + z2)
    half = z / (1.0 + z2) * math.sqrt(share * (1.0 - share) / of + 0.25 * z2 / of)
    low = 0.0 if hits == 0 else centre - half
    high = 1.0 if hits == of else centre + half
    return low, high


@dataclass(frozen=True, slots=True)
class Rate:
    """How often something came out, of how many."""

    hits: int
    of: int

    @property
    def share(self) -> float | None:
        """None where nothing was counted."""
        return self.hits / self.of if self.of else None

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's at 95 %."""
        return wilson(self.hits, self.of)
