"""Effects of conditions and history on the material: age, water, temperature, rate, strain."""

import math
from collections.abc import Callable
from functools import lru_cache, partial

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import erf, rgamma

from planner.gap.campaign import stated
from planner.gap.diagnosis import FoundEffect
from planner.gap.effect import Values, kept_below, place_on_palette
from planner.numerics import FloatArray
from planner.simulation.bar_solver import (
    SOFTENING_PEAKS,
    SOFTENING_SHARES,
    RELAXATION_TIMES_s,
    Setup,
)

# ------------------------------------------------------------------------------------------------
# A condition of each test against that at which the palette's laws hold; how much each mixture
# shows.


_WIDTH = 0.7
"""Of the trend, over the palette's range. Chosen: a mixture at the other end shows an eighth."""


def _reference(setup: Setup, name: str) -> float:
    """Return a condition's value at the palette's reference."""
    return float(getattr(stated(setup.reference), name))


def _graded(setup: Setup, size: float, values: Values) -> FloatArray:
    """Return a size in each slice, (S,): whole at the mixture `peak`, less around it.

    A form without that parameter shows it in all mixtures alike.
    """
    return _trend(place_on_palette(setup), size, values)


def _trend(places: FloatArray, size: float, values: Values) -> FloatArray:
    """Return a size at places on the palette, 0 to 1; see `_graded`."""
    if "peak" not in values:
        return np.full(len(places), size)
    return np.asarray(size * np.exp(-(((places - values["peak"]) / _WIDTH) ** 2)))


_KNOTS = 15
"""Places along a condition, or relaxation times, between which a smooth course is drawn. Numerical:
over a step a course keeps its sign."""

_SMOOTH = 1.4
"""Knots over which such a course keeps its sign. Physical: 0.7 decades of relaxation times, as an
exponential is half a decade to either side wide."""

_WAVES = 7
"""Patterns of it, the smoothest first. Numerical: they hold 95 % of its variance over the middle
knots."""


@lru_cache(maxsize=1)
def _waves() -> FloatArray:
    """Return patterns over the knots, (K, waves), of a Gaussian process of deviation 1."""
    away = np.subtract.outer(np.arange(_KNOTS), np.arange(_KNOTS)) / _SMOOTH
    values, vectors = np.linalg.eigh(np.exp(-0.5 * away**2))
    # Signs as a first rise, so that they are the same on every machine.
    rising = np.sign(vectors[-1] - vectors[0] + 1e-9)
    return np.asarray((vectors * rising * np.sqrt(np.maximum(values, 0.0)))[:, ::-1][:, :_WAVES])


def _course(values: Values) -> FloatArray:
    """Return a form's own waves over the knots, (K,); 0 where it is given none."""
    return np.asarray(_waves() @ [values.get(f"wave_{k + 1}", 0.0) for k in range(_WAVES)])


def _risen(log_slope: FloatArray, knots: FloatArray, at: ArrayLike) -> FloatArray:
    """Return a rising function at places, its slope linear between knots and even beyond."""
    slope, width = np.exp(log_slope), knots[1] - knots[0]
    at_knots = np.concatenate([[0.0], np.cumsum(0.5 * width * (slope[1:] + slope[:-1]))])
    at = np.asarray(at, dtype=np.float64)
    inside = np.clip(at, knots[0], knots[-1])
    left = np.minimum(((inside - knots[0]) / width).astype(np.int64), len(knots) - 2)
    over = inside - knots[left]
    bend = 0.5 * (slope[left + 1] - slope[left]) / width
    beyond = (at - inside) * np.where(at < inside, slope[0], slope[-1])
    return np.asarray(at_knots[left] + over * (slope[left] + over * bend) + beyond)


# ------------------------------------------------------------------------------------------------
# Ageing: curing goes on after the print and stiffens; some mixtures lose stiffness instead.


_KNOTS_DECADES: FloatArray = np.linspace(-1.5, 5.5, _KNOTS)
"""Of a time in days or hours: a course keeps its sign over 0.7 decades. Chosen: from an hour, and
minutes in water, to years beyond any campaign."""


def _log_time(setup: Setup, values: Values) -> Setup:
    """Decades of age beyond the reference, counted from a first change, or else a day."""
    onset = values.get("onset", 1.0)
    age, start = setup.age_days, _reference(setup, "age_days")
    course = partial(_risen, _course(values), _KNOTS_DECADES)
    decades = course(np.log10(age + onset)) - course(np.log10(start + onset))
    return setup.stiffened(_graded(setup, values["change"], values) * setup.on_slices(decades))


