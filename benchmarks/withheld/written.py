"""The results of a run as a page of Markdown."""

from collections.abc import Mapping
from typing import Any

from benchmarks.withheld.leave_one_out import COLUMNS as LEFT_OUT_COLUMNS
from benchmarks.withheld.leave_one_out import LeftOut, left_out_rows
from planner.gap.bench.intervals import Rate
from planner.gap.bench.summary import RATES, Row, Summary
from planner.gap.bench.table import COLUMNS, markdown, overall_lines, table_rows

__all__ = ["results_markdown"]

_MET = {True: "yes", False: "no", None: ""}


def results_markdown(results: Mapping[str, Any]) -> str:
    """Return the page; shares are in per cent with Wilson's intervals at 95 %."""
    made_by = results["made_by"]
    summary = _summary(results["summary"])
    targets = [[t["name"], t["wanted"], t["got"], _MET[t["met"]]] for t in results["targets"]]
    left_out = [LeftOut(**row) for row in results["left_out"]]
    parts = [
        f"Set {made_by['set']}, seed {made_by['seed']}, {made_by['count']} campaigns a tier of "
        f"{made_by['specimens']} specimens, subset {made_by['subset']}; planner "
        f"{results['planner']}; sha256 of the truth `{results['truth_sha256']}`.",
        "### Targets",
        markdown(["", "target", "reached", "met"], targets),
        "### By tier and signal-to-noise ratio",
        markdown(COLUMNS, table_rows(summary)),
        "".join(f"- {line}\n" for line in overall_lines(summary)),
        "### By detectability, for information",
        markdown(COLUMNS, table_rows(summary, by=("detectability",))),
        "### One effect left out of the library at a time",
        "Gaps are medians of normalised RMS errors of force on held-out conditions; 'true effect' "
        "is the bench's own, with the effect as it was made.",
        markdown(LEFT_OUT_COLUMNS, left_out_rows(left_out)),
    ]
    if results["problems"]:
        lines = (f"- {name}: {problem}\n" for name, problem in results["problems"].items())
        parts += ["### Diagnoses that failed, counted as wrong", "".join(lines)]
    return "\n".join(part if part.endswith("\n") else part + "\n" for part in parts)


def _summary(document: Mapping[str, Any]) -> Summary:
    """Return the summary that a document was made of."""
    rows = []
    for row in document["rows"]:
        counted = {name: Rate(r["hits"], r["of"]) for name, r in row["rates"].items()}
        rates = {name: counted.get(name, Rate(0, 0)) for name in RATES}
        rows.append(Row(**{**row, "rates": rates}))
    return Summary(rows=tuple(rows), **document["overall"])
