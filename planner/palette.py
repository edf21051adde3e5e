"""What a printer can print: materials from softest to hardest, on the coordinate m.

The coordinate m is an index of the mixture (TangoPlus 0, FLX9795 1, VeroWhitePlus 1.5 on the
Connex3), not a volume fraction. A palette is data alone: the laws' mathematics lives in
`planner.materials`.
"""

import hashlib
import itertools
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal, NoReturn

import msgspec

from planner.errors import (
    ArgumentError,
    PaletteError,
    UnknownNameError,
    as_number,
    check_kind,
    check_known,
    did_you_mean,
    refused,
)
from planner.formats.files import decode_toml, read_file, toml_text
from planner.formats.outputs import check_absent, write_whole
from planner.glance import brief, counted, html_of, one_line, plotted, shade

__all__ = [
    "DENSEST_G_CM3",
    "LAW_PARAMETERS",
    "SAME_K",
    "LawParameters",
    "Material",
    "Palette",
    "PaletteFile",
    "Reading",
    "Reference",
    "Temperature",
    "Uncertainty",
    "encode_palette",
    "load_palette",
    "parse_palette",
    "write_palette",
]


LAW_PARAMETERS: Mapping[str, Mapping[str, int | None]] = {
    "linear": {"modulus_MPa": 1},
    "yielding": {"modulus_MPa": 1, "flow_MPa": 1, "hardening_MPa": 1, "sharpness": 1},
    "neo-hookean": {"mu_MPa": 1},
    "yeoh": {"c_MPa": 3},
    "ogden": {"mu_MPa": None, "alpha": None},
    "martins": {"c1": 1, "c2_MPa": 1, "c3": 1, "c4_MPa": 1},
    "ogden-thesis": {"c": 6, "strain_min": 1, "strain_max": 1},
}
"""The models a palette file may name, with the parameters of each, in file units, and the length of
each: a single figure (1), a list (more), or lists of one length among them (None)."""


class _Kept(dict[str, tuple[float, ...]]):
    """A mapping that stays as it is made; all that is done with a dict but changing it works."""

    def _refuse(self, *_: object, **__: object) -> NoReturn:
        raise TypeError("a law's parameters stay as they are; make another LawParameters of them")

    __setitem__ = __delitem__ = __ior__ = clear = pop = popitem = setdefault = update = _refuse

    def __reduce__(self) -> tuple[Any, ...]:
        return _Kept, (dict(self),)  # a copy is else filled item by item


@dataclass(frozen=True, slots=True)
class LawParameters:
    """The name of a constitutive law and its parameters, as a palette file holds them.

    Parameters
    ----------
    model
        A key of `LAW_PARAMETERS`.
    parameters
        Values by symbol, which stay as they are: a palette is read once and known by its hash. A
        single figure becomes a tuple of one.

    Raises
    ------
    ArgumentError
        No such model, or parameters that are not what it takes.
    """

    model: str
    parameters: Mapping[str, tuple[float, ...]]

    def __post_init__(self) -> None:
        object.__setattr__(self, "parameters", _Kept(_parameters(self.model, self.parameters)))

    def stiffened(self, factor: float) -> "LawParameters":
        """Return the law whose stress is `factor` times this one's: its moduli are."""
        by = {name: factor if name.endswith("_MPa") else 1.0 for name in self.parameters}
        parameters = {name: tuple(by[name] * v for v in vs) for name, vs in self.parameters.items()}
        return LawParameters(self.model, parameters)


def _parameters(model: str, given: Mapping[str, Any]) -> dict[str, tuple[float, ...]]:
    """Return a law's parameters in its own order, each a tuple of finite numbers."""
    check_known(model, LAW_PARAMETERS, f"law: model is {model!r}; {{}}it must be one of")
    expected = LAW_PARAMETERS[model]
    takes = f"{model} takes {', '.join(expected)}"
    check_kind(given, Mapping, f"parameters by symbol; {takes}")
    for key in given:
        check_known(key, expected, f"law: unknown key {key!r}; {{}}{model} takes")
    parameters: dict[str, tuple[float, ...]] = {}
    for key, length in expected.items():
        if key not in given:
            raise ArgumentError(f"law: {key!r} is missing; {takes}")
        several = isinstance(given[key], Iterable) and not isinstance(given[key], str)
        values = tuple(given[key]) if several else (given[key],)
        parameters[key] = tuple(as_number(v, f"law: {key}") for v in values)
        if not values or length not in (None, len(values)):
            takes = f"{model} takes {length or 'one or more'}"
            raise ArgumentError(f"law: {key} has {len(values)} values; {takes}")
    lengths = {key: len(parameters[key]) for key, length in expected.items() if length is None}
    if len(set(lengths.values())) > 1:
        raise ArgumentError(f"law: {lengths}: these lists must be of one length")
    return parameters