def _saturating(setup: Setup, values: Values) -> Setup:
    """To an end, as a reaction of first order."""
    age, start = setup.age_days, _reference(setup, "age_days")
    gone = np.exp(-start / values["time"]) - np.exp(-age / values["time"])
    return setup.stiffened(setup.on_slices(values["change"] * gone))


# ------------------------------------------------------------------------------------------------
# Moisture: soaked elastomer swells and softens, saturating within about a day.


_LEAST_h, _MOST_DECADES = 1e-9, 300.0
"""Hours in water that stand for none, and the logarithm of those that stand for all. Numerical: so
that they have a logarithm, and are numbers."""


def _softened_by_water(setup: Setup, values: Values, *, sheet: bool) -> Setup:
    """Soften by what is taken up over the saturation, through a sheet or whatever the thickness."""
    soak_h, start_h = setup.soak_h, np.full_like(setup.soak_h, _reference(setup, "soak_h"))
    if "wave_1" in values:
        soak_h, start_h = (_as_if_h(h, values) for h in (soak_h, start_h))
    size, uptake = _graded(setup, values["softening"], values), _sheet if sheet else _root
    taken, start = (
        np.log1p(-size * setup.on_slices(uptake(setup, h, values["saturation"])))
        for h in (soak_h, start_h)
    )
    return setup.stiffened(taken - start)


def _as_if_h(hours: FloatArray, values: Values) -> FloatArray:
    """Return hours that a course over their logarithm makes of them."""
    logs = np.log10(np.maximum(hours, _LEAST_h))
    decades = _KNOTS_DECADES[0] + _risen(_course(values), _KNOTS_DECADES, logs)
    return np.asarray(10.0 ** np.minimum(decades, _MOST_DECADES))


def _sheet(setup: Setup, soak_h: FloatArray, saturation_h: float) -> FloatArray:
    """Mass taken up over its saturation: Fick's law for a sheet, short and long times joined."""
    tau_h = saturation_h * (setup.thickness_mm / 3.0) ** 2
    return np.sqrt(-np.expm1(-4.0 * soak_h / np.pi / tau_h))


def _root(setup: Setup, soak_h: FloatArray, saturation_h: float) -> FloatArray:
    """Root of the time until saturation, whatever the thickness."""
    return np.tanh(np.sqrt(soak_h / saturation_h))


# ------------------------------------------------------------------------------------------------
# Temperature: mixtures soften through a glass transition that lies the higher the harder.


def _warmer_K(setup: Setup) -> FloatArray:
    """Kelvin above the reference, (P,)."""
    return setup.temperature_C - _reference(setup, "temperature_C")


def _wlf(setup: Setup, values: Values) -> Setup:
    """Less and less per kelvin; below half the constant the tangent goes on.

    A form without that parameter softens alike by every kelvin.
    """
    warmer, constant = _warmer_K(setup), values.get("constant", math.inf)
    inside = np.maximum(warmer, -0.5 * constant)
    shift = inside / (1.0 + inside / constant) + 4.0 * (warmer - inside)
    slope = _graded(setup, values["slope"], values)
    return setup.stiffened(-slope * setup.on_slices(shift))


_KNOTS_C: FloatArray = np.linspace(-75.0, 135.0, _KNOTS)
"""Of a temperature. Physical: a course keeps its sign over 21 K, half of what a jetted elastomer's
transition takes from 10 to 90 %."""

_STEEPER = 1.5
"""Deviation of ln slope from an even one. Physical: a transition of five in ln stress within 44 K,
wherever from -50 to 110 °C, is drawn to 4 % of the stress with no detail beyond 3."""

_HIGHER_K = 20.0
"""Of the transition, from the middle of the palette to its ends. Physical: about what a transition
takes from its middle to 90 %, so that mixtures are in it one after the other."""

_HASTE = 6.0
"""Decades of time that do what an ln of softening does. Physical: stress falls by a sixth of an ln
a decade of time in a transition, so that 4 % a kelvin are 0.24 decades, as polymers shift there."""

_ZERO_K = 273.15
"""0 °C. Physical: above its transition a network's stress is proportional to the absolute
temperature."""

_LESS_FAR = 0.3
"""Of the softening, from small strains to large, over the softening. Chosen: at large strains the
network bears more of the stress, and softens less."""


