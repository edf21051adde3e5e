"""From a specimen's record to its curve of nominal stress against strain."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planner.arrays import FloatArray
from planner.errors import FileError
from planner.formats.tensile import Specimen, TensileTable
from planner.materials.curve import MINIMUM_POINTS, Curve
from planner.materials.rupture import without_tail
from planner.measurement.plausibility import check_agreement, check_plausible, check_rising

__all__ = ["Dimensions", "curve_of", "dimensions_of", "states_no_strain_unit"]

START_SHARE = 0.02
"""A record whose first load is below this share of its peak starts unloaded."""

_LOADS = ("force_N", "stress_MPa", "true_stress_MPa")


@dataclass(frozen=True, slots=True)
class Dimensions:
    """A specimen's section and gauge length where known, and the crosshead's rate."""

    area_mm2: float | None
    gauge_mm: float | None
    rate_mm_s: float | None


def states_no_strain_unit(table: TensileTable) -> bool:
    """Say whether the strain in use stands in the file under a heading without unit."""
    used = "strain" if "strain" in table.columns else "true_strain"
    return used in table.columns and used in table.without_unit


def dimensions_of(specimen: Specimen | None, given: Specimen, table: TensileTable) -> Dimensions:
    """Return a specimen's size: from its row, else as given, else from the file's head."""
    head = table.metadata

    def size(name: str) -> float | None:
        for source in (specimen, given):
            value = None if source is None else getattr(source, name)
            if value is not None:
                return float(value)
        value = head.get(name)
        return float(value) if isinstance(value, float) and value > 0.0 else None

    area = None if specimen is None else specimen.area_mm2
    if area is None:
        width, thickness = size("width_mm"), size("thickness_mm")
        area = None if width is None or thickness is None else width * thickness
    return Dimensions(area, size("gauge_mm"), size("rate_mm_s"))


def curve_of(table: TensileTable, *, specimen: str, material: str, dimensions: Dimensions) -> Curve:
    """Turn a record into a checked loading curve; every correction is noted.

    Nominal stress is force over the undeformed section, strain is displacement over gauge
    length; stress and strain in the file go first, and the others then cross-check them.
    True measures are turned to nominal ones for a constant volume: e = exp(e_true) - 1,
    s = s_true / (1 + e).

    Raises
    ------
    FileError
        A size is missing, or the columns are implausible, swapped, cyclic or never load.
    """
    where = f"specimen {specimen}"
    if Path(table.file).stem != specimen:
        where += f" ({table.file})"
    if len(table.lines) < MINIMUM_POINTS:
        raise FileError(
            f"{where}: the record has {len(table.lines)} points; at least {MINIMUM_POINTS} are "
            "needed to characterise it"
        )
    notes: list[str] = []
    columns = _upright(table.columns, where, notes)
    strain = _strain(columns, dimensions, where, notes)
    stress = _stress(columns, strain, dimensions, where, notes)
    time = _time(columns.get("time_s"), table, where, notes)
    unit_stated = not states_no_strain_unit(table)
    check_plausible(strain, stress, unit_stated=unit_stated, where=where)
    notes.extend(_cross_check(columns, strain, stress, time, dimensions, where))
    check_rising(strain, stress, where=where)
    tension = slice(_compressed(strain, stress, where, notes), None)
    curve = Curve(
        specimen,
        strain[tension],
        stress[tension],
        None if time is None else time[tension],
        material,
        (*table.notes, *notes),
    )
    return without_tail(curve)


def _upright(
    columns: Mapping[str, FloatArray], where: str, notes: list[str]
) -> dict[str, FloatArray]:
    """Turn a load or a length that counts tension negative; both at once are compression."""
    negative = []
    for name, values in columns.items():
        # A crosshead's position may be negative throughout and yet rise.
        change = values if name in _LOADS else values - values[0]
        if name != "time_s" and -float(change.min()) > 5.0 * abs(float(change.max())):
            negative.append(name)
    if any(name in _LOADS for name in negative) and any(name not in _LOADS for name in negative):
        raise FileError(
            f"{where}: {' and '.join(negative)} are negative, as in compression; give a tensile "
            "test, or turn the signs in the file if tension counts negative there"
        )
    notes.extend(
        f"{where}: {name} is negative in tension; its sign was turned" for name in negative
    )
    return {name: -values if name in negative else values for name, values in columns.items()}


def _compressed(strain: FloatArray, stress: FloatArray, where: str, notes: list[str]) -> int:
    """Return how many points lie before the last strain below zero ahead of the peak."""
    below = np.flatnonzero(strain[: int(np.argmax(stress))] < 0.0)
    if not len(below):
        return 0
    count = int(below[-1]) + 1
    notes.append(
        f"{where}: {count} points up to strain {strain[count]:.4g} are left out, for strain is "
        f"negative there (from {strain[:count].min():.4g})"
    )
    return count


def _strain(
    columns: dict[str, FloatArray], dimensions: Dimensions, where: str, notes: list[str]
) -> FloatArray:
    if "strain" in columns:
        return columns["strain"]
    if "true_strain" in columns:
        notes.append(f"{where}: strain from true (logarithmic) strain")
        return np.expm1(columns["true_strain"])
    if dimensions.gauge_mm is None:
        raise FileError(
            f"{where}: the gauge length is unknown, so displacement gives no strain; add "
            "gauge_mm to specimens.csv, or give --gauge-mm"
        )
    displacement = columns["displacement_mm"]
    load = next(columns[name] for name in _LOADS if name in columns)
    if displacement[0] != 0.0 and abs(load[0]) < START_SHARE * float(np.max(np.abs(load))):
        notes.append(
            f"{where}: displacement counted from its first value, {displacement[0]:.4g} mm"
        )
        displacement = displacement - displacement[0]
    return displacement / dimensions.gauge_mm


def _stress(
    columns: dict[str, FloatArray],
    strain: FloatArray,
    dimensions: Dimensions,
    where: str,
    notes: list[str],
) -> FloatArray:
    if "stress_MPa" in columns:
        return columns["stress_MPa"]
    if "force_N" not in columns:
        notes.append(f"{where}: nominal stress from true stress at constant volume")
        return columns["true_stress_MPa"] / (1.0 + strain)
    if dimensions.area_mm2 is None:
        raise FileError(
            f"{where}: the section is unknown, so force gives no stress; add width_mm and "
            "thickness_mm to specimens.csv, or give --width-mm and --thickness-mm"
        )
    return columns["force_N"] / dimensions.area_mm2


def _time(
    time: FloatArray | None, table: TensileTable, where: str, notes: list[str]
) -> FloatArray | None:
    if time is None:
        return None
    back = np.flatnonzero(np.diff(time) <= 0.0)
    if len(back):
        line = table.lines[back[0] + 1]
        notes.append(
            f"{where}: time does not rise at line {line} ({time[back[0]]:g} s to "
            f"{time[back[0] + 1]:g} s); the time column is left out"
        )
        return None
    if time[0] < 0.0:
        notes.append(f"{where}: time starts at {time[0]:g} s; counted from there")
        time = time - time[0]
    return time


def _cross_check(
    columns: dict[str, FloatArray],
    strain: FloatArray,
    stress: FloatArray,
    time: FloatArray | None,
    dimensions: Dimensions,
    where: str,
) -> list[str]:
    """Compare what the file says twice: by its own columns, and by sizes and rate."""
    notes: list[str] = []
    gauge, area = dimensions.gauge_mm, dimensions.area_mm2
    if "strain" in columns and "displacement_mm" in columns and gauge is not None:
        travel = float(np.ptp(columns["displacement_mm"])) / gauge
        what = "range of strain against displacement over gauge length"
        notes += check_agreement(float(np.ptp(strain)), travel, what=what, where=where)
    elif time is not None and dimensions.rate_mm_s is not None and gauge is not None:
        travel = dimensions.rate_mm_s * float(time[-1] - time[0]) / gauge
        what = "range of strain against crosshead rate times time over gauge length"
        notes += check_agreement(float(np.ptp(strain)), travel, what=what, where=where)
    if "stress_MPa" in columns and "force_N" in columns and area is not None:
        nominal = float(np.max(columns["force_N"])) / area
        what = "peak stress against force over section"
        notes += check_agreement(float(np.max(stress)), nominal, what=what, where=where)
    return notes
