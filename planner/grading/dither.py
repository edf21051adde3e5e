"""Dither: cells of two materials along a gradient, and what they come to."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from planner.cutting.grid import TETRAHEDRA
from planner.cutting.pieces import FIRST_SHIFT, Pieces, split
from planner.errors import ArgumentError
from planner.fields.basic import Field
from planner.grading.printability import CutPart, print_checks
from planner.grading.profile import Band, Profile, StiffnessScale
from planner.grading.regions import (
    BlendSegment,
    Printed,
    blend_segments,
    blended,
    catalogue_material,
    region_of,
)
from planner.materials.mixtures import TwoPhases
from planner.mesh.mesh import Mesh, compact
from planner.numerics import Float32Array, FloatArray, IntArray, as_point, kernel
from planner.plan import Check, Finding, Region, Shell
from planner.printers import Printer
from planner.voxels.columns import MOST_VOXELS, Grid, dense, inside_shares, voxelize

__all__ = ["CellDesign", "cell_design"]


# ------------------------------------------------------------------------------------------------
# What cells come to once their corners are bevelled.
#
# Shells of dealt cells are level sets on the lattice of the cells' centres, in the six tetrahedra
# between eight of them. So two materials meet half-way between centres, cells that touch along an
# edge or at a corner are joined or parted by one rule everywhere, and no edge ever has four faces.
# But a cell alone among others keeps half of its volume. Which fraction of the volume a dealt
# fraction comes to is counted here, exactly, on the very tile.


@dataclass(frozen=True, slots=True, eq=False)
class BevelledTile:
    """How a tile's cells come out, from all soft to all hard.

    Attributes
    ----------
    dealt : (n,)
        Fractions of cells, 0 to 1.
    volume : (n,)
        Fraction of the volume that is hard; rises strictly from 0 to 1.
    triangles_per_cell : (n,)
        Of the surface between both.
    """

    dealt: FloatArray
    volume: FloatArray
    triangles_per_cell: FloatArray

    def dealt_for(self, volume: FloatArray) -> FloatArray:
        """Return the fraction of cells to deal for a volume fraction."""
        return np.asarray(np.interp(volume, self.volume, self.dealt))


@cache
def blue_noise_bevelled() -> BevelledTile:
    """Return the table of the tile that cells are dealt by.

    Of 129 fractions; between them the volume is off by 2e-4 at most.
    `benchmarks/calibrate_dither.py` makes it.
    """
    data = (files("planner.grading") / "bevelled.json").read_bytes()
    columns = msgspec.json.decode(data, type=dict[str, list[float]])
    return BevelledTile(**{name: np.array(values) for name, values in columns.items()})


# ------------------------------------------------------------------------------------------------
# Dealing cells, and how much of the volume each of a lattice keeps, its corners bevelled.


def dither_cells(fraction: FloatArray, cell: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Tell which of some cells are hard: where the fraction exceeds a cell's own threshold.

    Thresholds are even over 0 to 1, neither included, by the ranks of the tile.

    Parameters
    ----------
    fraction : (n,)
        Wanted at each.
    cell : (n, 3) int64
        Its place in the lattice of cells.
    """
    ranks = blue_noise_ranks()
    i, j, k = (cell % len(ranks)).T
    return np.asarray(fraction > (ranks[i, j, k] + 0.5) / ranks.size)


# Volume for each of 1 to 4 corners of one label in a tetrahedron of volume 1/6.
_SHARE = np.array([0.0, 0.125, 0.25, 0.875 / 3.0, 0.25]) / 6.0


def own_volumes(label: NDArray[np.int16]) -> Float32Array:
    """Return the volume that each cell's centre comes to have around it, as a share of a cell.

    Parameters
    ----------
    label : (nx, ny, nz) int16
        What each cell belongs to; -1 where there is none, which counts as its neighbours' own.
    """
    found = np.zeros(tuple(n + 2 for n in label.shape), dtype=np.float32)
    _spread(np.pad(label, 1, constant_values=-1), TETRAHEDRA, _SHARE, found)
    return found[1:-1, 1:-1, 1:-1]


@kernel
def _spread(label: Any, corners: Any, share: Any, found: Any) -> None:
    nx, ny, nz = label.shape
    for i in range(nx - 1):
        for j in range(ny - 1):
            for k in range(nz - 1):
                for t in range(6):
                    for c in range(4):
                        at = corners[t, c]
                        x, y, z = i + (at & 1), j + (at >> 1 & 1), k + (at >> 2)
                        own = label[x, y, z]
                        if own < 0:
                            continue
                        same = 0
                        for d in range(4):
                            to = corners[t, d]
                            other = label[i + (to & 1), j + (to >> 1 & 1), k + (to >> 2)]
                            if other == own or other < 0:
                                same += 1
                        found[x, y, z] += share[same]


