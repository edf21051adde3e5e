"""Stiffness between a palette's grades, and the grade or blend that has a wanted one."""

import itertools
from dataclasses import dataclass, field
from statistics import NormalDist

import numpy as np
from numpy.typing import ArrayLike

from planner.errors import ArgumentError, PaletteError
from planner.materials.laws import Law, make_law, positive_stretch, secant_modulus_MPa
from planner.numerics import FloatArray, IntArray
from planner.palette import Palette

__all__ = [
    "Blend",
    "CoefficientModel",
    "blend_for",
    "coordinate_for",
    "nearest",
    "nearest_on",
    "thresholds_of",
]


# ------------------------------------------------------------------------------------------------
# Stiffness at any coordinate of a palette, between its catalogue grades too.
#
# Between neighbours a and b the logarithm of the nominal stress is linear in the coordinate,
# P = Pa^(1-t) Pb^t with t = (m - ma)/(mb - ma). Hence a blend is stress-free at rest, increases
# with stretch, is exact at the grades and stiffens with m at every strain; its inverse is closed.
# It is also the posterior mean of ln P as a Wiener process in m known at the grades, which gives
# the interval: a Brownian bridge between grades that are themselves uncertain.


_LADDER_STRAINS = 201


@dataclass(frozen=True, slots=True)
class CoefficientModel:
    """The consistent law of every mixture of a palette.

    Coordinates and strains are numbers or arrays that broadcast; results have their shape.

    Attributes
    ----------
    laws
        Of the catalogue grades, from soft to hard.
    strain_limit
        Smallest elongation at break of the elastic grades (of all, if none is elastic): the
        working strains, over which stiffness is known to rise with the coordinate.

    Raises
    ------
    PaletteError
        The stiffness does not rise strictly from grade to grade at some working strain, is not
        positive there, or a law is not stress-free at rest.
    """

    palette: Palette
    laws: tuple[Law, ...] = field(init=False)
    strain_limit: float = field(init=False)

    def __post_init__(self) -> None:
        materials = self.palette.materials
        elastic = [m for m in materials if m.deformation == "elastic"] or materials
        limit = min(m.elongation_at_break for m in elastic)
        for material in materials:
            if material.law.model == "ogden-thesis":
                raise PaletteError(
                    f"palette {self.palette.name}: material {material.id!r}: law: "
                    f"{material.law.model} is not stress-free at rest; give it under 'published' "
                    "and a stress-free law here"
                )
        object.__setattr__(self, "laws", tuple(make_law(m.law) for m in materials))
        object.__setattr__(self, "strain_limit", limit)
        _check_ladder(self)

    @property
    def coordinates(self) -> FloatArray:
        """Coordinates of the grades, strictly rising."""
        return np.array([m.coordinate for m in self.palette.materials])

    def grade_moduli_MPa(self, at_strain: ArrayLike) -> FloatArray:
        """Return the secant moduli of the grades: one row a grade, soft to hard."""
        return np.stack([secant_modulus_MPa(law, at_strain) for law in self.laws])

    def modulus_MPa(self, coordinate: ArrayLike, at_strain: ArrayLike) -> FloatArray:
        """Return the secant modulus of the nominal stress.

        Raises
        ------
        ArgumentError
            A coordinate outside the palette, or a strain not above -1.
        """
        lower, upper, t = self.bracket(coordinate)
        strain = np.asarray(at_strain, dtype=np.float64)
        softer = self._grade_modulus_MPa(lower, strain)
        harder = self._grade_modulus_MPa(upper, strain)
        return softer ** (1.0 - t) * harder**t

    def nominal_stress_MPa(self, coordinate: ArrayLike, stretch: ArrayLike) -> FloatArray:
        """Return the nominal stress.

        Raises
        ------
        ArgumentError
            A coordinate outside the palette, or a stretch not above 0.
        """
        strain = positive_stretch(stretch) - 1.0
        return self.modulus_MPa(coordinate, strain) * strain

    def modulus_interval_MPa(
        self, coordinate: ArrayLike, at_strain: ArrayLike, level: float = 0.95
    ) -> tuple[FloatArray, FloatArray]:
        """Return the interval that holds a print's modulus with probability `level`.

        ln(modulus) is normal about the model's, with variance
        ((1-t) sa + t sb)² + σ² (mb - ma) t (1-t): the grades' own `Material.modulus_log_sd`, and
        the bridge of a Wiener process whose σ the palette's grades give when each in turn is
        left out and predicted from its neighbours. Neighbours' errors are taken to go together
        (one source, one lab, one reading), so that they do not average out between: at a grade
        the interval is its own, between grades it is wider than their mean.

        Raises
        ------
        ArgumentError
            As `modulus_MPa`, or a level not between 0 and 1.
        """
        if not 0.0 < level < 1.0:
            raise ArgumentError(f"level {level:g}: it must be between 0 and 1")
        log_sd = self.log_sd(coordinate, self.wiener_variance(at_strain))
        factor = np.exp(NormalDist().inv_cdf(0.5 + level / 2.0) * log_sd)
        modulus = self.modulus_MPa(coordinate, at_strain)
        return modulus / factor, modulus * factor

    def log_sd(self, coordinate: ArrayLike, wiener_variance: ArrayLike) -> FloatArray:
        """Return the standard deviation of ln(modulus), where σ² is `wiener_variance`."""
        lower, upper, t = self.bracket(coordinate)
        own = np.array([m.modulus_log_sd for m in self.palette.materials])
        gap = self.coordinates[upper] - self.coordinates[lower]
        bridge = np.asarray(wiener_variance) * gap * t * (1.0 - t)
        return np.asarray(np.sqrt(((1.0 - t) * own[lower] + t * own[upper]) ** 2 + bridge))

    def wiener_variance(self, at_strain: ArrayLike) -> FloatArray:
        """Return σ², the variance of ln(modulus) a unit of coordinate, at a strain.

        The mean square of the leave-one-grade-out residuals, each over the variance that a
        bridge of σ = 1 has there. The grades' own scatter is not taken off, so σ errs on the
        wide side. Two grades leave nothing out: then σ² is that of the one step. One has none.
        """
        log_moduli = np.log(self.grade_moduli_MPa(at_strain))
        steps = np.diff(log_moduli, axis=0)
        gaps = np.diff(self.coordinates).reshape(-1, *(1,) * (steps.ndim - 1))
        if len(steps) < 2:
            return np.asarray(np.sum(steps**2 / gaps, axis=0))
        before, after = gaps[:-1], gaps[1:]
        residuals = (steps[:-1] * after - steps[1:] * before) / (before + after)
        return np.asarray(np.mean(residuals**2 * (before + after) / (before * after), axis=0))

    def bracket(self, coordinate: ArrayLike) -> tuple[IntArray, IntArray, FloatArray]:
        """Return the grades below and above, and how far between them, 0..1.

        At a grade the fraction is 0; at the last one both are it.

        Raises
        ------
        ArgumentError
            A coordinate outside the palette.
        """
        m = np.asarray(coordinate, dtype=np.float64)
        c = self.coordinates
        allowed = (m >= c[0]) & (m <= c[-1])
        if not allowed.all():
            raise ArgumentError(
                f"coordinate {m[~allowed].flat[0]:g}: palette {self.palette.name} goes from "
                f"{c[0]:g} to {c[-1]:g}"
            )
        lower = np.asarray(np.searchsorted(c, m, side="right") - 1)
        upper = np.minimum(lower + 1, len(c) - 1)
        gap = np.where(upper > lower, c[upper] - c[lower], 1.0)
        return lower, upper, np.asarray((m - c[lower]) / gap)

    def _grade_modulus_MPa(self, grade: IntArray, strain: FloatArray) -> FloatArray:
        """Return the secant modulus of grades by their place; both broadcast."""
        if strain.ndim == 0:
            return self.grade_moduli_MPa(strain)[grade]
        grade, strain = np.broadcast_arrays(grade, strain)
        result = np.empty(grade.shape)
        for k in np.unique(grade):
            here = grade == k
            result[here] = secant_modulus_MPa(self.laws[k], strain[here])
        return result


