"""Effects, axes and figures of a diagnosis in words."""

import math
from collections.abc import Mapping, Sequence

from planner.gap.diagnosis import Effects
from planner.gap.effects import EFFECTS

__all__ = [
    "CLAUSES",
    "axis_words",
    "clause",
    "effects_words",
    "figure",
    "id_of",
    "listed",
    "p_value",
    "percent",
    "probability",
    "sentence",
    "setting",
    "title",
    "unit_of",
]

CLAUSES: Mapping[str, str] = {
    "ageing": "specimens tested long after printing carry another force than fresh ones",
    "composition-offset": "what was printed is softer or harder than the mixture asked for",
    "cross-section": "specimens are thicker or thinner than drawn, so all stresses are off",
    "force-offset": "the load cell does not show zero when nothing pulls",
    "force-scale": "the load cell shows a multiple of the true force: its gain, or a unit mixed up",
    "grip-slack": "part of the travel is taken up before the specimen is pulled",
    "grip-slip": "the specimen creeps out of the grips as the load grows",
    "interface-bleed": "materials mix where they meet, so that steps in a bar are blurred",
    "machine-compliance": "the machine and the grips give way under load and take up travel",
    "material-law": "the palette's law of one material does not describe that material",
    "moisture": "water taken up in soaking softens the specimens",
    "orientation": "stiffness depends on how the specimen lay on the tray",
    "permanent-set": "specimens stay longer after a large strain and come back slack",
    "rate": "force depends on how fast the specimen is pulled, and relaxes when it is held",
    "skin": "a surface layer differs from the inside, and weighs more in thin specimens",
    "softening": "a specimen is softer once it has been strained (Mullins effect)",
    "strain-scale": "true strains are a multiple of the recorded ones: gauge length or travel",
    "temperature": "stiffness at the test's temperature differs from that at the palette's",
}
"""What each effect does, as the end of a sentence."""

_AXES: Mapping[str, str] = {
    "age_days": "age at the test",
    "batch": "batch",
    "branch": "branch of the path",
    "gauge_mm": "gauge length",
    "material": "material or design",
    "measured_thickness_mm": "measured thickness",
    "measured_width_mm": "measured width",
    "orientation": "orientation on the tray",
    "position": "position along the bar",
    "protocol": "protocol",
    "rate_mm_s": "crosshead speed",
    "soak_h": "soaking time",
    "specimen": "single specimens",
    "strain": "strain",
    "temperature_C": "temperature",
    "thickness_mm": "thickness",
    "time": "time",
    "width_mm": "width",
}

_UNITS: Mapping[str, str] = {
    "_mm_s": "mm/s", "_per_s": "1/s", "_MPa": "MPa", "_mm": "mm", "_days": "days", "_C": "°C",
    "_h": "h", "_s": "s", "_N": "N",
}  # fmt: skip


def id_of(effects: Effects) -> str:
    """Return a hypothesis as a verdict is written: "none", an id, or "a+b"."""
    return "+".join(effects) if effects else "none"


def title(effect: str) -> str:
    """Return the name that an effect has in a heading."""
    if effect == "unknown":
        return "something unknown"
    return EFFECTS[effect].title if effect in EFFECTS else effect


def effects_words(effects: Effects) -> str:
    """Return a hypothesis in words."""
    return " + ".join(title(e) for e in effects) if effects else "no gap"


def clause(effect: str) -> str:
    """Return what an effect does, as the end of a sentence."""
    return CLAUSES.get(effect, title(effect))


def axis_words(axis: str) -> str:
    """Return an axis in words; a column that planner does not know keeps its name."""
    return _AXES.get(axis, f"column {axis}")


def listed(words: Sequence[str], most: int | None = None, last: str = "and") -> str:
    """Write a list in a sentence, a long one in short."""
    if most is not None and len(words) > most:
        return f"{', '.join(words[:most])} {last} {len(words) - most} more"
    if len(words) < 2:
        return "".join(words)
    return f"{', '.join(words[:-1])} {last} {words[-1]}"


def percent(share: float, digits: int = 2) -> str:
    """Write a share in per cent: 0.214 is "21 %", 0.034 is "3.4 %"."""
    return f"{figure(100.0 * share, digits)} %" if math.isfinite(share) else "open"


def figure(value: float, digits: int = 3) -> str:
    """Write a figure with so many significant digits, whole numbers in full."""
    if not math.isfinite(value):
        return "open"
    if value == 0.0:
        return "0"
    rounded = float(f"{value:.{digits - 1}e}")
    power = math.floor(math.log10(abs(rounded)))
    if -4 <= power < 6:
        return f"{rounded:.{max(0, digits - 1 - power)}f}"
    mantissa, _, exponent = f"{rounded:.{digits - 1}e}".partition("e")
    return f"{mantissa}e{int(exponent)}"


def probability(value: float) -> str:
    """Write a probability without claiming certainty."""
    if value > 0.995:
        return "above 0.99"
    if value < 0.005:
        return "below 0.01"
    return f"{value:.2f}"


def p_value(p: float) -> str:
    """Write a p-value with one digit where it is small, which is all that it is known to."""
    return f"p = {figure(p, 2 if p >= 0.01 else 1)}"


def setting(column: str, value: object) -> str:
    """Write what a specimen has on an axis: "temperature 35 °C", "material FLX9760"."""
    words, unit = axis_words(column), unit_of(column)
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return f"{words} {value:.4g} {unit}".rstrip()
    return f"{words} {value}"


def unit_of(column: str) -> str:
    """Return the unit that a column's name ends in, "" for none."""
    return next((unit for end, unit in _UNITS.items() if column.endswith(end)), "")


def sentence(words: str) -> str:
    """Return words with a capital and a full stop, unless they end in one or in a question."""
    words = words.strip()
    if words and words[0].islower() and "_" not in words.partition(" ")[0]:
        words = words[0].upper() + words[1:]
    return words if words.endswith((".", "?", "!")) else words + "."
