"""What of a plan will not print as drawn, with its place, its size and what to change."""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from planner.cutting.pieces import Pieces
from planner.fields.basic import Field, PlanarField
from planner.glance import sized
from planner.mesh.mesh import Measures, Mesh, connected, measure
from planner.mesh.part import fits_turned
from planner.numerics import FloatArray, IntArray, Point, as_point
from planner.plan import Check, Finding, Shell
from planner.printers import Printer
from planner.voxels.columns import MOST_VOXELS, grid_for, voxel_counts
from planner.voxels.thin_places import (
    SOUND,
    ThinPlace,
    longest_checked_mm,
    room_mm,
    space_around_mm,
    thin_solid_places,
    thin_space_places,
    thinnest_first,
)

__all__ = ["WITHIN_MM", "CutPart", "print_checks"]


# ------------------------------------------------------------------------------------------------
# A placed part, what it was divided along, and what came of it.


@dataclass(frozen=True, eq=False)
class CutPart:
    """A placed part, what it was divided along, and what came of it.

    Attributes
    ----------
    pitch_mm, within_mm
        Of the grid on which a curved field was drawn, and how near to it.
    translation_mm
        What took the part from its file to where it is placed: places are told where the user
        drew them.
    levels, names, shells
        Values of the field between the pieces, what each is printed in, and the shell of each
        material; none where cells of several lie among each other.
    cures
        What makes bands thicker, in words.
    """

    mesh: Mesh
    field: Field
    pieces: Pieces
    pitch_mm: float
    within_mm: float
    translation_mm: Point
    levels: FloatArray
    names: Sequence[str] = ("the part",)
    shells: Sequence[Shell] = ()
    cures: Sequence[str] = ()

    def drawn_mm(self, place_mm: Point) -> Point:
        """Return a place in the coordinates of the part's own file."""
        return as_point(np.subtract(place_mm, self.translation_mm))


# ------------------------------------------------------------------------------------------------
# Separate bits of a solid that are smaller than a limit.


class Fragments(NamedTuple):
    """Bodies of a solid that are smaller than a limit.

    Attributes
    ----------
    boxes_mm : (n, 2, 3)
        Of all of them.
    seen_mm, volumes_mm3 : (k, 2, 3), (k,)
        Of those large enough to be printed at all.
    """

    boxes_mm: FloatArray
    seen_mm: FloatArray
    volumes_mm3: FloatArray


def bodies_of(mesh: Mesh) -> Measures:
    """Measure what vertices in common hold together; the volume of a closed void is below 0."""
    corners = mesh.faces.T
    body = connected(len(mesh.vertices), corners[:2].ravel(), corners[1:].ravel())
    used, number = np.unique(body[corners[0]], return_inverse=True)
    return measure(mesh.vertices, mesh.faces, number.astype(np.int32), len(used))


def _closed_voids(found: Measures, part: CutPart, machine: Printer) -> Iterator[str]:
    """Say that a part's closed voids, of its bodies as measured, are printed full of support."""
    volumes_mm3 = -found.volume_mm3
    if count := int((volumes_mm3 > machine.minimum_feature_mm**3).sum()):
        largest = int(np.argmax(volumes_mm3))
        place = _point(part.drawn_mm(as_point(found.bounds_mm[largest].mean(axis=0))))
        what = "a closed void" if count == 1 else f"{count} closed voids, the largest"
        yield (
            f"{what} of {volumes_mm3[largest]:.3g} mm3 at {place} mm: it is printed full of "
            f"{machine.support}, which cannot be taken out; open it to the outside"
        )


def small_bodies(found: Measures, limit_mm: float, least_mm: float) -> Fragments:
    """Find bodies with less volume than a cube of a limit, or smaller than it in all directions.

    Bodies are as `bodies_of` measures them; voids are none. Bodies smaller than `least_mm` in all
    directions are not counted: a printer does not see them.
    """
    volume, extent = found.volume_mm3, np.ptp(found.bounds_mm, axis=1)
    small = (volume > 0.0) & ((volume < limit_mm**3) | (extent < limit_mm).all(axis=1))
    seen = small & (extent >= least_mm).any(axis=1)
    return Fragments(found.bounds_mm[small], found.bounds_mm[seen], volume[seen])


