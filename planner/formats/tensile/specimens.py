"""The list of specimens: what each one is, its size and how it was tested."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

from planner.errors import FileError
from planner.formats.tensile.text_rows import number, read_text, split_rows

__all__ = ["Specimen", "is_specimens_file", "read_specimens"]

_POSITIVE = (
    "width_mm", "thickness_mm", "gauge_mm", "measured_width_mm", "measured_thickness_mm",
    "rate_mm_s",
)  # fmt: skip
_FROM_TO = {
    "temperature_C": (-100.0, 300.0),
    "soak_h": (0.0, math.inf),
    "age_days": (0.0, math.inf),
}
"""Beyond these temperatures every elastomer and jetted resin is glass, or decomposes."""

_NUMBERS = (*_POSITIVE, *_FROM_TO)
_CHOICES = {
    "orientation": ("x", "y", "z"),
    "protocol": ("monotonic", "cyclic", "relaxation"),
}
_TEXTS = ("specimen", "material", "profile", "file", "batch")
_COLUMNS = (*_TEXTS, *_CHOICES, *_NUMBERS)


@dataclass(frozen=True, slots=True)
class Specimen:
    """One row of specimens.csv; None or "" stands for an empty cell, which means unknown.

    Attributes
    ----------
    material, profile
        Exactly one is given: a material of one piece, or the file of a graded bar's design.
    covariates
        Further columns as the lab wrote them, by name.
    """

    specimen: str
    material: str = ""
    profile: str = ""
    file: str = ""
    batch: str = ""
    width_mm: float | None = None
    thickness_mm: float | None = None
    gauge_mm: float | None = None
    measured_width_mm: float | None = None
    measured_thickness_mm: float | None = None
    rate_mm_s: float | None = None
    temperature_C: float | None = None
    soak_h: float | None = None
    age_days: float | None = None
    orientation: str = ""
    protocol: str = ""
    covariates: Mapping[str, str] = field(default_factory=dict)

    @property
    def area_mm2(self) -> float | None:
        """Undeformed section, from measured sizes where there are any."""
        width = self.measured_width_mm or self.width_mm
        thickness = self.measured_thickness_mm or self.thickness_mm
        return None if width is None or thickness is None else width * thickness


def is_specimens_file(path: str | Path) -> bool:
    """Say whether a file lists specimens: a column `specimen`, and `material` or `profile`."""
    first = read_text(Path(path)).lstrip("\n").splitlines()[0]
    return any(
        "specimen" in cells and ("material" in cells or "profile" in cells)
        for cells in ([c.strip().casefold() for c in first.split(s)] for s in ",;\t")
    )


def read_specimens(path: str | Path) -> tuple[Specimen, ...]:
    """Read specimens.csv; the case of planner's own columns does not matter.

    Raises
    ------
    FileError
        A missing column, a size that is no positive number, a condition that no test has, an
        unknown choice, neither or both of material and profile, or two rows of one specimen; the
        message names line and column.
    """
    path = Path(path)
    text = read_text(path)
    lines = text.splitlines()
    separator = max(",;\t", key=next((line for line in lines if line.strip()), "").count)
    rows = [(line, cells) for line, cells in split_rows(text, separator) if any(cells)]
    known = {name.casefold(): name for name in _COLUMNS}
    columns = [known.get(name.casefold(), name) for name in rows[0][1]]
    for name in columns:
        if columns.count(name) > 1:
            raise FileError(f"{path.name}: two columns {name!r}; keep one")
    if "specimen" not in columns or not {"material", "profile"} & set(columns):
        raise FileError(
            f"{path.name}: columns are {', '.join(columns)}; 'specimen' and 'material' (or "
            "'profile') are needed"
        )
    specimens: list[Specimen] = []
    seen: dict[str, int] = {}
    for line, cells in rows[1:]:
        if len(cells) > len(columns):
            raise FileError(
                f"{path.name}, line {line}: {len(cells)} cells for {len(columns)} columns; a "
                "comma within a cell needs quotes"
            )
        record = dict(zip(columns, cells, strict=False))
        specimen = _specimen(record, separator, f"{path.name}, line {line}")
        if specimen.specimen in seen:
            raise FileError(
                f"{path.name}, line {line}: specimen {specimen.specimen!r} stands on line "
                f"{seen[specimen.specimen]} already; give each specimen its own id"
            )
        seen[specimen.specimen] = line
        specimens.append(specimen)
    if not specimens:
        raise FileError(f"{path.name}: no specimen; write one row a specimen")
    return tuple(specimens)


def _specimen(record: Mapping[str, str], separator: str, where: str) -> Specimen:
    texts: dict[str, Any] = {name: record.get(name, "") for name in _TEXTS}
    if not texts["specimen"]:
        raise FileError(f"{where}: column 'specimen' is empty; give the specimen an id")
    if bool(texts["material"]) == bool(texts["profile"]):
        raise FileError(
            f"{where}: give exactly one of 'material' and 'profile' (got "
            f"{texts['material']!r} and {texts['profile']!r})"
        )
    for name, allowed in _CHOICES.items():
        texts[name] = record.get(name, "").casefold()
        if texts[name] and texts[name] not in allowed:
            raise FileError(
                f"{where}: {name} is {record[name]!r}; it must be one of {', '.join(allowed)}"
            )
    sizes: dict[str, Any] = {
        name: _size(record.get(name, ""), name, separator, where) for name in _NUMBERS
    }
    return Specimen(
        **texts,
        **sizes,
        covariates=MappingProxyType(
            {name: value for name, value in record.items() if name not in _COLUMNS and name}
        ),
    )


def _size(cell: str, name: str, separator: str, where: str) -> float | None:
    if not cell:
        return None
    value = number(cell, separator)
    if value is None or not math.isfinite(value) or (name in _POSITIVE and value <= 0):
        must = "a number above 0" if name in _POSITIVE else "a number"
        raise FileError(f"{where}: {name} is {cell!r}; it must be {must}, or empty if unknown")
    low, high = _FROM_TO.get(name, (-math.inf, math.inf))
    if not low <= value <= high:
        must = f"from {low:g} to {high:g}" if math.isfinite(high) else f"{low:g} or more"
        hint = "; kelvin or degrees Fahrenheit?" if name == "temperature_C" else ""
        raise FileError(
            f"{where}: {name} is {cell!r}; it must be {must}, or empty if unknown{hint}"
        )
    return value
