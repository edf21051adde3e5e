"""How many triangles dealt cells come to, before they are cut."""

import math

import numpy as np

from planner.errors import ArgumentError
from planner.geometry.columns import dense, grid_for, iterate_columns
from planner.geometry.dither.bevelled import blue_noise_bevelled
from planner.geometry.mesh import Mesh
from planner.grading.blends.dither import DealtField

__all__ = ["MOST_TRIANGLES", "check_size", "estimated_triangles"]

MOST_TRIANGLES = 8_000_000
"""Of all shells together: files of 400 MB, a minute or two and some GB to make."""

_SAMPLES = 200_000
_SURFACE_TRIANGLES = 20.0  # a square of the part's surface, at half the cells; measured


def check_size(mesh: Mesh, dealt: DealtField) -> None:
    """Refuse cells that are too small for a part.

    Raises
    ------
    ArgumentError
        There would be more than `MOST_TRIANGLES`; a cell that gives fewer is named.
    """
    inner, surface = estimated_triangles(mesh, dealt)
    triangles = inner + surface
    if triangles <= MOST_TRIANGLES:
        return
    larger = 1.0  # times the cell: inner ones fall with its cube, others with its square
    while inner / larger**3 + surface / larger**2 > MOST_TRIANGLES:
        larger *= 1.01
    coarser = math.ceil(dealt.cell_mm * larger * 20.0) / 20.0
    raise ArgumentError(
        f"--cell {dealt.cell_mm:g}: this part has {mesh.volume_mm3 / dealt.cell_mm**3:.2g} cells "
        f"of that size, whose shells would have some {triangles:.2g} triangles; up to "
        f"{MOST_TRIANGLES:.2g} are possible: take --cell {coarser:g} or larger, or --blend bands:4"
    )


def estimated_triangles(mesh: Mesh, dealt: DealtField) -> tuple[float, float]:
    """Estimate the triangles of all shells from a sample: inside the part, and at its surface."""
    extent_mm = np.ptp(mesh.bounds_mm, axis=0)
    pitch_mm = max(float(np.cbrt(extent_mm.prod() / _SAMPLES)), float(extent_mm.max()) / 16000.0)
    table = blue_noise_bevelled()
    count, drawn = 0, 0.0
    grid = grid_for(mesh.bounds_mm, pitch_mm)
    for columns in iterate_columns(mesh, grid):
        index = np.argwhere(dense(columns)).astype(np.float64)
        index[:, 1] += columns.first_row
        points_mm = np.array(grid.origin_mm) + (index + 0.5) * pitch_mm
        share = table.dealt_for(dealt.wanted(points_mm)[1])
        drawn += float(np.interp(share, table.dealt, table.triangles_per_cell).sum())
        count += len(points_mm)
    if count == 0:  # walls thinner than the sample's pitch
        drawn, count = float(table.triangles_per_cell.max()), 1
    drawn /= count
    inner = 2.0 * drawn * mesh.volume_mm3 / dealt.cell_mm**3
    busy = drawn / float(table.triangles_per_cell.max())
    return inner, _SURFACE_TRIANGLES * busy * mesh.area_mm2 / dealt.cell_mm**2
