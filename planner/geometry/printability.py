"""Places where a material's region is too thin, or too small, to print.

The region of a material is opened by a ball on a voxel grid: what no ball of the minimum wall
reaches is thin. At a convex edge this leaves a sliver that is no defect, so a place counts only
where it extends further than one minimum wall from sound material, measured inside the region,
over a length of half a minimum wall: that lets pass the edges and corners of a box, sharp edges
down to about 40 degrees, and the corners of obliquely cut bands.
"""

import itertools
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from planner.arrays import FloatArray
from planner.errors import ArgumentError
from planner.geometry.columns import MOST_VOXELS
from planner.geometry.fields import Field, PlanarField
from planner.geometry.inscribed import inscribed_ball
from planner.geometry.mesh import Mesh
from planner.geometry.thin_places import (
    COARSEST_RADIUS,
    Band,
    Place,
    Raster,
    raster_for,
    thin_places,
)

__all__ = ["Finding", "longest_checked_mm", "thin_walls"]

_SOUND = 0.98  # of the minimum wall: walls drawn at the minimum come out rounded


@dataclass(frozen=True)
class Finding:
    """A place that may not print.

    Attributes
    ----------
    kind
        "thin-wall": thinner than the minimum wall. "fragment": a separate piece of material that
        is smaller than the minimum wall in every direction.
    label
        Index of the piece that holds `place_mm`.
    place_mm
        Centre of the largest ball that fits into the place.
    size_mm
        Diameter of that ball: the thickness at the place's thickest point.
    extent_mm, volume_mm3
        Bounding box and volume of the place, in whole voxels.
    more
        Places of this material that were found beyond this one and are not listed.
    """

    kind: Literal["thin-wall", "fragment"]
    label: int
    place_mm: tuple[float, float, float]
    size_mm: float
    extent_mm: tuple[float, float, float]
    volume_mm3: float
    more: int = 0


@dataclass(frozen=True)
class _Region:
    """Adjacent pieces of one material, and the extent of the part that they take up."""

    material: Hashable
    first: int
    band: Band
    thickness_mm: float
    inner_mm: FloatArray  # planes between its pieces


def longest_checked_mm(minimum_wall_mm: float) -> float:
    """Return the longest extent of a part whose walls `thin_walls` can check."""
    return (MOST_VOXELS - 3) * minimum_wall_mm / (2 * COARSEST_RADIUS + 1)


def thin_walls(
    mesh: Mesh,
    field: Field,
    levels: Sequence[float],
    materials: Sequence[Hashable],
    minimum_wall_mm: float,
    *,
    limit: int = 20,
) -> tuple[Finding, ...]:
    """Find what is thinner than the minimum wall in the region of each material.

    Adjacent pieces of one material are one region. Places that touch are one finding.

    The grid's pitch is minimum_wall / 11 for small parts (a dog-bone), / 7 up to a cube of about
    200 mm (for a wall of 0.6 mm), and / 5 beyond, which keeps to some seconds and less than 1 GB.
    A wall of the minimum or more is never reported, in whatever direction it lies; one below
    0.85 of it (0.8, 0.75, 0.6 at / 9, / 7, / 5) always is, if it reaches further than a minimum
    wall; in between it depends on how it lies on the grid. Sheets thinner than the pitch are
    found; pins and fragments thinner than it may be missed. Sizes are short of the true ones by
    at most 0.02 minimum walls, 0.04 on the coarsest grid.

    Parameters
    ----------
    field, levels
        A field with planar level sets and the levels that divide the mesh into pieces.
    materials
        What each piece is made of, len(levels) + 1.
    limit
        Largest number of findings for a material, the largest places first; the last of them
        tells how many `more` there are.

    Returns
    -------
    tuple of Finding
        By material in order of the pieces, and by falling volume.

    Raises
    ------
    ArgumentError
        The wall or limit is not positive, the counts do not match, the field is not planar, or
        a region is longer than `longest_checked_mm`.
    """
    if not (0 < minimum_wall_mm < np.inf and limit > 0):
        raise ArgumentError(
            f"minimum wall is {minimum_wall_mm} mm and limit {limit}; both must be positive"
        )
    if len(materials) != len(levels) + 1:
        raise ArgumentError(
            f"{len(levels)} levels make {len(levels) + 1} pieces, and there are {len(materials)} "
            "materials; give one for each piece"
        )
    found: dict[Hashable, list[Finding]] = {}
    unlisted: dict[Hashable, int] = {}
    for region in _regions(mesh, field, levels, materials):
        findings, rest = _findings(mesh, region, minimum_wall_mm, limit)
        found.setdefault(region.material, []).extend(findings)
        unlisted[region.material] = unlisted.get(region.material, 0) + rest
    listed: list[Finding] = []
    for material, findings in found.items():
        findings.sort(key=lambda f: (-f.volume_mm3, f.label, f.place_mm))
        more = unlisted[material] + max(len(findings) - limit, 0)
        listed += findings[:limit]
        if more:
            listed[-1] = replace(listed[-1], more=more)
    return tuple(listed)


