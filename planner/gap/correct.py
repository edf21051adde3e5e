"""A palette for the conditions of use, from what a diagnosis has found."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from planner.errors import ArgumentError, FileError, PaletteError
from planner.gap.campaign import Campaign
from planner.gap.diagnosis import Diagnosis, FoundEffect
from planner.gap.effect import STANDARD, Effect, Form, Values
from planner.gap.effects import effects_for
from planner.gap.virtual import single_test, virtual_specimen
from planner.materials.characterise import Curve
from planner.materials.fit import fit_law, law_stress_MPa, sample_of, stability
from planner.materials.laws import FITTED_MODELS, SeparableLaw, make_law
from planner.materials.mixtures import CoefficientModel
from planner.numerics import FloatArray
from planner.palette import (
    LawParameters,
    Material,
    Palette,
    Reference,
    encode_palette,
    parse_palette,
)
from planner.simulation.bar_solver import STRAIN_END, LawTables, Setup, law_tables, predict

__all__ = ["CONDITION_EFFECTS", "Correction", "corrected_palette"]


# ------------------------------------------------------------------------------------------------
# What a verdict means where no palette can hold it: what to do instead, with figures.


_TEST_EFFECTS = (
    "force-offset", "force-scale", "grip-slack", "grip-slip", "machine-compliance", "strain-scale",
)  # fmt: skip
"""Effects of the test itself: what was printed is as predicted, what was read is not."""

_TEST: Mapping[str, str] = MappingProxyType(
    {
        "force-offset": "zero the load cell before every test, or take the offset off the curves",
        "force-scale": "check the load cell's calibration and the unit of force, and divide the "
        "curves by the factor",
        "grip-slack": "take the toe off the curves, or start at a small preload",
        "grip-slip": "grip harder, or read the strain from the specimen, not from the grips",
        "machine-compliance": "take compliance times force off the travel, or read the strain "
        "from the specimen",
        "strain-scale": "measure the gauge length that strains, and divide the travel by it",
    }
)


def _instead(found: FoundEffect, width_mm: float, thickness_mm: float) -> str:
    """Return a sentence on an effect that a palette cannot hold.

    Parameters
    ----------
    width_mm, thickness_mm
        Of the section that figures are given for.
    """
    if found.id in _TEST_EFFECTS:
        return (
            f"{found.id}: the print was right, the measurement was off ({_figures(found)}); the "
            f"palette stays as it is: {_TEST[found.id]}, and diagnose again"
        )
    return _OTHERS[found.id](found, width_mm, thickness_mm)


def _figures(found: FoundEffect) -> str:
    return ", ".join(
        f"{name} {value:.3g}{'' if (u := found.units.get(name, '1')) == '1' else ' ' + u}"
        for name, value in found.parameters.items()
    )


def _section(found: FoundEffect, width_mm: float, thickness_mm: float) -> str:
    head = f"{found.id}: the section is other than drawn, which no palette can hold; "
    if found.form == "rounded":
        lost = (4.0 - math.pi) * found.parameters["radius"] ** 2
        return (
            f"{head}corners of {found.parameters['radius']:.2f} mm take {lost:.2f} mm2 off every "
            f"section: draw a section of {width_mm:g} x {thickness_mm:g} mm "
            f"{lost / width_mm:.2f} mm thicker"
        )
    over = found.parameters["oversize"]
    which = {
        "thickness": "the thickness (across the layers)",
        "width": "the width",
    }.get(found.form, "width and thickness each")
    return f"{head}draw {which} {abs(over):.2f} mm {'smaller' if over > 0.0 else 'larger'}"


def _skin(found: FoundEffect, width_mm: float, thickness_mm: float) -> str:
    depth = found.parameters["depth"]
    excess = math.expm1(found.parameters["log_stiffness"])

    def stress_factor(scale: float) -> float:
        inside = 1.0
        if found.form != "faces":
            inside *= max(1.0 - 2.0 * depth / (width_mm * scale), 0.0)
        if found.form != "edges":
            inside *= max(1.0 - 2.0 * depth / (thickness_mm * scale), 0.0)
        return 1.0 + excess * (1.0 - inside)

    return (
        f"skin: a layer of {depth:.2f} mm bears {1.0 + excess:.2f} times the inside's stress, so "
        "the stiffness goes with the size of the section, which no palette can hold: about "
        f"{stress_factor(1.0):.2f} times the law's at {width_mm:g} x {thickness_mm:g} mm, "
        f"{stress_factor(3.0):.2f} times at three times that; divide the target by the factor of "
        "your section, or take the skin off"
    )


def _bleed(found: FoundEffect, width_mm: float, thickness_mm: float) -> str:
    length = next(iter(found.parameters.values()))
    reach = {"gaussian": 2.0, "exponential": 2.0}.get(found.form, 1.0) * length
    return (
        f"interface-bleed: mixtures run into each other over about {reach:.2f} mm to either side "
        "of a boundary, which is a property of the design, not of a palette: keep bands wider "
        f"than {2.0 * reach:.2f} mm, and draw steps as ramps where it matters"
    )


def _unloading(found: FoundEffect, width_mm: float, thickness_mm: float) -> str:
    return (
        f"{found.id} ({_figures(found)}): it changes what follows the first loading alone; the "
        "law, which is the first loading's, stays as it is; a part that is used over and over is "
        "softer than planned below its largest strain so far"
    )


_OTHERS: Mapping[str, Callable[[FoundEffect, float, float], str]] = MappingProxyType(
    {
        "cross-section": _section,
        "skin": _skin,
        "interface-bleed": _bleed,
        "softening": _unloading,
        "permanent-set": _unloading,
    }
)


# ------------------------------------------------------------------------------------------------
# A material's law with its stress multiplied along the strain, in the same model.


_STARTS = 24
_EVEN = 1e-4
"""Spread of ln factor along the strain below which the law keeps its course."""

_STRESSES: Mapping[str, str] = MappingProxyType(
    {
        "linear": "modulus_MPa",
        "neo-hookean": "mu_MPa",
        "yeoh": "c_MPa",
        "ogden": "mu_MPa",
    }
)
"""The parameters that a factor on the stress multiplies, where the model has such a list."""


@dataclass(frozen=True, slots=True, eq=False)
class Refit:
    """A law, and how well it follows what it was to follow.

    Attributes
    ----------
    misfit
        RMS relative error of stress.
    tension_alone
        Whether it is unfit for even slight compression, where its stress would turn.
    """

    law: LawParameters
    misfit: float
    tension_alone: bool = False


def _refitted(material: Material, strain: FloatArray, log_factor: FloatArray) -> Refit:
    """Return a material's law with its stress multiplied by exp(log_factor).

    An even factor multiplies the law's moduli and leaves no misfit. Else the same model, with as
    many terms, is fitted to the changed curve.

    Parameters
    ----------
    strain : (n,)
        Rising, above 0.

    Raises
    ------
    PaletteError
        The model cannot follow: its stress would fall before the break.
    """
    even = float(np.ptp(log_factor)) < _EVEN
    if even or material.law.model == "linear":
        law = _multiplied(material.law, float(np.exp(log_factor.mean())))
        if law is not None:
            return Refit(
                law, float(np.sqrt(np.mean((np.exp(log_factor.mean() - log_factor) - 1.0) ** 2)))
            )
    stress = make_law(material.law).nominal_stress_MPa(1.0 + strain) * np.exp(log_factor)
    model = _model(material.law)
    sample = sample_of([Curve(material.id, strain, stress)], points=None)
    fit = fit_law(model, sample, starts=_STARTS, also=_exponents(material.law))
    if not stability(fit, material.elongation_at_break, margin=0.0).stable:
        raise PaletteError(
            f"material {material.id}: its {material.law.model} law cannot follow the correction: "
            "the stress would fall before the break; measure it at these conditions and fit a "
            "law with planner fit"
        )
    found = law_stress_MPa(model, fit.a, fit.c, 1.0 + strain)
    misfit = float(np.sqrt(np.mean((found / stress - 1.0) ** 2)))
    # Palettes are held to slight compression and beyond the break, too; a pull needs neither.
    alone = not stability(fit, material.elongation_at_break).stable
    return Refit(fit.parameters, misfit, alone)


def _multiplied(law: LawParameters, factor: float) -> LawParameters | None:
    parameters = dict(law.parameters)
    for name in ("c2_MPa", "c4_MPa") if law.model == "martins" else (_STRESSES.get(law.model),):
        if name is None:
            return None
        parameters[name] = tuple(value * factor for value in parameters[name])
    return LawParameters(law.model, MappingProxyType(parameters))


def _model(law: LawParameters) -> SeparableLaw:
    if law.model not in FITTED_MODELS:
        raise PaletteError(
            f"law {law.model!r} cannot be corrected; it must be one of {', '.join(FITTED_MODELS)}"
        )
    models = FITTED_MODELS[law.model]
    if law.model != "ogden":
        return models[0]
    terms = len(law.parameters["alpha"])
    if terms > len(models):
        raise PaletteError(
            f"an Ogden law of {terms} terms cannot be fitted again; the most is {len(models)}"
        )
    return models[terms - 1]


def _exponents(law: LawParameters) -> FloatArray | None:
    """Return the law's own nonlinear parameters as a start, (1, q)."""
    if law.model == "ogden":
        return np.sort(np.array([law.parameters["alpha"]]), axis=1)
    if law.model == "martins":
        return np.array([[law.parameters["c1"][0], law.parameters["c3"][0]]])
    return None


