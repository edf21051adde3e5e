"""The figures that specimens are compared by, one row a figure."""

from dataclasses import dataclass

import numpy as np

from planner.arrays import BoolArray, FloatArray, IntArray

__all__ = ["BRANCHES", "FeatureTable"]

BRANCHES = ("loading", "unloading", "reloading", "hold", "field")
"""Where on its path a specimen was: first loading, any way back, any later loading, a rest at the
end of a loading; "field" is strain along a bar, from image correlation, during the first loading.
"""


CLEAR = 5.0
"""Of the floor: above it a figure is not noise."""

_SAME = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class FeatureTable:
    """N figures of all specimens, ordered by specimen.

    A force F is held as ``asinh(F / (2 s))``: its logarithm where it is far above the floor s, and
    its value over 2 s below, so that relative errors, offsets and zero crossings are all seen. The
    local strains of a field likewise.

    Attributes
    ----------
    specimen : (N,)
        Place in the campaign, rising.
    test : (N,)
        The test of the forward model that predicts it.
    step : (N,)
        Its step there.
    branch : (N,)
        Index into `BRANCHES`.
    strain : (N,)
        Nominal strain of the whole gauge at that step.
    time_s : (N,)
        Since the test began; for "hold" since the hold began.
    x_mm : (N,)
        Place along the bar, NaN for forces.
    floor : (N,)
        The floor s, in N or a strain.
    measured : (N,)
        The transformed measurement.
    measured_raw : (N,)
        In N, or a strain.
    """

    specimen: IntArray
    test: IntArray
    step: IntArray
    branch: IntArray
    strain: FloatArray
    time_s: FloatArray
    x_mm: FloatArray
    floor: FloatArray
    measured: FloatArray
    measured_raw: FloatArray

    def __len__(self) -> int:
        return len(self.specimen)

    @property
    def is_field(self) -> BoolArray:
        """Which rows are strains along a bar."""
        return np.asarray(self.branch == BRANCHES.index("field"))

    def transformed(self, raw: FloatArray) -> FloatArray:
        """Return forces or strains of these rows, (..., N), on the scale of `measured`."""
        return np.arcsinh(raw / (2.0 * self.floor))

    def sensitivity(self, raw: FloatArray) -> FloatArray:
        """Return the derivative of `transformed` by the logarithm of its argument."""
        half = raw / (2.0 * self.floor)
        return half / np.sqrt(1.0 + half**2)

    def chord(self, raw: FloatArray) -> FloatArray:
        """Return the mean of `sensitivity` from `raw` to what was measured.

        With it a factor on forces is a constant times the chord, however large the factor. Where
        either is in the noise, or their signs differ, it is the larger one's sensitivity.
        """
        measured = self.measured_raw
        larger = np.where(np.abs(measured) > np.abs(raw), measured, raw)
        found = self.sensitivity(larger)
        clear = np.minimum(np.abs(measured), np.abs(raw)) > CLEAR * self.floor
        clear &= np.sign(measured) == np.sign(raw)
        ratio = np.log(np.divide(measured, raw, out=np.ones_like(raw), where=clear))
        clear &= np.abs(ratio) > _SAME
        rise = self.measured - self.transformed(raw)
        return np.asarray(np.divide(rise, ratio, out=found, where=clear))
