"""A palette for the conditions of use, from what a diagnosis has found."""

import contextlib
import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, TypeAlias, cast

import numpy as np

from planner.errors import (
    ArgumentError,
    FileError,
    PaletteError,
    UnknownNameError,
    positive,
    refused,
    within,
)
from planner.gap.campaign import TOLERANCES, Campaign, stated
from planner.gap.diagnosis import Diagnosis, FoundEffect, name_of, read_diagnosis
from planner.gap.effect import Effect, Form, StatedEffect, with_effects
from planner.gap.effects import effect_named, effects_for
from planner.gap.noise import FIT_SD, USUAL
from planner.gap.virtual import single_tests, virtual_specimen
from planner.glance import one_line, outcome
from planner.materials.characterise import Curve
from planner.materials.fit import Sample, fit_law, least_yielding, sample_of, yielding_parameters
from planner.materials.laws import SeparableLaw, make_law
from planner.materials.mixtures import CoefficientModel
from planner.numerics import FloatArray, normal_quantile
from planner.palette import Material, Palette, Reference, encode_palette
from planner.printers import Printer, load_printer, palette_of
from planner.simulation.bar_solver import LawTables, Setup, law_tables, predict

__all__ = ["Correction", "correct"]


# ------------------------------------------------------------------------------------------------
# What is corrected, by what and for which use.


@dataclass(frozen=True, slots=True)
class _Case:
    """A diagnosis, its palette, the palette's own conditions, those of use, a part's section.

    Effects of a condition change nothing at the palette's own conditions.
    """

    palette: Palette
    diagnosis: Diagnosis
    own: Reference
    use: Reference
    section_mm: tuple[float, float]

    def grades(self, *conditions: str | None) -> list[int]:
        """Return the places on the palette of the materials that tell of conditions, rising."""
        tested = self.diagnosis.tested.get("material", tuple(self.diagnosis.recalibration))
        of_each = (self.diagnosis.changed.get(name, tested) for name in conditions if name)
        ids = set(tested).intersection(*of_each)
        return [k for k, material in enumerate(self.palette.materials) if material.id in ids]


# ------------------------------------------------------------------------------------------------
# Factors on stress: materials pulled at conditions, with effects and without.


_GAUGE_mm = 25.0
"""Of what is pulled. Convention: any would do, as pace and path are those of strain."""

_BREAK_SHARE = 0.95
"""How far a law is followed, of the elongation at break. Chosen: near the break, with no step
beyond it."""


_Place: TypeAlias = tuple[Material, Reference]
"""A material, and the conditions it is pulled at, all of them known."""


_WORKING_STRAIN = 0.1
"""At which a factor is told, or at half the break of rigid grades. Convention: as the ladder of
stiffness is."""


def _working_strain(material: Material) -> float:
    """Return the strain at which a factor is told."""
    return min(_WORKING_STRAIN, 0.5 * material.elongation_at_break)


class _Factors:
    """What effects multiply the stress of materials by, against the palette's own conditions.

    Parameters
    ----------
    places
        Materials and the conditions they are pulled at.
    strain : (P,)
        How far each is pulled.
    steps
        Of the way there.
    """

    def __init__(
        self, case: _Case, places: Sequence[_Place], strain: Sequence[float], steps: int
    ) -> None:
        self.strain = np.outer(strain, np.linspace(0.0, 1.0, steps + 1))
        self._laws: LawTables = law_tables(case.palette)
        self._used = _pulled(case, places, self.strain)
        self._own = _pulled(case, [(m, case.own) for m, _ in places], self.strain)

    def log(self, effects: Sequence[StatedEffect]) -> FloatArray:
        """Return ln factor at the strains above 0 of every place, (P, steps); NaN where it is none.

        An effect of a condition acts at the palette's own conditions too: its law was measured
        with it.
        """
        ours = [e for e in effects if e.effect.condition]
        after = predict(with_effects(self._used, effects), self._laws).force_N
        before = predict(with_effects(self._own, ours), self._laws).force_N
        with np.errstate(all="ignore"):
            log: FloatArray = np.log(after[:, 1:] / before[:, 1:])
        return np.where(np.isfinite(log), log, np.nan)


