"""The list of specimens: what each one is, its size and how it was tested."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

import msgspec

from planner.errors import FileError
from planner.formats import tables
from planner.formats.files import read_file, toml_beside
from planner.formats.tensile import headings_of, mode_of

__all__ = [
    "SPECIMEN_COLUMNS",
    "SPECIMEN_TEXTS",
    "ListedSpecimen",
    "SpecimenColumn",
    "SpecimenConditions",
    "is_specimens_file",
    "read_specimens",
]


@dataclass(frozen=True, slots=True)
class SpecimenColumn:
    """A condition or a size in specimens.csv; numbers are above 0 unless `between` says more.

    Attributes
    ----------
    name
        With its unit as suffix.
    title
        What it is, in words.
    at
        A sentence's end that tells a value.
    label
        The same beside a curve; "" where a curve is not named by it.
    called
        Headings of the same quantity that leave the unit open.
    choices
        What a cell may say; None for a number, none for any text.
    between
        Least and largest number.
    plausible
        What tensile specimens have, in mm: beyond, the cell is doubted.
    tolerance
        How far apart, absolute and relative, two specimens of one condition may be.
    usual
        Stands in where neither specimen nor palette tells.
    is_size
        Whether it belongs to the specimen's size; the others are conditions of print and test.
    """

    name: str
    title: str
    at: str
    label: str = ""
    called: tuple[str, ...] = ()
    choices: tuple[str, ...] | None = None
    between: tuple[float, float] | None = None
    plausible: tuple[float, float] = (0.0, math.inf)
    tolerance: tuple[float, float] | None = None
    usual: float | None = None
    is_size: bool = False


_ROWS = toml_beside("specimens.toml")
SPECIMEN_COLUMNS: Mapping[str, SpecimenColumn] = MappingProxyType(
    {name: msgspec.convert({"name": name, **row}, SpecimenColumn) for name, row in _ROWS.items()}
)
"""What is known of a specimen besides what it is made of: conditions, then sizes, by name."""

_DIAMETER = SpecimenColumn("diameter_mm", "diameter", "", called=("diameter",))
"""The section of a round specimen, in place of width and thickness."""

SPECIMEN_TEXTS = ("specimen", "material", "profile", "file")
"""The columns that say which specimen it is, what it is made of and where its curve stands."""

_PART_TEXTS = ("part", "fix", "move", "load")
"""Those of whole parts. Without the first, the others are a lab's own columns."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SpecimenConditions:
    """How a specimen was made and tested, and its section; None stands for what is unknown."""

    width_mm: float | None = None
    thickness_mm: float | None = None
    measured_width_mm: float | None = None
    measured_thickness_mm: float | None = None
    rate_mm_s: float | None = None
    temperature_C: float | None = None
    soak_h: float | None = None
    age_days: float | None = None
    orientation: Literal["x", "y", "z"] | None = None
    protocol: Literal["monotonic", "cyclic", "relaxation"] | None = None
    batch: str | None = None

    @property
    def area_mm2(self) -> float | None:
        """Undeformed section, from measured sizes where there are any; None where unknown."""
        width = self.measured_width_mm or self.width_mm
        thickness = self.measured_thickness_mm or self.thickness_mm
        return None if width is None or thickness is None else width * thickness


@dataclass(frozen=True, slots=True)
class ListedSpecimen(SpecimenConditions):
    """One row of specimens.csv; None or "" stands for an empty cell, which means unknown.

    Attributes
    ----------
    diameter_mm
        Of a round specimen, whose sides are unknown.
    material, profile, part
        Exactly one is given: a material of one piece, the file of a graded bar's design, or the
        plan of a whole part.
    fix, move, load
        How a part is held and loaded.
    mode
        How it was loaded, as a column ``mode`` says, whatever its case, or else a protocol such as
        "cyclic compression"; "" where neither does.
    covariates
        Further columns as the lab wrote them, by name.
    """

    specimen: str
    material: str = ""
    profile: str = ""
    part: str = ""
    fix: str = ""
    move: str = ""
    load: str = ""
    file: str = ""
    gauge_mm: float | None = None
    diameter_mm: float | None = None
    mode: str = ""
    covariates: Mapping[str, str] = field(default_factory=dict)

    def conditions(self) -> dict[str, Any]:
        """Return what the row says in each of `SPECIMEN_COLUMNS`."""
        return {name: getattr(self, name) for name in SPECIMEN_COLUMNS}


