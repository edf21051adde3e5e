"""What a column's heading means: which quantity, in which unit."""

import re
from dataclasses import dataclass

from planner.errors import FileError
from planner.formats.tensile.units import is_unit, unit_factor

__all__ = ["Heading", "Meaning", "column_of", "parse_heading"]

_NAMES = {
    "time": ("time", "elapsed time", "test time", "total time"),
    "force": ("force", "load", "standard force", "tensile force", "tensile load", "axial force"),
    "displacement": (
        "displacement", "disp", "extension", "travel", "position", "crosshead", "stroke",
        "crosshead displacement", "crosshead extension", "tensile extension", "distance",
        "tensile displacement", "axial displacement", "standard travel",
    ),
    "elongation": ("elongation", "deformation"),
    "strain": (
        "strain", "ε", "engineering strain", "nominal strain", "tensile strain", "axial strain",
        "strain 1", "tensile strain (extension)", "tensile strain (displacement)",
        "tensile strain (strain 1)", "eng strain",
    ),
    "stress": (
        "stress", "σ", "engineering stress", "nominal stress", "tensile stress", "axial stress",
        "eng stress",
    ),
    "stretch": ("stretch", "stretch ratio", "lambda"),
    "true strain": ("true strain",),
    "true stress": ("true stress",),
    "specimen": ("specimen", "specimen id"),
}  # fmt: skip
_MEANING = {name: meaning for meaning, names in _NAMES.items() for name in names}
_COLUMN = {
    "time": ("time_s", "time"),
    "force": ("force_N", "force"),
    "displacement": ("displacement_mm", "length"),
    "strain": ("strain", "strain"),
    "stress": ("stress_MPa", "stress"),
    "stretch": ("stretch", "strain"),
    "true strain": ("true_strain", "strain"),
    "true stress": ("true_stress_MPa", "stress"),
}
_UNIT_OPTIONAL = {"strain", "stretch", "true strain"}
_BRACKETED = re.compile(r"(.*?)\s*[\(\[]\s*([^()\[\]]*?)\s*[\)\]]\s*")
_SUFFIXED = re.compile(r"(.+)_([^_\s]+)")
_SPACED = re.compile(r"(.+)\s(\S+)")


@dataclass(frozen=True, slots=True)
class Heading:
    """A heading taken apart: a key of the known meanings, and its unit (None: not stated)."""

    text: str
    meaning: str
    unit: str | None


@dataclass(frozen=True, slots=True)
class Meaning:
    """Canonical column name, and the factor to its unit."""

    column: str
    factor: float
    unit_stated: bool


def _meaning(name: str) -> str | None:
    return _MEANING.get(re.sub(r"[\s_]+", " ", name).strip().casefold())


def parse_heading(text: str) -> Heading | None:
    """Take a heading apart, or return None where it names nothing that is known.

    "Load (lbf)", "Load [lbf]", "force_N", "Load N" and a bare "Load" are understood.
    """
    bracketed = _BRACKETED.fullmatch(text)
    if bracketed and (meaning := _meaning(bracketed[1])) is not None:
        # "Tensile strain (Displacement)" names where the strain comes from, not a unit.
        if is_unit(bracketed[2]) or _meaning(text) is None:
            return Heading(text, meaning, bracketed[2])
        return Heading(text, meaning, None)
    if (meaning := _meaning(text)) is not None:
        return Heading(text, meaning, None)
    if bracketed and (inner := parse_heading(bracketed[1])) is not None:
        return Heading(text, inner.meaning, bracketed[2])
    suffixed = _SUFFIXED.fullmatch(text)
    if suffixed and (meaning := _meaning(suffixed[1])) is not None:
        return Heading(text, meaning, suffixed[2])
    spaced = _SPACED.fullmatch(text)
    # Only a known unit: a "Load cell" and a "Time stamp" are no columns.
    if spaced and is_unit(spaced[2]) and (meaning := _meaning(spaced[1])) is not None:
        return Heading(text, meaning, spaced[2])
    return None


def column_of(heading: Heading, *, where: str) -> Meaning:
    """Return the canonical column of a heading, with the factor to its unit.

    Raises
    ------
    FileError
        The unit is missing where one is needed, or is unknown.
    """
    where = f"{where}, column {heading.text!r}"
    meaning, unit = heading.meaning, heading.unit
    if meaning == "elongation":
        # Bench software calls both the travel and the per cent of gauge length so.
        meaning = "strain" if unit is not None and "%" in unit else "displacement"
    column, quantity = _COLUMN[meaning]
    if unit is None and meaning not in _UNIT_OPTIONAL:
        raise FileError(
            f"{where}: no unit; write it in the heading, as '{heading.text} (unit)', "
            f"or name the columns yourself, as {column}"
        )
    return Meaning(column, unit_factor(quantity, unit or "", where=where), unit is not None)
