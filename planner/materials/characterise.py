"""What a tensile test says of a material without any law: modulus, toughness, elongation."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from planner.errors import ArgumentError
from planner.materials.curve import Curve
from planner.materials.deformation import Deformation, deformation, yield_strain
from planner.materials.linear_part import LinearPart, linear_part

__all__ = [
    "SECANT_STRAINS",
    "Characteristics",
    "MaterialCharacteristics",
    "Spread",
    "characterise",
    "characterise_material",
    "spread",
    "toe_compensated",
]

SECANT_STRAINS = (0.1, 0.5, 1.0)
OFFSET_SHARE = 0.02
"""Stress at rest, as a share of the peak, that tells a load cell not zeroed."""

CONFIDENCE = 0.95
_FIGURES = (
    "modulus_MPa", "modulus_uncompensated_MPa", "toughness_MJ_m3", "elongation_at_break",
    "strength_MPa",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Characteristics:
    """One specimen's figures. Strains count from the toe-compensated origin.

    Attributes
    ----------
    modulus_MPa
        Young's modulus: the slope of the linear part.
    modulus_uncompensated_MPa
        Stress over strain at the end of the linear part with strains as recorded: what the
        modulus would be without compensation. The modulus itself where there is no toe.
    toe_strain
        What was taken off the strains; 0 where there is no toe.
    toughness_MJ_m3
        Area under the curve to break, in MJ/m3 (MPa).
    elongation_at_break
        Strain at break, a fraction.
    strength_MPa
        Largest nominal stress.
    secant_MPa
        Stress over strain by strain; None beyond break.
    """

    specimen: str
    modulus_MPa: float
    modulus_uncompensated_MPa: float
    linear_strain: tuple[float, float]
    toe_strain: float
    toughness_MJ_m3: float
    elongation_at_break: float
    strength_MPa: float
    secant_MPa: Mapping[float, float | None]
    yield_strain: float | None
    deformation: Deformation
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Spread:
    """Mean and scatter of one figure over replicates.

    Attributes
    ----------
    sd, cv
        Standard deviation (n - 1) and its ratio to the mean; None for one specimen.
    interval
        95 % interval of the mean by Student's t; None for one specimen.
    """

    mean: float
    n: int
    sd: float | None
    cv: float | None
    interval: tuple[float, float] | None


@dataclass(frozen=True, slots=True)
class MaterialCharacteristics:
    """One material's figures over its specimens; names of `spreads` are those of the table."""

    material: str
    specimens: tuple[Characteristics, ...]
    spreads: Mapping[str, Spread]
    deformation: Deformation
    agree: bool

    @property
    def n(self) -> int:
        """Number of specimens."""
        return len(self.specimens)


def toe_compensated(curve: Curve, part: LinearPart | None = None) -> Curve:
    """Return the curve with strains counted from the end of its toe (ASTM D638, annex A1).

    Points before that origin are dropped; a curve without a toe comes back as it is.
    """
    part = linear_part(curve) if part is None else part
    if part.toe_strain == 0.0:
        return curve
    keep = curve.strain >= part.toe_strain
    return replace(
        curve,
        strain=curve.strain[keep] - part.toe_strain,
        stress_MPa=curve.stress_MPa[keep],
        time_s=None if curve.time_s is None else curve.time_s[keep],
        notes=(*curve.notes, _toe_note(curve, part)),
    )


def characterise(
    curve: Curve, *, secant_strains: Sequence[float] = SECANT_STRAINS
) -> Characteristics:
    """Take a loading curve's figures.

    Raises
    ------
    FileError
        The curve has no rising part to take a slope from.
    ArgumentError
        A secant strain is not above 0.
    """
    for value in secant_strains:
        if not 0.0 < value < np.inf:
            raise ArgumentError(f"secant strain is {value:g}; it must be a number above 0")
    part = linear_part(curve)
    strain = curve.strain - part.toe_strain
    end = part.stop - 1
    elongation = float(strain[-1])
    at_yield = yield_strain(curve)
    if at_yield is not None:
        at_yield -= part.toe_strain
    how = deformation(part.modulus_MPa, elongation, at_yield)
    notes = [_toe_note(curve, part), *_offset_note(curve, part)]
    if how.kind == "elastic":
        notes += _fall_note(curve)
    origin_area = 0.0
    if part.toe_strain == 0.0 and strain[0] > 0.0:
        origin_area = 0.5 * float(strain[0]) * max(float(curve.stress_MPa[0]), 0.0)
    return Characteristics(
        specimen=curve.specimen,
        modulus_MPa=part.modulus_MPa,
        modulus_uncompensated_MPa=part.modulus_MPa * float(strain[end] / curve.strain[end])
        if part.toe_strain
        else part.modulus_MPa,
        linear_strain=(float(strain[part.start]), float(strain[end])),
        toe_strain=part.toe_strain,
        toughness_MJ_m3=float(np.trapezoid(curve.stress_MPa, strain)) + origin_area,
        elongation_at_break=elongation,
        strength_MPa=float(np.max(curve.stress_MPa)),
        secant_MPa=MappingProxyType(
            {value: _secant(curve, part.toe_strain, value) for value in secant_strains}
        ),
        yield_strain=at_yield,
        deformation=how,
        notes=tuple(notes),
    )


