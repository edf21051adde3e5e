"""What to cut a part along, at which levels, and what each piece is printed in."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.arrays import FloatArray
from planner.errors import ArgumentError
from planner.geometry.fields import Field
from planner.geometry.mesh import Mesh
from planner.geometry.shells import Pieces
from planner.grading.bands import Band, equal_bands, natural_bands
from planner.grading.blends.choice import BlendChoice
from planner.grading.blends.dealt_regions import dealt_regions, fraction_checks
from planner.grading.blends.dither import DealtField, dealt_pieces
from planner.grading.blends.foresee import check_size
from planner.grading.blends.mixtures import mixed_bands
from planner.grading.blends.period_regions import with_periods
from planner.grading.blends.periods import Period, laminated
from planner.grading.blends.stretches import stretches
from planner.grading.blends.tally import Tally, tally
from planner.grading.printed import Printed, catalogue_material
from planner.grading.profile import Profile
from planner.grading.regions import regions_of
from planner.grading.stiffness_scale import StiffnessScale
from planner.plan import Check, Finding, Region, Shell
from planner.printers import Printer

__all__ = ["Design", "design_pieces"]

_MOST_BANDS = 10_000


@dataclass(frozen=True, slots=True, eq=False)
class Design:
    """Pieces along a gradient.

    Attributes
    ----------
    bands
        Field and target of each piece; empty where cells are dealt.
    printed
        What each piece is printed in.
    periods
        Of each band, where two materials take turns; else empty.
    dealt, counted
        Where cells of two materials lie among each other, their lattice and what they come to; else
        None.
    mean_wall_mm
        Twice the part's volume over its area: its thickness were it a plate.
    """

    choice: BlendChoice
    bands: tuple[Band, ...]
    printed: tuple[Printed, ...]
    periods: tuple[Period | None, ...] = ()
    dealt: DealtField | None = None
    counted: Tally | None = None
    mean_wall_mm: float = math.inf

    @property
    def levels(self) -> FloatArray:
        """Values of the field that is cut along, between pieces."""
        if self.dealt is not None:
            return self.dealt.levels
        return np.array([band.start for band in self.bands[1:]])

    def regions(
        self, pieces: Pieces, shells: Sequence[Shell], scale: StiffnessScale
    ) -> tuple[Region, ...]:
        """Report what was cut, with what it comes to together."""
        if self.dealt is not None and self.counted is not None:
            return dealt_regions(pieces, self.printed, shells, self.dealt, self.counted, scale)
        regions = regions_of(pieces, self.bands, self.printed, shells)
        if self.periods:
            return with_periods(regions, tuple(zip(self.bands, self.periods, strict=True)), scale)
        return regions

    def checks(
        self, pieces: Pieces, scale: StiffnessScale, machine: Printer
    ) -> tuple[dict[str, Check], tuple[Finding, ...]]:
        """Hold dealt cells against what was wanted and what the printer can do."""
        if self.dealt is None or self.counted is None:
            return {}, ()
        checks, findings = fraction_checks(pieces, self.dealt, self.counted, scale)
        cell_mm = self.dealt.cell_mm
        if cell_mm < machine.minimum_feature_mm * (1.0 - 1e-9):
            message = (
                f"cells of {cell_mm:g} mm are smaller than what {machine.title} prints "
                f"undistorted, {machine.minimum_feature_mm:g} mm: their volumes will be off; take "
                "--cell "
                f"{machine.minimum_feature_mm:g}"
            )
            findings = (Finding(kind="cell", message=message, size_mm=cell_mm), *findings)
        if cell_mm > self.mean_wall_mm:
            message = (
                f"cells of {cell_mm:g} mm are thicker than the part, whose walls are "
                f"{self.mean_wall_mm:.3g} mm on the mean: a place holds whichever cell happens to "
                "be there, and stretches of the gradient may have none; take a smaller --cell"
            )
            findings = (Finding(kind="cell", message=message, size_mm=cell_mm), *findings)
        return checks, findings

    def document(self) -> dict[str, object] | None:
        """Return what plan.json says of the choice; None of the nearest material."""
        if self.choice.kind == "nearest":
            return None
        found: dict[str, object] = {"kind": self.choice.kind}
        if self.choice.kind == "bands":
            found["periods"] = self.choice.periods
        if self.dealt is not None:
            found["cell_mm"] = self.dealt.cell_mm
            found["tile"] = "blue-noise-32"
        return found


def design_pieces(
    choice: BlendChoice, mesh: Mesh, field: Field, target: Profile, scale: StiffnessScale,
    machine: Printer, *, bands: int | None, cell_mm: float | None,
) -> Design:  # fmt: skip
    """Decide what each place of a part is printed in.

    Parameters
    ----------
    bands
        Equal steps of the field, with ``nearest`` and ``mix``.
    cell_mm
        Edge of a cell, with ``dither``; the printer's minimum feature by default.

    Raises
    ------
    ArgumentError
        Options that do not go together or are out of range; too many cells.
    """
    if bands is not None and choice.kind in ("dither", "bands"):
        raise ArgumentError(
            f"--bands {bands}: it goes with --blend nearest or mix"
            + ("; write --blend bands:N for N periods" if choice.kind == "bands" else "")
        )
    if bands is not None and not 1 <= bands <= _MOST_BANDS:
        raise ArgumentError(f"--bands {bands}: it must be a whole number from 1 to {_MOST_BANDS}")
    if cell_mm is not None and choice.kind != "dither":
        raise ArgumentError(f"--cell {cell_mm:g}: it goes with --blend dither")
    moduli = scale.moduli_MPa
    if choice.kind == "mix":
        return Design(choice, *mixed_bands(target, scale, bands, machine))
    if choice.kind == "bands":
        laminate = laminated(target, stretches(target, moduli), moduli, choice.periods)
        steps = tuple(band for band, _ in laminate)
        return Design(
            choice, steps, _materials(steps, scale, machine), tuple(p for _, p in laminate)
        )
    if choice.kind == "dither":
        return _dithered(choice, mesh, field, target, scale, machine, cell_mm)
    steps = natural_bands(target, moduli) if bands is None else equal_bands(target, moduli, bands)
    return Design(choice, steps, _materials(steps, scale, machine))


def _materials(
    steps: Sequence[Band], scale: StiffnessScale, machine: Printer
) -> tuple[Printed, ...]:
    return tuple(catalogue_material(scale, band.grade, machine) for band in steps)


def _dithered(
    choice: BlendChoice, mesh: Mesh, field: Field, target: Profile, scale: StiffnessScale,
    machine: Printer, cell_mm: float | None,
) -> Design:  # fmt: skip
    along = stretches(target, scale.moduli_MPa)
    pieces = dealt_pieces(along)
    dealt = DealtField(
        field, target, scale.moduli_MPa, along, pieces, mesh.bounds_mm[0],
        machine.minimum_feature_mm if cell_mm is None else cell_mm,
    )  # fmt: skip
    printed = tuple(catalogue_material(scale, piece.grade, machine) for piece in pieces)
    check_size(mesh, dealt)
    mean_wall_mm = 2.0 * mesh.volume_mm3 / mesh.area_mm2
    return Design(
        choice, (), printed, dealt=dealt, counted=tally(mesh, dealt), mean_wall_mm=mean_wall_mm
    )
