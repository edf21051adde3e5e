"""A part to grade: a mesh checked, repaired where there is one way to do so, and placed."""

import hashlib
import itertools
import unicodedata
from collections import defaultdict
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from os import PathLike, fspath
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from planner.errors import ArgumentError, MeshError, check_known, refused
from planner.formats.mesh_file import read_mesh
from planner.formats.units import QUANTITY_UNITS, canonical_unit
from planner.glance import counted, place_text, sized
from planner.mesh.mesh import (
    Mesh,
    Topology,
    cancel_opposite,
    compact,
    connected,
    measure,
    order_edges,
    repeats_index,
    weld,
    weld_points,
)
from planner.numerics import BoolArray, FloatArray, Int32Array, IntArray, Point

__all__ = ["Part", "fits_turned", "make_part", "moved_to_corner", "open_part", "plain"]


# ------------------------------------------------------------------------------------------------
# Move a part to where the single precision of mesh files is finest and never negative.


def moved_to_corner(mesh: Mesh) -> tuple[Mesh, FloatArray]:
    """Move a part's smallest corner to (1, 1, 1) mm and round it to float32.

    Slicing programs of jetting printers want positive coordinates, and rounding before cutting
    makes one part, and so interfaces that match, of what is cut. Where rounding there takes too
    much of the volume, as of thin plates that lie askew, the part is moved on by up to a step of
    float32, to where it takes least. Vertices that round to one position are joined, faces that
    thereby repeat a vertex are dropped, and faces that thereby cover another turned over cancel.

    Parameters
    ----------
    mesh : Mesh
        The part, in mm, as `make_part` has it.

    Returns
    -------
    placed : Mesh
        Vertices are float32 values; no two are equal.
    translation_mm : (3,) float64
        What was added to every vertex before rounding.

    Raises
    ------
    MeshError
        Nothing is left of it in single precision.
    """
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
    vertices, index = weld_points((mesh.vertices + translation_mm).astype(np.float32))
    faces = index.take(mesh.faces)
    used, faces = compact(faces.compress(cancel_opposite(faces), axis=0), len(vertices))
    return Mesh(vertices.take(used, axis=0).astype(np.float64), faces)


def _least_taken(mesh: Mesh, translation_mm: FloatArray) -> FloatArray:
    """Return the translation, up to a step of float32 further, whose rounding takes least volume.

    A vertex moved by rounding takes the scalar product of its way with the volume's gradient, which
    is a third of the summed normals of its faces, as long as their areas.
    """
    normals = mesh.area_vectors_mm2 / 3.0
    moved = mesh.vertices + translation_mm
    steps = np.spacing(moved.max(axis=0).astype(np.float32)).astype(np.float64)
    further = steps[:, None] * np.arange(_PLACES) / _PLACES
    taken = np.empty((3, _PLACES))
    for axis in range(3):
        pull = np.bincount(mesh.faces.ravel(), np.repeat(normals[:, axis], 3), minlength=len(moved))
        for number in range(_PLACES):
            wanted = moved[:, axis] + further[axis, number]
            taken[axis, number] = pull @ (wanted.astype(np.float32) - wanted)
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
    file, sha256, unit
        Where it comes from, as a plan says it: the file and its unit, or those of arrays.
    """

    mesh: Mesh
    name: str
    repairs: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    file: str = ""
    sha256: str = ""
    unit: str = "mm"


def open_part(
    part: object,
    *,
    unit: str | None = None,
    name: str | None = None,
    tray_mm: Point | None = None,
    bodies: str | None = None,
    oversize: bool = True,
) -> Part:
    """Read and validate a part.

    Parameters
    ----------
    part
        Path, mesh with ``vertices`` and ``faces``, or pair (vertices, faces).
    tray_mm
        Largest part the printer takes, for a warning.
    bodies
        See `make_part`.
    oversize
        Take a part that the tray does not hold, whichever way it is turned.

    Raises
    ------
    MeshError, FileError
        The file or the mesh cannot be used; the message says where and what to do.
    ArgumentError
        Not a path, mesh or pair; or an unknown unit.
    """
    if isinstance(part, (str, PathLike)):
        path = Path(fspath(part))
        read = read_mesh(path, unit)
        triangles, notes, sha256, used = read.triangles, read.notes, read.sha256, read.unit
        called = _safe(path.stem if name is None else name)
        file = path.name.encode("utf-8", "replace").decode("utf-8")  # any bytes make a name
    else:
        called = file = _safe(name or "part")
        vertices, faces = _arrays(part, called)
        used, notes = canonical_unit(unit or "mm"), ()
        triangles = (vertices * QUANTITY_UNITS["length"][used])[faces]
        sha256 = hashlib.sha256(vertices.tobytes() + faces.tobytes()).hexdigest()
    made = make_part(triangles, name=called, bodies=bodies)
    made = replace(made, file=file, sha256=sha256, unit=used)
    asked = undersize(made.mesh) if unit is None and isinstance(part, (str, PathLike)) else None
    sizes = filter(None, (_beside_tray(made, tray_mm, oversize), asked))
    return replace(made, warnings=(*notes, *sizes))


def _beside_tray(part: Part, tray_mm: Point | None, oversize: bool) -> str | None:
    """Say that a part is larger than the tray; stop before the work if it fits no way round."""
    extent = np.ptp(part.mesh.bounds_mm, axis=0)
    if tray_mm is None or (extent <= np.array(tray_mm)).all():
        return None
    fits = fits_turned(extent, tray_mm)
    if not (fits or oversize):
        hint = _unit_hint(extent, part.unit).replace("--unit", "`unit`")
        raise MeshError(
            f"{part.file}: the part is {sized(extent)} mm, too large for the tray of "
            f"{sized(tray_mm, 'g')} mm{hint}; scale or divide the part, or take it as it is with "
            "`force_oversize`"
        )
    hint = "; turn it to fit" if fits else _unit_hint(extent)
    return f"the part is {sized(extent)} mm, the tray {sized(tray_mm, 'g')} mm{hint}"


def _arrays(part: object, name: str) -> tuple[FloatArray, IntArray]:
    """Return vertices (n, 3) and faces (m, 3) of a mesh, or of a pair of them.

    Raises
    ------
    ArgumentError
        Neither; arrays of another shape, or an index outside the vertices.
    """
    vertices = getattr(part, "vertices", None)
    faces = getattr(part, "faces", None)
    if vertices is None and isinstance(part, tuple) and len(part) == 2:
        vertices, faces = part
    try:
        points = np.ascontiguousarray(vertices, np.float64)
        index = np.ascontiguousarray(faces, np.int64)
    except (TypeError, ValueError):
        raise ArgumentError(
            "a part must be a path, a mesh with vertices (n, 3) and faces (m, 3), or a pair of "
            f"these arrays; got {type(part).__name__}"
        ) from None
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
    return points, index


def _safe(name: str) -> str:
    """Keep what any file system and any reader of STL headers takes."""
    plain = unicodedata.normalize("NFKD", str(name))  # an accent becomes a mark of its own
    bare = (c for c in plain if not unicodedata.combining(c))
    kept = "".join(c if c.isascii() and (c.isalnum() or c in "._-") else "-" for c in bare)
    return kept.strip(".-") or "part"


def make_part(triangles: FloatArray, *, name: str, bodies: str | None = None) -> Part:
    """Check a triangle soup and make a part of it.

    Repairs are made only where there is one way to do so, or where `bodies` chooses one, and each
    is told: see `_close_mesh` and `_arrange_bodies`. Bodies
    that touch along an edge alone are refused: such a contact has no cross-section to print,
    and files store it as an edge of four faces, which is no solid's.

    Found by rays along z (see `find_crossing`), not proved: a body
    that crosses itself. Not looked for: bodies that touch at a point.

    Parameters
    ----------
    triangles : (k, 3, 3) float64
        Corners in mm, counter-clockwise as seen from outside.
    name
        What errors call the part.
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
    if bodies is not None:
        check_known(bodies, _READINGS, f"`bodies` {bodies}: {{}}it may be")
    with refused(MeshError, name, "{}", MeshError):
        _check_numbers(triangles)
        vertices, faces = _welded(np.ascontiguousarray(triangles, dtype=np.float64))
        dropped = len(triangles) - len(faces)
        told = (f"{dropped} triangles with two equal corners dropped",) if dropped else ()
        state = _unfolded(_close_mesh(Repaired(vertices, Topology(faces), told)))
        points, arranged, repairs = _arrange_bodies(state, bodies)
        used, faces = compact(arranged, len(points))
        mesh = Mesh(points[used], faces)
        _check_solid(mesh, reweld=points is not state.vertices or state.touching)
    return Part(mesh, name, repairs)


