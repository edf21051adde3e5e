"""Loops as machine code: kept on disk under a digest of all it is made of, or compiled."""

import contextlib
import ctypes
import functools
import gc
import hashlib
import importlib
import importlib.machinery
import importlib.metadata
import importlib.util
import json
import os
import pickle
import platform
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

__all__ = ["Loop", "compile_ahead"]

# Numba's own cache looks at the file of a loop alone. But machine code also holds the loops that it
# calls and the constants that it names, from whatever file. So the name of a file here is a digest
# of all of these, as the interpreter has them: sources may have changed since they were loaded.
# Files of one name hold the same, so that processes and checkouts need not know of each other.
#
# What is kept is called without numba, whose import takes a quarter of a short command: LLVM links
# the machine code to numba's helpers in C, and numba's entry into it, which takes and returns
# Python's objects, is made a function. What has to be unpickled, named tuples, arrays that are
# returned, errors that are raised, it asks numba for, which is imported then.


_compiling = threading.RLock()


class Loop:
    """A function over arrays, as machine code for each set of types that it is called with.

    Attributes
    ----------
    py_func
        The function as it is written.
    options
        How numba compiles it.
    """

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        functools.update_wrapper(self, function)
        self.py_func, self.options = function, options
        self._entries: dict[tuple[Any, ...], Callable[..., Any]] = {}

    def __call__(self, *arguments: Any) -> Any:
        """Run the machine code for these types, found or made when they are first met."""
        key = tuple(map(_seen, arguments))
        entry = self._entries.get(key)
        if entry is None:
            with _compiling:
                entry = self._entries[key] = self._entry(arguments)
        return entry(*arguments)

    @property
    def _numba_type_(self) -> Any:
        """What numba takes it for where another loop names it."""
        return self._dispatcher._numba_type_

    @functools.cached_property
    def _dispatcher(self) -> Any:
        """What numba knows the loop by."""
        import numba

        return numba.njit(**self.options)(self.py_func)

    def _entry(self, arguments: tuple[Any, ...]) -> Callable[..., Any]:
        """Return what takes arguments of these types."""
        path = self._path(arguments)
        if path is None:
            self._compile(arguments)
            return self._dispatcher  # type: ignore[no-any-return]
        with contextlib.suppress(*_UNUSABLE):
            return self._kept(path)
        with _turn(path):
            with contextlib.suppress(*_UNUSABLE):  # what another process compiled meanwhile
                return self._kept(path)
            compiled = self._compile(arguments)
            with contextlib.suppress(*_UNUSABLE, pickle.PicklingError):  # a full disk, say
                scratch = path.with_suffix(f".{os.getpid()}")
                scratch.write_bytes(pickle.dumps(_linkable(compiled)))
                scratch.replace(path)
                _sweep(path.parent.parent, path.stat().st_mtime)
        return compiled.entry_point  # type: ignore[no-any-return]

    def _kept(self, path: Path) -> Callable[..., Any]:
        entry = _linked(pickle.loads(path.read_bytes()), self.py_func)
        with contextlib.suppress(OSError):  # another user's
            os.utime(path)  # for _sweep
        return entry

    def _compile(self, arguments: tuple[Any, ...]) -> Any:
        """Return what numba compiles for these types."""
        searching = gc.isenabled()
        gc.disable()  # for cycles of garbage, an eighth of the time of compiling
        try:
            import numba

            types = tuple(map(numba.typeof, arguments))
            self._dispatcher.compile(types)
        finally:
            if searching:
                gc.enable()
        return self._dispatcher.overloads[types]

    def _path(self, arguments: tuple[Any, ...]) -> Path | None:
        """Return the file for given arguments and this processor; None where none can be kept."""
        if (folder := _folder()) is None:
            return None
        try:
            words = [*map(_type_word, arguments), *_processor()]
            digest = hashlib.sha256("\n".join(words).encode())
            # Of the loop, and of the file's layout.
            for part in (*_parts(self, []), *_parts_of_code(_linkable.__code__, {}, [])):
                digest.update(b"%d %b" % (len(part), part))
        except _NoNameError:
            return None
        name = f"{self.py_func.__module__}.{self.py_func.__name__}"
        return folder / f"{name}-{digest.hexdigest()[:32]}.nbc"


_UNUSABLE = (
    OSError, EOFError, pickle.UnpicklingError,  # a file that is gone, cut short or damaged
    AttributeError, ImportError, KeyError, RuntimeError, TypeError,  # numba from within is another
)  # fmt: skip
"""What a file cannot be linked for, or written; the loop is compiled then."""


@cache
def _folder() -> Path | None:
    """Return the folder of these versions: as the user says, beside the package, or the user's."""
    version = importlib.metadata.version
    name = (
        f"loops-python{platform.python_version()}-numba{version('numba')}"
        f"-llvmlite{version('llvmlite')}-numpy{np.__version__}"
    )
    said = os.environ.get("NUMBA_CACHE_DIR")
    for parent in map(Path, [said]) if said else _usual_folders():
        folder = parent / name
        with contextlib.suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()
            return folder
    return None


