"""A set of tensile tests: specimens read, converted, held against what is plausible."""

import math
import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from planner.errors import (
    ArgumentError,
    Caution,
    FileError,
    UnknownNameError,
    as_texts,
    did_you_mean,
    listed,
    positive,
    refused,
)
from planner.formats.files import path_within
from planner.formats.specimens import ListedSpecimen, is_specimens_file, read_specimens
from planner.formats.tensile import MODES, NoRecordError, TensileTable, mode_of, read_tensile
from planner.formats.units import QUANTITIES, UnitOf, slips
from planner.materials import characterise
from planner.materials.characterise import Curve
from planner.numerics import FloatArray

__all__ = [
    "ReadRecord",
    "Study",
    "in_stated_units",
    "is_negative",
    "listed_files",
    "place_of_no_load",
    "read_study",
    "stated_units",
]


# ------------------------------------------------------------------------------------------------
# Which files are replicates of one material, by their names alone.


_REPLICATE = re.compile(
    r"(.+?)(?:[-_]0{0,2}\d|[ _-](?i:s|#|(?:run|rep|test|trial|sample|specimen)[ _]?)\d\d?"
    r"| ?\(\d\d?\))"
)


def _materials_by_name(names: Iterable[str]) -> dict[str, str]:
    """Return a material by specimen's name: the name without the replicate's number.

    A number from ten on behind a hyphen or an underscore is a replicate's only where its stem has
    replicates below ten too: "Ecoflex 00-10" and "Ecoflex 00-30" are two materials, as are "mix_25"
    and "mix_50"; "FLX-10" is one more of "FLX-1", "FLX-2".
    """
    found = {name: match[1] for name in names if (match := _REPLICATE.fullmatch(name))}
    stems = {stem for name, stem in found.items() if re.fullmatch(r"[-_]0*\d", name[len(stem) :])}
    tens = {name: match[1] for name in names if (match := re.fullmatch(r"(.+?)[-_][1-9]\d", name))}
    found |= {name: stem for name, stem in tens.items() if stem in stems}
    return {name: found.get(name, name) for name in names}


# ------------------------------------------------------------------------------------------------
# Signs that a column is not what its heading says: wrong unit, swapped, unloaded.


_LARGEST_STRAIN = 30.0
"""Beyond any elastomer: the softest platinum silicones break at 12 to 20."""

_LARGEST_STRESS_MPA = 500.0
"""Beyond any unreinforced polymer's nominal strength (about 150 MPa)."""

_STIFF_STRESS_MPA = 20.0
"""What bears more and stretches to more than twice its length has to state its unit."""

_LARGEST_UNSTATED_WORK_MPA = 50.0
"""Largest stress times strain of what need not state its unit: few rubbers come near."""

_REVERSAL_SHARE = 0.05
_EVEN = 0.05
_JITTER_SHARE = 0.02
"""Noise of an optically measured strain, as a share of its range."""

_SLIPS = slips("columns")


def _check_plausible(
    strain: FloatArray, stress_MPa: FloatArray, *, unit_stated: bool, sure: bool, where: str
) -> None:
    """Refuse strains and stresses that no polymer reaches.

    A strain without unit counts as a fraction. It is refused where the specimen would stretch
    to more than twice its length under more than 20 MPa, which tells a rigid plastic's per
    cents, or so far that stress times strain exceeds 50 MPa.

    Raises
    ------
    FileError
        Strain or stress out of what is possible; the message names the likely slip.
    """
    largest, peak = float(strain.max()), float(stress_MPa.max())
    if largest > _LARGEST_STRAIN:
        raise FileError(
            f"{where}: strain reaches {largest:.4g} ({100 * largest:.4g} %), more than any "
            f"polymer's ({_LARGEST_STRAIN:g}); if it is in per cent, head the column 'strain (%)'"
        )
    strong = peak > _STIFF_STRESS_MPA or peak * largest > _LARGEST_UNSTATED_WORK_MPA
    if not unit_stated and largest > 1.0 and strong:
        raise FileError(
            f"{where}: strain reaches {largest:.4g} at {peak:.4g} MPa and its heading gives no "
            "unit; per cent is likely: head the column 'strain (%)', or 'strain (mm/mm)' if it "
            "is a fraction after all (and then check the unit of stress: psi?); or give --unit-of "
            "strain=%, or strain=1"
        )
    if peak > _LARGEST_STRESS_MPA and not sure:
        raise FileError(
            f"{where}: stress reaches {peak:.4g} MPa, more than any polymer's "
            f"({_LARGEST_STRESS_MPA:g} MPa); if it is in psi or kPa, say so in the heading; if it "
            "is right, say its unit or the force's by --unit-of stress=MPa or force=N"
        )


