"""A smooth trend of a figure over material and conditions, that a few strays do not move."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from planner.arrays import FloatArray
from planner.gap.specimen import Specimen

__all__ = ["trend_residuals"]

_ROUNDS = 60
_SMALLEST = 1e-4
_SCALES: Mapping[str, Callable[[FloatArray], FloatArray]] = {
    "rate_mm_s": np.log,
    "temperature_C": np.positive,
    "soak_h": lambda hours: np.sqrt(np.maximum(hours, 0.0)),
    "age_days": lambda days: np.log1p(np.maximum(days, 0.0)),
}


def trend_residuals(specimens: Sequence[Specimen], values: Sequence[float]) -> FloatArray | None:
    """Return what a least-absolute-deviations fit over the conditions leaves of each value.

    Columns: one a material or design and orientation, log rate, temperature, the root of the
    soaking time, log age; iteratively reweighted least squares.

    Returns
    -------
    residuals
        None where there are not twice as many specimens as columns and four more.
    """
    matrix = _design(specimens)
    if len(values) < 2 * matrix.shape[1] + 4:
        return None
    y = np.asarray(values, dtype=np.float64)
    residuals: FloatArray = y - np.median(y)
    for _ in range(_ROUNDS):
        weight = 1.0 / np.sqrt(np.maximum(np.abs(residuals), _SMALLEST))
        solution = np.linalg.lstsq(matrix * weight[:, None], y * weight, rcond=1e-9)[0]
        residuals = y - matrix @ solution
    return residuals


def _design(specimens: Sequence[Specimen]) -> FloatArray:
    pieces = [s.material if s.profile is None else f"design {s.profile.name}" for s in specimens]
    columns = _indicators(pieces) + _indicators([s.orientation for s in specimens])[1:]
    for name, scale in _SCALES.items():
        known = [v for s in specimens if (v := getattr(s, name)) is not None]
        if not known:
            continue
        usual = float(np.median(known))
        values = [getattr(s, name) for s in specimens]
        column = scale(np.array([usual if v is None else v for v in values], dtype=np.float64))
        spread = float(np.ptp(column))
        if spread > 1e-9:
            columns.append((column - column.mean()) / spread)
    return np.stack(columns, axis=1)


def _indicators(labels: Sequence[str | None]) -> list[FloatArray]:
    return [np.array([float(v == k) for v in labels]) for k in dict.fromkeys(labels)]
