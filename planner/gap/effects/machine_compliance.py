"""Machine compliance: frame, load cell and grips stretch with the specimen."""

import numpy as np

from planner.gap.effects.effect import Effect, Form, Parameter, Values
from planner.gap.forward.setup import Setup

__all__ = ["EFFECT"]


def _linear(setup: Setup, values: Values) -> Setup:
    """Add a spring in series."""
    return _compliant(setup, values["compliance"], 1.0)


def _stiffening(setup: Setup, values: Values) -> Setup:
    """Add a spring in series, the stiffer the more it bears, as joints are."""
    return _compliant(setup, values["compliance"], values["power"])


def _compliant(setup: Setup, compliance_mm_N: float, power: float) -> Setup:
    if compliance_mm_N == 0.0:
        return setup
    return setup.with_(
        compliance_mm_N=setup.compliance_mm_N + compliance_mm_N,
        compliance_power=np.full_like(setup.compliance_power, power),
    )


EFFECT = Effect(
    "machine-compliance",
    "compliance of the machine",
    "boundary",
    (
        Form(
            "linear",
            (Parameter("compliance", 0.002, 0.1, "of machine and grips", "mm/N", log=True),),
            _linear,
            "lost = C F",
            "Kalidindi, Abusafieh & El-Danaf, Exp. Mech. 37, 1997, 210",
        ),
        Form(
            "stiffening",
            (
                Parameter("compliance", 0.003, 0.4, "without load", "mm/N", log=True),
                Parameter("power", 0.2, 0.9, "of the load"),
            ),
            _stiffening,
            "lost = C ((1 + F)^p - 1) / p, F in N",
            "Johnson, Contact Mechanics, 1985 (joints stiffen under load)",
        ),
    ),
    where=("material", "strain", "width_mm", "gauge_mm"),
)
