"""Files as bytes, zip archives unpacked, JSON documents in one canonical form, TOML documents."""

import contextlib
import io
import json
import math
import stat
import tomllib
import zipfile
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PureWindowsPath
from typing import Any, TypeVar

import msgspec

from planner.errors import FileError, refused

__all__ = [
    "SIGNIFICANT_DIGITS",
    "USUAL_LIMITS",
    "UnfoldingLimits",
    "decode_document",
    "decode_toml",
    "encode_document",
    "free_memory_bytes",
    "json_of",
    "most_unpacked",
    "path_within",
    "read_file",
    "toml_beside",
    "toml_text",
    "unpacked",
]


# ------------------------------------------------------------------------------------------------
# Files as bytes.


def read_file(path: str | Path, *, advice: str = "", error: type[FileError] = FileError) -> bytes:
    """Read a file whole.

    Parameters
    ----------
    path
        A file; folders, devices and pipes are refused before they are opened.
    advice
        What to do, at the end of a message.
    error
        What is raised.

    Raises
    ------
    FileError
        No file, or one that cannot be read or is larger than the memory that is free.
    """
    then = f"; {advice}" if advice else ""
    # A ValueError tells a zero byte in the name.
    with refused(error, path, f"cannot be read ({{}}){then}", OSError, ValueError, TypeError):
        found = Path(path).stat()
        if not stat.S_ISREG(found.st_mode):
            what = "a folder" if stat.S_ISDIR(found.st_mode) else "a device or a pipe"
            raise error(f"{path}: is {what}, not a file{then}")
        size, free = found.st_size / 1e9, free_memory_bytes() / 1e9
        large = f"holds {size:.3g} GB, too much for the {free:.3g} GB of memory that are free"
        with refused(error, path, f"{large}; take a smaller file", MemoryError):
            if _HELD * size > free:
                raise MemoryError
            return Path(path).read_bytes()


_HELD = 2.5
"""Times a file's size: its bytes, and the corners of a binary STL in double precision. Other kinds
take more; what then does not fit is told by the command."""


def free_memory_bytes() -> float:
    """Return the memory that is free, of the machine and of the container; inf if none tells."""
    free = math.inf
    with contextlib.suppress(OSError, ValueError):  # not Linux
        info = Path("/proc/meminfo").read_text(encoding="ascii").split()
        free = 1024.0 * int(info[info.index("MemAvailable:") + 1])
    with contextlib.suppress(OSError, ValueError):  # no container, or one without a limit
        most, used = (int(Path(name).read_text(encoding="ascii")) for name in _CONTAINER)
        free = min(free, float(most - used))
    return free


_CONTAINER = ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory.current")


# ------------------------------------------------------------------------------------------------
# What a folder's documents name: files and folders that lie in that folder, and no others.


def path_within(folder: str | Path, name: str) -> Path:
    """Return where in a folder a file or folder lies that a document there names.

    Plans, campaigns and diagnoses come from others: what they name is opened only where it lies
    below their own folder, links followed, and is no device. There may be none of that name.

    Raises
    ------
    FileError
        It lies outside, on a path that is absolute or by a link; or is neither file nor folder.
    """
    path = Path(folder) / name
    asked = "cannot be read ({}); check the name"
    # A ValueError tells a zero byte, a RuntimeError a loop of links before Python 3.13.
    with refused(FileError, path, asked, OSError, ValueError, RuntimeError):
        root, place = Path(folder).resolve(), path.resolve()
        # What is a drive or a root on one machine is so on all.
        if PureWindowsPath(name).anchor or root not in place.parents:
            raise FileError(
                f"{folder}: {name!r}, which is named there, lies outside the folder; it was not "
                "read: put it into the folder, and name it by its path from there"
            )
        there = place.exists() or place.is_symlink()  # itself in a loop of links
        mode = place.stat().st_mode if there else stat.S_IFREG
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise FileError(f"{path}: is a device, a pipe or a socket; it was not read: give a file")
    return path


# ------------------------------------------------------------------------------------------------
# Zip archives, unpacked no further than they promise.


_LARGEST = 0xFFFFFFFE
"""Bytes that a zip archive, or a member of it, holds without zip64."""


_RATIO = 100
"""Text packs by 4 to 11 (meshes, the most regular ones included); zeros by 1,030."""

_HARMLESS = 100_000_000
"""Bytes that any machine has; a constant field of 230 x 230 x 230 doubles is as large."""


def most_unpacked(packed_bytes: int) -> int:
    """Return how many bytes a file of so many may unpack to; what holds more exhausts memory."""
    return max(_HARMLESS, _RATIO * packed_bytes)


