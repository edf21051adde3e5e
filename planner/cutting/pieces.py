"""Divide a part at levels of a field: planes or level sets, and the pieces that come of it."""

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from planner.cutting.grid import default_pitch_mm
from planner.cutting.level_sets import split_curved
from planner.cutting.planes import LATTICE_MM, caps, divide, snap_distance_mm
from planner.errors import ArgumentError
from planner.fields.basic import Field, PlanarField
from planner.mesh.mesh import Measures, Mesh, measure
from planner.numerics import Float32Array, FloatArray

__all__ = ["Pieces", "piece_bounds_mm", "piece_volumes_mm3", "shell_faces", "split"]


@dataclass(frozen=True, eq=False)
class Pieces:
    """A part divided at L levels into L + 1 pieces, softest to hardest along the field.

    Attributes
    ----------
    vertices : (n, 3) float32
        One pool for all pieces, in mm; no two positions are equal.
    faces : (k, 3) int32
        The part's surface, divided, with its orientation.
    piece : (k,) int32
        The piece each of `faces` belongs to.
    cap_faces : (c, 3) int32
        Interfaces, outwards for the piece below the level; turned over for the one above.
    cap_level : (c,) int32
        The level each of `cap_faces` lies in.
    count : int
        Number of pieces, L + 1; some may be empty.
    """

    vertices: Float32Array
    faces: NDArray[np.int32]
    piece: NDArray[np.int32]
    cap_faces: NDArray[np.int32]
    cap_level: NDArray[np.int32]
    count: int

    @cached_property
    def measures(self) -> Measures:
        """Volume, area and bounds of every piece."""
        faces = np.concatenate([self.faces, self.cap_faces, self.cap_faces[:, ::-1]])
        piece = np.concatenate([self.piece, self.cap_level, self.cap_level + np.int32(1)])
        return measure(self.vertices, faces, piece, self.count)


def split(
    mesh: Mesh, field: Field, levels: Sequence[float] | FloatArray, *,
    pitch_mm: float | None = None, within_mm: float = math.inf, follow: bool = True,
) -> Pieces:  # fmt: skip
    """Divide a part at levels of a field: in planes where its level sets are, else on a grid.

    Parameters
    ----------
    mesh : Mesh
        A closed part at float32 positions, as `planner.mesh.part.place` returns it.
    field : Field
        In the coordinates of `mesh`.
    levels : (L,) sequence of float
        Field values of the interfaces, strictly increasing in (0, 1).
    pitch_mm : float
        Of the grid on which curved level sets are drawn; see
        `planner.cutting.grid.default_pitch_mm`. Planes need none.
    within_mm
        The grid is divided where triangles would lie farther from their level set.
    follow
        Whether vertices lie where the field has its levels, or where it has them if linear
        between the grid's vertices.

    Returns
    -------
    Pieces
        Every piece's shell is closed, and both sides of an interface have the same triangles.

    Raises
    ------
    ArgumentError
        Levels out of order, out of range or too close to be told apart in float32; positions
        that float32 cannot hold; a pitch that is none or too fine; a field that is not finite.
    MeshError
        The part is open where a level meets it.
    """
    values = np.asarray(levels, dtype=np.float64)
    if values.ndim != 1 or not (
        np.isfinite(values).all() and (values > 0).all() and (values < 1).all()
    ):
        raise ArgumentError(f"levels {list(levels)}: every level must be a number between 0 and 1")
    if not (mesh.vertices.astype(np.float32) == mesh.vertices).all():
        raise ArgumentError(
            "the mesh has coordinates that float32 cannot hold; pass it through "
            "planner.mesh.part.place first"
        )
    if not isinstance(field, PlanarField):
        if not (np.diff(values) > 0).all():
            raise ArgumentError(f"levels {list(levels)}: they must increase")
        pitch_mm = default_pitch_mm(mesh) if pitch_mm is None else pitch_mm
        curved = split_curved(mesh, field, values, pitch_mm, within_mm, follow)
        return Pieces(
            curved.vertices,
            curved.faces,
            curved.piece,
            curved.cap_faces,
            curved.cap_level,
            len(values) + 1,
        )
    normal, offsets_mm = _planes(field, values)
    least_mm = 2.5 * snap_distance_mm(mesh.bounds_mm)
    close = np.flatnonzero(~(np.diff(offsets_mm) > least_mm))
    if len(close):
        i = int(close[0])
        raise ArgumentError(
            f"levels {values[i]:.9g} and {values[i + 1]:.9g} are "
            f"{offsets_mm[i + 1] - offsets_mm[i]:.3g} mm apart along the field: they must "
            f"increase by more than {least_mm:.3g} mm for this part; drop one of them"
        )
    divided = divide(mesh, normal, offsets_mm)
    vertices, cap_faces, cap_level = caps(divided, normal)
    return Pieces(vertices, divided.faces, divided.piece, cap_faces, cap_level, len(offsets_mm) + 1)


def _planes(field: PlanarField, levels: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return normal and offsets in mm; along a coordinate axis the offsets are float32 values."""
    normal = np.asarray(field.plane(0.0)[0], dtype=np.float64)
    offsets_mm = np.array([field.plane(level)[1] for level in levels.tolist()], dtype=np.float64)
    if np.count_nonzero(normal) == 1:
        offsets_mm = (np.rint(offsets_mm / LATTICE_MM) * LATTICE_MM).astype(np.float32)
    return normal, offsets_mm.astype(np.float64)


def shell_faces(pieces: Pieces, members: Collection[int]) -> NDArray[np.int32]:
    """Faces of the union of some pieces, outwards, as indices into the pool of vertices.

    Parameters
    ----------
    pieces : Pieces
        The divided part.
    members : collection of int
        Indices of the pieces to join.

    Returns
    -------
    (m, 3) int32
        The members' share of the surface, then interfaces with what is not a member.
    """
    chosen = np.zeros(pieces.count, dtype=np.bool_)
    chosen[list(members)] = True
    below, above = chosen[pieces.cap_level], chosen[pieces.cap_level + 1]
    return np.concatenate(
        [
            pieces.faces[chosen[pieces.piece]],
            pieces.cap_faces[below & ~above],
            pieces.cap_faces[above & ~below][:, ::-1],
        ]
    )


def piece_volumes_mm3(pieces: Pieces) -> FloatArray:
    """Volume of every piece in mm³, (count,); their sum is the part's volume."""
    return pieces.measures.volume_mm3


def piece_bounds_mm(pieces: Pieces) -> FloatArray:
    """Smallest and largest coordinates of every piece in mm, (count, 2, 3); NaN where empty."""
    found = pieces.measures.bounds_mm
    return np.where(np.isfinite(found), found, np.nan)
