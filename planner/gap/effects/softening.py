"""Softening (Mullins): a material strained once is softer below the largest strain it has seen."""

import numpy as np
from scipy.special import erf

from planner.arrays import FloatArray
from planner.gap.effects.effect import Effect, Form, Parameter, Values
from planner.gap.effects.mixture_trend import PEAK, mixture_share
from planner.gap.forward.setup import SOFTENING_PEAKS, SOFTENING_SHARES, Setup

__all__ = ["EFFECT"]

_SIZE = Parameter("softening", 0.02, 0.7, "stress lost near rest after a large strain", log=True)
_SCALE = Parameter("scale", 0.03, 1.0, "largest strain at which two thirds are lost", log=True)

_SHARES: FloatArray = SOFTENING_SHARES[:, None]
_PEAKS: FloatArray = SOFTENING_PEAKS[None, :]


def _damage(setup: Setup, values: Values) -> Setup:
    """Damage by the largest strain, felt the less the nearer to it."""
    below = 1.0 - _SHARES ** values["power"]
    table = below * -np.expm1(-_PEAKS / values["scale"])
    return _softened(setup, np.full_like(setup.softening, values["softening"]), table)


def _graded_damage(setup: Setup, values: Values) -> Setup:
    """Damage by the largest strain, one mixture most."""
    table = (1.0 - _SHARES) * -np.expm1(-_PEAKS / values["scale"])
    return _softened(setup, values["softening"] * mixture_share(setup, values["peak"]), table)


def _pseudo_elastic(setup: Setup, values: Values) -> Setup:
    """Error function of the energy missing to its largest, energies taken as strain squared."""
    missing = _PEAKS**2 * (1.0 - _SHARES**2)
    table = erf(missing / (values["scale"] ** 2 + values["reach"] * _PEAKS**2))
    return _softened(setup, np.full_like(setup.softening, values["softening"]), table)


def _softened(setup: Setup, size: FloatArray, table: FloatArray) -> Setup:
    if not np.any(size):
        return setup
    return setup.with_(softening=setup.softening + size, softening_table=table)


EFFECT = Effect(
    "softening",
    "softening by strain (Mullins)",
    "law",
    (
        Form(
            "damage",
            (_SIZE, _SCALE, Parameter("power", 0.4, 3.0, "of strain over the largest", log=True)),
            _damage,
            "stress *= 1 - s (1 - (e / e_max)^p) (1 - exp(-e_max / e_0)) below e_max",
            "Simo, Comput. Methods Appl. Mech. Eng. 60, 1987, 153",
        ),
        Form(
            "graded-damage",
            (_SIZE, _SCALE, PEAK),
            _graded_damage,
            "stress *= 1 - s w(m) (1 - e / e_max) (1 - exp(-e_max / e_0)) below e_max",
            "Simo, Comput. Methods Appl. Mech. Eng. 60, 1987, 153",
        ),
        Form(
            "pseudo-elastic",
            (
                _SIZE,
                Parameter("scale", 0.03, 0.6, "strain of slight softening", log=True),
                Parameter("reach", 0.0, 1.0, "of softening at large strains"),
            ),
            _pseudo_elastic,
            "stress *= 1 - s erf((e_max^2 - e^2) / (e_0^2 + b e_max^2)) below e_max",
            "Ogden & Roxburgh, Proc. R. Soc. A 455, 1999, 2861; "
            "Dorfmann & Ogden, Int. J. Solids Struct. 41, 2004, 1855",
        ),
    ),
    where=("branch", "strain"),
    channels=("unloading",),
)
