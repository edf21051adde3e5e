"""The results of a run as a section of Markdown."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from benchmarks.withheld.comparison import COLUMNS as NAIVE_COLUMNS
from benchmarks.withheld.comparison import comparison_rows
from benchmarks.withheld.summary import (
    COLUMNS,
    RATES,
    Rate,
    Row,
    Summary,
    markdown,
    overall_lines,
    table_rows,
)
from planner.errors import FileError

__all__ = ["put_into_page", "results_markdown"]

_MET = {True: "yes", False: "no", None: ""}


def results_markdown(results: Mapping[str, Any]) -> str:
    """Return a section for a page of the docs."""
    made_by = results["made_by"]
    summary = _summary(results["summary"])
    targets = [[t["name"], t["wanted"], t["got"], _MET[t["met"]]] for t in results["targets"]]
    parts = [
        f"## The {made_by['set']} set, seed {made_by['seed']}",
        f"{_campaigns(made_by)} of {made_by['specimens']} specimens; planner "
        f"{results['planner']}; sha256 of the truth `{results['truth_sha256']}`, of the method "
        f"`{results['method_sha256']}`. Shares are in per cent, with Wilson's intervals at 95 % "
        "and, among the targets, counts.",
        "### Targets",
        markdown(["", "target", "reached", "met"], targets),
        "### By tier",
        markdown(COLUMNS, table_rows(summary, by=("all",))),
        "The oracle knows the bench's forms, noise and ranges, and fits them through the bench's "
        "solver: it names an effect whose evidence is 5 nats ahead of every other, and misses one "
        "that is left out where every other effect in every form is 5 nats behind. Ours is top-1, "
        "of effects left out 'unknown or class'.",
        "".join(f"- {line}\n" for line in overall_lines(summary)),
    ]
    if results["naive"] is not None:
        parts += [
            "### Beside a naive choice by BIC and a guess",
            "The naive analyst fits every single effect of the library to all points and lets the "
            "BIC choose; log scores are of the right hypothesis, in nats.",
            markdown(NAIVE_COLUMNS, comparison_rows(results["naive"])),
        ]
    if results["problems"]:
        lines = (f"- {name}: {problem}\n" for name, problem in results["problems"].items())
        parts += ["### Diagnoses that failed, counted as wrong", "".join(lines)]
    return "\n".join(part if part.endswith("\n") else part + "\n" for part in parts)


def put_into_page(page: Path, text: str, name: str = "results") -> None:
    """Put a section in place of what stands between a page's two comments of that name.

    Raises
    ------
    FileError
        The page has no such place.
    """
    begin, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->\n"
    before, found, rest = page.read_text(encoding="utf-8").partition(begin)
    _, ended, after = rest.partition(end)
    if not found or not ended:
        raise FileError(
            f"{page}: no place for {name}; mark it by {begin.strip()} and {end.strip()}"
        )
    page.write_text(f"{before}{begin}\n{text}\n{end}{after}", encoding="utf-8", newline="\n")


def _campaigns(made_by: Mapping[str, Any]) -> str:
    if made_by["subset"] == "all":
        return f"{made_by['count']} campaigns a tier"
    return f"Subset {made_by['subset']} of {made_by['count']} campaigns a tier"


def _summary(document: Mapping[str, Any]) -> Summary:
    """Return the summary that a document was made of."""
    rows = []
    for row in document["rows"]:
        counted = {name: Rate(r["hits"], r["of"]) for name, r in row["rates"].items()}
        rates = {name: counted.get(name, Rate(0, 0)) for name in RATES}
        rows.append(Row(**{**row, "rates": rates}))
    return Summary(rows=tuple(rows), **document["overall"])