def _check_rising(strain: FloatArray, stress_MPa: FloatArray, *, where: str) -> None:
    """Refuse swapped columns and records that unload.

    The crosshead moves at a constant rate, so strain is the column that never falls back and
    has even steps; both standards (ASTM D412, D638) test so.

    Raises
    ------
    FileError
        Stress has even steps and strain uneven ones, or strain falls back and stress never does
        (swapped); or strain falls back by more than 5 % of its range before the peak, or behind
        it while the specimen still bears load (a cyclic test); or stress falls by as much of its
        peak ahead of it while strain stands (relaxation by steps), or begins at its peak.
    """
    peak = int(np.argmax(stress_MPa)) + 1
    span = float(np.ptp(strain))
    if span <= 0.0:
        raise FileError(f"{where}: strain stands at {strain[0]:g} throughout; check the column")
    fallen = np.maximum.accumulate(strain) - strain
    if bool(np.all(np.diff(stress_MPa) >= 0.0)):
        # A strain measured optically jitters beside a smooth load: even steps tell it apart.
        even = _unevenness(stress_MPa) < _EVEN
        back = float(fallen.max()) > (1e-3 if even else _JITTER_SHARE) * span
        if back or (_unevenness(stress_MPa) < 0.01 and _unevenness(strain) > 0.2):
            said = "strain falls back, stress never does" if back else "only stress has even steps"
            raise FileError(
                f"{where}: {said}, as if the columns were swapped (or the test was "
                "load-controlled, which is not understood here); check the headings"
            )
    climbed, largest = np.maximum.accumulate(strain[:peak]), stress_MPa[peak - 1]
    first = np.searchsorted(climbed, climbed - characterise.STILL_SHARE * span)
    held = np.arange(peak) - first > max(characterise.HELD_SHARE * len(strain), 3.0)
    relaxed = np.where(held, stress_MPa[first] - stress_MPa[:peak], 0.0)
    bears = stress_MPa[peak:] > characterise.BROKEN_SHARE * largest
    behind = np.max(fallen[peak:], where=bears, initial=0.0)
    for fall, of, said in (
        (fallen[:peak].max(), span, "strain falls back by {} before the peak load, as in a cyclic"),
        (relaxed.max(), largest, "stress falls by {} while strain stands, as in a relaxation"),
        (behind, span, "strain falls back by {} behind the peak load, under load, as in a cyclic"),
        (largest * (peak == 1), largest, "stress begins at its peak of {}, as in an unloading"),
    ):
        if fall > _REVERSAL_SHARE * of:
            raise FileError(
                f"{where}: {said.format(f'{fall:.4g}')} test; give the first loading alone, from "
                "no load on, or leave it out by protocol 'cyclic' or 'relaxation' in specimens.csv"
                "; name several specimens in a column 'specimen'; if a row is a test, export curves"
            )


def _unevenness(values: FloatArray) -> float:
    steps = np.diff(values)
    mean = float(np.mean(steps))
    return float(np.std(steps)) / mean if mean > 0.0 else np.inf


# ------------------------------------------------------------------------------------------------
# From a specimen's record to its curve of nominal stress against strain.


_LOADS = ("force_N", "stress_MPa", "true_stress_MPa")


@dataclass(frozen=True, slots=True)
class Dimensions:
    """A specimen's section and gauge length where known, and the crosshead's rate.

    Attributes
    ----------
    sources
        Of ``area`` and ``gauge``: where they come from.
    """

    area_mm2: float | None
    gauge_mm: float | None
    rate_mm_s: float | None
    sources: Mapping[str, str] = field(default_factory=dict)


def _states_no_strain_unit(table: TensileTable) -> bool:
    """Say whether the strain in use stands in the file under a heading without unit."""
    used = "strain" if "strain" in table.columns else "true_strain"
    return used in table.columns and used in table.without_unit


_OFF_NOMINAL = 0.05
"""By which a size may differ from the one in a file's head without a word. Chosen: what callipers
measure differs from the nominal size by less."""


def _dimensions_of(
    specimen: ListedSpecimen | None, given: ListedSpecimen, table: TensileTable, notes: list[str]
) -> Dimensions:
    """Return a specimen's size: from its row, else as given, else from the file's head, noted."""
    from_head, sources = list[str](), dict[str, str]()

    def nearest(name: str) -> tuple[float, str] | None:
        said = table.metadata.get(name)
        head = said if isinstance(said, float) and said > 0.0 else None
        for source, where in ((specimen, _SPECIMENS), (given, f"--{name.replace('_', '-')}")):
            value = getattr(source, f"measured_{name}", None) or getattr(source, name, None)
            if value is not None:
                if head and abs(value / head - 1.0) > _OFF_NOMINAL:
                    said = f"its head gives {name} {head:.4g}; {value:.4g} counts, from {where}"
                    notes.append(f"{table.file}: {said}")
                return float(value), where
        if head is None:
            return None
        from_head.append(f"{name} {head:.4g}")
        return head, table.sources.get(name, "")

    def product(of: str, *names: str) -> float | None:
        found = [one for name in names if (one := nearest(name)) is not None]
        if len(found) < len(names):
            return None
        sources[of] = " x ".join(where for _, where in found if where)
        return math.prod(value for value, _ in found)

    sides = ("width_mm", "thickness_mm")
    area = None if specimen is None else specimen.area_mm2
    if area is not None:
        sources["area"] = _SPECIMENS
    elif all(getattr(one, side, None) is None for one in (specimen, given) for side in sides):
        area = None if getattr(specimen, "diameter_mm", None) else product("area", "area_mm2")
        if area is None and (diameter := product("area", "diameter_mm")) is not None:
            area = 0.25 * np.pi * diameter**2
    area = product("area", *sides) if area is None else area
    gauge, rate = product("gauge", "gauge_mm"), product("rate", "rate_mm_s")
    if from_head:
        notes.append(f"{table.file}: its head gives {listed(from_head)}")
    return Dimensions(area, gauge, rate, sources)


_FIRST = 6
"""Rows of a record by which is told where it has no load. Chosen: more than noise needs, and few
enough for a line."""


