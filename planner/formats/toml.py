"""TOML, read: what a person wrote, refused with its place where it is none."""

import tomllib
from typing import Any

from planner.errors import FileError

__all__ = ["decode_toml"]


def decode_toml(data: bytes, name: str) -> dict[str, Any]:
    """Read the bytes of a TOML file, which errors call `name`.

    Raises
    ------
    FileError
        Not UTF-8, not TOML, or nested too deep or with numbers too long for Python.
    """
    try:
        return tomllib.loads(data.decode("utf-8"))
    except (ValueError, RecursionError) as error:  # the first of text, of TOML and of long numbers
        raise FileError(f"{name}: not a TOML file: {error}") from error
