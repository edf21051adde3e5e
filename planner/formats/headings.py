"""What headings of tensile exports mean: quantities, sizes and speeds in six languages."""

import re
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from planner.errors import FileError
from planner.formats.tables import LONGEST_HEADING, is_unit, quantities_of, unit_factor

__all__ = [
    "HeadedColumn",
    "Heading",
    "column_of",
    "head_text",
    "is_speed",
    "parse_heading",
    "size_of",
]


# ------------------------------------------------------------------------------------------------
# The terms. A line a language (English, German, French, Spanish, Italian, Japanese), as Zwick
# testXpert, Instron Bluehill, Shimadzu Trapezium and MTS TestSuite write them. Accents and case do
# not matter, nor do the qualifiers below.


_TERMS = {
    "time": """
        time, elapsed time, test time, total time, running time
        zeit, prüfzeit, pruefzeit, testzeit, versuchszeit, messzeit
        temps, temps écoulé, temps d'essai, durée
        tiempo, tiempo transcurrido, tiempo de ensayo
        tempo, tempo trascorso, tempo di prova
        時間, 経過時間, 試験時間""",
    "force": """
        force, load
        kraft, last, prüfkraft, pruefkraft
        charge, effort
        carga, fuerza
        carico, forza
        試験力, 荷重, 力""",
    "displacement": """
        displacement, disp, extension, travel, crosshead, stroke, distance,
        crosshead displacement, crosshead extension, crosshead travel
        weg, prüfweg, traversenweg, maschinenweg, kolbenweg, verschiebung, verlängerung,
        verlaengerung, längenänderung, laengenaenderung
        déplacement, déplacement traverse, déplacement de la traverse, course
        extensión, desplazamiento, desplazamiento del cabezal, desplazamiento de la cruceta,
        desplazamiento del travesaño, carrera, recorrido
        estensione, spostamento, spostamento traversa, spostamento della traversa, corsa
        ストローク, 変位, 変形量, クロスヘッド変位, クロスヘッド移動量, 移動量""",
    "position": """
        position, crosshead position, absolute crosshead travel
        traversenposition, traversenweg absolut, traverse abs, traverse absolut
        position traverse, position de la traverse
        posición, posición del cabezal
        posizione, posizione traversa
        位置, クロスヘッド位置""",
    "elongation": """
        elongation, deformation
        dehnung, verformung
        allongement, élongation, déformation
        alargamiento, elongación, deformación
        allungamento, deformazione
        伸び""",
    "strain": """
        strain, ε, stroke strain
        feindehnung
        déformation relative
        deformación unitaria
        deformazione unitaria
        ひずみ, 歪み, 歪, 伸び率, ストロークひずみ""",
    "stress": """
        stress, σ
        spannung
        contrainte
        esfuerzo, tensión
        sforzo, tensione, sollecitazione
        応力""",
    "stretch": """
        stretch, stretch ratio, lambda""",
    "true strain": """
        true strain
        wahre dehnung
        déformation vraie
        deformación verdadera, deformación real
        deformazione vera
        真ひずみ""",
    "true stress": """
        true stress
        wahre spannung
        contrainte vraie
        esfuerzo verdadero, esfuerzo real
        tensione vera, sforzo vero
        真応力""",
    "specimen": """
        specimen, specimen id
        probe, probekörper
        éprouvette
        probeta
        provino
        試験片""",
}
"""Of a column. `position` counts from anywhere; `elongation` is a length or a strain, by its unit:
languages name both alike."""

_SIZES = {
    "width_mm": """
        width
        breite, probenbreite
        largeur
        anchura, ancho
        larghezza
        幅, 試験片幅""",
    "thickness_mm": """
        thickness
        dicke, probendicke
        épaisseur
        espesor, grosor
        spessore
        厚さ, 厚み, 試験片厚さ""",
    "gauge_mm": """
        length, gauge length, gage length
        länge, messlänge, anfangsmesslänge, einspannlänge, probenlänge
        longueur, longueur initiale, longueur de référence, longueur utile
        longitud, longitud inicial, longitud de referencia, longitud calibrada
        lunghezza, lunghezza iniziale, lunghezza di riferimento, lunghezza utile
        標点距離, 標点間距離, ゲージ長, つかみ具間距離""",
}
"""Of the specimen, above the columns."""

_TEXTS = {
    "material": "material, werkstoff, matériau, materiale, 材料, 材質",
    "specimen": """
        specimen label, specimen name, specimen id, probenbezeichnung, probenname,
        nom de l'éprouvette, nombre de la probeta, nome del provino, 試験片名""",
}

_SPEEDS = """
    speed, rate, crosshead speed, test speed, testing speed, crosshead rate
    geschwindigkeit, prüfgeschwindigkeit, pruefgeschwindigkeit, traversengeschwindigkeit
    vitesse, vitesse d'essai, vitesse de la traverse
    velocidad, velocidad de ensayo, velocidad del cabezal
    velocità, velocità di prova, velocità della traversa
    試験速度, 速度"""
"""Of the crosshead during the test; that of a preload has another name."""

_BEFORE = re.compile(
    r"^(?:standard|tensile|axial|engineering|eng|nominale?|technische|nenn|zug|引張|公称)\s*"
)
_BEHIND = re.compile(
    r"\s(?:standard|estandar|axiale?|assiale|nominale?|conventionnelle|ingenieril|"
    r"ingegneristica|(?:de|en|a|por|di|in) "
    r"(?:traction|traccion|tension|trazione))$"
)
"""Words that tell nothing of the quantity; `engineering` is what a column is that is not `true`."""