def _usual_folders() -> Iterator[Path]:
    yield Path(__file__).parent / "__pycache__"
    from numba.misc.appdirs import AppDirs

    yield Path(AppDirs("planner", appauthor=False).user_cache_dir)  # type: ignore[no-untyped-call]


@contextlib.contextmanager
def _turn(path: Path) -> Iterator[None]:
    """Wait while another process compiles what is to be kept here; a dead one is not waited for."""
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(ImportError, OSError):  # Windows, or a folder without locks
            from fcntl import LOCK_EX, flock

            lock = stack.enter_context(path.with_suffix(".lock").open("w"))
            stack.callback(path.with_suffix(".lock").unlink, missing_ok=True)
            flock(lock, LOCK_EX)
        yield


_UNUSED_S = 30 * 24 * 3600


def _sweep(folder: Path, now_s: float) -> None:
    """Remove what no process has used for a month; one that still wants it compiles it again."""
    for path in folder.glob("loops-*/*"):
        with contextlib.suppress(OSError):  # another process sweeps too
            if path.stat().st_mtime < now_s - _UNUSED_S:
                path.unlink()


# ------------------------------------------------------------------------------------------------
# The types of arguments, as numba tells them apart.


_MEMORY = 0x1 | 0x2 | 0x100 | 0x400  # numpy's flags C and F contiguous, aligned, writeable


def _seen(value: Any) -> Any:
    """Return what decides how a value is taken, at least."""
    if (kind := type(value)) is np.ndarray:
        return value.dtype, value.ndim, value.flags.num & _MEMORY
    if kind is int:
        return kind if value.bit_length() < 64 else "no int64"
    return (kind, *map(_seen, value)) if isinstance(value, tuple) else kind


def _type_word(value: Any) -> str:
    """Return the same as a word, one for all of a numba type."""
    kind = type(value)
    if kind is np.ndarray:
        flags = value.flags
        layout = "C" if flags.c_contiguous else "F" if flags.f_contiguous else "A"
        return f"{value.dtype!r} {value.ndim} {layout} {flags.writeable} {flags.aligned}"
    if isinstance(value, tuple):
        return f"{kind.__module__}.{kind.__qualname__}({', '.join(map(_type_word, value))})"
    if kind is int and value.bit_length() >= 64:
        raise _NoNameError
    if value is None:
        return "None"
    if kind in (bool, int, float, complex) or isinstance(value, np.generic):
        return repr(np.dtype(kind))
    raise _NoNameError


# ------------------------------------------------------------------------------------------------
# Machine code, linked without numba.


_Linkable = tuple[bytes, str, list[tuple[str, list[Any]]], list[str]]
"""Code, the name of its entry, the environments that it names, each with constants, and the symbols
that it needs. The last environment is that of the loop itself."""


def _linkable(compiled: Any) -> _Linkable:
    """Return what is to be kept of what numba compiled."""
    library = compiled.library
    if library.has_dynamic_globals or compiled.lifted or compiled.reload_init:
        raise _NoNameError
    own = compiled.environment
    others = [each for each in compiled._find_referenced_environments() if each is not own]
    environments = [(each.env_name, list(each.consts)) for each in (*others, own)]
    module = library._final_module
    symbols = (*module.functions, *module.global_variables)
    declared = (value.name for value in symbols if value.is_declaration)
    needed = [name for name in declared if not name.startswith("llvm.")]
    entry = compiled.fndesc.llvm_cpython_wrapper_name
    return library._get_compiled_object(), entry, environments, needed


def _linked(kept: _Linkable, function: Callable[..., Any]) -> Callable[..., Any]:
    """Return the entry into machine code that was kept."""
    code, entry, environments, needed = kept
    llvm, engine, functions = _engine()
    if not all(map(llvm.address_of_symbol, needed)):
        raise _NoNameError
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    held = []
    for name, constants in environments:
        environment = functions.Environment({})
        environment.consts[:] = constants
        ctypes.c_void_p.from_address(engine.get_global_value_address(name)).value = id(environment)
        held.append(environment)
    return functions.make_function(  # type: ignore[no-any-return]
        sys.modules[function.__module__], function.__name__, function.__doc__ or "",
        engine.get_function_address(entry), held[-1], (engine, *held),
    )  # fmt: skip


@cache
def _engine() -> tuple[Any, Any, Any]:
    """Return LLVM, its linker, which knows what machine code calls, and the maker of functions."""
    from llvmlite import binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    functions, helpers = map(_part_of_numba, ("_dynfunc", "_helperlib"))
    memory = _part_of_numba("core.runtime._nrt_python")
    memory.memsys_use_cpython_allocator()
    symbols = {"_Py_NoneStruct": id(None)}
    for module in (functions, helpers):
        symbols |= {f"numba_{name}": place for name, place in module.c_helpers.items()}
    for name, place in memory.c_helpers.items():
        symbols[name if name.startswith("_") else f"NRT_{name}"] = place
    for name, value in vars(importlib.import_module("builtins")).items():
        if isinstance(value, type) and issubclass(value, BaseException):
            symbols[f"PyExc_{name}"] = id(value)
    for name, place in symbols.items():
        llvm.add_symbol(name, place)
    machine = llvm.Target.from_default_triple().create_target_machine()
    return llvm, llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine), functions


