"""Gradients for the sweep: as planner takes them, and their values computed here, on their own."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.float64]


@dataclass(frozen=True)
class Gradient:
    """Options of the command, and the field they mean.

    Attributes
    ----------
    bounds
        Lowest and highest value that the field can have at points (n, 3) of the part's file: equal
        where its formula is known.
    steepness
        Most that the field changes a mm.
    curved
        Whether it is drawn on a grid, and so lies off by a part of a pitch.
    of_surface
        Whether it goes by the part's surface, which repairs change.
    """

    options: tuple[str, ...]
    bounds: Callable[[Values], tuple[Values, Values]]
    steepness: float
    curved: bool
    of_surface: bool = False


def exactly(value: Callable[[Values], Values]) -> Callable[[Values], tuple[Values, Values]]:
    def bounds(points: Values) -> tuple[Values, Values]:
        values = value(points)
        return values, values

    return bounds


def text(values: Values) -> str:
    return " ".join(repr(float(value)) for value in values)


def gradients(triangles: Values, rng: np.random.Generator) -> dict[str, Gradient]:
    """Return a gradient of each kind over a solid."""
    points = triangles.reshape(-1, 3)
    low, high = points.min(axis=0), points.max(axis=0)
    size = high - low
    length = float(np.linalg.norm(size))
    axis = int(rng.integers(3))
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    along = points @ direction
    centre = low + rng.uniform(-0.2, 1.2, 3) * size
    reach = float(np.linalg.norm(points - centre, axis=1).max())
    depth = 0.5 * float(size.min())
    start = low + size * rng.uniform(0, 0.3, 3)
    radius = 0.3 * length

    def on_axis(where: Values) -> Values:
        return (where[:, axis] - low[axis]) / size[axis]

    def radial(where: Values) -> Values:
        return np.linalg.norm(where - centre, axis=1) / reach

    def deep(where: Values) -> Values:
        return distance_to(triangles, where) / depth

    def straight(where: Values) -> tuple[Values, Values]:
        # No way is shorter than the straight one.
        way = np.maximum(np.linalg.norm(where - start, axis=1) - radius, 0.0) / length
        return way, np.full(len(where), np.inf)

    def unknown(where: Values) -> tuple[Values, Values]:
        return np.full(len(where), -np.inf), np.full(len(where), np.inf)

    names = {
        "axis": f"axis: {'xyz'[axis]}",
        "radial": f"radial: point={text(centre)}, from=0, to={reach!r}",
        "distance": f"distance: surface, from=0, to={depth!r}",
    }
    ends = (low[axis] + 0.1 * size[axis], high[axis] - 0.1 * size[axis])
    steep = {"axis": 1 / size[axis], "radial": 1 / reach, "distance": 1 / depth}
    known = {"axis": on_axis, "radial": radial, "distance": deep}

    def two(kind: str, one: str, other: str, weight: float) -> Gradient:
        def both(where: Values) -> Values:
            a, b = known[one](where), known[other](where)
            if kind == "blend":
                return (1 - weight) * a + weight * b
            return np.minimum(a, b) if kind == "min" else np.maximum(a, b)

        last = f"; {weight!r}" if kind == "blend" else ""
        said = f"{kind}({names[one]}; {names[other]}{last})"
        return Gradient(("--field", said), exactly(both), max(steep[one], steep[other]), True, True)

    return {
        "plane": Gradient(
            ("--axis", ",".join(repr(float(n)) for n in direction)),
            exactly(lambda where: (where @ direction - along.min()) / np.ptp(along)),
            1 / float(np.ptp(along)),
            False,
        ),
        "axis": Gradient(("--axis", "xyz"[axis]), exactly(on_axis), steep["axis"], False),
        "radial": Gradient(("--field", names["radial"]), exactly(radial), steep["radial"], True),
        "distance": Gradient(
            ("--field", names["distance"]), exactly(deep), steep["distance"], True, True
        ),
        "geodesic": Gradient(
            ("--field", f"geodesic: start=ball {text(start)} {radius!r}, from=0, to={length!r}"),
            straight, 1 / length, True,
        ),
        "harmonic": Gradient(
            (
                "--field",
                f"harmonic: from={'xyz'[axis]}<{float(ends[0])!r}, "
                f"to={'xyz'[axis]}>{float(ends[1])!r}",
            ),
            unknown, np.inf, True,
        ),
        "blend": two("blend", "axis", "distance", float(rng.uniform(0.2, 0.8))),
        "min": two("min", "radial", "distance", 0.0),
        "max": two("max", "axis", "radial", 0.0),
    }  # fmt: skip


def distance_to(triangles: Values, where: Values) -> Values:
    """Return the distance of each point to the nearest of some triangles, all tried."""
    found = np.full(len(where), np.inf)
    a, b, c = (corner[None] for corner in triangles.transpose(1, 0, 2))
    for n, point in enumerate(where):
        found[n] = np.sqrt(_squared(point[None, None], a, b, c).min())
    return found


def _squared(point: Values, a: Values, b: Values, c: Values) -> Values:
    # The nearest of a triangle is on one of its sides, or where the normal through the point meets.
    squared = np.minimum(_to_side(point, a, b), _to_side(point, b, c))
    squared = np.minimum(squared, _to_side(point, c, a))
    normal = np.cross(b - a, c - a)
    length = (normal * normal).sum(axis=-1)
    within = np.ones(length.shape, dtype=bool)
    for one, other in ((a, b), (b, c), (c, a)):
        within &= (np.cross(other - one, point - one) * normal).sum(axis=-1) >= 0
    height = ((point - a) * normal).sum(axis=-1)
    above = np.divide(height * height, length, out=np.full(length.shape, np.inf), where=length > 0)
    return np.where(within, np.minimum(above, squared), squared)


def _to_side(point: Values, one: Values, other: Values) -> Values:
    side = other - one
    length = (side * side).sum(axis=-1)
    along = ((point - one) * side).sum(axis=-1)
    share = np.clip(np.divide(along, length, out=np.zeros(length.shape), where=length > 0), 0, 1)
    off = point - one - share[..., None] * side
    return (off * off).sum(axis=-1)
