"""Which version of the method answered: a hash of its source."""

import hashlib
from pathlib import Path

import planner.gap

__all__ = ["method_sha256"]


def method_sha256(folder: Path | None = None) -> str:
    """Return the sha256 over the sources of planner.gap: their paths and bytes, sorted by path.

    Parameters
    ----------
    folder
        Another folder than that of the installed planner.gap.
    """
    folder = folder or Path(planner.gap.__path__[0])
    found = hashlib.sha256()
    sources = (path for path in folder.rglob("*") if path.suffix in (".py", ".toml"))
    for path in sorted(sources, key=lambda p: p.relative_to(folder).as_posix()):
        data = path.read_bytes()
        found.update(f"{path.relative_to(folder).as_posix()} {len(data)}\n".encode())
        found.update(data)
    return found.hexdigest()
