"""Composition offset: the machine jets another mixture than was asked for."""

import numpy as np

from planner.arrays import FloatArray
from planner.gap.effects.effect import Effect, Form, Parameter, Values
from planner.gap.effects.mixture_trend import PEAK, place_on_palette
from planner.gap.forward.setup import Setup

__all__ = ["EFFECT"]

_WIDTH = 0.3
"""Of the range over which mixtures are off that much."""


def _shift_of(low: float, high: float, meaning: str) -> Parameter:
    return Parameter("shift", low, high, meaning, log=True, signed=True)


def _shifted(setup: Setup, shift: FloatArray) -> Setup:
    """Move slices by shares of the palette's range, (S,), ever less where its end is near."""
    place = place_on_palette(setup)
    room = np.maximum(np.where(shift > 0.0, 1.0 - place, place), 0.0)
    ratio = shift / np.maximum(room, 1e-12)
    moved = shift * (1.0 + ratio**8) ** -0.125
    low, high = setup.coordinate_range
    coordinate = np.clip(setup.coordinate + (high - low) * moved, low, high)
    return setup.with_(coordinate=coordinate)


def _constant(setup: Setup, values: Values) -> Setup:
    """All mixtures alike, but for the palette's ends."""
    return _shifted(setup, np.full(len(setup.coordinate), values["shift"]))


def _dot_gain(setup: Setup, values: Values) -> Setup:
    """Mixtures, but not their pure parts: droplets of one spread over the other's."""
    place = place_on_palette(setup)
    return _shifted(setup, 4.0 * values["shift"] * place * (1.0 - place))


def _hard_jets(setup: Setup, values: Values) -> Setup:
    """Move mixtures the more, the more hard resin was asked for."""
    return _shifted(setup, values["shift"] * place_on_palette(setup))


def _graded(setup: Setup, values: Values) -> Setup:
    """Most for the mixtures about one place on the palette."""
    away = (place_on_palette(setup) - values["peak"]) / _WIDTH
    return _shifted(setup, values["shift"] * np.exp(-(away**2)))


EFFECT = Effect(
    "composition-offset",
    "mixture off the one asked for",
    "composition",
    (
        Form(
            "constant",
            (_shift_of(0.003, 0.12, "of the palette's range"),),
            _constant,
            "u += a, u from 0 at the palette's softest to 1 at its hardest, within the palette",
            "Meisel, Dillard & Williams, Rapid Prototyping J. 24, 2018, 872",
        ),
        Form(
            "dot-gain",
            (_shift_of(0.004, 0.16, "of the palette's range, at its middle"),),
            _dot_gain,
            "u += 4 a u (1 - u), within the palette",
            "Murray, J. Franklin Inst. 221, 1936, 721; Yule & Nielsen, TAGA Proc. 3, 1951, 65",
        ),
        Form(
            "hard-jets",
            (_shift_of(0.005, 0.2, "of the palette's range, at its hard end"),),
            _hard_jets,
            "u += a u, within the palette",
            "Meisel, Dillard & Williams, Rapid Prototyping J. 24, 2018, 872",
        ),
        Form(
            "graded",
            (_shift_of(0.004, 0.16, "of the palette's range, where it is most"), PEAK),
            _graded,
            "u += a exp(-((u - peak) / 0.3)^2), within the palette",
            "Meisel, Dillard & Williams, Rapid Prototyping J. 24, 2018, 872",
        ),
    ),
    where=("material", "position"),
    channels=("materials",),
)
