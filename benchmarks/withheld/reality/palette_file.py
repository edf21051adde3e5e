"""The palette as the bench reads it: published curves, and the file that goes into a campaign.

The bench reads the file itself, so that no line of planner stands between it and its reality.
"""

import re
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

__all__ = ["Grade", "PaletteFile", "fitted_palette", "read_palette"]

FloatArray = NDArray[np.float64]

_PLASTIC = re.compile(r'(?m)^deformation *= *"plastic"')


@dataclass(frozen=True)
class Grade:
    """One elastomer of the palette.

    Attributes
    ----------
    stress_MPa
        Nominal stress on engineering strain, as the palette's law has it.
    """

    id: str
    coordinate: float
    break_strain: float
    stress_MPa: Callable[[FloatArray], FloatArray]


@dataclass(frozen=True)
class PaletteFile:
    """The elastic grades from soft to hard, the reference conditions and the file's text."""

    grades: tuple[Grade, ...]
    strain_rate_per_s: float
    temperature_C: float
    soak_h: float
    age_days: float
    orientation: str
    text: str

    def calibrated(self, sd: float) -> str:
        """Return the file's text with every `modulus_log_sd` at the lab's own calibration.

        Without the rigid grades, which the bench cannot print: a mixture harder than its hardest
        grade is that grade, here as in the file.
        """
        head, *materials = self.text.split("[[material]]")
        elastic = [m for m in materials if not _PLASTIC.search(m)]
        text = "[[material]]".join([head, *elastic])
        return re.sub(r"(?m)^modulus_log_sd *=.*$", f"modulus_log_sd = {sd:.4f}", text)


def read_palette(text: str) -> PaletteFile:
    """Read a palette (contract, section 2); grades that deform plastically are left out."""
    document = tomllib.loads(text)
    reference = document["reference"]
    grades = tuple(
        Grade(m["id"], m["coordinate"], m["elongation_at_break"], _published(m["law"]))
        for m in document["material"]
        if m.get("deformation", "elastic") == "elastic"
    )
    return PaletteFile(
        grades,
        reference["strain_rate_per_s"],
        reference["temperature_C"],
        reference["soak_h"],
        reference["age_days"],
        reference["orientation"],
        text,
    )


_SPECIMENS = 3
_ALPHA = np.array([-2.0, 2.0, 5.0])
_LAW = re.compile(r"\[material\.(law|published)\]\n(?:[^\[\n].*\n?|\n(?!\[))*")


def fitted_palette(
    palette: PaletteFile,
    stress_MPa: Callable[[float, FloatArray], FloatArray],
    scatter: float,
    rng: np.random.Generator,
) -> PaletteFile:
    """Return the palette with Ogden's law fitted to three noisy specimens of each elastic grade.

    It says neither how well the law follows them nor how much they differ.

    Parameters
    ----------
    stress_MPa
        Of a coordinate and strains: what the grades truly do.
    scatter
        Standard deviation of a specimen's level, a third of it of its course.
    """
    head, *materials = palette.text.split("[[material]]")
    coordinates = {g.id: g for g in palette.grades}
    found = []
    for text in materials:
        grade = coordinates.get(tomllib.loads("[[material]]" + text)["material"][0]["id"])
        if grade is not None:
            strain = np.linspace(0.02, 0.9 * grade.break_strain, 40)
            level, slope = scatter * rng.normal(size=(2, _SPECIMENS)) * [[1.0], [1.0 / 3.0]]
            noise = np.exp(level[:, None] + np.outer(slope, strain / strain[-1] - 0.5))
            curve = (noise * stress_MPa(grade.coordinate, strain)).mean(axis=0)
            stretch = 1.0 + strain
            # Ogden's terms of positive work, with exponents that nobody chose for these.
            terms = stretch[:, None] ** (_ALPHA - 1.0) - stretch[:, None] ** (-0.5 * _ALPHA - 1.0)
            mu, _ = nnls(terms * np.sign(_ALPHA), curve)
            kept = mu > 0.0
            law = '[material.law]\nmodel = "ogden"\n'
            for name, values in (("mu_MPa", mu * np.sign(_ALPHA)), ("alpha", _ALPHA)):
                law += f"{name} = [{', '.join(f'{x:.6g}' for x in values[kept])}]\n"
            text = _LAW.sub("", text).rstrip() + f"\n{law}\n"
            text = re.sub(r"(?m)^modulus_log_sd *=.*\n", "", text)
        found.append(text)
    return read_palette("[[material]]".join([head, *found]))


def _published(law: Mapping[str, Any]) -> Callable[[FloatArray], FloatArray]:
    def stress_MPa(strain: FloatArray) -> FloatArray:
        stretch = 1.0 + strain
        shear = stretch - stretch**-2
        j = stretch**2 + 2.0 / stretch - 3.0
        match law["model"]:
            case "ogden":
                terms = zip(law["mu_MPa"], law["alpha"], strict=True)
                return sum(
                    (mu * (stretch ** (a - 1) - stretch ** (-a / 2 - 1)) for mu, a in terms),
                    start=np.zeros_like(strain),
                )
            case "yeoh":
                c1, c2, c3 = law["c_MPa"]
                yeoh: FloatArray = 2.0 * shear * (c1 + 2.0 * c2 * j + 3.0 * c3 * j**2)
                return yeoh
            case "neo-hookean":
                return _one(law["mu_MPa"]) * shear
            case "martins":
                c1, c2, c3, c4 = (_one(law[key]) for key in ("c1", "c2_MPa", "c3", "c4_MPa"))
                fibre = 2.0 * c3 * c4 * strain * np.exp(c3 * strain**2)
                return 2.0 * c1 * c2 * shear * np.exp(c1 * j) + fibre
            case "linear":
                return _one(law["modulus_MPa"]) * strain
            case "yielding":
                modulus, flow, hardening, n = (
                    _one(law[key])
                    for key in ("modulus_MPa", "flow_MPa", "hardening_MPa", "sharpness")
                )
                bend = (1.0 + ((modulus - hardening) / flow * np.abs(strain)) ** n) ** (1.0 / n)
                yielding: FloatArray = hardening * strain + (modulus - hardening) * strain / bend
                return yielding
        raise ValueError(f"the bench knows no law {law['model']!r}; add it to palette_file.py")

    return stress_MPa


def _one(value: float | list[float]) -> float:
    return value[0] if isinstance(value, list) else value
