"""One axis along which a gap may vary, and how likely what is seen along it is without one."""

from dataclasses import dataclass

import numpy as np
import scipy.special

from planner.arrays import FloatArray

__all__ = ["Axis", "share_p"]


@dataclass(frozen=True, slots=True, eq=False)
class Axis:
    """One axis.

    Attributes
    ----------
    basis : (N, k)
        Orthonormal, in whitened figures: what a gap along the axis may look like.
    p : float
        Of what is seen, for this axis alone; small where the gap varies along it.
    drawn_p : (P,)
        The same figure of each draw without a gap.
    detail
        One sentence.
    least
        The chance that is left to a draw to show the very same, which `drawn_p` is without.
    is_common
        Whether it is the gap that all specimens have in common, a course over strain.
    """

    name: str
    basis: FloatArray
    p: float
    drawn_p: FloatArray
    detail: str
    is_common: bool = False
    least: float = 0.0


def share_p(explained: FloatArray, left: FloatArray, k: float, freedom: float) -> FloatArray:
    """Return the chance of explaining so much by accident: of Fisher's F, by the beta function.

    Parameters
    ----------
    explained, left
        Sums of squares, in any common unit.
    k, freedom
        Their degrees of freedom.
    """
    ratio = explained / np.maximum(explained + left, 1e-300)
    p = scipy.special.betainc(0.5 * freedom, 0.5 * k, np.clip(1.0 - ratio, 0.0, 1.0))
    floored: FloatArray = np.maximum(np.asarray(p, dtype=np.float64), 1e-300)
    return floored
