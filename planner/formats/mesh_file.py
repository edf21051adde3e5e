"""Mesh files of any kind as triangles in millimetres; STL, also written."""

import contextlib
import hashlib
import io
import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from planner.errors import FileError, MeshError, OutputError, did_you_mean, listed
from planner.formats.files import USUAL_LIMITS, UnfoldingLimits, read_file
from planner.formats.units import QUANTITY_UNITS, canonical_unit
from planner.numerics import Float32Array, FloatArray, IntArray

__all__ = ["EXTENSIONS", "decode_stl", "encode_stl", "read_mesh", "stl_holds"]


_BY_TRIMESH = ("ply", "obj", "off", "glb")
_BY_CASCADIO = ("step", "stp")
EXTENSIONS = ("stl", "3mf", *_BY_TRIMESH, *_BY_CASCADIO)
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


def read_mesh(
    path: str | Path, unit: str | None = None, limits: UnfoldingLimits = USUAL_LIMITS
) -> MeshFile:
    """Read STL, 3MF, PLY, OBJ, OFF, GLB or STEP.

    All the file's objects are read, each where the file places it.

    Parameters
    ----------
    path
        The file; its ending says what it is.
    unit
        mm, cm, m, inch, ft or um: the unit of the file's figures. By default what the file
        says (3MF, STEP), m for GLB as glTF prescribes, and mm for the formats that have none.
    limits
        What a 3MF or GLB may unfold to, whose objects may be placed many times.

    Raises
    ------
    ArgumentError
        No such unit.
    FileError
        No such file, a folder, or not readable.
    MeshError
        Not a mesh that planner reads: wrong ending, damaged, empty, coordinates not finite, more
        than `limits`.
    """
    path = Path(path)
    if unit is not None:
        unit = canonical_unit(unit)
    data = _bytes(path)
    kind = path.suffix.lstrip(".").casefold()
    if kind not in EXTENSIONS:
        raise MeshError(
            f"{path}: files ending in {path.suffix or 'nothing'} are not read; convert it to one "
            f"of {', '.join(EXTENSIONS)}"
        )
    triangles, own, notes = _READERS.get(kind, _by_trimesh)(data, kind, str(path), limits)
    _require_finite(triangles, str(path))
    if unit is not None and own is not None and unit != own:
        notes = (*notes, f"read in {unit} as asked, though the file says {own}")
    used = unit or own or "mm"
    in_mm = np.ascontiguousarray(triangles, dtype=np.float64)
    if used != "mm":
        in_mm = in_mm * QUANTITY_UNITS["length"][used]
    return MeshFile(in_mm, path.stem, hashlib.sha256(data).hexdigest(), used, notes)


def _bytes(path: Path) -> bytes:
    if not os.path.lexists(path):
        beside = list[str]()
        with contextlib.suppress(OSError):
            beside = sorted(entry.name for entry in path.parent.iterdir() if entry.is_file())
        hint = did_you_mean(path.name, beside) or "check the name and the folder"
        raise FileError(f"{path}: no such file; {hint.rstrip()}")
    return read_file(path, advice=f"give a mesh file ({', '.join(EXTENSIONS)})")


_Read = tuple[Float32Array | FloatArray, str | None, tuple[str, ...]]
"""Triangles, the unit that the file states, and what is to be said."""


def _stl(data: bytes, kind: str, name: str, limits: UnfoldingLimits) -> _Read:
    return decode_stl(data, name), None, ()


def _by_trimesh(data: bytes, kind: str, name: str, limits: UnfoldingLimits) -> _Read:
    triangles, _ = _trimesh(data, kind, name, limits)
    in_m = "read in m, the unit of glTF; use --unit if the file keeps another"
    return (triangles, "m", (in_m,)) if kind == "glb" else (triangles, None, ())


