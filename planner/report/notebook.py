"""What a notebook shows of a plan, a palette, a simulation, a diagnosis: words, figure, table."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import singledispatch
from html import escape
from typing import Any

from planner.errors import PlannerError
from planner.gap.diagnosis import Diagnosis
from planner.grading.profile import StiffnessScale, stiffness_scale
from planner.palette import Palette
from planner.plan import Plan
from planner.printers import load_printer
from planner.report.display import colours_told_apart
from planner.report.gap_figures import figures_of
from planner.report.gap_page import headline, scope
from planner.report.loaded_part import response_rows, summary_words
from planner.report.material_figures import materials_figure
from planner.report.plan_figure import stiffness_figure
from planner.report.plan_text import (
    error_words,
    format_interval,
    format_number,
    plan_table,
    unreachable_words,
)
from planner.report.simulation_figures import simulation_figure
from planner.simulation.part import PartSimulation
from planner.simulation.simulate import Simulation

__all__ = ["AT_STRAIN", "html_of"]


AT_STRAIN = 0.1
"""Working strain of a palette that is shown without one. Convention: the default of commands."""

_MOST_ROWS, _MOST_WORDS = 20, 6
"""Rows and remarks shown: what is seen without scrolling. The value itself holds the others."""


@singledispatch
def html_of(value: Any) -> str:
    """Return what a notebook shows of a value: HTML that holds all it needs, and no script.

    Raises
    ------
    TypeError
        Nothing is drawn of values of this type.
    """
    raise TypeError(f"a {type(value).__name__} has no page in a notebook")


def _html(value: object, parts: Iterable[str]) -> str:
    """Put parts below the value's own line, dark on white whatever the notebook's colours."""
    style = "background:#fff;color:#222;padding:8px 12px;overflow-x:auto;font:13px sans-serif"
    line = repr(value).strip("<>")
    body = "\n".join(part for part in parts if part)
    return f'<div style="{style}">\n<p><b>{escape(line)}</b></p>\n{body}\n</div>'


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


@html_of.register
def _plan(plan: Plan) -> str:
    if not plan.regions:
        return _html(plan, ())
    colours = _colours(plan)
    numbers = {name: number for number, name in enumerate(colours, start=1)}
    said = [finding.message for finding in plan.findings]
    table = plan_table(plan)
    columns = [name for name in table.columns if name not in ("#", "mass g")]
    return _html(
        plan,
        [
            _words([*unreachable_words(plan), *said]),
            _figure(stiffness_figure(plan, colours, numbers, "Target and achieved stiffness")),
            _table(
                columns, table.rows, [colours[r.printed] for r in plan.regions],
                ["material", "blend"],
            ),
            _said(error_words(plan).replace("--blend", "blend")),
        ],
    )  # fmt: skip


def _colours(plan: Plan) -> dict[str, str]:
    """Return a colour for each material of a plan, from soft to hard, grey where none is known."""
    known = {shell.material: shell.colour for shell in plan.shells}
    if not known:
        try:
            palette = load_printer(plan.printer).palette(plan.palette.name)
        except PlannerError:
            palette = None  # a lab's own, known by its file alone
        known = {m.id: m.colour for m in palette.materials} if palette is not None else {}
    names = list(dict.fromkeys(r.printed for r in sorted(plan.regions, key=_coordinate)))
    own = [known.get(name, "#808080") for name in names]
    return dict(zip(names, colours_told_apart(own), strict=True))


def _coordinate(region: Any) -> float:
    return float(region.coordinate)


@html_of.register
def _simulation(simulation: Simulation) -> str:
    return _html(
        simulation,
        [
            _words([finding.message for finding in simulation.findings]),
            _figure(simulation_figure(simulation)) if len(simulation.force_N) > 1 else "",
            _words(simulation.notes, "note"),
        ],
    )


@html_of.register
def _part_simulation(result: PartSimulation) -> str:
    rows = list(response_rows(result))
    return _html(
        result,
        [
            _words([finding.message for finding in result.findings]),
            _figure(simulation_figure(result)) if len(result.steps.share) > 1 else "",
            _table(list(rows[0]), rows, ["transparent"] * len(rows), ["", "faces"]),
            _words([*summary_words(result), *result.notes], "note"),
        ],
    )


@html_of.register
def _palette(palette: Palette) -> str:
    try:
        scale = stiffness_scale(palette, AT_STRAIN)
    except PlannerError as error:  # it can be looked at all the same
        return _html(palette, [_words([str(error)]), _materials(palette, {})])
    return _html(palette, _ladder(scale))


@html_of.register
def _scale(scale: StiffnessScale) -> str:
    return _html(scale, _ladder(scale))


def _ladder(scale: StiffnessScale) -> Iterator[str]:
    stiffness = zip(scale.palette.materials, scale.moduli_MPa, scale.intervals_MPa, strict=True)
    column = f"MPa at strain {scale.at_strain:g}"
    told = {
        m.id: {column: format_number(modulus), "95 % interval": format_interval(interval)}
        for m, modulus, interval in stiffness
    }
    yield _figure(materials_figure(scale))
    yield _materials(scale.palette, told)


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


@html_of.register
def _diagnosis(diagnosis: Diagnosis) -> str:
    figures = figures_of(diagnosis)
    return _html(
        diagnosis,
        [
            _said(headline(diagnosis)),
            _said(" ".join(diagnosis.summary) or scope(diagnosis)),
            *(_figure(figures[name]) for name in ("evidence", "closure") if name in figures),
            _words(diagnosis.limitations, "limitation"),
        ],
    )
