"""Force and strains of bars that are pulled, slices in series under one force, and of parts."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import zip_longest
from operator import attrgetter
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from planner.errors import PaletteError
from planner.materials.laws import FARTHEST, Law, make_law, secant_modulus_MPa
from planner.materials.mixtures import (
    bracketed,
    interpolated,
    pchip_slopes,
    pchip_weights,
    places_of,
)
from planner.numerics import BoolArray, FloatArray, IntArray, inner_kernel, kernel
from planner.palette import Palette, Reference
from planner.simulation.bar import ProfileDesign
from planner.simulation.part_response import PartResponse, force_factor

__all__ = [
    "PUSHED_END",
    "SOFTENING_PEAKS",
    "SOFTENING_SHARES",
    "LawTables",
    "Prediction",
    "PulledBars",
    "RELAXATION_TIMES_s",
    "Setup",
    "law_tables",
    "predict",
    "unaltered",
]


# ------------------------------------------------------------------------------------------------
# The palette's laws as tables, for solvers that call them a million times.
#
# The logarithm of the secant modulus (nominal stress over strain) of every material stands on a
# uniform grid of strain, as cubics through values and slopes; and so does its slope over the
# place there, of the monotone cubic through all materials. A mixture lies on that cubic, as
# everywhere in planner. For all mixtures of the Connex3 the error of the stress is below 1e-9 of
# it. Nothing is asked of the order of the materials' stiffness, so that palettes whose laws cross
# can be diagnosed too: where steps beside a material differ in sign, its slope is 0.


_STRAIN_END = 3.0
"""The tables' last strain, or farther if laws are; from there on the stress goes on straight.
Chosen: beyond where jetted elastomers break."""

_TABLE_INTERVALS = 1500
"""Up to `_STRAIN_END`; more of the same width beyond. Numerical: cubics over 0.002 of strain, whose
error goes with the fourth power of that."""

PUSHED_END = 0.7
"""A law is followed so far in compression; from there on the stress goes on straight. Chosen: tests
in compression end before."""

_SLIGHTEST = 0.02
"""Least tangent over secant beyond a law's end. Numerical: its stress must go on rising there for
the travel to tell the strain."""


@dataclass(frozen=True, slots=True, eq=False)
class LawTables:
    """ln(secant modulus) of every material of a palette over strain, and its slope over the place.

    Attributes
    ----------
    coordinate, place : (M,)
        Of the materials, rising; see `planner.materials.mixtures.places_of`.
    hardness
        `Palette.hardness`, which tells places between.
    strain_step
        Width of an interval.
    cubics : (2 M, intervals, 2, 4)
        In the share of the interval, 0 to 1, of ln(secant in MPa) and of its slope over the
        place. The first M in tension, then the same materials in compression, over the
        strain's size.
    sound_strain : (M,)
        Where each law ends in tension: it ceases to rise there, or is not followed further.
        Beyond, the stress rises straight on.
    """

    coordinate: FloatArray
    place: FloatArray
    hardness: tuple[tuple[float, float], ...]
    strain_step: float
    cubics: FloatArray
    sound_strain: FloatArray

    def mixed(self, coordinate: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
        """Return the materials below and above, clipped to the palette, and weights, (3, ...).

        A mixture is its lower material, plus these times (upper - lower, slopes of both). At a
        material all are 0.
        """
        c = self.coordinate
        place = places_of(self.hardness, np.clip(coordinate, c[0], c[-1]))
        lower, upper, t, gap = bracketed(self.place, place)
        return lower, upper, np.stack(pchip_weights(t, gap))

    def stress_and_tangent_MPa(
        self, coordinate: ArrayLike, strain: ArrayLike
    ) -> tuple[FloatArray, FloatArray]:
        """Return nominal stress of mixtures, and its derivative by the strain.

        Parameters
        ----------
        coordinate, strain
            Strains of 0 and above; both broadcast.
        """
        e = np.asarray(strain, dtype=np.float64)
        lower, upper, weights = self.mixed(np.asarray(coordinate, dtype=np.float64))
        rise, d0, d1 = weights[..., None]
        intervals = self.cubics.shape[1]
        inside = np.minimum(e, intervals * self.strain_step)
        place = inside / self.strain_step
        interval = np.minimum(place.astype(np.int64), intervals - 1)
        s = place - interval
        softer, harder = self.cubics[lower, interval], self.cubics[upper, interval]
        (y0, slope0), (y1, slope1) = (np.moveaxis(cubics, -2, 0) for cubics in (softer, harder))
        mixed = y0 + rise * (y1 - y0) + d0 * slope0 + d1 * slope1
        c0, c1, c2, c3 = np.moveaxis(mixed, -1, 0)
        secant = np.exp(c0 + s * (c1 + s * (c2 + s * c3)))
        slope = (c1 + s * (2.0 * c2 + s * 3.0 * c3)) / self.strain_step
        tangent = secant * np.maximum(1.0 + inside * slope, _LEAST_TANGENT)
        return np.asarray(secant * inside + tangent * (e - inside)), np.asarray(tangent)


def law_tables(
    palette: Palette, *, strain_end: float | None = None, farthest: float = FARTHEST,
    chosen: bool = False,
) -> LawTables:  # fmt: skip
    """Tabulate a palette's laws, each up to `farthest` times its elongation at break.

    Parameters
    ----------
    strain_end
        The tables' last strain; by default as far as any law is followed, `_STRAIN_END` at least.
    chosen
        Whether the way between grades was chosen already, from more grades than these.

    Raises
    ------
    PaletteError
        A law that does not rise from rest: nothing can be predicted with it.
    """
    if strain_end is None:
        widest = max(material.elongation_at_break for material in palette.materials)
        strain_end = max(_STRAIN_END, farthest * widest)
    intervals = max(_TABLE_INTERVALS, math.ceil(strain_end / _STRAIN_END * _TABLE_INTERVALS))
    nodes = np.linspace(0.0, strain_end, intervals + 1)
    pulled, pushed = [], []
    for material in palette.materials:
        table = other = None
        if material.law.model != "ogden-thesis":
            law, end = make_law(material.law), farthest * material.elongation_at_break
            table = _table_cubics(law, nodes, end)
            other = _table_cubics(law, nodes, PUSHED_END + 1e-9, -1.0)
        if table is None or other is None:
            raise PaletteError(
                f"palette {palette.name}: material {material.id!r}: law: {material.law.model} "
                "is not stress-free at rest or does not rise from there; give a law that does"
            )
        pulled.append(table)
        pushed.append(other)
    coordinate = np.array([m.coordinate for m in palette.materials])
    hardness = palette.hardness if chosen else interpolated(palette).hardness
    place = places_of(hardness, coordinate)
    values, slopes, ends = zip(*pulled, *pushed, strict=True)
    cubics = _cubics_of(place, np.stack(values), np.stack(slopes))
    sound_strain = np.array(ends[: len(pulled)])
    return LawTables(coordinate, place, hardness, float(nodes[1]), cubics, sound_strain)


def _table_cubics(
    law: Law, strain: FloatArray, farthest: float, sign: float = 1.0
) -> tuple[FloatArray, FloatArray, float] | None:
    """Return ln(secant), its slope an interval, and where the law ends; None if at rest.

    Parameters
    ----------
    sign
        -1 in compression, where strains are sizes.
    """
    h = float(strain[1])
    stretched = np.maximum(sign * strain, -PUSHED_END - h)  # nothing is asked of a law beyond
    with np.errstate(all="ignore"):
        secant = secant_modulus_MPa(law, stretched)
        tangent = law.tangent_MPa(1.0 + stretched)
    sound = (secant > 0.0) & (tangent > 0.0) & np.isfinite(secant) & np.isfinite(tangent)
    sound &= strain <= max(farthest, 5.0 * h)
    last = len(strain) - 1 if sound.all() else int(np.argmin(sound)) - 1
    if last < 4:
        return None
    end = float(strain[last])
    rise = max(float(tangent[last]), _SLIGHTEST * float(secant[last]))
    beyond = strain[last:]
    secant[last:] = (secant[last] * end + rise * (beyond - end)) / beyond
    tangent[last:] = rise
    g = np.log(secant)
    slope = np.empty_like(g)
    # d ln(P / strain) = T / P - 1 / strain, 0 / 0 at rest: there from the values beside it.
    slope[1:] = (tangent[1:] / secant[1:] - 1.0) / strain[1:] * h
    slope[0] = (-25.0 * g[0] + 48.0 * g[1] - 36.0 * g[2] + 16.0 * g[3] - 3.0 * g[4]) / 12.0
    return g, slope, end


def _cubics_of(
    place: FloatArray, values: FloatArray, slopes: FloatArray, *, mixed: bool = True
) -> FloatArray:
    """Return `LawTables.cubics` of ln(secant) at N nodes of strain, and of its slope an interval.

    Their slopes over the place are exact at the nodes, and so is their course over strain, but
    where laws cross: there it has a kink.

    Parameters
    ----------
    values, slopes : (n M, N)
    mixed
        Whether slopes over the place are wanted; pure materials do without, in half the time.
    """
    of = [(values, slopes)]
    if mixed:
        # A complex step: the imaginary part is the derivative by the strain, below any rounding.
        nodes = (values + 1e-30j * slopes).reshape(-1, len(place), values.shape[1])
        over = np.concatenate([pchip_slopes(place, way) for way in nodes])
        of.append((over.real, over.imag * 1e30))
    cubics = np.empty((len(values), values.shape[1] - 1, len(of), 4))
    for k, (y, dy) in enumerate(of):
        step, before, after = np.diff(y), dy[:, :-1], dy[:, 1:]
        cubics[:, :, k, 0] = y[:, :-1]
        cubics[:, :, k, 1] = before
        cubics[:, :, k, 2] = 3.0 * step - 2.0 * before - after
        cubics[:, :, k, 3] = before + after - 2.0 * step
    return cubics


# ------------------------------------------------------------------------------------------------
# Instantaneous laws: what relaxes in the palette's own tests until it shows the palette's laws.
#
# A stress S whose shares g_k relax with times tau_k shows, pulled evenly,
#
#     P = (1 - sum g) S + sum g_k h_k,   h_k' = S' - h_k / tau_k
#
# Between nodes of strain the stress changes evenly in time, so that each h_k follows exactly, and
# each node's S from the ones before it.


@kernel
def _fill_instantaneous(
    stress: FloatArray, shares: FloatArray, keeps: FloatArray, adds: FloatArray
) -> None:
    """Turn stresses shown at even times, (N, M), into instantaneous ones, in place.

    Materials stand side by side, so that processors take several at a time.

    Parameters
    ----------
    shares : (K, M)
    keeps, adds : (K,)
        Of what an exponential holds, and of what is new, what is left after a step.
    """
    held = np.zeros(shares.shape)  # by each exponential
    # The stress before, what was new in it, what all exponentials hold, what they add of the new.
    before, new, rest, added = np.zeros((4, stress.shape[1]))
    fixed = np.ones(stress.shape[1])
    for k in range(len(keeps)):
        fixed -= shares[k] * (1.0 - adds[k])
        added += shares[k] * adds[k]
    for i in range(1, len(stress)):
        rest[:] = 0.0
        for k in range(len(keeps)):
            for m in range(len(rest)):
                held[k, m] = keeps[k] * (held[k, m] + adds[k] * shares[k, m] * new[m])
                rest[m] += held[k, m]
        for m in range(len(rest)):
            now = (stress[i, m] - rest[m] + added[m] * before[m]) / fixed[m]
            new[m] = now - before[m]
            before[m] = now
            stress[i, m] = now


def instantaneous(
    laws: LawTables, relaxing: FloatArray, rate_per_s: float, *, mixed: bool = True
) -> LawTables:
    """Return the laws of instantaneous stress, of which shares relax in the laws' own tests.

    Mixtures lie on the monotone cubic through the instantaneous laws.

    Parameters
    ----------
    relaxing : (M, K)
        Shares of each material that relax with `RELAXATION_TIMES_s`.
    rate_per_s
        Strain rate of those tests.
    mixed
        Whether mixtures are asked for; without, the tables hold no slopes over m.
    """
    used = np.flatnonzero(relaxing.any(axis=0))
    spent = laws.strain_step / rate_per_s / RELAXATION_TIMES_s[used]
    strain = laws.strain_step * np.arange(laws.cubics.shape[1] + 1)
    cubics = laws.cubics[:, :, 0]
    last = cubics[:, -1:]
    log_secant = np.concatenate([cubics[..., 0], last.sum(axis=2)], axis=1)
    slopes = np.concatenate([cubics[..., 1], last @ (0.0, 1.0, 2.0, 3.0)], axis=1)
    shown = np.exp(log_secant) * strain
    stress = np.array(shown.T, order="C")  # its own, of one material too
    shares = np.ascontiguousarray(relaxing[:, used].T)
    _fill_instantaneous(stress, shares, np.exp(-spent), -np.expm1(-spent) / spent)
    # Shares of nearly one of a law that falls would ask for less than nothing.
    ratio = np.maximum(stress[1:].T / shown[:, 1:], 1e-3)
    change = np.log(np.concatenate([ratio[:, :1], ratio], axis=1))
    slopes += np.gradient(change, axis=1)
    return replace(laws, cubics=_cubics_of(laws.place, log_secant + change, slopes, mixed=mixed))


# ------------------------------------------------------------------------------------------------
# Every bar as it is mounted: all that decides its curve.


RELAXATION_TIMES_s: FloatArray = np.geomspace(1e-2, 1e5, 15)
"""Times of the exponentials that any relaxation is written with. Numerical: two a decade, as an
exponential is a decade wide: any smooth course is a sum of them."""

SOFTENING_SHARES: FloatArray = np.linspace(0.0, 1.0, 21)
"""Strain over the largest strain so far, at which softening tables stand. Numerical: straight over
twentieths, far below what any form of softening is known to."""

SOFTENING_PEAKS: FloatArray = np.linspace(0.0, 1.0, 21)
"""Largest strains so far, at which softening and set tables stand. Numerical: straight over steps
of 0.05 of strain, and level beyond 1."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PulledBars:
    """P bars that are pulled through T steps, cut into S slices in all.

    A coupon is a bar of one slice. A whole part's slices are the bins of its response, each of
    length and section 1: they go through the strains that the response says, and bear its shares
    of the force. Where no effect acts, attributes are those of `unaltered`.

    Attributes
    ----------
    first_slice : (P + 1,)
        Slices of bar p are ``first_slice[p]`` to ``first_slice[p + 1]``.
    time_s, travel_mm : (P, T)
        Of the crosshead, the first step at rest.
    length_mm, area_mm2 : (S,)
        Of each slice, at rest.
    coordinate : (S,)
        Of what was really printed.
    log_factor, log_tilt : (S,)
        The stress is multiplied by ``exp(log_factor + log_tilt tanh((strain - 0.15) / 0.2))``.
    relaxing : (S, K)
        Shares of the instantaneous stress that relax with `RELAXATION_TIMES_s`.
    clock : (P,)
        How many times as fast as in the laws' own tests everything relaxes.
    reference_relaxing : (M, K), reference_rate_per_s
        Shares of each of the laws' materials in the test that its law was measured in, and that
        test's strain rate: the instantaneous laws are such that, pulled so, they show the laws.
        Without rows, laws are instantaneous as they are.
    softening : (S,), softening_table : (21, 21)
        Below its largest strain so far, a slice's stress is multiplied by
        ``1 - softening * table(strain / largest, largest)``, the table on `SOFTENING_SHARES` and
        `SOFTENING_PEAKS`, its last row 0.
    set_share : (S,), set_table : (21,), set_growth
        Below its largest strain so far, a slice bears no stress up to ``set_share * table(largest)
        * (1 + set_growth ln(1 + reloads))``, the table on `SOFTENING_PEAKS` a strain below the
        peak.
    reloads : (P, T)
        How often each test was loaded again by then: ways up below the farthest travel so far,
        over it. No more than a few per cent beyond, it counts anew.
    fatigue : (S,)
        The stress is multiplied by ``(1 + reloads) ** -fatigue``.
    pushed : (P,)
        Which bars are compressed: travel and what is lost of it count that way, laws are those of
        compression; force and strains come out negative.
    travel_factor : (P,)
        True travel over the recorded one; a gauge length drawn too short acts alike.
    lost_mm : (P, T)
        Travel that never reaches the specimen.
    slip_mm_N, slip_from_N, slip_power : (P,)
        Travel lost for good: ``slip_mm_N max(F_max - slip_from_N, 0) ** slip_power``.
    compliance_mm_N, joint_share, joint_N : (P,)
        Travel lost in the machine:
        ``compliance_mm_N (F + joint_share joint_N ln(1 + F / joint_N))``.
    gain, offset_N : (P, T)
        Of the load cell: it shows ``gain F + offset``.
    parts
        Of each test the response of its part, None of a bar; () where all are bars.
    """

    first_slice: IntArray
    time_s: FloatArray
    travel_mm: FloatArray
    length_mm: FloatArray
    area_mm2: FloatArray
    coordinate: FloatArray
    log_factor: FloatArray
    log_tilt: FloatArray
    relaxing: FloatArray
    softening: FloatArray
    set_share: FloatArray
    reloads: FloatArray
    fatigue: FloatArray
    clock: FloatArray
    pushed: BoolArray
    travel_factor: FloatArray
    lost_mm: FloatArray
    slip_mm_N: FloatArray
    slip_from_N: FloatArray
    slip_power: FloatArray
    compliance_mm_N: FloatArray
    joint_share: FloatArray
    joint_N: FloatArray
    gain: FloatArray
    offset_N: FloatArray
    reference_relaxing: FloatArray = field(
        default_factory=lambda: np.zeros((0, len(RELAXATION_TIMES_s)))
    )
    reference_rate_per_s: float = 1.0
    softening_table: FloatArray = field(default_factory=lambda: np.zeros((21, 21)))
    set_table: FloatArray = field(default_factory=lambda: np.zeros(21))
    set_growth: float = 0.0
    parts: tuple[PartResponse | None, ...] = ()


