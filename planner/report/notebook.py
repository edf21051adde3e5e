"""What a notebook shows of a value: words, figure, table; and its plot, with matplotlib."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import singledispatch
from html import escape
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from planner.errors import ArgumentError, PlannerError, refused
from planner.gap.campaign import Campaign
from planner.gap.diagnosis import Diagnosis
from planner.glance import format_interval, format_number
from planner.grading.profile import StiffnessScale, stiffness_scale
from planner.materials.palette_study import Characterisation
from planner.numerics import FloatArray
from planner.palette import Palette
from planner.plan import Plan
from planner.printers import load_printer
from planner.report import plan_figure
from planner.report.display import colours_told_apart
from planner.report.gap_figures import errors_of, figures_of
from planner.report.gap_page import headline, scope
from planner.report.loaded_part import response_rows, summary_words
from planner.report.material_figures import PLACES, materials_figure
from planner.report.simulation_figures import course_of, simulation_figure
from planner.report.svg import BLUE, INK, RED
from planner.simulation.part import PartSimulation
from planner.simulation.simulate import Simulation

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["draw", "small_page"]


_AT_STRAIN = 0.1
"""Working strain of a palette that is shown without one. Convention: the default of commands."""

_MOST_ROWS, _MOST_WORDS = 20, 6
"""Rows and remarks shown: what is seen without scrolling. The value itself holds the others."""


def small_page(value: Any) -> str:
    """Return what a notebook shows of a value: HTML that holds all it needs, and no script.

    Raises
    ------
    TypeError
        Nothing is drawn of values of this type.
    """
    # Parts stand below the value's own line, dark on white whatever the notebook's colours.
    style = "background:#fff;color:#222;padding:8px 12px;overflow-x:auto;font:13px sans-serif"
    line = repr(value).strip("<>")
    body = "\n".join(part for part in _parts(value) if part)
    return f'<div style="{style}">\n<p><b>{escape(line)}</b></p>\n{body}\n</div>'


@singledispatch
def _parts(value: Any) -> Iterable[str]:
    raise TypeError(f"a {type(value).__name__} has no page in a notebook")


def _said(words: str) -> str:
    return f"<p>{escape(words)}</p>" if words else ""


def _words(said: Sequence[str], kind: str = "finding") -> str:
    more = len(said) - _MOST_WORDS
    shown = [*said[:_MOST_WORDS], *([f"and {more} more"] if more > 0 else [])]
    items = "".join(f"<li>{escape(words)}</li>" for words in shown)
    return f'<ul class="{kind}s">{items}</ul>' if items else ""


def _figure(svg: bytes | str) -> str:
    drawn = svg.decode("utf-8") if isinstance(svg, bytes) else svg
    return drawn.replace("<svg ", '<svg style="max-width:100%;height:auto" ', 1)


def _table(
    columns: Sequence[str], rows: Sequence[Mapping[str, str]], colours: Sequence[str],
    left: Sequence[str],
) -> str:  # fmt: skip
    """Return a table whose rows begin with a swatch; figures stand flush right."""

    def cells(row: Mapping[str, str], tag: str) -> Iterator[str]:
        for name in columns:
            side = "left" if name in left else "right"
            style = f"text-align:{side};padding:1px 8px;white-space:nowrap"
            yield f'<{tag} style="{style}">{escape(row.get(name, ""))}</{tag}>'

    lines = ["<tr><th></th>" + "".join(cells({n: n for n in columns}, "th")) + "</tr>"]
    for row, colour in zip(rows[:_MOST_ROWS], colours, strict=False):
        swatch = f'<td style="background:{escape(colour)};min-width:1em"></td>'
        lines.append(f"<tr>{swatch}{''.join(cells(row, 'td'))}</tr>")
    more = len(rows) - _MOST_ROWS
    if more > 0:
        lines.append(f'<tr><td></td><td colspan="{len(columns)}">and {more} more</td></tr>')
    return "<table>\n" + "\n".join(lines) + "\n</table>"


@_parts.register
def _plan(plan: Plan) -> Iterable[str]:
    if not plan.regions:
        return ()
    colours = _colours(plan)
    said = [finding.message for finding in plan.findings]
    drawn = plan_figure.stiffness_figure(plan, colours, "Target and achieved stiffness")
    table = plan_figure.plan_table(plan)
    columns = [name for name in table.columns if name not in ("#", "mass g")]
    swatches = [colours[region.printed] for region in plan.regions]
    rows = _table(columns, table.rows, swatches, ["material", "blend"])
    better = _said(plan_figure.error_words(plan).replace("--blend", "blend"))
    found = _words([*plan_figure.unreachable_words(plan), *said])
    return found, _figure(drawn), rows, better


def _colours(plan: Plan) -> dict[str, str]:
    """Return a colour for each material of a plan, from soft to hard, grey where none is known."""
    known = {shell.material: shell.colour for shell in plan.shells}
    if not known:
        with suppress(PlannerError):  # a lab's own palette is known by its file alone
            palette = load_printer(plan.printer).palette(plan.palette.name)
            known = {material.id: material.colour for material in palette.materials}
    soft_first = sorted(plan.regions, key=lambda region: region.coordinate)
    names = list(dict.fromkeys(region.printed for region in soft_first))
    own = [known.get(name, "#808080") for name in names]
    return dict(zip(names, colours_told_apart(own), strict=True))


@_parts.register
def _simulation(simulation: Simulation) -> Iterable[str]:
    said = _words([finding.message for finding in simulation.findings])
    drawn = _figure(simulation_figure(simulation)) if len(simulation.force_N) > 1 else ""
    return said, drawn, _words(simulation.notes, "note")


@_parts.register
def _part_simulation(result: PartSimulation) -> Iterable[str]:
    rows = list(response_rows(result))
    said = _words([finding.message for finding in result.findings])
    drawn = _figure(simulation_figure(result)) if len(result.steps.share) > 1 else ""
    table = _table(list(rows[0]), rows, ["transparent"] * len(rows), ["", "faces"])
    return said, drawn, table, _words([*summary_words(result), *result.notes], "note")


@_parts.register
def _palette(palette: Palette) -> Iterable[str]:
    try:
        scale = stiffness_scale(palette, _AT_STRAIN)
    except PlannerError as error:  # it can be looked at all the same
        return _words([str(error)]), _materials(palette, {})
    return _ladder(scale)


@_parts.register
def _ladder(scale: StiffnessScale) -> Iterable[str]:
    stiffness = zip(scale.palette.materials, scale.moduli_MPa, scale.intervals_MPa, strict=True)
    column = f"MPa at strain {scale.at_strain:g}"
    told = {
        m.id: {column: format_number(modulus), "95 % interval": format_interval(interval)}
        for m, modulus, interval in stiffness
    }
    return _figure(materials_figure(scale)), _materials(scale.palette, told)


def _materials(palette: Palette, told: Mapping[str, Mapping[str, str]]) -> str:
    rows = [
        {
            "material": material.id,
            "m": f"{material.coordinate:.4g}",
            **told.get(material.id, {}),
            "strain at break": format_number(material.elongation_at_break),
            "law": material.law.model,
        }
        for material in palette.materials
    ]
    columns = list(rows[0]) if rows else []
    return _table(columns, rows, [m.colour for m in palette.materials], ["material", "law"])


@_parts.register
def _diagnosis(diagnosis: Diagnosis) -> Iterable[str]:
    figures = figures_of(diagnosis)
    drawn = [_figure(figures[name]) for name in ("evidence", "closure") if name in figures]
    said = _said(headline(diagnosis)), _said(" ".join(diagnosis.summary) or scope(diagnosis))
    return *said, *drawn, _words(diagnosis.limitations, "limitation")


# ------------------------------------------------------------------------------------------------
# Plots with matplotlib, for figures of one's own.


def draw(value: Any, ax: "Axes | None") -> "Axes":
    """Draw a value into axes, new ones if none are given, and return them.

    Raises
    ------
    ArgumentError
        matplotlib is not installed.
    """
    if ax is None:
        with refused(ArgumentError, "no matplotlib", "pip install matplotlib ({})", ImportError):
            pyplot: Any = import_module("matplotlib.pyplot")
        _, ax = pyplot.subplots(layout="constrained")
    if not hasattr(ax, "fill_between"):
        raise ArgumentError(f"`ax` {ax!r}: give axes of matplotlib, or none")
    _draw(value, ax)
    if not isinstance(value, Diagnosis):  # whose bars have names beside them
        ax.legend()
    return ax


@singledispatch
def _draw(value: Any, ax: "Axes") -> None:
    raise TypeError(f"a {type(value).__name__} has no plot")


@_draw.register(Plan)
def _draw_plan(plan: Plan, ax: "Axes") -> None:
    begin, way, words = plan_figure.mm_along(plan.gradient.field)
    target = plan_figure.target_along(plan)
    if target is not None:
        ax.plot(begin + target[0] * way, target[1], "--", color=BLUE, label="target")
    for number, region in enumerate(plan_figure.stretches(plan.regions)):
        ends = [begin + u * way for u in region.field]
        step, band = ("achieved", "95 % interval") if number == 0 else (None, None)
        ax.plot(ends, [region.modulus_MPa] * 2, color=INK, linewidth=2.5, label=step)
        ax.fill_between(
            ends, *region.modulus_interval_MPa, color=BLUE, alpha=0.2, linewidth=0.0, label=band
        )
    y_label = f"secant modulus at strain {plan.stiffness.at_strain:g}, MPa"
    ax.set(xlabel=words, ylabel=y_label, yscale="log", title=plan.part.file)


@_draw.register(Simulation)
def _draw_simulation(simulation: Simulation, ax: "Axes") -> None:
    force, (x, x_label, first, title) = simulation.force_N, course_of(simulation)
    band = f"{100 * simulation.level:g} % of prints"
    ax.fill_between(x, *simulation.force_interval_N.T, color=BLUE, alpha=0.2, label=band)
    ax.plot(x[: first + 1], force[: first + 1], color=BLUE, label="predicted")
    if first < len(x):
        ax.plot(x[first:], force[first:], ":", color=BLUE, label="beyond the break")
        ax.plot(x[first], force[first], "x", color=RED, markersize=9.0, label="break")
    ax.set(xlabel=x_label, ylabel="force, N", title=title)


@_draw.register(PartSimulation)
def _draw_part(result: PartSimulation, ax: "Axes") -> None:
    curve = result.curve
    around = [np.concatenate([low, high[::-1]]) for low, high in curve.interval]
    ax.fill(*around, color=BLUE, alpha=0.2, label=f"{100 * result.level:g} % of prints")
    ax.plot(curve.x, curve.y, "o-", color=BLUE, markersize=3.0, label="predicted")
    ax.set(xlabel=curve.x_label, ylabel=curve.y_label, title=result.called)


@_draw.register(Palette)
def _draw_palette(palette: Palette, ax: "Axes") -> None:
    _draw_scale(stiffness_scale(palette, _AT_STRAIN), ax)


@_draw.register(StiffnessScale)
def _draw_scale(scale: StiffnessScale, ax: "Axes") -> None:
    materials, strain = scale.palette.materials, scale.at_strain
    grades = [material.coordinate for material in materials]
    m = scale.model.coordinates_between(PLACES)
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
    x_label = "coordinate m of the material"
    y_label = f"secant modulus at strain {strain:g}, MPa"
    ax.set(xlabel=x_label, ylabel=y_label, yscale="log", title=scale.palette.name)


@_draw.register(Diagnosis)
def _draw_diagnosis(diagnosis: Diagnosis, ax: "Axes") -> None:
    rows = list(errors_of(diagnosis))[::-1]
    bars = ax.barh([words for words, _ in rows], [100.0 * error for _, error in rows], color=BLUE)
    ax.bar_label(bars, fmt="%.2g %%", padding=3.0)
    title = f"{diagnosis.campaign}: {diagnosis.verdict}"
    ax.set(xlabel="error of force, % of each test's largest", title=title)
    ax.margins(x=0.15)


@_draw.register(Characterisation)
def _draw_tests(found: Characterisation, ax: "Axes") -> None:
    curves = [(name, c.strain, c.stress_MPa) for name, each in found.curves.items() for c in each]
    _coloured(ax, curves)
    ax.set(xlabel="strain as recorded", ylabel="nominal stress, MPa")


@_draw.register(Campaign)
def _draw_campaign(campaign: Campaign, ax: "Axes") -> None:
    _coloured(ax, ((s.made_of, s.displacement_mm, s.force_N) for s in campaign.specimens))
    ax.set(xlabel="displacement, mm", ylabel="force, N", title=campaign.name)


def _coloured(ax: "Axes", curves: Iterable[tuple[str, FloatArray, FloatArray]]) -> None:
    """Draw curves, those of one name in one colour, each name once in the legend."""
    colours: dict[str, str] = {}
    for name, x, y in curves:
        label = None if name in colours else name
        colour = colours.setdefault(name, f"C{len(colours)}")
        ax.plot(x, y, color=colour, linewidth=1.0, label=label)
