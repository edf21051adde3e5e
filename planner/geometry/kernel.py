"""Compile a loop over arrays once, and keep it where the user can write."""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

__all__ = ["free_kernel", "inner_kernel", "kernel"]

F = TypeVar("F", bound=Callable[..., Any])


def kernel(function: F) -> F:
    """Compile `function` with numba in no-python mode, cached on disk where possible.

    Floating point stays strict (no fast-math, no fused operations), so that results are the
    same bytes on every machine. Where neither the package's folder nor the user's cache folder
    is writable, the function is compiled anew in each process.

    A first run waits for all kernels it meets, about 0.03 s a line: call each with one set of
    types, give it its arrays instead of having them made inside, and keep out of it what
    numpy does as well.
    """
    return _compiled(function)


def free_kernel(function: F) -> F:
    """Compile a function that lets other threads run meanwhile; see `kernel`."""
    return _compiled(function, nogil=True)


def inner_kernel(function: F) -> F:
    """Compile a function that other kernels call and Python does not; see `kernel`."""
    return _compiled(function, no_cpython_wrapper=True)


def _compiled(function: F, **more: Any) -> F:
    options: dict[str, Any] = {"error_model": "numpy", "no_cfunc_wrapper": True, **more}
    try:
        return cast(F, numba.njit(cache=True, **options)(function))
    except RuntimeError:
        return cast(F, numba.njit(**options)(function))
