"""How much of the excess an axis explains, and how sure that is."""

from dataclasses import dataclass

import numpy as np

from planner.arrays import FloatArray
from planner.gap.where.axis import Axis
from planner.gap.where.whitening import Whitening

__all__ = ["CLAIM", "Excess", "explained_by"]

CLAIM = 3.0
"""The square of the mean of a ramp from zero, over its variance."""


@dataclass(frozen=True, slots=True, eq=False)
class Excess:
    """What there is to explain.

    An axis may claim some of the gap that all specimens have in common: with half of them at
    33 degC, soft, and half as predicted, half of the gap is common and yet lies along temperature.
    It may claim three times what the gap varies by along it, which is what a gap has in common
    that rises evenly from none. A gap that is the same everywhere is so claimed by no axis.

    Attributes
    ----------
    y, apart : (N,)
        Whitened residuals, all and without their common part.
    common : (N, c)
        Orthonormal.
    """

    whitening: Whitening
    y: FloatArray
    apart: FloatArray
    common: FloatArray

    @property
    def noise(self) -> float:
        """The least excess that shares are taken of: two deviations of pure noise."""
        return float(2.0 * np.sqrt(2.0 * len(self.y)))

    @property
    def total(self) -> float:
        """Sum of squares beyond noise."""
        return float(max(float(self.y @ self.y) - len(self.y), self.noise))

    @property
    def in_common(self) -> float:
        """Of it, what all specimens have in common."""
        return max(explained_by(self.common, self.y) - float(self.common.shape[1]), 0.0)

    def explained(self, axis: Axis) -> float:
        """Return what an axis explains beyond noise, its claim on the common gap included."""
        if axis.is_common:
            return self.in_common
        own = max(explained_by(axis.basis, self.apart) - float(axis.basis.shape[1]), 0.0)
        return own + min(CLAIM * own, self.in_common)

    def share(self, axis: Axis) -> float:
        """Return the share of the excess, 0 to 1."""
        explained = self.explained(axis)
        return explained / max(self.total, explained, 1e-12)

    def interval(self, axis: Axis, weights: FloatArray) -> tuple[float, float]:
        """Return the 90 % interval of the share over draws of specimens.

        Parameters
        ----------
        weights : (B, n)
            How often each specimen was drawn.
        """
        squares = self.whitening.summed(self.y**2) - np.diff(self.whitening.starts)
        total = np.maximum(weights @ squares, self.noise)
        common = self._drawn(self.common, self.y, weights)
        own = common
        if not axis.is_common:
            own = self._drawn(axis.basis, self.apart, weights)
            own = own + np.minimum(CLAIM * own, common)
        shares = own / np.maximum(total, np.maximum(own, 1e-12))
        share = self.share(axis)
        moved = shares + share - float(np.median(shares))
        low, high = np.quantile(np.clip(moved, 0.0, 1.0), (0.05, 0.95)).tolist()
        return min(low, share), max(high, share)

    def _drawn(self, basis: FloatArray, y: FloatArray, weights: FloatArray) -> FloatArray:
        """Explained beyond noise, of draws, (B,)."""
        k = basis.shape[1]
        if not k:
            return np.zeros(len(weights))
        score = weights @ self.whitening.summed(basis * y[:, None])
        pairs = self.whitening.summed((basis[:, :, None] * basis[:, None, :]).reshape(-1, k * k))
        gram = (weights @ pairs).reshape(-1, k, k) + 1e-3 * np.eye(k)
        solved = np.linalg.solve(gram, score[:, :, None])[:, :, 0]
        # A draw has the noise of what was measured and its own.
        found: FloatArray = np.maximum(np.einsum("bk,bk->b", score, solved) - 2.0 * k, 0.0)
        return found


def explained_by(basis: FloatArray, y: FloatArray) -> float:
    """Return the sum of squares along an orthonormal basis."""
    return float(np.sum((basis.T @ y) ** 2))