@cache
def blue_noise_ranks() -> IntArray:
    """Return the ranks of a periodic cube of 32^3 cells, each of 0 to 32767 once.

    By void and cluster (Ulichney 1993): at every fraction the hard cells lie evenly but without a
    pattern. Power at wavelengths above 8 cells is about 1 % of white noise's.
    `benchmarks/blue_noise_tile.py` makes it.
    """
    with (files("planner.grading") / "blue-noise-32.npy").open("rb") as file:
        ranks: IntArray = np.load(file).astype(np.int32)
    ranks.setflags(write=False)
    return ranks


# ------------------------------------------------------------------------------------------------
# Cells of two materials dealt along a gradient, as levels on one lattice.
#
# Every cell centre gets the number of the piece it belongs to, and levels half-way between numbers,
# drawn on the lattice of the centres, are the shells' interfaces. They never touch, so shells are
# manifolds. Pieces are numbered by material from soft to hard, so that cells of one material are
# joined wherever they are neighbours; between cells of materials further apart the materials
# between them make thin sheets. Where the target jumps, numbers begin anew: nothing but the
# materials on both sides of the jump comes to lie there.


class DitherPiece(NamedTuple):
    """All cells of one material, `grade` its place from soft to hard, between two jumps.

    `run` counts the parts of the field over which the target does not jump.
    """

    run: int
    grade: int


def dither_pieces(along: Sequence[BlendSegment]) -> tuple[DitherPiece, ...]:
    """Return the pieces of all stretches in the order of their numbers.

    The materials of a run stand from soft to hard or from hard to soft, such that it begins near
    the material that it has at the jump.
    """
    pieces: list[DitherPiece] = []
    for run in range(along[-1].run + 1):
        own = [stretch for stretch in along if stretch.run == run]
        low, high = min(s.lower for s in own), max(s.upper for s in own)
        grades = list(range(low, high + 1))
        from_low, from_high = own[0].lower - low, high - own[0].upper
        begin_MPa, end_MPa = own[0].ends_MPa
        if from_high < from_low or (from_high == from_low and end_MPa < begin_MPa):
            grades.reverse()
        pieces += [DitherPiece(run, grade) for grade in grades]
    return tuple(pieces)


