"""What a design is to reach, and what it must keep: targets and limits, as a user writes them."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from planner.errors import ArgumentError, check_known
from planner.formats.mesh_file import read_mesh
from planner.formats.tables import read_columns
from planner.formats.units import unit_factor
from planner.mesh.mesh import Mesh
from planner.numerics import FloatArray, Point
from planner.simulation.loads import LoadCase, read_conditions

if TYPE_CHECKING:
    from planner.simulation.loads import Conditions
    from planner.simulation.solid import Equilibrium, Mechanics

__all__ = ["Functional", "Limits", "Target", "posed"]


@dataclass(frozen=True, eq=False)
class Target:
    """One figure that a load case is to come to, or to keep below or above.

    Attributes
    ----------
    text
        As it was written.
    selector
        Faces whose mean displacement, force or stiffness it is; of a shape, faces that count.
    quantity
        ``ux``, ``uy``, ``uz`` (mm), ``rx``, ``ry``, ``rz`` (degrees that the faces turn about the
        axis), ``distance`` (mm, from `selector` to `other`), ``fx``, ``fy``, ``fz`` (N, of a
        support) or ``stiffness`` (N/mm, of a force or of a support that moves).
    value
        In the unit of its quantity.
    other
        Of a distance: the faces at its other end.
    sense
        ``=`` of a target; ``<`` or ``>`` of a limit, which is on the figure without its sign.
    weight
        Of its miss, beside others' that it stands against.
    points_mm, moves_mm
        Of a shape by points: places at rest and where each is to move by, (n, 3); there the design
        comes as near as it can.
    surface_mm : (k, 3, 3)
        Of a shape by a surface: its triangles, where they are wanted.
    """

    text: str
    selector: str = ""
    quantity: str = ""
    value: float = 0.0
    other: str = ""
    sense: str = "="
    weight: float = 1.0
    points_mm: tuple[Point, ...] = ()
    moves_mm: tuple[Point, ...] = ()
    surface_mm: FloatArray | None = None

    @property
    def selectors(self) -> list[str]:
        """Faces that it is about."""
        return [text for text in (self.selector, self.other) if text]

    @classmethod
    def read(cls, text: str, option: str = "target") -> "Target":
        """Read ``SELECTOR QUANTITY=VALUE UNIT``, ``shape: FILE.csv`` or ``shape: FILE.stl``.

        Behind each may stand ``weight 2``; of a limit, ``<`` or ``>`` stands in place of ``=``.

        Raises
        ------
        ArgumentError
            It is neither; a quantity or a unit is unknown.
        FileError
            The file of a shape cannot be read, or a row breaks the rules.
        """
        where, bare, weight = f"`{option}` {text}", text.strip(), 1.0
        if weighed := _WEIGHT.fullmatch(bare):
            bare, weight = weighed[1].strip(), float(weighed[2])
            if weight <= 0.0:
                raise ArgumentError(f"{where}: a weight must be above 0")
        if bare.casefold().startswith("shape:") and option == "target":
            return replace(_shape(text, bare), weight=weight)
        found, signs = _TARGET.fullmatch(bare), "=" if option == "target" else "<>"
        if found is None or found[3] not in signs:
            raise ArgumentError(
                f"{where}: it must be SELECTOR QUANTITY=VALUE UNIT, as in 'x=min uz=-12 mm', or "
                "shape: FILE (points as .csv, or a surface)"
                if option == "target"
                else f"{where}: there are strain/break<0.5 (largest strain over elongation at "
                "break), slope<0.1 /mm (change of ln(modulus) a mm), and figures of faces, as "
                "x=min uy<1 mm"
            )
        selector, quantity, value, unit = found[1], found[2].casefold(), float(found[4]), found[5]
        said = f"{where}: no such quantity {quantity!r}; {{}}there are"
        check_known(quantity, _QUANTITIES, said)
        if not unit:
            raise ArgumentError(
                f"{where}: the unit is missing; displacements (ux) are in mm, turns (ry) in deg, "
                "forces (fx) in N and stiffness in N/mm"
            )
        if quantity == "stiffness":
            force, slash, length = unit.partition("/")
            if not slash:
                raise ArgumentError(f"{where}: {unit!r} is no stiffness; write N/mm or mN/mm")
            newtons = unit_factor("force", force, where=where)
            factor = newtons / unit_factor("length", length, where=where)
            if value <= 0.0:
                raise ArgumentError(f"{where}: a stiffness must be above 0")
        elif quantity[0] == "r":
            factor = {"deg": 1.0, "°": 1.0, "rad": float(np.degrees(1.0))}.get(unit.strip(), 0.0)
            if not factor:
                raise ArgumentError(
                    f"{where}: {unit!r} is no unit of a turn; there are deg and rad"
                )
            if abs(factor * value) >= 180.0:
                raise ArgumentError(f"{where}: a turn must be below 180 deg")
        else:
            factor = unit_factor("force" if quantity[0] == "f" else "length", unit, where=where)
        places = _BETWEEN.split(selector.strip()) if quantity == "distance" else [selector.strip()]
        if quantity == "distance" and (len(places) != 2 or value <= 0.0):
            raise ArgumentError(
                f"{where}: a distance is between two places and above 0: "
                "'z=max to z=min distance=12 mm'"
            )
        if found[3] != "=" and (quantity == "stiffness" or value <= 0.0):
            raise ArgumentError(
                f"{where}: a limit is on ux, rx, fx or a distance, on the figure without its sign, "
                "and above 0"
            )
        other = places[1] if len(places) == 2 else ""
        return cls(text, places[0], quantity, factor * value, other, found[3], weight)


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

    @classmethod
    def read(cls, texts: Sequence[str]) -> tuple["Limits", list[Target]]:
        """Read ``strain/break<0.5`` and ``slope<0.1 /mm``, and figures such as ``x=min uy<1 mm``.

        Raises
        ------
        ArgumentError
            Another text, or a limit that is not above 0.
        """
        held: dict[str, float] = {}
        figures = []
        for text in texts:
            found = _LIMIT.fullmatch(text.strip())
            if found is None:
                figures.append(Target.read(text, "limit"))
                continue
            if float(found[2]) <= 0.0:
                raise ArgumentError(f"`limit` {text}: it must be above 0")
            held[found[1].casefold()] = float(found[2])
        return cls(held.get("strain/break"), held.get("slope")), figures


_QUANTITIES = (
    "ux", "uy", "uz", "rx", "ry", "rz", "fx", "fy", "fz", "distance", "stiffness",
)  # fmt: skip
_NUMBER = r"([-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)"
_TARGET = re.compile(rf"(.+)\s+([a-z]+)\s*(=|<|>)=?\s*{_NUMBER}\s*([^=<>]*)", re.IGNORECASE)
_WEIGHT = re.compile(rf"(.*)\sweight\s+{_NUMBER}", re.IGNORECASE)
_BETWEEN = re.compile(r"\s+to\s+", re.IGNORECASE)


_SHAPE_COLUMNS = ("x_mm", "y_mm", "z_mm", "ux_mm", "uy_mm", "uz_mm")
_MOST_POINTS = 30
"""Each costs three solutions an evaluation; ten to twenty tell a shape."""


_ON = re.compile(r"(.+?)\s+on\s+(.+)", re.IGNORECASE)


def _shape(text: str, bare: str) -> Target:
    named = bare.partition(":")[2].strip()
    on = _ON.fullmatch(named)
    path = Path(on[1] if on else named)
    if path.suffix.casefold() != ".csv":
        surface = read_mesh(path).triangles
        return Target(text, on[2] if on else "", "shape", surface_mm=np.asarray(surface, float))
    columns = dict.fromkeys(_SHAPE_COLUMNS, "length")
    numbers = read_columns(path, columns, others=True).numbers
    values = np.stack([numbers[name] for name in columns], axis=1).tolist()
    if len(values) > _MOST_POINTS:
        raise ArgumentError(
            f"`target` {text}: {len(values)} points; a shape takes 1 to {_MOST_POINTS}"
        )
    points = tuple((x, y, z) for x, y, z, *_ in values)
    moves = tuple((u, v, w) for *_, u, v, w in values)
    return Target(text, points_mm=points, moves_mm=moves)


_LIMIT = re.compile(
    r"(strain/break|slope)\s*<=?\s*([-+]?(?:\d+\.?\d*|\.\d+))\s*(?:/\s*mm)?", re.IGNORECASE
)


# ------------------------------------------------------------------------------------------------
# What a target asks of an equilibrium.


class Functional(NamedTuple):
    """A figure of an equilibrium.

    Attributes
    ----------
    text
        What it is, with its unit.
    wanted, unit
        The figure wanted, or the limit.
    scale
        A deviation that counts as whole, where `wanted` is 0.
    kind
        ``target``, which is to be met; ``near``, which the design comes as near to as it can;
        ``<`` or ``>``, limits of the figure without its sign.
    weight
        Of its miss.
    measure : callable
        Of `Mechanics` and an equilibrium: the figure, and its derivatives over the nodes'
        displacements, (N, 3).
    """

    text: str
    wanted: float
    unit: str
    scale: float
    kind: str
    weight: float
    measure: "Measure"

    def miss(self, figure: float) -> tuple[float, float]:
        """Return how far a target is missed, ln(figure / wanted), and the slope of that.

        Below a fifth of what is wanted, its tangent: figures may be 0 or of the other sign.
        """
        if not self.wanted:
            return figure / self.scale, 1.0 / self.scale
        ratio = figure / self.wanted
        bent = max(ratio, _STRAIGHT)
        return float(np.log(bent)) + (ratio - bent) / bent, 1.0 / (bent * self.wanted)

    def passed(self, figure: float) -> float:
        """Return by how much a limit is passed, over it; below 0 if it is not."""
        over = abs(figure) / self.wanted - 1.0
        return over if self.kind == "<" else -over


_STRAIGHT = 0.2
"""Of what is wanted: below it a miss goes with the figure, no longer with its logarithm."""

Measure = Callable[["Mechanics", "Equilibrium"], tuple[float, FloatArray]]


def posed(
    cases: Sequence[LoadCase], targets: Sequence[Sequence[Target]], surface: Mesh
) -> "list[tuple[Conditions, list[Functional]]]":
    """Return each case's supports and loads on a surface, and what its targets ask there."""
    size_mm = float(np.linalg.norm(np.ptp(surface.bounds_mm, axis=0)))
    out = []
    for case, aims in zip(cases, targets, strict=True):
        watch = [selector for aim in aims for selector in aim.selectors]
        on = read_conditions(surface, replace(case, watch=watch))
        out.append((on, functionals(aims, on, size_mm)))
    return out


