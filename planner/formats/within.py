"""What a folder's documents name: files and folders that lie in that folder, and no others."""

import stat
from pathlib import Path, PureWindowsPath

from planner.errors import FileError

__all__ = ["path_within"]


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
    try:
        root, place = Path(folder).resolve(), path.resolve()
        # What is a drive or a root on one machine is so on all.
        if PureWindowsPath(name).anchor or root not in place.parents:
            raise FileError(
                f"{folder}: {name!r}, which is named there, lies outside the folder; it was not "
                "read: put it into the folder, and name it by its path from there"
            )
        mode = place.stat().st_mode if place.exists() else stat.S_IFREG
    except (OSError, ValueError, RuntimeError) as error:  # a zero byte; a loop of links
        reason = getattr(error, "strerror", None) or error
        raise FileError(f"{path}: cannot be read ({reason}); check the name") from error
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise FileError(f"{path}: is a device, a pipe or a socket; it was not read: give a file")
    return path
