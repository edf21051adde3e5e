"""Fit a law to a published curve by looking at every choice of what is not linear in it."""

import itertools

import numpy as np

from planner.materials.laws import (
    Law,
    Ogden,
    Yielding,
    over_neo_hooke,
    rubber_over_neo_hooke,
    stability,
)
from planner.numerics import FloatArray, IntArray

__all__ = ["fit_ogden", "fit_yielding", "is_a_rubbers", "relative_rms"]

TOLERANCE = 0.05
"""Relative RMS residual that is good enough: the scatter between specimens."""

_TERMS, _STEP, _CANCELLATION_MAX = 2, 0.5, 5.0

_ALPHA_MAX = 5.0
"""Chosen: steeper terms follow tension no better than specimens scatter, and far beyond the curve,
where simulations follow a law too, they are all that is left of it."""

_COMPRESSED = np.linspace(0.6, 0.95, 8)

_YIELD_STRAINS = np.geomspace(0.005, 0.5, 401)
_SHARPNESS = (1, 2, 3, 4)
"""Whole, so that the secant modulus has no infinite curvature at rest."""


def fit_ogden(strain: FloatArray, stress_MPa: FloatArray, strain_max: float) -> Ogden:
    """Return the best sound Ogden law of two terms.

    Exponents lie on a grid (abs(α) <= 5, step 0.5) and the moduli are linear least squares of
    the relative residuals, so that no start value or stopping rule enters. A law counts only if
    it is sound in uniaxial, planar and equibiaxial loading from stretch 0.6 to ``1 + strain_max``
    (`planner.materials.laws.stability`), carries in compression what a rubber does, and
    Σ abs(μi αi) is at most 5 times Σ μi αi: no pairs of huge terms that cancel. A third term
    follows tension closer, and pays for it with stresses in compression that no one measured.

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
        if is_a_rubbers(law) and stability(law, strain_max).ok:
            return law
    raise ValueError(f"no sound Ogden law of two terms fits within {TOLERANCE:g}")


def is_a_rubbers(law: Law) -> bool:
    """Return whether a law carries in compression, to stretch 0.6, what a rubber does."""
    low, high = rubber_over_neo_hooke(_COMPRESSED)
    found = over_neo_hooke(law, _COMPRESSED)
    return bool(((found >= low) & (found <= high)).all())


def fit_yielding(strain: FloatArray, stress_MPa: FloatArray) -> Yielding:
    """Return the best law that bends over.

    The strain of the bend lies on a grid, its sharpness is a whole number, and both slopes are
    linear least squares of the relative residuals, for the same reason.

    Raises
    ------
    ValueError
        The curve does not bend over.
    """
    best, least = None, np.inf
    for sharpness in _SHARPNESS:
        for at in _YIELD_STRAINS:
            bent = strain / (1.0 + (strain / at) ** sharpness) ** (1.0 / sharpness)
            columns = np.stack([strain, bent], axis=1) / stress_MPa[:, np.newaxis]
            behind, more = np.linalg.lstsq(columns, np.ones(len(strain)), rcond=None)[0]
            if behind < 0.0 or more <= 0.0:
                continue
            figures = (behind + more, more * at, behind, sharpness)
            law = Yielding(*(_rounded(v) for v in figures))
            off = relative_rms(law, strain, stress_MPa)
            if off < least:
                best, least = law, off
    if best is None:
        raise ValueError("the curve does not bend over: no law that yields follows it")
    return best


def relative_rms(law: Law, strain: FloatArray, stress_MPa: FloatArray) -> float:
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
