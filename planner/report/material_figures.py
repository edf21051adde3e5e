"""Figures of materials: a palette's ladder of stiffness, and what tensile tests show."""

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np

from planner.grading.profile import StiffnessScale
from planner.materials.characterise import Characteristics, Curve, MaterialCharacteristics
from planner.materials.laws import make_law, secant_modulus_MPa
from planner.materials.palette_study import Characterisation
from planner.numerics import FloatArray
from planner.report.svg import (
    BLUE,
    INK,
    PALE_BLUE,
    RUST,
    Chart,
    band,
    cross,
    disc,
    frame,
    in_rows,
    line,
    log_ticks,
    picture,
    ring,
    segment,
    text,
)

__all__ = [
    "characterisation_figure",
    "headroom",
    "materials_figure",
    "specimen_key",
    "specimen_line",
]


_QUIET = "#5c5c5c"
_SMALL, _LETTER, _LINE = 11.0, 6.3, 12.0
"""Size of small words, about the width of their letters, and from line to line; in pixels."""


# ------------------------------------------------------------------------------------------------
# The figure of a palette: its ladder, and each grade's stress to its break.


_LEFT, _TOP, _WIDTH, _HEIGHT = 64.0, 100.0, 520.0, 380.0
_BETWEEN, _MARGIN = 84.0, 24.0

