"""Figures of a diagnosis: where the gap lies, evidence, curves, closure."""

import itertools
import math
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from planner.gap.diagnosis import Diagnosis, Gap, Location, Traces, signed_error
from planner.gap.summary import axis_words, clear_places, p_value, percent, probability
from planner.numerics import FloatArray
from planner.report import svg

__all__ = ["errors_of", "figures_of", "unit_of"]


def figures_of(diagnosis: Diagnosis) -> dict[str, bytes]:
    """Return the figures as SVG by their names, in the order in which a reader asks.

    What was measured, what causes it, where it lies, how far it closes. Those of curves where there
    are traces.
    """
    traces = diagnosis.traces
    if traces is not None and not diagnosis.named:  # no effects to draw
        after, residual = (np.full_like(v, np.nan) for v in (traces.after_N, traces.residual_after))
        traces = replace(traces, after_N=after, residual_after=residual)
    drawn = {
        "curves": None if traces is None else _curves_figure(traces),
        "evidence": _evidence_figure(diagnosis),
        "residuals": None if traces is None else _residual_figure(diagnosis, traces),
        "closure": _closure_figure(diagnosis),
    }
    return {name: drawing for name, drawing in drawn.items() if drawing is not None}


# ------------------------------------------------------------------------------------------------
# What figures and tables show: errors by their names, and a column's unit.


def errors_of(diagnosis: Diagnosis) -> Iterator[tuple[str, float]]:
    """Yield each error that is known with its name, what replicates differ by last."""
    gap = diagnosis.gap
    for words, error in (
        ("palette alone", gap.before),
        ("laws refitted, nothing added", gap.recalibration_only),
        ("regression without any physics", gap.generic),
        # Without an effect there is nothing to add, and the error is the palette's own.
        ("with the verdict's effects", gap.after if diagnosis.named else None),
        ("scatter between replicates", gap.floor),
    ):
        if error is not None:
            yield words, error


_UNITS: Mapping[str, str] = {
    "_mm_s": "mm/s", "_per_s": "1/s", "_MPa": "MPa", "_mm": "mm", "_days": "days", "_C": "°C",
    "_h": "h", "_s": "s", "_N": "N",
}  # fmt: skip


def unit_of(column: str) -> str:
    """Return the unit that a column's name ends in, "" for none."""
    return next((unit for end, unit in _UNITS.items() if column.endswith(end)), "")


# ------------------------------------------------------------------------------------------------
# Colours that mean the same in every figure, told apart by the colour-blind and in grey.


@dataclass(frozen=True, slots=True)
class _Look:
    """How a prediction is drawn: its name, colour, dashes, marks, and how far aside they stand."""

    of: str
    colour: str
    dash: str
    mark: Callable[..., str]
    aside: float


_BEFORE = _Look("palette alone", svg.RUST, "6,4", svg.ring, -5.0)
_AFTER = _Look("with the verdict's effects", svg.BLUE, "", svg.disc, 5.0)

_BASELINE = "#9aa3ad"
"""What the effects are held against."""

_PALE = "#c9d8ea"
_WITH_UNKNOWN = "something unknown, alone or beside it"
"""The part of a bar that needs something unknown, and what it is called."""

# ------------------------------------------------------------------------------------------------
# What figures share: panels in rows, and bars from the left.


_TOP = 84.0

_BARS_LEFT, _BARS_WIDTH, _BARS_RIGHT = 290.0, 380.0, 90.0
_STEP, _HEIGHT, _LEADING = 28.0, 17.0, 15.0


@dataclass(frozen=True, slots=True)
class _Bar:
    """A name, stretches of the bar by width and colour, what to write at its end, a whisker."""

    name: str
    stretches: Sequence[tuple[float, str]]
    words: str
    whisker: Sequence[float] = ()