def _threemf(data: bytes, kind: str, name: str, limits: UnfoldingLimits) -> _Read:
    from planner.formats.threemf import decode_threemf

    model = decode_threemf(data, name, limits=limits)
    corners = [np.empty((0, 3, 3)), *(item.vertices[item.faces] for item in model.objects)]
    told = (*model.remarks, *_together([item.name for item in model.objects]))
    return np.concatenate(corners, dtype=np.float64), model.unit, told


def _together(names: Sequence[str]) -> tuple[str, ...]:
    """Say that a file's objects are one part to planner, and what they are called."""
    if len(names) < 2:
        return ()
    called = [name for name in names if name]
    told = f" ({listed(called, _NAMES_SHOWN)})" if called else ""
    return (f"holds {len(names)} placed objects{told}, graded together as one part",)


_NAMES_SHOWN = 4


_DEFLECTION_MM = 0.01
"""Between a face of a STEP file and its triangles: a quarter of a jetting printer's pixel."""

_CONVERTED = rb"CONVERSION_BASED_UNIT\s*\(\s*'(\w+)'"
_STEP_UNIT = re.compile(  # an inch is stated by a metre: what is converted counts first
    rb"%b[^;]*LENGTH_UNIT|LENGTH_UNIT[^;]*%b" % (_CONVERTED, _CONVERTED)
)
_STEP_METRES = re.compile(rb"LENGTH_UNIT[^;]*SI_UNIT\s*\(\s*(?:\.(\w+)\.|\$)\s*,\s*\.METRE\.")
_STEP_UNITS: Mapping[bytes, str] = MappingProxyType(
    {b"MILLI": "mm", b"CENTI": "cm", b"MICRO": "um", b"": "m", b"INCH": "inch", b"FOOT": "ft"}
)


def _step(data: bytes, kind: str, name: str, limits: UnfoldingLimits) -> _Read:
    """Read the bodies of a STEP file as triangles, in the file's own unit."""
    if not data.lstrip().startswith(b"ISO-10303-21") or b"END-ISO-10303-21" not in data[-4096:]:
        raise MeshError(
            f"{name}: not a whole STEP file, from ISO-10303-21 to END-ISO-10303-21; copy or export "
            "it again"
        )
    if find_spec("cascadio") is None:
        raise MeshError(
            f"{name}: STEP is read by cascadio, which is not installed: pip install cascadio, or "
            "export the part as 3MF or STL"
        )
    empty = MeshError(f"{name}: Open CASCADE finds no solid in it; export the part as a solid")
    # In a process of its own: Open CASCADE prints, and files that break its rules can crash it.
    with tempfile.TemporaryDirectory() as folder:
        step, made = Path(folder, "part.step"), Path(folder, "part.glb")
        step.write_bytes(data)
        call = "import sys, cascadio; cascadio.step_to_glb(*sys.argv[1:3], float(sys.argv[3]))"
        command = [sys.executable, "-c", call, str(step), str(made), str(_DEFLECTION_MM)]
        ended = subprocess.run(command, capture_output=True, check=False)
        if ended.returncode or not made.is_file():
            raise empty
        glb = made.read_bytes()
    in_m, names = _trimesh(glb, "glb", name, limits)
    if not len(in_m):
        raise empty
    stated = _STEP_UNIT.search(data) or _STEP_METRES.search(data)
    word = b"MILLI" if stated is None else next(filter(None, stated.groups()), b"")
    own = _STEP_UNITS.get(word.upper(), "mm")
    # As precise as it was in metres; and both ends of a seam are equal again, to 10 nm.
    in_mm = np.round(1000.0 * in_m, 5).astype(np.float32).astype(np.float64)
    return in_mm / QUANTITY_UNITS["length"][own], own, _together(names)


_READERS = {"stl": _stl, "3mf": _threemf, **dict.fromkeys(_BY_CASCADIO, _step)}


