"""An effect as a person states it: ``rate:rise=0.12,form=power-law``."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from planner.errors import ArgumentError, UnknownNameError, nearest_names
from planner.gap.effects import Effect, Form, Parameter, Values, effects_for
from planner.palette import Palette

__all__ = ["StatedEffect", "effect_named", "stated_effect", "usual_value"]


@dataclass(frozen=True, slots=True)
class StatedEffect:
    """An effect in one form with its parameters' values."""

    effect: Effect
    form: Form
    values: Values

    @property
    def text(self) -> str:
        """As it is stated, whole."""
        values = ",".join(f"{name}={value:.6g}" for name, value in self.values.items())
        return f"{self.effect.id}:form={self.form.name},{values}"


def effect_named(id: str, effects: Mapping[str, Effect], option: str) -> Effect:
    """Return an effect by its id.

    Raises
    ------
    UnknownNameError
        There is none; the message names what is near.
    """
    if id in effects:
        return effects[id]
    near = nearest_names(id, list(effects))
    hint = f"did you mean {near[0]}? " if near else ""
    raise UnknownNameError(f"{option} {id}: no such effect; {hint}there are {', '.join(effects)}")


def usual_value(parameter: Parameter) -> float:
    """Return the middle of a parameter's prior."""
    low, high = parameter.low, parameter.high
    return math.sqrt(low * high) if parameter.log and low > 0.0 else 0.5 * (low + high)


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
    effect = effect_named(id.strip(), effects_for(palette), "--effect")
    given: dict[str, str] = {}
    for pair in filter(None, (part.strip() for part in rest.split(","))):
        name, equals, value = pair.partition("=")
        if not equals or not value.strip():
            raise ArgumentError(
                f"--effect {text}: {pair!r} is no NAME=VALUE; write it as rate:rise=0.12"
            )
        given[name.strip()] = value.strip()
    form = _form(effect, given.pop("form", None), given, text)
    values = {p.name: usual_value(p) for p in form.parameters}
    for parameter in form.parameters:
        if parameter.name in given:
            size = parameter is form.size
            values[parameter.name] = _value(parameter, given[parameter.name], size, text)
    return StatedEffect(effect, form, values)


def _form(effect: Effect, name: str | None, given: Mapping[str, str], text: str) -> Form:
    forms = {form.name: form for form in effect.forms}
    if name is not None and name not in forms:
        near = nearest_names(name, list(forms))
        hint = f"did you mean {near[0]}? " if near else ""
        raise UnknownNameError(
            f"--effect {text}: {effect.id} has no form {name!r}; {hint}its forms are "
            f"{', '.join(forms)}"
        )
    candidates = list(forms.values()) if name is None else [forms[name]]
    for form in candidates:
        if set(given) <= {p.name for p in form.parameters}:
            return form
    which = "no form" if name is None else f"form {name} does not"
    owns = "; ".join(f"{f.name}: {', '.join(p.name for p in f.parameters)}" for f in candidates)
    raise UnknownNameError(
        f"--effect {text}: {which} take{'s' if name is None else ''} {', '.join(given)} ({owns})"
    )


def _value(parameter: Parameter, text: str, size: bool, whole: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    low, high = parameter.low, parameter.high
    if size:
        low = -high if parameter.signed else 0.0
    if not low <= value <= high:
        raise ArgumentError(
            f"--effect {whole}: {parameter.name} is {text}; it must be from {low:g} to {high:g}"
            + (f" {parameter.unit}" if parameter.unit != "1" else "")
        )
    return value
