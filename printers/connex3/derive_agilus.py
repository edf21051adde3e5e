"""Derive the Agilus palette from others' readings: ``python -m printers.connex3.derive_agilus``.

Nobody whom we could read pulled the mixtures of Agilus30 and Vero by their names. What is known of
them is a nominal hardness; six sources tell how stiff PolyJet rubbers of a stated hardness are in
tension, and the palette is Gent's relation times their mean. How sure that is, and what would be
better: docs/explanation/agilus-numbers.md.
"""

import math
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from planner.materials.laws import NeoHookean, secant_modulus_MPa
from planner.materials.mixtures import gent_modulus_MPa
from planner.palette import LawParameters, Material, Palette, Reference, encode_palette
from printers.connex3.agilus import (
    Entry,
    Reading,
    Sources,
    load_sources,
    rigid_readings,
    rubber_readings,
)
from printers.connex3.derive import SPECIMEN_LOG_SD, yielding_law

__all__ = [
    "PALETTE",
    "hardness_log_sd",
    "palette_bytes",
    "rigid_votes",
    "rubber_votes",
]

PALETTE = Path(__file__).parent / "palettes" / "connex3-agilus-vero.toml"

HARDNESS_SD = 2.5
"""Of a nominal Shore A: the digits in the names stand for ranges five points wide."""

_COMMENT = b"""\
# Derived from agilus.toml by `python -m printers.connex3.derive_agilus`: edit that, not this. The
# level is unsure by a factor of 4 either way, see docs/explanation/agilus-numbers.md; for a part
# that has to be right make a palette of your own tests with `planner fit`.
"""

_DENSITY = "density between Agilus30's (STAMP 2025) and Vero's (Tango palette)"


def rubber_votes(readings: Iterable[Reading]) -> dict[str, float]:
    """Return ln of a source's moduli over Gent's, the mean of its readings: one vote a source."""
    return _votes((r.source, math.log(r.of_gent)) for r in readings)


def rigid_votes(readings: Iterable[Reading]) -> dict[str, float]:
    """Return ln of a source's modulus in MPa: one vote a source."""
    return _votes((r.source, math.log(r.modulus_MPa)) for r in readings)


def hardness_log_sd(shore_A: float) -> float:
    """Return how far ln of Gent's modulus moves by one `HARDNESS_SD`."""
    ends = (gent_modulus_MPa(shore_A + step) for step in (HARDNESS_SD, -HARDNESS_SD))
    harder, softer = ends
    return math.log(harder / softer) / 2.0


def palette_bytes() -> bytes:
    """Return the palette file."""
    return _COMMENT + encode_palette(_derived_palette(load_sources()))


def _votes(readings: Iterable[tuple[str, float]]) -> dict[str, float]:
    by_source: dict[str, list[float]] = {}
    for source, value in readings:
        by_source.setdefault(source, []).append(value)
    return {source: float(np.mean(values)) for source, values in by_source.items()}


def _derived_palette(sources: Sources) -> Palette:
    *rubbers, rigid = sources.material
    votes = list(rubber_votes(rubber_readings(sources)).values())
    return Palette(
        name=PALETTE.stem,
        materials=(
            # As on the Tango ladder, sixths; the rigid mixtures at 7/6 and 8/6 are left out.
            *(_rubber(entry, k / 6.0, votes, sources) for k, entry in enumerate(rubbers)),
            _rigid(rigid, 1.5, sources),
        ),
        hardness=tuple((k / 6.0, entry.shore_A) for k, entry in enumerate(rubbers)),
        reference=Reference(
            strain_rate_per_s=sources.test.strain_rate_per_s,
            temperature_C=sources.test.temperature_C,
            soak_h=0.0,
        ),
        source=sources.source,
        base_resins=(rubbers[0].id, rigid.id),
    )


def _rubber(entry: Entry, coordinate: float, votes: Sequence[float], sources: Sources) -> Material:
    scale = math.exp(float(np.mean(votes)))
    modulus = scale * gent_modulus_MPa(entry.shore_A)
    mu = modulus / float(secant_modulus_MPa(NeoHookean(1.0), sources.test.at_strain))
    spread = math.hypot(
        float(np.std(votes, ddof=1)), hardness_log_sd(entry.shore_A), SPECIMEN_LOG_SD
    )
    law = LawParameters("neo-hookean", {"mu_MPa": (_digits(mu),)})
    said = (
        f"{scale:.2f} times Gent's modulus of Shore A {entry.shore_A:g}, by {len(votes)} sources; "
        f"{_DENSITY}; break UNCONFIRMED"
    )
    return _material(entry, coordinate, sources, law, spread, said)


def _rigid(entry: Entry, coordinate: float, sources: Sources) -> Material:
    votes = list(rigid_votes(rigid_readings(sources)).values())
    modulus, (low, high) = math.exp(float(np.mean(votes))), entry.strength_MPa
    law = yielding_law(_digits(modulus), _digits(math.sqrt(low * high)))
    said = (
        f"modulus: geometric mean of {len(votes)} sources; flows at the middle of its strength, "
        f"{low:g} to {high:g} MPa (data sheet); density and break as in the Tango palette"
    )
    spread = math.hypot(float(np.std(votes, ddof=1)), SPECIMEN_LOG_SD)
    return _material(entry, coordinate, sources, law, spread, said)


def _material(
    entry: Entry, coordinate: float, sources: Sources, law: LawParameters, log_sd: float, said: str
) -> Material:
    soft, hard = sources.stamp.density_g_cm3["Agilus30"], sources.material[-1].density_g_cm3
    return Material(
        id=entry.id,
        coordinate=coordinate,
        elongation_at_break=entry.elongation_at_break,
        density_g_cm3=round(soft + (hard - soft) * coordinate / 1.5, 4),
        law=law,
        aliases=tuple(entry.aliases),
        colour=entry.colour,
        source=said,
        deformation="plastic" if math.isnan(entry.shore_A) else "elastic",
        modulus_log_sd=round(log_sd, 3),
    )


def _digits(value: float) -> float:
    """Keep three digits: more than the sources are worth."""
    return float(f"{value:.3g}")


if __name__ == "__main__":
    PALETTE.write_bytes(palette_bytes())