def unaltered(first_slice: IntArray, steps: int) -> dict[str, Any]:
    """Return what `PulledBars` of elastic slices in a rigid machine have, by attribute."""
    tests, slices = len(first_slice) - 1, int(first_slice[-1])
    none, still, one = np.zeros(slices), np.zeros(tests), np.ones(tests)
    return {
        **dict.fromkeys(("log_factor", "log_tilt", "softening", "set_share", "fatigue"), none),
        "relaxing": np.zeros((slices, len(RELAXATION_TIMES_s))),
        "pushed": np.zeros(tests, dtype=np.bool_),
        **dict.fromkeys(("slip_mm_N", "slip_from_N", "compliance_mm_N", "joint_share"), still),
        **dict.fromkeys(("clock", "travel_factor", "slip_power", "joint_N"), one),
        **dict.fromkeys(("lost_mm", "offset_N", "reloads"), np.zeros((tests, steps))),
        "gain": np.ones((tests, steps)),
    }


_SLOWEST = 1e-3
"""Of a part's mean strain rate, that of any bin. Numerical: so that it has a logarithm; what is
strained so little bears hardly any share."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Setup(PulledBars):
    """Every test of a campaign with its conditions; an effect returns a changed copy.

    Tests that are replicates of one another are one test here.

    Attributes
    ----------
    reference
        The conditions at which the palette's laws were measured.
    palette_coordinate : (M,)
        Of the palette's materials, softest to hardest.
    rate_per_s, temperature_C, soak_h, age_days, width_mm, thickness_mm, gauge_mm : (P,)
        Covariates; where unknown, those of the reference (sizes: the nominal ones).
    orientation : (P,)
        0, 1 or 2 for x, y, z; where unknown, the reference's.
    designs
        Of each test, None for a coupon.
    x_mm : (S,)
        Middle of each slice along the drawn gauge; `length_mm` is what is really there.
    """

    reference: Reference
    palette_coordinate: FloatArray
    rate_per_s: FloatArray
    temperature_C: FloatArray
    soak_h: FloatArray
    age_days: FloatArray
    width_mm: FloatArray
    thickness_mm: FloatArray
    gauge_mm: FloatArray
    orientation: IntArray
    designs: tuple[ProfileDesign | None, ...]
    x_mm: FloatArray

    @property
    def coordinate_range(self) -> tuple[float, float]:
        """Of the palette, softest to hardest."""
        return float(self.palette_coordinate[0]), float(self.palette_coordinate[-1])

    @property
    def rate_ratio(self) -> FloatArray:
        """How fast each slice is strained over its test's `rate_per_s`, (S,); 1 in a bar."""
        ratio = np.ones(len(self.coordinate))
        for number, part in enumerate(self.parts):
            if part is not None:
                end_mm = self.travel_mm[number].max(keepdims=True)
                nominal = end_mm / self.gauge_mm[number]
                bins = slice(self.first_slice[number], self.first_slice[number + 1])
                ratio[bins] = np.maximum(part.at(end_mm)[1][0] / nominal, _SLOWEST)
        return ratio

    def mean_of_tests(self, values: FloatArray) -> FloatArray:
        """Return the mean of each test's slices, (P,), of values a slice, (S,)."""
        return np.add.reduceat(values, self.first_slice[:-1]) / np.diff(self.first_slice)

    def on_slices(self, values: FloatArray) -> FloatArray:
        """Return values of the tests, (P,), on their slices, (S,)."""
        return np.repeat(np.asarray(values, dtype=np.float64), np.diff(self.first_slice))

    def with_(self, **changes: Any) -> "Setup":
        """Return a copy with some attributes changed."""
        return replace(self, **changes)

    def stiffened(self, log_factor: FloatArray) -> "Setup":
        """Return a copy whose slices' stresses are multiplied by exp(log_factor), (S,)."""
        return replace(self, log_factor=self.log_factor + log_factor)