def _bar_figure(
    title: str, bars: Sequence[_Bar], marks: Sequence[tuple[float, str]], *,
    key: Sequence[str] = (), notes: Sequence[str] = (), dashed: float | None = None,
) -> bytes:  # fmt: skip
    """Draw bars below each other over a grid with its marks, notes below; all widths in pixels."""
    bottom = _TOP + _STEP * max(len(bars), 1)
    parts = list(key)

    def upright_line(x: float, colour: str, width: float = 1.0, dash: str = "") -> None:
        ends = (_BARS_LEFT + x, _TOP - 4.0), (_BARS_LEFT + x, bottom)
        parts.append(svg.segment(*ends, colour=colour, width=width, dash=dash))

    for x, words in marks:
        upright_line(x, "#e4e4e4")
        at = (_BARS_LEFT + x, bottom + 16.0)
        parts.append(svg.text(*at, words, anchor="middle", colour=svg.QUIET))
    for number, bar in enumerate(bars):
        first, end = _TOP + _STEP * number, _BARS_LEFT
        middle = first + 0.5 * _HEIGHT
        parts.append(svg.text(_BARS_LEFT - 10.0, middle + 4.0, bar.name, anchor="end"))
        for width, colour in bar.stretches:
            parts.append(svg.rectangle(end, first, width, _HEIGHT, colour=colour))
            end += width
        if bar.whisker:
            low, high = (_BARS_LEFT + x for x in bar.whisker)
            for ends in ((low, 0.0, high, 0.0), (low, -4.0, low, 4.0), (high, -4.0, high, 4.0)):
                start, stop = (ends[0], middle + ends[1]), (ends[2], middle + ends[3])
                parts.append(svg.segment(start, stop, colour=svg.INK, width=1.5))
            end = max(end, high)
        parts.append(svg.text(end + 8.0, middle + 4.0, bar.words))
    upright_line(0.0, svg.GREY)
    if dashed is not None:
        upright_line(dashed, svg.INK, 1.5, "5,4")
    lines = [line for note in notes for line in textwrap.wrap(note, 104)]
    for number, words in enumerate(lines):
        parts.append(svg.text(20.0, bottom + 40.0 + _LEADING * number, words, colour=svg.QUIET))
    width, height = _BARS_LEFT + _BARS_WIDTH + _BARS_RIGHT, bottom + 34.0 + _LEADING * len(lines)
    return svg.picture(width, height, parts, title=title)


# ------------------------------------------------------------------------------------------------
# The errors to draw along one axis: points a specimen, or a line a test.


_LOG_FROM = 20.0
_BRANCHES = ("loading", "unloading", "reloading", "hold")
_HOLD = 3.0


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """Errors along an axis, before and after.

    Attributes
    ----------
    x, before, after : (n,)
        Places on the axis, and errors there; NaN where unknown.
    names
        Of the places 0, 1, 2, ..., where the axis has no numbers.
    log
        Whether `x` is a decimal logarithm.
    joined
        Whether to join the means of the axis' levels.
    of_curve : (n,)
        For errors along curves: which curve each point belongs to; None for points a specimen.
    row
        For points a specimen: whose each one is, in the campaign's order.
    """

    x: FloatArray
    before: FloatArray
    after: FloatArray
    names: tuple[str, ...] = ()
    log: bool = False
    joined: bool = False
    of_curve: FloatArray | None = None
    row: tuple[int, ...] = ()


def points_along(traces: Traces, axis: str) -> Points | None:
    """Return the points of an axis; None where the traces do not hold it."""
    if axis in ("strain", "time"):
        return _along_curves(traces, axis)
    if axis == "branch":
        return _of_branches(traces)
    column = traces.columns.get(axis)
    if column is None:
        return None
    errors, row = (traces.residual_before, traces.residual_after), tuple(range(len(column)))
    known = dict.fromkeys(v for v in column if v is not None)
    numbers = [v for v in known if isinstance(v, (int, float))]
    if numbers and len(numbers) == len(known):
        x = np.array([np.nan if v is None else float(v) for v in column])
        log = min(numbers) > 0.0 and max(numbers) >= _LOG_FROM * min(numbers)
        x = np.log10(x) if log else x
        few = len(np.unique(np.round(x[np.isfinite(x)], 9))) <= 12
        return Points(x, *errors, log=log, joined=few, row=row)
    names = tuple(dict.fromkeys(map(str, known)))
    names = names if axis in ("specimen", "material") else tuple(sorted(names))
    x = np.array([np.nan if v is None else names.index(str(v)) for v in column])
    return Points(x, *errors, names=names, joined=axis != "specimen", row=row)