def _welded(triangles: FloatArray) -> tuple[FloatArray, Int32Array]:
    """Index a triangle soup by position, and drop what has two equal corners."""
    vertices, faces = weld(triangles)
    return vertices, faces[~repeats_index(faces)]


def _check_numbers(triangles: FloatArray) -> None:
    if triangles.size == 0:
        raise MeshError("holds no triangles; export the part again")
    bad = ~(np.abs(triangles) <= _FARTHEST_MM)
    if bad.any():
        first = int(np.argmax(bad.any(axis=(1, 2))))
        raise MeshError(
            f"triangle {first + 1} has a coordinate of {triangles[first][bad[first]][0]} mm; "
            f"coordinates must be finite and at most {_FARTHEST_MM:g} mm: check the unit, or "
            "export the part again"
        )


def _check_solid(mesh: Mesh, *, reweld: bool) -> None:
    leaf_mm3 = _FLAT * mesh.area_mm2 * float(np.ptp(mesh.bounds_mm, axis=0).max())
    if len(mesh.faces) == 0 or mesh.volume_mm3 <= leaf_mm3:
        raise MeshError(
            "encloses no volume; export it as a solid, with a thickness in every direction"
        )
    if reweld:
        vertices, faces = _welded(mesh.triangles)
        topology = Topology(faces)
        if not topology.closed:
            raise MeshError(_describe_faults(vertices, topology))
    crossing = find_crossing(mesh)
    if crossing is not None:
        raise MeshError(
            f"the surface crosses itself: {place_text(crossing.place_mm)} is enclosed "
            f"{crossing.times_inside} times over {crossing.length_mm:.3g} mm along z, in all about "
            f"{crossing.volume_mm3:.3g} mm3; unite or mend the part in the CAD program"
        )


def undersize(mesh: Mesh) -> str | None:
    """Ask whether a part whose unit no one stated is in mm; None where it is as large as most."""
    extent = np.ptp(mesh.bounds_mm, axis=0)
    if extent.max() >= _LIKELY_MM[0]:
        return None
    return f"the part is {sized(extent)} mm{_unit_hint(extent)}"


def fits_turned(extent_mm: FloatArray, tray_mm: Point) -> bool:
    """Tell whether a part of some extent, turned by right angles as it best may be, fits a tray.

    How a part lies best on the diagonal, no program knows that does not know what else is to be
    printed.
    """
    return bool((np.sort(extent_mm) <= np.sort(np.array(tray_mm))).all())


def _unit_hint(extent: FloatArray, stated: str = "mm") -> str:
    """Name the unit, not the stated one, in which the part would have the size of most parts."""
    (low, high), mm = _LIKELY_MM, QUANTITY_UNITS["length"]
    for unit in _LIKELY_UNITS:
        scale = mm[unit] / mm[stated]
        if unit != stated and low <= scale * extent.max() <= high:
            name = {"inch": "inches"}.get(unit, unit)
            return f"; in {name} it would be {sized(scale * extent, '.3g')} mm: --unit {unit}"
    return "; check its unit (--unit)"


# ------------------------------------------------------------------------------------------------
# Take apart solids that meet at an edge: faces pair up around it so that each bounds solid.


_DIGITS = 9  # of an angle in radians: faces nearer than that lie on each other
_HALF_TURN = round(np.pi, _DIGITS)


def _ends(faces: Int32Array, half: int) -> tuple[int, int]:
    face, corner = divmod(half, 3)
    return int(faces[face, corner]), int(faces[face, (corner + 1) % 3])