# ------------------------------------------------------------------------------------------------
# A palette for the conditions of use, from a diagnosis: how the loop from print to plan closes.


CONDITION_EFFECTS: Mapping[str, str] = {
    "rate": "strain_rate_per_s",
    "temperature": "temperature_C",
    "moisture": "soak_h",
    "ageing": "age_days",
    "orientation": "orientation",
}
"""Effects of a condition, with the name of the condition: none at the palette's own."""

_PRINT_EFFECTS = ("composition-offset", "material-law")
"""Effects on what is printed, whatever the conditions."""

_GAUGE_mm = 25.0
_BREAK_SHARE = 0.95
_STEPS = 120
_NOTABLE_MISFIT = 0.01
_NOTABLE = 1e-6
_INTERVAL_SD = 2.0 * 1.645
"""Width of a 90 % interval in standard deviations."""


@dataclass(frozen=True, slots=True)
class Correction:
    """A corrected palette.

    Attributes
    ----------
    palette
        The palette as it was where nothing could be corrected.
    corrected
        The effects that went into it, and "recalibration".
    notes
        What was done, what a palette cannot hold and what to do about that, a sentence each.
    misfit
        By material: RMS relative error of its new law against the corrected curve.
    factor
        By material: what its stress is multiplied by, at a strain of 0.1 or half its break.
    left
        The effects of the verdict that no palette can hold.
    """

    palette: Palette
    corrected: tuple[str, ...]
    notes: tuple[str, ...]
    misfit: Mapping[str, float] = field(default_factory=dict)
    factor: Mapping[str, float] = field(default_factory=dict)
    left: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class _Applied:
    effect: Effect
    form: Form
    values: Values


