"""From a tensile file's table to a specimen's record of time, travel and force."""

from dataclasses import dataclass

import numpy as np

from planner.arrays import FloatArray
from planner.errors import FileError
from planner.formats.tensile import TensileTable
from planner.gap.specimen import MINIMUM_POINTS

__all__ = ["Record", "Sizes", "record_of"]

START_SHARE = 0.02
"""Below this share of its largest value a first force is none, and a first travel is rest."""

_TURNED_RATIO = 5.0


@dataclass(frozen=True, slots=True)
class Sizes:
    """What turns strain and stress into travel and force, where known; and the declared rate."""

    gauge_mm: float
    area_mm2: float | None
    rate_mm_s: float | None


@dataclass(frozen=True, slots=True, eq=False)
class Record:
    """One specimen's measurement; `notes` say what was corrected, without naming it."""

    time_s: FloatArray
    displacement_mm: FloatArray
    force_N: FloatArray
    time_recorded: bool
    notes: tuple[str, ...]


def record_of(table: TensileTable, sizes: Sizes, *, where: str) -> Record:
    """Take time, travel and force of a table.

    Force that counts negative in tension is turned, travel counts from its unloaded start,
    points of one time are averaged, and a time that was not recorded is counted from travel and
    rate; each is noted.

    Raises
    ------
    FileError
        A channel is missing, the record is too short, or time falls; the message names file,
        specimen and line.
    """
    if len(table.lines) < MINIMUM_POINTS:
        raise FileError(
            f"{where}: the curve has {len(table.lines)} points; at least {MINIMUM_POINTS} are "
            "needed: export all of it, or take the specimen out of specimens.csv"
        )
    notes: list[str] = []
    force = _upright(_force(table, sizes, where, notes), "force", notes)
    travel = _upright(_travel(table, sizes, where, notes), "travel", notes)
    if not np.any(force > 0.0):
        raise FileError(f"{where}: no force above 0; check the load cell, its sign and the column")
    reach = float(np.max(np.abs(travel)))
    if reach == 0.0:
        raise FileError(f"{where}: the crosshead never moves; check the column of travel")
    unloaded = abs(force[0]) < START_SHARE * float(np.max(force))
    if unloaded and abs(travel[0]) > START_SHARE * float(np.ptp(travel)):
        notes.append("travel counts from its unloaded start, not from 0 as recorded")
        travel = travel - travel[0]
    time, recorded = _time(table, travel, sizes, where, notes)
    same = np.flatnonzero(np.diff(time) == 0.0)
    if len(same):
        notes.append("several points of one time, averaged; log time with more digits")
        starts = np.flatnonzero(np.concatenate([[True], np.diff(time) > 0.0]))
        counts = np.diff(np.append(starts, len(time)))
        time = time[starts]
        travel = np.add.reduceat(travel, starts) / counts
        force = np.add.reduceat(force, starts) / counts
        if len(time) < MINIMUM_POINTS:
            raise FileError(
                f"{where}: only {len(time)} different times; check the unit and digits of time"
            )
    return Record(time, travel, force, recorded, (*notes, *table.notes))


def _force(table: TensileTable, sizes: Sizes, where: str, notes: list[str]) -> FloatArray:
    if "force_N" in table.columns:
        return table.columns["force_N"]
    if "stress_MPa" not in table.columns:
        raise FileError(f"{where}: no column of force; export it, headed 'force_N'")
    if sizes.area_mm2 is None:
        raise FileError(
            f"{where}: a stress but no force, and the section is unknown; give width_mm and "
            "thickness_mm in specimens.csv"
        )
    notes.append("force is stress times the section in specimens.csv; it was not recorded")
    return table.columns["stress_MPa"] * sizes.area_mm2


def _travel(table: TensileTable, sizes: Sizes, where: str, notes: list[str]) -> FloatArray:
    if "displacement_mm" in table.columns:
        return table.columns["displacement_mm"]
    if "strain" not in table.columns:
        raise FileError(f"{where}: no column of travel; export it, headed 'displacement_mm'")
    notes.append("travel is strain times the gauge length; the crosshead's was not recorded")
    return table.columns["strain"] * sizes.gauge_mm


def _upright(values: FloatArray, what: str, notes: list[str]) -> FloatArray:
    """Turn a channel that counts negative in tension."""
    if float(-values.min()) <= _TURNED_RATIO * abs(float(values.max())):
        return values
    notes.append(f"{what} is negative in tension; its sign was turned")
    return -values


def _time(
    table: TensileTable, travel: FloatArray, sizes: Sizes, where: str, notes: list[str]
) -> tuple[FloatArray, bool]:
    if "time_s" not in table.columns:
        if sizes.rate_mm_s is None:
            raise FileError(
                f"{where}: no column of time and no rate_mm_s; export the time, headed 'time_s', "
                "or give the rate in specimens.csv"
            )
        notes.append("time was not recorded; it is counted from travel and rate_mm_s")
        path = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(travel)))])
        return path / sizes.rate_mm_s, False
    time = table.columns["time_s"]
    fall = np.flatnonzero(np.diff(time) < 0.0)
    if len(fall):
        at = int(fall[0])
        reversed_ = len(fall) == len(time) - 1
        what = "the rows stand in reversed order" if reversed_ else "sort or repair the rows"
        raise FileError(
            f"{where}, line {table.lines[at + 1]}: time falls from {time[at]:g} s to "
            f"{time[at + 1]:g} s; {what}"
        )
    if time[0] < 0.0:
        notes.append(f"time counts from its first value, {time[0]:g} s")
        time = time - time[0]
    return time, True
