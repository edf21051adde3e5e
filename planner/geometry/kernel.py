"""Compile a loop over arrays once, and keep it where the user can write."""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

__all__ = ["kernel"]

F = TypeVar("F", bound=Callable[..., Any])


def kernel(function: F) -> F:
    """Compile `function` with numba in no-python mode, cached on disk where possible.

    Floating point stays strict (no fast-math, no fused operations), so that results are the
    same bytes on every machine. Where neither the package's folder nor the user's cache folder
    is writable, the function is compiled anew in each process.
    """
    try:
        return cast(F, numba.njit(cache=True, error_model="numpy")(function))
    except RuntimeError:
        return cast(F, numba.njit(error_model="numpy")(function))
