"""Virtual specimens: campaigns yet to be measured, and synthetic data of stated effects."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np

from planner.errors import (
    ArgumentError,
    FileError,
    UnknownNameError,
    as_count,
    as_texts,
    check_known,
    positive,
    refused,
    within,
)
from planner.formats.files import path_within
from planner.formats.specimens import read_specimens
from planner.gap.campaign import Campaign, Specimen, StrainField, stated
from planner.gap.campaign_folder import (
    SPECIMENS,
    ListReader,
    has_curves,
    read_campaign,
    read_campaign_file,
    read_list,
    said_mode,
)
from planner.gap.diagnosis import read_diagnosis
from planner.gap.effect import Effect, Form, Parameter, StatedEffect, with_effects
from planner.gap.effects import effect_named, effects_for
from planner.gap.noise import USUAL
from planner.gap.observations import seen_shares
from planner.gap.segments import ReplicateTest, path_of, setup_of
from planner.numerics import FloatArray, numbers_in
from planner.palette import Palette
from planner.printers import Printer, load_printer, palette_of
from planner.simulation.bar import ProfileDesign
from planner.simulation.bar_solver import Prediction, Setup, law_tables, predict
from planner.simulation.simulate import loading_path

__all__ = [
    "BAR_SHARE",
    "HOLD_S",
    "single_tests",
    "stated_effect",
    "synthesise_campaign",
    "synthetic_campaign",
    "virtual_specimen",
    "virtual_strain",
]


# ------------------------------------------------------------------------------------------------
# Specimens that are yet to be tested, on the path that their protocol will take them.


HOLD_S = 240.0
"""How long relaxation holds. Chosen: some minutes, over which two to three decades of time are
seen."""

_FACET_mm = 1.0
"""Of a camera that is yet to see a bar's strain, one beside the other. Chosen: some 20 pixels,
where a thousand see a gauge and its grips."""

_PLANNED_ROWS = 160
"""Of a pull that is planned. Numerical: several a step of its test."""

_FRAMES = 8
"""That a camera takes of a pull. Chosen: two are compared, the last and the one nearest half
its travel."""

_STRAIN = 0.3
_BREAK_SHARE = 0.6
"""How far coupons are pulled, and at most of the smallest elongation at break. Chosen: where laws
bend, and specimens weaker than the mean hold."""

BAR_SHARE = 0.5
"""How far a bar is pulled beside coupons. Chosen: its soft half strains up to twice as much as the
bar does."""


def virtual_strain(
    palette: Palette, materials: Sequence[str], profiles: Sequence[ProfileDesign] = ()
) -> float:
    """Return how far a campaign's coupons are pulled: the same strain for all, broken by none.

    Bars go half as far. One strain for all keeps it from going with the material.
    """
    breaks = [palette.resolve(name).elongation_at_break for name in materials]
    at, ends = np.array([(m.coordinate, m.elongation_at_break) for m in palette.materials]).T
    breaks += [float(np.interp(design.coordinate, at, ends).min()) for design in profiles]
    return min([_STRAIN, *(_BREAK_SHARE * b for b in breaks)])


def virtual_specimen(
    palette: Palette,
    *,
    id: str,
    gauge_mm: float,
    strain: float,
    hold_s: float = HOLD_S,
    camera: bool = False,
    steps: int | None = None,
    pushed: bool = False,
    **fields: Any,
) -> Specimen:
    """Return a specimen with the time and travel of its test; its force is a stand-in.

    The force is what keeps a record whole, rising with travel; whoever needs the truth predicts it.

    Parameters
    ----------
    strain
        How far a coupon is pulled; see `virtual_strain`.
    camera
        Whether a bar's strain is seen along its axis.
    steps
        Of each leg of its path; 160 in all by default.
    pushed
        Whether it is compressed so far, not pulled.
    fields
        Of `Specimen`. Without `rate_mm_s` it is pulled at the palette's own strain rate.
    """
    own = asdict(stated(palette.reference))
    rate = fields.get("rate_mm_s") or own["strain_rate_per_s"] * gauge_mm
    design: ProfileDesign | None = fields.get("profile")
    protocol = fields.get("protocol") or "monotonic"
    end_mm = strain * gauge_mm * (1.0 if design is None else BAR_SHARE)
    path = loading_path(
        protocol,
        to_displacement_mm=end_mm,
        rate_mm_s=rate,
        steps=steps or (_PLANNED_ROWS if protocol == "monotonic" else _PLANNED_ROWS // 2),
        hold_s=hold_s,
    )
    seen = None
    if camera and design is not None:
        x = np.arange(0.5 * _FACET_mm, gauge_mm, _FACET_mm)
        last = int(np.argmax(path.displacement_mm))
        rows = np.unique(np.linspace(1, last, _FRAMES).astype(np.int64))
        local = np.repeat(path.displacement_mm[rows, None] / gauge_mm, len(x), axis=1)
        seen = StrainField(path.time_s[rows], x, local, _FACET_mm)
    travel = -path.displacement_mm if pushed else path.displacement_mm
    return Specimen(
        id=id,
        time_s=path.time_s,
        displacement_mm=travel,
        force_N=travel / gauge_mm,
        gauge_mm=gauge_mm,
        strain_field=seen,
        **fields,
    )


# ------------------------------------------------------------------------------------------------
# Specimens' tests on their own, at any steps: to predict whole curves.


_LONE_ROWS = 200
"""Of a record that is followed alone. Numerical: several a step of its test."""


def single_tests(
    campaign: Campaign, places: Sequence[int], time_s: FloatArray, travel_mm: FloatArray
) -> Setup:
    """Return the setup of specimens, a test each, along paths of any steps, with no effect.

    Parameters
    ----------
    places
        Of the specimens in the campaign.
    time_s, travel_mm : (P, T)
        Of the crosshead, the first step at rest; the way it loads.

    Raises
    ------
    FileError
        A specimen that never loads over enough rows to be observed.
    """
    tests = []
    for place in places:
        if (path := path_of(campaign.specimens[place])) is None:
            raise FileError(
                f"campaign {campaign.name}: specimen {campaign.specimens[place].id} never loads "
                "over enough points; leave it out"
            )
        tests.append(ReplicateTest({place: path}))
    setup, none = setup_of(campaign, tests), np.zeros_like(time_s)
    reloads = np.stack([*map(np.interp, time_s, setup.time_s, setup.reloads)])
    steps = {"time_s": time_s, "travel_mm": travel_mm, "reloads": reloads}
    return setup.with_(**steps, lost_mm=none, gain=none + 1.0, offset_N=none)


# ------------------------------------------------------------------------------------------------
# A campaign that is yet to be measured: its list of specimens, each on its protocol's path.


def read_design(
    path: str | Path, palette: str | Path | Palette | None, *, printer: Printer, camera: bool
) -> Campaign:
    """Read which specimens are to be tested: a specimens.csv, or a campaign's folder.

    A folder's own palette counts. Where it has curves, their specimens go the ways that they
    went; else each goes that of its protocol, as far as a column `to_strain` says, or
    `virtual_strain`; a part as far as `to_mm` says, or it was simulated. Forces are stand-ins.

    Parameters
    ----------
    palette, printer
        Of a list alone; by default those of the campaign or diagnosis that it lies beside, if any.
    camera
        Whether bars are seen along their axis.

    Raises
    ------
    FileError
        A file that is missing or cannot be understood, or a specimen without its sizes.
    PaletteError, UnknownNameError
        The palette, or a material that it does not have.
    """
    with refused(ArgumentError, f"`design` {path!r}", "give a list or a campaign", TypeError):
        path = Path(path)
    if path.is_file():
        folder, name = path.parent, ""
        if palette is None and (folder / "campaign.toml").is_file():
            file = read_campaign_file(folder)
            palette, name = file.palette_in(folder), file.printer
        elif palette is None and (folder / "diagnosis.json").is_file():
            palette = read_diagnosis(folder).own_palette
        return _listed(path, path.stem, palette_of(palette, printer), name or printer.name, camera)
    if not path.is_dir():
        raise FileError(
            f"{path}: no such file or folder; give a specimens.csv or the folder of a campaign"
        )
    file = read_campaign_file(path)
    own = file.palette_in(path)
    if has_curves(path) or any(row.file for row in read_specimens(path_within(path, SPECIMENS))):
        return _followed(read_campaign(path, own))
    return _listed(path_within(path, SPECIMENS), file.name, own, file.printer, camera)


def _followed(campaign: Campaign) -> Campaign:
    """Return a campaign whose specimens go the ways that they went."""
    specimens = tuple(s for s in map(_retraced, campaign.specimens) if s is not None)
    if not specimens:
        raise FileError(
            f"campaign {campaign.name}: no specimen loads over enough points to be followed; "
            f"give its {SPECIMENS} alone, and each goes the way of its protocol"
        )
    return replace(campaign, specimens=specimens)


def _retraced(specimen: Specimen) -> Specimen | None:
    """Return a specimen on the way that it was meant to go: corners, and lines between.

    None where it never loads over enough rows to be observed.
    """
    if (path := path_of(specimen)) is None:
        return None
    rows = max(_LONE_ROWS // len(path.segments), 12)
    even, held = np.arange(1, rows + 1) / rows, np.geomspace(1e-3, 1.0, rows)
    parts = [s.begin_s + (s.end_s - s.begin_s) * (even if s.moves else held) for s in path.segments]
    time = np.concatenate([np.zeros(1), *parts])
    corners = np.array([(0.0, 0.0), *((s.end_s, s.end_mm) for s in path.segments)])
    travel = np.interp(time, *corners.T) * (-1.0 if specimen.pushed else 1.0)
    seen = specimen.strain_field
    return replace(
        specimen,
        time_s=time,
        displacement_mm=travel,
        force_N=travel / specimen.gauge_mm,
        # Times count from the start of travel.
        strain_field=None if seen is None else replace(seen, time_s=seen.time_s - path.shift_s),
    )


def _listed(file: Path, name: str, palette: Palette, printer: str, camera: bool) -> Campaign:
    rows, covariates, notes = read_list(file)
    reader = ListReader(file, palette)
    read = [reader.fields(row)[0] for row in rows]
    designs = [fields["profile"] for fields in read if "profile" in fields]
    strain = virtual_strain(palette, [row.material for row in rows if row.material], designs)
    specimens = []
    for row, fields in zip(rows, read, strict=True):
        own, where = covariates[row.specimen], f"{file.name}, specimen {row.specimen}"
        share = BAR_SHARE if row.profile else 1.0
        if row.part:
            end_mm = float(fields["part"].response.displacement_mm[-1])
            far = _figure(own.get("to_mm"), end_mm, where, "to_mm") / fields["gauge_mm"]
        else:
            far = _figure(own.get("to_strain"), share * strain, where, "to_strain")
        specimen = virtual_specimen(
            palette,
            id=row.specimen,
            # What the list says is how far it goes; a bar else goes its share.
            strain=far / share,
            hold_s=_figure(own.get("hold_s"), HOLD_S, where, "hold_s"),
            camera=camera,
            pushed=not row.part and said_mode(row) == "compression",
            covariates=own,
            **fields,
        )
        specimens.append(specimen)
    return Campaign(
        name=name,
        printer=printer,
        palette=palette,
        specimens=tuple(specimens),
        covariates=tuple(rows[0].covariates),
        remarks=tuple(notes),
    )


def _figure(value: str | float | None, otherwise: float, where: str, name: str) -> float:
    if value is None:
        return otherwise
    with refused(FileError, where, "{}, or empty", ArgumentError):
        return positive(value, name)


# ------------------------------------------------------------------------------------------------
# An effect as a person states it: ``rate:rise=0.12,form=power-law``.


def stated_effect(text: str, palette: Palette) -> StatedEffect:
    """Read an effect: its id, then a colon and NAME=VALUE with commas between.

    Parameters that are not given are at the middle of their prior; without ``form=`` the first
    form is taken that has all the given ones.

    Raises
    ------
    UnknownNameError
        No such effect, form or parameter.
    ArgumentError
        A value that is no number, or beyond what the effect may have.
    """
    id, _, rest = text.partition(":")
    effect = effect_named(id.strip(), effects_for(palette), "`effect`")
    given: dict[str, str] = {}
    for pair in filter(None, (part.strip() for part in rest.split(","))):
        name, equals, value = pair.partition("=")
        if not equals or not value.strip():
            raise ArgumentError(
                f"`effect` {text}: {pair!r} is no NAME=VALUE; write it as rate:rise=0.12"
            )
        given[name.strip()] = value.strip()
    form = _form(effect, given.pop("form", None), given, text)
    values = {
        p.name: _value(p, given[p.name], p is form.size, text) if p.name in given else p.usual
        for p in form.parameters
    }
    return StatedEffect(effect, form, values)


def _form(effect: Effect, name: str | None, given: Mapping[str, str], text: str) -> Form:
    candidates = [form for form in effect.forms if name in (None, form.name)]
    if not candidates:
        said = f"`effect` {text}: {effect.id} has no form {name!r}; {{}}its forms are"
        check_known(name, (form.name for form in effect.forms), said, UnknownNameError)
    for form in candidates:
        if set(given) <= {p.name for p in form.parameters}:
            return form
    which = "no form takes" if name is None else f"form {name} does not take"
    owns = "; ".join(f"{f.name}: {', '.join(p.name for p in f.parameters)}" for f in candidates)
    raise UnknownNameError(f"`effect` {text}: {which} {', '.join(given)} ({owns})")


def _value(parameter: Parameter, text: str, size: bool, whole: str) -> float:
    (value,) = numbers_in([text], float) or [math.nan]
    low, high = parameter.low, parameter.high
    if size:
        low = -high if parameter.signed else 0.0
    unit = "" if parameter.unit == "1" else f" in {parameter.unit}"
    return within(value, f"`effect` {whole}: {parameter.name}{unit}", low, high)


# ------------------------------------------------------------------------------------------------
# A campaign with stated effects, made by planner's own forward model: to teach and to practise.
#
# What planner makes by its own formulas proves nothing about what it can find in measurements;
# every file says where it comes from.


_SCATTER = USUAL.specimen
"""Standard deviation of specimens' levels, of the logarithm of force; the rest goes with it."""

