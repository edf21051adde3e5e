"""What a dithered plan comes to along its field: its blend as one material at every place."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from planner.arrays import FloatArray
from planner.errors import FileError
from planner.grading.profile import Profile
from planner.palette import Palette
from planner.plan import Plan, Region

__all__ = ["dithered_profile", "is_dithered"]

_POINTS = 65  # of a stretch; the coordinate between them is off by 1e-4 of a grade at most


def is_dithered(plan: Plan) -> bool:
    """Tell whether cells of two materials lie among each other in a plan."""
    return (plan.gradient.blend or {}).get("kind") == "dither"


def dithered_profile(plan: Plan, palette: Palette) -> tuple[FloatArray, FloatArray]:
    """Return field values from 0 to 1 and the coordinate at each, linear between.

    Cells are small against the part, so a place behaves as the mixture does, whose modulus is the
    target: it is given the coordinate between its two materials at which a homogeneous mixture has
    this modulus, by their moduli when the plan was made. A value that stands twice is a step.

    Raises
    ------
    FileError
        The plan's blends or profile are not what planner writes.
    UnknownNameError
        The palette lacks a material of the plan.
    """
    profile = _profile(plan.gradient.profile)
    by_stretch = {region.field: region for region in plan.regions}
    field, coordinate = [], []
    for (start, stop), region in sorted(by_stretch.items()):
        u = np.linspace(start, stop, _POINTS)
        field.append(u)
        coordinate.append(_coordinates(region, u, profile, palette))
    if not field:
        raise FileError("plan.json: it has no regions; grade the part again")
    return np.concatenate(field), np.concatenate(coordinate)


def _coordinates(region: Region, u: FloatArray, profile: Profile, palette: Palette) -> FloatArray:
    blend = region.blend
    if blend is None:
        return np.full(len(u), palette.resolve(region.printed).coordinate)
    try:
        lower, upper = (palette.resolve(str(blend[name])).coordinate for name in ("lower", "upper"))
        soft, hard = (float(modulus) for modulus in blend["moduli_MPa"])
        if not 0.0 < soft < hard < np.inf:
            raise ValueError(
                f"moduli_MPa are {soft:g} and {hard:g}, not the softer's and the harder's"
            )
    except (KeyError, TypeError, ValueError) as error:
        raise FileError(
            f"plan.json: region {region.index}: its blend is not that of dithered cells "
            f"({error!r}); grade the part again"
        ) from error
    # At a jump the profile has the value after it: keep within the stretch.
    inner = np.clip(u, u[0] + 1e-9 * (u[-1] - u[0]), u[-1] - 1e-9 * (u[-1] - u[0]))
    t = np.clip(np.log(profile.modulus_MPa(inner) / soft) / np.log(hard / soft), 0.0, 1.0)
    return np.asarray(lower + t * (upper - lower))


def _profile(description: Mapping[str, Any]) -> Profile:
    try:
        return Profile(
            str(description["name"]),
            tuple(description["positions"]),
            tuple(description["moduli_MPa"]),
            description["shape"],
        )
    except (KeyError, TypeError) as error:
        raise FileError(
            f"plan.json: gradient.profile is not one that planner writes ({error!r}); grade the "
            "part again"
        ) from error
