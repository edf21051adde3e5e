"""Where a part comes from: a file, or a mesh in memory."""

import hashlib
from dataclasses import dataclass
from os import PathLike, fspath
from pathlib import Path

import numpy as np

from planner.errors import ArgumentError
from planner.formats.mesh_file import MILLIMETRES, read_mesh, unit_scale_mm
from planner.geometry.part import Part, make_part

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
        return PartSource(made, called, path.name, file.sha256, file.unit, warnings)
    triangles = _triangles(part)
    in_mm = triangles * unit_scale_mm(unit or MILLIMETRES)
    called = _safe(name or "part")
    made = make_part(in_mm, name=called, tray_mm=tray_mm)
    digest = hashlib.sha256(np.ascontiguousarray(triangles).tobytes()).hexdigest()
    return PartSource(made, called, called, digest, unit or MILLIMETRES, made.warnings)


def _triangles(part: object) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    vertices = getattr(part, "vertices", None)
    faces = getattr(part, "faces", None)
    if vertices is None and isinstance(part, tuple) and len(part) == 2:
        vertices, faces = part
    try:
        points = np.asarray(vertices, dtype=np.float64)
        corners = np.asarray(faces, dtype=np.int64)
        if points.ndim != 2 or points.shape[1] != 3 or corners.ndim != 2 or corners.shape[1] != 3:
            raise ValueError
        return points[corners]
    except (TypeError, ValueError, IndexError):
        raise ArgumentError(
            f"a part must be a path, a mesh with vertices (n, 3) and faces (m, 3), or a pair of "
            f"these arrays; got {type(part).__name__}"
        ) from None


def _safe(name: str) -> str:
    """Keep what any file system and any reader of STL headers takes."""
    kept = "".join(c if c.isascii() and (c.isalnum() or c in "._-") else "-" for c in name)
    return kept.strip(".-") or "part"