def _pulled(case: _Case, places: Sequence[_Place], strain: FloatArray) -> Setup:
    specimens, times, (width_mm, thickness_mm) = [], [], case.section_mm
    for number, ((material, at), strains) in enumerate(zip(places, strain, strict=True)):
        conditions = asdict(at)
        rate_per_s = conditions.pop("strain_rate_per_s")
        times.append(strains / rate_per_s)
        specimen = virtual_specimen(
            case.palette,
            id=f"{number}",
            gauge_mm=_GAUGE_mm,
            strain=float(strains[-1]),
            material=material.id,
            width_mm=width_mm,
            thickness_mm=thickness_mm,
            rate_mm_s=rate_per_s * _GAUGE_mm,
            **conditions,
        )
        specimens.append(specimen)
    campaign = Campaign("use", "", case.palette, tuple(specimens))
    return single_tests(campaign, range(len(places)), np.stack(times), strain * _GAUGE_mm)


# ------------------------------------------------------------------------------------------------
# How sure a factor is: by the intervals of its parameters, and by the forms that fit as well.


_GRID = 7
"""Values of each parameter of shape. Numerical: a seventh of its prior is finer than tests
resolve."""

_ROUNDS = 4
"""In which a size is scaled to the tests, at most. Numerical: ln factor is nearly proportional to
the size, so that each round leaves a small share of the error; 1e-4 ends them."""


_DEVIATIONS = 0.2
"""Of a parameter, by which its change is asked for. Numerical: small enough that what parameters
change adds up."""


def _intervals_sd(
    factors: _Factors, found: Sequence[FoundEffect], effects: Sequence[StatedEffect]
) -> FloatArray:
    """Return the deviation of the mean ln factor of every place, from the parameters' errors.

    Parameters that stand in for one another have large errors, which go together.
    """
    total = np.zeros(len(factors.strain))
    for number, (one, effect) in enumerate(zip(found, effects, strict=True)):
        before, after, names = effects[:number], effects[number + 1 :], list(one.parameters)
        changes = np.zeros((len(names), len(total)))
        for change, name in zip(changes, names, strict=True):
            ends = low, high = one.interval.get(name, (-math.inf, math.inf))
            if math.isfinite(high - low) and name in effect.values:
                value, by = effect.values[name], normal_quantile(0.9)
                step = _DEVIATIONS * 0.5 * (high - low) / by
                if low <= value - step < value + step <= high:  # else at the end of what may be
                    ends, by = (value - step, value + step), _DEVIATIONS
                both = ([*before, _with(effect, name, end), *after] for end in ends)
                down, up = (factors.log(acting).mean(axis=1) for acting in both)
                change += 0.5 * (up - down) / by
        correlation = np.array(one.correlation or np.eye(len(names)))
        total += np.einsum("ip,ij,jp->p", changes, correlation, changes)
    return np.sqrt(np.maximum(total, 0.0))


def _with(effect: StatedEffect, name: str, value: float) -> StatedEffect:
    return replace(effect, values={**effect.values, name: value})


