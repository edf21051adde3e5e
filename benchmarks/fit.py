"""Time fits: one Ogden N=3 from 50 starts, a ten-grade palette, and the real silicones.

    python benchmarks/fit.py [folder of tensile files]

Targets: 0.2 s for the fit, 5 s for the palette with its intervals and coefficient model.
"""

import sys
import time
from pathlib import Path
from types import MappingProxyType

import numpy as np

from planner.materials.characterise import Curve
from planner.materials.fit import fit_law, law_stress_MPa, sample_of
from planner.materials.laws import FITTED_MODELS
from planner.materials.mixtures import CoefficientModel
from planner.materials.palette_study import fit as fit_palette
from planner.materials.study import Study, read_study

OGDEN = {law.columns: law for law in FITTED_MODELS["ogden"]}

GRADES, SPECIMENS, POINTS = 10, 3, 300


def specimens(grade: int, rng: np.random.Generator) -> tuple[Curve, ...]:
    """Two-term Ogden specimens, each grade about twice as stiff as the one before."""
    curves = []
    for number in range(SPECIMENS):
        strain = np.linspace(0.0, 1.2 - 0.08 * grade, POINTS + 1)[1:]
        c = np.array([-0.05, 0.25]) * 2.0**grade
        stress = law_stress_MPa(OGDEN[2], np.array([-2.0, 1.8]), c, 1.0 + strain)
        stress = stress * np.exp(0.04 * rng.standard_normal())
        stress += 0.002 * stress.max() * rng.standard_normal(POINTS)
        curves.append(Curve(f"G{grade}-{number}", strain, stress, material=f"G{grade}"))
    return tuple(curves)


def main() -> None:
    rng = np.random.default_rng(1)
    for count in (30, 300):
        sample = sample_of(specimens(0, rng)[:1], points=count)
        started = time.perf_counter()
        fit = fit_law(OGDEN[3], sample, starts=50)
        seconds = time.perf_counter() - started
        agreeing = f"{fit.starts_agreeing} of {fit.starts} starts agree"
        print(
            f"Ogden N=3, 50 starts, {len(sample.stretch):3d} points  {seconds:6.3f} s  {agreeing}"
        )
    groups = {f"G{grade}": specimens(grade, rng) for grade in range(GRADES)}
    started = time.perf_counter()
    result = fit_palette(
        Study(MappingProxyType(groups), MappingProxyType({}), ()), name="benchmark"
    )
    CoefficientModel(result.palette)
    seconds = time.perf_counter() - started
    print(f"{GRADES}-grade palette, all laws, intervals, model   {seconds:6.3f} s")
    if len(sys.argv) > 1:
        started = time.perf_counter()
        study = read_study([Path(sys.argv[1])])
        result = fit_palette(study, name="real")
        seconds = time.perf_counter() - started
        print(f"{len(study.groups)} real materials{'':32}{seconds:6.3f} s")
        for material in result.palette.materials:
            fitted = result.fits[material.id].choice
            if fitted.chosen is not None:
                best = fitted.chosen.fit
                print(f"  {material.id:30} {best.name:12} R2 {best.r2:.6f}  nRMSE {best.nrmse:.4f}")


if __name__ == "__main__":
    main()
