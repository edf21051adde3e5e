"""Draw thesis-numbers.svg and rewrite the tables of thesis-numbers.md; needs matplotlib.

python docs/explanation/thesis_numbers.py
"""

from pathlib import Path

import numpy as np

from planner.materials.algorithm_one import QuadraticCoefficients, literal_stress_MPa
from planner.materials.laws import (
    Ogden,
    make_law,
    secant_modulus_MPa,
    stability,
)
from planner.materials.mixtures import CoefficientModel, gent_modulus_MPa
from planner.printers import load_printer
from printers.connex3.curve_fit import over_neo_hooke, relative_rms
from printers.connex3.derive import fit_strains, reading_log_sd
from printers.connex3.thesis import Published, load_thesis
from printers.connex3.toe import correct

FOLDER = Path(__file__).parent
THESIS = load_thesis()
PALETTE = load_printer("connex3").palette()
MODEL = CoefficientModel(PALETTE)

FORMER = {
    "TangoPlus": Ogden((0.2631345, 0.4236421), (-1.5, 1.5)),
    "FLX9740": Ogden((0.782701, 0.7923873), (-1.0, 1.5)),
    "FLX9750": Ogden((0.7173868, 1.182566), (-1.5, 1.5)),
    "FLX9760": Ogden((1.235658, 2.02937), (-1.5, 1.5)),
    "FLX9770": Ogden((2.494, 5.839602), (-1.5, 1.0)),
    "FLX9785": Ogden((-1.501023, 0.07287953), (-4.0, 5.5)),
    "FLX9795": Ogden((-1.359657, -7.66368, -1.359674), (-26.0, -2.0, 13.0)),
}
"""The laws that follow tension closest, without a look at compression."""


def shore_a(published: Published) -> float:
    """Nominal hardness: in the mixtures' names; FLX930 26 to 28, unconfirmed."""
    return 27.0 if published.id == "TangoPlus" else float(published.id[-2:])


def straight_line_modulus_MPa(published: Published) -> float:
    """Modulus of the straight line to the break that has the toughness of Table 3.1."""
    return 2.0 * published.toughness_MJ_m3 / published.elongation_at_break**2


def area_MJ_m3(published: Published) -> float:
    """Area under the corrected curve."""
    curve = correct(published)
    strain = np.linspace(0.0, published.elongation_at_break - curve.toe, 20001)
    return float(np.trapezoid(curve.nominal_stress_MPa(strain), strain))


def r_squared(published: Published, offset: float) -> float:
    """R² of the quadratics against the grade's own fit, with strain + offset for a variable."""
    strain = np.linspace(0.1, published.elongation_at_break, 400)
    fit = literal_stress_MPa(published.c, strain)
    quadratics = QuadraticCoefficients(THESIS.quadratics)
    model = quadratics.literal_stress_MPa(THESIS.coordinate(published), strain + offset)
    return float(1.0 - np.sum((fit - model) ** 2) / np.sum((fit - fit.mean()) ** 2))


def tables() -> dict[str, list[list[str]]]:
    """Return the page's tables by name: a heading row, then the rows."""
    variable = [["grade", "R², x = strain", "R², x = 1 + strain", "stress at rest if x = 1, MPa"]]
    toe = [["grade", "onset", "toe", "tangent, MPa", "law", "RMS of fit", "reading, sd of ln E"]]
    compression = [
        [
            "grade",
            "RMS in tension: closest",
            "law",
            "at stretch 0.8, MPa: closest",
            "law",
            "neo-Hooke",
            "law over neo-Hooke: at 0.8",
            "at 0.6",
            "closest law sound from",
        ]
    ]
    rigid = [["grade", "crosshead, at rest", "at 10 %", "extensometer, at rest", "at 10 %"]]
    ladder = [
        [
            "grade",
            "Table 3.1",
            "2 U / ε²",
            "area / Table 3.1's",
            "Gent from Shore A",
            "law, at rest",
            "law, at 10 %",
            "95 % at 10 %",
        ]
    ]
    for published, material, law in zip(
        THESIS.materials, PALETTE.materials, MODEL.laws, strict=True
    ):
        low, high = MODEL.modulus_interval_MPa(material.coordinate, 0.1)
        row = [
            published.id,
            f"{published.youngs_modulus_MPa:.3g}",
            f"{straight_line_modulus_MPa(published):.3g}",
            f"{area_MJ_m3(published) / published.toughness_MJ_m3:.2f}" if published.c else "",
            f"{gent_modulus_MPa(shore_a(published)):.3g}" if published.c else "",
            f"{float(law.tangent_MPa(1.0)):.3g}",
            f"{float(MODEL.modulus_MPa(material.coordinate, 0.1)):.3g}",
            f"{float(low):.3g} to {float(high):.3g}",
        ]
        ladder.append(row)
        if not published.c:
            other = make_law(material.readings[0].law)
            secants = [secant_modulus_MPa(one, [0.0, 0.1]).tolist() for one in (law, other)]
            rigid.append([published.id, *(f"{v:.4g}" for pair in secants for v in pair)])
            continue
        variable.append(
            [
                published.id,
                f"{r_squared(published, 0.0):.2f}",
                f"{r_squared(published, 1.0):.1f}",
                f"{float(literal_stress_MPa(published.c, 1.0)):.2f}",
            ]
        )
        curve = correct(published)
        strain = fit_strains(curve)
        toe.append(
            [
                published.id,
                f"{curve.onset:.4f}",
                f"{curve.toe:.4f}",
                f"{curve.modulus_MPa:.3g}",
                material.law.model,
                f"{100 * relative_rms(law, strain, curve.nominal_stress_MPa(strain)):.2f} %",
                f"{reading_log_sd(curve):.3f}",
            ]
        )
        closest = FORMER[published.id]
        both = (closest, law)
        off = [relative_rms(one, strain, curve.nominal_stress_MPa(strain)) for one in both]
        pushed = [float(one.nominal_stress_MPa(0.8)) for one in both]
        hooke = float(law.tangent_MPa(1.0)) / 3.0 * (0.8 - 0.8**-2)
        lowest = stability(closest, published.elongation_at_break).sound["uniaxial"][0]
        compression.append(
            [
                published.id,
                *(f"{100 * one:.2f} %" for one in off),
                *(f"{one:.3g}" for one in (*pushed, hooke)),
                *(f"{ratio:.2f}" for ratio in over_neo_hooke(law, [0.8, 0.6])),
                f"{lowest:.2f}",
            ]
        )
    return {
        "variable": variable,
        "toe": toe,
        "compression": compression,
        "ladder": ladder,
        "rigid": rigid,
    }


