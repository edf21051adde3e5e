"""STL: binary and ASCII, as arrays of triangles."""

import re

import numpy as np

from planner.errors import MeshError, OutputError
from planner.numerics import Float32Array, FloatArray, IntArray

__all__ = ["decode_stl", "encode_stl", "require_finite", "stl_holds"]


_HEADER_BYTES = 80
_RECORD = np.dtype(
    [("normal", "<f4", (3,)), ("corners", "<f4", (3, 3)), ("attribute", "<u2")], align=False
)
_BLOCK = 16384  # triangles at a time, so that intermediate results stay in the cache

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
    size = len(data)
    count = int.from_bytes(data[_HEADER_BYTES : _HEADER_BYTES + 4], "little")
    binary = size >= _HEADER_BYTES + 4 and size == _binary_size(count)
    if not binary and b"\0" in data:  # text never holds a zero byte
        raise MeshError(f"{name}: {_wrong_size(size, count)}; copy or export the file again")
    triangles: Float32Array | FloatArray = (
        np.frombuffer(data, _RECORD, count, _HEADER_BYTES + 4)["corners"].copy()
        if binary
        else _decode_ascii(data, name)
    )
    if len(triangles) == 0:
        raise MeshError(f"{name}: holds no triangles; export the part again")
    require_finite(triangles, name)
    return triangles


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
    records = np.zeros(len(faces), dtype=_RECORD)
    for start in range(0, len(faces), _BLOCK):
        block = records[start : start + _BLOCK]
        corners = points[faces[start : start + _BLOCK]]
        block["corners"] = corners
        block["normal"] = _unit_normals(corners)
    head = text.encode("ascii", "replace")[:_HEADER_BYTES].ljust(_HEADER_BYTES)
    return b"".join((head, len(faces).to_bytes(4, "little"), records.data))


def stl_holds(data: bytes, vertices: Float32Array, faces: IntArray) -> bool:
    """Tell whether the triangles of a binary STL are these, bit for bit, in this order."""
    count = int.from_bytes(data[_HEADER_BYTES : _HEADER_BYTES + 4], "little")
    if count != len(faces) or len(data) != _binary_size(count):
        return False
    records = np.frombuffer(data, _RECORD, count, _HEADER_BYTES + 4)
    points = np.ascontiguousarray(vertices, np.float32).view(np.uint32)
    return all(
        np.array_equal(
            np.ascontiguousarray(records["corners"][start : start + _BLOCK]).view(np.uint32),
            points[faces[start : start + _BLOCK]],
        )
        for start in range(0, count, _BLOCK)
    )


def require_finite(triangles: Float32Array | FloatArray, name: str) -> None:
    """Refuse triangles with a coordinate that is not a finite number.

    Raises
    ------
    MeshError
        Names the first such triangle, counted from 1, and how many there are.
    """
    if np.isfinite(triangles).all():
        return
    finite = np.isfinite(triangles).all(axis=(1, 2))
    first = int(np.argmin(finite))
    values = triangles[first][~np.isfinite(triangles[first])]
    raise MeshError(
        f"{name}: triangle {first + 1} of {len(triangles)} has a coordinate {values[0]}; "
        f"{int((~finite).sum())} triangles are not finite; export the part again"
    )


def _binary_size(count: int) -> int:
    return _HEADER_BYTES + 4 + count * _RECORD.itemsize


def _wrong_size(size: int, count: int) -> str:
    if size < _HEADER_BYTES + 4:
        return f"a binary STL begins with {_HEADER_BYTES + 4} bytes, got {size}: it is cut short"
    expected = _binary_size(count)
    whole = (size - _HEADER_BYTES - 4) // _RECORD.itemsize
    verdict = "it is cut short" if size < expected else "it is damaged or no STL"
    return (
        f"a binary STL of {count} triangles has {expected} bytes, got {size} "
        f"({whole} triangles): {verdict}"
    )


def _unit_normals(corners: Float32Array) -> Float32Array:
    x, y, z = corners.astype(np.float64).transpose(2, 1, 0)
    ux, uy, uz = x[1] - x[0], y[1] - y[0], z[1] - z[0]
    vx, vy, vz = x[2] - x[0], y[2] - y[0], z[2] - z[0]
    normal = np.stack([uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx])
    length = np.sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2])
    length[length == 0.0] = 1.0
    unit: Float32Array = (normal / length + 0.0).T.astype(np.float32)
    return unit


def _decode_ascii(data: bytes, name: str) -> FloatArray:
    numbers: list[bytes] = []
    place = 3 if data.startswith(b"\xef\xbb\xbf") else 0  # a byte-order mark
    while data[place:].strip():
        opening = _SOLID.match(data, place)
        if opening is None:
            raise _ascii_error(data, place, ["solid"], name)
        facets = _FACET.scanner(data, opening.end())  # type: ignore[attr-defined] # not in typeshed
        place = opening.end()
        while facet := facets.match():
            numbers += facet.groups()
            place = facet.end()
        closing = _ENDSOLID.match(data, place)
        if closing is None:
            raise _ascii_error(data, place, _GRAMMAR, name)
        place = closing.end()
    return np.array([float(number) for number in numbers]).reshape(-1, 3, 3)


def _ascii_error(data: bytes, place: int, grammar: list[str], name: str) -> MeshError:
    """Say at which line the text leaves the grammar; # stands for a number."""
    words = re.compile(rb"\S+").finditer(data, place)
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
