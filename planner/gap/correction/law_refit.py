"""A material's law with its stress multiplied along the strain, in the same model."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from planner.arrays import FloatArray
from planner.errors import PaletteError
from planner.materials.curve import Curve
from planner.materials.fit.law_fit import fit_law, law_stress_MPa
from planner.materials.fit.sample import sample_of
from planner.materials.fit.separable import FITTED_MODELS, SeparableLaw
from planner.materials.fit.stability import stability
from planner.materials.laws import make_law
from planner.palette import LawParameters, Material

__all__ = ["Refit", "refitted"]

_STARTS = 24
_EVEN = 1e-4
"""Spread of ln factor along the strain below which the law keeps its course."""

_STRESSES: Mapping[str, str] = MappingProxyType(
    {
        "linear": "modulus_MPa",
        "neo-hookean": "mu_MPa",
        "yeoh": "c_MPa",
        "ogden": "mu_MPa",
    }
)
"""The parameters that a factor on the stress multiplies, where the model has such a list."""


@dataclass(frozen=True, slots=True, eq=False)
class Refit:
    """A law, and how well it follows what it was to follow.

    Attributes
    ----------
    misfit
        RMS relative error of stress.
    tension_alone
        Whether it is unfit for even slight compression, where its stress would turn.
    """

    law: LawParameters
    misfit: float
    tension_alone: bool = False


def refitted(material: Material, strain: FloatArray, log_factor: FloatArray) -> Refit:
    """Return a material's law with its stress multiplied by exp(log_factor).

    An even factor multiplies the law's moduli and leaves no misfit. Else the same model, with as
    many terms, is fitted to the changed curve.

    Parameters
    ----------
    strain : (n,)
        Rising, above 0.

    Raises
    ------
    PaletteError
        The model cannot follow: its stress would fall before the break.
    """
    even = float(np.ptp(log_factor)) < _EVEN
    if even or material.law.model == "linear":
        law = _multiplied(material.law, float(np.exp(log_factor.mean())))
        if law is not None:
            return Refit(
                law, float(np.sqrt(np.mean((np.exp(log_factor.mean() - log_factor) - 1.0) ** 2)))
            )
    stress = make_law(material.law).nominal_stress_MPa(1.0 + strain) * np.exp(log_factor)
    model = _model(material.law)
    sample = sample_of([Curve(material.id, strain, stress)], points=None)
    fit = fit_law(model, sample, starts=_STARTS, also=_exponents(material.law))
    if not stability(fit, material.elongation_at_break, margin=0.0).stable:
        raise PaletteError(
            f"material {material.id}: its {material.law.model} law cannot follow the correction: "
            "the stress would fall before the break; measure it at these conditions and fit a "
            "law with planner fit"
        )
    found = law_stress_MPa(model, fit.a, fit.c, 1.0 + strain)
    misfit = float(np.sqrt(np.mean((found / stress - 1.0) ** 2)))
    # Palettes are held to slight compression and beyond the break, too; a pull needs neither.
    alone = not stability(fit, material.elongation_at_break).stable
    return Refit(fit.parameters, misfit, alone)


def _multiplied(law: LawParameters, factor: float) -> LawParameters | None:
    parameters = dict(law.parameters)
    for name in ("c2_MPa", "c4_MPa") if law.model == "martins" else (_STRESSES.get(law.model),):
        if name is None:
            return None
        parameters[name] = tuple(value * factor for value in parameters[name])
    return LawParameters(law.model, MappingProxyType(parameters))


def _model(law: LawParameters) -> SeparableLaw:
    if law.model not in FITTED_MODELS:
        raise PaletteError(
            f"law {law.model!r} cannot be corrected; it must be one of {', '.join(FITTED_MODELS)}"
        )
    models = FITTED_MODELS[law.model]
    if law.model != "ogden":
        return models[0]
    terms = len(law.parameters["alpha"])
    if terms > len(models):
        raise PaletteError(
            f"an Ogden law of {terms} terms cannot be fitted again; the most is {len(models)}"
        )
    return models[terms - 1]


def _exponents(law: LawParameters) -> FloatArray | None:
    """Return the law's own nonlinear parameters as a start, (1, q)."""
    if law.model == "ogden":
        return np.sort(np.array([law.parameters["alpha"]]), axis=1)
    if law.model == "martins":
        return np.array([[law.parameters["c1"][0], law.parameters["c3"][0]]])
    return None