def place_of_no_load(
    length: FloatArray, load: FloatArray, *, preloaded: bool = False
) -> tuple[float, str]:
    """Return the travel or strain at no load, and what tells it; 0 and "" if it counts from there.

    No load is where a line through the first rows says, or the first row if it has hardly any, or
    if all bear the same: a preload that is held. Where hardly any is borne up to 0, slack was taken
    off, and 0 holds. `preloaded`: it was set to 0 where a preload stood.
    """
    first, middle = float(length[0]), float(np.mean(load[:_FIRST]))
    unloaded = np.abs(load) < characterise.UNLOADED_SHARE * float(np.max(np.abs(load)))
    passed = int(np.argmax(length * first <= 0.0))
    flat = np.ptp(load[: passed or 1]) <= 6.0 * characterise.noise_sd(load)
    if passed >= _FIRST and flat and unloaded[:passed].all():
        return 0.0, ""
    farthest = float(length[np.argmax(np.abs(length - first))])
    if preloaded:  # noise of the load would flatten a line through few rows
        n = max(_FIRST, int(np.argmax(np.abs(load) > 2.0 * abs(middle))))
        rise, base = np.polyfit(length[:n], load[:n], 1).tolist()
        start = -base / (rise or np.inf)
        back = (start - first) * (farthest - first) < 0.0
        return (start, "no load, by a line") if back else (0.0, "")
    rows = np.vander(load[:_FIRST] - middle, 2)
    slope, level = np.linalg.lstsq(rows, length[:_FIRST], rcond=None)[0].tolist()
    start = level - slope * middle
    if abs(start) <= abs(start - first):
        return 0.0, ""
    if unloaded[0] or not np.ptp(load[:_FIRST]) or (start - first) * (farthest - first) > 0.0:
        return first, "its first value"
    return start, f"no load, by a line through its first {_FIRST} rows"


_TURNED_RATIO = 5.0
"""Largest value below zero over the largest above, of what was recorded with its sign turned.
Chosen: a way back past zero is small beside the pull, so that anything well above 1 does."""


def is_negative(values: FloatArray) -> bool:
    """Say whether a load, or a length that counts from its start, has its sign turned."""
    low, high = float(values.min()), float(values.max())
    # A load that begins under a preload stays below zero; one that was not zeroed rises there.
    return -low > _TURNED_RATIO * abs(high) or (high < 0.0 and float(values[0]) > 0.5 * low)


@dataclass(frozen=True, slots=True, eq=False)
class _Test:
    """One specimen's record on its way to a curve; `sign` is -1 where it was compressed."""

    where: str
    record: "_Record"
    columns: Mapping[str, FloatArray]
    sign: float
    notes: list[str]

    def strain(self) -> FloatArray:
        """Return the strain, with its sign turned where the specimen was compressed."""
        columns, gauge_mm = self.columns, self.record.sizes.gauge_mm
        if "strain" in columns:
            strain = columns["strain"]
            begins = abs(strain[0]) <= characterise.UNLOADED_SHARE * np.ptp(strain)
            return strain if begins else self._from_no_load("strain", strain)
        if "true_strain" in columns:
            self.notes.append(f"{self.where}: strain from true (logarithmic) strain")
            return self.sign * np.expm1(self.sign * columns["true_strain"])
        if gauge_mm is None:
            raise FileError(
                f"{self.where}: the gauge length is unknown, so displacement gives no strain; add "
                f"gauge_mm to specimens.csv, or give `gauge_mm`{self._readings('gauge_mm')}"
            )
        return self._from_no_load("displacement", columns["displacement_mm"], " mm") / gauge_mm

    def _from_no_load(self, what: str, values: FloatArray, unit: str = "") -> FloatArray:
        """Return travel or strain, counted from no load, which is noted where it did not."""
        load = next(self.columns[name] for name in _LOADS if name in self.columns)
        start, where = place_of_no_load(values, load)
        if where:
            self.notes.append(f"{self.where}: {what} counted from {where}, {start:.4g}{unit}")
        return values - start

    def stress_MPa(self, strain: FloatArray) -> FloatArray:
        """Return the nominal stress, with its sign turned like that of strain."""
        columns, area_mm2 = self.columns, self.record.sizes.area_mm2
        if "stress_MPa" in columns:
            return columns["stress_MPa"]
        if "force_N" not in columns:
            self.notes.append(f"{self.where}: nominal stress from true stress at constant volume")
            return columns["true_stress_MPa"] / (1.0 + self.sign * strain)
        if area_mm2 is None:
            raise FileError(
                f"{self.where}: the section is unknown, so force gives no stress; add width_mm and "
                "thickness_mm, or diameter_mm, to specimens.csv, or give `width_mm` and "
                "`thickness_mm`"
                f"{self._readings('area_mm2', 'width_mm', 'thickness_mm', 'diameter_mm')}"
            )
        return columns["force_N"] / area_mm2

    def _readings(self, *sizes: str) -> str:
        """Say what the file leaves unclear of sizes that are missing, or ""."""
        unclear = self.record.table.unclear
        said = [unclear[size] for size in sizes if size in unclear]
        return f"; the file has {listed(said)}" if said else ""

    def time_s(self) -> FloatArray | None:
        """Return the time; None where there is none, or it does not rise."""
        time = self.columns.get("time_s")
        if time is not None and len(back := np.flatnonzero(np.diff(time) <= 0.0)):
            line = self.record.table.lines[back[0] + 1]
            self.notes.append(
                f"{self.where}: time does not rise at line {line} ({time[back[0]]:g} s to "
                f"{time[back[0] + 1]:g} s); the time column is left out"
            )
            return None
        return time

    def cross_check(self, strain: FloatArray, stress_MPa: FloatArray) -> None:
        """Compare what the file says twice: by its own columns, and by sizes and rate.

        Where strains differ by more than a third without a known reason that is noted.

        Raises
        ------
        FileError
            They differ by the factor of a known slip of units (within 10 %), or stresses by more
            than a third: a machine's section was not entered, or the stress is a true one.
        """
        columns, sizes, time_s = self.columns, self.record.sizes, self.time_s()
        gauge_mm, area_mm2, rate_mm_s = sizes.gauge_mm, sizes.area_mm2, sizes.rate_mm_s
        twice: list[tuple[str, float, float]] = []
        if gauge_mm is not None and {"strain", "displacement_mm"} <= set(columns):
            travel, what = np.ptp(columns["displacement_mm"]), "travel over gauge length"
            twice.append((f"range of strain against {what}", np.ptp(strain), travel / gauge_mm))
        elif gauge_mm is not None and rate_mm_s is not None and time_s is not None:
            travel, what = rate_mm_s * np.ptp(time_s), "rate times time over length"
            twice.append((f"range of strain against {what}", np.ptp(strain), travel / gauge_mm))
        if area_mm2 is not None and {"stress_MPa", "force_N"} <= set(columns):
            nominal, what = columns["force_N"].max() / area_mm2, "force over section"
            twice.append((f"peak stress against {what}", stress_MPa.max(), nominal))
        for what, stated, derived in twice:
            if not (stated > 0.0 and derived > 0.0):
                continue
            ratio, said = stated / derived, f"{self.where}: {what}: {stated:.4g}"
            if not 0.75 < ratio < 4.0 / 3.0:
                # Of strain the two may differ: by where it is measured.
                size = "correct the size, or leave one out by --columns" * ("strain" not in what)
                advice = next((a for of, a in _SLIPS.items() if abs(ratio / of - 1.0) < 0.1), size)
                if advice:
                    raise FileError(f"{said} against {derived:.4g}; {advice}")
                self.notes.append(Caution(f"{said} to {derived:.4g}; check sizes, units"))


