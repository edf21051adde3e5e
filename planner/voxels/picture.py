"""Pictures of coloured solids as PNG: from outside, and cut open."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planner.fields.basic import project
from planner.formats.png import ImageKind, encode_layer
from planner.glance import channels
from planner.numerics import BoolArray, Float32Array, FloatArray, Int32Array, IntArray, as_point
from planner.voxels.columns import Grid, columns_of, snap

__all__ = ["pictures_of"]

# Rays are the columns of a voxel grid that stands along the line of sight: exact at every edge,
# and the same everywhere. Steps along a ray are 1/16 of a pixel, from which slopes are taken.


_AROUND, _ABOVE = (0.8, 0.6), (0.9, 0.43588989435406733)
"""Cosine and sine of the angles from which the part is seen: 37 degrees round, 26 degrees down."""

_FINER = 2
"""Rays a pixel along either side; their colours are averaged."""

_STEPS = 16
"""Along a ray, to a ray's spacing."""

_LIGHT = (-0.45, 0.65, 0.61237243569579)
"""Towards the light: from the upper left, before the part."""

_SHADE = (0.55, 0.5)
"""Of a material's colour: in the shade, and what light adds; cuts have it whole."""

_LEVELS = 40
"""Of light. Chosen: steps are hardly seen, and files are a third smaller."""

_PLACES = (0.0, 0.65, 0.85, 1.0)
"""Of the cut, as shares of the way from the middle to the front: the first that meets anything.
Chosen: of two bodies side by side it meets the one before, about in its middle."""

_MARGIN = 0.03
"""Of the picture's width, on either side."""


class _Pictures(NamedTuple):
    """PNGs of the same solids: from outside, cut open, and the first at half the size."""

    outside: bytes
    section: bytes
    thumbnail: bytes


class _Seen(NamedTuple):
    """What each ray meets first: number of a shell or -1, depth in steps, and whether on a cut."""

    shell: IntArray
    depth: IntArray
    cut: BoolArray


def pictures_of(
    solids: Sequence[tuple[FloatArray | Float32Array, IntArray, str]], *, width: int, height: int
) -> _Pictures:
    """Draw closed solids in their colours, on a transparent ground.

    Of the section what is in front of a vertical plane is taken off. It lies along the longer of
    the horizontal sides, through the middle; or before it, where that is between bodies.

    Parameters
    ----------
    solids
        Vertices in mm, outward faces between all of them, and the colour, ``#RRGGBB``.
    width, height
        Of the pictures in pixels, even; the solids fill them.
    """
    placed = [vertices.astype(np.float64) for vertices, _, _ in solids]
    low, high = _box(placed)
    across = int((high - low)[0] > (high - low)[1])  # of x and y, the shorter side
    normal = np.array([(1.0, 0.0, 0.0), (0.0, -1.0, 0.0)][across])
    view = _view()
    # Right, up and away are a left-handed set: what was outside would be inside.
    turned = [_product(points - 0.5 * (low + high), view) for points in placed]
    least, most = _box(turned)
    fill = 1.0 - 2.0 * _MARGIN
    pitch = float(max((most - least)[0] / width, (most - least)[1] / height)) / fill / _FINER
    nx, ny = width * _FINER, height * _FINER
    corner = 0.5 * (least + most) - 0.5 * pitch * np.array([nx, ny, 0.0])
    steps = pitch / _STEPS
    nz = int((most - least)[2] / steps) + 2
    while nz > 16000:  # what a grid can number
        steps, nz = 2.0 * steps, nz // 2 + 1
    origin = (float(corner[0]), float(corner[1]), float(least[2]) - steps)
    grid = Grid(origin, (pitch, pitch, steps), (nx, ny, nz))
    _, faces, colours = zip(*solids, strict=True)
    each = zip(placed, faces, strict=True)
    before = np.concatenate([((at - 0.5 * (low + high)) @ normal)[own] for at, own in each])
    first, last = before.min(axis=1), before.max(axis=1)
    places = (float(last.max()) * share for share in _PLACES)
    place = next(at for at in places if ((first <= at) & (at <= last)).any())
    plane = _plane_depth(_product(normal[None], view)[0], place, grid)
    inwards = (np.ascontiguousarray(each[:, ::-1], np.int32) for each in faces)
    both = _look(zip((snap(each, grid) for each in turned), inwards, strict=True), grid, plane)
    outside, section = (_colours(seen, colours, steps / pitch) for seen in both)
    return _Pictures(_encode(outside), _encode(section), _encode(_halved(outside)))


