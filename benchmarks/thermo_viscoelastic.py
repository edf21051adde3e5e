"""Closure of thermo-viscoelastic campaigns beside a plain linear viscoelastic model's.

python -m benchmarks.thermo_viscoelastic [--campaigns 6] [--seed 1]

A law is relaxed by a spectrum, its times shifted by the WLF law, its stress proportional to the
absolute temperature; pulled as the palette's grade was, it shows the palette's law, and owes
planner nothing else. Each campaign draws spectrum and shift anew, and is pulled at four
temperatures and four rates. Both sides predict conditions, and whole levels, that they did not see.
The plain model is told the course of the law that relaxes, which planner has to find, and fitted as
one would in an afternoon: shares of a Prony series with two times a decade, not negative, and a
shift factor for each temperature, straight in the temperature beyond those fitted (Ferry,
Viscoelastic Properties of Polymers, 1980, ch. 11).
"""

import argparse
import itertools
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, nnls

import planner
from planner.materials.laws import make_law
from planner.printers import load_printer

Array = NDArray[np.float64]

GRADE = "FLX9760"
REFERENCE_C, REFERENCE_PER_S = 23.0, 0.034  # of the bundled palette
TEMPERATURES_C = (12.0, 23.0, 34.0, 45.0)
RATES_MM_S = (0.0425, 0.425, 4.25, 42.5)
GAUGE_MM, AREA_MM2, TO_STRAIN, POINTS = 25.0, 18.0, 0.5, 60
LEVEL_SD, NOISE_SD = 0.03, 0.002
TIMES_s = np.logspace(-8.0, 6.0, 57)
PRONY_s = np.logspace(-6.0, 5.0, 23)


STRAIN = np.linspace(0.0, TO_STRAIN, POINTS)


def elastic_MPa() -> Array:
    """Return the grade's stress in the palette's own test."""
    (grade,) = (m for m in load_printer("connex3").palette(None).materials if m.id == GRADE)
    return make_law(grade.law).nominal_stress_MPa(1.0 + STRAIN)


def pulled(elastic: Array, rate_per_s: float, times_s: Array) -> Array:
    """Return what is left of elastic stress in branches of each time after a pull, (n, K)."""
    left = np.zeros((POINTS, len(times_s)))
    step_s = np.diff(STRAIN) / rate_per_s
    for k, (h, rise) in enumerate(zip(step_s, np.diff(elastic), strict=True)):
        x = h / times_s
        mean = np.where(x > 1e-8, -np.expm1(-x) / np.maximum(x, 1e-300), 1.0)
        left[k + 1] = left[k] * np.exp(-x) + rise * mean
    return left


def instantaneous_MPa(shares: Array) -> Array:
    """Return the stress that, relaxed by shares, is the palette's in the palette's own test."""
    steps = np.tri(POINTS)[:, 1:]  # the stress after each rise
    shown = np.stack([pulled(one, REFERENCE_PER_S, TIMES_s) @ shares for one in steps.T], axis=1)
    rises = np.linalg.solve(((1.0 - shares.sum()) * steps + shown)[1:], elastic_MPa()[1:])
    return np.asarray(steps @ rises)


def reality(rng: np.random.Generator) -> tuple[Array, float, float]:
    """Draw shares over `TIMES_s` and the two constants of the WLF law."""
    centre, breadth = rng.uniform(-4.0, 0.0), rng.uniform(1.5, 3.0)
    share = rng.uniform(0.75, 0.95)
    parts = np.exp(-0.5 * ((np.log10(TIMES_s) - centre) / breadth) ** 2)
    return share * parts / parts.sum(), rng.uniform(5.0, 12.0), rng.uniform(60.0, 110.0)


def measured(rng: np.random.Generator) -> tuple[list[tuple[float, float, Array]], Array]:
    """Return tests, and the law that relaxes in them.

    Of each test temperature, rate over the gauge length, and nominal stress in MPa.
    """
    shares, c1, c2 = reality(rng)
    elastic = instantaneous_MPa(shares)

    def stress(celsius: float, rate: float) -> Array:
        warmer = celsius - REFERENCE_C
        shift = 10.0 ** (-c1 * warmer / (c2 + warmer))
        relaxed = pulled(elastic, rate, TIMES_s * shift) @ shares
        drawn = (celsius + 273.15) / (REFERENCE_C + 273.15)
        return drawn * ((1.0 - shares.sum()) * elastic + relaxed)

    tests = []
    for celsius, rate_mm_s, _ in itertools.product(TEMPERATURES_C, RATES_MM_S, range(2)):
        rate = rate_mm_s / GAUGE_MM
        clean = stress(celsius, rate) * np.exp(rng.normal(0.0, LEVEL_SD))
        tests.append((celsius, rate, clean + rng.normal(0.0, NOISE_SD * clean.max(), POINTS)))
    return tests, elastic


