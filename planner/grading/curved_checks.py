"""Checks of a plan along a curved field: where its interfaces lie, and its voxels."""

import numpy as np

from planner.arrays import FloatArray
from planner.geometry.columns import grid_for, iterate_columns
from planner.geometry.fields import Field
from planner.geometry.mesh import Mesh
from planner.geometry.shells import Pieces, shell_faces
from planner.grading.findings import voxel_check, voxel_mm
from planner.grading.interface_error import interface_error_mm
from planner.plan import Check, Finding
from planner.printers import Printer

__all__ = ["interface_checks", "voxel_checks"]


def interface_checks(
    pieces: Pieces, field: Field, levels: FloatArray, pitch_mm: float, mesh: Mesh,
    volumes_mm3: FloatArray, machine: Printer,
) -> tuple[dict[str, Check], tuple[Finding, ...]]:  # fmt: skip
    """Measure interfaces against the field, and pieces against the printer's voxels.

    Returns
    -------
    checks : dict
        ``interface_error_mm``: distance from their level sets that 90 % of the interfaces' area
        keeps; at most half a pitch is wanted. ``voxel_volume_error``: see
        `planner.grading.findings.print_checks`.
    findings : tuple of Finding
        What to do where an interface is too far off.
    """
    error_mm = interface_error_mm(pieces, field, levels, pitch_mm)
    checks = {"interface_error_mm": Check(error_mm, pitch_mm / 2, error_mm <= pitch_mm / 2)}
    findings: list[Finding] = []
    if error_mm > pitch_mm / 2:
        findings.append(
            Finding(
                kind="pitch",
                message=f"interfaces lie {error_mm:.2g} mm or more from where the field has them: "
                f"the field bends within a pitch of {pitch_mm:g} mm; take a finer --pitch",
                size_mm=error_mm,
            )
        )
    checks |= voxel_checks(pieces, mesh, volumes_mm3, machine)
    return checks, tuple(findings)


def voxel_checks(
    pieces: Pieces, mesh: Mesh, volumes_mm3: FloatArray, machine: Printer
) -> dict[str, Check]:
    """Hold the pieces of a part that fits the tray, nearly, against the printer's voxels."""
    if not bool((np.ptp(mesh.bounds_mm, axis=0) <= 2.0 * np.array(machine.tray_mm)).all()):
        return {}
    voxel = voxel_mm(mesh, machine)
    grid = grid_for(mesh.bounds_mm, voxel.tolist())
    counted = np.zeros(pieces.count)
    for number in range(pieces.count):
        faces = shell_faces(pieces, [number])
        if len(faces):
            shell = Mesh(pieces.vertices.astype(np.float64), faces)
            counted[number] = sum(c.voxels for c in iterate_columns(shell, grid))
    counted *= grid.voxel_mm3
    return {"voxel_volume_error": voxel_check(counted, volumes_mm3, mesh, voxel)}