def _trimesh(
    data: bytes, kind: str, name: str, limits: UnfoldingLimits
) -> tuple[FloatArray, list[str]]:
    """Return triangles, and what the placed objects are called."""
    import trimesh

    _require_whole(data, kind, name)
    try:
        # A cast of what is no number is invalid, and would else give any number; what overflows
        # is not finite, and refused as such.
        with np.errstate(invalid="raise", over="ignore", divide="ignore"):
            if kind == "glb":
                _check_tree(data, limits)
            scene = trimesh.load_scene(io.BytesIO(data), file_type=kind, process=False)
            placed = [scene.geometry[scene.graph[node][1]] for node in scene.graph.nodes_geometry]
            faces = [getattr(shape, "faces", np.empty((0, 3))) for shape in placed]
            count = sum(map(len, faces))
            if count > limits.triangles or len(placed) > limits.objects:
                raise ValueError(
                    f"it unfolds to {len(placed):,} objects of {count:,} triangles; at most "
                    f"{limits.objects:,} and {limits.triangles:,} are read"
                )
            if any((corners < 0).any() for corners in faces):
                raise ValueError("a face has a vertex below the first")
            triangles = np.asarray(scene.to_mesh().triangles, dtype=np.float64).reshape(-1, 3, 3)
    except Exception as error:  # whatever a parser of foreign bytes may raise
        reason = f"{type(error).__name__}: {error}"
        if isinstance(error, ArithmeticError):
            reason = "a figure is no number, or too large"
        raise MeshError(
            f"{name}: not a {kind.upper()} file that can be read ({reason}); export the part "
            "again, as STL or 3MF if you can"
        ) from error
    return triangles, [str(scene.graph[node][1]) for node in scene.graph.nodes_geometry]


def _check_tree(data: bytes, limits: UnfoldingLimits) -> None:
    """Refuse a GLB whose nodes are deep: each is placed by the matrices from the root, 10 µs each.

    Ten levels of as many objects as are read are a second.
    """
    nodes = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")]).get("nodes", [])
    parents = {child: k for k, node in enumerate(nodes) for child in node.get("children", ())}
    total, level = 0, list(range(len(nodes)))
    while level:  # of each node the one above, until all are at the root
        total += len(level)
        if total > 10 * limits.objects:
            raise ValueError(
                f"its nodes are nested too deep, over {10 * limits.objects} matrices, or turn back "
                "on themselves"
            )
        level = [parents[node] for node in level if node in parents]


_ELEMENT = re.compile(rb"^element\s+\S+\s+(\d{1,18})\s*$", re.MULTILINE)


def _require_whole(data: bytes, kind: str, name: str) -> None:
    """Refuse text with fewer rows than its head promises, of which trimesh reads what there is."""
    if kind == "ply" and b"format ascii" in (head := data.partition(b"end_header")[0]):
        promised = sum(int(count) for count in _ELEMENT.findall(head))
        rows = _rows(data[len(head) :])[1:]
    elif kind == "off":
        rows = _rows(re.sub(rb"#.*", b"", data).partition(b"OFF")[2])
        counts, rows = rows[0].split()[:2] if rows else [], rows[1:]
        if not all(count.isdigit() and len(count) < 19 for count in counts):
            return  # trimesh says what is wrong
        promised = sum(map(int, counts))
    else:
        return
    if len(rows) < promised:
        raise MeshError(
            f"{name}: promises {promised} rows of vertices and faces, and holds {len(rows)}: it is "
            "cut short; copy or export the file again"
        )


def _rows(text: bytes) -> list[bytes]:
    return [line for line in text.splitlines() if line.strip()]


# ------------------------------------------------------------------------------------------------
# STL: binary and ASCII, as arrays of triangles.


_HEADER_BYTES = 80
_RECORD = np.dtype([("normal", "<f4", (3,)), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])