def _parted_sd(factors: _Factors, effect: StatedEffect, tests: int, sd: float) -> FloatArray:
    """Return how far the forms of an effect part that fit the tests as well, (P - tests,).

    What the form found says of the tests stands for the tests. Every form, in every shape on a
    grid over its prior, is given the size that comes nearest to that; a shape weighs
    ``exp(-chi² / 2)`` within its form, a form as its best shape does: that tests do not tell two
    forms apart is no reason to believe the simpler one elsewhere. What is returned is the root
    mean square of how far they are from the form found at the places that follow the tests. It is
    small among the tests, and grows away from them as physics that they cannot tell apart parts.

    Parameters
    ----------
    factors
        Of the places tested, then of those asked for.
    tests
        How many are tested.
    sd
        Of ln stress: what a form may be off by at each test.
    """
    found = factors.log([effect])[:, -1]
    total, weight = np.zeros(len(found) - tests), 0.0
    for form in effect.effect.forms:
        tried = (_fitted(factors, start, found, tests, sd) for start in _starts(form, effect))
        fits = [fit for fit in tried if fit is not None]
        if form.name == effect.form.name:
            fits.append((0.0, found))
        if fits:
            each = np.exp([log_weight for log_weight, _ in fits])
            off = np.stack([log[tests:] - found[tests:] for _, log in fits])
            best = form.weight * float(each.max())
            total += best * (each @ off**2) / max(float(each.sum()), 1e-300)
            weight += best
    return np.sqrt(total / weight)


def _starts(form: Form, effect: StatedEffect) -> Iterator[StatedEffect]:
    """Yield the form in every shape of the grid, at the usual size."""
    size, *shapes = form.parameters
    middles = (np.arange(_GRID) + 0.5) / _GRID
    for values in itertools.product(*([p.at(share) for share in middles] for p in shapes)):
        shape = dict(zip((p.name for p in shapes), values, strict=True))
        yield replace(effect, form=form, values={size.name: size.usual, **shape})


def _fitted(
    factors: _Factors, one: StatedEffect, found: FloatArray, tests: int, sd: float
) -> tuple[float, FloatArray] | None:
    """Return ln of the weight and of the factors of a form at the size nearest to the tests.

    None where it does not show in them, or leaves no stress. ln factor is nearly proportional to
    the size, so that scaling it by the ratio of the two sets of logarithms converges.
    """
    size = one.form.size
    lowest = -size.high if size.signed else 0.0
    for _ in range(_ROUNDS):
        log = factors.log([one])[:, -1]
        there, value = log[:tests], one.values[size.name]
        norm = float(there @ there)
        if not (np.isfinite(log).all() and norm > 0.0):
            return None
        better = min(max(value * float(there @ found[:tests]) / norm, lowest), size.high)
        if abs(better - value) < 1e-4 * abs(value):
            break
        if better == 0.0:
            log = np.zeros_like(log)
            break
        one = _with(one, size.name, better)
    return -0.5 * float(np.sum(((log[:tests] - found[:tests]) / sd) ** 2)), log


# ------------------------------------------------------------------------------------------------
# A material's law with its stress multiplied along the strain, in the same model.


_STARTS = 24
"""Shapes that a law's fit is started from. Numerical: beside the law's own shape, which nearly fits
already."""

_EVEN = 1e-4
"""Spread of ln factor along the strain below which the law keeps its course. Numerical: stress is
off by half of it at most."""


@dataclass(frozen=True, slots=True, eq=False)
class _Refit:
    """A material with another law, and how well this follows what it was to follow.

    Attributes
    ----------
    misfit
        RMS relative error of stress.
    tension_alone
        Whether it is unfit for even slight compression, where its stress would turn.
    """

    material: Material
    misfit: float
    tension_alone: bool = False


