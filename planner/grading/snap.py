"""Cuts moved off faces that lie alongside them, so that no sliver of a material is left there."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import SupportsFloat

import numpy as np

from planner.errors import ArgumentError, as_number
from planner.fields.basic import Field, PlanarField
from planner.grading.profile import Band, Profile
from planner.mesh.mesh import Mesh
from planner.numerics import BoolArray, FloatArray
from planner.printers import Printer

__all__ = ["snap_limit_mm", "snapped_bands"]

# Where a face of the part lies alongside a level set, a cut near it leaves a layer as thin as the
# two are apart. A layer below the printer's smallest feature blurs into its neighbour: moving the
# cut by that little onto the face, or away from it, costs next to no stiffness.


_ALONGSIDE = 3.0 / math.sqrt(10.0)
"""Cosine of the angle between face and level set from which a layer between them counts: at a
slope of 1:3 it tapers within three times its thickness, which prints as an edge."""

_OFFSETS = 40
"""Steps of a move to either side. Numerical: 8 um, half a layer, for the Connex3."""

_SAME = 1e-9
"""Of the field: a face this near to a cut lies on it, and leaves no layer."""

_MOST_SAMPLES = 5000
"""Triangles at which a curved field is looked at; planes are looked at everywhere."""

_WORTH = 0.5
"""A move that leaves slivers has to halve them. Chosen: else the cut stays where it was asked."""

_NEIGHBOUR = 0.1
"""Of the way to the next cut that a cut may move. Chosen: the error of a band then grows by a tenth
of the step between its materials at most."""


def snap_limit_mm(stated: SupportsFloat | None, machine: Printer) -> float:
    """Return how far a cut may be moved: half the minimum wall, where nothing is stated.

    Raises
    ------
    ArgumentError
        It is below 0 or not finite.
    """
    if stated is None:
        return machine.minimum_wall_mm / 2.0
    limit_mm = as_number(stated, "`snap_mm`")
    if limit_mm < 0.0:
        raise ArgumentError(f"`snap_mm` {limit_mm:g}: it must be 0 mm, for none, or more")
    return limit_mm


@dataclass(frozen=True, slots=True)
class _Alongside:
    """Faces alongside the level sets.

    Attributes
    ----------
    low, high : (n,)
        Least and largest field over each.
    per_mm
        Slope of the field.
    ahead
        Whether the part lies towards larger values.
    """

    low: FloatArray
    high: FloatArray
    area_mm2: FloatArray
    per_mm: FloatArray
    ahead: BoolArray

    def area_of_slivers_mm2(self, levels: FloatArray, limit_mm: float) -> FloatArray:
        """Return how much of the faces has a layer below a limit at each of some cuts, (k,)."""
        reach = limit_mm * self.per_mm
        begin = np.where(self.ahead, self.low, self.low - reach)
        end = np.where(self.ahead, self.high + reach, self.high)
        near = (begin < levels.max()) & (end > levels.min())
        low, high, reach = self.low[near], self.high[near], reach[near]
        # The layer lies between face and cut: ahead of the face, or behind it.
        start = np.where(self.ahead[near], levels[:, None] - reach, levels[:, None])
        stop = np.where(self.ahead[near], levels[:, None], levels[:, None] + reach)
        flat = high - low <= _SAME
        within = np.minimum(high, stop) - np.maximum(low, start)
        inner = (low > start + _SAME) & (high < stop - _SAME)
        share = np.clip(within / np.where(flat, 1.0, high - low), 0.0, 1.0)
        return np.asarray(np.where(flat, inner, share) @ self.area_mm2[near])


def _moved_cuts(
    mesh: Mesh, field: Field, levels: Sequence[float], *, snap_mm: float, machine: Printer
) -> Iterator[dict[str, float]]:
    """Yield which cuts, at rising values of the field, to move; see `snapped_bands`."""
    faces = _faces_alongside(mesh, field) if snap_mm > 0.0 and len(levels) else None
    if faces is None or not len(faces.low):
        return
    limit_mm, edges = machine.minimum_feature_mm, [0.0, *levels, 1.0]
    shares = np.arange(-_OFFSETS, _OFFSETS + 1) / _OFFSETS
    for before, level, after in zip(edges, levels, edges[2:], strict=False):
        near = np.abs(0.5 * (faces.low + faces.high) - level)
        per_mm = float(faces.per_mm[int(np.argmin(near / faces.per_mm))])
        ways = level - before, after - level
        back, forth = (min(snap_mm * per_mm, _NEIGHBOUR * way) for way in ways)
        places = level + np.where(shares < 0.0, back, forth) * shares
        places = places[np.argsort(np.abs(places - level), kind="stable")]  # the nearest first
        slivers = faces.area_of_slivers_mm2(places, limit_mm)
        # What is no larger than the smallest feature is none.
        clean = np.flatnonzero(slivers <= limit_mm**2)
        best = int(clean[0]) if len(clean) else int(np.argmin(slivers))
        if best and (len(clean) or slivers[best] <= _WORTH * slivers[0]):
            to = float(places[best])
            yield {"field": level, "to": to, "by_mm": abs(to - level) / per_mm}


def _faces_alongside(mesh: Mesh, field: Field) -> _Alongside | None:
    """Find them; None of a field that is not one number everywhere, which cutting tells."""
    corners, normal = mesh.triangles, mesh.area_vectors_mm2
    area = np.linalg.norm(normal, axis=1)
    looked = np.flatnonzero(area > 0.0)
    step_mm = 1e-3 * float(np.ptp(mesh.bounds_mm, axis=0).max())
    if isinstance(field, PlanarField):
        direction, first_mm = field.plane(0.0)
        slopes = direction / (field.plane(1.0)[1] - first_mm)
        centre = corners[looked].mean(axis=1)
        value, gradient = field.values(centre), np.broadcast_to(slopes, centre.shape)
    else:
        looked = looked[:: max(1, -(-len(looked) // _MOST_SAMPLES))]
        centre = corners[looked].mean(axis=1)
        steps = step_mm * np.eye(3)
        points = [centre, *(centre + step for step in steps), *(centre - step for step in steps)]
        with np.errstate(all="ignore"):
            at_points = [np.asarray(field.values(p), dtype=np.float64) for p in points]
        if any(v.shape != (len(centre),) or not np.isfinite(v).all() for v in at_points):
            return None
        value, ahead, behind = at_points[0], at_points[1:4], at_points[4:]
        gradient = (np.stack(ahead, axis=1) - np.stack(behind, axis=1)) / (2.0 * step_mm)
    slope = np.linalg.norm(gradient, axis=1)
    cosine = np.zeros(len(looked))
    along = np.einsum("ij,ij->i", normal[looked], gradient)
    np.divide(along, area[looked] * slope, out=cosine, where=slope > 1e-9 / step_mm)
    kept = np.abs(cosine) >= _ALONGSIDE
    found, centre, value = looked[kept], centre[kept], value[kept]
    rise = np.einsum("ij,ikj->ik", gradient[kept], corners[found] - centre[:, None])
    low, high = value + rise.min(axis=1), value + rise.max(axis=1)
    weight = area[found] * (area.sum() / area[looked].sum())
    return _Alongside(low, high, weight, slope[kept], cosine[kept] < 0.0)


def snapped_bands(
    mesh: Mesh,
    field: Field,
    bands: Sequence[Band],
    target: Profile,
    *,
    snap_mm: float,
    machine: Printer,
) -> tuple[tuple[Band, ...], list[dict[str, float]]]:
    """Return bands whose cuts were moved so that fewer or no slivers are left, and those cuts.

    Of each cut it is told, as a plan says it, at which value of the ``field`` it was asked, where
    it was moved ``to``, and ``by_mm``, how far that is along the field.

    The nearest place without slivers is taken; without such, the one that leaves the least, if
    that is half or less of what there was. No cut moves more than a tenth of the way to its
    neighbour or to an end of the field.

    Bands have the targets that they hold now. Beyond a jump of the target that a cut lay on, the
    band keeps the target that it was made for: what was moved there is a place, not a stiffness.

    Parameters
    ----------
    snap_mm
        Farthest that a cut may move, along the field.
    """
    levels = [band.start for band in bands[1:]]
    moved = list(_moved_cuts(mesh, field, levels, snap_mm=snap_mm, machine=machine))
    to = {cut["field"]: cut["to"] for cut in moved}
    found = []
    for band in bands:
        start, stop = to.get(band.start, band.start), to.get(band.stop, band.stop)
        first = max(start, band.start) if band.start in target.jumps else start
        last = min(stop, band.stop) if band.stop in target.jumps else stop
        held_MPa = target.interval_MPa(first, last)
        found.append(replace(band, start=start, stop=stop, target_MPa=held_MPa))
    return tuple(found), moved
