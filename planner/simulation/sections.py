"""A bar from a plan: cross-sections of its printed shells, and the material of every slice."""

import hashlib
from pathlib import Path
from typing import Any

import numpy as np

from planner.arrays import FloatArray
from planner.errors import ArgumentError, FileError
from planner.formats.stl import decode_stl
from planner.geometry.columns import Grid, iterate_columns
from planner.geometry.fields.axis import project
from planner.geometry.mesh import Mesh
from planner.geometry.weld import weld
from planner.grading.blends.along import dithered_profile, is_dithered
from planner.palette import Palette
from planner.plan import Plan

__all__ = ["plan_sections"]

_ACROSS = 512  # voxels across the widest side of the section
_SLIVER = 1e-6  # of a layer: edges closer than this are one

Sections = tuple[FloatArray, FloatArray, FloatArray]


def plan_sections(folder: Path, plan: Plan, palette: Palette, *, slices: int) -> Sections:
    """Cut a plan's shells across the axis of its gradient.

    The shells are made into columns of voxels along the axis, and each layer of voxels is a
    slice, divided where bands of the plan meet, so that every slice has one material. An area is
    the count of voxels in the layer's mid-plane. Where cells of two materials lie among each other
    a slice has the mixture that they come to.

    Parameters
    ----------
    folder
        Where the plan's files are; not looked at where the plan still holds its shells.
    slices
        Layers over the axis.

    Returns
    -------
    edges_mm : (n + 1,)
        From 0, where the gradient begins.
    coordinate, area_mm2 : (n,)

    Raises
    ------
    ArgumentError
        The plan's field has no axis.
    FileError
        A shell is missing, or is not the one that the plan was written with.
    UnknownNameError
        The palette lacks a material of the plan.
    """
    direction, start_mm, span_mm = _axis(plan.gradient.field)
    mesh = _turned(_shells(folder, plan), direction)
    grid = _grid(mesh, start_mm, span_mm, slices)
    counts = np.zeros(slices, dtype=np.int64)
    for columns in iterate_columns(mesh, grid):
        begun = np.bincount(columns.start, minlength=slices + 1)
        ended = np.bincount(columns.stop, minlength=slices + 1)
        counts += np.cumsum(begun - ended)[:slices]
    layer_area_mm2 = counts * (grid.pitch_mm[0] * grid.pitch_mm[1])

    layers = np.linspace(0.0, span_mm, slices + 1)
    bands = np.array([region.field for region in plan.regions]) * span_mm
    edges = np.union1d(layers, np.clip(bands.ravel(), 0.0, span_mm))
    edges = edges[np.concatenate([[True], np.diff(edges) > _SLIVER * span_mm / slices])]
    centres = 0.5 * (edges[:-1] + edges[1:])
    layer = np.minimum((centres / span_mm * slices).astype(np.int64), slices - 1)
    region = np.clip(np.searchsorted(bands[:, 0], centres, side="right") - 1, 0, None)
    area = np.where(centres <= bands[region, 1], layer_area_mm2[layer], 0.0)
    if is_dithered(plan):
        return edges, np.interp(centres / span_mm, *dithered_profile(plan, palette)), area
    coordinates = np.array(
        [r.coordinate if r.material is None else palette.resolve(r.material).coordinate
         for r in plan.regions]
    )  # fmt: skip
    return edges, coordinates[region], area


def _axis(field: Any) -> tuple[tuple[float, float, float], float, float]:
    if field.get("name") != "axis":
        raise ArgumentError(
            f"the plan's field is {field.get('name')!r}; a bar is simulated along an axis: grade "
            "along one (--axis), or give a profile file"
        )
    try:
        x, y, z = (float(value) for value in field["direction"])
        start_mm, span_mm = float(field["start_mm"]), float(field["span_mm"])
    except (KeyError, TypeError, ValueError) as error:
        raise FileError(f"plan.json: gradient.field is not an axis: {error!r}") from error
    if not (0.0 < span_mm < np.inf and abs(x * x + y * y + z * z - 1.0) < 1e-6):
        raise FileError(
            f"plan.json: gradient.field: direction ({x:g}, {y:g}, {z:g}) must have length 1 and "
            f"span_mm {span_mm:g} be above 0; grade the part again"
        )
    return (x, y, z), start_mm, span_mm


def _shells(folder: Path, plan: Plan) -> Mesh:
    """Read all shells as one mesh; where two touch, their faces cancel in winding numbers."""
    soups = [decode_stl(shell.stl, shell.file) for shell in plan.shells]
    files = {} if soups else {region.file: region.sha256 for region in plan.regions}
    for file, expected in files.items():
        try:
            data = (folder / file).read_bytes()
        except OSError as error:
            raise FileError(
                f"{folder / file}: cannot be read ({error.strerror or error}); the plan's "
                "sections are cut from its STL files: keep them beside plan.json"
            ) from error
        if hashlib.sha256(data).hexdigest() != expected:
            raise FileError(
                f"{folder / file}: its content is not what the plan was written with; grade the "
                "part again"
            )
        soups.append(decode_stl(data, str(folder / file)))
    if not soups:
        raise FileError(f"{folder}: the plan has no regions; grade the part again")
    vertices, faces = weld(np.concatenate(soups).astype(np.float32))
    return Mesh(vertices.astype(np.float64), faces)


def _turned(mesh: Mesh, direction: tuple[float, float, float]) -> Mesh:
    """Turn a mesh so that `direction` becomes z, exactly where it is an axis of coordinates."""
    n = np.array(direction)
    across = np.zeros(3)
    across[(int(np.argmax(np.abs(n))) + 1) % 3] = 1.0
    first = across - (across @ n) * n
    first /= np.sqrt(first @ first)
    second = np.cross(n, first)
    rows = [project(mesh.vertices, row.tolist()) for row in (first, second, n)]
    return Mesh(np.stack(rows, axis=1), mesh.faces)


def _grid(mesh: Mesh, start_mm: float, span_mm: float, slices: int) -> Grid:
    """Return a grid that fits the section's bounding box with whole voxels."""
    (low_x, low_y, _), (high_x, high_y, _) = mesh.bounds_mm.tolist()
    width, height = high_x - low_x, high_y - low_y
    finest = max(width, height) / _ACROSS
    nx, ny = (max(1, int(np.ceil(side / finest))) for side in (width, height))
    return Grid(
        (low_x, low_y, start_mm), (width / nx, height / ny, span_mm / slices), (nx, ny, slices)
    )
