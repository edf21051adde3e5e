"""Derive the palette from the thesis: ``python -m printers.connex3.derive`` rewrites it.

Each elastomer's published curve is regenerated over its valid range, freed of its toe and
fitted with a stress-free Ogden law, or one that bends over where no Ogden law follows it and stays
a rubber's in compression. Rigid grades have two readings: by crosshead (the thesis) and
by extensometer (others), a palette each. How and why: docs/explanation/thesis-numbers.md.
"""

import math
from dataclasses import asdict
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np

from planner.materials.algorithm_one import literal_stress_MPa
from planner.materials.laws import Law, make_law
from planner.numerics import FloatArray
from planner.palette import LawParameters, Material, Palette, Reading, Reference, encode_palette
from printers.connex3.curve_fit import fit_ogden, fit_yielding, relative_rms
from printers.connex3.thesis import Published, Thesis, load_thesis
from printers.connex3.toe import CorrectedCurve, correct

__all__ = [
    "EXTENSOMETER_PALETTE",
    "PALETTE",
    "SPECIMEN_LOG_SD",
    "fit_strains",
    "palette_bytes",
    "reading_log_sd",
    "yielding_law",
]

PALETTE = Path(__file__).parent / "palettes" / "connex3-tango-vero.toml"
EXTENSOMETER_PALETTE = PALETTE.with_stem(f"{PALETTE.stem}-extensometer")

SPECIMEN_LOG_SD = 0.05
"""Scatter between specimens of one print; the thesis prints none. PolyJet elastomers show
coefficients of variation of 1 to 9 %."""

_SHARPNESS = 4.0
"""How sharply rigid grades bend into yield. Chosen, no source tells it: with 2 or 8 the secant at
strain 0.1 is within 5 % of this."""

_HARDENING = 0.2
"""Slope behind the yield over the flow stress, per unit of strain. Chosen, no source tells it:
stress has to go on rising, and to the break this is 3 to 6 %."""

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


