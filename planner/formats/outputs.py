"""Results on disk: whole or absent, one run at a time, and never in place of what others wrote."""

import contextlib
import errno
import glob
import hashlib
import itertools
import os
import re
import shutil
import stat
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import msgspec

from planner.errors import OutputError, listed, refused
from planner.formats.files import encode_document

__all__ = [
    "SEAL",
    "check_absent",
    "check_target",
    "claimed",
    "files_within",
    "is_as_written",
    "is_scratch",
    "is_sealed",
    "is_stream",
    "new_folder",
    "seal",
    "write_folder",
    "write_whole",
]


# ------------------------------------------------------------------------------------------------
# Scratch files and folders beside their targets, and those that killed runs have left.
#
# Only who has claimed a target makes them. The system takes a claim's lock back when the process
# ends, however it ends, and the next run that claims the target removes what is left.


def is_scratch(name: str) -> bool:
    """Tell whether a file or folder is called as what a run writes into before it is whole."""
    return _SCRATCH.fullmatch(name) is not None


_SCRATCH = re.compile(r"\..+\.partial-\d+(-\d+)?")


@contextmanager
def _scratch_beside(target: Path, *, folder: bool) -> Iterator[Path]:
    """Make a hidden file or folder beside `target`, which renaming reaches without copying.

    What is left of it in the end is removed.
    """
    for number in itertools.count():
        more = f"-{number}" if number else ""
        scratch = target.with_name(f".{target.name}.partial-{os.getpid()}{more}")
        with contextlib.suppress(FileExistsError):  # of a claim within this one
            scratch.mkdir() if folder else scratch.open("xb").close()
            break
    with contextlib.ExitStack() as held:
        held.callback(_remove, scratch)
        _lock(scratch, held)  # what is made anew in place of what is open has another inode
        yield scratch


def _remove(path: Path) -> None:
    try:
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)
        else:
            with contextlib.suppress(OSError):
                path.unlink()
    except KeyboardInterrupt:  # which ends the command once this is done
        _remove(path)
        raise


# ------------------------------------------------------------------------------------------------
# A target belongs to one run from its first look at it until it is written.


_LOCKS = find_spec("fcntl") is not None
"""Windows has no such locks: there what killed runs left stays."""

_Place = str | Path
"""As it was named, which messages repeat."""

_SYSTEM = (OSError, RuntimeError, TypeError)
"""What it refuses by; the second tells a loop of links, the third what is no path."""

_claims: dict[Path, bool] = {}
"""Targets of this process, and whether what is there may be replaced."""


@contextmanager
def claimed(output: _Place, *, force: bool = True) -> Iterator[Path]:
    """Keep other runs from a target; within, this process may claim it again.

    Folders above it that are missing are made, and are gone again where nothing came into them.

    Parameters
    ----------
    output
        A file or folder to write.
    force
        Whether a file that has come there meanwhile may be replaced.

    Yields
    ------
    pathlib.Path
        The target with links and dots resolved.

    Raises
    ------
    OutputError
        Another run is writing it, or its folder cannot be written into.
    """
    with contextlib.ExitStack() as held:
        with refused(OutputError, output, "cannot be written ({}); choose another place", *_SYSTEM):
            target = Path(output).resolve()
            if target not in _claims:
                for missing in reversed([p for p in target.parents if not p.exists()]):
                    missing.mkdir(exist_ok=True)
                    held.callback(_remove_empty, missing)
                lock = target.with_name(f".{target.name}.partial-0")
                lock.touch()
                while not _lock(lock, held):
                    if lock.exists():
                        raise OutputError(
                            f"{output}: another run is writing it; wait for that one, or name "
                            "another place"
                        )
                    lock.touch()  # that run has ended just now
                held.callback(_remove, lock)
                for left in target.parent.glob(f".{glob.escape(target.name)}.partial-*"):
                    if _LOCKS and is_scratch(left.name) and left != lock:
                        _remove(left)
                _claims[target] = force
                held.callback(_claims.pop, target)
        yield target


def _lock(path: Path, held: contextlib.ExitStack) -> bool:
    """Lock a file or folder until then; False where another run has, or it is not of this name."""
    if not _LOCKS:
        return True
    import fcntl

    try:
        handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW)
        held.callback(os.close, handle)
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return os.path.samestat(os.fstat(handle), path.lstat())
    except OSError:
        return False


def _remove_empty(folder: Path) -> None:
    with contextlib.suppress(OSError):
        folder.rmdir()