def _regions(
    mesh: Mesh, field: Field, levels: Sequence[float], materials: Sequence[Hashable]
) -> list[_Region]:
    if not isinstance(field, PlanarField):
        raise ArgumentError(
            f"field {field.name!r}: its level sets are not planes, and walls can be checked "
            "along planar fields only; use an axis"
        )
    planes = [field.plane(float(level)) for level in levels]
    normal = np.asarray(planes[0][0] if planes else (0.0, 0.0, 1.0), dtype=np.float64)
    terms = mesh.vertices[mesh.faces.ravel()] * normal
    along = terms[:, 0] + terms[:, 1] + terms[:, 2]
    start, end = float(along.min()), float(along.max())
    cuts = [-np.inf, *(float(offset) for _, offset in planes), np.inf]
    regions = []
    for material, group in itertools.groupby(range(len(materials)), key=materials.__getitem__):
        pieces = list(group)
        low, high = cuts[pieces[0]], cuts[pieces[-1] + 1]
        band = Band(
            normal, low if low > start else -float(np.inf), high if high < end else float(np.inf)
        )
        thickness = min(high, end) - max(low, start)
        if thickness > 0:
            inner = np.array(cuts[pieces[0] + 1 : pieces[-1] + 1])
            regions.append(_Region(material, pieces[0], band, thickness, inner))
    return regions


def _findings(mesh: Mesh, region: _Region, wall_mm: float, limit: int) -> tuple[list[Finding], int]:
    """Return up to `limit` findings of a region, and how many places were not looked at."""
    raster = raster_for(*_bounds(mesh, region.band), wall_mm)
    drawn = _drawn(region, raster.grid.pitch_mm[0])
    places = thin_places(mesh, drawn, raster)
    places.sort(key=lambda p: (-p.voxels, *p.low.tolist()))
    share = min(1.0, region.thickness_mm / raster.grid.pitch_mm[0])
    findings: list[Finding] = []
    for seen, place in enumerate(places):
        if len(findings) == limit:
            return findings, len(places) - seen
        finding = _measure(mesh, region, raster, place, wall_mm, share)
        if finding is not None:
            findings.append(finding)
    return findings, 0


def _bounds(mesh: Mesh, band: Band) -> tuple[FloatArray, FloatArray]:
    # of the part of the bounding box between the band's planes, by interval arithmetic
    low, high = mesh.bounds_mm
    terms = np.sort(np.stack([low * band.normal, high * band.normal]), axis=0)
    narrow_low, narrow_high = low.copy(), high.copy()
    for axis, n in enumerate(band.normal):
        if abs(n) > 1e-6:
            others = terms.sum(axis=1) - terms[:, axis]
            ends = sorted([(band.low_mm - others[1]) / n, (band.high_mm - others[0]) / n])
            narrow_low[axis] = min(max(low[axis], ends[0]), high[axis])
            narrow_high[axis] = max(min(high[axis], ends[1]), low[axis])
    return narrow_low, narrow_high


def _drawn(region: _Region, pitch_mm: float) -> Band:
    # a band thinner than a voxel is drawn one voxel thick, so that no centre misses it
    band = region.band
    spare = max(pitch_mm - region.thickness_mm, 0.0)
    if np.isfinite(band.low_mm) and np.isfinite(band.high_mm):
        spare /= 2
    return Band(band.normal, band.low_mm - spare, band.high_mm + spare)


def _measure(
    mesh: Mesh, region: _Region, raster: Raster, place: Place, wall_mm: float, share: float
) -> Finding | None:
    pitch = raster.grid.pitch_mm[0]
    band = region.band
    centre, radius = inscribed_ball(
        mesh.vertices,
        mesh.faces,
        raster.position_mm(place.deepest),
        band.normal,
        band.low_mm,
        band.high_mm,
        1.5 * pitch,
        wall_mm,
    )
    if 2 * radius >= _SOUND * wall_mm:
        return None
    extent = np.empty(3)
    extent[raster.order] = (place.high - place.low) * pitch
    x, y, z = centre.tolist()
    along = x * band.normal[0] + y * band.normal[1] + z * band.normal[2]
    small = place.alone and bool((extent - pitch < wall_mm).all())  # between voxel centres
    return Finding(
        kind="fragment" if small else "thin-wall",
        label=region.first + int(np.searchsorted(region.inner_mm, along, side="right")),
        place_mm=(x, y, z),
        size_mm=float(2 * radius),
        extent_mm=(float(extent[0]), float(extent[1]), float(extent[2])),
        volume_mm3=place.voxels * raster.grid.voxel_mm3 * share,
    )