def _part_of_numba(name: str) -> ModuleType:
    """Return an extension module of numba, imported without numba, which finds it later."""
    called = f"numba.{name}"
    if called not in sys.modules:
        package: Any = importlib.util.find_spec("numba")
        folder = Path(package.submodule_search_locations[0], *name.split(".")[:-1])
        spec: Any = importlib.machinery.PathFinder.find_spec(called, [str(folder)])
        sys.modules[called] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(sys.modules[called])
    return sys.modules[called]


@cache
def _processor() -> tuple[str, ...]:
    """Return for what code is compiled: the processor, and what the user tells numba."""
    from llvmlite import binding as llvm  # 0.06 s, which files without kernels do not pay

    features = ""
    with contextlib.suppress(RuntimeError):  # where LLVM cannot tell
        features = llvm.get_host_cpu_features().flatten()
    said = {name: value for name, value in os.environ.items() if name.startswith("NUMBA_")}
    said.pop("NUMBA_CACHE_DIR", None)
    host = (llvm.get_process_triple(), llvm.get_host_cpu_name(), features)
    return (*host, *sorted(f"{name}={value}" for name, value in said.items()))


# ------------------------------------------------------------------------------------------------
# The first run after installation: other processes compile what it is about to meet.
#
# A process compiles one loop at a time, and a first simulation for 20 s. So further processors go
# meanwhile through the loops that first_run.json lists, in the order in which a command meets them,
# from the last back to where the run is by then. Whatever becomes of them, it compiles by itself
# what it does not find.


_started: list[subprocess.Popen[bytes]] = []


def compile_ahead(*commands: str) -> None:
    """Start processes that compile the loops of commands, unless all but one are kept."""
    folder = _folder()
    kept = {path.name.rpartition("-")[0] for path in folder.glob("*.nbc")} if folder else set()
    if folder is None or sum(name not in kept for name, _ in _listed(commands)) < 2:
        return
    # os.cpu_count() counts processors that this process may not use; not every system tells.
    allowed = getattr(os, "sched_getaffinity", None)
    shares = min((len(allowed(0)) if allowed else os.cpu_count() or 1) - 1, 2)
    for share in range(shares):
        code = f"from {__name__} import compile_share as c; c({share}, {shares}, *{commands})"
        with contextlib.suppress(OSError):
            _started.append(
                subprocess.Popen(
                    [sys.executable, "-c", code],
                    stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                )
            )  # fmt: skip


def compile_share(share: int, shares: int, *commands: str) -> None:
    """Compile and keep every `shares`-th of the loops of commands, the last ones first."""
    for name, types in _listed(commands)[::-1][share::shares]:
        _named(name)._entry(tuple(map(_of_type, types)))


def _listed(commands: tuple[str, ...]) -> list[tuple[str, list[Any]]]:
    """Return the loops of commands with the types of their arguments, in the order of first use."""
    listed = json.loads(Path(__file__).with_name("first_run.json").read_bytes())
    return [loop for command in commands for loop in listed[command]]


def _named(name: str) -> Any:
    module, _, own = name.rpartition(".")
    return getattr(importlib.import_module(module), own)


def _of_type(told: Any) -> Any:
    """Return a value of a type: a scalar's name, {class: types} of a tuple, or what an array is."""
    if isinstance(told, str):
        return np.dtype(told).type()
    if isinstance(told, dict):
        ((kind, types),) = told.items()
        made = _named(kind)
        return getattr(made, "_make", made)(map(_of_type, types))  # named or not
    dtype, dimensions, layout, writeable = told
    dtype = np.dtype(dtype if isinstance(dtype, str) else [*map(tuple, dtype)])
    shape = (2,) * dimensions
    array = np.zeros(shape, dtype) if layout == "C" else np.zeros((*shape, 2), dtype)[..., 0]
    array.flags.writeable = writeable
    return array


# ------------------------------------------------------------------------------------------------
# What machine code is made of.


class _NoNameError(RuntimeError):
    """A loop takes in something whose content cannot be told."""


_OF_A_VERSION = {"builtins", "llvmlite", "math", "numba", "numpy", "typing"}


def _parts(value: Any, seen: list[FunctionType]) -> Iterator[bytes]:
    """Yield what a loop, or something that it names, brings into machine code."""
    value = getattr(value, "_defn", value)  # of an intrinsic
    if isinstance(value, Loop):
        yield repr(sorted(value.options.items())).encode()
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
