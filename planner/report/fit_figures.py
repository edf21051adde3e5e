"""The figure of a fit: tests over their laws, what lies between the materials, and Algorithm 1."""

from collections.abc import Iterator, Sequence
from functools import partial
from itertools import pairwise
from statistics import NormalDist

import numpy as np

from planner.materials.algorithm_one import QuadraticStudy, mixtures_without
from planner.materials.fit_intervals import MaterialFit
from planner.materials.laws import make_law
from planner.materials.mixtures import CoefficientModel
from planner.materials.palette_study import PaletteStudy
from planner.numerics import FloatArray
from planner.palette import Material
from planner.report.material_figures import headroom, specimen_key, specimen_line
from planner.report.svg import (
    GREY,
    INK,
    PALE_BLUE,
    Chart,
    Panel,
    band,
    disc,
    frame,
    in_rows,
    line,
    log_ticks,
    picture,
    ring,
    segment,
    text,
    ticks,
)

__all__ = ["fit_figure"]


# ------------------------------------------------------------------------------------------------
# The whole: panels in rows, under a heading a subject.


_QUADRATIC, _QUIET = "#a6206a", "#5c5c5c"
_WIDTH, _HEIGHT, _ACROSS, _LEFT = 300.0, 200.0, 3, 64.0
_CELL = (384.0, 306.0)
_TOP = 84.0
_STRAINS = 100
_PLACES = 30
_DASH = "7,4"


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
    >>> figure = planner.fit_figure(planner.fit(["samples/tensile"]))  # doctest: +SKIP
    >>> Path("fit.svg").write_bytes(figure)  # doctest: +SKIP
    """
    materials = study.palette.materials
    sections: list[tuple[str, Sequence[Panel], float]] = [
        (
            "Tests, their laws and residuals",
            [partial(_tests, study, material, study.fits[material.id]) for material in materials],
            _CELL[1] + _RESIDUALS,
        )
    ]
    if study.quadratic is not None:
        sections.append(
            (
                "Coefficients of eq. 3.8 over m: rings, with intervals, each material by itself; "
                "dotted, the quadratics through them; dashed, those fitted to all curves",
                [partial(_coefficient, study.quadratic, which) for which in range(6)],
                _CELL[1],
            )
        )
    if study.problem is None and len(materials) > 1:
        model = CoefficientModel(study.palette)
        between = [partial(_mixture, study, model, *two) for two in pairwise(materials)]
        panels = [partial(_ladder, study, model, strain) for strain in _ladder_strains(model)]
        sections.append(("Secant moduli over m", panels, _CELL[1]))
        sections.append(("Mixtures halfway between two materials", between, _CELL[1]))
    left_out = [
        partial(_left_out, study, material, alone)
        for material in materials
        if (alone := mixtures_without(study.palette, material)) is not None
    ]
    if left_out:
        sections.append(("Each material predicted by the others alone", left_out, _CELL[1]))
    parts = list(_key(study))
    top, width = _TOP, 2.0 * _CELL[0]
    for heading, drawn_by, height in sections:
        parts.append(text(20.0, top + 6.0, heading, size=14.0))
        drawn, reach, top = in_rows(drawn_by, _ACROSS, (_LEFT, top + 58.0), (_CELL[0], height))
        parts += drawn
        width = max(width, reach)
    if study.problem is not None:
        parts.append(
            text(20.0, top, "Not fit to plan with: nothing is drawn between all materials.")
        )
        top += 20.0
    title = f"{study.palette.name}: laws fitted to tensile tests"
    return picture(width, top - 20.0, parts, title=title)


def _key(study: PaletteStudy) -> Iterator[str]:
    y = 52.0
    yield segment((20.0, y), (48.0, y), colour=INK, width=2.0)
    yield text(54.0, y + 4.0, "law or mixture", colour=_QUIET)
    yield segment((166.0, y), (194.0, y), colour=PALE_BLUE, width=12.0)
    yield text(200.0, y + 4.0, "95 % of prints", colour=_QUIET)
    yield segment((312.0, y - 6.0), (312.0, y + 6.0), colour=INK, width=2.0)
    level = next(iter(study.fits.values())).uncertainty.level
    yield text(320.0, y + 4.0, f"mean of the specimens, {100 * level:g} %", colour=_QUIET)
    if study.quadratic is not None:
        yield segment((500.0, y), (528.0, y), colour=_QUADRATIC, width=2.0, dash=_DASH)
        yield text(534.0, y + 4.0, "quadratics (Algorithm 1)", colour=_QUIET)


# ------------------------------------------------------------------------------------------------
# A material's tests over its law, and the residuals below.


_RESIDUALS = 92.0
"""What the residuals add to a cell."""

_RESIDUAL_HEIGHT = 64.0


def _tests(
    study: PaletteStudy, material: Material, fit: MaterialFit, left: float, top: float
) -> Iterator[str]:
    law = make_law(material.law)
    longest = max(float(curve.strain[-1]) for curve in fit.curves)
    strain = np.linspace(0.0, max(longest, material.elongation_at_break), _STRAINS)
    stress = law.nominal_stress_MPa(1.0 + strain)
    wide = np.exp(NormalDist().inv_cdf(0.975) * material.modulus_log_sd)
    largest = max(float(curve.stress_MPa.max()) for curve in fit.curves)
    # A law that fits badly has a band that would leave no room for the curves.
    highest = max(largest, float(stress.max())) * headroom(len(fit.curves), _HEIGHT)
    chart = Chart(left, top, _WIDTH, _HEIGHT, (0.0, 1.04 * float(strain[-1])), (0.0, highest))
    r2 = "" if fit.uncertainty.r2 is None else f", R2 {fit.uncertainty.r2:.4f}"
    name = fit.chosen_name
    yield text(left - 44.0, top - 30.0, f"{material.id}: {name}{r2}", size=12.5)
    yield band(chart, strain, stress / wide, np.minimum(stress * wide, highest), colour=PALE_BLUE)
    yield from frame(chart, x_label="", y_label="nominal stress, MPa", most_ticks=6)
    for number, curve in enumerate(fit.curves):
        yield specimen_line(chart, number, curve.strain, curve.stress_MPa)
    yield line(chart, strain, stress, colour=INK, width=2.0)
    for one in fit.secants:
        if one.strain > 0.0 and np.isfinite(one.high_MPa):
            ends = (one.strain * one.low_MPa, min(one.strain * one.high_MPa, highest))
            yield from _whisker(chart.x(one.strain), *(chart.y(end) for end in ends))
    if study.quadratic is not None:
        known = {row.id: row.curve for row in study.quadratic.rows}
        if material.id in known:
            x = np.linspace(*_ends(known[material.id].strain), _STRAINS)
            y = study.quadratic.quadratics.model.literal_stress_MPa(material.coordinate, x)
            yield from _within(chart, x, y)
    yield from specimen_key(chart, [curve.specimen for curve in fit.curves])
    errors = [
        100.0 * (c.stress_MPa - law.nominal_stress_MPa(1.0 + c.strain)) / largest
        for c in fit.curves
    ]
    reach = 1.1 * max(float(np.abs(error).max()) for error in errors) or 1.0
    below = Chart(
        left, top + _HEIGHT + 46.0, _WIDTH, _RESIDUAL_HEIGHT, chart.x_range, (-reach, reach)
    )
    round_end = ticks(0.0, reach, 4)[-1]
    yield from frame(
        below,
        x_label="strain",
        y_label="measured less law, % of the largest stress",
        y_ticks=[(value, f"{value:g}") for value in (-round_end, 0.0, round_end)],
        most_ticks=6,
    )
    zero = below.y(0.0)
    yield segment((left, zero), (left + _WIDTH, zero), colour=GREY, width=1.2)
    for number, (curve, error) in enumerate(zip(fit.curves, errors, strict=True)):
        yield specimen_line(below, number, curve.strain, error)


def _whisker(x: float, low: float, high: float) -> Iterator[str]:
    yield segment((x, low), (x, high), colour=INK, width=2.0)
    for y in (low, high):
        yield segment((x - 4.0, y), (x + 4.0, y), colour=INK, width=2.0)


def _within(chart: Chart, x: FloatArray, y: FloatArray) -> Iterator[str]:
    """Draw the quadratics' line where it lies in the chart; they may leave it far."""
    low, high = chart.y_range
    inside = (y >= low) & (y <= high) & np.isfinite(y)
    edges = np.flatnonzero(np.diff(inside)) + 1
    for run in np.split(np.arange(len(x)), edges):
        if inside[run[0]] and len(run) > 1:
            yield line(chart, x[run], y[run], colour=_QUADRATIC, width=2.0, dash=_DASH)


