"""Scores put together: by tier, and by how visible the hidden effect is."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import fmean, median
from types import MappingProxyType
from typing import Any

from planner.gap.bench.calibration import area_under_curve, expected_calibration_error
from planner.gap.bench.hypothesis import UNKNOWN
from planner.gap.bench.intervals import Rate
from planner.gap.bench.score import Score

__all__ = ["RATES", "STRATA", "Row", "Summary", "summarise"]

RATES = (
    *("top_1", "class_hit", "false_alarm", "missed", "misattributed", "partly", "companion"),
    *("open", "honest", "where_hit", "covered", "answered"),
)
"""Measures of `Score` that are true or false."""

STRATA: Mapping[str, tuple[float, ...]] = MappingProxyType(
    {"snr": (1.0, 2.0, 4.0), "detectability": (4.0, 10.0)}
)
"""Where the strata of each kind of visibility end; a stratum holds its lower end."""


@dataclass(frozen=True, slots=True)
class Row:
    """The scores of one tier, or of one stratum of it.

    Attributes
    ----------
    by, stratum
        "all" and "all", or what was split by ("snr", "detectability") and the range.
    rates
        By the names in `RATES`; those that have no meaning here count nothing.
    probability
        Mean probability on the right answer.
    closure_error
        Median.
    closures
        How many reported a closure that could be held against the true one.
    median_seconds, longest_seconds
        None where no time was given.
    """

    tier: str
    by: str
    stratum: str
    campaigns: int
    rates: Mapping[str, Rate]
    probability: float
    closure_error: float | None
    closures: int
    median_seconds: float | None
    longest_seconds: float | None

    def document(self) -> dict[str, Any]:
        """Return the row for JSON."""
        rates = {
            name: {
                "hits": rate.hits,
                "of": rate.of,
                "share": rate.share,
                "interval": list(rate.interval),
            }
            for name, rate in self.rates.items()
            if rate.of
        }
        plain = (
            *("tier", "by", "stratum", "campaigns", "probability", "closure_error", "closures"),
            *("median_seconds", "longest_seconds"),
        )
        return {name: getattr(self, name) for name in plain} | {"rates": rates}


@dataclass(frozen=True, slots=True)
class Summary:
    """All rows, and what takes all campaigns together.

    Attributes
    ----------
    area_unknown
        How well the probability of "unknown" tells effects out of the library from the rest.
    calibration_error
        Of the leading probability.
    log_score, log_gain
        Means, in nats.
    """

    rows: tuple[Row, ...]
    area_unknown: float | None
    calibration_error: float | None
    log_score: float
    log_gain: float

    def document(self) -> dict[str, Any]:
        """Return the summary for JSON."""
        return {
            "rows": [row.document() for row in self.rows],
            "overall": {
                "area_unknown": self.area_unknown,
                "calibration_error": self.calibration_error,
                "log_score": self.log_score,
                "log_gain": self.log_gain,
            },
        }

    def row(self, tier: str, stratum: str = "all", by: str = "snr") -> Row | None:
        """Return one row, None where there is none."""
        by = "all" if stratum == "all" else by
        for row in self.rows:
            if (row.tier, row.by, row.stratum) == (tier, by, stratum):
                return row
        return None


def summarise(scores: Sequence[Score]) -> Summary:
    """Put scores together; tiers keep the order in which they come first.

    Raises
    ------
    ValueError
        There is no score.
    """
    if not scores:
        raise ValueError("no score to sum up")
    rows = []
    for tier in dict.fromkeys(s.tier for s in scores):
        of_tier = [s for s in scores if s.tier == tier]
        rows.append(_row(tier, "all", "all", of_tier))
        for by, ends in STRATA.items():
            for number, name in enumerate(_names(ends)):
                inside = [s for s in of_tier if _stratum(getattr(s, by), ends) == number]
                if inside:
                    rows.append(_row(tier, by, name, inside))
    led = [s for s in scores if s.leading_probability is not None]
    return Summary(
        rows=tuple(rows),
        area_unknown=area_under_curve(
            [s.probability_unknown for s in scores], [s.expected == UNKNOWN for s in scores]
        ),
        calibration_error=expected_calibration_error(
            [s.leading_probability or 0.0 for s in led], [s.leading_right for s in led]
        ),
        log_score=fmean(s.log_score for s in scores),
        log_gain=fmean(s.log_gain for s in scores),
    )


def _row(tier: str, by: str, stratum: str, scores: Sequence[Score]) -> Row:
    counted = {
        name: [value for s in scores if (value := getattr(s, name)) is not None] for name in RATES
    }
    errors = [s.closure_error for s in scores if s.closure_error is not None]
    seconds = [s.seconds for s in scores if s.seconds is not None]
    return Row(
        tier=tier,
        by=by,
        stratum=stratum,
        campaigns=len(scores),
        rates={name: Rate(sum(values), len(values)) for name, values in counted.items()},
        probability=fmean(s.probability for s in scores),
        closure_error=median(errors) if errors else None,
        closures=len(errors),
        median_seconds=median(seconds) if seconds else None,
        longest_seconds=max(seconds, default=None),
    )


def _names(ends: Sequence[float]) -> list[str]:
    inner = [f"{low:g}-{high:g}" for low, high in pairwise(ends)]
    return [f"<{ends[0]:g}", *inner, f">{ends[-1]:g}"]


def _stratum(value: float | None, ends: Sequence[float]) -> int | None:
    return None if value is None else sum(value >= end for end in ends)