# ------------------------------------------------------------------------------------------------
# The stress of one slice: its law, and what its largest strain so far has done to it.


_BUCKLED = 0.05
"""Stiffness of a pulled strip that is pushed back, over that in tension. Chosen: it gives way
sideways, and what it still bears is hardly seen."""

_BUCKLING_STRAIN = 0.005
"""Over which it gives way. Chosen: less than any strain that is tested, and smooth."""

_TILT_MIDDLE, _TILT_WIDTH = 0.15, 0.2
"""Strain at the middle of a tilt of ln stress, and over which it turns. Chosen: the middle of the
usual pull to 0.3, so that a tilt of either sign leaves the mean stress alone."""

_LEAST_TANGENT = 0.02
"""Of the secant. Numerical: a tangent below it, of a law that falls, would send Newton's method
astray."""


_SLICE = np.dtype(
    [
        *((name, np.int64) for name in ("lower", "upper")),
        *((name, np.float64) for name in (
            "length_mm", "area_mm2", "rise", "slope_0", "slope_1", "log_factor", "log_tilt",
            "softening", "set_share", "fatigue", "strain", "former", "largest", "left", "stress",
            "stress_before", "share", "rest", "alone", "stiffness", "tangent",
        )),
    ]
)  # fmt: skip
"""A slice as it is mounted, and where it stands.

Its law: rows of the cubics and weights (`LawTables.mixed`), and its changes. Of its strain: now, at
the step before, the largest so far, and what of that stays for good. Of the law's stress: now and
at the step before. A step bears `share` of the law's stress, and the `rest` of what relaxes.
`alone`, `stiffness` and `tangent` are Newton's.
"""

