"""Simulation: what a bar does under load, and its files."""

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np

from planner.arrays import BoolArray, FloatArray
from planner.formats.json_document import SIGNIFICANT_DIGITS, encode_document
from planner.palette import Palette
from planner.simulation.bar import Bar
from planner.simulation.findings import Finding

__all__ = ["Simulation"]


@dataclass(frozen=True, slots=True, eq=False)
class Simulation:
    """Force and displacement of a bar's ends, and the strain along it.

    Attributes
    ----------
    name
        What was pulled: a part's file, a profile's, or a material.
    bar
        Its slices: ``x_mm``, ``length_mm``, ``area_mm2``, ``coordinate``, (n,) each.
    time_s, displacement_mm, force_N : (steps,)
        Steps that lie out of reach are left out.
    force_interval_N : (steps, 2)
        Holds the force of a print with probability `level`.
    strain, stress_MPa : (steps, n)
        Engineering strain and nominal stress of each slice.
    break_strain : (n,)
        Elongation at break of each slice.
    findings
        Where a print would break or the path ends early.
    notes
        What was assumed, one sentence each.
    """

    name: str
    palette: Palette
    bar: Bar
    protocol: str
    rate_mm_s: float
    to_strain: float
    level: float
    time_s: FloatArray
    displacement_mm: FloatArray
    force_N: FloatArray
    force_interval_N: FloatArray
    strain: FloatArray
    stress_MPa: FloatArray
    break_strain: FloatArray
    findings: tuple[Finding, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def ok(self) -> bool:
        """Whether the whole path is reached and nothing breaks on it."""
        return not self.findings

    @property
    def gauge_strain(self) -> FloatArray:
        """Displacement over the bar's length at rest, (steps,)."""
        return self.displacement_mm / self.bar.gauge_mm

    @property
    def beyond_break(self) -> BoolArray:
        """Steps from the first break on, which are extrapolated, (steps,)."""
        broken = (self.strain > self.break_strain).any(axis=1)
        return np.logical_or.accumulate(broken)

    def document(self) -> dict[str, Any]:
        """Return the simulation as JSON holds it."""
        low, high = self.force_interval_N.T
        return {
            "schema": 1,
            "source": self.name,
            "palette": {"name": self.palette.name, "sha256": self.palette.sha256},
            "protocol": self.protocol,
            "rate_mm_s": self.rate_mm_s,
            "to_strain": self.to_strain,
            "gauge_mm": self.bar.gauge_mm,
            "level": self.level,
            "steps": {
                "time_s": self.time_s.tolist(),
                "displacement_mm": self.displacement_mm.tolist(),
                "gauge_strain": self.gauge_strain.tolist(),
                "force_N": self.force_N.tolist(),
                "force_low_N": low.tolist(),
                "force_high_N": high.tolist(),
                "beyond_break": self.beyond_break.tolist(),
            },
            "slices": {
                "x_mm": self.bar.x_mm.tolist(),
                "length_mm": self.bar.length_mm.tolist(),
                "area_mm2": self.bar.area_mm2.tolist(),
                "coordinate": self.bar.coordinate.tolist(),
                "break_strain": self.break_strain.tolist(),
            },
            "strain": self.strain.tolist(),
            "findings": [dataclasses.asdict(finding) for finding in self.findings],
            "notes": list(self.notes),
        }

    def json(self) -> bytes:
        """Return the bytes of the JSON document."""
        return encode_document(self.document())

    def csv(self) -> bytes:
        """Return the curve as CSV, one row a step."""
        columns = {
            "time_s": self.time_s,
            "displacement_mm": self.displacement_mm,
            "force_N": self.force_N,
            "force_low_N": self.force_interval_N[:, 0],
            "force_high_N": self.force_interval_N[:, 1],
            "gauge_strain": self.gauge_strain,
            "beyond_break": self.beyond_break.astype(np.float64),
        }
        return _csv(columns)

    def field_csv(self) -> bytes:
        """Return the strain along the bar as CSV: time_s, x_mm, strain of each step and slice."""
        steps, n = self.strain.shape
        columns = {
            "time_s": np.repeat(self.time_s, n),
            "x_mm": np.tile(self.bar.x_mm, steps),
            "strain": self.strain.ravel(),
        }
        return _csv(columns)


def _csv(columns: dict[str, FloatArray]) -> bytes:
    row = ",".join([f"%.{SIGNIFICANT_DIGITS}g"] * len(columns))
    values = np.stack(list(columns.values()), axis=1) + 0.0  # no -0
    lines = [",".join(columns), *(row % tuple(figures) for figures in values.tolist())]
    return ("\n".join(lines) + "\n").encode("ascii")
