"""A plan in words and as figures: its table, what is said of it, its stiffness along the field."""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import TypeAlias

import numpy as np

from planner.glance import format_interval, format_number, format_range
from planner.grading.profile import profile_of
from planner.grading.regions import error_text
from planner.numerics import FloatArray
from planner.plan import Plan, Region
from planner.report import svg
from planner.report.svg import BLUE, INK, PALE_BLUE, RUST, Chart

__all__ = [
    "both_figure",
    "error_words",
    "mm_along",
    "moved_words",
    "plan_table",
    "stiffness_figure",
    "stretches",
    "target_along",
    "unreachable_words",
]


# ------------------------------------------------------------------------------------------------
# A plan as rows of words: what the terminal and the page show.


@dataclass(frozen=True, slots=True)
class PlanTable:
    """What was wanted and what is printed, a row a region.

    Attributes
    ----------
    rows
        By column, one for each of `Plan.regions`.
    total
        Of the whole part: a row with fewer columns.
    right
        Columns whose figures stand flush right.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[Mapping[str, str], ...]
    total: Mapping[str, str]
    right: tuple[str, ...] = ("#", "achieved MPa", "error", "volume mm3", "mass g")


def plan_table(plan: Plan) -> PlanTable:
    """Return the table of a plan."""
    begin, way, words = mm_along(plan.gradient.field)
    long = words == _IN_MM
    rows = tuple(
        {
            "#": str(r.index),
            "material": r.printed,
            "blend": _blend_text(r),
            "place mm" if long else "field": " .. ".join(
                f"{begin + u * way:.{2 if long else 4}f}" for u in r.field
            ),
            "target MPa": format_range(r.target_modulus_MPa),
            "achieved MPa": format_number(r.modulus_MPa),
            "95 % interval": format_interval(r.modulus_interval_MPa),
            "error": " .. ".join(dict.fromkeys(f"{100 * e:+.0f}" for e in r.error)) + " %",
            "volume mm3": format_number(r.volume_mm3, 4),
            "mass g": format_number(r.mass_g),
        }
        for r in plan.regions
    )
    total = {
        "material": "all",
        "volume mm3": format_number(sum(r.volume_mm3 for r in plan.regions), 4),
        "mass g": format_number(plan.mass_g),
    }
    strain = f"{plan.stiffness.at_strain:g}"
    title = f"{plan.part.file} on {plan.printer}: secant modulus at strain {strain}"
    columns = tuple(name for name in rows[0] if name != "blend" or plan.gradient.blend is not None)
    return PlanTable(title, columns, rows, total)


def error_words(plan: Plan) -> str:
    """Say how far the stiffness is off its target at worst, and what would make it less.

    Nothing of a plan that does not say so.
    """
    check = plan.checks.get("worst_stiffness_error")
    if check is None:
        return ""
    others = plan.stiffness.alternatives.items()
    better = [f"{option} {error_text(ratio)}" for option, ratio in others]
    return f"largest error of the stiffness: {', '.join([error_text(check.value), *better])}"


def moved_words(plan: Plan) -> str:
    """Say how many cuts were moved off faces of the part; nothing where none was."""
    snap = plan.gradient.snap
    if snap is None:
        return ""
    moved = snap["moved"]
    cuts = "1 cut was" if len(moved) == 1 else f"{len(moved)} cuts were"
    return (
        f"{cuts} moved by up to {max(cut['by_mm'] for cut in moved):.2f} mm, so that no sliver is "
        "left beside a face of the part (--snap 0: not at all)"
    )


def unreachable_words(plan: Plan) -> list[str]:
    """Say of each stretch whose target no material reaches where it lies and what comes nearest."""
    return [
        f"target {missed.target_modulus_MPa[0]:.3g} .. {missed.target_modulus_MPa[1]:.3g} MPa at "
        f"field {missed.field[0]:.3f} .. {missed.field[1]:.3f} is out of reach; the nearest is "
        f"{missed.nearest} with {missed.modulus_MPa:.3g} MPa"
        for missed in plan.unreachable
    ]


_IN_MM, _SHARE = "place along the field, mm", "field, from its beginning (0) to its end (1)"


def mm_along(field: Mapping[str, object]) -> tuple[float, float, str]:
    """Return where a field begins and how far it goes, in mm where it is a length; and in words."""
    begin, end, span = field.get("from_mm"), field.get("to_mm"), field.get("span_mm")
    if not isinstance(span, float):
        return 0.0, 1.0, _SHARE
    if isinstance(begin, float) and isinstance(end, float):
        return begin, end - begin, _IN_MM
    return 0.0, span, _IN_MM


def _blend_text(region: Region) -> str:
    """Say in a few words what a region has to do with its neighbour."""
    blend = region.blend or {}
    if blend.get("kind") == "dither":
        return f"{100 * blend['volume_fraction']:.1f} % {blend['upper']} in {blend['lower']}"
    if blend.get("kind") == "bands":
        return f"{100 * blend['share']:.1f} % {blend['upper']}, {blend['lower']} in turn"
    if blend.get("kind") == "mix":
        return f"{100 * blend['fraction']:.1f} % {blend['upper']} mixed in {blend['lower']}"
    return ""


# ------------------------------------------------------------------------------------------------
# Target and achieved stiffness along the field, as SVG inside a page.


_Target: TypeAlias = tuple[FloatArray, FloatArray]

_LEFT, _TOP, _WIDTH, _HEIGHT = 58.0, 34.0, 620.0, 260.0
_STRIP = 14.0
_PLACES = 24
"""Places drawn between two knots of a target that is no straight line."""

_ROOM = 0.05
_LETTER = 6.2
"""About the width of a letter of the figure, in pixels."""


def stiffness_figure(plan: Plan, colours: Mapping[str, str], words: str = "") -> str:
    """Draw target, achieved modulus and its 95 % interval along the field, and what lies where.

    Parameters
    ----------
    colours
        Of each material from soft to hard, as the page shows it. What belongs to a material has
        its number as ``data-material``, so that the page can point it out.
    words
        What it shows; where none are given, the page says so under the id ``stiffness-words``.

    Returns
    -------
    str
        An ``svg`` element.
    """
    target = target_along(plan)
    *_, words_along = mm_along(plan.gradient.field)
    numbers = {name: number for number, name in enumerate(colours, start=1)}
    known = any(low < high for low, high in (r.modulus_interval_MPa for r in plan.regions))
    chart = _chart([plan], [target], [e for r in plan.regions for e in r.modulus_interval_MPa])
    bottom = _TOP + _HEIGHT + 44.0
    parts = [
        *(_interval(r, chart, numbers) for r in stretches(plan.regions) if known),
        *chart.frame(
            x_label="", y_label=f"secant modulus at strain {plan.stiffness.at_strain:g}, MPa"
        ),
        *([] if target is None else [_target_line(chart, target)]),
        *(_achieved(r, chart) for r in stretches(plan.regions)),
        *_strip(plan.regions, chart, colours, numbers),
        svg.text(_LEFT + 0.5 * _WIDTH, bottom + 24.0, words_along, anchor="middle"),
        *_key(known, target is not None),
    ]
    width, height = _LEFT + _WIDTH + 16.0, bottom + 34.0
    named = f'aria-label="{escape(words)}"' if words else 'aria-labelledby="stiffness-words"'
    return svg.inline(width, height, parts, named)


def _chart(
    plans: Sequence[Plan], targets: Sequence[_Target | None], more_MPa: Sequence[float] = ()
) -> Chart:
    """Return a chart of moduli over the field, in mm where all plans' have the same ends."""
    moduli_MPa = [*(r.modulus_MPa for plan in plans for r in plan.regions), *more_MPa]
    wanted = [target[1] for target in targets if target is not None]
    logs = np.log10(np.sort(np.concatenate([moduli_MPa, *wanted])))
    spans = {mm_along(plan.gradient.field)[:2] for plan in plans}
    begin, way = spans.pop() if len(spans) == 1 else (0.0, 1.0)
    ends = (begin, begin + way) if way else (0.0, 1.0)
    return Chart(_LEFT, _TOP, _WIDTH, _HEIGHT, ends, svg.with_room(logs, _ROOM), y_log=True)