def _check_ladder(model: CoefficientModel) -> None:
    name, materials = model.palette.name, model.palette.materials
    strains = np.linspace(0.0, model.strain_limit, _LADDER_STRAINS)
    moduli = model.grade_moduli_MPa(strains)
    for material, row in zip(materials, moduli, strict=True):
        bad = ~((row > 0.0) & np.isfinite(row))
        if bad.any():
            raise PaletteError(
                f"palette {name}: material {material.id!r}: law: the secant modulus is "
                f"{row[bad][0]:g} MPa at strain {strains[bad][0]:g}; it must be above 0 at all "
                f"working strains, 0 to {model.strain_limit:g}"
            )
    for (i, softer), (j, harder) in itertools.pairwise(enumerate(materials)):
        bad = moduli[i] >= moduli[j]
        if bad.any():
            raise PaletteError(
                f"palette {name}: {harder.id} ({moduli[j][bad][0]:.4g} MPa) is not stiffer than "
                f"{softer.id} ({moduli[i][bad][0]:.4g} MPa) at strain {strains[bad][0]:g}; "
                f"stiffness must rise with the coordinate at all working strains, 0 to "
                f"{model.strain_limit:g}: reorder the materials or correct a law"
            )


# ------------------------------------------------------------------------------------------------
# From a wanted stiffness back to a coordinate, a grade or a blend of two.
#
# All at one working strain. Moduli outside the palette's range are clamped to it.


