"""One specimen of a campaign: what it is, how it was tested, what was measured."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from planner.arrays import FloatArray
from planner.errors import FileError
from planner.gap.profile_design import ProfileDesign
from planner.materials.curve import MINIMUM_POINTS

__all__ = ["MINIMUM_POINTS", "Orientation", "Protocol", "Specimen", "StrainField"]

Orientation = Literal["x", "y", "z"]
Protocol = Literal["monotonic", "cyclic", "relaxation"]


@dataclass(frozen=True, slots=True, eq=False)
class StrainField:
    """Strain along the axis, from image correlation.

    Attributes
    ----------
    time_s
        Rising, shape (t,), on the same clock as the specimen's record.
    x_mm
        Places along the undeformed gauge from its end, rising, shape (p,).
    strain
        Engineering strain, shape (t, p).
    """

    time_s: FloatArray
    x_mm: FloatArray
    strain: FloatArray

    def __post_init__(self) -> None:
        _freeze(self, ("time_s", "x_mm", "strain"))
        shape = (len(self.time_s), len(self.x_mm))
        if self.strain.shape != shape:
            raise FileError(f"strain field: shape {self.strain.shape}; it must be {shape}")


@dataclass(frozen=True, slots=True, eq=False)
class Specimen:
    """One specimen; None stands for what is unknown, never for "as the palette's reference".

    Attributes
    ----------
    id
        Its name in specimens.csv.
    time_s, displacement_mm, force_N
        The record: time rising, travel of the crosshead from rest, force positive in tension;
        shape (n,), n at least `MINIMUM_POINTS`.
    material, profile
        Exactly one is given: a material id of the palette, or a graded bar's design.
    width_mm, thickness_mm
        Nominal section; None for a graded bar whose design has its own, and where only the
        measured size is known.
    gauge_mm
        Undeformed gauge length.
    orientation
        Of the gauge on the tray.
    covariates
        Further columns by name: text, number or None.
    strain_field
        Strain along the axis, if it was measured.
    time_recorded
        False where the record had no time and it was counted from travel and rate.
    """

    id: str
    time_s: FloatArray
    displacement_mm: FloatArray
    force_N: FloatArray
    gauge_mm: float
    material: str | None = None
    profile: ProfileDesign | None = None
    width_mm: float | None = None
    thickness_mm: float | None = None
    measured_width_mm: float | None = None
    measured_thickness_mm: float | None = None
    rate_mm_s: float | None = None
    temperature_C: float | None = None
    soak_h: float | None = None
    age_days: float | None = None
    orientation: Orientation | None = None
    protocol: Protocol | None = None
    batch: str | None = None
    covariates: Mapping[str, str | float | None] = field(default_factory=dict)
    strain_field: StrainField | None = None
    time_recorded: bool = True

    def __post_init__(self) -> None:
        _freeze(self, ("time_s", "displacement_mm", "force_N"))
        where = f"specimen {self.id}"
        columns = {"time_s": self.time_s, "displacement_mm": self.displacement_mm,
                   "force_N": self.force_N}  # fmt: skip
        if self.time_s.ndim != 1 or len({array.shape for array in columns.values()}) > 1:
            shapes = {name: array.shape for name, array in columns.items()}
            raise FileError(f"{where}: columns differ in shape ({shapes}); give one value a point")
        if len(self.time_s) < MINIMUM_POINTS:
            raise FileError(
                f"{where}: the record has {len(self.time_s)} points; at least {MINIMUM_POINTS} "
                "are needed: export all of it, or leave the specimen out of specimens.csv"
            )
        for name, array in columns.items():
            bad = np.flatnonzero(~np.isfinite(array))
            if len(bad):
                raise FileError(
                    f"{where}: {name} is {array[bad[0]]} at point {bad[0] + 1}; remove or repair "
                    "such points"
                )
        fall = np.flatnonzero(np.diff(self.time_s) <= 0.0)
        if len(fall):
            raise FileError(
                f"{where}: time goes from {self.time_s[fall[0]]:g} s to "
                f"{self.time_s[fall[0] + 1]:g} s at point {fall[0] + 2}; time must rise"
            )
        if (self.material is None) == (self.profile is None):
            raise FileError(f"{where}: give exactly one of material and profile")
        if not 0.0 < self.gauge_mm < np.inf:
            raise FileError(f"{where}: gauge_mm is {self.gauge_mm:g}; it must be above 0")

    @property
    def strain(self) -> FloatArray:
        """Travel over gauge length."""
        return self.displacement_mm / self.gauge_mm

    @property
    def area_mm2(self) -> float | None:
        """Undeformed section, measured sizes first; None where a design alone gives it."""
        width = self.measured_width_mm or self.width_mm
        thickness = self.measured_thickness_mm or self.thickness_mm
        return None if width is None or thickness is None else width * thickness

    def section_mm2(self, x_mm: FloatArray) -> FloatArray | None:
        """Return the undeformed section along the gauge, the design's where it has one.

        None where it is unknown.
        """
        area = self.area_mm2
        design = self.profile
        if design is None or (design.width_mm is None and design.thickness_mm is None):
            return None if area is None else np.full(np.shape(x_mm), area)
        sizes = []
        for along, alone in (
            (design.width_mm, self.measured_width_mm or self.width_mm),
            (design.thickness_mm, self.measured_thickness_mm or self.thickness_mm),
        ):
            if along is None and alone is None:
                return None
            sizes.append(
                np.full(np.shape(x_mm), alone)
                if along is None
                else np.interp(x_mm, design.x_mm, along)
            )
        section: FloatArray = sizes[0] * sizes[1]
        return section


def _freeze(value: object, names: tuple[str, ...]) -> None:
    for name in names:
        array = np.array(getattr(value, name), dtype=np.float64)
        array.setflags(write=False)
        object.__setattr__(value, name, array)
