"""How sure the modulus of a blend is."""

import math
from statistics import NormalDist

from planner.grading.stiffness_scale import StiffnessScale

__all__ = ["blend_interval_MPa"]


def blend_interval_MPa(
    scale: StiffnessScale, lower: int, upper: int, modulus_MPa: float, error: float
) -> tuple[float, float]:
    """Return the interval that holds a print's modulus with 95 % probability.

    The materials' errors go together, as everywhere in planning: the larger of their scatters is
    taken, and the relative error of the estimate is added to it.

    Parameters
    ----------
    lower, upper
        Places of the materials from soft to hard.
    """
    materials = scale.palette.materials
    log_sd = max(materials[lower].modulus_log_sd, materials[upper].modulus_log_sd)
    factor = math.exp(NormalDist().inv_cdf(0.975) * log_sd) * (1.0 + error)
    return modulus_MPa / factor, modulus_MPa * factor
