"""The compilation cache: machine code of loops on disk, under a digest of all it is made of."""

import contextlib
import hashlib
import os
import pickle
import platform
import tempfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import llvmlite
import numba
import numpy as np
from numba.core.caching import NullCache
from numba.core.compiler import CompileResult
from numba.core.dispatcher import Dispatcher
from numba.core.runtime.nrt import rtsys
from numba.core.serialize import dumps
from numba.misc.appdirs import AppDirs

__all__ = ["keep"]

# Numba's own cache looks at the file of a loop alone. But machine code also holds the loops that it
# calls and the constants that it names, from whatever file. So the name of a file here is a digest
# of all of these, as the interpreter has them: sources may have changed since they were loaded.
# Files of one name hold the same, so that processes and checkouts need not know of each other.


def keep(loop: Any) -> None:
    """Let a loop find its machine code on disk, and leave it there, if a folder can be written."""
    folder = _folder()
    if folder is not None:
        loop._cache = _Cache(loop, folder)


@cache
def _folder() -> Path | None:
    """Return the folder of these versions: as the user says, beside the package, or the user's."""
    name = (
        f"loops-python{platform.python_version()}-numba{numba.__version__}"
        f"-llvmlite{llvmlite.__version__}-numpy{np.__version__}"
    )
    beside = Path(__file__).parent / "__pycache__"
    users = AppDirs("planner", appauthor=False).user_cache_dir  # type: ignore[no-untyped-call]
    said = os.environ.get("NUMBA_CACHE_DIR")
    for parent in [said] if said else [beside, users]:
        folder = Path(parent) / name
        with contextlib.suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()
            return folder
    return None


class _Cache(NullCache):
    """What numba asks for the machine code of one loop, and gives it to once it is compiled."""

    def __init__(self, loop: Any, folder: Path) -> None:
        self._loop, self._folder = loop, folder

    @property
    def cache_path(self) -> str:
        return str(self._folder)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        # Not `target_context.refresh()`, which also loads what only compiling needs: 0.15 s.
        rtsys.initialize(target_context)
        with contextlib.suppress(OSError, EOFError, pickle.UnpicklingError, _NoNameError):
            path = self._path(sig, target_context.codegen())
            parts = pickle.loads(path.read_bytes())
            with contextlib.suppress(OSError):  # another user's
                os.utime(path)  # for _sweep
            return CompileResult._rebuild(target_context, *parts)  # type: ignore[no-untyped-call]
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        if data.library.has_dynamic_globals or not all(lifted.can_cache for lifted in data.lifted):
            return
        with contextlib.suppress(OSError, _NoNameError):  # a full disk, say
            path = self._path(sig, data.codegen)
            scratch = path.with_suffix(f".{os.getpid()}")
            scratch.write_bytes(dumps(data._reduce()))  # type: ignore[no-untyped-call]
            scratch.replace(path)
            _sweep(self._folder.parent, path.stat().st_mtime)

    def _path(self, sig: Any, codegen: Any) -> Path:
        """Return the file for given types of arguments and this kind of processor."""
        digest = hashlib.sha256(repr((sig, codegen.magic_tuple())).encode())
        for part in _parts(self._loop, []):
            digest.update(b"%d %b" % (len(part), part))
        name = f"{self._loop.__module__}.{self._loop.__name__}"
        return self._folder / f"{name}-{digest.hexdigest()[:32]}.nbc"


_UNUSED_S = 30 * 24 * 3600


def _sweep(folder: Path, now_s: float) -> None:
    """Remove what no process has used for a month; one that still wants it compiles it again."""
    for path in folder.glob("loops-*/*"):
        with contextlib.suppress(OSError):  # another process sweeps too
            if path.stat().st_mtime < now_s - _UNUSED_S:
                path.unlink()


# ------------------------------------------------------------------------------------------------
# What machine code is made of.


class _NoNameError(Exception):
    """A loop takes in something whose content cannot be told."""


_OF_A_VERSION = {"builtins", "llvmlite", "math", "numba", "numpy", "typing"}


def _parts(value: Any, seen: list[FunctionType]) -> Iterator[bytes]:
    """Yield what a loop, or something that it names, brings into machine code."""
    value = getattr(value, "_defn", value)  # of an intrinsic
    if isinstance(value, Dispatcher):
        yield repr(sorted(value.targetoptions.items())).encode()
        value = value.py_func
    if isinstance(value, FunctionType):
        if value in seen:
            yield b"%d" % seen.index(value)
        else:
            seen.append(value)
            for cell in value.__closure__ or ():
                yield from _parts(cell.cell_contents, seen)
            yield from _parts_of_code(value.__code__, value.__globals__, seen)
    elif isinstance(value, tuple):
        yield b"%d" % len(value)
        for item in value:
            yield from _parts(item, seen)
    elif isinstance(value, np.ndarray):
        yield repr((value.dtype, value.shape)).encode() + value.tobytes()
    else:
        is_module = isinstance(value, ModuleType)
        home = value.__name__ if is_module else getattr(value, "__module__", type(value).__module__)
        text = home if is_module else repr(value)
        if home.partition(".")[0] not in _OF_A_VERSION or " at 0x" in text:
            raise _NoNameError
        yield text.encode()


def _parts_of_code(
    code: CodeType, names: dict[str, Any], seen: list[FunctionType]
) -> Iterator[bytes]:
    yield code.co_code + code.co_exceptiontable
    yield repr((code.co_names, code.co_varnames, code.co_cellvars, code.co_freevars)).encode()
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _parts_of_code(constant, names, seen)
        else:
            yield repr(constant).encode()
    for name in code.co_names:
        if name in names:
            yield from _parts(names[name], seen)
