"""Residuals on a scale where all noise is of unit variance and unrelated.

A specimen's own noise is taken out by the Cholesky factor of its covariance, what specimens share
by the inverse root of ``I + V V'`` with V the whitened shared columns, which is of low rank. So
what laws or batches may well be off by counts no more than its prior allows.
"""

from dataclasses import dataclass

import numpy as np

from planner.arrays import FloatArray, IntArray
from planner.errors import ArgumentError
from planner.gap.features.table import FeatureTable
from planner.gap.where.noise import Noise

__all__ = ["Whitening", "orthonormal"]


@dataclass(frozen=True, slots=True, eq=False)
class Whitening:
    """The way from N figures to N numbers of unit noise.

    Attributes
    ----------
    specimen : (n,)
        Places in the campaign of the specimens that have figures.
    starts : (n + 1,)
        Rows of specimen i are ``starts[i]`` to ``starts[i + 1]``.
    inverse_roots
        Of each specimen's covariance.
    directions, shrink : (N, q), (q,)
        What specimens share, orthonormal, and how much of it is taken off.
    """

    specimen: IntArray
    starts: IntArray
    inverse_roots: tuple[FloatArray, ...]
    directions: FloatArray
    shrink: FloatArray

    @classmethod
    def of(cls, table: FeatureTable, noise: Noise) -> "Whitening":
        """Return the whitening of a table's figures.

        Raises
        ------
        ArgumentError
            Blocks or shared columns do not fit the table, or a block is no covariance.
        """
        specimen, first = np.unique(table.specimen, return_index=True)
        starts = np.append(first, len(table))
        sizes = np.diff(starts).tolist()
        if [len(block) for block in noise.block_covariance] != sizes:
            got = [len(block) for block in noise.block_covariance]
            raise ArgumentError(f"noise: blocks of {got} figures; the specimens have {sizes}")
        if noise.shared.shape[0] != len(table):
            raise ArgumentError(
                f"noise: shared has {noise.shared.shape[0]} rows; the table has {len(table)}"
            )
        try:
            roots = tuple(
                np.linalg.inv(np.linalg.cholesky(block)) for block in noise.block_covariance
            )
        except np.linalg.LinAlgError:
            raise ArgumentError(
                "noise: a specimen's covariance is not positive definite; add the sensor's noise "
                "to its diagonal"
            ) from None
        own = cls(specimen, starts, roots, np.zeros((len(table), 0)), np.zeros(0))
        shared = own.of_specimens(noise.shared)
        if shared.shape[1]:
            directions, singular, _ = np.linalg.svd(shared, full_matrices=False)
            own = cls(specimen, starts, roots, directions, 1.0 - 1.0 / np.sqrt(1.0 + singular**2))
        return own

    def of_specimens(self, columns: FloatArray) -> FloatArray:
        """Return columns, (N, ...), with each specimen's own noise whitened."""
        pieces = [
            root @ columns[a:b]
            for root, a, b in zip(
                self.inverse_roots, self.starts[:-1], self.starts[1:], strict=True
            )
        ]
        return np.concatenate(pieces)

    def of_all(self, whitened: FloatArray) -> FloatArray:
        """Return what `of_specimens` gave with that whitened which specimens share."""
        along = (self.directions.T @ whitened).T * self.shrink
        return np.asarray(whitened - self.directions @ along.T, dtype=np.float64)

    def __call__(self, columns: FloatArray) -> FloatArray:
        """Return columns, (N, ...), whitened."""
        return self.of_all(self.of_specimens(columns))

    def summed(self, values: FloatArray) -> FloatArray:
        """Return sums over each specimen's rows, (n, ...)."""
        sums: FloatArray = np.add.reduceat(values, self.starts[:-1], axis=0)
        return sums


def orthonormal(columns: FloatArray, besides: FloatArray | None = None) -> FloatArray:
    """Return an orthonormal basis of columns, (N, k), and of what is in them beside another."""
    if not columns.shape[1]:
        return columns
    scale = np.linalg.norm(columns, axis=0)
    left: FloatArray = columns[:, scale > 0.0] / scale[scale > 0.0]
    if besides is not None and left.shape[1]:
        for _ in range(2):  # once more for rounding
            left = left - besides @ (besides.T @ left)
    if not left.shape[1]:
        return left
    basis, singular, _ = np.linalg.svd(left, full_matrices=False)
    # Columns were of unit length: what is left of less than a hundredth is the other's.
    kept: FloatArray = np.ascontiguousarray(basis[:, singular > 1e-2])
    return kept
