"""How much of the volume each cell of a lattice keeps, its corners bevelled."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.arrays import Float32Array
from planner.geometry.kernel import kernel

__all__ = ["own_volumes"]

# A cube's tetrahedra, along its edges from corner 0 to corner 7; corner c is at
# (c & 1, c >> 1 & 1, c >> 2).
_CORNERS = np.array(
    [[0, 1, 3, 7], [0, 2, 6, 7], [0, 4, 5, 7], [0, 1, 5, 7], [0, 2, 3, 7], [0, 4, 6, 7]]
)
# Volume for each of 1 to 4 corners of one label in a tetrahedron of volume 1/6.
_SHARE = np.array([0.0, 0.125, 0.25, 0.875 / 3.0, 0.25]) / 6.0


def own_volumes(label: NDArray[np.int16]) -> Float32Array:
    """Return the volume that each cell's centre comes to have around it, as a share of a cell.

    Parameters
    ----------
    label : (nx, ny, nz) int16
        What each cell belongs to; -1 where there is none, which counts as its neighbours' own.
    """
    found = np.zeros(tuple(n + 2 for n in label.shape), dtype=np.float32)
    padded = np.pad(label, 1, constant_values=-1)
    _spread(padded, _CORNERS, _SHARE, found)
    return found[1:-1, 1:-1, 1:-1]


@kernel
def _spread(label: Any, corners: Any, share: Any, found: Any) -> None:
    nx, ny, nz = label.shape
    for i in range(nx - 1):
        for j in range(ny - 1):
            for k in range(nz - 1):
                for t in range(6):
                    for c in range(4):
                        at = corners[t, c]
                        x, y, z = i + (at & 1), j + (at >> 1 & 1), k + (at >> 2)
                        own = label[x, y, z]
                        if own < 0:
                            continue
                        same = 0
                        for d in range(4):
                            to = corners[t, d]
                            other = label[i + (to & 1), j + (to >> 1 & 1), k + (to >> 2)]
                            if other == own or other < 0:
                                same += 1
                        found[x, y, z] += share[same]
