"""What an effect is: physically sized, in a family of forms, at one stage of the model."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from planner.gap.campaign import Campaign, Specimen, column_levels
from planner.gap.diagnosis import FoundEffect
from planner.gap.quality import HOLDS, UNLOADS
from planner.gap.segments import hold_share, speed_mm_s, unloading_share
from planner.numerics import FloatArray
from planner.simulation.bar_solver import Setup

__all__ = [
    "Effect",
    "Form",
    "Parameter",
    "StatedEffect",
    "Values",
    "kept_below",
    "place_on_palette",
    "untestable",
    "with_effects",
]


# ------------------------------------------------------------------------------------------------
# What an effect is: physically sized, in a family of forms, at one stage of the forward model.


_Stage = Literal["composition", "law", "geometry", "boundary", "sensor"]
_STAGES: tuple[_Stage, ...] = get_args(_Stage)
"""In the order in which a specimen comes to be; effects act in this order."""

Values = Mapping[str, float]
Apply = Callable[[Setup, Values], Setup]
Advice = Callable[[FoundEffect, float, float], str]
"""Of what was found, and the width and thickness of a part's section in mm: a sentence."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """One number of a form, with its prior.

    Attributes
    ----------
    low, high
        Bounds. Of a form's first parameter, its size: the least that is worth naming and the most
        that is physical; it is 0 when the effect is off.
    log
        Whether equal ratios are equally likely, as of most sizes; else equal differences are.
    signed
        Of a size: whether it may be negative as well.
    unit
        "1" for none.
    """

    name: str
    low: float
    high: float
    meaning: str
    unit: str = "1"
    log: bool = True
    signed: bool = False

    def at(self, share: float) -> float:
        """Return the value of which a share of its prior lies below."""
        if self.log and self.low > 0.0:
            return float(self.low * (self.high / self.low) ** share)
        return float(self.low + share * (self.high - self.low))

    @property
    def usual(self) -> float:
        """The middle of its prior."""
        return self.at(0.5)


@dataclass(frozen=True, slots=True)
class Form:
    """One functional form of an effect.

    Attributes
    ----------
    parameters
        The size first, then at most two that give the form its shape.
    apply
        Of a setup and the parameters' values: the setup with the effect. With size 0 it changes
        nothing; what it changes is smooth in every parameter.
    equation, source
        As the documentation shows them.
    weight
        How usual the form is beside the effect's others.
    details
        Names of further values that make the form rich enough for real data: each normal with
        deviation 1 before any data, 0 where it is not given.
    """

    name: str
    parameters: tuple[Parameter, ...]
    apply: Apply
    equation: str
    source: str
    weight: float = 1.0
    details: tuple[str, ...] = ()

    @property
    def size(self) -> Parameter:
        """The first parameter."""
        return self.parameters[0]


_LEAST_ROOT = 0.1
"""Of a specimen's own size. Numerical: a thousandth of the effect's is none."""


@dataclass(frozen=True, slots=True)
class Effect:
    """One physical or experimental effect that a palette's laws do not know.

    All that planner knows of it stands here: whoever designs, diagnoses, reports or corrects
    reads it.

    Attributes
    ----------
    id
        Of the contract.
    title
        As in a heading.
    clause
        What it does, as the end of a sentence.
    stage
        Where it acts.
    forms
        At least two.
    where
        Axes along which its gap varies: columns of specimens.csv, or ``material``, ``strain``,
        ``time``, ``branch``, ``position``, ``specimen``.
    changes
        What a campaign changes to see it: `planner.gap.effects.STEPS`, ``materials`` or ``bars``.
    covariates
        Columns that must be known and take more than one value, or another than in the palette's
        own tests, or it cannot be tested; each entry may name alternatives, "rate_mm_s|hold".
    channels
        What must have been measured, each entry with alternatives: ``unloading``, ``hold``,
        ``bar``, ``materials`` (two or more, a bar or a part), ``section`` (width and thickness).
    condition
        The condition of a palette's reference that it is an effect of, so that at the palette's
        own there is none.
    advice
        What to do instead, where no palette can hold it.
    individual
        Coefficient of variation of its size from specimen to specimen; 0 where all have it alike.
    some
        Whether it may hold for some specimens only, alike in these.
    """

    id: str
    title: str
    clause: str
    stage: _Stage
    forms: tuple[Form, ...]
    where: tuple[str, ...]
    changes: tuple[str, ...]
    covariates: tuple[str, ...] = ()
    channels: tuple[str, ...] = ()
    condition: str | None = None
    advice: Advice | None = None
    individual: float = 0.0
    some: bool = False

    @property
    def order(self) -> int:
        """The place of its stage among `_STAGES`."""
        return _STAGES.index(self.stage)

    def own_size(self, deviate: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return a specimen's size over the effect's, of a normal deviate, and its slope by that.

        The cube root of a Gamma variate is nearly normal (Wilson & Hilferty, Proc. Natl. Acad. Sci.
        17, 1931, 684): sizes are positive, and their variation is `individual`.
        """
        root = np.maximum(1.0 + self.individual * np.asarray(deviate) / 3.0, _LEAST_ROOT)
        return root**3, self.individual * root**2

    def form(self, name: str) -> Form | None:
        """Return a form by its name."""
        return next((form for form in self.forms if form.name == name), None)


