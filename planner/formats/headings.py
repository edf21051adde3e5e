"""What headings of test exports mean: quantities, sizes, speeds and names in seven languages."""

import functools
import math
import re
import unicodedata
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from planner.errors import FileError
from planner.formats.tables import LONGEST_HEADING, is_unit, number, quantities_of, unit_factor

__all__ = [
    "MODES",
    "HeadedColumn",
    "Heading",
    "column_of",
    "head_text",
    "is_speed",
    "marked_specimen",
    "mode_of",
    "parse_heading",
    "size_of",
    "split_value",
]


# ------------------------------------------------------------------------------------------------
# The terms. A line a language (English, German, French, Spanish, Italian, Japanese, Chinese), as
# Zwick testXpert, Instron Bluehill, Shimadzu Trapezium, MTS TestSuite and others write them.
# Accents and case do not matter, nor do the qualifiers below.


_TERMS = {
    "time": """
        time, elapsed time, test time, total time, running time, timestamp
        zeit, prüfzeit, pruefzeit, testzeit, versuchszeit, messzeit, zeitstempel
        temps, temps écoulé, temps d'essai, durée
        tiempo, tiempo transcurrido, tiempo de ensayo
        tempo, tempo trascorso, tempo di prova
        時間, 経過時間, 試験時間
        时间, 试验时间, 测试时间""",
    "force": """
        force, load, axial load cell, load cell force, load cell reading
        kraft, last, prüfkraft, pruefkraft, kraftaufnehmer
        charge, effort
        carga, fuerza
        carico, forza
        試験力, 荷重, 力, 試験荷重
        力, 试验力, 负荷, 载荷, 荷重, 拉力, 力值, 荷载""",
    "displacement": """
        displacement, disp, extension, travel, crosshead, stroke, distance, deflection,
        crosshead displacement, crosshead extension, crosshead travel, crosshead stroke,
        machine extension, actuator displacement, actuator travel, ram travel
        weg, prüfweg, traversenweg, maschinenweg, kolbenweg, verschiebung, verlängerung,
        verlaengerung, längenänderung, laengenaenderung, standardwegaufnehmer, wegaufnehmer, hub
        déplacement, déplacement traverse, déplacement de la traverse, course
        extensión, desplazamiento, desplazamiento del cabezal, desplazamiento de la cruceta,
        desplazamiento del travesaño, carrera, recorrido
        estensione, spostamento, spostamento traversa, spostamento della traversa, corsa
        ストローク, 変位, クロスヘッド変位, クロスヘッド移動量, 移動量
        位移, 行程, 横梁位移, 夹头位移, 十字头位移""",
    "position": """
        position, crosshead position, absolute crosshead travel, crosshead absolute,
        crosshead travel absolute, grip to grip separation, grip separation,
        crosshead separation
        traversenposition, traversenweg absolut, traverse abs, traverse absolut, werkzeugabstand
        position traverse, position de la traverse, traverse absolue, course traverse absolue,
        écartement entre outils
        posición, posición del cabezal
        posizione, posizione traversa
        位置, クロスヘッド位置
        横梁位置""",
    "elongation": """
        elongation, deformation, deform, extensometer, ext, lvdt, extensometer travel,
        extensometer extension, clip gauge
        dehnung, verformung, längung, dehnungsaufnehmer
        allongement, élongation, déformation, extensomètre
        alargamiento, elongación, deformación, extensómetro
        allungamento, deformazione, estensometro
        伸び, 変形量, 伸び計, 変形, 伸度
        伸长, 伸长量, 变形, 变形量, 引伸计""",
    "strain": """
        strain, ε, stroke strain, e11, exx, eyy, percentage strain, percent strain
        feindehnung
        déformation relative
        deformación unitaria
        deformazione unitaria
        ひずみ, 歪み, 歪, 伸び率, ストロークひずみ
        应变, 伸长率, 延伸率, 变形率""",
    "stress": """
        stress, σ, sigma
        spannung
        contrainte
        esfuerzo, tensión
        sforzo, tensione, sollecitazione
        応力
        应力, 强度""",
    "stretch": """
        stretch, stretch ratio, lambda, λ""",
    "true strain": """
        true strain
        wahre dehnung
        déformation vraie
        deformación verdadera, deformación real
        deformazione vera
        真ひずみ
        真应变, 真实应变""",
    "true stress": """
        true stress
        wahre spannung
        contrainte vraie
        esfuerzo verdadero, esfuerzo real
        tensione vera, sforzo vero
        真応力
        真应力, 真实应力""",
    "specimen": """
        specimen, specimen id, specimen no, specimen number, specimen name, specimen label,
        specimen designation, sample, sample id, sample name, sample no
        probe, probekörper, prüfling, probennummer, probenname, proben-nr, proben nr
        éprouvette, échantillon, n° éprouvette, désignation éprouvette
        probeta, muestra
        provino, campione
        試験片, 試験片名, 試料, 試料名
        试样, 试样编号, 试样号, 试样名称, 样品, 样品编号, 试件""",
}
"""Of a column. `position` counts from anywhere; `elongation` is a length or a strain, by its unit:
languages name both alike."""

