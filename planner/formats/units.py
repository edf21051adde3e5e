"""Units: what machines write, as factors; what a person states; what a factor hints at."""

import contextlib
import math
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from planner.errors import ArgumentError, FileError, UnknownNameError, check_known, did_you_mean
from planner.formats.files import toml_beside

__all__ = [
    "QUANTITIES",
    "QUANTITY_UNITS",
    "UnitOf",
    "canonical_unit",
    "quantities_of",
    "slips",
    "unit_factor",
    "unit_near",
]


# ------------------------------------------------------------------------------------------------
# Units that testing machines write, as factors to mm, N, MPa, s and fractions.


_UNITS = toml_beside("units.toml")
QUANTITY_UNITS: Mapping[str, Mapping[str, float]] = {
    quantity: _UNITS[quantity] for quantity in ("time", "length", "force", "stress", "strain")
}
"""Factors to s, mm, N, MPa and fractions, by quantity and unit."""

_FOLDED: dict[str, dict[str, float]] = {
    quantity: {unit.casefold(): f for unit, f in units.items() if unit not in ("mN", "MN")}
    | _UNITS["read-alone"].get(quantity, {})
    | {
        word: units[unit]
        for unit, words in _UNITS["words"].items()
        if unit in units
        for word in words.split(", ")
    }
    for quantity, units in QUANTITY_UNITS.items()
}
_LENGTHS, _TIMES = _FOLDED["length"].items(), _FOLDED["time"].items()
_FOLDED["area"] = {f"{unit}{two}": f * f for unit, f in _LENGTHS for two in ("2", "^2")}
_FOLDED["stress"] |= {
    f"{force}/{area}": newtons / mm2
    for force, newtons in {**_FOLDED["force"], "mn": 1e-3}.items()
    for area, mm2 in _FOLDED["area"].items()
    if f"{force}/{area}" not in _FOLDED["stress"]
}
_FOLDED["speed"] = {f"{unit}/{time}": f / s for unit, f in _LENGTHS for time, s in _TIMES}


def _find(quantity: str, unit: str) -> float | None:
    # "sec.", "in."; the Japanese "％" and "㎜" are one character each.
    unit = unicodedata.normalize("NFKC", unit).removesuffix(".").replace(" / ", "/")
    if quantity == "stress" and unit.startswith("MN/"):
        return _find("stress", unit[1:]) and 1e6 * _FOLDED["stress"][unit[1:].casefold()]
    factor = QUANTITY_UNITS.get(quantity, {}).get(unit)
    return _FOLDED[quantity].get(unit.casefold()) if factor is None else factor


def quantities_of(unit: str) -> frozenset[str]:
    """Return what has a unit: keys of `QUANTITY_UNITS`, "area", "speed"; none of an empty text."""
    unit = unit.strip()
    return frozenset(q for q in _FOLDED if unit and _find(q, unit) is not None)


def unit_factor(quantity: str, unit: str, *, where: str) -> float:
    """Return the factor from a unit to planner's own unit of that quantity.

    Parameters
    ----------
    quantity
        A key of `QUANTITY_UNITS`, "area" or "speed".
    unit
        As the file writes it; case is ignored, save between mN and MN, and in mPa: SI's milli.
    where
        What errors call the place: file and column.

    Raises
    ------
    FileError
        The unit is none of that quantity.
    """
    unit, units = unit.strip(), QUANTITY_UNITS.get(quantity, {})
    factor = None if unit == "mPa" else _find(quantity, unit)
    if factor is None:
        known = f"{did_you_mean(unit, units)}use one of "
        known += ", ".join(repr(each) for each in units if each.isascii() and each)
        raise FileError(f"{where}: unknown unit {unit!r} of {quantity}; {known}")
    return factor


# ------------------------------------------------------------------------------------------------
# As a person states it: ``inch`` of a mesh, ``force=lbf:S1,S2`` of tests.


_OF_MESHES = ("mm", "cm", "m", "inch", "ft", "um")


def canonical_unit(unit: str) -> str:
    """Return the short name of a mesh's unit of length, a key of `QUANTITY_UNITS`.

    Raises
    ------
    ArgumentError
        Nothing is called so; the message says what is near.
    """
    short = {QUANTITY_UNITS["length"][name]: name for name in _OF_MESHES}
    called = short.get(_find("length", str(unit).strip()) or 0.0)
    if called is None:
        hint = did_you_mean(str(unit), [name for name, mm in _LENGTHS if mm in short])
        raise ArgumentError(
            f"`unit` {unit or repr(unit)}: no such unit; {hint}it may be {', '.join(_OF_MESHES)}"
        )
    return called