def _along_curves(traces: Traces, axis: str) -> Points:
    """Return the mean error of each test along its curve, at steps that lie apart."""
    x_of_tests = traces.time_s
    if axis == "strain":
        lengths = [traces.columns["gauge_mm"][rows[0]] for rows in traces.rows]
        x_of_tests = traces.travel_mm / np.array(lengths, dtype=np.float64)[:, None]
    errors = [traces.errors(f) for f in (traces.before_N, traces.after_N)]
    parts: list[tuple[float, ...]] = []
    for test, (x, rows) in enumerate(zip(x_of_tests, traces.rows, strict=True)):
        # Of strains the first loading alone: on the way back the same ones come again.
        last = int(np.argmax(x)) if axis == "strain" else len(x) - 1
        for i in np.unique(np.linspace(0, last, 40).round().astype(np.intp)).tolist():
            parts.append((x[i], *(float(np.mean(e[rows, i])) for e in errors), float(test)))
    table = np.array(parts)
    x, before, after, of_curve = table[table[:, 0] > 0.0].T if axis == "time" else table.T
    log = axis == "time" and bool(x.max() >= _LOG_FROM * x.min())
    return Points(np.log10(x) if log else x, before, after, log=log, of_curve=of_curve)


def _of_branches(traces: Traces) -> Points:
    """Return each specimen's error on each way of its path."""
    errors = [traces.errors(f) for f in (traces.before_N, traces.after_N)]
    parts: list[tuple[float, ...]] = []
    for travel, rows in zip(traces.travel_mm, traces.rows, strict=True):
        branch = _branch_of_steps(travel)
        for row, place in itertools.product(rows, range(len(_BRANCHES))):
            if (on := branch == place).any():
                found = (float(signed_error(e[row, on])) for e in errors)
                parts.append((float(place), *found, float(row)))
    places, befores, afters, row = np.array(parts).T
    there, x = np.unique(places, return_inverse=True)
    names = tuple(_BRANCHES[int(place)] for place in there)
    return Points(x.astype(np.float64), befores, afters, names=names, row=tuple(map(int, row)))


def _branch_of_steps(travel: FloatArray) -> FloatArray:
    """Return the place in `_BRANCHES` of each step; NaN of the first."""
    moves = np.diff(travel)
    still = np.abs(moves) <= 1e-6 * float(np.ptp(travel))
    fallen = np.logical_or.accumulate((moves < 0.0) & ~still)
    branch = np.where(still, _HOLD, np.where(moves < 0.0, 1.0, np.where(fallen, 2.0, 0.0)))
    return np.append(np.nan, branch)


# ------------------------------------------------------------------------------------------------
# What a pointer on a mark brings up: the specimen or test, its conditions, its errors.


_SIZES = ("specimen", "material", "width_mm", "thickness_mm", "gauge_mm")


def _specimen_words(traces: Traces, row: int) -> str:
    """Name a specimen with what it is of and the conditions that it was tested in."""
    words = [str(traces.columns["material"][row])]
    for column, values in traces.columns.items():
        value = values[row]
        told = column in ("rate_mm_s", "temperature_C") or len({*values} - {None}) > 1
        if value is None or column in _SIZES or not told:
            continue
        shown = f"{value:g}" if isinstance(value, float) else str(value)
        words.append(f"{axis_words(column)} {shown} {unit_of(column)}".strip())
    return f"{traces.columns['specimen'][row]}: {', '.join(words)}"


def _error_words(before: float, after: float) -> str:
    """Say what both predictions miss by, as far as it is known."""
    errors = ((before, _BEFORE), (after, _AFTER))
    known = [f"{percent(error)} ({look.of})" for error, look in errors if math.isfinite(error)]
    words = f"error {', '.join(known)}" if known else "no error known"
    return words.replace(" %", "\N{NO-BREAK SPACE}%")


# ------------------------------------------------------------------------------------------------
# Where the gap lies: errors of force along the leading axes, before and after.


_Range = tuple[float, float]

_SHOWN, _ACROSS = 4, 2
_CHARACTER = 7.0
_ERROR = "error, % of the largest force"
_OVERALL = Location("material", 0.0, (0.0, 0.0), 1.0)
"""Shows every specimen where there is room, whether or not the gap varies along it."""


def _residual_figure(diagnosis: Diagnosis, traces: Traces) -> bytes:
    """Return the figure as SVG."""
    places = clear_places(diagnosis) or list(diagnosis.where[:1])
    if len(places) < _ACROSS and all(p.axis != "material" for p in places):
        places.append(_OVERALL)
    found = [(place, points_along(traces, place.axis)) for place in places]
    shown = [(place, points) for place, points in found if points is not None][:_SHOWN]
    y_range = _y_range([points for _, points in shown])
    panels = [partial(_residual_panel, traces, *one, y_range) for one in shown]
    parts, width, height = svg.in_rows(panels, _ACROSS, (66.0, _TOP), (440.0, 280.0))
    key = [*_key(_BEFORE, 20.0, with_mark=True)]
    if any(np.isfinite(points.after).any() for _, points in shown):
        key += _key(_AFTER, 160.0, with_mark=True)
    title = "Error of each specimen: measured force above (+) or below (-) prediction"
    return svg.picture(width + 16.0, height - 16.0, [*key, *parts], title=title)