_SIZES = {
    "width_mm": """
        width, b0
        breite, probenbreite
        largeur
        anchura, ancho
        larghezza
        幅, 試験片幅
        宽度, 宽, 试样宽度""",
    "thickness_mm": """
        thickness, a0
        dicke, probendicke
        épaisseur
        espesor, grosor
        spessore
        厚さ, 厚み, 試験片厚さ
        厚度, 厚, 试样厚度""",
    "diameter_mm": """
        diameter, d0
        durchmesser, probendurchmesser
        diamètre
        diámetro
        diametro
        直径
        直径, 试样直径""",
    "area_mm2": """
        area, cross section, cross-section, cross sectional area, cross-sectional area,
        result crosssection, s0, initial area, section area
        querschnitt, querschnittsfläche, probenquerschnitt, anfangsquerschnitt
        section, section initiale, surface
        área, sección, sección transversal
        area della sezione, sezione, sezione iniziale
        断面積
        面积, 横截面积, 截面积, 原始横截面积""",
    "gauge_mm": """
        gauge length, gage length, gauge, l0, l0 sw, initial length, initial gauge length,
        extensometer gauge length, extensometer gage length, gage length standard travel
        messlänge, anfangsmesslänge, messlaenge, standardweg ab
        longueur initiale, longueur de référence, longueur utile, base de mesure
        longitud inicial, longitud de referencia, longitud calibrada, longitud de medida
        lunghezza iniziale, lunghezza di riferimento, lunghezza utile, tratto utile
        標点距離, 標点間距離, ゲージ長
        标距, 原始标距, 标距长度, 试样标距""",
    "length_mm": """
        length
        länge, probenlänge
        longueur
        longitud
        lunghezza
        長さ
        长度, 平行长度""",
    "grip_mm": """
        grip separation, grip to grip separation, grip distance, initial grip separation,
        grip to grip separation at the start position, clamping length
        einspannlänge, werkzeugabstand, klemmlänge
        distance entre mors, écartement entre outils
        distancia entre mordazas
        distanza tra le pinze, distanza tra gli afferraggi
        つかみ具間距離, チャック間距離
        夹具间距, 夹距""",
}
"""Of the specimen, outside the columns. Of the last three the first that is there is the length
that travel is divided by."""

_TEXTS = {
    "material": """material, werkstoff, matériau, materiale, 材料, 材質, material name, specimen
        material, 材料名称""",
    "specimen": """
        specimen label, specimen name, specimen id, specimen designation, sample name, sample id,
        name, probenbezeichnung, probenname, probenkennung, nom de l'éprouvette,
        désignation éprouvette, nombre de la probeta, nome del provino, 試験片名, 名前, 試験片番号,
        试样编号, 试样名称, 试样号, specimen number, specimen no, sample no, specimen, sample,
        specimen identifier""",
    "mode": """
        test type, type of test, test mode, loading mode, versuchsart, prüfart, type d'essai,
        tipo de ensayo, tipo di prova, 試験種類, 試験モード, 试验类型""",
}

_SPEEDS = """
    speed, rate, crosshead speed, test speed, testing speed, crosshead rate
    geschwindigkeit, prüfgeschwindigkeit, pruefgeschwindigkeit, traversengeschwindigkeit
    vitesse, vitesse d'essai, vitesse de la traverse
    velocidad, velocidad de ensayo, velocidad del cabezal
    velocità, velocità di prova, velocità della traversa
    試験速度, 速度
    试验速度, 拉伸速度"""
"""Of the crosshead during the test; that of a preload has another name."""

_MODES = {
    "tension": """tension, tensile, uniaxial, uniaxial tension, pulled, ut, zug, zugversuch,
        traction, tracción, trazione, 引張, 拉伸, tensile test""",
    "compression": """compression, compressive, compressed, uniaxial compression, pushed, uc,
        druck, druckversuch, compresión, compressione, 圧縮, 压缩, compression test""",
    "planar": """planar, planar tension, pure shear, ps, reiner schub, cisaillement pur,
        平面拉伸, 純せん断""",
    "equibiaxial": """equibiaxial, equi-biaxial, equibiaxial tension, equal biaxial,
        equibiaxial extension, et, eb, äquibiaxial, équibiaxial, équibiaxiale, 等二軸, 等双轴""",
}
"""How a specimen was loaded."""