def _target_line(chart: Chart, target: _Target, colour: str = BLUE, width: float = 2.0) -> str:
    begin, end = chart.x_range
    x = begin + target[0] * (end - begin)
    return chart.line(x, target[1], colour=colour, width=width, dash="6,4")


def target_along(plan: Plan) -> _Target | None:
    """Return places 0..1 and the target there, in MPa; None of a plan without one."""
    profile = plan.gradient.profile
    if not {"positions", "moduli_MPa", "shape"} <= profile.keys():
        return None
    wanted = profile_of({"name": "", **profile})
    places, values = [], []
    for a, b in itertools.pairwise(wanted.positions):
        if a < b:
            u = np.linspace(a, b, 2 if wanted.shape == "log" else _PLACES)
            u[-1] = np.nextafter(b, a)  # at a jump, the value before it
            places.append(u)
            values.append(wanted.modulus_MPa(u))
    return np.concatenate(places), np.concatenate(values)


def stretches(regions: Sequence[Region]) -> list[Region]:
    """Return one region a stretch of the field: two whose cells lie together have one modulus."""
    return list({region.field: region for region in regions}.values())


def _span(region: Region, chart: Chart) -> tuple[float, float]:
    """Return where a region begins and ends in the picture."""
    begin, end = chart.x_range
    first, last = (begin + u * (end - begin) for u in region.field)
    return chart.x(first), chart.x(last)


