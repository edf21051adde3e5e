"""What a loaded part does, as tables of words: what the terminal and the page show."""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np

from planner.glance import percent
from planner.numerics import FloatArray
from planner.report.plan_text import format_interval, format_number

if TYPE_CHECKING:
    from planner.simulation.part import PartSimulation

__all__ = ["part_title", "response_rows", "step_rows", "summary_words"]


def part_title(result: "PartSimulation") -> str:
    """Say in a line what was solved."""
    cells = result.cells
    edges = " x ".join(f"{edge:.3g}" for edge in cells.cell_mm)
    share = float(result.steps.share[-1])
    reached = "the whole load" if share == 1.0 else f"{share:.3g} of the load"
    return (
        f"{result.called}: {len(cells.nodes)} cells of {edges} mm, {3 * len(cells.node_mm)} "
        f"unknowns, {reached}"
    )


def response_rows(result: "PartSimulation") -> Iterator[Mapping[str, str]]:
    """Yield what the part does at the last step where it is loaded, held and watched, a row each.

    Of a moment that is how its faces turn, and what is left of it. The interval is of the figure
    that was not given: the displacement along a force, or the force along a move.
    """
    interval = f"{100.0 * result.level:g} % interval"
    sizes_N = [float(np.linalg.norm(r.force_N[-1])) for r in result.steps.responses]
    long_mm = float(np.ptp(result.cells.surface.bounds_mm, axis=0).max())
    sizes_N += [float(np.linalg.norm(m.moment_N_mm)) / long_mm for m in result.conditions.moments]
    # Loads that balance leave a support nothing but rounding.
    least_N = _NOTHING * max(sizes_N, default=0.0)
    units = {"fix": "N", "move": "N", "moment": "°"}
    for response in result.steps.responses:
        kind, stiffness, turn = response.kind, response.stiffness_N_mm, response.turn_deg
        sure = "" if response.interval is None else format_interval(response.interval)
        moved = "" if kind == "fix" else _vector(response.displacement_mm[-1])
        force = "" if kind == "watch" else _vector(response.force_N[-1], least_N)
        if turn is not None and response.moment_N_mm is not None:
            moved, force = f"{_vector(turn[-1])} °", f"{_vector(response.moment_N_mm[-1])} N mm"
        yield {
            "": kind,
            "faces": response.selector,
            "moves mm (x y z)": moved,
            "force N (x y z)": force,
            interval: f"{sure} {units.get(kind, 'mm')}" if sure else "",
            "N/mm": "" if stiffness is None else format_number(stiffness),
        }
    away, (x, y, z) = result.farthest
    yield {
        "": "farthest",
        "faces": f"({x:.4g}, {y:.4g}, {z:.4g}) mm",
        "moves mm (x y z)": _vector(away),
        "force N (x y z)": "",
        interval: "",
        "N/mm": "",
    }


_NOTHING = 5e-6
"""Of a vector's length, or of the largest force, below which a component is written as 0: forces
are solved for so far."""


def _vector(components: FloatArray, least: float = 0.0) -> str:
    least = max(least, _NOTHING * float(np.linalg.norm(components)))
    rounded = np.where(np.abs(components) < least, 0.0, components)
    return " ".join(format_number(float(c)) for c in rounded)


def step_rows(result: "PartSimulation", most: int) -> Iterator[Mapping[str, str]]:
    """Yield up to so many steps, from rest to the last."""
    curve, steps = result.curve, result.steps
    count = len(steps.share)
    for k in np.rint(np.linspace(0.0, count - 1.0, min(most, count))).astype(int).tolist():
        yield {
            "load": f"{steps.share[k]:.3g}",
            curve.x_label: format_number(float(curve.x[k]), 4),
            curve.y_label: format_number(float(curve.y[k]), 4),
            "energy, mJ": format_number(float(steps.energy_mJ[k]), 4),
            "strain / break": format_number(float(steps.largest[k])),
        }


def summary_words(result: "PartSimulation") -> Iterator[str]:
    """Say what the largest strain is and where, and how far the figures depend on the cells."""
    steps, case = result.steps, f"{result.case}: " if result.case else ""
    k = int(steps.largest.argmax())
    x, y, z = steps.largest_mm[k].tolist()
    yield (
        f"{case}largest strain over elongation at break: {steps.largest[k]:.3g}, "
        f"at ({x:.4g}, {y:.4g}, {z:.4g}) mm"
    )
    found = result.discretisation
    if found is not None:
        yield (
            f"{case}figures are within {percent(found.largest)} of those of ever smaller cells, as "
            f"two solutions in cells of {found.cell_mm:.3g} mm tell (right for nine parts in ten)"
        )
