"""What to look at again before a material's figures are used."""

from collections.abc import Callable

from planner.materials.characterise import Characteristics, MaterialCharacteristics
from planner.materials.deformation import NONRIGID_MPA

__all__ = ["REPLICATE_FACTOR", "doubts"]

REPLICATE_FACTOR = 2.0
"""Replicates differ by a few to some tens of per cent; beyond this factor from their median a
specimen is another material, or its size is wrong."""

_FIGURES: dict[str, Callable[[Characteristics], float]] = {
    "modulus (MPa)": lambda c: c.modulus_MPa,
    "strength (MPa)": lambda c: c.strength_MPa,
    "strain at break": lambda c: c.elongation_at_break,
}


def doubts(found: MaterialCharacteristics) -> tuple[str, ...]:
    """Return what speaks against a material's figures, one sentence each.

    - Specimens that deform unlike one another.
    - Specimens whose modulus, strength or strain at break is more than `REPLICATE_FACTOR` times
      the replicates' median, or less than its inverse; two specimens are compared directly.
    - A modulus above the nonrigid plastics' with more than twice the length at break and no
      yield point, which few materials show, and every rubber whose stress is psi given as MPa.
    """
    said = []
    if not found.agree:
        kinds = ", ".join(f"{c.specimen} {c.deformation.kind}" for c in found.specimens)
        said.append(
            f"{found.material}: its specimens disagree on how it deforms: {kinds}; taken as "
            f"{found.deformation.kind}, because {found.deformation.reason}"
        )
    said += [
        sentence
        for name, value in _FIGURES.items()
        if (sentence := _unlike(found, name, [value(c) for c in found.specimens]))
    ]
    said += [
        f"specimen {c.specimen}: {c.modulus_MPa:.3g} MPa is above a nonrigid material's "
        f"({NONRIGID_MPA:g} MPa), yet it stretches by {c.elongation_at_break:.3g} without a yield "
        "point; a rubber whose stress is psi given as MPa looks so: check the unit of stress"
        for c in found.specimens
        if c.modulus_MPa > NONRIGID_MPA and c.elongation_at_break > 1.0 and c.yield_strain is None
    ]
    return tuple(said)


def _unlike(found: MaterialCharacteristics, name: str, values: list[float]) -> str | None:
    names = [c.specimen for c in found.specimens]
    advice = "check the specimens' sizes, units and materials"
    if len(values) == 2:
        if max(values) <= REPLICATE_FACTOR * min(values):
            return None
        return (
            f"{found.material}: {name} is {values[0]:.3g} of {names[0]} and {values[1]:.3g} of "
            f"{names[1]}, more than {REPLICATE_FACTOR:g} times apart; {advice}"
        )
    median = sorted(values)[len(values) // 2]
    far = [
        f"{value:.3g} of {specimen}"
        for specimen, value in zip(names, values, strict=True)
        if not median / REPLICATE_FACTOR <= value <= REPLICATE_FACTOR * median
    ]
    if not far:
        return None
    return (
        f"{found.material}: {name} is {', '.join(far)}, more than {REPLICATE_FACTOR:g} times off "
        f"the replicates' median, {median:.3g}; {advice}"
    )