def corrected_palette(
    palette: Palette,
    diagnosis: Diagnosis,
    conditions: Reference | None = None,
    *,
    recalibrate: bool = False,
    width_mm: float = 6.0,
    thickness_mm: float = 3.0,
) -> Correction:
    """Return a palette whose laws hold for the conditions of use, by a diagnosis' verdict.

    An effect of a condition is taken relative to the palette's own conditions, at which its laws
    were measured. A law that relaxes becomes what an even pull at the stated rate shows.

    Parameters
    ----------
    conditions
        Of use; those that are None are the palette's own.
    recalibrate
        Multiply every law by the level that the campaign asks for beside the effects, too.
    width_mm, thickness_mm
        Of the part's section: water takes the longer, the thicker it is.

    Raises
    ------
    ArgumentError
        A condition or size outside what it may be.
    FileError
        The diagnosis names an effect or a form that this palette has not.
    PaletteError
        The corrected laws would cross, or a law cannot follow.
    """
    use = _conditions(palette.reference, conditions or Reference())
    for name, value in (("`width_mm`", width_mm), ("`thickness_mm`", thickness_mm)):
        if not 0.0 < value < math.inf:
            raise ArgumentError(f"{name} {value:g}: it must be above 0")
    known = [e for e in diagnosis.effect if e.id in CONDITION_EFFECTS or e.id in _PRINT_EFFECTS]
    others = [e for e in diagnosis.effect if e not in known]
    left = tuple(e.id for e in others)
    notes = [_instead(e, width_mm, thickness_mm) for e in others]
    notes += _doubts(diagnosis)
    applied = [_applied(e, palette) for e in known]
    section = (width_mm, thickness_mm)
    factors = _Factors(palette, use, section)
    logs = {m.id: factors.log_factor(m, applied) for m in palette.materials}
    notes += _idle(known, palette.reference, use)
    corrected = [e.id for e, one in zip(known, applied, strict=True) if factors.matters([one])]
    asked = diagnosis.recalibration if recalibrate else {}
    if recalibrate and any(material in asked for material in logs):
        corrected.append("recalibration")
    if not corrected:
        return Correction(palette, (), tuple(notes), left=left)
    materials, misfit, factor, tension_alone = [], {}, {}, []
    for material in palette.materials:
        level = asked.get(material.id, (0.0, 0.0))[0]
        strain, log = logs[material.id]
        fit = _refitted(material, strain, log + level)
        spread = factors.spread(material, known, applied)
        misfit[material.id] = fit.misfit
        if fit.tension_alone:
            tension_alone.append(material.id)
        at = min(0.1, 0.5 * material.elongation_at_break)
        factor[material.id] = float(np.exp(np.interp(at, strain, log) + level))
        sd = math.hypot(material.modulus_log_sd, spread)
        materials.append(replace(material, law=fit.law, uncertainty=None, modulus_log_sd=sd))
    notes += _about(palette, diagnosis, misfit, corrected)
    if tension_alone:
        notes.append(
            f"{', '.join(tension_alone)}: the new law holds from rest to the break and not beyond "
            "either: do not use it in compression"
        )
    made = replace(
        palette,
        name=palette.name.removesuffix("-corrected") + "-corrected",
        materials=tuple(materials),
        reference=use,
        source=_source(palette, diagnosis, known, corrected, use, thickness_mm),
    )
    return Correction(_checked(made), tuple(corrected), tuple(notes), misfit, factor, left)


