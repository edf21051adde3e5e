"""Which material or blend has a wanted stiffness; and what stands at a wanted coordinate."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from planner.errors import ArgumentError, as_number, positive
from planner.glance import one_line
from planner.grading.profile import (
    AS_SHOWN,
    known_interval,
    stated_modulus_MPa,
    stiffness_scale,
)
from planner.materials.algorithm_one import (
    LiteralCurve,
    algorithm_one,
    literal_stress_MPa,
    quadratics_through,
)
from planner.materials.characterise import SECANT_STRAINS, Curve
from planner.materials.fit import fit_law, least_yielding, sample_of, yielding_parameters
from planner.materials.laws import candidate_laws, make_law
from planner.materials.mixtures import Blend, CoefficientModel, nearest_on
from planner.numerics import FloatArray
from planner.palette import LawParameters, Material, Palette
from planner.printers import Printer, palette_of

__all__ = ["Mixture", "invert"]


@dataclass(frozen=True, slots=True)
class MixtureLaw:
    """A law for other programs that stands for a mixture, which planner itself interpolates.

    Attributes
    ----------
    error
        Root mean square of its relative error in stress; 0 of a material of the palette.
    """

    law: LawParameters
    error: float


@dataclass(frozen=True, slots=True)
class MixtureSecant:
    """The secant modulus of a mixture at a strain, 0 for the initial one, and its 95 % interval."""

    strain: float
    modulus_MPa: float
    interval_MPa: tuple[float, float]


@dataclass(frozen=True, slots=True)
class Mixture:
    """The answer for one wanted modulus, or one coordinate.

    Attributes
    ----------
    target_MPa
        The wanted modulus; None where a coordinate was asked for.
    reachable
        Whether the palette's range holds the target; if not, `blend` is the nearest end.
    nearest
        Catalogue material nearest in log stiffness.
    blend, modulus_MPa, interval_MPa
        The interpolated blend, its modulus and the 95 % interval of that.
    range_MPa
        What the palette reaches.
    notes
        What to know of the materials named, one sentence each: `StiffnessScale.remarks`.
    secants
        Of a coordinate: its stiffness at more strains, up to the first break of its materials.
    law
        Of a coordinate, or where one was asked for: a law that stands for it.
    """

    target_MPa: float | None
    at_strain: float
    reachable: bool
    nearest: str
    nearest_modulus_MPa: float
    blend: Blend
    modulus_MPa: float
    interval_MPa: tuple[float, float]
    range_MPa: tuple[float, float]
    notes: tuple[str, ...] = ()
    secants: tuple[MixtureSecant, ...] = ()
    law: MixtureLaw | None = None

    @one_line
    def __repr__(self) -> str:
        return f"{self.blend_text()}: {self.modulus_MPa:.3g} MPa at strain {self.at_strain:g}" + (
            "" if self.reachable else f", the nearest to {self.target_MPa:.3g} MPa"
        )

    def blend_text(self) -> str:
        """Return the blend in words."""
        if self.blend.fraction == 0.0 or self.blend.lower == self.blend.upper:
            return self.blend.lower
        if self.blend.fraction == 1.0:
            return self.blend.upper
        share = 100.0 * self.blend.fraction
        return f"{100.0 - share:.1f} % {self.blend.lower} + {share:.1f} % {self.blend.upper}"

    def document(self) -> dict[str, Any]:
        """Return the answer as JSON holds it; moduli in MPa with all their digits."""
        found: dict[str, Any] = {
            "target_modulus_MPa": self.target_MPa,
            "reachable": self.reachable,
            "range_MPa": list(self.range_MPa),
            "nearest": {"material": self.nearest, "modulus_MPa": self.nearest_modulus_MPa},
            "blend": {**asdict(self.blend), **_stiffness(self)},
            "notes": list(self.notes),
        }
        if self.target_MPa is None:
            found["secants"] = [{"strain": one.strain, **_stiffness(one)} for one in self.secants]
        if self.target_MPa is None or self.law is not None:
            found["law"] = None if self.law is None else _law_document(self.law)
        return found


def _stiffness(of: Mixture | MixtureSecant) -> dict[str, Any]:
    return {"modulus_MPa": of.modulus_MPa, "modulus_interval_MPa": known_interval(of.interval_MPa)}


def _law_document(found: MixtureLaw) -> dict[str, Any]:
    parameters = {symbol: list(values) for symbol, values in found.law.parameters.items()}
    return {"model": found.law.model, **parameters, "relative_error": found.error}


def invert(
    modulus_MPa: float | str | None = None,
    *,
    coordinate: float | None = None,
    at_strain: float = 0.1,
    law: str | None = None,
    printer: str | Printer = "connex3",
    palette: str | Path | Palette | None = None,
) -> Mixture:
    """Find the digital material, and the blend of two, that has a wanted stiffness.

    Parameters
    ----------
    modulus_MPa
        Wanted secant modulus; or text with a unit, ``"500kPa"``.
    coordinate
        In its place, the coordinate m whose stiffness and law are wanted.
    at_strain
        Working strain: stiffness is the secant modulus of the nominal stress up to it; at 0 the
        tangent at rest.
    law
        Law that stands for the mixture: one that `fit` knows, ``yielding``, or ``ogden-thesis``,
        eq. 3.8 with its coefficients as quadratics of m (Algorithm 1 on the curves that the
        palette's materials state as published). Without it a coordinate gets one of its
        neighbours' kind.
    printer, palette
        By name, file or value; the printer's default palette if not given.

    Returns
    -------
    Mixture
        `Mixture.reachable` is false where the palette ends before that modulus; the mixture is then
        the nearest that can be printed.

    Raises
    ------
    ArgumentError
        Neither or both are given, the modulus is not a positive number, or coordinate or strain
        are out of range.
    UnknownNameError, PaletteError
        No such printer or palette, or a palette file that breaks the schema.

    Examples
    --------
    >>> planner.invert(1.2, at_strain=0.2).blend_text()  # doctest: +SKIP
    '69.8 % FLX9750 + 30.2 % FLX9760'
    """
    if (modulus_MPa is None) is (coordinate is None):
        raise ArgumentError("give `modulus_MPa`, a wanted modulus, or `coordinate`, a place; one")
    if isinstance(modulus_MPa, str):
        text, modulus_MPa = modulus_MPa, stated_modulus_MPa(modulus_MPa, bare="MPa")
        if modulus_MPa is None:
            raise ArgumentError(f"`modulus_MPa` {text}: write MPa, or its unit, as in 500kPa")
    if modulus_MPa is not None:
        modulus_MPa = positive(modulus_MPa, "`modulus_MPa`")
    palette = palette_of(palette, printer)
    scale = stiffness_scale(palette, at_strain)
    model, low, high = scale.model, scale.moduli_MPa[0], scale.moduli_MPa[-1]
    if modulus_MPa is not None:
        blend = model.blend_for(min(max(modulus_MPa, low), high), at_strain)
    elif coordinate is not None:
        blend = model.blend_at(as_number(coordinate, "`coordinate`"))
    modulus, interval = _modulus(model, blend.coordinate, at_strain)
    place = int(nearest_on(model.ladder_MPa(at_strain), modulus))
    return Mixture(
        target_MPa=modulus_MPa,
        at_strain=at_strain,
        reachable=modulus_MPa is None
        or low * (1 - AS_SHOWN) <= modulus_MPa <= high * (1 + AS_SHOWN),
        nearest=palette.materials[place].id,
        nearest_modulus_MPa=scale.moduli_MPa[place],
        blend=blend,
        modulus_MPa=modulus,
        interval_MPa=interval,
        range_MPa=(low, high),
        notes=scale.remarks({palette.materials[place].id, blend.lower, blend.upper}),
        secants=() if coordinate is None else _secants(model, blend),
        law=None if coordinate is None and law is None else _law(model, blend, law),
    )


def _modulus(
    model: CoefficientModel, coordinate: float, at_strain: float
) -> tuple[float, tuple[float, float]]:
    low, high = model.modulus_interval_MPa(coordinate, at_strain)
    return float(model.modulus_MPa(coordinate, at_strain)), (float(low), float(high))


def _secants(model: CoefficientModel, blend: Blend) -> tuple[MixtureSecant, ...]:
    first_break = min(material.elongation_at_break for material in _ends(model, blend))
    strains = (strain for strain in (0.0, *SECANT_STRAINS) if strain <= first_break)
    return tuple(MixtureSecant(e, *_modulus(model, blend.coordinate, e)) for e in strains)


def _ends(model: CoefficientModel, blend: Blend) -> list[Material]:
    ids = {blend.lower, blend.upper}
    return [material for material in model.palette.materials if material.id in ids]


_POINTS = 60
"""Strains that a mixture's law is fitted at, even up to the first break."""

_RIDGE = 3e-3
"""Where the curve is nearly straight, flow stress, hardening and sharpness stand in for one
another; numerical: an error of 0.70 % for 0.67, and the same digits on all processors."""


def _law(model: CoefficientModel, blend: Blend, wanted: str | None) -> MixtureLaw:
    """Return the law of a material, or one that is fitted to the mixture.

    If none is named, one of its neighbours' kind: where one of them yields, a law that does; else
    Ogden's, of as many terms as theirs have.
    """
    ends = _ends(model, blend)
    if len(ends) == 1 and wanted in (None, ends[0].law.model):
        return MixtureLaw(ends[0].law, 0.0)
    strain = np.linspace(0.0, min(m.elongation_at_break for m in ends), _POINTS + 1)[1:]
    stress = model.nominal_stress_MPa(blend.coordinate, 1.0 + strain)
    if wanted == "ogden-thesis":
        return _thesis_law(model, blend, strain, stress)
    sample = sample_of([Curve("mixture", strain, stress)], points=None)
    if wanted is None and any(material.law.model in ("linear", "yielding") for material in ends):
        wanted = "yielding"
    if wanted == "yielding":
        at_rest, _ = _modulus(model, blend.coordinate, 0.0)
        fitted, _ = least_yielding(at_rest, sample, ridge=_RIDGE)
        parameters = yielding_parameters(fitted)
    else:
        if wanted is None:
            # One that is no Ogden law counts for two terms: neo-Hooke's bends less, Yeoh's more.
            terms = max(len(material.law.parameters.get("alpha", (0.0, 0.0))) for material in ends)
            wanted = f"ogden-{terms}"
        fits = [fit_law(form, sample) for form in candidate_laws(wanted)]
        parameters = min(fits, key=lambda fit: fit.cost).parameters
    return MixtureLaw(parameters, _off(make_law(parameters).nominal_stress_MPa(1 + strain), stress))


def _thesis_law(
    model: CoefficientModel, blend: Blend, strain: FloatArray, stress: FloatArray
) -> MixtureLaw:
    """Return eq. 3.8 at a coordinate, by Algorithm 1 on the published curves."""
    known = [m for m in model.palette.materials if m.published is not None]
    if len(known) < 3 or not known[0].coordinate <= blend.coordinate <= known[-1].coordinate:
        raise ArgumentError(
            f"law 'ogden-thesis' at m {blend.coordinate:g}: it lies between materials of palette "
            f"{model.palette.name} that state eq. 3.8 under 'published', three at least; they are "
            + (", ".join(f"{m.id} ({m.coordinate:g})" for m in known) or "none")
        )
    laws = [m.published.parameters for m in known if m.published is not None]
    at = [m.coordinate for m in known]
    spans = [np.linspace(law["strain_min"][0], law["strain_max"][0], _POINTS) for law in laws]
    curves = [
        LiteralCurve(m, span, literal_stress_MPa(law["c"], span))
        for m, span, law in zip(at, spans, laws, strict=True)
    ]
    start = quadratics_through(at, [law["c"] for law in laws])
    c = algorithm_one(curves, start).model.coefficients(blend.coordinate)
    low, high = (
        float(np.interp(blend.coordinate, at, [law[end][0] for law in laws]))
        for end in ("strain_min", "strain_max")
    )
    within = (strain >= low) & (strain <= high)
    off = _off(literal_stress_MPa(c, strain[within]), stress[within])
    ends = {"strain_min": (low,), "strain_max": (high,)}
    return MixtureLaw(LawParameters("ogden-thesis", {"c": tuple(c.tolist()), **ends}), off)


def _off(found: FloatArray, stress: FloatArray) -> float:
    return float(np.sqrt(np.mean((found / stress - 1.0) ** 2)))