def _any_course(setup: Setup, values: Values) -> Setup:
    """Soften along any course, or hasten what relaxes by as many decades in place of that.

    So rate and temperature are one law where both vary: with `haste` 1 all softening is time's, by
    a clock that is the mean of a bar's mixtures. Where nothing relaxes `haste` has no meaning.
    """
    higher_K = _HIGHER_K * values.get("span", 0.0) * (2.0 * place_on_palette(setup) - 1.0)
    log_slope, at = _STEEPER * _course(values), _reference(setup, "temperature_C")
    now = setup.on_slices(_warmer_K(setup)) + at
    passed = _risen(log_slope, _KNOTS_C, now - higher_K)
    passed -= _risen(log_slope, _KNOTS_C, at - higher_K)
    softened = values["slope"] * passed
    drawn = values.get("entropy", 0.0) * np.log((now + _ZERO_K) / (at + _ZERO_K))
    faster = values.get("haste", 0.0) if np.any(setup.relaxing) else 0.0
    return setup.stiffened(drawn - (1.0 - faster) * softened).with_(
        log_tilt=setup.log_tilt + _LESS_FAR * values.get("tilt", 0.0) * softened,
        clock=setup.clock
        * 10.0 ** np.clip(_HASTE * faster * setup.mean_of_tests(softened), -12.0, 12.0),
    )


# ------------------------------------------------------------------------------------------------
# Rate: elastomers are stiffer when strained faster, and relax when held.


_LOG10_TIMES: FloatArray = np.log10(RELAXATION_TIMES_s)
_TIME_STEP = float(np.log(RELAXATION_TIMES_s[1] / RELAXATION_TIMES_s[0]))


def _rate_power(setup: Setup, values: Values) -> Setup:
    """Stiffen alike by every decade of strain rate above the reference."""
    rate = setup.on_slices(setup.rate_per_s) * setup.rate_ratio
    decades = np.log10(rate / _reference(setup, "strain_rate_per_s"))
    return setup.stiffened(_graded(setup, values["rise"], values) * decades)


def _rate_so_far(setup: Setup, values: Values) -> Setup:
    """Stiffen by the mean strain rate so far: it falls where held, so that stress relaxes."""
    path_mm = np.cumsum(np.abs(np.diff(setup.travel_mm, axis=1, prepend=0.0)), axis=1)
    moving_s = path_mm / (setup.rate_per_s * setup.gauge_mm)[:, None]
    slowed = np.log10(np.maximum(setup.time_s / np.maximum(moving_s, 1e-9), 1.0))
    rise = setup.mean_of_tests(_graded(setup, values["rise"], values))[:, None]
    return _rate_power(setup, values).with_(gain=setup.gain * np.exp(-rise * slowed))


def _relaxing(setup: Setup, spectrum_at: Callable[[FloatArray], FloatArray]) -> Setup:
    """Add shares that relax, the palette's laws kept in the palette's own tests.

    Parameters
    ----------
    spectrum_at
        Of places on the palette, 0 to 1, (n,): shares, (n, K).
    """
    materials = setup.with_(coordinate=setup.palette_coordinate)
    shares, before = spectrum_at(place_on_palette(materials)), setup.reference_relaxing
    if not shares.any():
        return setup
    return setup.with_(
        relaxing=setup.relaxing + spectrum_at(place_on_palette(setup)),
        reference_relaxing=shares + before if len(before) else shares,
        reference_rate_per_s=_reference(setup, "strain_rate_per_s"),
    )


def _spectrum(centre_s: float, breadth: float) -> FloatArray:
    """Parts of a whole, log-normal over the relaxation times, (K,)."""
    weights = np.exp(-0.5 * ((_LOG10_TIMES - math.log10(centre_s)) / breadth) ** 2)
    return weights / float(np.sum(weights))


def _prony(setup: Setup, values: Values) -> Setup:
    """All mixtures relax alike; or one relaxes most, over two decades of time."""
    parts = _spectrum(values["centre"], values.get("breadth", 1.0))
    return _relaxing(setup, lambda places: _trend(places, values["share"], values)[:, None] * parts)


def _fractional(setup: Setup, values: Values) -> Setup:
    """Relax as (1 + t/onset)^-n: its spectrum's integral over ln time as a sum."""
    rates = values["onset"] / RELAXATION_TIMES_s

    def spectrum_at(places: FloatArray) -> FloatArray:
        n = _trend(places, values["exponent"], values)[:, None]
        return np.asarray(rgamma(n) * np.exp(n * np.log(rates) - rates) * _TIME_STEP)

    return _relaxing(setup, spectrum_at)


