"""A field as a user writes it: NAME: arguments, or min, max, blend, clamp of such."""

import re
from collections.abc import Callable, Mapping
from types import MappingProxyType

from planner.errors import ArgumentError, nearest_names
from planner.geometry.fields import Field
from planner.geometry.fields.composed import BlendField, ClampField, MaximumField, MinimumField
from planner.geometry.fields.function import FunctionField
from planner.grading.field_kinds import KINDS, Setting

__all__ = ["build_field"]

_COMPOSED = re.compile(r"^\s*(\w+)\s*\((.*)\)\s*$", re.DOTALL)
_NAMED = re.compile(r"^\s*([\w-]+)\s*(?::(.*))?$", re.DOTALL)
_DEEPEST = 20


def build_field(wish: object, setting: Setting) -> Field:
    """Build a field over a placed part.

    Parameters
    ----------
    wish
        Text such as ``radial: point=0 0 5, to=12`` or ``min(axis: x; distance: surface)``; a
        `Field` in the coordinates of the placed part; or a function of points (n, 3) in the
        part's own coordinates.
    setting
        The part, where it was placed, and the pitch.

    Raises
    ------
    ArgumentError
        No such field, or arguments that it does not take; the message says what is near.
    """
    if isinstance(wish, str):
        return _parse(wish, setting, 0)
    if isinstance(wish, Field):
        return wish
    if callable(wish):
        return FunctionField(wish, setting.origin_mm)
    raise ArgumentError(
        f"field is a {type(wish).__name__}; give text, a planner Field, or a function of points"
    )


def _parse(text: str, setting: Setting, depth: int) -> Field:
    if depth > _DEEPEST:
        raise ArgumentError(f"--field: fields are nested deeper than {_DEEPEST}")
    composed = _COMPOSED.match(text)
    if composed and composed[1] in _RULES:
        return _RULES[composed[1]](_parts(composed[2]), text, setting, depth + 1)
    named = _NAMED.match(text)
    name = named[1] if named else text.split("(")[0].split(":")[0].strip()
    if named is None or name not in KINDS:
        known = [*KINDS, *_RULES]
        near = nearest_names(name, known)
        hint = f"did you mean {near[0]}? " if near else ""
        raise ArgumentError(
            f"--field {text.strip()!r}: there is no field {name!r}; {hint}there are "
            f"{', '.join(KINDS)}, and {', '.join(_RULES)} of such, as in min(axis: x; axis: y)"
        )
    return KINDS[name](named[2] or "", setting)


def _parts(text: str) -> list[str]:
    """Split at semicolons outside parentheses."""
    parts, depth, last = [], 0, 0
    for place, letter in enumerate(text):
        depth += (letter == "(") - (letter == ")")
        if letter == ";" and depth == 0:
            parts.append(text[last:place])
            last = place + 1
    return [*parts, text[last:]]


def _several(parts: list[str], text: str, setting: Setting, depth: int) -> tuple[Field, ...]:
    if len(parts) < 2:
        raise ArgumentError(f"--field {text.strip()!r}: give two or more fields, parted by ;")
    return tuple(_parse(part, setting, depth) for part in parts)


def _minimum(parts: list[str], text: str, setting: Setting, depth: int) -> Field:
    return MinimumField(_several(parts, text, setting, depth))


def _maximum(parts: list[str], text: str, setting: Setting, depth: int) -> Field:
    return MaximumField(_several(parts, text, setting, depth))


def _blend(parts: list[str], text: str, setting: Setting, depth: int) -> Field:
    if len(parts) != 3:
        raise ArgumentError(f"--field {text.strip()!r}: blend takes (field; field; weight 0 to 1)")
    weight = _number(parts[2], text)
    if not 0.0 <= weight <= 1.0:
        raise ArgumentError(f"--field {text.strip()!r}: the weight {weight:g} is not 0 to 1")
    first, second = (_parse(part, setting, depth) for part in parts[:2])
    return BlendField(first, second, weight)


def _clamp(parts: list[str], text: str, setting: Setting, depth: int) -> Field:
    if len(parts) != 3:
        raise ArgumentError(f"--field {text.strip()!r}: clamp takes (field; lowest; highest)")
    low, high = _number(parts[1], text), _number(parts[2], text)
    if not low < high:
        raise ArgumentError(f"--field {text.strip()!r}: {low:g} is not below {high:g}")
    return ClampField(_parse(parts[0], setting, depth), low, high)


def _number(part: str, text: str) -> float:
    try:
        return float(part)
    except ValueError:
        raise ArgumentError(
            f"--field {text.strip()!r}: {part.strip()!r} must be a number"
        ) from None


_RULES: Mapping[str, Callable[[list[str], str, Setting, int], Field]] = MappingProxyType(
    {"min": _minimum, "max": _maximum, "blend": _blend, "clamp": _clamp}
)
