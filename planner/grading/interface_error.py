"""How far the interfaces of a curved field lie from its true level sets."""

import numpy as np

from planner.arrays import FloatArray
from planner.geometry.fields import Field
from planner.geometry.shells import Pieces

__all__ = ["interface_error_mm"]

_SAMPLES = 20_000
_KEPT = 0.9


def interface_error_mm(pieces: Pieces, field: Field, levels: FloatArray, pitch_mm: float) -> float:
    """Measure the distance from their level sets that 90 % of the interfaces' area keeps.

    Along the normals at the centres of up to 20000 triangles, which lie farther off than their
    corners. Where the level set does not pass within half a pitch, as at the edges of a distance
    field, the distance is estimated from the field's slope, and counts as a pitch at most.

    Parameters
    ----------
    pieces
        The divided part.
    levels
        Of the interfaces.
    """
    count = len(pieces.cap_faces)
    if count == 0:
        return 0.0
    chosen = np.arange(0, count, max(1, -(-count // _SAMPLES)))
    corners = pieces.vertices[pieces.cap_faces[chosen]].astype(np.float64)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0.0)
    centre = corners.mean(axis=1)
    half = 0.5 * pitch_mm * normal
    level = levels[pieces.cap_level[chosen]]
    off = field.values(centre) - level
    below, above = field.values(centre - half) - level, field.values(centre + half) - level
    towards = np.where((off > 0.0) == (below > 0.0), above, below)
    slope = np.abs(off - towards)
    crossed = (towards > 0.0) != (off > 0.0)
    steep = np.maximum(slope, np.abs(above - below) / 2.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(crossed, np.abs(off) / slope, np.abs(off) / steep + 1.0)
    share = np.where(off == 0.0, 0.0, np.nan_to_num(share, nan=2.0, posinf=2.0))
    order = np.argsort(share)
    area = np.cumsum(length[order, 0])
    last = min(int(np.searchsorted(area, _KEPT * area[-1])), len(order) - 1)
    return float(min(share[order[last]], 2.0)) * 0.5 * pitch_mm