def _curve_of(name: str, record: "_Record", said: str, sure: bool) -> Curve:
    """Turn a record into a checked loading curve; every correction is noted.

    Nominal stress is force over the undeformed section, strain is displacement over gauge
    length; stress and strain in the file go first, and the others then cross-check them.
    True measures are turned to nominal ones for a constant volume: e = exp(e_true) - 1,
    s = s_true / (1 + e). Of a compressed specimen strain and stress are negative; they are
    checked with their signs turned.

    Parameters
    ----------
    said
        The mode that is said, or "".
    sure
        Whether the unit of stress or force was stated.

    Raises
    ------
    FileError
        A size is missing, or the columns are implausible, swapped, cyclic or never load.
    """
    table, where, notes = record.table, f"specimen {name}", list[str]()
    if Path(table.file).stem != name:
        where += f" ({table.file})"
    characterise.check_record(where, {"line": np.asarray(table.lines, dtype=np.float64)})
    sign = -1.0 if said == "compression" else 1.0
    test = _Test(where, record, _upright(table.columns, where, notes, said), sign, notes)
    strain = test.strain()
    stress = test.stress_MPa(strain)
    if sign < 0.0 and float(strain.max()) >= 1.0:
        raise FileError(
            f"{where}: compressed by {float(strain.max()):.4g} of its length, which is more than "
            "all of it; check the unit of strain and the gauge length"
        )
    unit_stated = not _states_no_strain_unit(table)
    _check_plausible(strain, stress, unit_stated=unit_stated, sure=sure, where=where)
    test.cross_check(strain, stress)
    _check_rising(strain, stress, where=where)
    mode = "uniaxial" if said in ("", "tension", "compression") else said
    curve = Curve(name, strain, stress, record.material, (*table.notes, *notes), mode)
    curve = characterise.without_tail(characterise.without_spikes(_from_rest(curve, where)))
    return replace(curve, strain=sign * curve.strain, stress_MPa=sign * curve.stress_MPa)


def _from_rest(curve: Curve, where: str) -> Curve:
    """Leave out points up to the last strain below zero ahead of the peak, and note it."""
    below = np.flatnonzero(curve.strain[: int(np.argmax(curve.stress_MPa))] < 0.0)
    if not len(below):
        return curve
    count = int(below[-1]) + 1
    return curve.part(
        slice(count, None),
        f"{where}: {count} points up to strain {curve.strain[count]:.4g} are left out, for strain "
        f"is negative there (from {curve.strain[:count].min():.4g})",
    )


