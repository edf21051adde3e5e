"""What the printed grades really do at reference conditions: a network beside a yielding phase.

A palette's law is an Ogden sum; here a molecular network (eight-chain or Gent) or an exponential
carries the large strains, and a second phase that saturates carries the initial stiffness. Both
are fitted to the published curve, and what they cannot follow stays as the base law's misfit, up
to a stated size.
Between grades the logarithm of the secant modulus follows a monotone cubic in the coordinate.
"""

from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.optimize import least_squares

from benchmarks.withheld.reality.palette_file import Grade, PaletteFile

__all__ = ["STRAINS", "BaseLaw", "Network", "fit_base_law"]

FloatArray = NDArray[np.float64]
Network = Literal["eight-chain", "exponential", "gent"]

STRAINS: FloatArray = np.linspace(0.0, 1.2, 241)
"""Engineering strains at which secant moduli are held."""

_SMALLEST_STRAIN = 1e-4
_FITTED_SHARE_OF_BREAK = 0.9


@dataclass(frozen=True)
class BaseLaw:
    """Secant moduli of the grades on `STRAINS`, logarithm, shape (grades, strains)."""

    coordinates: FloatArray
    log_secant_MPa: FloatArray

    def secant_MPa(self, coordinate: FloatArray) -> FloatArray:
        """Return secant moduli, shape of `coordinate` with the strains appended."""
        inside = np.clip(coordinate, self.coordinates[0], self.coordinates[-1])
        curve = PchipInterpolator(self.coordinates, self.log_secant_MPa, axis=0)
        return np.exp(curve(inside))

    def stress_MPa(self, coordinate: float, strain: FloatArray) -> FloatArray:
        """Return the nominal stress of one mixture at strains."""
        secant: FloatArray = np.interp(strain, STRAINS, self.secant_MPa(np.array(coordinate)))
        return secant * strain

    def shifted(self, log_factor: FloatArray, log_tilt: FloatArray) -> "BaseLaw":
        """Return the law with a factor a grade, and a tilt of the curve about strain 0.15."""
        tilt = np.tanh((STRAINS - 0.15) / 0.2)
        shift = log_factor[:, None] + log_tilt[:, None] * tilt
        return BaseLaw(self.coordinates, self.log_secant_MPa + shift)


@cache
def fit_base_law(palette: PaletteFile, network: Network, largest_misfit: float) -> BaseLaw:
    """Fit the bench's law to each grade's published curve, strain 0 to break.

    Where the root mean square relative misfit is above `largest_misfit`, the curve is drawn
    towards the published one until it is equal.
    """
    rows = [_log_secant(grade, network, largest_misfit) for grade in palette.grades]
    return BaseLaw(np.array([g.coordinate for g in palette.grades]), np.array(rows))


def _log_secant(grade: Grade, network: Network, largest_misfit: float) -> FloatArray:
    end = _FITTED_SHARE_OF_BREAK * grade.break_strain
    strain = np.linspace(0.01, end, 40)
    published = grade.stress_MPa(strain)
    modulus = published[0] / strain[0]

    def misfit(log_parameters: FloatArray) -> FloatArray:
        return _stress_MPa(strain, np.exp(log_parameters), network) / published - 1.0

    start = np.log([0.3 * modulus, 4.0, 0.01 * modulus, 0.1])
    low = np.log([1e-3 * modulus, 1.2 if network == "eight-chain" else 0.6, 1e-5 * modulus, 0.02])
    high = np.log([0.5 * modulus, 200.0, 0.5 * modulus, 2.0])
    fit = least_squares(misfit, start, bounds=(low, high), xtol=1e-12, ftol=1e-12)
    held = np.clip(STRAINS, _SMALLEST_STRAIN, end)
    published_log = np.log(grade.stress_MPa(held) / held)
    difference = np.log(_stress_MPa(held, np.exp(fit.x), network) / held) - published_log
    misfit_rms = float(np.sqrt(np.mean(difference[end >= STRAINS] ** 2)))
    return published_log + difference * min(1.0, largest_misfit / misfit_rms)


def _stress_MPa(strain: FloatArray, parameters: FloatArray, network: Network) -> FloatArray:
    shear_MPa, limit, yield_MPa, yield_strain = parameters
    stretch = 1.0 + strain
    if network == "eight-chain":
        # Arruda & Boyce 1993, with Cohen's inverse Langevin; `limit` is the locking chain stretch
        chain = np.sqrt((stretch**2 + 2.0 / stretch) / 3.0)
        y = np.minimum(chain / limit, 0.995)
        y0 = 1.0 / limit
        gain = (3.0 - y**2) / (1.0 - y**2) / ((3.0 - y0**2) / (1.0 - y0**2))
        glassy = yield_MPa * np.tanh(strain / yield_strain)
    elif network == "exponential":
        # Fung 1967, Demiray 1972; `limit` is the I1 - 3 over which the stiffness grows by e
        gain = np.exp(np.minimum((stretch**2 + 2.0 / stretch - 3.0) / limit, 4.0))
        glassy = yield_MPa * strain / (strain + yield_strain)
    else:
        # Gent 1996; `limit` is the largest I1 - 3
        gain = limit / np.maximum(limit - (stretch**2 + 2.0 / stretch - 3.0), 0.02 * limit)
        glassy = yield_MPa * (1.0 - np.exp(-strain / yield_strain))
    stress_MPa: FloatArray = shear_MPa * gain * (stretch - stretch**-2) + glassy
    return stress_MPa
