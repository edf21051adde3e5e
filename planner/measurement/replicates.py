"""Which files are replicates of one material, by their names alone."""

import re
from collections.abc import Iterable

__all__ = ["materials_by_name"]

_REPLICATE = re.compile(r"(.+?)(?:_\d{1,2}|-0?[1-9]|[ _-][sS]\d{1,2}| ?\(\d{1,2}\))")
_TENS = re.compile(r"(.+?)-[1-9]\d")


def materials_by_name(names: Iterable[str]) -> dict[str, str]:
    """Return a material by specimen's name: the name without the replicate's number.

    A number of two digits behind a hyphen is a replicate's only where its stem has replicates
    below ten too: "Ecoflex 00-10" and "Ecoflex 00-30" are two materials, "FLX-10" is one more of
    "FLX-1", "FLX-2".
    """
    found = {name: match[1] for name in names if (match := _REPLICATE.fullmatch(name))}
    stems = {stem for name, stem in found.items() if re.fullmatch(r"-0?[1-9]", name[len(stem) :])}
    tens = {name: match[1] for name in names if (match := _TENS.fullmatch(name))}
    found |= {name: stem for name, stem in tens.items() if stem in stems}
    return {name: found.get(name, name) for name in names}