# ------------------------------------------------------------------------------------------------
# Findings about walls, layers, bits and gaps, in words: what, where in the part's own coordinates,
# how far off, and what to change.


def _thin_findings(
    kind: str, places: Sequence[ThinPlace], unlisted: int, part: CutPart, limit_mm: float,
    name: str | None = None,
) -> Iterator[Finding]:  # fmt: skip
    """Say where walls of the part, layers of a material or gaps are thinner than a limit.

    The last one tells how many more there are than are listed.
    """
    for place in places:
        drawn_mm = part.drawn_mm(place.place_mm)
        at = f"at {_point(drawn_mm)} mm over {sized(place.extent_mm, '.2f')} mm"
        of = f"of {place.size_mm:.2f} mm {at}"
        if kind == "thin-wall":
            number = np.searchsorted(part.levels, _field_at(part, place), side="right")
            name, more = part.names[int(number)], "wall"
            cure = _one_of(["thicken the part there", *_larger(place, limit_mm, "it")])
            message = f"{name}: a wall {of} is below the minimum wall of {limit_mm:g} mm; {cure}"
        elif kind == "thin-band":
            more = "place"
            cure = _one_of([*part.cures, *_larger(place, limit_mm, "the part")])
            message = (
                f"{name}: a layer {of}, field {_field_at(part, place):.3f}, is below the smallest "
                f"feature of {limit_mm:g} mm: it blurs into its neighbours and will not have its "
                f"stiffness; {cure}"
            )
        else:
            more = "gap"
            message = (
                f"a gap {of} is narrower than the smallest feature of {limit_mm:g} mm: it will "
                "fuse or hold support; widen or close it"
            )
        if unlisted and place is places[-1]:
            message += f"; and {unlisted} more {more}{'s' * (unlisted > 1)}"
        yield Finding(kind, message, name, place.place_mm, drawn_mm, place.size_mm)


def _fragments_finding(
    bits: Fragments, name: str | None, part: CutPart, limit_mm: float
) -> Finding:
    """Say how many separate bits are smaller than the minimum feature: of a material, or loose."""
    count, largest = len(bits.seen_mm), int(np.argmax(bits.volumes_mm3))
    what = "a separate bit" if count == 1 else f"{count} separate bits, the largest"
    box_mm, volume_mm3 = bits.seen_mm[largest], bits.volumes_mm3[largest]
    place_mm, extent_mm = as_point(box_mm.mean(axis=0)), as_point(np.ptp(box_mm, axis=0))
    drawn_mm = part.drawn_mm(place_mm)
    cure = "join it to the part, or leave it out" if name is None else _one_of(part.cures)
    message = (
        f"{name or 'the part'}: {what} of {sized(extent_mm, '.2f')} mm and "
        f"{volume_mm3:.2g} mm3 at {_point(drawn_mm)} mm, smaller than the smallest feature of "
        f"{limit_mm:g} mm, will not print as drawn; {cure}"
    )
    return Finding("fragment", message, name, place_mm, drawn_mm, max(extent_mm))


_MOST_LARGER = 5.0
"""Chosen: nobody prints a part larger than so many times to be rid of a layer."""


def _larger(place: ThinPlace, limit_mm: float, what: str) -> Iterator[str]:
    """Say by what factor a part would have to grow, rounded up, so that it is enough."""
    if place.size_mm * _MOST_LARGER >= limit_mm:
        yield f"print {what} {math.ceil(10.0 * limit_mm / place.size_mm) / 10.0:.1f} times as large"


def _one_of(cures: Sequence[str]) -> str:
    *others, last = cures
    return f"{', '.join(others)}, or {last}" if others else last


