"""A palette for the conditions of use, from what a diagnosis has found."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, cast

import numpy as np

from planner.errors import ArgumentError, FileError, PaletteError, PlannerError, UnknownNameError
from planner.gap.campaign import Campaign
from planner.gap.diagnosis import Diagnosis, FoundEffect, name_of, read_diagnosis
from planner.gap.effect import Effect, StatedEffect, stated, with_effects
from planner.gap.effects import effect_named, effects_for
from planner.gap.virtual import single_test, virtual_specimen
from planner.materials.characterise import Curve
from planner.materials.fit import fit_law, law_stress_MPa, sample_of, unstable_strain
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
from planner.printers import Printer, palette_of
from planner.simulation.bar_solver import LawTables, law_tables, predict

__all__ = ["Correction", "correct"]


# ------------------------------------------------------------------------------------------------
# A material's law with its stress multiplied along the strain, in the same model.


_STARTS = 24
_EVEN = 1e-4
"""Spread of ln factor along the strain below which the law keeps its course."""


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
    law = material.law
    if law.model == "linear" or float(np.ptp(log_factor)) < _EVEN:
        even = log_factor.mean()
        parameters = {
            name: tuple(v * float(np.exp(even)) for v in values) if _is_stress(name) else values
            for name, values in law.parameters.items()
        }
        misfit = float(np.sqrt(np.mean((np.exp(even - log_factor) - 1.0) ** 2)))
        return Refit(LawParameters(law.model, MappingProxyType(parameters)), misfit)
    stress = make_law(law).nominal_stress_MPa(1.0 + strain) * np.exp(log_factor)
    model = _model(law)
    sample = sample_of([Curve(material.id, strain, stress)], points=None)
    own = [np.sort(v) for name, v in sorted(law.parameters.items()) if not _is_stress(name)]
    start = np.concatenate(own)[None] if own else None
    fit = fit_law(model, sample, starts=_STARTS, also=start)
    if unstable_strain(fit, material.elongation_at_break, margin=0.0) is not None:
        raise PaletteError(
            f"material {material.id}: its {law.model} law cannot follow the correction: "
            "the stress would fall before the break; measure it at these conditions and fit a "
            "law with planner fit"
        )
    found = law_stress_MPa(model, fit.a, fit.c, 1.0 + strain)
    misfit = float(np.sqrt(np.mean((found / stress - 1.0) ** 2)))
    # Palettes are held to slight compression and beyond the break, too; a pull needs neither.
    alone = unstable_strain(fit, material.elongation_at_break) is not None
    return Refit(fit.parameters, misfit, alone)


def _is_stress(parameter: str) -> bool:
    """Return whether a factor on the stress multiplies a law's parameter; else it is a shape's."""
    return parameter.endswith("_MPa")


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


# ------------------------------------------------------------------------------------------------
# A palette for the conditions of use, from a diagnosis: how the loop from print to plan closes.


_CONDITIONS: Mapping[str, tuple[str, float, float]] = MappingProxyType(
    {
        "strain_rate_per_s": ("a strain rate of {:g} per s", 1e-9, 1e6),
        "temperature_C": ("{:g} degC", -100.0, 200.0),
        "soak_h": ("{:g} h of soaking", 0.0, 1e6),
        "age_days": ("an age of {:g} days", 0.0, 1e5),
    }
)
"""The conditions of use in words, and what they may be."""

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
    before
        The palette that was corrected.
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
    doubt
        Why it may not be the one that was diagnosed; "" where it surely is.
    """

    palette: Palette
    before: Palette
    corrected: tuple[str, ...]
    notes: tuple[str, ...]
    misfit: Mapping[str, float] = field(default_factory=dict)
    factor: Mapping[str, float] = field(default_factory=dict)
    left: tuple[str, ...] = ()
    doubt: str = ""

    @property
    def ok(self) -> bool:
        """Whether the palette was corrected for all that the verdict names."""
        return bool(self.corrected) and not self.left

    def document(self) -> dict[str, Any]:
        """Return what was corrected, for which conditions and how well, as JSON holds it."""
        at = self.palette.reference
        return {
            "corrected": list(self.corrected),
            "left": list(self.left),
            "conditions": asdict(at) if self.corrected else None,
            "materials": {
                m: {"stress_factor": float(f"{f:.6g}"), "misfit": float(f"{self.misfit[m]:.3g}")}
                for m, f in self.factor.items()
            },
            "notes": list(self.notes),
        }