def _key(look: _Look, x: float, *, with_mark: bool = False) -> Iterator[str]:
    """Draw what a prediction looks like, and its name."""
    if with_mark:
        yield look.mark(x + 6.0, 48.0, colour=look.colour, radius=3.2)
        x += 14.0
    yield svg.segment((x, 48.0), (x + 22.0, 48.0), colour=look.colour, width=1.8, dash=look.dash)
    yield svg.text(x + 28.0, 52.0, look.of, colour=svg.QUIET)


def _residual_panel(
    traces: Traces, place: Location, points: Points, y_range: _Range, left: float, top: float
) -> Iterator[str]:
    chart = svg.Chart(left, top + 20.0, 350.0, 190.0, _x_range(points), y_range)
    words = axis_words(place.axis)
    heading = words[:1].upper() + words[1:]
    if place is not _OVERALL:
        heading += f": {percent(place.share)} of the gap, p = {p_value(place.p)}"
    yield svg.text(chart.left, chart.top - 10.0, heading, size=12.5)
    unit = "s" if place.axis == "time" else unit_of(place.axis)
    label = f"{words}, {unit}" if unit else words
    marks = _x_ticks(points, chart)
    blank = [(value, "") for value, _ in marks]
    yield from chart.frame(x_label="", y_label="", x_ticks=blank, most_ticks=7)
    yield from _x_words(chart, marks, label)
    ends = ((x, chart.y(0.0)) for x in (chart.left, chart.left + chart.width))
    yield svg.segment(*ends, colour=svg.GREY, width=1.2)
    yield chart.upright(46.0, _ERROR)
    yield from _error_lines(traces, points, chart, label)
    if points.of_curve is None:
        yield from _error_marks(traces, points, chart)


def _error_lines(traces: Traces, points: Points, chart: svg.Chart, label: str) -> Iterator[str]:
    """Draw the error of each test along its curve, or through the means of an axis' levels."""
    across = (chart.x_range[1] - chart.x_range[0]) / chart.width
    readable = chart.axes(label, _ERROR, log=points.log)
    for errors, look in ((points.before, _BEFORE), (points.after, _AFTER)):
        y = np.clip(100.0 * errors, *chart.y_range)
        line = partial(chart.line, colour=look.colour, width=1.3, dash=look.dash)
        if points.of_curve is not None:
            for curve in np.unique(points.of_curve):
                on = (points.of_curve == curve) & np.isfinite(y)
                if on.sum() > 1:
                    words = f"{traces.label[int(curve)]}: error, {look.of}"
                    yield from svg.told(words, [line(points.x[on], y[on])], axes=readable)
        elif points.joined:
            x = points.x + look.aside * across
            level = np.round(points.x, 9)
            known = np.isfinite(level) & np.isfinite(y)
            at = [known & (level == one) for one in np.unique(level[known])]
            if len(at) > 1:
                yield line(*(np.array([v[on].mean() for on in at]) for v in (x, y)))


def _error_marks(traces: Traces, points: Points, chart: svg.Chart) -> Iterator[str]:
    """Draw a mark a specimen for each prediction."""
    for row, x, *errors in zip(points.row, points.x, points.before, points.after, strict=True):
        marks = [
            look.mark(chart.x(x) + look.aside, chart.y(100.0 * e), colour=look.colour, radius=3.2)
            for e, look in zip(errors, (_BEFORE, _AFTER), strict=True)
            if math.isfinite(x) and math.isfinite(e)
        ]
        if marks:
            yield from svg.told(f"{_specimen_words(traces, row)}; {_error_words(*errors)}", marks)


def _x_range(points: Points) -> _Range:
    if points.names:
        return -0.6, len(points.names) - 0.4
    x = points.x[np.isfinite(points.x)]
    low, high = (float(x.min()), float(x.max())) if len(x) else (0.0, 1.0)
    room = 0.08 * (high - low) or max(0.1 * abs(low), 0.1)
    if points.of_curve is not None and low >= 0.0 and not points.log:
        return 0.0, high + 0.25 * room
    return low - room, high + room


