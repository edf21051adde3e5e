"""Scores put together: shares with their intervals, calibration, by tier and visibility."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import NormalDist, fmean, median
from types import MappingProxyType
from typing import Any

import numpy as np
from scipy.stats import rankdata

from benchmarks.withheld.scoring import UNKNOWN, Score

__all__ = [
    "COLUMNS",
    "DROPPABLE",
    "RATES",
    "STRATA",
    "OracleShare",
    "Rate",
    "Row",
    "Summary",
    "area_under_curve",
    "expected_calibration_error",
    "markdown",
    "of_oracle",
    "overall_lines",
    "summarise",
    "table_rows",
    "wilson",
]


# ------------------------------------------------------------------------------------------------
# Shares of a count, with the interval that so few trials leave.


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


@dataclass(frozen=True, slots=True)
class OracleShare:
    """How often we reach what was to be reached, over how often the oracle does.

    The oracle's count is taken for what these campaigns allow: the interval is of our count alone.
    """

    ours: int
    oracles: int
    of: int

    @property
    def value(self) -> float:
        """Above 1 where we reach more than the oracle is sure of."""
        return self.ours / self.oracles

    @property
    def text(self) -> str:
        """Per cent, with Wilson's interval of our count."""
        low, high = (100 * end * self.of / self.oracles for end in wilson(self.ours, self.of))
        return f"{100 * self.value:.0f} % [{low:.0f}, {high:.0f}]"


def of_oracle(ours: Rate, oracles: Rate) -> OracleShare | None:
    """Return our share of the oracle's; None where it was not asked or reaches nothing."""
    return OracleShare(ours.hits, oracles.hits, ours.of) if oracles.hits else None


# ------------------------------------------------------------------------------------------------
# Whether probabilities mean what they say.


def expected_calibration_error(
    probabilities: Sequence[float], right: Sequence[bool], bins: int = 10
) -> float | None:
    """Return the mean distance of how often it was right from how sure it was.

    Over bins of equal width, weighted by what is in them (Naeini et al., AAAI 2015); None of
    nothing. Biased upwards where the bins hold few.
    """
    if not len(probabilities):
        return None
    p, hit = np.asarray(probabilities, dtype=float), np.asarray(right, dtype=float)
    place = np.minimum((p * bins).astype(int), bins - 1)
    apart = np.bincount(place, weights=hit - p, minlength=bins)
    return float(np.abs(apart).sum() / len(p))


def area_under_curve(scores: Sequence[float], positive: Sequence[bool]) -> float | None:
    """Return the probability that a positive case scores above a negative one, ties by half.

    The area under the receiver operating characteristic (Hanley & McNeil, Radiology 143, 1982);
    None where there is but one kind of case.
    """
    label = np.asarray(positive, dtype=bool)
    of, others = int(label.sum()), int((~label).sum())
    if not (of and others):
        return None
    ranks = rankdata(np.asarray(scores, dtype=float))
    return float((ranks[label].sum() - 0.5 * of * (of + 1)) / (of * others))


# ------------------------------------------------------------------------------------------------
# Scores put together: by tier, and by how visible the hidden effect is.


RATES = (
    *("top_1", "class_hit", "false_alarm", "missed", "misattributed", "partly", "companion"),
    *("open", "honest", "where_hit", "covered", "answered", "oracle", "beside_oracle"),
)
"""Measures of `Score` that are true or false; the last is what is held against the oracle."""

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
    probability, oracle_probability
        Mean probability on the right answer, ours and the oracle's.
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
    oracle_probability: float | None
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
            *("tier", "by", "stratum", "campaigns", "probability", "oracle_probability"),
            *("closure_error", "closures", "median_seconds", "longest_seconds"),
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
    oracles = [s.oracle_probability for s in scores if s.oracle_probability is not None]
    return Row(
        tier=tier,
        by=by,
        stratum=stratum,
        campaigns=len(scores),
        rates={name: Rate(sum(values), len(values)) for name, values in counted.items()},
        probability=fmean(s.probability for s in scores),
        oracle_probability=fmean(oracles) if oracles else None,
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


# ------------------------------------------------------------------------------------------------
# The rows of a summary as a table of texts.


_RATES = {
    "top-1 %": "top_1",
    "in class %": "class_hit",
    "false alarm %": "false_alarm",
    "sure but wrong %": "misattributed",
    "missed %": "missed",
    "one right %": "partly",
    "companion %": "companion",
    "unknown or class %": "open",
    "honest class %": "honest",
    "where %": "where_hit",
    "covered %": "covered",
    "oracle %": "oracle",
}

COLUMNS = (
    *("tier", "stratum", "n", "P(truth)", *_RATES, "of the oracle's", "oracle's P(truth)"),
    *("closure error", "s"),
)
"""Headings; those that name a share are in per cent with Wilson's interval at 95 %."""

DROPPABLE = (
    *("missed %", "companion %", "one right %", "covered %", "in class %", "honest class %"),
    *("oracle's P(truth)", "oracle %", "of the oracle's"),
    *("unknown or class %", "s", "closure error", "where %"),
)
"""What a narrow terminal can do without, the first one first."""


def table_rows(summary: Summary, *, by: Sequence[str] = ("all", "snr")) -> list[list[str]]:
    """Return a row of texts for each row of the summary that is split by one of `by`."""
    rows = []
    tier = ""
    for row in summary.rows:
        if row.by in by:
            rows.append(_texts(row, "" if row.tier == tier else row.tier))
            tier = row.tier
    return rows


def overall_lines(summary: Summary) -> list[str]:
    """Return what holds for all campaigns together, a line each."""
    lines = [
        f"log score {summary.log_score:.2f} nats, {summary.log_gain:.2f} above a guess over all "
        "hypotheses"
    ]
    if summary.calibration_error is not None:
        lines.append(f"calibration error {summary.calibration_error:.3f} (10 bins)")
    if summary.area_unknown is not None:
        lines.append(f"area under the curve for unknown effects {summary.area_unknown:.3f}")
    return lines


def markdown(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Write a table in Markdown; columns that are empty throughout are left out."""
    kept = [i for i in range(len(columns)) if any(row[i] for row in rows)]
    lines = [[columns[i] for i in kept], ["---"] * len(kept), *([r[i] for i in kept] for r in rows)]
    return "".join("| " + " | ".join(line) + " |\n" for line in lines)


def _texts(row: Row, tier: str) -> list[str]:
    stratum = "all" if row.by == "all" else f"{row.by} {row.stratum}"
    error = "" if row.closure_error is None else f"{row.closure_error:.3f}"
    seconds = "" if row.median_seconds is None else f"{row.median_seconds:.1f}"
    rates = (_rate(row.rates[name]) for name in _RATES.values())
    share = of_oracle(row.rates["beside_oracle"], row.rates["oracle"])
    oracle = ["" if share is None else share.text.replace(" %", "")]
    sure = row.oracle_probability
    oracle.append("" if sure is None else f"{sure:.2f}")
    ours = [tier, stratum, str(row.campaigns), f"{row.probability:.2f}"]
    return [*ours, *rates, *oracle, error, seconds]


def _rate(rate: Rate) -> str:
    if rate.share is None:
        return ""
    low, high = rate.interval
    return f"{100 * rate.share:.0f} [{100 * low:.0f}, {100 * high:.0f}]"
