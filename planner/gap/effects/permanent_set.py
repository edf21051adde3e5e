"""Permanent set: a material strained once stays longer, and bears no stress up to there."""

import numpy as np

from planner.arrays import FloatArray
from planner.gap.effects.effect import Effect, Form, Parameter, Values
from planner.gap.effects.mixture_trend import PEAK, mixture_share
from planner.gap.forward.setup import SOFTENING_PEAKS, Setup

__all__ = ["EFFECT"]

_SIZE = Parameter("share", 0.01, 0.5, "of the largest strain that stays", log=True)
_SOURCE = "Dorfmann & Ogden, Int. J. Solids Struct. 41, 2004, 1855"


def _proportional(setup: Setup, values: Values) -> Setup:
    """Keep a share of the largest strain, all mixtures alike."""
    return _set(setup, np.full_like(setup.set_share, values["share"]), SOFTENING_PEAKS)


def _graded(setup: Setup, values: Values) -> Setup:
    """Keep a share of the largest strain, one mixture most."""
    return _set(setup, values["share"] * mixture_share(setup, values["peak"]), SOFTENING_PEAKS)


def _threshold(setup: Setup, values: Values) -> Setup:
    """Hardly any up to a threshold, a share of the largest strain far beyond."""
    beyond = (SOFTENING_PEAKS / values["threshold"]) ** 4
    table = SOFTENING_PEAKS * beyond / (1.0 + beyond)
    return _set(setup, np.full_like(setup.set_share, values["share"]), table)


def _power(setup: Setup, values: Values) -> Setup:
    """Faster than the largest strain."""
    table = SOFTENING_PEAKS ** values["power"]
    return _set(setup, np.full_like(setup.set_share, values["share"]), table)


def _set(setup: Setup, share: FloatArray, table: FloatArray) -> Setup:
    if not np.any(share):
        return setup
    return setup.with_(set_share=setup.set_share + share, set_table=table)


EFFECT = Effect(
    "permanent-set",
    "permanent set",
    "law",
    (
        Form("proportional", (_SIZE,), _proportional, "e_p = s e_max", _SOURCE),
        Form("graded", (_SIZE, PEAK), _graded, "e_p = s w(m) e_max", _SOURCE),
        Form(
            "threshold",
            (_SIZE, Parameter("threshold", 0.05, 0.6, "strain from which it stays", log=True)),
            _threshold,
            "e_p = s e_max y / (1 + y), y = (e_max / e_0)^4",
            "Diani, Fayolle & Gilormini, Eur. Polym. J. 45, 2009, 601",
        ),
        Form(
            "power",
            (
                Parameter("share", 0.02, 0.7, "of strain 1 that stays", log=True),
                Parameter("power", 1.1, 3.0, "of the largest strain"),
            ),
            _power,
            "e_p = s e_max^p",
            "Diani, Fayolle & Gilormini, Eur. Polym. J. 45, 2009, 601",
        ),
    ),
    where=("branch", "strain"),
    channels=("unloading",),
)