@dataclass(frozen=True, slots=True)
class StatedEffect:
    """An effect in one form with its parameters' values."""

    effect: Effect
    form: Form
    values: Values

    @property
    def text(self) -> str:
        """As a person states it, whole: ``rate:form=power-law,rise=0.12``."""
        values = ",".join(f"{name}={value:.6g}" for name, value in self.values.items())
        return f"{self.effect.id}:form={self.form.name},{values}"


def with_effects(setup: Setup, effects: Iterable[StatedEffect]) -> Setup:
    """Return a setup with effects, each at its stage."""
    for one in sorted(effects, key=lambda e: e.effect.order):
        setup = one.form.apply(setup, one.values)
    return setup


# ------------------------------------------------------------------------------------------------
# Whether a campaign can tell anything about an effect, and if not, why.


def untestable(effect: Effect, campaign: Campaign) -> str | None:
    """Return why a campaign says nothing about an effect; None if it does say something.

    A covariate serves if specimens differ in it by more than replicates may, from one another or
    all alike from the palette's own tests. Unloading and holding are taken from the records.
    """
    for needed in (*effect.covariates, *effect.channels):
        reasons = [_missing(name, campaign) for name in needed.split("|")]
        if None not in reasons:
            return " and ".join(reason for reason in reasons if reason is not None)
    return None


def _missing(name: str, campaign: Campaign) -> str | None:
    """Say what a channel lacks, or how a column fails to vary."""
    given, own = campaign.specimens, campaign.palette.reference
    if name in _CHANNELS:
        there, reason = _CHANNELS[name]
        return None if there(given) else reason
    known = [value for s in given if (value := _value(name, s)) is not None]
    if not known:
        return f"{name} is not known for any specimen"
    rate_mm_s = own.strain_rate_per_s and own.strain_rate_per_s * given[0].gauge_mm
    in_palette = rate_mm_s if name == "rate_mm_s" else getattr(own, name, None)
    if len({*column_levels(name, [*known, in_palette])} - {None}) > 1:
        return None
    was = known[0] if isinstance(known[0], str) else f"{float(np.median(known)):.4g}"
    if len(known) < len(given):
        return f"{name} is known for {len(known)} of {len(given)} specimens, and was {was} in them"
    return f"{name} was {was} in {'all specimens' if len(given) > 1 else 'the only specimen'}"


def _value(name: str, specimen: Specimen) -> Any:
    """Return a column's value; the rate is what the record shows, where it has a time."""
    if name == "rate_mm_s" and specimen.time_recorded:
        return speed_mm_s(specimen.time_s, specimen.travel_mm)
    return getattr(specimen, name, specimen.covariates.get(name))


def _is_held(specimen: Specimen) -> bool:
    # A test declared to hold may do so for less than one that was not meant to.
    return hold_share(specimen) > HOLDS * (0.5 if specimen.protocol == "relaxation" else 1.0)


def _is_graded(specimen: Specimen) -> bool:
    return specimen.coordinates is not None and float(np.ptp(specimen.coordinates)) > 1e-6


def _made_of(specimen: Specimen) -> str | float | None:
    return specimen.material if specimen.coordinates is None else float(specimen.coordinates[0])


_CHANNELS: Mapping[str, tuple[Callable[[Sequence[Specimen]], bool], str]] = {
    "unloading": (
        lambda given: any(unloading_share(s) > UNLOADS for s in given),
        "no specimen was unloaded",
    ),
    "hold": (lambda given: any(map(_is_held, given)), "no specimen was held at a strain"),
    "bar": (
        lambda given: any(s.profile is not None and _is_graded(s) for s in given),
        "there is no graded bar",
    ),
    "materials": (
        lambda given: any(map(_is_graded, given)) or len(set(map(_made_of, given))) > 1,
        "there is one material only",
    ),
    "section": (
        lambda given: any(s.section_mm2(np.zeros(1)) is not None for s in given),
        "width and thickness are not known for any specimen",
    ),
}
"""Whether specimens show what a channel stands for, and the reason if not."""


# ------------------------------------------------------------------------------------------------
# What the forms of several files need.


def place_on_palette(setup: Setup) -> FloatArray:
    """Return each slice's coordinate from 0, the palette's softest, to 1, its hardest, (S,)."""
    low, high = setup.coordinate_range
    return (setup.coordinate - low) / max(high - low, 1e-12)


def kept_below(size: FloatArray, most: ArrayLike) -> FloatArray:
    """Return sizes of either sign that hardly change well below a largest, and never exceed it."""
    return np.asarray(size * (1.0 + (size / np.maximum(most, 1e-12)) ** 8) ** -0.125)