def _pairs(
    vertices: FloatArray, faces: Int32Array, halves: list[int]
) -> list[tuple[int, int]] | None:
    """Pair the half-edges at an edge across the solid between their faces.

    With angles that grow from the first to the second axis across the edge, a face that runs
    along the edge has its solid before it, one that runs against it behind it: as brackets
    close and open.
    """
    edge = tuple(sorted(_ends(faces, halves[0])))
    along = vertices[edge[1]] - vertices[edge[0]]
    along = np.ldexp(along, -int(np.frexp(np.abs(along).max())[1]))  # or its square may be 0
    along = along / np.linalg.norm(along)
    first = np.cross(along, np.eye(3)[int(np.argmin(np.abs(along)))])
    second = np.cross(along, first)
    around = []
    for half in halves:
        face, corner = divmod(half, 3)
        arm = vertices[faces[face, (corner + 2) % 3]] - vertices[edge[0]]
        angle = round(float(np.arctan2(arm @ second, arm @ first)), _DIGITS)
        angle = abs(angle) if angle == -_HALF_TURN else angle
        opens = _ends(faces, half) != edge
        around.append((angle, opens, half))  # of equal angles the closing one first
    around.sort()
    balance = np.cumsum([1 if opens else -1 for _, opens, _ in around])
    if balance[-1] != 0:
        return None
    start = int(np.argmin(balance)) + 1
    pairs, opened, closed = list[tuple[int, int]](), list[int](), list[int]()
    for _, opens, half in around[start:] + around[:start]:
        (opened if opens else closed).append(half)
        if len(opened) == len(closed):  # out of the solid again
            # Where several solids overlap, files hold one after the other: pair in that order.
            pairs += zip(sorted(opened), sorted(closed), strict=True)
            opened, closed = [], []
    return pairs


# ------------------------------------------------------------------------------------------------
# Repairs of a welded mesh that have one possible outcome, tried until the mesh is closed.


_TOLERANCE = 1e-5
"""How far a repair may move a vertex, as a share of the part's largest extent."""

_MOST_BORDERS = 5000


@dataclass(frozen=True, eq=False)
class Repaired:
    """A mesh and what was done to it.

    Attributes
    ----------
    notes
        One sentence a repair.
    touching
        Bodies met at shared edges and were given vertices of their own: unite them.
    """

    vertices: FloatArray
    topology: Topology
    notes: tuple[str, ...] = ()
    touching: bool = False


_Repair: TypeAlias = Callable[[Repaired], Repaired | None]


def _close_mesh(state: Repaired) -> Repaired:
    """Make a mesh closed and consistently wound by plain repairs.

    Each repair is kept only where it changes something; none is kept unless the mesh is closed
    in the end: pairs of opposite faces, bodies that share the vertices of an edge at which they
    touch, faces that occur twice, border vertices within `_TOLERANCE` of each other or of
    another border edge, and faces turned over. Opposite faces of a solid and of a body wound
    inwards stay, each body with vertices of its own: whether that is a cavity is not decided here.

    Parameters
    ----------
    state
        Welded mesh without repeated indices.

    Raises
    ------
    MeshError
        The mesh stays open or crowded at edges.
    """
    if state.topology.closed:
        return state
    closed = _closed(state, (_opposites, *_STEPS))
    both_ways = _opposites_apart(state)
    apart = None if both_ways is None else _closed(both_ways, _STEPS)
    if apart is not None and _walls_a_cavity(apart):
        return replace(apart, touching=True)
    if closed is None:
        raise MeshError(_describe_faults(state.vertices, state.topology))
    return closed


def _closed(state: Repaired, steps: Iterable[_Repair]) -> Repaired | None:
    for repair in steps:
        if state.topology.closed:
            break
        state = repair(state) or state
    return state if state.topology.closed else None


def _next(state: Repaired, faces: Int32Array, note: str) -> Repaired:
    return Repaired(state.vertices, Topology(faces), (*state.notes, note))


def _counted(count: int, one: str, many: str) -> str:
    return f"{count} {one if count == 1 else many}"


def _duplicates(state: Repaired) -> Repaired | None:
    """Drop faces on the same vertices, the same way round, as an earlier one."""
    faces = state.topology.faces
    if len(state.topology.crowded_edges) == 0:
        return None
    first = np.sort(np.unique(_from_lowest(faces), axis=0, return_index=True)[1])
    count = len(faces) - len(first)
    if count == 0:
        return None
    note = _counted(count, "triangle that occurs", "triangles that occur") + " twice dropped"
    return _next(state, faces[first], note)


def _from_lowest(faces: Int32Array) -> Int32Array:
    """Name the lowest vertex of each face first, the same way round."""
    shift = np.argmin(faces, axis=1)[:, np.newaxis]
    return np.take_along_axis(faces, (shift + np.arange(3)) % 3, axis=1)


def _opposites(state: Repaired) -> Repaired | None:
    """Drop pairs of opposite faces: walls without thickness, or between bodies face to face."""
    faces = state.topology.faces
    keep = cancel_opposite(faces)
    count = int((~keep).sum()) // 2
    if count == 0 or not keep.any():
        return None
    pairs = _counted(count, "pair of opposite triangles", "pairs of opposite triangles")
    return _next(state, faces[keep], f"{pairs} dropped: a wall without thickness")


def _opposites_apart(state: Repaired) -> Repaired | None:
    """Lay opposite faces in two sheets, the first before and the second behind all others.

    Within a sheet neighbours agree, so that bodies of a file that mixes their faces come apart; and
    a sheet shares vertices with others at its rim alone. None where there are no opposite faces.
    """
    faces, count = state.topology.faces, len(state.vertices)
    keep = cancel_opposite(faces)
    if keep.all():
        return None
    pairs = _from_lowest(faces[~keep])
    corners = np.sort(pairs, axis=1)
    _, first, index = np.unique(corners, axis=0, return_index=True, return_inverse=True)
    sheet = Topology(pairs[first])
    turned = sheet.turned
    if turned is None:
        return None
    front = (pairs == _from_lowest(_turn(sheet.faces, turned))[index.ravel()]).all(axis=1)
    inner = np.ones(count, dtype=np.int32)
    inner[sheet.open_edges] = inner[sheet.crowded_edges] = 0
    own = count * inner[pairs]
    layers = [(pairs + own)[front], faces[keep], (pairs + 2 * own)[~front]]
    vertices = np.tile(state.vertices, (3, 1))
    return replace(state, vertices=vertices, topology=Topology(np.concatenate(layers)))