_Record: TypeAlias = Any
"""One row of a structured array, or all."""


@inner_kernel
def _mixed(slice_: _Record, cubics: FloatArray, interval: int, power: int) -> float:
    """Return a coefficient of a slice's cubic; each number by itself, as views are counted."""
    low: float = cubics[slice_.lower, interval, 0, power]
    if slice_.rise == 0.0:  # a pure material
        return low
    upper = slice_.upper
    bent: float = slice_.slope_0 * cubics[slice_.lower, interval, 1, power]
    bent += slice_.slope_1 * cubics[upper, interval, 1, power]
    rise: float = slice_.rise * (cubics[upper, interval, 0, power] - low)
    return low + rise + bent


@inner_kernel
def _elastic_stress(
    strain: float, slice_: _Record, cubics: FloatArray, step: float
) -> tuple[float, float]:
    """Return stress and tangent of a slice that was never strained farther."""
    intervals = cubics.shape[1]
    end = intervals * step
    inside = min(max(strain, 0.0), end)
    place = inside / step
    j = min(int(place), intervals - 1)
    s = place - j
    c0, c1 = _mixed(slice_, cubics, j, 0), _mixed(slice_, cubics, j, 1)
    c2, c3 = _mixed(slice_, cubics, j, 2), _mixed(slice_, cubics, j, 3)
    logarithm = c0 + s * (c1 + s * (c2 + s * c3)) + slice_.log_factor
    slope = (c1 + s * (2.0 * c2 + s * 3.0 * c3)) / step
    log_tilt = slice_.log_tilt
    if log_tilt != 0.0:
        bend = math.tanh((inside - _TILT_MIDDLE) / _TILT_WIDTH)
        logarithm += log_tilt * bend
        slope += log_tilt * (1.0 - bend * bend) / _TILT_WIDTH
    secant = math.exp(logarithm)
    if strain < 0.0:
        decay = math.exp(max(strain / _BUCKLING_STRAIN, -700.0))
        stress = _BUCKLED * strain - (1.0 - _BUCKLED) * _BUCKLING_STRAIN * (1.0 - decay)
        return secant * stress, secant * (_BUCKLED + (1.0 - _BUCKLED) * decay)
    tangent = secant * (1.0 + inside * slope)
    tangent = max(tangent, _LEAST_TANGENT * secant)
    if strain > end:
        return secant * end + tangent * (strain - end), tangent
    return secant * inside, tangent


