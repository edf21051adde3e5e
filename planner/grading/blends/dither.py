"""Cells of two materials dealt along a gradient, as levels on one lattice.

Each stretch of the gradient between two neighbouring materials makes two pieces, one of either.
Pieces are numbered along the gradient, and every cell centre gets the number of its piece: levels
half-way between numbers, drawn on the lattice of the centres, are the shells' interfaces. They
never touch, so shells are manifolds, and where the gradient jumps only its own materials lie
between.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from planner.arrays import FloatArray, IntArray
from planner.errors import ArgumentError
from planner.geometry.columns import MOST_VOXELS, Grid, dense, grid_for, iterate_columns
from planner.geometry.dither.bevelled import blue_noise_bevelled
from planner.geometry.dither.deal import deal_cells
from planner.geometry.dither.tile import blue_noise_ranks, thresholds
from planner.geometry.fields import Field
from planner.geometry.level_sets.split_curved import FIRST_SHIFT
from planner.geometry.mesh import Mesh
from planner.grading.blends.stretches import Stretch
from planner.grading.profile import Profile
from planner.materials.homogenisation.dithered import dithered_fraction

__all__ = ["MOST_TRIANGLES", "DealtField", "DealtPiece", "Expected", "dealt_pieces", "expected"]

MOST_TRIANGLES = 8_000_000
"""Of all shells together: files of 400 MB, some minutes and several GB to make."""

_SAMPLES = 200_000
_PARTS = 3  # of a cell's edge, to tell how much of it is inside
_SURFACE_TRIANGLES = 40.0  # a square of the part's surface, at half the cells; measured


@dataclass(frozen=True, slots=True)
class DealtPiece:
    """All cells of one material within one stretch: `grade` is its place from soft to hard."""

    stretch: int
    grade: int


def dealt_pieces(along: Sequence[Stretch]) -> tuple[DealtPiece, ...]:
    """Return the pieces of all stretches, in an order in which neighbours share a material."""
    pieces: list[DealtPiece] = []
    for number, stretch in enumerate(along):
        grades = (
            [stretch.lower, stretch.upper] if stretch.lower < stretch.upper else [stretch.lower]
        )
        last = pieces[-1].grade if pieces else None
        if (grades[-1] == last) or (grades[0] != last and not stretch.rising):
            grades.reverse()
        pieces += [DealtPiece(number, grade) for grade in grades]
    return tuple(pieces)


@dataclass(frozen=True, slots=True, eq=False)
class DealtField:
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
    along: tuple[Stretch, ...]
    pieces: tuple[DealtPiece, ...]
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

    def description(self) -> dict[str, object]:
        """Everything needed to build the field of the gradient again."""
        return self.field.description()

    def values(self, points_mm: FloatArray) -> FloatArray:
        """Return the cells' pieces at points (n, 3): (n,), each half-way between levels."""
        stretch, fraction = self.wanted(points_mm)
        dealt = blue_noise_bevelled().dealt_for(fraction)
        cell = np.floor((points_mm - self.corner_mm) / self.cell_mm).astype(np.int64)
        hard = deal_cells(dealt, cell, thresholds(blue_noise_ranks()))
        soft_piece, hard_piece = _numbers(self.along, self.pieces)
        piece = np.where(hard, hard_piece[stretch], soft_piece[stretch])
        return np.asarray((piece + 0.5) / len(self.pieces))

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
                pair = self.moduli_MPa[stretch.lower], self.moduli_MPa[stretch.upper]
                fraction[own] = dithered_fraction(*pair, target[own])
        return number, fraction


def _numbers(along: Sequence[Stretch], pieces: Sequence[DealtPiece]) -> tuple[IntArray, IntArray]:
    """Return the numbers of each stretch's softer and harder piece."""
    place = {(piece.stretch, piece.grade): n for n, piece in enumerate(pieces)}
    soft = [place[i, stretch.lower] for i, stretch in enumerate(along)]
    hard = [place[i, stretch.upper] for i, stretch in enumerate(along)]
    return np.array(soft), np.array(hard)


