"""A camera on a graded bar: what its facets see of a model's slices, in bins of its places."""

from dataclasses import dataclass

import numpy as np

from planner.gap.campaign import StrainField
from planner.gap.segments import Path
from planner.numerics import FloatArray, IntArray
from planner.simulation.bar import step_places_mm
from planner.simulation.bar_solver import Setup

__all__ = [
    "BINS_MOST",
    "SIDES",
    "Bins",
    "bins_of",
    "frames_of",
    "seen_shares",
]


# ------------------------------------------------------------------------------------------------
# What a facet sees of a bar: the mean of the strain over its length.


_POINT_MM = 1e-3
"""Length for a facet of none: a point on a step sees half of either side. Numerical: less than any
slice or pixel."""


def seen_shares(setup: Setup, number: int, x_mm: FloatArray, facet_mm: float) -> FloatArray:
    """Return what facets see of a bar as shares of its slices' strains, (p, slices of the bar).

    Strain is linear between the middles of slices, but for the design's steps: there it jumps.

    Parameters
    ----------
    number
        The bar, among the setup's tests.
    x_mm : (p,)
        Middles of the facets along the gauge; of one that reaches beyond an end, what is on the
        gauge counts.
    facet_mm
        Their length.
    """
    own = slice(int(setup.first_slice[number]), int(setup.first_slice[number + 1]))
    middle, length = setup.x_mm[own], setup.length_mm[own]
    edges = np.append(middle - 0.5 * length, middle[-1] + 0.5 * length[-1])
    design, end = setup.designs[number], edges[-1]
    assert design is not None
    steps = step_places_mm(design) * (end / design.length_mm)
    # Slices end at steps: each block between two has knots at its ends and at middles of slices.
    cut = np.searchsorted(middle, np.concatenate([[0.0], steps, [end]]))
    knots = [
        (place, of)
        for first, stop in zip(cut[:-1].tolist(), cut[1:].tolist(), strict=True)
        for place, of in (
            (edges[first], first),
            *((middle[k], k) for k in range(first, stop)),
            (edges[stop], stop - 1),
        )
    ]
    at = np.array([place for place, _ in knots])
    value = np.eye(len(middle))[[of for _, of in knots]]
    trapezoids = 0.5 * (value[1:] + value[:-1]) * np.diff(at)[:, None]
    moved = np.concatenate([np.zeros((1, len(middle))), np.cumsum(trapezoids, axis=0)])

    def moved_at(x: FloatArray) -> FloatArray:
        k = np.clip(np.searchsorted(at, x, side="right") - 1, 0, len(at) - 2)
        s = (x - at[k])[:, None]
        rise = (value[k + 1] - value[k]) / (at[k + 1] - at[k])[:, None]
        return np.asarray(moved[k] + s * (value[k] + 0.5 * s * rise))

    half = 0.5 * max(facet_mm, _POINT_MM)
    begin = np.clip(x_mm - half, 0.0, end - _POINT_MM)
    stop = np.clip(x_mm + half, _POINT_MM, end)
    return np.asarray((moved_at(stop) - moved_at(begin)) / (stop - begin)[:, None])


# ------------------------------------------------------------------------------------------------
# Bins of places: features, with what they would be were facets longer, shorter or elsewhere.


BINS_MOST = 16
"""Of a camera's places. Chosen: a sixteenth of the gauge is less than the longest facet that is
believed."""

_PLACES_LEAST = 3
"""Of a camera in a bin. Chosen: its facets overlap, so that a place tells of its neighbours too."""

_LENGTHS = 6
"""Equally likely lengths of a facet that nobody states, evenly from a point to the longest.
Numerical: steps of 2 % of the gauge, twice what places may be off by."""

_LONGEST_SHARE = 0.1
"""Longest facet that is believed, of the gauge; facets that stand farther apart may be as long as
that. Chosen: one that averages over more shows no gradient."""

_SHIFT_SHARE = 0.01
"""Standard deviation of where the gauge begins in the camera's picture, of the gauge. Chosen: half
of how far beyond the gauge places may be said to lie (see `campaign_folder`)."""

