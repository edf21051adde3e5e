"""Read a campaign's folder."""

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import cast

from planner.errors import FileError, UnknownNameError, nearest_names
from planner.formats.tensile import Specimen as Row
from planner.formats.tensile import TensileTable, read_specimens, read_tensile
from planner.gap.campaign import Campaign
from planner.gap.campaign_file import palette_of, read_campaign_file
from planner.gap.limitations import named
from planner.gap.profile_design import read_profile
from planner.gap.record import Sizes, record_of
from planner.gap.specimen import Orientation, Protocol, Specimen
from planner.gap.specimen_columns import check_headings, covariates_of
from planner.gap.strain_fields import MeasuredField, read_strain_fields
from planner.palette import Palette

__all__ = ["read_campaign"]

SPECIMENS, CURVES, FIELDS = "specimens.csv", "curves.csv", "fields.csv"


def read_campaign(folder: str | Path, palette: Palette | None = None) -> Campaign:
    """Read a campaign: campaign.toml, specimens.csv, curves, strain fields and profiles.

    Parameters
    ----------
    palette
        In place of the one that campaign.toml names.

    Raises
    ------
    FileError
        A file that is missing or cannot be understood, or data that nothing should rest on; the
        message names file and line or specimen, what is wrong and what to do.
    PaletteError, UnknownNameError
        The palette, or a material that it does not have.
    """
    folder = Path(folder)
    file = read_campaign_file(folder)
    palette = palette_of(file, folder) if palette is None else palette
    rows = read_specimens(folder / SPECIMENS)
    noted = _Notes()
    for note in check_headings(rows, SPECIMENS):
        noted.add(note)
    tables = _tables(folder, rows, noted)
    fields: dict[str, MeasuredField] = {}
    if (folder / FIELDS).is_file():
        fields = read_strain_fields(folder / FIELDS)
        for note, stray in _strays(fields, rows, FIELDS):
            noted.add(note, stray)
    covariates = covariates_of(rows)
    place = _Place(folder, palette, noted)
    specimens: list[Specimen] = []
    for row in rows:
        if row.specimen not in tables:
            noted.add("no curve; left out", row.specimen)
            continue
        measured = fields.get(row.specimen), covariates[row.specimen]
        specimens.append(_specimen(row, tables[row.specimen], *measured, place))
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
        remarks=tuple(noted.sentences()),
    )


class _Notes:
    """Notes with the specimens that each applies to, in order of appearance."""

    def __init__(self) -> None:
        self._ids: dict[str, list[str]] = {}

    def add(self, note: str, *ids: str) -> None:
        self._ids.setdefault(note, []).extend(ids)

    def sentences(self) -> Iterator[str]:
        for note, ids in self._ids.items():
            yield f"{named(ids)}: {note}" if ids else note


@dataclass(frozen=True, slots=True)
class _Place:
    folder: Path
    palette: Palette
    noted: _Notes


def _tables(folder: Path, rows: Sequence[Row], noted: _Notes) -> dict[str, TensileTable]:
    """Read each specimen's table: from the file its row names, else from curves.csv."""
    by_id = {row.specimen: row for row in rows}
    files: dict[str, list[Row]] = {}
    for row in rows:
        files.setdefault(row.file or CURVES, []).append(row)
    if (folder / CURVES).is_file():
        files.setdefault(CURVES, [])
    elif CURVES in files and len(files) > 1:
        del files[CURVES]
    elif CURVES in files:
        raise FileError(
            f"{folder}: no {CURVES}; write the curves there (specimen,time_s,displacement_mm,"
            f"force_N), or name a file for each specimen in the column 'file' of {SPECIMENS}"
        )
    found: dict[str, TensileTable] = {}
    for name, members in files.items():
        tables = read_tensile(folder / name)
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
            near = [] if listed else nearest_names(table.specimen, list(by_id))
            hint = f"; did you mean {near[0]}?" if near else hint
            noted.add(
                f"a curve in {name} but no row in {SPECIMENS}{hint}; left out", table.specimen
            )
    return found


def _strays(
    found: Mapping[str, object], rows: Sequence[Row], name: str
) -> Iterator[tuple[str, str]]:
    known = {row.specimen for row in rows}
    for specimen in found:
        if specimen not in known:
            yield f"in {name} but no row in {SPECIMENS}; left out", specimen


def _specimen(
    row: Row,
    table: TensileTable,
    measured_field: MeasuredField | None,
    covariates: Mapping[str, str | float | None],
    place: _Place,
) -> Specimen:
    where = f"specimen {row.specimen} ({table.file})"
    gauge = _size(row, table, "gauge_mm")
    design, material = None, None
    with _naming(f"{SPECIMENS}, specimen {row.specimen}"):
        if row.material:
            material = place.palette.resolve(row.material).id
        else:
            file = place.folder / row.profile
            design, notes = read_profile(file, palette=place.palette, gauge_mm=gauge)
            gauge = design.length_mm
            for note in notes:
                place.noted.add(note, row.specimen)
    if gauge is None:
        raise FileError(f"{where}: the gauge length is unknown; give gauge_mm in {SPECIMENS}")
    width, thickness = (_size(row, table, name) for name in ("width_mm", "thickness_mm"))
    width_known = width or row.measured_width_mm or (design and design.width_mm is not None)
    thickness_known = (
        thickness or row.measured_thickness_mm or (design and design.thickness_mm is not None)
    )
    if not (width_known and thickness_known):
        missing = "thickness_mm" if width_known else "width_mm"
        raise FileError(
            f"{where}: the section is unknown, so its force cannot be predicted; give {missing} "
            f"in {SPECIMENS}"
        )
    rate = _size(row, table, "rate_mm_s")
    area = (
        row.area_mm2
        if width is None or thickness is None
        else ((row.measured_width_mm or width) * (row.measured_thickness_mm or thickness))
    )
    record = record_of(table, Sizes(gauge, area, rate), where=where)
    for note in record.notes:
        place.noted.add(note, row.specimen)
    if measured_field is not None and measured_field.note:
        place.noted.add(measured_field.note, row.specimen)
    return Specimen(
        id=row.specimen,
        time_s=record.time_s,
        displacement_mm=record.displacement_mm,
        force_N=record.force_N,
        time_recorded=record.time_recorded,
        gauge_mm=gauge,
        material=material,
        profile=design,
        width_mm=width,
        thickness_mm=thickness,
        measured_width_mm=row.measured_width_mm,
        measured_thickness_mm=row.measured_thickness_mm,
        rate_mm_s=rate,
        temperature_C=row.temperature_C,
        soak_h=row.soak_h,
        age_days=row.age_days,
        orientation=cast("Orientation | None", row.orientation or None),
        protocol=cast("Protocol | None", row.protocol or None),
        batch=row.batch or None,
        covariates=covariates,
        strain_field=None if measured_field is None else measured_field.on_gauge(gauge),
    )


def _size(row: Row, table: TensileTable, name: str) -> float | None:
    """Return a size or rate: from the specimen's row, else from the head of its file."""
    given = getattr(row, name)
    value = table.metadata.get(name) if given is None else given
    return value if isinstance(value, float) and value > 0.0 else None


@contextlib.contextmanager
def _naming(where: str) -> Iterator[None]:
    try:
        yield
    except (FileError, UnknownNameError) as error:
        raise type(error)(f"{where}: {error}") from error
