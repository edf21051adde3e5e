"""What an effect is: physically sized, in a family of forms, at one stage of the forward model."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

from planner.gap.forward.setup import Setup

__all__ = ["Apply", "Effect", "Form", "Parameter", "Stage", "Values"]

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
