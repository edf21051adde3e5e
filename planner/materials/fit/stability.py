"""Drucker's postulate in tension: the stress of a law must rise with the stretch."""

from dataclasses import dataclass

import numpy as np

from planner.materials.fit.law_fit import LawFit, law_stress_MPa

__all__ = ["MARGIN", "Stability", "stability"]

MARGIN = 0.1
"""Share of the working strain that the law must hold beyond each end of the working range."""

POINTS = 801


@dataclass(frozen=True, slots=True)
class Stability:
    """Where a law's nominal stress rises.

    Attributes
    ----------
    stable
        Over the whole range, margins included.
    strain
        The first strain at which it does not, seen from rest; None where stable.
    checked
        The strains from and to which it was checked.
    """

    stable: bool
    strain: float | None
    checked: tuple[float, float]


def stability(fit: LawFit, working_strain: float, margin: float = MARGIN) -> Stability:
    """Check that nominal stress rises with stretch, and is zero at rest and positive in tension.

    For an incompressible law in uniaxial tension dP/dl > 0 with P >= 0 is more than Drucker's
    d(tau)/d(ln l) > 0, for tau = l P.

    Parameters
    ----------
    working_strain
        The working range is from rest to this strain; it is checked from ``-margin`` times it
        (not below ``-margin``) to ``1 + margin`` times it.
    """
    low, high = -margin * min(working_strain, 1.0), (1.0 + margin) * working_strain
    strain = np.linspace(low, high, POINTS)
    rises = np.diff(law_stress_MPa(fit.law, fit.a, fit.c, 1.0 + strain)) > 0.0
    middle = 0.5 * (strain[1:] + strain[:-1])
    falling = middle[~rises]
    first = float(falling[np.argmin(np.abs(falling))]) if len(falling) else None
    return Stability(first is None, first, (low, high))