def fitted(
    tests: list[tuple[float, float, Array]], elastic: Array
) -> dict[float, tuple[float, Array]]:
    """Fit the plain model; return log10 of the shift and shares at every temperature."""
    told = sorted({celsius for celsius, *_ in tests})

    def solved(shift: Array) -> tuple[Array, Array]:
        rows, right = [], []
        for celsius, rate, stress in tests:
            at = float(np.interp(celsius, told, shift))
            branches = pulled(elastic, rate, PRONY_s * 10.0**at)
            drawn = (celsius + 273.15) / (REFERENCE_C + 273.15)
            rows.append(drawn * np.column_stack([elastic, branches]) / stress.max())
            right.append(stress / stress.max())
        matrix, target = np.concatenate(rows), np.concatenate(right)
        # The palette's law is kept in the palette's own test, as planner keeps it.
        own = PRONY_s * 10.0 ** float(np.interp(REFERENCE_C, told, shift))
        kept = np.column_stack([elastic, pulled(elastic, REFERENCE_PER_S, own)]).sum(axis=0)
        kept, sure = kept / elastic_MPa().sum(), 1e3
        shares = nnls(np.vstack([matrix, sure * kept]), np.append(target, sure))[0]
        return shares, matrix @ shares - target

    first = -0.1 * (np.array(told) - told[0])
    free = least_squares(
        lambda s: solved(np.concatenate([[0.0], s]))[1], first[1:], diff_step=1e-3, max_nfev=30
    ).x
    shift = np.concatenate([[0.0], free])
    shares = solved(shift)[0]
    slopes = np.diff(shift) / np.diff(told)

    def at(celsius: float) -> float:
        if celsius < told[0]:
            return float(shift[0] + slopes[0] * (celsius - told[0]))
        if celsius > told[-1]:
            return float(shift[-1] + slopes[-1] * (celsius - told[-1]))
        return float(np.interp(celsius, told, shift))

    return {celsius: (at(celsius), shares) for celsius in TEMPERATURES_C}


def missed(tests: list[tuple[float, float, Array]], elastic: Array, levels: bool) -> float:
    """Return the plain model's error of held-out tests, normalised as planner's."""
    keys = [(celsius,) for celsius in TEMPERATURES_C] + [(r / GAUGE_MM,) for r in RATES_MM_S]
    if not levels:
        keys = list(itertools.product(TEMPERATURES_C, [r / GAUGE_MM for r in RATES_MM_S]))
    squares = []
    for out in keys:
        left = [test for test in tests if set(out) <= set(test[:2])]
        model = fitted([test for test in tests if not set(out) <= set(test[:2])], elastic)
        for celsius, rate, stress in left:
            shift, shares = model[celsius]
            branches = pulled(elastic, rate, PRONY_s * 10.0**shift)
            drawn = (celsius + 273.15) / (REFERENCE_C + 273.15)
            predicted = drawn * np.column_stack([elastic, branches]) @ shares
            squares.append(np.mean((predicted - stress) ** 2) / stress.max() ** 2)
    return float(np.sqrt(np.mean(squares)))


def write_campaign(folder: Path, tests: list[tuple[float, float, Array]]) -> None:
    """Write what was measured as a lab would."""
    (folder / "campaign.toml").write_text(
        'schema = 1\nname = "thermo-viscoelastic (made)"\nprinter = "connex3"\n'
        'palette = "connex3-tango-vero"\n'
        'notes = "SIMULATED. Nothing was measured."\n',
        encoding="utf-8",
    )
    heads = (
        "specimen,material,width_mm,thickness_mm,gauge_mm,rate_mm_s,temperature_C,protocol,batch"
    )
    rows, curves = [heads], ["specimen,time_s,displacement_mm,force_N"]
    travel = GAUGE_MM * STRAIN
    for number, (celsius, rate, stress) in enumerate(tests):
        name = f"T{number:02d}"
        speed = rate * GAUGE_MM
        rows.append(f"{name},{GRADE},6,3,{GAUGE_MM:g},{speed:g},{celsius:g},monotonic,1")
        for x, force in zip(travel.tolist(), (AREA_MM2 * stress).tolist(), strict=True):
            curves.append(f"{name},{x / speed:.9g},{x:.9g},{force:.9g}")
    (folder / "specimens.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    (folder / "curves.csv").write_text("\n".join(curves) + "\n", encoding="utf-8")


def main() -> None:
    """Print a row a campaign."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--campaigns", type=int, default=6)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    print(
        "verdict                  before  after  plain  ratio | levels: before  after  plain  ratio"
    )
    for number in range(given.campaigns):
        tests, elastic = measured(np.random.default_rng((given.seed, number)))
        with tempfile.TemporaryDirectory() as folder:
            write_campaign(Path(folder), tests)
            diagnosis = planner.diagnose(folder)
        gap = diagnosis.gap
        plain, plain_levels = (missed(tests, elastic, levels=levels) for levels in (False, True))
        after, beyond = gap.after or np.nan, gap.extrapolated or np.nan
        print(
            f"{diagnosis.verdict:24} {gap.before:6.3f} {after:6.4f} {plain:6.4f} "
            f"{after / plain:6.2f} | {gap.extrapolated_before or np.nan:14.3f} {beyond:6.4f} "
            f"{plain_levels:6.4f} {beyond / plain_levels:6.2f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
