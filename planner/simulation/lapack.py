"""LAPACK and BLAS for compiled loops: factor, divide and multiply dense matrices in place."""

from functools import cache
from typing import Any, TypeAlias

import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import get_cython_function_address, intrinsic
from numpy.typing import NDArray

from planner.numerics import IntArray, inner_kernel

__all__ = ["Int", "address_of", "blas_addresses", "gemm", "potrf", "syrk", "trsm"]


# Addresses of scipy's functions are asked for at run time and given to kernels as numbers, so that
# kernels can be cached on disk. Matrices too are addresses: columns one after the other, with a
# leading dimension. `integers` is scratch of six numbers, by which arguments are handed over.

Int: TypeAlias = Any
"""In kernels, of any width."""


@cache
def blas_addresses() -> NDArray[np.int64]:
    """Return the addresses of dpotrf, dtrsm, dsyrk and dgemm."""
    return np.array(
        [get_cython_function_address("scipy.linalg.cython_lapack", "dpotrf")]
        + [
            get_cython_function_address("scipy.linalg.cython_blas", name)
            for name in ("dtrsm", "dsyrk", "dgemm")
        ],
        dtype=np.int64,
    )


def _calling(typing_context: Any, address: Any, pointers: Any) -> Any:
    """Call the function at an address with a tuple of pointers, all as integers."""
    unpacked: Any = cgutils.unpack_tuple

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        pointer = ir.IntType(8).as_pointer()
        given = [builder.inttoptr(value, pointer) for value in unpacked(builder, arguments[1])]
        function = ir.FunctionType(ir.VoidType(), [pointer] * len(given)).as_pointer()
        builder.call(builder.inttoptr(arguments[0], function), given)
        return context.get_dummy_value()

    return types.void(address, pointers), code


_call: Any = intrinsic(_calling)


@inner_kernel
def address_of(array: Any) -> Int:
    """Return where an array begins; it must live on while the address is used."""
    return np.int64(array.ctypes.data)


_LETTERS = np.frombuffer(b"LRTN", dtype=np.uint8)
_NUMBERS = np.array([1.0, -1.0, 0.0])


@inner_kernel
def potrf(address: Int, n: Int, a: Int, lda: Int, integers: IntArray) -> Int:
    """Factor; return 0, or which pivot failed, from 1."""
    integers[0], integers[1], integers[2] = n, lda, 0
    i = address_of(integers)
    _call(address, (address_of(_LETTERS), i, a, i + 4, i + 8))
    return integers[2]


@inner_kernel
def trsm(
    address: Int, side: Int, transposed: bool, m: Int, n: Int, a: Int, lda: Int, b: Int,
    ldb: Int, integers: IntArray,
) -> None:  # fmt: skip
    """Divide b, (m, n), by a lower triangle, from the left (0) or the right (1)."""
    integers[0], integers[1], integers[2], integers[3] = m, n, lda, ldb
    i, letters = address_of(integers), address_of(_LETTERS)
    turned = letters + (2 if transposed else 3)
    one = address_of(_NUMBERS)
    _call(
        address,
        (letters + side, letters, turned, letters + 3, i, i + 4, one, a, i + 8, b, i + 12),
    )


@inner_kernel
def syrk(
    address: Int, n: Int, k: Int, a: Int, lda: Int, c: Int, ldc: Int, integers: IntArray,
) -> None:  # fmt: skip
    """Take a times its transpose from the lower triangle of c."""
    integers[0], integers[1], integers[2], integers[3] = n, k, lda, ldc
    i, letters, numbers = address_of(integers), address_of(_LETTERS), address_of(_NUMBERS)
    _call(address, (letters, letters + 3, i, i + 4, numbers + 8, a, i + 8, numbers, c, i + 12))


@inner_kernel
def gemm(
    address: Int, transposed: bool, m: Int, n: Int, k: Int, a: Int, lda: Int, b: Int,
    ldb: Int, scale: Int, c: Int, ldc: Int, integers: IntArray,
) -> None:  # fmt: skip
    """Set c to a, or its transpose, times b (scale 0); or take that from c (scale 1)."""
    integers[0], integers[1], integers[2] = m, n, k
    integers[3], integers[4], integers[5] = lda, ldb, ldc
    i, letters, numbers = address_of(integers), address_of(_LETTERS), address_of(_NUMBERS)
    turned = letters + (2 if transposed else 3)
    by, keep = (numbers + 8, numbers) if scale else (numbers, numbers + 16)
    _call(
        address,
        (turned, letters + 3, i, i + 4, i + 8, by, a, i + 12, b, i + 16, keep, c, i + 20),
    )
