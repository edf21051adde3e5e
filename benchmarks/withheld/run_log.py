"""The log of scoring runs: a page with a row for each, so that nobody can fish for a good one."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from planner.errors import FileError

__all__ = ["MIXED", "append_run", "check_not_scored"]

MIXED = "mixed"
"""In place of a method's hash, of a run that went on after the method had changed."""

_HASH_DIGITS = 16
_FIGURES = {
    "library, of the oracle's": "library: named, of what the oracle names",
    "other forms, of the oracle's": "other forms: named, of what the oracle names",
    "in the class": "one effect: truth in the class",
    "left out": "left out: unknown or a class",
    "sure but wrong": "left out: sure but wrong",
    "false alarm": "none: false alarm",
    "both of two": "two effects: both",
    "where": "where: true axis among the first two",
    "closure error": "how far: median closure error",
}
"""Headings, and the targets whose figures stand below them."""

_RUN = ("planner", "method", "set", "seed", "count", "specimens", "subset", "truth")
_COLUMNS = (*_RUN, *_FIGURES, "log score", "naive log score", "targets met")
_TABLE = f"""
| {" | ".join(_COLUMNS)} |
| {" | ".join(["---"] * len(_COLUMNS))} |
"""
_HEAD = f"""# Scoring runs of the diagnosis

Every run of `python -m benchmarks.withheld.run` with `--log`, the latest last; rows are never taken
out. The method is the sha256 over the sources of `planner/gap`, the truth that of the sealed file,
{_HASH_DIGITS} digits of each. The final set is scored once for each method. Shares in per cent with
Wilson's intervals at 95 %, log scores in nats, of the diagnoses with the whole library.
{_TABLE}"""


def check_not_scored(log: Path, method: str) -> None:
    """Refuse a method that the log has on the final set already.

    Raises
    ------
    FileError
        It has, or the log cannot be read.
    """
    for row in _rows(log):
        if row["set"] == "final" and row["method"] == method[:_HASH_DIGITS]:
            raise FileError(
                f"{log}: method {method[:_HASH_DIGITS]} was scored on the final set already, with "
                f"seed {row['seed']}; a method is scored there once: change planner/gap, or go on "
                "with --set development"
            )


def append_run(log: Path, results: Mapping[str, Any], method: str) -> None:
    """Append a run's row; a log that is not there begins with what it is.

    Where the figures are others than the log's last ones, a table of its own begins.
    """
    rows = _rows(log)  # a page of another kind is left as it is
    made_by = results["made_by"]
    targets = {t["name"]: t for t in results["targets"]}
    naive = results.get("naive")
    held = [t["met"] for t in targets.values() if t["met"] is not None]
    cells = [
        results["planner"],
        method[:_HASH_DIGITS],
        *(str(made_by[k]) for k in ("set", "seed", "count", "specimens", "subset")),
        results["truth_sha256"][:_HASH_DIGITS],
        *(targets[name]["got"] if name in targets else "" for name in _FIGURES.values()),
        f"{results['log_score']:.2f}",
        "" if naive is None else f"{naive['overall']['naive_log_score']:.2f}",
        f"{sum(held)} of {len(held)}",
    ]
    text = log.read_text(encoding="utf-8") if log.exists() else _HEAD
    if rows and tuple(rows[-1]) != _COLUMNS:
        text += _TABLE
    log.parent.mkdir(parents=True, exist_ok=True)
    row = f"| {' | '.join(cells)} |\n"
    log.write_text(text.rstrip("\n") + "\n" + row, encoding="utf-8", newline="\n")


def _rows(log: Path) -> list[dict[str, str]]:
    if not log.exists():
        return []
    try:
        lines = log.read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError) as error:
        raise FileError(f"{log}: cannot be read ({error}); name the log of runs") from error
    found: list[dict[str, str]] = []
    head: tuple[str, ...] = ()
    for line in lines:
        cells = tuple(c.strip() for c in line.strip("|").split("|")) if line[:1] == "|" else ()
        if not cells or set(cells) == {"---"}:
            head = head if cells else ()
        elif head:
            found.append(dict(zip(head, cells, strict=True)))
        else:
            head = cells
    if not head or not set(_RUN) <= set(head):
        raise FileError(
            f"{log}: not a log of scoring runs, which ends with a table of them; name another file"
        )
    return found