def _point(place_mm: Sequence[float]) -> str:
    # + 0.0: a place that rounds to zero has no sign.
    return "(" + ", ".join(f"{round(coordinate, 2) + 0.0:.2f}" for coordinate in place_mm) + ")"


# ------------------------------------------------------------------------------------------------
# How far the interfaces of a curved field lie from its true level sets.


WITHIN_MM = 0.02
"""How near interfaces of curved fields are to lie to their level sets: half a printed pixel."""

_INTERFACE_SAMPLES = 5_000
_KEPT, _KEPT_AT_A_PITCH = 0.99, 0.9  # of the area
_REACH_MM = 0.01  # for the field's slope


def _interfaces(part: CutPart, findings: list[Finding]) -> tuple[dict[str, Check], list[str]]:
    """Hold interfaces against the level sets that they stand for; also return what to know."""
    distance_mm, area_mm2 = _interface_distances_mm(part)
    error_mm, limit_mm = _quantile(distance_mm, _KEPT, area_mm2), part.within_mm
    cautions = []
    if math.isinf(limit_mm) and (lost := _lost_at_the_surface(part)):
        message = (
            f"cells of {part.pitch_mm:g} mm hold nothing of {', '.join(lost)}, which is at the "
            "part's surface: it is printed as its neighbour; take a finer --pitch, or none"
        )
        findings.append(Finding(kind="pitch", message=message, size_mm=part.pitch_mm))
    if error_mm > WITHIN_MM:
        near = float(area_mm2[distance_mm <= WITHIN_MM].sum() / area_mm2.sum())
        why = "they are cut off at creases of the field, or it bends more than triangles can follow"
        if math.isinf(limit_mm):
            why = "without --pitch they are divided where the field bends"
        cautions.append(
            f"interfaces lie within {1e3 * WITHIN_MM:g} um of the field over "
            f"{math.floor(100.0 * near)} % of their area, and {1e3 * error_mm:.0f} um or more off "
            f"over the last per cent: {why}"
        )
    if error_mm > limit_mm or math.isinf(limit_mm):
        # Creases of a field are cut off within a pitch, however small: the rule of a stated one.
        error_mm, limit_mm = _quantile(distance_mm, _KEPT_AT_A_PITCH, area_mm2), part.pitch_mm / 2
    ok = error_mm <= limit_mm
    if not ok:
        message = (
            f"interfaces lie {1e3 * error_mm:.0f} um or more from where the field has them, over "
            f"{1e3 * limit_mm:.0f} um: the field bends or has creases within a pitch of "
            f"{part.pitch_mm:g} mm; take a finer --pitch"
        )
        findings.append(Finding(kind="pitch", message=message, size_mm=error_mm))
    return {"interface_error_um": Check(1e3 * error_mm, 1e3 * limit_mm, ok)}, cautions


def _lost_at_the_surface(part: CutPart) -> list[str]:
    """Return what no piece is of, though the field has it at vertices of the part."""
    at = part.field.values(part.mesh.vertices)
    low, high = (np.searchsorted(part.levels, at + 1e-6 * way) for way in (-1.0, 1.0))
    held = np.unique(low[low == high])
    return list(dict.fromkeys(part.names[k] for k in held if not part.pieces.volumes_mm3[k]))


def _interface_distances_mm(part: CutPart) -> tuple[FloatArray, FloatArray]:
    """Measure how far interfaces lie from their level sets, and the area that each stands for.

    At the centres and corners of up to 5000 triangles, by the field's slope along their normals;
    a pitch at most.
    """
    pieces, field = part.pieces, part.field
    count = len(pieces.cap_faces)
    if count == 0:
        return np.zeros(1), np.ones(1)
    chosen, corners, normal, length = _some_caps(pieces, np.arange(count), _INTERFACE_SAMPLES)
    normal *= _REACH_MM / np.maximum(length, 1e-300)[:, None]
    centre = corners.mean(axis=1)
    level = part.levels[pieces.cap_level[chosen]]
    value = field.values(centre)
    off = np.abs([value - level, *(field.values(p) - level for p in corners.transpose(1, 0, 2))])
    sides = [field.values(place) - value for place in (centre + normal, centre - normal)]
    off, rise = off.max(axis=0), np.abs(sides).max(axis=0)  # of a crease, the side that is steep
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = np.where(off > 0.0, _REACH_MM * off / rise, 0.0)
    return np.minimum(distance, part.pitch_mm), length


