"""What planner says of what is wrong: its exceptions, and the notes that ask for an act.

::

    PlannerError
    ├── FileError            a file cannot be read or understood
    │   ├── MeshError        a mesh that cannot be graded: open, self-crossing, empty
    │   └── PaletteError     a palette or printer file that breaks its schema
    ├── UnknownNameError     a material, printer or palette that nothing is called
    ├── ArgumentError        an option or argument outside what it may be
    │   └── ThinBandError    a gradient with a band thinner than a printed layer
    └── OutputError          the result cannot be written

Every message says what is wrong, where, what was got against what is allowed, and what to do, on
one line that a terminal shows in six rows at most, whatever of a file it quotes.
Arguments of public functions stand in it by their names, between backticks; the command line
shows them as its options (`planner.cli.run`).
A command maps any of them to exit code 2; whatever else escapes is a bug (exit code 70).
"""

import difflib
import math
import operator
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, SupportsFloat

__all__ = [
    "ArgumentError",
    "Caution",
    "FileError",
    "MeshError",
    "OutputError",
    "PaletteError",
    "PlannerError",
    "ThinBandError",
    "UnknownNameError",
    "as_count",
    "as_number",
    "as_texts",
    "check_kind",
    "check_known",
    "did_you_mean",
    "listed",
    "nearest_names",
    "positive",
    "refused",
    "within",
]


_LONGEST = 480
"""Characters of a message: six rows of 80, which a terminal shows at a glance."""

_WORD = 80
"""Characters of a word in a message that is too long; what is longer keeps its two ends."""

_LONG_WORD = re.compile(rf"\S{{{_WORD + 1},}}")


class PlannerError(Exception):
    """Base of all errors that planner raises on purpose; its message is cut to a glimpse."""

    def __init__(self, message: str) -> None:
        super().__init__(_glimpse(message))


def _glimpse(message: str) -> str:
    """Return a message as one printable line of `_LONGEST` characters at most.

    Messages quote files, whose cells and lines may be of any length: long words are cut first,
    then the middle is left out, since place and cause come first and what to do comes last.
    """
    if not message.isprintable():
        message = "".join(
            c if c.isprintable() else " " if c.isspace() else repr(c)[1:-1] for c in message
        )
    if len(message) > _LONGEST:
        message = _LONG_WORD.sub(lambda word: _ends(word[0], _WORD), message)
    return _ends(message, _LONGEST)


def _ends(text: str, most: int) -> str:
    """Return a text, if too long its first two thirds and its last third."""
    if len(text) <= most:
        return text
    last = (most - 3) // 3
    return f"{text[: most - 3 - last]}...{text[-last:]}"


class FileError(PlannerError):
    """A file that cannot be read or understood."""


class MeshError(FileError):
    """A mesh that cannot be graded, with the place of the fault."""


class PaletteError(FileError):
    """A palette or printer file that breaks its schema; the message names the key."""


class UnknownNameError(PlannerError):
    """A name that stands for nothing, or for more than one thing; the message says what is near."""


class ArgumentError(PlannerError):
    """An option or argument outside what it may be."""


class ThinBandError(ArgumentError):
    """A gradient that has a band thinner than a layer of the printer."""


class OutputError(PlannerError):
    """A result that cannot be written: no permission, no space, or already there."""


@contextmanager
def refused(
    kind: type[PlannerError], place: object, said: str, *caught: type[Exception]
) -> Iterator[None]:
    """Tell what is caught within as an error of planner's, its reason in place of {}."""
    try:
        yield
    except caught as error:
        reason = getattr(error, "strerror", None) or error
        raise kind(f"{place}: {said.replace('{}', str(reason))}") from error


def nearest_names(name: str, known: Iterable[str], least: float = 0.55) -> list[str]:
    """Return up to three of `known` that `name` may be a slip of, nearest first.

    They share with it at least that share of letters.
    """
    folded = {k.casefold(): k for k in known}
    near = difflib.get_close_matches(name.casefold(), folded, n=3, cutoff=least)
    return [folded[f] for f in near]