_TILT = 0.1
"""Of ln stress from small strains to large. Chosen: relaxation is not quite the same at all
strains."""


def _smooth_spectrum(setup: Setup, values: Values) -> Setup:
    """Relax with any smooth spectrum, mixtures to their own degree."""
    parts = _spectrum(values["centre"], values["breadth"]) * np.exp(_course(values))
    parts /= parts.sum()

    def spectrum_at(places: FloatArray) -> FloatArray:
        u = 2.0 * places - 1.0
        more = values.get("trend", 0.0) * u + values.get("bend", 0.0) * (1.5 * u * u - 0.5)
        share = values["share"] * np.exp(more)
        return np.asarray(kept_below(share, _MOST_RELAXING)[:, None] * parts)

    tilted = setup.with_(log_tilt=setup.log_tilt + _TILT * values.get("tilt", 0.0))
    return _relaxing(tilted, spectrum_at)


_MOST_RELAXING = 0.98
"""Of the stress at once. Numerical: something must be left to carry the slice."""


# ------------------------------------------------------------------------------------------------
# What a material strained once does next, which a law of first loading does not hold.


def _first_loading_alone(found: FoundEffect, width_mm: float, thickness_mm: float) -> str:
    return (
        f"{found.id} ({found.text}): it changes what follows the first loading alone; the "
        "law, which is the first loading's, stays as it is; a part that is used over and over is "
        "softer than planned below its largest strain so far"
    )


# ------------------------------------------------------------------------------------------------
# Permanent set: a material strained once stays longer, and bears no stress up to there.


_SET_GROWTH = 0.3
"""Of the set with the logarithm of reloads. Chosen: from the first to the tenth it grows by up to
about two thirds."""


def _set(setup: Setup, values: Values) -> Setup:
    """Keep a share of the largest strain, or of a power of it.

    With a threshold hardly any up to there, that share far beyond.
    """
    share, table = _graded(setup, values["share"], values), SOFTENING_PEAKS
    if not np.any(share):
        return setup
    if "threshold" in values:
        beyond = (table / values["threshold"]) ** 4
        table = table * beyond / (1.0 + beyond)
    elif "power" in values:
        table = table ** values["power"]
    growth = _SET_GROWTH * values.get("cycles", 0.0)
    return setup.with_(
        set_share=setup.set_share + share, set_table=table, set_growth=setup.set_growth + growth
    )


# ------------------------------------------------------------------------------------------------
# Softening (Mullins): a material strained once is softer below the largest strain it has seen.


_SHARES: FloatArray = SOFTENING_SHARES[:, None]


_MOST_LOST = 0.95
"""Of the stress near rest. Numerical: something must be left to carry the slice."""

_MIX = 0.5
"""Of ln softening, from the middle of the palette to its hardest mixture. Chosen: one end of a
palette softens by up to some e times as much as the other."""

_FATIGUE = 0.15
"""Exponent of the fall with reloads, over the softening. Physical: from the first cycle to the
tenth, filled rubbers lose some per cent of the stress at the largest strain, foams 10 to 15 %."""


def _softened(setup: Setup, values: Values, table: FloatArray) -> Setup:
    size = _graded(setup, values["softening"], values)
    if not np.any(size):
        return setup
    if "mixture" in values:
        size = size * np.exp(_MIX * values["mixture"] * (2.0 * place_on_palette(setup) - 1.0))
        size = kept_below(size, _MOST_LOST)
    return setup.with_(
        softening=setup.softening + size,
        softening_table=table,
        fatigue=setup.fatigue + _FATIGUE * values.get("cycles", 0.0) * size,
    )


def _damage(setup: Setup, values: Values) -> Setup:
    """Damage by the largest strain, felt the less the nearer to it."""
    below = 1.0 - _SHARES ** values.get("power", 1.0)
    return _softened(setup, values, below * -np.expm1(-SOFTENING_PEAKS / values["scale"]))


def _pseudo_elastic(setup: Setup, values: Values) -> Setup:
    """Error function of the energy missing to its largest, energies taken as strain squared."""
    missing = SOFTENING_PEAKS**2 * (1.0 - _SHARES**2)
    reach = values["scale"] ** 2 + values["reach"] * SOFTENING_PEAKS**2
    return _softened(setup, values, erf(missing / reach))
