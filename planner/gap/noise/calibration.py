"""What the palette's own laws may be off by: columns of the figures, each of prior deviation 1.

Every grade's level and course are uncertain, and so is what lies between grades. The columns are
the forward model's own derivatives, so that a graded bar feels its grades as it should.
"""

import itertools

import numpy as np

from planner.arrays import FloatArray
from planner.gap.forward import Setup
from planner.palette import Palette

__all__ = ["Calibration", "calibration_columns", "calibrations"]

UNKNOWN_LOG_SD = 0.05
"""Of a grade's modulus where the palette does not say."""

TILT_SD = 0.01
"""Of the logarithm of stress, from small strains to large ones: laws follow their tests to 1 %."""

BETWEEN_SD = 0.03
"""Of the logarithm of stress half-way between two grades: nobody measured it."""

_STEP = 0.02


class Calibration:
    """One way in which the palette may be off.

    Attributes
    ----------
    material
        Its id, "" between two grades.
    kind
        "level", "tilt" or "between".
    sd
        Of its size.
    """

    __slots__ = ("kind", "material", "sd", "weight")

    def __init__(self, material: str, kind: str, sd: float, weight: FloatArray) -> None:
        self.material, self.kind, self.sd, self.weight = material, kind, sd, weight

    def applied(self, setup: Setup, size: float) -> Setup:
        """Return the setup with the laws off by `size`."""
        if self.kind == "tilt":
            return setup.with_(log_tilt=setup.log_tilt + size * self.weight)
        return setup.stiffened(size * self.weight)


def calibrations(palette: Palette, setup: Setup) -> tuple[Calibration, ...]:
    """Return the ways that matter to a setup: of grades and gaps between grades that it holds."""
    at = np.array([m.coordinate for m in palette.materials])
    where = np.clip(setup.coordinate, at[0], at[-1])
    found = []
    for k, material in enumerate(palette.materials):
        hat = np.interp(where, at, np.eye(len(at))[k])
        if hat.max() > 0.0:
            sd = material.modulus_log_sd or UNKNOWN_LOG_SD
            found.append(Calibration(material.id, "level", sd, hat))
            found.append(Calibration(material.id, "tilt", TILT_SD, hat))
    for low, high in itertools.pairwise(at):
        t = np.clip((where - low) / (high - low), 0.0, 1.0)
        bump = 4.0 * t * (1.0 - t)
        if bump.max() > 0.01:
            found.append(Calibration("", "between", BETWEEN_SD, bump))
    return tuple(found)


def calibration_columns(
    ways: tuple[Calibration, ...], shifted: FloatArray, unshifted: FloatArray
) -> FloatArray:
    """Return the columns, (N, q), from the figures of setups shifted by `step`.

    Parameters
    ----------
    shifted : (q, N)
        Figures of ``way.applied(setup, step(way))``.
    unshifted : (N,)
    """
    sizes = np.array([way.sd / step(way) for way in ways])
    return np.ascontiguousarray(((shifted - unshifted) * sizes[:, None]).T)


def step(way: Calibration) -> float:
    """Return the size that a way is tried with."""
    return _STEP