def correct(
    diagnosis: Diagnosis | str | Path,
    *,
    palette: str | Path | Palette | None = None,
    temperature_C: float | None = None,
    rate_per_s: float | None = None,
    soak_h: float | None = None,
    age_days: float | None = None,
    orientation: str | None = None,
    width_mm: float = 6.0,
    thickness_mm: float = 3.0,
    recalibrate: bool = False,
    printer: str | Printer = "connex3",
) -> Correction:
    """Correct a palette for the conditions of use, by a diagnosis' verdict.

    An effect of a condition is taken relative to the palette's own conditions, at which its laws
    were measured. A law that relaxes becomes what an even pull at the stated rate shows.

    Parameters
    ----------
    diagnosis
        A diagnosis, or the file or folder that holds it.
    palette
        By name, file or value; by default the one that was diagnosed, if the printer brings it.
    temperature_C, rate_per_s, soak_h, age_days, orientation
        Conditions of use: strain rate, hours in water, days since the print, and the load's
        direction on the tray, x, y or z. Those that are None are the palette's own.
    width_mm, thickness_mm
        Of the part's section: water takes the longer, the thicker it is.
    recalibrate
        Multiply every law by the level that the campaign asks for beside the effects, too.
    printer
        Whose palettes names mean.

    Returns
    -------
    Correction
        With the corrected palette; `write_palette` writes it.

    Raises
    ------
    ArgumentError
        A condition or size outside what it may be.
    UnknownNameError
        No such printer or palette; or none is given, and the printer has not the diagnosed one;
        or the diagnosis names an effect that there is not.
    FileError
        No diagnosis, or one that names a form or parameters that this palette has not.
    PaletteError
        The corrected laws would cross, or a law cannot follow.

    Examples
    --------
    >>> warm = planner.correct("diagnosis", temperature_C=33)  # doctest: +SKIP
    >>> planner.write_palette(warm.palette, "warm.toml")  # doctest: +SKIP
    """
    if orientation not in (None, "x", "y", "z"):
        raise ArgumentError(f"`orientation` {orientation}: it must be x, y or z")
    along = cast("Literal['x', 'y', 'z'] | None", orientation)
    diagnosis = diagnosis if isinstance(diagnosis, Diagnosis) else read_diagnosis(diagnosis)
    before, doubt = _diagnosed_palette(diagnosis, palette, printer)
    asked = Reference(rate_per_s, temperature_C, soak_h, age_days, along)
    use = _conditions(asked, before.reference)
    for name, value in (("width_mm", width_mm), ("thickness_mm", thickness_mm)):
        if not 0.0 < value < math.inf:
            raise ArgumentError(f"`{name}` {value:g}: it must be above 0")
    made = _corrected(before, diagnosis, use, (width_mm, thickness_mm), recalibrate)
    return replace(made, doubt=doubt)


def _diagnosed_palette(
    found: Diagnosis, palette: str | Path | Palette | None, printer: str | Printer
) -> tuple[Palette, str]:
    """Return the palette, and a doubt whether it is the one that was diagnosed."""
    if palette is None:
        try:
            chosen = palette_of(found.palette, printer)
        except PlannerError:
            has = "does not bring"
        else:
            if found.palette_sha256 in ("", chosen.sha256):
                return chosen, ""
            has = "brings with other bytes"
        machine = printer if isinstance(printer, str) else printer.name
        raise UnknownNameError(
            f"the diagnosis is of a palette {found.palette} that printer {machine} {has}; give "
            "its file, the campaign's palette.toml, with `palette`"
        )
    chosen = palette_of(palette, printer)
    if found.palette_sha256 in ("", chosen.sha256):
        return chosen, ""
    return chosen, (
        f"palette {chosen.name} is not, byte for byte, the one that was diagnosed; if it has "
        "other laws, the correction is wrong: give the campaign's own with --palette"
    )


def _corrected(
    palette: Palette,
    diagnosis: Diagnosis,
    use: Reference,
    section: tuple[float, float],
    recalibrate: bool,
) -> Correction:
    library = effects_for(palette)
    known: list[FoundEffect] = []
    left, notes = [], []
    for found in diagnosis.effect:
        effect = effect_named(found.id, library, "diagnosis: effect")
        if effect.advice is None:
            known.append(found)
        else:
            left.append(found.id)
            notes.append(effect.advice(found, *section))
    notes += _doubts(diagnosis)
    applied = [_stated(e, library[e.id], palette.name) for e in known]
    factors = _Factors(palette, use, section)
    logs = {m.id: factors.log_factor(m, applied) for m in palette.materials}
    notes += [
        f"{one.effect.id}: nothing changes at {_in_words(use, own)}, the palette's own; "
        "state the condition of use to have it corrected"
        for one in applied
        if (own := one.effect.condition) and getattr(factors.own, own) == getattr(use, own)
    ]
    corrected = [one.effect.id for one in applied if factors.matters([one])]
    asked = diagnosis.recalibration if recalibrate else {}
    if recalibrate and any(material in asked for material in logs):
        corrected.append("recalibration")
    if not corrected:
        return Correction(palette, palette, (), tuple(notes), left=tuple(left))
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
        source=_source(palette, diagnosis, applied, corrected, use, section[1]),
    )
    return Correction(
        _checked(made), palette, tuple(corrected), tuple(notes), misfit, factor, tuple(left)
    )


