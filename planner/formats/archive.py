"""Zip archives and 3MF: what they unpack and unfold to, counted before a machine is exhausted."""

import io
import re
import struct
import zipfile
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from planner.errors import FileError, MeshError

__all__ = [
    "LARGEST",
    "USUAL_LIMITS",
    "UnfoldingLimits",
    "check_structure",
    "deflated",
    "most_unpacked",
    "unpacked",
]

LARGEST = 0xFFFFFFFE
"""Bytes that a zip archive, or a member of it, holds without zip64."""


def deflated(data: bytes, member: zipfile.ZipInfo) -> memoryview:
    """Return a member's bytes as they are packed."""
    name_size, extra_size = struct.unpack_from("<2H", data, member.header_offset + 26)
    start = member.header_offset + 30 + name_size + extra_size
    return memoryview(data)[start : start + member.compress_size]


_PIECE = 1 << 20
_RATIO = 100
"""Text packs by 4 to 11 (meshes, the most regular ones included); zeros by 1,030."""

_HARMLESS = 100_000_000
"""Bytes that any machine has; a constant field of 230 x 230 x 230 doubles is as large."""


def most_unpacked(packed_bytes: int) -> int:
    """Return how many bytes a file of so many may unpack to; what holds more exhausts memory."""
    return max(_HARMLESS, _RATIO * packed_bytes)


def unpacked(data: bytes, name: str, most_bytes: int) -> Iterator[tuple[str, Iterator[bytes]]]:
    """Yield the members of an archive: the name of each, and its content piece by piece.

    A member is worth no more memory than a piece, and its content is checked to be of the length
    that the archive's directory promises: what is longer is not unpacked.

    Parameters
    ----------
    data, name
        The whole file, and what errors call it.
    most_bytes
        That all members may promise together, and not above `most_unpacked`.

    Raises
    ------
    FileError
        No zip archive, a packing other than deflate, or more than is promised or allowed.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = archive.infolist()
    except (zipfile.BadZipFile, ValueError, OSError, NotImplementedError) as error:
        raise FileError(
            f"{name}: not a zip archive that can be read ({error}); copy or export the file again"
        ) from error
    promised = sum(member.file_size for member in members)
    most_bytes = min(most_bytes, most_unpacked(len(data)))
    if promised > most_bytes:
        raise FileError(
            f"{name}: {len(data):,} bytes that unpack to {promised:,}; at most {most_bytes:,} are "
            "read: it is damaged, or made to exhaust memory; export the part again"
        )
    for member in members:
        yield member.filename, _pieces(data, member, name)


def _pieces(data: bytes, member: zipfile.ZipInfo, name: str) -> Iterator[bytes]:
    try:
        packed = deflated(data, member)
    except struct.error:
        packed = memoryview(b"")
    if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise FileError(
            f"{name}: {member.filename} is packed by method {member.compress_type}; only deflate "
            "is read: zip it again"
        )
    got = 0
    for piece in _slices(packed) if member.compress_type == 0 else _inflated(packed, member, name):
        got += len(piece)
        if got > member.file_size:
            break
        yield piece
    if got != member.file_size:
        more = "more" if got > member.file_size else f"{got:,}"
        raise FileError(
            f"{name}: {member.filename} promises {member.file_size:,} bytes and holds {more}; "
            "copy or export the file again"
        )


def _slices(packed: memoryview) -> Iterator[bytes]:
    for start in range(0, len(packed), _PIECE):
        yield bytes(packed[start : start + _PIECE])


def _inflated(packed: memoryview, member: zipfile.ZipInfo, name: str) -> Iterator[bytes]:
    unpacker = zlib.decompressobj(-zlib.MAX_WBITS)
    try:
        for block in _slices(packed):
            while block:
                yield unpacker.decompress(block, _PIECE)
                block = unpacker.unconsumed_tail
        yield unpacker.flush(_PIECE)
    except zlib.error as error:
        raise FileError(
            f"{name}: {member.filename} cannot be unpacked ({error}); copy or export the file again"
        ) from error


# ------------------------------------------------------------------------------------------------
# What the build of a 3MF file unfolds to, counted from its text before anything is unfolded.


@dataclass(frozen=True, slots=True)
class UnfoldingLimits:
    """How much a file may hold, and what it places unfold to, before it is refused.

    Attributes
    ----------
    triangles
        As placed; what the file itself holds is read in any case. Grading along an axis takes 400
        bytes of memory a triangle (measured from 0.3 to 5 million), along a curved field twice to
        three times that: 10 million are about what a machine of 8 GB grades.
    objects
        In the file, and as placed, assemblies included. The time that lib3mf takes grows with the
        square of their number: some 6 s for 10,000.
    depth
        Components within components. lib3mf follows them by recursion: 1,000 levels fit into
        256 KiB, half of the least stack that a thread usually has.
    unpacked_bytes
        Of all members of the archive together; see `unpacked`.
    """

    triangles: int = 10_000_000
    objects: int = 10_000
    depth: int = 1_000
    unpacked_bytes: int = LARGEST


USUAL_LIMITS = UnfoldingLimits()

_Key = tuple[str, int]
"""An object: the archive's member that holds it, and its number there."""


@dataclass(slots=True)
class _Object:
    triangles: int = 0
    components: list[_Key] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class _Unfolded:
    objects: int
    triangles: int
    depth: int


