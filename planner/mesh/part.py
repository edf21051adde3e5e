"""A part to grade: a mesh checked and repaired, and where it is placed."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from planner.errors import ArgumentError, MeshError, did_you_mean
from planner.formats.units import QUANTITY_UNITS
from planner.mesh.mesh import (
    Mesh,
    Topology,
    cancel_opposite,
    compact,
    repeats_index,
    weld,
    weld_points,
)
from planner.mesh.repair import READINGS, arrange_bodies, close_mesh, describe_faults, find_crossing
from planner.numerics import FloatArray, IntArray

__all__ = ["Part", "fits_turned", "make_part", "oversize", "part_from_arrays", "place", "undersize"]


# ------------------------------------------------------------------------------------------------
# Move a part to where the single precision of mesh files is finest and never negative.


def place(mesh: Mesh) -> tuple[Mesh, FloatArray]:
    """Move a part's smallest corner to (1, 1, 1) mm and round it to float32.

    Slicing programs of jetting printers want positive coordinates, and rounding before cutting
    makes one part, and so interfaces that match, of what is cut. Where rounding there takes too
    much of the volume, as of thin plates that lie askew, the part is moved on by up to a step of
    float32, to where it takes least. Vertices that round to one position are joined, faces that
    thereby repeat a vertex are dropped, and faces that thereby cover another turned over cancel.

    Parameters
    ----------
    mesh : Mesh
        The part, in mm.

    Returns
    -------
    placed : Mesh
        Vertices are float32 values; no two are equal.
    translation_mm : (3,) float64
        What was added to every vertex before rounding.

    Raises
    ------
    MeshError
        Without faces, or with a coordinate that is not finite.
    """
    if len(mesh.faces) == 0:
        raise MeshError("the mesh has no triangles; export the part again as a solid")
    if not np.isfinite(mesh.vertices).all():
        row = int(np.flatnonzero(~np.isfinite(mesh.vertices).all(axis=1))[0])
        raise MeshError(
            f"vertex {row} is {tuple(mesh.vertices[row].tolist())}: coordinates must be finite "
            "numbers of mm; export the part again"
        )
    translation_mm = 1.0 - mesh.bounds_mm[0]
    placed = _rounded(mesh, translation_mm)
    if abs(placed.volume_mm3 - mesh.volume_mm3) > _VOLUME_TAKEN * mesh.volume_mm3:
        nearer_mm = _least_taken(mesh, translation_mm)
        moved = _rounded(mesh, nearer_mm)
        if abs(moved.volume_mm3 - mesh.volume_mm3) < abs(placed.volume_mm3 - mesh.volume_mm3):
            placed, translation_mm = moved, nearer_mm
    if len(placed.faces) == 0:
        raise MeshError(
            "nothing is left of the mesh in single precision: the part has no thickness, or its "
            "unit is wrong; check the unit, or scale the part"
        )
    return placed, translation_mm


_VOLUME_TAKEN = 2.5e-7
"""Of the volume: a quarter of what the checks of a plan allow; the rest is for the points that
cuts add. Parts whose walls are thicker than some mm stay below it wherever they are."""

_PLACES = 16
"""Places along each axis that are tried, over one step of float32. The volume that rounding takes
is, to first order, a sum of one term an axis: of 16^3 sums the smallest is some thousandth of
one."""


def _rounded(mesh: Mesh, translation_mm: FloatArray) -> Mesh:
    """Move a mesh, round it to float32, and join what has become equal."""
    rounded = (mesh.vertices + translation_mm).astype(np.float32)
    vertices, index = weld_points(rounded)
    faces = index[mesh.faces]
    faces = faces[~repeats_index(faces)]
    faces = faces[cancel_opposite(faces)]
    used, faces = compact(faces, len(vertices))
    return Mesh(vertices[used].astype(np.float64), faces)


def _least_taken(mesh: Mesh, translation_mm: FloatArray) -> FloatArray:
    """Return the translation, up to a step of float32 further, whose rounding takes least volume.

    A vertex moved by rounding takes the scalar product of its way with the volume's gradient, which
    is a third of the summed normals of its faces, as long as their areas.
    """
    a, b, c = mesh.triangles.transpose(1, 0, 2)
    normals = np.cross(b - a, c - a) / 6.0
    moved = mesh.vertices + translation_mm
    steps = np.spacing(moved.max(axis=0).astype(np.float32)).astype(np.float64)
    further = steps[:, None] * np.arange(_PLACES) / _PLACES
    taken = np.empty((3, _PLACES))
    for axis in range(3):
        pull = np.bincount(mesh.faces.ravel(), np.repeat(normals[:, axis], 3), minlength=len(moved))
        for place in range(_PLACES):
            wanted = moved[:, axis] + further[axis, place]
            taken[axis, place] = pull @ (wanted.astype(np.float32) - wanted)
    sums = np.abs(taken[0][:, None, None] + taken[1][:, None] + taken[2])
    best = np.unravel_index(int(np.argmin(sums)), sums.shape)
    return np.asarray(translation_mm + further[np.arange(3), best])


# ------------------------------------------------------------------------------------------------
# A part to grade: a mesh that was checked, and repaired where there is one way to do so.


_FARTHEST_MM = 1e6
_LIKELY_MM = (5.0, 300.0)
_LIKELY_UNITS = ("mm", "inch", "cm", "m", "um")


@dataclass(frozen=True, slots=True)
class Part:
    """A closed part in mm, right side out.

    Attributes
    ----------
    mesh
        Every directed edge occurs once, and so does its reverse.
    name
        What messages and files call it.
    repairs
        What was changed, a sentence each; empty for a mesh taken as it was.
    warnings
        What looks wrong but was left: size and unit.
    """

    mesh: Mesh
    name: str
    repairs: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()


def make_part(
    triangles: FloatArray,
    *,
    name: str,
    tray_mm: tuple[float, float, float] | None = None,
    bodies: str | None = None,
) -> Part:
    """Check a triangle soup and make a part of it.

    Repairs are made only where there is one way to do so, or where `bodies` chooses one, and each
    is told: see `planner.mesh.repair.close_mesh` and `planner.mesh.repair.arrange_bodies`. Bodies
    that touch along an edge alone are refused: such a contact has no cross-section to print,
    and files store it as an edge of four faces, which is no solid's.

    Found by rays along z (see `planner.mesh.repair.find_crossing`), not proved: a body
    that crosses itself. Not looked for: bodies that touch at a point.

    Parameters
    ----------
    triangles : (k, 3, 3) float64
        Corners in mm, counter-clockwise as seen from outside.
    name
        What errors call the part.
    tray_mm
        Largest part the printer takes, for a warning.
    bodies
        What bodies are whose winding does not tell: ``cavities`` or ``solids``.

    Raises
    ------
    ArgumentError
        Another word for `bodies`.
    MeshError
        Empty, not finite, open, without volume, crossing itself, or more than two faces at an
        edge; or its volume depends on `bodies`. The message says how many, where, and what to do.
    """
    if bodies is not None and bodies not in READINGS:
        hint = did_you_mean(bodies, READINGS)
        raise ArgumentError(f"`bodies` {bodies}: {hint}it may be {' or '.join(READINGS)}")
    _check_numbers(triangles, name)
    vertices, welded = weld(np.ascontiguousarray(triangles, dtype=np.float64))
    faces = welded[~repeats_index(welded)]
    repairs = []
    if len(faces) < len(welded):
        count = len(welded) - len(faces)
        repairs.append(f"{count} triangles with two equal corners dropped")
    topology = Topology(faces)
    touching = False
    if not topology.closed:
        repaired = close_mesh(vertices, faces)
        if repaired is None:
            raise MeshError(f"{name}: {describe_faults(vertices, topology)}")
        vertices, topology, touching = repaired.vertices, repaired.topology, repaired.touching
        repairs += repaired.notes
    try:
        arranged = arrange_bodies(vertices, topology, touching=touching, bodies=bodies)
    except MeshError as error:
        raise MeshError(f"{name}: {error}") from error
    repairs += arranged.notes
    used, faces = compact(arranged.faces, len(arranged.vertices))
    mesh = Mesh(arranged.vertices[used], faces)
    _check_solid(mesh, name, reweld=arranged.vertices is not vertices or touching)
    return Part(mesh, name, tuple(repairs), tuple(_size_warnings(mesh, tray_mm)))


def part_from_arrays(
    vertices: FloatArray,
    faces: IntArray,
    *,
    name: str = "part",
    tray_mm: tuple[float, float, float] | None = None,
    bodies: str | None = None,
) -> Part:
    """Make a part of vertices (n, 3) in mm and faces (m, 3); see `make_part`.

    Raises
    ------
    ArgumentError
        Arrays of another shape, or an index outside the vertices.
    MeshError
        See `make_part`.
    """
    points, index = np.asarray(vertices, dtype=np.float64), np.asarray(faces)
    if points.ndim != 2 or points.shape[1] != 3 or index.ndim != 2 or index.shape[1] != 3:
        raise ArgumentError(
            f"{name}: vertices are {points.shape} and faces {index.shape}; they must be (n, 3) "
            "and (m, 3)"
        )
    if index.size and not 0 <= index.min() <= index.max() < len(points):
        raise ArgumentError(
            f"{name}: faces name vertices {index.min()} to {index.max()}; there are {len(points)}, "
            "counted from 0"
        )
    return make_part(points[index.astype(np.int64)], name=name, tray_mm=tray_mm, bodies=bodies)


def _check_numbers(triangles: FloatArray, name: str) -> None:
    if triangles.size == 0:
        raise MeshError(f"{name}: holds no triangles; export the part again")
    largest = float(np.abs(triangles).max())
    if np.isnan(largest) or largest > _FARTHEST_MM:
        bad = ~(np.abs(triangles) <= _FARTHEST_MM)
        first = int(np.argmax(bad.any(axis=(1, 2))))
        raise MeshError(
            f"{name}: triangle {first + 1} has a coordinate of {triangles[first][bad[first]][0]} "
            f"mm; coordinates must be finite and at most {_FARTHEST_MM:g} mm: check the unit, or "
            "export the part again"
        )


def _check_solid(mesh: Mesh, name: str, *, reweld: bool) -> None:
    if len(mesh.faces) == 0 or mesh.volume_mm3 <= 0.0 or _is_flat(mesh):
        raise MeshError(
            f"{name}: encloses no volume; export it as a solid, with a thickness in every direction"
        )
    if reweld:
        vertices, faces = weld(mesh.triangles)
        topology = Topology(faces[~repeats_index(faces)])
        if not topology.closed:
            raise MeshError(f"{name}: {describe_faults(vertices, topology)}")
    crossing = find_crossing(mesh)
    if crossing is not None:
        x, y, z = crossing.place_mm
        raise MeshError(
            f"{name}: the surface crosses itself: ({x:.4g}, {y:.4g}, {z:.4g}) mm is enclosed "
            f"{crossing.times_inside} times over {crossing.length_mm:.3g} mm along z, in all about "
            f"{crossing.volume_mm3:.3g} mm3; unite or mend the part in the CAD program"
        )


def _is_flat(mesh: Mesh) -> bool:
    extent = float(np.ptp(mesh.bounds_mm, axis=0).max())
    return mesh.volume_mm3 <= 1e-9 * mesh.area_mm2 * extent


def _size_warnings(mesh: Mesh, tray_mm: tuple[float, float, float] | None) -> Iterator[str]:
    extent = mesh.bounds_mm[1] - mesh.bounds_mm[0]
    if tray_mm is not None and (extent > np.array(tray_mm)).any():
        tray = " x ".join(f"{length:g}" for length in tray_mm)
        hint = "; turn it to fit" if fits_turned(extent, tray_mm) else _unit_hint(extent)
        yield f"the part is {_size(extent)} mm, the tray {tray} mm{hint}"


def undersize(mesh: Mesh) -> str | None:
    """Ask whether a part whose unit no one stated is in mm; None where it is as large as most."""
    extent = np.ptp(mesh.bounds_mm, axis=0)
    if extent.max() >= _LIKELY_MM[0]:
        return None
    return f"the part is {_size(extent)} mm{_unit_hint(extent)}"


def _size(extent: FloatArray, digits: int = 4) -> str:
    return " x ".join(f"{length:.{digits}g}" for length in extent)


def fits_turned(extent_mm: FloatArray, tray_mm: tuple[float, float, float]) -> bool:
    """Tell whether a part of some extent, turned by right angles as it best may be, fits a tray.

    How a part lies best on the diagonal, no program knows that does not know what else is to be
    printed.
    """
    return bool((np.sort(extent_mm) <= np.sort(np.array(tray_mm))).all())


def oversize(mesh: Mesh, tray_mm: tuple[float, float, float], unit: str) -> str | None:
    """Say that a part, whose figures are in a unit, fits no way round into a tray; None if it does.

    See `fits_turned`.
    """
    extent = np.ptp(mesh.bounds_mm, axis=0)
    if fits_turned(extent, tray_mm):
        return None
    tray = " x ".join(f"{length:g}" for length in tray_mm)
    hint = _unit_hint(extent, unit).replace("--unit", "`unit`")
    return f"the part is {_size(extent)} mm, too large for the tray of {tray} mm{hint}"


def _unit_hint(extent: FloatArray, stated: str = "mm") -> str:
    """Name the unit, not the stated one, in which the part would have the size of most parts."""
    (low, high), mm = _LIKELY_MM, QUANTITY_UNITS["length"]
    for unit in _LIKELY_UNITS:
        scale = mm[unit] / mm[stated]
        if unit != stated and low <= scale * extent.max() <= high:
            name = {"inch": "inches"}.get(unit, unit)
            return f"; in {name} it would be {_size(scale * extent, 3)} mm: --unit {unit}"
    return "; check its unit (--unit)"