@dataclass(frozen=True, slots=True)
class Reference:
    """The conditions at which a palette's laws were measured."""

    strain_rate_per_s: float | None = None
    temperature_C: float | None = None
    soak_h: float | None = None
    age_days: float | None = None
    orientation: Literal["x", "y", "z"] | None = None


SAME_K = 2.0
"""Temperatures that near are one: the tolerance of a standard atmosphere (ISO 291, class 2)."""


class Temperature(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """What warming multiplies the stress of grades by, one place each in every list.

    Attributes
    ----------
    coordinate
        Of the grades that were tested at two temperatures or more, rising.
    low_C, high_C
        Between which each was.
    factor
        Its stress at `high_C` over that at `low_C`.
    log_sd
        Standard deviation of ln(factor).
    """

    coordinate: tuple[float, ...]
    low_C: tuple[float, ...]
    high_C: tuple[float, ...]
    factor: tuple[float, ...]
    log_sd: tuple[float, ...]


class Uncertainty(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """How sure a fitted law is.

    Attributes
    ----------
    specimens
        Number of specimens behind the law.
    level
        Nominal coverage of the intervals.
    law_low, law_high
        Ends of the parameters' intervals by symbol, infinite where tests leave a side open.
    basis
        What the intervals rest on.
    nrmse
        Root mean square error over the largest stress.
    held_out_error
        Relative error on specimens that took no part in the fit.
    strain, log_sd
        Standard deviation of ln(secant modulus) of the next print at strains, straight between;
        `Material.modulus_log_sd` where there are none.
    """

    specimens: int
    level: float = 0.95
    law_low: dict[str, tuple[float, ...]] = {}
    law_high: dict[str, tuple[float, ...]] = {}
    basis: str = ""
    r2: float | None = None
    nrmse: float | None = None
    held_out_error: float | None = None
    strain: tuple[float, ...] = ()
    log_sd: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class Reading:
    """What others say of a material's law: intervals hold both, plans use the material's own.

    Attributes
    ----------
    name
        How it was read, as "extensometer".
    modulus_log_sd
        Standard deviation of ln(modulus) about this law.
    """

    name: str
    law: LawParameters
    modulus_log_sd: float = 0.0
    source: str = ""

    __repr__ = brief


_GREY = "#808080"
"""Of a material that states no colour, where another of its palette does."""


@dataclass(frozen=True, slots=True)
class Material:
    """One digital material.

    Attributes
    ----------
    id
        The name that goes into file names and plans: letters, digits, dot, dash, underscore.
    coordinate
        Place on the palette, m; strictly increasing from soft to hard.
    elongation_at_break
        Engineering strain at break.
    law
        The stress-free law that planning and simulation use.
    published
        The law as its source printed it, kept to reproduce the source; never planned with.
    modulus_log_sd
        Standard deviation of ln(modulus): how far a print's stiffness may lie from the law's.
    deformation
        "elastic" (comes back, nearly to the break) or "plastic" (Young's modulus, and yield if
        known).
    uncertainty
        Of the law, where it was fitted to tests.
    readings
        What others say of the law, where sources differ by more than scatter.

    Raises
    ------
    ArgumentError
        A figure that no material has, or an id or colour that cannot be written.
    """

    id: str
    coordinate: float
    elongation_at_break: float
    density_g_cm3: float | None
    law: LawParameters
    aliases: tuple[str, ...] = ()
    colour: str = _GREY
    source: str = ""
    deformation: Literal["elastic", "plastic"] = "elastic"
    modulus_log_sd: float = 0.0
    published: LawParameters | None = None
    uncertainty: Uncertainty | None = None
    readings: tuple[Reading, ...] = ()

    def __post_init__(self) -> None:
        called = f"material {self.id!r}"
        object.__setattr__(self, "aliases", tuple(self.aliases))
        for name in ("coordinate", "elongation_at_break", "density_g_cm3", "modulus_log_sd"):
            if name != "density_g_cm3" or self.density_g_cm3 is not None:
                object.__setattr__(self, name, as_number(getattr(self, name), f"{called}: {name}"))
        for fault in _faults(self):
            raise ArgumentError(f"{called}: {fault}")
        object.__setattr__(self, "colour", self.colour.upper())

    @property
    def laws(self) -> tuple[LawParameters, ...]:
        """Its law, and behind it those of its readings."""
        return self.law, *(reading.law for reading in self.readings)

    def changed(self, laws: Sequence[LawParameters], log_sd: float) -> "Material":
        """Return the material with other `laws`, all of them less sure by `log_sd` of ln(modulus).

        What is told of the fit is of the law before, and goes.
        """

        def wider(*sds: float) -> tuple[float, ...]:
            return tuple(math.hypot(sd, log_sd) for sd in sds)

        law, *others = laws
        (own,), known = wider(self.modulus_log_sd), self.uncertainty
        if known is not None:
            known = Uncertainty(known.specimens, strain=known.strain, log_sd=wider(*known.log_sd))
        readings = tuple(
            replace(one, law=other, modulus_log_sd=wider(one.modulus_log_sd)[0])
            for one, other in zip(self.readings, others, strict=True)
        )
        return replace(self, law=law, modulus_log_sd=own, uncertainty=known, readings=readings)

    @one_line
    def __repr__(self) -> str:
        return (
            f"{self.id}: m {self.coordinate:g}, {self.law.model}, {self.deformation}, breaks at "
            f"strain {self.elongation_at_break:.3g}"
        )


@dataclass(frozen=True, slots=True)
class Palette:
    """Materials from softest to hardest, with the conditions they were measured at.

    Attributes
    ----------
    materials
        Sorted by `Material.coordinate`, at least one.
    base_resins
        What its materials are jetted from; empty means the printer's own resins, or, of materials
        that the printer does not know, themselves.
    hardness
        Nominal Shore A of the printer's rubbers over the coordinate, soft to hard, of mixtures
        that are no material of the palette too; pairs of (coordinate, Shore A), none if unknown.
    temperature
        What warming does to its grades, if tests tell.
    sha256
        Of the file's bytes, so that a plan can say what it was planned with; "" of a palette that
        was made or changed since.

    Raises
    ------
    ArgumentError
        No material, one name for two, or coordinates that do not rise.
    """

    name: str
    materials: tuple[Material, ...]
    reference: Reference = field(default_factory=Reference)
    source: str = ""
    base_resins: tuple[str, ...] = ()
    hardness: tuple[tuple[float, float], ...] = ()
    temperature: Temperature | None = None
    sha256: str = field(default="", init=False)

    def __post_init__(self) -> None:
        said = "give materials, each a Material"
        with refused(ArgumentError, "materials", said, AttributeError, TypeError):
            object.__setattr__(self, "materials", tuple(self.materials))
            _check_names_and_order(self.materials)
        if not self.materials:
            raise ArgumentError("no material; a palette needs at least one")

    _repr_html_ = html_of
    plot = plotted

    @one_line
    def __repr__(self) -> str:
        return (
            f"{self.name}: {counted(len(self.materials), 'material')}, "
            f"{self.materials[0].id} to {self.materials[-1].id}"
        )

    def known_by(self, sha256: str) -> "Palette":
        """Return the palette as that of a file with this hash."""
        made = replace(self)
        object.__setattr__(made, "sha256", sha256)
        return made

    def as_written(self) -> "Palette":
        """Return the palette as its file will be read, so that plans of both are equal."""
        return parse_palette(encode_palette(self), name=self.name)

    def resolve(self, name: str) -> Material:
        """Return the material that `name` stands for.

        An id or alias in any case, or the beginning of exactly one material's id or alias.

        Raises
        ------
        UnknownNameError
            Nothing, or more than one material, is called so; the message names what is near.
        """
        wanted = str(name).strip().casefold()
        names = {m.id: [n.casefold() for n in (m.id, *m.aliases)] for m in self.materials}
        exact = [m for m in self.materials if wanted in names[m.id]]
        begun = [m for m in self.materials if any(n.startswith(wanted) for n in names[m.id])]
        for found in (exact, begun if wanted else []):
            if len(found) == 1:
                return found[0]
        if wanted and begun:
            raise UnknownNameError(
                f"material {name!r} is ambiguous in palette {self.name}: it may be "
                f"{', '.join(m.id for m in begun)}; give more letters"
            )
        ids = [m.id for m in self.materials]
        hint = did_you_mean(wanted, [*ids, *(a for m in self.materials for a in m.aliases)], most=3)
        raise UnknownNameError(
            f"no material {name!r} in palette {self.name}; {hint}it has {', '.join(ids)}"
        )


class _ReadingFile(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    name: str
    law: dict[str, Any]
    modulus_log_sd: float = 0.0
    source: str = ""


class _MaterialFile(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    id: str
    coordinate: float
    elongation_at_break: float
    law: dict[str, Any]
    density_g_cm3: float | None = None
    aliases: list[str] = []
    colour: str = ""
    source: str = ""
    deformation: Literal["elastic", "plastic"] = "elastic"
    modulus_log_sd: float = 0.0
    published: dict[str, Any] | None = None
    uncertainty: Uncertainty | None = None
    reading: list[_ReadingFile] = []


_Span = Annotated[float, msgspec.Meta(ge=0.0, lt=1e9)]


class _ReferenceFile(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    strain_rate_per_s: Annotated[float, msgspec.Meta(gt=0.0, lt=1e9)] | None = None
    temperature_C: Annotated[float, msgspec.Meta(gt=-273.15, lt=1e4)] | None = None
    soak_h: _Span | None = None
    age_days: _Span | None = None
    orientation: Literal["x", "y", "z"] | None = None


class _HardnessFile(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    coordinate: list[float]
    shore_A: list[float]


class PaletteFile(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """What a palette file holds, as far as types say it."""

    schema: int
    name: str
    kind: Literal["palette"]
    material: list[_MaterialFile]
    reference: _ReferenceFile = _ReferenceFile()
    hardness: _HardnessFile | None = None
    temperature: Temperature | None = None
    source: str = ""
    base_resins: tuple[str, ...] = ()


def load_palette(path: str | Path) -> Palette:
    """Read a palette file (TOML).

    Parameters
    ----------
    path
        The file; its keys are in docs/reference/files.md.

    Returns
    -------
    Palette
        Its materials from soft to hard.

    Raises
    ------
    PaletteError
        The file is missing, no TOML, or breaks the schema; the message names the key.

    Examples
    --------
    >>> planner.load_palette("lab.toml").resolve("flx976").id  # doctest: +SKIP
    'FLX9760'
    """
    data = read_file(path, advice="give the path of a palette file (TOML)", error=PaletteError)
    return parse_palette(data, name=str(Path(path)))


_ALLOWED = {"kind": "palette", "deformation": "elastic or plastic", "orientation": "x, y or z"}
"""By key, where only some words are."""


@lru_cache(maxsize=16)  # a command asks for its palette several times
def parse_palette(data: bytes, *, name: str) -> Palette:
    """Make a palette of a palette file's bytes; `name` is what errors call it.

    Raises
    ------
    PaletteError
        See `load_palette`.
    """
    called = f"palette {name}"
    try:
        file = msgspec.convert(decode_toml(data, called, PaletteError), PaletteFile)
    except msgspec.ValidationError as error:
        key = str(error).rpartition(".")[2].strip("`")
        allowed = f"; it may be {_ALLOWED[key]}" if key in _ALLOWED else ""
        raise PaletteError(f"{called}: {error}{allowed}") from error
    if file.schema != 1:
        raise PaletteError(
            f"palette {name}: schema is {file.schema}, this version reads schema 1; "
            "update planner or convert the file"
        )
    with refused(PaletteError, called, "{}", ArgumentError):
        palette = Palette(
            name=file.name,
            materials=tuple(map(_material, file.material)),
            reference=Reference(**msgspec.structs.asdict(file.reference)),
            source=file.source,
            base_resins=file.base_resins,
            hardness=() if file.hardness is None else _hardness(file.hardness),
            temperature=None if file.temperature is None else _temperature(file.temperature),
        )
    if not any(entry.colour for entry in file.material):
        last = max(len(file.material) - 1, 1)
        shaded = (replace(m, colour=shade(k / last)) for k, m in enumerate(palette.materials))
        palette = replace(palette, materials=tuple(shaded))
    return palette.known_by(hashlib.sha256(data).hexdigest())


def _hardness(table: _HardnessFile) -> tuple[tuple[float, float], ...]:
    pairs = tuple(zip(table.coordinate, table.shore_A, strict=False))
    rising = all(a < c and b < d for (a, b), (c, d) in itertools.pairwise(pairs))
    finite = all(math.isfinite(m) and 0.0 < shore < 100.0 for m, shore in pairs)
    if not (len(table.coordinate) == len(table.shore_A) >= 2 and rising and finite):
        raise ArgumentError(
            "hardness: coordinate and shore_A must be lists of one length, two figures or more, "
            "both rising, and Shore A between 0 and 100"
        )
    return pairs


def _temperature(table: Temperature) -> Temperature:
    lists = msgspec.structs.astuple(table)
    rows = [*zip(*lists, strict=False)]
    finite = all(math.isfinite(v) for one in lists for v in one)
    rising = all(a < b for a, b in itertools.pairwise(table.coordinate))
    sound = all(low < high and factor > 0.0 and sd >= 0.0 for _, low, high, factor, sd in rows)
    if not (rows and {len(one) for one in lists} == {len(rows)} and finite and rising and sound):
        raise ArgumentError(
            f"temperature: {', '.join(table.__struct_fields__)} must be lists of "
            "one length, coordinates rising, low_C below high_C, factors above 0, log_sd not below"
        )
    return table


DENSEST_G_CM3 = 25.0
"""Above all materials: osmium has 22.6."""

_LONGEST, _UNSUREST = 50.0, 9.0
"""Above what the most stretchable gels reach, 20 to 30; and of ln(modulus), a factor of 8,000."""


def _faults(material: Material) -> Iterator[str]:
    """Yield what types do not say of a material and is wrong with it."""
    if not (isinstance(material.id, str) and re.fullmatch(r"[A-Za-z0-9._-]+", material.id)):
        yield "the id goes into file names; use letters, digits, '.', '-' and '_'"
    if not all(isinstance(law, LawParameters) for law in material.laws):
        yield "its law must be LawParameters(model, parameters) of planner.palette"
    for key, value, most, such in (
        ("elongation_at_break", material.elongation_at_break, _LONGEST, "a strain: 170 % are 1.7"),
        ("density_g_cm3", material.density_g_cm3, DENSEST_G_CM3, "in g/cm3: 1140 kg/m3 are 1.14"),
    ):
        if value is not None and not 0.0 < value < most:
            yield f"{key} is {value}; it must be above 0 and below {most:g}, {such}"
    for log_sd in (material.modulus_log_sd, *(r.modulus_log_sd for r in material.readings)):
        if not 0.0 <= log_sd < _UNSUREST:
            yield f"modulus_log_sd is {log_sd}; it must be from 0 to {_UNSUREST:g}"
    at = material.uncertainty or Uncertainty(0)
    rising = all(a < b for a, b in itertools.pairwise((-1.0, *at.strain, math.inf)))
    sure = all(0.0 <= v < _UNSUREST for v in at.log_sd)
    if not (len(at.strain) == len(at.log_sd) and rising and sure):
        lists = "strain and log_sd must be lists of one length, strain rising"
        yield f"uncertainty: {lists}, log_sd from 0 to {_UNSUREST:g}"
    if not re.fullmatch(r"#[0-9A-Fa-f]{6}", material.colour):
        yield f"colour is {material.colour!r}; write it as '#RRGGBB'"


def _material(entry: _MaterialFile) -> Material:
    where = f"material {entry.id!r}"
    stated = msgspec.structs.asdict(entry) | {"colour": entry.colour or _GREY}
    stated["law"] = _law(entry.law, where)
    if entry.published is not None:
        stated["published"] = _law(entry.published, f"{where}: published")
    stated["readings"] = tuple(
        Reading(**msgspec.structs.asdict(r) | {"law": _law(r.law, f"{where}: reading")})
        for r in stated.pop("reading")
    )
    return Material(**stated)


def _law(table: Mapping[str, Any], where: str) -> LawParameters:
    given: dict[str, Any] = dict(table)
    with refused(ArgumentError, where, "{}", ArgumentError):
        return LawParameters(given.pop("model", None), given)


def _check_names_and_order(materials: tuple[Material, ...]) -> None:
    seen: dict[str, Material] = {}
    for material in materials:
        for called in (material.id, *material.aliases):
            if (other := seen.setdefault(called.casefold(), material)) is not material:
                raise ArgumentError(
                    f"{called!r} names both {other.id} and {material.id}; ids and aliases must be "
                    "unique"
                )
    for softer, harder in itertools.pairwise(materials):
        if not softer.coordinate < harder.coordinate:
            raise ArgumentError(
                f"coordinate of {harder.id} is {harder.coordinate:g}, not above "
                f"{softer.coordinate:g} of {softer.id}; list materials from soft to hard with "
                "rising coordinates"
            )


# ------------------------------------------------------------------------------------------------
# Palette files: TOML in one canonical form, so that equal palettes are equal bytes.


def encode_palette(palette: Palette) -> bytes:
    """Write a palette as `planner.palette.parse_palette` reads it.

    Keys come in a fixed order, those at their default are left out, figures are rounded to
    `SIGNIFICANT_DIGITS`; UTF-8. `Palette.sha256` is not written: it is the file's own.
    """
    return ("\n".join(_lines(palette)) + "\n").encode("utf-8")


def write_palette(palette: Palette, output: str | Path, *, force: bool = False) -> None:
    """Write a palette file (TOML) whole or not at all.

    Parameters
    ----------
    palette
        Fitted, corrected or read.
    output
        The file; ``-`` prints it, as on the command line.
    force
        Replace a file that is there.

    Raises
    ------
    OutputError
        The file is there already and `force` is false, or the system refused.
    ArgumentError
        It is no palette.

    Examples
    --------
    >>> planner.write_palette(planner.fit(["tests"]).palette, "lab.toml")  # doctest: +SKIP
    """
    check_absent(output, force=force)
    check_kind(palette, Palette, "a Palette, which a fit or a correction has as its `palette`")
    write_whole(output, encode_palette(palette))


def _lines(palette: Palette) -> Iterator[str]:
    head = {"schema": 1, "name": palette.name, "kind": "palette", "source": palette.source or None}
    yield from _table((), head | {"base_resins": palette.base_resins})
    yield from _table(("", "[reference]"), asdict(palette.reference))
    coordinates, shore = zip(*palette.hardness, strict=True) if palette.hardness else ((), ())
    yield from _table(("", "[hardness]"), {"coordinate": coordinates, "shore_A": shore})
    if palette.temperature is not None:
        yield from _table(("", "[temperature]"), msgspec.structs.asdict(palette.temperature))
    for material in palette.materials:
        yield from _toml_material(material)


_STATED = (
    "id", "aliases", "coordinate", "elongation_at_break", "density_g_cm3", "deformation",
    "modulus_log_sd",
)  # fmt: skip


def _toml_material(material: Material) -> Iterator[str]:
    stated = {name: getattr(material, name) for name in _STATED}
    stated |= {"colour": material.colour, "source": material.source or None}
    yield from _table(("", "[[material]]"), stated)
    yield from _toml_law("law", material.law)
    if material.published is not None:
        yield from _toml_law("published", material.published)
    if material.uncertainty is not None:
        sure = msgspec.structs.asdict(material.uncertainty)
        sure["basis"] = sure["basis"] or None
        ends = {key: sure.pop(key) for key in ("law_low", "law_high")}
        yield from _table(("[material.uncertainty]",), sure)
        for key, values in ends.items():
            yield from _table((f"[material.uncertainty.{key}]",), values)
    for reading in material.readings:
        stated = {"modulus_log_sd": reading.modulus_log_sd, "source": reading.source or None}
        yield from _table(("[[material.reading]]",), {"name": reading.name, **stated})
        yield from _toml_law("reading.law", reading.law)


def _toml_law(key: str, law: LawParameters) -> Iterator[str]:
    known = LAW_PARAMETERS[law.model]
    values = {s: v[0] if known[s] == 1 else v for s, v in law.parameters.items()}
    yield from _table((f"[material.{key}]",), {"model": law.model, **values})


def _table(head: Sequence[str], values: Mapping[str, Any]) -> Iterator[str]:
    """Write keys under a heading, those that state something; nothing where none does."""
    if stated := {key: value for key, value in values.items() if value not in (None, ())}:
        yield from (*head, *(f"{key} = {toml_text(value)}" for key, value in stated.items()))
