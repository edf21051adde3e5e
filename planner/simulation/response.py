"""The constitutive law of every slice at once, from tables of the palette's laws.

Calling a law for each slice and load step costs powers by the million. Instead the logarithm of
each grade's secant modulus is tabulated over strain and interpolated by cubics through values and
slopes; a blend is linear between two grades in that logarithm (see `CoefficientModel`), so one
table a grade serves every mixture. For all mixtures of the Connex3 the error of the stress is below
1e-9 of it.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from planner.arrays import FloatArray, IntArray
from planner.materials.coefficients import CoefficientModel
from planner.materials.laws import Law
from planner.materials.stiffness import secant_modulus_MPa

__all__ = ["FARTHEST", "ElasticResponse", "Response", "elastic_response"]

FARTHEST = 2.0
"""A law is followed to this many times the elongation at break: to break it is measured, from
there to here a specimen stronger than the mean may still hold, beyond it nothing is known."""

_INTERVALS = 2048


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
        interval = np.minimum(place.astype(np.int64), _INTERVALS - 1)
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
    nodes = np.linspace(0.0, FARTHEST * float(breaks[grades].max()), _INTERVALS + 1)
    tables = [_cubics(model.laws[k], nodes) for k in grades.tolist()]
    rising = np.array([limit for _, limit in tables])
    softer, harder = np.searchsorted(grades, lower), np.searchsorted(grades, upper)
    limit = np.minimum(FARTHEST * break_strain, np.minimum(rising[softer], rising[harder]))
    return ElasticResponse(
        break_strain=break_strain,
        strain_limit=limit,
        _step=float(nodes[1]),
        _softer=softer * _INTERVALS,
        _harder=harder * _INTERVALS,
        _fraction=t[:, None],
        _cubics=np.concatenate([cubics for cubics, _ in tables]),
    )


def _cubics(law: Law, strain: FloatArray) -> tuple[FloatArray, float]:
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
