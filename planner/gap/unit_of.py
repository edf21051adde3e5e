"""The units that a campaign's force or travel may be in: as stated, as a verdict hints."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType

from planner.errors import UnknownNameError, did_you_mean
from planner.formats.units import OWN, QUANTITIES, UnitOf, parsed_unit, unit_near
from planner.gap.campaign import Specimen
from planner.gap.diagnosis import FoundEffect

__all__ = ["merged_units", "stated_units", "suggested_units"]


# ------------------------------------------------------------------------------------------------
# As a person states it: ``force=lbf:S1,S2``.


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
        one = parsed_unit(text, ("force", "travel"))
        for id in one.specimens or specimens:
            if id not in found:
                raise UnknownNameError(
                    f"unit_of {text}: no specimen {id!r} in specimens.csv; "
                    f"{did_you_mean(id, specimens)}its ids stand in the column 'specimen'"
                )
            found[id][one.quantity] = one
    return found


# ------------------------------------------------------------------------------------------------
# As a verdict hints: a gain of force or travel that is the factor between two units.


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
            reach = max(OWN, abs(low - log), abs(high - log))
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