def _ends(values: FloatArray) -> tuple[float, float]:
    return float(values.min()), float(values.max())


# ------------------------------------------------------------------------------------------------
# Between the materials: moduli over m, mixtures halfway, and Algorithm 1's coefficients over m.


def _ladder_strains(model: CoefficientModel) -> list[float]:
    """Return rest, and about a fifth and three fifths of the working strains."""
    return [0.0, *(float(f"{share * model.strain_limit:.1g}") for share in (0.2, 0.6))]


def _ladder(
    study: PaletteStudy, model: CoefficientModel, strain: float, left: float, top: float
) -> Iterator[str]:
    grades = model.coordinates
    m = model.coordinates_between(_PLACES)
    low, high = model.modulus_interval_MPa(m, strain)
    room = 0.04 * float(grades[-1] - grades[0])
    least, most = np.log10([low.min(), high.max()]).tolist()
    spare = 0.06 * (most - least)
    chart = Chart(
        left, top, _WIDTH, _HEIGHT,
        (float(grades[0]) - room, float(grades[-1]) + room), (least - spare, most + spare),
    )  # fmt: skip
    yield band(chart, m, np.log10(low), np.log10(high), colour=PALE_BLUE)
    where = "at rest" if strain == 0.0 else f"at strain {strain:g}"
    yield from frame(
        chart,
        x_label="coordinate m",
        y_label=f"secant modulus {where}, MPa",
        y_ticks=log_ticks(*chart.y_range),
        most_ticks=6,
    )
    yield line(chart, m, np.log10(model.modulus_MPa(m, strain)), colour=INK, width=2.0)
    if study.quadratic is not None and strain > 0.0:
        of = np.array([row.curve.coordinate for row in study.quadratic.rows])
        x = m[(m >= of[0]) & (m <= of[-1])]
        y = study.quadratic.quadratics.model.literal_stress_MPa(x, strain) / strain
        # What is not above zero has no logarithm, and lies below the chart.
        yield from _within(chart, x, np.log10(np.where(y > 0.0, y, 1e-9)))
    for material, modulus in zip(
        study.palette.materials, model.grade_moduli_MPa(strain).tolist(), strict=True
    ):
        x_at, y_at = chart.x(material.coordinate), chart.y(float(np.log10(modulus)))
        yield disc(x_at, y_at, colour=INK, radius=5.0)
        yield disc(x_at, y_at, colour=material.colour, radius=3.8)