_NUMBER = rb"[-+]?(?:\d+\.?\d*|\.\d+|nan|inf)(?:e[-+]?\d+)?"
_VERTEX = rb"\s+vertex" + 3 * (rb"\s+(" + _NUMBER + rb")")
_FACET = re.compile(
    rb"\s*facet\s+normal(?:\s+\S+){3}\s+outer\s+loop" + 3 * _VERTEX + rb"\s+endloop\s+endfacet\b",
    re.IGNORECASE,
)
# A name runs to the end of its line, or to the first facet where a file has no line breaks.
_SOLID = re.compile(rb"\s*solid\b(?:[^\r\n]*?(?=\bfacet\s+normal\b)|[^\r\n]*)", re.IGNORECASE)
_ENDSOLID = re.compile(rb"\s*endsolid\b(?:[^\r\n]*?(?=\bsolid\b[^\r\n]*\bfacet\b)|[^\r\n]*)", re.I)
_POINT = ["vertex", "#", "#", "#"]
_GRAMMAR = ["facet", "normal", "#", "#", "#", "outer", "loop", *3 * _POINT, "endloop", "endfacet"]


def decode_stl(data: bytes, name: str) -> Float32Array | FloatArray:
    """Read the bytes of an STL file, binary or ASCII.

    Binary is told by its length, 84 + 50 n bytes, whatever its header says: many programs begin
    a binary header with "solid". ASCII may be in any case, spaced in any way, and hold several
    solids. Stored normals are ignored: the order of the corners says where outside is.

    Parameters
    ----------
    data
        The whole file.
    name
        What errors call it.

    Returns
    -------
    (k, 3, 3) array
        Corners in the file's unit; float32 from binary, float64 from ASCII.

    Raises
    ------
    MeshError
        Empty, cut short, not an STL (with the line), or a coordinate that is not finite (with
        the triangle).
    """
    if not data.strip():
        raise MeshError(f"{name}: the file is empty; export the part again")
    records = _records(data)
    if records is None and b"\0" in data:  # text never holds a zero byte
        raise MeshError(f"{name}: {_wrong_size(data)}; copy or export the file again")
    triangles = _decode_ascii(data, name) if records is None else records["corners"].copy()
    _require_finite(triangles, name)
    return triangles


_ROWS = 8192  # of which all that is computed stays in the processor's cache


def encode_stl(vertices: Float32Array, faces: IntArray, header: str) -> bytes:
    """Make the bytes of a binary STL.

    Normals are computed in float64 from the float32 corners with basic operations alone, so
    that they are the same bits everywhere; a triangle without area gets a zero normal.

    Parameters
    ----------
    vertices : (n, 3) float32
        Positions, in the unit that `header` names.
    faces : (m, 3) int
        Outward triangles.
    header
        Text of the 80-byte header, cut to length. A leading "solid", which would make readers
        take the file for ASCII, is prefixed.

    Returns
    -------
    bytes
        84 + 50 m of them.

    Raises
    ------
    OutputError
        A vertex is not finite.
    """
    text = f"STL {header}" if header.lstrip().casefold().startswith("solid") else header
    points = np.ascontiguousarray(vertices, dtype=np.float32) + np.float32(0.0)  # no -0.0
    if not np.isfinite(points).all():
        first = int(np.argmin(np.isfinite(points).all(axis=1)))
        raise OutputError(
            f"STL {header}: vertex {first + 1} is {points[first].tolist()}: not finite; mend the "
            "mesh before it is written"
        )
    records = np.zeros(len(faces), _RECORD)
    for first in range(0, len(faces), _ROWS):
        some = slice(first, first + _ROWS)
        records["corners"][some] = corners = points.take(faces[some], axis=0)
        a, b, c = np.ascontiguousarray(corners.transpose(1, 2, 0), np.float64)
        normal = np.cross(b - a, c - a, axis=0)
        length = np.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)
        records["normal"][some] = (normal / np.where(length == 0.0, 1.0, length) + 0.0).T
    head = text.encode("ascii", "replace")[:_HEADER_BYTES].ljust(_HEADER_BYTES)
    return b"".join((head, len(faces).to_bytes(4, "little"), records.data))


def stl_holds(data: bytes, vertices: Float32Array, faces: IntArray) -> bool:
    """Tell whether the triangles of a binary STL are these, bit for bit, in this order."""
    records = _records(data)
    if records is None or len(records) != len(faces):
        return False
    points = np.ascontiguousarray(vertices, np.float32).view(np.uint32)
    return np.array_equal(records["corners"].copy().view(np.uint32), points.take(faces, axis=0))


