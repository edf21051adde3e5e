"""The unit that a quantity is in, whatever a file says: as stated, and which one a factor means."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from planner.errors import ArgumentError, UnknownNameError, did_you_mean
from planner.formats.tables import QUANTITY_UNITS

__all__ = [
    "OWN",
    "QUANTITIES",
    "UnitOf",
    "factor_of",
    "parsed_unit",
    "unit_near",
]


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

    @property
    def text(self) -> str:
        """As ``--unit-of`` takes it."""
        ids = f":{','.join(self.specimens)}" if self.specimens else ""
        return f"{self.quantity}={self.unit}{ids}"


QUANTITIES: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "force": ("force_N", "force"),
        "travel": ("displacement_mm", "length"),
        "stress": ("stress_MPa", "stress"),
        "strain": ("strain", "strain"),
    }
)
"""Of each that may be in another unit: its column, and the kind of its unit."""

_OF_ONE = {"force": "N", "travel": "mm", "stress": "MPa", "strain": "strain of 1"}


# ------------------------------------------------------------------------------------------------
# As a person states it: ``force=lbf:S1,S2``.


def factor_of(stated: UnitOf) -> float:
    """Return how much of planner's own unit the stated one has; it may be such a number itself.

    Raises
    ------
    UnknownNameError
        It is neither a unit of the quantity nor a number above 0.
    """
    units = QUANTITY_UNITS[QUANTITIES[stated.quantity][1]]
    if stated.unit in units:
        return units[stated.unit]
    try:
        factor = float(stated.unit)
    except ValueError:
        factor = math.nan
    if 0.0 < factor < math.inf:
        return factor
    plain = [unit for unit in units if (unit.isascii() and unit.isalpha()) or unit == "%"]
    raise UnknownNameError(
        f"unit_of {stated.text}: no unit {stated.unit!r} of {stated.quantity}; "
        f"{did_you_mean(stated.unit, plain)}there are {', '.join(plain)}, or how many "
        f"{_OF_ONE[stated.quantity]} it has"
    )


def parsed_unit(text: str, quantities: Sequence[str]) -> UnitOf:
    """Read QUANTITY=UNIT:ID,ID,...; without ids it holds for all specimens.

    Raises
    ------
    ArgumentError
        A text that is not of that form.
    UnknownNameError
        A quantity that is none of `quantities`, or an unknown unit.
    """
    head, _, ids = text.partition(":")
    quantity, equals, unit = (part.strip() for part in head.partition("="))
    if not equals or not unit:
        raise ArgumentError(
            f"unit_of {text!r}: write QUANTITY=UNIT:ID,ID,..., as in force=lbf:S1,S2; without "
            "ids for all specimens"
        )
    if quantity not in quantities:
        raise UnknownNameError(
            f"unit_of {text}: no quantity {quantity!r}; {did_you_mean(quantity, quantities)}"
            f"there are {' and '.join(quantities)}"
        )
    one = UnitOf(quantity, unit, tuple(id.strip() for id in ids.split(",") if id.strip()))
    factor_of(one)
    return one


# ------------------------------------------------------------------------------------------------
# As a factor hints: that between two units.


OWN = 0.03
"""ln factor that a load cell may be off besides. Chosen: as much as the effect's forms of known
units allow."""


def unit_near(kind: str, log: float, own: float, reach: float = OWN) -> str | None:
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
        How far a unit's logarithm may lie off.
    """
    units = {name: f for name, f in QUANTITY_UNITS[kind].items() if f != own}
    inverse = {f"{own * own / f:.6g}": own * own / f for f in units.values()}
    for choices, near in ((units, min(reach, OWN)), (units | inverse, reach)):
        unit = min(choices, key=lambda name: abs(math.log(choices[name]) - log))
        if abs(math.log(choices[unit]) - log) <= near:
            return unit
    return None