@inner_kernel
def _fallen_share(table: FloatArray, share: float, largest: float) -> tuple[float, float]:
    """Return a softening table between its nodes, and its derivative by the share, 0 to 1."""
    rows, columns = table.shape[0] - 1, table.shape[1] - 1
    place = min(max(share, 0.0), 1.0) * rows
    i = min(int(place), rows - 1)
    across = min(max(largest, 0.0), 1.0) * columns
    j = min(int(across), columns - 1)
    v = across - j
    begin = table[i, j] + v * (table[i, j + 1] - table[i, j])
    rise = table[i + 1, j] + v * (table[i + 1, j + 1] - table[i + 1, j]) - begin
    if share < 0.0 or share > 1.0:
        return begin + (place - i) * rise, 0.0
    return begin + (place - i) * rise, rise * rows


@inner_kernel
def _slice_stress(
    strain: float, slice_: _Record, cubics: FloatArray, step: float, table: FloatArray
) -> tuple[float, float]:
    """Return stress and tangent of a slice that may have been strained farther before."""
    largest, left, softening = slice_.largest, slice_.left, slice_.softening
    if strain >= largest or (left == 0.0 and softening == 0.0):
        return _elastic_stress(strain, slice_, cubics, step)
    spread = largest / (largest - left)
    felt = (strain - left) * spread
    stress, tangent = _elastic_stress(felt, slice_, cubics, step)
    tangent *= spread
    if softening != 0.0:
        fall, slope = _fallen_share(table, felt / largest, largest)
        factor = 1.0 - softening * fall
        least = _LEAST_TANGENT * factor * tangent
        tangent = factor * tangent - softening * slope * spread / largest * stress
        tangent = max(tangent, least)
        stress *= factor
    return stress, tangent


# ------------------------------------------------------------------------------------------------
# One test from rest to its last step: equilibrium of its slices, with all that they remember.
#
# Every step solves for the strains of all slices and the one force that runs through them, by
# Newton's method with the strains eliminated slice by slice. Within a step the stress of the law
# changes evenly, so that relaxing terms follow exactly. A step that can have left no more than the
# tolerance is the last: what it leaves goes with its square. Where Newton's method does not settle,
# the force is bracketed and each slice's strain with it: slow, but certain to end with finite
# numbers.


_TOLERANCE = 1e-10
"""Of the force, and of the length. Numerical: where Newton's method ends, far below any sensor."""

_LOW = -0.6
_ABOVE = 100.0
"""Strains are sought from `_LOW` to so far above the tables' last. Numerical: no equilibrium of a
specimen lies beyond, nor of one whose travel is taken for inches."""

_ITERATIONS = 40
_PATIENCE = 8
_BISECTIONS = 100
_LONGEST = 0.25
"""Newton's steps, those before they are halved, steps of a bracket, and the longest change of a
strain. Numerical: they decide how fast equilibrium is found, and not where it lies."""

_CURVATURE = 20.0
"""Half the curvature of a slice's stress over its tangent, at most, as is taken for granted: what a
step of Newton's method leaves goes by it. Numerical: elastomers' is 2 to 10."""


_LOSSES = (
    "slip_mm_N", "slip_from_N", "slip_power", "compliance_mm_N", "joint_share", "joint_N",
)  # fmt: skip
_TEST = np.dtype(
    [("first", np.int64), ("stop", np.int64), *((name, np.float64) for name in _LOSSES)]
)
"""A test: its slices, and what grips and machine take of its travel; see `PulledBars`."""

_STEP = np.dtype([(name, np.float64) for name in ("time_s", "travel_mm", "worn", "force_N")])
"""A step of a test: its travel is what reaches specimen, grips and machine; `worn` is ln(1 + n) of
n reloads so far."""

