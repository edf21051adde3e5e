"""The order of axes: what explains most first, then what adds to it.

Only axes along which the gap varies at the 5 % level compete; the others follow by their p-value.
The first explains most, each degree of freedom costing the logarithm of the number of specimens
(Schwarz). The others follow by what they add to the first, and by a part of what they explain
alone: an axis that merely goes along with the first falls behind one that does not, and before
one that explains nothing.
"""

import math
from collections.abc import Sequence

import numpy as np

from planner.arrays import FloatArray
from planner.gap.where.axis import Axis
from planner.gap.where.share import CLAIM, Excess, explained_by
from planner.gap.where.whitening import orthonormal

__all__ = ["SIGNIFICANT", "ranked"]

SIGNIFICANT = 0.05
_ALONE = 0.3


def ranked(
    axes: Sequence[Axis], p: FloatArray, excess: Excess
) -> tuple[tuple[int, ...], tuple[float, ...]]:
    """Return the order of axes, and what each adds to the first as a share of its own."""
    cost = math.log(max(len(excess.whitening.specimen), 2))
    alone = np.array([excess.explained(a) - (cost - 1.0) * a.basis.shape[1] for a in axes])
    alone = np.maximum(alone, 0.0)
    found = [i for i in range(len(axes)) if p[i] <= SIGNIFICANT]
    if not found:
        order = sorted(range(len(axes)), key=lambda i: (p[i], -alone[i]))
        return tuple(order), (1.0,) * len(axes)
    first = max(found, key=lambda i: (alone[i], -p[i]))
    adds = np.array([_added(axis, axes[first], excess, cost) for axis in axes])
    adds[first] = alone[first]
    merit = adds + _ALONE * alone
    rest = sorted((i for i in found if i != first), key=lambda i: -merit[i])
    others = sorted((i for i in range(len(axes)) if i not in found), key=lambda i: p[i])
    parts = tuple(
        float(added / max(own, 1e-12)) if own > 0.0 else 1.0
        for added, own in zip(adds, alone, strict=True)
    )
    return (first, *rest, *others), parts


def _added(axis: Axis, first: Axis, excess: Excess, cost: float) -> float:
    if axis is first:
        return 0.0
    if axis.is_common:
        own = max(explained_by(first.basis, excess.apart) - float(first.basis.shape[1]), 0.0)
        return max(excess.in_common - CLAIM * own, 0.0)
    beside = axis.basis if first.is_common else orthonormal(axis.basis, besides=first.basis)
    return max(explained_by(beside, excess.apart) - cost * float(beside.shape[1]), 0.0)
