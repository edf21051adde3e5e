"""A campaign's folder, read and written."""

import contextlib
import math
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np

from planner.errors import ArgumentError, FileError, UnknownNameError, did_you_mean, nearest_names
from planner.formats.files import decode_toml, path_within, read_file, toml_text
from planner.formats.outputs import write_folder
from planner.formats.specimens import SPECIMEN_COLUMNS, SPECIMEN_TEXTS, read_specimens
from planner.formats.specimens import ListedSpecimen as Row
from planner.formats.tables import encode_csv, number, read_columns
from planner.formats.tensile import TensileTable, mode_of, read_tensile
from planner.formats.units import QUANTITIES
from planner.gap.campaign import Campaign, PartTest, Specimen, StrainField, named
from planner.materials.characterise import MINIMUM_POINTS, UNLOADED_SHARE, check_record
from planner.materials.laws import Law, make_law
from planner.materials.study import in_stated_units, is_negative, place_of_no_load, stated_units
from planner.numerics import FloatArray, IntArray
from planner.palette import Palette, encode_palette, load_palette
from planner.plan import plan_file
from planner.printers import load_printer, palette_of
from planner.simulation.bar import ProfileDesign, read_profile
from planner.simulation.bar_solver import PUSHED_END
from planner.simulation.part_response import PartResponse

__all__ = [
    "CURVES",
    "SPECIMENS",
    "CampaignFile",
    "ListReader",
    "has_curves",
    "read_campaign",
    "read_campaign_file",
    "read_list",
    "said_mode",
    "specimens_csv",
    "write_campaign",
]


# ------------------------------------------------------------------------------------------------
# The further columns of specimens.csv: covariates, and slips in headings.


_ALONG_TESTS = frozenset({"strain", "branch", "time", "position"})
"""Axes of a diagnosis that are no columns."""


Covariates = Mapping[str, str | float | None]


def read_list(path: Path) -> tuple[tuple[Row, ...], dict[str, Covariates], list[str]]:
    """Read a list of specimens.

    Returns
    -------
    rows
        One a specimen.
    covariates
        Further columns by specimen: numbers where all of a column are, None if empty.
    notes
        Columns that look like a slip, a sentence each.

    Raises
    ------
    FileError
        A row or heading that is refused.
    """
    rows = read_specimens(path)
    names, notes = tuple(rows[0].covariates), []
    for heading in names:
        if heading in _ALONG_TESTS:
            raise FileError(
                f"{path.name}: a further column {heading!r} would be taken for what lies along a "
                f"test; give it another name, as {'tray ' + heading!r}"
            )
        near = nearest_names(heading, [*SPECIMEN_TEXTS, *SPECIMEN_COLUMNS], _ALIKE)
        if near and abs(len(near[0]) - len(heading)) <= 2:
            notes.append(
                f"{path.name}: column {heading!r} is unknown and kept as a covariate; rename it if "
                f"it means {near[0]}"
            )
    columns = [_column([row.covariates.get(name, "") for row in rows]) for name in names]
    covariates: dict[str, Covariates] = {
        row.specimen: dict(zip(names, cells, strict=True))
        for row, *cells in zip(rows, *columns, strict=True)
    }
    return rows, covariates, notes


def _column(cells: Sequence[str]) -> list[str | float | None]:
    numbers = {cell: number(cell, ";") for cell in cells if cell}
    if all(value is not None and math.isfinite(value) for value in numbers.values()):
        return [numbers.get(cell) for cell in cells]
    return [cell or None for cell in cells]


_ALIKE = 0.85
"""Share of letters in common from which a heading is asked about. Chosen: one wrong letter in
seven."""


# ------------------------------------------------------------------------------------------------
# Whether a record is of a pull or of a push, whichever way its channels count.


def said_mode(row: Row, in_file: str = "") -> str | None:
    """Return what a row of specimens.csv says of the way of loading, or else the curve's file.

    None where neither says it. A cell says so by itself alone: a batch that was moulded by
    compression may be pulled. What is as short as "uc" may as well be a person's initials, save
    where a mode is asked for.
    """
    others = [cell for cell in row.covariates.values() if len(cell) > 2]
    modes = map(mode_of, (row.mode, *others, in_file))
    return next((mode for mode in modes if mode in ("tension", "compression")), None)


