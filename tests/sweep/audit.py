"""An audit of a plan's folder that owes nothing to planner: it reads the files and judges them.

Every figure is computed here, from the bytes: shells closed and right side out, volumes that add
up, interfaces that cancel, the part's own surface left, no place in two shells, each place in the
material that the gradient asks for there, and a 3MF that says what the STL files say.
"""

import hashlib
import itertools
import json
import math
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import manifold3d
import numpy as np
from numpy.typing import NDArray

from tests.sweep.fields import Gradient, Values, distance_to

Faces = NDArray[np.int64]

SHAPE, PLACE, FILES = "shape", "material", "files"
VOLUME_LIMIT = 1e-6
"""What a plan itself promises of its volumes, relative."""

OVERLAP_LIMIT = 1e-9
"""Likewise, of the part's volume that two shells may share."""

_POINTS = 60
_MOST_BOOLEAN = 400_000  # triangles of two shells that are intersected: seconds


def audit(
    folder: Path, source: Values, gradient: Gradient, pitch_mm: float, seed: int
) -> list[str]:
    """Return what is wrong with a plan's folder, a sentence each that begins with its kind.

    Parameters
    ----------
    source : (n, 3, 3)
        The part's triangles as they were given, in mm.
    pitch_mm
        Grid of the curved interfaces, or the edge of dithered cells.
    """
    plan = json.loads((folder / "plan.json").read_text(encoding="utf-8"))
    shells = {
        file: read_stl(folder / file) for file in dict.fromkeys(r["file"] for r in plan["regions"])
    }
    rng = np.random.default_rng(seed)
    faults = [f"{FILES}: {fault}" for fault in _files(folder, plan, shells)]
    faults += [f"{SHAPE}: {fault}" for fault in _shapes(plan, shells, source, rng)]
    faults += [f"{PLACE}: {fault}" for fault in _materials(plan, shells, gradient, pitch_mm, rng)]
    return faults


def read_stl(path: Path) -> NDArray[np.float32]:
    """Return the triangles (n, 3, 3) of a binary STL file."""
    data = path.read_bytes()
    count = int.from_bytes(data[80:84], "little")
    if len(data) != 84 + 50 * count:
        raise ValueError(f"{path.name} has {len(data)} bytes, its {count} triangles need others")
    rows = np.frombuffer(data, np.uint8, offset=84).reshape(count, 50)
    return rows[:, 12:48].copy().view("<f4").reshape(count, 3, 3)


# ------------------------------------------------------------------------------------------------
# Files: hashes, and the 3MF against the STL files.


def _files(
    folder: Path, plan: Mapping[str, Any], shells: Mapping[str, NDArray[np.float32]]
) -> list[str]:
    faults = []
    for region in plan["regions"]:
        if hashlib.sha256((folder / region["file"]).read_bytes()).hexdigest() != region["sha256"]:
            faults.append(f"{region['file']} has not the hash that the plan states")
        if len(shells[region["file"]]) != region["triangles"]:
            faults.append(f"{region['file']} has not the triangles that the plan states")
    objects = read_3mf(folder / f"{plan['part']['name']}.3mf")
    names = {Path(file).stem: soup for file, soup in shells.items()}
    if set(objects) != set(names):
        return [*faults, f"the 3MF has {sorted(objects)}, the STL files {sorted(names)}"]
    for name, soup in names.items():
        other = objects[name]
        if other.shape != soup.shape or np.any(other.astype(np.float32) != soup):
            faults.append(f"{name} in the 3MF is not what stands in its STL file")
        elif len(np.unique(other.reshape(-1, 3), axis=0)) != len(
            np.unique(soup.reshape(-1, 3), axis=0)
        ):
            faults.append(f"{name} in the 3MF has other vertices in common than in its STL file")
    return faults


def read_3mf(path: Path) -> dict[str, Values]:
    """Return the triangles of each mesh by its name, as the build places it."""
    with zipfile.ZipFile(path) as archive:
        root = ET.fromstring(archive.read("3D/3dmodel.model"))
    meshes, parts, names = {}, {}, {}
    for item in root.iter():
        if not item.tag.endswith("}object"):
            continue
        names[item.get("id")] = item.get("name")
        vertices = [
            [float(v.get(axis, "nan")) for axis in "xyz"]
            for v in item.iter()
            if v.tag.endswith("}vertex")
        ]
        faces = [
            [int(t.get(corner, "-1")) for corner in ("v1", "v2", "v3")]
            for t in item.iter()
            if t.tag.endswith("}triangle")
        ]
        if faces:
            meshes[item.get("id")] = np.array(vertices)[np.array(faces)]
        parts[item.get("id")] = [
            (c.get("objectid"), _matrix(c.get("transform")))
            for c in item.iter()
            if c.tag.endswith("}component")
        ]
    found: dict[str, Values] = {}

    def unfold(number: str | None, placed: Values) -> None:
        if number in meshes:
            turned = meshes[number] @ placed[:3] + placed[3]
            found[str(names[number])] = turned.astype(np.float32).astype(np.float64)
        for child, transform in parts[number]:
            whole = np.eye(4)
            whole[:, :3] = placed
            inner = np.eye(4)
            inner[:, :3] = transform
            unfold(child, (inner @ whole)[:, :3])

    for item in root.iter():
        if item.tag.endswith("}item"):
            unfold(item.get("objectid"), _matrix(item.get("transform")))
    return found


