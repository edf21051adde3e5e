"""Figures of materials: a palette's ladder, what tensile tests show, and laws fitted to them."""

from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from planner.errors import check_kind
from planner.grading.profile import StiffnessScale
from planner.materials.algorithm_one import QuadraticStudy, mixtures_without
from planner.materials.characterise import Characteristics, Curve, MaterialCharacteristics
from planner.materials.fit import MaterialFit
from planner.materials.laws import make_law, secant_modulus_MPa
from planner.materials.mixtures import CoefficientModel
from planner.materials.palette_study import Characterisation, PaletteStudy
from planner.numerics import FloatArray, normal_quantile
from planner.palette import Material
from planner.report import svg
from planner.report.svg import BLUE, GREY, INK, PALE_BLUE, QUIET, RUST, Chart

__all__ = ["PLACES", "characterisation_figure", "fit_figure", "materials_figure"]


_SMALL, _LETTER, _LINE = 11.0, 6.3, 12.0
"""Size of small words, about the width of their letters, and from line to line; in pixels."""

_KEY_TOP = 52.0


def _key(x: float, words: str, *mark: str) -> Iterator[str]:
    """Say below a figure's heading what a mark in it means, in words that begin at x."""
    yield from mark
    yield svg.text(x, _KEY_TOP + 4.0, words, colour=QUIET)


def _sample(x: float, *, colour: str, width: float = 2.0, dash: str = "") -> str:
    """Draw a short line for a key."""
    start, stop = (x, _KEY_TOP), (x + 28.0, _KEY_TOP)
    return svg.segment(start, stop, colour=colour, width=width, dash=dash)


def _dot(x: float, y: float, *, colour: str, radius: float) -> Iterator[str]:
    """Draw a material: a disc of its colour with a rim."""
    yield svg.disc(x, y, colour=INK, radius=radius)
    yield svg.disc(x, y, colour=colour, radius=radius - 1.2)


# ------------------------------------------------------------------------------------------------
# The figure of a palette: its ladder, and each grade's stress to its break.


_LEFT, _TOP, _WIDTH, _HEIGHT = 64.0, 100.0, 520.0, 380.0
_BETWEEN, _MARGIN = 84.0, 24.0

PLACES = 60
"""Places drawn between two grades."""

_FROM_STRAIN, _STRAINS = 0.01, 200
"""Where the stress begins, which a logarithm needs, and strains drawn."""


def materials_figure(scale: StiffnessScale) -> bytes:
    """Draw a palette's ladder of stiffness with its interval, and each grade's stress to its break.

    Parameters
    ----------
    scale
        What `planner.list_materials` returns.

    Returns
    -------
    bytes
        The figure as SVG.

    Examples
    --------
    >>> from pathlib import Path  # doctest: +SKIP
    >>> figure = planner.materials_figure(planner.list_materials(at_strain=0.2))  # doctest: +SKIP
    >>> Path("ladder.svg").write_bytes(figure)  # doctest: +SKIP
    """
    check_kind(scale, StiffnessScale, "what `planner.list_materials` returns")
    second = _LEFT + _WIDTH + _BETWEEN
    width, height = second + _WIDTH + _MARGIN, _TOP + _HEIGHT + 52.0
    parts = [*_ladder(scale), *_stresses(scale, second)]
    title = f"{scale.palette.name}: stiffness of its materials"
    return svg.picture(width, height, parts, title=title)


