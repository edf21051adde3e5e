"""A bar along its axis: slices, each of one mixture and one cross-section."""

from dataclasses import dataclass

import numpy as np

from planner.arrays import FloatArray
from planner.errors import ArgumentError

__all__ = ["Bar", "bar_between", "coupon"]


@dataclass(frozen=True, slots=True, eq=False)
class Bar:
    """A straight bar, cut across its axis into slices.

    Attributes
    ----------
    edges_mm : (n + 1,)
        Where slices begin and end along the axis, rising.
    coordinate : (n,)
        The mixture of each slice, on the palette's coordinate.
    area_mm2 : (n,)
        The cross-section of each slice at rest.

    Raises
    ------
    ArgumentError
        Lengths that do not agree, edges that do not rise, a figure that is not finite, or a
        slice without cross-section.
    """

    edges_mm: FloatArray
    coordinate: FloatArray
    area_mm2: FloatArray

    def __post_init__(self) -> None:
        for name in ("edges_mm", "coordinate", "area_mm2"):
            array = np.array(getattr(self, name), dtype=np.float64)
            array.setflags(write=False)
            object.__setattr__(self, name, array)
            if array.ndim != 1 or not np.isfinite(array).all():
                raise ArgumentError(f"bar: {name} must be finite numbers, one a slice")
        n = len(self.coordinate)
        if n < 1 or self.area_mm2.shape != (n,) or self.edges_mm.shape != (n + 1,):
            raise ArgumentError(
                f"bar: {len(self.edges_mm)} edges, {n} coordinates and {len(self.area_mm2)} "
                "areas; n slices have n + 1 edges, n coordinates and n areas"
            )
        if not (self.length_mm > 0.0).all():
            at = int(np.argmin(self.length_mm > 0.0))
            raise ArgumentError(
                f"bar: edges go from {self.edges_mm[at]:g} to {self.edges_mm[at + 1]:g} mm; they "
                "must rise"
            )
        if not (self.area_mm2 > 0.0).all():
            empty = np.flatnonzero(~(self.area_mm2 > 0.0))
            raise ArgumentError(
                f"the bar has no cross-section at {self.x_mm[empty[0]]:.4g} mm along its axis "
                f"({len(empty)} of {n} slices), so it carries no force; take a stretch (--between) "
                "that leaves this out, or another part"
            )

    @property
    def x_mm(self) -> FloatArray:
        """Centres of the slices along the axis, (n,)."""
        centres: FloatArray = 0.5 * (self.edges_mm[:-1] + self.edges_mm[1:])
        return centres

    @property
    def length_mm(self) -> FloatArray:
        """Length of each slice at rest, (n,)."""
        return np.diff(self.edges_mm)

    @property
    def gauge_mm(self) -> float:
        """Length of the bar at rest."""
        return float(self.edges_mm[-1] - self.edges_mm[0])


def coupon(coordinate: float, *, width_mm: float, thickness_mm: float, gauge_mm: float) -> Bar:
    """Return a bar of one mixture and one section: a single slice.

    Raises
    ------
    ArgumentError
        A size that is not above 0 and finite.
    """
    sizes = {"width": width_mm, "thickness": thickness_mm, "gauge": gauge_mm}
    for name, size in sizes.items():
        if not 0.0 < size < np.inf:
            raise ArgumentError(f"{name} of {size:g} mm: it must be above 0 and finite")
    return Bar(
        np.array([0.0, gauge_mm]), np.array([coordinate]), np.array([width_mm * thickness_mm])
    )


def bar_between(
    edges_mm: FloatArray,
    coordinate: FloatArray,
    area_mm2: FloatArray,
    between_mm: tuple[float, float] | None,
) -> Bar:
    """Return the bar of some slices, or of what of them lies between two places of the axis.

    Raises
    ------
    ArgumentError
        The two places do not rise or do not lie on the bar; or as `Bar`.
    """
    if between_mm is None:
        return Bar(edges_mm, coordinate, area_mm2)
    start, stop = between_mm
    low, high = float(edges_mm[0]), float(edges_mm[-1])
    if not low <= start < stop <= high:
        raise ArgumentError(
            f"--between {start:g}:{stop:g}: it must rise and lie on the bar, which goes from "
            f"{low:.6g} to {high:.6g} mm along its axis"
        )
    inner = edges_mm[(edges_mm > start) & (edges_mm < stop)]
    edges = np.concatenate([[start], inner, [stop]])
    old = np.searchsorted(edges_mm, edges[:-1], side="right") - 1
    return Bar(edges, coordinate[old], area_mm2[old])
