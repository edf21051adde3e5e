"""All inner products that weighing hypotheses takes, whitened once.

Columns are the residual, the figures of every node of every form, patterns of the unknown, each
specimen's own gain, and nuisances: calibration of the laws and batches. Weights on specimens and a
factor on the scatter enter afterwards, so that resampling and leaving out cost one product each.
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from planner.arrays import FloatArray, IntArray
from planner.gap.noise import SpecimenNoise

__all__ = ["Elimination", "Gram", "Whitened", "whiten"]


@dataclass(frozen=True, slots=True, eq=False)
class Whitened:
    """Columns (N, X) whitened specimen by specimen; the last `nuisances` have prior deviation 1.

    Attributes
    ----------
    first_row : (n + 1,)
        Where each specimen's rows begin.
    """

    columns: FloatArray
    first_row: IntArray
    nuisances: int

    def gram(self, weight: FloatArray | None = None) -> "Gram":
        """Return the inner products, specimens weighted by `weight` (n,)."""
        counts = np.diff(self.first_row)
        if weight is None:
            return Gram(self.columns.T @ self.columns, float(counts.sum()), self.nuisances)
        rows = np.repeat(weight, counts)
        kept = rows > 0.0
        part = self.columns[kept] * np.sqrt(rows[kept])[:, None]
        return Gram(part.T @ part, float(rows.sum()), self.nuisances)


@dataclass(frozen=True, slots=True, eq=False)
class Gram:
    """Inner products (X, X) of weighted columns and the weighted number of rows."""

    products: FloatArray
    rows: float
    nuisances: int

    def eliminate(
        self, scale: float = 1.0, extra: tuple[FloatArray, FloatArray] | None = None
    ) -> "Elimination":
        """Integrate over nuisances, the noise being `scale` times as large.

        Parameters
        ----------
        extra
            Further nuisances of prior deviation 1: inner products with all columns, (e, X), and
            with one another, (e, e).
        """
        kept = len(self.products) - self.nuisances
        m = self.products / scale**2
        inner, cross = m[kept:, kept:], m[kept:, :kept]
        if extra is not None:
            more, own = extra[0] / scale**2, extra[1] / scale**2
            cross = np.concatenate([cross, more[:, :kept]])
            inner = np.block([[inner, more[:, kept:].T], [more[:, kept:], own]])
        inner = inner + np.eye(len(inner))
        factor = scipy.linalg.cholesky(inner, lower=True, check_finite=False)
        half = scipy.linalg.solve_triangular(factor, cross, lower=True, check_finite=False)
        log_det = 2.0 * float(np.log(np.diagonal(factor)).sum())
        left = m[:kept, :kept] - half.T @ half
        none = -self.rows * float(np.log(scale)) - 0.5 * (float(left[0, 0]) + log_det)
        return Elimination(left, none)


@dataclass(frozen=True, slots=True, eq=False)
class Elimination:
    """Inner products of the kept columns with nuisances integrated out, and ln p(data | none)."""

    products: FloatArray
    none: float

    def part(self, columns: IntArray) -> "Elimination":
        """Return the inner products of some columns, the residual first."""
        return Elimination(self.products[np.ix_(columns, columns)], self.none)

    def with_random(self, columns: slice, amplitude: float, head: int) -> "Elimination":
        """Integrate over columns with coefficients of deviation `amplitude`; keep `head` others."""
        a = self.products
        inner = a[columns, columns] + np.eye(columns.stop - columns.start) / amplitude**2
        factor = scipy.linalg.cholesky(inner, lower=True, check_finite=False)
        half = scipy.linalg.solve_triangular(
            factor, a[columns, :head], lower=True, check_finite=False
        )
        log_det = 2.0 * float(np.log(np.diagonal(factor)).sum())
        log_det += 2.0 * len(inner) * float(np.log(amplitude))
        left = a[:head, :head] - half.T @ half
        gain = 0.5 * (float(a[0, 0]) - float(left[0, 0])) - 0.5 * log_det
        return Elimination(left, self.none + gain)


def whiten(columns: FloatArray, noise: SpecimenNoise, nuisances: int) -> Whitened:
    """Whiten columns (N, X) by each specimen's own covariance."""
    white = np.empty_like(columns)
    for rows, factor in zip(noise.rows, noise.factors, strict=True):
        white[rows] = scipy.linalg.solve_triangular(
            factor, columns[rows], lower=True, check_finite=False
        )
    first = np.array([r.start for r in noise.rows] + [len(columns)])
    return Whitened(white, first, nuisances)
