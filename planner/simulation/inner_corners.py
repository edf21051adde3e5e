"""Pieces of material in a cell, parted at inner corners: a wall and the ground it stands on."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.mesh.mesh import Mesh, Topology, connected
from planner.numerics import BoolArray, FloatArray, IntArray, kernel
from planner.simulation.material_columns import SampledMaterial, column_xy

__all__ = ["contacts", "opposed", "parted"]


# One smooth field can hardly turn a wall against the ground that it stands on in the same cell. So
# what stands before the plane of a face is a piece of its own, and springs hold both together as
# they do two materials. A convex piece has nothing before the planes of its own faces.

_DEEP, _SKIN = 0.25, 0.06
"""Of a cell: how far material is to stand before one plane of a corner, and lie behind it; and
before the other. Numerical, of thin-walled parts: with 0.1 for both a twentieth more nodes gain
nothing, with 0.35 half of the gain is lost. A skin is what columns do not hold together."""

_TURN = np.cos(np.radians(30.0))
"""Of the angle between normals at an inner corner. Chosen: facets of tubes turn less; stress at a
corner that turns by less rises no faster than with the fourth root of 1 / distance."""


def parted(
    material: SampledMaterial, surface: Mesh, low: FloatArray, size: FloatArray
) -> tuple[SampledMaterial, FloatArray]:
    """Find the connected pieces of material in the cells, and part them by planes of their faces.

    Parameters
    ----------
    surface
        Of all material, of triangles smaller than a cell.
    low, size : (3,)
        Lower corner of the lattice and edges of a cell, mm.

    Returns
    -------
    material
        Its segments cut where a plane crosses them, and told to pieces.
    halves : (n, k, 4)
        Half-spaces that hold each piece, of planes that have parted it: normal n and offset o, with
        n · (x - low) > o, mm. Zero where there are fewer than k.
    """
    deep, skin = _DEEP * float(size.mean()), _SKIN * float(size.mean())
    places, planes = _inner_edges(surface, low)
    label = material.cell * (int(material.shell.max(initial=0)) + 1) + material.shell
    pairs = material.touching(label, np.arange(len(label)))
    material = replace(material, piece=connected(len(label), *pairs.T))
    halves = np.zeros((int(material.piece.max(initial=-1)) + 1, 0, 4))
    while len(places) and len(halves):
        index = np.stack(np.unravel_index(material.pieces()[0], material.counts), axis=1)
        piece = material.locate(low, size, index, low + places, -planes[:, :, :3].sum(axis=1))[0]
        # At an edge on a plane that has parted it, the piece has no inner corner left.
        above = np.einsum("nki,ni->nk", halves[piece, :, :3], places) - halves[piece, :, 3]
        bounds = ((above > skin) | ~halves[piece].any(axis=2)).all(axis=1)
        plane = _best_planes(material, piece[bounds], planes[bounds], size, deep, skin)
        again = np.any(plane[piece], axis=1)
        places, planes = places[again], planes[again]
        if len(places):
            material, parent, side = _halved(material, plane, size, deep)
            beyond = (side[:, None] * plane[parent])[:, None]
            halves = np.concatenate([halves[parent], beyond], axis=1)
    return material, halves


def _inner_edges(surface: Mesh, low: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return middles of edges where faces turn to each other, from `low`, and both planes."""
    corners = surface.triangles
    normal = surface.normals
    twin = Topology(surface.faces).twin
    half = np.flatnonzero(twin > np.arange(len(twin)))
    sides = np.stack([half, twin[half]], axis=1)
    n = normal[sides // 3]
    # how far the other face's third corner is before this one's plane
    tip = corners[sides[:, 1] // 3, (sides[:, 1] + 2) % 3] - corners[sides[:, 0] // 3, 0]
    turned = np.sum(n[:, 0] * n[:, 1], axis=1) < _TURN
    inner = turned & (np.sum(n[:, 0] * tip, axis=1) > 0.0)
    half, n = half[inner], n[inner]
    places = 0.5 * (corners[half // 3, half % 3] + corners[half // 3, (half + 1) % 3]) - low
    offset = np.sum(n * places[:, None], axis=2, keepdims=True)
    return places, np.concatenate([n, offset], axis=2)


def _best_planes(
    material: SampledMaterial, piece: NDArray[np.int32], planes: FloatArray, size: FloatArray,
    deep: float, skin: float,
) -> FloatArray:  # fmt: skip
    """Return for each piece the plane, (n, 4), of inner corners that parts it deepest, or zeros.

    Both planes, (k, 2, 4), of a corner are to part the piece.
    """
    best = np.zeros((int(material.piece.max()) + 1, 4))
    key = np.column_stack([piece, np.round(1e4 * planes).reshape(-1, 8)]).astype(np.int64)
    first = np.unique(key, axis=0, return_index=True)[1]
    piece, planes = piece[first], planes[first]
    chosen, at = np.unique(piece, return_inverse=True)
    number = np.full(len(best), -1, np.int32)
    number[chosen] = np.arange(len(chosen))
    begin, segments = material.segments_of(number, np.zeros(len(chosen), np.int64))
    depth = np.empty((len(piece), 2))
    for k in range(2):
        scaled = _scaled(material, planes[:, k], size)
        _part_depths(segments, begin, at, scaled, material.frame, material.across, depth[:, k])
    deepest, own = depth.max(axis=1), depth.argmax(axis=1)
    order = np.argsort(deepest, kind="stable")
    order = order[(depth.min(axis=1)[order] > skin) & (deepest[order] > deep)]
    best[piece[order]] = planes[order, own[order]]  # the last of several counts: the deepest
    return best


def _scaled(material: SampledMaterial, planes: FloatArray, size: FloatArray) -> FloatArray:
    """Return planes over x and y in cells and z in steps."""
    return np.asarray(planes * [size[0], size[1], size[2] / material.voxels, 1.0])


def _halved(
    material: SampledMaterial, plane: FloatArray, size: FloatArray, deep: float
) -> tuple[SampledMaterial, NDArray[np.int32], FloatArray]:
    """Cut segments by the plane, (4,), of their piece; return new pieces' parents, and sides, ±1.

    What is on one side and reaches less than `deep` from the plane stays with the other side.
    """
    is_planned = np.asarray(plane.any(axis=1))[material.piece]
    planned, rest = np.flatnonzero(is_planned), np.flatnonzero(~is_planned)
    x, y = material.xy(planned)
    a, b, slope, offset = _scaled(material, plane, size)[material.piece[planned]].T
    base = a * x + b * y - offset
    column, low, high = material.segments[planned].T
    before = np.stack([base + slope * low > 0.0, base + slope * high > 0.0], axis=1)
    crossed = before[:, 0] != before[:, 1]
    cut = high.copy()
    cut[crossed] = np.clip(np.rint(-base[crossed] / slope[crossed]), low[crossed], high[crossed])
    ends = np.stack([low, cut, high], axis=1)
    away = np.abs(base[:, None] + slope[:, None] * ends)
    real = ends[:, :-1] < ends[:, 1:]
    parent = np.nonzero(real)[0]
    halves = [column[parent], ends[:, :-1][real], ends[:, 1:][real]]
    was = np.concatenate([rest, planned[parent]])
    order = np.argsort(was, kind="stable")
    segments = np.concatenate([material.segments[rest], np.column_stack(halves)])[order]
    of = 2 * material.piece[was[order]]
    material = replace(material, segments=segments, shell=material.shell[was[order]])
    of[order >= len(rest)] += before[real]
    pairs = material.touching(of >> 1, np.arange(len(of)))  # on both sides of a plane

    def connected_by_side() -> NDArray[np.int32]:
        return connected(len(of), *pairs[of[pairs[:, 0]] == of[pairs[:, 1]]].T)

    group = connected_by_side()
    far = np.zeros(int(group.max()) + 1)
    reach = np.maximum(away[:, :-1], away[:, 1:])[real]
    np.maximum.at(far, group[order >= len(rest)], reach)
    of[(far[group] < deep) & plane[of >> 1].any(axis=1)] ^= 1
    material = replace(material, piece=connected_by_side())
    half = np.empty(int(material.piece.max()) + 1, of.dtype)
    half[material.piece] = of
    return material, half >> 1, np.where(half & 1, 1.0, -1.0)


def opposed(
    pairs: NDArray[np.int32], halves: FloatArray, middle_mm: FloatArray, size: FloatArray
) -> BoolArray:
    """Tell which pairs of pieces lie on both sides of what is one plane there, to 0.06 of a cell.

    Where columns stand on both sides of an upright plane they touch in a skin along it.

    Parameters
    ----------
    middle_mm : (pairs, 3)
        Place, from the lattice's lower corner, where the pieces of a pair are near each other.
    """
    out = np.zeros(len(pairs), np.bool_)
    near = np.flatnonzero(np.any(halves[pairs], axis=(2, 3)).all(axis=1))
    one, other = halves[pairs[near, 0]], halves[pairs[near, 1]]
    total = one[:, :, None] + other[:, None, :]
    off = np.einsum("nkli,ni->nkl", total[..., :3], middle_mm[near]) - total[..., 3]
    along = np.linalg.norm(total[..., :3], axis=3) < 0.2
    real = one.any(axis=2)[:, :, None] & other.any(axis=2)[:, None, :]
    out[near] = (real & along & (np.abs(off) < _SKIN * size.mean())).any(axis=(1, 2))
    return out


_ACROSS = 4
"""Points along each axis of the plane that parts two pieces: in one line they would be a hinge."""


def contacts(
    material: SampledMaterial, touching: NDArray[np.int32], index: IntArray, size: FloatArray
) -> tuple[NDArray[np.int32], FloatArray, FloatArray]:
    """Return points where pieces of one material and cell touch.

    Parameters
    ----------
    touching : (k, 2)
        Segments of one shell and cell that touch.
    index : (n, 3)
        Place of each piece's cell.

    Returns
    -------
    pairs : (k, 2)
    local : (k, 2, 3)
        Places in both, in their cells' own coordinates.
    area_mm2 : (k,)
    """
    found = material.piece[touching]
    found, touching = found[found[:, 0] != found[:, 1]], touching[found[:, 0] != found[:, 1]]
    column, low, high = material.segments[touching].transpose(2, 1, 0)
    beside = column[1] - column[0]
    axis = np.where(beside == 0, 2, beside == material.across)
    (x, y), (far_x, far_y) = (material.xy(each) for each in touching.T)
    bottom = low.max(axis=0)
    bottom, length = bottom / material.voxels, (high.min(axis=0) - bottom) / material.voxels
    count = len(index)
    key = found[:, :2].min(axis=1).astype(np.int64) * count + found[:, :2].max(axis=1)
    pairs, of = np.unique(key, return_inverse=True)
    # Columns touch in steps. Their vector area is that of the plane.
    _, _, pitch, cos, sin, *_ = material.frame.tolist()
    way = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])[axis]
    tall = np.where(axis < 2, size[2] * length, pitch)
    turn = np.where(found[:, 0] < found[:, 1], 1.0, -1.0)
    area = (turn * pitch * tall)[:, None] * way
    normal = np.stack([np.bincount(of, a) for a in area.T], axis=1)
    normal = normal / np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
    # A few points stand for all.
    place = np.stack([(x + far_x) / 2.0, (y + far_y) / 2.0, bottom], axis=1)
    place = np.repeat(place, _ACROSS, axis=0)
    place[:, 2] += np.outer(length, (np.arange(_ACROSS) + 0.5) / _ACROSS).ravel()
    of, area = np.repeat(of, _ACROSS), np.repeat(area / _ACROSS, _ACROSS, axis=0)
    low, span = np.full((len(pairs), 3), np.inf), np.full((len(pairs), 3), -np.inf)
    np.minimum.at(low, of, place)
    np.maximum.at(span, of, place - low[of])
    box = np.floor((_ACROSS - 1e-9) * (place - low[of]) / np.maximum(span, 0.05)[of])
    in_pair = box.astype(np.int64) @ [_ACROSS**2, _ACROSS, 1]
    boxes, into = np.unique(_ACROSS**3 * of + in_pair, return_inverse=True)
    size_mm2 = np.linalg.norm(area, axis=1)
    moments = np.stack([np.bincount(into, size_mm2 * x) for x in place.T], axis=1)
    middle = moments / np.bincount(into, size_mm2)[:, None]
    through = np.bincount(into, np.einsum("ni,ni->n", area, normal[of]))
    real = through > 1e-9 * pitch**2
    ends = np.stack(np.divmod(pairs[boxes[real] // _ACROSS**3], count), axis=1).astype(np.int32)
    return ends, 2.0 * (middle[real, None] - index[ends]) - 1.0, through[real]


@kernel
def _part_depths(
    segments: Any, begin: Any, piece: Any, planes: Any, frame: Any, nu: Any, depth: Any
) -> None:
    # How far a piece reaches to that side of a plane on which it reaches less.
    for j in range(piece.size):
        high, low = -np.inf, np.inf
        for s in range(begin[piece[j]], begin[piece[j] + 1]):
            x, y = column_xy(frame, nu, segments[s, 0])
            base = planes[j, 0] * x + planes[j, 1] * y - planes[j, 3]
            one, other = base + planes[j, 2] * segments[s, 1], base + planes[j, 2] * segments[s, 2]
            high, low = max(high, one, other), min(low, one, other)
        depth[j] = min(high, -low)
