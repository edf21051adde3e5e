"""Marlow's law: an energy of the first invariant alone that a measured tensile curve fixes."""

from dataclasses import dataclass

import numpy as np

from planner.errors import PaletteError
from planner.materials.laws import FARTHEST, first_invariant, secant_modulus_MPa
from planner.materials.mixtures import CoefficientModel, bracketed, pchip_at, pchip_slopes
from planner.numerics import FloatArray, IntArray

__all__ = ["POISSON", "MarlowTable", "marlow_table", "uniaxial_strain"]


POISSON = 0.49
"""Of every mixture at rest, in solids; rubbers have 0.4999, which makes no visible difference to a
part that bends, rigid grades 0.38 to 0.4, a matter of per cents in what hardly deforms."""


# ------------------------------------------------------------------------------------------------
# The law.
#
# With an isochoric energy W(I1) the nominal stress of a uniaxial test is
#
#     P = 2 W'(I1) (l - l^-2),  I1 = l² + 2 / l,
#
# so that the test gives W' at every I1, and no other mode needs a fit (R. S. Marlow, A general
# first-invariant hyperelastic constitutive model, Constitutive Models for Rubber III, 2003). Where
# the stress of the test rises, shear is stable too, whatever signs a fitted law's terms have.
# Fitted Ogden terms of mixed sign need not be: TangoPlus' cease to resist shear across the pull at
# 68 % tension, before its break at 100 %.
#
# The variable of the tables is x = sqrt(I1 - 3), which is sqrt(3) times the strain of a small test,
# so that stress over x is smooth at rest; W' is kept by its logarithm. Between grades the
# logarithm follows the monotone cubic that planning uses, at nodes close enough to be joined by
# straight lines.

_STRAINS = 1025
_BETWEEN = 16  # nodes from grade to grade: a straight line between is within 1e-4 of the cubic


@dataclass(frozen=True, slots=True, eq=False)
class MarlowTable:
    """W' of every mixture of a palette over x = sqrt(I1 - 3).

    Attributes
    ----------
    coordinate : (K,)
        Nodes, rising evenly from grade to grade.
    step
        Between the values of x, which begin at 0.
    log_slope_MPa : (K, n, 2)
        ln W' in MPa and its derivative over x: cubics between.
    energy_MPa : (K, n)
        W over x²: at rest W'.
    break_strain : (K,)
        Elongation at break, linear between grades.
    """

    coordinate: FloatArray
    step: float
    log_slope_MPa: FloatArray
    energy_MPa: FloatArray
    break_strain: FloatArray

    def places(self, coordinate: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return the node below each coordinate and the share of the way to the next."""
        inside = np.clip(coordinate, self.coordinate[0], self.coordinate[-1])
        below, _, share, _ = bracketed(self.coordinate, inside)
        last = max(len(self.coordinate) - 2, 0)  # at the last node all of the way to it
        return np.minimum(below, last).astype(np.int64), np.where(below > last, 1.0, share)

    def shear_modulus_MPa(self, coordinate: FloatArray) -> FloatArray:
        """Return the shear modulus at rest, 2 W'(3)."""
        rest = np.interp(coordinate, self.coordinate, self.log_slope_MPa[:, 0, 0])
        return np.asarray(2.0 * np.exp(rest))

    def break_at(self, coordinate: FloatArray) -> FloatArray:
        """Return the elongation at break."""
        return np.interp(coordinate, self.coordinate, self.break_strain)


def uniaxial_strain(x: FloatArray) -> FloatArray:
    """Return the strain e >= 0 of an incompressible tensile test with x = sqrt(I1 - 3).

    The stretch l solves l³ - I1 l + 2 = 0, whose three roots are real: by Viète's cosine, its angle
    measured from where it is at rest, so that no digits are lost there.
    """
    third = np.asarray(x, dtype=np.float64) ** 2 / 3.0
    angle = np.arcsin(np.sqrt(-0.5 * np.expm1(-1.5 * np.log1p(third)))) / 1.5
    root = np.sqrt(1.0 + third)
    turned = np.sqrt(3.0) * np.sin(angle) - 2.0 * np.sin(0.5 * angle) ** 2
    return np.asarray(third / (1.0 + root) + root * turned)


def marlow_table(model: CoefficientModel, *, poisson: float = POISSON) -> MarlowTable:
    """Tabulate the law of every mixture of a palette.

    Parameters
    ----------
    poisson
        Poisson's ratio at rest. W' is times 3 / (2 (1 + ν)), so that Young's modulus at rest
        stays that of the palette.

    Raises
    ------
    PaletteError
        A law's stress ceases to rise before its break: no energy of it is stable.
    """
    materials = model.palette.materials
    breaks = model.breaks
    top = FARTHEST * breaks.max()
    x = np.linspace(0.0, np.sqrt(first_invariant(top)), _STRAINS)
    strain = uniaxial_strain(x)
    rows = np.empty((len(materials), len(x)))
    for k, (material, law) in enumerate(zip(materials, model.laws, strict=True)):
        held = np.minimum(strain, FARTHEST * breaks[k])
        secant = secant_modulus_MPa(law, held)
        rising = (np.diff(secant * held) > 0.0) | (strain[1:] > FARTHEST * breaks[k])
        end = len(x) if rising.all() else int(np.argmin(rising)) + 1
        if strain[end - 1] < min(breaks[k], top):
            raise PaletteError(
                f"palette {model.palette.name}: material {material.id!r}: the stress of its law "
                f"ceases to rise at strain {strain[end - 1]:.3g}, before its break at "
                f"{breaks[k]:g}; a solid of it is unstable: give a law that rises"
            )
        wide = (1.0 + held) ** 2 / (2.0 * (3.0 + 3.0 * held + held * held))
        rows[k] = np.log(secant * wide)
        rows[k, end:] = rows[k, end - 1]
    rows += np.log(1.5 / (1.0 + poisson))

    nodes = model.coordinates_between(_BETWEEN)
    lower, upper, t, gap = model.bracketed(nodes)
    bracket = lower, upper, t[:, None], gap[:, None]
    table = pchip_at(rows, pchip_slopes(model.places, rows), bracket)
    step = float(x[1])
    # Slopes of the monotone cubic: no wiggle where a row ends and W' stays.
    log_slope = np.stack([table, pchip_slopes(x, np.ascontiguousarray(table.T)).T], axis=2)
    # The share of a shear's stress that falls: the tables are stable where W' x rises.
    if (falls := np.diff(np.exp(table) * x, axis=1) <= 0.0).any():
        k, i = np.argwhere(falls)[0].tolist()
        raise PaletteError(
            f"palette {model.palette.name}: at coordinate {nodes[k]:.3g} the stress in shear "
            f"ceases to rise at a strain of {strain[i]:.3g}; a solid of it is unstable: give laws "
            "that rise"
        )
    energy, square = np.exp(table), x[1:] ** 2  # W', then W over x²
    # W goes with x²: trapezia of W' over that, in which it is nearly straight.
    area = 0.5 * np.diff(x**2) * (energy[:, 1:] + energy[:, :-1])
    energy[:, 1:] = np.cumsum(area, axis=1) / square
    break_strain = np.interp(nodes, model.coordinates, breaks)
    return MarlowTable(nodes, step, np.ascontiguousarray(log_slope), energy, break_strain)