class _Extensometer(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    modulus_MPa: tuple[float, float]
    source: str
    strength_MPa: tuple[float, float] | None = None


class _Entry(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    id: str
    aliases: list[str]
    colour: str
    shore_A: float | None = None
    extensometer: _Extensometer | None = None


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


def _derived_palette(reading: Literal["crosshead", "extensometer"]) -> Palette:
    """Return the palette whose rigid grades are as `reading` has them."""
    thesis = load_thesis()
    catalogue = msgspec.toml.decode(
        (files("printers.connex3") / "catalogue.toml").read_bytes(), type=_Catalogue
    )
    soft, hard = (catalogue.density_g_cm3[thesis.materials[k].id] for k in (0, -1))
    last = thesis.coordinate(thesis.materials[-1])
    materials, hardness = [], []
    for published, entry in zip(thesis.materials, catalogue.material, strict=True):
        coordinate, measured = thesis.coordinate(published), entry.extensometer
        material = Material(
            id=published.id,
            coordinate=coordinate,
            elongation_at_break=published.elongation_at_break,
            density_g_cm3=round(soft + (hard - soft) * coordinate / last, 4),
            aliases=tuple(entry.aliases),
            colour=entry.colour,
            **(_plastic(published, thesis, measured, reading) if measured else _elastic(published)),
        )
        materials.append(material)
        if entry.shore_A is not None:
            hardness.append((coordinate, entry.shore_A))
    file = PALETTE if reading == "crosshead" else EXTENSOMETER_PALETTE
    return Palette(
        name=file.stem,
        materials=tuple(materials),
        reference=_REFERENCE,
        hardness=tuple(hardness),
        source=f"{thesis.source}; see docs/explanation/thesis-numbers.md",
    )


def palette_bytes(reading: Literal["crosshead", "extensometer"] = "crosshead") -> bytes:
    """Return the palette file whose rigid grades are as `reading` has them."""
    return _COMMENT + encode_palette(_derived_palette(reading))


def _elastic(published: Published) -> dict[str, Any]:
    curve = correct(published)
    strain = fit_strains(curve)
    stress = curve.nominal_stress_MPa(strain)
    law: Law
    try:
        law = fit_ogden(strain, stress, published.elongation_at_break)
        parameters = LawParameters("ogden", {"mu_MPa": law.mu_MPa, "alpha": law.alpha})
    except ValueError:
        law = fit_yielding(strain, stress)
        parameters = LawParameters("yielding", {k: (v,) for k, v in asdict(law).items()})
    off = relative_rms(law, strain, stress)
    valid = {"strain_min": (curve.onset,), "strain_max": (published.elongation_at_break,)}
    return {
        "law": parameters,
        "published": LawParameters("ogden-thesis", {"c": published.c, **valid}),
        "modulus_log_sd": round(math.hypot(SPECIMEN_LOG_SD, reading_log_sd(curve), off), 3),
        "source": f"Table 3.2, toe of {curve.toe:.4f} taken off; {_DENSITY}",
        "deformation": "elastic",
    }


def _plastic(
    published: Published,
    thesis: Thesis,
    other: _Extensometer,
    reading: Literal["crosshead", "extensometer"],
) -> dict[str, Any]:
    readings = {
        "crosshead": _by_crosshead(published, thesis),
        "extensometer": _by_extensometer(published, other),
    }
    own = readings.pop(reading)
    return {
        "law": own.law,
        "modulus_log_sd": own.modulus_log_sd,
        "source": f"{own.source}; {_DENSITY}",
        "deformation": "plastic",
        "readings": tuple(readings.values()),
    }


def _by_crosshead(published: Published, thesis: Thesis) -> Reading:
    """Return Table 3.1's modulus, and a yield where its toughness leaves room for one.

    Behind the yield a curve has less area than the straight line to its break. Where the
    table's toughness is above the line's, the thesis carries no yield: the law is the line.
    """
    modulus, toughness = published.youngs_modulus_MPa, published.toughness_MJ_m3
    line = 0.5 * modulus * published.elongation_at_break**2
    if toughness < line:
        law = _flowing(modulus, published)
        known = "yield from its toughness"
    else:
        law = LawParameters("linear", {"modulus_MPa": (modulus,)})
        known = "its toughness is above that of the line to the break, so nothing carries a yield"
    sd = math.hypot(SPECIMEN_LOG_SD, _rigid_reading_log_sd(published, thesis))
    source = f"crosshead: Young's modulus of Table 3.1; {known}"
    return Reading("crosshead", law, round(sd, 3), source)


def _by_extensometer(published: Published, other: _Extensometer) -> Reading:
    """Return the law of a modulus in the middle of its range, flowing at its strength.

    Without a strength it flows so that the area to the break is Table 3.1's toughness: a machine's
    give moves strains, hardly the area where most of the strain is flow.
    """
    modulus = math.sqrt(math.prod(other.modulus_MPa))
    ranges = [other.modulus_MPa]
    if other.strength_MPa is None:
        law = _flowing(modulus, published)
    else:
        ranges.append(other.strength_MPa)
        law = yielding_law(modulus, math.sqrt(math.prod(other.strength_MPa)))
    # A range is read as a 95 % interval, 2 * 1.96 standard deviations wide.
    widest = max(math.log(high / low) / (2.0 * 1.96) for low, high in ranges)
    sd = math.hypot(SPECIMEN_LOG_SD, widest)
    return Reading("extensometer", law, round(sd, 3), f"extensometer: {other.source}")


def yielding_law(modulus_MPa: float, flow_MPa: float) -> LawParameters:
    """Return a rigid grade's law: it bends into yield at the flow stress and hardens a little."""
    figures = {
        "modulus_MPa": modulus_MPa,
        "flow_MPa": flow_MPa,
        "hardening_MPa": _HARDENING * flow_MPa,
        "sharpness": _SHARPNESS,
    }
    return LawParameters("yielding", {k: (float(f"{v:.7g}"),) for k, v in figures.items()})


def _flowing(modulus_MPa: float, published: Published) -> LawParameters:
    """Return the law whose area to the break is the printed toughness."""
    from scipy.optimize import brentq

    strain = np.linspace(0.0, published.elongation_at_break, 2001)

    def missing(flow_MPa: float) -> float:
        law = make_law(yielding_law(modulus_MPa, flow_MPa))
        area = float(np.trapezoid(law.nominal_stress_MPa(1.0 + strain), strain))
        return area - published.toughness_MJ_m3

    highest = modulus_MPa * published.elongation_at_break
    mean = published.toughness_MJ_m3 / published.elongation_at_break
    return yielding_law(modulus_MPa, float(brentq(missing, 0.5 * mean, 2.0 * highest)))


if __name__ == "__main__":
    PALETTE.write_bytes(palette_bytes())
    EXTENSOMETER_PALETTE.write_bytes(palette_bytes("extensometer"))
