"""What a value shows at a glance: one line of words; in a notebook a small page; a plot."""

import dataclasses
import functools
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import PurePath
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = [
    "as_words",
    "brief",
    "channels",
    "counted",
    "format_interval",
    "format_number",
    "format_range",
    "html_of",
    "in_percent",
    "one_line",
    "outcome",
    "place_text",
    "plotted",
    "shade",
    "sized",
]


_Value = TypeVar("_Value")
_LISTS = (tuple, list, Mapping, bytes)

_MOST = 120
"""Characters of a line. Convention: what a terminal or a cell of a notebook shows unbroken."""


def one_line(told: Callable[[_Value], str]) -> Callable[[_Value], str]:
    """Make a `__repr__` of a method that says in words what a value is and holds.

    The type's name is put before. A value that is not complete, as a debugger shows one whose
    making failed, cannot tell; its type alone stands there then.
    """

    @functools.wraps(told)
    def shown(value: _Value) -> str:
        kind = type(value).__name__
        try:
            return f"<{_cut(f'{kind} {told(value)}', _MOST - 2)}>"
        except Exception:
            return f"<{kind}, not complete>"

    return shown


@one_line
def brief(value: Any) -> str:
    """Return the `repr` of a dataclass on one line: figures rounded, arrays and lists by size.

    What is None or empty is left out, and so are fields that have no room.
    """
    words, room = [], _MOST - len(f"<{type(value).__name__} , …>")
    for field in dataclasses.fields(value):
        held = getattr(value, field.name)
        if not field.repr or held is None or (isinstance(held, _LISTS) and not held):
            continue
        words.append(f"{field.name}={_short(held)}")
        room -= len(words[-1]) + 2
        if room < 0:
            return ", ".join([*words[:-1], "…"])
    return ", ".join(words)


def channels(colour: str) -> tuple[int, ...]:
    """Return red, green and blue of a colour "#RRGGBB", 0 to 255."""
    return tuple(bytes.fromhex(colour[1:]))


_SHADES = ("#FBD724", "#F89540", "#CC4778", "#7E03A8", "#0D0887")


def shade(fraction: float) -> str:
    """Return a colour between yellow (soft, 0) and blue (hard, 1)."""
    below = min(int(fraction * (len(_SHADES) - 1)), len(_SHADES) - 2)
    part = fraction * (len(_SHADES) - 1) - below
    ends = zip(channels(_SHADES[below]), channels(_SHADES[below + 1]), strict=True)
    return "#" + "".join(f"{round(a + part * (b - a)):02X}" for a, b in ends)


def place_text(place_mm: Iterable[float], digits: int = 4) -> str:
    """Write a place with so many digits: "(1.5, 20, 3) mm"."""
    return f"({', '.join(f'{x:.{digits}g}' for x in place_mm)}) mm"


def sized(lengths: Iterable[float], form: str = ".4g") -> str:
    """Write lengths along the axes, each in a form: "1.5 x 20 x 3"."""
    return " x ".join(f"{length:{form}}" for length in lengths)


def counted(count: int, noun: str) -> str:
    """Return a count in words: "1 material", "3 targets out of reach"."""
    first, _, rest = noun.partition(" ")
    return f"{count} {first}{'' if count == 1 else 's'}{rest and ' ' + rest}"


def format_number(value: float | None, digits: int = 3) -> str:
    """Write a figure with `digits` significant digits, without exponent where it reads well."""
    if value is None:
        return "-"
    if value == 0.0:
        return "0"
    if 1e-4 <= abs(value) < 1e6:
        exponent = int(f"{value:.{digits - 1}e}".split("e")[1])
        return f"{value:.{max(0, digits - 1 - exponent)}f}"
    return f"{value:.{digits - 1}e}"


def format_range(ends: Sequence[float]) -> str:
    """Write the two ends of a range with three significant digits, or the one that they are."""
    return " .. ".join(dict.fromkeys(format_number(end) for end in ends))


def format_interval(ends: Sequence[float]) -> str:
    """Write how sure a figure is; one of no width is of a palette that states no uncertainty."""
    return format_range(ends) if ends[0] < ends[-1] else "unknown"


def in_percent(share: float, sign: str = "") -> str:
    """Return a share in per cent with two digits or all before the point, never as a power."""
    figure = round(100.0 * share, 4)
    return f"{figure:{sign}{'.0f' if abs(figure) >= 99.5 else '.2g'}} %"


def outcome(*wrong: tuple[int, str]) -> str:
    """Return "ok", or what is wrong by count and noun, those that are not 0."""
    return ", ".join(counted(count, noun) for count, noun in wrong if count) or "ok"


_MARKUP = re.compile(r"<(?=[A-Za-z/!?])|(?<=\])\(|\|")
"""What begins an element of Markdown, the address of a link, or a cell of a table."""


def as_words(text: str) -> str:
    """Return text of a file's as words of one line of Markdown, whoever renders it."""
    return _MARKUP.sub(r"\\\g<0>", _on_one_line(text))


def _on_one_line(text: str) -> str:
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def _cut(text: str, most: int) -> str:
    """Return text on one line, without what a terminal takes for a command, long in its middle."""
    line = _on_one_line(text)
    if len(line) <= most:
        return line
    return f"{line[: most // 2]}…{line[len(line) - (most - most // 2 - 1) :]}"


_SHORT = 24
"""Characters of one value: a line holds four or five."""


def _short(value: Any) -> str:
    """Return a field's value in a few letters."""
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, (str, PurePath)):
        return _cut(str(value), _SHORT) or "''"
    if hasattr(value, "shape"):
        return f"[{' x '.join(map(str, value.shape))}]"
    if isinstance(value, tuple) and len(value) <= 3 and all(isinstance(v, float) for v in value):
        return f"({', '.join(map(_short, value))})"
    if isinstance(value, Mapping) and isinstance(value.get("name"), str):
        return _cut(value["name"], _SHORT)
    if isinstance(value, _LISTS):
        return f"[{len(value)}]"
    named = getattr(value, "name", None) or getattr(value, "id", None)
    return _cut(str(named), _SHORT) if isinstance(named, str) else _cut(repr(value), _SHORT)


# ------------------------------------------------------------------------------------------------
# Pages and plots are drawn by `planner.report`, which lies above every value that it draws. These
# two calls are the only ones that go upwards, and only when someone looks.


def html_of(value: Any) -> str:
    """Return what a notebook shows of a value; a class has it as `_repr_html_`."""
    from planner.report import notebook

    return notebook.small_page(value)


def plotted(value: Any, ax: "Axes | None" = None) -> "Axes":
    """Draw a value with matplotlib; return the axes, new ones if none are given.

    Drawn is of a plan the target and achieved stiffness along the field; of a palette, at a strain
    of 0.1, or a scale of stiffness the modulus over the coordinate m; of a pulled bar force over
    displacement, and of a loaded part its load curve; of tests and campaigns every specimen's
    curve; of a diagnosis the error of force before and after. A class has it as `plot`.

    Raises
    ------
    ArgumentError
        matplotlib is not installed.
    """
    from planner.report import notebook

    return notebook.draw(value, ax)
