"""Units that testing machines write, as factors to mm, N, MPa, s and fractions.

Factors follow the international inch, the avoirdupois pound and standard gravity (NIST SP 811,
appendix B).
"""

from collections.abc import Mapping
from types import MappingProxyType

from planner.errors import FileError

__all__ = ["QUANTITY_UNITS", "is_unit", "unit_factor"]

_POUND_FORCE_N = 0.45359237 * 9.80665
_PSI_MPA = _POUND_FORCE_N / 25.4**2

QUANTITY_UNITS: Mapping[str, Mapping[str, float]] = MappingProxyType(
    {
        "time": {
            "s": 1.0, "sec": 1.0, "secs": 1.0, "second": 1.0, "seconds": 1.0,
            "ms": 1e-3, "min": 60.0, "minutes": 60.0, "h": 3600.0, "hr": 3600.0,
        },
        "length": {
            "mm": 1.0, "cm": 10.0, "m": 1000.0, "um": 1e-3, "µm": 1e-3, "μm": 1e-3,
            "in": 25.4, "inch": 25.4, "inches": 25.4, '"': 25.4, "mil": 0.0254, "ft": 304.8,
        },
        "force": {
            "N": 1.0, "mN": 1e-3, "kN": 1e3, "MN": 1e6, "newton": 1.0, "newtons": 1.0,
            "lbf": _POUND_FORCE_N, "lb": _POUND_FORCE_N, "lbs": _POUND_FORCE_N,
            "klbf": 1e3 * _POUND_FORCE_N, "kip": 1e3 * _POUND_FORCE_N,
            "ozf": _POUND_FORCE_N / 16, "oz": _POUND_FORCE_N / 16,
            "kgf": 9.80665, "kg": 9.80665, "gf": 9.80665e-3, "g": 9.80665e-3,
        },
        "stress": {
            "MPa": 1.0, "Pa": 1e-6, "kPa": 1e-3, "GPa": 1e3, "bar": 0.1,
            "N/mm2": 1.0, "N/mm^2": 1.0, "N/mm²": 1.0, "N/m2": 1e-6, "N/m^2": 1e-6, "N/m²": 1e-6,
            "psi": _PSI_MPA, "ksi": 1e3 * _PSI_MPA, "lbf/in2": _PSI_MPA, "lbf/in^2": _PSI_MPA,
            "kgf/mm2": 9.80665, "kgf/mm^2": 9.80665,
        },
        "strain": {
            "": 1.0, "-": 1.0, "1": 1.0, "mm/mm": 1.0, "m/m": 1.0, "in/in": 1.0, "fraction": 1.0,
            "%": 0.01, "percent": 0.01, "per cent": 0.01, "pct": 0.01, "mm/mm %": 0.01,
            "µε": 1e-6, "με": 1e-6, "microstrain": 1e-6,
        },
    }
)  # fmt: skip
"""Factors to s, mm, N, MPa and fractions, by quantity and unit."""

_CASE_MATTERS = {"mN", "MN"}
_FOLDED = {
    quantity: {unit.casefold(): f for unit, f in units.items() if unit not in _CASE_MATTERS}
    for quantity, units in QUANTITY_UNITS.items()
}


def _find(quantity: str, unit: str) -> float | None:
    unit = unit.removesuffix(".")  # "sec.", "in."
    factor = QUANTITY_UNITS[quantity].get(unit)
    return _FOLDED[quantity].get(unit.casefold()) if factor is None else factor


def is_unit(text: str) -> bool:
    """Say whether `text` is a unit of any quantity that is known here."""
    return bool(text.strip()) and any(_find(q, text.strip()) is not None for q in QUANTITY_UNITS)


def unit_factor(quantity: str, unit: str, *, where: str) -> float:
    """Return the factor from a unit to planner's own unit of that quantity.

    Parameters
    ----------
    quantity
        A key of `QUANTITY_UNITS`.
    unit
        As the file writes it; case is ignored, save between mN and MN.
    where
        What errors call the place: file and column.

    Raises
    ------
    FileError
        The unit is none of that quantity.
    """
    factor = _find(quantity, unit.strip())
    if factor is None:
        known = ", ".join(repr(u) for u in QUANTITY_UNITS[quantity] if u.isascii() and u)
        raise FileError(f"{where}: unknown unit {unit.strip()!r} of {quantity}; use one of {known}")
    return factor
