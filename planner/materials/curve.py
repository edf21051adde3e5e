"""One specimen's loading curve, checked: the input of characterisation and of fitting."""

from dataclasses import dataclass, field

import numpy as np

from planner.arrays import FloatArray
from planner.errors import FileError

__all__ = ["MINIMUM_POINTS", "Curve"]

MINIMUM_POINTS = 8
"""Fewer points than this decide neither a slope nor a law."""


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """Nominal stress against engineering strain of one specimen in uniaxial tension.

    Attributes
    ----------
    specimen
        The specimen's name; errors carry it.
    strain
        Engineering strain (elongation over gauge length, a fraction), shape (n,).
    stress_MPa
        Nominal stress (force over the undeformed section), shape (n,).
    time_s
        Time from the first point, or None where it was not recorded.
    material
        What the specimen is made of, as the lab calls it.
    notes
        What was corrected or assumed on the way, one sentence each.

    Raises
    ------
    FileError
        The arrays differ in length, hold NaN or infinity, have fewer than `MINIMUM_POINTS`
        points, or time does not rise.
    """

    specimen: str
    strain: FloatArray
    stress_MPa: FloatArray
    time_s: FloatArray | None = None
    material: str = ""
    notes: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        columns = {"strain": self.strain, "stress_MPa": self.stress_MPa}
        if self.time_s is not None:
            columns["time_s"] = self.time_s
        for name, values in columns.items():
            array = np.array(values, dtype=np.float64)
            array.setflags(write=False)
            object.__setattr__(self, name, array)
            columns[name] = array
        where = f"specimen {self.specimen}"
        if len({array.shape for array in columns.values()}) > 1 or self.strain.ndim != 1:
            shapes = {name: array.shape for name, array in columns.items()}
            raise FileError(f"{where}: columns differ in shape ({shapes}); give one value a point")
        if len(self.strain) < MINIMUM_POINTS:
            raise FileError(
                f"{where}: the curve has {len(self.strain)} points; it takes at least "
                f"{MINIMUM_POINTS} to characterise one"
            )
        for name, array in columns.items():
            bad = np.flatnonzero(~np.isfinite(array))
            if len(bad):
                raise FileError(
                    f"{where}: {name} is {array[bad[0]]} at point {bad[0] + 1}; remove or repair "
                    "such points"
                )
        if self.time_s is not None and np.any(np.diff(self.time_s) <= 0):
            at = int(np.flatnonzero(np.diff(self.time_s) <= 0)[0])
            raise FileError(
                f"{where}: time goes from {self.time_s[at]:g} s to {self.time_s[at + 1]:g} s at "
                f"point {at + 2}; time must rise"
            )

    @property
    def stretch(self) -> FloatArray:
        """Deformed length over gauge length, 1 + strain."""
        return 1.0 + self.strain