_TERM = np.dtype([(name, np.float64) for name in ("time_s", "leaves", "adds")])
"""A relaxing exponential: a step leaves so much of its stress, and adds so much of what is new."""

_RELAXING = np.dtype([(name, np.float64) for name in ("share", "stress")])
"""An exponential of a slice: its share of the stress, and what is left of it."""


@inner_kernel
def _lost_travel(force: float, largest_N: float, test: _Record) -> tuple[float, float]:
    """Return what slip and the machine take of the travel at a force, and its derivative."""
    lost, slope = 0.0, 0.0
    compliance = test.compliance_mm_N
    if compliance != 0.0:
        share, over = test.joint_share, abs(force) / test.joint_N
        lost = compliance * (abs(force) + share * test.joint_N * math.log1p(over))
        slope = compliance * (1.0 + share / (1.0 + over))
        if force < 0.0:
            lost = -lost
    slip, slip_power = test.slip_mm_N, test.slip_power
    if slip != 0.0:
        over = max(force, largest_N) - test.slip_from_N
        if over > 0.0:
            lost += slip * over**slip_power
            if force > largest_N:
                slope += slip * slip_power * max(over, 1e-9) ** (slip_power - 1.0)
    return lost, slope


@inner_kernel
def _strain_under(
    force: float, slice_: _Record, cubics: FloatArray, step: float, table: FloatArray
) -> float:
    """Return the strain at which a slice bears a force, by Newton's method within a bracket."""
    low, high = _LOW, cubics.shape[1] * step + _ABOVE
    strain = 0.0
    for _ in range(_BISECTIONS):
        stress, tangent = _slice_stress(strain, slice_, cubics, step, table)
        excess = slice_.area_mm2 * (slice_.share * stress + slice_.rest) - force
        if excess > 0.0:
            high = strain
        else:
            low = strain
        if excess == 0.0 or high - low < 1e-15:
            break
        slope = slice_.area_mm2 * slice_.share * tangent
        wanted = strain - excess / slope
        if not low < wanted < high:
            wanted = 0.5 * (low + high)
        if abs(wanted - strain) < 1e-14:
            break
        strain = wanted
    return strain


@inner_kernel
def _bracketed_force(
    target: float, largest_N: float, test: _Record, slices: _Record, cubics: FloatArray,
    step: float, table: FloatArray,
) -> float:  # fmt: skip
    """Return the force at which strains and losses add up to the travel; leave the strains."""
    low, high, stride = -math.inf, math.inf, 1.0
    force = 0.0
    for _ in range(_BISECTIONS):
        length = 0.0
        for i in range(len(slices)):
            slices[i].strain = _strain_under(force, slices[i], cubics, step, table)
            length += slices[i].length_mm * slices[i].strain
        lost, _ = _lost_travel(force, largest_N, test)
        if target - lost - length > 0.0:
            low = force
        else:
            high = force
        if low > -math.inf and high < math.inf:
            if high - low <= 1e-13 * (abs(low) + abs(high)):
                break
            force = 0.5 * (low + high)
        else:  # one end is not known yet: go on in ever longer strides
            force += stride if high == math.inf else -stride
            stride *= 4.0
    for i in range(len(slices)):
        slices[i].stress, _ = _slice_stress(slices[i].strain, slices[i], cubics, step, table)
    return force


@inner_kernel
def _left_strain(table: FloatArray, share: float, largest: float) -> float:
    """Return what stays of a largest strain, of a share of the set's table."""
    columns = len(table) - 1
    place = min(max(largest, 0.0), 1.0) * columns
    j = min(int(place), columns - 1)
    value: float = table[j] + (place - j) * (table[j + 1] - table[j])
    return min(share * value, 0.95 * largest)


