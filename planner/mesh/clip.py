"""Hexahedra clipped by a surface between their corners: whole ones, wedges and tetrahedra."""

from typing import NamedTuple

import numpy as np

from planner.numerics import FloatArray, IntArray

__all__ = ["clip_hexahedra"]


_TETRAHEDRA = np.array(
    [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)]
)
"""Six about the diagonal from the first corner to the seventh, in VTK's order of corners: faces of
neighbours on a lattice are halved alike."""


class _Clipped(NamedTuple):
    """What is left of hexahedra; points are the given ones, then those on cut edges.

    Attributes
    ----------
    hexahedra (a, 8), wedges (b, 6), tetrahedra (c, 4)
        Their points, in VTK's order.
    of_hexahedron, of_wedge, of_tetrahedron
        Which hexahedron given each is of.
    edge : (p, 2), share : (p,)
        The ends of each cut edge, and how far from the first the cut is.
    """

    hexahedra: IntArray
    wedges: IntArray
    tetrahedra: IntArray
    of_hexahedron: IntArray
    of_wedge: IntArray
    of_tetrahedron: IntArray
    edge: IntArray
    share: FloatArray


def clip_hexahedra(corners: IntArray, points_mm: FloatArray, distance: FloatArray) -> _Clipped:
    """Keep what of hexahedra is inside: where a distance, linear between points, is 0 or less.

    Parameters
    ----------
    corners : (n, 8)
        Points of each, in VTK's order.
    points_mm : (P, 3)
    distance : (P,)
        From the surface, above 0 outside.
    """
    inside = distance <= 0.0
    count = inside[corners].sum(axis=1)
    whole, cut = np.flatnonzero(count == 8), np.flatnonzero((count > 0) & (count < 8))
    tets = corners[cut][:, _TETRAHEDRA].reshape(-1, 4)
    owner = np.repeat(cut, len(_TETRAHEDRA))
    # Corners inside come first; where that turns one inside out, two alike are exchanged.
    within = inside[tets].sum(axis=1)
    tets = np.take_along_axis(tets, np.argsort(~inside[tets], axis=1, kind="stable"), axis=1)
    turned = np.linalg.det(points_mm[tets[:, 1:]] - points_mm[tets[:, :1]]) < 0.0
    for rows, pair in ((turned & (within == 2), [0, 1]), (turned & (within != 2), [1, 2])):
        tets[np.ix_(rows, pair)] = tets[np.ix_(rows, pair[::-1])]
    one, two, three, all_four = (tets[within == k].T for k in (1, 2, 3, 4))
    ends = [
        *((one[0], one[k]) for k in (1, 2, 3)),
        *((two[i], two[k]) for i in (0, 1) for k in (2, 3)),
        *((three[k], three[3]) for k in (0, 1, 2)),
    ]
    pairs = np.sort(np.concatenate([np.stack(pair, axis=1) for pair in ends]), axis=1)
    edge, number = np.unique(pairs, axis=0, return_inverse=True)
    sizes = np.cumsum([len(a) for a, _ in ends])[:-1]
    a1, a2, a3, a, b, c, d, e, f, g = np.split(len(points_mm) + number.ravel(), sizes)
    low, high = distance[edge].T
    return _Clipped(
        corners[whole],
        np.concatenate(
            [
                np.stack([two[0], a, b, two[1], c, d], axis=1),
                np.stack([three[0], three[1], three[2], e, f, g], axis=1),
            ]
        ),
        np.concatenate([all_four.T, np.stack([one[0], a1, a2, a3], axis=1)]),
        whole,
        np.concatenate([owner[within == 2], owner[within == 3]]),
        np.concatenate([owner[within == 4], owner[within == 1]]),
        edge,
        low / (low - high),
    )