def _refitted(material: Material, strain: FloatArray, log_factor: FloatArray) -> _Refit:
    """Return a material with its law's stress multiplied by exp(log_factor).

    An even factor multiplies the law's moduli and leaves no misfit; a straight line has the mean of
    an uneven one. Else the same model, with as many terms, is fitted to the changed curve, or one
    that yields where that is off and this is closer.

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
        misfit = float(np.sqrt(np.mean((np.exp(even - log_factor) - 1.0) ** 2)))
        return _Refit(replace(material, law=law.stiffened(float(np.exp(even)))), misfit)
    model = make_law(law)
    stress = model.nominal_stress_MPa(1.0 + strain) * np.exp(log_factor)
    sample = sample_of([Curve(material.id, strain, stress)], points=None)
    if not isinstance(model, SeparableLaw):  # one that yields
        return _bent(material, sample)
    own = [np.sort(v) for name, v in sorted(law.parameters.items()) if not name.endswith("_MPa")]
    start = np.concatenate(own)[None] if own else None
    fit = fit_law(model, sample, starts=_STARTS, also=start)
    if fit.unstable_strain(material.elongation_at_break, margin=0.0) is not None:
        raise PaletteError(
            f"material {material.id}: its {law.model} law cannot follow the correction: "
            "the stress would fall before the break; measure it at these conditions and fit a "
            "law with planner fit"
        )
    misfit = float(np.sqrt(np.mean((fit.nominal_stress_MPa(1.0 + strain) / stress - 1.0) ** 2)))
    if misfit > FIT_SD and (bent := _bent(material, sample)).misfit < misfit:
        return bent
    # Palettes are held to slight compression and beyond the break, too; a pull needs neither.
    alone = fit.unstable_strain(material.elongation_at_break) is not None
    return _Refit(replace(material, law=fit.parameters), misfit, alone)


def _bent(material: Material, sample: Sample) -> _Refit:
    """Return a material with the law that yields and follows a curve best, in relative stress."""
    steepest = float(sample.stress_MPa[0] / (sample.stretch[0] - 1.0))
    law, _ = least_yielding(steepest, sample)
    off = law.nominal_stress_MPa(sample.stretch) / sample.stress_MPa - 1.0
    bent = replace(material, law=yielding_parameters(law))
    return _Refit(bent, float(np.sqrt(np.mean(off**2))))


# ------------------------------------------------------------------------------------------------
# A palette for the conditions of use, from a diagnosis: how the loop from print to plan closes.


_CONDITIONS: Mapping[str, tuple[str, str, float, float]] = {
    "strain_rate_per_s": ("a strain rate of ", "per s", 1e-9, 1e6),
    "temperature_C": ("", "degC", -100.0, 200.0),
    "soak_h": ("", "h of soaking", 0.0, 1e6),
    "age_days": ("an age of ", "days", 0.0, 1e5),
}
"""The conditions of use, what stands before and after their figure, and what they may be.
Convention: beyond any polymer's use, to catch slips of units."""

_STEPS = 120
"""Of a pull to near the break, which the law is fitted to. Numerical: several points a bend of any
law."""

_STEPS_TO_WORK = 24
"""Of a pull to the working strain. Numerical: a relaxing law is followed to 1e-3."""