def _upright(
    columns: Mapping[str, FloatArray], where: str, notes: list[str], said: str
) -> dict[str, FloatArray]:
    """Turn a load or a length that is negative in the way of loading that is said.

    Raises
    ------
    FileError
        Both are negative, as in compression, and nothing says the way of loading.
    """
    negative = [
        name
        for name, values in columns.items()
        # A crosshead's position may be negative throughout and yet rise.
        if name != "time_s" and is_negative(values if name in _LOADS else values - values[0])
    ]
    both = any(name in _LOADS for name in negative) and any(n not in _LOADS for n in negative)
    if both and not said:
        raise FileError(
            f"{where}: {' and '.join(negative)} are negative, as in compression; say --mode "
            "compression, or --mode tension if tension counts negative there (or the same in a "
            f"column 'mode' of {_SPECIMENS})"
        )
    if said != "compression" and not both:
        turned = "its sign was turned, as of tension: if it was compressed, say --mode compression"
        notes.extend(Caution(f"{where}: only {name} is negative; {turned}") for name in negative)
    return {name: -values if name in negative else values for name, values in columns.items()}


# ------------------------------------------------------------------------------------------------
# A lab's tensile tests: files and list of specimens to curves grouped by material.


_SPECIMENS = "specimens.csv"
_SUFFIXES = (".csv", ".txt", ".log", ".tsv", ".dat", ".asc", ".tra", ".lvm",
             ".xlsx", ".xlsm", ".xls", ".ods")  # fmt: skip
_NO_RECORDS = {"fields.csv", "materials.csv"}
"""Strains along bars beside the curves of a campaign, and what planner itself writes."""


@dataclass(frozen=True, slots=True)
class ReadRecord:
    """What was read of one specimen, and where.

    Attributes
    ----------
    sheet
        Of a workbook, else "".
    mode
        ``tension``, ``compression``, ``planar`` or ``equibiaxial``.
    columns
        By name: the heading in the file, with its unit.
    unused
        Headings of the other columns.
    gauge_from, area_from
        Where length and section come from; "" where they are unknown, or not needed.
    left_out
        Why the record is not used, or "".
    """

    file: str
    sheet: str
    specimen: str
    material: str
    mode: str
    columns: Mapping[str, str]
    unused: tuple[str, ...]
    gauge_mm: float | None
    gauge_from: str
    area_mm2: float | None
    area_from: str
    rows: int
    left_out: str = ""


@dataclass(frozen=True, slots=True)
class Study:
    """Curves by material.

    Attributes
    ----------
    groups
        Loading curves in tension to break by material, in the order of specimens.csv or of the
        files.
    specimens
        Rows of specimens.csv by specimen; empty without one.
    notes
        What was corrected, assumed or left out, one sentence each.
    dimensions
        Size and crosshead rate by specimen, whichever source they come from.
    factors
        By specimen and column: what the numbers in the file were multiplied by, its unit.
    other_modes
        The curves of specimens loaded otherwise, by material: planar, equibiaxial, or compressed.
    records
        What was read, a record each, those left out included.
    unlisted
        Files with records that are in no row of specimens.csv.
    """

    groups: Mapping[str, tuple[Curve, ...]]
    specimens: Mapping[str, ListedSpecimen]
    notes: tuple[str, ...]
    dimensions: Mapping[str, Dimensions] = field(default_factory=dict)
    factors: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    other_modes: Mapping[str, tuple[Curve, ...]] = field(default_factory=dict)
    records: tuple[ReadRecord, ...] = ()
    unlisted: tuple[str, ...] = ()

    def findings(self) -> tuple[str, ...]:
        """Return what was in the files and is in no result, one sentence each."""
        said = f"not used; give what is in there a row in {_SPECIMENS}, or move it elsewhere"
        return (f"{listed(self.unlisted, 8)}: {said}",) if self.unlisted else ()


