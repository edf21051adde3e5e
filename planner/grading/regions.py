"""Bands of the part as shells to print and regions to report."""

import hashlib
from collections.abc import Sequence
from typing import Any

import numpy as np

from planner.arrays import FloatArray
from planner.formats.stl import encode_stl
from planner.geometry.shells import Pieces, piece_bounds_mm, piece_volumes_mm3, shell_faces
from planner.grading.bands import Band
from planner.grading.printed import Printed
from planner.plan import Point, Region, Shell
from planner.printers import Printer

__all__ = ["mixed", "point", "regions_of", "shells_of"]


def shells_of(
    pieces: Pieces, printed: Sequence[Printed], at_strain: float, machine: Printer, name: str
) -> tuple[Shell, ...]:
    """Unite the pieces of each material or mixture into one shell set, from soft to hard."""
    names = np.array([what.name for what in printed])
    occupied = piece_volumes_mm3(pieces) > 0.0
    used_ones = {what.name: what for what, some in zip(printed, occupied, strict=True) if some}
    shells: list[Shell] = []
    for what in sorted(used_ones.values(), key=lambda what: what.coordinate):
        faces = shell_faces(pieces, np.flatnonzero(names == what.name))
        used, compact = np.unique(faces, return_inverse=True)
        vertices = pieces.vertices[used]
        faces = compact.reshape(-1, 3).astype(np.int32)
        file = f"stl/{name}__{len(shells) + 1:02d}_{what.name}.stl"
        shells.append(
            Shell(
                material=what.name,
                operator_name=what.operator_name,
                colour=what.colour,
                file=file,
                vertices=vertices,
                faces=faces,
                stl=encode_stl(vertices, faces, f"{name} {what.operator_name} unit=mm"),
                properties={
                    "coordinate": f"{what.coordinate:.9g}",
                    "modulus_MPa": f"{what.modulus_MPa:.9g}",
                    "at_strain": f"{at_strain:.9g}",
                    "operator_name": what.operator_name,
                    "base_resins": ", ".join(machine.base_resins),
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
    hashes = {shell.material: hashlib.sha256(shell.stl).hexdigest() for shell in shells}
    regions: list[Region] = []
    for number, (band, what) in enumerate(zip(steps, printed, strict=True)):
        if volumes[number] <= 0.0:
            continue
        low, high = band.target_MPa
        regions.append(
            Region(
                index=len(regions) + 1,
                material=what.material,
                coordinate=what.coordinate,
                field=(band.start, band.stop),
                target_modulus_MPa=(low, high),
                modulus_MPa=what.modulus_MPa,
                modulus_interval_MPa=what.interval_MPa,
                error=(what.modulus_MPa / high - 1.0, what.modulus_MPa / low - 1.0),
                volume_mm3=float(volumes[number]),
                mass_g=float(volumes[number]) * what.density_g_cm3 / 1000.0,
                bounds_mm=(point(bounds[number, 0]), point(bounds[number, 1])),
                file=files[what.name].file,
                sha256=hashes[what.name],
                triangles=len(files[what.name].faces),
                blend=mixed(what),
            )
        )
    return tuple(regions)


def mixed(what: Printed) -> dict[str, Any] | None:
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
