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

from planner.errors import FileError
from planner.formats.tables import LONGEST_HEADING, number
from planner.formats.units import is_unit, quantities_of, unit_factor

__all__ = [
    "LENGTHS",
    "LOADS",
    "MODES",
    "HeadedColumn",
    "Heading",
    "column_of",
    "head_text",
    "heading_of",
    "headings_of",
    "is_figure",
    "is_of_crosshead",
    "marked_specimen",
    "may_be_nearer",
    "mode_of",
    "parse_heading",
    "size_of",
    "split_value",
    "suffice",
]


# ------------------------------------------------------------------------------------------------
# The terms are data, in terms.toml; here stand the words and signs around them.


_SPECIMEN = r"(?:specimen|sample|probe|prüfling|eprouvette|echantillon|probeta|muestra|provino|"
_SPECIMEN += r"campione|test ?piece|試験片|試料|试样|样品|试件)"
_BEFORE = re.compile(
    r"^(?:standard|tensile|compressive|axial|engineering|eng|nomin(?:al|ell?)e?|technische|nenn|zug|druck|"
    r"引張|圧縮|公称|拉伸|压缩|工程|轴向|machine|primary|measured|actual|corrected|raw|applied|"
    r"video|optical|instron|specimen|sample|proben|試験片|试样|test|avg|average|initial)\s*"
)
_BEHIND = re.compile(
    r"\s(?:standard|estandar|axiale?|assiale|nominale?|conventionnelle|ingenieril|ingegneristica|"
    r"absolute?|eprouvette|specimen|probe|provino|probeta|from preload|ab vorkraft|"
    r"(?:de|en|a|por|di|in) (?:traction|traccion|tension|trazione|compression|compresion|"
    r"compressione))$"
)
"""Words that tell nothing of the quantity; `engineering` is what a column is that is not `true`."""

_COMPRESSIVE = re.compile(r"compress|compresion|^druck|stauch|圧縮|压缩")
_BRACKET = re.compile(r"[(\[{<]\s*([^()\[\]{}<>]*?)\s*[)\]}>]")
_CHANNEL = re.compile(
    r"\d|ext|lvdt|channel|chan|kanal|canal|voie|load cell|clip|video|dic|sensor|aufnehmer|capteur|"
    r"crosshead|traverse|machine|axial|auto|raw|eng",
    re.IGNORECASE,
)
"""What a bracket without a unit names the source of a column by."""

_NUMBERED_CHANNEL = re.compile(
    r"(?:c|ch|chan|channel|kanal|canal|voie|canale|通道|チャンネル)(?=[\s_.:#\d])[\s_.:#]*\d*[\s_.:-]+",
    re.IGNORECASE,
)
_SUFFIXED = re.compile(r"(.+)_([^_\s]+)")
_JOINED = re.compile(r"(.+?)\s*(?:[/,;:]|\s(?:in|en)\s)\s*(.+)")
_SPACED = re.compile(r"(.+)\s(\S+)")
_NUMBERED = re.compile(
    rf"(.+?)(?:[\s_.:#-]+(?P<tag>(?:{_SPECIMEN}\s*)?[A-Za-z]{{0,3}}-?\d+|[A-Z])|(?P<number>\d+))",
    re.IGNORECASE,
)
_TAG = re.compile(rf"(?:{_SPECIMEN}[\s_]*)?[\w-]*\d[\w-]*", re.IGNORECASE)
_SYMBOL = re.compile(r"(.+) (?:[abdhls]\s?[0o]|[abhtw])")
"""A size with its symbol in ISO 527: "Probendicke a0"."""

_GAUGE = re.compile(
    r"(?:(?:anfangs)?messl(?:a|ae)nge|gau?ge length)\b(?!.*(?:bruch|break|final|end|after))"
)
"""Which travel or strain it is of may stand behind."""

_MARK = re.compile(
    rf"[#*%\s]*(?:{_SPECIMEN}n?|(?P<test>test(?: run)?|prüfung|versuch|essai|ensayo|prova|kurve|"
    r"curve))[\s-]*(?:(?P<counted>no|nr|n|number|nummer|n°|№)(?!\w)|(?:name|id)\b)?"
    r"\s*(?:(?(test)(?(counted)[.:#]|[.#])|[.:#=_-])+\s*(?P<said>.{1,60})|"
    r"(?P<number>[\w.-]*\d[\w.-]*|[A-Z])(?:\s*(?:of|von|sur|de|di|/)\s*\d+)?)",
    re.IGNORECASE,
)