def is_specimens_file(path: str | Path) -> bool:
    """Say whether a file lists specimens: a column `specimen`, and what each is made of."""
    data = read_file(path, advice="give the path of a tensile file")
    if tables.is_workbook(data):
        return False
    first = tables.decode_text(data, Path(path)).lstrip().split("\n")[0]
    return any(
        "specimen" in cells and not _MADE_OF.isdisjoint(cells) and headings_of(cells) is None
        for cells in ([c.strip().casefold() for c in first.split(s)] for s in ",;\t")
    )


def read_specimens(path: str | Path) -> tuple[ListedSpecimen, ...]:
    """Read specimens.csv; the case of planner's own columns does not matter.

    Raises
    ------
    FileError
        A missing column, or one in another unit, as "width_in" or "Temperature (K)"; a size that is
        no positive number, a condition that no test has, an unknown choice, neither or both of
        material and profile, or two rows of one specimen; the message names line and column.
    """
    path = Path(path)
    headings, separator, rows = tables.read_rows(path)
    texts: tuple[str, ...] = SPECIMEN_TEXTS
    if "part" in (name.casefold() for name in headings):
        texts += _PART_TEXTS
    known = {name.casefold(): name for name in (*texts, *_COLUMNS)}
    columns = [_column(name, known) for name in headings]
    for name in columns:
        if name and columns.count(name) > 1:
            raise FileError(f"{path.name}: two columns {name!r}; keep one")
        if name not in known.values() and (quantity := _quantity(name)) is not None:
            raise FileError(
                f"{path.name}, column {name!r}: its unit is not understood; give the values as "
                f"{quantity} and head the column so"
            )
    if "specimen" not in columns or _MADE_OF.isdisjoint(columns):
        raise FileError(
            f"{path.name}: columns are {', '.join(columns)}; 'specimen' and 'material' (or "
            "'profile', or 'part') are needed"
        )
    specimens: dict[str, tuple[int, ListedSpecimen]] = {}
    for line, cells in rows:
        where = f"{path.name}, line {line}"
        if len(cells) > len(columns):
            raise FileError(
                f"{where}: {len(cells)} cells for {len(columns)} columns; a comma within a cell "
                "needs quotes"
            )
        row = _listed(dict(zip(columns, cells, strict=False)), texts, separator, where)
        if (before := specimens.setdefault(row.specimen, (line, row))[0]) != line:
            raise FileError(
                f"{where}: specimen {row.specimen!r} stands on line {before} already; give each "
                "specimen its own id"
            )
    if not specimens:
        raise FileError(f"{path.name}: no specimen; write one row a specimen")
    return tuple(row for _, row in specimens.values())


_COLUMNS = {**SPECIMEN_COLUMNS, _DIAMETER.name: _DIAMETER}
_QUANTITIES = {called: name for name, c in _COLUMNS.items() for called in c.called}
_UNIT = re.compile(r"(.*?)\s*[\(\[]\s*(.*?)\s*[\)\]]")
_OWN_UNITS = {
    "mm": "_mm", "mm/s": "_mm_s", "°c": "_C", "degc": "_C", "h": "_h", "d": "_days", "days": "_days"
}  # fmt: skip
_PER_TIME = re.compile(r"(.*?) [^ ]+ (?:per )?(?:s|sec|min|minute|h|hr|hour)")