@kernel
def _follow_path(
    tests: _Record, paths: _Record, all_slices: _Record, terms: _Record, all_relaxing: _Record,
    cubics: FloatArray, step: float, softening_table: FloatArray, set_table: FloatArray,
    set_growth: float, tolerance: float, all_strain: FloatArray, near: FloatArray,
) -> None:  # fmt: skip
    """Fill in force and strain of every step of every test.

    Parameters
    ----------
    tests, paths
        (P,) and (P, T), whose forces are filled in.
    all_slices, terms, all_relaxing
        (S,), (K,) and (S, K).
    all_strain
        Filled in, (T, S).
    near
        Strains of tests much like these, (T, S): where Newton's method starts; none by default.
    """
    high = cubics.shape[1] * step + _ABOVE
    for p in range(len(tests)):
        test, path = tests[p], paths[p]
        slices = all_slices[test.first : test.stop]
        relaxing = all_relaxing[test.first : test.stop]
        strain = all_strain[:, test.first : test.stop]
        total_length, scale = 0.0, math.inf
        for i in range(len(slices)):
            total_length += slices[i].length_mm
            _, tangent = _elastic_stress(0.0, slices[i], cubics, step)
            scale = min(scale, slices[i].area_mm2 * tangent)
        force, former_N, largest_N, settled, before = 0.0, 0.0, 0.0, 0.0, 0.0
        for t in range(len(path)):
            target = path[t].travel_mm
            worn = path[t].worn
            more = worn - path[max(t - 1, 0)].worn
            set_grown = 1.0 + set_growth * worn
            if more != 0.0:
                for i in range(len(slices)):
                    this = slices[i]
                    this.log_factor -= this.fatigue * more
                    if this.left != 0.0:
                        share = this.set_share * set_grown
                        this.left = _left_strain(set_table, share, this.largest)
            duration = path[t].time_s - path[max(t - 1, 0)].time_s
            for k in range(len(terms)):
                spent = duration / terms[k].time_s
                gone = -math.expm1(-spent)
                terms[k].leaves = 1.0 - gone
                terms[k].adds = gone / spent if spent > 1e-12 else 1.0
            for i in range(len(slices)):
                share, rest = 1.0, 0.0
                for k in range(len(terms)):
                    # Of what is new, a step adds `adds` of each relaxing share.
                    own, term = relaxing[i, k], terms[k]
                    share -= own.share * (1.0 - term.adds)
                    rest += own.stress * term.leaves
                    rest -= own.share * term.adds * slices[i].stress_before
                slices[i].share = share
                slices[i].rest = rest
            # Go on as before where the crosshead does: a better start than standing still.
            ahead = (target - settled) / (settled - before) if settled != before else 0.0
            if not 0.0 < ahead < 4.0:
                ahead = 0.0
            force, former_N = force + ahead * (force - former_N), force
            for i in range(len(slices)):
                this = slices[i]
                begun, away = this.strain, this.strain
                if len(near) > 0:  # go on beside what is near, which turns where this does
                    away -= near[max(t - 1, 0), test.first + i]
                    begun = away + near[t, test.first + i]
                this.strain = min(max(begun + ahead * (away - this.former), _LOW), high)
                this.former = away
            solved = False
            for iteration in range(_ITERATIONS):
                length, soft = 0.0, 0.0
                for i in range(len(slices)):
                    this = slices[i]
                    this.stress, this.tangent = _slice_stress(
                        this.strain, this, cubics, step, softening_table
                    )
                    this.stiffness = this.area_mm2 * this.share * this.tangent
                    excess = this.area_mm2 * (this.share * this.stress + this.rest) - force
                    this.alone = this.strain - excess / this.stiffness
                    length += this.length_mm * this.alone
                    soft += this.length_mm / this.stiffness
                lost, slope = _lost_travel(force, largest_N, test)
                change = (target - lost - length) / (soft + slope)
                # Kinks can send Newton's method to and fro; half a step ends that.
                part = 1.0 if iteration < _PATIENCE else 0.5
                force += part * change
                left_N, elongation = 0.0, 0.0
                for i in range(len(slices)):
                    this = slices[i]
                    move = this.alone + change / this.stiffness - this.strain
                    rest = (1.0 - part) * abs(move) + _CURVATURE * move * move
                    left_N = max(left_N, this.stiffness * rest)
                    move = part * min(max(move, -_LONGEST), _LONGEST)
                    this.strain = min(max(this.strain + move, _LOW), high)
                    this.stress += this.tangent * move
                    elongation += this.length_mm * this.strain
                lost, _ = _lost_travel(force, largest_N, test)
                solved = left_N <= tolerance * (abs(force) + 1e-4 * scale) and (
                    abs(target - lost - elongation) <= tolerance * total_length
                )
                if solved:
                    break
            if not solved:
                force = _bracketed_force(
                    target, largest_N, test, slices, cubics, step, softening_table
                )
            for i in range(len(slices)):
                this = slices[i]
                e = this.strain
                new = this.stress - this.stress_before
                for k in range(len(terms)):
                    own, term = relaxing[i, k], terms[k]
                    own.stress = own.stress * term.leaves + own.share * new * term.adds
                this.stress_before = this.stress
                if e > this.largest:
                    this.largest = e
                    if this.set_share != 0.0:
                        this.left = _left_strain(set_table, this.set_share * set_grown, e)
                strain[t, i] = e
            path[t].force_N = force
            largest_N = max(largest_N, force)
            before, settled = settled, target


# ------------------------------------------------------------------------------------------------
# A whole part: each bin of its material is strained as its response says, by itself and with all
# that it remembers. Its stress over the palette's there is what the bin's share of the force goes
# by. What grips and machine take of the travel is taken before.


@kernel
def _take_travel(tests: _Record, force_N: FloatArray, lost: FloatArray, slope: FloatArray) -> None:
    """Fill in what one test's grips and machine take of the travel, and its derivative, (T,)."""
    largest_N = 0.0
    for t in range(len(force_N)):
        lost[t], slope[t] = _lost_travel(force_N[t], largest_N, tests[0])
        largest_N = max(largest_N, force_N[t])