def _conditions(reference: Reference, asked: Reference) -> Reference:
    """Return the conditions of use, each stated, the palette's own or the usual one."""
    values = {}
    for name, low, high in (
        ("strain_rate_per_s", 1e-9, 1e6),
        ("temperature_C", -100.0, 200.0),
        ("soak_h", 0.0, 1e6),
        ("age_days", 0.0, 1e5),
    ):
        value = getattr(asked, name)
        if value is None:
            value = getattr(reference, name)
        if value is None:
            value = STANDARD["rate_per_s" if name == "strain_rate_per_s" else name]
        if not low <= value <= high:
            argument = {"strain_rate_per_s": "rate_per_s"}.get(name, name)
            raise ArgumentError(f"`{argument}` {value:g}: it must be from {low:g} to {high:g}")
        values[name] = float(value)
    return Reference(**values, orientation=asked.orientation or reference.orientation or "x")


def _applied(found: FoundEffect, palette: Palette) -> _Applied:
    effect = effects_for(palette)[found.id]
    form = next((f for f in effect.forms if f.name == found.form), None)
    if form is None:
        raise FileError(
            f"diagnosis: effect {found.id} has the form {found.form!r}, which palette "
            f"{palette.name} has not; it has {', '.join(f.name for f in effect.forms)}: give the "
            "palette that was diagnosed with `palette`"
        )
    missing = [p.name for p in form.parameters if p.name not in found.parameters]
    if missing:
        raise FileError(
            f"diagnosis: effect {found.id}: parameter {missing[0]!r} of form {form.name} is missing"
        )
    return _Applied(effect, form, found.parameters)


