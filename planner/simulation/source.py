"""What is to be pulled: a plan, a profile file, a material's coupon, or a bar as it is."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planner.errors import FileError, UnknownNameError
from planner.palette import Material, Palette, load_palette
from planner.plan import Plan, plan_file, read_plan
from planner.printers import Printer
from planner.printers import printer as load_printer
from planner.simulation.bar import Bar, bar_between, coupon
from planner.simulation.profile_file import read_profile_bar
from planner.simulation.sections import plan_sections

__all__ = ["D638_TYPE_IV", "Section", "Source", "open_source"]


@dataclass(frozen=True, slots=True)
class Section:
    """Size of a bar where its source has none."""

    width_mm: float
    thickness_mm: float
    gauge_mm: float


D638_TYPE_IV = Section(width_mm=6.0, thickness_mm=4.0, gauge_mm=33.0)
"""The narrow section of ASTM D638's specimen for soft materials."""


@dataclass(frozen=True, slots=True)
class Source:
    """A bar, and where it came from."""

    name: str
    bar: Bar
    palette: Palette
    notes: tuple[str, ...] = ()


def open_source(
    source: object,
    *,
    palette: str | Path | Palette | None,
    printer: str | Printer | None,
    slices: int,
    section: Section,
    between_mm: tuple[float, float] | None,
) -> Source:
    """Make the bar that a source describes.

    Parameters
    ----------
    source
        Path of a plan.json, its folder or a profile (``.csv``); a material's name; or a `Plan`,
        `Material` or `Bar`.
    palette, printer
        By default those of the plan, else the Connex3 and its own palette.
    slices
        Slices over a plan's axis or a profile.
    between_mm
        Only what lies between these places along the axis.

    Raises
    ------
    PlannerError
        Nothing is called so, or it is no bar; the message says what to give.
    """
    if isinstance(source, Plan):
        return _of_plan(source, Path(), palette, printer, slices, between_mm)
    if isinstance(source, (str, Path)) and _is_plan(Path(source)):
        file = plan_file(source)
        return _of_plan(read_plan(file), file.parent, palette, printer, slices, between_mm)
    chosen = _palette(palette, printer)
    name, bar = _bar(source, chosen, slices, section)
    return Source(name, bar_between(bar.edges_mm, bar.coordinate, bar.area_mm2, between_mm), chosen)


def _is_plan(path: Path) -> bool:
    return path.suffix.casefold() == ".json" or path.is_dir()


def _bar(source: object, palette: Palette, slices: int, section: Section) -> tuple[str, Bar]:
    if isinstance(source, Bar):
        return "bar", source
    if not isinstance(source, Material):
        path = Path(str(source))
        if path.suffix.casefold() == ".csv":
            bar = read_profile_bar(
                path,
                palette,
                slices=slices,
                width_mm=section.width_mm,
                thickness_mm=section.thickness_mm,
            )
            return path.name, bar
        if path.is_file():
            raise FileError(
                f"{path}: is no plan and no profile; give a plan.json or its folder (planner grade "
                "makes one), a profile (.csv), or a material"
            )
        try:
            source = palette.resolve(str(source))
        except UnknownNameError as error:
            raise UnknownNameError(f"{error}; nor is {path} a file or folder") from error
    bar = coupon(
        source.coordinate,
        width_mm=section.width_mm,
        thickness_mm=section.thickness_mm,
        gauge_mm=section.gauge_mm,
    )
    return source.id, bar


def _of_plan(
    plan: Plan,
    folder: Path,
    palette: str | Path | Palette | None,
    printer: str | Printer | None,
    slices: int,
    between_mm: tuple[float, float] | None,
) -> Source:
    if palette is None:
        try:
            chosen = _palette(plan.palette.name, plan.printer if printer is None else printer)
        except UnknownNameError as error:
            raise UnknownNameError(
                f"{error}; the plan was made with palette {plan.palette.name}: give its file with "
                "--palette"
            ) from error
    else:
        chosen = _palette(palette, printer)
    notes = []
    if chosen.sha256 != plan.palette.sha256:
        notes.append(
            f"palette {chosen.name} is not the one that the plan was made with; its laws are used"
        )
    edges_mm, coordinate, area_mm2 = plan_sections(folder, plan, chosen, slices=slices)
    bar = bar_between(edges_mm, coordinate, area_mm2, between_mm)
    if float(np.sqrt(bar.area_mm2.max())) > bar.gauge_mm:
        notes.append(
            "the part is wider than it is long along the gradient: sections do not stay plane, and "
            "forces are a rough guide"
        )
    return Source(plan.part.file, bar, chosen, tuple(notes))


def _palette(palette: str | Path | Palette | None, printer: str | Printer | None) -> Palette:
    if isinstance(palette, Palette):
        return palette
    if palette is not None and (str(palette).endswith(".toml") or Path(palette).is_file()):
        return load_palette(palette)
    machine = load_printer(printer or "connex3")
    return machine.palette(None if palette is None else str(palette))
