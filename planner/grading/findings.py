"""What of a plan will not print as drawn, with its place and size."""

from collections.abc import Sequence

import numpy as np

from planner.arrays import FloatArray
from planner.geometry.columns import MOST_VOXELS, grid_for, iterate_columns
from planner.geometry.fields import Field, PlanarField
from planner.geometry.labels import label_columns, label_volumes_mm3
from planner.geometry.mesh import Mesh
from planner.geometry.printability import Finding as Place
from planner.geometry.printability import longest_checked_mm, thin_walls
from planner.plan import Check, Finding
from planner.printers import Printer

__all__ = ["print_checks", "voxel_check", "voxel_mm"]


def print_checks(
    mesh: Mesh,
    field: Field,
    levels: Sequence[float],
    materials: Sequence[str],
    volumes_mm3: FloatArray,
    machine: Printer,
) -> tuple[dict[str, Check], tuple[Finding, ...]]:
    """Hold a placed part against the printer: tray, minimum wall, native voxels.

    `levels` divide it into pieces of `materials` and `volumes_mm3`.

    Returns
    -------
    checks : dict
        ``tray_excess_mm``: how far the part reaches beyond the tray at worst.
        ``places_too_thin``: walls and fragments below the minimum wall.
        ``voxel_volume_error``: volume of each piece in the printer's own voxels against
        `volumes_mm3`, of the part's volume, at worst. A voxel is counted wrongly only where the
        surface passes within half its diagonal, which is the limit. Voxels are coarser than the
        printer's where a part over the tray would need more than can be numbered.

        Walls and voxels of a curved field are not checked here, see
        `planner.grading.curved_checks`, nor are those of a part that is far over the tray; the
        findings then say so: its unit is wrong.
    findings : tuple of Finding
        In words, the tray first. Places are in the coordinates of the files.
    """
    checks, findings = {}, []
    extent_mm = mesh.bounds_mm[1] - mesh.bounds_mm[0]
    excess_mm = float((extent_mm - np.array(machine.tray_mm)).max())
    checks["tray_excess_mm"] = Check(max(excess_mm, 0.0), 0.0, excess_mm <= 0.0)
    if excess_mm > 0.0:
        findings.append(_too_large(extent_mm, machine))
    longest_mm = longest_checked_mm(machine.minimum_wall_mm)
    if excess_mm > max(machine.tray_mm) or (excess_mm > 0.0 and extent_mm.max() > longest_mm):
        findings.append(_unchecked(machine))
        return checks, tuple(findings)
    if not isinstance(field, PlanarField):
        return checks, tuple(findings)
    places = thin_walls(mesh, field, levels, materials, machine.minimum_wall_mm)
    count = sum(1 + place.more for place in places)
    checks["places_too_thin"] = Check(count, 0, count == 0)
    findings += [_too_thin(place, materials[place.label], machine) for place in places]
    checks["voxel_volume_error"] = _voxel_check(mesh, field, levels, volumes_mm3, machine)
    return checks, tuple(findings)


def _too_large(extent_mm: FloatArray, machine: Printer) -> Finding:
    size = " x ".join(f"{length:.1f}" for length in extent_mm)
    tray = " x ".join(f"{length:g}" for length in machine.tray_mm)
    turned = (np.sort(extent_mm) <= np.sort(np.array(machine.tray_mm))).all()
    cure = "turn it to fit" if turned else "scale or divide the part, or check its unit"
    return Finding(
        kind="tray",
        message=f"the part is {size} mm, larger than the tray of {machine.title}, {tray} mm; "
        f"{cure}",
        size_mm=float(extent_mm.max()),
    )


def _unchecked(machine: Printer) -> Finding:
    return Finding(
        kind="unchecked",
        message=f"walls and voxels were not checked: the part is far over the tray of "
        f"{machine.title}; check its unit",
    )


def _too_thin(place: Place, material: str, machine: Printer) -> Finding:
    where = ", ".join(f"{coordinate:.2f}" for coordinate in place.place_mm)
    extent = " x ".join(f"{length:.2f}" for length in place.extent_mm)
    what = "a wall" if place.kind == "thin-wall" else "a separate fragment"
    more = f"; and {place.more} more places of {material}" if place.more else ""
    return Finding(
        kind=place.kind,
        message=f"{material}: {what} of {place.size_mm:.2f} mm at ({where}) mm over {extent} mm is "
        f"below the minimum wall of {machine.minimum_wall_mm:g} mm{more}",
        material=material,
        place_mm=place.place_mm,
        size_mm=place.size_mm,
    )


def _voxel_check(
    mesh: Mesh, field: Field, levels: Sequence[float], volumes_mm3: FloatArray, machine: Printer
) -> Check:
    pitch_mm = voxel_mm(mesh, machine)
    counted_mm3 = np.zeros(len(levels) + 1)
    for columns in iterate_columns(mesh, grid_for(mesh.bounds_mm, pitch_mm.tolist())):
        labelled = label_columns(columns, field, levels)
        counted_mm3 += label_volumes_mm3(labelled, len(levels) + 1)
    return voxel_check(counted_mm3, volumes_mm3, mesh, pitch_mm)


def voxel_mm(mesh: Mesh, machine: Printer) -> FloatArray:
    """Return the printer's voxel, or a larger one where the part has too many to number."""
    native_mm = np.array([*machine.pixel_mm, machine.layer_mm])
    extent_mm = np.ptp(mesh.bounds_mm, axis=0)
    return native_mm * max(1.0, float((extent_mm / native_mm).max()) / (MOST_VOXELS - 1))


def voxel_check(
    counted_mm3: FloatArray, volumes_mm3: FloatArray, mesh: Mesh, pitch_mm: FloatArray
) -> Check:
    """Hold volumes counted in voxels against those of the pieces."""
    error = float(np.abs(counted_mm3 - volumes_mm3).max()) / mesh.volume_mm3
    limit = mesh.area_mm2 * float(np.linalg.norm(pitch_mm)) / mesh.volume_mm3
    return Check(error, limit, error <= limit)