def _ladder(scale: StiffnessScale) -> Iterator[str]:
    materials, strain = scale.palette.materials, scale.at_strain
    others = [
        (material.coordinate, float(secant_modulus_MPa(make_law(reading.law), held)))
        for material in materials
        for reading in material.readings
        for held in [min(strain, material.elongation_at_break)]
    ]
    chart, drawn = _moduli(
        scale.model, strain, (_LEFT, _TOP, _WIDTH, _HEIGHT), (0.05, 0.05), PLACES, BLUE,
        most=max((modulus for _, modulus in others), default=0.0),
        x_label="coordinate m of the material", y_label=f"secant modulus at strain {strain:g}, MPa",
    )  # fmt: skip
    yield from drawn
    for coordinate, modulus in others:
        yield svg.ring(chart.x(coordinate), chart.y(modulus), colour=RUST, radius=4.5)
    names = []
    each = zip(materials, scale.moduli_MPa, scale.intervals_MPa, strict=True)
    for material, modulus, ends in each:
        x, y = chart.x(material.coordinate), chart.y(modulus)
        bottom, top = (chart.y(end) for end in ends)
        yield svg.segment((x, bottom), (x, top), colour=BLUE)
        yield from _dot(x, y, colour=material.colour, radius=6.0)
        # A ladder rises, so that there is room below a grade on its right and above on its left.
        fits = x + 9.0 + _LETTER * len(material.id) < chart.left + chart.width
        place = (x + 9.0, y + 15.0, "start") if fits else (x - 9.0, y - 9.0, "end")
        names.append((material.id, *place))
    yield from _names(names)
    yield from _ladder_key(bool(others))


def _ladder_key(others: bool) -> Iterator[str]:
    x = _LEFT
    yield from _key(x + 18.0, "material", *_dot(x + 6.0, _KEY_TOP, colour="#ffffff", radius=6.0))
    yield from _key(x + 116.0, "between them", _sample(x + 82.0, colour=BLUE))
    yield from _key(x + 246.0, "95 % of prints", _sample(x + 212.0, colour=PALE_BLUE, width=12.0))
    if others:
        mark = svg.ring(x + 348.0, _KEY_TOP, colour=RUST, radius=4.5)
        yield from _key(x + 358.0, "the same read otherwise", mark)


def _stresses(scale: StiffnessScale, left: float) -> Iterator[str]:
    """Draw each grade's law to its break, over a logarithm: grades differ by decades."""
    materials = scale.palette.materials
    curves = []
    for material, law in zip(materials, scale.model.laws, strict=True):
        strain = np.linspace(_FROM_STRAIN, material.elongation_at_break, _STRAINS)
        curves.append((strain, law.nominal_stress_MPa(1.0 + strain)))
    longest = max(float(strain[-1]) for strain, _ in curves)
    stresses = [float(v) for _, stress in curves for v in (stress[0], stress[-1])]
    # Names stand behind the ends of the curves.
    letters = max(len(material.id) for material in materials)
    reach = longest / (1.0 - (_LETTER * letters + 14.0) / _WIDTH)
    y_range = svg.with_room(np.log10([min(stresses), max(stresses)]), 0.05)
    chart = Chart(left, _TOP, _WIDTH, _HEIGHT, (0.0, reach), y_range, y_log=True)
    label = "nominal stress of each law to its break, MPa"
    yield from chart.frame(x_label="strain", y_label=label)
    if scale.at_strain < longest:
        x = chart.x(scale.at_strain)
        yield svg.segment((x, _TOP), (x, _TOP + _HEIGHT), colour=QUIET, width=1.2, dash="5,4")
        yield svg.text(x + 5.0, _TOP + _HEIGHT - 8.0, "working strain", colour=QUIET, size=_SMALL)
    names = []
    for material, (strain, stress) in zip(materials, curves, strict=True):
        yield chart.line(strain, stress, colour=INK, width=3.2)
        yield chart.line(strain, stress, colour=material.colour, width=2.0)
        x_end, y_end = chart.x(float(strain[-1])), chart.y(float(stress[-1]))
        yield svg.cross(x_end, y_end, colour=INK, arm=4.0)
        names.append((material.id, x_end + 8.0, y_end + 4.0, "start"))
    yield from _names(names)


