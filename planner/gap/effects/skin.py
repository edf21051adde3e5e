"""Skin: a surface layer, cured or wetted otherwise, that is stiffer or softer than the inside."""

import math

import numpy as np

from planner.arrays import FloatArray
from planner.gap.effects.effect import Effect, Form, Parameter, Values
from planner.gap.effects.section_sizes import section_sizes_mm
from planner.gap.forward.setup import Setup

__all__ = ["EFFECT"]

_SIZE = Parameter(
    "log_stiffness", 0.1, 1.5, "ln of the skin's stress over the inside's", log=True, signed=True
)
_DEPTH = Parameter("depth", 0.04, 0.6, "of the skin", "mm", log=True)
_SOURCE = "Voigt, Ann. Phys. 274, 1889, 573 (layers side by side)"


def _inside(size_mm: FloatArray, depth_mm: float) -> FloatArray:
    """Share of a size that two skins leave; skins that meet leave nothing, smoothly."""
    ratio = 2.0 * depth_mm / size_mm
    return 1.0 - ratio / (1.0 + ratio**8) ** 0.125


def _covered(setup: Setup, share: FloatArray, log_stiffness: float) -> Setup:
    return setup.stiffened(np.log1p(math.expm1(log_stiffness) * share))


def _all_sides(setup: Setup, values: Values) -> Setup:
    """Around the section."""
    width, thickness = section_sizes_mm(setup)
    share = 1.0 - _inside(width, values["depth"]) * _inside(thickness, values["depth"])
    return _covered(setup, share, values["log_stiffness"])


def _faces(setup: Setup, values: Values) -> Setup:
    """Top and bottom only."""
    _, thickness = section_sizes_mm(setup)
    return _covered(setup, 1.0 - _inside(thickness, values["depth"]), values["log_stiffness"])


def _edges(setup: Setup, values: Values) -> Setup:
    """Sides only, which support material touches."""
    width, _ = section_sizes_mm(setup)
    return _covered(setup, 1.0 - _inside(width, values["depth"]), values["log_stiffness"])


EFFECT = Effect(
    "skin",
    "surface layer",
    "geometry",
    (
        Form(
            "all-sides",
            (_SIZE, _DEPTH),
            _all_sides,
            "stress *= 1 + (exp(b) - 1) (1 - (1 - 2 h / w) (1 - 2 h / t))",
            _SOURCE,
        ),
        Form("faces", (_SIZE, _DEPTH), _faces, "stress *= 1 + (exp(b) - 1) 2 h / t", _SOURCE),
        Form("edges", (_SIZE, _DEPTH), _edges, "stress *= 1 + (exp(b) - 1) 2 h / w", _SOURCE),
    ),
    where=("thickness_mm", "width_mm"),
)
