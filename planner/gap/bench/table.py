"""The rows of a summary as a table of texts."""

from collections.abc import Sequence

from planner.gap.bench.intervals import Rate
from planner.gap.bench.summary import Row, Summary

__all__ = ["COLUMNS", "DROPPABLE", "markdown", "overall_lines", "table_rows"]

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
}

COLUMNS = ("tier", "stratum", "n", "P(truth)", *_RATES, "closure error", "s")
"""Headings; those that name a share are in per cent with Wilson's interval at 95 %."""

DROPPABLE = (
    *("missed %", "companion %", "one right %", "covered %", "in class %", "honest class %"),
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
    return [tier, stratum, str(row.campaigns), f"{row.probability:.2f}", *rates, error, seconds]


def _rate(rate: Rate) -> str:
    if rate.share is None:
        return ""
    low, high = rate.interval
    return f"{100 * rate.share:.0f} [{100 * low:.0f}, {100 * high:.0f}]"