def characterise_material(
    material: str, curves: Sequence[Curve], *, secant_strains: Sequence[float] = SECANT_STRAINS
) -> MaterialCharacteristics:
    """Take the figures of a material's specimens, with their spread.

    Raises
    ------
    FileError, ArgumentError
        See `characterise`.
    """
    found = tuple(characterise(curve, secant_strains=secant_strains) for curve in curves)
    figures: dict[str, list[float | None]] = {
        name: [getattr(c, name) for c in found] for name in _FIGURES
    }
    for strain in secant_strains:
        figures[f"secant_{strain:g}_MPa"] = [c.secant_MPa[strain] for c in found]
    spreads = {
        name: spread(known)
        for name, values in figures.items()
        if (known := [value for value in values if value is not None])
    }
    yields = [c.yield_strain for c in found if c.yield_strain is not None]
    whole = deformation(
        spreads["modulus_MPa"].mean,
        spreads["elongation_at_break"].mean,
        float(np.mean(yields)) if 2 * len(yields) > len(found) else None,
    )
    agree = all(c.deformation.kind == whole.kind for c in found)
    return MaterialCharacteristics(material, found, MappingProxyType(spreads), whole, agree)


def spread(values: Sequence[float]) -> Spread:
    """Return mean, standard deviation, coefficient of variation and 95 % t-interval."""
    n = len(values)
    mean = float(np.mean(values))
    if n < 2:
        return Spread(mean, n, None, None, None)
    from scipy.special import stdtrit

    sd = float(np.std(values, ddof=1))
    half = float(stdtrit(n - 1, 0.5 + CONFIDENCE / 2)) * sd / np.sqrt(n)
    cv = sd / abs(mean) if mean else None
    return Spread(mean, n, sd, cv, (mean - float(half), mean + float(half)))


def _secant(curve: Curve, toe: float, strain: float) -> float | None:
    """Stress over strain, the stress from a line through the points nearby."""
    x = curve.strain - toe
    if strain > x[-1] or strain < x[0]:
        return None
    near = np.abs(x - strain)
    # Five points even out noise; where they lie too far apart, two have to do.
    at = np.sort(np.argsort(near, kind="stable")[:5])
    u = x[at] - strain
    v = curve.stress_MPa[at]
    sxx = float(np.sum((u - u.mean()) ** 2))
    if float(np.ptp(u)) > 0.5 * strain or sxx == 0.0:
        return float(np.interp(strain, x, curve.stress_MPa)) / strain
    slope = float(np.sum((u - u.mean()) * (v - v.mean()))) / sxx
    return float(v.mean() - slope * u.mean()) / strain


def _toe_note(curve: Curve, part: LinearPart) -> str:
    where = f"specimen {curve.specimen}"
    if part.toe_strain:
        return (
            f"{where}: a toe; strains count from {part.toe_strain:.4g}, where the tangent at the "
            "steepest slope meets zero stress (ASTM D638, annex A1)"
        )
    if part.kind == "origin":
        return f"{where}: steepens from the start; modulus at the origin, strains not shifted"
    if part.kind == "arc":
        return f"{where}: bends from the start; modulus at the origin, no toe, strains not shifted"
    if part.start == 0 and part.zero_strain > 0.0 and curve.strain[0] > 0.0:
        return (
            f"{where}: the record starts within the linear part, at strain {curve.strain[0]:.4g}, "
            f"whose line meets zero stress at {part.zero_strain:.4g}; no toe is recorded, strains "
            "not shifted"
        )
    return f"{where}: no toe; strains not shifted"


def _offset_note(curve: Curve, part: LinearPart) -> list[str]:
    """Note a line or arc that misses the origin though the record begins at rest."""
    at_rest = -part.modulus_MPa * part.zero_strain
    peak = float(np.max(curve.stress_MPa))
    begins = float(curve.strain[0]) <= 0.01 * float(curve.strain[-1])
    if part.toe_strain or not begins or abs(at_rest) <= OFFSET_SHARE * peak:
        return []
    return [
        f"specimen {curve.specimen}: the curve's beginning points at {at_rest:.3g} MPa at rest, "
        f"{100 * at_rest / peak:.2g} % of its peak; the load cell may not have been zeroed"
    ]


def _fall_note(curve: Curve) -> list[str]:
    """Note a long fall at the end of a rubber's curve, which counts as elongation."""
    peak, end = int(np.argmax(curve.stress_MPa)), float(curve.strain[-1])
    at_peak, fallen = float(curve.strain[peak]), 1.0 - curve.stress_MPa[-1] / curve.stress_MPa[peak]
    if at_peak > 0.98 * end or fallen < 0.1:
        return []
    return [
        f"specimen {curve.specimen}: the stress falls slowly from its peak at strain {at_peak:.4g} "
        f"to the break at {end:.4g}; toughness and strain at break count that as elongation"
    ]