def _walls_a_cavity(state: Repaired) -> bool:
    """Tell whether opposite faces belong to two bodies, one of which is wound inwards."""
    volume, _, full = _measured(state.vertices, state.topology)
    sign = np.where(full, np.sign(volume), 0.0)[state.topology.body]
    faces = weld_points(state.vertices)[1][state.topology.faces]
    of_all, of_solids, of_cavities = (
        np.count_nonzero(~cancel_opposite(faces[which]))
        for which in (sign != 0.0, sign > 0.0, sign < 0.0)
    )
    return bool(of_all > of_solids + of_cavities)


def _near_vertices(state: Repaired) -> Repaired | None:
    """Join border vertices within the tolerance."""
    from scipy.spatial import cKDTree

    border = np.unique(state.topology.open_edges)
    if not 0 < len(border) <= _MOST_BORDERS:
        return None
    points = state.vertices[border]
    tolerance = _tolerance_mm(state.vertices)
    pairs = cKDTree(points).query_pairs(tolerance, output_type="ndarray")
    if len(pairs) == 0:
        return None
    group = connected(len(border), *pairs.T)
    _, first = np.unique(group, return_index=True)
    target = first[group]
    moved = np.linalg.norm(points - points[target], axis=1)
    if moved.max() > 2.0 * tolerance:  # a chain of near vertices is no point
        return None
    index = np.arange(len(state.vertices), dtype=np.int32)
    index[border] = border[target]
    faces = index[state.topology.faces]
    count = int((target != np.arange(len(border))).sum())
    vertices = _counted(count, "border vertex", "border vertices")
    note = f"{vertices} joined to others at most {moved.max():.2g} mm away"
    return _next(state, faces[~repeats_index(faces)], note)


def _junctions(state: Repaired) -> Repaired | None:
    """Divide border faces at vertices that lie on their edges."""
    count = 0
    for _ in range(3):  # a face has three edges, one is divided at a time
        faces, divided = _divide(state)
        if divided == 0:
            break
        count += divided
        state = replace(state, topology=Topology(faces))
    if count == 0:
        return None
    junctions = _counted(count, "edge that ends", "edges that end")
    return _next(state, faces, f"{junctions} on the middle of another joined to it")


def _divide(state: Repaired) -> tuple[Int32Array, int]:
    faces = state.topology.faces
    half = np.flatnonzero(state.topology.twin == Topology.OPEN)
    if not 0 < len(half) <= _MOST_BORDERS:
        return faces, 0
    tolerance = _tolerance_mm(state.vertices)
    border = np.unique(state.topology.open_edges)
    points = state.vertices[border]
    gone = np.zeros(len(faces), dtype=np.bool_)
    added: list[tuple[int, int, int]] = []
    for e in half:
        f, j = divmod(int(e), 3)
        a, b, c = (int(faces[f, (j + k) % 3]) for k in range(3))
        start, along = state.vertices[a], state.vertices[b] - state.vertices[a]
        length = float(np.linalg.norm(along))
        if gone[f] or length <= 2.0 * tolerance:
            continue
        offset = points - start
        place = offset @ along / length
        distance = np.linalg.norm(offset - place[:, np.newaxis] * (along / length), axis=1)
        on = (distance <= tolerance) & (place > tolerance) & (place < length - tolerance)
        on &= border != c
        if not on.any():
            continue
        between = border[on][np.argsort(place[on], kind="stable")].tolist()
        added += [(p, q, c) for p, q in itertools.pairwise([a, *between, b])]
        gone[f] = True
    more = np.array(added, dtype=np.int32).reshape(-1, 3)
    return np.concatenate([faces[~gone], more]), int(gone.sum())


def _winding(state: Repaired) -> Repaired | None:
    """Turn faces over until neighbours agree."""
    topology = state.topology
    turned = topology.turned if topology.two_faced else None
    if turned is None:
        return None
    triangles = _counted(int(turned.sum()), "triangle was", "triangles were")
    return _next(state, _turn(topology.faces, turned), f"{triangles} turned over: now all agree")


def _turn(faces: Int32Array, which: BoolArray) -> Int32Array:
    """Reverse some faces, (m,) bool."""
    return np.where(which[:, np.newaxis], faces[:, ::-1], faces)


def _touching(state: Repaired) -> Repaired | None:
    """Give bodies that meet at crowded edges vertices of their own.

    Around an edge of more than two faces, those between which there is solid belong together.
    """
    vertices, topology = state.vertices, state.topology
    if not 0 < len(topology.crowded_edges) <= _MOST_BORDERS or len(topology.open_edges):
        return None
    faces, twin = topology.faces, topology.twin.astype(np.int64)
    order, starts, count = order_edges(faces)
    for first, last in zip(starts[count > 2], (starts + count)[count > 2], strict=True):
        pairs = _pairs(vertices, faces, order[first:last].tolist())
        if pairs is None:
            return None
        for one, other in pairs:
            twin[one], twin[other] = other, one
    corner = np.arange(len(twin))
    after = corner - corner % 3 + (corner + 1) % 3
    index = connected(len(twin), corner, after[twin])  # neighbours around a vertex are one
    original = np.zeros(index.max() + 1, dtype=np.int64)
    original[index] = faces.ravel()
    apart = Topology(index.reshape(-1, 3))
    return Repaired(vertices[original], apart, state.notes, touching=True) if apart.closed else None


# Where faces balance at each edge, bodies touch or coincide and no face may go.
_STEPS: tuple[_Repair, ...] = (
    _touching, _duplicates, _near_vertices, _junctions, _winding, _touching,
)  # fmt: skip


def _tolerance_mm(vertices: FloatArray) -> float:
    return _TOLERANCE * float(np.ptp(vertices, axis=0).max())


# ------------------------------------------------------------------------------------------------
# Polygons with a notch that a program divided into triangles as if they had none.


_LEVEL = 1e-6
"""Of a cosine, off 1, between faces that may lie in one plane. Numerical: far above what float32
turns them by; whether they do is told by their heights."""