@functools.lru_cache(maxsize=8192)
def _folded(text: str) -> str:
    """Return a term as it is looked up: without accents, case, underscores and full width."""
    plain = unicodedata.normalize("NFKD", text).casefold()
    bare = "".join(c for c in plain if unicodedata.category(c) != "Mn")
    return re.sub(r"[\s_,]+", " ", bare).strip(" .:=")


_TERMS: Mapping[str, Mapping[str, str]] = tomllib.loads(
    Path(__file__).with_name("terms.toml").read_text(encoding="utf-8")
)
_MEANING, _SIZE, _TEXT, _SPEED, _MODE = (
    {
        _folded(term): meaning
        for meaning, terms in _TERMS[table].items()
        for term in re.split(r",|\n", terms)
        if term.strip()
    }
    for table in ("columns", "sizes", "texts", "speeds", "modes")
)
MODES = tuple(_TERMS["modes"])
"""The ways of loading that are told apart."""


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


_COLUMNS: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "time": ("time_s", "time"),
        "force": ("force_N", "force"),
        "displacement": ("displacement_mm", "length"),
        "position": ("displacement_mm", "length"),
        "strain": ("strain", "strain"),
        "stress": ("stress_MPa", "stress"),
        "stretch": ("stretch", "strain"),
        "true strain": ("true_strain", "strain"),
        "true stress": ("true_stress_MPa", "stress"),
    }
)
_OF = {"time": "s", "force": "N", "length": "mm", "stress": "MPa"}
_UNIT_OPTIONAL = {"strain", "stretch", "true strain"}
_TOLD_BY_UNIT = {
    ("strain", "length"): "displacement",  # an extensometer's travel
    ("elongation", "length"): "displacement",
    ("elongation", "strain"): "strain",
    ("displacement", "strain"): "strain",
    ("force", "stress"): "stress",  # testXpert: "Standardkraft in MPa"
}


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


@dataclass(frozen=True, slots=True)
class HeadedColumn:
    """Canonical column name of a heading, and the factor to its unit."""

    heading: Heading
    name: str
    factor: float


@functools.lru_cache(maxsize=8192)
def parse_heading(text: str) -> Heading | None:
    """Take a heading apart, or return None where it names nothing that is known.

    "Load (lbf)", "Load [lbf]", "force_N", "Load N", "Kraft in N", "Kraft / N", "C_1_Force[kN]",
    "Load (5 kN cell) [N]", "S1_force_N" and a bare "Load" are understood.
    """
    if len(text) > LONGEST_HEADING:
        return None
    plain = " ".join(unicodedata.normalize("NFKC", text).split())
    brackets, name = list[str](), plain
    while inner := _BRACKET.findall(name):  # one within another, as WaveMatrix writes them
        brackets, name = inner + brackets, _BRACKET.sub(" ", name)
    name = " ".join(name.split()) or plain
    found = _parse(_NUMBERED_CHANNEL.sub("", name, count=1)) or _tagged(name)
    if found is None:
        return None
    meaning, unit, tag = found
    for bracket in reversed(brackets):
        stated = is_unit(bracket) and not (bracket.isdigit() and meaning not in _UNIT_OPTIONAL)
        if stated or not (_CHANNEL.search(bracket) or _looked_up(bracket, _MEANING)):
            unit = bracket
            if stated:
                break
    compressed = _COMPRESSIVE.search(_folded(name)) is not None
    return Heading(text, meaning, unit, tag, compressed)


def _parse(name: str) -> tuple[str, str | None, str] | None:
    """Return meaning, unit and tag of a heading without brackets."""
    if (meaning := _looked_up(name, _MEANING)) is not None:
        return meaning, None, ""
    suffixed = _SUFFIXED.fullmatch(name)
    if suffixed and not suffixed[2].isdigit():
        meaning = _looked_up(suffixed[1], _MEANING)
        if meaning is not None and (is_unit(suffixed[2]) or not _CHANNEL.search(suffixed[2])):
            return meaning, suffixed[2], ""
    for pattern in (_JOINED, _SPACED):
        match = pattern.fullmatch(name)
        # Only a known unit: a "Load cell" and a "Time stamp" are no columns.
        if match and is_unit(match[2]) and not match[2].isdigit():
            inner = _parse(match[1])
            if inner is not None:
                return inner[0], match[2], inner[2]
    numbered = _NUMBERED.fullmatch(name)
    if numbered:
        inner = _parse(numbered[1])
        if inner is not None and not inner[2]:
            return inner[0], inner[1], numbered["tag"] or numbered["number"]
    return None