def unpacked(data: bytes, name: str, most_bytes: int = _LARGEST) -> Iterator[tuple[str, bytes]]:
    """Yield the members of an archive: the name of each, and its content.

    It is checked to be what the archive's directory promises, and unpacked no further.

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
    most_bytes = min(most_bytes, most_unpacked(len(data)))
    said = "not a zip archive that can be read ({}); copy or export the file again"
    # The last of a member that is encrypted.
    broken = (zipfile.BadZipFile, zlib.error, ValueError, OSError, EOFError, RuntimeError)
    with refused(FileError, name, said, *broken), zipfile.ZipFile(io.BytesIO(data)) as archive:
        promised = sum(member.file_size for member in archive.infolist())
        if promised > most_bytes:
            raise FileError(
                f"{name}: {len(data):,} bytes that unpack to {promised:,}; at most "
                f"{most_bytes:,} are read: it is damaged, or made to exhaust memory; export "
                "the part again"
            )
        for member in archive.infolist():
            if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
                raise FileError(
                    f"{name}: {member.filename} is packed by method {member.compress_type}; "
                    "only deflate is read: zip it again"
                )
            # At least a byte: who reads none is not told that there is more than promised.
            with archive.open(member) as stream:
                content = stream.read(max(member.file_size, 1))
            if len(content) < member.file_size:
                raise EOFError(f"{member.filename} is cut short")
            yield member.filename, content


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


# ------------------------------------------------------------------------------------------------
# TOML, read: what a person wrote, refused with its place where it is none.


def decode_toml(data: bytes, name: str, error: type[FileError] = FileError) -> dict[str, Any]:
    """Read the bytes of a TOML file, which errors call `name`.

    Raises
    ------
    FileError
        Not UTF-8, not TOML, or nested too deep or with numbers too long for Python.
    """
    # A ValueError is of text, of TOML or of long numbers.
    with refused(error, name, "not a TOML file: {}", ValueError, RecursionError):
        return tomllib.loads(data.decode("utf-8"))


def toml_beside(name: str) -> Mapping[str, Mapping[str, Any]]:
    """Return one of the TOML files that stand beside this module."""
    return tomllib.loads(Path(__file__).with_name(name).read_text(encoding="utf-8"))


def toml_text(value: str | float | Sequence[Any]) -> str:
    """Write a TOML value: a text, a figure of `SIGNIFICANT_DIGITS` or inf, or a list of such."""
    if isinstance(value, str):  # JSON's escapes, and DEL, which JSON lets through
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, Sequence):
        return f"[{', '.join(map(toml_text, value))}]"
    if isinstance(value, int):
        return str(value)
    return repr(float(f"{value:.{SIGNIFICANT_DIGITS}g}") + 0.0)  # + 0.0 turns -0.0 into 0.0


# ------------------------------------------------------------------------------------------------
# JSON documents in one canonical form, so that equal content is equal bytes.


_T = TypeVar("_T")

SIGNIFICANT_DIGITS = 9
"""Figures are rounded to this: far finer than any measurement, coarser than the last bits in
which mathematical libraries of different machines differ."""


def encode_document(document: Mapping[str, Any]) -> bytes:
    """Write a JSON document in canonical form.

    Keys in the order given, two-space indent, lists of plain values on one line, figures
    rounded to `SIGNIFICANT_DIGITS`, a newline at the end; UTF-8.

    Raises
    ------
    ValueError
        A figure is not finite.
    """
    return (_encode(_rounded(document), "") + "\n").encode("utf-8")


def json_of(value: Any) -> bytes:
    """Return the bytes of the JSON document that the value is: equal ones of equal values."""
    return encode_document(value.document())


def decode_document(data: bytes, type_: type[_T], name: str) -> _T:
    """Read a JSON document into a typed value.

    Raises
    ------
    FileError
        Not JSON, or not of that type; the message names the key.
    """
    broken = (msgspec.DecodeError, UnicodeDecodeError, RecursionError)
    with refused(FileError, name, "not the JSON document that it should be: {}", *broken):
        return msgspec.json.decode(data, type=type_)


def _rounded(value: Any) -> Any:
    if isinstance(value, float):
        if not math.isfinite(value):
            raise ValueError(f"{value} cannot be written to JSON")
        return float(f"{value:.{SIGNIFICANT_DIGITS}g}") + 0.0  # + 0.0 turns -0.0 into 0.0
    if isinstance(value, Mapping):
        return {str(k): _rounded(v) for k, v in value.items()}
    return [_rounded(v) for v in value] if isinstance(value, (list, tuple)) else value


def _encode(value: Any, indent: str) -> str:
    inner = indent + "  "
    if isinstance(value, dict) and value:
        items = (f"{inner}{json.dumps(k)}: {_encode(v, inner)}" for k, v in value.items())
        return "{\n" + ",\n".join(items) + f"\n{indent}}}"
    if isinstance(value, list) and any(isinstance(v, dict) for v in value):
        items = (inner + _encode(v, inner) for v in value)
        return "[\n" + ",\n".join(items) + f"\n{indent}]"
    return json.dumps(value, ensure_ascii=False)