def _names(names: Sequence[tuple[str, float, float, str]]) -> Iterator[str]:
    """Write names at places beside marks, from the lowest up; what would cover another moves up."""
    taken = [(x - 15.0, x - 3.0, y) for _, x, y, anchor in names if anchor == "start"]
    for name, x, y, anchor in sorted(names, key=lambda placed: -placed[2]):
        start = x - _LETTER * len(name) if anchor == "end" else x
        stop = start + _LETTER * len(name)
        for left, right, at in sorted(taken, key=lambda box: -box[2]):
            if start < right and left < stop and abs(at - y) < _LINE:
                y = at - _LINE
        taken.append((start, stop, y))
        yield svg.text(x, y, name, anchor=anchor, size=_SMALL)


def _moduli(
    model: CoefficientModel, strain: float, box: tuple[float, float, float, float],
    room: tuple[float, float], places: int, colour: str, *, most: float = 0.0, **labels: Any,
) -> tuple[Chart, list[str]]:  # fmt: skip
    """Return a chart of secant moduli over the coordinate, and what is drawn: line and interval.

    Parameters
    ----------
    room
        Share of both axes beyond what is drawn, on either side.
    places
        Drawn between two grades.
    most
        A modulus that has room too.
    """
    grades, m = model.coordinates, model.coordinates_between(places)
    low, high = model.modulus_interval_MPa(m, strain)
    ends = np.log10([low.min(), max(most, high.max())])
    x_range, y_range = svg.with_room(grades, room[0]), svg.with_room(ends, room[1])
    chart = Chart(*box, x_range, y_range, y_log=True)
    line = chart.line(m, model.modulus_MPa(m, strain), colour=colour)
    return chart, [chart.band(m, low, high), *chart.frame(**labels), line]


# ------------------------------------------------------------------------------------------------
# The figure of tensile tests: every specimen's curve with its toe, modulus, yield and break.


_PANEL_WIDTH, _PANEL_HEIGHT, _ACROSS = 300.0, 210.0, 3
_CELL = (384.0, 316.0)
_CORNER = (64.0, 120.0)

# Okabe and Ito's colours, told apart by the colour-blind; then the same, dashed.
_SPECIMENS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
_DASHES = ("", "7,3", "2,3")

_SHOWN_NAMES = 6
_SHOWN_POINTS = 200
_LETTERS = 22
"""Letters of a specimen's name that have room beside the curves."""


def characterisation_figure(found: Characterisation) -> bytes:
    """Draw every specimen's curve, with its toe, Young's modulus, yield and break.

    Parameters
    ----------
    found
        What `planner.characterise` returns.

    Returns
    -------
    bytes
        The figure as SVG.

    Examples
    --------
    >>> from pathlib import Path  # doctest: +SKIP
    >>> figure = planner.characterisation_figure(planner.characterise(["tests"]))  # doctest: +SKIP
    >>> Path("tests.svg").write_bytes(figure)  # doctest: +SKIP
    """
    check_kind(found, Characterisation, "what `planner.characterise` returns")
    shown = [partial(_tests_panel, one, found.curves[one.material]) for one in found.materials]
    parts, width, height = svg.in_rows(shown, _ACROSS, _CORNER, _CELL)
    size = (max(width, 2.0 * _CELL[0]), height - 40.0)
    title = "Tensile tests: curves as recorded"
    return svg.picture(*size, [*_tests_key(), *parts], title=title)


def _tests_key() -> Iterator[str]:
    yield from _key(54.0, "Young's modulus", _sample(20.0, colour=INK, width=1.4, dash="5,4"))
    yield from _key(186.0, "end of the toe", svg.disc(176.0, _KEY_TOP, colour=INK))
    yield from _key(306.0, "yield", svg.ring(296.0, _KEY_TOP, colour=INK))
    yield from _key(376.0, "break", svg.cross(366.0, _KEY_TOP, colour=INK, arm=4.0))


