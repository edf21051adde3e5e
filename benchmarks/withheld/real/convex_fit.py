"""What a plain mechanism makes of a campaign: elastic shapes that relax, fitted without choices.

Stress is the sum of c_jk h_jk with c >= 0, where h_jk is the hereditary integral of the elastic
shape j over the relaxation time k. There is nothing to select, no noise to estimate and no local
minimum, so that it tells how much of a gap a viscoelastic law of the usual kind could close.
"""

from collections.abc import Hashable, Sequence

import numpy as np
from scipy.optimize import nnls

from planner.gap.campaign import Campaign, column_levels
from planner.gap.observations import ObservationModel
from planner.materials.laws import make_law
from planner.numerics import FloatArray
from planner.palette import Material

__all__ = ["convex_errors", "hereditary", "left_out_errors"]

_EXPONENTS = np.array([0.2, 1.0, 2.0, 4.0, 6.0])
"""From softening to strongly stiffening, in the nominal stress of an Ogden law."""

_TIMES_S = np.array([np.inf, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0])
"""Two to a decade, as no test tells more (a Debye peak is wider than a decade)."""

_FINER = 8
"""Steps that a step of the campaign's grid is cut into: errors fall with their square."""

_POINTS = 64
"""Of the palette's own curve: as many as a test has."""


def hereditary(time_s: FloatArray, strain: FloatArray) -> FloatArray:
    """Return h_jk(t), the integral of exp(-(t - u) / tau_k) ds_j(u), of tests (P, T).

    Between the given times the strain goes evenly.

    Returns
    -------
    (P, T, shapes * times)
    """
    coarse = np.arange(time_s.shape[1])
    fine = np.linspace(0.0, coarse[-1], _FINER * coarse[-1] + 1)
    time_s, strain = (
        np.stack([np.interp(fine, coarse, row) for row in rows]) for rows in (time_s, strain)
    )
    stretch = 1.0 + strain[..., None]
    shape = (stretch ** (_EXPONENTS - 1.0) - stretch ** (-0.5 * _EXPONENTS - 1.0)) / _EXPONENTS
    duration = np.diff(time_s, axis=1)[..., None] / _TIMES_S
    # (1 - exp(-x)) / x, which is 1 where a time is infinite and where nothing passes
    kept, share = np.exp(-duration), np.ones_like(duration)
    np.divide(-np.expm1(-duration), duration, out=share, where=duration > 0.0)
    h = np.zeros((*shape.shape, len(_TIMES_S)))
    h[:, 0] = shape[:, 0, :, None]
    for n, rise in enumerate(np.moveaxis(np.diff(shape, axis=1), 1, 0)):
        h[:, n + 1] = kept[:, n, None] * h[:, n] + share[:, n, None] * rise[..., None]
    return h[:, ::_FINER].reshape(len(h), len(coarse), -1)


def left_out_errors(campaign: Campaign, group: Sequence[Hashable]) -> FloatArray:
    """Return each specimen's mean squared error of force over its largest, its group left out.

    Each material is fitted alone, to its coupons of the other groups and to the palette's own
    curve. A specimen that cannot be compared has NaN, and so has a graded bar.
    """
    mounted = ObservationModel(campaign)
    setup, of = mounted.setup, np.maximum(mounted.test_of, 0)
    area = (setup.width_mm * setup.thickness_mm)[of, None]
    basis = hereditary(setup.time_s, setup.travel_mm / setup.gauge_mm[:, None])[of]
    measured = mounted.measured_N / area
    peak = np.abs(measured).max(axis=1)
    usual = float(np.median(setup.rate_per_s))
    rate = campaign.palette.reference.strain_rate_per_s or usual
    materials = {m.id: _own_curve(m, rate) for m in campaign.palette.materials}
    errors = np.full(len(group), np.nan)
    compared = mounted.test_of >= 0
    for out in dict.fromkeys(group):
        for id, (own_basis, own) in materials.items():
            mine = compared & np.array([s.material == id for s in campaign.specimens])
            left = np.array([g == out for g in group]) & mine
            if not left.any():
                continue
            # Each test, and the palette's curve as one more, counts by its largest stress
            fitted, stress = basis[mine & ~left], measured[mine & ~left]
            scale = peak[mine & ~left, None]
            rows = [own_basis / own.max(), *(fitted / scale[..., None])]
            found, _ = nnls(
                np.concatenate(rows), np.concatenate([own / own.max(), (stress / scale).ravel()])
            )
            missed = (basis[left] @ found - measured[left]) / peak[left, None]
            errors[left] = np.mean(missed**2, axis=1)
    return errors


def convex_errors(campaign: Campaign) -> tuple[float, float | None]:
    """Return the held-out errors: a condition left out at a time, and a rate.

    With one condition only, specimens are left out one at a time; with fewer than two rates known
    there is no second figure.
    """
    tests = ObservationModel(campaign).tests
    condition = {place: n for n, members in enumerate(tests) for place in members}
    count = len(campaign.specimens)
    groups = [condition.get(k, -1) for k in range(count)] if len(tests) > 1 else list(range(count))
    level = column_levels("rate_mm_s", [s.rate_mm_s for s in campaign.specimens])
    rates = {k for k in level if k is not None}
    by_rate = _rms(left_out_errors(campaign, level)) if len(rates) > 1 else None
    return _rms(left_out_errors(campaign, groups)), by_rate


def _own_curve(material: Material, rate_per_s: float) -> tuple[FloatArray, FloatArray]:
    """Return basis and stress of a palette's law, along the test that it stands for."""
    strain = np.linspace(0.0, material.elongation_at_break, _POINTS)
    stress = make_law(material.law).nominal_stress_MPa(1.0 + strain)
    return hereditary(strain[None] / rate_per_s, strain[None])[0], np.asarray(stress)


def _rms(squares: FloatArray) -> float:
    return float(np.sqrt(np.nanmean(squares)))
