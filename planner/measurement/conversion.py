"""From a specimen's record to its curve of nominal stress against strain."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planner.arrays import FloatArray
from planner.errors import FileError
from planner.formats.tensile import Specimen, TensileTable
from planner.materials.curve import MINIMUM_POINTS, Curve
from planner.materials.rupture import without_tail
from planner.measurement.plausibility import check_agreement, check_plausible, check_rising

__all__ = ["Dimensions", "curve_of", "dimensions_of"]

START_SHARE = 0.02
"""A record whose first load is below this share of its peak starts unloaded."""


@dataclass(frozen=True, slots=True)
class Dimensions:
    """A specimen's section and gauge length where known, and the crosshead's rate."""

    area_mm2: float | None
    gauge_mm: float | None
    rate_mm_s: float | None


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
    columns = {name: _upright(name, values, where, notes) for name, values in table.columns.items()}
    strain = _strain(columns, dimensions, where, notes)
    stress = _stress(columns, strain, dimensions, where, notes)
    time = _time(columns.get("time_s"), table, where, notes)
    unit_stated = "strain" not in columns or "strain" not in table.without_unit
    notes.extend(check_plausible(strain, stress, unit_stated=unit_stated, where=where))
    notes.extend(_cross_check(columns, strain, stress, time, dimensions, where))
    check_rising(strain, stress, where=where)
    curve = Curve(specimen, strain, stress, time, material, (*table.notes, *notes))
    return without_tail(curve)


def _upright(name: str, values: FloatArray, where: str, notes: list[str]) -> FloatArray:
    """Turn a record whose tension counts negative."""
    if name == "time_s" or abs(float(values.min())) <= 5.0 * abs(float(values.max())):
        return values
    notes.append(f"{where}: {name} is negative in tension; its sign was turned")
    return -values


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
    load = columns["force_N"] if "force_N" in columns else next(iter(_loads(columns)))
    if displacement[0] != 0.0 and abs(load[0]) < START_SHARE * float(np.max(np.abs(load))):
        notes.append(
            f"{where}: displacement counted from its first value, {displacement[0]:.4g} mm"
        )
        displacement = displacement - displacement[0]
    return displacement / dimensions.gauge_mm


def _loads(columns: dict[str, FloatArray]) -> list[FloatArray]:
    return [columns[name] for name in ("stress_MPa", "true_stress_MPa") if name in columns]


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