def _require_finite(triangles: Float32Array | FloatArray, name: str) -> None:
    """Refuse no triangles at all, and those with a coordinate that is not a finite number.

    Raises
    ------
    MeshError
        Names the first such triangle, counted from 1, and how many there are.
    """
    if len(triangles) == 0:
        raise MeshError(f"{name}: holds no triangles; export the part again")
    if np.isfinite(triangles).all():
        return
    finite = np.isfinite(triangles).all(axis=(1, 2))
    first = int(np.argmin(finite))
    values = triangles[first][~np.isfinite(triangles[first])]
    raise MeshError(
        f"{name}: triangle {first + 1} of {len(triangles)} has a coordinate {values[0]}; "
        f"{int((~finite).sum())} triangles are not finite; export the part again"
    )


def _records(data: bytes) -> Any:
    """Return the triangles of a binary STL; None of what is none by its length."""
    count = int.from_bytes(data[_HEADER_BYTES : _HEADER_BYTES + 4], "little")
    is_whole = len(data) == _HEADER_BYTES + 4 + count * _RECORD.itemsize
    return np.frombuffer(data, _RECORD, count, _HEADER_BYTES + 4) if is_whole else None


def _wrong_size(data: bytes) -> str:
    size, count = len(data), int.from_bytes(data[_HEADER_BYTES : _HEADER_BYTES + 4], "little")
    if size < _HEADER_BYTES + 4:
        return f"a binary STL begins with {_HEADER_BYTES + 4} bytes, got {size}: it is cut short"
    expected = _HEADER_BYTES + 4 + count * _RECORD.itemsize
    whole = (size - _HEADER_BYTES - 4) // _RECORD.itemsize
    verdict = "it is cut short" if size < expected else "it is damaged or no STL"
    return (
        f"a binary STL of {count} triangles has {expected} bytes, got {size} "
        f"({whole} triangles): {verdict}"
    )


def _decode_ascii(data: bytes, name: str) -> FloatArray:
    numbers: list[bytes] = []
    at = 3 if data.startswith(b"\xef\xbb\xbf") else 0  # a byte-order mark
    while data[at:].strip():
        if (opening := _SOLID.match(data, at)) is None:
            raise _ascii_error(data, at, ["solid"], name)
        facets = _FACET.scanner(data, opening.end())  # type: ignore[attr-defined] # not in typeshed
        at = opening.end()
        while facet := facets.match():
            numbers += facet.groups()
            at = facet.end()
        if (closing := _ENDSOLID.match(data, at)) is None:
            raise _ascii_error(data, at, _GRAMMAR, name)
        at = closing.end()
    return np.array([float(number) for number in numbers]).reshape(-1, 3, 3)


def _ascii_error(data: bytes, at: int, grammar: list[str], name: str) -> MeshError:
    """Say at which line the text leaves the grammar; # stands for a number."""
    words = re.compile(rb"\S+").finditer(data, at)
    for position, expected in enumerate(grammar):
        found = next(words, None)
        word = "" if found is None else found.group().decode("ascii", "replace")
        if found is None or (found.end() == len(data) and len(word) < len(expected)):
            line = data.count(b"\n") + 1
            return MeshError(
                f"{name}: line {line}: the file ends where {_called(expected)} should follow: "
                "it is cut short; copy or export the file again"
            )
        if position in (2, 3, 4):  # the normal, which nobody reads
            continue
        numeric = re.fullmatch(_NUMBER, found.group(), re.IGNORECASE) is not None
        if not (numeric if expected == "#" else word.casefold() == expected):
            line = data.count(b"\n", 0, found.start()) + 1
            return MeshError(
                f"{name}: line {line}: expected {_called(expected)}, got {word[:40]!r}; "
                "it is not a sound ASCII STL"
            )
    raise AssertionError("the grammar was left, so a word differs")


def _called(expected: str) -> str:
    return "a number" if expected == "#" else repr(expected)
