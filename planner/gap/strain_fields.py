"""fields.csv: strain along the axis from image correlation."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from planner.errors import FileError
from planner.gap.column_file import read_columns
from planner.gap.specimen import StrainField

__all__ = ["read_strain_fields"]

_COLUMNS: Mapping[str, str | None] = {"time_s": "time", "x_mm": "length", "strain": None}


def read_strain_fields(path: Path) -> tuple[dict[str, StrainField], dict[str, str]]:
    """Read strain fields, and what of them was left out, by specimen.

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
    fields: dict[str, StrainField] = {}
    notes: dict[str, str] = {}
    for specimen, at in rows.items():
        where = f"{path.name}, specimen {specimen}"
        times, t = np.unique(file.numbers["time_s"][at], return_inverse=True)
        places, p = np.unique(file.numbers["x_mm"][at], return_inverse=True)
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
        if not whole.all():
            notes[specimen] = "places along the axis not seen at every time are left out"
        fields[specimen] = StrainField(times, places[whole], strain[:, whole])
    return fields, notes
