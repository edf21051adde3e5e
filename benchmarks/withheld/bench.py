"""Diagnose campaigns whose cause is known, and say how often the diagnosis is right.

``python -m benchmarks.withheld.bench campaigns --truth campaigns.truth.json -o results.json``
"""

import sys
from collections.abc import Callable, Collection
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from planner.cli import run
from planner.cli.output import command

if TYPE_CHECKING:
    from benchmarks.withheld.answers import Outcome
    from benchmarks.withheld.results import Results

__all__ = ["app", "bench"]


_NAMED = 5


def bench(
    folder: Annotated[
        Path | None, typer.Argument(help="Folder that holds the campaigns' folders.")
    ] = None,
    truth: Annotated[
        Path | None, typer.Option("--truth", help="The sealed truth of these campaigns (JSON).")
    ] = None,
    sha256: Annotated[
        str | None, typer.Option("--sha256", help="The hash that was published of the truth.")
    ] = None,
    without: Annotated[
        list[str] | None,
        typer.Option("--without", help="Diagnose without this effect; repeatable."),
    ] = None,
    documents: Annotated[
        Path | None,
        typer.Option(
            "--documents",
            help="Score these diagnoses in place of new ones: a folder of CAMPAIGN.json or "
            "CAMPAIGN/diagnosis.json, or an earlier results file.",
        ),
    ] = None,
    jobs: Annotated[int, typer.Option("--jobs", min=1, max=256, help="Processes.")] = 2,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of each diagnosis.")] = 0,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Results file (JSON), with the diagnoses themselves."),
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="Replace an earlier results file.")
    ] = False,
) -> int:
    """Diagnose campaigns whose cause is known and say how often the diagnosis is right.

    Exit code 1 when a campaign could not be diagnosed or was not given.

    Example: [bold]python -m benchmarks.withheld.bench campaigns --truth truth.json[/bold]
    """
    from benchmarks.withheld.results import check_effects, score_outcomes
    from benchmarks.withheld.scoring import read_truth
    from planner.cli.output import in_words, progress
    from planner.errors import ArgumentError
    from planner.formats.files import encode_document
    from planner.formats.outputs import check_absent, write_whole

    if truth is None:
        raise ArgumentError("no truth to score against; give its file with --truth")
    if folder is None and documents is None:
        raise ArgumentError("nothing to score; give the folder of the campaigns, or --documents")
    excluded = tuple(sorted(set(without or ())))
    check_effects(excluded)
    if output is not None:
        check_absent(output, force=force)
    sealed = read_truth(truth, sha256=sha256)
    with progress() as stage:
        if documents is not None:
            outcomes = _written(documents, folder)
        else:
            assert folder is not None
            outcomes = _diagnosed(folder, sealed.campaigns, excluded, jobs, seed, stage)
        results = score_outcomes(outcomes, sealed, without=excluded)
    given = {name: o.document for name, o in outcomes.items() if o.document is not None}
    if output is not None:
        write_whole(output, encode_document(results.document(given)))
    if in_words(lambda: encode_document(results.document())):
        _print(results, output)
    return 1 if results.problems or results.not_diagnosed else 0


def _written(documents: Path, folder: Path | None) -> "dict[str, Outcome]":
    from benchmarks.withheld.answers import Outcome
    from benchmarks.withheld.results import read_documents

    found = read_documents(documents)
    names = found if folder is None else _campaigns(folder)
    problem = f"no document in {documents}"
    return {
        name: Outcome(found[name]) if name in found else Outcome(None, problem=problem)
        for name in names
    }


def _diagnosed(
    folder: Path,
    known: Collection[str],
    without: tuple[str, ...],
    jobs: int,
    seed: int,
    stage: Callable[[str], None],
) -> "dict[str, Outcome]":
    from benchmarks.withheld.answers import Task
    from benchmarks.withheld.results import diagnose_all
    from planner.errors import FileError

    names = _campaigns(folder)
    stranger = next((name for name in names if name not in known), None)
    if stranger is not None:
        raise FileError(
            f"{folder / stranger}: the truth knows nothing of this campaign; give the truth that "
            "was written with the campaigns"
        )
    tasks = [Task(folder / name, without) for name in names]
    answers = diagnose_all(tasks, jobs=jobs, stage=stage, seed=seed)
    return {task.folder.name: outcome for task, outcome in answers}


def _campaigns(folder: Path) -> list[str]:
    from planner.errors import FileError

    names = sorted(file.parent.name for file in folder.glob("*/campaign.toml"))
    if not names:
        raise FileError(
            f"{folder}: no campaign in it; give the folder that holds the campaigns' folders"
        )
    return names


def _print(results: "Results", output: Path | None) -> None:
    from benchmarks.withheld.summary import COLUMNS, DROPPABLE, overall_lines, table_rows
    from planner.cli.output import finding, print_table, say

    rows = table_rows(results.summary)
    kept = [i for i in range(len(COLUMNS)) if any(row[i] for row in rows)]
    truth = results.truth
    print_table(
        [COLUMNS[i] if i < 2 else f">{COLUMNS[i]}" for i in kept],
        [[row[i] for i in kept] for row in rows],
        title=f"{truth.file}: {len(results.scores)} of {len(truth.campaigns)} campaigns"
        + (f", diagnosed without {', '.join(results.without)}" if results.without else ""),
        droppable=[name for name in DROPPABLE if COLUMNS.index(name) in kept],
    )
    for line in overall_lines(results.summary):
        say(line)
    say("shares with 95 % intervals (Wilson)")
    say(f"sha256 of the truth {truth.sha256}")
    for name, problem in list(results.problems.items())[:_NAMED]:
        finding(f"campaign {name}: no answer, counted as wrong: {problem}")
    if len(results.problems) > _NAMED:
        finding(f"{len(results.problems) - _NAMED} more campaigns have no answer")
    if results.not_diagnosed:
        finding(f"{len(results.not_diagnosed)} campaigns of the truth were not given")
    if output is not None:
        say(f"results written to {output}")


app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode="rich")
command(app)(bench)

if __name__ == "__main__":
    sys.exit(run(commands=app))