def _turned(
    source: "_Source", force_N: FloatArray, travel_mm: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return force and travel, both positive in tension and negative in compression.

    What is said of a specimen holds. Else both negative are a push, both positive a pull. Where
    one alone is negative, the curve tells, by the law that it is nearer to at any stiffness; where
    laws are too much alike for that, a piece that is wider than long was pushed: no grip holds it.
    What was turned or looks odd is noted.
    """
    said, notes = source.said, source.notes
    # Under a preload no row shows the travel 0 that it counts from.
    down = {"force": is_negative(force_N), "travel": is_negative(np.append(0.0, travel_mm))}
    names = [name for name, negative in down.items() if negative]
    curve = _kind(source, force_N, travel_mm)
    told = said or (curve if len(names) == 1 else None)
    is_wide = source.gauge_mm**2 < (source.row.area_mm2 or 0.0)
    by_signs = is_wide if len(names) == 1 else bool(names)
    pushed = by_signs if told is None else told == "compression"
    if pushed and len(names) == 2:
        notes.append("travel and force are negative; it is compared as compressed")
    elif pushed and said is not None:
        notes.append("compared as compressed, as specimens.csv says")
    elif pushed:
        why = "the curve bends as in compression" if curve else "it is wider than long"
        notes.append(
            f"{names[0]} alone is negative and {why}; it is compared as compressed: if it was "
            "pulled, write tension in a column 'mode'"
        )
    else:
        notes += [f"{name} is negative in tension; its sign was turned" for name in names]
        if said is None and curve == "compression":
            notes.append(
                "compared as pulled, but the curve bends as in compression; if it was pushed, "
                "write compression in a column 'mode'"
            )
    of_force, of_travel = (1.0 if negative is pushed else -1.0 for negative in down.values())
    return of_force * force_N, of_travel * travel_mm


_PLACES = 40
"""Strains at which a curve is looked at. Numerical: laws are straight over a fortieth of them."""


def _kind(source: "_Source", force_N: FloatArray, travel_mm: FloatArray) -> str | None:
    """Return the way of loading whose law a first loading is nearer to, at any stiffness.

    None where there is no law, or two differ by less than the nearer one is missed by.
    """
    if source.law is None:
        return None
    moved = np.abs(travel_mm - travel_mm[0])
    top = int(np.argmax(moved >= 0.95 * moved.max()))
    strain, load = moved[: top + 1] / source.gauge_mm, np.abs(force_N[: top + 1])
    end = min(float(strain.max()), PUSHED_END)
    at = np.linspace(0.0, end, _PLACES + 1)[1:]
    if not end > 0.0 or not load.max() > 0.0:
        return None
    rising, first = np.unique(np.maximum.accumulate(strain), return_index=True)
    laws = [way * source.law.nominal_stress_MPa(1.0 + way * at) for way in (1.0, -1.0)]
    curves = np.stack([np.interp(at, rising, load[first]), *laws])
    curves /= np.maximum(np.linalg.norm(curves, axis=1, keepdims=True), 1e-300)
    pulled, pushed, apart = np.linalg.norm(curves[[0, 0, 1]] - curves[[1, 2, 2]], axis=1)
    if min(pulled, pushed) >= apart - min(pulled, pushed):
        return None
    return "tension" if pulled <= pushed else "compression"


# ------------------------------------------------------------------------------------------------
# From a tensile file's table to a specimen's record of time, travel and force.


@dataclass(frozen=True, slots=True)
class _Source:
    """A specimen's table and row, and what tells a pull from a push.

    Attributes
    ----------
    said
        How it was loaded, as its row says; None where it does not.
    law
        Its material's; None for a bar.
    """

    where: str
    table: TensileTable
    row: Row
    gauge_mm: float
    said: str | None
    law: Law | None
    notes: list[str]
    """What was corrected, without naming the specimen."""
    zeroed_at_preload: bool = False


def _record_of(source: _Source) -> dict[str, Any]:
    """Take time, travel and force of a table, and whether the time was recorded.

    Force and travel count positive in tension and negative in compression (see `_turned`). Travel
    counts from no load, points of one time are averaged, and a time that was not
    recorded is counted from travel and rate; each is noted.

    Raises
    ------
    FileError
        A channel is missing, the record is too short, or time falls; the message names file,
        specimen and line.
    """
    where, points, notes = source.where, len(source.table.lines), source.notes
    force, force_unit_N = _channel(source, "force", source.row.area_mm2)
    travel, travel_unit_mm = _channel(source, "travel", source.gauge_mm)
    check_record(where, {"force_N": force, "displacement_mm": travel})
    if not np.ptp(travel):
        raise FileError(f"{where}: the crosshead never moves; check the column of travel")
    if not np.any(force):
        raise FileError(f"{where}: the force is 0 all along; check the load cell and the column")
    preloaded = source.zeroed_at_preload
    if preloaded or abs(travel[0]) > UNLOADED_SHARE * np.ptp(travel):
        start_mm, told_by = place_of_no_load(travel, force, preloaded=preloaded)
        if told_by:
            notes.append(f"travel counts from {told_by}, not from 0 as recorded")
        travel = travel - start_mm
    force, travel = _turned(source, force, travel)
    time, recorded = _time(source, travel)
    time, starts, counts = np.unique(time, return_index=True, return_counts=True)
    if len(time) < points:
        notes.append("several points of one time, averaged; log time with more digits")
        travel = np.add.reduceat(travel, starts) / counts
        force = np.add.reduceat(force, starts) / counts
        if len(time) < MINIMUM_POINTS:
            raise FileError(
                f"{where}: only {len(time)} different times; check the unit and digits of time"
            )
    return {
        "time_s": time,
        "displacement_mm": travel,
        "force_N": force,
        "time_recorded": recorded,
        "force_unit_N": force_unit_N,
        "travel_unit_mm": travel_unit_mm,
    }


_MADE_OF = {
    "force": ("stress_MPa", "stress times the section in specimens.csv; it was"),
    "travel": ("strain", "strain times the gauge length; the crosshead's was"),
}
"""The column that stands in where force or travel was not recorded, and how that is noted."""


def _channel(
    source: _Source, quantity: str, times: float | None
) -> tuple[FloatArray, float | None]:
    """Return force or travel, and how many newtons or millimetres a unit of the file's has.

    Parameters
    ----------
    times
        What the column that stands in is multiplied by, where it is known.
    """
    column, table, (other, how) = QUANTITIES[quantity][0], source.table, _MADE_OF[quantity]
    if column in table.columns:
        return table.columns[column], table.factors[column]
    if other not in table.columns:
        raise FileError(f"{source.where}: no column of {quantity}; export it, headed {column!r}")
    if times is None:
        raise FileError(
            f"{source.where}: a stress but no force, and the section is unknown; give width_mm and "
            "thickness_mm in specimens.csv"
        )
    source.notes.append(f"{quantity} is {how} not recorded")
    return table.columns[other] * times, None


def _time(source: _Source, travel: FloatArray) -> tuple[FloatArray, bool]:
    if "time_s" not in source.table.columns:
        # How long a hold took no travel tells.
        if (held := source.row.protocol == "relaxation") or source.row.rate_mm_s is None:
            said = "in a relaxation test" if held else "and no rate_mm_s in specimens.csv instead"
            raise FileError(f"{source.where}: no column of time {said}; export it, headed 'time_s'")
        source.notes.append("time was not recorded; it is counted from travel and rate_mm_s")
        path = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(travel)))])
        return path / source.row.rate_mm_s, False
    time = source.table.columns["time_s"]
    if len(fall := np.flatnonzero(np.diff(time) < 0.0)):
        at = int(fall[0])
        raise FileError(
            f"{source.where}, line {source.table.lines[at + 1]}: time falls from {time[at]:g} s to "
            f"{time[at + 1]:g} s; sort or repair the rows"
        )
    return time, True


# ------------------------------------------------------------------------------------------------
# fields.csv: strain along the axis from image correlation.


SPECIMENS, CURVES, _FIELDS = "specimens.csv", "curves.csv", "fields.csv"

_FACET = frozenset({"facet_mm"})


class _Fields:
    """The columns of fields.csv, the line of each row, and the rows of each specimen.

    Without that file there is no row.
    """

    def __init__(self, folder: Path) -> None:
        self.rows: dict[str, list[int]] = {}
        if not (folder / _FIELDS).is_file():
            return
        path = path_within(folder, _FIELDS)
        columns = {"time_s": "time", "x_mm": "length", "strain": None, "facet_mm": "length"}
        file = read_columns(path, columns, optional=_FACET, gaps=_FACET, texts=("specimen",))
        self._columns, self._lines = file.numbers, np.array(file.lines)
        for row, specimen in enumerate(file.texts["specimen"]):
            self.rows.setdefault(specimen, []).append(row)

    def of(self, specimen: str, gauge_mm: float, notes: list[str]) -> StrainField | None:
        """Return a specimen's field, places that were seen at every time; None without one.

        Raises
        ------
        FileError
            One place twice at one time, too few places, or one that lies beyond an end of the
            gauge by more than a facet and 2 % of the gauge; the message names line or specimen.
        """
        if specimen not in self.rows:
            return None
        at = np.array(self.rows[specimen])
        lines, columns = self._lines[at], {name: v[at] for name, v in self._columns.items()}
        times, t = np.unique(columns["time_s"], return_inverse=True)
        x, first, p = np.unique(columns["x_mm"], return_index=True, return_inverse=True)
        count = np.bincount(t * len(x) + p, minlength=len(times) * len(x)).reshape(len(times), -1)
        if count.max() > 1:
            double = int(np.flatnonzero(count[t, p] > 1)[1])
            raise FileError(
                f"{_FIELDS}, line {lines[double]}: specimen {specimen} has a strain at this time "
                "and place already; keep one"
            )
        strain = np.zeros(count.shape)
        strain[t, p] = columns["strain"]
        whole = count.all(axis=0)
        if whole.sum() < 2 or 2 * whole.sum() < len(x):
            raise FileError(
                f"{_FIELDS}, specimen {specimen}: only {whole.sum()} of {len(x)} places were seen "
                f"at all {len(times)} times; export the strains on the same places at each time"
            )
        if not whole.all():
            notes.append("places along the axis not seen at every time are left out")
        x, first = x[whole], lines[first[whole]]
        facet = _stated_facet_mm(columns.get("facet_mm", np.full(len(at), np.nan)), lines)
        if facet is not None and facet > gauge_mm:
            raise FileError(
                f"{_FIELDS}, line {first[0]}: facet_mm is {facet:g}, more than the gauge's "
                f"{gauge_mm:g} mm; give the length that one strain is the mean of"
            )
        field = StrainField(times, x, strain[:, whole], facet)
        slack = field.slack_mm(gauge_mm)
        if len(outside := np.flatnonzero((x < -slack) | (x > gauge_mm + slack))):
            raise FileError(
                f"{_FIELDS}, line {first[outside[0]]}: x_mm is {x[outside[0]]:g}; the gauge goes "
                f"from 0 to {gauge_mm:g} mm; count x_mm along the undeformed gauge from its end, "
                "and leave out what is beyond"
            )
        return field


def _stated_facet_mm(facets: FloatArray, lines: IntArray) -> float | None:
    """Return the one length of a specimen's facets, (r,); None where it is unknown."""
    known = np.isfinite(facets[0])
    odd = np.flatnonzero((facets != facets[0]) | (facets < 0.0) if known else facets >= -np.inf)
    if len(odd):
        raise FileError(
            f"{_FIELDS}, line {lines[odd[0]]}: facet_mm is {facets[odd[0]]:g}; give the specimen's "
            "facets one length, 0 for points, or none where it is unknown"
        )
    return float(facets[0]) if known else None


# ------------------------------------------------------------------------------------------------
# campaign.toml: the campaign's name, its printer and its palette.


_CAMPAIGN = "campaign.toml"


class CampaignFile(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """The content of campaign.toml."""

    schema: Literal[1]
    name: str
    printer: str
    palette: str | None = None
    notes: str = ""
    zeroed_at_preload: bool = False

    def palette_in(self, folder: Path, given: str | Path | Palette | None = None) -> Palette:
        """Load a campaign's palette.

        It is the given one; else the one that campaign.toml names, a file beside it or one of the
        printer's.

        Raises
        ------
        FileError
            It names none.
        PaletteError, UnknownNameError
            The file breaks its schema, or the printer or its palette is not installed.
        """
        if given is not None:
            return palette_of(given, self.printer)
        if self.palette is None:
            raise FileError(
                f'{_CAMPAIGN}: no palette; write palette = "palette.toml", or a palette\'s name'
            )
        beside = path_within(folder, self.palette)
        if self.palette.endswith(".toml") or beside.is_file():
            return load_palette(beside)
        return load_printer(self.printer).palette(self.palette)


def read_campaign_file(folder: str | Path) -> CampaignFile:
    """Read campaign.toml in a folder.

    Raises
    ------
    FileError
        The folder or file is missing, is no TOML, or breaks the schema; the message names the
        key.
    """
    if not isinstance(folder, str | Path) or not Path(folder).is_dir():
        raise FileError(f"{folder}: no such folder; give the folder of a campaign")
    data = read_file(
        path_within(folder, _CAMPAIGN),
        advice="a campaign's folder has a campaign.toml with schema, name, printer and palette",
    )
    try:
        return msgspec.convert(decode_toml(data, _CAMPAIGN), CampaignFile)
    except msgspec.ValidationError as error:
        known = ", ".join(CampaignFile.__struct_fields__)
        raise FileError(f"{_CAMPAIGN}: {error}; its keys are {known}") from error


# ------------------------------------------------------------------------------------------------
# Read a campaign's folder.


def has_curves(folder: Path) -> bool:
    """Say whether there is more in curves.csv than the heading, which a design writes."""
    path = path_within(folder, CURVES)
    return path.is_file() and sum(map(bool, map(bytes.strip, read_file(path).splitlines()))) > 1


_Noted = defaultdict[str, list[str]]
"""Notes with the specimens that each applies to, in order of appearance."""


def read_campaign(
    folder: str | Path,
    palette: str | Path | Palette | None = None,
    unit_of: str | Sequence[str] = (),
) -> Campaign:
    """Read a campaign: campaign.toml, specimens.csv, curves, strain fields and profiles.

    Parameters
    ----------
    folder
        With campaign.toml, specimens.csv and the curves.
    palette
        By name, file or value, in place of the one that campaign.toml names.
    unit_of
        The unit that force or travel is in, whatever the file says: ``"force=lbf:S1,S2"`` for
        some specimens, ``"travel=in"`` for all; one text, or several.

    Returns
    -------
    Campaign
        Its specimens in the order of the list; what was left out is among its remarks.

    Raises
    ------
    FileError
        A file that is missing or cannot be understood, or data that nothing should rest on; the
        message names file and line or specimen, what is wrong and what to do.
    ArgumentError
        A text of `unit_of` that is not QUANTITY=UNIT:ID,ID,...
    PaletteError, UnknownNameError
        The palette, or a material that it does not have; a specimen or unit that there is not.

    Examples
    --------
    >>> len(planner.read_campaign("samples/warm-lab").specimens)  # doctest: +SKIP
    18
    """
    file = read_campaign_file(folder)
    folder = Path(folder)
    palette = file.palette_in(folder, palette)
    rows, covariates, slips = read_list(path_within(folder, SPECIMENS))
    noted: _Noted = defaultdict(list, {note: [] for note in slips})
    tables = _tables(folder, rows, noted)
    fields = _Fields(folder)
    for stray in (specimen for specimen in fields.rows if specimen not in covariates):
        noted[f"in {_FIELDS} but no row in {SPECIMENS}; left out"].append(stray)
    units = stated_units(unit_of, {row.specimen: row.material for row in rows})
    reader = ListReader(folder / SPECIMENS, palette, zeroed_at_preload=file.zeroed_at_preload)
    specimens: list[Specimen] = []
    for row in rows:
        if row.specimen not in tables:
            noted["no curve; left out"].append(row.specimen)
            continue
        id, where = row.specimen, f"specimen {row.specimen} ({tables[row.specimen].file})"
        table = in_stated_units(tables[id], units.get(id, {}), where, named=False)
        specimen, notes = reader.specimen(row, table, where, fields, covariates[id])
        specimens.append(specimen)
        for note in notes:
            noted[note].append(id)
    if not specimens:
        raise FileError(
            f"{folder}: none of the {len(rows)} specimens has a curve; the column 'specimen' of "
            f"{CURVES} and that of {SPECIMENS} must agree"
        )
    return Campaign(
        name=file.name,
        printer=file.printer,
        palette=palette,
        specimens=tuple(specimens),
        covariates=tuple(rows[0].covariates),
        notes=file.notes,
        remarks=tuple(f"{named(ids)}: {note}" if ids else note for note, ids in noted.items()),
    )


class ListReader:
    """What the rows of a list of specimens stand for; what they name lies in the list's folder."""

    def __init__(self, file: Path, palette: Palette, *, zeroed_at_preload: bool = False) -> None:
        self.palette, self._file, self._preloaded = palette, file, zeroed_at_preload
        self._part, self._profiles = cache(self._part_test), dict[str, Path]()

    def fields(self, row: Row) -> tuple[dict[str, Any], list[str]]:
        """Return what a specimen is made of, its sizes and conditions; and what is to be noted.

        Returns
        -------
        fields
            As of `Specimen`.

        Raises
        ------
        FileError
            A size that is missing; a design or part that is missing or not understood.
        UnknownNameError
            No such material.
        """
        where = f"{self._file.name}, specimen {row.specimen}"
        found, notes, design = row.conditions(), list[str](), None
        with _naming(where):
            if row.material:
                found["material"] = self.palette.resolve(row.material).id
            elif row.part:
                part = self._part(row.part, row.fix, row.move, row.load)  # simulated once
                found |= {"part": part, "gauge_mm": part.response.gauge_mm}
            else:
                file, gauge = path_within(self._file.parent, row.profile), found["gauge_mm"]
                design, remarks = read_profile(file, palette=self.palette, gauge_mm=gauge)
                if self._profiles.setdefault(design.name, file) != file:
                    raise FileError(
                        f"another profile is called {design.name!r} too, in "
                        f"{self._profiles[design.name].parent}; rename one of them, as specimens "
                        "of one name count as replicates"
                    )
                found |= {"profile": design, "gauge_mm": design.length_mm}
                notes += remarks
        if found["gauge_mm"] is None:
            raise FileError(f"{where}: the gauge length is unknown; give gauge_mm")
        sides = ("width_mm", "thickness_mm")
        told = any(found[name] or found[f"measured_{name}"] for name in sides)
        # An area alone tells no shape.
        if row.diameter_mm and not (row.part or told):
            found |= dict.fromkeys(sides, math.sqrt(0.25 * math.pi) * row.diameter_mm)
            notes.append(f"a diameter of {row.diameter_mm:g} mm, taken as a square of its section")
        for name in sides:
            drawn = row.part or getattr(design, name, None) is not None
            if not (drawn or found[name] or found[f"measured_{name}"]):
                raise FileError(
                    f"{where}: the section is unknown, so its force cannot be predicted; give "
                    f"{name}, or the diameter_mm of a round specimen"
                )
        return found, notes

    def specimen(
        self, row: Row, table: TensileTable, where: str, measured: _Fields, covariates: Covariates
    ) -> tuple[Specimen, list[str]]:
        """Return a specimen, and what was corrected or left out of it.

        Parameters
        ----------
        where
            What errors call it.
        covariates
            Its own of the list's further columns.

        Raises
        ------
        FileError, UnknownNameError
            As `fields`; or a record that is none.
        """
        told: dict[str, Any] = {
            name: value  # what the file's head tells, the row does not; sides tell the section
            for name, value in table.metadata.items()
            if name != "area_mm2" and getattr(row, name, "") is None
            if isinstance(value, float) and value > 0.0
        }
        row = replace(row, **told)
        fields, notes = self.fields(row)
        # A part's travel counts along its load, whether that pulls or pushes.
        in_file = str(table.metadata.get("mode", ""))
        for cell in (row.mode, in_file):
            if mode_of(cell) in ("planar", "equibiaxial"):
                raise FileError(
                    f"{where}: mode is {cell!r}; a campaign is of tension and compression, so "
                    "leave this specimen out"
                )
        said = "tension" if row.part else said_mode(row, in_file)
        law = make_law(self.palette.resolve(row.material).law) if row.material else None
        gauge_mm, preloaded = fields["gauge_mm"], self._preloaded
        fields |= _record_of(_Source(where, table, row, gauge_mm, said, law, notes, preloaded))
        notes += table.notes
        if row.part and row.specimen in measured.rows:
            notes.append("strains along a whole part are not compared; left out")
        seen = None if row.part else measured.of(row.specimen, fields["gauge_mm"], notes)
        return Specimen(id=row.specimen, covariates=covariates, strain_field=seen, **fields), notes

    def _part_test(self, part: str, fix: str, move: str, load: str) -> PartTest:
        path = path_within(self._file.parent, part)
        if path.is_file() and path.name != "plan.json":
            return PartTest(PartResponse.read(path), fix, move, load)
        if not fix or bool(move) == bool(load):
            raise FileError(
                f"part {part}: give 'fix' and one of 'move' and 'load' (got {fix!r}, {move!r} and "
                f"{load!r}), as in fix x<1 and move x=max: 10,0,0 mm"
            )
        plan = plan_file(path)
        # The solid's solver is slow to import, and few campaigns hold parts.
        from planner.simulation.response import part_response

        supports = re.split(r"\s*;\s*", fix)
        try:
            response = part_response(plan, self.palette, fix=supports, move=move, load=load)
        except ArgumentError as error:
            raise FileError(f"part {part}: {error}") from error
        return PartTest(response, fix, move, load)


def _tables(folder: Path, rows: Sequence[Row], noted: _Noted) -> dict[str, TensileTable]:
    """Read each specimen's table: from the file its row names, else from curves.csv."""
    by_id = {row.specimen: row for row in rows}
    files: dict[str, list[Row]] = {}
    for row in rows:
        files.setdefault(row.file or CURVES, []).append(row)
    if has_curves(folder):
        files.setdefault(CURVES, [])
    elif files.pop(CURVES, None) and not files:
        raise FileError(
            f"{folder}: nothing in {CURVES}; write the curves there (specimen,time_s,"
            f"displacement_mm,force_N), or name a file for each specimen in the column 'file' of "
            f"{SPECIMENS}"
        )
    found: dict[str, TensileTable] = {}
    for name, members in files.items():
        with _naming(SPECIMENS):
            path = path_within(folder, name)
        tables = read_tensile(path)
        if len(tables) == 1 and len(members) == 1 and members[0].file:
            found[members[0].specimen] = tables[0]
            continue
        if any(not table.specimen for table in tables):
            raise FileError(
                f"{name}: no column 'specimen', and {len(members)} specimens of {SPECIMENS} are "
                "in it; add the column, or give each specimen its own file"
            )
        for table in tables:
            listed = by_id.get(table.specimen)
            if listed is not None and (listed.file or CURVES) == name:
                found[table.specimen] = table
                continue
            hint = f"; its row names {listed.file or CURVES}" if listed else ""
            if listed is None and (question := did_you_mean(table.specimen, by_id)):
                hint = f"; {question.rstrip()}"
            said = f"a curve in {name} but no row in {SPECIMENS}{hint}; left out"
            noted[said].append(table.specimen)
    return found


@contextlib.contextmanager
def _naming(where: str) -> Iterator[None]:
    try:
        yield
    except (FileError, UnknownNameError) as error:
        raise type(error)(f"{where}: {error}") from error


# ------------------------------------------------------------------------------------------------
# Write a campaign's folder, as `read_campaign` reads it.


_WRITTEN = sorted(SPECIMEN_COLUMNS, key=lambda name: not SPECIMEN_COLUMNS[name].is_size)
"""Sizes go before conditions."""

_CsvRow = Sequence[str | float | None]


def specimens_csv(campaign: Campaign) -> bytes:
    """Return the list of specimens as a file's bytes; designs of bars as profiles/NAME.csv."""
    files, _ = _own_files(campaign.specimens)
    of_parts = ("part", "fix", "move", "load") if any(s.part for s in campaign.specimens) else ()
    columns = ("specimen", "material", "profile", *of_parts, *_WRITTEN, *campaign.covariates)
    rows: list[_CsvRow] = [columns]
    for s, file in zip(campaign.specimens, files, strict=True):
        own = {name: getattr(s, name) for name in _WRITTEN}
        cells = {**s.covariates, **own, "specimen": s.id, "material": s.material}
        if s.profile is not None:
            cells["profile"] = file
        if s.part is not None:  # its response has its gauge
            cells |= {name: getattr(s.part, name) for name in of_parts[1:]}
            cells |= {"part": file, "gauge_mm": None}
        rows.append(tuple(cells.get(name) for name in columns))
    return encode_csv(rows)


def write_campaign(campaign: Campaign, output: str | Path, *, measured: bool = True) -> Path:
    """Write campaign.toml, palette.toml, specimens.csv, curves.csv, fields.csv, profiles and parts.

    The folder is whole or absent. Reading it gives the campaign back, figures to
    nine digits; writing that again gives the same bytes. Limitations are not written:
    reading finds them again.

    Parameters
    ----------
    campaign
        As it was read, designed or made.
    output
        Folder to write.
    measured
        False leaves out what is yet to be measured: curves.csv has its heading alone.

    Returns
    -------
    pathlib.Path
        The folder.

    Raises
    ------
    OutputError
        The folder exists and is not empty, or cannot be written.

    Examples
    --------
    >>> made = planner.design_campaign("rate,moisture", 16)  # doctest: +SKIP
    >>> planner.write_campaign(made.campaign, "lab", measured=False)  # doctest: +SKIP
    """
    curves = campaign.specimens if measured else ()
    files = {
        "palette.toml": encode_palette(campaign.palette),
        _CAMPAIGN: _campaign_toml(campaign),
        SPECIMENS: specimens_csv(campaign),
        CURVES: encode_csv(_curve_rows(curves)),
        **_own_files(campaign.specimens)[1],
    }
    if any(s.strain_field is not None for s in curves):
        files[_FIELDS] = encode_csv(_field_rows(curves))
    return write_folder(output, files)


def _campaign_toml(campaign: Campaign) -> bytes:
    notes = {"notes": campaign.notes} if campaign.notes else {}
    pairs = {"name": campaign.name, "printer": campaign.printer, "palette": "palette.toml"} | notes
    lines = (f"{key} = {toml_text(value)}\n" for key, value in pairs.items())
    return "".join(["schema = 1\n", *lines]).encode("utf-8")


def _curve_rows(specimens: Sequence[Specimen]) -> Iterable[_CsvRow]:
    yield ("specimen", "time_s", "displacement_mm", "force_N")
    for s in specimens:
        for values in zip(s.time_s, s.displacement_mm, s.force_N, strict=True):
            yield (s.id, *values)


def _field_rows(specimens: Sequence[Specimen]) -> Iterable[_CsvRow]:
    fields = [(s.id, s.strain_field) for s in specimens if s.strain_field is not None]
    stated = any(seen.facet_mm is not None for _, seen in fields)
    yield ("specimen", "time_s", "x_mm", "strain", *(["facet_mm"] if stated else []))
    for id, seen in fields:
        facet = [seen.facet_mm] if stated else []
        for time, strains in zip(seen.time_s, seen.strain, strict=True):
            for x, strain in zip(seen.x_mm, strains, strict=True):
                yield (id, time, x, strain, *facet)


def _own_files(specimens: Sequence[Specimen]) -> tuple[list[str], dict[str, bytes]]:
    """Name a file for each specimen's design or part ("" without), and what it holds.

    Equal ones share one.
    """
    names: list[str] = []
    files: dict[str, bytes] = {}
    for s in specimens:
        if s.profile is not None:
            path, data = "profiles/{}.csv", _profile_csv(s.profile)
        elif s.part is not None:
            path, data = "parts/{}.json", s.part.response.encode()
        else:
            names.append("")
            continue
        number, name = 1, path.format(s.made_of)
        while files.setdefault(name, data) != data:
            number += 1
            name = path.format(f"{s.made_of}-{number}")
        names.append(name)
    return names, files


def _profile_csv(design: ProfileDesign) -> bytes:
    names = ("x_mm", "coordinate", "width_mm", "thickness_mm")
    columns = {name: along for name in names if (along := getattr(design, name)) is not None}
    return encode_csv([tuple(columns), *zip(*columns.values(), strict=True)])