def read_study(
    files: Study | str | Path | Iterable[str | Path],
    *,
    specimens: str | Path | None = None,
    material: str | None = None,
    width_mm: float | None = None,
    thickness_mm: float | None = None,
    gauge_mm: float | None = None,
    columns: Sequence[str] | None = None,
    unit_of: str | Sequence[str] = (),
    mode: str | None = None,
    blocks: str | None = None,
    leave_out: Collection[str] = (),
) -> Study:
    """Read tests and group them by material.

    Parameters
    ----------
    files
        Tensile files, or folders of them; a study is returned as it is. A list of specimens among
        them, or named specimens.csv beside them, says what each one is.
    specimens
        The list of specimens, if it is elsewhere.
    material
        What all specimens without a row are made of; else the file's head or its name without
        the replicate's number tells ("FLX9760-2.csv", "FLX9760_02.csv", "FLX9760 S2.csv"), which
        is noted.
    width_mm, thickness_mm, gauge_mm
        Size of the specimens that neither a row nor a file's head gives.
    columns
        See `planner.formats.tensile.read_tensile`.
    unit_of
        The unit that force, travel, stress or strain is in, whatever the files say:
        ``"force=lbf:S1,S2"`` for some specimens or materials, ``"travel=in"`` for all.
    mode
        How specimens were loaded of which no row says it in a column ``mode``: ``tension``,
        ``compression``, ``planar`` or ``equibiaxial``.
    blocks
        See `planner.formats.tensile.read_tensile`.
    leave_out
        Specimens and materials that no figure is to rest on.

    Raises
    ------
    FileError
        A file that cannot be read or understood, two specimens of one id, an unknown size, or a
        curve that no result should rest on; the message names file, line or specimen.
    ArgumentError
        A size that is not above 0, or no file at all.
    UnknownNameError
        A unit, specimen or material in `unit_of` or `leave_out` that there is not.
    """
    if isinstance(files, Study):
        return files
    given = ListedSpecimen("", width_mm=width_mm, thickness_mm=thickness_mm, gauge_mm=gauge_mm)
    for name in ("width_mm", "thickness_mm", "gauge_mm"):
        if (value := getattr(given, name)) is not None:
            positive(value, f"`{name}`")
    with refused(ArgumentError, f"`files` {files!r}", "give paths of files or folders", TypeError):
        paths = [Path(file) for file in ([files] if isinstance(files, (str, Path)) else files)]
    whole = not any(path.is_file() and not is_specimens_file(path) for path in paths)
    files, listing = _files(paths, None if specimens is None else Path(str(specimens)))
    notes: list[str] = []
    rows: dict[str, ListedSpecimen] = {}
    if listing is not None:
        rows = {row.specimen: row for row in read_specimens(listing)}
        files = _withlisted(files, rows.values(), listing.parent) if whole else files
    if not files:
        raise ArgumentError("no tensile file; name files, or a folder with files in it")
    found_records: list[_Record] = []
    unlisted: list[str] = []
    for path in files:
        named = None if listing is None else _relative(path, listing)
        own = [row for row in rows.values() if row.file == named]
        try:
            tables = read_tensile(path, columns=columns, blocks=blocks, option="--columns")
        except FileError as error:
            poor = isinstance(error, NoRecordError) and path.parent in paths
            if own or path.stem in rows or not (rows or poor):
                raise
            notes.append(Caution(f"{str(error).partition('; ')[0]}; left out"))
            if path.suffix.casefold() in _SUFFIXES and path.name not in _NO_RECORDS:
                unlisted += [] if isinstance(error, NoRecordError) else [path.name]
            continue
        several = len(tables) > 1
        for table in tables:
            row_of_table, why = _row(table, path, own, rows), ""
            if row_of_table is not None:
                why = _left_out(row_of_table)
                notes += [f"specimen {row_of_table.specimen}: {why}; left out"] if why else []
            elif rows:
                what = f"specimen {table.specimen} has no row with this file"
                said = f"{what} in" if own or several else "not named in"
                notes.append(Caution(f"{path.name}: {said} {_SPECIMENS}; left out"))
                why = f"no row in {_SPECIMENS}"
                unlisted.append(path.name + (f", specimen {table.specimen}" if several else ""))
            found_records.append(_Record(path, table, row_of_table, several, why))
    records = _named(found_records)
    materials = _materials(records, material or "", notes)
    records |= {name: replace(records[name], material=of) for name, of in materials.items()}
    units = stated_units(unit_of, materials)
    leave_out = as_texts(leave_out, "`leave_out`")
    for name in leave_out:
        _check_name(name, materials, f"leave_out {name}: no specimen and no material of that name")
    if asked := {name for name, of in materials.items() if not {name, of}.isdisjoint(leave_out)}:
        records |= {name: replace(records[name], left_out="as asked") for name in asked}
        notes.append(f"left out as asked: {listed(list(dict.fromkeys(leave_out)), 6)}")
    used = {name: record for name, record in records.items() if not record.left_out}
    found: dict[str, Curve] = {}
    for name, record in used.items():
        sizes = _dimensions_of(record.row, given, record.table, notes)
        own_units = units.get(name, {})
        table = in_stated_units(record.table, own_units, f"specimen {name}")
        said = _said_mode(record, mode)
        used[name] = replace(record, table=table, mode=said or "tension", sizes=sizes)
        sure = not {"stress", "force"}.isdisjoint(own_units)
        found[name] = _curve_of(name, used[name], said, sure)
    # Who names some files means to leave out the others.
    absent, told = Caution if whole else str, {*found, *asked}
    missing = (row for row in rows.values() if not (row.specimen in told or _left_out(row)))
    notes += [absent(f"specimen {row.specimen}: no curve among the files") for row in missing]
    if unstated := [name for name, one in used.items() if _states_no_strain_unit(one.table)]:
        largest = [abs(float(found[name].strain[-1])) for name in unstated]
        ends = list(dict.fromkeys([min(largest), max(largest)]))
        taken = f"taken as a fraction, up to {' .. '.join(f'{v:.4g}' for v in ends)}"
        said = f"strain of {listed(unstated, 2)} has no unit; {taken}"
        notes.append(Caution(f"{said}; if it is not, give --unit-of strain=%"))
    curves = [found[name] for name in rows or found if name in found]
    if not curves:
        raise FileError("no curve to characterise: " + "; ".join(notes))
    notes.extend(_copies(curves))
    groups: dict[str, tuple[Curve, ...]] = {}
    others: dict[str, tuple[Curve, ...]] = {}
    for curve in curves:
        of = groups if used[curve.specimen].mode == "tension" else others
        of[curve.material] = (*of.get(curve.material, ()), curve)
    notes.extend(dict.fromkeys(note for curve in curves for note in curve.notes))
    dimensions = {name: record.sizes for name, record in used.items()}
    factors = {name: record.table.factors for name, record in used.items()}
    read = tuple(_told(name, one) for name, one in (records | used).items())
    return Study(groups, rows, tuple(notes), dimensions, factors, others, read, tuple(unlisted))


@dataclass(frozen=True, slots=True)
class _Record:
    """What one specimen's table was read from; `in_company` where its file holds others too."""

    path: Path
    table: TensileTable
    row: ListedSpecimen | None
    in_company: bool
    left_out: str = ""
    material: str = ""
    mode: str = ""
    sizes: Dimensions = field(default_factory=lambda: Dimensions(None, None, None))


