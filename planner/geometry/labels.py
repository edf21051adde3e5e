"""Columns split where a field crosses levels: every voxel gets the label of its centre.

The label is the number of levels at or below the field's value, so levels l1 < l2 < ... give
label 0 below l1, 1 from l1 to l2, and so on. Where the field is linear along a column, each
transition is solved for, not sampled, and decided by the same comparison as a single voxel's.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.arrays import FloatArray, IntArray
from planner.errors import ArgumentError
from planner.geometry.columns import Columns
from planner.geometry.fields import Field, PlanarField
from planner.geometry.kernel import inner_kernel, kernel

__all__ = ["LabelledColumns", "label_by_planes", "label_columns", "label_volumes_mm3", "layers"]

_MOST_LABELS = 1 << 15


@dataclass(frozen=True, eq=False)
class LabelledColumns(Columns):
    """Columns whose runs each have one label; runs of different labels may touch.

    Attributes
    ----------
    label : (runs,) int16
        Label of each run.
    """

    label: IntArray = field(default_factory=lambda: np.empty(0, np.int16))


def label_columns(columns: Columns, field: Field, levels: Sequence[float]) -> LabelledColumns:
    """Split the runs of columns where a field crosses levels.

    Parameters
    ----------
    field
        A field whose level sets are planes.
    levels
        Strictly increasing values of the field.

    Raises
    ------
    ArgumentError
        The levels do not rise, are more than 32766, or the field's level sets are not planes.
    """
    values = np.asarray(levels, dtype=np.float64)
    if values.ndim != 1 or not (np.isfinite(values).all() and (np.diff(values) > 0).all()):
        raise ArgumentError(f"levels are {list(levels)}; they must be finite and strictly rising")
    if len(values) + 1 >= _MOST_LABELS:
        raise ArgumentError(f"{len(values)} levels; up to {_MOST_LABELS - 2} are possible")
    if not isinstance(field, PlanarField):
        raise ArgumentError(
            f"field {field.name!r}: its level sets are not planes, and voxels can be labelled "
            "along planar fields only; use an axis"
        )
    planes = [field.plane(float(level)) for level in values]
    normal = planes[0][0] if planes else np.zeros(3)
    return label_by_planes(columns, normal, np.array([offset for _, offset in planes], np.float64))


def label_by_planes(
    columns: Columns, normal: FloatArray, offsets_mm: FloatArray
) -> LabelledColumns:
    """Split the runs of columns at parallel planes normal . x = offset, offsets rising in mm."""
    grid, crossed = columns.grid, len(offsets_mm) if normal[2] != 0.0 else 0
    most = len(columns.start) + crossed * int(np.count_nonzero(np.diff(columns.offsets)))
    start, stop = np.empty((2, most), np.int32)
    label, offsets = np.empty(most, np.int16), np.zeros_like(columns.offsets)
    runs = _split_runs(
        columns.offsets,
        columns.start,
        columns.stop,
        columns.first_row,
        np.array([*grid.origin_mm, *grid.pitch_mm, *normal], np.float64),
        grid.shape[0],
        grid.shape[2],
        offsets_mm,
        np.full(len(offsets_mm) + 1, grid.shape[2], np.int64),
        *(start, stop, label, offsets),
    )
    return LabelledColumns(
        *(grid, columns.first_row, offsets, start[:runs].copy(), stop[:runs].copy()),
        columns.faults,
        label[:runs].copy(),
    )


def label_volumes_mm3(columns: LabelledColumns, labels: int) -> FloatArray:
    """Return the volume of each label's voxels, (labels,) in mm³."""
    length = columns.stop.astype(np.float64) - columns.start  # sums stay exact up to 2^53 voxels
    voxels = np.bincount(columns.label, weights=length, minlength=labels)
    return np.asarray(voxels * columns.grid.voxel_mm3, dtype=np.float64)


