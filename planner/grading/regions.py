"""Bands of the part as shells to print and regions to report."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from planner.cutting.pieces import Pieces, piece_bounds_mm, piece_volumes_mm3, shell_faces
from planner.formats.mesh_file import encode_stl
from planner.formats.threemf import Constituent, composite_name, mixed_colour
from planner.grading.profile import Band, StiffnessScale
from planner.materials.mixtures import blend_for
from planner.mesh.mesh import compact
from planner.numerics import FloatArray, Point
from planner.plan import Region, Shell
from planner.printers import Printer, resins_of

__all__ = [
    "Printed",
    "catalogue_material",
    "mixture",
    "point",
    "region_of",
    "regions_of",
    "shells_of",
]


# ------------------------------------------------------------------------------------------------
# What a piece of a part is printed in: a catalogue material, or a mixture of two.


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


# ------------------------------------------------------------------------------------------------
# Bands of the part as shells to print and regions to report.


def shells_of(
    pieces: Pieces, printed: Sequence[Printed], scale: StiffnessScale, machine: Printer, name: str
) -> tuple[Shell, ...]:
    """Unite the pieces of each material or mixture into one shell set, from soft to hard."""
    names = np.array([what.name for what in printed])
    occupied = piece_volumes_mm3(pieces) > 0.0
    used_ones = {what.name: what for what, some in zip(printed, occupied, strict=True) if some}
    mixed = (part.name for what in used_ones.values() for part in what.constituents)
    ids = {*mixed, *(what.material for what in used_ones.values() if what.material)}
    resins = resins_of(scale.palette, machine, ids)
    shells: list[Shell] = []
    for what in sorted(used_ones.values(), key=lambda what: what.coordinate):
        faces = shell_faces(pieces, np.flatnonzero(names == what.name))
        used, faces = compact(faces, len(pieces.vertices))
        vertices = pieces.vertices[used]
        file = f"stl/{name}__{len(shells) + 1:02d}_{what.name}.stl"
        header = f"{name} {what.operator_name} unit=mm"
        shells.append(
            Shell(
                material=what.name,
                operator_name=what.operator_name,
                colour=what.colour,
                file=file,
                vertices=vertices,
                faces=faces,
                header=header,
                sha256=hashlib.sha256(encode_stl(vertices, faces, header)).hexdigest(),
                properties={
                    "coordinate": f"{what.coordinate:.9g}",
                    "modulus_MPa": f"{what.modulus_MPa:.9g}",
                    "at_strain": f"{scale.at_strain:.9g}",
                    "operator_name": what.operator_name,
                    "base_resins": ", ".join(resins),
                },
                constituents=what.constituents,
            )
        )
    return tuple(shells)


def regions_of(
    pieces: Pieces, steps: Sequence[Band], printed: Sequence[Printed], shells: Sequence[Shell]
) -> tuple[Region, ...]:
    """Report each band that holds any of the part."""
    volumes = piece_volumes_mm3(pieces)
    bounds = piece_bounds_mm(pieces)
    files = {shell.material: shell for shell in shells}
    regions: list[Region] = []
    for number, (band, what) in enumerate(zip(steps, printed, strict=True)):
        if volumes[number] > 0.0:
            regions.append(region_of(band, what, float(volumes[number]), bounds[number], files))
    return tuple(regions)


def region_of(
    band: Band, what: Printed, volume_mm3: float, bounds_mm: FloatArray,
    files: Mapping[str, Shell],
) -> Region:  # fmt: skip
    """Report a band that is printed in one material or mixture.

    Its number is that of its shell, from soft to hard, as in the shell's file name.

    Parameters
    ----------
    files
        The shells by material, from soft to hard.
    """
    low, high = band.target_MPa
    shell = files[what.name]
    return Region(
        index=list(files).index(what.name) + 1,
        material=what.material,
        coordinate=what.coordinate,
        field=(band.start, band.stop),
        target_modulus_MPa=(low, high),
        modulus_MPa=what.modulus_MPa,
        modulus_interval_MPa=what.interval_MPa,
        error=(what.modulus_MPa / high - 1.0, what.modulus_MPa / low - 1.0),
        volume_mm3=volume_mm3,
        mass_g=volume_mm3 * what.density_g_cm3 / 1000.0,
        bounds_mm=(point(bounds_mm[0]), point(bounds_mm[1])),
        file=shell.file,
        sha256=shell.sha256,
        triangles=len(shell.faces),
        blend=_mixed(what),
    )


def _mixed(what: Printed) -> dict[str, Any] | None:
    """Return what a plan says of a mixture; None of a catalogue material."""
    if what.material is not None:
        return None
    lower, upper = what.constituents
    return {
        "kind": "mix",
        "name": what.name,
        "lower": lower.name,
        "upper": upper.name,
        "fraction": upper.share,
    }


def point(values: FloatArray) -> Point:
    """Return three coordinates as plain numbers."""
    return float(values[0]), float(values[1]), float(values[2])