def _told(name: str, record: _Record) -> ReadRecord:
    table, columns, sizes = record.table, record.table.columns, record.sizes
    gauge = None if {"strain", "true_strain"} & set(columns) else sizes.gauge_mm
    area = None if {"stress_MPa", "true_stress_MPa"} & set(columns) else sizes.area_mm2
    return ReadRecord(
        table.file, table.sheet, name, record.material, record.mode, table.headings, table.unused,
        gauge, "" if gauge is None else sizes.sources.get("gauge", ""),
        area, "" if area is None else sizes.sources.get("area", ""),
        len(table.lines), record.left_out,
    )  # fmt: skip


def _said_mode(record: _Record, given: str | None) -> str:
    """Return how a specimen was loaded, as its row, the option or its file says; else "".

    Raises
    ------
    FileError, ArgumentError
        A way of loading that there is not.
    """
    row, table = record.row, record.table
    of_row = row.mode if row else ""
    if given is not None and mode_of(given) is None:
        raise ArgumentError(f"mode is {given!r}; it must be one of {', '.join(MODES)}")
    said = of_row or given or str(table.metadata.get("mode", ""))
    if said and mode_of(said) is None:
        raise FileError(
            f"{_SPECIMENS if of_row else table.file}, specimen "
            f"{row.specimen if row else table.specimen}: mode is {said!r}; it must be one of "
            f"{', '.join(MODES)}, or empty"
        )
    return mode_of(said) or ""


def _named(found: Sequence[_Record]) -> dict[str, _Record]:
    """Return records by specimen: of names that come in several files, with the file's in front.

    Of files that are called alike in several folders, as of a folder a material, the folder's too.

    Raises
    ------
    FileError
        Two of one name all the same.
    """
    paths = {record.path for record in found}
    stems, apart = [p.stem for p in paths], len({p.name for p in paths}) < len(paths)
    names = [r.row.specimen if r.row else _specimen_name(r.path, r.table) for r in found]
    records: dict[str, _Record] = {}
    for name, record in zip(names, found, strict=True):
        if record.row is None and (apart or names.count(name) > 1):
            path = record.path.absolute()
            file = path.name if stems.count(path.stem) > 1 else path.stem
            file = f"{path.parent.name}_{path.stem}" if apart else file
            name = f"{file} {name}" if record.table.specimen == name else file
        if name in records:
            several = f"; give each specimen of the file a row in {_SPECIMENS}, named as there"
            raise FileError(
                f"{record.path.name}: specimen {name!r} was read from {records[name].path.name} "
                f"already; rename one, or give each its id in {_SPECIMENS}"
                f"{several if record.row and record.in_company else ''}"
            )
        records[name] = record
    return records


def stated_units(
    stated: str | Sequence[str], materials: Mapping[str, str]
) -> Mapping[str, Mapping[str, UnitOf]]:
    """Return the units that are stated of each specimen, by quantity; a material names all its own.

    Raises
    ------
    ArgumentError, UnknownNameError
        See `UnitOf.parsed`; also a name of neither a specimen nor a material.
    """
    found: dict[str, dict[str, UnitOf]] = {}
    for text in as_texts(stated, "`unit_of`"):
        one = UnitOf.parsed(text)
        for name in one.specimens:
            _check_name(name, materials, f"unit_of {text}: no specimen and no material {name!r}")
        for name, of in materials.items():
            if not one.specimens or name in one.specimens or of in one.specimens:
                found.setdefault(name, {})[one.quantity] = one
    return found


def _check_name(name: str, materials: Mapping[str, str], otherwise: str) -> None:
    """Refuse a name of neither a specimen nor a material."""
    known = sorted({*materials, *materials.values()})
    if name not in known:
        there = ", ".join(dict.fromkeys(filter(None, materials.values())))
        hint = did_you_mean(name, known)
        raise UnknownNameError(f"{otherwise}; {hint}there are materials {there}")


def in_stated_units(
    table: TensileTable, units: Mapping[str, UnitOf], where: str, *, named: bool = True
) -> TensileTable:
    """Return a table with columns in the units that were stated for it, which is noted.

    Parameters
    ----------
    named
        Whether the notes begin with `where`.

    Raises
    ------
    FileError
        There is no column of a quantity.
    """
    of = f"{where}: " if named else ""
    for quantity, unit in units.items():
        column = QUANTITIES[quantity][0]
        if column not in table.factors:
            raise FileError(
                f"{where}: its file has no column of {quantity}, so it cannot be read as "
                f"{quantity}={unit.unit}; it has {', '.join(table.factors)}"
            )
        values = table.columns[column] * (unit.factor / table.factors[column])
        said = f"{of}{quantity} is read in the unit {unit.unit}, as was asked for"
        columns, factors = {**table.columns, column: values}, {**table.factors, column: unit.factor}
        bare, notes = table.without_unit - {column}, (*table.notes, said)
        table = replace(table, columns=columns, factors=factors, without_unit=bare, notes=notes)
    return table


def _copies(curves: Sequence[Curve]) -> Iterator[Caution]:
    """Say which records are equal number for number: copies tell nothing of scatter."""
    seen: dict[tuple[bytes, bytes], str] = {}
    for curve in curves:
        key = curve.strain.tobytes(), curve.stress_MPa.tobytes()
        if (first := seen.setdefault(key, curve.specimen)) != curve.specimen:
            yield Caution(
                f"specimen {curve.specimen}: its record equals that of {first}; leave a copy out, "
                "else scatter comes out too small"
            )