def _mixture(
    study: PaletteStudy,
    model: CoefficientModel,
    softer: Material,
    harder: Material,
    left: float,
    top: float,
) -> Iterator[str]:
    m = 0.5 * (softer.coordinate + harder.coordinate)
    end = min(softer.elongation_at_break, harder.elongation_at_break)
    strain = np.linspace(0.0, end, _STRAINS)
    stress = model.nominal_stress_MPa(m, 1.0 + strain)
    low, high = (strain * ends for ends in model.modulus_interval_MPa(m, strain))
    beside = [make_law(one.law).nominal_stress_MPa(1.0 + strain) for one in (softer, harder)]
    highest = 1.06 * max(float(beside[1].max()), float(high.max()))
    chart = Chart(left, top, _WIDTH, _HEIGHT, (0.0, 1.04 * end), (0.0, highest))
    heading = f"m {m:.4g}: between {softer.id} and {harder.id}"
    yield text(left - 44.0, top - 30.0, heading, size=12.5)
    yield band(chart, strain, low, high, colour=PALE_BLUE)
    yield from frame(chart, x_label="strain", y_label="nominal stress, MPa", most_ticks=6)
    for one, curve in zip((softer, harder), beside, strict=True):
        yield line(chart, strain, curve, colour=INK, width=3.0)
        yield line(chart, strain, curve, colour=one.colour, width=2.0)
    yield line(chart, strain, stress, colour=INK, width=2.0)
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
    strain = np.linspace(0.0, end, _STRAINS)
    stress = model.nominal_stress_MPa(m, 1.0 + strain)
    low, high = (strain * ends for ends in model.modulus_interval_MPa(m, strain))
    largest = max(float(curve.stress_MPa.max()) for curve in fit.curves)
    highest = max(largest, float(stress.max())) * headroom(len(fit.curves), _HEIGHT)
    chart = Chart(left, top, _WIDTH, _HEIGHT, (0.0, 1.04 * end), (0.0, highest))
    yield text(left - 44.0, top - 30.0, f"{material.id}, m {m:.4g}", size=12.5)
    yield band(chart, strain, low, np.minimum(high, highest), colour=PALE_BLUE)
    yield from frame(chart, x_label="strain", y_label="nominal stress, MPa", most_ticks=6)
    for number, curve in enumerate(fit.curves):
        yield specimen_line(chart, number, curve.strain, curve.stress_MPa)
    yield line(chart, strain, stress, colour=INK)
    rows = () if study.quadratic is None else study.quadratic.rows
    for row in rows:
        if row.id == material.id and row.model_without is not None:
            x = np.linspace(*_ends(row.curve.strain), _STRAINS)
            yield from _within(chart, x, row.model_without.literal_stress_MPa(m, x))
    yield from specimen_key(chart, [curve.specimen for curve in fit.curves])


