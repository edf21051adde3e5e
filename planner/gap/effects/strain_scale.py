"""Strain scale: the length that strains is not the gauge length, or travel is read wrongly."""

import math

from planner.gap.effects.effect import Effect, Form, Parameter, Values
from planner.gap.forward.setup import Setup

__all__ = ["EFFECT"]

_INCH = math.log(25.4)


def _factor(setup: Setup, values: Values) -> Setup:
    """Scale the travel of all tests alike."""
    return setup.with_(travel_factor=setup.travel_factor * math.exp(values["log_factor"]))


def _ends(setup: Setup, values: Values) -> Setup:
    """Spread the travel over more than the gauge: the fillets strain as well."""
    share = setup.gauge_mm / (setup.gauge_mm + values["length"])
    return setup.with_(travel_factor=setup.travel_factor * share)


EFFECT = Effect(
    "strain-scale",
    "gauge length or travel",
    "boundary",
    (
        Form(
            "factor",
            (
                Parameter(
                    "log_factor",
                    0.01,
                    0.5,
                    "ln of true over recorded strain",
                    log=True,
                    signed=True,
                ),
            ),
            _factor,
            "strain = travel / gauge exp(a)",
            "ISO 37 (strain is measured between marks, not grips)",
        ),
        Form(
            "ends",
            (Parameter("length", 0.3, 20.0, "that strains beyond the gauge", "mm", log=True),),
            _ends,
            "strain = travel / (gauge + l)",
            "ISO 37 (the fillets of a dumb-bell strain as well)",
        ),
        Form(
            "inch",
            (
                Parameter(
                    "log_factor",
                    _INCH - 0.03,
                    _INCH + 0.03,
                    "travel in inches taken for mm, or the reverse",
                    signed=True,
                ),
            ),
            _factor,
            "ln factor = +-ln 25.4",
            "Thompson & Taylor, NIST SP 811, 2008 (units)",
            weight=0.1,
        ),
    ),
    where=("strain", "gauge_mm"),
)
