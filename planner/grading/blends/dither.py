"""Cells of two materials dealt along a gradient, as levels on one lattice.

Every cell centre gets the number of the piece it belongs to, and levels half-way between numbers,
drawn on the lattice of the centres, are the shells' interfaces. They never touch, so shells are
manifolds. Pieces are numbered by material from soft to hard, so that cells of one material are
joined wherever they are neighbours; between cells of materials further apart the materials between
them make thin sheets. Where the target jumps, numbers begin anew: nothing but the materials on both
sides of the jump comes to lie there.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.arrays import FloatArray, IntArray
from planner.errors import ArgumentError
from planner.geometry.dither.bevelled import blue_noise_bevelled
from planner.geometry.dither.deal import deal_cells
from planner.geometry.dither.tile import blue_noise_ranks, thresholds
from planner.geometry.fields import Field
from planner.grading.blends.stretches import Stretch
from planner.grading.profile import Profile
from planner.materials.homogenisation.dithered import dithered_fraction

__all__ = ["DealtField", "DealtPiece", "dealt_pieces"]


@dataclass(frozen=True, slots=True)
class DealtPiece:
    """All cells of one material, `grade` its place from soft to hard, between two jumps.

    `run` counts the parts of the field over which the target does not jump.
    """

    run: int
    grade: int


def dealt_pieces(along: Sequence[Stretch]) -> tuple[DealtPiece, ...]:
    """Return the pieces of all stretches in the order of their numbers.

    The materials of a run stand from soft to hard or from hard to soft, such that it begins near
    the material that it has at the jump.
    """
    pieces: list[DealtPiece] = []
    for run in range(along[-1].run + 1):
        own = [stretch for stretch in along if stretch.run == run]
        low, high = min(s.lower for s in own), max(s.upper for s in own)
        grades = list(range(low, high + 1))
        from_low, from_high = own[0].lower - low, high - own[0].upper
        if from_high < from_low or (from_high == from_low and not own[0].rising):
            grades.reverse()
        pieces += [DealtPiece(run, grade) for grade in grades]
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
        _, _, piece = self.deal(points_mm)
        return np.asarray((piece + 0.5) / len(self.pieces))

    def deal(self, points_mm: FloatArray) -> tuple[IntArray, FloatArray, IntArray]:
        """Return stretch, wanted volume fraction of the harder material, and piece of each cell."""
        stretch, fraction = self.wanted(points_mm)
        dealt = blue_noise_bevelled().dealt_for(fraction)
        cell = np.floor((points_mm - self.corner_mm) / self.cell_mm).astype(np.int64)
        hard = deal_cells(dealt, cell, thresholds(blue_noise_ranks()))
        place = {(piece.run, piece.grade): n for n, piece in enumerate(self.pieces)}
        of_soft = np.array([place[s.run, s.lower] for s in self.along])
        of_hard = np.array([place[s.run, s.upper] for s in self.along])
        return stretch, fraction, np.where(hard, of_hard[stretch], of_soft[stretch])

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