def _tests_panel(
    one: MaterialCharacteristics, curves: Sequence[Curve], left: float, top: float
) -> Iterator[str]:
    longest = max(float(curve.strain[-1]) for curve in curves)
    lowest = min(0.0, *(float(curve.strain[0]) for curve in curves))
    highest = max(float(curve.stress_MPa.max()) for curve in curves)
    y_range = (0.0, _headroom(len(curves), _PANEL_HEIGHT) * highest)
    chart = Chart(left, top, _PANEL_WIDTH, _PANEL_HEIGHT, (lowest, 1.05 * longest), y_range)
    modulus = one.spreads["modulus_MPa"].mean
    heading = f"{one.material}: {modulus:.3g} MPa, deforms {one.deformation.kind}ally"
    yield svg.text(left - 44.0, top - 32.0, heading, size=13.0)
    yield from chart.frame(
        x_label="strain as recorded", y_label="nominal stress, MPa", most_ticks=6
    )
    yield from _specimen_lines(chart, ((curve.strain, curve.stress_MPa) for curve in curves))
    for number, (specimen, curve) in enumerate(zip(one.specimens, curves, strict=True)):
        yield from _marks(chart, specimen, curve, _SPECIMENS[number % len(_SPECIMENS)])
    yield from _specimen_key(chart, [curve.specimen for curve in curves])


def _marks(chart: Chart, specimen: Characteristics, curve: Curve, colour: str) -> Iterator[str]:
    toe, zero = specimen.toe_strain, specimen.toe_strain + specimen.zero_strain
    # To where the eye sees whether it is a tangent: twice the linear part, within the chart.
    linear = 2.0 * (specimen.linear_strain[1] - specimen.zero_strain)
    end = zero + min(linear, 0.8 * specimen.strength_MPa / specimen.modulus_MPa)
    ends = (max(zero, chart.x_range[0]), end)
    start, stop = ((chart.x(x), chart.y(specimen.modulus_MPa * (x - zero))) for x in ends)
    yield svg.segment(start, stop, colour=INK, width=1.1, dash="5,4")
    if toe:
        yield svg.disc(chart.x(toe), chart.y(0.0), colour=colour)
    if specimen.yield_strain is not None:
        at = toe + specimen.yield_strain
        y = float(np.interp(at, curve.strain, curve.stress_MPa))
        yield svg.ring(chart.x(at), chart.y(y), colour=colour)
    broken = chart.x(float(curve.strain[-1])), chart.y(float(curve.stress_MPa[-1]))
    yield svg.cross(*broken, colour=colour, arm=4.0)


def _specimen_lines(chart: Chart, curves: Iterable[tuple[FloatArray, FloatArray]]) -> Iterator[str]:
    """Draw a material's specimens, each at so many points as can be seen."""
    for number, (x, y) in enumerate(curves):
        at = np.unique(np.linspace(0, len(x) - 1, _SHOWN_POINTS).round().astype(np.int64))
        colour, dash = _look(number)
        yield chart.line(x[at], y[at], colour=colour, width=1.6, dash=dash)


def _headroom(specimens: int, height: float) -> float:
    """Return by what an axis exceeds its curves, so that the specimens' names stand above them."""
    return 1.08 + (min(specimens, _SHOWN_NAMES + 1) * _LINE + 6.0) / height


def _specimen_key(chart: Chart, names: Sequence[str]) -> Iterator[str]:
    """Name the first specimens at the top left of a chart."""
    x, y = chart.left + 8.0, chart.top + 12.0
    for number, name in enumerate(names[:_SHOWN_NAMES]):
        colour, dash = _look(number)
        at = y + _LINE * number
        yield svg.segment((x, at - 4.0), (x + 20.0, at - 4.0), colour=colour, width=1.6, dash=dash)
        # Names of specimens differ at their ends.
        cut = name if len(name) <= _LETTERS else f"…{name[1 - _LETTERS :]}"
        yield svg.text(x + 26.0, at, cut, size=_SMALL, colour=QUIET)
    if len(names) > _SHOWN_NAMES:
        more = f"and {len(names) - _SHOWN_NAMES} more"
        yield svg.text(x + 26.0, y + _LINE * _SHOWN_NAMES, more, size=_SMALL, colour=QUIET)


