"""The further columns of specimens.csv: covariates, and slips in headings."""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from difflib import SequenceMatcher
from types import MappingProxyType

from planner.errors import FileError, nearest_names
from planner.formats.tensile import Specimen as Row
from planner.formats.tensile.text_rows import number

__all__ = ["check_headings", "covariates_of"]

KNOWN = (
    "specimen", "material", "profile", "file", "width_mm", "thickness_mm", "gauge_mm",
    "measured_width_mm", "measured_thickness_mm", "rate_mm_s", "temperature_C", "soak_h",
    "age_days", "orientation", "protocol", "batch",
)  # fmt: skip
_QUANTITIES = {
    "width": "width_mm",
    "thickness": "thickness_mm",
    "gauge": "gauge_mm",
    "gauge length": "gauge_mm",
    "gage": "gauge_mm",
    "gage length": "gauge_mm",
    "measured width": "measured_width_mm",
    "measured thickness": "measured_thickness_mm",
    "rate": "rate_mm_s",
    "temperature": "temperature_C",
    "soak": "soak_h",
    "age": "age_days",
}
_UNIT = re.compile(r"(.*?)\s*[\(\[].*[\)\]]")
_PER_TIME = re.compile(r"(.*?) [^ ]+ (?:per )?(?:s|sec|min|minute|h|hr|hour)")


def check_headings(rows: Sequence[Row], where: str) -> Iterator[str]:
    """Refuse known quantities in other units, and note columns that look like a slip.

    Raises
    ------
    FileError
        A heading such as "width_in" or "Temperature (K)".
    """
    for heading in rows[0].covariates:
        quantity = _quantity(heading)
        if quantity is not None:
            raise FileError(
                f"{where}, column {heading!r}: its unit is not understood; give the values as "
                f"{quantity} and head the column so"
            )
        near = [n for n in nearest_names(heading, list(KNOWN)) if _alike(n, heading)]
        if near:
            yield (
                f"{where}: column {heading!r} is unknown and kept as a covariate; rename it if "
                f"it means {near[0]}"
            )


def covariates_of(rows: Sequence[Row]) -> dict[str, Mapping[str, str | float | None]]:
    """Return each specimen's further columns: numbers where all of a column are, None if empty."""
    names = tuple(rows[0].covariates)
    columns = {name: _column([row.covariates.get(name, "") for row in rows]) for name in names}
    return {
        row.specimen: MappingProxyType({name: columns[name][i] for name in names})
        for i, row in enumerate(rows)
    }


def _column(cells: Sequence[str]) -> list[str | float | None]:
    numbers = {cell: number(cell, ";") for cell in cells if cell}
    if all(value is not None and math.isfinite(value) for value in numbers.values()):
        return [numbers.get(cell) for cell in cells]
    return [cell or None for cell in cells]


def _quantity(heading: str) -> str | None:
    bracketed = _UNIT.fullmatch(heading)
    name = bracketed[1] if bracketed else heading
    words = re.sub(r"[\s_]+", " ", name).strip().casefold()
    stem, _, unit = words.rpartition(" ")
    speed = _PER_TIME.fullmatch(words)
    if speed is not None and speed[1] in _QUANTITIES:
        return _QUANTITIES[speed[1]]
    return _QUANTITIES.get(words) or (_QUANTITIES.get(stem) if len(unit) <= 6 else None)


def _alike(known: str, heading: str) -> bool:
    """Say whether two names differ by a letter or two, or by case."""
    a, b = known.casefold(), heading.casefold()
    return abs(len(a) - len(b)) <= 2 and SequenceMatcher(None, a, b).ratio() > 0.85