SIDES = np.linspace(-2.0, 2.0, 7)
"""Where places may lie, in such deviations. Numerical: steps of 0.2 mm of a gauge of 32 mm, which
is little beside a facet."""


@dataclass(frozen=True, slots=True, eq=False)
class Bins:
    """Bins of a camera's places along a bar of S slices.

    Attributes
    ----------
    x_mm : (b,)
        Mean of the places in each.
    of_place : (p,)
        The bin of each place.
    shares : (L, sides, b, S)
        What a bin sees of the slices' strains: with facets of each likely length, or of the stated
        one, and places aside from where they are said to be by each of `SIDES`.
    overlap : (b, b)
        Mean share of a facet that places of two bins have in common.
    """

    x_mm: FloatArray
    of_place: IntArray
    shares: FloatArray
    overlap: FloatArray

    @property
    def places(self) -> IntArray:
        """How many places are in each, (b,)."""
        return np.bincount(self.of_place)

    def means(self, field: StrainField, path: Path, travel_mm: float) -> FloatArray | None:
        """Return the mean strain of each bin at a travel of the first loading.

        Between two frames it is linear in the travel. None without a frame that is near.
        """
        travels, strains = frames_of(field, path)
        if not len(travels):
            return None
        order = np.argsort(travels)
        nearest = float(travels[np.argmin(np.abs(travels - travel_mm))])
        if abs(nearest - travel_mm) > _NEAR * travel_mm:
            return None
        within = float(np.clip(travel_mm, travels[order[0]], travels[order[-1]]))
        strain = [np.interp(within, travels[order], at) for at in strains[order].T]
        sums = np.bincount(self.of_place, np.array(strain) * (travel_mm / within))
        return np.asarray(sums / self.places)


_NEAR = 0.1
"""A frame this much of its travel away from an instant still counts, its strains scaled. Chosen:
over a tenth more travel, strains along a bar grow nearly in proportion to it."""


def frames_of(field: StrainField, path: Path) -> tuple[FloatArray, FloatArray]:
    """Return travels, (f,), and strains, (f, p), of the frames taken in the first loading."""
    segment = path.segments[0]
    time = field.time_s - path.shift_s
    inside = (time > segment.begin_s) & (time <= segment.end_s * (1.0 + 1e-9))
    return np.interp(time[inside], path.time_s, path.travel_mm), field.strain[inside]


def bins_of(field: StrainField, setup: Setup, number: int) -> Bins:
    """Return the bins of a camera's places along a bar, by number among the setup's tests."""
    x, gauge = field.x_mm, float(setup.gauge_mm[number])
    count = max(1, min(BINS_MOST, len(x) // _PLACES_LEAST))
    of_place = np.arange(len(x)) * count // len(x)
    first = np.searchsorted(of_place, np.arange(count))
    size = np.bincount(of_place)[:, None]

    def binned(rows: FloatArray) -> FloatArray:
        return np.asarray(np.add.reduceat(rows, first) / size)

    if field.facet_mm is None:
        longest = max(_LONGEST_SHARE * gauge, float(np.median(np.diff(x))))
        lengths = np.linspace(0.0, longest, _LENGTHS).tolist()
    else:
        lengths = [field.facet_mm]
    aside = x + _SHIFT_SHARE * gauge * SIDES[:, None]
    of_length = [seen_shares(setup, number, aside.ravel(), facet) for facet in lengths]
    places = np.reshape(of_length, (len(lengths), *aside.shape, -1))
    shares = np.add.reduceat(places, first, axis=2) / size
    far = np.abs(np.subtract.outer(x, x))
    alike = np.mean([np.maximum(1.0 - far / max(w, _POINT_MM), 0.0) for w in lengths], axis=0)
    return Bins(
        x_mm=binned(x[:, None])[:, 0],
        of_place=of_place,
        shares=shares,
        overlap=binned(binned(alike).T),
    )
