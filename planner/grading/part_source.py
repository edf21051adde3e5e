"""Where a part comes from: a file, or a mesh in memory."""

import hashlib
import unicodedata
from dataclasses import dataclass
from os import PathLike, fspath
from pathlib import Path

import numpy as np

from planner.arrays import FloatArray, IntArray
from planner.errors import ArgumentError
from planner.formats.mesh_file import MILLIMETRES, canonical_unit, read_mesh, unit_scale_mm
from planner.geometry.part import Part, make_part, part_from_arrays

__all__ = ["PartSource", "open_part"]


@dataclass(frozen=True, slots=True)
class PartSource:
    """A validated part and what a plan says of its origin."""

    part: Part
    name: str
    file: str
    sha256: str
    unit: str
    warnings: tuple[str, ...]


def open_part(
    part: object,
    *,
    unit: str | None = None,
    name: str | None = None,
    tray_mm: tuple[float, float, float] | None = None,
) -> PartSource:
    """Read and validate a part.

    Parameters
    ----------
    part
        Path, mesh with ``vertices`` and ``faces``, or pair (vertices, faces).

    Raises
    ------
    MeshError, FileError
        The file or the mesh cannot be used; the message says where and what to do.
    ArgumentError
        Not a path, mesh or pair; or an unknown unit.
    """
    if isinstance(part, (str, PathLike)):
        path = Path(fspath(part))
        file = read_mesh(path, unit)
        called = _safe(path.stem if name is None else name)
        made = make_part(file.triangles, name=called, tray_mm=tray_mm)
        warnings = (*file.notes, *made.warnings)
        shown = path.name.encode("utf-8", "replace").decode("utf-8")  # any bytes make a name
        return PartSource(made, called, shown, file.sha256, file.unit, warnings)
    vertices, faces = _arrays(part)
    used = canonical_unit(unit or MILLIMETRES)
    called = _safe(name or "part")
    made = part_from_arrays(vertices * unit_scale_mm(used), faces, name=called, tray_mm=tray_mm)
    digest = hashlib.sha256(vertices.tobytes() + faces.tobytes()).hexdigest()
    return PartSource(made, called, called, digest, used, made.warnings)


def _arrays(part: object) -> tuple[FloatArray, IntArray]:
    vertices = getattr(part, "vertices", None)
    faces = getattr(part, "faces", None)
    if vertices is None and isinstance(part, tuple) and len(part) == 2:
        vertices, faces = part
    try:
        return (
            np.ascontiguousarray(vertices, dtype=np.float64),
            np.ascontiguousarray(faces, dtype=np.int64),
        )
    except (TypeError, ValueError):
        raise ArgumentError(
            "a part must be a path, a mesh with vertices (n, 3) and faces (m, 3), or a pair of "
            f"these arrays; got {type(part).__name__}"
        ) from None


def _safe(name: str) -> str:
    """Keep what any file system and any reader of STL headers takes."""
    plain = unicodedata.normalize("NFKD", name)  # an accent becomes a mark of its own
    bare = (c for c in plain if not unicodedata.combining(c))
    kept = "".join(c if c.isascii() and (c.isalnum() or c in "._-") else "-" for c in bare)
    return kept.strip(".-") or "part"
