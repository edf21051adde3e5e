"""What an effect is: physically sized, in a family of forms, at one stage of the model."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

import numpy as np

from planner.formats.tensile import SPECIMEN_COLUMNS
from planner.gap.campaign import TOLERANCES, Campaign, Specimen, levels
from planner.gap.quality_records import HOLDS, UNLOADS, hold_share, speed_mm_s, unloading_share
from planner.numerics import FloatArray
from planner.simulation.bar_solver import Setup

__all__ = [
    "PEAK",
    "STANDARD",
    "Apply",
    "Effect",
    "Form",
    "Parameter",
    "Stage",
    "Values",
    "condition",
    "mixture_share",
    "place_on_palette",
    "reference_condition",
    "section_sizes_mm",
    "untestable",
]


# ------------------------------------------------------------------------------------------------
# What an effect is: physically sized, in a family of forms, at one stage of the forward model.


Stage = Literal["composition", "law", "geometry", "boundary", "sensor"]
Values = Mapping[str, float]
Apply = Callable[[Setup, Values], Setup]


@dataclass(frozen=True, slots=True)
class Parameter:
    """One number of a form, with its prior.

    Attributes
    ----------
    low, high
        Bounds. Of a form's first parameter, its size: the least that is worth naming and the most
        that is physical; it is 0 when the effect is off.
    log
        Whether equal ratios, not equal differences, are equally likely.
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
    log: bool = False
    signed: bool = False


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
    """

    name: str
    parameters: tuple[Parameter, ...]
    apply: Apply
    equation: str
    source: str
    weight: float = 1.0

    @property
    def size(self) -> Parameter:
        """The first parameter."""
        return self.parameters[0]


@dataclass(frozen=True, slots=True)
class Effect:
    """One physical or experimental effect that a palette's laws do not know.

    Attributes
    ----------
    id
        Of the contract.
    stage
        Where it acts.
    forms
        At least two.
    where
        Axes along which its gap varies: columns of specimens.csv, or ``material``, ``strain``,
        ``time``, ``branch``, ``position``, ``specimen``.
    covariates
        Columns that must be known and take more than one value, or it cannot be tested; each
        entry may name alternatives, "rate_mm_s|hold".
    channels
        What must have been measured, each entry with alternatives: ``unloading``, ``hold``,
        ``bar``, ``materials`` (two or more, or a bar), ``section`` (width and thickness).
    individual
        Coefficient of variation of its size from specimen to specimen; 0 where all have it alike.
    some
        Whether it may hold for some specimens only, alike in these.
    """

    id: str
    title: str
    stage: Stage
    forms: tuple[Form, ...]
    where: tuple[str, ...]
    covariates: tuple[str, ...] = ()
    channels: tuple[str, ...] = ()
    individual: float = 0.0
    some: bool = False


# ------------------------------------------------------------------------------------------------
# Whether a campaign can tell anything about an effect, and if not, why.


_DECLARED_HOLDS = 0.5 * HOLDS
"""A test declared to hold may do so for less than one that was not meant to."""


def untestable(effect: Effect, campaign: Campaign) -> str | None:
    """Return why a campaign says nothing about an effect; None if it does say something.

    A covariate serves if it is known of two specimens or more and differs between them by more
    than replicates may. Unloading and holding are taken from the records.
    """
    for needed in (*effect.covariates, *effect.channels):
        reasons = [_missing(name, campaign.specimens) for name in needed.split("|")]
        if None not in reasons:
            return " and ".join(reason for reason in reasons if reason is not None)
    return None


def _missing(name: str, specimens: Sequence[Specimen]) -> str | None:
    channel = _CHANNELS.get(name)
    return _constant(name, specimens) if channel is None else channel(specimens)


def _constant(name: str, specimens: Sequence[Specimen]) -> str | None:
    """Say how a column fails to vary."""
    values = [_value(name, s) for s in specimens]
    known = [value for value in values if value is not None]
    if not known:
        return f"{name} is not known for any specimen"
    if _varies(name, known):
        return None
    first = known[0]
    was = first if isinstance(first, str) else f"{float(np.median(known)):.4g}"  # type: ignore[arg-type]
    if len(known) < len(values):
        return f"{name} is known for {len(known)} of {len(values)} specimens, and was {was} in them"
    return f"{name} was {was} in {'all specimens' if len(values) > 1 else 'the only specimen'}"


def _varies(name: str, known: Sequence[str | float]) -> bool:
    if any(isinstance(value, str) for value in known):
        return len(set(known)) > 1
    numbers = [float(value) for value in known]
    return max(level or 0 for level in levels(numbers, *TOLERANCES.get(name, (0.0, 0.0)))) > 0


def _value(name: str, specimen: Specimen) -> str | float | None:
    """Return a column's value; the rate is what the record shows, where it has a time."""
    if name == "rate_mm_s" and specimen.time_recorded:
        return speed_mm_s(specimen.time_s, specimen.displacement_mm)
    value: str | float | None = getattr(specimen, name, specimen.covariates.get(name))
    return value


