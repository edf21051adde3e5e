"""Draw the figures and rewrite the tables of thesis-reproduced.md; needs matplotlib.

python docs/explanation/thesis_reproduced.py [PNG FOLDER]
"""

import math
import sys
from functools import cache
from pathlib import Path
from statistics import NormalDist, fmean
from typing import Any

import numpy as np
from thesis_numbers import FOLDER, MODEL, PALETTE, THESIS, area_MJ_m3, with_tables

from planner.materials.algorithm_one import (
    LiteralCurve,
    QuadraticCoefficients,
    QuadraticFit,
    algorithm_one,
    individual_fit,
    literal_stress_MPa,
    normalised_rmse,
    quadratics_through,
    r_squared,
    without,
)
from planner.materials.mixtures import pchip_slopes, pchip_weights
from planner.numerics import FloatArray
from planner.palette import LawParameters
from printers.connex3.derive import SPECIMEN_LOG_SD
from printers.connex3.leave_one_out import HeldOut, held_out, published_curve
from printers.connex3.toe import correct

FIGURES = ("thesis-figure-3-1", "thesis-figure-3-2", "thesis-figure-4-1")
PRINTED = QuadraticCoefficients(THESIS.quadratics)
ELASTOMERS = THESIS.elastomers
INTERIOR = ELASTOMERS[1:-1]
CURVES = [published_curve(THESIS, p) for p in ELASTOMERS]
TOE_OFF = [published_curve(THESIS, p, toe_off=True) for p in ELASTOMERS]
THROUGH = quadratics_through([c.coordinate for c in CURVES], [p.c for p in ELASTOMERS])
BOTH_STRAINS = "crosshead strain (literal), strain with the toe taken off (consistent)"
SPECIMENS = 3
"""Of each mixture: "tensile testing was done in triplicate" (section 3.0.2)."""
LITERAL, CONSISTENT, HELD = "#C2410C", "#1D4ED8", "#0F766E"


@cache
def fitted() -> QuadraticFit:
    """Algorithm 1 as the thesis starts it, from the quadratics through Table 3.2."""
    return algorithm_one(CURVES, THROUGH)


@cache
def held_out_rows() -> tuple[HeldOut, ...]:
    """Both models' errors for the interior elastomers."""
    return tuple(held_out(THESIS, PALETTE, p) for p in INTERIOR)


def stress(quadratics: QuadraticCoefficients, curve: LiteralCurve) -> FloatArray:
    """Stress of a literal coefficient model along a curve."""
    return quadratics.literal_stress_MPa(curve.coordinate, curve.strain)


def law_area_MJ_m3(place: int) -> float:
    """Area under a grade's consistent law to the printed elongation."""
    strain = np.linspace(0.0, THESIS.materials[place].elongation_at_break, 20001)
    return float(np.trapezoid(MODEL.laws[place].nominal_stress_MPa(1.0 + strain), strain))


def table_3_1() -> list[list[str]]:
    """Set printed characteristics beside recomputed ones."""
    rows = [
        ["grade", "E printed", "E law", "U printed", "U curve", "U law", "ε printed", "less toe"]
    ]
    for place, (published, law) in enumerate(zip(THESIS.materials, MODEL.laws, strict=True)):
        elongation = published.elongation_at_break
        rows.append(
            [
                published.id,
                f"{published.youngs_modulus_MPa:.4f}",
                f"{float(law.tangent_MPa(1.0)):.3g}",
                f"{published.toughness_MJ_m3:.4f}",
                f"{area_MJ_m3(published):.4f}" if published.c else "",
                f"{law_area_MJ_m3(place):.4f}",
                f"{100 * elongation:.0f} %",
                f"{100 * (elongation - correct(published).toe):.1f} %" if published.c else "",
            ]
        )
    return rows


