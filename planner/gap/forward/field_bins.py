"""Strain fields, in bins along the bar that a camera and a model can both fill."""

from dataclasses import dataclass

import numpy as np

from planner.arrays import BoolArray, FloatArray, IntArray
from planner.gap.forward.legs import Path
from planner.gap.specimen import StrainField

__all__ = ["BINS_MOST", "FieldWeights", "bin_edges_mm", "bin_means", "frame_travels_mm"]

BINS_MOST = 16

_PLACES_LEAST = 3
"""Of a camera in a bin: its facets overlap, so that a place tells of its neighbours too."""

_NEAR = 0.1
"""A frame this much of its travel away from an instant still counts, its strains scaled."""


@dataclass(frozen=True, slots=True, eq=False)
class FieldWeights:
    """How strains of slices make up the features that are strains of bins.

    Attributes
    ----------
    feature, slice_ : (m,)
        Row of the feature table, and slice of the setup.
    weight : (m,)
        Of a feature's all sum to 1.
    """

    feature: IntArray
    slice_: IntArray
    weight: FloatArray


def frame_travels_mm(field: StrainField, path: Path, end_mm: float) -> FloatArray:
    """Return the travels, rising, of the frames taken in the first loading up to `end_mm`."""
    leg = path.legs[0]
    time = field.time_s - path.shift_s
    inside = (time > leg.begin_s) & (time <= leg.end_s * (1.0 + 1e-9))
    travel = np.interp(time[inside], path.time_s, path.travel_mm)
    return np.asarray(travel[(travel > 0.02 * end_mm) & (travel <= end_mm * (1.0 + 1e-9))])


def bin_edges_mm(x_mm: FloatArray, gauge_mm: float) -> tuple[FloatArray, IntArray]:
    """Return begin and end of each bin, (b, 2), and the bin of each place of the camera.

    Each place stands for the stretch halfway to its neighbours.
    """
    middle = 0.5 * (x_mm[1:] + x_mm[:-1])
    begin = np.concatenate([[x_mm[0] - 0.5 * (x_mm[1] - x_mm[0])], middle])
    end = np.concatenate([middle, [x_mm[-1] + 0.5 * (x_mm[-1] - x_mm[-2])]])
    count = max(1, min(BINS_MOST, len(x_mm) // _PLACES_LEAST))
    bin_of = np.arange(len(x_mm)) * count // len(x_mm)
    first = np.searchsorted(bin_of, np.arange(count))
    last = np.searchsorted(bin_of, np.arange(count), side="right") - 1
    edges = np.clip(np.stack([begin[first], end[last]], axis=1), 0.0, gauge_mm)
    return edges, bin_of


def bin_means(
    field: StrainField, path: Path, travel_mm: float, bin_of: IntArray
) -> FloatArray | None:
    """Return the mean strain of each bin at a travel of the first loading; None without a frame.

    The nearest frame's strains are scaled by the ratio of the travels, which is close to 1.
    """
    leg = path.legs[0]
    time = field.time_s - path.shift_s
    inside: BoolArray = (time > leg.begin_s) & (time <= leg.end_s * (1.0 + 1e-9))
    if not inside.any():
        return None
    travels = np.interp(time[inside], path.time_s, path.travel_mm)
    nearest = int(np.argmin(np.abs(travels - travel_mm)))
    if abs(travels[nearest] - travel_mm) > _NEAR * travel_mm:
        return None
    strain = field.strain[inside][nearest] * (travel_mm / travels[nearest])
    return np.asarray(np.bincount(bin_of, strain) / np.bincount(bin_of))
