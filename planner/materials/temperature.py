"""What warming multiplies a material's stress by, from tests at two temperatures or more."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from statistics import NormalDist

import numpy as np

from planner.materials.characterise import Curve, toe_compensated
from planner.materials.fit import RELATIVE_FLOOR, students_t
from planner.materials.fit_intervals import ASSUMED_LOG_SD, MaterialFit, loading
from planner.materials.study import Study
from planner.numerics import FloatArray
from planner.palette import SAME_K, Temperature

__all__ = ["at_one_temperature", "temperature_table"]

_USUAL_C = 23.0
"""Of the same standard: of two temperatures with as many specimens the palette's is the nearer."""

_STRAINS = np.linspace(0.1, 1.0, 19)
"""Shares of the strain that all specimens reach, at which stresses are compared. Numerical."""


def at_one_temperature(study: Study) -> tuple[Study, dict[str, tuple[Curve, ...]]]:
    """Return a study's tests at one temperature, and those of the same materials at others.

    The one is that of most specimens. A material that was not tested there keeps what it has.
    """
    told = _temperatures(study)
    if not told:
        return study, {}
    own = max(
        told.values(),
        key=lambda t: (sum(abs(v - t) <= SAME_K for v in told.values()), -abs(t - _USUAL_C)),
    )
    groups, others = {}, {}
    for material, curves in study.groups.items():
        far = tuple(c for c in curves if abs(told.get(c.specimen, own) - own) > SAME_K)
        if len(far) in (0, len(curves)):
            groups[material] = curves
            continue
        groups[material] = tuple(c for c in curves if c not in far)
        others[material] = far
    return replace(study, groups=groups), others


def _temperatures(study: Study) -> dict[str, float]:
    rows = study.specimens.items()
    return {name: row.temperature_C for name, row in rows if row.temperature_C is not None}


def temperature_table(
    study: Study,
    fits: Mapping[str, MaterialFit],
    others: Mapping[str, Sequence[Curve]],
    coordinate: Mapping[str, float],
) -> Temperature | None:
    """Return the factor of every material tested at two temperatures; None if there is none.

    ln(stress), the mean over strains that all of its specimens reach, is straight in the
    temperature, by least squares; ln(factor) is its slope times the difference. Its deviation is
    that of the specimens about the line, widened by Student's t; `ASSUMED_LOG_SD` of two.
    """
    told, rows = _temperatures(study), []
    for material, far in others.items():
        elastic = fits[material].characteristics.deformation.kind == "elastic"
        borne = loading(far) if elastic else [toe_compensated(curve) for curve in far]
        curves = [c for c in (*fits[material].curves, *borne) if c.specimen in told]
        at = np.array([told[curve.specimen] for curve in curves])
        if np.ptp(at) <= SAME_K:
            continue  # those at the palette's own temperature do not state it
        strain = _STRAINS * min(float(curve.strain.max()) for curve in curves)
        slope, sd = _line(at, np.array([_level(curve, strain) for curve in curves]))
        span = float(np.ptp(at))
        rows.append((coordinate[material], at.min(), at.max(), np.exp(slope * span), sd * span))
    if not rows:
        return None
    return Temperature(
        *(tuple(float(v) for v in column) for column in zip(*sorted(rows), strict=True))
    )


def _level(curve: Curve, strain: FloatArray) -> float:
    """Return the mean ln(stress) at strains."""
    least = RELATIVE_FLOOR * float(curve.stress_MPa.max())
    return float(
        np.log(np.maximum(np.interp(strain, curve.strain, curve.stress_MPa), least)).mean()
    )


def _line(x: FloatArray, y: FloatArray) -> tuple[float, float]:
    """Return the slope of a line by least squares, and its standard deviation."""
    x = x - x.mean()
    squares = float(x @ x)
    slope = float(x @ y) / squares
    sd = ASSUMED_LOG_SD
    if len(x) > 2:
        off = y - y.mean() - slope * x
        widened = students_t(0.95, len(x) - 1) / NormalDist().inv_cdf(0.975)
        sd = widened * float(np.sqrt(off @ off / (len(x) - 2.0)))
    return slope, sd / squares**0.5
