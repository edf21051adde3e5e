"""A lab's tensile tests: files and list of specimens to curves grouped by material."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType

from planner.errors import ArgumentError, FileError
from planner.formats.tensile import Specimen, TensileTable, read_specimens, read_tensile
from planner.formats.tensile.specimens import is_specimens_file
from planner.materials.curve import Curve
from planner.measurement.conversion import (
    Dimensions,
    curve_of,
    dimensions_of,
    states_no_strain_unit,
)
from planner.measurement.replicates import materials_by_name

__all__ = ["Study", "read_study"]

SPECIMENS = "specimens.csv"
_SUFFIXES = (".csv", ".txt", ".log", ".tsv")


@dataclass(frozen=True, slots=True)
class Study:
    """Curves by material.

    Attributes
    ----------
    groups
        Loading curves to break by material, in the order of specimens.csv or of the files.
    specimens
        Rows of specimens.csv by specimen; empty without one.
    notes
        What was corrected, assumed or left out, one sentence each.
    dimensions
        Size and crosshead rate by specimen, whichever source they come from.
    """

    groups: Mapping[str, tuple[Curve, ...]]
    specimens: Mapping[str, Specimen]
    notes: tuple[str, ...]
    dimensions: Mapping[str, Dimensions] = field(default_factory=dict)


def read_study(
    paths: Iterable[str | Path],
    *,
    specimens: str | Path | None = None,
    material: str | None = None,
    width_mm: float | None = None,
    thickness_mm: float | None = None,
    gauge_mm: float | None = None,
    columns: Sequence[str] | None = None,
) -> Study:
    """Read tensile tests and group them by material.

    Parameters
    ----------
    paths
        Tensile files, or folders of them. A list of specimens among them, or named
        specimens.csv beside them, says what each one is.
    specimens
        The list of specimens, if it is elsewhere.
    material
        What all specimens without a row are made of; else the file's head or its name without
        the replicate's number tells ("FLX9760-2.csv", "FLX9760_02.csv", "FLX9760 S2.csv"), which
        is noted.
    width_mm, thickness_mm, gauge_mm
        Size of the specimens that neither a row nor a file's head gives.
    columns
        See `planner.formats.tensile.read_tensile`.

    Raises
    ------
    FileError
        A file that cannot be read or understood, two specimens of one id, an unknown size, or a
        curve that no result should rest on; the message names file, line or specimen.
    ArgumentError
        A size that is not above 0, or no file at all.
    """
    given = _given(width_mm, thickness_mm, gauge_mm)
    files, listing = _files(paths, None if specimens is None else Path(specimens))
    notes: list[str] = []
    rows: dict[str, Specimen] = {}
    if listing is not None:
        rows = {row.specimen: row for row in read_specimens(listing)}
        files = _with_listed(files, rows.values(), listing.parent)
    if not files:
        raise ArgumentError("no tensile file; name files, or a folder with files in it")
    by_file: dict[str, list[Specimen]] = {}
    for row in rows.values():
        by_file.setdefault(row.file, []).append(row)
    found: dict[str, tuple[str, Curve]] = {}
    sizes: dict[str, Dimensions] = {}
    unstated: list[str] = []
    for path in files:
        own = by_file.get(_relative(path, listing), [])
        if rows and not own and not _names_specimens(path, rows, columns):
            notes.append(f"{path.name}: not named in {SPECIMENS}; left out")
            continue
        for table in read_tensile(path, columns=columns):
            row_of_table = _row(table, path, own, rows)
            if own and row_of_table is None:
                notes.append(
                    f"{path.name}: specimen {table.specimen} has no row with this file in "
                    f"{SPECIMENS}; left out"
                )
                continue
            name = row_of_table.specimen if row_of_table else _specimen_name(path, table)
            if name in found:
                raise FileError(
                    f"{path.name}: specimen {name!r} was read from {found[name][0]} already; "
                    f"rename one, or give each its id in {SPECIMENS}"
                )
            if row_of_table is not None and _left_out(row_of_table, notes):
                continue
            sizes[name] = dimensions_of(row_of_table, given, table)
            curve = curve_of(
                table,
                specimen=name,
                material=row_of_table.material if row_of_table else material or _material(table),
                dimensions=sizes[name],
            )
            found[name] = (path.name, curve)
            if states_no_strain_unit(table):
                unstated.append(name)
    notes.extend(
        f"specimen {row.specimen}: no curve among the files"
        for row in rows.values()
        if row.specimen not in found and not row.profile and row.protocol in ("", "monotonic")
    )
    if unstated:
        largest = [float(found[name][1].strain[-1]) for name in unstated]
        ends = list(dict.fromkeys([min(largest), max(largest)]))
        notes.append(
            f"strain of {_some(unstated)} has no unit; taken as a fraction, up to "
            f"{' .. '.join(f'{v:.4g}' for v in ends)}, that is "
            f"{' .. '.join(f'{100 * v:.4g}' for v in ends)} %"
        )
    order = {name: place for place, name in enumerate(rows)}
    curves = sorted((c for _, c in found.values()), key=lambda c: order.get(c.specimen, len(order)))
    if not curves:
        raise FileError("no curve to characterise: " + "; ".join(notes))
    curves = _named_by_file(curves, notes)
    groups: dict[str, tuple[Curve, ...]] = {}
    for curve in curves:
        groups[curve.material] = (*groups.get(curve.material, ()), curve)
    notes.extend(dict.fromkeys(note for curve in curves for note in curve.notes))
    return Study(
        MappingProxyType(groups), MappingProxyType(rows), tuple(notes), MappingProxyType(sizes)
    )


def _given(width_mm: float | None, thickness_mm: float | None, gauge_mm: float | None) -> Specimen:
    sizes = {"width_mm": width_mm, "thickness_mm": thickness_mm, "gauge_mm": gauge_mm}
    for name, value in sizes.items():
        if value is not None and not 0.0 < value < float("inf"):
            raise ArgumentError(f"{name} is {value:g}; a size must be a number above 0")
    return Specimen("", width_mm=width_mm, thickness_mm=thickness_mm, gauge_mm=gauge_mm)


def _files(paths: Iterable[str | Path], listing: Path | None) -> tuple[list[Path], Path | None]:
    """Tensile files in the order given, and the list of specimens."""
    files: list[Path] = []
    for path in map(Path, paths):
        if path.is_dir():
            inside = sorted(p for p in path.iterdir() if p.suffix.casefold() in _SUFFIXES)
            if path / SPECIMENS in inside and listing in (None, path / SPECIMENS):
                listing = path / SPECIMENS
                # The list says which of a folder's files are tensile records.
                inside = [p for p in inside if p.name == "curves.csv"]
            files.extend(inside)
        elif path.name == SPECIMENS or (path.is_file() and is_specimens_file(path)):
            if listing is not None and listing.resolve() != path.resolve():
                raise FileError(f"{path} and {listing}: two lists of specimens; give one")
            listing = path
        else:
            files.append(path)
    if listing is None:
        beside = {p.parent / SPECIMENS for p in files if (p.parent / SPECIMENS).is_file()}
        if len(beside) > 1:
            raise FileError(
                f"{', '.join(sorted(map(str, beside)))}: several lists of specimens; read the "
                "folders one by one, or name one list"
            )
        listing = next(iter(beside), None)
    return files, listing


def _with_listed(files: list[Path], rows: Iterable[Specimen], folder: Path) -> list[Path]:
    """Add the files that the list names, where only the list or its folder was given."""
    if files:
        return files
    named = list(dict.fromkeys(row.file for row in rows if row.file))
    default = folder / "curves.csv"
    return [folder / name for name in named] or ([default] if default.is_file() else [])


def _relative(path: Path, listing: Path | None) -> str:
    if listing is None:
        return path.name
    try:
        return path.resolve().relative_to(listing.resolve().parent).as_posix()
    except ValueError:
        return path.name


def _names_specimens(
    path: Path, rows: Mapping[str, Specimen], columns: Sequence[str] | None
) -> bool:
    if path.stem in rows:
        return True
    try:
        tables = read_tensile(path, columns=columns)
    except FileError:
        return False
    return any(table.specimen in rows for table in tables)


def _row(
    table: TensileTable, path: Path, own: Sequence[Specimen], rows: Mapping[str, Specimen]
) -> Specimen | None:
    """Return the row of a record: by the file's own column of specimens, else by the file."""
    named = "" if "specimen" in table.metadata else table.specimen
    if not own:
        return rows.get(table.specimen) or rows.get(path.stem)
    if len(own) == 1 and named not in rows:
        return own[0]
    if not named:
        raise FileError(
            f"{path.name}: rows of {_some([row.specimen for row in own])} in {SPECIMENS} name this "
            "file, and no column 'specimen' in it tells them apart; give each its own file"
        )
    return next((row for row in own if row.specimen == named), None)


