"""Zip archives in one canonical form: same members, same bytes."""

import io
import struct
import zipfile

from planner.errors import OutputError

__all__ = ["canonical_archive"]

_DATE = 0 << 9 | 1 << 5 | 1  # 1980-01-01, the earliest that a zip can say
_VERSION = 20  # deflate and folders, nothing newer
_UNIX_FILE = 0o100644 << 16
_LARGEST = 0xFFFFFFFE


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
    body, directory = bytearray(), bytearray()
    for name in names:
        member = members[name]
        offset = len(body)
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
        body += struct.pack("<4s5H3I2H", b"PK\x03\x04", *facts) + path
        body += _deflated(data, member)
        made_by = 3 << 8 | _VERSION  # Unix, so that the permissions count
        directory += struct.pack("<4sH5H3I2H", b"PK\x01\x02", made_by, *facts)
        directory += struct.pack("<3H2I", 0, 0, 0, _UNIX_FILE, offset) + path
    count = len(names)
    end = struct.pack("<4s4H2IH", b"PK\x05\x06", 0, 0, count, count, len(directory), len(body), 0)
    return bytes(body + directory + end)


def _deflated(data: bytes, member: zipfile.ZipInfo) -> memoryview:
    name_size, extra_size = struct.unpack_from("<2H", data, member.header_offset + 26)
    start = member.header_offset + 30 + name_size + extra_size
    return memoryview(data)[start : start + member.compress_size]
