"""One group of specimens as they are mounted: everything that decides their curves.

An effect returns a changed copy. Coupons are one element long; graded bars are cut into elements
that are shortest where the design may jump.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.withheld.reality.base_law import BaseLaw
from benchmarks.withheld.reality.design import Design
from benchmarks.withheld.reality.palette_file import PaletteFile
from benchmarks.withheld.reality.protocol import Motion, crosshead

__all__ = ["Bench", "mount"]

FloatArray = NDArray[np.float64]
WithSlope = tuple[FloatArray, FloatArray]

_ELEMENTS_A_SEGMENT = 4


@dataclass(frozen=True)
class Bench:
    """S specimens of N elements each, T rows a curve (the first at rest).

    Attributes
    ----------
    edges_mm
        Ends of the elements along the drawn gauge, (S, N + 1).
    element_mm
        The lengths that are really there, (S, N).
    coordinate
        Of what was really printed, (S, N).
    secant_factor
        Multiplies the secant moduli, broadcast against (S, N, strains).
    time_factor
        Multiplies the stress, broadcast against (S, T).
    relaxation, memory_share
        Relaxation function of time (s), 1 at the start; the share of the stress that it holds
        for, (S, N). The palette's own test gives the palette's stress.
    damage
        Of (work, largest work) in MPa: the factor on the stress below the largest work, and its
        slope by work.
    set_strain
        Of the largest strain: what stays when the stress is gone.
    lost_mm
        Crosshead travel that never reaches the specimen, (S, T).
    slip_mm, compliance_mm
        Of the largest force so far, and of the force: travel lost, and its slope in mm/N.
    gain, offset_N
        Of the load cell, broadcast against (S, T).
    """

    palette: PaletteFile
    design: Design
    motion: Motion
    law: BaseLaw
    edges_mm: FloatArray
    element_mm: FloatArray
    coordinate: FloatArray
    area_mm2: FloatArray
    secant_factor: FloatArray
    time_factor: FloatArray
    memory_share: FloatArray
    lost_mm: FloatArray
    gain: FloatArray
    offset_N: FloatArray
    relaxation: Callable[[FloatArray], FloatArray] | None = None
    damage: Callable[[FloatArray, FloatArray], WithSlope] | None = None
    set_strain: Callable[[FloatArray], FloatArray] | None = None
    slip_mm: Callable[[FloatArray], WithSlope] | None = None
    compliance_mm: Callable[[FloatArray], WithSlope] | None = None

    @property
    def centre_mm(self) -> FloatArray:
        """Return the middles of the elements along the drawn gauge, (S, N)."""
        return 0.5 * (self.edges_mm[:, 1:] + self.edges_mm[:, :-1])

    def strain_at(self, bar: int, strain: FloatArray, x_mm: FloatArray) -> FloatArray:
        """Return a bar's strain at points, its elements strained by (N,).

        Linear between the middles of elements, but not across the ends of segments, where the
        design may jump.
        """
        edges, own = self.edges_mm[bar], _ELEMENTS_A_SEGMENT
        segment = (np.searchsorted(edges, x_mm, side="right") - 1).clip(0, len(strain) - 1) // own
        middles, strains = (a.reshape(-1, own) for a in (self.centre_mm[bar], strain))
        at = zip(x_mm, segment, strict=True)
        return np.array([float(np.interp(x, middles[k], strains[k])) for x, k in at])

    def stiffened(self, factor: FloatArray) -> "Bench":
        """Return the bench with secant moduli multiplied; (S,), (S, N) or (S, N, strains)."""
        factor = factor.reshape(factor.shape + (1,) * (3 - factor.ndim))
        return replace(self, secant_factor=self.secant_factor * factor)


def mount(palette: PaletteFile, design: Design, law: BaseLaw) -> Bench:
    """Mount specimens as designed, with nothing unmodelled: all coupons, or all bars."""
    bars = bool((design.profile >= 0).any())
    motion = crosshead(design)
    if bars:
        share = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, _ELEMENTS_A_SEGMENT + 1))
        chosen = [design.profiles[p] for p in design.profile]
        edges = np.array(
            [
                np.append(np.add.outer(p.edges_mm[:-1], share[:-1] * p.edges_mm[1]), p.length_mm)
                for p in chosen
            ]
        )
        centre = 0.5 * (edges[:, 1:] + edges[:, :-1])
        coordinate = np.array([p.at(x) for p, x in zip(chosen, centre, strict=True)])
    else:
        edges = design.gauge_mm[:, None] * np.array([0.0, 1.0])
        coordinate = design.coordinate[:, None]
    rows = motion.time_s.shape
    return Bench(
        palette=palette,
        design=design,
        motion=motion,
        law=law,
        edges_mm=edges,
        element_mm=np.diff(edges, axis=1),
        coordinate=coordinate,
        area_mm2=design.width_mm * design.thickness_mm,
        secant_factor=np.ones((len(design), 1, 1)),
        time_factor=np.ones((len(design), 1)),
        memory_share=np.zeros(coordinate.shape),
        lost_mm=np.zeros(rows),
        gain=np.ones((len(design), 1)),
        offset_N=np.zeros((len(design), 1)),
    )