def check_structure(data: bytes, name: str, limits: UnfoldingLimits) -> None:
    """Refuse a 3MF file that holds, or unfolds to, more than planner reads.

    Nothing is built of it: members are unpacked piece by piece, and of their text only what
    makes the structure is looked at (objects, components, build items, a triangle's first corner).
    Each object is counted once, however often it is placed. Whatever else is wrong with the file
    is left to its reader.

    Parameters
    ----------
    data, name
        The whole file, and what errors call it.

    Raises
    ------
    MeshError
        No zip archive, or one that does not hold what it promises; or more than a limit.
    """
    objects: dict[_Key, _Object] = {}
    items: list[_Key] = []
    try:
        called = f"{name}: not a 3MF file that can be read"
        for member, pieces in unpacked(data, called, limits.unpacked_bytes):
            for _ in _scan(member, pieces, objects, items):
                if len(objects) > limits.objects:
                    raise _refusal(name, f"holds more than {limits.objects:,} objects")
    except FileError as error:
        raise MeshError(str(error)) from error
    stored = sum(found.triangles for found in objects.values())
    whole = _unfold(objects, items)
    for what, got, most in (
        ("unfolds to {} objects, assemblies included", whole.objects, limits.objects),
        ("unfolds to {} triangles", whole.triangles, max(limits.triangles, stored)),
        ("nests components {} deep", whole.depth, limits.depth),
    ):
        if got > most:
            raise _refusal(
                name, f"{what.format(_counted(got))}, more than the {most:,} that planner reads"
            )


def _refusal(name: str, what: str) -> MeshError:
    return MeshError(
        f"{name}: {what}; print fewer copies at once, export the part coarser, or read it from a "
        "script with higher limits (planner.formats.mesh_file.read_mesh)"
    )


def _counted(count: int) -> str:
    return f"{count:,}" if count < 10**15 else "over 10^15"


# ------------------------------------------------------------------------------------------------
# The structure, from the text of the model.


_OPENING = re.compile(rb"<(?:!--|\?|(?:[\w.-]+:)?(object|component|item)(?=\s))")
_REST = re.compile(rb"""(?:[^>"']|"[^"]*"|'[^']*')*+>""")
_ATTRIBUTE = re.compile(rb"""([\w.-]+)\s*=\s*(?:"([^"]*)"|'([^']*)')""")
_ENDS = {b"<!--": b"-->", b"<?": b"?>"}
_CORNER = b"v1"
"""Each triangle has this attribute once, whatever its prefix and blanks."""

_LONGEST_TAG = 1 << 20


def _scan(
    member: str, pieces: Iterable[bytes], objects: dict[_Key, _Object], items: list[_Key]
) -> Iterator[None]:
    """Add what a member of the archive has of objects and build items, and yield at each piece."""
    text, current = b"", _Object()
    for piece in pieces:
        text += piece
        place = counted = 0
        while opening := _OPENING.search(text, place):
            current.triangles += text.count(_CORNER, counted, opening.start())
            place = counted = opening.start()
            if opening[1] is None:
                end = text.find(_ENDS[opening[0]], opening.end())
                closed = None if end < 0 else end + len(_ENDS[opening[0]])
            else:
                rest = _REST.match(text, opening.end())
                closed = None if rest is None else rest.end()
            if closed is None:  # goes on in the next piece
                break
            place = counted = closed
            if opening[1] is not None:
                found = _ATTRIBUTE.findall(text, opening.end(), closed)
                said = {key: (double or single) for key, double, single in found}
                current = _note(member, opening[1], said, objects, items, current)
        else:
            opened = text.rfind(b"<", place)
            # A tag's beginning is kept; a text of any length may follow a whole one.
            place = opened if opened >= 0 and len(text) - opened < 4096 else len(text)
            current.triangles += text.count(_CORNER, counted, place)
        text = text[place:]
        if len(text) > _LONGEST_TAG:
            raise FileError(f"{member}: has an XML element of more than {_LONGEST_TAG:,} bytes")
        yield
    current.triangles += text.count(_CORNER)


def _note(
    member: str,
    tag: bytes,
    said: dict[bytes, bytes],
    objects: dict[_Key, _Object],
    items: list[_Key],
    current: _Object,
) -> _Object:
    """Take an element in, and return the object that what follows is of."""
    key = _key(member, said.get(b"path"), said.get(b"id" if tag == b"object" else b"objectid"))
    if key is None:  # the reader will say what is wrong
        return current
    if tag == b"object":
        return objects.setdefault(key, _Object())
    (current.components if tag == b"component" else items).append(key)
    return current


def _key(member: str, path: bytes | None, number: bytes | None) -> _Key | None:
    where = member if path is None else path.decode("utf-8", "replace").lstrip("/")
    try:
        return where.casefold(), int(number or b"")
    except ValueError:
        return None


# ------------------------------------------------------------------------------------------------
# What it unfolds to.


def _unfold(objects: dict[_Key, _Object], items: list[_Key]) -> _Unfolded:
    """Add up what the items place, each object's own sum made once, after those of its components.

    What refers to itself, or to nothing, adds nothing: the reader refuses it.
    """
    known: dict[_Key, _Unfolded] = {}
    nothing = _Unfolded(0, 0, 0)
    begun: set[_Key] = set()
    for start in objects:
        waiting = [start]
        while waiting:
            key = waiting[-1]
            if key in begun:
                waiting.pop()
                known.setdefault(key, _sum(objects[key], known))
                continue
            begun.add(key)
            for one in set(objects[key].components):
                if one in objects and one not in begun:
                    waiting.append(one)
    placed = [known.get(key, nothing) for key in items]
    return _Unfolded(
        sum(one.objects for one in placed),
        sum(one.triangles for one in placed),
        max((one.depth for one in known.values()), default=0),
    )


def _sum(found: _Object, known: dict[_Key, _Unfolded]) -> _Unfolded:
    parts = [known[key] for key in found.components if key in known]
    return _Unfolded(
        1 + sum(part.objects for part in parts),
        found.triangles + sum(part.triangles for part in parts),
        1 + max((part.depth for part in parts), default=0),
    )