def _no_unloading(specimens: Sequence[Specimen]) -> str | None:
    if any(unloading_share(s.displacement_mm, s.force_N) > UNLOADS for s in specimens):
        return None
    return "no specimen was unloaded"


def _no_hold(specimens: Sequence[Specimen]) -> str | None:
    least = {s.id: _DECLARED_HOLDS if s.protocol == "relaxation" else HOLDS for s in specimens}
    if any(hold_share(s) > least[s.id] for s in specimens):
        return None
    return "no specimen was held at a strain"


def _no_bar(specimens: Sequence[Specimen]) -> str | None:
    return None if any(_is_graded(s) for s in specimens) else "there is no graded bar"


def _one_material(specimens: Sequence[Specimen]) -> str | None:
    if any(_is_graded(s) for s in specimens):
        return None
    mixtures = {
        s.material if s.profile is None else float(s.profile.coordinate[0]) for s in specimens
    }
    return None if len(mixtures) > 1 else "there is one material only"


def _no_section(specimens: Sequence[Specimen]) -> str | None:
    if any(s.section_mm2(np.zeros(1)) is not None for s in specimens):
        return None
    return "width and thickness are not known for any specimen"


def _is_graded(specimen: Specimen) -> bool:
    return specimen.profile is not None and float(np.ptp(specimen.profile.coordinate)) > 1e-6


_CHANNELS: Mapping[str, Callable[[Sequence[Specimen]], str | None]] = MappingProxyType(
    {
        "unloading": _no_unloading,
        "hold": _no_hold,
        "bar": _no_bar,
        "materials": _one_material,
        "section": _no_section,
    }
)


# ------------------------------------------------------------------------------------------------
# A condition of each test against that at which the palette's laws hold.


STANDARD: Mapping[str, float] = MappingProxyType(
    {"rate_per_s": 0.03}
    | {name: c.usual for name, c in SPECIMEN_COLUMNS.items() if c.usual is not None}
)
"""What stands in where a palette does not say at which conditions it was measured."""

_REFERENCE = MappingProxyType({"rate_per_s": "strain_rate_per_s"})
_COLUMN = MappingProxyType({"rate_per_s": "rate_mm_s"})


def reference_condition(setup: Setup, name: str) -> float:
    """Return a condition's value at the palette's reference."""
    value = getattr(setup.reference, _REFERENCE.get(name, name))
    return STANDARD[name] if value is None else float(value)


def condition(setup: Setup, name: str) -> FloatArray:
    """Return a condition of the tests, (P,), the reference's where it is unknown."""
    values: FloatArray = getattr(setup, name)
    known = setup.known.get(name, setup.known.get(_COLUMN.get(name, name)))
    if known is None:
        return values
    return np.where(known, values, reference_condition(setup, name))


# ------------------------------------------------------------------------------------------------
# How much of an effect each mixture shows: most at one place on the palette, less around it.


PEAK = Parameter("peak", 0.0, 1.0, "mixture that shows most of it, softest 0 to hardest 1")

_WIDTH = 0.7
"""Of the trend, over the palette's range: a mixture at the other end shows an eighth."""


def place_on_palette(setup: Setup) -> FloatArray:
    """Return each slice's coordinate from 0, the palette's softest, to 1, its hardest, (S,)."""
    low, high = setup.coordinate_range
    return (setup.coordinate - low) / max(high - low, 1e-12)


def mixture_share(setup: Setup, peak: float) -> FloatArray:
    """Return the share of an effect in each slice, (S,), 1 at the place `peak`."""
    return np.exp(-(((place_on_palette(setup) - peak) / _WIDTH) ** 2))


# ------------------------------------------------------------------------------------------------
# Width and thickness of every slice, as drawn.


def section_sizes_mm(setup: Setup) -> tuple[FloatArray, FloatArray]:
    """Return width and thickness, (S,); a bar's design goes before the test's own size."""
    width, thickness = setup.on_slices(setup.width_mm), setup.on_slices(setup.thickness_mm)
    for test, design in enumerate(setup.designs):
        if design is None or (design.width_mm is None and design.thickness_mm is None):
            continue
        slices = slice(setup.first_slice[test], setup.first_slice[test + 1])
        for size, along in ((width, design.width_mm), (thickness, design.thickness_mm)):
            if along is not None:
                size[slices] = np.interp(setup.x_mm[slices], design.x_mm, along)
    return width, thickness