def _folds(mesh: Mesh, topology: Topology) -> tuple[Int32Array, IntArray]:
    """Group the faces of a closed mesh by planes, (m,), and tell which groups fold back."""
    size = np.linalg.norm(mesh.area_vectors_mm2, axis=1)
    large, twin = size > _OVERLAP * size.sum(), topology.twin
    normals = mesh.area_vectors_mm2 / np.maximum(size, 1e-300)[:, None]
    bare = np.flatnonzero(~large)  # corners in line, or nearly: in the plane beyond the long side
    sides = np.roll(mesh.triangles[bare], -1, axis=1) - mesh.triangles[bare]
    normals[bare] = normals[twin[3 * bare + np.linalg.norm(sides, axis=2).argmax(axis=1)] // 3]
    once = np.flatnonzero(twin > np.arange(len(twin)))
    one, other = once // 3, twin[once] // 3
    cosine = np.einsum("ij,ij->i", normals[one], normals[other])
    folded = one[(cosine < _LEVEL - 1.0) & large[one] & large[other]]
    level = np.abs(cosine) > 1.0 - _LEVEL
    group = connected(len(size), one[level], other[level]) if len(folded) else topology.body
    return group, np.flatnonzero(np.bincount(group[folded]))


def _unfolded(state: Repaired) -> Repaired:
    """Divide anew what lies in a plane and folds back on itself, as a fan over a notch does.

    Its outline tells its shape; what has no simple one stays, and a mesh that would not be closed.
    """
    mesh, faces = Mesh(state.vertices, state.topology.faces), state.topology.faces
    group, numbers = _folds(mesh, state.topology)
    if not len(numbers):
        return state
    from manifold3d import triangulate

    kept, divided = np.ones(len(faces), dtype=np.bool_), list[Int32Array]()
    for number in numbers:
        own = group == number
        rim, up = Topology(faces[own]).open_edges, mesh.area_vectors_mm2[own].sum(axis=0)
        after, height, size = dict(rim.tolist()), mesh.triangles[own] @ up, np.linalg.norm(up)
        # After fewer corners than there are sides where one is met twice.
        if not 0 < len(after) == len(rim) or np.ptp(height) > _tolerance_mm(state.vertices) * size:
            continue
        loops = list[list[int]]()
        while after:
            loops.append([next(iter(after))])
            while (onward := after.pop(loops[-1][-1])) != loops[-1][0]:
                loops[-1].append(onward)
        drop = int(np.argmax(np.abs(up)))
        across = [(drop + 1) % 3, (drop + 2) % 3][:: 1 if up[drop] > 0.0 else -1]
        flat = triangulate([state.vertices[loop][:, across] for loop in loops])
        divided.append(np.array([*itertools.chain(*loops)], np.int32)[flat])
        kept &= ~own
    count = _counted(len(divided), "folded polygon", "folded polygons")
    new = _next(state, np.concatenate([faces[kept], *divided]), f"{count} divided anew")
    return new if divided and new.topology.closed else state


# ------------------------------------------------------------------------------------------------
# Several bodies in one part: which lie inside which, which way out, and overlaps united.


_READINGS = ("cavities", "solids")
"""What a body may be whose winding does not tell."""

_FLAT = 1e-9  # of area times extent: far below any printable thickness, far above rounding
_OVERLAP = 1e-7  # of the bodies' volume: less than this is touching; of their area: not even that
_SAME_MM = 2.0**-36
"""Places that near are one where bodies meet. Numerical: far below what float32 tells apart on any
part, far above the rounding of what was computed twice."""

_OUTSIDE = 1e-3  # of all directions: a point inside, or at a corner, sees more of the surface


_Arranged = tuple[FloatArray, Int32Array, tuple[str, ...]]
"""Vertices and faces of bodies the right way out, that do not overlap, and what was done; no faces
when none has volume."""


def _arrange_bodies(state: Repaired, bodies: str | None) -> _Arranged:
    """Turn bodies the right way out and unite those that overlap.

    An outermost body turned inside out is turned over with all that lies inside it. Inside a
    solid, apart from its surface, an inward body is a cavity; inside a cavity every body is solid.
    Overlapping solids are united. Of other bodies the winding does not tell whether they are
    solids or cavities: an inward one that reaches the surface of a solid or lies where two overlap,
    and an outward one alone inside a solid. They are left to `bodies`.

    Parameters
    ----------
    state
        A closed mesh; what touches is united even where it does not overlap.
    bodies
        What such a body is: ``cavities``, taken away from the solids around it; or ``solids``:
        then every body is, whichever way it is wound.

    Raises
    ------
    MeshError
        Bodies overlap and cannot be united; or `bodies` has to be given, as the part's volume
        depends on it.
    """
    vertices, topology = state.vertices, state.topology
    volume, bounds, full = _measured(vertices, topology)
    notes = [*state.notes]
    if not full.all() and full.any():
        flat = find_crossing(Mesh(vertices, topology.faces[~full[topology.body]]))
        if flat is not None:
            raise MeshError(
                f"a body crosses itself at {place_text(flat.place_mm)} and is wound inwards in "
                "as much of its volume as outwards; mend it in the CAD program"
            )
        notes.append(f"{int((~full).sum())} of {len(full)} bodies without volume dropped")
    pairs = _box_pairs(bounds, full)
    found = _Bodies(vertices, topology, volume, bounds, full, pairs)
    outward, doubtful, parent = roles = _roles(found)
    if doubtful.any() or (bodies == "solids" and not outward[full].all()):
        return _chosen(found, roles, bodies, notes)
    turned, body, faces = full & (outward != (volume > 0.0)), topology.body, topology.faces
    if turned.any():
        faces = _turn(faces, turned[body])
        some = f"{int(turned.sum())} of {int(full.sum())} bodies were"
        notes.append(f"{'the part was' if turned[full].all() else some} inside out: turned")
    keep = full[body]
    if pairs and outward[full].sum() > 1:
        solid = np.where(outward, np.arange(len(full)), parent)
        met = np.zeros(len(full), dtype=np.bool_)
        both = solid[np.array(pairs)]
        met[both[both[:, 0] != both[:, 1]]] = True
        numbers = np.flatnonzero(met & outward & full)
        groups = [faces[keep & (solid[body] == number)] for number in numbers]
        if (united := _unite(state, groups)) is not None:
            triangles, note = united
            rest = vertices[faces[keep & ~met[solid[body]]]]
            return *_welded(np.concatenate([rest, triangles])), (*notes, note)
    return vertices, faces if keep.all() else faces[keep], tuple(notes)


def _measured(vertices: FloatArray, topology: Topology) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Return each body's signed volume and bounds, and whether it is more than a leaf."""
    volume, area, bounds, _ = measure(vertices, topology.faces, topology.body, topology.bodies)
    return volume, bounds, np.abs(volume) > _FLAT * area * np.ptp(bounds, axis=1).max(axis=1)


@dataclass(frozen=True, eq=False)
class _Bodies:
    """The bodies of a closed mesh, each as a solid when asked for."""

    vertices: FloatArray
    topology: Topology
    volume: FloatArray
    bounds: FloatArray
    full: BoolArray
    pairs: list[tuple[int, int]]
    _solids: dict[int, Any] = field(default_factory=dict)

    @cached_property
    def faces(self) -> list[Int32Array]:
        """Each body's faces."""
        body = self.topology.body
        order = np.argsort(body, kind="stable")
        return np.split(self.topology.faces[order], np.cumsum(np.bincount(body))[:-1])

    def solid(self, number: int) -> Any:
        """Return a body as a solid, whichever way it is wound."""
        if number not in self._solids:
            way = -1 if self.volume[number] < 0.0 else 1
            self._solids[number] = _manifold(self.vertices, self.faces[number][:, ::way])
        return self._solids[number]

    def sum(self, which: BoolArray) -> Any:
        """Return what some bodies are together, each as a solid."""
        return _sum([self.solid(number) for number in np.flatnonzero(which).tolist()])

    def shared_mm3(self, one: int, other: int) -> float:
        """Return the volume that is in both of two bodies."""
        return float((self.solid(one) ^ self.solid(other)).volume())

    def overlap(self, one: int, other: int) -> bool:
        """Tell whether two bodies have more in common than where they touch."""
        both = abs(self.volume[one]) + abs(self.volume[other])
        return bool(self.shared_mm3(one, other) > _OVERLAP * both)

    def inside(self, outer: int, inner: int) -> tuple[bool, bool]:
        """Tell whether a body lies inside another, and more than rounding off its surface."""
        import manifold3d

        tolerance = _tolerance_mm(self.vertices)
        low, high = self.bounds[inner, 0] - tolerance, self.bounds[inner, 1] + tolerance
        wall = self.vertices[self.faces[outer]]
        near = ((wall.min(axis=1) <= high) & (wall.max(axis=1) >= low)).all(axis=1).any()
        probes = np.unique(self.faces[inner])
        some = np.linspace(0, len(probes) - 1, 5 if near else 1).astype(np.int64)
        around = [abs(_winding_number(probe, wall)) for probe in self.vertices[probes[some]]]
        if max(around) < _OUTSIDE:
            return False, True
        if not near:
            return True, True
        size = np.ptp(self.bounds[outer], axis=0)
        space = manifold3d.Manifold.cube(3.0 * size).translate(self.bounds[outer, 0] - size)
        if (space - self.solid(outer)).min_gap(self.solid(inner), tolerance) >= tolerance:
            return True, True
        return self.shared_mm3(outer, inner) / abs(self.volume[inner]) > 1.0 - _OVERLAP, False


def _box_pairs(bounds: FloatArray, full: BoolArray) -> list[tuple[int, int]]:
    """Return the pairs of bodies whose bounding boxes overlap or touch, by a sweep along x."""
    order = np.flatnonzero(full)
    order = order[np.argsort(bounds[order, 0, 0], kind="stable")]
    low, high = bounds[order, 0], bounds[order, 1] + _SAME_MM
    pairs = []
    for i, stop in enumerate(np.searchsorted(low[:, 0], high[:, 0]).tolist()):
        later = slice(i + 1, max(stop, i + 1))
        overlap = ((low[later] < high[i]) & (high[later] > low[i])).all(axis=1)
        pairs += [(int(order[i]), int(order[i + 1 + k])) for k in np.flatnonzero(overlap)]
    return pairs


def _nesting(found: _Bodies, rank: NDArray[np.int64]) -> dict[int, dict[int, bool]]:
    """Return which bodies lie inside which of lower rank, and whether apart from their surface."""
    nesting: dict[int, dict[int, bool]] = defaultdict(dict)
    for pair in found.pairs:
        outer, inner = sorted(pair, key=lambda number: rank[number])
        low, high = found.bounds[outer]
        if not ((low <= found.bounds[inner, 0]) & (high >= found.bounds[inner, 1])).all():
            continue
        inside, apart = found.inside(outer, inner)
        if inside:
            nesting[inner][outer] = apart
    return nesting


def _winding_number(point: FloatArray, triangles: FloatArray) -> float:
    """How often a closed surface encloses a point: its solid angle (Van Oosterom 1983) / 4 pi."""
    a, b, c = (triangles - point).transpose(1, 0, 2)
    la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
    above = np.einsum("ij,ij->i", a, np.cross(b, c))
    below = la * lb * lc + lc * np.einsum("ij,ij->i", a, b)
    below += lb * np.einsum("ij,ij->i", a, c) + la * np.einsum("ij,ij->i", b, c)
    return float(np.arctan2(above, below).sum() / (2.0 * np.pi))


_Roles = tuple[BoolArray, BoolArray, NDArray[np.int64]]


def _roles(found: _Bodies) -> _Roles:
    """Decide from the outermost inwards which bodies are solids and which cavities.

    Returns
    -------
    outward : (bodies,) bool
        Which are solids.
    doubtful : (bodies,) bool
        Cavities that may as well be solids.
    parent : (bodies,) int
        The smallest body around each, -1 for the outermost.
    """
    volume = found.volume
    order = np.argsort(-np.abs(volume), kind="stable")
    rank = np.argsort(order)
    nesting = _nesting(found, rank)
    meets = defaultdict(list)
    for i, j in found.pairs:
        meets[i].append(j)
        meets[j].append(i)
    outward = np.ones(len(volume), dtype=np.bool_)
    doubtful = np.zeros(len(volume), dtype=np.bool_)
    over = np.zeros(len(volume), dtype=np.bool_)  # turned over with the outermost body
    parent = np.full(len(volume), -1)
    for body in order.tolist():
        around = nesting.get(body)
        inward = volume[body] < 0.0
        if around is None:
            doubtful[body] = inward and any(
                volume[k] > 0.0 and k not in nesting and found.overlap(body, k) for k in meets[body]
            )
            over[body] = inward and not doubtful[body]
            outward[body] = not doubtful[body]
            continue
        parent[body] = max(around, key=lambda k: rank[k])
        over[body] = over[parent[body]]
        times = sum(1 if outward[k] else -1 for k in around)  # inside solids
        if times <= 0:
            continue
        if inward != over[body]:
            outward[body] = False
            doubtful[body] = times > 1 or not all(around.values())
        elif all(around.values()):
            doubtful[body] = not any(
                k not in around and body not in nesting.get(k, ()) and found.overlap(body, k)
                for k in meets[body]
            )
            outward[body] = not doubtful[body]
    return outward, doubtful, parent


def _chosen(found: _Bodies, roles: _Roles, bodies: str | None, notes: list[str]) -> _Arranged:
    """Make the part in which doubtful bodies are what was asked for, if that matters."""
    import manifold3d

    full, (outward, doubtful, parent) = found.full, roles
    solids = found.sum(full)
    hollow = manifold3d.Manifold()
    level, around = np.zeros(len(parent), dtype=np.int64), parent
    while (around >= 0).any():
        level += (around >= 0) & doubtful[around]
        around = np.where(around >= 0, parent[around], -1)
    for at in range(int(level.max()) + 1):  # what lies in a doubtful cavity stays
        for body in np.flatnonzero(full & outward & (level == at)).tolist():
            own = full & ~outward & ~doubtful & (parent == body)
            hollow += found.solid(body) - found.sum(own)
        hollow -= found.sum(full & doubtful & (level == at))
    count, whole = int(full.sum()), hollow if bodies == "cavities" else solids
    volumes = f"{hollow.volume():.9g} mm3 with cavities, {solids.volume():.9g} mm3 with solids"
    same = abs(solids.volume() - hollow.volume()) <= _OVERLAP * solids.volume()
    if bodies is None and not same:
        place = place_text(found.bounds[int(np.argmax(doubtful))].mean(axis=0))
        first, what = "the first ", "are cavities or solids"
        if doubtful.sum() == 1:
            first, what = "", "is a cavity or a solid"
        raise MeshError(
            f"its winding does not tell whether {doubtful.sum()} of its {count} bodies, {first}"
            f"around {place}, {what}: it has {volumes}; choose by `bodies`, if it is the part, or "
            "mend it in the CAD program"
        )
    if whole.is_empty():
        raise MeshError("nothing is left where cavities are taken away; choose solids by `bodies`")
    note = f"{count} bodies united" if same else f"its {count} bodies read as {bodies}: {volumes}"
    return *_welded(_mesh_of(whole).triangles), (*notes, note)


def plain(mesh: Mesh, within_mm: float) -> Mesh:
    """Return a closed surface without the edges that it does without, moved by so much at most.

    One whose bodies touch along an edge is returned as it is.
    """
    try:
        solid = _manifold(mesh.vertices, mesh.faces)
    except MeshError:
        return mesh
    return mesh if solid.is_empty() else _mesh_of(solid.simplify(within_mm))


def _sum(solids: list[Any]) -> Any:
    import manifold3d

    whole = manifold3d.Manifold.batch_boolean(solids, manifold3d.OpType.Add)
    if whole.status() != manifold3d.Error.NoError or (solids and whole.is_empty()):
        raise MeshError("its bodies overlap and cannot be united; unite them in the CAD program")
    return whole


def _unite(state: Repaired, groups: list[Int32Array]) -> tuple[FloatArray, str] | None:
    """Unite solids: their triangles, and a note; None where no two overlap or touch in a face.

    Rounded askew they touch in places alone, and what would be united has slits: they stay apart,
    but for bodies that met at shared edges.
    """
    snapped = np.rint(state.vertices / _SAME_MM) * _SAME_MM
    solids = [_manifold(snapped, faces) for faces in groups]
    whole = _mesh_of(_sum(solids))
    alone, area = sum(s.volume() for s in solids), sum(s.surface_area() for s in solids)
    shared = alone - whole.volume_mm3
    touched, apart = shared <= _OVERLAP * alone, area - whole.area_mm2 <= _OVERLAP * area
    if touched and not state.touching and (apart or len(_folds(whole, Topology(whole.faces))[1])):
        return None
    met = "touched" if touched else f"overlapped ({shared:.4g} mm3 counted twice)"
    return whole.triangles, f"{len(groups)} bodies {met}: united"


def _mesh_of(solid: Any) -> Mesh:
    mesh = solid.to_mesh64()
    points = np.asarray(mesh.vert_properties, dtype=np.float64)[:, :3]
    return Mesh(points, np.asarray(mesh.tri_verts).astype(np.int32))


def _manifold(vertices: FloatArray, faces: Int32Array) -> Any:
    import manifold3d

    used, faces = compact(faces, len(vertices))
    mesh = manifold3d.Mesh64(np.ascontiguousarray(vertices[used]), faces.astype(np.uint64))
    solid = manifold3d.Manifold(mesh)
    if solid.status() != manifold3d.Error.NoError:
        raise MeshError(
            "its bodies may overlap, and one of them cannot be united with the others "
            f"({solid.status().name}); unite them in the CAD program"
        )
    return solid


# ------------------------------------------------------------------------------------------------
# Find where a closed surface crosses itself, by rays along z.


_RAYS = 128
_SHIFT = (0.5 + 0.0822871, 0.5 - 0.0673913)  # off the lattices that designed parts lie on
_TOUCH = 1e-6


@dataclass(frozen=True, slots=True)
class Crossing:
    """Where a surface crosses itself.

    Attributes
    ----------
    place_mm
        Middle of the longest stretch found.
    times_inside
        How often the surface encloses that place; an ordinary solid does once.
    length_mm
        Of that stretch, along z.
    volume_mm3
        Estimate of all that is enclosed other than once.
    """

    place_mm: Point
    times_inside: int
    length_mm: float
    volume_mm3: float


def find_crossing(mesh: Mesh) -> Crossing | None:
    """Follow 128 x 128 rays along z and find stretches enclosed twice or negatively.

    What is smaller than 1/128 of the extent along x or y may be missed, and overlaps up to a
    millionth of the extent deep count as touching: this is a test of samples, not a proof.

    Parameters
    ----------
    mesh : Mesh
        Closed: every directed edge once, and its reverse once.

    Returns
    -------
    Crossing or None
        None where every stretch is enclosed once or not at all.
    """
    low, high = mesh.bounds_mm
    step = (high - low)[:2] / _RAYS
    if not (step > 0.0).all():
        return None
    first = low[:2] + step * np.array(_SHIFT)
    y0, y1, y2 = (mesh.vertices[corner, 1] for corner in mesh.faces.T)
    bottom, top = np.minimum(np.minimum(y0, y1), y2), np.maximum(np.maximum(y0, y1), y2)
    face, row = _covered(bottom, top, first[1], step[1])
    ray, z, way = _cross(mesh, face, row, first, step)
    order = np.lexsort((-way, z, ray))  # of equal heights the entry first
    ray, z = ray[order], z[order]
    inside = np.cumsum(way[order])  # the sum over each ray is zero
    length = np.where(ray[1:] == ray[:-1], np.diff(z), 0.0)
    wrong = ((inside[:-1] > 1) | (inside[:-1] < 0)) & (length > _TOUCH * float((high - low).max()))
    if not wrong.any():
        return None
    worst = int(np.argmax(np.where(wrong, length, 0.0)))
    x, y = first + step * np.array([ray[worst] % _RAYS, ray[worst] // _RAYS])
    place_mm = (float(x), float(y), float((z[worst] + z[worst + 1]) / 2))
    volume_mm3 = float(length[wrong].sum() * step[0] * step[1])
    return Crossing(place_mm, int(inside[worst]), float(length[worst]), volume_mm3)


def _cross(
    mesh: Mesh, face: IntArray, row: IntArray, first: FloatArray, step: FloatArray
) -> tuple[IntArray, FloatArray, IntArray]:
    """Ray, height and way (1 in, -1 out) of the crossings of faces with rows of rays.

    A row of rays meets a triangle between its edge that runs up and its edge that runs down;
    a shared edge gives both of its triangles the same bound, so that no ray slips through.
    """
    x, y, _ = mesh.vertices.T
    corners, height = mesh.faces[face], first[1] + row * step[1]
    up, down = np.zeros(len(face)), np.zeros(len(face))
    for tail, head in ((0, 1), (1, 2), (2, 0)):
        p, q = corners[:, tail], corners[:, head]
        rising = y[p] <= height
        crossed = np.flatnonzero(rising != (y[q] <= height))
        p, q = np.minimum(p, q)[crossed], np.maximum(p, q)[crossed]
        at = x[p] + (x[q] - x[p]) * ((height[crossed] - y[p]) / (y[q] - y[p]))
        rising = rising[crossed]
        up[crossed[rising]], down[crossed[~rising]] = at[rising], at[~rising]
    span, column = _covered(np.minimum(up, down), np.maximum(up, down), first[0], step[0])
    way = np.where(up < down, 1, -1)[span]
    heights = _height(mesh.vertices[corners[span]], first[0] + column * step[0], height[span])
    return row[span] * _RAYS + column, heights, way


def _covered(low: FloatArray, high: FloatArray, first: float, step: float) -> tuple[IntArray, ...]:
    """All pairs of an interval and a ray in it: low <= first + ray * step < high."""
    rays = first + np.arange(_RAYS) * step
    begin, end = np.searchsorted(rays, low), np.searchsorted(rays, high)
    count = np.maximum(end - begin, 0)
    owner = np.repeat(np.arange(len(low)), count)
    return owner, np.arange(len(owner)) - (np.cumsum(count) - count - begin)[owner]


def _height(corners: FloatArray, x: FloatArray, y: FloatArray) -> FloatArray:
    a, b, c = corners.transpose(1, 0, 2)
    nx, ny, nz = np.cross(b - a, c - a).T
    low, high = corners[:, :, 2].min(axis=1), corners[:, :, 2].max(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        z = np.clip(a[:, 2] - (nx * (x - a[:, 0]) + ny * (y - a[:, 1])) / nz, low, high)
    return np.asarray(np.where(nz == 0.0, (low + high) / 2.0, z))


# ------------------------------------------------------------------------------------------------
# Say in words why a mesh is no solid: where, how many, what to do.


def _describe_faults(vertices: FloatArray, topology: Topology) -> str:
    """Describe the fault that matters most of a mesh that is not closed.

    Parameters
    ----------
    vertices, topology
        A welded mesh.
    """
    if len(topology.faces) == 0:
        return "every triangle has two equal corners; export the part again"
    if (np.ptp(vertices, axis=0) == 0.0).any():
        return "it is flat and encloses no volume; export it with a thickness in every direction"
    opened, crowded = topology.open_edges, topology.crowded_edges
    if len(opened) == 3 * len(topology.faces):
        return (
            f"its {len(topology.faces)} triangles share no edge: they are a soup, not a surface; "
            "export the part as a solid"
        )
    if len(opened):
        return _describe_borders(vertices, opened, len(crowded))
    if len(crowded):
        pairs, count = np.unique(np.sort(crowded, axis=1), axis=0, return_counts=True)
        length = _length(vertices, pairs)
        return (
            f"{counted(len(pairs), 'edge')} in all {length:.4g} mm long with up to {count.max()} "
            f"faces, the first at {place_text(vertices[crowded[0]].mean(axis=0))}: bodies or walls "
            "touch along a line, which has no thickness to print; let them overlap, or move them "
            "apart"
        )
    # Of a surface with two sides `_winding` has turned over what disagreed on where outside is.
    return "the surface has one side only, as a Möbius strip; export the part as a solid"


def _describe_borders(vertices: FloatArray, edges: Int32Array, crowded: int) -> str:
    # Edges that hang together, by first appearance.
    group = connected(len(vertices), *edges.T)[edges[:, 0]]
    loops = [edges[group == own] for own in dict.fromkeys(group.tolist())]
    around = [_length(vertices, loop) for loop in loops]
    longest = int(np.argmax(around))
    points = vertices[np.unique(loops[longest])]
    middle = place_text((points.min(axis=0) + points.max(axis=0)) / 2)
    holes = counted(len(loops), "hole") + (", the longest" if len(loops) > 1 else "")
    also = f"; {crowded} more edges have over two faces" if crowded else ""
    return (
        f"the surface is open: {counted(len(edges), 'edge')} with one face around {holes} of "
        f"{around[longest]:.4g} mm around {middle}{also}; close it in the "
        "CAD program, or export the part as a solid"
    )


def _length(vertices: FloatArray, edges: Int32Array) -> float:
    return float(np.linalg.norm(vertices[edges[:, 1]] - vertices[edges[:, 0]], axis=1).sum())
