"""Force and strains of a bar that is pulled: slices in series under one force."""

import math
from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from planner.errors import PaletteError
from planner.materials.laws import Law, OgdenThesis, make_law, secant_modulus_MPa
from planner.materials.mixtures import CoefficientModel
from planner.numerics import BoolArray, FloatArray, IntArray, free_kernel, inner_kernel
from planner.palette import Palette, Reference
from planner.simulation.bar import Bar, ProfileDesign

__all__ = [
    "FARTHEST",
    "SOFTENING_PEAKS",
    "SOFTENING_SHARES",
    "STRAIN_END",
    "ElasticResponse",
    "Equilibrium",
    "LawTables",
    "Prediction",
    "RELAXATION_TIMES_s",
    "Setup",
    "elastic_response",
    "law_tables",
    "predict",
    "predict_all",
    "solve",
]


# ------------------------------------------------------------------------------------------------
# The constitutive law of every slice at once, from tables of the palette's laws.
#
# Calling a law for each slice and load step costs powers by the million. Instead the logarithm of
# each grade's secant modulus is tabulated over strain and interpolated by cubics through values and
# slopes; a blend is linear between two grades in that logarithm (see `CoefficientModel`), so one
# table a grade serves every mixture. For all mixtures of the Connex3 the error of the stress is
# below 1e-9 of it.


FARTHEST = 2.0
"""A law is followed to this many times the elongation at break: to break it is measured, from
there to here a specimen stronger than the mean may still hold, beyond it nothing is known."""

_RESPONSE_INTERVALS = 2048


