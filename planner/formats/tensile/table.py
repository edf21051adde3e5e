"""What a tensile file holds once its columns have planner's names and units."""

from collections.abc import Mapping
from dataclasses import dataclass

from planner.arrays import FloatArray, IntArray

__all__ = ["TensileTable"]


@dataclass(frozen=True, slots=True, eq=False)
class TensileTable:
    """One specimen's record.

    Attributes
    ----------
    file
        Name of the file, without folder.
    columns
        Arrays of one length by name: time_s, displacement_mm, force_N, strain, stress_MPa,
        true_strain, true_stress_MPa; whichever the file has.
    lines
        Line number of each row in the file, for messages.
    specimen
        The specimen that the file names, or "".
    metadata
        What the file's head says: width_mm, thickness_mm, gauge_mm, rate_mm_s (numbers),
        material (text); whichever it has.
    without_unit
        Columns whose header gave no unit, so that one was assumed.
    notes
        What was assumed or left out in reading.
    """

    file: str
    columns: Mapping[str, FloatArray]
    lines: IntArray
    specimen: str
    metadata: Mapping[str, float | str]
    without_unit: frozenset[str]
    notes: tuple[str, ...]
