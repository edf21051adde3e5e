"""Places where a closed solid, or the space around one, is thinner than a limit.

Found on a voxel grid as in `planner.geometry.printability`, then measured by inscribed balls
between the solid's own triangles, so that nothing of the limit or more is reported.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from planner.arrays import FloatArray, IntArray
from planner.geometry.inscribed import inscribed_ball
from planner.geometry.kernel import kernel
from planner.geometry.mesh import Mesh
from planner.geometry.solid_words import solid_words
from planner.geometry.thin_places import Place, Raster, places_in, raster_for

__all__ = ["SOUND", "ThinPlace", "room_mm", "thin_solid_places", "thin_space_places"]

SOUND = 0.98
"""Of a limit: what is drawn at the limit comes out rounded."""

_MOST_WORK = {5: 500_000, 4: 1_000_000, 3: 4_000_000}
_EVERYWHERE = np.array([0.0, 0.0, 1.0]), -np.inf, np.inf


@dataclass(frozen=True)
class ThinPlace:
    """A place thinner than a limit, over a length of more than the limit.

    Attributes
    ----------
    place_mm
        Where it has `size_mm`.
    size_mm, least_mm
        Upper quartile and least of the diameters of balls that fit at points spread over it.
    extent_mm, volume_mm3
        Bounding box and volume, in whole voxels.
    alone
        Whether it is a piece by itself.
    """

    place_mm: tuple[float, float, float]
    size_mm: float
    least_mm: float
    extent_mm: tuple[float, float, float]
    volume_mm3: float
    alone: bool


def thin_solid_places(
    mesh: Mesh, limit_mm: float, *, listed: int, widest_passed_mm: float = 0.0
) -> tuple[list[ThinPlace], int]:
    """Find where a closed solid is thinner than a limit.

    The grid's pitch is limit / 11 for parts of some millimetres, / 9 and / 7 up to a few
    centimetres, and / 5 beyond. What is as thick as the limit is never reported. A layer thinner
    than 0.85 of it (0.8, 0.75, 0.6 on coarser grids) always is, in whatever direction it lies,
    if it reaches further than the limit; in between it depends on how it lies on the grid. Sharp
    edges down to about 40 degrees pass.

    Parameters
    ----------
    widest_passed_mm
        Places that extend less than this in two directions pass, and separate pieces that do so
        in all three: edges that taper, where level sets graze a surface.

    Returns
    -------
    places : list of ThinPlace
        Up to `listed`, by falling volume.
    more : int
        Places that were found and not measured.
    """
    raster = raster_for(mesh.bounds_mm[0], mesh.bounds_mm[1], limit_mm, _MOST_WORK)
    widest = widest_passed_mm / raster.grid.pitch_mm[0]
    places = [
        place
        for place in places_in(solid_words(mesh, raster), raster)
        if np.sort(place.high - place.low)[2 if place.alone else 1] >= widest
    ]
    places.sort(key=lambda p: (-p.voxels, *p.low.tolist()))
    found: list[ThinPlace] = []
    for seen, place in enumerate(places):
        if len(found) == listed:
            return found, len(places) - seen
        measured = _measured(mesh, raster, place, limit_mm)
        if measured is not None:
            found.append(measured)
    return found, 0


def thin_space_places(mesh: Mesh, limit_mm: float, *, listed: int) -> tuple[list[ThinPlace], int]:
    """Find where empty space between surfaces of a closed solid, or within, is narrow.

    As `thin_solid_places`, of a box around the solid without the solid.
    """
    margin_mm = 4.0 * limit_mm
    corners = np.array(np.meshgrid([0, 1], [0, 1], [0, 1], indexing="ij")).reshape(3, 8).T
    low, high = mesh.bounds_mm + np.array([[-margin_mm], [margin_mm]])
    box = np.array(
        [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
         [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]],
        dtype=np.int32,
    )  # fmt: skip
    around = Mesh(
        np.concatenate([low + corners * (high - low), mesh.vertices]),
        np.concatenate([box, mesh.faces[:, ::-1] + np.int32(8)]),
    )
    return thin_solid_places(around, limit_mm, listed=listed)


def room_mm(
    mesh: Mesh, points_mm: FloatArray, step_mm: float, limit_mm: float
) -> tuple[FloatArray, FloatArray]:
    """Return centres (n, 3) and diameters of the largest balls that fit near points (n, 3).

    Diameters of the limit and more are not told apart; outside the solid they are zero.
    """
    reach_mm = 0.55 * limit_mm
    around = reach_mm + 2.5 * step_mm
    low, high = points_mm.min(axis=0) - around, points_mm.max(axis=0) + around
    near = np.empty(len(mesh.faces), dtype=np.int64)
    near = near[: _within(mesh.vertices, mesh.faces, low, high, near)]
    faces = mesh.faces[near]
    centres, diameters = np.empty((len(points_mm), 3)), np.empty(len(points_mm))
    for i, point in enumerate(points_mm):
        centres[i], radius = inscribed_ball(
            mesh.vertices, faces, np.ascontiguousarray(point), *_EVERYWHERE, step_mm, reach_mm
        )
        diameters[i] = 2.0 * radius
    return centres, diameters


def _measured(mesh: Mesh, raster: Raster, place: Place, limit_mm: float) -> ThinPlace | None:
    pitch_mm = raster.grid.pitch_mm[0]
    voxels: IntArray = np.concatenate([place.deepest[None], place.core])
    points = np.array([raster.position_mm(voxel) for voxel in voxels])
    centres, diameters = room_mm(mesh, points, 1.5 * pitch_mm, limit_mm)
    order = np.argsort(diameters, kind="stable")
    middle = order[3 * len(order) // 4]  # points at its rim have less room
    if diameters[middle] >= SOUND * limit_mm:
        return None
    extent = np.empty(3)
    extent[raster.order] = (place.high - place.low) * pitch_mm
    x, y, z = centres[middle].tolist()
    return ThinPlace(
        place_mm=(x, y, z),
        size_mm=float(diameters[middle]),
        least_mm=float(diameters[order[0]]),
        extent_mm=(float(extent[0]), float(extent[1]), float(extent[2])),
        volume_mm3=place.voxels * raster.grid.voxel_mm3,
        alone=place.alone,
    )


@kernel
def _within(vertices: Any, faces: Any, low: Any, high: Any, found: Any) -> Any:
    # Faces whose boxes meet a box.
    n = 0
    for f in range(faces.shape[0]):
        apart = False
        for d in range(3):
            a, b, c = vertices[faces[f, 0], d], vertices[faces[f, 1], d], vertices[faces[f, 2], d]
            apart |= min(a, b, c) > high[d] or max(a, b, c) < low[d]
        if not apart:
            found[n] = f
            n += 1
    return n
