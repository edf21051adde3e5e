"""A palette at another temperature, by what tests at two temperatures say of its grades."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from planner.errors import PaletteError
from planner.notes import Caution
from planner.palette import SAME_K, Palette
from planner.printers import Printer, palette_of

__all__ = ["at_temperature"]


def at_temperature(
    temperature_C: float,
    *,
    palette: str | Path | Palette | None = None,
    printer: str | Printer = "connex3",
) -> tuple[Palette, tuple[str, ...]]:
    """Return a palette as it is at a temperature, and what is to be known of it.

    ln(stress) falls straight with temperature, by the slope between the two temperatures that a
    grade was tested at. Between tested grades the slope is straight over the coordinate, beyond
    them that of the last. How sure it is adds to `Material.modulus_log_sd`.

    Parameters
    ----------
    temperature_C
        Of use.
    palette, printer
        A palette with a table ``[temperature]``, by name, file or value.

    Returns
    -------
    tuple
        The palette, and one sentence each: the factors, what is an extrapolation.

    Raises
    ------
    PaletteError
        The palette tells nothing of temperature, or not at which its laws were measured.

    Examples
    --------
    >>> warm, notes = planner.at_temperature(33, palette="lab.toml")  # doctest: +SKIP
    >>> planner.write_palette(warm, "warm.toml")  # doctest: +SKIP
    """
    chosen = palette_of(palette, printer)
    table, own_C = chosen.temperature, chosen.reference.temperature_C
    if table is None or own_C is None or not np.isfinite(temperature_C):
        raise PaletteError(
            f"palette {chosen.name}: it cannot be told at {temperature_C:g} degC; it needs "
            "[reference] temperature_C and a table [temperature], which planner fit makes of tests "
            "at two temperatures (column temperature_C)"
        )
    low, high = np.array(table.low_C), np.array(table.high_C)
    m = [material.coordinate for material in chosen.materials]
    warmer = temperature_C - own_C
    log = np.interp(m, table.coordinate, np.log(table.factor) / (high - low)) * warmer
    sd = np.interp(m, table.coordinate, np.array(table.log_sd) / (high - low)) * abs(warmer)
    warmed = []
    for material, change, own in zip(chosen.materials, log, sd, strict=True):
        factor = float(np.exp(change))
        readings = tuple(replace(r, law=r.law.stiffened(factor)) for r in material.readings)
        wide = float(np.hypot(material.modulus_log_sd, own))
        law = material.law.stiffened(factor)
        warmed.append(
            replace(material, law=law, modulus_log_sd=wide, readings=readings, uncertainty=None)
        )
    notes = [
        f"at {temperature_C:g} degC, of stress at {own_C:g} degC: "
        + ", ".join(f"{one.id} {np.exp(v):.2g}" for one, v in zip(warmed, log, strict=True))
    ]
    if not low.min() - SAME_K <= temperature_C <= high.max() + SAME_K:
        notes.append(
            Caution(
                f"{temperature_C:g} degC is an extrapolation: grades were tested from "
                f"{low.min():g} to {high.max():g} degC, and through a glass transition stress "
                "falls by more than the straight line says; test at that temperature"
            )
        )
    first, last = table.coordinate[0], table.coordinate[-1]
    if beyond := [one.id for one in warmed if not first <= one.coordinate <= last]:
        notes.append(
            Caution(
                f"{', '.join(beyond)}: beyond the grades tested at two temperatures, m {first:g} "
                f"to {last:g}; the nearest one's factor is taken: an extrapolation"
            )
        )
    use = replace(chosen.reference, temperature_C=temperature_C)
    name = f"{chosen.name}-at-{temperature_C:g}C"
    return replace(chosen, name=name, materials=tuple(warmed), reference=use), tuple(notes)