@dataclass(frozen=True, slots=True)
class Blend:
    """What stands at one coordinate: `fraction` of the way from grade `lower` to `upper`.

    Attributes
    ----------
    lower, upper
        Ids of materials; the same, with fraction 0, at a catalogue grade.
    """

    lower: str
    upper: str
    fraction: float
    coordinate: float


def thresholds_of(ladder_MPa: ArrayLike) -> FloatArray:
    """Return the geometric means of neighbours on a ladder of rising moduli."""
    moduli = np.asarray(ladder_MPa, dtype=np.float64)
    return np.sqrt(moduli[:-1] * moduli[1:])


def nearest_on(ladder_MPa: ArrayLike, modulus_MPa: ArrayLike) -> IntArray:
    """Return the rung nearest in log stiffness on a ladder of rising moduli; see `nearest`."""
    thresholds = thresholds_of(ladder_MPa)
    return np.asarray(np.searchsorted(thresholds, _positive(modulus_MPa), side="left"))


def nearest(model: CoefficientModel, modulus_MPa: ArrayLike, at_strain: float) -> IntArray:
    """Return the place of the grade nearest in log stiffness; a tie goes to the softer.

    Raises
    ------
    ArgumentError
        A modulus is not above 0, or the strain not a working strain.
    """
    return nearest_on(_ladder_MPa(model, at_strain), modulus_MPa)


def coordinate_for(model: CoefficientModel, modulus_MPa: ArrayLike, at_strain: float) -> FloatArray:
    """Return the coordinate whose secant modulus is wanted, clamped to the palette.

    The exact inverse of `CoefficientModel.modulus_MPa` within the range.

    Raises
    ------
    ArgumentError
        As `nearest`.
    """
    ladder, c = _ladder_MPa(model, at_strain), model.coordinates
    target = np.clip(_positive(modulus_MPa), ladder[0], ladder[-1])
    lower = np.searchsorted(ladder, target, side="right") - 1
    upper = np.minimum(lower + 1, len(c) - 1)
    step = np.where(upper > lower, np.log(ladder[upper] / ladder[lower]), 1.0)
    t = np.log(target / ladder[lower]) / step
    return np.minimum(c[lower] + t * (c[upper] - c[lower]), c[upper])


def blend_for(model: CoefficientModel, modulus_MPa: float, at_strain: float) -> Blend:
    """Return the blend whose secant modulus is wanted, clamped to the palette.

    Raises
    ------
    ArgumentError
        As `nearest`.
    """
    coordinate = float(coordinate_for(model, float(modulus_MPa), at_strain))
    lower, upper, t = model.bracket(coordinate)
    ids = [material.id for material in model.palette.materials]
    return Blend(ids[int(lower)], ids[int(upper if t > 0.0 else lower)], float(t), coordinate)


def _ladder_MPa(model: CoefficientModel, at_strain: float) -> FloatArray:
    if not 0.0 <= at_strain <= model.strain_limit:
        raise ArgumentError(
            f"strain {at_strain:g}: the working strain must be from 0 to {model.strain_limit:g}, "
            f"where the first elastic material of palette {model.palette.name} breaks"
        )
    return model.grade_moduli_MPa(at_strain)


def _positive(modulus_MPa: ArrayLike) -> FloatArray:
    modulus = np.asarray(modulus_MPa, dtype=np.float64)
    allowed = (modulus > 0.0) & (modulus < np.inf)
    if not allowed.all():
        raise ArgumentError(
            f"modulus {modulus[~allowed].flat[0]:g} MPa: it must be above 0 and finite"
        )
    return modulus