_PLACES = 60
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
    >>> figure = planner.materials_figure(planner.list_materials(at_strain=0.2))  # doctest: +SKIP
    >>> Path("ladder.svg").write_bytes(figure)  # doctest: +SKIP
    """
    second = _LEFT + _WIDTH + _BETWEEN
    return picture(
        second + _WIDTH + _MARGIN,
        _TOP + _HEIGHT + 52.0,
        [*_ladder(scale), *_stresses(scale, second)],
        title=f"{scale.palette.name}: stiffness of its materials",
    )


def _ladder(scale: StiffnessScale) -> Iterator[str]:
    materials, strain = scale.palette.materials, scale.at_strain
    grades = [material.coordinate for material in materials]
    m = scale.model.coordinates_between(_PLACES)
    low, high = scale.model.modulus_interval_MPa(m, strain)
    others = [
        (material.coordinate, float(secant_modulus_MPa(make_law(reading.law), held)))
        for material in materials
        for reading in material.readings
        for held in [min(strain, material.elongation_at_break)]
    ]
    most = max([float(high.max()), *(modulus for _, modulus in others)])
    room = 0.05 * (grades[-1] - grades[0]) or 0.5
    chart = Chart(
        _LEFT,
        _TOP,
        _WIDTH,
        _HEIGHT,
        (grades[0] - room, grades[-1] + room),
        _decades(float(low.min()), most),
    )
    yield band(chart, m, np.log10(low), np.log10(high), colour=PALE_BLUE)
    yield from frame(
        chart,
        x_label="coordinate m of the material",
        y_label=f"secant modulus at strain {strain:g}, MPa",
        y_ticks=log_ticks(*chart.y_range),
    )
    yield line(chart, m, np.log10(scale.model.modulus_MPa(m, strain)), colour=BLUE)
    for coordinate, modulus in others:
        yield ring(chart.x(coordinate), _log_y(chart, modulus), colour=RUST, radius=4.5)
    at = [(chart.x(c), _log_y(chart, v)) for c, v in zip(grades, scale.moduli_MPa, strict=True)]
    for (x, y), ends, material in zip(at, scale.intervals_MPa, materials, strict=True):
        bottom, top = (_log_y(chart, end) for end in ends)
        yield segment((x, bottom), (x, top), colour=BLUE)
        yield disc(x, y, colour=INK, radius=6.0)
        yield disc(x, y, colour=material.colour, radius=4.8)
    # A ladder rises, so that there is room below a grade on its right and above it on its left.
    right = chart.left + chart.width
    names = [material.id for material in materials]
    below = [x + 9.0 + _LETTER * len(name) < right for (x, _), name in zip(at, names, strict=True)]
    placed = [
        (x + 9.0, y + 15.0, "start") if fits else (x - 9.0, y - 9.0, "end")
        for (x, y), fits in zip(at, below, strict=True)
    ]
    yield from _names(names, placed)
    yield from _ladder_key(bool(others))


def _ladder_key(others: bool) -> Iterator[str]:
    y, x = 52.0, _LEFT
    yield disc(x + 6.0, y, colour=INK, radius=6.0)
    yield disc(x + 6.0, y, colour="#ffffff", radius=4.8)
    yield text(x + 18.0, y + 4.0, "material", colour=_QUIET)
    yield segment((x + 82.0, y), (x + 110.0, y), colour=BLUE, width=2.0)
    yield text(x + 116.0, y + 4.0, "between them", colour=_QUIET)
    yield segment((x + 212.0, y), (x + 240.0, y), colour=PALE_BLUE, width=12.0)
    yield text(x + 246.0, y + 4.0, "95 % of prints", colour=_QUIET)
    if others:
        yield ring(x + 348.0, y, colour=RUST, radius=4.5)
        yield text(x + 358.0, y + 4.0, "the same read otherwise", colour=_QUIET)


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
    y_range = _decades(min(stresses), max(stresses))
    chart = Chart(left, _TOP, _WIDTH, _HEIGHT, (0.0, reach), y_range)
    yield from frame(
        chart,
        x_label="strain",
        y_label="nominal stress of each law to its break, MPa",
        y_ticks=log_ticks(*chart.y_range),
    )
    if scale.at_strain < longest:
        x = chart.x(scale.at_strain)
        yield segment((x, _TOP), (x, _TOP + _HEIGHT), colour=_QUIET, width=1.2, dash="5,4")
        yield text(x + 5.0, _TOP + _HEIGHT - 8.0, "working strain", colour=_QUIET, size=_SMALL)
    ends = []
    for material, (strain, stress) in zip(materials, curves, strict=True):
        y = np.log10(stress)
        yield line(chart, strain, y, colour=INK, width=3.2)
        yield line(chart, strain, y, colour=material.colour, width=2.0)
        x_end, y_end = chart.x(float(strain[-1])), chart.y(float(y[-1]))
        yield cross(x_end, y_end, colour=INK, arm=4.0)
        ends.append((x_end + 8.0, y_end + 4.0, "start"))
    yield from _names([material.id for material in materials], ends)


def _names(names: Sequence[str], places: Sequence[tuple[float, float, str]]) -> Iterator[str]:
    """Write names beside marks, from the lowest up; what would cover another moves up."""
    taken = [(x - 15.0, x - 3.0, y) for x, y, anchor in places if anchor == "start"]
    for name, (x, y, anchor) in sorted(
        zip(names, places, strict=True), key=lambda item: -item[1][1]
    ):
        start = x - _LETTER * len(name) if anchor == "end" else x
        stop = start + _LETTER * len(name)
        for left, right, at in sorted(taken, key=lambda box: -box[2]):
            if start < right and left < stop and abs(at - y) < _LINE:
                y = at - _LINE
        taken.append((start, stop, y))
        yield text(x, y, name, anchor=anchor, size=_SMALL)


def _log_y(chart: Chart, value: float) -> float:
    return chart.y(float(np.log10(value)))


def _decades(low: float, high: float) -> tuple[float, float]:
    """Return the logarithms of a range with some room on either side."""
    ends = np.log10([low, high])
    room = 0.05 * float(ends[1] - ends[0]) or 0.5
    return float(ends[0]) - room, float(ends[1]) + room


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
    >>> figure = planner.characterisation_figure(planner.characterise(["tests"]))  # doctest: +SKIP
    >>> Path("tests.svg").write_bytes(figure)  # doctest: +SKIP
    """
    shown = [partial(_tests_panel, one, found.curves[one.material]) for one in found.materials]
    parts, width, height = in_rows(shown, _ACROSS, _CORNER, _CELL)
    return picture(
        max(width, 2.0 * _CELL[0]),
        height - 40.0,
        [*_tests_key(), *parts],
        title="Tensile tests: curves as recorded",
    )


def _tests_key() -> Iterator[str]:
    y = 52.0
    yield segment((20.0, y), (48.0, y), colour=INK, width=1.4, dash="5,4")
    yield text(54.0, y + 4.0, "Young's modulus", colour=_QUIET)
    yield disc(176.0, y, colour=INK)
    yield text(186.0, y + 4.0, "end of the toe", colour=_QUIET)
    yield ring(296.0, y, colour=INK)
    yield text(306.0, y + 4.0, "yield", colour=_QUIET)
    yield cross(366.0, y, colour=INK, arm=4.0)
    yield text(376.0, y + 4.0, "break", colour=_QUIET)


