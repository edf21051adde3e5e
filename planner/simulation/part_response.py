"""How a whole part answers a motion: its force, and what each of its mixtures has to do with it.

A part of laws P(m, e) stores W = integral of P over the uniaxial strain e that is equivalent at
each of its points. A change of a law at one strain changes the force at a given displacement by

    d ln F = sum_b s_b d ln P(m_b, e_b),    s_b = V_b P(m_b, e_b) (de_b/dd) / F,

to first order, whatever the shape: strains that give way to the change store no more to that
order. The shares s_b add up to 1. So whoever knows force, strains and shares along a motion knows
what any change of the laws does to the force, without solving the part anew.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import msgspec
import numpy as np

from planner.errors import FileError
from planner.formats.files import decode_document, encode_document, read_file
from planner.glance import brief
from planner.numerics import FloatArray, freeze

__all__ = ["PartResponse", "force_factor"]


_WHOLE = 0.02
"""How far shares may be off a sum of 1. Numerical: they come of differences between load steps."""


_ARRAYS = ("displacement_mm", "force_N", "coordinate", "strain", "share")


class _ResponseFile(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    name: str
    displacement_mm: list[float]
    force_N: list[float]
    coordinate: list[float]
    strain: list[list[float]]
    share: list[list[float]]
    thickness_mm: float
    log_sd: float


@dataclass(frozen=True, slots=True, eq=False)
class PartResponse:
    """Force and shares of a part along one motion, at n steps and in B bins of its material.

    Attributes
    ----------
    name
        Of the part.
    displacement_mm, force_N : (n,)
        Mean of the loaded faces along the load, and force along it; rising from above 0.
    coordinate : (B,)
        The mixture of each bin, on the palette's coordinate.
    strain : (n, B)
        Its uniaxial strain of equal energy, 0 and above.
    share : (n, B)
        d ln force / d ln stress of its law there, at the displacement; of all bins 1.
    thickness_mm
        Twice the part's volume over its surface, which of a sheet is the thickness.
    log_sd
        How far the logarithm of all forces may be off: cells, supports.

    Raises
    ------
    FileError
        Lengths that do not agree, a displacement that does not rise from above 0, a force that is
        none, or shares that do not add up to 1.
    """

    name: str
    displacement_mm: FloatArray
    force_N: FloatArray
    coordinate: FloatArray
    strain: FloatArray
    share: FloatArray
    thickness_mm: float
    log_sd: float = 0.02

    __repr__ = brief

    def __post_init__(self) -> None:
        freeze(self, *_ARRAYS)
        steps, bins = self.displacement_mm.shape, self.coordinate.shape
        shapes = (self.force_N.shape, self.strain.shape, self.share.shape)
        problem = None
        if len(steps) != 1 or len(bins) != 1 or shapes != (steps, steps + bins, steps + bins):
            problem = "its columns differ in length"
        elif steps[0] < 2 or bins[0] < 1:
            problem = "it takes two steps or more, and a bin"
        elif not (np.diff(self.displacement_mm, prepend=0.0) > 0.0).all():
            problem = "its displacement does not rise from above 0"
        elif not (self.force_N > 0.0).all():
            problem = "its force is not above 0 along the load"
        elif not (np.isfinite(self.share).all() and (self.strain >= 0.0).all()):
            problem = "a strain is below 0, or a share is no number"
        elif np.abs(self.share.sum(axis=1) - 1.0).max() > _WHOLE:
            problem = "its shares do not add up to 1"
        elif Path(self.name).name != self.name or "\0" in self.name:
            problem = "its name, which a file is called by, holds a path"
        if problem is not None:
            raise FileError(f"response of part {self.name}: {problem}; simulate the part again")

    @property
    def gauge_mm(self) -> float:
        """Length over which the last displacement is the mean strain of what bears the force."""
        strain = float(self.share[-1] @ self.strain[-1])
        return float(self.displacement_mm[-1]) / max(strain, 1e-9)

    def at(self, displacement_mm: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return force (T,), strains and shares (T, B) at displacements, (T,), of 0 and above.

        Before the first step and beyond the last, force and strains go in proportion.
        """
        first, last = self.displacement_mm[[0, -1]]
        over_travel = _curves(self)(np.clip(displacement_mm, first, last))
        stiffness, compliance, share = np.split(over_travel, [1, 1 + len(self.coordinate)], axis=1)
        force = np.asarray(stiffness[:, 0] * displacement_mm)
        return force, compliance * displacement_mm[:, None], share

    def encode(self) -> bytes:
        """Return the response as a file's bytes: what was solved once need not be solved again."""
        arrays = {name: getattr(self, name).tolist() for name in _ARRAYS}
        figures = {"thickness_mm": self.thickness_mm, "log_sd": self.log_sd}
        return encode_document({"name": self.name, **arrays, **figures})

    @classmethod
    def read(cls, path: Path) -> "PartResponse":
        """Read a response as `encode` wrote it.

        Raises
        ------
        FileError
            The file cannot be read, or is no response.
        """
        file = decode_document(read_file(path), _ResponseFile, str(path))
        return cls(**msgspec.structs.asdict(file))


@lru_cache(maxsize=256)
def _curves(response: PartResponse) -> Callable[[FloatArray], FloatArray]:
    """Return force and strains over the displacement, and shares; all smooth at rest."""
    from scipy.interpolate import PchipInterpolator  # of a whole part alone: slow to import

    d = response.displacement_mm
    over = [response.force_N[:, None] / d[:, None], response.strain / d[:, None], response.share]
    return PchipInterpolator(d, np.concatenate(over, axis=1))


_TAKEN = 0.25
"""Ratio of stresses from which down forces are added, and not their logarithms. Chosen: no change
of a law on the way up takes three quarters; on the way back, where softened or relaxed material
bears nothing or pushes, there is no logarithm."""


def force_factor(ratio: FloatArray, share: FloatArray) -> FloatArray:
    """Return what a part's force is multiplied by, (...), where stresses are by ratios, (..., B).

    First order in logarithms: between material side by side, whose stresses add up, and material
    in series, whose compliances do. Ratios that are all alike are the factor.
    """
    above = np.maximum(ratio, _TAKEN)
    mean = np.sum(share * (np.log(above / _TAKEN) + (ratio - above) / _TAKEN), axis=-1)
    return np.asarray(_TAKEN * np.where(mean > 0.0, np.exp(mean), 1.0 + mean))
