"""Interface bleed: droplets of neighbouring mixtures run into each other before they cure."""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from scipy.special import erfc

from planner.arrays import FloatArray
from planner.gap.effects.effect import Effect, Form, Parameter, Values
from planner.gap.forward.setup import Setup
from planner.gap.profile_design import ProfileDesign

__all__ = ["EFFECT"]

_FLATNESS = 1e-4
"""How far, in the coordinate, a design may be off the straight line that stands for its points."""


def _gaussian(distance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Tail, and tail's integral, of a normal density of standard deviation 1, from distances."""
    tail = 0.5 * erfc(distance / np.sqrt(2.0))
    density = np.exp(-0.5 * distance**2) / np.sqrt(2.0 * np.pi)
    return tail, density - distance * tail


def _exponential(distance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Tail, and tail's integral, of a two-sided exponential of mean distance 1."""
    tail = 0.5 * np.exp(-distance)
    return tail, tail


def _droplet(distance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Tail, and tail's integral, of a parabola, the section of a cap, of half-width 1."""
    inside = np.minimum(distance, 1.0)
    left = 1.0 - inside
    return 0.25 * left**2 * (2.0 + inside), left**3 * (3.0 + inside) / 16.0


@lru_cache(maxsize=256)
def _corners(design: ProfileDesign) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Places of a design's steps and bends, with the step of its coordinate and of its slope.

    Beyond the gauge a bar goes on as it ends. Points that a straight line passes within
    `_FLATNESS` are left out.
    """
    x, c = _straightened(design.x_mm, design.coordinate)
    run, rise = np.diff(x), np.diff(c)
    step = run <= 1e-9 * x[-1]
    slope = np.where(step, 0.0, rise / np.where(step, 1.0, run))
    place = np.concatenate([x, x[:-1][step]])
    bend = np.concatenate([np.diff(slope, prepend=0.0, append=0.0), np.zeros(int(step.sum()))])
    jump = np.concatenate([np.zeros(len(x)), rise[step]])
    used = (bend != 0.0) | (jump != 0.0)
    return place[used], jump[used], bend[used]


def _straightened(x: FloatArray, c: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Leave out points between the ends of straight pieces (Douglas & Peucker, 1973)."""
    keep = np.zeros(len(x), dtype=np.bool_)
    keep[[0, -1]] = True
    pieces = [(0, len(x) - 1)]
    while pieces:
        first, last = pieces.pop()
        if last - first < 2:
            continue
        run = x[last] - x[first]
        inner = slice(first + 1, last)
        share = (x[inner] - x[first]) / run if run > 0.0 else np.zeros(last - first - 1)
        off = np.abs(c[inner] - c[first] - share * (c[last] - c[first]))
        worst = int(np.argmax(off))
        if off[worst] > _FLATNESS:
            middle = first + 1 + worst
            keep[middle] = True
            pieces += [(first, middle), (middle, last)]
    return x[keep], c[keep]


def _bled(
    kernel: Callable[[FloatArray], tuple[FloatArray, FloatArray]],
) -> Callable[[Setup, Values], Setup]:
    """Return the form of a kernel: bars take the exact convolution of their designs with it.

    Convolution turns a unit step at distance r into one that is off by the kernel's tail beyond
    |r|, and a bend into one that is off by the tail's integral.
    """

    def apply(setup: Setup, values: Values) -> Setup:
        length_mm = values["length"]
        if length_mm <= 0.0:
            return setup
        coordinate = setup.coordinate.copy()
        for test, design in enumerate(setup.designs):
            if design is None:
                continue
            place, jump, bend = _corners(design)
            slices = slice(setup.first_slice[test], setup.first_slice[test + 1])
            from_corner = setup.x_mm[slices, None] - place
            tail, integral = kernel(np.abs(from_corner) / length_mm)
            coordinate[slices] += (-np.sign(from_corner) * tail) @ jump
            coordinate[slices] += length_mm * (integral @ bend)
        return setup.with_(coordinate=np.clip(coordinate, *setup.coordinate_range))

    return apply


EFFECT = Effect(
    "interface-bleed",
    "mixing where materials meet",
    "composition",
    (
        Form(
            "gaussian",
            (Parameter("length", 0.05, 2.0, "standard deviation", "mm", log=True),),
            _bled(_gaussian),
            "m = design * normal density: erf across a step",
            "Crank, The Mathematics of Diffusion, 1975, ch. 2",
        ),
        Form(
            "exponential",
            (Parameter("length", 0.04, 1.5, "of decay", "mm", log=True),),
            _bled(_exponential),
            "m = design * exp(-|x| / l) / (2 l)",
            "Crank, The Mathematics of Diffusion, 1975, ch. 14 (diffusion with reaction)",
        ),
        Form(
            "droplet",
            (Parameter("length", 0.1, 4.0, "radius of spreading", "mm", log=True),),
            _bled(_droplet),
            "m = design * 3 (1 - (x / l)^2) / (4 l) within l",
            "Zorzetto et al., Sci. Rep. 10, 2020, 22285",
        ),
    ),
    where=("position", "material"),
    channels=("bar",),
)
