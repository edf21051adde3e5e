"""Grading: from a part and a wish for stiffness to a plan, and the verification of plans."""

from planner.grading.certificate import Certificate, certify
from planner.grading.difference import Difference, differences
from planner.grading.planning import grade
from planner.grading.mixture import Mixture, mixture_for
from planner.grading.profile import Profile

__all__ = [
    "Certificate",
    "Difference",
    "Mixture",
    "Profile",
    "certify",
    "differences",
    "grade",
    "mixture_for",
]
