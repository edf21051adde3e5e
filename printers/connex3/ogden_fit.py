"""Fit a stress-free Ogden law to a curve by looking at every choice of exponents."""

import itertools

import numpy as np

from planner.materials.laws import Ogden, stability
from planner.numerics import FloatArray, IntArray

__all__ = ["fit_ogden", "relative_rms"]

TOLERANCE = 0.05
"""Relative RMS residual that is good enough: the scatter between specimens."""

_TERMS, _STEP, _ALPHA_MAX = 2, 0.5, 30.0
_CANCELLATION_MAX = 5.0


def fit_ogden(strain: FloatArray, stress_MPa: FloatArray, strain_max: float) -> Ogden:
    """Return the best sound Ogden law of two terms.

    Exponents lie on a grid (abs(α) <= 30, step 0.5) and the moduli are linear least squares of
    the relative residuals, so that no start value or stopping rule enters. A law counts only if
    it is sound in uniaxial, planar and equibiaxial loading from stretch 0.6 to ``1 + strain_max``
    (`planner.materials.laws.stability`), and Σ abs(μi αi) is at most 5 times Σ μi αi: no pairs of
    huge terms that cancel. A third term follows tension closer, and pays for it with stresses
    in compression that no one measured.

    Raises
    ------
    ValueError
        No sound law fits within `TOLERANCE`.
    """
    count = round(_ALPHA_MAX / _STEP)
    alpha = _STEP * np.array([k for k in range(-count, count + 1) if k != 0])
    columns = _terms(1.0 + strain, alpha) / stress_MPa[:, np.newaxis]
    target = np.ones(len(strain))
    choices = np.array(list(itertools.combinations(range(len(alpha)), _TERMS)))
    for place in np.argsort(-_explained(columns, target, choices), kind="stable"):
        chosen = choices[place]
        moduli = np.linalg.lstsq(columns[:, chosen], target, rcond=None)[0]
        parts = moduli * alpha[chosen]
        if np.abs(parts).sum() > _CANCELLATION_MAX * parts.sum():
            continue
        law = Ogden(tuple(_rounded(m) for m in moduli), tuple(alpha[chosen].tolist()))
        if relative_rms(law, strain, stress_MPa) > TOLERANCE:
            break  # and so are all that follow
        if stability(law, strain_max).ok:
            return law
    raise ValueError(f"no sound Ogden law of two terms fits within {TOLERANCE:g}")


def relative_rms(law: Ogden, strain: FloatArray, stress_MPa: FloatArray) -> float:
    """Return the root mean square of (law - stress) / stress."""
    residual = law.nominal_stress_MPa(1.0 + strain) / stress_MPa - 1.0
    return float(np.sqrt(np.mean(residual**2)))


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
