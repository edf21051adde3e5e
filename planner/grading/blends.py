"""Blends of two materials: stretches between them, and bands of both in turn or mixed."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.errors import ArgumentError
from planner.grading.profile import (
    Band,
    Profile,
    StiffnessScale,
    distinct_positions,
    equal_bands,
    natural_bands,
)
from planner.grading.regions import Printed, mixture
from planner.materials.mixtures import reuss_MPa, reuss_share
from planner.plan import Region
from planner.printers import Printer

__all__ = [
    "MIXTURES_UNCALIBRATED",
    "BlendSegment",
    "Laminate",
    "blend_interval_MPa",
    "blend_segments",
    "laminated",
    "mixed_bands",
    "with_laminates",
]


# ------------------------------------------------------------------------------------------------
# Stretches of the field over which the target stays between the same two materials.


_SAME = 1e-9  # relative: a target this near to a material's modulus is that


@dataclass(frozen=True, slots=True)
class BlendSegment:
    """A stretch of the field between two neighbouring materials.

    Attributes
    ----------
    start, stop
        Field values.
    lower, upper
        Places of the materials from soft (0) to hard; the same where the target is one material's
        modulus, or beyond the softest or the hardest.
    target_MPa
        Lowest and highest target.
    ends_MPa
        Targets where it begins and ends.
    run
        How many jumps of the target lie before it.
    """

    start: float
    stop: float
    lower: int
    upper: int
    target_MPa: tuple[float, float]
    ends_MPa: tuple[float, float]
    run: int

    @property
    def rising(self) -> bool:
        """Whether the target is not lower at the end than at the beginning."""
        return self.ends_MPa[1] >= self.ends_MPa[0]


def blend_segments(profile: Profile, moduli_MPa: tuple[float, ...]) -> tuple[BlendSegment, ...]:
    """Divide the field where the target passes the modulus of a material.

    Parameters
    ----------
    moduli_MPa
        Of the catalogue materials, strictly rising.
    """
    cuts = [u for modulus in moduli_MPa for u in profile.crossings(modulus)]
    jumps = [a for a, b in itertools.pairwise(profile.positions) if a == b]
    found = []
    for start, stop in itertools.pairwise(distinct_positions([*cuts, *jumps])):
        low, high = profile.interval_MPa(start, stop)
        lower, upper = _neighbours(low, high, moduli_MPa)
        inner = 1e-9 * (stop - start)  # a jump's own value is that after it
        ends = [float(profile.modulus_MPa(u)) for u in (start, stop - inner)]
        run = sum(jump <= start + inner for jump in jumps)
        found.append(BlendSegment(start, stop, lower, upper, (low, high), (ends[0], ends[1]), run))
    return tuple(found)


def _neighbours(low: float, high: float, moduli_MPa: tuple[float, ...]) -> tuple[int, int]:
    place = int(np.searchsorted(moduli_MPa, math.sqrt(low * high)))
    if place == 0:
        return 0, 0
    if place == len(moduli_MPa):
        return place - 1, place - 1
    for grade in (place - 1, place):
        if all(math.isclose(e, moduli_MPa[grade], rel_tol=_SAME) for e in (low, high)):
            return grade, grade
    return place - 1, place


# ------------------------------------------------------------------------------------------------
# How sure the modulus of a blend is.


def blend_interval_MPa(
    scale: StiffnessScale, lower: int, upper: int, modulus_MPa: float, error: float
) -> tuple[float, float]:
    """Return the interval that holds a print's modulus with 95 % probability.

    The materials' errors go together, as everywhere in planning: the wider of their intervals is
    taken, either way, and the relative error of the estimate is added to it.

    Parameters
    ----------
    lower, upper
        Places of the materials from soft to hard.
    """
    ends = [(scale.moduli_MPa[k], *scale.intervals_MPa[k]) for k in (lower, upper)]
    less = max(own / low for own, low, _ in ends) * (1.0 + error)
    more = max(high / own for own, _, high in ends) * (1.0 + error)
    return modulus_MPa / less, modulus_MPa * more


# ------------------------------------------------------------------------------------------------
# Thinner bands of two materials in turn, as a laminate in series along the gradient.


_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)
_THINNEST = 1e-9  # of the field: a share below is none


@dataclass(frozen=True, slots=True)
class Laminate:
    """Two bands, one of either material, or one where the share is 0 or 1.

    Attributes
    ----------
    start, stop
        Field values.
    lower, upper
        Places of the materials from soft to hard.
    share
        Of the length along the field that is of the harder one.
    modulus_MPa
        In series: the harmonic mean.
    target_MPa
        Lowest and highest target within.
    """

    start: float
    stop: float
    lower: int
    upper: int
    share: float
    modulus_MPa: float
    target_MPa: tuple[float, float]


def laminated(
    profile: Profile, along: Sequence[BlendSegment], moduli_MPa: tuple[float, ...], periods: int
) -> tuple[tuple[Band, Laminate | None], ...]:
    """Divide each stretch between two materials into periods that stretch as the target does.

    Under one force a period elongates by the mean of the target's compliance, exactly: the
    materials lie in series. Each period begins with the material that the one before ended with;
    but where the gradient begins and ends lies the material nearer to the target there, because
    fields are held at their ends: beyond a distance of 3 mm, say, all of the part is the last band.

    Returns
    -------
    tuple of (Band, Period)
        Bands along the field, and the period each belongs to; None outside transitions.
    """
    found: list[tuple[Band, Laminate | None]] = []
    for stretch in along:
        if stretch.lower == stretch.upper:
            band = Band(stretch.start, stretch.stop, stretch.lower, stretch.target_MPa)
            found.append((band, None))
            continue
        edges = np.linspace(stretch.start, stretch.stop, periods + 1).tolist()
        edges[-1] = stretch.stop
        middle_MPa = math.sqrt(moduli_MPa[stretch.lower] * moduli_MPa[stretch.upper])
        begins_hard, ends_hard = (end > middle_MPa for end in stretch.ends_MPa)
        for start, stop in itertools.pairwise(edges):
            period = _laminate(profile, stretch, moduli_MPa, start, stop)
            if not found:
                hard_first = begins_hard
            elif stretch is along[-1] and stop == stretch.stop:
                hard_first = not ends_hard
            else:
                hard_first = found[-1][0].grade == stretch.upper
            shares = [(stretch.lower, 1.0 - period.share), (stretch.upper, period.share)]
            if hard_first:
                shares.reverse()
            middle = start + shares[0][1] * (stop - start)
            for (grade, _), low, high in zip(shares, (start, middle), (middle, stop), strict=True):
                if high - low > _THINNEST:
                    found.append((Band(low, high, grade, period.target_MPa), period))
    return tuple(found)


def _laminate(
    profile: Profile,
    stretch: BlendSegment,
    moduli_MPa: tuple[float, ...],
    start: float,
    stop: float,
) -> Laminate:
    # Between knots the target is smooth, and Gauss' rule of 8 nodes exact to rounding.
    knots = [start, *(u for u in profile.positions if start < u < stop), stop]
    compliance = 0.0
    for low, high in itertools.pairwise(knots):
        u = 0.5 * (low + high) + 0.5 * (high - low) * _NODES
        compliance += float(0.5 * (high - low) * (_WEIGHTS @ (1.0 / profile.modulus_MPa(u))))
    soft, hard = moduli_MPa[stretch.lower], moduli_MPa[stretch.upper]
    share = float(reuss_share(soft, hard, compliance / (stop - start)))
    if not _THINNEST < share * (stop - start) < stop - start - _THINNEST:
        share = float(math.floor(share + 0.5))
    return Laminate(
        start,
        stop,
        stretch.lower,
        stretch.upper,
        share,
        float(reuss_MPa(soft, hard, share)),
        profile.interval_MPa(start, stop),
    )


# ------------------------------------------------------------------------------------------------
# What a plan says of bands that take turns.


def with_laminates(
    regions: Sequence[Region], steps: Sequence[tuple[Band, Laminate | None]], scale: StiffnessScale
) -> tuple[Region, ...]:
    """Say of each thin band which period it belongs to, and what that comes to in series."""
    periods = {(band.start, band.stop): period for band, period in steps}
    found = []
    for region in regions:
        period = periods[region.field]
        if period is None or period.share in (0.0, 1.0):
            found.append(region)
            continue
        low, high = period.target_MPa
        blend = {
            "kind": "bands",
            "lower": scale.palette.materials[period.lower].id,
            "upper": scale.palette.materials[period.upper].id,
            "field": [period.start, period.stop],
            "share": period.share,
        }
        found.append(
            replace(
                region,
                modulus_MPa=period.modulus_MPa,
                modulus_interval_MPa=blend_interval_MPa(
                    scale, period.lower, period.upper, period.modulus_MPa, 0.0
                ),
                error=(period.modulus_MPa / high - 1.0, period.modulus_MPa / low - 1.0),
                blend=blend,
            )
        )
    return tuple(found)


# ------------------------------------------------------------------------------------------------
# Bands of true mixtures, for printers that jet them.


_MOST_MIXTURES = 99
"""Each is a file of its own."""

MIXTURES_UNCALIBRATED = (
    "mixtures need a printer that jets them, as {printer} may not; their ratios are not calibrated"
)

_STEP = 1.2  # of the modulus from mixture to mixture: within 10 % of the target


def mixed_bands(
    profile: Profile, scale: StiffnessScale, count: int | None, machine: Printer
) -> tuple[tuple[Band, ...], tuple[Printed, ...]]:
    """Cut where the mixture changes, and say what each band is printed in.

    Parameters
    ----------
    count
        Equal steps of the field; by default steps of the modulus of up to 20 %, both ends of the
        gradient among them.

    Raises
    ------
    ArgumentError
        More than 99 bands.
    """
    if count is None:
        low, high = (
            float(np.clip(end, scale.moduli_MPa[0], scale.moduli_MPa[-1]))
            for end in profile.interval_MPa(0.0, 1.0)
        )
        steps = max(1, math.ceil(math.log(high / low) / math.log(_STEP) - 1e-9))
        ladder = np.geomspace(low, high, steps + 1).tolist() if high > low * 1.001 else [low]
        bands = natural_bands(profile, tuple(ladder))
        moduli = [ladder[band.grade] for band in bands]
    else:
        if count > _MOST_MIXTURES:
            raise ArgumentError(
                f"`blend` mix `bands` {count}: each mixture is a file of its own; up to "
                f"{_MOST_MIXTURES} are possible"
            )
        bands = equal_bands(profile, scale.moduli_MPa, count)
        moduli = [math.sqrt(band.target_MPa[0] * band.target_MPa[1]) for band in bands]
    printed = tuple(mixture(scale, modulus, machine) for modulus in moduli)
    return _merged(bands, printed)


def _merged(
    bands: Sequence[Band], printed: Sequence[Printed]
) -> tuple[tuple[Band, ...], tuple[Printed, ...]]:
    """Join neighbours that come to one mixture, shares being kept to 0.1 %."""
    kept: list[tuple[Band, Printed]] = []
    for band, what in zip(bands, printed, strict=True):
        again = kept and kept[-1][1] == what
        kept.append((kept.pop()[0].joined(band) if again else band, what))
    return tuple(band for band, _ in kept), tuple(what for _, what in kept)