_NOTABLE = 1e-6
"""ln factor below which an effect changes nothing. Numerical: rounding stays below."""


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
    log_sd
        By material: deviation of ln factor, of the parameters and of the forms that fit as well.
    left
        The effects of the verdict that no palette can hold.
    findings
        Those of the notes that need something done before a part is printed: what is left, and
        materials whose factor is not known to the step to the neighbouring grade.
    """

    palette: Palette
    before: Palette
    corrected: tuple[str, ...]
    notes: tuple[str, ...]
    misfit: Mapping[str, float] = field(default_factory=dict)
    factor: Mapping[str, float] = field(default_factory=dict)
    log_sd: Mapping[str, float] = field(default_factory=dict)
    left: tuple[str, ...] = ()
    findings: tuple[str, ...] = ()

    @one_line
    def __repr__(self) -> str:
        if not self.corrected:
            return f"{self.palette.name}: nothing corrected"
        found = outcome((len(self.findings), "finding"))
        return f"{self.palette.name}: corrected for {', '.join(self.corrected)}; {found}"

    @property
    def ok(self) -> bool:
        """Whether the palette was corrected for all that the verdict names, and is known enough."""
        return bool(self.corrected) and not self.findings

    def document(self) -> dict[str, Any]:
        """Return what was corrected, for which conditions and how well, as JSON holds it."""
        return {
            "corrected": list(self.corrected),
            "left": list(self.left),
            "conditions": asdict(self.palette.reference) if self.corrected else None,
            "materials": {
                m: {
                    "stress_factor": float(f"{f:.6g}"),
                    "log_sd": float(f"{self.log_sd[m]:.3g}"),
                    "misfit": float(f"{self.misfit[m]:.3g}"),
                }
                for m, f in self.factor.items()
            },
            "notes": list(self.notes),
            "findings": list(self.findings),
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
        By name, file or value; by default the one that was diagnosed, which lies in the folder of
        the diagnosis, or the printer brings.
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
        No such printer or palette; or none is given, and neither the folder nor the printer has the
        diagnosed one; or the diagnosis names an effect that there is not.
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
    diagnosis = diagnosis if isinstance(diagnosis, Diagnosis) else read_diagnosis(diagnosis)
    before, doubt = _diagnosed_palette(diagnosis, palette, printer)
    asked = Reference(rate_per_s, temperature_C, soak_h, age_days, cast("Any", orientation))
    use = _conditions(asked, before.reference)
    section_mm = positive(width_mm, "`width_mm`"), positive(thickness_mm, "`thickness_mm`")
    own = _conditions(Reference(), before.reference)
    return _corrected(_Case(before, diagnosis, own, use, section_mm), recalibrate, doubt)


def _diagnosed_palette(
    found: Diagnosis, palette: str | Path | Palette | None, printer: str | Printer
) -> tuple[Palette, tuple[str, ...]]:
    """Return the palette, and a doubt whether it is the one that was diagnosed."""
    own = found.own_palette
    if palette is not None:
        chosen = palette_of(palette, printer)
        same = own is not None and encode_palette(chosen) == encode_palette(own)
        if same or found.palette_sha256 in ("", chosen.sha256):
            return chosen, ()
        return chosen, (
            f"palette {chosen.name} is not, byte for byte, the one that was diagnosed; if it has "
            "other laws, the correction is wrong: give the campaign's own with --palette",
        )
    if own is not None:
        return own, ()
    has = "does not bring"
    with contextlib.suppress(FileError, UnknownNameError):
        brought = load_printer(printer).palette(found.palette)
        if found.palette_sha256 in ("", brought.sha256):
            return brought, ()
        has = "brings with other bytes"
    machine = printer if isinstance(printer, str) else printer.name
    raise UnknownNameError(
        f"the diagnosis is of a palette {found.palette} that printer {machine} {has}; give "
        "its file, the campaign's palette.toml, with `palette`"
    )


def _corrected(case: _Case, recalibrate: bool, doubt: Sequence[str]) -> Correction:
    palette, diagnosis, own, use = case.palette, case.diagnosis, case.own, case.use
    library = effects_for(palette)
    pairs = [(one, effect_named(one.id, library, "diagnosis: effect")) for one in diagnosis.effect]
    known = [found for found, effect in pairs if effect.advice is None]
    left = tuple(found.id for found, effect in pairs if effect.advice)
    findings = [effect.advice(found, *case.section_mm) for found, effect in pairs if effect.advice]
    notes = [*doubt, *findings, *_doubts(diagnosis)]
    applied = [_stated(e, library[e.id], palette.name) for e in known]
    far = [_BREAK_SHARE * material.elongation_at_break for material in palette.materials]
    factors = _Factors(case, [(material, use) for material in palette.materials], far, _STEPS)
    logs = _whole(factors.log(applied), palette)
    notes += [
        f"{one.effect.id}: nothing changes at {_in_words(use, name)}, the palette's own; "
        "state the condition of use to have it corrected"
        for one in applied
        if (name := one.effect.condition) and getattr(own, name) == getattr(use, name)
    ]
    acting = [e for e in applied if np.abs(_whole(factors.log([e]), palette)).max() > _NOTABLE]
    corrected = [one.effect.id for one in acting]
    asked = diagnosis.recalibration if recalibrate else {}
    if recalibrate and any(material.id in asked for material in palette.materials):
        corrected.append("recalibration")
    if not corrected:
        return Correction(palette, palette, (), tuple(notes), left=left, findings=tuple(findings))
    sure = _intervals_sd(factors, known, applied)
    forms = _forms_sd(case, acting)
    materials, fits, factor, log_sd = [], {}, {}, {}
    for number, material in enumerate(palette.materials):
        level, level_sd = asked.get(material.id, (0.0, 0.0))
        strain, log = factors.strain[number, 1:], logs[number] + level
        sd = math.hypot(sure[number], forms[number], level_sd)
        refits = [_refitted(replace(material, law=law), strain, log) for law in material.laws]
        fits[material.id] = refits[0]
        factor[material.id] = float(np.exp(np.interp(_working_strain(material), strain, log)))
        log_sd[material.id] = sd
        materials.append(material.changed([one.material.law for one in refits], sd))
    misfit = {m: fit.misfit for m, fit in fits.items()}
    if bad := [f"{m} {100 * off:.1f} %" for m, off in misfit.items() if off > FIT_SD]:
        notes.append(f"laws more than 1 % off the corrected curve: {', '.join(bad)}")
    if tension_alone := [m for m, fit in fits.items() if fit.tension_alone]:
        notes.append(
            f"{', '.join(tension_alone)}: the new law holds from rest to break only; do not use "
            "it in compression"
        )
    name = palette.name.removesuffix("-corrected") + "-corrected"
    source = _source(case, acting, corrected)
    made = replace(palette, name=name, materials=tuple(materials), reference=use, source=source)
    made = made.as_written()
    unfit = "the correction makes the palette unfit to plan with"
    then = "{}; if it is one material's, measure that one again, or leave it out of the palette"
    with refused(PaletteError, unfit, then, PaletteError):
        model = CoefficientModel(made)  # as for grading
    notes += _beyond(case, acting, log_sd)
    findings += (guesses := list(_guesses(case, model, forms)))
    notes += guesses
    return Correction(
        made, palette, tuple(corrected), tuple(notes), misfit, factor, log_sd,
        left, tuple(findings),
    )  # fmt: skip


def _whole(log: FloatArray, palette: Palette) -> FloatArray:
    """Return ln factors of a palette's materials, all of them numbers."""
    lost = ~np.isfinite(log).all(axis=1)
    if lost.any():
        raise PaletteError(
            f"material {palette.materials[int(np.argmax(lost))].id}: its stress at these "
            "conditions is not above 0; state conditions nearer to those of the campaign"
        )
    return log


