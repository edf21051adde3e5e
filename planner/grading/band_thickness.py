"""How thick bands between two curved interfaces are."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.arrays import FloatArray
from planner.geometry.fields import Field
from planner.geometry.shells import Pieces

__all__ = ["BandThickness", "band_thicknesses"]

_SAMPLES = 200  # of an interface
_STEPS = 5
_NEAR = 0.02  # of a band: how near to the other interface a way has to end


@dataclass(frozen=True, eq=False)
class BandThickness:
    """A band of one material between two interfaces, measured at points spread over them.

    Attributes
    ----------
    first, last
        Its pieces, neighbours of one material being one band.
    thickness_mm, area_mm2 : (n,)
        Length of the way from one interface to the other along the normal, and how much of the
        interfaces it stands for.
    middle_mm : (n, 3)
        Half-way.
    """

    first: int
    last: int
    thickness_mm: FloatArray
    area_mm2: FloatArray
    middle_mm: FloatArray

    def kept_mm(self, share: float) -> float:
        """Return the thickness that all but a share of the area keeps."""
        order = np.argsort(self.thickness_mm, kind="stable")
        area = np.cumsum(self.area_mm2[order])
        at = min(int(np.searchsorted(area, share * area[-1])), len(order) - 1)
        return float(self.thickness_mm[order[at]])


def band_thicknesses(
    pieces: Pieces, field: Field, levels: FloatArray, names: Sequence[str], pitch_mm: float
) -> tuple[BandThickness, ...]:
    """Measure the bands that have an interface on both sides, in the order of the field.

    From the centres of up to 200 triangles of either interface along their normals to where the
    field has the other level. Ways that do not end there, as beyond an edge of the field, are
    left out.

    Parameters
    ----------
    names
        What each piece is made of.
    """
    found = []
    corners = pieces.vertices.T
    longest_mm = float(np.linalg.norm([np.ptp(corners[axis]) for axis in range(3)]))
    for _, group in itertools.groupby(range(pieces.count), key=names.__getitem__):
        own = list(group)
        if own[0] == 0 or own[-1] == pieces.count - 1:
            continue
        band = _measured(pieces, field, levels, own[0], own[-1], pitch_mm, longest_mm)
        if band is not None:
            found.append(band)
    return tuple(found)


def _measured(
    pieces: Pieces,
    field: Field,
    levels: FloatArray,
    first: int,
    last: int,
    pitch_mm: float,
    longest_mm: float,
) -> BandThickness | None:
    low, high = float(levels[first - 1]), float(levels[last])
    at, way, area, target = [], [], [], []
    for level, sign, end in ((first - 1, 1.0, high), (last, -1.0, low)):
        members = np.flatnonzero(pieces.cap_level == level)
        chosen = members[:: max(1, -(-len(members) // _SAMPLES))]
        corners = pieces.vertices[pieces.cap_faces[chosen]].astype(np.float64)
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        length = np.linalg.norm(normal, axis=1)
        flat = ~(length > 0.0)
        at.append(corners.mean(axis=1)[~flat])
        way.append(sign * (normal / np.where(flat, 1.0, length)[:, None])[~flat])
        area.append(0.5 * length[~flat])
        target.append(np.full(int((~flat).sum()), end))
    start, towards, goal = np.concatenate(at), np.concatenate(way), np.concatenate(target)
    if not len(start):
        return None
    own = np.where(goal == high, low, high)
    begin = field.values(start)  # centres of triangles lie off their level by a chord's height
    reached = np.full(len(start), 0.25 * pitch_mm)
    with np.errstate(all="ignore"):
        for _ in range(_STEPS):
            value = field.values(start + reached[:, None] * towards)
            slope = (value - begin) / (goal - begin) / reached  # of the band, per mm
            better = np.where(slope > 0.0, 1.0 / slope, 2.0 * reached)
            reached = np.minimum(np.clip(better, 0.2 * reached, 8.0 * reached), longest_mm)
        value = field.values(start + reached[:, None] * towards)
        good = (np.abs(value - goal) <= _NEAR * (high - low)) & (begin != goal)
    if not good.any():
        return None
    middle = start + 0.5 * reached[:, None] * towards
    thickness = reached * (goal - own) / np.where(good, goal - begin, 1.0)
    return BandThickness(first, last, thickness[good], np.concatenate(area)[good], middle[good])
