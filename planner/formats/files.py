"""Files and folders that are whole or absent, and JSON in one canonical form."""

import contextlib
import itertools
import json
import math
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any, TypeVar

import msgspec

from planner.errors import FileError, OutputError

__all__ = [
    "SIGNIFICANT_DIGITS",
    "FolderKind",
    "check_absent",
    "check_target",
    "decode_document",
    "encode_document",
    "new_folder",
    "write_whole",
]


# ------------------------------------------------------------------------------------------------
# Files that are whole or absent.


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
        raise OutputError(f"{path}: exists already; replace it with `force`, or name another file")


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


# ------------------------------------------------------------------------------------------------
# Output folders that are whole or absent.


@dataclass(frozen=True, slots=True)
class FolderKind:
    """What planner writes into one kind of folder.

    Attributes
    ----------
    mark
        The file by which such a folder is known.
    own
        Patterns of its files, the mark among them, which may so be replaced.
    """

    mark: str
    own: tuple[str, ...]


_PLAN = FolderKind(
    "plan.json",
    (
        "plan.json",
        "*.3mf",
        "HOWTO.md",
        "plan.html",
        "part.png",
        "section.png",
        "report.html",
        "design.json",
        "profile.csv",
        "stl/*.stl",
    ),
)
"""The folder of a plan."""

_NAMED = 5


def check_target(
    folder: str | Path,
    *,
    force: bool = False,
    kind: FolderKind | None = _PLAN,
    option: str = "output",
) -> Path:
    """Make sure that a folder may be written, before hours are spent on its content.

    An absent or empty folder may; one that holds files of its kind alone may with `force`, unless
    its kind is None; anything else never.

    Parameters
    ----------
    option
        By which the folder is named.

    Returns
    -------
    pathlib.Path
        The folder with links and dots resolved.

    Raises
    ------
    OutputError
        Says what is there and what to do.
    """
    try:
        target = Path(folder).resolve()
        if target.is_dir():
            content = {entry.name for entry in target.iterdir()}
            if not content:
                return target
            if kind is None:
                raise OutputError(f"{folder}: exists already; name another folder with `{option}`")
            if kind.mark not in content:
                raise OutputError(
                    f"{folder}: exists and holds no {kind.mark}, so planner did not write it and "
                    f"does not replace it; name another folder with `{option}`"
                )
            strangers = _strangers(target, kind)
            if strangers:
                raise OutputError(
                    f"{folder}: holds {_listed(strangers)}, which planner did not write and does "
                    f"not delete; move that elsewhere, or name another folder with `{option}`"
                )
            if not force:
                raise OutputError(
                    f"{folder}: exists already; replace it with `force`, or name another folder "
                    f"with `{option}`"
                )
        elif target.exists():
            raise OutputError(f"{folder}: is a file; name a folder with `{option}`")
        elif not target.parent.is_dir():
            raise OutputError(
                f"{folder}: there is no folder {target.parent} to put it into; create that first"
            )
    except (OSError, RuntimeError) as error:  # RuntimeError: a loop of links
        raise OutputError(f"{folder}: {_reason(error)}") from error
    return target


@contextmanager
def new_folder(
    folder: str | Path,
    *,
    force: bool = False,
    kind: FolderKind | None = _PLAN,
    option: str = "output",
) -> Iterator[Path]:
    """Write a folder whole or not at all.

    The body writes into the folder it is given, a sibling of the target, which takes the
    target's name when the body ends. Whatever stops the body, an interrupt included, leaves the
    target as it was and nothing beside it.

    Parameters
    ----------
    folder
        The target; see `check_target` for what may be there.
    force
        Replace an earlier folder of the same kind.
    option
        As in `check_target`.

    Yields
    ------
    pathlib.Path
        The folder to write into.

    Raises
    ------
    OutputError
        The target may not be written, or the system refused: no permission, no space. Or the
        target is written and a rest of the earlier folder is left; the message says where.
    """
    target = check_target(folder, force=force, kind=kind, option=option)
    scratch = None
    try:
        scratch = _make_sibling(target, "partial")
        yield scratch
        # What has come there meanwhile.
        check_target(folder, force=force, kind=kind, option=option)
        earlier = _exchange(scratch, target)
    except OSError as error:
        raise OutputError(
            f"{folder}: {_reason(error)}; nothing was written; choose another place with `{option}`"
        ) from error
    finally:
        if scratch is not None:
            shutil.rmtree(scratch, ignore_errors=True)
    try:
        if earlier is not None:
            shutil.rmtree(earlier)
    except OSError as error:
        raise OutputError(
            f"{folder}: is written, but the earlier one could not be deleted whole "
            f"({_reason(error)}); delete {earlier}"
        ) from error


def _make_sibling(target: Path, suffix: str) -> Path:
    """Make a folder beside `target`, which renaming reaches without copying."""
    for number in itertools.count():
        sibling = target.with_name(f".{target.name}.{suffix}{number or ''}")
        try:
            sibling.mkdir()
        except FileExistsError:
            continue
        return sibling
    raise AssertionError("count() does not end")


def _strangers(folder: Path, kind: FolderKind) -> list[str]:
    """List what is not planner's in a folder, sorted; folders end in a slash."""
    own = {path for pattern in kind.own for path in folder.glob(pattern) if path.is_file()}
    within = {folder / PurePosixPath(pattern).parent for pattern in kind.own} - {folder}
    own |= {path for path in within if path.is_dir()}
    own = {path for path in own if not path.is_symlink()}
    return sorted(
        path.relative_to(folder).as_posix() + "/" * (path.is_dir() and not path.is_symlink())
        for path in folder.rglob("*")
        if path not in own
    )


def _listed(names: list[str]) -> str:
    more = len(names) - _NAMED
    return ", ".join(names[:_NAMED]) + (f" and {more} more" if more > 0 else "")


def _exchange(scratch: Path, target: Path) -> Path | None:
    """Rename `scratch` to `target`; return where what was there has gone."""
    if not target.exists():
        scratch.rename(target)
        return None
    earlier = _make_sibling(target, "replaced")
    kept = earlier / target.name
    try:
        target.rename(kept)
        scratch.rename(target)
    except BaseException:
        if kept.exists() and not target.exists():
            kept.rename(target)
        earlier.rmdir()
        raise
    return earlier


def _reason(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)


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


def decode_document(data: bytes, type_: type[_T], name: str) -> _T:
    """Read a JSON document into a typed value.

    Raises
    ------
    FileError
        Not JSON, or not of that type; the message names the key.
    """
    try:
        return msgspec.json.decode(data, type=type_)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise FileError(f"{name}: not the JSON document that it should be: {error}") from error


def _rounded(value: Any) -> Any:
    if isinstance(value, float):
        if not math.isfinite(value):
            raise ValueError(f"{value} cannot be written to JSON")
        return float(f"{value:.{SIGNIFICANT_DIGITS}g}") + 0.0  # + 0.0 turns -0.0 into 0.0
    if isinstance(value, Mapping):
        return {str(k): _rounded(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_rounded(v) for v in value]
    return value


def _encode(value: Any, indent: str) -> str:
    inner = indent + "  "
    if isinstance(value, dict) and value:
        items = (f"{inner}{json.dumps(k)}: {_encode(v, inner)}" for k, v in value.items())
        return "{\n" + ",\n".join(items) + f"\n{indent}}}"
    if isinstance(value, list) and any(isinstance(v, dict) for v in value):
        items = (inner + _encode(v, inner) for v in value)
        return "[\n" + ",\n".join(items) + f"\n{indent}]"
    return json.dumps(value, ensure_ascii=False)