QUANTITIES: Mapping[str, tuple[str, str]] = {
    "force": ("force_N", "force"),
    "travel": ("displacement_mm", "length"),
    "stress": ("stress_MPa", "stress"),
    "strain": ("strain", "strain"),
}
"""Of each that may be in another unit: its column, and the kind of its unit."""

_OF_ONE = {"force": "N", "travel": "mm", "stress": "MPa", "strain": "strain of 1"}


@dataclass(frozen=True, slots=True)
class UnitOf:
    """A unit that force or travel is in, whatever the file says; no specimens means all.

    Attributes
    ----------
    quantity
        ``force`` or ``travel``; of tensile tests also ``stress`` or ``strain``.
    unit
        Or, where it has no name, how many newtons or millimetres it has.
    """

    quantity: str
    unit: str
    specimens: tuple[str, ...] = ()

    @staticmethod
    def parsed(text: str) -> "UnitOf":
        """Read QUANTITY=UNIT:ID,ID,...; without ids it holds for all specimens.

        Raises
        ------
        ArgumentError
            A text that is not of that form.
        UnknownNameError
            A quantity that is none of `QUANTITIES`, or an unknown unit.
        """
        head, _, ids = text.partition(":")
        quantity, equals, unit = (part.strip() for part in head.partition("="))
        if not equals or not unit:
            raise ArgumentError(
                f"unit_of {text!r}: write QUANTITY=UNIT:ID,ID,..., as in force=lbf:S1,S2; without "
                "ids for all specimens"
            )
        said = f"unit_of {text}: no quantity {quantity!r}; {{}}there are"
        check_known(quantity, QUANTITIES, said, UnknownNameError)
        one = UnitOf(quantity, unit, tuple(id.strip() for id in ids.split(",") if id.strip()))
        _ = one.factor  # a slip is told at once
        return one

    @property
    def text(self) -> str:
        """As ``--unit-of`` takes it."""
        ids = f":{','.join(self.specimens)}" if self.specimens else ""
        return f"{self.quantity}={self.unit}{ids}"

    @property
    def factor(self) -> float:
        """How much of planner's own unit it has; it may be such a number itself.

        Raises
        ------
        UnknownNameError
            It is neither a unit of the quantity nor a number above 0.
        """
        units = QUANTITY_UNITS[QUANTITIES[self.quantity][1]]
        if self.unit in units:
            return units[self.unit]
        with contextlib.suppress(ValueError):
            if 0.0 < (factor := float(self.unit)) < math.inf:
                return factor
        plain = [unit for unit in units if (unit.isascii() and unit.isalpha()) or unit == "%"]
        raise UnknownNameError(
            f"unit_of {self.text}: no unit {self.unit!r} of {self.quantity}; "
            f"{did_you_mean(self.unit, plain)}there are {', '.join(plain)}, or how many "
            f"{_OF_ONE[self.quantity]} it has"
        )


# ------------------------------------------------------------------------------------------------
# As a factor hints: that between two units.


def slips(table: str) -> dict[float, Any]:
    """Return what is mixed up, in words, by the factor that it leaves; a table of units.toml."""
    known = {unit: f for units in QUANTITY_UNITS.values() for unit, f in units.items()}
    found = dict[float, Any]()
    for text, words in _UNITS["slips"][table].items():
        product = math.prod(known[unit] for unit in text.removeprefix("1/").split("*"))
        found[1.0 / product if text.startswith("1/") else product] = words
    return found


_OWN = 0.03
"""ln factor that a load cell may be off besides. Chosen: as much as the effect's forms of known
units allow."""


def unit_near(kind: str, log: float, own: float, reach: float = 0.0) -> str | None:
    """Return the unit of a factor, or as a number the inverse of one; None where none is near.

    A unit goes before an inverse that is nearer still, if it is as near as load cells are sure.

    Parameters
    ----------
    kind
        A key of `QUANTITY_UNITS`.
    log
        Of the factor to planner's own unit.
    own
        The factor of the unit in the file, which is not meant.
    reach
        How far a unit's logarithm may lie off, if that is more than a load cell's may.
    """
    units = {name: f for name, f in QUANTITY_UNITS[kind].items() if f != own}
    inverse = {f"{own * own / f:.6g}": own * own / f for f in units.values()}
    for choices, near in ((units, _OWN), (units | inverse, max(reach, _OWN))):
        unit = min(choices, key=lambda name: abs(math.log(choices[name]) - log))
        if abs(math.log(choices[unit]) - log) <= near:
            return unit
    return None
