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
    "library, SNR > 4": "library, SNR > 4: top-1",
    "library, SNR 2-4": "library, SNR 2-4: top-1",
    "P(truth)": "library: mean probability on the truth",
    "other forms": "other forms: top-1",
    "left out": "left out: unknown or a class",
    "false alarm": "none: false alarm",
    "both of two": "two effects: both",
    "where": "where: true axis among the first two",
    "closure error": "how far: median closure error",
}
"""Headings, and the targets whose figures stand below them."""

_COLUMNS = (
    *("planner", "method", "set", "seed", "count", "specimens", "subset", "truth", *_FIGURES),
    *("log score", "naive log score", "targets met"),
)
_HEAD = f"""# Scoring runs of the diagnosis

Every run of `python -m benchmarks.withheld.run` with `--log`, the latest last; rows are never taken
out. The method is the sha256 over the sources of `planner/gap`, the truth that of the sealed file,
{_HASH_DIGITS} digits of each. The final set is scored once for each method. Shares in per cent with
Wilson's intervals at 95 %, log scores in nats, of the diagnoses with the whole library.

| {" | ".join(_COLUMNS)} |
| {" | ".join(["---"] * len(_COLUMNS))} |
"""


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
    """Append a run's row; a log that is not there begins with what it is."""
    _rows(log)  # a page of another kind is left as it is
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
    table = [[c.strip() for c in line.strip("|").split("|")] for line in lines if line[:1] == "|"]
    if not table or tuple(table[0]) != _COLUMNS or not lines[-1].startswith("|"):
        raise FileError(
            f"{log}: not a log of scoring runs, which ends with a table of {len(_COLUMNS)} "
            "columns; name another file"
        )
    return [dict(zip(_COLUMNS, row, strict=True)) for row in table[2:]]
