"""Walls, bands, bits and gaps of a part divided along curved level sets.

A wall stands by itself, so it is the part as a whole that has to have the minimum wall: where it
is of several materials, they are jetted into each other and cure as one. A band is held by what it
is bonded to, and has to be as thick as the smallest feature alone: below that neighbours' droplets
mix through all of it, and it has no stiffness of its own.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.arrays import FloatArray
from planner.geometry.fields import Field
from planner.geometry.fragments import Fragments, small_bodies
from planner.geometry.mesh import Mesh
from planner.geometry.printability import longest_checked_mm
from planner.geometry.shells import Pieces
from planner.geometry.solid_walls import (
    SOUND,
    ThinPlace,
    room_mm,
    thin_solid_places,
    thin_space_places,
)
from planner.grading.band_thickness import BandThickness, band_thicknesses
from planner.grading.wall_words import band_words, bits_words, gap_words, wall_words
from planner.plan import Check, Finding, Shell
from planner.printers import Printer

__all__ = ["Divided", "wall_checks"]

_LISTED = 3  # findings of a kind and a material
_LEAST = 0.05  # of a band's area may be thinner
_PASSED = 3.0  # limits that the tapering edge of a layer may be wide
_TRIED = 9  # points of a band that balls are put into


@dataclass(frozen=True, eq=False)
class Divided:
    """A placed part, what it was divided along, and what came of it.

    Attributes
    ----------
    names
        What each piece is printed in.
    cure
        What makes bands thicker, in words.
    """

    mesh: Mesh
    field: Field
    levels: FloatArray
    pieces: Pieces
    names: Sequence[str]
    shells: Sequence[Shell]
    pitch_mm: float
    cure: str


def wall_checks(part: Divided, machine: Printer) -> tuple[dict[str, Check], tuple[Finding, ...]]:
    """Hold walls, layers, separate bits and gaps of a part against the printer.

    Returns
    -------
    checks : dict
        ``places_too_thin``: walls of the part below the minimum wall, layers of one material below
        the minimum feature, separate bits smaller than it. ``thinnest_band_mm``: the thickness
        that 95 % of the thinnest band keeps, of bands with an interface on both sides and of
        layers found too thin; left out where there is neither. ``gaps_too_narrow``: gaps below
        the minimum feature.
    findings : tuple of Finding
        With place, size, limit and what to change; three of a kind and a material at most.
    """
    extent_mm = np.ptp(part.mesh.bounds_mm, axis=0)
    if not bool((extent_mm <= 2.0 * np.array(machine.tray_mm)).all()):
        return {}, ()  # print_checks says so
    limit_mm = machine.minimum_feature_mm
    if float(extent_mm.max()) > longest_checked_mm(limit_mm) - 8.0 * limit_mm:
        message = "bands and gaps were not checked: the part is too long for so small a feature"
        return {}, (Finding(kind="unchecked", message=f"{message} as {limit_mm:g} mm"),)
    walls, unlisted = thin_solid_places(part.mesh, machine.minimum_wall_mm, listed=_LISTED)
    findings = [
        wall_words(place, _piece_name(part, place), machine, unlisted if place is walls[-1] else 0)
        for place in walls
    ]
    count, thicknesses = len(walls) + unlisted, []
    measured = band_thicknesses(part.pieces, part.field, part.levels, part.names, part.pitch_mm)
    for shell in part.shells:
        own = [band for band in measured if part.names[band.first] == shell.material]
        found, number, thinnest = _layers(part, shell, own, machine, bool(walls))
        findings += found
        count += number
        thicknesses += thinnest
    checks = {"places_too_thin": Check(count, 0, count == 0)}
    if thicknesses:
        thick = not any(finding.kind == "thin-band" for finding in findings)
        checks["thinnest_band_mm"] = Check(min(thicknesses), limit_mm, thick)
    gaps, unlisted = thin_space_places(part.mesh, limit_mm, listed=_LISTED)
    for gap in gaps:
        findings.append(gap_words(gap, machine, unlisted if gap is gaps[-1] else 0))
    checks["gaps_too_narrow"] = Check(len(gaps) + unlisted, 0, not gaps)
    return checks, tuple(findings)


def _layers(
    part: Divided, shell: Shell, bands: Sequence[BandThickness], machine: Printer, bare: bool
) -> tuple[list[Finding], int, list[float]]:
    """Return findings of a material, how many places they stand for, and thicknesses in mm.

    `bare` tells that walls of the part were found: they need not be told again of each material.
    """
    limit_mm = machine.minimum_feature_mm
    solid = Mesh(shell.vertices.astype(np.float64), shell.faces.astype(np.int32))
    bits = small_bodies(solid, limit_mm, max(machine.pixel_mm))
    thin = [(band, _thin_band(band, solid, limit_mm)) for band in bands]
    places, unlisted = [place for _, place in thin if place is not None], 0
    told = {n for band, place in thin if place for n in range(band.first, band.last + 1)}
    if not {n for n, name in enumerate(part.names) if name == shell.material} <= told:
        drawn, unlisted = thin_solid_places(
            solid, limit_mm, listed=_LISTED, widest_passed_mm=_PASSED * limit_mm
        )
        drawn = [
            p for p in drawn if not _loose(p, bits) and not (bare and _whole(p, part, limit_mm))
        ]
        places, unlisted = (drawn, unlisted) if drawn else (places, 0)
    unlisted += max(len(places) - _LISTED, 0)
    places = places[:_LISTED]
    findings = [
        band_words(
            place,
            shell.material,
            _field_at(part, place),
            machine,
            part.cure,
            unlisted if place is places[-1] else 0,
        )
        for place in places
    ]
    if bits.count:
        findings.append(bits_words(bits, shell.material, machine, part.cure))
    thicknesses = [p.size_mm for p in places] or [band.kept_mm(_LEAST) for band in bands]
    return findings, len(places) + unlisted + bits.count, thicknesses


def _loose(place: ThinPlace, bits: Fragments) -> bool:
    """Tell whether a place is one of the separate bits."""
    at, slack = np.array(place.place_mm), 0.1 * np.array(place.extent_mm)
    low, high = bits.boxes_mm[:, 0] - slack, bits.boxes_mm[:, 1] + slack
    return place.alone and bool(((low <= at) & (at <= high)).all(axis=1).any())


def _whole(place: ThinPlace, part: Divided, limit_mm: float) -> bool:
    """Tell whether the part as a whole is no thicker at a place than the layer there."""
    _, room = room_mm(part.mesh, np.array([place.place_mm]), 0.25 * limit_mm, limit_mm)
    return float(room[0]) <= place.size_mm + 0.1 * limit_mm


def _thin_band(band: BandThickness, solid: Mesh, limit_mm: float) -> ThinPlace | None:
    """Return where a band is too thin by its field, if balls between its triangles confirm it."""
    if band.kept_mm(_LEAST) >= SOUND * limit_mm:
        return None
    thin = np.flatnonzero(band.thickness_mm < SOUND * limit_mm)
    thin = thin[np.argsort(band.thickness_mm[thin], kind="stable")]
    tried = thin[np.unique(np.linspace(0, len(thin) - 1, _TRIED).astype(np.int64))]
    points = band.middle_mm[tried]
    centres, room = room_mm(solid, points, 0.25 * limit_mm, limit_mm)
    sure = np.flatnonzero((room > 0.0) & (room < SOUND * limit_mm))
    if 2 * len(sure) <= len(tried):
        return None
    order = sure[np.argsort(room[sure], kind="stable")]
    middle = order[len(order) // 2]
    x, y, z = centres[middle].tolist()
    width, depth, height = np.ptp(band.middle_mm[thin], axis=0).tolist()
    size_mm = float(room[middle])
    share = float(band.area_mm2[thin].sum()) * size_mm / 2.0
    return ThinPlace(
        (x, y, z), size_mm, float(room[order[0]]), (width, depth, height), share, False
    )


def _field_at(part: Divided, place: ThinPlace) -> float:
    return float(part.field.values(np.array([place.place_mm]))[0])


def _piece_name(part: Divided, place: ThinPlace) -> str:
    return part.names[int(np.searchsorted(part.levels, _field_at(part, place), side="right"))]
