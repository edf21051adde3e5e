"""A campaign with stated effects, made by planner's own forward model: to teach and to practise.

What planner makes by its own formulas proves nothing about what it can find in measurements; every
file says where it comes from.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from planner.arrays import FloatArray
from planner.errors import ArgumentError, FileError
from planner.gap.campaign import Campaign
from planner.gap.forward import Prediction, Setup, law_tables, predict
from planner.gap.imitation.stated_effect import StatedEffect
from planner.gap.planned.lone_test import lone_test
from planner.gap.specimen import Specimen, StrainField

__all__ = ["SCATTER", "imitate"]

SCATTER = 0.03
"""Standard deviation of specimens' levels, of the logarithm of force; the rest goes with it."""

_BATCH = 0.4
_SLOPE = 0.4
_WANDER = 0.2
_WANDER_LENGTH = 0.15
"""Of a path. Batches, slopes and wandering in shares of the specimens' scatter."""

_SENSOR = 0.001
_SENSOR_LEAST_N = 0.002
_FIELD, _FIELD_RELATIVE = 0.003, 0.02
_STAGES = ("composition", "law", "geometry", "boundary", "sensor")


def imitate(
    plan: Campaign,
    effects: Sequence[StatedEffect],
    rng: np.random.Generator,
    *,
    scatter: float = SCATTER,
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
    if not 0.0 <= scatter <= 0.3:
        raise ArgumentError(f"--scatter {scatter:g}: it must be from 0 to 0.3")
    laws = law_tables(plan.palette)
    batches = {
        name: _BATCH * scatter * float(rng.standard_normal())
        for name in dict.fromkeys(s.batch for s in plan.specimens)
    }
    told = ", ".join(e.text for e in effects) or "no effect"
    how = f"SIMULATED by planner gap simulate with {told}; scatter {scatter:g}"
    how += f"; {seed_text}" if seed_text else ""
    specimens = []
    for place, specimen in enumerate(plan.specimens):
        setup = lone_test(plan, place, specimen.time_s, specimen.displacement_mm)
        if setup is None:
            raise FileError(
                f"campaign {plan.name}: specimen {specimen.id} never loads over enough points; "
                "leave it out"
            )
        prediction = predict(_with(setup, effects, rng), laws)
        level = batches[specimen.batch] + _course(specimen, scatter, rng)
        specimens.append(_measured(specimen, setup, prediction, level, rng, how))
    return replace(
        plan,
        name=f"{plan.name} (simulated)",
        specimens=tuple(specimens),
        covariates=(*plan.covariates, "simulated"),
        notes=f"{how}. Nothing was measured.",
        remarks=(),
    )


def _with(setup: Setup, effects: Sequence[StatedEffect], rng: np.random.Generator) -> Setup:
    """Return the setup with every effect, sizes that are each specimen's own drawn."""
    for one in sorted(effects, key=lambda e: _STAGES.index(e.effect.stage)):
        own = 1.0 + one.effect.individual * float(rng.standard_normal())
        size = one.form.size.name
        values = {**one.values, size: one.values[size] * max(own, 0.1)}
        setup = one.form.apply(setup, values)
    return setup


def _course(specimen: Specimen, scatter: float, rng: np.random.Generator) -> FloatArray:
    """Return what is a specimen's own, of ln force along its record: level, slope, wandering."""
    level, slope = rng.standard_normal(2)
    travel = specimen.displacement_mm / float(specimen.displacement_mm.max())
    place = np.arange(len(travel)) / (len(travel) - 1)
    kept = np.exp(-np.diff(place) / _WANDER_LENGTH)
    wander = rng.standard_normal(len(travel))
    for k, share in enumerate(kept):
        wander[k + 1] = share * wander[k] + np.sqrt(1.0 - share**2) * wander[k + 1]
    course: FloatArray = scatter * (level + _SLOPE * slope * (travel - 0.5) + _WANDER * wander)
    return course


def _measured(
    specimen: Specimen,
    setup: Setup,
    prediction: Prediction,
    level: FloatArray,
    rng: np.random.Generator,
    how: str,
) -> Specimen:
    force = prediction.force_N[0] * np.exp(level)
    noise = max(_SENSOR * float(np.abs(force).max()), _SENSOR_LEAST_N)
    force = force + noise * rng.standard_normal(len(force))
    seen = specimen.strain_field
    return replace(
        specimen,
        id=f"SIM-{specimen.id}",
        force_N=force,
        strain_field=None if seen is None else _seen(seen, specimen, setup, prediction, rng),
        covariates={**specimen.covariates, "simulated": how.partition(";")[0]},
        time_recorded=True,
    )


def _seen(
    seen: StrainField,
    specimen: Specimen,
    setup: Setup,
    prediction: Prediction,
    rng: np.random.Generator,
) -> StrainField:
    """Return the strains that a camera sees when it looked, means over the way between places."""
    half = 0.5 * float(np.median(np.diff(seen.x_mm))) if len(seen.x_mm) > 1 else 0.5
    edges = np.concatenate([[0.0], setup.x_mm + 0.5 * setup.length_mm])
    ends = np.stack([seen.x_mm - half, seen.x_mm + half]).clip(0.0, edges[-1])
    moved = np.cumsum(prediction.strain * setup.length_mm, axis=1)
    moved = np.concatenate([np.zeros((len(moved), 1)), moved], axis=1)
    along = np.stack([np.diff(np.interp(ends, edges, row), axis=0)[0] for row in moved])
    along = along / np.diff(ends, axis=0)[0]
    strain = np.stack([np.interp(seen.time_s, specimen.time_s, at) for at in along.T], axis=1)
    sd = np.hypot(_FIELD, _FIELD_RELATIVE * strain)
    return replace(seen, strain=strain + sd * rng.standard_normal(strain.shape))