def table_3_2() -> list[list[str]]:
    """Set the consistent law's coefficients beside the printed ones."""
    rows = [["grade", *(f"c{j}" for j in range(1, 7)), "law", "nRMSE"]]
    for place, (published, curve) in enumerate(zip(ELASTOMERS, TOE_OFF, strict=True)):
        predicted = MODEL.laws[place].nominal_stress_MPa(1.0 + curve.strain)
        rows.append(
            [
                published.id,
                *(f"{c:.4f}" for c in published.c),
                law_in_words(PALETTE.materials[place].law),
                f"{100 * normalised_rmse(curve.stress_MPa, predicted):.2f} %",
            ]
        )
    return rows


def law_in_words(law: LawParameters) -> str:
    """Write a law's parameters as the palette has them."""
    lists = (f"{k} {', '.join(f'{v:.4g}' for v in values)}" for k, values in law.parameters.items())
    return f"{law.model}: {'; '.join(lists)}"


def table_4_1() -> list[list[str]]:
    """R² against the regenerated curves; that of the individual fits is not known."""
    head = ["grade", "individual fit", "printed quadratics", "Algorithm 1, run here"]
    rows = [[*head, "consistent law", "consistent model without the grade"]]
    for place, published in enumerate(ELASTOMERS):
        curve, toe_off = CURVES[place], TOE_OFF[place]
        law = MODEL.laws[place].nominal_stress_MPa(1.0 + toe_off.strain)
        apart = ""
        if place > 0:
            model = without(PALETTE, published.id)
            predicted = model.nominal_stress_MPa(curve.coordinate, 1.0 + toe_off.strain)
            apart = f"{r_squared(curve.stress_MPa, predicted):.3f}"
        rows.append(
            [
                published.id,
                "not known",
                f"{r_squared(curve.stress_MPa, stress(PRINTED, curve)):.3f}",
                f"{r_squared(curve.stress_MPa, stress(fitted().model, curve)):.3f}",
                f"{r_squared(curve.stress_MPa, law):.4f}",
                apart,
            ]
        )
    return rows


@cache
def searches() -> dict[str, tuple[QuadraticCoefficients, int]]:
    """Every way of Algorithm 1 that is compared, with its number of evaluations."""
    again = algorithm_one(CURVES, PRINTED)
    five, evaluations = fitted(), fitted().evaluations
    for _ in range(4):
        five = algorithm_one(CURVES, five.model)
        evaluations += five.evaluations
    own = quadratics_through([c.coordinate for c in CURVES], [individual_fit(c).c for c in CURVES])
    whole = algorithm_one(CURVES, own)
    return {
        "quadratics through Table 3.2 (lines 4, 5)": (THROUGH, 0),
        "printed in section 3.0.5": (PRINTED, 0),
        "Algorithm 1: fminsearch from line 5": (fitted().model, fitted().evaluations),
        "the same, started five times over": (five.model, evaluations),
        "fminsearch from the printed ones": (again.model, again.evaluations),
        "all seven lines, from the curves": (whole.model, whole.evaluations),
    }


def table_algorithm() -> list[list[str]]:
    """Pooled errors, and how near the printed quadratics' curves each comes."""
    rows = [["quadratics", "evaluations", "pooled error, MPa²", "RMS apart from printed, MPa"]]
    count = sum(len(curve.strain) for curve in CURVES)
    for name, (model, evaluations) in searches().items():
        apart = sum(float(np.sum((stress(model, c) - stress(PRINTED, c)) ** 2)) for c in CURVES)
        pooled = sum(float(np.sum((stress(model, c) - c.stress_MPa) ** 2)) for c in CURVES)
        rows.append(
            [
                name,
                str(evaluations),
                f"{pooled:.1f}",
                f"{(apart / count) ** 0.5:.3f}",
            ]
        )
    return rows


