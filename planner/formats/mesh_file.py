"""Mesh files of any kind as triangles in millimetres."""

import hashlib
import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import numpy as np

from planner.errors import ArgumentError, FileError, MeshError, did_you_mean
from planner.formats.stl import decode_stl, require_finite
from planner.formats.tables import QUANTITY_UNITS
from planner.numerics import Float32Array, FloatArray

__all__ = ["EXTENSIONS", "MILLIMETRES", "canonical_unit", "read_mesh", "unit_scale_mm"]


MILLIMETRES = "mm"

_SCALE_MM: Mapping[str, float] = MappingProxyType(
    {unit: QUANTITY_UNITS["length"][unit] for unit in (MILLIMETRES, "cm", "m", "inch", "ft", "um")}
)
_ALIASES = (
    ("mm", ("millimeter", "millimetre")),
    ("cm", ("centimeter", "centimetre")),
    ("m", ("meter", "metre")),
    ("inch", ("in", "inches", '"')),
    ("ft", ("foot", "feet", "'")),
    # In lower case the micro sign is a mu.
    ("um", ("micron", "micrometer", "micrometre", "\u03bcm")),
)
_ALSO_CALLED = MappingProxyType({alias: unit for unit, known in _ALIASES for alias in known})
_BY_TRIMESH = ("ply", "obj", "off", "glb")
EXTENSIONS = ("stl", "3mf", *_BY_TRIMESH)
"""What `read_mesh` reads, by the ending of the file's name."""


@dataclass(frozen=True, slots=True)
class MeshFile:
    """The triangles of a mesh file.

    Attributes
    ----------
    triangles
        (k, 3, 3) corners in mm, as the file has them: nothing is merged, dropped or turned.
    name
        The file's name without folder and ending.
    sha256
        Of the file's bytes.
    unit
        The unit that the file's figures were taken to be in.
    notes
        What the reader decided or left out, in words.
    """

    triangles: FloatArray
    name: str
    sha256: str
    unit: str
    notes: tuple[str, ...] = ()


def read_mesh(path: str | Path, unit: str | None = None) -> MeshFile:
    """Read STL, 3MF, PLY, OBJ, OFF or GLB.

    All the file's objects are read, each where the file places it.

    Parameters
    ----------
    path
        The file; its ending says what it is.
    unit
        mm, cm, m, inch, ft or um: the unit of the file's figures. By default what the file
        says (3MF), m for GLB as glTF prescribes, and mm for the formats that have none.

    Raises
    ------
    ArgumentError
        No such unit.
    FileError
        No such file, a folder, or not readable.
    MeshError
        Not a mesh that planner reads: wrong ending, damaged, empty, coordinates not finite.
    """
    path = Path(path)
    if unit is not None:
        unit = canonical_unit(unit)
    data = _bytes(path)
    kind = path.suffix.lstrip(".").casefold()
    triangles: Float32Array | FloatArray
    own: str | None = None
    notes: tuple[str, ...] = ()
    if kind == "stl":
        triangles = decode_stl(data, str(path))
    elif kind == "3mf":
        triangles, own, notes = _threemf(data, str(path))
    elif kind in _BY_TRIMESH:
        triangles, own, notes = _trimesh(data, kind, str(path))
    else:
        raise MeshError(
            f"{path}: files ending in {path.suffix or 'nothing'} are not read; convert it to one "
            f"of {', '.join(EXTENSIONS)}"
        )
    if len(triangles) == 0:
        raise MeshError(f"{path}: holds no triangles; export the part again")
    require_finite(triangles, str(path))
    if unit is not None and own is not None and unit != own:
        notes = (*notes, f"read in {unit} as asked, though the file says {own}")
    used = unit or own or MILLIMETRES
    in_mm = np.ascontiguousarray(triangles, dtype=np.float64)
    if used != MILLIMETRES:
        in_mm = in_mm * unit_scale_mm(used)
    return MeshFile(in_mm, path.stem, hashlib.sha256(data).hexdigest(), used, notes)


def canonical_unit(unit: str) -> str:
    """Return the short name of a unit of length.

    Raises
    ------
    ArgumentError
        Nothing is called so; the message says what is near.
    """
    folded = unit.strip().casefold()
    called = _ALSO_CALLED.get(folded, _ALSO_CALLED.get(folded.removesuffix("s"), folded))
    if called in _SCALE_MM:
        return called
    hint = did_you_mean(unit, [*_SCALE_MM, *_ALSO_CALLED])
    raise ArgumentError(
        f"`unit` {unit or repr(unit)}: no such unit; {hint}it may be {', '.join(_SCALE_MM)}"
    )


def unit_scale_mm(unit: str) -> float:
    """Return how many mm a unit of length has.

    Raises
    ------
    ArgumentError
        No such unit.
    """
    return _SCALE_MM[canonical_unit(unit)]


def _bytes(path: Path) -> bytes:
    if path.is_dir():
        raise FileError(f"{path}: is a folder; give a mesh file ({', '.join(EXTENSIONS)})")
    try:
        return path.read_bytes()
    except FileNotFoundError as error:
        hint = did_you_mean(path.name, _files_beside(path)) or "check the name and the folder"
        raise FileError(f"{path}: no such file; {hint.rstrip()}") from error
    except (OSError, ValueError) as error:  # ValueError: a zero byte in the name
        raise FileError(
            f"{path}: cannot be read ({getattr(error, 'strerror', None) or error}); check the file"
        ) from error


def _files_beside(path: Path) -> list[str]:
    try:
        return sorted(entry.name for entry in path.parent.iterdir() if entry.is_file())
    except OSError:
        return []


_Read = tuple[FloatArray, str | None, tuple[str, ...]]


def _threemf(data: bytes, name: str) -> _Read:
    from planner.formats.threemf import decode_threemf

    model = decode_threemf(data, name)
    corners = [item.vertices.astype(np.float64)[item.faces] for item in model.objects]
    triangles = np.concatenate([np.empty((0, 3, 3)), *corners])
    notes = model.remarks
    if len(corners) > 1:
        notes = (*notes, f"holds {len(corners)} placed objects, graded together as one part")
    return triangles, model.unit, notes


def _trimesh(data: bytes, kind: str, name: str) -> _Read:
    import trimesh

    try:
        scene = trimesh.load_scene(io.BytesIO(data), file_type=kind, process=False)
        mesh = scene.to_mesh()
        triangles = np.asarray(mesh.triangles, dtype=np.float64).reshape(-1, 3, 3)
    except Exception as error:  # whatever a parser of foreign bytes may raise
        raise MeshError(
            f"{name}: not a {kind.upper()} file that can be read "
            f"({type(error).__name__}: {error}); export the part again, as STL or 3MF if you can"
        ) from error
    if kind != "glb":
        return triangles, None, ()
    return triangles, "m", ("read in m, the unit of glTF; use --unit if the file keeps another",)