def listed_files(files: Iterable[str | Path], specimens: str | Path | None) -> tuple[Path, ...]:
    """Return the files that `read_study` reads: the list of specimens, and what it names."""
    found, listing = _files(files, None if specimens is None else Path(str(specimens)))
    if listing is None:
        return tuple(found)
    return (listing, *_withlisted(found, read_specimens(listing), listing.parent))


def _files(paths: Iterable[str | Path], listing: Path | None) -> tuple[list[Path], Path | None]:
    """Tensile files in the order given, and the list of specimens."""
    files: list[Path] = []
    for path in map(Path, paths):
        if path.is_dir():
            # What begins so is Excel's note of an open workbook, or macOS's of a file.
            inside = sorted(p for p in path.glob("[!.~]*") if p.suffix.casefold() in _SUFFIXES)
            if path / _SPECIMENS in inside and listing in (None, path / _SPECIMENS):
                listing = path / _SPECIMENS
            files.extend(p for p in inside if p.name != _SPECIMENS)
        elif path.name == _SPECIMENS or (path.is_file() and is_specimens_file(path)):
            if listing is not None and listing.resolve() != path.resolve():
                raise FileError(f"{path} and {listing}: two lists of specimens; give one")
            listing = path
        else:
            files.append(path)
    if listing is None:
        beside = {p.parent / _SPECIMENS for p in files if (p.parent / _SPECIMENS).is_file()}
        if len(beside) > 1:
            raise FileError(
                f"{', '.join(sorted(map(str, beside)))}: several lists of specimens; read the "
                "folders one by one, or name one list"
            )
        listing = next(iter(beside), None)
    return files, listing


def _withlisted(files: list[Path], rows: Iterable[ListedSpecimen], folder: Path) -> list[Path]:
    """Add the files that the list names, where the list or its folder was given."""
    names = dict.fromkeys(row.file or "curves.csv" for row in rows)
    named = (path_within(folder, name) for name in names)
    here, called = {path.resolve() for path in files}, {"curves.csv", *(p.name for p in files)}
    # A list that lies elsewhere may name the files of the folder that was given.
    return files + [
        p for p in named if p.resolve() not in here and (p.is_file() or p.name not in called)
    ]


def _relative(path: Path, listing: Path) -> str:
    whole, folder = path.resolve(), listing.resolve().parent
    return whole.relative_to(folder).as_posix() if whole.is_relative_to(folder) else path.name


def _row(
    table: TensileTable, path: Path, own: list[ListedSpecimen], rows: Mapping[str, ListedSpecimen]
) -> ListedSpecimen | None:
    """Return the row of a record: by the file's own column of specimens, else by the file."""
    named = "" if "specimen" in table.metadata else table.specimen
    if not own:
        return rows.get(table.specimen) or rows.get(path.stem)
    if len(own) == 1 and named not in rows:
        return own[0]
    if not named:
        raise FileError(
            f"{path.name}: rows of {listed([row.specimen for row in own], 4)} in {_SPECIMENS} name "
            "this file, and no column 'specimen' in it tells them apart; give each its own file"
        )
    return next((row for row in own if row.specimen == named), None)


def _specimen_name(path: Path, table: TensileTable) -> str:
    # A label in the file's head is often the same in all files of a batch.
    if "specimen" not in table.metadata and table.specimen:
        return table.specimen
    return path.stem.encode("utf-8", "replace").decode("utf-8")  # any bytes make a file's name


_ORDINAL = re.compile(r"(?:[^\W\d_]{0,2}|\w*?(?i:specimen|probe|sample|test))\W*\d+(?:[\W_]+\d+)*")
"""A specimen's name within a file that counts alone: "1 _ 2", "S3", "Specimen 4"."""


def _materials(records: Mapping[str, _Record], given: str, notes: list[str]) -> dict[str, str]:
    """Return what each specimen is made of; of its name alone, noted, where nothing else tells."""
    known: dict[str, str] = {}
    told_by: dict[str, str] = {}
    for name, record in records.items():
        if record.left_out:
            continue
        named = str(record.table.metadata.get("material", ""))
        known[name] = record.row.material if record.row else given or named
        called = record.table.specimen
        counts = record.in_company and (_ORDINAL.fullmatch(called) or mode_of(called))
        told_by[name] = (name.removesuffix(called).strip() or record.path.stem) if counts else name
    unknown = [name for name in known if not known[name]]
    by_name = _materials_by_name(list(dict.fromkeys(told_by[name] for name in unknown)))
    if unknown:
        count = Counter(by_name[told_by[name]] for name in unknown).most_common()
        groups = [m if n == 1 else f"{m} ({n} specimens)" for m, n in count]
        by_file = all(told_by[name] == records[name].path.stem for name in unknown)
        notes.append(
            f"materials by the {'files' if by_file else 'specimens'}' names: {listed(groups, 2)}; "
            f"--material or {_SPECIMENS} says others"
        )
    return {name: known[name] or by_name[told_by[name]] for name in known}


def _left_out(row: ListedSpecimen) -> str:
    """Return why the list itself takes a specimen out, or ""."""
    if row.profile:
        return "a graded bar, of no one material"
    return "" if row.protocol in (None, "monotonic") else f"protocol {row.protocol}"