def _conditions(asked: Reference, own: Reference) -> Reference:
    """Return the conditions of use, each stated, the palette's own or the usual one."""
    use, numbers = stated(asked, own), dict[str, Any]()
    for name, (_, _, low, high) in _CONDITIONS.items():
        argument = {"strain_rate_per_s": "rate_per_s"}.get(name, name)
        numbers[name] = within(getattr(use, name), f"`{argument}`", low, high)
    return replace(use, **numbers)


def _in_words(at: Reference, name: str) -> str:
    if name == "orientation":
        return f"orientation {at.orientation}"
    before, unit, _, _ = _CONDITIONS[name]
    return f"{before}{getattr(at, name):g} {unit}"


def _stated(found: FoundEffect, effect: Effect, palette: str) -> StatedEffect:
    if (form := effect.form(found.form)) is None:
        raise FileError(
            f"diagnosis: effect {found.id} has the form {found.form!r}, which palette {palette} "
            f"has not; it has {', '.join(f.name for f in effect.forms)}: give the palette that "
            "was diagnosed with `palette`"
        )
    if missing := [p.name for p in form.parameters if p.name not in found.parameters]:
        raise FileError(
            f"diagnosis: effect {found.id}: parameter {missing[0]!r} of form {form.name} is missing"
        )
    names = {p.name for p in form.parameters}.union(form.details)
    values = {name: value for name, value in found.parameters.items() if name in names}
    return StatedEffect(effect, form, values)