# ------------------------------------------------------------------------------------------------
# Files that are whole or absent.


_STREAMS = ("-", "/dev/stdout", "/dev/fd/1", "/proc/self/fd/1")


def is_stream(output: _Place) -> bool:
    """Tell whether an output is what the process prints, by one of its usual names."""
    return str(output) in _STREAMS


def check_absent(path: _Place, *, force: bool) -> None:
    """Refuse to replace a file, unless that is wished, and whatever is no file.

    Raises
    ------
    OutputError
        There is a file already, or a link to none, and `force` is false; or the path is a folder,
        a device or a pipe; or its folder is missing.
    """
    if is_stream(path):
        return
    with refused(OutputError, path, "{}; choose another place", *_SYSTEM):
        path = Path(path)
        _check_link(path, "name another file", force=force)
        if path.is_dir():
            raise OutputError(f"{path}: is a folder; name a file")
        if path.exists() and not path.is_file():
            raise OutputError(f"{path}: is a device or a pipe; name a file, or - for the terminal")
        if path.exists() and not force:
            raise OutputError(
                f"{path}: exists already; replace it with `force`, or name another file"
            )
        folder = (path.resolve() if path.is_symlink() else path).parent
        if not folder.is_dir():
            raise OutputError(f"{path}: there is no folder {folder}; create that first")


def _check_link(path: Path, other: str, *, force: bool) -> None:
    if not path.is_symlink() or path.exists():
        return
    with contextlib.suppress(FileNotFoundError):
        path.stat()  # which a loop of links refuses
    if not force:
        raise OutputError(
            f"{path}: is a link to {path.readlink()}, where nothing is; make that with `force`, "
            f"or {other}"
        )


def write_whole(path: _Place, data: bytes) -> None:
    """Write a file by way of a temporary one beside it; a link is followed.

    ``-`` and ``/dev/stdout`` stand for what the process prints.

    Raises
    ------
    OutputError
        The system refused, the path is a device or a pipe, or another run writes it.
    """
    if is_stream(path):
        if (out := sys.__stdout__) is None:
            raise OutputError("standard output is closed; name a file")
        out.flush()
        out.buffer.write(data)
        out.flush()
        return
    with claimed(path) as target:
        check_absent(path, force=_claims[target])
        with (
            refused(OutputError, path, "cannot be written ({}); choose another place", OSError),
            _scratch_beside(target, folder=False) as scratch,
        ):
            scratch.write_bytes(data)
            scratch.replace(target)


# ------------------------------------------------------------------------------------------------
# What in a folder planner has written: what its record lists, as it was written.


_RECORDS = ("plan.json", "diagnosis.json", "slices.json", "tables.json")
_LIST = "files_sha256"
"""The record's key: the hash of each other file by its path."""

_PAGE = "plan.html"
_SEAL = b'<meta name="sha256" content="%s">'
_OPEN = _SEAL % (64 * b"0")
_NAMED = 5


SEAL = _OPEN.decode()
"""What a page has in its head that `seal` is to close."""


def seal(page: bytes) -> bytes:
    """Put a page's own hash into it, by which it is known as written by planner and unchanged.

    A plan's page may be made anew when its record is long written. The hash is that of the page
    with zeros in its place.
    """
    return page.replace(_OPEN, _SEAL % hashlib.sha256(page).hexdigest().encode(), 1)


def is_sealed(path: Path) -> bool:
    """Tell whether a page is as `seal` made it."""
    page = path.read_bytes()
    at = page.find(_OPEN[:-66])
    return at >= 0 and seal(page[:at] + _OPEN + page[at + len(_OPEN) :]) == page


def _kept_files(root: Path, record: str, listed: Mapping[str, str]) -> Iterator[str]:
    """Yield what planner has not written into a folder, or not as it is now.

    Parameters
    ----------
    root
        One that planner wrote.
    record, listed
        The name of its JSON document, and the folder's files with their hashes listed there.

    Yields
    ------
    str
        Files, links and empty folders by their paths within it; folders end in a slash.
    """
    for name, path in _within(root):
        if name.endswith("/"):
            ours = any(path.iterdir()) or any(file.startswith(name) for file in listed)
        else:
            ours = name == record or (
                stat.S_ISREG(path.lstat().st_mode) and is_as_written(root, name, listed.get(name))
            )
        if not ours:
            yield name