def _tests_panel(
    one: MaterialCharacteristics, curves: Sequence[Curve], left: float, top: float
) -> Iterator[str]:
    longest = max(float(curve.strain[-1]) for curve in curves)
    lowest = min(0.0, *(float(curve.strain[0]) for curve in curves))
    highest = max(float(curve.stress_MPa.max()) for curve in curves)
    chart = Chart(
        left,
        top,
        _PANEL_WIDTH,
        _PANEL_HEIGHT,
        (lowest, 1.05 * longest),
        (0.0, headroom(len(curves), _PANEL_HEIGHT) * highest),
    )
    modulus = one.spreads["modulus_MPa"].mean
    heading = f"{one.material}: {modulus:.3g} MPa, deforms {one.deformation.kind}ally"
    yield text(left - 44.0, top - 32.0, heading, size=13.0)
    yield from frame(
        chart, x_label="strain as recorded", y_label="nominal stress, MPa", most_ticks=6
    )
    for number, curve in enumerate(curves):
        yield specimen_line(chart, number, curve.strain, curve.stress_MPa)
    for number, (specimen, curve) in enumerate(zip(one.specimens, curves, strict=True)):
        yield from _marks(chart, specimen, curve, _SPECIMENS[number % len(_SPECIMENS)])
    yield from specimen_key(chart, [curve.specimen for curve in curves])


def _marks(chart: Chart, specimen: Characteristics, curve: Curve, colour: str) -> Iterator[str]:
    toe, zero = specimen.toe_strain, specimen.toe_strain + specimen.zero_strain
    # To where the eye sees whether it is a tangent: twice the linear part, within the chart.
    end = zero + min(
        2.0 * (specimen.linear_strain[1] - specimen.zero_strain),
        0.8 * specimen.strength_MPa / specimen.modulus_MPa,
    )
    start = max(zero, chart.x_range[0])
    ends = [(x, specimen.modulus_MPa * (x - zero)) for x in (start, end)]
    (x0, y0), (x1, y1) = ((chart.x(x), chart.y(y)) for x, y in ends)
    yield segment((x0, y0), (x1, y1), colour=INK, width=1.1, dash="5,4")
    if toe:
        yield disc(chart.x(toe), chart.y(0.0), colour=colour)
    if specimen.yield_strain is not None:
        at = toe + specimen.yield_strain
        y = float(np.interp(at, curve.strain, curve.stress_MPa))
        yield ring(chart.x(at), chart.y(y), colour=colour)
    yield cross(
        chart.x(float(curve.strain[-1])),
        chart.y(float(curve.stress_MPa[-1])),
        colour=colour,
        arm=4.0,
    )


def specimen_line(chart: Chart, number: int, x: FloatArray, y: FloatArray) -> str:
    """Draw the curve of a material's n-th specimen, at so many points as can be seen."""
    at = np.unique(np.linspace(0, len(x) - 1, _SHOWN_POINTS).round().astype(np.int64))
    colour, dash = _look(number)
    return line(chart, x[at], y[at], colour=colour, width=1.6, dash=dash)


def headroom(specimens: int, height: float) -> float:
    """Return by what an axis exceeds its curves, so that the specimens' names stand above them."""
    return 1.08 + (min(specimens, _SHOWN_NAMES + 1) * _LINE + 6.0) / height


def specimen_key(chart: Chart, names: Sequence[str]) -> Iterator[str]:
    """Name the first specimens at the top left of a chart."""
    x, y = chart.left + 8.0, chart.top + 12.0
    for number, name in enumerate(names[:_SHOWN_NAMES]):
        colour, dash = _look(number)
        at = y + _LINE * number
        yield segment((x, at - 4.0), (x + 20.0, at - 4.0), colour=colour, width=1.6, dash=dash)
        # Names of specimens differ at their ends.
        cut = name if len(name) <= _LETTERS else f"…{name[1 - _LETTERS :]}"
        yield text(x + 26.0, at, cut, size=_SMALL, colour=_QUIET)
    if len(names) > _SHOWN_NAMES:
        more = f"and {len(names) - _SHOWN_NAMES} more"
        yield text(x + 26.0, y + _LINE * _SHOWN_NAMES, more, size=_SMALL, colour=_QUIET)


def _look(number: int) -> tuple[str, str]:
    return _SPECIMENS[number % len(_SPECIMENS)], _DASHES[number // len(_SPECIMENS) % len(_DASHES)]