def _coefficient(found: QuadraticStudy, which: int, left: float, top: float) -> Iterator[str]:
    grades = np.array([row.curve.coordinate for row in found.rows])
    own = np.array([row.fit.c[which] for row in found.rows])
    m = np.linspace(grades[0], grades[-1], _STRAINS)
    last = found.quadratics.model.coefficients(m)[:, which]
    through = found.through.coefficients(m)[:, which]
    low, high = _ends(np.concatenate([own, last, through]))
    spare = 0.08 * (high - low) or 1.0
    room = 0.04 * float(grades[-1] - grades[0])
    chart = Chart(
        left, top, _WIDTH, _HEIGHT,
        (float(grades[0]) - room, float(grades[-1]) + room), (low - spare, high + spare),
    )  # fmt: skip
    unit = ", MPa" if which % 2 == 0 else ""
    yield from frame(chart, x_label="coordinate m", y_label=f"c{which + 1}{unit}", most_ticks=6)
    yield line(chart, m, through, colour=GREY, width=1.6, dash="2,3")
    yield line(chart, m, last, colour=_QUADRATIC, dash=_DASH)
    for x, row in zip(grades.tolist(), found.rows, strict=True):
        ends = [row.fit.c[which] + sign * row.fit.half[which] for sign in (-1.0, 1.0)]
        held = [min(max(end, chart.y_range[0]), chart.y_range[1]) for end in ends]
        at = chart.x(x)
        yield segment((at, chart.y(held[0])), (at, chart.y(held[1])), colour=INK, width=1.2)
        yield ring(at, chart.y(row.fit.c[which]), colour=INK)