class _Factors:
    """What effects multiply the stress of a palette's materials by, pulled at conditions of use."""

    def __init__(self, palette: Palette, use: Reference, section_mm: tuple[float, float]) -> None:
        self.palette, self.use, self.section_mm = palette, use, section_mm
        self.own = _conditions(palette.reference, Reference())
        self.laws: LawTables = law_tables(palette)

    def log_factor(
        self, material: Material, effects: Sequence[_Applied]
    ) -> tuple[FloatArray, FloatArray]:
        """Return strains above 0 up to near the break, and ln factor there."""
        ours = [e for e in effects if e.effect.id in CONDITION_EFFECTS]
        end = min(_BREAK_SHARE * material.elongation_at_break, STRAIN_END)
        strain = end * np.linspace(0.0, 1.0, _STEPS + 1)
        after = self._force_N(material, self.use, effects, strain)
        before = self._force_N(material, self.own, ours, strain)
        with np.errstate(all="ignore"):
            log: FloatArray = np.log(after[1:] / before[1:])
        if not np.isfinite(log).all():
            raise PaletteError(
                f"material {material.id}: its stress at these conditions is not above 0; state "
                "conditions nearer to those of the campaign"
            )
        return strain[1:], log

    def matters(self, effects: Sequence[_Applied]) -> bool:
        """Return whether effects change any law at the conditions of use."""
        logs = [self.log_factor(m, effects)[1] for m in self.palette.materials]
        return max(float(np.abs(log).max()) for log in logs) > _NOTABLE

    def spread(
        self, material: Material, found: Sequence[FoundEffect], effects: Sequence[_Applied]
    ) -> float:
        """Return the deviation of the mean ln factor, from the parameters' intervals."""
        total = 0.0
        for number, (one, effect) in enumerate(zip(found, effects, strict=True)):
            for name, ends in one.interval.items():
                if name not in one.parameters or not all(map(math.isfinite, ends)):
                    continue
                means = []
                for end in ends:
                    moved = replace(effect, values={**effect.values, name: end})
                    changed = [*effects[:number], moved, *effects[number + 1 :]]
                    means.append(float(self.log_factor(material, changed)[1].mean()))
                total += ((means[1] - means[0]) / _INTERVAL_SD) ** 2
        return math.sqrt(total)

    def _force_N(
        self,
        material: Material,
        at: Reference,
        effects: Sequence[_Applied],
        strain: FloatArray,
    ) -> FloatArray:
        assert at.strain_rate_per_s is not None
        specimen = virtual_specimen(
            self.palette,
            id=material.id,
            gauge_mm=_GAUGE_mm,
            strain=float(strain[-1]),
            material=material.id,
            width_mm=self.section_mm[0],
            thickness_mm=self.section_mm[1],
            rate_mm_s=at.strain_rate_per_s * _GAUGE_mm,
            temperature_C=at.temperature_C,
            soak_h=at.soak_h,
            age_days=at.age_days,
            orientation=at.orientation,
            protocol="monotonic",
        )
        campaign = Campaign("use", "", self.palette, (specimen,))
        setup = single_test(campaign, 0, strain / at.strain_rate_per_s, strain * _GAUGE_mm)
        assert setup is not None
        force: FloatArray = predict(_with(setup, effects), self.laws).force_N[0]
        return force


