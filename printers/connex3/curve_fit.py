"""Fit a law to a published curve by looking at every choice of what is not linear in it."""

import itertools

import numpy as np
from numpy.typing import ArrayLike

from planner.materials.laws import (
    Law,
    Linear,
    NeoHookean,
    Ogden,
    Yielding,
    positive_stretch,
    stability,
)
from planner.numerics import FloatArray, IntArray

__all__ = [
    "fit_ogden",
    "fit_yielding",
    "is_a_rubbers",
    "over_neo_hooke",
    "relative_rms",
    "rubber_over_neo_hooke",
]

TOLERANCE = 0.05
"""Relative RMS residual that is good enough: the scatter between specimens."""

_TERMS, _STEP, _CANCELLATION_MAX = (2, 3), 0.5, 5.0

_BETTER = 1.25
"""Times the error with a third term that is worth it. Chosen."""

_EXACT = 1e-4
"""Error that is none: less than a load cell resolves."""

_ALPHA_MAX = 5.0
"""Chosen: steeper terms follow tension no better than specimens scatter, and far beyond the curve,
where simulations follow a law too, they are all that is left of it."""

_COMPRESSED = np.linspace(0.6, 0.95, 8)

_ROOM = 0.005
"""What the fit keeps inside each limit, which is looked at here and there alone."""

_YIELD_STRAINS = np.geomspace(0.005, 0.5, 401)
_SHARPNESS = (1, 2, 3, 4)
"""Whole, so that the secant modulus has no infinite curvature at rest."""


def fit_ogden(strain: FloatArray, stress_MPa: FloatArray, strain_max: float) -> Ogden:
    """Return the best sound Ogden law of two or three terms.

    Exponents lie on a grid (abs(α) <= 5, step 0.5) and the moduli are least squares of the relative
    residuals within what is asked of them, so that no start value enters. The law is sound in
    uniaxial, planar and equibiaxial loading from stretch 0.6 to ``1 + strain_max``
    (`planner.materials.laws.stability`), carries in compression what a rubber does, and
    Σ abs(μi αi) is at most 5 times Σ μi αi: no pairs of huge terms that cancel. A third term is
    taken where it follows the curve closer by a factor of 1.25.

    Raises
    ------
    ValueError
        No sound law fits within `TOLERANCE`.
    """
    best, least = None, TOLERANCE
    for terms in _TERMS:
        law, off = _best_of(strain, stress_MPa, strain_max, terms)
        if law is not None and (best is None or max(off * _BETTER, _EXACT) < least):
            best, least = law, off
    if best is None:
        raise ValueError(f"no sound Ogden law of three terms fits within {TOLERANCE:g}")
    return best


def _best_of(
    strain: FloatArray, stress_MPa: FloatArray, strain_max: float, terms: int
) -> tuple[Ogden | None, float]:
    """Return the best law of so many terms, within `TOLERANCE`, and its error."""
    count = round(_ALPHA_MAX / _STEP)
    alpha = _STEP * np.array([k for k in range(-count, count + 1) if k != 0])
    columns = _terms(1.0 + strain, alpha) / stress_MPa[:, np.newaxis]
    target, limits = np.ones(len(strain)), _limits(alpha, strain_max)
    choices = np.array(list(itertools.combinations(range(len(alpha)), terms)))
    best, least = None, TOLERANCE
    explained = _explained(columns, target, choices)
    for place in np.argsort(-explained, kind="stable"):
        if explained[place] < len(strain) * (1.0 - least**2):
            break  # and so do all that follow, even without limits
        chosen = choices[place]
        moduli = _least_squares_within(columns[:, chosen], target, limits[:, chosen])
        parts = moduli * alpha[chosen]
        if np.abs(parts).sum() > _CANCELLATION_MAX * parts.sum():
            continue
        law = Ogden(tuple(_rounded(m) for m in moduli), tuple(alpha[chosen].tolist()))
        off = relative_rms(law, strain, stress_MPa)
        if off < least and is_a_rubbers(law) and not stability(law, strain_max).limits:
            best, least = law, off
    return best, least


def _limits(alpha: FloatArray, strain_max: float) -> FloatArray:
    """Return rows that times the moduli are above 0 of a law that is sound.

    Σ μ α x^α > 0 for every principal stretch x makes it stable in every loading; nominal stress
    rises in uniaxial loading; and in compression it is a rubber's.
    """
    farthest = 1.0 + strain_max
    stretch = np.geomspace(0.6, farthest, 41)
    principal = np.geomspace(min(0.6, farthest**-0.5), max(farthest, 0.6**-0.5), 41)
    x, at_rest = stretch[:, np.newaxis], 1.5 * alpha
    tangent = (alpha - 1.0) * x ** (alpha - 2.0) + (alpha / 2.0 + 1.0) * x ** (-alpha / 2.0 - 2.0)
    neo_hooke = (_COMPRESSED - _COMPRESSED**-2)[:, np.newaxis] / 3.0
    over = _terms(_COMPRESSED, alpha) / neo_hooke
    low, high = (end[:, np.newaxis] * at_rest for end in rubber_over_neo_hooke(_COMPRESSED))
    return np.vstack(
        [
            alpha * principal[:, np.newaxis] ** alpha - _ROOM * alpha,
            tangent - _ROOM * at_rest,
            over - (1.0 + _ROOM) * low,
            (1.0 - _ROOM) * high - over,
        ]
    )


def _least_squares_within(columns: FloatArray, target: FloatArray, rows: FloatArray) -> FloatArray:
    """Return x with the least |columns x - target| and rows x >= 0.

    Seen in an orthogonal basis that is the point of a cone nearest to another, which is less by
    its part in the polar cone (J. J. Moreau 1962): non-negative least squares.
    """
    from scipy.optimize import nnls

    basis, triangle = np.linalg.qr(columns)
    free = basis.T @ target
    normals = np.linalg.solve(triangle.T, rows.T)
    normals /= np.linalg.norm(normals, axis=0)
    pushed = normals @ nnls(normals, -free)[0]
    return np.asarray(np.linalg.solve(triangle, free + pushed), dtype=np.float64)


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


# ------------------------------------------------------------------------------------------------
# What a rubber carries in compression, where tension is all that was tested.
#
# A law may rise everywhere and still carry many times what any rubber does. Seen over a neo-Hookean
# law of the same modulus at rest, rubbers that were compressed lie near 1: the law that Ogden
# fitted to Treloar's natural rubber (Proc. R. Soc. A 326, 1972) has 1.03 at stretch 0.8 and 1.05 at
# 0.6.


def over_neo_hooke(law: Law, stretch: ArrayLike) -> FloatArray:
    """Return the nominal stress over that of a neo-Hookean law of the same modulus at rest."""
    neo_hooke = NeoHookean(float(law.tangent_MPa(1.0)) / 3.0)
    return np.asarray(law.nominal_stress_MPa(stretch) / neo_hooke.nominal_stress_MPa(stretch))


def rubber_over_neo_hooke(stretch: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return between what `over_neo_hooke` is looked for of a rubber that is compressed.

    From a nominal stress that stays a straight line, 3 (l - 1) / (l - l^-2), to Mooney's second
    term alone, 1 / l: the ends of what is in use. They are 0.79 and 1.25 at stretch 0.8, 0.55 and
    1.67 at 0.6.
    """
    stretch = positive_stretch(stretch)
    return over_neo_hooke(Linear(1.0), stretch), np.asarray(1.0 / stretch)
