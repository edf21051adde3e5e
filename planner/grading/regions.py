"""Bands of the part as shells to print and regions to report."""

import hashlib
from collections.abc import Sequence

import numpy as np

from planner.arrays import FloatArray
from planner.formats.stl import encode_stl
from planner.geometry.shells import Pieces, piece_bounds_mm, piece_volumes_mm3, shell_faces
from planner.grading.bands import Band
from planner.grading.stiffness_scale import StiffnessScale
from planner.plan import Point, Region, Shell
from planner.printers import Printer

__all__ = ["point", "regions_of", "shells_of"]


def shells_of(
    pieces: Pieces, steps: Sequence[Band], scale: StiffnessScale, machine: Printer, name: str
) -> tuple[Shell, ...]:
    """Unite the pieces of each material into one shell set, from soft to hard."""
    grades = np.array([band.grade for band in steps])
    occupied = piece_volumes_mm3(pieces) > 0.0
    shells: list[Shell] = []
    for grade in sorted(set(grades[occupied].tolist())):
        material = scale.palette.materials[grade]
        faces = shell_faces(pieces, np.flatnonzero(grades == grade))
        used, compact = np.unique(faces, return_inverse=True)
        vertices = pieces.vertices[used]
        faces = compact.reshape(-1, 3).astype(np.int32)
        file = f"stl/{name}__{len(shells) + 1:02d}_{material.id}.stl"
        operator_name = machine.operator_name(material.id)
        shells.append(
            Shell(
                material=material.id,
                operator_name=operator_name,
                colour=material.colour,
                file=file,
                vertices=vertices,
                faces=faces,
                stl=encode_stl(vertices, faces, f"{name} {operator_name} unit=mm"),
                properties={
                    "coordinate": f"{material.coordinate:.9g}",
                    "modulus_MPa": f"{scale.moduli_MPa[grade]:.9g}",
                    "at_strain": f"{scale.at_strain:.9g}",
                    "operator_name": operator_name,
                    "base_resins": ", ".join(machine.base_resins),
                },
            )
        )
    return tuple(shells)


def regions_of(
    pieces: Pieces, steps: Sequence[Band], scale: StiffnessScale, shells: Sequence[Shell]
) -> tuple[Region, ...]:
    """Report each band that holds any of the part."""
    volumes = piece_volumes_mm3(pieces)
    bounds = piece_bounds_mm(pieces)
    files = {shell.material: shell for shell in shells}
    hashes = {shell.material: hashlib.sha256(shell.stl).hexdigest() for shell in shells}
    regions: list[Region] = []
    for number, band in enumerate(steps):
        if volumes[number] <= 0.0:
            continue
        material = scale.palette.materials[band.grade]
        achieved = scale.moduli_MPa[band.grade]
        low, high = band.target_MPa
        regions.append(
            Region(
                index=len(regions) + 1,
                material=material.id,
                coordinate=material.coordinate,
                field=(band.start, band.stop),
                target_modulus_MPa=(low, high),
                modulus_MPa=achieved,
                modulus_interval_MPa=scale.intervals_MPa[band.grade],
                error=(achieved / high - 1.0, achieved / low - 1.0),
                volume_mm3=float(volumes[number]),
                mass_g=float(volumes[number]) * material.density_g_cm3 / 1000.0,
                bounds_mm=(point(bounds[number, 0]), point(bounds[number, 1])),
                file=files[material.id].file,
                sha256=hashes[material.id],
                triangles=len(files[material.id].faces),
            )
        )
    return tuple(regions)


def point(values: FloatArray) -> Point:
    """Return three coordinates as plain numbers."""
    return float(values[0]), float(values[1]), float(values[2])
