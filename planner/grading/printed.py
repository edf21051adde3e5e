"""What a piece of a part is printed in: a catalogue material, or a mixture of two."""

from dataclasses import dataclass

from planner.formats.threemf_model import Constituent, composite_name, mixed_colour
from planner.grading.stiffness_scale import StiffnessScale
from planner.materials.inverse import blend_for
from planner.printers import Printer

__all__ = ["Printed", "catalogue_material", "mixture"]


@dataclass(frozen=True, slots=True)
class Printed:
    """A material to print in.

    Attributes
    ----------
    name
        Goes into file names.
    material
        Id of a catalogue material; None for a mixture.
    constituents
        Of a mixture: catalogue materials and their shares.
    """

    name: str
    material: str | None
    coordinate: float
    modulus_MPa: float
    interval_MPa: tuple[float, float]
    density_g_cm3: float
    colour: str
    operator_name: str
    constituents: tuple[Constituent, ...] = ()


def catalogue_material(scale: StiffnessScale, grade: int, machine: Printer) -> Printed:
    """Return a catalogue material by its place from soft to hard."""
    material = scale.palette.materials[grade]
    return Printed(
        name=material.id,
        material=material.id,
        coordinate=material.coordinate,
        modulus_MPa=scale.moduli_MPa[grade],
        interval_MPa=scale.intervals_MPa[grade],
        density_g_cm3=material.density_g_cm3,
        colour=material.colour,
        operator_name=machine.operator_name(material.id),
    )


def mixture(scale: StiffnessScale, modulus_MPa: float, machine: Printer) -> Printed:
    """Return the mixture of two neighbouring materials that has a modulus.

    A modulus beyond the palette is clamped to it. The share of the harder material is how far the
    mixture's coordinate lies between the two: the palette knows no other measure.
    """
    blend = blend_for(scale.model, modulus_MPa, scale.at_strain)
    ids = [material.id for material in scale.palette.materials]
    # Shares as their names tell them, so that one name is one mixture.
    share = round(blend.fraction, 3)
    lower, upper = ids.index(blend.lower), ids.index(blend.upper)
    if share in (0.0, 1.0) or lower == upper:
        return catalogue_material(scale, upper if share == 1.0 else lower, machine)
    pair = scale.palette.materials[lower], scale.palette.materials[upper]
    coordinate = pair[0].coordinate + share * (pair[1].coordinate - pair[0].coordinate)
    low, high = scale.model.modulus_interval_MPa(coordinate, scale.at_strain)
    parts = tuple(
        Constituent(material.id, material.colour, part)
        for material, part in zip(pair, (round(1.0 - share, 3), share), strict=True)
    )
    return Printed(
        name=composite_name(parts),
        material=None,
        coordinate=coordinate,
        modulus_MPa=float(scale.model.modulus_MPa(coordinate, scale.at_strain)),
        interval_MPa=(float(low), float(high)),
        density_g_cm3=sum(m.density_g_cm3 * p.share for m, p in zip(pair, parts, strict=True)),
        colour=mixed_colour(parts),
        operator_name=" + ".join(
            f"{100 * part.share:.1f} % {machine.operator_name(part.name)}" for part in parts
        ),
        constituents=parts,
    )