def _column(heading: str, known: Mapping[str, str]) -> str:
    """Return the column that a heading names, as "Width (mm)" does; else the heading itself."""
    bracketed = _UNIT.fullmatch(heading) if len(heading) <= tables.LONGEST_HEADING else None
    if bracketed and (own := _OWN_UNITS.get(bracketed[2].casefold())):
        quantity = _quantity(heading) or ""
        return quantity if quantity.endswith(own) else heading
    return known.get(heading.casefold(), heading)


def _quantity(heading: str) -> str | None:
    """Return the column whose quantity a heading names with a unit of its own, or without one."""
    if len(heading) > tables.LONGEST_HEADING:
        return None
    bracketed = _UNIT.fullmatch(heading)
    words = re.sub(r"[\s_]+", " ", bracketed[1] if bracketed else heading).strip().casefold()
    stem, _, unit = words.rpartition(" ")
    speed = _PER_TIME.fullmatch(words)
    called = (speed[1] if speed else "", words, stem if len(unit) <= 6 else "")
    return next((_QUANTITIES[each] for each in called if each in _QUANTITIES), None)


_MADE_OF = frozenset({"material", "profile", "part"})


def _listed(
    record: Mapping[str, str], names: Sequence[str], separator: str, where: str
) -> ListedSpecimen:
    texts: dict[str, Any] = {name: record.get(name, "") for name in names}
    if not texts["specimen"]:
        raise FileError(f"{where}: column 'specimen' is empty; give the specimen an id")
    made = {name: texts[name] for name in ("material", "profile", "part") if name in texts}
    if sum(map(bool, made.values())) != 1:
        got = " and ".join(map(repr, made.values()))
        raise FileError(f"{where}: give exactly one of {' and '.join(map(repr, made))} (got {got})")
    if not texts.get("part"):
        if loose := next((name for name in _PART_TEXTS[1:] if texts.get(name)), None):
            raise FileError(f"{where}: {loose!r} goes with a part; give one, or leave it empty")
    elif record.get("gauge_mm"):
        raise FileError(f"{where}: a part has no 'gauge_mm'; leave it empty")
    record, mode = _without_mode(record)
    conditions: dict[str, Any] = {
        column.name: _condition(record.get(column.name, ""), column, separator, where)
        for column in _COLUMNS.values()
    }
    known = {*names, *_COLUMNS, ""}
    others = {name: value for name, value in record.items() if name not in known}
    mode = {name.casefold(): value for name, value in others.items()}.get("mode") or mode
    return ListedSpecimen(**texts, **conditions, mode=mode, covariates=others)


def _without_mode(record: Mapping[str, str]) -> tuple[Mapping[str, str], str]:
    """Return a row whose protocol does not say how the specimen was loaded, and what it said.

    Nothing more of a protocol is a monotonic test.
    """
    words = record.get("protocol", "").casefold().split()
    if not (mode := next(filter(mode_of, words), "")):
        return record, ""
    return {**record, "protocol": " ".join(w for w in words if w != mode) or "monotonic"}, mode


def _condition(cell: str, column: SpecimenColumn, separator: str, where: str) -> str | float | None:
    if not cell:
        return None
    if column.choices is not None:
        if column.choices and cell.casefold() not in column.choices:
            allowed = ", ".join(column.choices)
            raise FileError(f"{where}: {column.name} is {cell!r}; it must be one of {allowed}")
        return cell.casefold() if column.choices else cell
    number, hint = tables.number(cell, separator), ""
    value = math.nan if number is None else number
    if not abs(value) <= tables.LARGEST_FIGURE or (not column.between and value <= 0):
        must = "a number" if column.between else "a number above 0"
    else:
        low, high = column.between or (0.0, math.inf)
        if low <= value <= high:
            return value
        must = f"from {low:g} to {high:g}" if math.isfinite(high) else f"{low:g} or more"
        hint = "; kelvin or degrees Fahrenheit?" if column.name == "temperature_C" else ""
    raise FileError(
        f"{where}: {column.name} is {cell!r}; it must be {must}, or empty if unknown{hint}"
    )