def functionals(
    targets: Sequence[Target], conditions: "Conditions", size_mm: float
) -> list[Functional]:
    """Return what targets ask of equilibria under conditions; shapes by a surface are not among.

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
        if target.surface_mm is not None:
            continue
        if target.points_mm:
            out += _shape_functionals(target)
            continue
        facets = facets_of[target.selector]
        axis, quantity = "xyz".find(target.quantity[-1]), target.quantity
        unit, scale, measure = "mm", 0.01 * size_mm, _mean(facets, np.eye(3)[axis])
        wanted = target.value
        if quantity[0] in "ur":
            held = [axis] if quantity[0] == "u" else [0, 1, 2]
            conditions.refuse_held(f"`target` {target.text}", facets, held)
        if quantity[0] == "r":
            unit, scale, measure = "deg", 1.0, _turn(facets, axis)
        elif quantity == "distance":
            measure = _distance(facets, facets_of[target.other])
        elif quantity[0] in "fs":
            wanted, unit, measure = _of_loads(target, facets, axis, conditions)
            scale = 1.0
        kind = "target" if target.sense == "=" else target.sense
        out.append(Functional(target.text, wanted, unit, scale, kind, target.weight, measure))
    return out


def _linear(weights_of: "Callable[[Mechanics], FloatArray]") -> Measure:
    """Return the displacement that nodal weights, (N, 3), tell."""

    def measure(mechanics: "Mechanics", state: "Equilibrium") -> tuple[float, FloatArray]:
        weights = weights_of(mechanics)
        return float(np.sum(weights * state.displacement_mm)), weights

    return measure


def _mean(facets: Any, direction: FloatArray) -> Measure:
    return _linear(lambda at: at.mean_weights(at.points_of(facets), direction))


def _reaction(number: int, direction: FloatArray) -> Measure:
    """Return the force of a support."""

    def measure(mechanics: "Mechanics", state: "Equilibrium") -> tuple[float, FloatArray]:
        force = mechanics.reactions(state)[number]
        return float(force @ direction), mechanics.reaction_weights(number, direction)

    return measure


def _at(place: Point, direction: FloatArray) -> Measure:
    return _linear(lambda at: at.place_weights(np.array(place), direction))


def _distance(one: Any, other: Any) -> Measure:
    """Return the distance between the middles of faces, by area."""

    def measure(mechanics: "Mechanics", state: "Equilibrium") -> tuple[float, FloatArray]:
        at = [mechanics.points_of(facets) for facets in (one, other)]
        place = mechanics.body.cells.node_mm + state.displacement_mm
        apart = mechanics.mean(at[0], place) - mechanics.mean(at[1], place)
        size = float(np.linalg.norm(apart))
        first, last = (mechanics.mean_weights(points, apart / size) for points in at)
        return size, first - last

    return measure


def _turn(facets: Any, axis: int) -> Measure:
    """Return how far faces turn about an axis: that component of the best fit's rotation vector.

    With R the rotation that takes places a about their middle nearest to b, and a' = R a, a change
    db turns it by ω = (tr S - S)⁻¹ Σ a' × db, S = Σ b a'ᵀ, and the vector r by J⁻¹ ω, J the left
    Jacobian of the rotations at r (J. Solà and others, arXiv 1812.01537, eq. 146).
    """

    def measure(mechanics: "Mechanics", state: "Equilibrium") -> tuple[float, FloatArray]:
        from scipy.spatial.transform import Rotation

        from planner.simulation.solid import spread

        turned = np.radians(mechanics.turn_deg(facets, state.displacement_mm))
        at = mechanics.points_of(facets)
        size = np.linalg.norm(at.area_mm2, axis=1)
        before, after = (
            place - size @ place / size.sum()
            for place in (mechanics.place_mm(at), mechanics.place_mm(at, state.displacement_mm))
        )
        carried = Rotation.from_rotvec(turned).apply(before)
        both = np.einsum("n,ni,nj->ij", size, after, carried)
        both = 0.5 * (both + both.T)
        angle = max(float(np.linalg.norm(turned)), 1e-9)
        x, y, z = turned
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        square = 1.0 / angle**2 - 0.5 / (angle * np.tan(0.5 * angle)) if angle > 1e-3 else 1 / 12
        inverse = np.eye(3) - 0.5 * cross + square * cross @ cross
        spin = np.linalg.solve(np.trace(both) * np.eye(3) - both, inverse[axis])
        pulls = np.degrees(size[:, None] * np.cross(spin, carried))
        return float(np.degrees(turned[axis])), spread(mechanics.body.cells, at, pulls)

    return measure


def _of_loads(
    target: Target, facets: Any, axis: int, conditions: "Conditions"
) -> tuple[float, str, Measure]:
    for force in conditions.forces:
        if target.quantity == "stiffness" and np.array_equal(force.facets, facets):
            given = np.array(force.force_N)
            size = float(np.linalg.norm(given))
            return size / target.value, "mm", _mean(facets, given / size)
    for number, support in enumerate(conditions.supports):
        if not np.array_equal(support.facets, facets):
            continue
        moved = np.array([d or 0.0 for d in support.displacement_mm])
        travel = float(np.linalg.norm(moved))
        if target.quantity == "stiffness" and not travel:
            break
        direction = moved / travel if target.quantity == "stiffness" else np.eye(3)[axis]
        wanted = target.value * travel if target.quantity == "stiffness" else target.value
        return wanted, "N", _reaction(number, direction)
    raise ArgumentError(
        f"`target` {target.text}: no load or support is on exactly these faces; a stiffness is that"
        " of a `load` or of a `move`, a force that of a `fix` or a `move`, with the same selector"
    )


def _shape_functionals(target: Target) -> list[Functional]:
    """Return the components of a shape's points; the longest way counts as whole."""
    greatest = float(np.linalg.norm(target.moves_mm, axis=1).max())
    return [
        Functional(
            f"{target.text}, point {number}, u{'xyz'[axis]}", move[axis], "mm", greatest, "near",
            target.weight, _at(place, np.eye(3)[axis]),
        )
        for number, (place, move) in enumerate(
            zip(target.points_mm, target.moves_mm, strict=True), start=1
        )
        for axis in range(3)
    ]  # fmt: skip