def _box(solids: Sequence[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Return the least and the greatest coordinates of points."""
    ends = np.array([[(each.min(), each.max()) for each in points.T] for points in solids])
    return ends[:, :, 0].min(axis=0), ends[:, :, 1].max(axis=0)


def _view() -> FloatArray:
    """Return the axes of the picture, a row each: right, up, and away from the eye."""
    (c, s), (rise, down) = _AROUND, _ABOVE
    right = np.array([c, s, 0.0])
    away = np.array([-s * rise, c * rise, -down])
    return np.stack([right, np.array([-s * down, c * down, rise]), away])


def _product(points: FloatArray, axes: FloatArray) -> FloatArray:
    """Return points in other axes."""
    return np.stack([project(points, as_point(axis)) for axis in axes], axis=1)


def _plane_depth(normal: FloatArray, place: float, grid: Grid) -> IntArray:
    """Return the step of each ray, (rows, columns), at which it passes a plane `place` from 0."""
    nx, ny, nz = grid.shape
    across = grid.origin_mm[0] + (np.arange(nx) + 0.5) * grid.pitch_mm[0]
    up = grid.origin_mm[1] + (np.arange(ny) + 0.5) * grid.pitch_mm[1]
    away = (place - (normal[0] * across + (normal[1] * up)[:, None])) / normal[2]
    step = np.floor((away - grid.origin_mm[2]) / grid.pitch_mm[2] + 0.5)
    return np.asarray(np.clip(step, 0, nz), dtype=np.int64)


def _look(
    solids: Iterable[tuple[NDArray[np.int64], Int32Array]], grid: Grid, plane: IntArray
) -> list[_Seen]:
    """Follow all rays to what they meet first, and to what they meet first behind a plane."""
    nx, ny, nz = grid.shape
    begins = np.stack([np.zeros(nx * ny, np.int32), plane.ravel().astype(np.int32)])
    shells, depths = np.full_like(begins, -1), np.full_like(begins, nz)
    for number, solid in enumerate(solids):
        for slab in columns_of(*solid, grid):
            rays = np.arange(len(slab.offsets) - 1) + slab.first_row * nx
            rays = np.repeat(rays, np.diff(slab.offsets))
            for begin, shell, depth in zip(begins, shells, depths, strict=True):
                # Where rays meet it, if that is nearer than what they have met.
                ahead = np.flatnonzero(slab.stop > begin.take(rays))
                ahead = ahead[np.diff(rays[ahead], prepend=-1) != 0]  # of each ray the first run
                own = rays[ahead]
                met = np.maximum(slab.start[ahead], begin[own])
                nearer = met < depth[own]
                shell[own[nearer]], depth[own[nearer]] = number, met[nearer]
    # No solid reaches the first step, where the rays of the whole begin.
    both = zip(shells, depths, depths == begins, strict=True)
    return [_Seen(*(each.reshape(ny, nx) for each in seen)) for seen in both]


def _colours(seen: _Seen, colours: Sequence[str], step: float) -> IntArray:
    """Return RGBA of each pixel, packed, the lowest row first, with light on slopes of the rays."""
    table = np.array([channels(colour) for colour in colours], np.float64)
    shell, depth = (np.pad(values, 1, constant_values=-1) for values in (seen.shell, seen.depth))
    at = np.flatnonzero(shell.ravel() >= 0)
    right, up = (_slope(shell, depth, at, away) * step for away in (1, shell.shape[1]))
    row, column = (places - 1 for places in np.divmod(at, shell.shape[1]))
    towards = right * _LIGHT[0] + up * _LIGHT[1] + _LIGHT[2]
    lit = np.floor(towards / np.sqrt(1.0 + right * right + up * up) * _LEVELS) / _LEVELS
    shade = _SHADE[0] + _SHADE[1] * np.clip(lit, 0.0, 1.0)
    shade[seen.cut[row, column]] = 1.0
    # A pixel is the mean of its rays, summed one after the other: the same bits on every machine.
    form = tuple(length // _FINER for length in seen.shell.shape)
    pixel = row // _FINER * form[1] + column // _FINER
    number = shell.ravel()[at]
    rays = np.bincount(pixel, minlength=form[0] * form[1])
    packed = (255.0 * rays / (_FINER * _FINER) + 0.5).astype(np.int64)
    for channel, shift in enumerate((24, 16, 8)):
        light = np.bincount(pixel, shade * table[number, channel], len(rays))
        mean = np.minimum(light / np.maximum(rays, 1), 255.0)
        packed |= np.where(rays > 0, (mean + 0.5).astype(np.int64), 0) << shift
    return packed.reshape(form)


def _slope(shell: IntArray, depth: IntArray, at: IntArray, away: int) -> FloatArray:
    """Return steps a ray at some rays, towards the rays that stand `away` of them on.

    It is the slope to the gentler of two neighbours, which is on the same face; their mean where
    they differ by a step at most, as on a plane.
    """
    none = 1e9
    shell, depth = shell.ravel(), depth.ravel()
    here = depth[at]
    ahead = np.where(shell[at + away] >= 0, (depth[at + away] - here).astype(np.float64), none)
    behind = np.where(shell[at - away] >= 0, (here - depth[at - away]).astype(np.float64), none)
    gentler = np.where(np.abs(ahead) <= np.abs(behind), ahead, behind)
    gentler[gentler == none] = 0.0
    even = (np.abs(ahead - behind) <= 1.5) & (ahead < none)
    return np.where(even, 0.5 * (ahead + behind), gentler)


def _halved(pixels: IntArray) -> IntArray:
    """Return packed pixels at half the size: means of four, weighted by how much each covers."""
    four = np.stack([pixels[row::2, column::2] for row in (0, 1) for column in (0, 1)])
    weight = four & 255
    cover = weight.sum(axis=0)
    halved = (cover + 2) // 4
    for shift in (24, 16, 8):
        light = ((four >> shift & 255) * weight).sum(axis=0)
        halved |= (light + cover // 2) // np.maximum(cover, 1) << shift
    return np.asarray(halved)


def _encode(pixels: IntArray) -> bytes:
    """Return the PNG of packed pixels (height, width), the lowest row first."""
    height, width = pixels.shape
    packed = pixels[::-1]
    edges = np.flatnonzero(np.diff(packed, axis=1, prepend=-1))
    used, label = np.unique(packed.ravel()[edges], return_inverse=True)
    colours = [tuple(c >> shift & 255 for shift in (24, 16, 8, 0)) for c in used.tolist()]
    offsets = np.searchsorted(edges, np.arange(height + 1) * width).astype(np.int64)
    start = (edges % width).astype(np.int32)
    stop = np.append(start[1:], 0).astype(np.int32)
    stop[stop == 0] = width
    kind = ImageKind(tuple(colours), indexed=False, pixel_mm=(0.25, 0.25))
    labels = (label + 1).astype(np.int32)
    return encode_layer((offsets, start, stop, labels), (0, height), width, kind)
