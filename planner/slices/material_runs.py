"""The runs of several shells as one set of runs with a material each."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.arrays import IntArray
from planner.geometry.kernel import kernel
from planner.geometry.layer_runs import LayerRuns

__all__ = ["MaterialRuns", "join_shells", "paint"]


@dataclass(frozen=True, eq=False)
class MaterialRuns:
    """Runs along x of whole layers, as in `LayerRuns`, each with a label.

    Attributes
    ----------
    label : (runs,) int32
        Shell n has label n + 1.
    voxels : (layers, shells) int64
        Voxels of each shell by layer, as drawn.
    overlapping
        Voxels that lie in more than one shell; each is drawn once.
    """

    offsets: IntArray
    start: IntArray
    stop: IntArray
    label: IntArray
    voxels: NDArray[np.int64]
    overlapping: int


def join_shells(shells: Sequence[LayerRuns], ny: int) -> MaterialRuns:
    """Join the runs that shells have in the same layers of `ny` rows."""
    rows = len(shells[0].offsets) - 1
    before = np.cumsum([0, *(len(runs.start) for runs in shells)])
    offsets = np.stack([runs.offsets + n for runs, n in zip(shells, before, strict=False)])
    start = np.concatenate([runs.start for runs in shells])
    stop = np.concatenate([runs.stop for runs in shells])
    joined, label = np.empty((2, len(start)), np.int32), np.empty(len(start), np.int32)
    new_offsets = np.zeros(rows + 1, np.int64)
    voxels = np.zeros((rows // ny, len(shells)), np.int64)
    place = offsets[:, 0].copy()
    runs, overlapping = _join(
        *(offsets, start, stop, ny, place, new_offsets, joined[0], joined[1], label, voxels)
    )
    return MaterialRuns(
        *(new_offsets, joined[0, :runs], joined[1, :runs], label[:runs], voxels, int(overlapping))
    )


@kernel
def _join(
    offsets: Any,
    start: Any,
    stop: Any,
    ny: Any,
    place: Any,
    new_offsets: Any,
    new_start: Any,
    new_stop: Any,
    label: Any,
    voxels: Any,
) -> Any:
    runs, overlapping = np.int64(0), np.int64(0)
    for r in range(new_offsets.size - 1):
        done = np.int32(0)  # voxels below are drawn
        while True:
            shell = -1
            for s in range(offsets.shape[0]):
                if place[s] < offsets[s, r + 1] and (
                    shell < 0 or start[place[s]] < start[place[shell]]
                ):
                    shell = s
            if shell < 0:
                break
            low, high = start[place[shell]], stop[place[shell]]
            place[shell] += 1
            overlapping += max(min(done, high) - low, 0)
            low = max(low, done)
            if low < high:
                new_start[runs], new_stop[runs], label[runs] = low, high, shell + 1
                voxels[r // ny, shell] += high - low
                runs += 1
                done = high
        new_offsets[r + 1] = runs
    return runs, overlapping


@kernel
def paint(offsets: Any, start: Any, stop: Any, label: Any, first: Any, image: Any) -> None:
    """Write the labels of runs into a zeroed (rows, nx) uint8 array, from row `first` on."""
    for r in range(image.shape[0]):
        for n in range(offsets[first + r], offsets[first + r + 1]):
            for i in range(start[n], stop[n]):
                image[r, i] = label[n]
