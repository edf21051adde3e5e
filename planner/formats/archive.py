"""Zip archives: written in one canonical form, and unpacked no further than they promise."""

import io
import struct
import zipfile
import zlib
from collections.abc import Iterator
from dataclasses import dataclass

from planner.errors import FileError, OutputError

__all__ = [
    "USUAL_LIMITS",
    "UnfoldingLimits",
    "canonical_archive",
    "most_unpacked",
    "unpacked",
]

_DATE = 0 << 9 | 1 << 5 | 1  # 1980-01-01, the earliest that a zip can say
_VERSION = 20  # deflate and folders, nothing newer
_UNIX_FILE = 0o100644 << 16
_LARGEST = 0xFFFFFFFE
"""Bytes that a zip archive, or a member of it, holds without zip64."""


def canonical_archive(data: bytes, first: tuple[str, ...]) -> bytes:
    """Rewrite an archive with fixed dates, permissions and order, and without zip64.

    The members' deflated bytes are copied as they are. Some readers of 3MF take neither zip64
    nor a date of zero, both of which lib3mf writes.

    Parameters
    ----------
    data
        A zip archive whose members are stored or deflated.
    first
        Members to put first, in this order; the rest follow sorted by name.

    Returns
    -------
    bytes
        The archive.

    Raises
    ------
    OutputError
        A member or the whole is 4 GiB or more, which takes zip64.
    """
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {member.filename: member for member in archive.infolist()}
    names = [name for name in first if name in members]
    names += sorted(name for name in members if name not in first)
    parts, offset, directory = list[bytes | memoryview](), 0, bytearray()
    for name in names:
        member = members[name]
        if max(offset + member.compress_size, member.file_size) > _LARGEST:
            raise OutputError(
                f"{name}: {member.file_size} bytes, more than the 4 GiB that readers of 3MF take; "
                "reduce the number of triangles"
            )
        path = name.encode("utf-8")
        flags = 0 if name.isascii() else 0x800
        facts = (
            *(_VERSION, flags, member.compress_type, 0, _DATE),
            *(member.CRC, member.compress_size, member.file_size, len(path), 0),
        )
        parts += [struct.pack("<4s5H3I2H", b"PK\x03\x04", *facts) + path, _deflated(data, member)]
        made_by = 3 << 8 | _VERSION  # Unix, so that the permissions count
        directory += struct.pack("<4sH5H3I2H", b"PK\x01\x02", made_by, *facts)
        directory += struct.pack("<3H2I", 0, 0, 0, _UNIX_FILE, offset) + path
        offset += len(parts[-2]) + len(parts[-1])
    count = len(names)
    end = struct.pack("<4s4H2IH", b"PK\x05\x06", 0, 0, count, count, len(directory), offset, 0)
    return b"".join((*parts, directory, end))


def _deflated(data: bytes, member: zipfile.ZipInfo) -> memoryview:
    name_size, extra_size = struct.unpack_from("<2H", data, member.header_offset + 26)
    start = member.header_offset + 30 + name_size + extra_size
    return memoryview(data)[start : start + member.compress_size]


_RATIO = 100
"""Text packs by 4 to 11 (meshes, the most regular ones included); zeros by 1,030."""

_HARMLESS = 100_000_000
"""Bytes that any machine has; a constant field of 230 x 230 x 230 doubles is as large."""


def most_unpacked(packed_bytes: int) -> int:
    """Return how many bytes a file of so many may unpack to; what holds more exhausts memory."""
    return max(_HARMLESS, _RATIO * packed_bytes)


def unpacked(data: bytes, name: str, most_bytes: int = _LARGEST) -> Iterator[tuple[str, bytes]]:
    """Yield the members of an archive: the name of each, and its content.

    It is checked to be of the length that the archive's directory promises: what is longer is not
    unpacked.

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
        yield member.filename, _content(data, member, name)


def _content(data: bytes, member: zipfile.ZipInfo, name: str) -> bytes:
    try:
        packed = _deflated(data, member)
    except struct.error:
        packed = memoryview(b"")
    most = member.file_size + 1  # one more than promised shows that there is too much
    if member.compress_type == zipfile.ZIP_STORED:
        content = bytes(packed[:most])
    elif member.compress_type == zipfile.ZIP_DEFLATED:
        try:
            content = zlib.decompressobj(-zlib.MAX_WBITS).decompress(packed, most)
        except zlib.error as error:
            raise FileError(
                f"{name}: {member.filename} cannot be unpacked ({error}); copy or export the file "
                "again"
            ) from error
    else:
        raise FileError(
            f"{name}: {member.filename} is packed by method {member.compress_type}; only deflate "
            "is read: zip it again"
        )
    if len(content) != member.file_size:
        more = "more" if len(content) == most else f"{len(content):,}"
        raise FileError(
            f"{name}: {member.filename} promises {member.file_size:,} bytes and holds {more}; "
            "copy or export the file again"
        )
    return content


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
    unpacked_bytes: int = _LARGEST


USUAL_LIMITS = UnfoldingLimits()
