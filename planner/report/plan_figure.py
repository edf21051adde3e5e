"""The figure of a plan: target and achieved stiffness along its field, as SVG inside a page."""

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from html import escape

import numpy as np

from planner.grading.profile import Profile
from planner.numerics import FloatArray
from planner.plan import Plan, Region
from planner.report.plan_text import format_interval, format_number, mm_along
from planner.report.svg import (
    BLUE,
    INK,
    PALE_BLUE,
    RUST,
    Chart,
    frame,
    inline,
    line,
    log_ticks,
    rectangle,
    segment,
    text,
    told,
)

__all__ = ["both_figure", "stiffness_figure", "stretches", "target_along"]


_LEFT, _TOP, _WIDTH, _HEIGHT = 58.0, 34.0, 620.0, 260.0
_STRIP_TOP, _STRIP = 0.0, 14.0
_PLACES = 24
"""Places drawn between two knots of a target that is no straight line."""

_ROOM = 0.05
_LETTER = 6.2
"""About the width of a letter of the figure, in pixels."""


def stiffness_figure(
    plan: Plan, colours: Mapping[str, str], numbers: Mapping[str, int], words: str = ""
) -> str:
    """Draw target, achieved modulus and its 95 % interval along the field, and what lies where.

    Parameters
    ----------
    colours, numbers
        Of each material, as the page shows it. What belongs to a material has its number as
        ``data-material``, so that the page can point it out.
    words
        What it shows; where none are given, the page says so under the id ``stiffness-words``.

    Returns
    -------
    str
        An ``svg`` element.
    """
    target = target_along(plan)
    known = any(low < high for low, high in (r.modulus_interval_MPa for r in plan.regions))
    moduli = [r.modulus_MPa for r in plan.regions] + [
        end for r in plan.regions for end in r.modulus_interval_MPa
    ]
    if target is not None:
        moduli += [float(10.0 ** target[1].min()), float(10.0 ** target[1].max())]
    low, high = math.log10(min(moduli)), math.log10(max(moduli))
    room = _ROOM * (high - low) or 0.5
    begin, way = mm_along(plan.gradient.field)
    ends = (begin, begin + way) if way else (0.0, 1.0)
    chart = Chart(_LEFT, _TOP, _WIDTH, _HEIGHT, ends, (low - room, high + room))
    long = isinstance(plan.gradient.field.get("span_mm"), float)
    bottom = _TOP + _HEIGHT + 44.0
    parts = [
        *(_interval(r, chart, ends, numbers) for r in stretches(plan.regions) if known),
        *frame(
            chart,
            x_label="",
            y_label=f"secant modulus at strain {plan.stiffness.at_strain:g}, MPa",
            y_ticks=log_ticks(*chart.y_range),
        ),
        *(
            [line(chart, ends[0] + target[0] * way, target[1], colour=BLUE, dash="6,4")]
            if target is not None
            else []
        ),
        *(_step(r, chart, ends) for r in stretches(plan.regions)),
        *_strip(plan.regions, chart, ends, colours, numbers),
        text(
            _LEFT + 0.5 * _WIDTH,
            bottom + 24.0,
            "mm along the field" if long else "field, from its beginning (0) to its end (1)",
            anchor="middle",
        ),
        *_key(known, target is not None),
    ]
    width, height = _LEFT + _WIDTH + 16.0, bottom + 34.0
    named = f'aria-label="{escape(words)}"' if words else 'aria-labelledby="stiffness-words"'
    return inline(width, height, parts, named)


def target_along(plan: Plan) -> tuple[FloatArray, FloatArray] | None:
    """Return places 0..1 and log10 of the target there, in MPa; None of a plan without one."""
    profile = plan.gradient.profile
    if not {"positions", "moduli_MPa", "shape"} <= profile.keys():
        return None
    wanted = Profile(
        str(profile.get("name", "")), tuple(profile["positions"]), tuple(profile["moduli_MPa"]),
        profile["shape"],
    )  # fmt: skip
    places, values = [], []
    for a, b in itertools.pairwise(wanted.positions):
        if a < b:
            u = np.linspace(a, b, 2 if wanted.shape == "log" else _PLACES)
            u[-1] = np.nextafter(b, a)  # at a jump, the value before it
            places.append(u)
            values.append(np.log10(wanted.modulus_MPa(u)))
    return np.concatenate(places), np.concatenate(values)


def stretches(regions: Sequence[Region]) -> list[Region]:
    """Return one region a stretch of the field: two whose cells lie together have one modulus."""
    return list({region.field: region for region in regions}.values())


def _span(region: Region, chart: Chart, ends: tuple[float, float]) -> tuple[float, float]:
    """Return where a region begins and ends in the picture."""
    begin, way = ends[0], ends[1] - ends[0]
    return chart.x(begin + region.field[0] * way), chart.x(begin + region.field[1] * way)


