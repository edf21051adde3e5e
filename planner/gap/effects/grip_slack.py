"""Grip slack: the crosshead moves before the specimen is taut."""

import numpy as np

from planner.arrays import FloatArray
from planner.gap.effects.effect import Effect, Form, Parameter, Values
from planner.gap.forward.setup import Setup

__all__ = ["EFFECT"]

_SIZE = Parameter("slack", 0.02, 2.0, "travel lost", "mm", log=True)
_SOURCE = "ASTM D638, annex on toe compensation"


def _taken(travel_mm: FloatArray, slack_mm: float) -> FloatArray:
    """Return the travel while it is well below the slack, the slack when it is well above.

    The corner is spread over about half the slack, as a grip does not close at once.
    """
    travel = np.maximum(travel_mm, 0.0)
    square_t, square_s = travel * travel, slack_mm * slack_mm
    sum_of_squares = square_t * square_t + square_s * square_s
    taken: FloatArray = travel * slack_mm / np.sqrt(np.sqrt(np.maximum(sum_of_squares, 1e-40)))
    return taken


def _dead_travel(setup: Setup, values: Values) -> Setup:
    """Lost first, and again on every way back."""
    return setup.with_(lost_mm=setup.lost_mm + _taken(setup.travel_mm, values["slack"]))


def _seating(setup: Setup, values: Values) -> Setup:
    """Lost first and for good."""
    furthest = np.maximum.accumulate(setup.travel_mm, axis=1)
    return setup.with_(lost_mm=setup.lost_mm + _taken(furthest, values["slack"]))


def _taking_up(setup: Setup, values: Values) -> Setup:
    """Lost bit by bit over a further length."""
    slack = values["slack"]
    taken = -np.expm1(-np.maximum(setup.travel_mm, 0.0) / (slack + values["length"]))
    return setup.with_(lost_mm=setup.lost_mm + slack * taken)


EFFECT = Effect(
    "grip-slack",
    "slack in the grips",
    "boundary",
    (
        Form(
            "dead-travel",
            (_SIZE,),
            _dead_travel,
            "lost = d s / (d^4 + s^4)^(1/4)",
            _SOURCE,
        ),
        Form(
            "seating",
            (_SIZE,),
            _seating,
            "lost = d s / (d^4 + s^4)^(1/4), d the furthest travel so far",
            _SOURCE,
        ),
        Form(
            "taking-up",
            (_SIZE, Parameter("length", 0.1, 5.0, "over which it is taken up", "mm", log=True)),
            _taking_up,
            "lost = s (1 - exp(-d / (s + l)))",
            _SOURCE,
        ),
    ),
    where=("strain", "specimen", "gauge_mm"),
    individual=0.35,
)