def table_held_out() -> list[list[str]]:
    """Leave one grade out: normalised RMSE of the whole curve."""
    head = ["literal", "straight", "over m", "over hardness"]
    rows = [
        [
            "grade",
            *(f"{name}, crosshead" for name in head),
            *(f"{name}, toe off" for name in head),
            "scatter alone",
        ]
    ]
    columns = (
        *("literal", "straight_crosshead", "even_crosshead", "consistent_crosshead"),
        *("literal_toe_off", "straight", "even", "consistent"),
    )
    figures = [[getattr(row, c) for c in columns] for row in held_out_rows()]
    for k, (row, of) in enumerate(zip(held_out_rows(), figures, strict=True), start=1):
        of.append(scatter_alone(k))
        rows.append([row.id, *(f"{v:.3f}" for v in of)])
    rows.append(["mean", *(f"{fmean(c):.3f}" for c in zip(*figures, strict=True))])
    last, curve = ELASTOMERS[-1], TOE_OFF[-1]
    predicted = without(PALETTE, last.id).nominal_stress_MPa(curve.coordinate, 1.0 + curve.strain)
    error = normalised_rmse(curve.stress_MPa, predicted)
    rows.append([last.id, *[""] * (len(columns) - 1), f"{error:.3f}", ""])
    return rows


def scatter_alone(place: int) -> float:
    """Error to expect of a grade left out, were the model right: of the tests' scatter alone.

    Each grade's curve is the mean of the thesis' three specimens, and off its own by a factor. How
    much the others' factors move the prediction, at strain 0.1, are the weights of the cubic.
    """
    kept = [k for k in range(len(PALETTE.materials)) if k != place]
    places, values = MODEL.places, np.log(MODEL.grade_moduli_MPa(0.1))
    ways = values[kept, None] + 1e-30j * np.eye(len(kept))
    slopes = pchip_slopes(places[kept], ways)
    h1, h2 = places[place] - places[place - 1], places[place + 1] - places[place]
    rise, d0, d1 = pchip_weights(np.asarray(h1 / (h1 + h2)), h1 + h2)
    below, above = place - 1, place
    foretold = ways[below] + rise * (ways[above] - ways[below])
    foretold += d0 * slopes[below] + d1 * slopes[above]
    weights = foretold.imag * 1e30
    log_sd = SPECIMEN_LOG_SD / math.sqrt(SPECIMENS) * math.hypot(1.0, *weights)
    stress = TOE_OFF[place].stress_MPa
    # The mean size of a normal deviate is sqrt(2 / π) of its standard deviation.
    return float(math.sqrt(2.0 / math.pi) * log_sd * np.sqrt(np.mean(stress**2)) / stress.max())


def table_coverage() -> list[list[str]]:
    """Residuals of left-out grades over the standard deviation that was foretold."""
    rows = [["grade left out", "at rest", "at 10 %", "at 55 %", "within 50 %", "within 95 %"]]
    strains = np.linspace(0.0, MODEL.strain_limit, 56)
    tail = NormalDist().inv_cdf(0.975)
    scores = []
    for material in PALETTE.materials[1:-1]:
        model, m = without(PALETTE, material.id), material.coordinate
        low, high = model.modulus_interval_MPa(m, strains)
        error = np.log(MODEL.modulus_MPa(m, strains) / model.modulus_MPa(m, strains))
        score = error * 2.0 * tail / np.log(high / low)
        scores.append(score)
        rows.append(
            [
                material.id,
                *(f"{round(float(score[k]), 1) + 0.0:+.1f}" for k in (0, 10, 55)),
                *_within(score),
            ]
        )
    every = np.concatenate(scores)
    rows.append(["all", "", "", "", *_within(every)])
    return rows


def _within(score: FloatArray) -> list[str]:
    return [
        f"{100 * float(np.mean(np.abs(score) <= NormalDist().inv_cdf(0.5 + level / 2))):.0f} %"
        for level in (0.5, 0.95)
    ]


