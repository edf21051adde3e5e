"""Where a campaign stands: what is measured, what is missing, which diagnosis, what comes next."""

import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from planner.errors import PlannerError
from planner.formats.files import path_within
from planner.formats.specimens import SPECIMEN_COLUMNS
from planner.formats.tensile import read_tensile
from planner.gap.campaign_folder import CURVES, SPECIMENS, has_curves, read_campaign_file, read_list
from planner.gap.diagnosis import Diagnosis, read_diagnosis
from planner.gap.effects import EFFECTS
from planner.glance import one_line

__all__ = ["Standing", "campaign_standing", "next_command"]


@dataclass(frozen=True, slots=True)
class Standing:
    """What a campaign's folder has and lacks; of a diagnosis alone, what that says.

    Attributes
    ----------
    listed, missing
        Specimens of the list, and those of them without a curve; none of a diagnosis alone.
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
        stands = f"{measured} of {len(self.listed)} specimens measured"
        return f"{self.campaign}: {stands if self.listed else self.verdict}; {self.next}"

    def document(self) -> dict[str, Any]:
        """Return it as ``--json`` prints it."""
        return {"schema": 1, **{name: getattr(self, name) for name in self.__dataclass_fields__}}


def campaign_standing(campaign: str | Path) -> Standing:
    """Say where a campaign stands: what is measured, what is missing, and what comes next.

    Parameters
    ----------
    campaign
        Its folder, with campaign.toml and specimens.csv; or a diagnosis, its folder or its file.

    Returns
    -------
    Standing
        With the next command.

    Raises
    ------
    FileError
        Neither a campaign nor a diagnosis, or a list or curves that cannot be read.

    Examples
    --------
    >>> planner.campaign_standing("lab").missing  # doctest: +SKIP
    ('D03a', 'D03b')
    """
    folder = Path(campaign)
    diagnosed = (folder / "diagnosis.json").is_file() and not (folder / "campaign.toml").is_file()
    if folder.is_file() or diagnosed:
        found = read_diagnosis(folder)
        command = next_command(found, folder)
        return Standing(found.campaign, (), (), {}, str(folder), found.verdict, command)
    name = read_campaign_file(folder).name
    rows, _, _ = read_list(path_within(folder, SPECIMENS))
    listed = tuple(row.specimen for row in rows)
    tables = read_tensile(path_within(folder, CURVES)) if has_curves(folder) else ()
    curves = {table.specimen for table in tables}
    missing = tuple(
        row.specimen
        for row in rows
        if not (path_within(folder, row.file).is_file() if row.file else row.specimen in curves)
    )
    unknown = {
        name: ids
        for name, column in SPECIMEN_COLUMNS.items()
        if not column.is_size
        and (ids := tuple(row.specimen for row in rows if getattr(row, name) is None))
    }
    at, diagnosis = _diagnosis_of(folder, name, len(listed) - len(missing))
    command = ""
    if not missing and diagnosis is not None:
        command = next_command(diagnosis, at, folder)
    elif not missing:
        target = folder.with_name(f"{folder.resolve().name}-diagnosis")
        command = f"planner gap diagnose {_quoted(folder)} -o {_quoted(target)}"
    found_at, verdict = (None, None) if diagnosis is None else (str(at), diagnosis.verdict)
    return Standing(name, listed, missing, unknown, found_at, verdict, command)


def next_command(
    found: Diagnosis, at: Path | None, campaign: Path | None = None, palette: str | None = None
) -> str:
    """Return the command that follows from a verdict, with the options that it needs; "" for none.

    Conditions of use are the last ones that were tested, to be replaced by the part's own.

    Parameters
    ----------
    at
        The folder or file of the diagnosis; None where none was written.
    campaign
        Its folder, if it is known.
    palette
        What it was diagnosed with in place of its own.
    """
    if found.unit_of:
        again = f" --palette {shlex.quote(palette)}" if palette else ""
        units = "".join(f" --unit-of {shlex.quote(unit.text)}" for unit in found.unit_of)
        return f"planner gap diagnose {_quoted(campaign or Path('CAMPAIGN'))}{again}{units}"
    known = [EFFECTS[one.id] for one in found.effect if one.id in EFFECTS]
    known = [effect for effect in known if effect.advice is None]
    if not known or at is None:
        return ""
    use = ""
    for condition in dict.fromkeys(effect.condition for effect in known if effect.condition):
        levels = found.tested.get(condition)
        if levels:
            level = levels[-1] if isinstance(levels[-1], str) else f"{levels[-1]:.4g}"
            use += f" --{condition.removeprefix('strain_').replace('_', '-')} {level}"
    return f"planner gap correct {_quoted(at)}{use} -o palette-corrected.toml"


def _quoted(path: Path) -> str:
    return shlex.quote(str(path))


def _diagnosis_of(
    folder: Path, campaign: str, measured: int
) -> tuple[Path | None, Diagnosis | None]:
    """Return the folder of a diagnosis of so many specimens, below the campaign or beside it."""
    above, here = folder.resolve().parent, Path.cwd()
    for file in sorted([*folder.glob("*/diagnosis.json"), *above.glob("*/diagnosis.json")]):
        try:
            found = read_diagnosis(file)
        except PlannerError:
            continue
        if found.campaign == campaign and found.specimens == measured:
            at = file.parent
            return (at.relative_to(here) if at.is_relative_to(here) else at), found
    return None, None
