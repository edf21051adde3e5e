"""Laws fitted to several loadings at once, beside published ones.

    python -m benchmarks.loadings

Treloar (1944), Kawabata (1981) and Meunier (2008), from the shared data. The error is what a fit
minimises, the root mean square of the residual over the stress (at least 5 % of the largest), by
loading; each weighs a third. Published, of Treloar's rubber: Ogden
(Proc. R. Soc. A 326, 1972), fitted to the three loadings at once; P. Steinmann, M. Hossain and
G. Possart (Arch. Appl. Mech. 82, 2012), each fitted to one loading alone. Exits 1 if Ogden's law of
three terms is worse than the published one of as many terms in any loading.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from planner.materials.characterise import Curve
from planner.materials.fit import LawFit, Sample, by_mode, choose_law, fit_law, sample_of
from planner.materials.laws import candidate_laws

FOLDER = Path(__file__).parents[2] / "shared" / "data" / "elastomers" / "classic_rubber"
FILES = {"uniaxial": "UT", "planar": "PS", "equibiaxial": "ET"}
STUDIES = ("Treloar_1944", "Kawabata_1981", "Meunier_2008")

PUBLISHED = {
    "Ogden 1972": ("ogden-3", (1.3, 5.0, -2.0), (0.63, 0.0012, -0.01)),
    "Steinmann, neo-Hooke, uniaxial": ("neo-hookean", (), (0.5673,)),
    "Steinmann, neo-Hooke, planar": ("neo-hookean", (), (0.3360,)),
    "Steinmann, neo-Hooke, equibiaxial": ("neo-hookean", (), (0.4104,)),
    # W = C10 (I1 - 3) + C01 (I2 - 3) is Ogden's of exponents 2 and -2, mu 2 C10 and -2 C01.
    "Steinmann, Mooney-Rivlin, uniaxial": ("ogden-2", (2.0, -2.0), (0.5176, 0.0898)),
    "Steinmann, Mooney-Rivlin, planar": ("ogden-2", (2.0, -2.0), (0.4696, 0.13)),
    "Steinmann, Mooney-Rivlin, equibiaxial": ("ogden-2", (2.0, -2.0), (0.3426, -0.0094)),
}


def study(name: str, weighting: str = "relative") -> Sample:
    """Return the points of a study's loadings, each with the same weight."""
    curves = []
    for mode, folder in FILES.items():
        stress, stretch = np.loadtxt(FOLDER / name / folder / "stress_stretch.txt").T
        for side in (stretch > 1.0, stretch < 1.0):
            if side.sum() >= 8:
                called = f"{name} {mode}"
                curves.append(Curve(called, stretch[side] - 1.0, stress[side], mode=mode))
    return sample_of(curves, weighting=weighting, points=None)


def main() -> None:
    worse = False
    print("error by loading, %: uniaxial, planar, equibiaxial (* chosen)")
    for name in STUDIES:
        sample = study(name)
        choice = choose_law(candidate_laws("all"), sample, float(sample.stretch.max()) - 1.0)
        for candidate in choice.candidates:
            mark = " *" if candidate is choice.chosen else ""
            print(f"{name}, {candidate.fit.name}{mark}: {told(errors(candidate.fit, sample))}")
            if name == STUDIES[0] and candidate.fit.name == "ogden-3":
                known = errors(published("Ogden 1972", candidate.fit), sample)
                own = errors(candidate.fit, sample)
                worse = any(a > b for a, b in zip(own, known, strict=True))
    sample = study(STUDIES[0])
    one = fit_law(candidate_laws("neo-hookean")[0], sample)
    for called in PUBLISHED:
        print(f"{STUDIES[0]}, {called}: {told(errors(published(called, one), sample))}")
    sys.exit(int(worse))


def errors(fit: LawFit, sample: Sample) -> list[float]:
    """Return a law's error in each loading."""
    return [off for _, (_, off) in by_mode(fit, sample)]


def told(values: list[float]) -> str:
    """Return errors in per cent."""
    return ", ".join(f"{100 * value:.1f}" for value in values)


def published(name: str, like: LawFit) -> LawFit:
    """Return a published law as if it had been fitted."""
    model, a, c = PUBLISHED[name]
    (law,) = candidate_laws(model)
    return replace(like, law=law, a=np.array(a), c=np.array(c))


if __name__ == "__main__":
    main()