_MOST_SCATTER = 0.3
"""Of a simulated campaign. Convention: three times and more what jetted specimens scatter by, to
catch slips."""

_SENSOR = 0.001
_SENSOR_LEAST_N = 0.002
"""Noise of force, of the largest and at least. Chosen: a good load cell's."""


def synthesise_campaign(
    design: Campaign | str | Path,
    *,
    effect: str | Sequence[str] = (),
    scatter: float = _SCATTER,
    seed: int = 1,
    camera: bool = False,
    printer: str | Printer = "connex3",
    palette: str | Path | Palette | None = None,
) -> Campaign:
    """Make a campaign with stated effects by planner's own model, to teach or to practise.

    It says of itself that it is simulated; it is no evidence of what the diagnosis can do with
    measurements.

    Parameters
    ----------
    design
        Which specimens: a specimens.csv, or a campaign or its folder, whose own palette counts.
    effect
        What is at work, each ``"ID:NAME=VALUE,..."``, as in ``"rate:rise=0.12,form=power-law"``;
        what is not given is at the middle of its range.
    scatter
        From specimen to specimen, of ln force; 0 leaves the sensors' noise alone.
    seed
        Same seed, same campaign.
    camera
        See the strain along planned bars, too.
    printer, palette
        Of a list alone, by name, file or value; by default those of the campaign or diagnosis
        that it lies beside, if any.

    Returns
    -------
    Campaign
        As `read_campaign` returns a measured one; its remarks say what is to be known of the list.

    Raises
    ------
    ArgumentError
        A scatter below 0 or above 0.3, or an effect's value beyond what it may be.
    UnknownNameError
        No such effect, form, parameter, printer or palette.
    FileError, PaletteError
        A file that is missing or cannot be understood, a specimen without its sizes, or a law that
        nothing can be predicted with.

    Examples
    --------
    >>> made = planner.synthesise_campaign("lab", effect="rate:rise=0.12")  # doctest: +SKIP
    >>> planner.diagnose(made).verdict  # doctest: +SKIP
    'rate'
    """
    if isinstance(design, Campaign):
        plan = _followed(design)
    else:
        plan = read_design(design, palette, printer=load_printer(printer), camera=camera)
    effects = [stated_effect(text, plan.palette) for text in as_texts(effect, "`effect`")]
    rng = np.random.default_rng(as_count(seed, "`seed`", 2**63, least=0))
    return synthetic_campaign(plan, effects, rng, scatter=scatter, seed_text=f"seed {seed}")