def _specimen_name(path: Path, table: TensileTable) -> str:
    # A label in the file's head is often the same in all files of a batch.
    return table.specimen if "specimen" not in table.metadata and table.specimen else path.stem


def _material(table: TensileTable) -> str:
    named = table.metadata.get("material")
    return named if isinstance(named, str) else ""


def _named_by_file(curves: Sequence[Curve], notes: list[str]) -> list[Curve]:
    """Give the curves without a material that of their specimen's name, and note it."""
    by_name = materials_by_name([c.specimen for c in curves if not c.material])
    if by_name:
        count = {m: list(by_name.values()).count(m) for m in by_name.values()}
        groups = ", ".join(m if n == 1 else f"{m} ({n} specimens)" for m, n in count.items())
        notes.append(
            f"materials by the files' names: {groups}; give --material or a {SPECIMENS} for others"
        )
    return [c if c.material else replace(c, material=by_name[c.specimen]) for c in curves]


def _some(names: Sequence[str]) -> str:
    return ", ".join(names) if len(names) <= 4 else f"{names[0]} and {len(names) - 1} others"


def _left_out(row: Specimen, notes: list[str]) -> bool:
    if row.profile:
        notes.append(f"specimen {row.specimen}: a graded bar, of no one material; left out")
    elif row.protocol not in ("", "monotonic"):
        notes.append(f"specimen {row.specimen}: protocol {row.protocol}; left out")
    else:
        return False
    return True
