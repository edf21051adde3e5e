"""The points that a law is fitted to: every specimen counts once, whatever its sampling rate."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from planner.arrays import BoolArray, FloatArray, IntArray
from planner.errors import ArgumentError
from planner.materials.curve import Curve

__all__ = ["RELATIVE_FLOOR", "Sample", "Weighting", "sample_of", "weighting_of"]

Weighting: TypeAlias = Literal["relative", "absolute"]

RELATIVE_FLOOR = 0.05
"""Share of the largest stress under which a relative residual stops growing: near zero stress
the load cell's noise, not the law, would decide."""


@dataclass(frozen=True, slots=True, eq=False)
class Sample:
    """Points of one material's specimens, with weights that sum to one.

    The cost of a law is ``sum w_i ((P(l_i) - P_i) / s_i)^2``, the mean square of the residual
    over the scale s: dimensionless, so that stiff and soft materials are judged alike.

    Attributes
    ----------
    stretch, stress_MPa
        Shape (n,).
    scale_MPa
        Shape (n,): hypot(stress, floor) for relative weighting, the root mean square stress for
        absolute weighting.
    weight
        Shape (n,): equal within a specimen; each specimen has the same sum.
    specimen
        Shape (n,), the specimen's number from zero.
    """

    stretch: FloatArray
    stress_MPa: FloatArray
    scale_MPa: FloatArray
    weight: FloatArray
    specimen: IntArray

    @property
    def specimens(self) -> int:
        """Number of specimens."""
        return len(np.unique(self.specimen))

    @property
    def factor(self) -> FloatArray:
        """Multiplier of a residual in MPa under which the sum of squares is the cost."""
        return np.sqrt(self.weight) / self.scale_MPa

    def part(self, chosen: BoolArray) -> "Sample":
        """Return the points where `chosen` (n,) is true, weighed anew."""
        keep = chosen
        specimen = self.specimen[keep]
        return Sample(
            self.stretch[keep],
            self.stress_MPa[keep],
            self.scale_MPa[keep],
            _weights(specimen),
            specimen,
        )


def weighting_of(name: str) -> Weighting:
    """Return the weighting of that name.

    Raises
    ------
    ArgumentError
        There is none.
    """
    match name:
        case "relative":
            return "relative"
        case "absolute":
            return "absolute"
    raise ArgumentError(f"weighting {name!r}: choose relative or absolute")


def sample_of(
    curves: Sequence[Curve],
    *,
    weighting: Weighting = "relative",
    points: int | None = 60,
) -> Sample:
    """Resample the specimens' loading curves to points even in strain, and weigh them.

    Parameters
    ----------
    curves
        Replicates of one material, strain from rest, loading only.
    weighting
        "relative": residual over hypot(stress, `RELATIVE_FLOOR` of the largest stress);
        "absolute": residual over the root mean square stress of all points.
    points
        Means over this many bins of equal strain width a specimen (empty bins are left out);
        None takes the points as they are, each of a specimen with the same weight.

    Raises
    ------
    ArgumentError
        No curve, or a curve without tension.
    """
    if not curves:
        raise ArgumentError("no curve to fit a law to; give at least one specimen")
    stretch, stress, specimen = [], [], []
    for number, curve in enumerate(curves):
        tension = (curve.strain > 0.0) & np.isfinite(curve.stress_MPa)
        if tension.sum() < 3 or curve.stress_MPa[tension].max() <= 0.0:
            raise ArgumentError(
                f"specimen {curve.specimen}: fewer than 3 points in tension with a stress above "
                "zero; a law is fitted to strain from 0 upwards and tensile stress as positive"
            )
        x, y = curve.strain[tension], curve.stress_MPa[tension]
        if points is not None and len(x) > points:
            x, y = _bin_means(x, y, points)
        stretch.append(1.0 + x)
        stress.append(y)
        specimen.append(np.full(len(x), number))
    all_stress, numbers = np.concatenate(stress), np.concatenate(specimen)
    weight = _weights(numbers)
    if weighting == "relative":
        scale = np.hypot(all_stress, RELATIVE_FLOOR * all_stress.max())
    else:
        scale = np.full(len(all_stress), np.sqrt((weight * all_stress**2).sum()))
    return Sample(np.concatenate(stretch), all_stress, scale, weight, numbers)


def _bin_means(x: FloatArray, y: FloatArray, bins: int) -> tuple[FloatArray, FloatArray]:
    index = np.minimum((x / x.max() * bins).astype(np.int64), bins - 1)
    count = np.bincount(index, minlength=bins)
    used = count > 0
    sums = (np.bincount(index, values, minlength=bins)[used] for values in (x, y))
    mean_x, mean_y = (s / count[used] for s in sums)
    return mean_x, mean_y


def _weights(specimen: IntArray) -> FloatArray:
    numbers, inverse, count = np.unique(specimen, return_inverse=True, return_counts=True)
    out: FloatArray = 1.0 / (count[inverse] * len(numbers))
    return out
