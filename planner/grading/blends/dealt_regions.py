"""Regions of a part whose cells were dealt, and what they come to."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from planner.arrays import FloatArray
from planner.geometry.shells import Pieces, piece_bounds_mm, piece_volumes_mm3
from planner.grading.bands import Band
from planner.grading.blends.blend_interval import blend_interval_MPa
from planner.grading.blends.dither import DealtField
from planner.grading.blends.tally import Tally
from planner.grading.printed import Printed
from planner.grading.regions import files_of, region_of
from planner.grading.stiffness_scale import StiffnessScale
from planner.materials.homogenisation.bounds import hashin_shtrikman_MPa, reuss_MPa, voigt_MPa
from planner.materials.homogenisation.dithered import (
    dither_table,
    dithered_fraction,
    dithered_modulus_MPa,
)
from planner.plan import Check, Finding, Region, Shell

__all__ = ["dealt_regions", "fraction_checks"]

_SHARE_ERROR = 0.01  # of the volume: cells of a gradient against those of an even fraction


@dataclass(frozen=True, slots=True)
class _Share:
    """Volume fraction of the harder material in a stretch."""

    achieved: float
    wanted: float
    cells: float

    @property
    def off(self) -> float:
        """How far it is off, over what few cells may be."""
        limit = _SHARE_ERROR + max(self.cells, 1.0) ** (-2.0 / 3.0)
        return float(abs(self.achieved - self.wanted) / limit)


def dealt_regions(
    pieces: Pieces, printed: Sequence[Printed], shells: Sequence[Shell], dealt: DealtField,
    counted: Tally, scale: StiffnessScale,
) -> tuple[Region, ...]:  # fmt: skip
    """Report what of each material lies in each stretch.

    A piece's volume is exact; its stretches share in it as its cells do. The modulus is that of
    the stretch at its mean fraction; the error is the estimate's alone, because the fraction
    follows the target within the stretch.
    """
    volumes, bounds = _volumes_mm3(pieces, dealt, counted), piece_bounds_mm(pieces)
    files = files_of(shells)
    shares = _shares(volumes, dealt, counted)
    regions: list[Region] = []
    for number, stretch in enumerate(dealt.along):
        for grade in sorted({stretch.lower, stretch.upper}):
            piece = _piece(dealt, stretch.run, grade)
            volume_mm3 = float(volumes[number, piece])
            if volume_mm3 <= 0.0:
                continue
            band = Band(stretch.start, stretch.stop, grade, stretch.target_MPa)
            low = np.maximum(counted.bounds_mm[number, piece, 0], bounds[piece, 0])
            high = np.minimum(counted.bounds_mm[number, piece, 1], bounds[piece, 1])
            box = np.stack([low, high]) if (low < high).all() else bounds[piece]
            index = len(regions) + 1
            region = region_of(index, band, printed[piece], volume_mm3, box, files)
            if stretch.lower < stretch.upper:
                region = _blended(region, number, dealt, shares[number], scale)
            regions.append(region)
    return tuple(regions)


def fraction_checks(
    pieces: Pieces, dealt: DealtField, counted: Tally, scale: StiffnessScale
) -> tuple[dict[str, Check], tuple[Finding, ...]]:
    """Hold achieved volume fractions against those wanted, over each stretch.

    Returns
    -------
    checks : dict
        ``volume_fraction_error``: of the worst stretch, as a share of what may be: 0.01, and more
        where cells are few.
    findings : tuple of Finding
        What to do about stretches that are off.
    """
    shares = _shares(_volumes_mm3(pieces, dealt, counted), dealt, counted)
    worst = max((share.off for share in shares.values()), default=0.0)
    findings = []
    for number, share in shares.items():
        if share.off > 1.0:
            stretch = dealt.along[number]
            lower, upper = (
                scale.palette.materials[grade].id for grade in (stretch.lower, stretch.upper)
            )
            findings.append(
                Finding(
                    kind="cell",
                    message=f"between {lower} and {upper}, at field {stretch.start:.4g} .. "
                    f"{stretch.stop:.4g}, {100 * share.achieved:.1f} % is {upper} where "
                    f"{100 * share.wanted:.1f} % is wanted: the gradient is too steep for cells "
                    f"of {dealt.cell_mm:g} mm; take a smaller --cell or a gentler profile",
                    material=upper,
                    size_mm=dealt.cell_mm,
                )
            )
    return {"volume_fraction_error": Check(worst, 1.0, worst <= 1.0)}, tuple(findings)


def _volumes_mm3(pieces: Pieces, dealt: DealtField, counted: Tally) -> FloatArray:
    """Share each piece's exact volume among its stretches, (stretches, pieces)."""
    exact = np.maximum(piece_volumes_mm3(pieces), 0.0)
    shares = counted.volume_mm3.copy()
    for piece in np.flatnonzero((shares.sum(axis=0) <= 0.0) & (exact > 0.0)).tolist():
        # A sliver that no cell's centre is near to, or a sheet where the target is too steep.
        wanted = dealt.pieces[piece]
        own = [
            n for n, s in enumerate(dealt.along)
            if s.run == wanted.run and wanted.grade in (s.lower, s.upper)
        ]  # fmt: skip
        shares[own[0] if own else 0, piece] = 1.0
    total = shares.sum(axis=0)
    return np.asarray(np.divide(shares, total, out=np.zeros_like(shares), where=total > 0) * exact)


def _shares(volumes_mm3: FloatArray, dealt: DealtField, counted: Tally) -> dict[int, _Share]:
    found = {}
    for number, stretch in enumerate(dealt.along):
        soft, hard = (
            float(volumes_mm3[number, _piece(dealt, stretch.run, grade)])
            for grade in (stretch.lower, stretch.upper)
        )
        if stretch.lower < stretch.upper and soft + hard > 0.0:
            achieved, wanted = hard / (soft + hard), float(counted.wanted[number])
            wanted = achieved if math.isnan(wanted) else wanted
            found[number] = _Share(achieved, wanted, float(counted.cells[number]))
    return found


def _piece(dealt: DealtField, run: int, grade: int) -> int:
    places = [(piece.run, piece.grade) for piece in dealt.pieces]
    return places.index((run, grade))


def _blended(
    region: Region, number: int, dealt: DealtField, share: _Share, scale: StiffnessScale
) -> Region:
    stretch = dealt.along[number]
    soft, hard = scale.moduli_MPa[stretch.lower], scale.moduli_MPa[stretch.upper]
    modulus = float(dithered_modulus_MPa(soft, hard, share.achieved))
    low, high = hashin_shtrikman_MPa(soft, hard, share.achieved)
    ends = dithered_fraction(soft, hard, np.array(stretch.ends_MPa))
    error = dither_table().error_at(hard / soft)
    blend: dict[str, Any] = {
        "kind": "dither",
        "lower": scale.palette.materials[stretch.lower].id,
        "upper": scale.palette.materials[stretch.upper].id,
        "moduli_MPa": [soft, hard],
        "fraction": [round(float(f), 6) for f in ends],
        "volume_fraction": share.achieved,
        "volume_fraction_wanted": share.wanted,
        "cell_mm": dealt.cell_mm,
        "bounds_MPa": [float(low), float(high)],
        "voigt_MPa": float(voigt_MPa(soft, hard, share.achieved)),
        "reuss_MPa": float(reuss_MPa(soft, hard, share.achieved)),
        "estimate_error": error,
    }
    return replace(
        region,
        modulus_MPa=modulus,
        modulus_interval_MPa=blend_interval_MPa(
            scale, stretch.lower, stretch.upper, modulus, error
        ),
        error=(-error, error),
        blend=blend,
    )