def synthetic_campaign(
    plan: Campaign,
    effects: Sequence[StatedEffect],
    rng: np.random.Generator,
    *,
    scatter: float = _SCATTER,
    seed_text: str = "",
) -> Campaign:
    """Return a campaign as if its specimens had been measured with these effects at work.

    Ids begin with "SIM-", a column `simulated` and the notes say how it was made.

    Parameters
    ----------
    plan
        Its specimens' time and travel are followed; their forces do not matter.
    scatter
        0 leaves the sensors' noise alone.
    seed_text
        How the generator was made, for the notes.

    Raises
    ------
    ArgumentError
        A scatter below 0 or above 0.3.
    FileError
        A specimen that never loads.
    PaletteError
        A law that nothing can be predicted with.
    """
    within(scatter, "`scatter`", 0.0, _MOST_SCATTER)
    laws = law_tables(plan.palette)
    batches = {
        name: USUAL.batch / USUAL.specimen * scatter * float(rng.standard_normal())
        for name in dict.fromkeys(s.batch for s in plan.specimens)
    }
    told = ", ".join(e.text for e in effects) or "no effect"
    how = f"SIMULATED by planner gap simulate with {told}; scatter {scatter:g}"
    how += f"; {seed_text}" if seed_text else ""
    specimens = []
    for place, specimen in enumerate(plan.specimens):
        setup = single_tests(plan, [place], specimen.time_s[None], specimen.travel_mm[None])
        prediction = predict(with_effects(setup, _drawn(effects, rng)), laws)
        level = batches[specimen.batch] + _course(specimen, scatter, rng)
        force = prediction.force_N[0] * np.exp(level)
        noise = max(_SENSOR * float(np.abs(force).max()), _SENSOR_LEAST_N)
        specimens.append(
            replace(
                specimen,
                id=f"SIM-{specimen.id}",
                force_N=force + noise * rng.standard_normal(len(force)),
                strain_field=_seen(specimen, setup, prediction, rng),
                covariates={**specimen.covariates, "simulated": how.partition(";")[0]},
                time_recorded=True,
            )
        )
    return replace(
        plan,
        name=f"{plan.name.removesuffix(' (simulated)')} (simulated)",
        specimens=tuple(specimens),
        covariates=tuple(dict.fromkeys((*plan.covariates, "simulated"))),
        notes=f"{how}. Nothing was measured.",
    )