@dataclass(frozen=True, slots=True, eq=False)
class DitherField:
    """The number of the piece that each cell belongs to, scaled to 0..1.

    It is meant for the corners of a grid whose pitch is the cell: these are the cells' centres.

    Attributes
    ----------
    field
        What the gradient follows.
    corner_mm : (3,)
        Where the lattice of cells begins.
    """

    field: Field
    profile: Profile
    moduli_MPa: tuple[float, ...]
    along: tuple[BlendSegment, ...]
    pieces: tuple[DitherPiece, ...]
    corner_mm: FloatArray
    cell_mm: float

    @property
    def name(self) -> str:
        """Kind of field: that which the gradient follows."""
        return self.field.name

    @property
    def levels(self) -> FloatArray:
        """Values between pieces."""
        return np.arange(1, len(self.pieces)) / len(self.pieces)

    @property
    def ends(self) -> IntArray:
        """Which pieces the softer and the harder material of each stretch are, (S, 2)."""
        number = self.pieces.index
        return np.array(
            [[number(DitherPiece(s.run, end)) for end in (s.lower, s.upper)] for s in self.along]
        )

    def description(self) -> dict[str, object]:
        """Everything needed to build the field of the gradient again."""
        return self.field.description()

    def values(self, points_mm: FloatArray) -> FloatArray:
        """Return the cells' pieces at points (n, 3): (n,), each half-way between levels."""
        _, _, piece = self.deal(points_mm)
        return np.asarray((piece + 0.5) / len(self.pieces))

    def deal(self, points_mm: FloatArray) -> tuple[IntArray, FloatArray, IntArray]:
        """Return stretch, wanted volume fraction of the harder material, and piece of each cell."""
        stretch, fraction = self.wanted(points_mm)
        dealt = blue_noise_bevelled().dealt_for(fraction)
        cell = np.floor((points_mm - self.corner_mm) / self.cell_mm).astype(np.int64)
        hard = dither_cells(dealt, cell)
        soft, harder = self.ends[stretch].T
        return stretch, fraction, np.where(hard, harder, soft)

    def wanted(self, points_mm: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return each point's stretch, and the volume fraction wanted of its harder material."""
        u = np.clip(np.asarray(self.field.values(points_mm), dtype=np.float64), 0.0, 1.0)
        if u.shape != (len(points_mm),) or not np.isfinite(u).all():
            raise ArgumentError(
                f"field {self.name!r}: it must give one finite number for each of {len(u)} points "
                "over the part and a cell around it"
            )
        starts = np.array([stretch.start for stretch in self.along[1:]])
        number = np.searchsorted(starts, u, side="right")
        target = self.profile.modulus_MPa(u)
        fraction = np.zeros(len(u))
        for index in np.unique(number).tolist():
            stretch = self.along[index]
            if stretch.lower < stretch.upper:
                own = number == index
                pair = TwoPhases(self.moduli_MPa[stretch.lower], self.moduli_MPa[stretch.upper])
                fraction[own] = pair.dithered_fraction(target[own])
        return number, fraction


# ------------------------------------------------------------------------------------------------
# Where dealt cells are: how much of each material lies in each stretch of the gradient.


_PARTS = 3  # of a cell's edge, to tell how much of it is inside


@dataclass(frozen=True, slots=True, eq=False)
class CellCounts:
    """What lies in each of S stretches, by piece of P.

    Attributes
    ----------
    volume_mm3 : (S, P)
        From the cells, corners bevelled, each as far as it is inside the part.
    bounds_mm : (S, P, 2, 3)
        Of the cells' centres, and a cell more; inside out where there is none.
    cells, wanted : (S,)
        Number of cells, and the mean volume fraction of the harder material that they should have.
    """

    volume_mm3: FloatArray
    bounds_mm: FloatArray
    cells: FloatArray
    wanted: FloatArray


def count_cells(mesh: Mesh, dealt: DitherField) -> CellCounts:
    """Count the cells of a part."""
    cell_mm = dealt.cell_mm
    first = mesh.bounds_mm[0] - (1.5 + FIRST_SHIFT) * cell_mm
    nx, ny, nz = np.ceil((mesh.bounds_mm[1] - first) / cell_mm).astype(int).tolist()
    shape = nx, ny, nz
    parts = _PARTS if _PARTS * max(shape) < MOST_VOXELS else 1
    inside = inside_shares(mesh, Grid(as_point(first), (cell_mm, cell_mm, cell_mm), shape), parts)
    used = np.flatnonzero(inside)
    centre = first + (np.stack(np.unravel_index(used, shape), axis=1) + 0.5) * cell_mm
    stretch, fraction, piece = dealt.deal(centre)
    label = np.full(shape, -1, dtype=np.int16)
    label.reshape(-1)[used] = piece
    share = inside.reshape(-1)[used]
    volume = share * own_volumes(label).reshape(-1)[used] * cell_mm**3
    stretches, pieces = len(dealt.along), len(dealt.pieces)
    key = stretch * pieces + piece
    bounds = np.empty((stretches * pieces, 2, 3))
    bounds[:, 0], bounds[:, 1] = np.inf, -np.inf
    np.minimum.at(bounds[:, 0], key, centre - cell_mm)
    np.maximum.at(bounds[:, 1], key, centre + cell_mm)
    cells = np.asarray(np.bincount(stretch, weights=share, minlength=stretches), np.float64)
    wanted = np.bincount(stretch, weights=share * fraction, minlength=stretches)
    volumes = np.bincount(key, weights=volume, minlength=stretches * pieces)
    volume_mm3 = np.asarray(volumes, np.float64).reshape(stretches, pieces)
    mean = np.divide(wanted, cells, out=np.full(stretches, np.nan), where=cells > 0.0)
    return CellCounts(volume_mm3, bounds.reshape(stretches, pieces, 2, 3), cells, mean)


# ------------------------------------------------------------------------------------------------
# How many triangles dealt cells come to, before they are cut.


_MOST_TRIANGLES = 8_000_000
"""Of all shells together: files of 400 MB, a minute or two and some GB to make."""

_SAMPLES = 200_000
_SURFACE_TRIANGLES = 20.0  # a square of the part's surface, at half the cells; measured


def affordable_cells(mesh: Mesh, dealt: DitherField, *, stated: bool) -> DitherField:
    """Return cells whose shells can be computed with: those given, or larger ones.

    Raises
    ------
    ArgumentError
        There would be more than `_MOST_TRIANGLES` of cells whose size was stated; one that gives
        fewer is named.
    """
    inner, surface = estimate_triangles(mesh, dealt)
    triangles = inner + surface
    if triangles <= _MOST_TRIANGLES:
        return dealt
    larger = 1.0  # times the cell: inner ones fall with its cube, others with its square
    while inner / larger**3 + surface / larger**2 > _MOST_TRIANGLES:
        larger *= 1.01
    coarser = math.ceil(dealt.cell_mm * larger * 20.0) / 20.0
    if not stated:
        return replace(dealt, cell_mm=coarser)
    raise ArgumentError(
        f"`cell_mm` {dealt.cell_mm:g}: this part has {mesh.volume_mm3 / dealt.cell_mm**3:.2g} "
        f"cells of that size, whose shells would have some {triangles:.2g} triangles; up to "
        f"{_MOST_TRIANGLES:.2g} are possible: take `cell_mm` {coarser:g} or larger, or `blend` "
        "bands:4"
    )


def estimate_triangles(mesh: Mesh, dealt: DitherField) -> tuple[float, float]:
    """Estimate the triangles of all shells from a sample: inside the part, and at its surface."""
    extent_mm = np.ptp(mesh.bounds_mm, axis=0)
    pitch_mm = max(math.cbrt(extent_mm.prod() / _SAMPLES), float(extent_mm.max()) / 16000.0)
    table = blue_noise_bevelled()
    columns, most = voxelize(mesh, pitch_mm), float(table.triangles_per_cell.max())
    centres = columns.grid.centre_mm(np.argwhere(dense(columns)))
    share = table.dealt_for(dealt.wanted(centres)[1])
    each = np.interp(share, table.dealt, table.triangles_per_cell)
    drawn = float(each.mean()) if len(each) else most  # walls thinner than the sample's pitch
    inner = 2.0 * drawn * mesh.volume_mm3 / dealt.cell_mm**3
    busy = drawn / most
    return inner, _SURFACE_TRIANGLES * busy * mesh.area_mm2 / dealt.cell_mm**2


# ------------------------------------------------------------------------------------------------
# Regions of a part whose cells were dealt, and what they come to.


_SHARE_ERROR = 0.01  # of the volume: cells of a gradient against those of an even fraction


@dataclass(frozen=True, slots=True, eq=False)
class CellDesign:
    """Cells of two materials among each other: their lattice, and what they come to."""

    dealt: DitherField
    counted: CellCounts
    printed: tuple[Printed, ...]
    stated: bool

    @property
    def says(self) -> Mapping[str, object]:
        """What a plan says of how targets between two materials are met."""
        return {"kind": "dither", "cell_mm": self.dealt.cell_mm, "tile": "blue-noise-32"}

    def cut(self, mesh: Mesh, along: Field, pitch_mm: float, within_mm: float) -> Pieces:
        """Divide the part along the cells, whatever the pitch of the field's own grid."""
        return split(mesh, self.dealt, self.dealt.levels, pitch_mm=self.dealt.cell_mm, follow=False)

    def regions(
        self, pieces: Pieces, shells: Sequence[Shell], scale: StiffnessScale
    ) -> Iterator[Region]:
        """Yield what of each material lies in each stretch.

        A piece's volume is exact; its stretches share in it as its cells do. The modulus is that of
        the stretch at its mean fraction; the error is the estimate's alone, because the fraction
        follows the target within the stretch.
        """
        dealt, volumes = self.dealt, self._volumes_mm3(pieces)
        shares, boxes = dict(self._shares(volumes)), self._boxes_mm(pieces, volumes)
        for number, (stretch, ends) in enumerate(zip(dealt.along, dealt.ends, strict=True)):
            for piece in dict.fromkeys(ends.tolist()):
                volume_mm3 = float(volumes[number, piece])
                if volume_mm3 <= 0.0:
                    continue
                grade = dealt.pieces[piece].grade
                band = Band(stretch.start, stretch.stop, grade, stretch.target_MPa)
                box = boxes[number, piece]
                region = region_of(band, self.printed[piece], volume_mm3, box, shells)
                if stretch.lower < stretch.upper:
                    region = _blended(region, stretch, *shares[number], scale, dealt.cell_mm)
                yield region

    def held(
        self, part: CutPart, shells: Sequence[Shell], scale: StiffnessScale, machine: Printer
    ) -> tuple[dict[str, Check], tuple[Finding, ...], list[str]]:
        """Hold cells against what was wanted, and the part as a whole against the printer.

        Cells of two materials hold each other: only walls of the part can be too thin.
        """
        cell_mm, least_mm = self.dealt.cell_mm, machine.minimum_feature_mm
        smaller = f"take a smaller --cell, down to {least_mm:g}"
        # One that is not stated is as small as it can be.
        cure = smaller if self.stated and cell_mm > least_mm else "take --blend nearest"
        off, findings = self._fractions(part.pieces, scale, cure)
        fine = cell_mm >= least_mm * (1.0 - 1e-9)
        messages = []
        mean_wall_mm = 2.0 * part.mesh.volume_mm3 / part.mesh.area_mm2  # were it a plate
        if cell_mm > mean_wall_mm:
            messages.append(
                f"cells of {cell_mm:g} mm are thicker than the part, whose walls are "
                f"{mean_wall_mm:.3g} mm on the mean: a place holds whichever cell happens to "
                f"be there, and stretches of the gradient may have none; {cure}"
            )
        if not fine:
            messages.append(
                f"cells of {cell_mm:g} mm are smaller than what {machine.title} prints "
                f"undistorted, {least_mm:g} mm: their volumes will be off; take --cell {least_mm:g}"
            )
        cells = [Finding(kind="cell", message=message, size_mm=cell_mm) for message in messages]
        walls, thin, cautions = print_checks(part, machine)
        checks = {**off, **walls, "cell_mm": Check(cell_mm, least_mm, fine)}
        return checks, (*cells, *findings, *thin), cautions

    def _fractions(
        self, pieces: Pieces, scale: StiffnessScale, cure: str
    ) -> tuple[dict[str, Check], tuple[Finding, ...]]:
        """Hold achieved volume fractions against those wanted, over each stretch.

        ``volume_fraction_error`` is that of the worst stretch, as a share of what may be: 0.01, and
        more where cells are few. `cure` is what to do where cells are too large for the gradient.
        """
        ids = [material.id for material in scale.palette.materials]
        worst, findings = 0.0, []
        for number, (achieved, wanted) in self._shares(self._volumes_mm3(pieces)):
            few = max(float(self.counted.cells[number]), 1.0) ** (-2.0 / 3.0)
            off = abs(achieved - wanted) / (_SHARE_ERROR + few)
            worst = max(worst, off)
            if off > 1.0:
                stretch = self.dealt.along[number]
                lower, upper = ids[stretch.lower], ids[stretch.upper]
                message = (
                    f"between {lower} and {upper}, at field {stretch.start:.4g} .. "
                    f"{stretch.stop:.4g}, {100 * achieved:.1f} % is {upper} where "
                    f"{100 * wanted:.1f} % is wanted: the gradient is too steep, or jumps, for "
                    f"cells of {self.dealt.cell_mm:g} mm; {cure} or a gentler profile"
                )
                findings.append(Finding("cell", message, upper, size_mm=self.dealt.cell_mm))
        return {"volume_fraction_error": Check(worst, 1.0, worst <= 1.0)}, tuple(findings)

    def _volumes_mm3(self, pieces: Pieces) -> FloatArray:
        """Share each piece's exact volume among its stretches, (stretches, pieces)."""
        exact = np.maximum(pieces.volumes_mm3, 0.0)
        shares = self.counted.volume_mm3.copy()
        for piece in np.flatnonzero((shares.sum(axis=0) <= 0.0) & (exact > 0.0)).tolist():
            # A sliver that no cell's centre is near to, or a sheet where the target is too steep.
            first = int((self.dealt.ends == piece).any(axis=1).argmax())
            shares[first, piece] = 1.0
        total = shares.sum(axis=0)
        np.divide(shares, total, out=shares, where=total > 0.0)
        return np.asarray(shares * exact)

    def _shares(self, volumes_mm3: FloatArray) -> Iterator[tuple[int, tuple[float, float]]]:
        """Yield achieved and wanted volume fraction of the harder material, by stretch."""
        each = zip(self.dealt.along, self.dealt.ends, volumes_mm3, strict=True)
        for number, (stretch, ends, volumes) in enumerate(each):
            soft, hard = volumes[ends].tolist()
            if stretch.lower < stretch.upper and soft + hard > 0.0:
                achieved, wanted = hard / (soft + hard), float(self.counted.wanted[number])
                yield number, (achieved, achieved if math.isnan(wanted) else wanted)

    def _boxes_mm(self, pieces: Pieces, volumes_mm3: FloatArray) -> FloatArray:
        """Return where each stretch has each piece, (stretches, pieces, 2, 3).

        Cells alone do not say how far a piece reaches: at a wall it is also drawn about centres
        that lie outside the part, which are not counted. So the points where a piece reaches
        furthest are given to the stretch that the field has there, or to the nearest one that has
        the piece: together, a piece's boxes are its bounds.
        """
        bounds_mm, counted = pieces.bounds_mm, self.counted
        low = np.maximum(counted.bounds_mm[:, :, 0], bounds_mm[None, :, 0])
        high = np.minimum(counted.bounds_mm[:, :, 1], bounds_mm[None, :, 1])
        there = volumes_mm3 > 0.0
        unseen = there & ~(low < high).all(axis=2)
        boxes = np.where(unseen[..., None, None], bounds_mm, np.stack([low, high], axis=2))
        for piece in np.flatnonzero(there.any(axis=0)).tolist():
            stretches = np.flatnonzero(there[:, piece])
            own = boxes[stretches, piece]
            reached = np.stack([own[:, 0].min(axis=0), own[:, 1].max(axis=0)])
            if not np.array_equal(reached, bounds_mm[piece]):
                furthest = _furthest_mm(pieces, piece)
                nearest = np.abs(stretches[:, None] - self.dealt.wanted(furthest)[0]).argmin(axis=0)
                np.minimum.at(own[:, 0], nearest, furthest)
                np.maximum.at(own[:, 1], nearest, furthest)
                boxes[stretches, piece] = own
        return boxes


def _furthest_mm(pieces: Pieces, piece: int) -> FloatArray:
    """Return the points, (6, 3), where a piece reaches furthest along each axis, either way."""
    used, _ = compact(pieces.shell_faces([piece]), len(pieces.vertices))
    own = pieces.vertices.take(used, axis=0)
    furthest = np.concatenate([own.argmin(axis=0), own.argmax(axis=0)])
    return np.asarray(own[furthest], dtype=np.float64)


def _blended(
    region: Region, stretch: BlendSegment, achieved: float, wanted: float, scale: StiffnessScale,
    cell_mm: float,
) -> Region:  # fmt: skip
    pair = stretch.lower, stretch.upper
    soft, hard = (scale.moduli_MPa[grade] for grade in pair)
    phases = TwoPhases(soft, hard)
    modulus = float(phases.dithered_MPa(achieved))
    low, high = phases.hashin_shtrikman_MPa(achieved)
    ends = phases.dithered_fraction(np.array(stretch.ends_MPa))
    error = phases.dither_error
    says: dict[str, Any] = {
        "moduli_MPa": [soft, hard],
        "fraction": [round(float(f), 6) for f in ends],
        "volume_fraction": achieved,
        "volume_fraction_wanted": wanted,
        "cell_mm": cell_mm,
        "bounds_MPa": [float(low), float(high)],
        "voigt_MPa": float(phases.voigt_MPa(achieved)),
        "reuss_MPa": float(phases.reuss_MPa(achieved)),
        "estimate_error": error,
    }
    off = modulus / float(phases.dithered_MPa(wanted))
    missed = (1.0 - error) * off - 1.0, (1.0 + error) * off - 1.0
    return blended(region, scale, pair, modulus, missed, error, "dither", says)


def cell_design(
    mesh: Mesh, field: Field, target: Profile, scale: StiffnessScale, machine: Printer,
    cell_mm: float | None,
) -> CellDesign:  # fmt: skip
    """Deal cells of two materials to each place between them.

    Parameters
    ----------
    cell_mm
        Edge of a cell; by default the printer's minimum feature, or as small as can be computed.

    Raises
    ------
    ArgumentError
        Too many cells.
    """
    along = blend_segments(target, scale.moduli_MPa)
    pieces = dither_pieces(along)
    least_mm = machine.minimum_feature_mm if cell_mm is None else cell_mm
    dealt = DitherField(field, target, scale.moduli_MPa, along, pieces, mesh.bounds_mm[0], least_mm)
    dealt = affordable_cells(mesh, dealt, stated=cell_mm is not None)
    printed = tuple(catalogue_material(scale, piece.grade, machine) for piece in pieces)
    return CellDesign(dealt, count_cells(mesh, dealt), printed, cell_mm is not None)
