"""What headings of test exports mean: quantities, sizes, speeds and names in seven languages."""

import functools
import math
import re
import tomllib
import unicodedata
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

from planner.errors import FileError
from planner.formats.tables import LONGEST_HEADING, number
from planner.formats.units import is_unit, quantities_of, unit_factor

__all__ = [
    "LENGTHS",
    "LOADS",
    "MODES",
    "SIGNS",
    "Heading",
    "head_text",
    "heading_of",
    "headings_of",
    "is_figure",
    "marked_specimen",
    "mode_of",
    "size_of",
    "split_value",
    "suffice",
]


# ------------------------------------------------------------------------------------------------
# The terms are data, in terms.toml, and so are the words around them; here stand the signs.


def _words(table: str, name: str) -> list[str]:
    return [word.strip() for word in re.split(r",|\n", _TERMS[table][name]) if word.strip()]


@functools.lru_cache(maxsize=8192)
def _folded(text: str) -> str:
    """Return a term as it is looked up: without accents, case, underscores and full width."""
    plain = unicodedata.normalize("NFKD", text).casefold()
    bare = "".join(c for c in plain if unicodedata.category(c) != "Mn")
    return re.sub(r"[\s_,]+", " ", bare).strip(" .:=")


_TERMS: Mapping[str, Mapping[str, Any]] = tomllib.loads(
    Path(__file__).with_name("terms.toml").read_text(encoding="utf-8")
)
_MEANING, _SIZE, _SYMBOLS, _TEXT, _SPEED, _MODE = (
    {_folded(word): meaning for meaning in _TERMS[table] for word in _words(table, meaning)}
    for table in ("columns", "sizes", "symbols", "texts", "speeds", "modes")
)
MODES = tuple(_TERMS["modes"])
"""The ways of loading that are told apart."""

_BEFORE, _BEHIND = (
    re.compile(form % "|".join(sorted(map(_folded, _words("qualifiers", name)), key=len)[::-1]))
    for name, form in (("before", r"^(?:%s)\s*"), ("behind", r"\s(?:%s)$"))
)
_ANY = {name: "|".join(_words("signs", name)) for name in _TERMS["signs"]}
SIGNS = MappingProxyType({name: re.compile(f"(?:{any_})", re.I) for name, any_ in _ANY.items()})
"""By what cells are known that are no terms; see terms.toml."""

_BRACKET = re.compile(r"[(\[{<]\s*([^()\[\]{}<>]*?)\s*[)\]}>]")
_NUMBERED_CHANNEL = re.compile(
    rf"(?:{_ANY['channel']})(?=[\s_.:#\d])[\s_.:#]*\d*[\s_.:-]+", re.IGNORECASE
)
_SUFFIXED = re.compile(r"(.+)_([^_\s]+)")
_JOINED = re.compile(r"(.+?)\s*(?:[/,;:]|\s(?:in|en)\s)\s*(.+)")
_SPACED = re.compile(r"(.+)\s(\S+)")
_NUMBERED = re.compile(
    rf"(.+?)(?:[\s_.:#-]+(?P<tag>(?:(?:{_ANY['specimen']})\s*)?[A-Za-z]{{0,3}}-?\d+|[A-Z])|"
    r"(?P<number>\d+))",
    re.IGNORECASE,
)
_TAG = re.compile(rf"(?:(?:{_ANY['specimen']})[\s_]*)?[\w-]*\d[\w-]*", re.IGNORECASE)
_SYMBOL = re.compile(r"(.+) (?:[abdhls]\s?[0o]|[abhtw])")
"""A size with its symbol in ISO 527: "Probendicke a0"."""

_GAUGE = re.compile(
    r"(?:(?:anfangs)?messl(?:a|ae)nge|gau?ge length)\b(?!.*(?:bruch|break|final|end|after))"
)
"""Which travel or strain it is of may stand behind."""

_MARK = re.compile(
    rf"[#*%\s]*(?:(?:{_ANY['specimen']})n?|(?P<test>{_ANY['test']}))[\s-]*"
    r"(?:(?P<counted>no|nr|n|number|nummer|n°|№)(?!\w)|(?:name|id)\b)?"
    r"\s*(?:(?(test)(?(counted)[.:#]|[.#])|[.:#=_-])+\s*(?P<said>.{1,60})|"
    r"(?P<number>[\w.-]*\d[\w.-]*|[A-Z])(?:\s*(?:of|von|sur|de|di|/)\s*\d+)?)",
    re.IGNORECASE,
)


def _looked_up(name: str, table: Mapping[str, str]) -> str | None:
    """Return what a name means, qualifiers taken off one by one until it is known."""
    folded = _folded(name)
    while folded not in table:
        bare = _BEHIND.sub("", folded)
        bare = _BEFORE.sub("", folded, count=1) if bare == folded else bare
        if bare == folded:
            return None
        folded = bare
    return table[folded]


# ------------------------------------------------------------------------------------------------
# A column's heading: which quantity, in which unit.