def _look(number: int) -> tuple[str, str]:
    return _SPECIMENS[number % len(_SPECIMENS)], _DASHES[number // len(_SPECIMENS) % len(_DASHES)]


# ------------------------------------------------------------------------------------------------
# The figure of a fit: tests over their laws, what lies between the materials, and Algorithm 1.


_QUADRATIC, _DASH = "#a6206a", "7,4"
_FIT_HEIGHT, _FIT_TOP = 200.0, 84.0
_FIT_CELL = (384.0, 306.0)
_CURVE_POINTS, _MIXTURES = 100, 30


def fit_figure(study: PaletteStudy) -> bytes:
    """Draw tests over the laws fitted to them with bands and residuals, and what lies between.

    Between the materials: their secant moduli over m, the mixtures halfway between neighbours, and
    what the other materials alone say of each.
    Where `planner.fit` ran Algorithm 1 too, its coefficients and predictions are drawn beside.

    Parameters
    ----------
    study
        What `planner.fit` returns.

    Returns
    -------
    bytes
        The figure as SVG.

    Examples
    --------
    >>> from pathlib import Path  # doctest: +SKIP
    >>> figure = planner.fit_figure(planner.fit(["samples/tensile"]))  # doctest: +SKIP
    >>> Path("fit.svg").write_bytes(figure)  # doctest: +SKIP
    """
    check_kind(study, PaletteStudy, "what `planner.fit` returns")
    materials = study.palette.materials
    tests = [partial(_tests, study, material, study.fits[material.id]) for material in materials]
    sections = [("Tests, their laws and residuals", tests, _FIT_CELL[1] + _RESIDUALS)]
    if study.quadratic is not None:
        words = (
            "Coefficients of eq. 3.8 over m: rings, with intervals, each material by itself; "
            "dotted, the quadratics through them; dashed, those fitted to all curves"
        )
        panels = [partial(_coefficient, study.quadratic, which) for which in range(6)]
        sections.append((words, panels, _FIT_CELL[1]))
    if study.problem is None and len(materials) > 1:
        model = CoefficientModel(study.palette)
        between = [partial(_mixture, study, model, *two) for two in pairwise(materials)]
        # Rest, and about a fifth and three fifths of the working strains.
        strains = [float(f"{share * model.strain_limit:.1g}") for share in (0.0, 0.2, 0.6)]
        panels = [partial(_fit_ladder, study, model, strain) for strain in strains]
        sections.append(("Secant moduli over m", panels, _FIT_CELL[1]))
        sections.append(("Mixtures halfway between two materials", between, _FIT_CELL[1]))
    left_out = [
        partial(_left_out, study, material, alone)
        for material in materials
        if not study.fits[material.id].compressed
        if (alone := mixtures_without(study.palette, material)) is not None
    ]
    if left_out:
        sections.append(("Each material predicted by the others alone", left_out, _FIT_CELL[1]))
    parts = list(_fit_key(study))
    top, width = _FIT_TOP, 2.0 * _FIT_CELL[0]
    for heading, drawn_by, height in sections:
        parts.append(svg.text(20.0, top + 6.0, heading, size=14.0))
        corner, cell = (_LEFT, top + 58.0), (_FIT_CELL[0], height)
        drawn, reach, top = svg.in_rows(drawn_by, _ACROSS, corner, cell)
        parts += drawn
        width = max(width, reach)
    if study.problem is not None:
        words = "Not fit to plan with: nothing is drawn between all materials."
        parts.append(svg.text(20.0, top, words))
        top += 20.0
    title = f"{study.palette.name}: laws fitted to tensile tests"
    return svg.picture(width, top - 20.0, parts, title=title)


def _fit_key(study: PaletteStudy) -> Iterator[str]:
    yield from _key(54.0, "law or mixture", _sample(20.0, colour=INK))
    yield from _key(200.0, "95 % of prints", _sample(166.0, colour=PALE_BLUE, width=12.0))
    level = next(iter(study.fits.values())).uncertainty.level
    ends = (312.0, _KEY_TOP - 6.0), (312.0, _KEY_TOP + 6.0)
    mark = svg.segment(*ends, colour=INK, width=2.0)
    yield from _key(320.0, f"mean of the specimens, {100 * level:g} %", mark)
    if study.quadratic is not None:
        mark = _sample(500.0, colour=_QUADRATIC, dash=_DASH)
        yield from _key(534.0, "quadratics (Algorithm 1)", mark)


# ------------------------------------------------------------------------------------------------
# A material's tests over its law, and the residuals below.


_RESIDUALS = 92.0
"""What the residuals add to a cell."""

_RESIDUAL_HEIGHT = 64.0


def _tests(
    study: PaletteStudy, material: Material, fit: MaterialFit, left: float, top: float
) -> Iterator[str]:
    longest = max(float(curve.strain[-1]) for curve in fit.curves)
    strain = np.linspace(0.0, max(longest, material.elongation_at_break), _CURVE_POINTS)
    stress = fit.stress_MPa(strain)
    wide = np.exp(normal_quantile() * material.modulus_log_sd)
    largest = max(float(curve.stress_MPa.max()) for curve in fit.curves)
    # A law that fits badly has a band that would leave no room for the curves.
    highest = max(largest, float(stress.max())) * _headroom(len(fit.curves), _FIT_HEIGHT)
    chart = _fit_chart(left, top, float(strain[-1]), highest)
    r2 = "" if fit.uncertainty.r2 is None else f", R2 {fit.uncertainty.r2:.4f}"
    heading = f"{material.id}: {fit.chosen_name}{r2}{', compression' * fit.compressed}"
    predicted = _Predicted(strain, stress, stress / wide, stress * wide)
    yield from _prints_and_tests(chart, heading, predicted, fit.curves, "")
    for one in () if fit.compressed else fit.secants:
        if one.strain > 0.0 and np.isfinite(one.high_MPa):
            ends = (one.strain * one.low_MPa, min(one.strain * one.high_MPa, highest))
            yield from _whisker(chart.x(one.strain), *(chart.y(end) for end in ends))
    if study.quadratic is not None:
        known = {row.id: row.curve for row in study.quadratic.rows}
        if material.id in known:
            x = np.linspace(*_ends(known[material.id].strain), _CURVE_POINTS)
            y = study.quadratic.quadratics.model.literal_stress_MPa(material.coordinate, x)
            yield from _within(chart, x, y)
    yield from _specimen_key(chart, [curve.specimen for curve in fit.curves])
    off = [c.stress_MPa - fit.stress_MPa(c.strain) for c in fit.curves]
    errors = [100.0 * each / largest for each in off]
    reach = 1.1 * max(float(np.abs(error).max()) for error in errors) or 1.0
    foot = top + _FIT_HEIGHT + 46.0
    below = Chart(left, foot, _PANEL_WIDTH, _RESIDUAL_HEIGHT, chart.x_range, (-reach, reach))
    round_end = svg.ticks(0.0, reach, 4)[-1]
    marks = [(value, f"{value:g}") for value in (-round_end, 0.0, round_end)]
    label = "measured less law, % of the largest stress"
    yield from below.frame(x_label="strain", y_label=label, y_ticks=marks, most_ticks=6)
    zero = below.y(0.0)
    yield svg.segment((left, zero), (left + _PANEL_WIDTH, zero), colour=GREY, width=1.2)
    strains = [curve.strain for curve in fit.curves]
    yield from _specimen_lines(below, zip(strains, errors, strict=True))


def _fit_chart(left: float, top: float, end: float, highest: float) -> Chart:
    return Chart(left, top, _PANEL_WIDTH, _FIT_HEIGHT, (0.0, 1.04 * end), (0.0, highest))


class _Predicted(NamedTuple):
    """A law's or a mixture's stress at strains, and what 95 % of prints have."""

    strain: FloatArray
    stress: FloatArray
    low: FloatArray
    high: FloatArray


def _mixture_at(model: CoefficientModel, m: float, end: float) -> _Predicted:
    """Return what stands at a coordinate up to a strain."""
    strain = np.linspace(0.0, end, _CURVE_POINTS)
    low, high = (strain * ends for ends in model.modulus_interval_MPa(m, strain))
    return _Predicted(strain, model.nominal_stress_MPa(m, 1.0 + strain), low, high)


def _prints(chart: Chart, heading: str, predicted: _Predicted, x_label: str) -> Iterator[str]:
    """Draw the band of prints under a heading."""
    strain, _, low, high = predicted
    yield svg.text(chart.left - 44.0, chart.top - 30.0, heading, size=12.5)
    yield chart.band(strain, low, np.minimum(high, chart.y_range[1]))
    yield from chart.frame(x_label=x_label, y_label="nominal stress, MPa", most_ticks=6)


def _prints_and_tests(
    chart: Chart, heading: str, predicted: _Predicted, curves: Sequence[Curve], x_label: str
) -> Iterator[str]:
    """Draw the band of prints, tests over it, and what is predicted over both."""
    yield from _prints(chart, heading, predicted, x_label)
    yield from _specimen_lines(chart, ((curve.strain, curve.stress_MPa) for curve in curves))
    yield chart.line(predicted.strain, predicted.stress, colour=INK)


def _whisker(x: float, low: float, high: float) -> Iterator[str]:
    yield svg.segment((x, low), (x, high), colour=INK, width=2.0)
    for y in (low, high):
        yield svg.segment((x - 4.0, y), (x + 4.0, y), colour=INK, width=2.0)


def _within(chart: Chart, x: FloatArray, y: FloatArray) -> Iterator[str]:
    """Draw the quadratics' line where it lies in the chart; they may leave it far."""
    low, high = np.power(10.0, chart.y_range) if chart.y_log else chart.y_range
    inside = (y >= low) & (y <= high) & np.isfinite(y)
    for run in np.split(np.arange(len(x)), np.flatnonzero(np.diff(inside)) + 1):
        if inside[run[0]] and len(run) > 1:
            yield chart.line(x[run], y[run], colour=_QUADRATIC, width=2.0, dash=_DASH)


def _ends(values: FloatArray) -> tuple[float, float]:
    return float(values.min()), float(values.max())


# ------------------------------------------------------------------------------------------------
# Between the materials: moduli over m, mixtures halfway, and Algorithm 1's coefficients over m.


def _fit_ladder(
    study: PaletteStudy, model: CoefficientModel, strain: float, left: float, top: float
) -> Iterator[str]:
    where = "at rest" if strain == 0.0 else f"at strain {strain:g}"
    chart, drawn = _moduli(
        model, strain, (left, top, _PANEL_WIDTH, _FIT_HEIGHT), (0.04, 0.06), _MIXTURES, INK,
        x_label="coordinate m", y_label=f"secant modulus {where}, MPa", most_ticks=6,
    )  # fmt: skip
    yield from drawn
    if study.quadratic is not None and strain > 0.0:
        of = np.array([row.curve.coordinate for row in study.quadratic.rows])
        m = model.coordinates_between(_MIXTURES)
        x = m[(m >= of[0]) & (m <= of[-1])]
        y = study.quadratic.quadratics.model.literal_stress_MPa(x, strain) / strain
        yield from _within(chart, x, y)
    moduli = model.grade_moduli_MPa(strain).tolist()
    for material, modulus in zip(study.palette.materials, moduli, strict=True):
        x_at, y_at = chart.x(material.coordinate), chart.y(modulus)
        yield from _dot(x_at, y_at, colour=material.colour, radius=5.0)


def _mixture(
    study: PaletteStudy, model: CoefficientModel, softer: Material, harder: Material, left: float,
    top: float,
) -> Iterator[str]:  # fmt: skip
    m = 0.5 * (softer.coordinate + harder.coordinate)
    end = min(softer.elongation_at_break, harder.elongation_at_break)
    predicted = _mixture_at(model, m, end)
    strain = predicted.strain
    beside = [make_law(one.law).nominal_stress_MPa(1.0 + strain) for one in (softer, harder)]
    highest = 1.06 * max(float(beside[1].max()), float(predicted.high.max()))
    chart = _fit_chart(left, top, end, highest)
    heading = f"m {m:.4g}: between {softer.id} and {harder.id}"
    yield from _prints(chart, heading, predicted, "strain")
    for one, curve in zip((softer, harder), beside, strict=True):
        yield chart.line(strain, curve, colour=INK, width=3.0)
        yield chart.line(strain, curve, colour=one.colour, width=2.0)
    yield chart.line(strain, predicted.stress, colour=INK)
    if study.quadratic is not None:
        rows = study.quadratic.rows
        if rows[0].curve.coordinate <= m <= rows[-1].curve.coordinate:
            x = strain[1:]
            yield from _within(chart, x, study.quadratic.quadratics.model.literal_stress_MPa(m, x))


def _left_out(
    study: PaletteStudy, material: Material, model: CoefficientModel, left: float, top: float
) -> Iterator[str]:
    fit, m = study.fits[material.id], material.coordinate
    end = max(float(curve.strain[-1]) for curve in fit.curves)
    predicted = _mixture_at(model, m, end)
    largest = max(float(curve.stress_MPa.max()) for curve in fit.curves)
    highest = max(largest, float(predicted.stress.max())) * _headroom(len(fit.curves), _FIT_HEIGHT)
    chart = _fit_chart(left, top, end, highest)
    heading = f"{material.id}, m {m:.4g}"
    yield from _prints_and_tests(chart, heading, predicted, fit.curves, "strain")
    for row in () if study.quadratic is None else study.quadratic.rows:
        if row.id == material.id and row.model_without is not None:
            x = np.linspace(*_ends(row.curve.strain), _CURVE_POINTS)
            yield from _within(chart, x, row.model_without.literal_stress_MPa(m, x))
    yield from _specimen_key(chart, [curve.specimen for curve in fit.curves])


def _coefficient(found: QuadraticStudy, which: int, left: float, top: float) -> Iterator[str]:
    grades = np.array([row.curve.coordinate for row in found.rows])
    own = np.array([row.fit.c[which] for row in found.rows])
    m = np.linspace(grades[0], grades[-1], _CURVE_POINTS)
    last = found.quadratics.model.coefficients(m)[:, which]
    through = found.through.coefficients(m)[:, which]
    y_range = svg.with_room(_ends(np.concatenate([own, last, through])), 0.08, 1.0)
    chart = Chart(left, top, _PANEL_WIDTH, _FIT_HEIGHT, svg.with_room(grades, 0.04), y_range)
    unit = ", MPa" if which % 2 == 0 else ""
    yield from chart.frame(x_label="coordinate m", y_label=f"c{which + 1}{unit}", most_ticks=6)
    yield chart.line(m, through, colour=GREY, width=1.6, dash="2,3")
    yield chart.line(m, last, colour=_QUADRATIC, dash=_DASH)
    for x, row in zip(grades.tolist(), found.rows, strict=True):
        ends = [row.fit.c[which] + sign * row.fit.half[which] for sign in (-1.0, 1.0)]
        held = [min(max(end, chart.y_range[0]), chart.y_range[1]) for end in ends]
        at = chart.x(x)
        yield svg.segment((at, chart.y(held[0])), (at, chart.y(held[1])), colour=INK, width=1.2)
        yield svg.ring(at, chart.y(row.fit.c[which]), colour=INK)
