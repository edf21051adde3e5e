"""Derive the palette from the thesis: ``python -m printers.connex3.derive`` rewrites it.

Each elastomer's published curve is regenerated over its valid range, freed of its toe and
fitted with a stress-free Ogden law; rigid grades keep their published modulus. How and why:
docs/explanation/thesis-numbers.md.
"""

import math
from importlib.resources import files
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from planner.numerics import FloatArray
from planner.palette import LawParameters, Material, Palette, Reference, encode_palette
from printers.connex3.ogden_fit import fit_ogden
from printers.connex3.thesis import Published, Thesis, literal_stress_MPa, load_thesis
from printers.connex3.toe import CorrectedCurve, correct

__all__ = [
    "PALETTE",
    "fit_strains",
    "palette_bytes",
    "reading_log_sd",
]

PALETTE = Path(__file__).parent / "palettes" / "connex3-tango-vero.toml"

SPECIMEN_LOG_SD = 0.05
"""Scatter between specimens of one print; the thesis prints none. PolyJet elastomers show
coefficients of variation of 1 to 9 %."""

_READING_STRAINS = np.geomspace(0.02, 0.5, 15)

_COMMENT = b"""\
# Derived from thesis.toml by `python -m printers.connex3.derive`: edit that, not this. A law is
# stress-free at rest, for planning; what is published is eq. 3.8 as printed, never planned with.
"""

_DENSITY = "density interpolated between the base resins' (unconfirmed)"

_REFERENCE = Reference(
    strain_rate_per_s=0.034,  # 1 mm/s on a gauge of about 29 mm
    temperature_C=23.0,
    soak_h=0.0,
    age_days=9.0,
    orientation="x",
)


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


def _rigid_reading_log_sd(published: Published, thesis: Thesis) -> float:
    """Return how far ln(modulus) of a rigid grade moves under other readings of Table 3.1.

    Root mean square of two: Table 3.1 against the curve at the hardest elastomer, where both
    can be believed; and the modulus of the straight line to the break that has the grade's own
    toughness, 2 U / ε².
    """
    hardest = thesis.elastomers[-1]
    line = 2.0 * published.toughness_MJ_m3 / published.elongation_at_break**2
    readings = (
        math.log(hardest.youngs_modulus_MPa / correct(hardest).modulus_MPa),
        math.log(line / published.youngs_modulus_MPa),
    )
    return math.sqrt(sum(r**2 for r in readings) / len(readings))


def _derived_palette() -> Palette:
    """Return the palette."""
    thesis = load_thesis()
    catalogue = msgspec.toml.decode(
        (files("printers.connex3") / "catalogue.toml").read_bytes(), type=_Catalogue
    )
    soft, hard = (catalogue.density_g_cm3[thesis.materials[k].id] for k in (0, -1))
    last = thesis.coordinate(thesis.materials[-1])
    materials = []
    for published, entry in zip(thesis.materials, catalogue.material, strict=True):
        coordinate = thesis.coordinate(published)
        materials.append(
            Material(
                id=published.id,
                coordinate=coordinate,
                elongation_at_break=published.elongation_at_break,
                density_g_cm3=round(soft + (hard - soft) * coordinate / last, 4),
                aliases=tuple(entry.aliases),
                colour=entry.colour,
                **(_elastic(published) if published.c else _plastic(published, thesis)),
            )
        )
    return Palette(
        name=PALETTE.stem,
        materials=tuple(materials),
        reference=_REFERENCE,
        source=f"{thesis.source}; see docs/explanation/thesis-numbers.md",
    )


def palette_bytes() -> bytes:
    """Return the palette file."""
    return _COMMENT + encode_palette(_derived_palette())


def _elastic(published: Published) -> dict[str, Any]:
    curve = correct(published)
    strain = fit_strains(curve)
    law = fit_ogden(strain, curve.nominal_stress_MPa(strain), published.elongation_at_break)
    valid = {"strain_min": (curve.onset,), "strain_max": (published.elongation_at_break,)}
    return {
        "law": LawParameters("ogden", {"mu_MPa": law.mu_MPa, "alpha": law.alpha}),
        "published": LawParameters("ogden-thesis", {"c": published.c, **valid}),
        "modulus_log_sd": round(math.hypot(SPECIMEN_LOG_SD, reading_log_sd(curve)), 3),
        "source": f"Table 3.2, toe of {curve.toe:.4f} taken off; {_DENSITY}",
        "deformation": "elastic",
    }


def _plastic(published: Published, thesis: Thesis) -> dict[str, Any]:
    return {
        "law": LawParameters("linear", {"modulus_MPa": (published.youngs_modulus_MPa,)}),
        "modulus_log_sd": round(
            math.hypot(SPECIMEN_LOG_SD, _rigid_reading_log_sd(published, thesis)), 3
        ),
        "source": f"Young's modulus of Table 3.1; {_DENSITY}",
        "deformation": "plastic",
    }


if __name__ == "__main__":
    PALETTE.write_bytes(palette_bytes())