_SPECIMEN = r"(?:specimen|sample|probe|prüfling|eprouvette|echantillon|probeta|muestra|provino|"
_SPECIMEN += r"campione|test ?piece|試験片|試料|试样|样品|试件)"
_BEFORE = re.compile(
    r"^(?:standard|tensile|compressive|axial|engineering|eng|nominale?|technische|nenn|zug|druck|"
    r"引張|圧縮|公称|拉伸|压缩|工程|轴向|machine|primary|measured|actual|corrected|raw|applied|"
    r"video|optical|instron|specimen|sample|proben|試験片|试样|test|avg|average|initial)\s*"
)
_BEHIND = re.compile(
    r"\s(?:standard|estandar|axiale?|assiale|nominale?|conventionnelle|ingenieril|ingegneristica|"
    r"absolute?|eprouvette|specimen|probe|provino|probeta|"
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
_SYMBOL = re.compile(r"(.+) [abdhls]\s?[0o]")
"""A size with its symbol in ISO 527: "Probendicke a0"."""

_MARK = re.compile(
    rf"{_SPECIMEN}\s*(?:(?:no|nr|name|id|n°|№)\b)?\s*"
    r"(?:[.:#=_-]+\s*(?P<said>.{1,60})|(?P<number>[\w.-]*\d[\w.-]*))",
    re.IGNORECASE,
)


@functools.lru_cache(maxsize=8192)
def _folded(text: str) -> str:
    """Return a term as it is looked up: without accents, case, underscores and full width."""
    plain = unicodedata.normalize("NFKD", text).casefold()
    bare = "".join(c for c in plain if unicodedata.category(c) != "Mn")
    return re.sub(r"[\s_,]+", " ", bare).strip(" .:=")


def _meanings(table: Mapping[str, str]) -> Mapping[str, str]:
    return {
        _folded(term): meaning
        for meaning, terms in table.items()
        for term in re.split(r",|\n", terms)
        if term.strip()
    }


_MEANING, _SIZE, _TEXT = _meanings(_TERMS), _meanings(_SIZES), _meanings(_TEXTS)
_MODE = _meanings(_MODES)
MODES = tuple(_MODES)
"""The ways of loading that are told apart."""
_SPEED = frozenset(_meanings({"speed": _SPEEDS}))


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
    brackets = _BRACKET.findall(plain)
    name = " ".join(_BRACKET.sub(" ", plain).split()) or plain
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
    unit = next((b for b in reversed(_BRACKET.findall(plain)) if is_unit(b) or "/" in b), "")
    name = " ".join(_BRACKET.sub(" ", plain).split()).rstrip(" :=")
    for pattern in () if unit else (_SUFFIXED, _JOINED, _SPACED):
        match = pattern.fullmatch(name)
        if match and (is_unit(match[2]) or _is_area(match[2])) and not match[2].isdigit():
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


def _is_area(unit: str) -> bool:
    return unicodedata.normalize("NFKC", unit).replace("^", "")[:-1] in ("mm", "cm", "in", "m")


def size_of(cell: str) -> tuple[str | None, str]:
    """Return the size that a cell beside the columns names, as width_mm, and its unit or ""."""
    unit = ""
    for name, unit in _names(cell):
        if (size := _looked_up(name, _SIZE)) is not None:
            return size, unit
    return None, unit


def is_speed(cell: str) -> tuple[bool, str]:
    """Say whether a cell of the head names the crosshead's speed, and give its unit or ""."""
    unit = ""
    for name, unit in _names(cell):
        numbered = _NUMBERED.fullmatch(_folded(name))
        if _folded(name) in _SPEED or (numbered is not None and numbered[1] in _SPEED):
            return True, unit
    return False, unit


def head_text(cell: str) -> str | None:
    """Return which text of the head a cell names: material, specimen, mode or none."""
    for name, _ in _names(cell):
        if (text := _TEXT.get(_folded(name))) is not None:
            return text
    return None


def mode_of(text: str) -> str | None:
    """Return how a specimen was loaded, as its words tell: a key of `_MODES`, or None."""
    return _MODE.get(_folded(text))


def marked_specimen(cell: str) -> str | None:
    """Return the specimen that a cell by itself announces: "1" of "Specimen 1"; else None."""
    match = _MARK.fullmatch(cell.strip()) if len(cell) <= LONGEST_HEADING else None
    return (match["said"] or match["number"]).strip() if match else None