def _said(region: Region) -> str:
    interval = format_interval(region.modulus_interval_MPa)
    return f"{format_number(region.modulus_MPa)} MPa, 95 % interval {interval}"


def _interval(region: Region, chart: Chart, numbers: Mapping[str, int]) -> str:
    left, right = _span(region, chart)
    low, high = (chart.y(end) for end in region.modulus_interval_MPa)
    drawn = svg.rectangle(left, high, right - left, low - high, colour=PALE_BLUE)
    return f'<g data-material="{numbers[region.printed]}">{drawn}</g>'


def _achieved(region: Region, chart: Chart, colour: str = INK, width: float = 2.5) -> str:
    left, right = _span(region, chart)
    y = chart.y(region.modulus_MPa)
    return svg.segment((left, y), (right, y), colour=colour, width=width)


def _strip(
    regions: Sequence[Region], chart: Chart, colours: Mapping[str, str], numbers: Mapping[str, int],
) -> Iterator[str]:  # fmt: skip
    """Draw what each stretch is printed in; two that share one have their shares of its height."""
    top = chart.top + chart.height + 24.0
    filled: dict[tuple[float, float], float] = {}
    for region in regions:
        left, right = _span(region, chart)
        share = _share(region)
        begin = filled.get(region.field, 0.0)
        filled[region.field] = begin + share
        name, number = region.printed, numbers[region.printed]
        words = f"{number} {name}: {_said(region)}"
        yield f'<g data-material="{number}"><title>{escape(words)}</title>'
        yield (
            f'<rect class="swatch" x="{left:.2f}" y="{top + begin * _STRIP:.2f}" '
            f'width="{right - left:.2f}" height="{share * _STRIP:.2f}" fill="{colours[name]}"/>'
        )
        if begin == 0.0 and _LETTER * len(str(number)) + 4.0 <= right - left and share == 1.0:
            middle = 0.5 * (left + right)
            yield svg.text(middle, top + _STRIP + 12.0, str(number), anchor="middle", size=10.0)
        yield "</g>"


def _share(region: Region) -> float:
    """Return how much of its stretch a region takes: all of it, but for cells among others."""
    blend = region.blend or {}
    if blend.get("kind") != "dither":
        return 1.0
    upper = float(blend.get("volume_fraction", 0.5))
    return upper if region.material == blend.get("upper") else 1.0 - upper


def _key(known: bool, wanted: bool) -> Iterator[str]:
    x = _LEFT + _WIDTH
    if known:
        x -= 92.0
        yield svg.text(x + 24.0, 18.0, "95 % band")
        yield svg.rectangle(x, 9.0, 18.0, 11.0, colour=PALE_BLUE)
    x -= 92.0
    yield svg.text(x + 26.0, 18.0, "achieved")
    yield svg.segment((x, 14.0), (x + 20.0, 14.0), colour=INK, width=2.5)
    if wanted:
        x -= 78.0
        yield svg.text(x + 26.0, 18.0, "target")
        yield svg.segment((x, 14.0), (x + 20.0, 14.0), colour=BLUE, width=2.0, dash="6,4")


# ------------------------------------------------------------------------------------------------
# Two plans over each other.


def both_figure(first: Plan, second: Plan, words: str) -> str:
    """Draw targets and achieved moduli of two plans over each other, along their fields.

    In millimetres where both fields begin and end at the same ones, else from 0 to 1.

    Parameters
    ----------
    words
        Id of what the page says of it.

    Returns
    -------
    str
        An ``svg`` element.
    """
    plans = (first, second)
    targets = [target_along(plan) for plan in plans]
    chart = _chart(plans, targets)
    strains = dict.fromkeys(f"{plan.stiffness.at_strain:g}" for plan in plans)
    across = _SHARE if chart.x_range[1] - chart.x_range[0] == 1.0 else _IN_MM
    up = f"secant modulus at strain {' and '.join(strains)}, MPa"
    parts = list(chart.frame(x_label=across, y_label=up))
    styles = (("A", BLUE, 5.0), ("B", RUST, 2.0))
    for (side, colour, thick), plan, target in zip(styles, plans, targets, strict=True):
        if target is not None:
            parts += svg.told(f"{side}: target", [_target_line(chart, target, colour, 1.3)])
        for region in stretches(plan.regions):
            said = f"{side}: {region.printed}, {_said(region)}"
            parts += svg.told(said, [_achieved(region, chart, colour, thick)])
    for place, (side, colour, thick) in enumerate(styles):
        x = _LEFT + _WIDTH - 100.0 + 56.0 * place
        parts += [
            svg.segment((x, 14.0), (x + 20.0, 14.0), colour=colour, width=thick),
            svg.text(x + 26.0, 18.0, side),
        ]
    width, height = _LEFT + _WIDTH + 16.0, _TOP + _HEIGHT + 50.0
    return svg.inline(width, height, parts, f'aria-labelledby="{words}"')
