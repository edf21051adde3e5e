"""fields.csv: strain along the axis from image correlation."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planner.errors import FileError
from planner.gap.column_file import read_columns
from planner.gap.specimen import StrainField

__all__ = ["MeasuredField", "read_strain_fields"]

_COLUMNS: Mapping[str, str | None] = {"time_s": "time", "x_mm": "length", "strain": None}

SLACK_SHARE = 0.02
FACET_SHARE = 0.05
"""Of the gauge: how far beyond its ends a place may lie. Its ends are known no better than to the
first, and a facet whose middle is beyond may still touch it; no useful facet is above the second.
"""


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredField:
    """One specimen's strain field as it stands in a file.

    Attributes
    ----------
    lines : (p,)
        Line of each place's first row.
    note
        What was left out, "" for nothing.
    """

    field: StrainField
    file: str
    lines: tuple[int, ...]
    note: str

    def on_gauge(self, gauge_mm: float) -> StrainField:
        """Return the field, whose places are on the gauge.

        Raises
        ------
        FileError
            A place lies beyond an end of the gauge by more than a facet and 2 % of the gauge.
        """
        x = self.field.x_mm
        facet = min(float(np.median(np.diff(x))), FACET_SHARE * gauge_mm)
        slack = max(facet, SLACK_SHARE * gauge_mm)
        outside = np.flatnonzero((x < -slack) | (x > gauge_mm + slack))
        if len(outside):
            at = int(outside[0])
            raise FileError(
                f"{self.file}, line {self.lines[at]}: x_mm is {x[at]:g}; the gauge goes from 0 to "
                f"{gauge_mm:g} mm; count x_mm along the undeformed gauge from its end, and leave "
                "out what is beyond"
            )
        return self.field


def read_strain_fields(path: Path) -> dict[str, MeasuredField]:
    """Read strain fields by specimen.

    Only places that were seen at every time are kept.

    Raises
    ------
    FileError
        A bad column or cell, one place twice at one time, or too few places; the message names
        file and line or specimen.
    """
    file = read_columns(path, _COLUMNS, with_specimen=True)
    rows: dict[str, list[int]] = {}
    for row, specimen in enumerate(file.texts):
        rows.setdefault(specimen, []).append(row)
    fields: dict[str, MeasuredField] = {}
    for specimen, at in rows.items():
        where = f"{path.name}, specimen {specimen}"
        times, t = np.unique(file.numbers["time_s"][at], return_inverse=True)
        places, first, p = np.unique(
            file.numbers["x_mm"][at], return_index=True, return_inverse=True
        )
        count = np.zeros((len(times), len(places)), dtype=np.int64)
        np.add.at(count, (t, p), 1)
        if count.max() > 1:
            double = int(np.flatnonzero(count[t, p] > 1)[1])
            raise FileError(
                f"{path.name}, line {file.lines[at[double]]}: specimen {specimen} has a strain at "
                "this time and place already; keep one"
            )
        strain = np.zeros(count.shape)
        strain[t, p] = file.numbers["strain"][at]
        whole = count.all(axis=0)
        if whole.sum() < 2 or 2 * whole.sum() < len(places):
            raise FileError(
                f"{where}: only {whole.sum()} of {len(places)} places were seen at all "
                f"{len(times)} times; export the strains on the same places at each time"
            )
        fields[specimen] = MeasuredField(
            field=StrainField(times, places[whole], strain[:, whole]),
            file=path.name,
            lines=tuple(file.lines[at[k]] for k in first[whole].tolist()),
            note="" if whole.all() else "places along the axis not seen at every time are left out",
        )
    return fields