def _x_words(chart: svg.Chart, marks: Sequence[tuple[float, str]], label: str) -> Iterator[str]:
    """Name the axis and its ticks, on two lines in turn where they have no room on one."""
    bottom = chart.top + chart.height
    room = chart.width / max(len(marks), 1)
    lines = 2 if max((len(words) for _, words in marks), default=0) * _CHARACTER > room else 1
    most = max(3, int(lines * room / _CHARACTER) - 1)
    for number, (value, words) in enumerate(marks):
        cut = words if len(words) <= most else words[: most - 1] + "…"
        y = bottom + 16.0 + 14.0 * (number % lines)
        yield svg.text(chart.x(value), y, cut, anchor="middle")
    y = bottom + 22.0 + 14.0 * lines
    yield svg.text(chart.left + 0.5 * chart.width, y, label, anchor="middle")


def _x_ticks(points: Points, chart: svg.Chart) -> Sequence[tuple[float, str]]:
    if points.names:
        every = math.ceil(len(points.names) / 14)
        return [(float(i), n) for i, n in enumerate(points.names) if i % every == 0]
    if points.log:
        return svg.log_ticks(*chart.x_range)
    return [(value, f"{value:g}") for value in svg.ticks(*chart.x_range, 6)]


def _y_range(panels: Sequence[Points]) -> _Range:
    """Return a range in per cent that holds zero and every error."""
    values = np.concatenate([[0.0], *(errors for p in panels for errors in (p.before, p.after))])
    low, high = svg.with_room(np.sort(100.0 * values[np.isfinite(values)]), 0.08, 1.0)
    return min(low, -1.0), max(high, 1.0)


# ------------------------------------------------------------------------------------------------
# Predicted against measured curves of the tests with the largest gap, side by side.


def _curves_figure(traces: Traces) -> bytes:
    """Return the figure as SVG."""
    squares = traces.errors(traces.before_N) ** 2
    errors = np.array([np.mean(squares[rows]) for rows in traces.rows])
    shown = np.argsort(-errors, kind="stable").tolist()[:6]
    title = "The tests with the largest gap" if len(errors) > len(shown) else "Every test"
    panels = [partial(_curves_panel, traces, test) for test in shown]
    parts, width, height = svg.in_rows(panels, 3, (62.0, _TOP), (292.0, 256.0))
    dot = svg.disc(26.0, 48.0, colour=svg.INK, radius=2.5)
    key = [dot, svg.text(36.0, 52.0, "measured", colour=svg.QUIET), *_key(_BEFORE, 112.0)]
    key += _key(_AFTER, 244.0) if np.isfinite(traces.after_N).any() else ()
    size, heading = (max(width + 20.0, 470.0), height + 4.0), f"{title}: predicted and measured"
    return svg.picture(*size, [*key, *parts], title=title, heading=heading)


def _curves_panel(traces: Traces, test: int, left: float, top: float) -> Iterator[str]:
    measured = traces.measured_N[traces.rows[test]]
    before, after = traces.before_N[test], traces.after_N[test]
    steps = np.diff(traces.time_s[test])
    still = steps[_branch_of_steps(traces.travel_mm[test])[1:] == _HOLD]
    held = float(still.sum()) > 0.5 * float(steps.sum())  # for most of the time
    x = (traces.time_s if held else traces.travel_mm)[test]
    force = np.concatenate([before, after, measured.ravel()])
    low, high = min(0.0, float(np.nanmin(force))), max(float(np.nanmax(force)), 0.0)
    room = 0.06 * (high - low) or 1.0
    y_range = (low - room if low < 0.0 else 0.0, high + room)
    across = "time, s" if held else "travel, mm"
    chart = svg.Chart(left, top + 34.0, 220.0, 150.0, (0.0, float(x.max()) or 1.0), y_range)
    for number, words in enumerate(textwrap.wrap(traces.label[test], 36, max_lines=2)):
        yield svg.text(left, top + 8.0 + 14.0 * number, words, size=11.5)
    yield from chart.frame(x_label=across, y_label="", most_ticks=5)
    yield chart.upright(38.0, "force, N")
    readable = chart.axes(across, "force, N")
    for row, curve in zip(traces.rows[test], measured, strict=True):
        places = [(chart.x(x[i]), chart.y(curve[i])) for i in _places(x, curve)]
        dots = [svg.disc(*place, colour=svg.INK, radius=1.7) for place in places]
        words = _error_words(traces.residual_before[row], traces.residual_after[row])
        words = f"measured, {_specimen_words(traces, row)}; {words}"
        yield from svg.told(words, dots, axes=readable)
    for curve, look in ((before, _BEFORE), (after, _AFTER)):
        if np.isfinite(curve).all():
            drawn = chart.line(x, curve, colour=look.colour, width=1.8, dash=look.dash)
            words = f"predicted, {look.of}: {traces.label[test]}"
            yield from svg.told(words, [drawn], axes=readable)