def _interval(
    region: Region, chart: Chart, ends: tuple[float, float], numbers: Mapping[str, int]
) -> str:
    left, right = _span(region, chart, ends)
    low, high = (chart.y(math.log10(end)) for end in region.modulus_interval_MPa)
    drawn = rectangle(left, high, right - left, low - high, colour=PALE_BLUE)
    return f'<g data-material="{numbers[region.printed]}">{drawn}</g>'


def _step(region: Region, chart: Chart, ends: tuple[float, float]) -> str:
    left, right = _span(region, chart, ends)
    y = chart.y(math.log10(region.modulus_MPa))
    return segment((left, y), (right, y), colour=INK, width=2.5)


def _strip(
    regions: Sequence[Region], chart: Chart, ends: tuple[float, float],
    colours: Mapping[str, str], numbers: Mapping[str, int],
) -> Iterator[str]:  # fmt: skip
    """Draw what each stretch is printed in; two that share one have their shares of its height."""
    top = chart.top + chart.height + 24.0 + _STRIP_TOP
    filled: dict[tuple[float, float], float] = {}
    for region in regions:
        left, right = _span(region, chart, ends)
        share = _share(region)
        begin = filled.get(region.field, 0.0)
        filled[region.field] = begin + share
        name, number = region.printed, numbers[region.printed]
        words = (
            f"{number} {name}: {format_number(region.modulus_MPa)} MPa, 95 % interval "
            f"{format_interval(region.modulus_interval_MPa)}"
        )
        yield f'<g data-material="{number}"><title>{escape(words)}</title>'
        yield (
            f'<rect class="swatch" x="{left:.2f}" y="{top + begin * _STRIP:.2f}" '
            f'width="{right - left:.2f}" height="{share * _STRIP:.2f}" fill="{colours[name]}"/>'
        )
        if begin == 0.0 and _LETTER * len(str(number)) + 4.0 <= right - left and share == 1.0:
            middle = 0.5 * (left + right)
            yield text(middle, top + _STRIP + 12.0, str(number), anchor="middle", size=10.0)
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
        yield text(x + 24.0, 18.0, "95 % band")
        yield rectangle(x, 9.0, 18.0, 11.0, colour=PALE_BLUE)
    x -= 92.0
    yield text(x + 26.0, 18.0, "achieved")
    yield segment((x, 14.0), (x + 20.0, 14.0), colour=INK, width=2.5)
    if wanted:
        x -= 78.0
        yield text(x + 26.0, 18.0, "target")
        yield segment((x, 14.0), (x + 20.0, 14.0), colour=BLUE, width=2.0, dash="6,4")


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
    moduli = [math.log10(region.modulus_MPa) for plan in plans for region in plan.regions]
    for target in targets:
        moduli += [] if target is None else [float(target[1].min()), float(target[1].max())]
    room = _ROOM * (max(moduli) - min(moduli)) or 0.5
    spans = [mm_along(plan.gradient.field) for plan in plans]
    begin, way = spans[0] if spans[0] == spans[1] and spans[0][1] else (0.0, 1.0)
    ends = (begin, begin + way)
    chart = Chart(_LEFT, _TOP, _WIDTH, _HEIGHT, ends, (min(moduli) - room, max(moduli) + room))
    strains = dict.fromkeys(f"{plan.stiffness.at_strain:g}" for plan in plans)
    long = way != 1.0
    across = "place along the field, mm" if long else "field, from its beginning (0) to its end (1)"
    up = f"secant modulus at strain {' and '.join(strains)}, MPa"
    parts = list(frame(chart, x_label=across, y_label=up, y_ticks=log_ticks(*chart.y_range)))
    styles = (("A", BLUE, 5.0), ("B", RUST, 2.0))
    for (side, colour, thick), plan, target in zip(styles, plans, targets, strict=True):
        if target is not None:
            drawn = line(
                chart, begin + target[0] * way, target[1], colour=colour, width=1.3, dash="6,4"
            )
            parts += told(f"{side}: target", [drawn])
        for region in stretches(plan.regions):
            said = (
                f"{side}: {region.printed}, {format_number(region.modulus_MPa)} MPa, 95 % interval "
                f"{format_interval(region.modulus_interval_MPa)}"
            )
            left, right = _span(region, chart, ends)
            y = chart.y(math.log10(region.modulus_MPa))
            parts += told(said, [segment((left, y), (right, y), colour=colour, width=thick)])
    for place, (side, colour, thick) in enumerate(styles):
        x = _LEFT + _WIDTH - 100.0 + 56.0 * place
        parts += [
            segment((x, 14.0), (x + 20.0, 14.0), colour=colour, width=thick),
            text(x + 26.0, 18.0, side),
        ]
    width, height = _LEFT + _WIDTH + 16.0, _TOP + _HEIGHT + 50.0
    return inline(width, height, parts, f'aria-labelledby="{words}"')