def did_you_mean(name: str, known: Iterable[str], most: int = 1) -> str:
    """Ask, with a space at the end, whether something near was meant; "" where nothing is near."""
    near = nearest_names(name, known)[:most]
    return f"did you mean {' or '.join(near)}? " if near else ""


def check_known(
    name: object, known: Iterable[str], said: str, kind: type[PlannerError] = ArgumentError
) -> None:
    """Refuse a name that is none of those known: what is near in place of {}, all behind."""
    if name not in (all_ := list(known)):
        before, _, after = said.rpartition("{}")
        raise kind(f"{before}{did_you_mean(str(name), all_)}{after} {', '.join(all_)}")


# ------------------------------------------------------------------------------------------------
# Notes: what was assumed, corrected or left out; and cautions, which ask for an act.


class Caution(str):
    """A note that the user should act on: a figure may be wrong until it is looked at.

    It is a text like any other note, so that files and documents hold both alike; a command line
    shows it as a warning.
    """

    __slots__ = ()


def listed(words: Sequence[str], most: int | None = None, last: str = "and") -> str:
    """Write a list in a sentence, a long one in short."""
    if most is not None and len(words) > most:
        return f"{', '.join(words[:most])} {last} {len(words) - most} more"
    return "".join(words) if len(words) < 2 else f"{', '.join(words[:-1])} {last} {words[-1]}"


# ------------------------------------------------------------------------------------------------
# Arguments as scripts give them, numpy scalars included, as plain numbers.


def as_number(value: SupportsFloat | str, name: str, ends: Sequence[float] = ()) -> float:
    """Return a finite number, where ends are given one between them.

    Raises
    ------
    ArgumentError
        It is none; text and a yes or no are not taken for one.
    """
    try:
        number = math.nan if isinstance(value, (str, bool)) else float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        raise ArgumentError(f"{name} {value!r}: it must be a finite number")
    if ends and not ends[0] < number < ends[1]:
        raise ArgumentError(f"{name} {number:g}: it must be between {ends[0]:g} and {ends[1]:g}")
    return number


def within(value: SupportsFloat, name: str, low: float, high: float) -> float:
    """Return a number from `low` to `high`, the ends included.

    Raises
    ------
    ArgumentError
        It is none.
    """
    number = as_number(value, name)
    if not low <= number <= high:
        raise ArgumentError(f"{name} {number:g}: it must be from {low:g} to {high:g}")
    return number


def check_kind(value: object, kind: type | tuple[type, ...], said: str) -> None:
    """Refuse a value of another kind, and say what to give."""
    if not isinstance(value, kind):
        raise ArgumentError(f"{value!r}: give {said}")


def as_texts(value: str | Iterable[str], name: str) -> tuple[str, ...]:
    """Return one text or several as several.

    Raises
    ------
    ArgumentError
        It is something else.
    """
    with refused(ArgumentError, f"{name} {value!r}", "it must be text, or several", TypeError):
        return (value,) if isinstance(value, str) else tuple(text + "" for text in value)


def positive(value: SupportsFloat | str, name: str) -> float:
    """Return a number above 0 with which one can reckon.

    Raises
    ------
    ArgumentError
        It is none.
    """
    number = as_number(value, name)
    if not number > 0.0:
        raise ArgumentError(f"{name} {number:g}: it must be above 0")
    # Chosen: no figure is near, and the square of a cube, as of the cells in a part, is a double.
    return as_number(number, name, (1e-30, 1e30))


def as_count(value: Any, name: str, most: int, least: int = 1) -> int:
    """Return a whole number from `least` to `most`.

    Raises
    ------
    ArgumentError
        It is none.
    """
    try:
        number = least - 1 if isinstance(value, bool) else operator.index(value)
    except TypeError:
        number = least - 1
    if not least <= number <= most:
        raise ArgumentError(f"{name} {value!r}: it must be a whole number from {least} to {most}")
    return number
