"""Axes between specimens: what is seen is held against the same with the column's cells dealt anew.

Each specimen is reduced to its scores along level, slope and bend of its curve; all that an axis
explains is a quadratic form of these. So a draw costs a few small matrices, not N figures.
"""

from dataclasses import dataclass

import numpy as np

from planner.arrays import FloatArray, IntArray
from planner.gap.where.axis import share_p
from planner.gap.where.columns import Column
from planner.gap.where.whitening import Whitening, orthonormal

__all__ = ["SpecimenScores"]

_RIDGE = 1e-7
_SAME = 1e-6
_WHOLE = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class SpecimenScores:
    """Scores of n specimens along s shapes.

    Attributes
    ----------
    own : (n, s, s)
        Information of each specimen's own figures.
    tied : (n, s, r)
        What is lost of it to what specimens share and to the common gap: the information of
        specimens i and j together is ``own_i (i = j) - tied_i tied_j'``.
    score : (n, s)
    """

    own: FloatArray
    tied: FloatArray
    score: FloatArray

    @classmethod
    def of(
        cls, whitening: Whitening, shapes: FloatArray, common: FloatArray, y: FloatArray
    ) -> "SpecimenScores":
        """Return the scores of whitened figures from which the common gap has been taken.

        Parameters
        ----------
        shapes : (N, s)
            Not whitened.
        common : (N, c)
            Orthonormal, whitened.
        y : (N,)
            Whitened, without its part along `common`.
        """
        phi = whitening.of_specimens(shapes)
        own = whitening.summed(phi[:, :, None] * phi[:, None, :])
        shrink = whitening.shrink
        # (I - Q a Q')^2 = I - Q (2 a - a^2) Q'.
        roots = np.sqrt(2.0 * shrink - shrink**2)
        shared = whitening.directions * roots
        columns = np.concatenate([shared, whitening.of_all(common)], axis=1)
        tied = whitening.summed(phi[:, :, None] * columns[:, None, :])
        score = whitening.summed(phi * whitening.of_all(y)[:, None])
        return cls(own, tied, score)

    def explained(self, coordinates: FloatArray) -> tuple[FloatArray, int]:
        """Return what axes explain, (P,), and the degrees of freedom of the first.

        Parameters
        ----------
        coordinates : (P, n, m)
            Of each specimen along each axis.
        """
        draws, n, m = coordinates.shape
        s = self.score.shape[1]
        turned = np.ascontiguousarray(np.swapaxes(coordinates, 1, 2))
        b = (turned @ self.score).reshape(draws, m * s)
        pairs = (turned[:, :, None, :] * turned[:, None, :, :]).reshape(draws, m * m, n)
        own = (pairs @ self.own.reshape(n, s * s)).reshape(draws, m, m, s, s)
        gram = own.transpose(0, 1, 3, 2, 4).reshape(draws, m * s, m * s)
        tied = (turned @ self.tied.reshape(n, -1)).reshape(draws, m * s, -1)
        gram = gram - tied @ np.swapaxes(tied, 1, 2)
        # One unit a column, from what a column has without the ties.
        unit = np.sqrt(np.einsum("pmmss->pms", own).reshape(draws, m * s))
        unit = np.maximum(unit, 1e-12 * max(float(unit.max()), 1e-150))
        gram = gram / (unit[:, :, None] * unit[:, None, :])
        b = b / unit
        rank = int(np.sum(np.linalg.eigvalsh(gram[0]) > 1e-4))
        gram += _RIDGE * np.eye(m * s)
        solved = np.linalg.solve(gram, b[:, :, None])[:, :, 0]
        return np.maximum(np.einsum("pk,pk->p", b, solved), 0.0), rank

    def total(self, known: IntArray) -> tuple[float, int]:
        """Return all that there is between specimens, and its degrees of freedom.

        By Woodbury's identity: the ties are few.
        """
        s = self.score.shape[1]
        values, vectors = np.linalg.eigh(self.own[known])
        kept = values > _RIDGE * np.maximum(values[:, -1:], 1e-150)
        roots = np.where(kept, 1.0 / np.sqrt(np.where(kept, values, 1.0)), 0.0)
        roots_of = vectors * roots[:, None, :]
        score = np.einsum("isk,is->ik", roots_of, self.score[known]).reshape(-1)
        tied = np.einsum("isk,isr->ikr", roots_of, self.tied[known]).reshape(len(known) * s, -1)
        lost, along = np.linalg.eigh(tied.T @ tied)
        # Of what the common gap takes whole, nothing is left in the scores either.
        free = lost < 1.0 - _WHOLE
        projected = along.T @ (tied.T @ score)
        total = score @ score + np.sum(projected[free] ** 2 / (1.0 - lost[free]))
        return float(total), int(kept.sum()) - int(np.sum(~free))

    def p(
        self, column: Column, places: IntArray, total: float, freedom: int
    ) -> tuple[float, FloatArray]:
        """Return the p-value of a column, and that of each draw.

        Noise is taken to be what specimens differ by beside the column, and no less than declared.
        Draws that came upon the seen arrangement are replaced by others: how likely it is is known.

        Parameters
        ----------
        places : (P, n known)
            Whose cell each known specimen is dealt, counted among the known.
        total, freedom
            See `total`, of the known specimens.
        """
        known = np.flatnonzero(column.known)
        cells = column.coordinates[known]
        coordinates = np.zeros((len(places) + 1, len(column.level), cells.shape[1]))
        coordinates[0, known] = cells
        coordinates[1:, known] = cells[places]
        explained, k = self.explained(coordinates)
        if k == 0 or freedom <= k:
            return 1.0, np.ones(len(places))
        left = np.maximum(total - explained, float(freedom - k))
        values = share_p(explained, left, k, freedom - k)
        same = np.abs(explained[1:] - explained[0]) <= _SAME * explained[0]
        drawn = values[1:]
        if same.any() and not same.all():
            drawn[same] = np.resize(drawn[~same], int(same.sum()))
        return float(values[0]), drawn

    def basis(
        self, whitening: Whitening, shapes: FloatArray, common: FloatArray, column: Column
    ) -> FloatArray:
        """Return what a gap along a column may look like in whitened figures, (N, k)."""
        of_row = np.repeat(np.arange(len(column.level)), np.diff(whitening.starts))
        cells = column.coordinates[of_row]
        columns = (cells[:, :, None] * shapes[:, None, :]).reshape(len(of_row), -1)
        return orthonormal(whitening(columns), besides=common)
