"""Effects that a palette's laws do not know: of the print, of conditions, of the test."""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from planner.errors import UnknownNameError, check_known
from planner.gap.diagnosis import FoundEffect
from planner.gap.effect import Effect, Form, Parameter
from planner.gap.effects import conditions, print, test
from planner.palette import Palette

__all__ = ["EFFECTS", "STEPS", "TESTS", "effect_named", "effects_for"]


_FILES = {"conditions": conditions, "print": print, "test": test}


def _named(function: str) -> Any:
    """Return the function that the table names by its file, as "test.gained"."""
    file, _, name = function.partition(".")
    return getattr(_FILES[file], f"_{name}")


_TABLES = tomllib.loads(Path(__file__).with_name("effects.toml").read_text(encoding="utf-8"))

TESTS: Mapping[str, str] = MappingProxyType(_TABLES.pop("tests"))
"""What makes a covariate or channel serve."""

STEPS: Mapping[str, Sequence[Mapping[str, str]]] = MappingProxyType(_TABLES.pop("steps"))
"""Steps of a campaign, by what an effect may ask for: what becomes of the reference's columns."""


def _effect(id: str, table: dict[str, Any], common: Mapping[str, Any]) -> Effect:
    parameters = {
        key: Parameter(**{"name": key, **given})
        for key, given in {**common, **table.pop("parameters", {})}.items()
    }
    forms = tuple(_form(name, given, parameters) for name, given in table.pop("forms", {}).items())
    advice = _named(table.pop("advice")) if "advice" in table else None
    if "remedy" in table:
        advice = partial(_measure_anew, table.pop("remedy"))
    return Effect(id=id, advice=advice, forms=forms, **_frozen(table))


def _form(name: str, table: dict[str, Any], parameters: Mapping[str, Parameter]) -> Form:
    own = tuple(parameters[key] for key in table.pop("parameters"))
    apply = partial(_named(table.pop("apply")), **table.pop("given", {}))
    return Form(name=name, parameters=own, apply=apply, **_frozen(table))


def _frozen(table: Mapping[str, Any]) -> dict[str, Any]:
    return {name: tuple(v) if isinstance(v, list) else v for name, v in table.items()}


def _measure_anew(remedy: str, found: FoundEffect, width_mm: float, thickness_mm: float) -> str:
    """Return what to do where what was printed is as predicted, and what was read is not."""
    return (
        f"{found.id}: the print was right, the measurement was off ({found.text}); the "
        f"palette stays as it is: {remedy}, and diagnose again"
    )


def _with_materials(coordinates: Sequence[float], names: Sequence[str]) -> Mapping[str, Effect]:
    """Return all effects, with the forms of `material-law` for each material."""
    law, apply = _LIBRARY["material-law"], _named("print.material_law")
    forms = tuple(
        replace(
            form,
            name=f"{name} {form.name}",
            equation=form.equation.format(name),
            apply=partial(apply, nodes=coordinates, peak=peak),
        )
        for name, peak in zip(names, np.eye(len(names)), strict=True)
        for form in law.forms
    )
    return MappingProxyType({**_LIBRARY, law.id: replace(law, forms=forms)})


_COMMON = _TABLES.pop("parameters")
_LIBRARY = {id: _effect(id, _TABLES[id], _COMMON) for id in sorted(_TABLES)}
"""The effects by id, that of laws with the forms of any material."""

EFFECTS = _with_materials((0.0, 0.5, 1.0), ("softest", "middle", "hardest"))
"""Every effect by its id, sorted; `material-law` stands for that of a palette of three.
Convention: three show what a form is called."""


def effects_for(palette: Palette) -> Mapping[str, Effect]:
    """Return every effect by its id, sorted, with the forms of a palette's own materials."""
    materials = palette.materials
    return _with_materials([m.coordinate for m in materials], [m.id for m in materials])


def effect_named(id: str, effects: Mapping[str, Effect], option: str) -> Effect:
    """Return an effect by its id.

    Raises
    ------
    UnknownNameError
        There is none; the message names what is near.
    """
    check_known(id, effects, f"{option} {id}: no such effect; {{}}there are", UnknownNameError)
    return effects[id]
