"""A palette as a ladder of stiffness at one working strain."""

from dataclasses import dataclass

import numpy as np

from planner.errors import ArgumentError
from planner.materials.coefficients import CoefficientModel
from planner.palette import Palette

__all__ = ["StiffnessScale", "stiffness_scale"]


@dataclass(frozen=True, slots=True)
class StiffnessScale:
    """The modulus of each material of a palette, softest first, and the model between them.

    Attributes
    ----------
    moduli_MPa
        Secant moduli of the nominal stress at `at_strain`, strictly rising.
    intervals_MPa
        95 % interval of each.
    """

    palette: Palette
    at_strain: float
    model: CoefficientModel
    moduli_MPa: tuple[float, ...]
    intervals_MPa: tuple[tuple[float, float], ...]

    def modulus_of(self, material_id: str) -> float:
        """Return a material's modulus in MPa."""
        ids = [material.id for material in self.palette.materials]
        return self.moduli_MPa[ids.index(material_id)]


def stiffness_scale(palette: Palette, at_strain: float) -> StiffnessScale:
    """Measure a palette's stiffness at a working strain.

    Raises
    ------
    ArgumentError
        The strain is not above 0, or a hyperelastic material breaks before it.
    PaletteError
        The palette's stiffness does not rise with the coordinate at that strain.
    """
    model = CoefficientModel(palette)
    if not 0.0 < at_strain <= model.strain_limit:
        raise ArgumentError(
            f"--at-strain {at_strain:g}: the working strain must be above 0 and at most "
            f"{model.strain_limit:g}, where the first elastic material of palette {palette.name} "
            "breaks; strains are fractions, so 10 % is 0.1"
        )
    coordinates = np.array([material.coordinate for material in palette.materials])
    moduli = model.modulus_MPa(coordinates, at_strain)
    low, high = model.modulus_interval_MPa(coordinates, at_strain)
    return StiffnessScale(
        palette=palette,
        at_strain=at_strain,
        model=model,
        moduli_MPa=tuple(float(value) for value in moduli),
        intervals_MPa=tuple((float(a), float(b)) for a, b in zip(low, high, strict=True)),
    )
