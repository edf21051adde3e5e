"""Array types that cross module borders, loops over arrays compiled once, one thread of BLAS."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any, TypeAlias, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from planner.compilation_cache import Loop

__all__ = [
    "BoolArray",
    "Float32Array",
    "FloatArray",
    "Int32Array",
    "IntArray",
    "Point",
    "as_point",
    "freeze",
    "inner_kernel",
    "interrupted",
    "kernel",
    "normal_quantile",
    "numbers_in",
    "one_blas_thread",
    "students_t",
]


# ------------------------------------------------------------------------------------------------
# Names for the array types that cross module borders.


FloatArray: TypeAlias = NDArray[np.float64]
Float32Array: TypeAlias = NDArray[np.float32]
Int32Array: TypeAlias = NDArray[np.int32]
IntArray: TypeAlias = NDArray[np.integer[Any]]
BoolArray: TypeAlias = NDArray[np.bool_]
Point: TypeAlias = tuple[float, float, float]


def as_point(values: FloatArray | Float32Array) -> Point:
    """Return three coordinates as plain numbers."""
    return float(values[0]), float(values[1]), float(values[2])


_Number = TypeVar("_Number", int, float)


def numbers_in(words: Iterable[Any], kind: Callable[[Any], _Number]) -> list[_Number]:
    """Return words as numbers of a kind; none where one of them is none."""
    try:
        return [kind(word) for word in words]
    except (TypeError, ValueError):
        return []


def freeze(value: object, *names: str) -> None:
    """Make arrays of a frozen dataclass that is being made its own, doubles, and unchangeable."""
    for name in names:
        if getattr(value, name) is not None:
            array = np.array(getattr(value, name), dtype=np.float64)
            array.setflags(write=False)
            object.__setattr__(value, name, array)


# ------------------------------------------------------------------------------------------------
# How far a level reaches on both sides.


def normal_quantile(level: float = 0.95) -> float:
    """Return the deviations about its mean within which a normal variable is, at a level."""
    from statistics import NormalDist

    return NormalDist().inv_cdf(0.5 + level / 2.0)


def students_t(level: float, specimens: float) -> float:
    """Return how many standard errors of so many specimens' mean the two-sided level reaches."""
    from scipy.special import stdtrit

    return float(stdtrit(specimens - 1, 0.5 + 0.5 * level))


# ------------------------------------------------------------------------------------------------
# Compile a loop over arrays once, and keep it where the user can write.


F = TypeVar("F", bound=Callable[..., Any])


def kernel(function: F) -> F:
    """Compile `function` with numba in no-python mode, cached on disk where possible.

    Floating point stays strict (no fast-math, no fused operations), so that results are the
    same bytes on every machine. Where neither the package's folder nor the user's cache folder
    is writable, the function is compiled anew in each process. What it names must be a number,
    an array, a tuple of such, numpy, math, or another kernel; else too it is compiled anew.

    Other threads run meanwhile, among them the command line's that ends the process on SIGTERM: an
    array that the loop changes must not be given to another at the same time.

    A first run waits for all kernels it meets, about 0.03 s a line: call each with one set of
    types, give it its arrays instead of having them made inside, and keep out of it what
    numpy does as well. An array that takes over another's elements in one statement costs 2 to 3 s,
    for the text of the error if they did not fit: loop over them.
    """
    return _compiled(function, nogil=True)


def inner_kernel(function: F) -> F:
    """Compile a function into the kernels that call it; Python does not. See `kernel`."""
    return _compiled(function, no_cpython_wrapper=True, forceinline=True)


def _compiled(function: F, **more: Any) -> F:
    return cast(F, Loop(function, {"error_model": "numpy", "no_cfunc_wrapper": True, **more}))


# ------------------------------------------------------------------------------------------------
# Threads of BLAS.


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Let the matrix routines of numpy and of scipy, each with a BLAS of its own, take one thread.

    Threads of BLAS spin while they wait for each other: on busy processors two take tens of times
    as long as one. The number is that of the whole process, and as before in the end.
    """
    with _blas().limit(limits=1, user_api="blas"):
        yield


@cache
def _blas() -> Any:
    import scipy.linalg  # noqa: F401 - its BLAS would be missed if it were loaded later
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


# ------------------------------------------------------------------------------------------------
# An interrupt, seen through compiled loops.


def interrupted(error: BaseException | None) -> bool:
    """Tell whether an interrupt is behind an error: compiled loops wrap it in a SystemError."""
    while error is not None:
        if isinstance(error, KeyboardInterrupt):
            return True
        error = error.__cause__ or error.__context__
    return False