def _quantile(values: FloatArray, share: float, weights: FloatArray) -> float:
    """Return the value that so large a share of the weights is not above."""
    return float(np.quantile(values, share, weights=weights, method="inverted_cdf"))


def _some_caps(
    pieces: Pieces, members: IntArray, most: int
) -> tuple[IntArray, FloatArray, FloatArray, FloatArray]:
    """Return some interface triangles, evenly so many at most: which, corners, normals, lengths."""
    chosen = members[:: max(1, -(-len(members) // most))]
    corners = pieces.vertices[pieces.cap_faces[chosen]].astype(np.float64)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return chosen, corners, normal, np.linalg.norm(normal, axis=1)


# ------------------------------------------------------------------------------------------------
# How thick bands between two curved interfaces are.


_THICKNESS_SAMPLES = 200  # of an interface
_STEPS = 5
_NEAR = 0.02  # of a band: how near to the other interface a way has to end


@dataclass(frozen=True, eq=False)
class BandThickness:
    """A band of one material between two interfaces, measured at points spread over them.

    Attributes
    ----------
    first, last
        Its pieces, neighbours of one material being one band.
    thickness_mm, area_mm2 : (n,)
        Length of the way from one interface to the other along the normal, and how much of the
        interfaces it stands for.
    middle_mm : (n, 3)
        Half-way.
    """

    first: int
    last: int
    thickness_mm: FloatArray
    area_mm2: FloatArray
    middle_mm: FloatArray

    def kept_mm(self, share: float) -> float:
        """Return the thickness that all but a share of the area keeps."""
        return _quantile(self.thickness_mm, share, self.area_mm2)


def _band_thicknesses(part: CutPart) -> Iterator[BandThickness]:
    """Measure the bands that have an interface on both sides, in the order of the field.

    From the centres of up to 200 triangles of either interface along their normals to where the
    field has the other level. Ways that do not end there, as beyond an edge of the field, are
    left out.
    """
    longest_mm = float(np.linalg.norm([np.ptp(each) for each in part.pieces.vertices.T]))
    for _, group in itertools.groupby(range(len(part.names)), key=part.names.__getitem__):
        own = list(group)
        inner = own[0] > 0 and own[-1] < len(part.names) - 1
        if inner and (band := _measured(part, own[0], own[-1], longest_mm)):
            yield band


def _measured(part: CutPart, first: int, last: int, longest_mm: float) -> BandThickness | None:
    pieces, field, levels = part.pieces, part.field, part.levels
    low, high = float(levels[first - 1]), float(levels[last])
    sides: list[tuple[FloatArray, ...]] = []
    for level, sign, end in ((first - 1, 1.0, high), (last, -1.0, low)):
        members = np.flatnonzero(pieces.cap_level == level)
        _, corners, normal, length = _some_caps(pieces, members, _THICKNESS_SAMPLES)
        solid = length > 0.0
        middle, length = corners.mean(axis=1)[solid], length[solid]
        way = sign * (normal[solid] / length[:, None])
        sides.append((middle, way, 0.5 * length, np.full(len(length), end)))
    start, towards, area, goal = (np.concatenate(both) for both in zip(*sides, strict=True))
    if not len(start):
        return None
    own = np.where(goal == high, low, high)
    begin = field.values(start)  # centres of triangles lie off their level by a chord's height
    reached = np.full(len(start), 0.25 * part.pitch_mm)
    with np.errstate(all="ignore"):
        for _ in range(_STEPS):
            value = field.values(start + reached[:, None] * towards)
            slope = (value - begin) / (goal - begin) / reached  # of the band, per mm
            better = np.where(slope > 0.0, 1.0 / slope, 2.0 * reached)
            reached = np.minimum(np.clip(better, 0.2 * reached, 8.0 * reached), longest_mm)
        value = field.values(start + reached[:, None] * towards)
        good = (np.abs(value - goal) <= _NEAR * (high - low)) & (begin != goal)
    if not good.any():
        return None
    middle = start + 0.5 * reached[:, None] * towards
    thickness = reached * (goal - own) / np.where(good, goal - begin, 1.0)
    return BandThickness(first, last, thickness[good], area[good], middle[good])


# ------------------------------------------------------------------------------------------------
# What of a plan will not print as drawn, with its place and size.
#
# A wall stands by itself, so it is the part as a whole that has to have the minimum wall: where it
# is of several materials, they are jetted into each other and cure as one. A band is held by what
# it is bonded to, and has to be as thick as the smallest feature alone: below that neighbours'
# droplets mix through all of it, and it has no stiffness of its own.


_LISTED = 3  # findings of a kind and a material
_LEAST = 0.05  # of a band's area or volume may be thinner: it then has its stiffness all the same
_PASSED = 3.0  # limits that the tapering edge of a layer may be wide
_TRIED = 9  # points of a band that balls are put into


def print_checks(
    part: CutPart, machine: Printer
) -> tuple[dict[str, Check], tuple[Finding, ...], list[str]]:
    """Hold a part against the printer: tray, walls, layers, bits, gaps, native voxels.

    Returns
    -------
    checks : dict
        ``tray_excess_mm``: how far the part reaches beyond the tray at worst.
        ``places_too_thin``: walls of the part below the minimum wall, layers of one material below
        the minimum feature, separate bits smaller than it. ``thinnest_band_mm``: the thickness
        that 95 % of the thinnest band keeps, of bands with an interface on both sides and of
        layers found too thin; left out where there is neither. ``gaps_too_narrow``: gaps below
        the minimum feature.
        ``interface_error_um``, of curved fields: distance from their level sets that 99 % of the
        interfaces' area keeps, at most 20; with a stated pitch 90 %, at most half of it.
        ``voxel_volume_error``: volume of each piece in the printer's own voxels against its own,
        of the part's volume, at worst. A voxel is counted wrongly only where the surface passes
        within half its diagonal, which is the limit. Voxels are coarser than the printer's where
        a part over the tray would need more than can be numbered.

        Walls and voxels of a part that is far over the tray are not checked; the findings then
        say so: its unit is wrong.
    findings : tuple of Finding
        With place, size, limit and what to change, the tray first; three of a kind and a material
        at most. Messages have places in the coordinates of the part's own file.
    cautions : list of str
        How far interfaces lie from a curved field, where that is beyond 20 um; closed voids.
    """
    extent_mm = np.ptp(part.mesh.bounds_mm, axis=0)
    excess_mm = float((extent_mm - np.array(machine.tray_mm)).max())
    checks = {"tray_excess_mm": Check(max(excess_mm, 0.0), 0.0, excess_mm <= 0.0)}
    findings = [_too_large(extent_mm, machine)] if excess_mm > 0.0 else []
    if excess_mm > max(machine.tray_mm):
        message = "walls and voxels were not checked: the part is far over the tray of "
        findings.append(Finding("unchecked", f"{message}{machine.title}; check its unit"))
        return checks, tuple(findings), []
    wall_mm, feature_mm = machine.minimum_wall_mm, machine.minimum_feature_mm
    bodies = bodies_of(part.mesh)
    around_mm = float(extent_mm.max()) + space_around_mm(feature_mm)
    if around_mm <= longest_checked_mm(min(wall_mm, feature_mm)):
        checks |= _walls(part, bodies, machine, findings)
    else:
        message = "walls, bands and gaps were not checked: the part is too long for so small a"
        what = f"feature as {feature_mm:g}" if feature_mm <= wall_mm else f"wall as {wall_mm:g}"
        findings.append(Finding("unchecked", f"{message} {what} mm"))
    cautions: list[str] = []
    if not isinstance(part.field, PlanarField) and len(part.levels):
        interfaces, cautions = _interfaces(part, findings)
        checks |= interfaces
    checks["voxel_volume_error"] = _voxel_check(part, machine)
    return checks, tuple(findings), [*cautions, *_closed_voids(bodies, part, machine)]


def _too_large(extent_mm: FloatArray, machine: Printer) -> Finding:
    size, tray = sized(extent_mm, ".1f"), sized(machine.tray_mm, "g")
    turned = fits_turned(extent_mm, machine.tray_mm)
    cure = "turn it to fit" if turned else "scale or divide the part, or check its unit"
    message = f"the part is {size} mm, larger than the tray of {machine.title}, {tray} mm; {cure}"
    return Finding("tray", message, size_mm=float(extent_mm.max()))


def _walls(
    part: CutPart, bodies: Measures, machine: Printer, findings: list[Finding]
) -> dict[str, Check]:
    """Hold walls, layers, separate bits and gaps of a part against the printer."""
    limit_mm = machine.minimum_feature_mm
    walls, unlisted = thin_solid_places(part.mesh, machine.minimum_wall_mm, listed=_LISTED)
    findings += _thin_findings("thin-wall", walls, unlisted, part, machine.minimum_wall_mm)
    loose = small_bodies(bodies, limit_mm, max(machine.pixel_mm))
    if len(loose.seen_mm):
        findings.append(_fragments_finding(loose, None, part, limit_mm))
        unlisted += len(loose.seen_mm)
    count, thicknesses, thick = len(walls) + unlisted, list[float](), True
    measured = tuple(_band_thicknesses(part)) if part.shells else ()
    for shell in part.shells:
        found, number, thinnest = _layers(part, shell, measured, machine, bare=bool(walls))
        findings += found
        count += number
        thicknesses += thinnest
        thick &= not any(finding.kind == "thin-band" for finding in found)
    checks = {"places_too_thin": Check(count, 0, count == 0)}
    if thicknesses:
        checks["thinnest_band_mm"] = Check(min(thicknesses), limit_mm, thick)
    gaps, unlisted = thin_space_places(part.mesh, limit_mm, listed=_LISTED)
    findings += _thin_findings("gap", gaps, unlisted, part, limit_mm)
    return checks | {"gaps_too_narrow": Check(len(gaps) + unlisted, 0, not gaps)}


def _layers(
    part: CutPart, shell: Shell, measured: Sequence[BandThickness], machine: Printer, *, bare: bool
) -> tuple[list[Finding], int, list[float]]:
    """Return findings of a material, how many places they stand for, and thicknesses in mm.

    `bare` tells that walls of the part were found: they need not be told again of each material.
    Places that together hold next to nothing of its smallest piece do not count.
    """
    limit_mm, name = machine.minimum_feature_mm, shell.material
    own = [number for number, called in enumerate(part.names) if called == name]
    volumes_mm3 = part.pieces.volumes_mm3[own]
    least_mm3 = _LEAST * float(min(volumes_mm3[volumes_mm3 > 0.0], default=0.0))
    bands = [band for band in measured if band.first in own]
    solid = Mesh(shell.vertices.astype(np.float64), shell.faces.astype(np.int32))
    bits = small_bodies(bodies_of(solid), limit_mm, max(machine.pixel_mm))
    thin = [(band, _thin_band(band, solid, limit_mm)) for band in bands]
    places, unlisted = [place for _, place in thin if place is not None], 0
    told = {n for band, place in thin if place for n in range(band.first, band.last + 1)}
    if not told.issuperset(own):
        passed_mm = _PASSED * limit_mm
        drawn, unlisted = thin_solid_places(
            solid, limit_mm, listed=_LISTED, widest_passed_mm=passed_mm, least_mm3=least_mm3
        )
        drawn = [place for place in drawn if not _loose(place, bits)]
        drawn = [place for place in drawn if not (bare and _whole(place, part, limit_mm))]
        places, unlisted = (drawn, unlisted) if drawn else (places, 0)
    unlisted += max(len(places) - _LISTED, 0)
    places = places[:_LISTED]
    findings = list(_thin_findings("thin-band", places, unlisted, part, limit_mm, name))
    loose = len(bits.seen_mm) if bits.volumes_mm3.sum() >= least_mm3 else 0
    if loose:
        findings.append(_fragments_finding(bits, name, part, limit_mm))
    thicknesses = [p.size_mm for p in places] or [band.kept_mm(_LEAST) for band in bands]
    return findings, len(places) + unlisted + loose, thicknesses


def _loose(place: ThinPlace, bits: Fragments) -> bool:
    """Tell whether a place is one of the separate bits."""
    at, slack = np.array(place.place_mm), 0.1 * np.array(place.extent_mm)
    low, high = bits.boxes_mm[:, 0] - slack, bits.boxes_mm[:, 1] + slack
    return place.alone and bool(((low <= at) & (at <= high)).all(axis=1).any())


def _whole(place: ThinPlace, part: CutPart, limit_mm: float) -> bool:
    """Tell whether the part as a whole is no thicker at a place than the layer there."""
    _, room = room_mm(part.mesh, np.array([place.place_mm]), 0.25 * limit_mm, limit_mm)
    return float(room[0]) <= place.size_mm + 0.1 * limit_mm


def _thin_band(band: BandThickness, solid: Mesh, limit_mm: float) -> ThinPlace | None:
    """Return where a band is too thin by its field, if balls between its triangles confirm it."""
    if band.kept_mm(_LEAST) >= SOUND * limit_mm:
        return None
    thin = np.flatnonzero(band.thickness_mm < SOUND * limit_mm)
    thin = thin[thinnest_first(band.thickness_mm[thin])]
    tried = thin[np.unique(np.linspace(0, len(thin) - 1, _TRIED).astype(np.int64))]
    centres, room = room_mm(solid, band.middle_mm[tried], 0.25 * limit_mm, limit_mm)
    sure = np.flatnonzero((room > 0.0) & (room < SOUND * limit_mm))
    if 2 * len(sure) <= len(tried):
        return None
    order = sure[thinnest_first(room[sure])]
    middle = order[len(order) // 2]
    extent_mm, size_mm = as_point(np.ptp(band.middle_mm[thin], axis=0)), float(room[middle])
    share = float(band.area_mm2[thin].sum()) * size_mm / 2.0
    return ThinPlace(as_point(centres[middle]), size_mm, extent_mm, share, False)


def _field_at(part: CutPart, place: ThinPlace) -> float:
    return float(part.field.values(np.array([place.place_mm]))[0])


def _voxel_check(part: CutPart, machine: Printer) -> Check:
    """Hold the pieces of a part against the printer's voxels, or larger ones of a large part."""
    native_mm = np.array([*machine.pixel_mm, machine.layer_mm])
    extent_mm = np.ptp(part.mesh.bounds_mm, axis=0)
    voxel = native_mm * max(1.0, float((extent_mm / native_mm).max()) / (MOST_VOXELS - 1))
    grid = grid_for(part.mesh.bounds_mm, voxel.tolist())
    pieces = part.pieces
    each = (pieces.shell_faces([number]) for number in range(pieces.count))
    counted = np.array(voxel_counts(pieces.vertices.astype(np.float64), each, grid))
    off_mm3 = np.abs(counted * grid.voxel_mm3 - pieces.volumes_mm3)
    error = float(off_mm3.max()) / part.mesh.volume_mm3
    limit = part.mesh.area_mm2 * float(np.linalg.norm(voxel)) / part.mesh.volume_mm3
    return Check(error, limit, error <= limit)
