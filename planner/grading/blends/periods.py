"""Thinner bands of two materials in turn, as a laminate in series along the gradient."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.grading.bands import Band
from planner.grading.blends.stretches import Stretch
from planner.grading.profile import Profile
from planner.materials.homogenisation.bounds import reuss_MPa, reuss_share

__all__ = ["Period", "laminated"]

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)
_THINNEST = 1e-9  # of the field: a share below is none


@dataclass(frozen=True, slots=True)
class Period:
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
    profile: Profile, along: Sequence[Stretch], moduli_MPa: tuple[float, ...], periods: int
) -> tuple[tuple[Band, Period | None], ...]:
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
    found: list[tuple[Band, Period | None]] = []
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
            period = _period(profile, stretch, moduli_MPa, start, stop)
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


def _period(
    profile: Profile, stretch: Stretch, moduli_MPa: tuple[float, ...], start: float, stop: float
) -> Period:
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
    return Period(
        start,
        stop,
        stretch.lower,
        stretch.upper,
        share,
        float(reuss_MPa(soft, hard, share)),
        profile.interval_MPa(start, stop),
    )