_COLUMNS: Mapping[str, Mapping[str, str]] = _TERMS["quantities"]
"""By meaning: the column, by the quantity that the unit is of; the first where none is stated."""


@dataclass(frozen=True, slots=True)
class Heading:
    """A heading taken apart.

    Attributes
    ----------
    text
        As the file writes it.
    meaning
        A key of the known meanings.
    unit
        None where it is not stated.
    tag
        What tells it from others of the same meaning: ``S1`` of "S1_force_N", ``2`` of "Force.2".
    compressed
        Whether it says that load or travel count in compression.
    """

    text: str
    meaning: str
    unit: str | None
    tag: str = ""
    compressed: bool = False

    @property
    def quantity(self) -> str:
        """What the column is of: of several quantities the one that its unit is of."""
        kinds = quantities_of(self.unit or "")
        choices = _COLUMNS[self.meaning]
        return next((kind for kind in choices if kind in kinds), next(iter(choices)))

    @property
    def is_of_crosshead(self) -> bool:
        """Whether it is of the machine's own way, which a nearer sensor's goes before."""
        return SIGNS["crosshead"].search(_folded(self.text)) is not None

    @property
    def may_be_nearer(self) -> bool:
        """Whether what is not understood may be of a sensor, or a strain of the gauge."""
        nearer, otherwise = (SIGNS[n].search(_folded(self.text)) for n in ("nearer", "otherwise"))
        return nearer is not None and otherwise is None

    def column(self, where: str) -> tuple[str, float]:
        """Return the name of the column, and the factor to its unit.

        Raises
        ------
        FileError
            The unit is missing where one is needed, or is unknown.
        """
        where, quantity = f"{where}, column {self.text!r}", self.quantity
        name = _COLUMNS[self.meaning][quantity]
        if self.unit is None and quantity != "strain":
            unsure = ", so that it may be a length or a strain" * (self.meaning == "elongation")
            units = ("mm", "%") if unsure else (name.rpartition("_")[2],)
            examples = " or ".join(f"'{self.text} ({unit})'" for unit in units)
            raise FileError(f"{where}: no unit{unsure}; write it in the heading, as {examples}")
        return name, unit_factor(quantity, self.unit or "", where=where)


@functools.lru_cache(maxsize=8192)
def heading_of(text: str) -> Heading:
    """Take a heading apart; where it names nothing that is known the meaning is "".

    "Load (lbf)", "Load [lbf]", "force_N", "Load N", "Kraft in N", "Kraft / N", "C_1_Force[kN]",
    "Load (5 kN cell) [N]", "S1_force_N" and a bare "Load" are understood.
    """
    plain = _plain(text)
    brackets, name = list[str](), plain
    while inner := _BRACKET.findall(name):  # one within another, as WaveMatrix writes them
        brackets, name = inner + brackets, _BRACKET.sub(" ", name)
    name = " ".join(name.split()) or plain
    found = _parse(_NUMBERED_CHANNEL.sub("", name, count=1)) or _tagged(name)
    if found is None:
        return Heading(text, "", None)
    meaning, unit, tag = found
    unitless = next(iter(_COLUMNS.get(meaning, ())), "") == "strain"
    for bracket in reversed(brackets):
        stated = is_unit(bracket) and (unitless or not bracket.isdigit())
        if stated or not (SIGNS["source"].search(bracket) or _looked_up(bracket, _MEANING)):
            unit = bracket
            if stated:
                break
    compressed = SIGNS["compressed"].search(_folded(name)) is not None
    return Heading(text, meaning, unit, tag, compressed)


def _plain(text: str) -> str:
    """Return a cell in one width, with single blanks; of what is too long for a heading ""."""
    short = unicodedata.normalize("NFKC", text) if len(text) <= LONGEST_HEADING else ""
    return " ".join(short.split())


def _parse(name: str) -> tuple[str, str | None, str] | None:
    """Return meaning, unit and tag of a heading without brackets."""
    if (meaning := _looked_up(name, _MEANING)) is not None:
        return meaning, None, ""
    suffixed = _SUFFIXED.fullmatch(name)
    if suffixed and not suffixed[2].isdigit():
        meaning = _looked_up(suffixed[1], _MEANING)
        if meaning is not None and (
            is_unit(suffixed[2]) or not SIGNS["source"].search(suffixed[2])
        ):
            return meaning, suffixed[2], ""
    for stem, unit in _apart(name, _JOINED, _SPACED):
        if (inner := _parse(stem)) is not None:
            return inner[0], unit, inner[2]
    numbered = _NUMBERED.fullmatch(name)
    if numbered:
        inner = _parse(numbered[1])
        if inner is not None and not inner[2]:
            return inner[0], inner[1], numbered["tag"] or numbered["number"]
    return None


def _apart(name: str, *patterns: re.Pattern[str]) -> Iterator[tuple[str, str]]:
    """Yield a name and the unit behind it, a known one: "Load cell", "Time stamp" have none."""
    for match in (pattern.fullmatch(name) for pattern in patterns):
        if match and is_unit(match[2]) and not match[2].isdigit():
            yield match[1], match[2]


