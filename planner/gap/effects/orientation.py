"""Orientation: swaths and layers make a part stiffer along some directions of the tray."""

import numpy as np

from planner.arrays import FloatArray
from planner.gap.effects.effect import Effect, Form, Parameter, Values
from planner.gap.forward.setup import Setup

__all__ = ["EFFECT"]

_SOURCE = "Bass, Meisel & Williams, Rapid Prototyping J. 22, 2016, 826"
_PARTS = "Mueller, Shea & Daraio, Mater. Des. 86, 2015, 902"


def _change(name: str) -> Parameter:
    return Parameter("change", 0.02, 0.5, f"of ln stress along {name}", log=True, signed=True)


def _along(setup: Setup, x: float, y: float, z: float) -> FloatArray:
    """Pick each test's figure by its direction, less that of the palette's own, on slices."""
    figures = np.array([x, y, z])
    start = figures["xyz".index(setup.reference.orientation or "x")]
    found: FloatArray = figures[setup.orientation] - start
    known = setup.known.get("orientation")
    return setup.on_slices(found if known is None else np.where(known, found, 0.0))


def _build_direction(setup: Setup, values: Values) -> Setup:
    """Across the layers against within them."""
    return setup.stiffened(_along(setup, 0.0, 0.0, values["change"]))


def _head_direction(setup: Setup, values: Values) -> Setup:
    """Along the head's way against across it."""
    return setup.stiffened(_along(setup, values["change"], 0.0, 0.0))


def _swath_direction(setup: Setup, values: Values) -> Setup:
    """Across the swaths, in the plane of a layer."""
    return setup.stiffened(_along(setup, 0.0, values["change"], 0.0))


def _three_way(setup: Setup, values: Values) -> Setup:
    """All three directions differ, y between x and z or a little beyond."""
    change = values["change"]
    return setup.stiffened(_along(setup, 0.0, values["part"] * change, change))


def _strained_layers(setup: Setup, values: Values) -> Setup:
    """Across the layers, the more or the less the further the strain."""
    change = _along(setup, 0.0, 0.0, values["change"])
    return setup.with_(
        log_factor=setup.log_factor + change,
        log_tilt=setup.log_tilt + values["growth"] * change,
    )


EFFECT = Effect(
    "orientation",
    "direction on the tray",
    "law",
    (
        Form(
            "build-direction",
            (_change("z"),),
            _build_direction,
            "ln stress += a along z",
            _SOURCE,
        ),
        Form(
            "head-direction",
            (_change("x"),),
            _head_direction,
            "ln stress += a cos^2 of the angle to x",
            _PARTS,
        ),
        Form(
            "swath-direction",
            (_change("y"),),
            _swath_direction,
            "ln stress += a along y",
            _PARTS,
        ),
        Form(
            "three-way",
            (_change("z"), Parameter("part", -0.5, 1.5, "of it along y")),
            _three_way,
            "ln stress += a along z, r a along y",
            _SOURCE,
        ),
        Form(
            "strained-layers",
            (_change("z"), Parameter("growth", -1.0, 1.0, "of it with strain")),
            _strained_layers,
            "ln stress += a (1 + k tanh((strain - 0.15) / 0.2)) along z",
            _SOURCE,
        ),
    ),
    where=("orientation",),
    covariates=("orientation",),
)
