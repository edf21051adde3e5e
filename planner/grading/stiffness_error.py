"""How far what is printed is off the target stiffness, and what another blend would make of it."""

import math
from collections.abc import Iterable, Mapping, Sequence

from planner.errors import ArgumentError
from planner.glance import percent
from planner.grading.blends import blend_segments
from planner.grading.profile import Profile, StiffnessScale, natural_bands
from planner.materials.mixtures import dither_table
from planner.plan import Check, Finding, Region

__all__ = ["alternatives", "error_text", "stiffness_check", "tolerated_ratio"]

# An error is a ratio, 1 or more: achieved over target where what is printed is too stiff, target
# over achieved where it is too soft. A ratio of 2 is as bad either way.


_ROUNDING = 1e-9
"""Relative: a stated tolerance is often the error that an earlier plan told, as printed."""

_LARGEST = 1e6
"""Of a tolerance; a palette from rubber to glass spans less."""


def tolerated_ratio(stated: float) -> float:
    """Return the largest ratio that is no finding.

    Parameters
    ----------
    stated
        The ratio, as 1.25; or, below 1, by what share the stiffness may be too large, as 0.25.

    Raises
    ------
    ArgumentError
        Below 0, or so large that nothing could miss it.
    """
    if not 0.0 <= stated <= _LARGEST:
        raise ArgumentError(
            f"`tolerance` {stated:g}: it must be from 0 to {_LARGEST:g}: a ratio, as 1.25, or "
            "below 1 a share, as 0.25 for 25 %"
        )
    return stated if stated >= 1.0 else 1.0 + stated


def stiffness_check(
    regions: Sequence[Region],
    limit: float,
    others: Mapping[str, float],
) -> tuple[Check, tuple[Finding, ...]]:
    """Hold the stiffness of all regions against what was wanted there.

    Parameters
    ----------
    limit
        Of `tolerated_ratio`.
    others
        Of `alternatives`.

    Returns
    -------
    check : Check
        The worst ratio of all regions, with its limit.
    findings : tuple of Finding
        Where the worst is, and what would make it smaller; empty where the check holds.
    """
    worst = max(regions, key=region_error)
    ratio = region_error(worst)
    ok = ratio <= limit * (1.0 + _ROUNDING)
    check = Check(ratio, limit, ok)
    if ok:
        return check, ()
    low, high = worst.target_modulus_MPa
    better = [f"{option} it is {error_text(error)}" for option, error in others.items()]
    cures = [*better, f"--tolerance {_rounded_up(ratio):g} accepts it"]
    message = (
        f"{worst.printed}: {worst.modulus_MPa:.3g} MPa where {low:.3g} .. {high:.3g} MPa is "
        f"wanted, at field {worst.field[0]:.3f} .. {worst.field[1]:.3f}: the stiffness is off by "
        f"up to {error_text(ratio)}, more than the tolerance, {error_text(limit)}; "
        + "; ".join(cures)
    )
    return check, (Finding("stiffness", message, worst.material),)


def alternatives(
    regions: Iterable[Region], target: Profile, scale: StiffnessScale, *, equal_bands: bool,
    moved: bool,
) -> dict[str, float]:  # fmt: skip
    """Return the worst ratio that other options would leave, where it is smaller.

    Of cells of two materials it is the error of their homogenised modulus; each cell by itself is
    one of the two.

    Parameters
    ----------
    equal_bands
        Whether the regions are bands of equal steps, in place of the nearest materials.
    moved
        Whether cuts between the nearest materials were moved off faces of the part.
    """
    ratio = max(region_error(region) for region in regions)
    moduli = scale.moduli_MPa
    between = [s for s in blend_segments(target, moduli) if s.lower < s.upper]
    cells = max(
        (1.0 / (1.0 - dither_table().error_at(moduli[s.upper] / moduli[s.lower])) for s in between),
        default=1.0,
    )
    option = "without --bands" if equal_bands else "with --snap 0" if moved else ""
    nearest = {option: _of_nearest(target, scale)} if option else {}
    found = {**nearest, "with --blend dither": cells}
    return {option: error for option, error in found.items() if error < ratio * (1.0 - 1e-6)}


def region_error(region: Region) -> float:
    """Return by what ratio a region is off its target, at its worst place."""
    return max(1.0 + region.error[1], 1.0 / (1.0 + region.error[0]))


def _of_nearest(target: Profile, scale: StiffnessScale) -> float:
    """Return the worst ratio of the nearest materials, of what of the target they reach."""
    moduli = scale.moduli_MPa
    least, most = moduli[0], moduli[-1]
    worst = 1.0
    for band in natural_bands(target, moduli):
        low, high = (min(max(value, least), most) for value in band.target_MPa)
        worst = max(worst, moduli[band.grade] / low, high / moduli[band.grade])
    return worst


def error_text(ratio: float) -> str:
    """Say a ratio as an error: in per cent, or as a factor where that reads better."""
    return percent(ratio - 1.0) if ratio < 2.0 else f"a factor of {ratio:.3g}"


def _rounded_up(value: float) -> float:
    """Return two significant digits that are not below a value."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return math.ceil(value / unit - 1e-9) * unit
