"""Material law: the palette's law of one material is off, by a factor or more with strain."""

from collections.abc import Sequence

import numpy as np

from planner.arrays import FloatArray
from planner.gap.effects.effect import Apply, Effect, Form, Parameter, Values
from planner.gap.forward.setup import Setup

__all__ = ["EFFECT", "effect_for"]

_SOURCE = "laws of one ladder disagree between tables of one thesis: see the thesis' numbers"


def effect_for(coordinates: Sequence[float], names: Sequence[str]) -> Effect:
    """Return the effect with two forms for each material of a palette.

    Mixtures between materials feel it in part, as their laws are interpolated.

    Parameters
    ----------
    coordinates
        Of the materials, rising.
    names
        Of the materials, in the same order.
    """
    nodes = np.asarray(coordinates, dtype=np.float64)
    factor = Parameter("log_factor", 0.1, 1.6, "of its stress", log=True, signed=True)
    tilt = Parameter("log_tilt", 0.1, 1.2, "of its stress with strain", log=True, signed=True)
    forms = []
    for place, name in enumerate(names):
        peak = np.zeros(len(nodes))
        peak[place] = 1.0
        forms += [
            Form(
                f"{name} factor",
                (factor,),
                _factor_of(nodes, peak),
                f"ln stress += a hat(m), hat 1 at {name} and 0 at its neighbours",
                _SOURCE,
            ),
            Form(
                f"{name} tilt",
                (tilt,),
                _tilt_of(nodes, peak),
                f"ln stress += a hat(m) tanh((strain - 0.15) / 0.2), hat 1 at {name}",
                _SOURCE,
            ),
        ]
    return Effect(
        "material-law",
        "law of one material",
        "law",
        tuple(forms),
        where=("material", "strain"),
        channels=("materials",),
    )


def _factor_of(nodes: FloatArray, peak: FloatArray) -> Apply:
    def apply(setup: Setup, values: Values) -> Setup:
        return setup.stiffened(values["log_factor"] * np.interp(setup.coordinate, nodes, peak))

    return apply


def _tilt_of(nodes: FloatArray, peak: FloatArray) -> Apply:
    def apply(setup: Setup, values: Values) -> Setup:
        tilt = values["log_tilt"] * np.interp(setup.coordinate, nodes, peak)
        return setup.with_(log_tilt=setup.log_tilt + tilt)

    return apply


EFFECT = effect_for((0.0, 0.5, 1.0), ("softest", "middle", "hardest"))
"""Of a palette of three materials; a campaign's own palette has its own forms."""