def tables() -> dict[str, list[list[str]]]:
    """Return the page's tables by name: a heading row, then the rows."""
    return {
        "table-3-1": table_3_1(),
        "table-3-2": table_3_2(),
        "algorithm": table_algorithm(),
        "table-4-1": table_4_1(),
        "held-out": table_held_out(),
        "coverage": table_coverage(),
    }


def draw_3_1(figure: Any) -> None:
    """Draw each grade's curve as printed, and the law that planning uses."""
    for place, (axes, published) in enumerate(
        zip(figure.subplots(2, 5).flat, THESIS.materials, strict=True)
    ):
        end, law = published.elongation_at_break, MODEL.laws[place]
        strain = np.linspace(0.0, end, 100)
        if published.c:
            curve, corrected = CURVES[place], correct(published)
            front = np.geomspace(0.1 * corrected.onset, corrected.onset, 50)
            axes.plot(front, literal_stress_MPa(published.c, front), ":", color=LITERAL)
            axes.plot(curve.strain, curve.stress_MPa, color=LITERAL, lw=2.5, alpha=0.6)
            strain = np.linspace(0.0, end - corrected.toe, 100)
            axes.plot(
                strain + corrected.toe, law.nominal_stress_MPa(1.0 + strain), color=CONSISTENT
            )
            axes.set_ylim(-0.05 * curve.stress_MPa.max(), 1.1 * curve.stress_MPa.max())
        else:
            line = 2.0 * published.toughness_MJ_m3 / end**2
            axes.plot(strain, line * strain, "--", color="0.5", lw=1.0)
            axes.plot(strain, law.nominal_stress_MPa(1.0 + strain), color=CONSISTENT)
        axes.set_title(f"{'abcdefghij'[place]}) {published.id}", fontsize=9)
    handles = [
        _line(color=LITERAL, lw=2.5, alpha=0.6, label="eq. 3.8 with Table 3.2"),
        _line(color=LITERAL, ls=":", label="the same below the onset"),
        _line(color=CONSISTENT, label="consistent law, moved right by the toe"),
        _line(color="0.5", ls="--", lw=1.0, label="straight line with Table 3.1's area"),
    ]
    _finish(figure, handles, "crosshead strain")