def is_as_written(root: Path, name: str, sha256: str | None) -> bool:
    """Tell whether a file of a folder has the hash that was listed, or is a page made anew."""
    path = root / name
    return _sha256(path) == sha256 or (name == _PAGE and is_sealed(path))


def _sha256(path: Path) -> str:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _within(root: Path) -> Iterator[tuple[str, Path]]:
    """Yield what lies in a folder, folders before their content and with a slash, no scratch."""
    for path in sorted(root.iterdir()):
        if is_scratch(path.name):
            continue
        if path.is_dir() and not path.is_symlink():
            yield f"{path.name}/", path
            for name, inner in _within(path):
                yield f"{path.name}/{name}", inner
        else:
            yield path.name, path


def _listed(root: Path, record: str) -> Mapping[str, str]:
    old = "does not list the folder's files (an earlier version, or another program, wrote it)"
    said = f"its {record} {old}, so that nothing in it is replaced"
    broken = (KeyError, msgspec.MsgspecError, UnicodeDecodeError, RecursionError)
    with refused(OutputError, root, f"{said}; name another folder, or remove this one", *broken):
        document = msgspec.json.decode((root / record).read_bytes(), type=dict[str, Any])
        return msgspec.convert(document[_LIST], dict[str, str])


def files_within(folder: _Place) -> Iterator[Path]:
    """Yield the files of a folder that a command given this folder may read.

    Of a folder that planner wrote these are its record and the files listed there; of another all,
    but for what planner wrote into a folder of its own within it.
    """
    root = Path(folder)
    for record in _RECORDS:
        if (root / record).is_file():
            yield root / record
            try:
                yield from (root / name for name in _listed(root, record))
            except (OutputError, OSError):  # of an earlier version
                yield from root.glob("stl/*")
            return
    for path in sorted(root.iterdir()):
        if path.is_dir():
            if not path.is_symlink() and not any((path / record).is_file() for record in _RECORDS):
                yield from files_within(path)
        elif not is_scratch(path.name):
            yield path


# ------------------------------------------------------------------------------------------------
# Output folders that are whole or absent.


def check_target(
    folder: _Place, *, force: bool = False, record: str | None = "plan.json", option: str = "output"
) -> tuple[str, ...]:
    """Make sure that a folder may be written, before hours are spent on its content.

    An absent or empty folder may; one that planner wrote may with `force`, unless `record` is None;
    anything else never.

    Parameters
    ----------
    record
        The document by which such a folder is known, and which lists its files.
    option
        By which the folder is named.

    Returns
    -------
    tuple of str
        What is there and stays; see `_kept_files`.

    Raises
    ------
    OutputError
        Says what is there and what to do.
    """
    kept: tuple[str, ...] = ()
    other = f"name another folder with `{option}`"
    with refused(OutputError, folder, "{}", *_SYSTEM):
        _check_link(Path(folder), other, force=force)
        target = Path(folder).resolve()
        if target.is_dir():
            content = {e.name for e in target.iterdir() if not is_scratch(e.name)}
            if not content:
                return kept
            if record is None:
                raise OutputError(f"{folder}: exists already; {other}")
            if record not in content:
                raise OutputError(
                    f"{folder}: exists and holds no {record}, so planner did not write it and "
                    f"does not replace it; {other}"
                )
            if not force:
                raise OutputError(f"{folder}: exists already; replace it with `force`, or {other}")
            listed = _listed(target, record)
            kept = tuple(sorted(_kept_files(target, record, listed)))
            changed = [name for name in kept if name in listed]
            _refuse(folder, changed, "was changed since planner wrote it", option)
        elif target.exists():
            raise OutputError(f"{folder}: is a file; name a folder with `{option}`")
        above = next(path for path in target.parents if path.exists())
        if not (above.is_dir() and os.access(above, os.W_OK | os.X_OK)):
            raise OutputError(
                f"{folder}: the folder {above} cannot be written into; choose another "
                f"place with `{option}`"
            )
    return kept


def _refuse(folder: _Place, names: list[str], why: str, option: str) -> None:
    if names:
        raise OutputError(
            f"{folder}: {listed(names, _NAMED)} {why}, and is not replaced; move that elsewhere, "
            f"or name another folder with `{option}`"
        )