@dataclass(frozen=True, slots=True, eq=False)
class Expected:
    """What is to come of dealing, before it is done.

    Attributes
    ----------
    triangles
        Of all shells, roughly.
    fraction, cells : (stretches,)
        Mean volume fraction of the harder material that is wanted over each stretch's cells, each
        as far as it is inside the part, and how many cells these are.
    """

    triangles: float
    fraction: FloatArray
    cells: FloatArray


def expected(mesh: Mesh, dealt: DealtField) -> Expected:
    """Foresee what a part's cells come to.

    Raises
    ------
    ArgumentError
        There would be more than `MOST_TRIANGLES`; a cell that gives fewer is named.
    """
    triangles = _triangles(mesh, dealt)
    if not triangles <= MOST_TRIANGLES:
        # Between cells within the part and at its surface alone.
        coarser = dealt.cell_mm * float(np.cbrt(triangles / MOST_TRIANGLES))
        coarser = math.ceil(coarser * 20.0) / 20.0
        raise ArgumentError(
            f"--cell {dealt.cell_mm:g}: this part has {mesh.volume_mm3 / dealt.cell_mm**3:.2g} "
            f"cells of that size, whose shells would have some {triangles:.2g} triangles; up to "
            f"{MOST_TRIANGLES:.2g} are possible: take --cell {coarser:g} or larger, or --blend "
            "bands:4"
        )
    count = len(dealt.along)
    wanted, cells = np.zeros(count), np.zeros(count)
    for points_mm, share in _cells(mesh, dealt.cell_mm):
        stretch, fraction = dealt.wanted(points_mm)
        cells += np.bincount(stretch, weights=share, minlength=count)
        wanted += np.bincount(stretch, weights=share * fraction, minlength=count)
    mean = np.divide(wanted, cells, out=np.full(count, np.nan), where=cells > 0.0)
    return Expected(triangles, mean, cells)


def _cells(mesh: Mesh, cell_mm: float) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield centres of the cells that hold any of a part, and which share of each is inside."""
    low, high = mesh.bounds_mm
    first = low - (1.5 + FIRST_SHIFT) * cell_mm
    cells = np.ceil((high - first) / cell_mm).astype(int)
    parts = _PARTS if _PARTS * int(cells.max()) < MOST_VOXELS else 1
    nx, ny, nz = (cells * parts).tolist()
    x, y, z = first.tolist()
    fine_mm = cell_mm / parts
    grid = Grid((x, y, z), (fine_mm, fine_mm, fine_mm), (nx, ny, nz))
    for columns in iterate_columns(mesh, grid):
        index = np.argwhere(dense(columns))
        index[:, 1] += columns.first_row
        key, count = np.unique(
            np.ravel_multi_index(tuple((index // parts).T), tuple(cells)), return_counts=True
        )
        place = np.stack(np.unravel_index(key, tuple(cells)), axis=1)
        yield first + (place + 0.5) * cell_mm, count / parts**3


def _triangles(mesh: Mesh, dealt: DealtField) -> float:
    """Estimate the triangles of all shells from a sample of the part."""
    extent_mm = np.ptp(mesh.bounds_mm, axis=0)
    pitch_mm = max(float(np.cbrt(extent_mm.prod() / _SAMPLES)), float(extent_mm.max()) / 16000.0)
    table = blue_noise_bevelled()
    count, drawn = 0, 0.0
    grid = grid_for(mesh.bounds_mm, pitch_mm)
    for columns in iterate_columns(mesh, grid):
        index = np.argwhere(dense(columns)).astype(np.float64)
        index[:, 1] += columns.first_row
        points_mm = np.array(grid.origin_mm) + (index + 0.5) * pitch_mm
        share = table.dealt_for(dealt.wanted(points_mm)[1])
        drawn += float(np.interp(share, table.dealt, table.triangles_per_cell).sum())
        count += len(points_mm)
    if count == 0:  # walls thinner than the sample's pitch
        drawn, count = float(table.triangles_per_cell.max()), 1
    drawn /= count
    inner = 2.0 * drawn * mesh.volume_mm3 / dealt.cell_mm**3
    busy = drawn / float(table.triangles_per_cell.max())
    return inner + _SURFACE_TRIANGLES * busy * mesh.area_mm2 / dealt.cell_mm**2 + len(mesh.faces)
