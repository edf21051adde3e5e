"""Cross-section: jetted parts print larger or smaller than drawn, and with rounded edges."""

import numpy as np

from planner.arrays import FloatArray
from planner.gap.effects.effect import Effect, Form, Parameter, Values
from planner.gap.effects.section_sizes import section_sizes_mm
from planner.gap.forward.setup import Setup

__all__ = ["EFFECT"]

_SOURCE = "Mueller, Shea & Daraio, Mater. Des. 86, 2015, 902"
_LEAST = 0.1
"""No size shrinks to less than this share of the drawn one."""


def _oversize(meaning: str) -> Parameter:
    return Parameter("oversize", 0.02, 0.4, meaning, "mm", log=True, signed=True)


def _grown(setup: Setup, width_mm: float, thickness_mm: float) -> Setup:
    width, thickness = section_sizes_mm(setup)
    ratio = _ratio(width, width_mm) * _ratio(thickness, thickness_mm)
    return setup.with_(area_mm2=setup.area_mm2 * ratio)


def _ratio(size_mm: FloatArray, more_mm: float) -> FloatArray:
    return np.maximum(1.0 + more_mm / size_mm, _LEAST)


def _both(setup: Setup, values: Values) -> Setup:
    """All sides alike."""
    return _grown(setup, values["oversize"], values["oversize"])


def _thickness(setup: Setup, values: Values) -> Setup:
    """Top and bottom."""
    return _grown(setup, 0.0, values["oversize"])


def _width(setup: Setup, values: Values) -> Setup:
    """Sides alone, where resin flows out before it cures."""
    return _grown(setup, values["oversize"], 0.0)


def _rounded(setup: Setup, values: Values) -> Setup:
    """Four corners rounded, at most to a half circle of the smaller size."""
    width, thickness = section_sizes_mm(setup)
    half = 0.5 * np.minimum(width, thickness)
    radius = values["radius"] / (1.0 + (values["radius"] / half) ** 4) ** 0.25
    ratio = 1.0 - (4.0 - np.pi) * radius**2 / (width * thickness)
    return setup.with_(area_mm2=setup.area_mm2 * ratio)


EFFECT = Effect(
    "cross-section",
    "section other than drawn",
    "geometry",
    (
        Form(
            "all-sides",
            (_oversize("of width and of thickness"),),
            _both,
            "A = A0 (1 + d / w) (1 + d / t)",
            "Ibrahim et al., J. Cranio-Maxillofac. Surg. 37, 2009, 167",
        ),
        Form("thickness", (_oversize("of thickness"),), _thickness, "A = A0 (1 + d / t)", _SOURCE),
        Form("width", (_oversize("of width"),), _width, "A = A0 (1 + d / w)", _SOURCE),
        Form(
            "rounded",
            (Parameter("radius", 0.3, 2.0, "of the corners", "mm", log=True),),
            _rounded,
            "A = A0 - (4 - pi) r^2",
            _SOURCE,
        ),
    ),
    where=("thickness_mm", "width_mm"),
    channels=("section",),
)
