"""Where a bar breaks, cannot follow, or is stretched past what its laws know."""

from dataclasses import dataclass

import numpy as np

from planner.arrays import BoolArray, FloatArray
from planner.materials.coefficients import CoefficientModel
from planner.simulation.bar import Bar
from planner.simulation.equilibrium import Equilibrium
from planner.simulation.protocol import LoadingPath
from planner.simulation.response import FARTHEST, ElasticResponse

__all__ = ["Finding", "findings", "yield_notes"]

_YIELD_STRAIN = 0.02
"""Rigid photopolymers leave Hooke's line at 2 to 3 %; palettes hold only their Young's moduli."""


@dataclass(frozen=True, slots=True)
class Finding:
    """Something that a print would not do as simulated, and where.

    Attributes
    ----------
    kind
        ``break``: a slice passes its elongation at break. ``unreachable``: the path ends early.
    x_mm
        Ends of the stretch of the bar that it concerns.
    gauge_strain
        Of the whole bar, when it happens first.
    """

    kind: str
    message: str
    x_mm: tuple[float, float]
    gauge_strain: float


def findings(
    bar: Bar,
    model: CoefficientModel,
    response: ElasticResponse,
    path: LoadingPath,
    reached: Equilibrium,
) -> tuple[Finding, ...]:
    """Report every stretch of slices that breaks, the first to break first, and an early end."""
    found = []
    gauge_strain = path.displacement_mm / bar.gauge_mm
    beyond = reached.strain > response.break_strain
    for start, stop in _runs(np.asarray(beyond.any(axis=0))):
        step = int(np.argmax(beyond[:, start:stop].any(axis=1)))
        excess = reached.strain[step] / response.break_strain
        first = start + int(np.argmax(excess[start:stop]))
        limit = float(response.break_strain[first])
        at = float(np.interp(limit, *_last_steps(reached.strain[:, first], gauge_strain, step)))
        place = (float(bar.edges_mm[start]), float(bar.edges_mm[stop]))
        found.append(
            Finding(
                "break",
                f"{_called(model, bar, first)} at {bar.x_mm[first]:.4g} mm passes its elongation "
                f"at break, {limit:.3g}, at a strain of {at:.3g} of the bar; a print would break "
                f"there, and what follows is extrapolated{_spread(stop - start, place)}",
                place,
                at,
            )
        )
    found.sort(key=lambda finding: finding.gauge_strain)
    if reached.stopped_at is not None:
        found.append(_unreachable(bar, model, response, path, reached, reached.stopped_at))
    return tuple(found)


def yield_notes(bar: Bar, model: CoefficientModel, reached: Equilibrium) -> tuple[str, ...]:
    """Say which rigid grades are strained past where Hooke's law is known to hold."""
    lower, _, _ = model.bracket(bar.coordinate)
    most = reached.strain.max(axis=0, initial=0.0)
    notes = []
    for k in np.unique(lower).tolist():
        material = model.palette.materials[k]
        strain = float(most[lower == k].max())
        if material.deformation == "plastic" and strain > _YIELD_STRAIN:
            notes.append(
                f"{material.id} is known by Young's modulus alone and is strained by {strain:.3g}; "
                f"such grades yield from about {_YIELD_STRAIN:g}, so the force is an upper bound"
            )
    return tuple(notes)


def _unreachable(
    bar: Bar,
    model: CoefficientModel,
    response: ElasticResponse,
    path: LoadingPath,
    reached: Equilibrium,
    at: int,
) -> Finding:
    wanted = float(path.displacement_mm.max()) / bar.gauge_mm
    got = reached.end_mm / bar.gauge_mm
    limit, breaks = float(response.strain_limit[at]), float(response.break_strain[at])
    why = (
        f"{FARTHEST:g} times its elongation at break, and its law is not known further"
        if limit >= FARTHEST * breaks
        else "where the stress of its law ceases to rise"
    )
    return Finding(
        "unreachable",
        f"a strain of {wanted:.3g} is out of reach: at {got:.3g}, {_called(model, bar, at)} at "
        f"{bar.x_mm[at]:.4g} mm is strained by {limit:.3g}, {why}",
        (float(bar.edges_mm[at]), float(bar.edges_mm[at + 1])),
        got,
    )


def _called(model: CoefficientModel, bar: Bar, at: int) -> str:
    m = float(bar.coordinate[at])
    lower, upper, t = model.bracket(m)
    softer, harder = (model.palette.materials[int(k)].id for k in (lower, upper))
    return softer if t == 0.0 else f"the blend of {softer} and {harder} at m = {m:.4g}"


def _last_steps(
    strain: FloatArray, gauge_strain: FloatArray, step: int
) -> tuple[FloatArray, FloatArray]:
    """Return a slice's and the bar's strain at the step before (rest, if none) and at a step."""
    before = (strain[step - 1], gauge_strain[step - 1]) if step else (0.0, 0.0)
    return np.array([before[0], strain[step]]), np.array([before[1], gauge_strain[step]])


def _spread(slices: int, place: tuple[float, float]) -> str:
    return f" (in the end for all of {place[0]:.4g} .. {place[1]:.4g} mm)" if slices > 1 else ""


def _runs(marked: BoolArray) -> list[tuple[int, int]]:
    """Return begin and end of every run of marked slices."""
    turns = np.diff(np.concatenate([[False], marked, [False]]).astype(np.int8))
    begins, ends = np.flatnonzero(turns == 1), np.flatnonzero(turns == -1)
    return list(zip(begins.tolist(), ends.tolist(), strict=True))