def layers(
    columns: Columns, first: int, last: int, values: Sequence[int] | None = None
) -> NDArray[np.uint8]:
    """Return layers of voxels as images, (last - first, rows, nx) uint8, 0 outside the part.

    A few dozen layers at once are fastest.

    Parameters
    ----------
    first, last
        Layers first <= k < last.
    values
        What to write for each label, 0 to 255; by default label + 1 (1 where columns have no
        labels).

    Raises
    ------
    ArgumentError
        The layers are not within the grid, or a label has no value.
    """
    nx, _, nz = columns.grid.shape
    if not 0 <= first <= last <= nz:
        raise ArgumentError(f"layers {first} to {last} are not within 0 to {nz}")
    if isinstance(columns, LabelledColumns):
        label = columns.label
    else:
        label = np.zeros(len(columns.start), np.int16)
    highest = int(label.max(initial=0))
    table = np.arange(1, highest + 2) if values is None else np.asarray(values)
    if len(table) <= highest or table.min() < 0 or table.max() > 255:
        raise ArgumentError(
            f"labels go up to {highest}, and values are {table.tolist()}; give one of 0 to 255 "
            "for each label"
        )
    images = np.zeros((last - first, columns.rows * nx), np.uint8)
    _paint(
        columns.offsets, columns.start, columns.stop, label, first, table.astype(np.uint8), images
    )
    return images.reshape(last - first, columns.rows, nx)


@kernel
def _split_runs(
    offsets: Any,
    start: Any,
    stop: Any,
    first_row: Any,
    frame: Any,
    nx: Any,
    nz: Any,
    plane: Any,
    cross: Any,
    new_start: Any,
    new_stop: Any,
    label: Any,
    new_offsets: Any,
) -> Any:
    # `frame`: the grid's origin and pitch, and the normal n.
    # Along a column n . x = base + z(k) rise is monotone in k, in floating point too: level i is
    # crossed at one k, `cross[i]`, estimated by a division and then settled by that comparison.
    origin, pitch, rise = frame[2], frame[5], frame[8]
    levels, n = plane.size, 0
    for c in range(offsets.size - 1):
        if offsets[c] < offsets[c + 1]:
            x = frame[0] + (c % nx + 0.5) * frame[3]
            y = frame[1] + (first_row + c // nx + 0.5) * frame[4]
            base = x * frame[6] + y * frame[7]
            # `order` counts crossings upwards along z: label rises with it or falls
            for order in range(levels):
                level = plane[order if rise >= 0.0 else levels - 1 - order]
                if rise == 0.0:
                    cross[order] = 0 if base >= level else nz
                    continue
                z = (level - base) / rise
                k = np.int64(min(max(np.ceil((z - origin) / pitch - 0.5), 0.0), float(nz)))
                while k < nz and not _past(base, origin, pitch, k, rise, level):
                    k += 1
                while k > 0 and _past(base, origin, pitch, k - 1, rise, level):
                    k -= 1
                cross[order] = k
            order = 0
            for r in range(offsets[c], offsets[c + 1]):
                low = np.int64(start[r])
                while low < stop[r]:
                    while order < levels and cross[order] <= low:
                        order += 1
                    high = min(np.int64(stop[r]), cross[order])
                    new_start[n], new_stop[n] = low, high
                    label[n] = order if rise >= 0.0 else levels - order
                    n += 1
                    low = high
        new_offsets[c + 1] = n
    return n


@inner_kernel
def _past(base: Any, origin: Any, pitch: Any, k: Any, rise: Any, plane: Any) -> Any:
    along = base + (origin + (k + 0.5) * pitch) * rise
    return along >= plane if rise > 0.0 else along < plane


@kernel
def _paint(
    offsets: IntArray,
    start: IntArray,
    stop: IntArray,
    label: IntArray,
    first: int,
    values: IntArray,
    images: IntArray,
) -> None:
    last = first + len(images)
    for c in range(len(offsets) - 1):
        for r in range(offsets[c], offsets[c + 1]):
            value = values[label[r]]
            for k in range(max(start[r], first), min(stop[r], last)):
                images[k - first, c] = value
