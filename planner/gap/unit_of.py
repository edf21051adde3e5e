"""The unit that force or travel is in, against what a file says: as stated, as a verdict hints."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType

from planner.errors import ArgumentError, UnknownNameError, did_you_mean
from planner.formats.tables import QUANTITY_UNITS
from planner.gap.campaign import Specimen
from planner.gap.diagnosis import FoundEffect, UnitOf

__all__ = [
    "QUANTITIES",
    "factor_of",
    "merged_units",
    "stated_units",
    "suggested_units",
    "unit_near",
]


QUANTITIES: Mapping[str, tuple[str, str]] = MappingProxyType(
    {"force": ("force_N", "force"), "travel": ("displacement_mm", "length")}
)
"""Of each that may be in another unit: its column, and the kind of its unit."""


# ------------------------------------------------------------------------------------------------
# As a person states it: ``force=lbf:S1,S2``.


def factor_of(stated: UnitOf) -> float:
    """Return the newtons or millimetres in the stated unit, which may be such a number itself.

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
    plain = [unit for unit in units if unit.isascii() and unit.isalpha()]
    raise UnknownNameError(
        f"unit_of {stated.text}: no unit {stated.unit!r} of {stated.quantity}; "
        f"{did_you_mean(stated.unit, plain)}there are {', '.join(plain)}, or how many "
        f"{'N' if stated.quantity == 'force' else 'mm'} it has"
    )


def stated_units(
    stated: str | Sequence[str], specimens: Sequence[str]
) -> Mapping[str, Mapping[str, UnitOf]]:
    """Read QUANTITY=UNIT:ID,ID,...; of each specimen, its units by quantity.

    Without ids it holds for all specimens; of two that name one specimen the last counts.

    Raises
    ------
    ArgumentError
        A text that is not of that form.
    UnknownNameError
        An unknown quantity, unit or specimen.
    """
    found: dict[str, dict[str, UnitOf]] = {id: {} for id in specimens}
    for text in (stated,) if isinstance(stated, str) else stated:
        head, _, ids = text.partition(":")
        quantity, equals, unit = (part.strip() for part in head.partition("="))
        if not equals or not unit:
            raise ArgumentError(
                f"unit_of {text!r}: write QUANTITY=UNIT:ID,ID,..., as in force=lbf:S1,S2; without "
                "ids for all specimens"
            )
        if quantity not in QUANTITIES:
            raise UnknownNameError(
                f"unit_of {text}: no quantity {quantity!r}; {did_you_mean(quantity, QUANTITIES)}"
                f"there are {' and '.join(QUANTITIES)}"
            )
        named = tuple(id.strip() for id in ids.split(",") if id.strip())
        one = UnitOf(quantity, unit, named)
        factor_of(one)
        for id in named or specimens:
            if id not in found:
                raise UnknownNameError(
                    f"unit_of {text}: no specimen {id!r} in specimens.csv; "
                    f"{did_you_mean(id, specimens)}its ids stand in the column 'specimen'"
                )
            found[id][quantity] = one
    return found


# ------------------------------------------------------------------------------------------------
# As a verdict hints: a gain of force or travel that is the factor between two units.


_OWN = 0.03
"""ln factor that a load cell may be off besides. Chosen: as much as the effect's forms of known
units allow."""

_GAINS: Mapping[tuple[str, str], tuple[str, float]] = MappingProxyType(
    {
        ("force-scale", "log_gain"): ("force", -1.0),
        ("force-scale", "factor"): ("force", -1.0),
        ("strain-scale", "log_factor"): ("travel", 1.0),
    }
)
"""By effect and parameter: the quantity, and the power of true over recorded. Convention: how the
effects define their sizes."""


def suggested_units(
    found: Iterable[FoundEffect], specimens: Sequence[Specimen]
) -> Iterator[UnitOf]:
    """Yield the units in which numbers make sense as they stand in the files, without a gain."""
    for effect in found:
        for name, value in effect.parameters.items():
            if (effect.id, name) not in _GAINS:
                continue
            quantity, power = _GAINS[effect.id, name]
            ends = effect.interval.get(name, (value, value))
            log, low, high = (
                power * (x if name.startswith("log_") else math.log(x)) for x in (value, *ends)
            )
            reach = max(_OWN, abs(low - log), abs(high - log))
            by_unit: dict[str, list[str]] = {}
            for s in specimens:
                own = s.force_unit_N if quantity == "force" else s.travel_unit_mm
                if own is None or (effect.specimens and s.id not in effect.specimens):
                    continue
                unit = unit_near(QUANTITIES[quantity][1], math.log(own) + log, own, reach)
                if unit is not None:
                    by_unit.setdefault(unit, []).append(s.id)
            for unit, ids in by_unit.items():
                yield UnitOf(quantity, unit, () if len(ids) == len(specimens) else tuple(ids))


def merged_units(units: Iterable[UnitOf]) -> tuple[UnitOf, ...]:
    """Return each unit once, with all its specimens."""
    found: dict[tuple[str, str], tuple[str, ...]] = {}
    for one in units:
        key = one.quantity, one.unit
        before = found.setdefault(key, one.specimens)
        # No specimens means all.
        found[key] = (
            tuple(dict.fromkeys(before + one.specimens)) if before and one.specimens else ()
        )
    return tuple(UnitOf(*key, specimens) for key, specimens in found.items())


def unit_near(kind: str, log: float, own: float, reach: float = _OWN) -> str | None:
    """Return the unit of a factor, or as a number the inverse of one; None where none is near.

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
    for choices in (units, inverse):
        unit = min(choices, key=lambda name: abs(math.log(choices[name]) - log))
        if abs(math.log(choices[unit]) - log) <= reach:
            return unit
    return None