def with_tables(page: str, tables: dict[str, list[list[str]]]) -> str:
    """Return the page with each table between its ``<!-- name -->`` marks written anew."""
    for name, (heading, *rows) in tables.items():
        before, rest = page.split(f"<!-- {name} -->\n", 1)
        _, after = rest.split(f"<!-- /{name} -->", 1)
        lines = [heading, ["---", *["---:"] * (len(heading) - 1)], *rows]
        table = "".join(f"| {' | '.join(line)} |\n" for line in lines)
        page = f"{before}<!-- {name} -->\n{table}<!-- /{name} -->{after}"
    return page


def draw(path: Path) -> None:
    """Draw the picture: divergence and toe, the corrected curves, the ladder."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    mpl.rcParams |= {"svg.hashsalt": "thesis-numbers", "font.size": 9}
    figure = Figure(figsize=(12.0, 4.0), layout="constrained")
    printed, secant, rungs = figure.subplots(1, 3)
    colours = {m.id: m.colour for m in PALETTE.materials}
    for published in THESIS.elastomers:
        curve = correct(published)
        colour, end = colours[published.id], published.elongation_at_break
        if published.id in ("TangoPlus", "FLX9740", "FLX9750"):
            x = np.geomspace(0.004, 0.45, 120)
            stress = literal_stress_MPa(published.c, x)
            below = x <= curve.onset
            printed.plot(x[below], stress[below], ":", color=colour)
            printed.plot(x[~below], stress[~below], color=colour, label=published.id)
            ends = np.array([curve.toe, curve.onset])
            printed.plot(ends, curve.modulus_MPa * (ends - curve.toe), "k", lw=0.8)
            printed.plot(curve.onset, curve.modulus_MPa * (curve.onset - curve.toe), "ko", ms=3.5)
        s = np.geomspace(0.005, end - curve.toe, 30)
        secant.loglog(s, curve.nominal_stress_MPa(s) / s, ".", ms=3, color=colour)
        law = MODEL.laws[THESIS.materials.index(published)]
        s = np.geomspace(0.002, end, 40)
        secant.loglog(s, law.nominal_stress_MPa(1.0 + s) / s, color=colour)
        secant.text(0.002, 1.06 * float(law.tangent_MPa(1.0)), published.id, fontsize=7)
    printed.set(xlim=(0, 0.45), ylim=(-0.08, 0.36), xlabel="crosshead strain")
    printed.set(ylabel="nominal stress, MPa", title="as printed, tangent and toe")
    secant.set(xlabel="strain, toe taken off", ylabel="secant modulus, MPa")
    secant.set(title="corrected curves (dots) and laws", ylim=(0.25, 80.0))
    printed.legend(fontsize=7, frameon=False, loc="lower right")

    m = MODEL.coordinates
    fine = np.linspace(m[0], m[-1], 91)
    low, high = MODEL.modulus_interval_MPa(fine, 0.1)
    rungs.fill_between(fine, low, high, color="#D5546E", alpha=0.2, lw=0, label="95 % at 10 %")
    rungs.semilogy(fine, MODEL.modulus_MPa(fine, 0.1), color="#A51F99", label="model at 10 %")
    for place, material in zip(m, PALETTE.materials, strict=True):
        rungs.plot(place, MODEL.modulus_MPa(place, 0.1), "o", color=material.colour, ms=6, mec="k")
    table = [p.youngs_modulus_MPa for p in THESIS.materials]
    rungs.plot(m, table, "kx--", lw=0.7, label="Table 3.1")
    hardness = [gent_modulus_MPa(shore_a(p)) for p in THESIS.elastomers]
    rungs.plot(m[: len(hardness)], hardness, "k^:", ms=4, lw=0.7, label="Gent from Shore A")
    rungs.set(xlabel="coordinate m", ylabel="modulus, MPa", title="the ladder")
    rungs.legend(fontsize=7, frameon=False, loc="upper left")
    figure.savefig(path, metadata={"Date": None} if path.suffix == ".svg" else None, dpi=110)


if __name__ == "__main__":
    page = FOLDER / "thesis-numbers.md"
    text = with_tables(page.read_text(encoding="utf-8"), tables())
    page.write_text(text, encoding="utf-8", newline="\n")
    draw(FOLDER / "thesis-numbers.svg")
