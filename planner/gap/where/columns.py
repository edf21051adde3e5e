"""Columns of specimens.csv as axes: their levels, and a few coordinates along each."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from planner.arrays import BoolArray, FloatArray, IntArray
from planner.gap.campaign import Campaign
from planner.gap.conditions import TOLERANCES, levels
from planner.gap.specimen import Specimen

__all__ = ["Column", "campaign_columns"]

Value = str | float | None

_NUMBERS: Mapping[str, Callable[[FloatArray], FloatArray]] = {
    "rate_mm_s": lambda v: np.log(np.maximum(v, 1e-9)),
    "temperature_C": np.positive,
    "soak_h": lambda v: np.sqrt(np.maximum(v, 0.0)),
    "age_days": lambda v: np.log1p(np.maximum(v, 0.0)),
    "width_mm": np.positive,
    "thickness_mm": np.positive,
    "gauge_mm": np.positive,
}
_TEXTS = ("orientation", "protocol", "batch")
_DEGREE = 2
_MOST_LEVELS = 8


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """A column that takes more than one value.

    Attributes
    ----------
    values
        Of each specimen with figures; None where unknown.
    level : (n,)
        Number of each specimen's level, -1 where unknown.
    coordinates : (n, m)
        Orthonormal and of mean zero over the specimens that are known, zero at the others:
        numbers as polynomials on the column's usual scale, text as levels.
    """

    name: str
    values: tuple[Value, ...]
    level: IntArray
    coordinates: FloatArray

    @property
    def known(self) -> BoolArray:
        """Which specimens' values are known."""
        return np.asarray(self.level >= 0)

    @property
    def is_number(self) -> bool:
        """Whether its values are numbers."""
        return not any(isinstance(v, str) for v in self.values)


def campaign_columns(campaign: Campaign, specimen: IntArray) -> tuple[Column, ...]:
    """Return the columns that vary over the specimens at these places; material first.

    A column whose text is another for nearly every specimen tells them apart, but not why, and is
    left out.
    """
    chosen = [campaign.specimens[i] for i in specimen.tolist()]
    found = [_column("material", [_material(s) for s in chosen])]
    found += [_column(name, [_size(s, name) for s in chosen]) for name in _NUMBERS]
    found += [_column(name, [getattr(s, name) for s in chosen]) for name in _TEXTS]
    names = dict.fromkeys((*campaign.covariates, *(k for s in chosen for k in s.covariates)))
    found += [_column(name, [s.covariates.get(name) for s in chosen]) for name in names]
    return tuple(column for column in found if column is not None)


def _material(specimen: Specimen) -> str:
    if specimen.profile is not None:
        return f"bar {specimen.profile.name}"
    return specimen.material or ""


def _size(specimen: Specimen, name: str) -> float | None:
    value: float | None = getattr(specimen, name)
    if value is None:
        value = getattr(specimen, f"measured_{name}", None)
    return value


def _column(name: str, values: Sequence[Value]) -> Column | None:
    clean = tuple(_clean(v) for v in values)
    if any(isinstance(v, str) for v in clean):
        clean = tuple(None if v is None else str(v) for v in clean)
        return _of_text(name, clean)
    return _of_numbers(name, clean)


def _clean(value: Value) -> Value:
    if isinstance(value, str):
        return value.strip() or None
    return None if value is None or not np.isfinite(value) else float(value)


def _of_text(name: str, values: tuple[Value, ...]) -> Column | None:
    texts = sorted({v for v in values if isinstance(v, str)})
    level = np.array([-1 if v is None else texts.index(str(v)) for v in values])
    known = level >= 0
    if len(texts) < 2 or (len(texts) > 3 and 2 * len(texts) > known.sum()):
        return None
    counts = np.bincount(level[known])
    common = np.argsort(-counts, kind="stable")[:_MOST_LEVELS]
    indicators = (level[:, None] == common).astype(np.float64)
    return _made(name, values, level, indicators)


def _of_numbers(name: str, values: tuple[Value, ...]) -> Column | None:
    numbers = [v if isinstance(v, float) else None for v in values]
    absolute, relative = TOLERANCES.get(name, (0.0, 1e-6))
    of = levels(numbers, absolute, relative)
    level = np.array([-1 if k is None else k for k in of])
    known = level >= 0
    count = int(level.max(initial=-1)) + 1
    if count < 2:
        return None
    figures = np.array([v for v in numbers if v is not None])
    centre = np.array([figures[level[known] == k].mean() for k in range(count)])
    x = np.zeros(len(values))
    x[known] = _scaled(name, centre)[level[known]]
    x[known] -= 0.5 * (x[known].min() + x[known].max())
    x /= max(float(np.abs(x).max()), 1e-12)
    powers = np.stack([x**k for k in range(1, min(_DEGREE, count - 1) + 1)], axis=1)
    return _made(name, values, level, powers * known[:, None])


def _scaled(name: str, values: FloatArray) -> FloatArray:
    if name in _NUMBERS:
        return _NUMBERS[name](values)
    wide = values.min() > 0.0 and values.max() > 20.0 * values.min()
    return np.log(values) if wide else values


def _made(name: str, values: tuple[Value, ...], level: IntArray, raw: FloatArray) -> Column | None:
    known = level >= 0
    centred = np.where(known[:, None], raw - raw[known].mean(axis=0), 0.0)
    basis, singular, _ = np.linalg.svd(centred, full_matrices=False)
    kept = singular > 1e-6 * max(float(singular[0]), 1e-12)
    if not kept.any():
        return None
    coordinates = np.where(known[:, None], basis[:, kept], 0.0)
    return Column(name, values, level, coordinates)