def _tagged(name: str) -> tuple[str, str | None, str] | None:
    """Return meaning, unit and tag of a heading with the specimen's in front: "S1_force_N"."""
    for gap in re.finditer(r"[\s_:./|-]+", name):
        tag = name[: gap.start()]
        inner = _parse(name[gap.end() :]) if _TAG.fullmatch(tag) else None
        if inner is not None:
            return inner[0], inner[1], tag
    return None


STRAINS = {"strain", "stretch", "true strain", "lagrange strain"}
LENGTHS = {"displacement", "position", "elongation"} | STRAINS
LOADS = {"force", "stress", "true stress"}
"""What a record has one of each of."""


def headings_of(cells: Sequence[str]) -> list[Heading] | None:
    """Return the headings in a row that names a load and a length; None of any other row."""
    if sum(map(bool, cells)) < 2:
        return None
    found = [heading_of("" if is_figure(cell) else cell) for cell in cells]
    return found if suffice(found) else None


def suffice(headings: Iterable[Heading]) -> bool:
    """Say whether there are a load and a length among headings."""
    meanings = {heading.meaning for heading in headings}
    return bool(meanings & LENGTHS and meanings & LOADS)


def is_figure(cell: str) -> bool:
    """Say whether a cell begins as a number does."""
    return cell[:1].isdigit() or (cell[:1] in "+-.," and cell[1:2].isdigit())


# ------------------------------------------------------------------------------------------------
# What stands beside the columns: sizes, speeds, names.


_VALUE = re.compile(r"([+-]?\d[\d.,'\s]*(?:[eE][+-]?\d+)?)\s*([^\d\s]\S*(?:\s\S+)?)?")


def split_value(cell: str, separator: str) -> tuple[float, str] | None:
    """Return the number and the unit in a cell such as "6,00 mm"; None where there is no number."""
    match = _VALUE.fullmatch(cell.strip()) if len(cell) <= LONGEST_HEADING else None
    value = None if match is None else number(match[1].strip(), separator)
    if match is None or value is None or not math.isfinite(value):
        return None
    return value, (match[2] or "").strip("()[] ")


def _names(cell: str) -> Iterator[tuple[str, str]]:
    """Yield the names that a cell such as "Dimension : Width (mm)" may mean, each with its unit."""
    plain = _plain(cell).rstrip(" :=")
    unit = next((b for b in reversed(_BRACKET.findall(plain)) if is_unit(b)), "")
    name = " ".join(_BRACKET.sub(" ", plain).split()).rstrip(" :=")
    if not unit:
        name, unit = next(_apart(name, _SUFFIXED, _JOINED, _SPACED), (name, ""))
    yield name, unit
    group, _, last = name.rpartition(" : ")
    if group:
        yield last, unit
    symbol = _SYMBOL.fullmatch(_folded(last))
    if symbol:
        yield symbol[1], unit
    for part in re.split(r"\s*,\s*|\s+-\s+", last)[:1]:
        if part != last:
            yield part, unit


def size_of(cell: str, *, symbols: bool = False) -> tuple[str | None, str, str]:
    """Return the size that a cell beside the columns names, its unit or "", and its number or "".

    A size as width_mm, or rate_mm_s, the crosshead's speed. "Width 2" has the number 2: one of
    several readings. `symbols` takes "w" for a width too, if its unit is of length or not there.
    """
    name = unit = ""
    for name, unit in _names(cell):
        numbered = _NUMBERED.fullmatch(_folded(name))
        stem, count = (numbered[1], numbered["tag"] or numbered["number"]) if numbered else ("", "")
        speed = _SPEED.get(_folded(name)) or _SPEED.get(stem)
        gauge = "gauge_mm" if _GAUGE.match(_folded(name)) else None
        if (size := _looked_up(name, _SIZE) or speed or gauge) is not None:
            of_area = _folded(name) == "a0" and "area" in quantities_of(unit)
            return "area_mm2" if of_area else size, unit, ""
        size = _looked_up(stem, _SIZE) if len(stem) > 1 and count.isdigit() else None
        if size in ("width_mm", "thickness_mm", "diameter_mm"):
            return size, unit, count
    is_symbol = symbols and (not unit or "length" in quantities_of(unit))
    return _SYMBOLS.get(_folded(name)) if is_symbol else None, unit, ""


def head_text(cell: str) -> str | None:
    """Return which text of the head a cell names: material, specimen, mode or none."""
    for name, _ in _names(cell):
        if (text := _TEXT.get(_folded(name))) is not None:
            return text
    return None


def mode_of(text: str) -> str | None:
    """Return how a specimen was loaded, as its words tell: one of `MODES`, or None."""
    return _MODE.get(_folded(text))


def marked_specimen(cell: str) -> str | None:
    """Return the specimen that a cell by itself announces: "1" of "Specimen 1"; else None."""
    match = _MARK.fullmatch(cell.strip()) if len(cell) <= LONGEST_HEADING else None
    return (match["said"] or match["number"]).strip() if match else None
