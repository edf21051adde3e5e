"""One colour a material, told apart by eye and by program."""

from collections.abc import Sequence

import numpy as np

from planner.arrays import IntArray
from planner.formats.png import Rgba

__all__ = ["LEAST_DISTANCE", "distinct_colours"]

LEAST_DISTANCE = 8.0
"""Between two colours of a stack, in 8-bit steps of red, green and blue together."""

_SPARE = np.stack(np.meshgrid(*[np.arange(0, 256, 17)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)


def distinct_colours(wished: Sequence[str]) -> tuple[Rgba, ...]:
    """Return the wished colours, opaque; those that look like an earlier one are replaced.

    A replacement is the spare colour farthest from all wished and given ones, so the result
    depends on the wishes alone.

    Parameters
    ----------
    wished
        "#RRGGBB" by material.
    """
    wishes = np.array([list(bytes.fromhex(colour.removeprefix("#"))) for colour in wished])
    spare = np.min([_squares(_SPARE, wish) for wish in wishes], axis=0)
    given: list[IntArray] = []
    for wish in wishes:
        colour = wish
        if any(_squares(wish, other) < LEAST_DISTANCE**2 for other in given):
            colour = _SPARE[np.argmax(spare)]
        given.append(colour)
        spare = np.minimum(spare, _squares(_SPARE, colour))
    return tuple((int(red), int(green), int(blue), 255) for red, green, blue in given)


def _squares(colours: IntArray, other: IntArray) -> IntArray:
    squares: IntArray = ((colours - other) ** 2).sum(axis=-1)
    return squares
