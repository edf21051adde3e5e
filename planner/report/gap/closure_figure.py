"""How far the gap closes: errors before and after, beside the floor and the baselines."""

import math
import textwrap
from collections.abc import Iterator

from planner.gap.diagnosis import Diagnosis, Gap
from planner.report.gap.colours import AFTER, BASELINE, BEFORE, QUIET
from planner.report.gap.wording import percent
from planner.report.svg import GREY, INK, picture, rectangle, segment, text, ticks

__all__ = ["closure_figure"]

_LEFT, _WIDTH, _RIGHT, _TOP, _STEP, _BAR = 290.0, 380.0, 90.0, 66.0, 30.0, 18.0
_LINE, _LEADING = 104, 15.0


def closure_figure(diagnosis: Diagnosis) -> bytes:
    """Return the figure as SVG: a bar an error, the replicate floor as a dashed line."""
    gap = diagnosis.gap
    title = "Error of force, of each test's largest"
    rows = list(_rows(diagnosis))
    interval = _after_interval(gap)
    most = max([value for _, value, _ in rows] + [gap.floor or 0.0, *(interval or ())]) or 1.0
    scale = _WIDTH / (1.12 * most)
    held_out = textwrap.wrap(f"held out: {gap.held_out}", _LINE) if gap.held_out else []
    first = _TOP + _LEADING * max(len(held_out) - 1, 0)
    bottom = first + _STEP * len(rows)
    parts = [text(20.0, 28.0, title, size=15.0)]
    for number, words in enumerate(held_out):
        parts.append(text(20.0, 46.0 + _LEADING * number, words, colour=QUIET))
    for tick in ticks(0.0, 112.0 * most, 6):
        x = _LEFT + scale * tick / 100.0
        parts.append(segment((x, first - 6.0), (x, bottom), colour="#e4e4e4"))
        parts.append(text(x, bottom + 16.0, f"{tick:g} %", anchor="middle", colour=QUIET))
    for number, (words, value, colour) in enumerate(rows):
        top = first + _STEP * number
        whisker = interval if colour == AFTER else None
        parts += _bar(words, value, colour, top, scale, whisker)
    parts.append(segment((_LEFT, first - 6.0), (_LEFT, bottom), colour=GREY))
    if gap.floor is not None:
        x = _LEFT + scale * gap.floor
        parts.append(segment((x, first - 6.0), (x, bottom), colour=INK, width=1.5, dash="5,4"))
        note = f"dashed: replicates differ by {percent(gap.floor)}, no model does better"
        parts.append(text(_LEFT, bottom + 38.0, note, colour=QUIET))
    return picture(_LEFT + _WIDTH + _RIGHT, bottom + 52.0, parts, title=title)


def _rows(diagnosis: Diagnosis) -> Iterator[tuple[str, float, str]]:
    gap = diagnosis.gap
    named = diagnosis.verdict not in ("none", "unknown")
    yield "palette alone", gap.before, BEFORE
    if gap.recalibration_only is not None:
        yield "laws refitted, no effect", gap.recalibration_only, BASELINE
    if gap.generic is not None:
        yield "flexible regression", gap.generic, BASELINE
    if gap.after is not None:
        yield (
            "with the verdict's effects" if named else "with the best of each fold",
            gap.after,
            AFTER,
        )


def _bar(
    words: str,
    value: float,
    colour: str,
    top: float,
    scale: float,
    interval: tuple[float, float] | None,
) -> Iterator[str]:
    middle = top + 0.5 * _BAR
    yield text(_LEFT - 10.0, middle + 4.0, words, anchor="end")
    yield rectangle(_LEFT, top, scale * value, _BAR, colour=colour)
    end = value
    if interval is not None:
        low, high = (_LEFT + scale * x for x in interval)
        yield segment((low, middle), (high, middle), colour=INK, width=1.5)
        for x in (low, high):
            yield segment((x, middle - 4.0), (x, middle + 4.0), colour=INK, width=1.5)
        end = max(value, interval[1])
    yield text(_LEFT + scale * end + 8.0, middle + 4.0, percent(value))


def _after_interval(gap: Gap) -> tuple[float, float] | None:
    """Return the error after that the ends of the closure's interval stand for."""
    if gap.after is None or gap.floor is None or gap.closed_interval is None:
        return None
    low, high = gap.closed_interval
    if not (math.isfinite(low) and math.isfinite(high)):
        return None
    reach = gap.before - gap.floor
    ends = sorted(max(0.0, gap.floor + (1.0 - closed) * reach) for closed in (low, high))
    return ends[0], ends[1]