@lru_cache(maxsize=128)
def _usual(
    response: PartResponse, palette: LawTables, displacements_mm: bytes
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return force, strains and shares of a response, and the palette's stresses there.

    Kept, as most effects leave the travel as it is, and hundreds are tried.
    """
    force, strain, share = response.at(np.frombuffer(displacements_mm))
    stress, _ = palette.stress_and_tangent_MPa(response.coordinate, strain)
    return force, strain, share, stress


_AT_REST = 1e-6
"""Of a response's last displacement: below it strains are none. Numerical: so that stresses at rest
have a ratio."""


def _move_part(
    response: PartResponse,
    palette: LawTables,
    test: _Record,
    path: _Record,
    follow: Callable[[_Record, _Record], None],
) -> None:
    """Fill in the forces of a part's test.

    Parameters
    ----------
    palette
        The laws that the response holds for.
    test, path
        (1,) and (T,).
    follow
        Pulls tests, (n,), along paths, (n, T): fills in strains of their slices, and forces.
    """
    bins = np.arange(test["first"][0], test["stop"][0])
    alone = np.zeros(len(bins), dtype=_TEST)
    alone["first"], alone["stop"] = bins, bins + 1
    ways = np.repeat(path[None], len(bins), axis=0)
    lost, slope = np.zeros((2, len(path)))
    end = float(response.displacement_mm[-1])
    least, moved = _AT_REST * end, path["travel_mm"].copy()
    for _ in range(_ITERATIONS):
        at = np.maximum(moved, least)
        usual_N, strain, share, usual_MPa = _usual(response, palette, at.tobytes())
        ways["travel_mm"] = strain.T
        follow(alone, ways)
        factor = force_factor(ways["force_N"].T / usual_MPa, share)
        path["force_N"] = factor * usual_N + usual_N / at * np.minimum(moved - least, 0.0)
        _take_travel(test, path["force_N"].copy(), lost, slope)
        gap = path["travel_mm"] - lost - moved
        if np.abs(gap).max() <= _TOLERANCE * end:
            break
        ahead_N, _, _ = response.at(at + least)
        stiffness = factor * (ahead_N - usual_N) / least
        moved += gap / (1.0 + slope * np.maximum(stiffness, 0.0))


# ------------------------------------------------------------------------------------------------
# What every test of a setup would show: force on the load cell, strain of every slice.


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """Of P tests of T steps and S slices.

    Attributes
    ----------
    force_N : (P, T)
        As the load cell shows it.
    strain : (T, S)
        Engineering strain of every slice, of its `PulledBars.length_mm`.
    bars
        What was predicted.
    borne_N : (P, T)
        What the specimens bear, before the load cell.
    mixtures
        Of the slices; see `LawTables.mixed`.
    curves
        The laws of instantaneous stress.
    """

    force_N: FloatArray
    strain: FloatArray
    bars: PulledBars
    borne_N: FloatArray
    mixtures: tuple[IntArray, IntArray, FloatArray]
    curves: LawTables


_OF_ALL = frozenset(
    {"first_slice", "reference_relaxing", "reference_rate_per_s", "softening_table", "set_table",
     "set_growth"}
)  # fmt: skip
"""What all tests of `PulledBars` share; the rest is theirs, or their slices'."""


def _differs(bars: PulledBars, like: PulledBars) -> BoolArray:
    """Return which specimens are not pulled alike in both, (P,); of as many steps and slices."""
    differs = np.zeros(len(bars.time_s), dtype=np.bool_)
    for name in PulledBars.__slots__:
        own, other = getattr(bars, name), getattr(like, name)
        if own is other or name in ("gain", "offset_N"):  # an effect changes a few
            continue
        if name in _OF_ALL:
            differs |= not np.array_equal(own, other)
        elif name == "parts":
            differs |= np.array([a is not b for a, b in zip_longest(own, other)], dtype=np.bool_)
        else:
            changed = (own != other).reshape(len(own), -1).any(axis=1)
            each = len(changed) == len(differs)
            differs |= changed if each else np.logical_or.reduceat(changed, bars.first_slice[:-1])
    return differs


def predict(
    bars: PulledBars,
    laws: LawTables,
    *,
    tolerance: float = _TOLERANCE,
    like: Prediction | None = None,
) -> Prediction:
    """Follow every test along its path.

    All values are finite for finite setups: where no equilibrium exists (more travel than the
    slices can take to strains of -0.6 to 100 beyond the tables), strains stay at that end.

    Parameters
    ----------
    like
        By the same laws, of as many tests, steps and slices: specimens that are pulled alike in it
        are not followed again, and bear the same to the last digit. The others start from it, and
        end within the tolerance of where they would end without.
    """
    tests = np.empty(len(bars.time_s), dtype=_TEST)
    tests["first"], tests["stop"] = bars.first_slice[:-1], bars.first_slice[1:]
    for name in _LOSSES:
        tests[name] = getattr(bars, name)
    paths = np.empty(bars.time_s.shape, dtype=_STEP)
    paths["time_s"] = bars.time_s * bars.clock[:, None]
    paths["travel_mm"] = bars.travel_mm * bars.travel_factor[:, None] - bars.lost_mm
    paths["worn"] = np.log1p(bars.reloads)
    materials, ways = len(laws.coordinate), 2 if bars.pushed.any() else 1
    slices = np.zeros(len(bars.coordinate), dtype=_SLICE)
    alike = like if like is not None and bars.coordinate is like.bars.coordinate else None
    mixtures = laws.mixed(bars.coordinate) if alike is None else alike.mixtures
    slices["lower"], slices["upper"], weights = mixtures
    slices["rise"], slices["slope_0"], slices["slope_1"] = weights
    of_laws = attrgetter("pushed", "reference_rate_per_s", "reference_relaxing")
    if alike is not None and all(map(np.array_equal, of_laws(bars), of_laws(alike.bars))):
        curves = alike.curves
    else:
        curves = replace(laws, cubics=laws.cubics[: ways * materials])
        if len(bars.reference_relaxing):
            mixed = bool(slices["rise"].any())
            shares = np.tile(bars.reference_relaxing, (ways, 1))
            curves = instantaneous(curves, shares, bars.reference_rate_per_s, mixed=mixed)
    pushed = np.repeat(bars.pushed, np.diff(bars.first_slice))
    for name in ("lower", "upper"):
        slices[name] += materials * pushed
    own = ("length_mm", "area_mm2", "log_factor", "log_tilt", "softening", "set_share", "fatigue")
    for name in own:
        slices[name] = getattr(bars, name)
    used = np.flatnonzero(bars.relaxing.any(axis=0))
    terms = np.empty(len(used), dtype=_TERM)
    terms["time_s"] = RELAXATION_TIMES_s[used]
    relaxing = np.zeros((len(slices), len(used)), dtype=_RELAXING)
    relaxing["share"] = bars.relaxing[:, used]
    strain = np.empty((bars.time_s.shape[1], len(slices)))
    borne = np.empty(bars.time_s.shape)
    some, near = np.ones(len(tests), dtype=np.bool_), strain[:0]
    if like is not None:
        some = _differs(bars, like.bars)
        strain[:], borne[:] = like.strain * np.where(pushed, -1.0, 1.0), like.borne_N
        near = strain.copy()
    # Copies, for kernels are compiled for arrays of one kind.
    softening = np.array(bars.softening_table, dtype=np.float64)
    left = np.array(bars.set_table, dtype=np.float64)

    def follow(tests: _Record, paths: _Record) -> None:
        _follow_path(
            tests, paths, slices.copy(), terms.copy(), relaxing.copy(), curves.cubics,
            curves.strain_step, softening, left, bars.set_growth, tolerance, strain, near,
        )  # fmt: skip

    of_bars = some.copy()
    for number, part in enumerate(bars.parts):
        if part is not None and some[number]:
            of_bars[number] = False
            _move_part(part, laws, tests[number : number + 1], paths[number], follow)
    alone = paths[of_bars]
    follow(tests[of_bars], alone)
    paths[of_bars] = alone
    borne[some] = np.where(bars.pushed[some, None], -1.0, 1.0) * paths["force_N"][some]
    shown, strain = bars.gain * borne + bars.offset_N, np.where(pushed, -strain, strain)
    return Prediction(shown, strain, bars, borne, mixtures, curves)
