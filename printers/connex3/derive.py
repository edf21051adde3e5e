"""Derive the palette from the thesis: ``python -m printers.connex3.derive`` rewrites it.

Each elastomer's published curve is regenerated over its valid range, freed of its toe and
fitted with a stress-free Ogden law; rigid grades keep their published modulus. How and why:
docs/explanation/thesis-numbers.md.
"""

import math
from importlib.resources import files
from pathlib import Path

import msgspec
import numpy as np

from planner.arrays import FloatArray
from planner.materials.laws.ogden_thesis import literal_stress_MPa
from printers.connex3.ogden_fit import fit_ogden
from printers.connex3.thesis import Published, Thesis, load_thesis
from printers.connex3.toe import CorrectedCurve, correct

__all__ = ["PALETTE", "fit_strains", "palette_text", "reading_log_sd"]

PALETTE = Path(__file__).parent / "palettes" / "connex3-tango-vero.toml"

SPECIMEN_LOG_SD = 0.05
"""Scatter between specimens of one print; the thesis prints none. PolyJet elastomers show
coefficients of variation of 1 to 9 %."""

_READING_STRAINS = np.geomspace(0.02, 0.5, 15)

_HEADER = """\
# Derived from thesis.toml by `python -m printers.connex3.derive`; edit that, not this.
# `law`: stress-free, for planning. `published`: eq. 3.8 as printed, never planned with.
schema = 1
name = "connex3-tango-vero"
kind = "palette"
source = "{source}; see docs/explanation/thesis-numbers.md"

# 1 mm/s on a gauge of about 29 mm; hand-cleaned without water, 8 to 10 days after printing.
[reference]
strain_rate_per_s = 0.034
temperature_C = 23.0
soak_h = 0.0
age_days = 9.0
orientation = "x"
"""


class _Entry(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    id: str
    aliases: list[str]
    colour: str


class _Catalogue(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    schema: int
    density_g_cm3: dict[str, float]
    material: list[_Entry]


def fit_strains(curve: CorrectedCurve) -> FloatArray:
    """Return the strains that the law is fitted at: 0.5 % to the break, evenly in logarithm."""
    return np.geomspace(0.005, curve.published.elongation_at_break - curve.toe, 200)


def reading_log_sd(curve: CorrectedCurve) -> float:
    """Return how far ln(secant modulus) moves under other readings of the published curve.

    Root mean square, over working strains 0.02 to 0.5, of the differences to three readings as
    defensible: no toe taken off (the chord from zero strain to the onset), and the tangent
    taken at two thirds and at one and a half times the onset.
    """
    published, strain = curve.published, _READING_STRAINS
    ours = curve.nominal_stress_MPa(strain)
    chord = float(literal_stress_MPa(published.c, curve.onset)) / curve.onset
    others = [
        CorrectedCurve(published, curve.onset, 0.0, chord),
        correct(published, curve.onset / 1.5),
        correct(published, curve.onset * 1.5),
    ]
    shifts = [np.log(other.nominal_stress_MPa(strain) / ours) for other in others]
    return float(np.sqrt(np.mean(np.square(shifts))))


def palette_text() -> str:
    """Return the palette file."""
    thesis = load_thesis()
    catalogue = msgspec.toml.decode(
        (files("printers.connex3") / "catalogue.toml").read_bytes(), type=_Catalogue
    )
    entries = {entry.id: entry for entry in catalogue.material}
    return _HEADER.format(source=thesis.source) + "".join(
        _material(thesis, published, entries[published.id], catalogue.density_g_cm3)
        for published in thesis.materials
    )


def _material(
    thesis: Thesis, published: Published, entry: _Entry, densities: dict[str, float]
) -> str:
    soft, hard = thesis.materials[0], thesis.materials[-1]
    m = thesis.coordinate(published)
    share = m / thesis.coordinate(hard)
    density = (1.0 - share) * densities[soft.id] + share * densities[hard.id]
    aliases = ", ".join(f'"{alias}"' for alias in entry.aliases)
    lines = [
        "",
        "[[material]]",
        f'id = "{published.id}"',
        f"coordinate = {m!r}",
        f"elongation_at_break = {published.elongation_at_break:.2f}",
        f"density_g_cm3 = {density:.4f}",
        f"aliases = [{aliases}]",
        f'colour = "{entry.colour}"',
    ]
    if published.c:
        lines += _elastomer(published)
    else:
        lines += [
            'deformation = "plastic"',
            f"modulus_log_sd = {_rigid_log_sd(thesis):.3f}",
            'source = "Young\'s modulus of Table 3.1; density interpolated"',
            "[material.law]",
            'model = "linear"',
            f"modulus_MPa = {published.youngs_modulus_MPa!r}",
        ]
    return "\n".join(lines) + "\n"


def _elastomer(published: Published) -> list[str]:
    curve = correct(published)
    strain = fit_strains(curve)
    law = fit_ogden(strain, curve.nominal_stress_MPa(strain), published.elongation_at_break)
    log_sd = math.hypot(SPECIMEN_LOG_SD, reading_log_sd(curve))
    return [
        f"modulus_log_sd = {log_sd:.3f}",
        f'source = "Table 3.2, toe of {curve.toe:.4f} taken off; density interpolated"',
        "[material.law]",
        'model = "ogden"',
        f"mu_MPa = {_numbers(law.mu_MPa)}",
        f"alpha = {_numbers(law.alpha)}",
        "[material.published]",
        'model = "ogden-thesis"',
        f"c = {_numbers(published.c)}",
        f"strain_min = {curve.onset:.4f}",
        f"strain_max = {published.elongation_at_break:.2f}",
    ]


def _rigid_log_sd(thesis: Thesis) -> float:
    """Table 3.1 against a curve, where both can be believed: the hardest elastomer."""
    hardest = thesis.elastomers[-1]
    reading = math.log(hardest.youngs_modulus_MPa / correct(hardest).modulus_MPa)
    return math.hypot(SPECIMEN_LOG_SD, reading)


def _numbers(values: tuple[float, ...]) -> str:
    return f"[{', '.join(f'{value:.7g}' for value in values)}]"


if __name__ == "__main__":
    PALETTE.write_text(palette_text(), encoding="utf-8", newline="\n")