def draw_3_2(figure: Any) -> None:
    """Draw individual laws and coefficient models, the literal left of the consistent."""
    panels = figure.subplots(4, 4)
    for place, published in enumerate(ELASTOMERS):
        literal, consistent = panels[place // 2, 2 * (place % 2) : 2 * (place % 2) + 2]
        curve, toe_off = CURVES[place], TOE_OFF[place]
        literal.plot(curve.strain, curve.stress_MPa, color=LITERAL, lw=2.5, alpha=0.6)
        literal.plot(curve.strain, stress(PRINTED, curve), "--", color="k", lw=1.2)
        literal.plot(curve.strain, stress(fitted().model, curve), ":", color="k", lw=1.5)
        strain = np.linspace(0.0, toe_off.strain[-1], 100)[1:]
        law = MODEL.laws[place]
        consistent.plot(toe_off.strain, curve.stress_MPa, color=LITERAL, lw=2.5, alpha=0.6)
        consistent.plot(strain, law.nominal_stress_MPa(1.0 + strain), color=CONSISTENT)
        if place:
            model = without(PALETTE, published.id)
            low, high = model.modulus_interval_MPa(curve.coordinate, strain)
            consistent.fill_between(
                strain, low * strain, high * strain, color=HELD, alpha=0.15, lw=0
            )
            predicted = model.nominal_stress_MPa(curve.coordinate, 1.0 + strain)
            consistent.plot(strain, predicted, "--", color=HELD)
        top = 1.6 * float(curve.stress_MPa.max())
        for axes, kind in ((literal, "literal"), (consistent, "consistent")):
            axes.set_title(f"{'abcdefg'[place]}) {published.id}, {kind}", fontsize=8)
            axes.set(xlim=(0.0, published.elongation_at_break), ylim=(0.0, top))
    for axes in panels[3, 2:]:
        axes.set_axis_off()
    handles = [
        _line(color=LITERAL, lw=2.5, alpha=0.6, label="individual fit, eq. 3.8 with Table 3.2"),
        _line(color="k", ls="--", lw=1.2, label="quadratics as printed"),
        _line(color="k", ls=":", lw=1.5, label="Algorithm 1, run here"),
        _line(color=CONSISTENT, label="consistent law and model at the grade"),
        _line(color=HELD, ls="--", label="consistent model without the grade, 95 %"),
    ]
    panels[3, 2].legend(handles=handles, loc="center left", fontsize=8, frameon=False)
    _finish(figure, [])


def draw_4_1(figure: Any) -> None:
    """Draw a material between FLX9750 and FLX9760."""
    m = 2.5 / 6.0
    neighbours = (2, 3)
    literal, consistent = figure.subplots(1, 2, sharey=True)
    for place in neighbours:
        curve, toe_off = CURVES[place], TOE_OFF[place]
        name = ELASTOMERS[place].id
        literal.plot(curve.strain, curve.stress_MPa, color=LITERAL, lw=2.5, alpha=0.6)
        consistent.plot(toe_off.strain, curve.stress_MPa, color=LITERAL, lw=2.5, alpha=0.6)
        for axes, along in ((literal, curve), (consistent, toe_off)):
            axes.text(along.strain[-1], along.stress_MPa[-1], name, fontsize=7, va="bottom")
    strain = np.linspace(CURVES[2].strain[0], 0.725, 100)
    literal.plot(
        strain, PRINTED.literal_stress_MPa(m, strain), "k--", label="quadratics as printed"
    )
    literal.plot(
        strain, fitted().model.literal_stress_MPa(m, strain), "k:", label="Algorithm 1, run here"
    )
    strain = np.linspace(0.0, 0.7, 100)[1:]
    low, high = MODEL.modulus_interval_MPa(m, strain)
    consistent.fill_between(strain, low * strain, high * strain, color=CONSISTENT, alpha=0.15, lw=0)
    consistent.plot(
        strain,
        MODEL.nominal_stress_MPa(m, 1.0 + strain),
        color=CONSISTENT,
        label="consistent model, 95 %",
    )
    for axes, title in ((literal, "literal"), (consistent, "consistent")):
        axes.set_title(f"between FLX9750 and FLX9760, {title}", fontsize=9)
        axes.set(ylim=(0.0, 1.5), xlim=(0.0, 0.85))
        axes.legend(fontsize=8, frameon=False, loc="upper left")
    _finish(figure, [])


def _line(**look: Any) -> Any:
    from matplotlib.lines import Line2D

    return Line2D([], [], **look)


def _finish(figure: Any, handles: list[Any], strain: str = BOTH_STRAINS) -> None:
    figure.supxlabel(strain)
    figure.supylabel("nominal stress, MPa")
    if handles:
        figure.legend(
            handles=handles, loc="outside upper center", ncols=4, fontsize=8, frameon=False
        )


def draw(folder: Path, suffix: str = ".svg") -> None:
    """Draw all figures into a folder."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    mpl.rcParams |= {"svg.hashsalt": "thesis-reproduced", "font.size": 8}
    sizes = ((13.0, 5.5), (12.0, 10.0), (9.0, 4.0))
    for name, size, fill in zip(FIGURES, sizes, (draw_3_1, draw_3_2, draw_4_1), strict=True):
        figure = Figure(figsize=size, layout="constrained")
        fill(figure)
        metadata = {"Date": None} if suffix == ".svg" else None
        figure.savefig(folder / f"{name}{suffix}", metadata=metadata, dpi=90)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        draw(Path(sys.argv[1]), ".png")
    else:
        page = FOLDER / "thesis-reproduced.md"
        text = with_tables(page.read_text(encoding="utf-8"), tables())
        page.write_text(text, encoding="utf-8", newline="\n")
        draw(FOLDER)