def _drawn(effects: Sequence[StatedEffect], rng: np.random.Generator) -> Iterator[StatedEffect]:
    """Yield the effects with sizes that are each specimen's own drawn."""
    for one in sorted(effects, key=lambda e: e.effect.order):
        own = float(one.effect.own_size(rng.standard_normal())[0])
        size = one.form.size.name
        yield replace(one, values={**one.values, size: one.values[size] * own})


def _course(specimen: Specimen, scatter: float, rng: np.random.Generator) -> FloatArray:
    """Return what is a specimen's own, of ln force along its record: level, slope, wandering."""
    level, slope = rng.standard_normal(2)
    travel = specimen.travel_mm / float(specimen.travel_mm.max())
    kept = math.exp(-1.0 / (len(travel) - 1) / USUAL.wander_length)
    fresh = rng.standard_normal(len(travel))
    fresh[1:] *= math.sqrt(1.0 - kept**2)
    wander = np.array(list(accumulate(fresh.tolist(), lambda at, more: kept * at + more)))
    tilt, rough = USUAL.slope / USUAL.specimen, USUAL.wander / USUAL.specimen
    return np.asarray(scatter * (level + tilt * slope * (travel - 0.5) + rough * wander))


def _seen(
    specimen: Specimen, setup: Setup, prediction: Prediction, rng: np.random.Generator
) -> StrainField | None:
    """Return the strains that a camera sees when it looked; facets of unknown length touch."""
    if (seen := specimen.strain_field) is None:
        return None
    facet = float(np.median(np.diff(seen.x_mm))) if seen.facet_mm is None else seen.facet_mm
    along = prediction.strain @ seen_shares(setup, 0, seen.x_mm, facet).T
    strain = np.stack([np.interp(seen.time_s, specimen.time_s, at) for at in along.T], axis=1)
    sd = np.hypot(USUAL.field, USUAL.field_relative * strain)
    return replace(seen, strain=strain + sd * rng.standard_normal(strain.shape))
