"""How far a print's force may lie from the predicted one, from the palette's uncertainty."""

from statistics import NormalDist

import numpy as np

from planner.arrays import FloatArray
from planner.errors import ArgumentError
from planner.materials.coefficients import CoefficientModel
from planner.simulation.bar import Bar
from planner.simulation.equilibrium import Equilibrium

__all__ = ["force_interval_N"]

_STRAINS = 65  # at which the variance between grades is taken; it varies slowly


def force_interval_N(
    bar: Bar, model: CoefficientModel, reached: Equilibrium, level: float
) -> FloatArray:
    """Return the interval that holds a print's force with probability `level`, (steps, 2).

    Let the stress of slice i be s_i times the law's, ln s_i normal with standard deviation d_i.
    At given displacement, to first order,

        d ln F = Σ w_i d ln s_i,  w_i = l_i P_i / T_i / Σ l P / T,

    with length l, nominal stress P and tangent T; the weights add up to 1. d_i is that of
    `CoefficientModel.modulus_interval_MPa`: the grades' own, and between grades the bridge's. All
    d_i are taken to go together, so that the standard deviation of ln F is Σ w_i d_i. Whatever
    their correlation, it is not larger.

    Raises
    ------
    ArgumentError
        A level that is not between 0 and 1.
    """
    if not 0.0 < level < 1.0:
        raise ArgumentError(f"--level {level:g}: it must be between 0 and 1")
    weight = bar.length_mm * reached.stress_MPa / reached.tangent_MPa
    total = weight.sum(axis=1, keepdims=True)
    weight = weight / np.where(total > 0.0, total, 1.0)
    sd = np.sum(weight * _log_sd(bar, model, reached.strain), axis=1)
    factor = np.exp(NormalDist().inv_cdf(0.5 + level / 2.0) * sd)
    return np.stack([reached.force_N / factor, reached.force_N * factor], axis=1)


def _log_sd(bar: Bar, model: CoefficientModel, strain: FloatArray) -> FloatArray:
    """Return the standard deviation of ln(stress) of each slice at each step, (steps, n)."""
    lower, upper, t = model.bracket(bar.coordinate)
    own = np.array([m.modulus_log_sd for m in model.palette.materials])
    grade = (1.0 - t) * own[lower] + t * own[upper]
    bridge = (model.coordinates[upper] - model.coordinates[lower]) * t * (1.0 - t)
    if not bridge.any():
        return np.broadcast_to(grade, strain.shape)
    known = np.linspace(0.0, model.strain_limit, _STRAINS)
    variance = np.interp(strain, known, model.wiener_variance(known))
    return np.asarray(np.sqrt(grade**2 + variance * bridge))