# ------------------------------------------------------------------------------------------------
# How far the use lies from what was tested, and how sure the correction is there.


def _forms_sd(case: _Case, effects: Sequence[StatedEffect]) -> FloatArray:
    """Return by how much forms that fit the tests as well differ in use, a material each.

    How an effect changes from mixture to mixture the forms know roughly. So for each material
    those tests speak that are next to it on the palette, on either side; its own alone, where it
    was tested.
    """
    materials, gap = case.palette.materials, case.diagnosis.gap
    total = np.zeros(len(materials))
    # The form found misses conditions left out by this much; one that is as near to it as that
    # at the tests is as good.
    sd = max(gap.after or 0.0, gap.floor or 0.0) or USUAL.specimen
    groups: dict[tuple[int, tuple[int, ...]], list[int]] = {}
    for (k, one), number in itertools.product(enumerate(effects), range(len(materials))):
        seen = case.grades(one.effect.condition)
        below, above = [n for n in seen if n <= number], [n for n in seen if n >= number]
        beside = tuple(dict.fromkeys([*below[-1:], *above[:1]]))  # itself, or those next to it
        groups.setdefault((k, beside), []).append(number)
    for (k, beside), numbers in groups.items():
        one = effects[k]
        if tests := _tests_of(case, [materials[n] for n in beside], one.effect.condition):
            places = [*tests, *((materials[n], case.use) for n in numbers)]
            far = [_working_strain(material) for material, _ in places]
            factors = _Factors(case, places, far, _STEPS_TO_WORK)
            total[numbers] += _parted_sd(factors, one, len(tests), sd) ** 2
    return np.sqrt(total)


def _tests_of(case: _Case, materials: Sequence[Material], condition: str | None) -> list[_Place]:
    """Return materials, each at every level of a condition that was tested."""
    if condition is None:
        return [(material, case.own) for material in materials]
    tested: Any = case.diagnosis.tested.get(condition, ())
    return [(m, replace(case.own, **{condition: level})) for m in materials for level in tested]


def _beyond(
    case: _Case, effects: Sequence[StatedEffect], log_sd: Mapping[str, float]
) -> Iterator[str]:
    """Yield a sentence for each condition and for the materials that lie beyond the tests."""
    use, ids, all_tested = case.use, list(log_sd), case.diagnosis.tested
    conditions = {one.effect.condition for one in effects} - {None}
    grades = case.grades(*conditions)
    if conditions - set(all_tested):
        yield (
            "the diagnosis does not say what was tested, so that use beyond it is not told: "
            "diagnose the campaign again"
        )
    for name in (*_CONDITIONS, "orientation"):
        tested, unchanged = all_tested.get(name, ()), getattr(use, name) == getattr(case.own, name)
        if not tested or unchanged or _among(use, name, tested):
            continue
        where = f"{_in_words(use, name)} lies beyond the tested {_range_in_words(name, tested)}"
        if name in conditions:
            factor = _factor_95([log_sd[ids[n]] for n in grades] or list(log_sd.values()))
            yield f"{where}: stress is known there to a factor of {factor} (95 %); test there"
        else:
            yield f"{where}: whether it changes anything is not known; nothing was corrected for it"
    if not grades or not effects:
        return
    new = [(n, id) for n, id in enumerate(ids) if n not in grades]
    between = [id for n, id in new if grades[0] < n < grades[-1]]
    outside = [id for n, id in new if not grades[0] < n < grades[-1]]
    if between:
        yield f"{', '.join(between)}: not tested for this, but between materials that were"
    if outside:
        ends = " to ".join(dict.fromkeys(ids[n] for n in (grades[0], grades[-1])))
        factor = _factor_95([log_sd[id] for id in outside])
        known = f"stress is known there to a factor of {factor} (95 %)"
        said = "nothing was corrected there" if factor == "1" else known
        yield f"{', '.join(outside)}: beyond what was tested ({ends}); {said}"


