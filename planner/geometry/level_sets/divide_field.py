"""Divide a part along level sets, as pieces whose shells fit triangle for triangle."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.arrays import Float32Array, FloatArray
from planner.geometry.fields.field import Field
from planner.geometry.level_sets.fill import fill_loops
from planner.geometry.level_sets.grid import active_cells, field_grid, touched_cells
from planner.geometry.level_sets.lattice import Lattice, lattice_for
from planner.geometry.level_sets.loops import Loops, walk_faces
from planner.geometry.level_sets.marching import draw_level_sets, keep_off_levels
from planner.geometry.level_sets.meetings import Meetings, Surface, edges_of, meet
from planner.geometry.level_sets.sides import inside_part, order_points, piece_of_vertices
from planner.geometry.mesh import Mesh
from planner.geometry.weld import cancel_opposite, repeats_index, weld_points

__all__ = ["DividedField", "divide_along"]


@dataclass(frozen=True, eq=False)
class DividedField:
    """A part divided along level sets; the arrays are those of `planner.geometry.shells.Pieces`.

    Attributes
    ----------
    vertices, faces, piece, cap_faces, cap_level
        See there.
    broken : int
        Contradictions met on the way; with any, the shells are not closed.
    """

    vertices: Float32Array
    faces: NDArray[np.int32]
    piece: NDArray[np.int32]
    cap_faces: NDArray[np.int32]
    cap_level: NDArray[np.int32]
    broken: int


def divide_along(
    mesh: Mesh, field: Field, levels: FloatArray, pitch_mm: float, shift: FloatArray
) -> DividedField:
    """Divide a part along the level sets of a field, drawn on one grid.

    Parameters
    ----------
    mesh : Mesh
        Closed, at float32 positions.
    levels : (L,) float64
        Strictly increasing.
    shift : (3,) float64
        Place of the grid's corner below the part's, in pitches beyond one: 0 to 1.
    """
    origin_mm = mesh.bounds_mm[0] - (1.0 + shift) * pitch_mm
    cubes = np.floor((mesh.bounds_mm[1] - origin_mm) / pitch_mm + 1e-2).astype(int) + 1
    shape = (int(cubes[0]), int(cubes[1]), int(cubes[2]))
    offsets, cells = touched_cells(mesh, origin_mm, pitch_mm, shape)
    active = active_cells(mesh, origin_mm, pitch_mm, cells, shape)
    grid = field_grid(field, origin_mm, pitch_mm, active)
    keep_off_levels(grid, levels)
    lattice = lattice_for(mesh.bounds_mm, 4.0 * pitch_mm)
    sets = draw_level_sets(grid, levels, lattice)
    active.reshape(-1)[sets.cell] = 2
    part = _surface(mesh.vertices, mesh.faces, lattice)
    level = _surface(sets.vertices, sets.faces, lattice)
    values = grid.interpolate(mesh.vertices)
    del grid
    meetings = meet(part, level, sets.cell, offsets, cells, active.reshape(-1))

    on_part = order_points(meetings, True, len(part.edges.ends))
    on_level = order_points(meetings, False, len(level.edges.ends))
    piece = piece_of_vertices(part, meetings, on_part, levels, values)
    inside = inside_part(part, level, meetings, on_level, sets.cell, offsets, cells, shape)
    level_of = np.where(
        meetings.of_part, sets.level[np.where(meetings.of_part, meetings.face, 0)], 0
    )
    level_of = level_of.astype(np.int32)
    between = sets.level[meetings.segment_level]
    part_loops = walk_faces(
        part, piece, on_part, meetings.way, level_of, meetings.segment, meetings.segment_part,
        between,
    )  # fmt: skip
    level_loops = walk_faces(
        level, inside, on_level, meetings.way, np.zeros_like(level_of), meetings.segment,
        meetings.segment_level, np.zeros_like(between),
    )  # fmt: skip
    met = _positions(meetings, mesh.vertices, sets.vertices, part, level, lattice)

    # One pool: the part's vertices, the level sets', the meetings; equal positions joined.
    n, m = len(mesh.vertices), len(sets.vertices)
    pool, number = weld_points(
        np.concatenate([mesh.vertices.astype(np.float32), sets.vertices, met])
    )
    of_part = np.concatenate([number[:n], number[n + m :]])
    faces, label, _ = _divided(mesh.faces, piece, part_loops, of_part, pool)
    caps, kept, source = _divided(sets.faces, inside, level_loops, number[n:], pool)
    order = np.argsort(sets.level[source[kept == 1]], kind="stable")
    caps, source = caps[kept == 1][order], source[kept == 1][order]
    broken = meetings.broken + part_loops.broken + level_loops.broken
    return _compact(pool, faces, label, caps, sets.level[source], broken)


def _surface(
    vertices: FloatArray | Float32Array, faces: NDArray[np.int32], lattice: Lattice
) -> Surface:
    return Surface(lattice.integers(vertices), faces, edges_of(faces))


def _positions(
    meetings: Meetings, part_mm: FloatArray, level_mm: Float32Array, part: Surface,
    level: Surface, lattice: Lattice,
) -> Float32Array:  # fmt: skip
    """Place the meetings on their edges, rounded once."""
    found = np.empty((len(meetings.edge), 3), dtype=np.float32)
    for own, vertices, surface in ((True, part_mm, part), (False, level_mm, level)):
        chosen = meetings.of_part == own
        ends = surface.edges.ends[meetings.edge[chosen]]
        low = vertices[ends[:, 0]].astype(np.float64)
        high = vertices[ends[:, 1]].astype(np.float64)
        found[chosen] = lattice.rounded(low + meetings.along[chosen, None] * (high - low))
    return found


def _divided(
    faces: NDArray[np.int32], labels: NDArray[np.int32], loops: Loops, number: NDArray[np.int32],
    pool: Float32Array,
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]:  # fmt: skip
    """Faces that nothing meets as they are, the others divided; their labels and sources."""
    whole = np.ones(len(faces), dtype=np.bool_)
    whole[loops.face] = False
    cut = np.flatnonzero(~whole)
    normals = np.zeros((len(faces), 3))
    corners = pool[number[faces[cut]]].astype(np.float64)
    normals[cut] = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    new, label, source = fill_loops(loops.joined(number), pool, normals)
    found = np.concatenate([number[faces[whole]], new])
    label = np.concatenate([labels[faces[whole, 0]], label])
    source = np.concatenate([np.flatnonzero(whole), source])
    proper = ~repeats_index(found)
    return found[proper], label[proper], source[proper]


def _compact(
    pool: Float32Array, faces: NDArray[np.int32], piece: NDArray[np.int32],
    caps: NDArray[np.int32], cap_level: NDArray[np.int32], broken: int,
) -> DividedField:  # fmt: skip
    """Leave out what covers itself within a piece or an interface, and vertices without use."""
    keep = _cancel_by(faces, piece)
    faces, piece = faces[keep], piece[keep]
    keep = _cancel_by(caps, cap_level)
    caps, cap_level = caps[keep], cap_level[keep]
    used = np.zeros(len(pool), dtype=np.bool_)
    used[faces.ravel()] = True
    used[caps.ravel()] = True
    index = np.cumsum(used, dtype=np.int32) - np.int32(1)
    return DividedField(pool[used], index[faces], piece, index[caps], cap_level, broken)


def _cancel_by(faces: NDArray[np.int32], label: NDArray[np.int32]) -> NDArray[np.bool_]:
    keep = np.ones(len(faces), dtype=np.bool_)
    for value in np.unique(label):
        own = np.flatnonzero(label == value)
        keep[own] = cancel_opposite(faces[own])
    return keep