def _conditions(asked: Reference, own: Reference) -> Reference:
    """Return the conditions of use, each stated, the palette's own or the usual one."""
    use = stated(asked, own)
    for name, (_, low, high) in _CONDITIONS.items():
        value = getattr(use, name)
        if not low <= value <= high:
            argument = {"strain_rate_per_s": "rate_per_s"}.get(name, name)
            raise ArgumentError(f"`{argument}` {value:g}: it must be from {low:g} to {high:g}")
    numbers: dict[str, Any] = {name: float(getattr(use, name)) for name in _CONDITIONS}
    return replace(use, **numbers)


def _in_words(at: Reference, name: str) -> str:
    if name == "orientation":
        return f"orientation {at.orientation}"
    return _CONDITIONS[name][0].format(getattr(at, name))


def _stated(found: FoundEffect, effect: Effect, palette: str) -> StatedEffect:
    form = effect.form(found.form)
    if form is None:
        raise FileError(
            f"diagnosis: effect {found.id} has the form {found.form!r}, which palette {palette} "
            f"has not; it has {', '.join(f.name for f in effect.forms)}: give the palette that "
            "was diagnosed with `palette`"
        )
    missing = [p.name for p in form.parameters if p.name not in found.parameters]
    if missing:
        raise FileError(
            f"diagnosis: effect {found.id}: parameter {missing[0]!r} of form {form.name} is missing"
        )
    values = {p.name: found.parameters[p.name] for p in form.parameters}
    return StatedEffect(effect, form, values)


class _Factors:
    """What effects multiply the stress of a palette's materials by, pulled at conditions of use."""

    def __init__(self, palette: Palette, use: Reference, section_mm: tuple[float, float]) -> None:
        self.palette, self.use, self.section_mm = palette, use, section_mm
        self.own = _conditions(Reference(), palette.reference)
        self.laws: LawTables = law_tables(palette)

    def log_factor(
        self, material: Material, effects: Sequence[StatedEffect]
    ) -> tuple[FloatArray, FloatArray]:
        """Return strains above 0 up to near the break, and ln factor there."""
        ours = [e for e in effects if e.effect.condition]
        end = _BREAK_SHARE * material.elongation_at_break
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

    def matters(self, effects: Sequence[StatedEffect]) -> bool:
        """Return whether effects change any law at the conditions of use."""
        logs = [self.log_factor(m, effects)[1] for m in self.palette.materials]
        return max(float(np.abs(log).max()) for log in logs) > _NOTABLE

    def spread(
        self, material: Material, found: Sequence[FoundEffect], effects: Sequence[StatedEffect]
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
        self, material: Material, at: Reference, effects: Sequence[StatedEffect], strain: FloatArray
    ) -> FloatArray:
        conditions = asdict(at)
        rate_per_s = conditions.pop("strain_rate_per_s")
        specimen = virtual_specimen(
            self.palette,
            id=material.id,
            gauge_mm=_GAUGE_mm,
            strain=float(strain[-1]),
            material=material.id,
            width_mm=self.section_mm[0],
            thickness_mm=self.section_mm[1],
            rate_mm_s=rate_per_s * _GAUGE_mm,
            **conditions,
        )
        campaign = Campaign("use", "", self.palette, (specimen,))
        setup = single_test(campaign, 0, strain / rate_per_s, strain * _GAUGE_mm)
        assert setup is not None
        force: FloatArray = predict(with_effects(setup, effects), self.laws).force_N[0]
        return force


def _doubts(diagnosis: Diagnosis) -> list[str]:
    notes = []
    if diagnosis.verdict == "unknown":
        notes.append(
            "the verdict is unknown: no effect of the library explains the gap, so there is "
            "nothing to correct by; see where the gap lies, and test what the diagnosis proposes"
        )
    if diagnosis.verdict == "none":
        notes.append("the verdict is none: the palette is right as far as the campaign can tell")
    others = [name for name in map(name_of, diagnosis.same_class) if name != diagnosis.verdict]
    if others and diagnosis.effect:
        notes.append(
            f"the data cannot tell {diagnosis.verdict} from {', '.join(others)}; the correction "
            f"is that of {diagnosis.verdict}"
        )
    return notes


def _about(
    palette: Palette, diagnosis: Diagnosis, misfit: Mapping[str, float], corrected: Sequence[str]
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


def _source(
    palette: Palette,
    diagnosis: Diagnosis,
    known: Sequence[StatedEffect],
    corrected: Sequence[str],
    use: Reference,
    thickness_mm: float,
) -> str:
    ours = [one for one in known if one.effect.id in corrected]
    names = {one.effect.id: f"{one.effect.id} ({one.form.name})" for one in ours}
    what = " and ".join(names.get(id, id) for id in corrected)
    at = ", ".join(_in_words(use, name) for name in (*_CONDITIONS, "orientation"))
    thick = any("thickness_mm" in one.effect.where for one in ours)
    return (
        f"palette {palette.name} (sha256 {palette.sha256[:12]}) corrected for {what} by planner "
        f"gap correct, from the diagnosis of campaign {diagnosis.campaign}, for {at}"
        f"{f', parts {thickness_mm:g} mm thick' if thick else ''}; before: {palette.source}"
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
