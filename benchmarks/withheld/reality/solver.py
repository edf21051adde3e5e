"""Force and strains in time: elements in series, specimens side by side, one row after another.

Where stress fades, the law that fades is the one of which the palette's own test, a pull at the
reference rate, made the palette's curve.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.withheld.reality.base_law import STRAINS
from benchmarks.withheld.reality.bench import Bench, FloatArray
from benchmarks.withheld.reality.bisection import equilibrium

__all__ = ["Response", "solve"]

_REFERENCE_CELLS = 400
_GAUSS = np.polynomial.legendre.leggauss(4)
_BUCKLED = 0.05  # share of the stiffness that a thin strip keeps in compression
_BUCKLING_STRAIN = 0.004
_ITERATIONS = 60
_FULL_STEPS = 8
_TOLERANCE_MM = 1e-9
_LARGEST_CORRECTION = 0.1


@dataclass(frozen=True)
class Response:
    """What the specimens do, before the machine's sensors see it.

    Attributes
    ----------
    force_N
        Shape (S, T).
    strain
        Of each element, referred to its true length, shape (S, T, N).
    """

    force_N: FloatArray
    strain: FloatArray


class _Curves:
    """Stress and work of every element on strain, by table."""

    def __init__(self, bench: Bench) -> None:
        strains, secant = STRAINS, bench.law.secant_MPa(bench.coordinate) * bench.secant_factor
        if bench.relaxation is not None:
            strains, secant = _before_it_faded(bench, bench.relaxation, secant)
        stress = secant * strains
        work = np.cumsum(0.5 * np.diff(strains) * (stress[..., 1:] + stress[..., :-1]), axis=-1)
        self._strains = strains
        self._secant = secant.ravel()
        self._work = np.concatenate([np.zeros((*work.shape[:-1], 1)), work], axis=-1).ravel()
        self._first = np.arange(bench.coordinate.size).reshape(bench.coordinate.shape) * len(
            strains
        )

    def _place(self, strain: FloatArray) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
        """Return the entry at or below a strain, the share of its cell, and the cell's width."""
        strain = np.maximum(strain, 0.0)
        share = strain / self._strains[-1]
        if self._strains is not STRAINS:
            share = np.sqrt(share)  # as the cells of `_before_it_faded` grow
        last = len(self._strains) - 2
        cell = np.minimum((share * (last + 1)).astype(np.int64), last)
        width = self._strains[cell + 1] - self._strains[cell]
        return self._first + cell, (strain - self._strains[cell]) / width, width

    def stress_MPa(self, strain: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the stress and its slope by strain."""
        at, part, width = self._place(strain)
        low = self._secant[at]
        rise = self._secant[at + 1] - low
        secant = low + rise * part
        slope = secant + strain * rise / width
        pushed = strain < 0.0
        if not pushed.any():
            return secant * strain, slope
        straight = np.exp(np.minimum(strain, 0.0) / _BUCKLING_STRAIN)
        push = _BUCKLED * strain + (1.0 - _BUCKLED) * _BUCKLING_STRAIN * (straight - 1.0)
        return (
            secant * np.where(pushed, push, strain),
            np.where(pushed, secant * (_BUCKLED + (1.0 - _BUCKLED) * straight), slope),
        )

    def work_MPa(self, strain: FloatArray) -> FloatArray:
        """Return the area under the stress."""
        at, part, _ = self._place(strain)
        low = self._work[at]
        work: FloatArray = low + (self._work[at + 1] - low) * part
        return work


def _before_it_faded(
    bench: Bench, relaxation: Callable[[FloatArray], FloatArray], secant: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return strains and the secant moduli there of which the palette's pull leaves `secant`.

    Step by step along the pull, the stress that has faded so far is known, and the next stress
    is what makes the sum the palette's.
    """
    # Cells that grow from the start, where relaxation is steep
    strains = STRAINS[-1] * np.linspace(0.0, 1.0, _REFERENCE_CELLS + 1) ** 2
    at = np.minimum(np.searchsorted(STRAINS, strains, side="right") - 1, len(STRAINS) - 2)
    part = (strains - STRAINS[at]) / np.diff(STRAINS)[at]
    published = (secant[..., at] * (1.0 - part) + secant[..., at + 1] * part) * strains
    left = _mean_left(relaxation, strains[None] / bench.palette.strain_rate_per_s)[0]
    share = np.broadcast_to(bench.memory_share, published.shape[:-1])
    stress = np.zeros_like(published)
    steps = np.zeros_like(published)
    for i in range(1, len(strains)):
        before = stress[..., i - 1]
        faded = steps[..., :i] @ left[i, :i] - left[i, i] * before
        kept = 1.0 + share * (left[i, i] - 1.0)
        stress[..., i] = (published[..., i] - share * faded) / kept
        steps[..., i] = stress[..., i] - before
    return strains, np.concatenate([secant[..., :1], stress[..., 1:] / strains[1:]], axis=-1)


class _History:
    """Largest strain and work so far in every element, and the stress that they leave."""

    def __init__(self, bench: Bench) -> None:
        self._bench = bench
        self._curves = _Curves(bench)
        self._peak_strain = np.full(bench.coordinate.shape, 1e-9)

    def stress_MPa(self, strain: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the stress and its slope by strain, before any relaxation."""
        bench = self._bench
        below = strain < self._peak_strain
        if not below.any():
            return self._curves.stress_MPa(strain)
        peak = np.maximum(strain, self._peak_strain)
        felt, stretch = strain, np.ones_like(strain)
        if bench.set_strain is not None:
            left = bench.set_strain(peak)
            stretch = np.where(below, peak / (peak - left), 1.0)
            felt = np.where(below, (strain - left) * stretch, strain)
        stress, slope = self._curves.stress_MPa(felt)
        slope = slope * stretch
        if bench.damage is not None:
            work = self._curves.work_MPa(felt)
            factor, factor_slope = bench.damage(work, self._curves.work_MPa(peak))
            slope = np.where(below, factor * slope + factor_slope * stress**2 * stretch, slope)
            stress = np.where(below, factor * stress, stress)
        return stress, slope

    def remember(self, strain: FloatArray) -> None:
        """Move on to the next row."""
        self._peak_strain = np.maximum(self._peak_strain, strain)


@dataclass(frozen=True, eq=False)
class _Row:
    """One row of a solution: force on strains, and travel lost on force."""

    bench: Bench
    history: _History
    scale: FloatArray
    kept: FloatArray
    past: FloatArray
    largest_force: FloatArray

    def bears_N(self, strain: FloatArray) -> FloatArray:
        stress, _ = self.history.stress_MPa(strain)
        return self.scale * (self.kept * stress + self.past)

    def lost_mm(self, force: FloatArray) -> FloatArray:
        lost, _ = _lost_mm(self.bench, force, self.largest_force)
        return lost + np.zeros_like(force)


def solve(bench: Bench) -> Response:
    """Return forces and strains of every row.

    Equal force in every element, and element lengths, slip and machine that add up to the
    crosshead's travel: Newton's method on strains and force together, implicit in time, and
    bisection for the specimens of which it does not find the equilibrium of a row. The memory
    is the hereditary integral of the stress increments, each spread evenly over its row.
    """
    travel = bench.motion.displacement_mm - bench.lost_mm
    (specimens, elements), rows = bench.coordinate.shape, travel.shape[1]
    area = bench.area_mm2[:, None]
    kernel = None if bench.relaxation is None else _mean_left(bench.relaxation, bench.motion.time_s)
    history = _History(bench)
    strain = np.zeros((specimens, elements))
    force, largest_force = np.zeros(specimens), np.zeros(specimens)
    before = np.zeros_like(strain)
    increments = np.zeros((specimens, rows, elements))
    forces, strains = np.zeros((specimens, rows)), np.zeros((specimens, rows, elements))
    time_factor = np.broadcast_to(bench.time_factor, (specimens, rows))
    share = bench.memory_share
    length = bench.element_mm.sum(axis=1)
    for row in range(1, rows):
        kept: FloatArray = np.ones((1, 1))
        past: FloatArray = np.zeros((1, 1))
        if kernel is not None:
            now = kernel[:, row, row, None]
            earlier = (kernel[:, row, None, 1:row] @ increments[:, 1:row])[:, 0]
            kept = 1.0 + share * (now - 1.0)
            past = share * (earlier - now * before)
        scale = area * time_factor[:, row, None]
        strain = _first_guess(strain, travel[:, row], travel[:, row - 1], length)
        for iteration in range(_ITERATIONS):
            stress, slope = history.stress_MPa(strain)
            stiffness = scale * kept * slope
            excess = force[:, None] - scale * (kept * stress + past)
            lost, lost_slope = _lost_mm(bench, force, largest_force)
            give = bench.element_mm / stiffness
            whole = give.sum(axis=1)
            gap = travel[:, row] - lost - (bench.element_mm * strain + give * excess).sum(axis=1)
            correction = gap / (whole + lost_slope)
            step = (excess + correction[:, None]) / stiffness
            damped = 1.0 if iteration < _FULL_STEPS else 0.5
            limited = np.maximum(damped * step, -_LARGEST_CORRECTION)
            strain = strain + np.minimum(limited, _LARGEST_CORRECTION)
            force = force + damped * correction
            # Strains may stand still while the force still moves, as where slip begins
            moved = np.abs(bench.element_mm * step).max(axis=1)
            moved = np.maximum(moved, np.abs(whole * correction))
            if moved.max() < _TOLERANCE_MM:
                break
        else:
            open_ = ~(moved < _TOLERANCE_MM)
            place = _Row(bench, history, scale, kept, past, largest_force)
            halved = equilibrium(place.bears_N, place.lost_mm, travel[:, row], bench.element_mm)
            force = np.where(open_, halved[0], force)
            strain = np.where(open_[:, None], halved[1], strain)
        stress, _ = history.stress_MPa(strain)
        increments[:, row] = stress - before
        before = stress
        history.remember(strain)
        largest_force = np.maximum(largest_force, force)
        forces[:, row], strains[:, row] = force, strain
    return Response(forces, strains)


def _first_guess(
    strain: FloatArray, travel: FloatArray, before: FloatArray, length: FloatArray
) -> FloatArray:
    """Scale the strains with the travel; at the very start, strain every element alike."""
    early = before < 1e-3 * length
    ratio = np.where(early, 1.0, travel / np.where(early, 1.0, before))
    alike = np.where(early, (travel - before) / length, 0.0)
    return strain * ratio[:, None] + alike[:, None]


def _mean_left(relaxation: Callable[[FloatArray], FloatArray], time_s: FloatArray) -> FloatArray:
    """Return what is left in row i of a step spread over row j, mean, shape (S, T, T).

    By Gauss's rule in the cube root of the age, as relaxation may be steep at the start.
    """
    end = np.cbrt(np.maximum(time_s[:, :, None] - time_s[:, None, :], 0.0))
    start_s = np.concatenate([np.zeros_like(time_s[:, :1]), time_s[:, :-1]], axis=1)
    start = np.cbrt(np.maximum(time_s[:, :, None] - start_s[:, None, :], 0.0))
    total, of = np.zeros_like(end), np.full_like(end, 1e-300)
    for place, weight in zip(*_GAUSS, strict=True):
        age = 0.5 * (start + end + place * (start - end))
        total += weight * age**2 * relaxation(age**3)
        of += weight * age**2
    return total / of


def _lost_mm(
    bench: Bench, force: FloatArray, largest: FloatArray
) -> tuple[FloatArray | float, FloatArray | float]:
    lost: FloatArray | float = 0.0
    slope: FloatArray | float = 0.0
    if bench.slip_mm is not None:
        slipped, by_force = bench.slip_mm(np.maximum(force, largest))
        lost, slope = lost + slipped, slope + np.where(force > largest, by_force, 0.0)
    if bench.compliance_mm is not None:
        given, by_force = bench.compliance_mm(force)
        lost, slope = lost + given, slope + by_force
    return lost, slope