def _with(setup: Setup, effects: Sequence[_Applied]) -> Setup:
    for one in sorted(effects, key=lambda e: e.effect.stage):  # composition before law
        setup = one.form.apply(setup, one.values)
    return setup


def _idle(known: Sequence[FoundEffect], own: Reference, use: Reference) -> list[str]:
    """Say of each effect of a condition that the condition of use is the palette's own."""
    before = _conditions(own, Reference())
    return [
        f"{e.id}: nothing changes at {_condition_text(name, use)}, the palette's own; state the "
        "condition of use to have it corrected"
        for e in known
        if (name := CONDITION_EFFECTS.get(e.id)) and getattr(before, name) == getattr(use, name)
    ]


def _doubts(diagnosis: Diagnosis) -> list[str]:
    notes = []
    if diagnosis.verdict == "unknown":
        notes.append(
            "the verdict is unknown: no effect of the library explains the gap, so there is "
            "nothing to correct by; see where the gap lies, and test what the diagnosis proposes"
        )
    if diagnosis.verdict == "none":
        notes.append("the verdict is none: the palette is right as far as the campaign can tell")
    others = ["+".join(e) for e in diagnosis.same_class if "+".join(e) != diagnosis.verdict]
    if others and diagnosis.effect:
        notes.append(
            f"the data cannot tell {diagnosis.verdict} from {', '.join(others)}; the correction "
            f"is that of {diagnosis.verdict}"
        )
    return notes


def _about(
    palette: Palette,
    diagnosis: Diagnosis,
    misfit: Mapping[str, float],
    corrected: Sequence[str],
) -> list[str]:
    notes = []
    bad = {m: value for m, value in misfit.items() if value > _NOTABLE_MISFIT}
    if bad:
        told = ", ".join(f"{m} {100 * value:.1f} %" for m, value in bad.items())
        notes.append(f"laws that follow the correction by more than 1 % off: {told}")
    known = diagnosis.recalibration
    unseen = [m.id for m in palette.materials if known and m.id not in known]
    if unseen and set(corrected) - {"recalibration"}:
        notes.append(
            f"{', '.join(unseen)}: not in the campaign; their correction is the effect's own trend"
        )
    return notes


def _condition_text(name: str, at: Reference) -> str:
    value = getattr(at, name)
    value = value if isinstance(value, str) else f"{value:g}"
    return {
        "strain_rate_per_s": f"a strain rate of {value} per s",
        "temperature_C": f"{value} degC",
        "soak_h": f"{value} h of soaking",
        "age_days": f"an age of {value} days",
        "orientation": f"orientation {value}",
    }[name]


def _source(
    palette: Palette,
    diagnosis: Diagnosis,
    known: Sequence[FoundEffect],
    corrected: Sequence[str],
    use: Reference,
    thickness_mm: float,
) -> str:
    forms = {e.id: f"{e.id} ({e.form})" for e in known}
    what = " and ".join(forms.get(id, id) for id in corrected)
    at = ", ".join(_condition_text(name, use) for name in CONDITION_EFFECTS.values())
    thick = f", parts {thickness_mm:g} mm thick" if "moisture" in corrected else ""
    return (
        f"palette {palette.name} (sha256 {palette.sha256[:12]}) corrected for {what} by planner "
        f"gap correct, from the diagnosis of campaign {diagnosis.campaign}, for {at}{thick}; "
        f"before: {palette.source}"
    )


def _checked(palette: Palette) -> Palette:
    """Return the palette as its file will be read, its ladder checked as for grading."""
    made = parse_palette(encode_palette(palette), name=palette.name)
    try:
        CoefficientModel(made)
    except PaletteError as error:
        raise PaletteError(
            f"the correction makes the palette unfit to plan with: {error}; if it is one "
            "material's, measure that one again, or leave it out of the palette"
        ) from error
    return made
