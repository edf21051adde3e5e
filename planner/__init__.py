"""A print-job mixture planner for multi-material jetting printers.

>>> import planner
>>> plan = planner.grade("finger.stl", from_="Tango", to="Vero", axis="x")  # doctest: +SKIP
>>> plan.write("finger-graded")  # doctest: +SKIP

Names are imported on first use, so that ``import planner`` costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from planner.errors import PlannerError
    from planner.gap.campaign import Campaign
    from planner.gap.campaign_folder import read_campaign
    from planner.gap.diagnose import diagnose
    from planner.gap.diagnosis import Diagnosis
    from planner.grading.blends import Mixture, mixture_for
    from planner.grading.check import Certificate, Difference, certify, differences
    from planner.grading.grade import grade
    from planner.grading.profile import Profile
    from planner.palette import Material, Palette, load_palette
    from planner.plan import Plan, Region, read_plan
    from planner.printers import Printer, installed_printers, printer
    from planner.simulation.bar import Bar
    from planner.simulation.simulate import Simulation, simulate
    from planner.slices.slices import Layer, iterate_layers
    from planner.slices.write import SliceStack, write_slices

__version__ = "0.1.0"

__all__ = [
    "Bar",
    "Campaign",
    "Certificate",
    "Diagnosis",
    "Difference",
    "Layer",
    "Material",
    "Mixture",
    "Palette",
    "Plan",
    "PlannerError",
    "Printer",
    "Profile",
    "Region",
    "Simulation",
    "SliceStack",
    "certify",
    "diagnose",
    "differences",
    "grade",
    "installed_printers",
    "iterate_layers",
    "load_palette",
    "mixture_for",
    "printer",
    "read_campaign",
    "read_plan",
    "simulate",
    "write_slices",
]

_HOME = {
    "PlannerError": "planner.errors",
    "Campaign": "planner.gap.campaign",
    "Diagnosis": "planner.gap.diagnosis",
    "diagnose": "planner.gap.diagnose",
    "read_campaign": "planner.gap.campaign_folder",
    "Certificate": "planner.grading.check",
    "Difference": "planner.grading.check",
    "Mixture": "planner.grading.blends",
    "Profile": "planner.grading.profile",
    "certify": "planner.grading.check",
    "differences": "planner.grading.check",
    "grade": "planner.grading.grade",
    "mixture_for": "planner.grading.blends",
    "Material": "planner.palette",
    "Palette": "planner.palette",
    "load_palette": "planner.palette",
    "Plan": "planner.plan",
    "Region": "planner.plan",
    "read_plan": "planner.plan",
    "Printer": "planner.printers",
    "installed_printers": "planner.printers",
    "printer": "planner.printers",
    "Bar": "planner.simulation.bar",
    "Simulation": "planner.simulation.simulate",
    "simulate": "planner.simulation.simulate",
    "Layer": "planner.slices.slices",
    "iterate_layers": "planner.slices.slices",
    "SliceStack": "planner.slices.write",
    "write_slices": "planner.slices.write",
}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'planner' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
