"""What a design is to reach, and what it must keep: targets and limits, as a user writes them."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from planner.errors import ArgumentError, did_you_mean
from planner.formats.tables import finite_number, read_records, unit_factor
from planner.numerics import FloatArray, Point
from planner.simulation.loads import refuse_held

if TYPE_CHECKING:
    from planner.simulation.loads import Conditions
    from planner.simulation.solid import Equilibrium, Mechanics

__all__ = [
    "Functional",
    "Limits",
    "Target",
    "functionals",
    "read_limits",
    "read_target",
]


@dataclass(frozen=True)
class Target:
    """One figure that a load case is to come to.

    Attributes
    ----------
    text
        As it was written.
    selector
        Faces whose mean displacement, force or stiffness it is.
    quantity
        ``ux``, ``uy``, ``uz`` (mm), ``fx``, ``fy``, ``fz`` (N, of a support) or ``stiffness``
        (N/mm, of a force or of a support that moves).
    value
        In the unit of its quantity.
    points_mm, moves_mm
        Of a shape: places at rest and where each is to move by, (n, 3); there the design comes as
        near as it can.
    """

    text: str
    selector: str = ""
    quantity: str = ""
    value: float = 0.0
    points_mm: tuple[Point, ...] = ()
    moves_mm: tuple[Point, ...] = ()


@dataclass(frozen=True)
class Limits:
    """What every design keeps.

    Attributes
    ----------
    strain_over_break
        Largest principal strain over the elongation at break, averaged over neighbouring cells.
    slope
        Largest change of ln(modulus) per mm along an axis; of another field, per unit of the field.
    """

    strain_over_break: float | None = None
    slope: float | None = None


_UNITS = {"u": ("length", "mm"), "f": ("force", "N")}
_QUANTITIES = ("ux", "uy", "uz", "fx", "fy", "fz", "stiffness")
_TARGET = re.compile(
    r"(.+?)\s+([a-z]+)\s*=\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)\s*(\S.*)?", re.IGNORECASE
)


def read_target(text: str) -> Target:
    """Read ``SELECTOR QUANTITY=VALUE UNIT``, or ``shape: FILE.csv``.

    Raises
    ------
    ArgumentError
        It is neither; a quantity or a unit is unknown.
    FileError
        The file of a shape cannot be read, or a row breaks the rules.
    """
    if text.casefold().startswith("shape:"):
        return _shape(text)
    found = _TARGET.fullmatch(text.strip())
    where = f"`target` {text}"
    if found is None:
        raise ArgumentError(
            f"{where}: it must be SELECTOR QUANTITY=VALUE UNIT, as in 'x=min uz=-12 mm', or "
            "shape: FILE.csv"
        )
    selector, quantity, value, unit = found[1], found[2].casefold(), float(found[3]), found[4]
    if quantity not in _QUANTITIES:
        hint = did_you_mean(quantity, _QUANTITIES)
        raise ArgumentError(
            f"{where}: no such quantity {quantity!r}; {hint}there are {', '.join(_QUANTITIES)}"
        )
    if not unit:
        raise ArgumentError(
            f"{where}: the unit is missing; displacements (ux) are in mm, forces (fx) in N and "
            "stiffness in N/mm"
        )
    if quantity == "stiffness":
        force, slash, length = unit.partition("/")
        if not slash:
            raise ArgumentError(f"{where}: {unit!r} is no stiffness; write N/mm or mN/mm")
        factor = unit_factor("force", force, where=where) / unit_factor(
            "length", length, where=where
        )
        if value <= 0.0:
            raise ArgumentError(f"{where}: a stiffness must be above 0")
    else:
        factor = unit_factor(_UNITS[quantity[0]][0], unit, where=where)
    return Target(text, selector.strip(), quantity, factor * value)


_SHAPE_COLUMNS = ("x_mm", "y_mm", "z_mm", "ux_mm", "uy_mm", "uz_mm")
_MOST_POINTS = 30
"""Each costs three solutions an evaluation; ten to twenty tell a shape."""


def _shape(text: str) -> Target:
    path = Path(text.partition(":")[2].strip())
    columns, rows = read_records(path, "shape")
    missing = [name for name in _SHAPE_COLUMNS if name not in columns]
    if missing:
        raise ArgumentError(
            f"`target` {text}: column {missing[0]} is missing; it needs "
            f"{', '.join(_SHAPE_COLUMNS)}: places at rest, and how far each is to move"
        )
    values = [
        [finite_number(row.get(name), f"{where}: {name}") for name in _SHAPE_COLUMNS]
        for where, row in rows
    ]
    if not 1 <= len(values) <= _MOST_POINTS:
        raise ArgumentError(
            f"`target` {text}: {len(values)} points; a shape takes 1 to {_MOST_POINTS}"
        )
    return Target(
        text,
        points_mm=tuple((x, y, z) for x, y, z, *_ in values),
        moves_mm=tuple((u, v, w) for *_, u, v, w in values),
    )


_LIMIT = re.compile(
    r"(strain/break|slope)\s*<=?\s*([-+]?(?:\d+\.?\d*|\.\d+))\s*(?:/\s*mm)?", re.IGNORECASE
)


def read_limits(texts: Sequence[str]) -> Limits:
    """Read ``strain/break<0.5`` and ``slope<0.1 /mm``.

    Raises
    ------
    ArgumentError
        Another text, or a limit that is not above 0.
    """
    held: dict[str, float] = {}
    for text in texts:
        found = _LIMIT.fullmatch(text.strip())
        if found is None:
            raise ArgumentError(
                f"`limit` {text}: there are strain/break<0.5 (largest strain over elongation at "
                "break) and slope<0.1 /mm (change of ln(modulus) a mm)"
            )
        if float(found[2]) <= 0.0:
            raise ArgumentError(f"`limit` {text}: it must be above 0")
        held[found[1].casefold()] = float(found[2])
    return Limits(held.get("strain/break"), held.get("slope"))


# ------------------------------------------------------------------------------------------------
# What a target asks of an equilibrium.


class Functional(NamedTuple):
    """A figure of an equilibrium that is linear in the displacements.

    Attributes
    ----------
    text
        What it is, with its unit.
    wanted, unit
        The figure wanted.
    scale
        A deviation that counts as whole, where `wanted` is 0.
    hard
        Whether it is to be met; else the design comes as near as it can.
    weights : callable
        Of `Mechanics`: nodal weights (N, 3), and what is to be added.
    """

    text: str
    wanted: float
    unit: str
    scale: float
    hard: bool
    weights: Callable[["Mechanics"], tuple[FloatArray, float]]

    def value(self, mechanics: "Mechanics", state: "Equilibrium") -> float:
        """Return the figure."""
        weights, constant = self.weights(mechanics)
        return float(np.sum(weights * state.displacement_mm)) + constant


def functionals(
    targets: Sequence[Target], conditions: "Conditions", size_mm: float
) -> list[Functional]:
    """Return what targets ask of equilibria under conditions.

    Parameters
    ----------
    conditions
        Whose watched faces are those of the targets' selectors.
    size_mm
        Of the part: a displacement of a hundredth of it counts as whole.

    Raises
    ------
    ArgumentError
        A stiffness or a force of faces without a load or support; a displacement of faces that
        supports hold along it.
    """
    out: list[Functional] = []
    facets_of = {watched.selector: watched.facets for watched in conditions.watched}
    for target in targets:
        if target.points_mm:
            out += _shape_functionals(target, size_mm)
            continue
        facets = facets_of[target.selector]
        axis = "xyz".find(target.quantity[-1]) if target.quantity != "stiffness" else -1
        if target.quantity.startswith("u"):
            refuse_held(f"`target` {target.text}", facets, [axis], conditions.supports)
            out.append(
                Functional(
                    target.text, target.value, "mm", 0.01 * size_mm, True,
                    _mean(facets, np.eye(3)[axis]),
                )
            )  # fmt: skip
            continue
        out.append(_of_loads(target, facets, axis, conditions))
    return out


def _mean(facets: Any, direction: FloatArray) -> Callable[["Mechanics"], tuple[FloatArray, float]]:
    def weights(mechanics: "Mechanics") -> tuple[FloatArray, float]:
        return mechanics.mean_weights(mechanics.points_of(facets), direction), 0.0

    return weights


def _of_loads(target: Target, facets: Any, axis: int, conditions: "Conditions") -> Functional:
    where = f"`target` {target.text}"
    for force in conditions.forces:
        if target.quantity == "stiffness" and np.array_equal(force.facets, facets):
            given = np.array(force.force_N)
            size = float(np.linalg.norm(given))
            return Functional(
                target.text, size / target.value, "mm", 1.0, True, _mean(facets, given / size)
            )
    for number, support in enumerate(conditions.supports):
        if not np.array_equal(support.facets, facets):
            continue
        moved = np.array([d or 0.0 for d in support.displacement_mm])
        travel = float(np.linalg.norm(moved))
        if target.quantity == "stiffness" and not travel:
            break
        direction = moved / travel if target.quantity == "stiffness" else np.eye(3)[axis]
        wanted = target.value * travel if target.quantity == "stiffness" else target.value

        def weights(
            mechanics: "Mechanics", number: int = number, direction: FloatArray = direction
        ) -> tuple[FloatArray, float]:
            held = mechanics.held[number]
            constant = float(held.stiffness.sum() * (held.axes * held.target_mm) @ direction)
            return mechanics.reaction_weights(number, direction), constant

        return Functional(target.text, wanted, "N", 1.0, True, weights)
    raise ArgumentError(
        f"{where}: no load or support is on exactly these faces; a stiffness is that of a `load` "
        "or of a `move`, a force that of a `fix` or a `move`, with the same selector"
    )


def _shape_functionals(target: Target, size_mm: float) -> list[Functional]:
    out = []
    for number, (place, move) in enumerate(zip(target.points_mm, target.moves_mm, strict=True)):
        for axis in range(3):

            def weights(
                mechanics: "Mechanics", place: Point = place, axis: int = axis
            ) -> tuple[FloatArray, float]:
                return mechanics.place_weights(np.array(place), np.eye(3)[axis]), 0.0

            out.append(
                Functional(
                    f"{target.text}, point {number + 1}, u{'xyz'[axis]}", move[axis], "mm",
                    0.01 * size_mm, False, weights,
                )
            )  # fmt: skip
    return out
