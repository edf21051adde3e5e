"""Our answers beside the naive analyst's and a guess, on the same campaigns."""

from collections.abc import Mapping, Sequence
from statistics import fmean
from typing import Any

from benchmarks.withheld.scoring import Score
from benchmarks.withheld.summary import Rate

__all__ = ["COLUMNS", "compare", "comparison_rows"]

COLUMNS = (
    *("tier", "n", "top-1 %", "naive top-1 %", "sure but wrong %", "naive sure but wrong %"),
    *("log score", "naive log score", "a guess"),
)
"""Log scores in nats; the guess is even over all hypotheses that could be weighed."""


def compare(ours: Sequence[Score], naive: Sequence[Score]) -> dict[str, Any]:
    """Return rows by tier and overall, for JSON; both score the same campaigns in one order."""
    tiers = dict.fromkeys(s.tier for s in ours)
    by_tier = [
        {"tier": tier} | _row(*([s for s in scores if s.tier == tier] for scores in (ours, naive)))
        for tier in tiers
    ]
    return {"rows": by_tier, "overall": {"tier": "all"} | _row(ours, naive)}


def comparison_rows(document: Mapping[str, Any]) -> list[list[str]]:
    """Return the texts under `COLUMNS`."""
    return [
        [
            row["tier"],
            str(row["campaigns"]),
            *(
                _share(Rate(row[name], row["campaigns"]))
                for name in ("top_1", "naive_top_1", "misattributed", "naive_misattributed")
            ),
            *(f"{row[name]:.2f}" for name in ("log_score", "naive_log_score", "guess")),
        ]
        for row in (*document["rows"], document["overall"])
    ]


def _row(ours: Sequence[Score], naive: Sequence[Score]) -> dict[str, Any]:
    return {
        "campaigns": len(ours),
        "top_1": sum(s.top_1 for s in ours),
        "naive_top_1": sum(s.top_1 for s in naive),
        "misattributed": sum(s.misattributed for s in ours),
        "naive_misattributed": sum(s.misattributed for s in naive),
        "log_score": fmean(s.log_score for s in ours),
        "naive_log_score": fmean(s.log_score for s in naive),
        "guess": fmean(s.log_score - s.log_gain for s in ours),
    }


def _share(rate: Rate) -> str:
    low, high = rate.interval
    return f"{100 * rate.hits / rate.of:.0f} [{100 * low:.0f}, {100 * high:.0f}]"