@contextmanager
def new_folder(
    folder: _Place, *, force: bool = False, record: str | None = "plan.json", option: str = "output"
) -> Iterator[Path]:
    """Write a folder whole or not at all.

    The body writes into the folder it is given, a sibling of the target, which takes the
    target's name when the body ends. Whatever stops the body, an interrupt included, leaves the
    target as it was and nothing beside it. The record, which the body writes too, then lists the
    folder's other files with their hashes. Of an earlier folder what planner wrote is replaced, and
    whatever else is in it stays.

    Parameters
    ----------
    folder
        The target; see `check_target` for what may be there.
    force
        Replace what planner wrote there.
    record, option
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
    if Path(os.path.realpath(folder)) not in _claims:  # whoever claims a target has looked at it
        check_target(folder, force=force, record=record, option=option)
    said = f"{{}}; nothing was written; choose another place with `{option}`"
    with (
        claimed(folder) as target,
        refused(OutputError, folder, said, OSError),
        _scratch_beside(target, folder=True) as scratch,
    ):
        made = scratch.stat()
        yield scratch
        if not os.path.samestat(made, scratch.stat()):  # what was made anew lacks a part
            raise FileNotFoundError(errno.ENOENT, "what was being written has been removed")
        if record is not None:
            _list_files(scratch / record)
        # What has come there meanwhile stays, too.
        kept = check_target(folder, force=force, record=record, option=option)
        seen = {name for name, _ in _within(target)} if target.is_dir() else set()
        _carry(target, scratch, kept, folder, option)
        _take_name(scratch, target, folder, force, option)
        _remove_earlier(scratch, target, seen, folder)


def write_folder(
    folder: _Place,
    files: Mapping[str, bytes],
    *,
    force: bool = False,
    record: str | None = None,
    option: str = "output",
) -> Path:
    """Write files by their paths into a folder, whole or not at all; see `new_folder`."""
    with new_folder(folder, force=force, record=record, option=option) as scratch:
        for name, content in files.items():
            (scratch / name).parent.mkdir(parents=True, exist_ok=True)
            (scratch / name).write_bytes(content)
    return Path(folder)


def _list_files(record: Path) -> None:
    """Add to a folder's record the hashes of its other files."""
    document = msgspec.json.decode(record.read_bytes(), type=dict[str, Any])
    document[_LIST] = {
        name: _sha256(path)
        for name, path in _within(record.parent)
        if path != record and not name.endswith("/")
    }
    record.write_bytes(encode_document(document))


def _carry(target: Path, scratch: Path, kept: tuple[str, ...], folder: _Place, option: str) -> None:
    """Let what is not planner's stand in the new folder too: by a second name, else as a copy."""
    in_the_way = [name for name in kept if _stands(scratch, name)]
    _refuse(folder, in_the_way, "is in the way, was not written by planner", option)
    for name in kept:
        place = scratch / name
        missing = [p for p in (place, *place.parents) if p.is_relative_to(scratch)][::-1]
        for above in missing if name.endswith("/") else missing[:-1]:
            if not above.exists():
                above.mkdir()
                shutil.copystat(target / above.relative_to(scratch), above)
        if not name.endswith("/"):
            try:
                os.link(target / name, place, follow_symlinks=False)
            except (OSError, NotImplementedError):  # not every file system has second names
                shutil.copy2(target / name, place, follow_symlinks=False)


def _stands(scratch: Path, name: str) -> bool:
    """Tell whether something new has a name, or is a file where that needs a folder."""
    above = [p for p in (scratch / name).parents if p.is_relative_to(scratch) and p != scratch]
    is_there = os.path.lexists(scratch / name) and not name.endswith("/")
    return is_there or any(os.path.lexists(p) and not p.is_dir() for p in above)


def _take_name(scratch: Path, target: Path, folder: _Place, force: bool, option: str) -> None:
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
    aside = Path(tempfile.mkdtemp(prefix=f".{target.name}.replaced-", dir=target.parent))
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


def _remove_earlier(scratch: Path, target: Path, seen: set[str], folder: _Place) -> None:
    said = "is written, but the earlier one could not be deleted whole ({})"
    with refused(OutputError, folder, f"{said}; delete {scratch}", OSError):
        if scratch.exists():
            left = list(_within(scratch))
            for closed in (scratch, *(path for name, path in left if name.endswith("/"))):
                closed.chmod(closed.stat().st_mode | stat.S_IRWXU)  # by its owner, perhaps
            for name, path in left:
                if name not in seen and path.exists() and not os.path.lexists(target / name):
                    path.rename(target / name)  # it came in the very last moment
            shutil.rmtree(scratch)