def _places(x: FloatArray, y: FloatArray) -> list[int]:
    """Return some steps that lie apart along the curve, its ends among them."""
    across, up = (np.diff(v) / (np.ptp(v) or 1.0) for v in (x, y))
    along = np.append(0.0, np.cumsum(np.hypot(across, up)))
    wanted = np.linspace(0.0, along[-1], 22)
    return sorted(set(np.searchsorted(along, wanted).clip(max=len(x) - 1).tolist()))


# ------------------------------------------------------------------------------------------------
# The probability of each hypothesis as bars.


def _evidence_figure(diagnosis: Diagnosis) -> bytes:
    """Return the figure as SVG: most probable first, the part that needs an unknown pale."""
    shown = [
        h
        for h in diagnosis.ranking[:8]
        if h.probability >= 0.005 or h.name in ("none", diagnosis.verdict)
    ]
    alike = diagnosis.same_class if len(diagnosis.same_class) > 1 else ()
    bars = []
    for h in shown:
        width = _BARS_WIDTH * min(h.probability, 1.0)
        alone = 0.0 if h.effects == ("unknown",) else 1.0 - min(max(h.with_unknown, 0.0), 1.0)
        plain = width * alone
        name = f"{'● ' if h.effects in alike else ''}{h.name}"
        stretches = ((plain, svg.BLUE), (width - plain, _PALE))
        bars.append(_Bar(name, stretches, probability(h.probability)))
    marks = [(_BARS_WIDTH * share, f"{share:g}") for share in (0.0, 0.25, 0.5, 0.75, 1.0)]
    key = []
    for x, colour, words in ((0.0, svg.BLUE, "by itself"), (92.0, _PALE, _WITH_UNKNOWN)):
        key.append(svg.rectangle(_BARS_LEFT + x, 48.0, 12.0, 12.0, colour=colour))
        key.append(svg.text(_BARS_LEFT + x + 18.0, 58.0, words, colour=svg.QUIET))
    rest = 1.0 - sum(h.probability for h in shown)
    notes = ["● not to be told apart here"] if alike else []
    notes += [f"all others together: {probability(rest)}"] if rest >= 5e-4 else []
    return _bar_figure("How probable each explanation is", bars, marks, key=key, notes=notes)


# ------------------------------------------------------------------------------------------------
# How far the gap closes: errors before and after, beside the floor and the baselines.


def _closure_figure(diagnosis: Diagnosis) -> bytes:
    """Return the figure as SVG: a bar an error, the replicate floor as a dashed line."""
    gap = diagnosis.gap
    colours = {look.of: look.colour for look in (_BEFORE, _AFTER)}
    rows = [
        (words, value, colours.get(words, _BASELINE))
        for words, value in errors_of(diagnosis)
        if words != "scatter between replicates"
    ]
    interval = _after_interval(gap)
    most = max([gap.floor or 0.0, *interval, *(value for _, value, _ in rows)]) or 1.0
    scale = _BARS_WIDTH / (1.12 * most)
    whisker = [scale * end for end in interval]
    bars = [
        _Bar(words, [(scale * x, colour)], percent(x), whisker if colour == svg.BLUE else ())
        for words, x, colour in rows
    ]
    marks = [(scale * tick / 100.0, f"{tick:g} %") for tick in svg.ticks(0.0, 112.0 * most, 6)]
    notes, floor = [f"held out: {gap.held_out}"] if gap.held_out else [], None
    if gap.floor is not None:
        floor = scale * gap.floor
        notes.append(f"dashed: scatter between replicates, {percent(gap.floor)}, as good as can be")
    title = "Error of all specimens, % of the largest force"
    return _bar_figure(title, bars, marks, notes=notes, dashed=floor)


def _after_interval(gap: Gap) -> list[float]:
    """Return the error after that the ends of the closure's interval stand for, if it has any."""
    closed = gap.closed_interval or (math.inf, math.inf)
    if gap.after is None or gap.floor is None or not all(map(math.isfinite, closed)):
        return []
    reach = gap.before - gap.floor
    return sorted(max(0.0, gap.floor + (1.0 - c) * reach) for c in closed)