class Response(Protocol):
    """What equilibrium asks of the slices' materials.

    Attributes
    ----------
    strain_limit : (n,)
        Strain up to which each slice's stress is known, and rises.
    """

    @property
    def strain_limit(self) -> FloatArray:
        """See the attributes."""
        ...

    def stress_and_tangent_MPa(self, strain: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return nominal stress and its derivative by the strain of each slice, (n,) each."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class ElasticResponse:
    """The stress-free elastic law of each of n slices.

    Attributes
    ----------
    break_strain : (n,)
        Elongation at break, linear in the coordinate between grades.
    strain_limit : (n,)
        `FARTHEST` times `break_strain`, or less where a law's stress ceases to rise.
    """

    break_strain: FloatArray
    strain_limit: FloatArray
    _step: float
    _softer: IntArray
    _harder: IntArray
    _fraction: FloatArray
    _cubics: FloatArray

    def stress_and_tangent_MPa(self, strain: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return nominal stress and tangent, (n,) each, at strains from 0 to `strain_limit`."""
        place = strain / self._step
        interval = np.minimum(place.astype(np.int64), _RESPONSE_INTERVALS - 1)
        s = place - interval
        c = np.take(self._cubics, self._softer + interval, axis=0)
        harder = np.take(self._cubics, self._harder + interval, axis=0)
        c += self._fraction * (harder - c)
        c0, c1, c2, c3 = c.T
        secant = np.exp(c0 + s * (c1 + s * (c2 + s * c3)))
        slope = (c1 + s * (2.0 * c2 + s * 3.0 * c3)) / self._step
        return secant * strain, secant * (1.0 + strain * slope)


def elastic_response(model: CoefficientModel, coordinate: FloatArray) -> ElasticResponse:
    """Tabulate the laws of a palette for slices of these mixtures.

    Raises
    ------
    ArgumentError
        A coordinate is outside the palette.
    """
    lower, upper, t = model.bracket(coordinate)
    upper = np.where(t > 0.0, upper, lower)
    breaks = np.array([m.elongation_at_break for m in model.palette.materials])
    break_strain = (1.0 - t) * breaks[lower] + t * breaks[upper]
    grades = np.unique(np.concatenate([lower, upper]))
    nodes = np.linspace(0.0, FARTHEST * float(breaks[grades].max()), _RESPONSE_INTERVALS + 1)
    tables = [_response_cubics(model.laws[k], nodes) for k in grades.tolist()]
    rising = np.array([limit for _, limit in tables])
    softer, harder = np.searchsorted(grades, lower), np.searchsorted(grades, upper)
    limit = np.minimum(FARTHEST * break_strain, np.minimum(rising[softer], rising[harder]))
    return ElasticResponse(
        break_strain=break_strain,
        strain_limit=limit,
        _step=float(nodes[1]),
        _softer=softer * _RESPONSE_INTERVALS,
        _harder=harder * _RESPONSE_INTERVALS,
        _fraction=t[:, None],
        _cubics=np.concatenate([cubics for cubics, _ in tables]),
    )


def _response_cubics(law: Law, strain: FloatArray) -> tuple[FloatArray, float]:
    """Return ln(secant) as a cubic an interval, (intervals, 4), and the strain to which it holds.

    That is the last node before the stress is not finite, or ceases to rise. At rest it does, or
    the palette would have no ladder of stiffness.
    """
    h = float(strain[1])
    with np.errstate(all="ignore"):
        secant = secant_modulus_MPa(law, strain)
        tangent = law.tangent_MPa(1.0 + strain)
        sound = (secant > 0.0) & (tangent > 0.0) & np.isfinite(secant) & np.isfinite(tangent)
    last = len(strain) - 1 if sound.all() else int(np.argmin(sound)) - 1
    g = np.log(np.where(sound, secant, 1.0))
    slope = np.empty_like(g)
    # d ln(P / strain) = T / P - 1 / strain, 0 / 0 at rest: there from the values beside it.
    slope[1:] = (np.where(sound, tangent / np.where(sound, secant, 1.0), 1.0)[1:] - 1.0) / strain[
        1:
    ]
    slope[0] = (-25.0 * g[0] + 48.0 * g[1] - 36.0 * g[2] + 16.0 * g[3] - 3.0 * g[4]) / (12.0 * h)
    slope *= h
    rise = np.diff(g)
    cubics = np.stack(
        [
            g[:-1],
            slope[:-1],
            3.0 * rise - 2.0 * slope[:-1] - slope[1:],
            slope[:-1] + slope[1:] - 2.0 * rise,
        ],
        axis=1,
    )
    cubics[last:] = (g[last], slope[last], 0.0, 0.0)  # met at its first node only
    return cubics, float(strain[last])


# ------------------------------------------------------------------------------------------------
# Force equilibrium of a bar in series, step by step under displacement control.
#
# At every step one force F runs through all slices, area P(strain) = F, and their elongations add
# up to the displacement of the ends. Newton's method on all strains and the force together costs
# one evaluation of the law an iteration: the strains are eliminated slice by slice, and the force
# alone remains.


_BAR_TOLERANCE = 1e-11
_BAR_ITERATIONS = 16
_FINEST = 2.0**-14  # of a step: halved so often, a step is given up


@dataclass(frozen=True, slots=True, eq=False)
class Equilibrium:
    """The states that were reached.

    Attributes
    ----------
    force_N : (steps,)
    strain, stress_MPa, tangent_MPa : (steps, n)
        Of each slice; steps may be fewer than were asked for.
    end_mm : float
        Displacement of the last state, or where on the way to the next step the path ended.
    stopped_at : int or None
        The slice whose law ends there, if one does.
    """

    force_N: FloatArray
    strain: FloatArray
    stress_MPa: FloatArray
    tangent_MPa: FloatArray
    end_mm: float
    stopped_at: int | None


@dataclass(slots=True)
class _State:
    displacement_mm: float
    force_N: float
    strain: FloatArray
    stress_MPa: FloatArray
    tangent_MPa: FloatArray


def solve(bar: Bar, response: Response, displacement_mm: FloatArray) -> Equilibrium:
    """Pull a bar through displacements of its ends, none below 0.

    A step on which Newton's method fails is halved until it succeeds. It cannot where a slice
    would leave `Response.strain_limit`: then the states up to the step before are returned.
    """
    strain = np.zeros_like(bar.area_mm2)
    state = _State(0.0, 0.0, strain, *response.stress_and_tangent_MPa(strain))
    states: list[_State] = []
    stopped_at = None
    for target in displacement_mm.tolist():
        reached = _advance(bar, response, state, target)
        state = reached[0]
        if not reached[1]:
            stopped_at = int(np.argmax(state.strain / response.strain_limit))
            break
        states.append(state)
    empty = np.empty((0, len(strain)))
    return Equilibrium(
        np.array([s.force_N for s in states]),
        np.array([s.strain for s in states]) if states else empty,
        np.array([s.stress_MPa for s in states]) if states else empty,
        np.array([s.tangent_MPa for s in states]) if states else empty,
        state.displacement_mm,
        stopped_at,
    )


def _advance(bar: Bar, response: Response, state: _State, target: float) -> tuple[_State, bool]:
    """Go to a displacement in as few parts as it takes; also say whether it was reached."""
    begin, part, done = state.displacement_mm, 1.0, 0.0
    while done < 1.0:
        share = min(done + part, 1.0)
        trial = _newton(bar, response, state, begin + share * (target - begin))
        if trial is not None:
            state, done, part = trial, share, 2.0 * part
        elif part > _FINEST:
            part *= 0.5
        else:
            return state, False
    return state, True


def _newton(bar: Bar, response: Response, state: _State, target: float) -> _State | None:
    """Solve one step from a state near by; None where the iteration does not settle."""
    length, area = bar.length_mm, bar.area_mm2
    if target == 0.0:
        strain = np.zeros_like(area)
        return _State(0.0, 0.0, strain, *response.stress_and_tangent_MPa(strain))
    force, strain, stress, tangent = (
        state.force_N,
        state.strain,
        state.stress_MPa,
        state.tangent_MPa,
    )
    for _ in range(_BAR_ITERATIONS):
        stiffness = area * tangent
        alone = strain + (force - area * stress) / stiffness
        change = (target - float(length @ alone)) / float(np.sum(length / stiffness))
        force += change
        wanted = alone + change / stiffness
        strain = np.clip(wanted, 0.0, response.strain_limit)
        stress, tangent = response.stress_and_tangent_MPa(strain)
        residual = float(np.abs(area * stress - force).max())
        if residual <= _BAR_TOLERANCE * abs(force) and (strain == wanted).all():
            return _State(target, force, strain, stress, tangent)
    return None


# ------------------------------------------------------------------------------------------------
# The palette's laws as tables, for solvers that call them a million times.
#
# The logarithm of the secant modulus (nominal stress over strain) of every material stands on a
# uniform grid of strain, as cubics through values and slopes; a mixture is linear between its two
# neighbours in that logarithm, as everywhere in planner. Nothing is asked of the order of the
# materials' stiffness, so that palettes whose laws cross can be diagnosed too.


STRAIN_END = 3.0
"""The tables' last strain; from there on the stress goes on straight."""

_TABLE_INTERVALS = 1500
_SLIGHTEST = 0.02
"""Least tangent over secant beyond a law's end, so that its stress goes on rising there."""


@dataclass(frozen=True, slots=True, eq=False)
class LawTables:
    """ln(secant modulus) of every material of a palette over strain.

    Attributes
    ----------
    coordinate : (M,)
        Of the materials, rising.
    strain_step
        Width of an interval.
    cubics : (M, intervals, 4)
        In the place within the interval, 0 to 1; the secant in MPa.
    sound_strain : (M,)
        Where each law ends: it ceases to rise there, or it is `FARTHEST` times the elongation at
        break. Beyond, the stress rises straight on.
    """

    coordinate: FloatArray
    strain_step: float
    cubics: FloatArray
    sound_strain: FloatArray

    def bracket(self, coordinate: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
        """Return the materials below and above, and how far between; clipped to the palette."""
        c = self.coordinate
        m = np.clip(coordinate, c[0], c[-1])
        lower = np.clip(np.searchsorted(c, m, side="right") - 1, 0, max(len(c) - 2, 0))
        upper = np.minimum(lower + 1, len(c) - 1)
        gap = np.where(upper > lower, c[upper] - c[lower], 1.0)
        return lower, upper, (m - c[lower]) / gap

    def stress_MPa(self, coordinate: ArrayLike, strain: ArrayLike) -> FloatArray:
        """Return the nominal stress of mixtures at strains of 0 and above; both broadcast."""
        m, e = np.broadcast_arrays(
            np.asarray(coordinate, dtype=np.float64), np.asarray(strain, dtype=np.float64)
        )
        inside = np.minimum(e, STRAIN_END)
        lower, upper, t = self.bracket(m)
        place = inside / self.strain_step
        interval = np.minimum(place.astype(np.int64), self.cubics.shape[1] - 1)
        s = place - interval
        softer, harder = self.cubics[lower, interval], self.cubics[upper, interval]
        c0, c1, c2, c3 = np.moveaxis(softer + t[..., None] * (harder - softer), -1, 0)
        secant = np.exp(c0 + s * (c1 + s * (c2 + s * c3)))
        slope = (c1 + s * (2.0 * c2 + s * 3.0 * c3)) / self.strain_step
        tangent = secant * (1.0 + inside * slope)
        return np.asarray(secant * inside + tangent * (e - inside))


def law_tables(palette: Palette) -> LawTables:
    """Tabulate a palette's laws.

    Raises
    ------
    PaletteError
        A law that does not rise from rest: nothing can be predicted with it.
    """
    nodes = np.linspace(0.0, STRAIN_END, _TABLE_INTERVALS + 1)
    tables = []
    for material in palette.materials:
        law = make_law(material.law)
        farthest = FARTHEST * material.elongation_at_break
        table = None if isinstance(law, OgdenThesis) else _table_cubics(law, nodes, farthest)
        if table is None:
            raise PaletteError(
                f"palette {palette.name}: material {material.id!r}: law: {material.law.model} "
                "is not stress-free at rest or does not rise from there; give a law that does"
            )
        tables.append(table)
    return LawTables(
        coordinate=np.array([m.coordinate for m in palette.materials]),
        strain_step=float(nodes[1]),
        cubics=np.stack([cubics for cubics, _ in tables]),
        sound_strain=np.array([end for _, end in tables]),
    )


def _table_cubics(law: Law, strain: FloatArray, farthest: float) -> tuple[FloatArray, float] | None:
    """Return ln(secant) as a cubic an interval, and where the law ends; None if at rest."""
    h = float(strain[1])
    with np.errstate(all="ignore"):
        secant = secant_modulus_MPa(law, strain)
        tangent = law.tangent_MPa(1.0 + strain)
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
    step = np.diff(g)
    cubics = np.stack(
        [
            g[:-1],
            slope[:-1],
            3.0 * step - 2.0 * slope[:-1] - slope[1:],
            slope[:-1] + slope[1:] - 2.0 * step,
        ],
        axis=1,
    )
    return cubics, end


# ------------------------------------------------------------------------------------------------
# Every test of a campaign as it is mounted: all that decides its curve.


RELAXATION_TIMES_s: FloatArray = np.geomspace(1e-2, 1e5, 15)
"""Times of the exponentials that any relaxation is written with, two a decade."""

SOFTENING_SHARES: FloatArray = np.linspace(0.0, 1.0, 21)
"""Strain over the largest strain so far, at which softening tables stand."""

SOFTENING_PEAKS: FloatArray = np.linspace(0.0, 1.0, 21)
"""Largest strains so far, at which softening and set tables stand."""


@dataclass(frozen=True, slots=True, eq=False)
class Setup:
    """P tests of T steps, cut into S slices in all; an effect returns a changed copy.

    Tests that are replicates of one another are one test here. Stages follow each other as the
    attributes do: what was printed, its law, its geometry, its grips and machine, its sensors.

    Attributes
    ----------
    reference
        The conditions at which the palette's laws were measured.
    coordinate_range
        Of the palette, softest to hardest.
    first_slice : (P + 1,)
        Slices of test p are ``first_slice[p]`` to ``first_slice[p + 1]``; a coupon has one.
    time_s, travel_mm : (P, T)
        Of the crosshead, the first step at rest.
    rate_per_s, temperature_C, soak_h, age_days, width_mm, thickness_mm, gauge_mm : (P,)
        Covariates; where unknown, those of the reference (sizes: the nominal ones).
    orientation : (P,)
        0, 1 or 2 for x, y, z.
    known : name to (P,)
        Where each covariate is known.
    designs
        Of each test, None for a coupon.
    x_mm, length_mm : (S,)
        Middle of each slice along the drawn gauge, and the length that is really there.
    coordinate : (S,)
        Of what was really printed.
    log_factor, log_tilt : (S,)
        The stress is multiplied by ``exp(log_factor + log_tilt tanh((strain - 0.15) / 0.2))``.
    relaxing : (S, K)
        Shares of the instantaneous stress that relax with `RELAXATION_TIMES_s`.
    softening : (S,), softening_table : (21, 21)
        Below its largest strain so far, a slice's stress is multiplied by
        ``1 - softening * table(strain / largest, largest)``, the table on `SOFTENING_SHARES` and
        `SOFTENING_PEAKS`, its last row 0.
    set_share : (S,), set_table : (21,)
        Below its largest strain so far, a slice bears no stress up to
        ``set_share * table(largest)``, the table on `SOFTENING_PEAKS` a strain below the peak.
    area_mm2 : (S,)
        At rest.
    travel_factor : (P,)
        True travel over the recorded one; a gauge length drawn too short acts alike.
    lost_mm : (P, T)
        Travel that never reaches the specimen.
    slip_mm_N, slip_from_N, slip_power : (P,)
        Travel lost for good: ``slip_mm_N max(F_max - slip_from_N, 0) ** slip_power``.
    compliance_mm_N, compliance_power : (P,)
        Travel lost in the machine: ``compliance_mm_N ((1 + F)**p - 1) / p`` with F in N.
    gain, offset_N : (P, T)
        Of the load cell: it shows ``gain F + offset``.
    """

    reference: Reference
    coordinate_range: tuple[float, float]
    first_slice: IntArray
    time_s: FloatArray
    travel_mm: FloatArray
    rate_per_s: FloatArray
    temperature_C: FloatArray
    soak_h: FloatArray
    age_days: FloatArray
    width_mm: FloatArray
    thickness_mm: FloatArray
    gauge_mm: FloatArray
    orientation: IntArray
    known: Mapping[str, BoolArray]
    designs: tuple[ProfileDesign | None, ...]
    x_mm: FloatArray
    coordinate: FloatArray
    log_factor: FloatArray
    log_tilt: FloatArray
    relaxing: FloatArray
    softening: FloatArray
    set_share: FloatArray
    length_mm: FloatArray
    area_mm2: FloatArray
    travel_factor: FloatArray
    lost_mm: FloatArray
    slip_mm_N: FloatArray
    slip_from_N: FloatArray
    slip_power: FloatArray
    compliance_mm_N: FloatArray
    compliance_power: FloatArray
    gain: FloatArray
    offset_N: FloatArray
    softening_table: FloatArray = field(default_factory=lambda: np.zeros((21, 21)))
    set_table: FloatArray = field(default_factory=lambda: np.zeros(21))

    @property
    def test_of_slice(self) -> IntArray:
        """The test that each slice belongs to, (S,)."""
        return np.repeat(np.arange(len(self.first_slice) - 1), np.diff(self.first_slice))

    @property
    def is_bar(self) -> BoolArray:
        """Which tests are graded bars, (P,)."""
        return np.array([design is not None for design in self.designs])

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
"""Stiffness in compression over that in tension: a strip gives way sideways."""

_BUCKLING_STRAIN = 0.005
_TILT_MIDDLE, _TILT_WIDTH = 0.15, 0.2
_LEAST_TANGENT = 0.02
"""Of the secant: a tangent below it, of a law that falls, would send Newton's method astray."""


@inner_kernel
def _elastic_stress(
    strain: float, lower: int, upper: int, fraction: float, log_factor: float,
    log_tilt: float, cubics: FloatArray, step: float,
) -> tuple[float, float]:  # fmt: skip
    """Return stress and tangent of a mixture that was never strained farther."""
    intervals = cubics.shape[1]
    end = intervals * step
    inside = min(max(strain, 0.0), end)
    place = inside / step
    i = min(int(place), intervals - 1)
    s = place - i
    c0 = cubics[lower, i, 0] + fraction * (cubics[upper, i, 0] - cubics[lower, i, 0])
    c1 = cubics[lower, i, 1] + fraction * (cubics[upper, i, 1] - cubics[lower, i, 1])
    c2 = cubics[lower, i, 2] + fraction * (cubics[upper, i, 2] - cubics[lower, i, 2])
    c3 = cubics[lower, i, 3] + fraction * (cubics[upper, i, 3] - cubics[lower, i, 3])
    logarithm = c0 + s * (c1 + s * (c2 + s * c3)) + log_factor
    slope = (c1 + s * (2.0 * c2 + s * 3.0 * c3)) / step
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
    strain: float, largest: float, left: float, softening: float, table: FloatArray,
    lower: int, upper: int, fraction: float, log_factor: float, log_tilt: float,
    cubics: FloatArray, step: float,
) -> tuple[float, float]:  # fmt: skip
    """Return stress and tangent below `largest`, of which a strain of `left` stays for good."""
    if strain >= largest or (left == 0.0 and softening == 0.0):
        return _elastic_stress(strain, lower, upper, fraction, log_factor, log_tilt, cubics, step)
    spread = largest / (largest - left)
    felt = (strain - left) * spread
    stress, tangent = _elastic_stress(
        felt, lower, upper, fraction, log_factor, log_tilt, cubics, step
    )
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
# changes evenly, so that relaxing terms follow exactly. Where Newton's method does not settle, the
# force is bracketed and each slice's strain with it: slow, but certain to end with finite numbers.


_WORK_ROWS = 10
"""Rows of the work array, each one value a slice."""

_STRAIN, _FORMER, _LARGEST, _LEFT, _STRESS, _STRESS_BEFORE, _SHARE, _REST, _ALONE, _STIFF = range(
    10
)
_LOW, _HIGH = -0.6, 4.0
_PATH_ITERATIONS = 40
_PATIENCE = 8
_BISECTIONS = 100
_PATH_TOLERANCE = 1e-10
_LONGEST = 0.25


@inner_kernel
def _lost_travel(
    force: float, largest_N: float, slip: float, slip_from: float, slip_power: float,
    compliance: float, power: float,
) -> tuple[float, float]:  # fmt: skip
    """Return what slip and the machine take of the travel at a force, and its derivative."""
    lost, slope = 0.0, 0.0
    if compliance != 0.0:
        size = abs(force)
        if power == 1.0:
            lost, slope = compliance * size, compliance
        elif abs(power) < 1e-9:
            lost, slope = compliance * math.log1p(size), compliance / (1.0 + size)
        else:
            lost = compliance * math.expm1(power * math.log1p(size)) / power
            slope = compliance * (1.0 + size) ** (power - 1.0)
        if force < 0.0:
            lost = -lost
    if slip != 0.0:
        over = max(force, largest_N) - slip_from
        if over > 0.0:
            lost += slip * over**slip_power
            if force > largest_N:
                slope += slip * slip_power * max(over, 1e-9) ** (slip_power - 1.0)
    return lost, slope


@inner_kernel
def _strain_at(
    force: float, area: float, share: float, rest: float, largest: float, left: float,
    softening: float, table: FloatArray, lower: int, upper: int, fraction: float,
    log_factor: float, log_tilt: float, cubics: FloatArray, step: float,
) -> float:  # fmt: skip
    """Return the strain at which a slice bears a force, by Newton's method within a bracket."""
    low, high = _LOW, _HIGH
    strain = 0.0
    for _ in range(_BISECTIONS):
        stress, tangent = _slice_stress(
            strain, largest, left, softening, table, lower, upper, fraction, log_factor,
            log_tilt, cubics, step,
        )  # fmt: skip
        excess = area * (share * stress + rest) - force
        if excess > 0.0:
            high = strain
        else:
            low = strain
        if excess == 0.0 or high - low < 1e-15:
            break
        slope = area * share * tangent
        wanted = strain - excess / slope
        if not low < wanted < high:
            wanted = 0.5 * (low + high)
        if abs(wanted - strain) < 1e-14:
            break
        strain = wanted
    return strain


@inner_kernel
def _bracketed_force(
    target: float, first: int, stop: int, largest_N: float, slip: float, slip_from: float,
    slip_power: float, compliance: float, power: float, lower: IntArray, upper: IntArray,
    slices: FloatArray, table: FloatArray, cubics: FloatArray, step: float, work: FloatArray,
) -> float:  # fmt: skip
    """Return the force at which strains and losses add up to the travel; leave the strains."""
    low, high, stride = -math.inf, math.inf, 1.0
    force = 0.0
    for _ in range(_BISECTIONS):
        length = 0.0
        for i in range(first, stop):
            work[_STRAIN, i] = _strain_at(
                force, slices[1, i], work[_SHARE, i], work[_REST, i], work[_LARGEST, i],
                work[_LEFT, i], slices[5, i], table, lower[i], upper[i], slices[2, i],
                slices[3, i], slices[4, i], cubics, step,
            )  # fmt: skip
            length += slices[0, i] * work[_STRAIN, i]
        lost, _ = _lost_travel(force, largest_N, slip, slip_from, slip_power, compliance, power)
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
    for i in range(first, stop):
        work[_STRESS, i], _ = _slice_stress(
            work[_STRAIN, i], work[_LARGEST, i], work[_LEFT, i], slices[5, i], table, lower[i],
            upper[i], slices[2, i], slices[3, i], slices[4, i], cubics, step,
        )  # fmt: skip
    return force


@inner_kernel
def _set_strain(table: FloatArray, largest: float) -> float:
    """Return the set's table at a largest strain."""
    columns = len(table) - 1
    place = min(max(largest, 0.0), 1.0) * columns
    j = min(int(place), columns - 1)
    value: float = table[j] + (place - j) * (table[j + 1] - table[j])
    return value


@free_kernel
def _follow_path(
    first_slice: IntArray, time_s: FloatArray, travel_mm: FloatArray, boundary: FloatArray,
    lower: IntArray, upper: IntArray, slices: FloatArray, relaxing: FloatArray,
    times: FloatArray, softening_table: FloatArray, set_table: FloatArray, cubics: FloatArray,
    step: float, work: FloatArray, memory: FloatArray, decay: FloatArray, force_N: FloatArray,
    strain: FloatArray,
) -> None:  # fmt: skip
    """Fill in force and strains of every step of every test.

    Parameters
    ----------
    travel_mm : (P, T)
        What reaches specimen, grips and machine.
    boundary : (5, P)
        Of slip its size, threshold and power, of the compliance its size and power.
    slices : (7, S)
        Length, area, fraction towards the harder material, log factor, log tilt, softening,
        share of the set.
    memory : (S, K)
        Work space of the relaxing terms, and `work`, (`_WORK_ROWS`, S), of the slices.
    decay : (2, K)
        Work space: what a step leaves of a term, and adds to it a unit of stress.
    """
    tests, steps = travel_mm.shape
    terms = len(times)
    for p in range(tests):
        first, stop = first_slice[p], first_slice[p + 1]
        slip, slip_from, slip_power = boundary[0, p], boundary[1, p], boundary[2, p]
        compliance, power = boundary[3, p], boundary[4, p]
        relaxes = False
        total_length, scale = 0.0, math.inf
        for i in range(first, stop):
            for row in range(_WORK_ROWS):
                work[row, i] = 0.0
            work[_SHARE, i] = 1.0
            for k in range(terms):
                memory[i, k] = 0.0
                relaxes = relaxes or relaxing[i, k] != 0.0
            total_length += slices[0, i]
            _, tangent = _slice_stress(
                0.0, 0.0, 0.0, 0.0, softening_table, lower[i], upper[i], slices[2, i],
                slices[3, i], slices[4, i], cubics, step,
            )  # fmt: skip
            scale = min(scale, slices[1, i] * tangent)
        force, largest_N, settled, before = 0.0, 0.0, 0.0, 0.0
        for t in range(steps):
            target = travel_mm[p, t]
            if relaxes:
                duration = time_s[p, t] - time_s[p, max(t - 1, 0)]
                for k in range(terms):
                    spent = duration / times[k]
                    gone = -math.expm1(-spent)
                    decay[0, k] = 1.0 - gone
                    decay[1, k] = gone / spent if spent > 1e-12 else 1.0
                for i in range(first, stop):
                    share, rest = 1.0, 0.0
                    for k in range(terms):
                        # Of what is new, a step leaves decay[1] of each relaxing share.
                        share -= relaxing[i, k] * (1.0 - decay[1, k])
                        rest += memory[i, k] * decay[0, k]
                        rest -= relaxing[i, k] * decay[1, k] * work[_STRESS_BEFORE, i]
                    work[_SHARE, i] = share
                    work[_REST, i] = rest
            # Go on as before where the crosshead does: a better start than standing still.
            ahead = 0.0
            if settled != before:
                ahead = (target - settled) / (settled - before)
            if not 0.0 < ahead < 4.0:
                ahead = 0.0
            for i in range(first, stop):
                now = work[_STRAIN, i]
                work[_STRAIN, i] = now + ahead * (now - work[_FORMER, i])
                work[_FORMER, i] = now
            solved = False
            for iteration in range(_PATH_ITERATIONS):
                worst, length, soft, elongation = 0.0, 0.0, 0.0, 0.0
                for i in range(first, stop):
                    e = work[_STRAIN, i]
                    stress, tangent = _slice_stress(
                        e, work[_LARGEST, i], work[_LEFT, i], slices[5, i], softening_table,
                        lower[i], upper[i], slices[2, i], slices[3, i], slices[4, i], cubics,
                        step,
                    )  # fmt: skip
                    work[_STRESS, i] = stress
                    stiff = slices[1, i] * work[_SHARE, i] * tangent
                    excess = slices[1, i] * (work[_SHARE, i] * stress + work[_REST, i]) - force
                    worst = max(worst, abs(excess))
                    work[_STIFF, i] = stiff
                    alone = e - excess / stiff
                    work[_ALONE, i] = alone
                    elongation += slices[0, i] * e
                    length += slices[0, i] * alone
                    soft += slices[0, i] / stiff
                lost, slope = _lost_travel(
                    force, largest_N, slip, slip_from, slip_power, compliance, power
                )
                gap = abs(target - lost - elongation)
                if worst <= _PATH_TOLERANCE * (abs(force) + 1e-4 * scale) and (
                    gap <= _PATH_TOLERANCE * total_length
                ):
                    solved = True
                    break
                change = (target - lost - length) / (soft + slope)
                # Kinks can send Newton's method to and fro; half a step ends that.
                part = 1.0 if iteration < _PATIENCE else 0.5
                force += part * change
                for i in range(first, stop):
                    move = work[_ALONE, i] + change / work[_STIFF, i] - work[_STRAIN, i]
                    e = work[_STRAIN, i] + part * min(max(move, -_LONGEST), _LONGEST)
                    work[_STRAIN, i] = min(max(e, _LOW), _HIGH)
            if not solved:
                force = _bracketed_force(
                    target, first, stop, largest_N, slip, slip_from, slip_power, compliance,
                    power, lower, upper, slices, softening_table, cubics, step, work,
                )  # fmt: skip
            for i in range(first, stop):
                e, stress, old = work[_STRAIN, i], work[_STRESS, i], work[_STRESS_BEFORE, i]
                if relaxes:
                    for k in range(terms):
                        memory[i, k] = (
                            memory[i, k] * decay[0, k]
                            + relaxing[i, k] * (stress - old) * decay[1, k]
                        )
                work[_STRESS_BEFORE, i] = stress
                if e > work[_LARGEST, i]:
                    work[_LARGEST, i] = e
                    if slices[6, i] != 0.0:
                        work[_LEFT, i] = min(slices[6, i] * _set_strain(set_table, e), 0.95 * e)
                strain[t, i] = e
            force_N[p, t] = force
            largest_N = max(largest_N, force)
            before, settled = settled, target


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
        Engineering strain of every slice, of its `Setup.length_mm`.
    """

    force_N: FloatArray
    strain: FloatArray


def predict(setup: Setup, laws: LawTables) -> Prediction:
    """Follow every test along its path.

    All values are finite for finite setups: where no equilibrium exists (more travel than the
    slices can take to strains of -0.6 to 4), strains stay at that end.
    """
    steps, slices = setup.time_s.shape[1], len(setup.coordinate)
    lower, upper, fraction = laws.bracket(setup.coordinate)
    used = np.flatnonzero(setup.relaxing.any(axis=0))
    force = np.empty(setup.time_s.shape)
    strain = np.empty((steps, slices))
    _follow_path(
        np.asarray(setup.first_slice, dtype=np.int64),
        np.ascontiguousarray(setup.time_s, dtype=np.float64),
        setup.travel_mm * setup.travel_factor[:, None] - setup.lost_mm,
        np.stack([setup.slip_mm_N, setup.slip_from_N, setup.slip_power,
                  setup.compliance_mm_N, setup.compliance_power]),
        np.asarray(lower, dtype=np.int64),
        np.asarray(upper, dtype=np.int64),
        np.stack([setup.length_mm, setup.area_mm2, fraction, setup.log_factor, setup.log_tilt,
                  setup.softening, setup.set_share]),
        np.ascontiguousarray(setup.relaxing[:, used]),
        RELAXATION_TIMES_s[used],
        np.ascontiguousarray(setup.softening_table, dtype=np.float64),
        np.ascontiguousarray(setup.set_table, dtype=np.float64),
        laws.cubics,
        laws.strain_step,
        np.empty((_WORK_ROWS, slices)),
        np.empty((slices, len(used))),
        np.empty((2, len(used))),
        force,
        strain,
    )  # fmt: skip
    return Prediction(setup.gain * force + setup.offset_N, strain)


def predict_all(setups: Iterable[Setup], laws: LawTables, *, workers: int = 2) -> list[Prediction]:
    """Predict several setups, in their order; threads change the time it takes and nothing else."""
    waiting = list(setups)
    if workers < 2 or len(waiting) < 2:
        return [predict(setup, laws) for setup in waiting]
    with ThreadPoolExecutor(min(workers, len(waiting))) as pool:
        return list(pool.map(partial(predict, laws=laws), waiting))