_BRACKETED = re.compile(r"(.*?)\s*[\(\[]\s*([^()\[\]]*?)\s*[\)\]]\s*")
_SUFFIXED = re.compile(r"(.+)_([^_\s]+)")
_JOINED = re.compile(r"(.+?)\s*(?:[/,;:]|\s(?:in|en)\s)\s*(.+)")
_SPACED = re.compile(r"(.+)\s(\S+)")
_NUMBERED = re.compile(r"(.+?)\s*\d+")
_KEY = re.compile(r"(?:.* : )?(?:specimen )?(.*?)\s*(?:[\(\[](.*)[\)\]])?\s*:?", re.IGNORECASE)
_SYMBOL = re.compile(r"(.+) [abl]\s?[0o]")
"""A size with its symbol in ISO 527: "Probendicke a0"."""


def _folded(text: str) -> str:
    """Return a term as it is looked up: without accents, case, underscores and full width."""
    plain = unicodedata.normalize("NFKD", text).casefold()
    bare = "".join(c for c in plain if unicodedata.category(c) != "Mn")
    return re.sub(r"[\s_]+", " ", bare).strip(" .")


def _meanings(table: Mapping[str, str]) -> Mapping[str, str]:
    return {
        _folded(term): meaning
        for meaning, terms in table.items()
        for term in re.split(r"[,\n]", terms)
        if term.strip()
    }


_MEANING, _SIZE, _TEXT = _meanings(_TERMS), _meanings(_SIZES), _meanings(_TEXTS)
_SPEED = frozenset(_meanings({"speed": _SPEEDS}))


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


@dataclass(frozen=True, slots=True)
class Heading:
    """A heading taken apart: a key of the known meanings, and its unit (None: not stated)."""

    text: str
    meaning: str
    unit: str | None


@dataclass(frozen=True, slots=True)
class HeadedColumn:
    """Canonical column name of a heading, and the factor to its unit."""

    heading: Heading
    name: str
    factor: float


def _meaning(name: str) -> str | None:
    folded = _folded(name)
    bare = _BEHIND.sub("", folded)
    names = (folded, bare, _BEFORE.sub("", bare))
    return next((_MEANING[name] for name in names if name in _MEANING), None)


def parse_heading(text: str) -> Heading | None:
    """Take a heading apart, or return None where it names nothing that is known.

    "Load (lbf)", "Load [lbf]", "force_N", "Load N", "Kraft in N", "Kraft / N" and a bare "Load"
    are understood.
    """
    if len(text) > LONGEST_HEADING:
        return None
    found = _parse(unicodedata.normalize("NFKC", text))
    return None if found is None else Heading(text, *found)


def _parse(text: str) -> tuple[str, str | None] | None:
    bracketed = _BRACKETED.fullmatch(text)
    if bracketed and (meaning := _meaning(bracketed[1])) is not None:
        # "Tensile strain (Strain 1)" names where the strain comes from, not a unit.
        numbered = _NUMBERED.fullmatch(bracketed[2])
        source = _meaning(numbered[1] if numbered else bracketed[2])
        return meaning, bracketed[2] if is_unit(bracketed[2]) or source is None else None
    if (meaning := _meaning(text)) is not None:
        return meaning, None
    if bracketed and (inner := _parse(bracketed[1])) is not None:
        return inner[0], bracketed[2]
    suffixed = _SUFFIXED.fullmatch(text)
    if suffixed and (meaning := _meaning(suffixed[1])) is not None:
        return meaning, suffixed[2]
    for pattern in (_JOINED, _SPACED):
        match = pattern.fullmatch(text)
        # Only a known unit: a "Load cell" and a "Time stamp" are no columns.
        if match and is_unit(match[2]) and (inner := _parse(match[1])) is not None:
            return inner[0], match[2]
    numbered = _NUMBERED.fullmatch(text)
    if numbered and (meaning := _meaning(numbered[1])) in _UNIT_OPTIONAL:
        return meaning, None
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
    if meaning == "elongation":
        length = unit is None or "strain" not in quantities_of(unit)
        meaning = "displacement" if length else "strain"
        if unit is None:
            raise FileError(
                f"{where}: no unit, so that it may be a length or a strain; write it in the "
                f"heading, as '{heading.text} (mm)' or '{heading.text} (%)'"
            )
    name, quantity = _COLUMNS[meaning]
    if unit is None and meaning not in _UNIT_OPTIONAL:
        raise FileError(
            f"{where}: no unit; write it in the heading, as '{heading.text} ({_OF[quantity]})'"
        )
    return HeadedColumn(heading, name, unit_factor(quantity, unit or "", where=where))


# ------------------------------------------------------------------------------------------------
# What stands above the columns.


def _key(cell: str) -> tuple[str, str]:
    """Return the name in a cell such as "Dimension : Width (mm)", and its unit or ""."""
    short = len(cell) <= LONGEST_HEADING
    match = _KEY.fullmatch(unicodedata.normalize("NFKC", cell)) if short else None
    if match is None:
        return "", ""
    name = _folded(match[1])
    symbol = _SYMBOL.fullmatch(name)
    return symbol[1] if symbol else name, match[2] or ""


def size_of(cell: str) -> tuple[str | None, str]:
    """Return the size that a cell of the head names, as width_mm, and its unit or ""."""
    name, unit = _key(cell)
    return _SIZE.get(name), unit


def is_speed(cell: str) -> tuple[bool, str]:
    """Say whether a cell of the head names the crosshead's speed, and give its unit or ""."""
    name, unit = _key(cell)
    numbered = _NUMBERED.fullmatch(name)
    return name in _SPEED or (numbered is not None and numbered[1] in _SPEED), unit


def head_text(cell: str) -> str | None:
    """Return which text of the head a cell names: material, specimen or none."""
    name, _ = _key(cell)
    return _TEXT.get(f"specimen {name}") or _TEXT.get(name)
