"""The Printer protocol, and how installed printers are found.

A printer is an object published under the entry point group ``planner.printers``; planner
imports none by name. `PrinterProfile` is the ready-made implementation, read from a
``printer.toml``; `planner.testing.check_printer` tells a plugin's author what is missing.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Annotated, Literal, Protocol, get_type_hints, runtime_checkable

import msgspec

from planner.errors import (
    ArgumentError,
    FileError,
    PaletteError,
    UnknownNameError,
    check_known,
    listed,
    positive,
    refused,
)
from planner.formats.files import decode_toml
from planner.glance import brief
from planner.palette import Palette, load_palette, parse_palette

__all__ = [
    "Printer",
    "ProfileFile",
    "installed_printers",
    "load_printer",
    "load_profile",
    "palette_of",
    "printer_faults",
]


@runtime_checkable
class Printer(Protocol):
    """What planner asks of a printer. Lengths in mm."""

    @property
    def name(self) -> str:
        """Short name for the command line, as the entry point's."""

    @property
    def title(self) -> str:
        """Name as on the machine."""

    @property
    def tray_mm(self) -> tuple[float, float, float]:
        """Largest part along x, y, z."""

    @property
    def pixel_mm(self) -> tuple[float, float]:
        """Native pitch in the plane."""

    @property
    def layer_mm(self) -> float:
        """Native pitch along z."""

    @property
    def minimum_wall_mm(self) -> float:
        """Thinnest wall that survives."""

    @property
    def minimum_feature_mm(self) -> float:
        """Smallest detail that prints undistorted."""

    @property
    def base_resins(self) -> tuple[str, ...]:
        """The resins in the cabinet that all digital materials are jetted from."""

    @property
    def support(self) -> str:
        """The support resin."""

    @property
    def palettes(self) -> tuple[str, ...]:
        """Names of the palettes it brings, the default first."""

    def palette(self, name: str | None = None) -> Palette:
        """Return a palette by name, or the default one."""

    def operator_name(self, material_id: str) -> str:
        """Return what the printer's own software calls a material."""

    def job_notes(self) -> str:
        """Return the how-to (Markdown) that goes beside the files, for the operator."""


_Length = Annotated[float, msgspec.Meta(gt=0.0, lt=1e9)]
# In mm, and no micrometres or metres: no pitch is above 1 mm, no tray below a centimetre.
_Pitch = Annotated[float, msgspec.Meta(gt=0.0, lt=1.0)]
_Side = Annotated[float, msgspec.Meta(ge=10.0, lt=1e9)]
_Names = Annotated[tuple[str, ...], msgspec.Meta(min_length=1)]


