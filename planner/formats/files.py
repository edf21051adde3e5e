"""Files and folders that are whole or absent, and JSON in one canonical form."""

import contextlib
import errno
import itertools
import json
import math
import os
import re
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
    "is_scratch",
    "new_folder",
    "write_whole",
]


# ------------------------------------------------------------------------------------------------
# Scratch files and folders beside their targets, and those that killed runs have left.
#
# Whoever writes locks its scratch; the system takes the lock back when the process ends, however it
# ends. So a scratch that can be locked is nobody's, and the next run to the same target removes it.


def is_scratch(name: str) -> bool:
    """Tell whether a file or folder is called as what a run writes into before it is whole."""
    return _SCRATCH.fullmatch(name) is not None


_SCRATCH = re.compile(r"\..+\.partial-\d+(-\d+)?")


@contextmanager
def _scratch_beside(target: Path, *, folder: bool) -> Iterator[Path]:
    """Make a hidden file or folder beside `target`, which renaming reaches without copying.

    What is left of it in the end is removed, and so is what killed runs have left there.
    """
    _remove_dead(target)
    for number in itertools.count():
        scratch = target.with_name(
            f".{target.name}.partial-{os.getpid()}" + (f"-{number}" if number else "")
        )
        try:
            scratch.mkdir() if folder else scratch.open("xb").close()
        except FileExistsError:
            continue
        with _locked(scratch) as ours:
            if not ours:  # another run took it for dead before it was locked
                continue
            try:
                yield scratch
            finally:
                _remove(scratch)
        return


def _remove_dead(target: Path) -> None:
    """Remove what runs to this target that were killed have left beside it."""
    with contextlib.suppress(OSError):  # none of it is in the way
        for path in target.parent.iterdir():
            if path.name.startswith(f".{target.name}.partial-") and is_scratch(path.name):
                with _locked(path) as dead:
                    if dead:
                        _remove(path)


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with contextlib.suppress(OSError):
            path.unlink()


@contextmanager
def _locked(path: Path) -> Iterator[bool]:
    """Lock a file or folder; False where someone else has, or it is not the one of this name."""
    try:
        import fcntl
    except ImportError:  # no such locks on Windows: what is left stays, and names are one's own
        yield path.name.startswith(".") and f"-{os.getpid()}" in path.name
        return
    handle = -1
    try:
        try:
            handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW)
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            ours = os.path.samestat(os.fstat(handle), path.lstat())
        except OSError:
            ours = False
        yield ours
    finally:
        if handle >= 0:
            os.close(handle)


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
    try:
        with _scratch_beside(path, folder=False) as scratch:
            scratch.write_bytes(data)
            scratch.replace(path)
    except OSError as error:
        raise OutputError(
            f"{path}: cannot be written ({error.strerror or error}); choose another place"
        ) from error


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
            content = {e.name for e in target.iterdir() if not is_scratch(e.name)}
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
        if not os.access(target.parent, os.W_OK | os.X_OK):  # where the scratch folder comes to be
            raise OutputError(
                f"{folder}: the folder {target.parent} cannot be written into; choose another "
                f"place with `{option}`"
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
    try:
        with _scratch_beside(target, folder=True) as scratch:
            made = scratch.stat()
            yield scratch
            if not os.path.samestat(made, scratch.stat()):  # what was made anew lacks what was lost
                raise FileNotFoundError(errno.ENOENT, "what was being written has been removed")
            # What has come there meanwhile.
            check_target(folder, force=force, kind=kind, option=option)
            _take_name(scratch, target, folder, force=force, option=option)
            _remove_earlier(scratch, folder)
    except OSError as error:
        raise OutputError(
            f"{folder}: {_reason(error)}; nothing was written; choose another place with `{option}`"
        ) from error


def _take_name(
    scratch: Path, target: Path, folder: str | Path, *, force: bool, option: str
) -> None:
    """Give `scratch` the name `target`; an earlier folder of that name then has that of `scratch`.

    Both change names in one step, so that a run that is killed leaves the one or the other.
    """
    try:
        scratch.rename(target)  # where there is nothing, or an empty folder
    except OSError as error:
        if error.errno not in (errno.ENOTEMPTY, errno.EEXIST):
            raise
        if not force:
            raise OutputError(
                f"{folder}: another run has written it meanwhile; nothing was written; replace it "
                f"with `force`, or name another folder with `{option}`"
            ) from error
        if not _exchange(scratch, target):
            _exchange_in_steps(scratch, target)


_HERE, _EXCHANGE = -100, 2  # AT_FDCWD and RENAME_EXCHANGE of Linux


def _exchange(one: Path, other: Path) -> bool:
    """Let two folders change names in one step; False where the system cannot."""
    import ctypes

    rename: Any = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if rename is None:
        return False
    if rename(_HERE, os.fsencode(one), _HERE, os.fsencode(other), _EXCHANGE) == 0:
        return True
    number = ctypes.get_errno()
    if number in (errno.EINVAL, errno.ENOSYS, errno.ENOTSUP, errno.EPERM):
        return False
    raise OSError(number, os.strerror(number), str(other))


def _exchange_in_steps(scratch: Path, target: Path) -> None:
    """Do what `_exchange` does by way of a third name, which no run removes."""
    for number in itertools.count():
        aside = target.with_name(f".{target.name}.replaced{number or ''}")
        try:
            aside.mkdir()
        except FileExistsError:
            continue
        break
    kept = aside / target.name
    try:
        target.rename(kept)
        scratch.rename(target)
    except BaseException:
        if kept.exists() and not target.exists():
            kept.rename(target)
        aside.rmdir()
        raise
    kept.rename(scratch)
    aside.rmdir()


def _remove_earlier(scratch: Path, folder: str | Path) -> None:
    try:
        if scratch.exists():
            shutil.rmtree(scratch)
    except OSError as error:
        raise OutputError(
            f"{folder}: is written, but the earlier one could not be deleted whole "
            f"({_reason(error)}); delete {scratch}"
        ) from error


def _strangers(folder: Path, kind: FolderKind) -> list[str]:
    """List what is not planner's in a folder, sorted; folders end in a slash."""
    own = {path for pattern in kind.own for path in folder.glob(pattern) if path.is_file()}
    within = {folder / PurePosixPath(pattern).parent for pattern in kind.own} - {folder}
    own |= {path for path in within if path.is_dir()}
    own = {path for path in own if not path.is_symlink()}
    return sorted(
        path.relative_to(folder).as_posix() + "/" * (path.is_dir() and not path.is_symlink())
        for path in folder.rglob("*")
        if path not in own and not is_scratch(path.name)
    )


def _listed(names: list[str]) -> str:
    more = len(names) - _NAMED
    return ", ".join(names[:_NAMED]) + (f" and {more} more" if more > 0 else "")


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