def _factor_95(log_sds: Sequence[float]) -> str:
    return f"{math.exp(normal_quantile() * max(log_sds)):.2g}"


def _among(use: Reference, name: str, tested: Sequence[float | str]) -> bool:
    """Return whether a condition lies within what was tested, as near as replicates do."""
    value = getattr(use, name)
    if isinstance(value, str):
        return value in tested
    absolute, relative = TOLERANCES["rate_mm_s" if name == "strain_rate_per_s" else name]
    low, high = (float(end) for end in (tested[0], tested[-1]))
    below, above = (max(absolute, relative * end) for end in (low, high))
    return bool(low - below <= value <= high + above)


def _range_in_words(name: str, tested: Sequence[float | str]) -> str:
    if name == "orientation":
        return " and ".join(map(str, tested))
    ends = " to ".join(dict.fromkeys(f"{end:g}" for end in (tested[0], tested[-1])))
    return f"{ends} {_CONDITIONS[name][1]}"


def _guesses(case: _Case, model: CoefficientModel, forms: FloatArray) -> Iterator[str]:
    """Yield a finding for the materials that may be as stiff as their neighbours in this use.

    A plan chooses grades. Where forms that fit the tests as well differ, with 95 %, by more than
    the step to the nearest grade, which grade meets a target is a guess. It is told of materials
    that were tested, or lie between such: a plan may do without the others, which a note names.
    """
    steps = np.diff(np.log(model.grade_moduli_MPa(min(_WORKING_STRAIN, model.strain_limit))))
    nearest = np.minimum(np.append(steps, np.inf), np.append(np.inf, steps))
    far, grades = normal_quantile() * forms > nearest, case.grades()
    between = range(grades[0], grades[-1] + 1) if grades else ()
    if ids := [case.palette.materials[n].id for n in between if far[n]]:
        yield (
            f"{', '.join(ids)}: which grade meets a target here is a guess. Forms of the effect "
            "that fit the tests as well differ by more than the step to the next grade. Test in "
            "this use first"
        )


def _doubts(diagnosis: Diagnosis) -> Iterator[str]:
    if diagnosis.verdict == "unknown":
        closes = diagnosis.gap.laws_close_it
        yield (
            "the verdict is unknown: no effect of the library explains the gap, so there is "
            "nothing to correct by; see where the gap lies, and test what the diagnosis proposes"
            + (", or take the laws as this campaign has them (--recalibrate)" if closes else "")
        )
    if diagnosis.verdict == "none":
        yield "the verdict is none: the palette is right as far as the campaign can tell"
    others = [name for name in map(name_of, diagnosis.same_class) if name != diagnosis.verdict]
    if others and diagnosis.effect:
        yield (
            f"the data cannot tell {diagnosis.verdict} from {', '.join(others)}; the correction "
            f"is that of {diagnosis.verdict}"
        )


def _source(case: _Case, acting: Sequence[StatedEffect], corrected: Sequence[str]) -> str:
    palette, use, thickness_mm = case.palette, case.use, case.section_mm[1]
    names = {one.effect.id: f"{one.effect.id} ({one.form.name})" for one in acting}
    what = " and ".join(names.get(id, id) for id in corrected)
    at = ", ".join(_in_words(use, name) for name in (*_CONDITIONS, "orientation"))
    thick = any("thickness_mm" in one.effect.where for one in acting)
    return (
        f"palette {palette.name} (sha256 {palette.sha256[:12]}) corrected for {what} by planner "
        f"gap correct, from the diagnosis of campaign {case.diagnosis.campaign}, for {at}"
        f"{f', parts {thickness_mm:g} mm thick' if thick else ''}; before: {palette.source}"
    )
