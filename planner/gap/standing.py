"""Where a campaign stands: what is measured, what is missing, which diagnosis there is."""

import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from planner.errors import PlannerError
from planner.formats.files import path_within
from planner.formats.specimens import SPECIMEN_COLUMNS
from planner.formats.tensile import read_tensile
from planner.gap.campaign_folder import CURVES, SPECIMENS, read_campaign_file, read_list
from planner.gap.diagnosis import read_diagnosis
from planner.glance import one_line

__all__ = ["Standing", "campaign_standing"]


@dataclass(frozen=True, slots=True)
class Standing:
    """What a campaign's folder has and lacks.

    Attributes
    ----------
    listed, missing
        Specimens of the list, and those of them without a curve.
    unknown
        By column: the specimens whose cell of that condition is empty.
    diagnosis, verdict
        The folder of a diagnosis of these specimens, within the campaign's or beside it.
    next
        The command that comes next; "" where specimens are to be measured first.
    """

    campaign: str
    listed: tuple[str, ...]
    missing: tuple[str, ...]
    unknown: Mapping[str, tuple[str, ...]]
    diagnosis: str | None
    verdict: str | None
    next: str

    @one_line
    def __repr__(self) -> str:
        measured = len(self.listed) - len(self.missing)
        return f"{self.campaign}: {measured} of {len(self.listed)} specimens measured; {self.next}"

    def document(self) -> dict[str, Any]:
        """Return it as ``--json`` prints it."""
        return {"schema": 1, **{name: getattr(self, name) for name in self.__dataclass_fields__}}


def campaign_standing(campaign: str | Path) -> Standing:
    """Say where a campaign stands: what is measured, what is missing, and what comes next.

    Parameters
    ----------
    campaign
        Its folder, with campaign.toml and specimens.csv.

    Returns
    -------
    Standing
        With the next command.

    Raises
    ------
    FileError
        No campaign, or a list or curves that cannot be read.

    Examples
    --------
    >>> planner.campaign_standing("lab").missing  # doctest: +SKIP
    ('D03a', 'D03b')
    """
    folder = Path(campaign)
    name = read_campaign_file(folder).name
    rows, _, _ = read_list(path_within(folder, SPECIMENS))
    listed = tuple(row.specimen for row in rows)
    curves = _with_curve(folder)
    missing = tuple(
        row.specimen
        for row in rows
        if not (path_within(folder, row.file).is_file() if row.file else row.specimen in curves)
    )
    conditions = [name for name, column in SPECIMEN_COLUMNS.items() if not column.is_size]
    empty = {
        column: tuple(row.specimen for row in rows if getattr(row, column) is None)
        for column in conditions
    }
    diagnosis, verdict = _diagnosis_of(folder, name, len(listed) - len(missing))
    return Standing(
        campaign=name,
        listed=listed,
        missing=missing,
        unknown={column: ids for column, ids in empty.items() if ids},
        diagnosis=None if diagnosis is None else str(diagnosis),
        verdict=verdict,
        next=_next(folder, bool(missing), diagnosis, verdict),
    )


def _with_curve(folder: Path) -> set[str]:
    """Return the specimens of curves.csv, of which a design writes the heading alone."""
    path = path_within(folder, CURVES)
    if not path.is_file() or len(path.read_bytes().split(b"\n", 2)) < 3:
        return set()
    return {table.specimen for table in read_tensile(path)}


def _diagnosis_of(folder: Path, campaign: str, measured: int) -> tuple[Path | None, str | None]:
    above = folder.resolve().parent
    for file in sorted([*folder.glob("*/diagnosis.json"), *above.glob("*/diagnosis.json")]):
        try:
            found = read_diagnosis(file)
        except PlannerError:
            continue
        if found.campaign == campaign and found.specimens == measured:
            where = file.parent
            here = Path.cwd()
            return (where.relative_to(here) if where.is_relative_to(here) else where), found.verdict
    return None, None


def _next(folder: Path, unmeasured: bool, diagnosis: Path | None, verdict: str | None) -> str:
    if unmeasured:
        return ""
    if diagnosis is None:
        target = folder.with_name(f"{folder.resolve().name}-diagnosis")
        return f"planner gap diagnose {shlex.quote(str(folder))} -o {shlex.quote(str(target))}"
    if verdict in ("none", "unknown"):
        return ""
    return f"planner gap correct {shlex.quote(str(diagnosis))} -o palette-corrected.toml"
