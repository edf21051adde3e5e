"""Constitutive laws, one a module, and how a palette's parameters become one.

All are uniaxial and incompressible and return the nominal stress in MPa at a stretch; see
`Law`. `OgdenThesis` alone is neither stress-free at rest nor valid everywhere.
"""

from planner.errors import ArgumentError
from planner.materials.laws.law import Law
from planner.materials.laws.linear import Linear
from planner.materials.laws.martins import Martins
from planner.materials.laws.neo_hookean import NeoHookean
from planner.materials.laws.ogden import Ogden
from planner.materials.laws.ogden_thesis import OgdenThesis
from planner.materials.laws.yeoh import Yeoh
from planner.palette import LAW_PARAMETERS, LawParameters

__all__ = ["Law", "Linear", "Martins", "NeoHookean", "Ogden", "OgdenThesis", "Yeoh", "make_law"]


def make_law(parameters: LawParameters) -> Law:
    """Return the law that a palette's parameters describe.

    Raises
    ------
    ArgumentError
        No law is called so.
    """
    p = parameters.parameters
    match parameters.model:
        case "linear":
            return Linear(*p["modulus_MPa"])
        case "neo-hookean":
            return NeoHookean(*p["mu_MPa"])
        case "yeoh":
            c1, c2, c3 = p["c_MPa"]
            return Yeoh((c1, c2, c3))
        case "ogden":
            return Ogden(p["mu_MPa"], p["alpha"])
        case "martins":
            return Martins(*p["c1"], *p["c2_MPa"], *p["c3"], *p["c4_MPa"])
        case "ogden-thesis":
            return OgdenThesis(p["c"], *p["strain_min"], *p["strain_max"])
    raise ArgumentError(f"law {parameters.model!r}: it must be one of {', '.join(LAW_PARAMETERS)}")