def _matrix(text: str | None) -> Values:
    return np.array(text.split() if text else [1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0], float).reshape(
        4, 3
    )


# ------------------------------------------------------------------------------------------------
# Shapes: each shell by itself, and all of them against the part.


def _shapes(
    plan: Mapping[str, Any], shells: Mapping[str, NDArray[np.float32]], source: Values,
    rng: np.random.Generator,
) -> list[str]:  # fmt: skip
    faults = []
    for file, soup in shells.items():
        faults += [f"{file} {fault}" for fault in unsound(soup)]
    soups = list(shells.values())
    every = np.concatenate(soups).astype(np.float64)
    surface = uncancelled(every)
    if surface is None:
        return [*faults, "a triangle is there more often one way than the other"]
    shift = np.array(plan["part"]["translation_mm"])
    placed = (source + shift).astype(np.float32).astype(np.float64)
    whole, sum_of_shells = volume(surface), math.fsum(volume(soup) for soup in soups)
    reach = float(np.abs(every).max())
    # Placing and cutting round a point once each, by half a unit in the last place of the largest
    # coordinate, or by half the lattice of 2^-20 mm where that is coarser.
    moved = 2 * math.sqrt(3) * max(2.0**-24 * 2.0 ** math.ceil(math.log2(reach)), 2.0**-21)
    if abs(sum_of_shells - whole) > 1e-12 * area(every) * reach:
        faults.append("the shells' volumes do not add up to that of the surface that is left")
    if unsound(surface.astype(np.float32), joined=True):
        faults.append("the surface that is left is not closed")
    if not plan["part"]["repairs"]:
        stated = abs(volume(source))
        off = abs(sum_of_shells - stated)
        if off > area(source) * moved or off > VOLUME_LIMIT * stated:
            faults.append(f"the volumes are {off / stated:.2e} off the part's")
        if abs(area(surface) - area(placed)) > moved * _perimeters(
            np.concatenate([surface, placed])
        ):
            faults.append("the surface that is left has not the part's area")
        corners = surface.reshape(-1, 3)
        some = corners[rng.integers(0, len(corners), max(4, min(60, 2_000_000 // len(placed))))]
        off = distance_to(placed, some).max()
        if off > moved + float(np.abs(shift).max()) * 5e-9:  # plans state nine digits
            faults.append(f"the surface that is left is {off:.2e} mm off the part's")
    return faults + _overlaps(soups, surface, moved, rng)


def unsound(soup: NDArray[np.float32], *, joined: bool = False) -> list[str]:
    """Return what keeps triangles from being one closed surface, corners joined by their bits.

    `joined` allows edges of more than two faces, as where bodies of a part touch.
    """
    faces = welded(soup)
    faults = []
    a, b, c = faces.T
    if np.any((a == b) | (b == c) | (c == a)):
        faults.append("has a triangle with two equal corners")
    if len(np.unique(np.sort(faces, axis=1), axis=0)) != len(faces):
        faults.append("has a triangle twice")
    sides = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    n = int(faces.max()) + 1
    ahead, times = np.unique(sides[:, 0] * n + sides[:, 1], return_counts=True)
    back, back_times = np.unique(sides[:, 1] * n + sides[:, 0], return_counts=True)
    if not np.array_equal(ahead, back) or not np.array_equal(times, back_times):
        faults.append("is open")
    elif not joined and times.max() > 1:
        faults.append("has an edge of more than two faces")
    if volume(soup) <= 0:
        faults.append(f"has the volume {volume(soup):.3g} mm3")
    return faults


def welded(soup: NDArray[np.floating[Any]]) -> Faces:
    """Return corners (n, 3) as numbers of distinct positions."""
    points = np.ascontiguousarray(soup.reshape(-1, 3)) + 0.0  # -0 and 0 are one position
    rows = points.view(np.dtype((np.void, points.dtype.itemsize * 3))).ravel()
    return np.unique(rows, return_inverse=True)[1].reshape(-1, 3).astype(np.int64)


def volume(soup: NDArray[np.floating[Any]]) -> float:
    """Return the volume within triangles, about their middle, without error of summation."""
    points = soup.astype(np.float64)
    a, b, c = (points - points.reshape(-1, 3).mean(axis=0)).transpose(1, 0, 2)
    return math.fsum((np.cross(a, b) * c).sum(axis=1).tolist()) / 6


def area(soup: Values) -> float:
    normals = np.cross(soup[:, 1] - soup[:, 0], soup[:, 2] - soup[:, 0])
    return math.fsum(np.linalg.norm(normals, axis=1).tolist()) / 2


def _perimeters(soup: Values) -> float:
    return float(np.linalg.norm(soup - np.roll(soup, 1, axis=1), axis=2).sum())


def uncancelled(every: Values) -> Values | None:
    """Return the triangles that no opposite one cancels; None if one is left more than once."""
    faces = welded(every)
    first = faces.argmin(axis=1)
    turned = np.take_along_axis(faces, (first[:, None] + np.arange(3)) % 3, axis=1)
    sign = np.where(turned[:, 1] < turned[:, 2], 1, -1)
    keys, index = np.unique(np.sort(faces, axis=1), axis=0, return_inverse=True)
    total = np.bincount(index.ravel(), sign, len(keys))
    if np.abs(total).max() > 1:
        return None
    # Of each key that is left, one triangle of its sign.
    left = np.flatnonzero(total[index.ravel()] == sign)
    return every[left[np.unique(index.ravel()[left], return_index=True)[1]]]


def _overlaps(
    soups: Sequence[NDArray[np.float32]], surface: Values, moved: float, rng: np.random.Generator
) -> list[str]:
    """Look for places in two shells: by winding numbers, and by the intersections' volumes.

    Where a face lies within what rounding moves its corners by is not settled: places nearer to one
    than `moved` count by their volume alone.
    """
    faults = []
    every = np.concatenate(soups).astype(np.float64)
    points = _probes(soups, rng, max(10, min(_POINTS, 1_500_000 // sum(map(len, soups)))))
    around = np.array([winding(soup, points) for soup in soups])
    times, whole_times = np.round(around), np.round(winding(surface, points))
    wrong = (times < 0).any(axis=0) | (times > 1).any(axis=0) | (times.sum(axis=0) != whole_times)
    wrong &= (np.abs(around - times) < 1e-3).all(axis=0)
    for point, found in zip(points[wrong], times.T[wrong], strict=True):
        if distance_to(every, point[None])[0] > moved:
            faults.append(f"shells wind {found.min():.0f} to {found.max():.0f} times about {point}")
            break
    whole = volume(surface)
    solids, boxes = [_solid(soup) for soup in soups], [_box(soup) for soup in soups]
    for one, other in itertools.combinations(range(len(soups)), 2):
        (low, high), (below, above) = (boxes[k] for k in (one, other))
        if np.any(high < below) or np.any(above < low):
            continue
        if len(soups[one]) + len(soups[other]) > _MOST_BOOLEAN:
            continue
        common = solids[one] ^ solids[other]
        shared = common.volume() / whole
        if shared > OVERLAP_LIMIT and _in_both(common, soups[one], soups[other], moved, rng):
            faults.append(f"shells {one + 1} and {other + 1} share {shared:.2e} of the part")
    return faults


def _in_both(
    common: manifold3d.Manifold, one: NDArray[np.float32], other: NDArray[np.float32],
    moved: float, rng: np.random.Generator,
) -> bool:  # fmt: skip
    """Tell whether shells wind about places of what manifold3d takes for their intersection.

    Where two shells share many faces it has been seen to return a piece of one of them.
    """
    faces_of_both = np.concatenate([one, other]).astype(np.float64)
    for piece in sorted(common.decompose(), key=lambda part: -part.volume())[:4]:
        mesh = piece.to_mesh64()
        soup = np.asarray(mesh.vert_properties)[:, :3][np.asarray(mesh.tri_verts)]
        low, high = soup.reshape(-1, 3).min(axis=0), soup.reshape(-1, 3).max(axis=0)
        shares = rng.dirichlet(np.ones(4), 2000)  # of two faces' corners: within, if it is convex
        faces = soup[rng.integers(0, len(soup), (2000, 2))].reshape(2000, 6, 3)
        points = np.concatenate(
            [(faces[:, :4] * shares[..., None]).sum(axis=1), rng.uniform(low, high, (2000, 3))]
        )
        points = points[winding(soup, points) > 0.9][:50]
        both = points[np.minimum(winding(one, points), winding(other, points)) > 0.9]
        if np.any(distance_to(faces_of_both, both) > moved):
            return True
    return False


def _solid(soup: NDArray[np.float32]) -> manifold3d.Manifold:
    rows, faces = np.unique(soup.reshape(-1, 3), axis=0, return_inverse=True)
    mesh = manifold3d.Mesh64(rows.astype(np.float64), faces.reshape(-1, 3).astype(np.uint64))
    return manifold3d.Manifold(mesh)


def _box(soup: NDArray[np.float32]) -> Values:
    points = soup.reshape(-1, 3)
    return np.array([points.min(axis=0), points.max(axis=0)])


def _probes(soups: Sequence[NDArray[np.float32]], rng: np.random.Generator, count: int) -> Values:
    """Return points anywhere, and some on either side of faces, among them the thinnest."""
    every = np.concatenate(soups).astype(np.float64)
    low, high = every.reshape(-1, 3).min(axis=0), every.reshape(-1, 3).max(axis=0)
    anywhere = rng.uniform(low, high, (count // 2, 3))
    normal = np.cross(every[:, 1] - every[:, 0], every[:, 2] - every[:, 0])
    size = np.linalg.norm(normal, axis=1)
    longest = np.linalg.norm(every - np.roll(every, 1, axis=1), axis=2).max(axis=1)
    width = size / longest
    thin = np.argsort(np.where(width > 0, width, np.inf))[: count // 8]
    chosen = np.concatenate([thin, rng.integers(0, len(every), count // 8)])
    chosen = chosen[size[chosen] > 0]
    step = (0.1 * width / np.maximum(size, 1e-300))[chosen, None] * normal[chosen]
    middle = every[chosen].mean(axis=1)
    return np.concatenate([anywhere, middle + step, middle - step])


def winding(soup: NDArray[np.floating[Any]], points: Values) -> Values:
    """Return how often triangles wind about each point: solid angles (Van Oosterom, 1983)."""
    corners = soup.astype(np.float64)
    found = np.empty(len(points))
    for n, point in enumerate(points):
        a, b, c = (corners - point).transpose(1, 0, 2)
        x, y, z = (np.sqrt((side * side).sum(axis=1)) for side in (a, b, c))
        above = (np.cross(a, b) * c).sum(axis=1)
        below = x * y * z + (a * b).sum(axis=1) * z
        below += (b * c).sum(axis=1) * x + (c * a).sum(axis=1) * y
        found[n] = np.arctan2(above, below).sum() / (2 * np.pi)
    return found


# ------------------------------------------------------------------------------------------------
# Materials: what the gradient asks for at a place, and the shell that holds it.


def _materials(
    plan: Mapping[str, Any], shells: Mapping[str, NDArray[np.float32]], gradient: Gradient,
    pitch_mm: float, rng: np.random.Generator,
) -> list[str]:  # fmt: skip
    if gradient.of_surface and plan["part"]["repairs"]:
        return []  # of which surface, is not known here
    low, high = _box(np.concatenate(list(shells.values()))).astype(np.float64)
    count = max(10, min(_POINTS, 1_500_000 // sum(map(len, shells.values()))))
    points = rng.uniform(low, high, (count, 3))
    holds = {file: winding(soup, points) > 0.5 for file, soup in shells.items()}
    inside = np.any(list(holds.values()), axis=0)
    if not inside.any():
        return []
    lowest, highest = gradient.bounds(points[inside] - np.array(plan["part"]["translation_mm"]))
    dithered = plan["gradient"].get("blend", {}).get("kind") == "dither"
    # Interfaces lie within 0.87 pitches, half the diagonal of a cube (and as much again where the
    # field is itself solved on such a grid); cells hold what is wanted at their centre, and bevels
    # reach into the next. Planes are cut exactly, but for rounding and what is told of cuts moved.
    off_mm = (3.0 if dithered else 2.0) * pitch_mm if dithered or gradient.curved else 0.0
    slack = gradient.steepness * off_mm + 1e-5
    faults = []
    for n, (least, most) in enumerate(zip(lowest - slack, highest + slack, strict=True)):
        may = {
            region["file"]
            for region in plan["regions"]
            if _open_ended(plan, region, 0) <= most and _open_ended(plan, region, 1) >= least
        }
        held = [file for file, inner in holds.items() if inner[inside][n]]
        if not may.intersection(held):
            where = np.round(points[inside][n], 3).tolist()
            faults.append(
                f"at {where}, field {least:.4f} to {most:.4f}: {held} instead of {sorted(may)}"
            )
    return faults[:2]


def _open_ended(plan: Mapping[str, Any], region: Mapping[str, Any], end: int) -> float:
    """Return an end of a region along the field; beyond the ends the last material goes on."""
    value = float(region["field"][end])
    ends = [r["field"][end] for r in plan["regions"]]
    if end == 0:
        return -math.inf if value == min(ends) else value
    return math.inf if value == max(ends) else value
