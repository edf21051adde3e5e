"""Controls: where ln(modulus) is free, and splines between: knots along a field, or a lattice."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import Any

import numpy as np

from planner.errors import ArgumentError
from planner.materials.mixtures import CoefficientModel
from planner.numerics import FloatArray, numbers_in

__all__ = ["TABLE", "Controls", "StiffnessRange", "lattice_counts"]

TABLE = "field.vti"
"""A lattice's gradient, as a file beside the plan."""


@dataclass(frozen=True, eq=False)
class StiffnessRange:
    """What a share of the way from ln(softest) to ln(stiffest) means.

    Attributes
    ----------
    moduli_MPa
        Softest and stiffest that is allowed: shares 0 and 1.
    model, at_strain
        Turn a modulus into a mixture.
    """

    moduli_MPa: tuple[float, float]
    model: CoefficientModel
    at_strain: float

    @property
    def span(self) -> float:
        """ln(stiffest / softest)."""
        return float(np.log(self.moduli_MPa[1] / self.moduli_MPa[0]))

    def modulus_MPa(self, share: FloatArray) -> FloatArray:
        """Return the moduli that shares mean."""
        return np.asarray(self.moduli_MPa[0] * np.exp(self.span * share))

    def coordinates(self, share: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the mixtures' coordinates at shares, and their derivative over the share."""
        nodes, known = self._known
        step = nodes[1]
        cell = np.clip((share / step).astype(np.int64), 0, len(nodes) - 2)
        return np.interp(share, nodes, known), (known[cell + 1] - known[cell]) / step

    @cached_property
    def _known(self) -> tuple[FloatArray, FloatArray]:
        nodes = np.linspace(0.0, 1.0, 2049)
        return nodes, self.model.coordinate_for(self.modulus_MPa(nodes), self.at_strain)


@dataclass(frozen=True, eq=False)
class Controls:
    """Unknowns of a design, each from 0 (softest that is allowed) to 1 (stiffest).

    Attributes
    ----------
    basis : callable
        Of points (Q, 3) in the part's own coordinates: (Q, n) sparse, each row of sum 1. It times
        the controls is the share of the way from ln(softest) to ln(stiffest) at the points.
    bends : (k, n)
        Second differences: a gradient whose sum of squares is least is smoothest.
    slopes : (r, n)
        Changes of that share a mm along lines of controls, which bound those in between.
    even : (n,)
        What is taken where nothing else is wanted.
    """

    basis: Callable[[FloatArray], Any]
    bends: FloatArray
    slopes: FloatArray
    even: FloatArray

    @classmethod
    def knots(
        cls, along: Callable[[FloatArray], FloatArray], even: FloatArray, span_mm: float
    ) -> "Controls":
        """Return knots at even distances of a field, with straight lines between.

        Parameters
        ----------
        along
            The field's values, from 0 to 1, at points in the part's own coordinates.
        span_mm
            Length of the field, or 1.
        """
        count = len(even)
        bends = np.diff(np.eye(count), 2, axis=0)
        slopes = np.diff(np.eye(count), axis=0) * (count - 1) / span_mm
        return cls(lambda at: _splines(along(at)[:, None], (count,), (1,)), bends, slopes, even)

    @classmethod
    def lattice(
        cls, bounds_mm: FloatArray, counts: Sequence[int], symmetric: Sequence[int]
    ) -> "Controls":
        """Return a lattice of controls over a box, all half-way where nothing else is wanted.

        Along an axis with one control the gradient is constant, with two linear.

        Parameters
        ----------
        symmetric
            Axes across whose middle plane of the box the gradient is its own mirror image.
        """
        low, extent = bounds_mm[0], np.maximum(np.ptp(bounds_mm, axis=0), 1e-9)
        total, degrees = int(np.prod(counts)), [min(_DEGREE, count - 1) for count in counts]
        first = np.arange(total).reshape(tuple(counts))
        for axis in symmetric:
            first = np.minimum(first, np.flip(first, axis))
        kept, tied = np.unique(first.ravel(), return_inverse=True)
        tie = np.eye(len(kept))[tied]

        def basis(points_mm: FloatArray) -> Any:
            from scipy.sparse import csr_matrix

            return _splines((points_mm - low) / extent, counts, degrees) @ csr_matrix(tie)

        rows = np.eye(total).reshape(*counts, total)
        slopes, bends = [], []
        for axis, count in enumerate(counts):
            spacing = extent[axis] / (count - degrees[axis])
            slopes.append(np.diff(rows, axis=axis).reshape(-1, total) / spacing)
            bends.append(np.diff(rows, 2, axis=axis).reshape(-1, total) / np.sqrt(total / count))
        for one, other in combinations(range(3), 2):
            twist = np.diff(np.diff(rows, axis=one), axis=other).reshape(-1, total)
            lines = total / max(counts[one], counts[other])
            bends.append(np.sqrt(2.0 / lines) * twist)
        even = np.full(len(kept), 0.5)
        return cls(basis, np.concatenate(bends) @ tie, np.concatenate(slopes) @ tie, even)


# ------------------------------------------------------------------------------------------------
# A lattice of controls, quadratic B-splines between. They are uniform, so that what is linear in
# the controls is linear in space, and second differences of the controls measure how it bends
# (P. H. C. Eilers and B. D. Marx, Flexible smoothing with B-splines and penalties, Statist. Sci. 11
# (1996) 89).


_DEGREE = 2
_MOST_CONTROLS = 600
"""A step solves for each of them, in memory all at once."""


def _splines(share: FloatArray, counts: Sequence[int], degrees: Sequence[int]) -> Any:
    """Return the weights of uniform B-splines at places, (Q, axes) from 0 to 1, sparse (Q, n).

    Of the products of each axis' splines, the last axis fastest.
    """
    from scipy.interpolate import NdBSpline
    from scipy.sparse import csr_matrix

    knots = tuple(np.arange(-k, n + 1.0) for n, k in zip(counts, degrees, strict=True))
    places = np.clip(share, 0.0, 1.0) * np.subtract(counts, degrees)
    made = NdBSpline.design_matrix(places, knots, tuple(degrees))
    # Its width ends with the last control that has a point.
    return csr_matrix((made.data, made.indices, made.indptr), (len(share), int(np.prod(counts))))


def lattice_counts(text: str, extent_mm: FloatArray, figures: int) -> tuple[int, int, int]:
    """Return the controls along x, y and z that ``6x3x3``, ``8mm`` or ``auto`` mean.

    ``auto`` takes the spacing at which there are about eight controls for each of so many figures
    that are wanted, 64 to 216 in all. They are as dense along each axis.

    Raises
    ------
    ArgumentError
        Another text, or too many.
    """
    plain = str(text).strip().casefold().replace("×", "x")
    words = plain.split("x")
    if len(words) == 3 and all(word.isdigit() and int(word) for word in words):
        x, y, z = map(int, words)
    else:
        (spacing,) = numbers_in([plain.removesuffix("mm")], float) or [0.0]
        if plain == "auto":
            wanted = min(max(8 * figures, 64), 216)
            sizes = np.geomspace(1.0, 0.01, 100) * float(extent_mm.max())
            counts = [np.prod(_counts(extent_mm, size)) for size in sizes]
            spacing = float(sizes[max(int(np.searchsorted(counts, wanted, "right")) - 1, 0)])
        elif not plain.endswith("mm") or not 0.0 < spacing < np.inf:
            raise ArgumentError(
                f"`free` {text}: it is 6x3x3 (controls along x, y and z), 8mm (their spacing) or "
                "auto"
            )
        x, y, z = _counts(extent_mm, spacing)
    if not 2 <= x * y * z <= _MOST_CONTROLS:
        raise ArgumentError(
            f"`free` {text}: {x} x {y} x {z} controls; there may be 2 to {_MOST_CONTROLS} in all"
        )
    return x, y, z


def _counts(extent_mm: FloatArray, spacing_mm: float) -> list[int]:
    spans = np.maximum(np.rint(np.minimum(extent_mm / spacing_mm, 1e3)), 1.0)
    return [int(n) + _DEGREE for n in spans]