class ProfileFile(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """What a ``printer.toml`` holds. With `like`, what it leaves out is as of that printer."""

    schema: Literal[1]
    name: str
    title: str
    tray_mm: tuple[_Side, _Side, _Side]
    pixel_mm: tuple[_Pitch, _Pitch]
    layer_mm: _Pitch
    minimum_wall_mm: _Length
    minimum_feature_mm: _Length
    base_resins: _Names
    support: str
    palettes: _Names
    operator_names: dict[str, str] = {}
    source: str = ""
    like: str = ""


_LENGTHS = ("tray_mm", "pixel_mm", "layer_mm", "minimum_wall_mm", "minimum_feature_mm")
_SAME_AS_BASE = ("name", "title", *_LENGTHS, "base_resins", "support", "palettes")


@dataclass(frozen=True, slots=True)
class PrinterProfile:
    """A `Printer` described by files: ``printer.toml``, ``palettes/*.toml``, ``job_notes.md``.

    Attributes
    ----------
    folder
        That holds palettes and notes.
    base
        Another printer, whose palettes, notes and names it has instead.
    """

    name: str
    title: str
    tray_mm: tuple[float, float, float]
    pixel_mm: tuple[float, float]
    layer_mm: float
    minimum_wall_mm: float
    minimum_feature_mm: float
    base_resins: tuple[str, ...]
    support: str
    palettes: tuple[str, ...]
    operator_names: Mapping[str, str]
    folder: Traversable
    base: Printer | None = None

    __repr__ = brief

    def palette(self, name: str | None = None) -> Palette:
        """Return a palette by name, or the default one.

        Raises
        ------
        UnknownNameError
            The printer has no palette of that name.
        PaletteError
            The palette's file breaks the schema.
        """
        wanted = self.palettes[0] if name is None else name
        said = f"no palette {wanted!r} for printer {self.name}; {{}}it has"
        check_known(wanted, self.palettes, said, UnknownNameError)
        if self.base is not None:
            return self.base.palette(wanted)
        found = parse_palette(self._beside(f"palettes/{wanted}.toml"), name=wanted)
        if found.name != wanted:  # plans name the palette, and ask for it by that
            raise PaletteError(
                f"printer {self.name}: palettes/{wanted}.toml is of name = {found.name!r}; give "
                "file and palette one name"
            )
        return found

    def operator_name(self, material_id: str) -> str:
        """Return what the printer's own software calls a material."""
        other = material_id if self.base is None else self.base.operator_name(material_id)
        return self.operator_names.get(material_id, other)

    def job_notes(self) -> str:
        """Return the how-to (Markdown) that goes beside the files, for the operator."""
        if self.base is None:
            return self._beside("job_notes.md").decode(errors="replace")
        pairs = ((key, getattr(self, key), getattr(self.base, key)) for key in _LENGTHS)
        other = [f"{key} {own}, not {its}" for key, own, its in pairs if own != its]
        stated = f"\nStated for this plan: {'; '.join(other)}.\n" if other else ""
        return self.base.job_notes() + stated

    def _beside(self, name: str) -> bytes:
        file = self.folder.joinpath(*name.split("/"))
        if not file.is_file():
            raise FileError(
                f"printer {self.name}: {name} is missing beside its printer.toml; "
                "`planner printers new NAME` writes one of each file"
            )
        return file.read_bytes()


def load_profile(folder: Traversable, name: str = "printer.toml") -> PrinterProfile:
    """Read a printer's profile.

    Parameters
    ----------
    folder
        Of its files, as a plugin's package (``importlib.resources.files(__name__)``).
    name
        Of the profile in it. With the key `like`, an installed printer, what the file leaves out is
        as there, palettes included.

    Raises
    ------
    PaletteError
        The profile breaks its schema; the message names the key.
    UnknownNameError
        No printer is called as `like` says.
    """
    broken = OSError, FileError, msgspec.ValidationError
    with refused(PaletteError, f"printer {folder}: {name}", "{}", *broken):
        document = decode_toml((folder / name).read_bytes(), name)
        like = document.get("like")
        base = _installed(like) if isinstance(like, str) else None
        given = {} if base is None else {key: getattr(base, key) for key in _SAME_AS_BASE}
        file = msgspec.convert(given | document, ProfileFile)
    stated = {key: getattr(file, key) for key in (*_SAME_AS_BASE, "operator_names")}
    return PrinterProfile(**stated, folder=folder, base=base)


def installed_printers() -> dict[str, EntryPoint]:
    """List the installed printers; nothing is loaded yet.

    Returns
    -------
    dict
        Their entry points by name, sorted: each says which object of which distribution it is.

    Examples
    --------
    >>> list(planner.installed_printers())  # doctest: +SKIP
    ['connex3']
    """
    return {e.name: e for e in _published()}


def _published() -> list[EntryPoint]:
    return sorted(entry_points(group="planner.printers"), key=lambda e: e.name)


def load_printer(
    name: str | Path | Printer,
    *,
    tray_mm: tuple[float, float, float] | None = None,
    minimum_wall_mm: float | None = None,
    minimum_feature_mm: float | None = None,
) -> Printer:
    """Load a printer.

    Parameters
    ----------
    name
        As `installed_printers` lists it; or a profile file (TOML), see `load_profile`; a printer
        given as such is returned as it is.
    tray_mm, minimum_wall_mm, minimum_feature_mm
        Limits in place of the printer's own.

    Returns
    -------
    Printer
        What planner asks of it, and its palettes.

    Raises
    ------
    ArgumentError
        A limit that is no length above 0, or not as many as there are.
    UnknownNameError
        No printer of that name is installed, or its plugin is not a printer.
    PaletteError
        A file that breaks its schema.

    Examples
    --------
    >>> planner.load_printer("connex3").palette().name  # doctest: +SKIP
    'connex3-tango-vero'
    """
    given = locals()
    stated = {key: given[key] for key in _LENGTHS if given.get(key) is not None}
    machine = name if isinstance(name, Printer) else _found(name)
    if not stated:
        return machine
    for key, lengths in stated.items():
        own, said = getattr(machine, key), "it must be three lengths in mm, along x, y and z"
        with refused(ArgumentError, f"`{key}` {lengths!r}", said, TypeError, ValueError):
            sides = zip(own, lengths, strict=True) if isinstance(own, tuple) else ()
            tray = tuple(positive(side, f"`{key}`") for _, side in sides)
            stated[key] = tray or positive(lengths, f"`{key}`")
    same = {key: getattr(machine, key) for key in _SAME_AS_BASE} | stated
    return PrinterProfile(**same, operator_names={}, folder=Path(), base=machine)


def _found(name: str | Path) -> Printer:
    if isinstance(name, Path) or str(name).endswith(".toml"):
        return load_profile(Path(name).parent, Path(name).name)
    return _installed(name)


def _installed(name: str) -> Printer:
    found = _published()
    said = f"no printer {name!r}; {{}}give its file, as printer.toml, or one that is installed:"
    check_known(name, sorted({e.name for e in found}), said, UnknownNameError)
    plugins = {_origin(e): e for e in found if e.name == name}
    if len(plugins) > 1:
        raise UnknownNameError(
            f"printer {name!r} is published by {listed(sorted(plugins))}; uninstall all but one"
        )
    ((origin, plugin),) = plugins.items()
    try:
        loaded: Printer = plugin.load()
        faults = printer_faults(loaded)
    except Exception as error:  # whatever a plugin of others may raise
        raise UnknownNameError(
            f"printer {name!r}: its plugin {origin} cannot be loaded "
            f"({type(error).__name__}: {error}); reinstall or remove it"
        ) from error
    if not faults and loaded.name != name:  # plans name the printer, and ask for it by that
        faults = [f"name is {loaded.name!r}; give it the entry point's"]
    if faults:
        raise UnknownNameError(
            f"printer {name!r}: {origin} is not a planner.Printer: {'; '.join(faults)}; "
            "run planner.testing.check_printer on it"
        )
    return loaded


def _origin(entry: EntryPoint) -> str:
    return entry.value if entry.dist is None else f"{entry.value} of {entry.dist.name}"


def printer_faults(printer: object) -> list[str]:
    """Return what an object lacks, or has out of range, to be a printer planner can plan for.

    What its members raise is raised.
    """
    if not isinstance(printer, Printer):
        members = (name for name in vars(Printer) if not name.startswith("_"))
        missing = ", ".join(sorted(name for name in members if not hasattr(printer, name)))
        return [f"{type(printer).__name__} lacks of planner.Printer: {missing}"]
    faults = []
    for name, kind in get_type_hints(ProfileFile, include_extras=True).items():
        if hasattr(Printer, name):  # what a file has to say, whoever says it
            try:
                msgspec.convert(getattr(printer, name), kind)
            except msgspec.ValidationError as error:
                faults.append(f"{name} is {getattr(printer, name)!r}: {error}")
    if faults or isinstance(printer, PrinterProfile):  # whose files are read when asked for
        return faults
    given: list[tuple[str, object, type]] = [
        (f"palette({name!r})", printer.palette(name), Palette) for name in printer.palettes
    ]
    given.append(("job_notes()", printer.job_notes(), str))
    return [
        f"{name} is {value!r} and no {kind.__name__}"
        for name, value, kind in given
        if not isinstance(value, kind)
    ]


def palette_of(
    palette: str | Path | Palette | None = None, printer: str | Path | Printer | None = None
) -> Palette:
    """Return the palette that is meant: a value, a file, a name, or the printer's default.

    Parameters
    ----------
    palette
        A name is one of the printer's palettes, unless there is a file of that name.
    printer
        By name or value, asked only where no file is given; the Connex3 by default.

    Raises
    ------
    UnknownNameError, PaletteError
        No such palette or printer, or a file that breaks the schema.
    """
    if isinstance(palette, Palette):
        return palette
    file = Path(str(palette or ""))
    if isinstance(palette, Path) or file.name.endswith(".toml") or file.is_file():
        return load_palette(file)
    return load_printer("connex3" if printer is None else printer).palette(palette)
