"""Plots of plans, palettes, tests, simulations and diagnoses with matplotlib, for one's figures."""

from collections.abc import Iterable
from functools import singledispatch
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from planner.errors import ArgumentError
from planner.gap.campaign import Campaign
from planner.gap.diagnosis import Diagnosis
from planner.gap.summary import errors_of
from planner.grading.profile import StiffnessScale, stiffness_scale
from planner.materials.palette_study import Characterisation
from planner.numerics import FloatArray
from planner.palette import Palette
from planner.plan import Plan
from planner.report.notebook import AT_STRAIN
from planner.report.plan_figure import stretches, target_along
from planner.report.plan_text import mm_along
from planner.report.svg import BLUE, INK, RED
from planner.simulation.part import PartSimulation
from planner.simulation.simulate import Simulation

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["draw"]


_PLACES = 60
"""Places drawn between two grades."""


def draw(value: Any, ax: "Axes | None") -> "Axes":
    """Draw a value into axes, new ones if none are given, and return them.

    Raises
    ------
    ArgumentError
        matplotlib is not installed.
    """
    if ax is None:
        try:
            pyplot: Any = import_module("matplotlib.pyplot")
        except ImportError as error:
            raise ArgumentError(
                f"plots need matplotlib ({error}): pip install matplotlib"
            ) from error
        _, ax = pyplot.subplots(layout="constrained")
        assert ax is not None
    _draw(value, ax)
    return ax


@singledispatch
def _draw(value: Any, ax: "Axes") -> None:
    raise TypeError(f"a {type(value).__name__} has no plot")


@_draw.register(Plan)
def _plan(plan: Plan, ax: "Axes") -> None:
    begin, way = mm_along(plan.gradient.field)
    target = target_along(plan)
    if target is not None:
        ax.plot(begin + target[0] * way, 10.0 ** target[1], "--", color=BLUE, label="target")
    for number, region in enumerate(stretches(plan.regions)):
        ends = [begin + u * way for u in region.field]
        label = "achieved" if number == 0 else None
        ax.plot(ends, [region.modulus_MPa] * 2, color=INK, linewidth=2.5, label=label)
        label = "95 % interval" if number == 0 else None
        ax.fill_between(
            ends, *region.modulus_interval_MPa, color=BLUE, alpha=0.2, linewidth=0.0, label=label
        )
    long = isinstance(plan.gradient.field.get("span_mm"), float)
    ax.set(
        xlabel="mm along the field" if long else "field, from its beginning (0) to its end (1)",
        ylabel=f"secant modulus at strain {plan.stiffness.at_strain:g}, MPa",
        yscale="log",
        title=plan.part.file,
    )
    ax.legend()


@_draw.register(Simulation)
def _simulation(simulation: Simulation, ax: "Axes") -> None:
    over_time = simulation.protocol == "relaxation"
    x = simulation.time_s if over_time else simulation.displacement_mm
    force, beyond = simulation.force_N, simulation.beyond_break
    first = int(np.argmax(beyond)) if beyond.any() else len(x)
    band = f"{100 * simulation.level:g} % of prints"
    ax.fill_between(x, *simulation.force_interval_N.T, color=BLUE, alpha=0.2, label=band)
    ax.plot(x[: first + 1], force[: first + 1], color=BLUE, label="predicted")
    if first < len(x):
        ax.plot(x[first:], force[first:], ":", color=BLUE, label="beyond the break")
        ax.plot(x[first], force[first], "x", color=RED, markersize=9.0, label="break")
    ax.set(
        xlabel="time, s" if over_time else "displacement, mm",
        ylabel="force, N",
        title=f"{simulation.name}: {simulation.protocol} to strain {simulation.to_strain:g}",
    )
    ax.legend()


@_draw.register(PartSimulation)
def _part(result: PartSimulation, ax: "Axes") -> None:
    curve = result.curve
    around = [np.concatenate([low, high[::-1]]) for low, high in curve.interval]
    ax.fill(*around, color=BLUE, alpha=0.2, label=f"{100 * result.level:g} % of prints")
    ax.plot(curve.x, curve.y, "o-", color=BLUE, markersize=3.0, label="predicted")
    ax.set(xlabel=curve.x_label, ylabel=curve.y_label, title=result.called)
    ax.legend()


@_draw.register(Palette)
def _palette(palette: Palette, ax: "Axes") -> None:
    _scale(stiffness_scale(palette, AT_STRAIN), ax)


@_draw.register(StiffnessScale)
def _scale(scale: StiffnessScale, ax: "Axes") -> None:
    materials, strain = scale.palette.materials, scale.at_strain
    grades = [material.coordinate for material in materials]
    m = scale.model.coordinates_between(_PLACES)
    low, high = scale.model.modulus_interval_MPa(m, strain)
    ax.fill_between(m, low, high, color=BLUE, alpha=0.2, linewidth=0.0, label="95 % of prints")
    ax.plot(m, scale.model.modulus_MPa(m, strain), color=BLUE, label="between materials")
    colours = [material.colour for material in materials]
    ax.scatter(grades, scale.moduli_MPa, c=colours, edgecolors=INK, zorder=3.0, label="materials")
    for material, modulus in zip(materials, scale.moduli_MPa, strict=True):
        ax.annotate(
            material.id, (material.coordinate, modulus), xytext=(7.0, -10.0),
            textcoords="offset points", fontsize="x-small",
        )  # fmt: skip
    ax.set(
        xlabel="coordinate m of the material",
        ylabel=f"secant modulus at strain {strain:g}, MPa",
        yscale="log",
        title=scale.palette.name,
    )
    ax.legend()


@_draw.register(Diagnosis)
def _diagnosis(diagnosis: Diagnosis, ax: "Axes") -> None:
    rows = list(errors_of(diagnosis))[::-1]
    bars = ax.barh([words for words, _ in rows], [100.0 * error for _, error in rows], color=BLUE)
    ax.bar_label(bars, fmt="%.2g %%", padding=3.0)
    ax.set(
        xlabel="error of force, % of each test's largest",
        title=f"{diagnosis.campaign}: {diagnosis.verdict}",
    )
    ax.margins(x=0.15)


@_draw.register(Characterisation)
def _tests(found: Characterisation, ax: "Axes") -> None:
    curves = [(name, c.strain, c.stress_MPa) for name, each in found.curves.items() for c in each]
    _coloured(ax, curves)
    ax.set(xlabel="strain as recorded", ylabel="nominal stress, MPa")


@_draw.register(Campaign)
def _campaign(campaign: Campaign, ax: "Axes") -> None:
    _coloured(ax, ((s.made_of, s.displacement_mm, s.force_N) for s in campaign.specimens))
    ax.set(xlabel="displacement, mm", ylabel="force, N", title=campaign.name)


def _coloured(ax: "Axes", curves: Iterable[tuple[str, FloatArray, FloatArray]]) -> None:
    """Draw curves, those of one name in one colour, each name once in the legend."""
    colours: dict[str, str] = {}
    for name, x, y in curves:
        label = None if name in colours else name
        colour = colours.setdefault(name, f"C{len(colours)}")
        ax.plot(x, y, color=colour, linewidth=1.0, label=label)
    ax.legend()
