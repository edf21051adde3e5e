"""Fit a stress-free Ogden law to a curve by looking at every choice of exponents."""

import itertools

import numpy as np

from planner.materials.laws import Ogden
from planner.numerics import FloatArray, IntArray

__all__ = ["fit_ogden", "relative_rms"]

TOLERANCE = 0.01
"""Relative RMS residual that is good enough: a fifth of the scatter between specimens."""

_GRIDS = ((1, 0.5), (2, 0.5), (3, 1.0))
_ALPHA_MAX = 30.0
_CANCELLATION_MAX = 5.0
_STABLE_FROM = 0.7


def fit_ogden(strain: FloatArray, stress_MPa: FloatArray, strain_max: float) -> Ogden:
    """Return the best stable Ogden law of the fewest terms that fit within `TOLERANCE`.

    Exponents lie on a grid (abs(α) <= 30, step 0.5 for one and two terms, 1 for three) and the
    moduli are linear least squares of the relative residuals, so that no start value or
    stopping rule enters. A law counts only if its stress rises strictly from stretch 0.7 to
    ``1 + strain_max``, its initial modulus is positive, and Σ abs(μi αi) is at most 5 times
    Σ μi αi: no pairs of huge terms that cancel.

    Raises
    ------
    ValueError
        No stable law of three terms fits within `TOLERANCE`.
    """
    for terms, step in _GRIDS:
        law = _best(strain, stress_MPa, strain_max, terms, step)
        if law is not None and relative_rms(law, strain, stress_MPa) <= TOLERANCE:
            return law
    raise ValueError(f"no stable Ogden law of up to three terms fits within {TOLERANCE:g}")


def relative_rms(law: Ogden, strain: FloatArray, stress_MPa: FloatArray) -> float:
    """Return the root mean square of (law - stress) / stress."""
    residual = law.nominal_stress_MPa(1.0 + strain) / stress_MPa - 1.0
    return float(np.sqrt(np.mean(residual**2)))


def _best(
    strain: FloatArray, stress_MPa: FloatArray, strain_max: float, terms: int, step: float
) -> Ogden | None:
    count = round(_ALPHA_MAX / step)
    alpha = step * np.array([k for k in range(-count, count + 1) if k != 0])
    columns = _terms(1.0 + strain, alpha) / stress_MPa[:, np.newaxis]
    target = np.ones(len(strain))
    choices = np.array(list(itertools.combinations(range(len(alpha)), terms)))
    stretches = np.linspace(_STABLE_FROM, 1.0 + strain_max, 201)
    for place in np.argsort(-_explained(columns, target, choices), kind="stable"):
        chosen = choices[place]
        moduli = np.linalg.lstsq(columns[:, chosen], target, rcond=None)[0]
        parts = moduli * alpha[chosen]
        if np.abs(parts).sum() > _CANCELLATION_MAX * parts.sum():
            continue
        law = Ogden(tuple(_rounded(m) for m in moduli), tuple(alpha[chosen].tolist()))
        if (law.tangent_MPa(stretches) > 0.0).all():
            return law
    return None


def _explained(columns: FloatArray, target: FloatArray, choices: IntArray) -> FloatArray:
    """Return the squares of `target` that each choice of columns explains.

    The columns span a dozen directions within rounding; seen in these alone, an orthogonal basis
    of each choice is cheap, and exact enough to rank alike on any machine.
    """
    u, size, v = np.linalg.svd(columns / np.linalg.norm(columns, axis=0), full_matrices=False)
    kept = size > 1e-13 * size[0]
    basis = np.linalg.qr((size[kept, np.newaxis] * v[kept])[:, choices].transpose(1, 0, 2))[0]
    return np.asarray((((target @ u[:, kept]) @ basis) ** 2).sum(axis=-1))


def _terms(stretch: FloatArray, alpha: FloatArray) -> FloatArray:
    base = stretch[:, np.newaxis]
    return np.asarray(base ** (alpha - 1.0) - base ** (-alpha / 2.0 - 1.0))


def _rounded(value: float) -> float:
    return float(f"{value:.7g}")
