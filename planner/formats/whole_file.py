"""Files that are whole or absent."""

import contextlib
from pathlib import Path

from planner.errors import OutputError

__all__ = ["check_absent", "write_whole"]


def check_absent(path: str | Path, *, force: bool) -> None:
    """Refuse to replace a file, unless that is wished.

    Raises
    ------
    OutputError
        There is a file already and `force` is false, or the path is a folder.
    """
    path = Path(path)
    if path.is_dir():
        raise OutputError(f"{path}: is a folder; name a file")
    if path.exists() and not force:
        raise OutputError(f"{path}: exists already; replace it with --force, or name another file")


def write_whole(path: str | Path, data: bytes) -> None:
    """Write a file by way of a temporary one beside it.

    Raises
    ------
    OutputError
        The system refused.
    """
    path = Path(path)
    scratch = path.with_name(f".{path.name}.partial")
    try:
        scratch.write_bytes(data)
        scratch.replace(path)
    except OSError as error:
        raise OutputError(
            f"{path}: cannot be written ({error.strerror or error}); choose another place"
        ) from error
    finally:
        with contextlib.suppress(OSError):
            scratch.unlink()
