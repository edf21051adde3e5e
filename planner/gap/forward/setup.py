"""Every test of a campaign as it is mounted: all that decides its curve."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from planner.arrays import BoolArray, FloatArray, IntArray
from planner.gap.profile_design import ProfileDesign
from planner.palette import Reference

__all__ = ["SOFTENING_PEAKS", "SOFTENING_SHARES", "RELAXATION_TIMES_s", "Setup"]

RELAXATION_TIMES_s: FloatArray = np.geomspace(1e-2, 1e5, 15)
"""Times of the exponentials that any relaxation is written with, two a decade."""

SOFTENING_SHARES: FloatArray = np.linspace(0.0, 1.0, 21)
"""Strain over the largest strain so far, at which softening tables stand."""

SOFTENING_PEAKS: FloatArray = np.linspace(0.0, 1.0, 21)
"""Largest strains so far, at which softening and set tables stand."""


@dataclass(frozen=True, slots=True, eq=False)
class Setup:
    """P tests of T steps, cut into S slices in all; an effect returns a changed copy.

    Tests that are replicates of one another are one test here. Stages follow each other as the
    attributes do: what was printed, its law, its geometry, its grips and machine, its sensors.

    Attributes
    ----------
    reference
        The conditions at which the palette's laws were measured.
    coordinate_range
        Of the palette, softest to hardest.
    first_slice : (P + 1,)
        Slices of test p are ``first_slice[p]`` to ``first_slice[p + 1]``; a coupon has one.
    time_s, travel_mm : (P, T)
        Of the crosshead, the first step at rest.
    rate_per_s, temperature_C, soak_h, age_days, width_mm, thickness_mm, gauge_mm : (P,)
        Covariates; where unknown, those of the reference (sizes: the nominal ones).
    orientation : (P,)
        0, 1 or 2 for x, y, z.
    known : name to (P,)
        Where each covariate is known.
    designs
        Of each test, None for a coupon.
    x_mm, length_mm : (S,)
        Middle of each slice along the drawn gauge, and the length that is really there.
    coordinate : (S,)
        Of what was really printed.
    log_factor, log_tilt : (S,)
        The stress is multiplied by ``exp(log_factor + log_tilt tanh((strain - 0.15) / 0.2))``.
    relaxing : (S, K)
        Shares of the instantaneous stress that relax with `RELAXATION_TIMES_s`.
    softening : (S,), softening_table : (21, 21)
        Below its largest strain so far, a slice's stress is multiplied by
        ``1 - softening * table(strain / largest, largest)``, the table on `SOFTENING_SHARES` and
        `SOFTENING_PEAKS`, its last row 0.
    set_share : (S,), set_table : (21,)
        Below its largest strain so far, a slice bears no stress up to
        ``set_share * table(largest)``, the table on `SOFTENING_PEAKS` a strain below the peak.
    area_mm2 : (S,)
        At rest.
    travel_factor : (P,)
        True travel over the recorded one; a gauge length drawn too short acts alike.
    lost_mm : (P, T)
        Travel that never reaches the specimen.
    slip_mm_N, slip_from_N, slip_power : (P,)
        Travel lost for good: ``slip_mm_N max(F_max - slip_from_N, 0) ** slip_power``.
    compliance_mm_N, compliance_power : (P,)
        Travel lost in the machine: ``compliance_mm_N ((1 + F)**p - 1) / p`` with F in N.
    gain, offset_N : (P, T)
        Of the load cell: it shows ``gain F + offset``.
    """

    reference: Reference
    coordinate_range: tuple[float, float]
    first_slice: IntArray
    time_s: FloatArray
    travel_mm: FloatArray
    rate_per_s: FloatArray
    temperature_C: FloatArray
    soak_h: FloatArray
    age_days: FloatArray
    width_mm: FloatArray
    thickness_mm: FloatArray
    gauge_mm: FloatArray
    orientation: IntArray
    known: Mapping[str, BoolArray]
    designs: tuple[ProfileDesign | None, ...]
    x_mm: FloatArray
    coordinate: FloatArray
    log_factor: FloatArray
    log_tilt: FloatArray
    relaxing: FloatArray
    softening: FloatArray
    set_share: FloatArray
    length_mm: FloatArray
    area_mm2: FloatArray
    travel_factor: FloatArray
    lost_mm: FloatArray
    slip_mm_N: FloatArray
    slip_from_N: FloatArray
    slip_power: FloatArray
    compliance_mm_N: FloatArray
    compliance_power: FloatArray
    gain: FloatArray
    offset_N: FloatArray
    softening_table: FloatArray = field(default_factory=lambda: np.zeros((21, 21)))
    set_table: FloatArray = field(default_factory=lambda: np.zeros(21))

    @property
    def test_of_slice(self) -> IntArray:
        """The test that each slice belongs to, (S,)."""
        return np.repeat(np.arange(len(self.first_slice) - 1), np.diff(self.first_slice))

    @property
    def is_bar(self) -> BoolArray:
        """Which tests are graded bars, (P,)."""
        return np.array([design is not None for design in self.designs])

    def on_slices(self, values: FloatArray) -> FloatArray:
        """Return values of the tests, (P,), on their slices, (S,)."""
        return np.repeat(np.asarray(values, dtype=np.float64), np.diff(self.first_slice))

    def with_(self, **changes: Any) -> "Setup":
        """Return a copy with some attributes changed."""
        return replace(self, **changes)

    def stiffened(self, log_factor: FloatArray) -> "Setup":
        """Return a copy whose slices' stresses are multiplied by exp(log_factor), (S,)."""
        return replace(self, log_factor=self.log_factor + log_factor)