def _tagged(name: str) -> tuple[str, str | None, str] | None:
    """Return meaning, unit and tag of a heading with the specimen's in front: "S1_force_N"."""
    for gap in re.finditer(r"[\s_:./|-]+", name):
        tag = name[: gap.start()]
        inner = _parse(name[gap.end() :]) if _TAG.fullmatch(tag) else None
        if inner is not None:
            return inner[0], inner[1], tag
    return None


def column_of(heading: Heading, *, where: str) -> HeadedColumn:
    """Return the canonical column of a heading, with the factor to its unit.

    Raises
    ------
    FileError
        The unit is missing where one is needed, or is unknown.
    """
    where = f"{where}, column {heading.text!r}"
    meaning, unit = heading.meaning, heading.unit
    kinds = quantities_of(unit or "")
    told = [other for (of, kind), other in _TOLD_BY_UNIT.items() if of == meaning and kind in kinds]
    if told and not (meaning in _COLUMNS and _COLUMNS[meaning][1] in kinds):
        meaning = told[0]
    elif meaning == "elongation":
        if unit is None:
            raise FileError(
                f"{where}: no unit, so that it may be a length or a strain; write it in the "
                f"heading, as '{heading.text} (mm)' or '{heading.text} (%)'"
            )
        meaning = "displacement"
    name, quantity = _COLUMNS[meaning]
    if unit is None and meaning not in _UNIT_OPTIONAL:
        raise FileError(
            f"{where}: no unit; write it in the heading, as '{heading.text} ({_OF[quantity]})'"
        )
    return HeadedColumn(heading, name, unit_factor(quantity, unit or "", where=where))


LENGTHS = {"displacement", "position", "elongation", "strain", "stretch", "true strain"}
LOADS = {"force", "stress", "true stress"}
"""What a record has one of each of."""


def heading_of(cell: str) -> Heading:
    """Take a heading apart; of a cell that is not understood the meaning is ""."""
    return parse_heading(cell) or Heading(cell, "", None)


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
    if len(cell) > LONGEST_HEADING:
        return
    plain = " ".join(unicodedata.normalize("NFKC", cell).split()).rstrip(" :=")
    unit = next((b for b in reversed(_BRACKET.findall(plain)) if is_unit(b)), "")
    name = " ".join(_BRACKET.sub(" ", plain).split()).rstrip(" :=")
    for pattern in () if unit else (_SUFFIXED, _JOINED, _SPACED):
        match = pattern.fullmatch(name)
        if match and is_unit(match[2]) and not match[2].isdigit():
            name, unit = match[1], match[2]
            break
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


def size_of(cell: str) -> tuple[str | None, str, str]:
    """Return the size that a cell beside the columns names, its unit or "", and its number or "".

    A size as width_mm, or rate_mm_s, the crosshead's speed. "Width 2" has the number 2: one of
    several readings.
    """
    unit = ""
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
    return None, unit, ""


def is_of_crosshead(heading: str) -> bool:
    """Say whether a column is the machine's own way, which a nearer sensor's goes before."""
    return _CROSSHEAD.search(_folded(heading)) is not None


def may_be_nearer(heading: str) -> bool:
    """Say whether a column that is not understood may be a sensor's, or a strain of the gauge."""
    folded = _folded(heading)
    return _NEARER.search(folded) is not None and _OTHERWISE.search(folded) is None


_NEARER = re.compile(
    r"strain|dehn|exten|verlang|laser|video|\b(?:ave|dic|lve|d ?l)\b|[δ∆]l|\beps|ε|elong|deform|"
    r"allong|allung|ひすみ|伸|应变"
)
_OTHERWISE = re.compile(
    r"quer|lateral|transv|width|breite|rate\b|speed|soll|command|setpoint|target|plastic|shear|error|"
    r"exx|epsx"
)
_CROSSHEAD = re.compile(
    r"crosshead|travers|stroke|machine|maschine|actuator|cabezal|cruceta|kolben|ストローク|"
    r"クロスヘット|横梁|夹头|十字头"
)


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
