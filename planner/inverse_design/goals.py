"""What a design is to reach, and what it must keep: targets and limits, as a user writes them."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from planner.errors import ArgumentError, as_texts, check_known, positive
from planner.formats.mesh_file import read_mesh
from planner.formats.tables import read_columns
from planner.formats.units import unit_factor
from planner.mesh.distance import TriangleTree, triangle_tree
from planner.mesh.mesh import Mesh
from planner.numerics import BoolArray, FloatArray, Point
from planner.simulation.bar import united
from planner.simulation.cut_cells import CutCells, carrier
from planner.simulation.element import shape_functions
from planner.simulation.loads import Conditions, LoadCase, read_conditions

if TYPE_CHECKING:
    from planner.simulation.solid import Equilibrium, Mechanics

__all__ = ["Deviation", "Functional", "Limits", "ShapeGoal", "Target", "WantedShape", "posed"]


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

    @classmethod
    def read(cls, text: str, option: str = "target", unit: str | None = None) -> "Target":
        """Read ``SELECTOR QUANTITY=VALUE UNIT``, ``shape: FILE.csv`` or ``shape: FILE.stl``.

        Behind each may stand ``weight 2``; of a limit, ``<`` or ``>`` stands in place of ``=``. A
        mesh is read in `unit`, as the part is.

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
            positive(weight, f"{where}: a weight")
        if bare.casefold().startswith("shape:") and option == "target":
            return replace(_shape(text, bare, unit), weight=weight)
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
        check_known(quantity, _QUANTITIES, f"{where}: no such quantity {quantity!r}; {{}}there are")
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
            positive(value, f"{where}: a stiffness")
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
    def read(cls, texts: str | Sequence[str]) -> tuple["Limits", list[Target]]:
        """Read ``strain/break<0.5`` and ``slope<0.1 /mm``, and figures such as ``x=min uy<1 mm``.

        Raises
        ------
        ArgumentError
            Another text, or a limit that is not above 0.
        """
        held: dict[str, float] = {}
        figures = []
        for text in as_texts(texts, "`limit`"):
            found = _LIMIT.fullmatch(text.strip())
            if found is None:
                figures.append(Target.read(text, "limit"))
                continue
            held[found[1].casefold()] = positive(float(found[2]), f"`limit` {text}:")
        return cls(held.get("strain/break"), held.get("slope")), figures


_QUANTITIES = (
    "ux", "uy", "uz", "rx", "ry", "rz", "fx", "fy", "fz", "distance", "stiffness",
)  # fmt: skip
_NUMBER = r"([-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d{1,2}(?!\d))?)"
_TARGET = re.compile(rf"(.+)\s+([a-z]+)\s*(=|<|>)=?\s*{_NUMBER}\s*([^=<>]*)", re.IGNORECASE)
_WEIGHT = re.compile(rf"(.*)\sweight\s+{_NUMBER}", re.IGNORECASE)
_BETWEEN = re.compile(r"\s+to\s+", re.IGNORECASE)


_MOST_POINTS = 30
"""Each costs three solutions an evaluation; ten to twenty tell a shape."""


def _shape(text: str, bare: str, unit: str | None) -> Target:
    named = bare.partition(":")[2].strip()
    on = re.fullmatch(r"(.+?)\s+on\s+(.+)", named, re.IGNORECASE)
    path = Path(on[1] if on else named)
    if path.suffix.casefold() != ".csv":
        surface = read_mesh(path, unit).triangles
        return Target(text, on[2] if on else "", "shape", surface_mm=np.asarray(surface, float))
    columns = dict.fromkeys(("x_mm", "y_mm", "z_mm", "ux_mm", "uy_mm", "uz_mm"), "length")
    numbers = read_columns(path, columns, others=True).numbers
    values = np.stack([numbers[name] for name in columns], axis=1).tolist()
    if len(values) > _MOST_POINTS:
        raise ArgumentError(
            f"`target` {text}: {len(values)} points; a shape takes 1 to {_MOST_POINTS}"
        )
    points = tuple((x, y, z) for x, y, z, *_ in values)
    return Target(text, points_mm=points, moves_mm=tuple((u, v, w) for *_, u, v, w in values))


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
        A deviation that counts as whole, where nothing is to change.
    kind
        ``target``, which is to be met; ``near``, which the design comes as near to as it can;
        ``<`` or ``>``, limits of the figure without its sign.
    weight
        Of its miss.
    measure : callable
        Of `Mechanics` and an equilibrium: the figure, and its derivatives over the nodes'
        displacements, (N, 3).
    at_rest
        The figure without a load: 0 but for a distance. What is missed is missed of the way there.
    """

    text: str
    wanted: float
    unit: str
    scale: float
    kind: str
    weight: float
    measure: "Measure"
    at_rest: float = 0.0

    @property
    def way(self) -> float:
        """How far the figure is to go from rest; 0 where it is to stay."""
        way = self.wanted - self.at_rest
        return way if abs(way) > _NO_WAY * self.scale else 0.0

    def miss(self, figure: float) -> tuple[float, float]:
        """Return how far a target is missed, ln(way gone / way), and the slope of that.

        Below a fifth of the way, its tangent: figures may be 0 or of the other sign.
        """
        gone, way = figure - self.at_rest, self.way
        if not way:
            return gone / self.scale, 1.0 / self.scale
        ratio = gone / way
        bent = max(ratio, _STRAIGHT)
        return float(np.log(bent)) + (ratio - bent) / bent, 1.0 / (bent * way)

    def passed(self, figure: float) -> float:
        """Return by how much a limit is passed, over it; below 0 if it is not."""
        over = abs(figure) / self.wanted - 1.0
        return over if self.kind == "<" else -over


_STRAIGHT = 0.2
"""Of the way: below it a miss goes with the figure, no longer with its logarithm."""

_NO_WAY = 1e-6
"""Numerical, of `Functional.scale`: a distance that is wanted as it is, but for rounding."""

Measured = tuple[float, FloatArray]
Measure = Callable[["Mechanics", "Equilibrium"], Measured]


def posed(
    cases: Sequence[LoadCase], targets: Sequence[Sequence[Target]], surface: Mesh
) -> list[tuple[Conditions, list[Functional]]]:
    """Return each case's supports and loads on a surface, and what its targets ask there."""
    out = []
    for case, aims in zip(cases, targets, strict=True):
        watch = [faces for aim in aims for faces in (aim.selector, aim.other) if faces]
        on = read_conditions(surface, replace(case, watch=watch))
        out.append((on, functionals(aims, on, surface)))
    return out


def functionals(
    targets: Sequence[Target], conditions: Conditions, surface: Mesh
) -> list[Functional]:
    """Return what targets ask of equilibria under conditions; shapes by a surface are not among.

    Parameters
    ----------
    conditions
        Whose watched faces are those of the targets' selectors.
    surface
        Of the part: a displacement of a hundredth of its size counts as whole.

    Raises
    ------
    ArgumentError
        A stiffness or a force of faces without a load or support; a displacement of faces that
        supports hold along it.
    """
    out: list[Functional] = []
    facets_of = {watched.selector: watched.facets for watched in conditions.watched}
    size_mm = float(np.linalg.norm(np.ptp(surface.bounds_mm, axis=0)))
    for target in targets:
        if target.surface_mm is not None:
            continue
        if target.points_mm:
            out += _shape_functionals(target)
            continue
        facets = facets_of[target.selector]
        axis, quantity = "xyz".find(target.quantity[-1]), target.quantity
        unit, scale, wanted, at_rest = "mm", 0.01 * size_mm, target.value, 0.0
        measure: Measure = partial(_mean, facets, np.eye(3)[axis])
        if quantity[0] in "ur":
            held = [axis] if quantity[0] == "u" else [0, 1, 2]
            conditions.refuse_held(f"`target` {target.text}", facets, held)
        if quantity[0] == "r":
            unit, scale, measure = "deg", 1.0, partial(_turn, facets, axis)
        elif quantity == "distance":
            other = facets_of[target.other]
            measure = partial(_distance, facets, other)
            at_rest = float(np.linalg.norm(_middle(surface, facets) - _middle(surface, other)))
        elif quantity[0] in "fs":
            wanted, unit, measure = _of_loads(target, facets, axis, conditions)
            scale = 1.0
        kind = "target" if target.sense == "=" else target.sense
        out.append(
            Functional(target.text, wanted, unit, scale, kind, target.weight, measure, at_rest)
        )
    return out


def _middle(surface: Mesh, facets: BoolArray) -> FloatArray:
    area = np.linalg.norm(surface.area_vectors_mm2[facets], axis=1)
    return np.asarray(area @ surface.triangles[facets].mean(axis=1) / area.sum())


def _mean(
    facets: Any, direction: FloatArray, mechanics: "Mechanics", state: "Equilibrium"
) -> Measured:
    """Return the mean displacement of faces."""
    weights = mechanics.mean_weights(mechanics.points_of(facets), direction)
    return float(np.sum(weights * state.displacement_mm)), weights


def _reaction(
    number: int, direction: FloatArray, mechanics: "Mechanics", state: "Equilibrium"
) -> Measured:
    """Return the force of a support."""
    force = mechanics.reactions(state)[number]
    return float(force @ direction), mechanics.reaction_weights(number, direction)


def _at(
    place: Point, direction: FloatArray, mechanics: "Mechanics", state: "Equilibrium"
) -> Measured:
    """Return the displacement of a place."""
    weights = mechanics.place_weights(np.array(place), direction)
    return float(np.sum(weights * state.displacement_mm)), weights


def _distance(one: Any, other: Any, mechanics: "Mechanics", state: "Equilibrium") -> Measured:
    """Return the distance between the middles of faces, by area."""
    at = [mechanics.points_of(facets) for facets in (one, other)]
    place = mechanics.body.cells.node_mm + state.displacement_mm
    apart = mechanics.mean(at[0], place) - mechanics.mean(at[1], place)
    size = float(np.linalg.norm(apart))
    first, last = (mechanics.mean_weights(points, apart / size) for points in at)
    return size, first - last


def _turn(facets: Any, axis: int, mechanics: "Mechanics", state: "Equilibrium") -> Measured:
    """Return how far faces turn about an axis: that component of the best fit's rotation vector.

    With R the rotation that takes places a about their middle nearest to b, and a' = R a, a change
    db turns it by ω = (tr S - S)⁻¹ Σ a' × db, S = Σ b a'ᵀ, and the vector r by J⁻¹ ω, J the left
    Jacobian of the rotations at r (J. Solà and others, arXiv 1812.01537, eq. 146).
    """
    from scipy.spatial.transform import Rotation

    from planner.simulation.solid import spread

    at, u = mechanics.points_of(facets), state.displacement_mm
    turned, size = np.radians(mechanics.turn_deg(facets, u)), at.size_mm2
    carried = Rotation.from_rotvec(turned).apply(mechanics.arm_mm(at))
    both = np.einsum("n,ni,nj->ij", size, mechanics.arm_mm(at, u), carried)
    both = 0.5 * (both + both.T)
    angle = max(float(np.linalg.norm(turned)), 1e-9)
    x, y, z = turned
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    square = 1.0 / angle**2 - 0.5 / (angle * np.tan(0.5 * angle)) if angle > 1e-3 else 1 / 12
    inverse = np.eye(3) - 0.5 * cross + square * cross @ cross
    spin = np.linalg.solve(np.trace(both) * np.eye(3) - both, inverse[axis])
    pulls = np.degrees(size[:, None] * np.cross(spin, carried))
    return float(np.degrees(turned[axis])), spread(mechanics.body.cells, at, pulls)


def _of_loads(
    target: Target, facets: Any, axis: int, conditions: Conditions
) -> tuple[float, str, Measure]:
    for force in conditions.forces:
        if target.quantity == "stiffness" and np.array_equal(force.facets, facets):
            given = np.array(force.force_N)
            size = float(np.linalg.norm(given))
            return size / target.value, "mm", partial(_mean, facets, given / size)
    for number, support in enumerate(conditions.supports):
        if not np.array_equal(support.facets, facets):
            continue
        moved = np.array([d or 0.0 for d in support.displacement_mm])
        travel = float(np.linalg.norm(moved))
        if target.quantity == "stiffness" and not travel:
            break
        if target.quantity == "stiffness":
            return target.value * travel, "N", partial(_reaction, number, moved / travel)
        return target.value, "N", partial(_reaction, number, np.eye(3)[axis])
    raise ArgumentError(
        f"`target` {target.text}: no load or support is on exactly these faces; a stiffness is that"
        " of a `load` or of a `move`, a force that of a `fix` or a `move`, with the same selector"
    )


def _shape_functionals(target: Target) -> list[Functional]:
    """Return the components of a shape's points; the longest way counts as whole."""
    greatest = float(np.linalg.norm(target.moves_mm, axis=1).max())
    each = enumerate(zip(target.points_mm, target.moves_mm, strict=True), start=1)
    return [
        Functional(
            f"{target.text}, point {number}, u{'xyz'[axis]}", move[axis], "mm", greatest, "near",
            target.weight, partial(_at, place, np.eye(3)[axis]),
        )
        for number, (place, move) in each
        for axis in range(3)
    ]  # fmt: skip


# ------------------------------------------------------------------------------------------------
# A shape that is wanted of a part's surface: how far places of the surface are off it.


_SAME = 1e-4
"""Of the part's size: corners of triangles that are one vertex, in files of single precision."""


class WantedShape(NamedTuple):
    """Where a part's surface is to be.

    Attributes
    ----------
    moved : (k, 3, 3)
        Its triangles.
    rest
        The part's, if those are a moved copy of them.
    surface
        The shape, to which the nearest place counts otherwise.
    greatest_mm
        The longest way that a place of the surface has to it.
    note
        How places were matched.
    """

    target: Target
    surface: Mesh
    moved: FloatArray
    greatest_mm: float
    note: str
    rest: Mesh | None

    @classmethod
    def of(cls, target: Target, part: FloatArray) -> "WantedShape":
        """Return a shape by the triangles of its surface.

        Parameters
        ----------
        part : (k, 3, 3)
            The part's triangles as in its file.

        Raises
        ------
        ArgumentError
            The shape is the part as it is, or so far away that it is that of another part.
        """
        moved, text = np.asarray(target.surface_mm), target.text
        size = float(np.ptp(part.reshape(-1, 3), axis=0).max())
        surface, rest = united({"": moved}), None
        if len(moved) == len(part) and _matched(part, moved, size):
            corners = np.arange(3 * len(part), dtype=np.int32).reshape(-1, 3)
            rest = Mesh(part.reshape(-1, 3), corners)
            greatest = float(np.linalg.norm(moved - part, axis=2).max())
            note = f"{text}: its triangles are those of the part, which go up to {greatest:.4g} mm"
        else:
            own = united({"": part})
            nearest, _ = triangle_tree(surface).closest(own.vertices)
            way = np.linalg.norm(nearest - own.vertices, axis=1)
            greatest = float(way.max())
            note = (
                f"{text}: its {len(moved)} triangles are not the part's {len(part)}, so that each "
                f"place is to come to the nearest of the shape, up to {greatest:.4g} mm away, "
                f"{way.mean():.3g} mm on the mean; a copy with the part's own triangles tells more"
            )
        if not 1e-5 * size < greatest < 3.0 * size:
            raise ArgumentError(
                f"`target` {text}: the shape is {greatest:.3g} mm from the part, which is "
                f"{size:.4g} mm long; give the part's surface as it is to be under the load, in "
                "the same place"
            )
        return cls(target, surface, moved, greatest, note, rest)


def _matched(part: FloatArray, moved: FloatArray, size: float) -> bool:
    """Tell whether triangles are one surface, moved: what meets in the one meets in the other."""
    steps = np.rint(part.reshape(-1, 3) / (_SAME * size))
    _, vertex = np.unique(steps, axis=0, return_inverse=True)
    corners, count = moved.reshape(-1, 3), np.bincount(vertex.ravel())
    mean = [np.bincount(vertex.ravel(), column) / count for column in corners.T]
    apart = corners - np.stack(mean, axis=1)[vertex.ravel()]
    return bool(np.abs(apart).max() < 10.0 * _SAME * size)


class Deviation(NamedTuple):
    """How far places of a surface are off, over the longest way, and what changes that.

    Attributes
    ----------
    rms : float
        Over the longest way; the mean is over the area.
    off : (m,)
        Whose sum of squares is that of the mean, times the weight.
    rows : callable
        From the nodes' displacements by each unknown, (N, 3, n), to the changes of `off`, (m, n).
    off_mm : (V,)
        Of each place; 0 where the shape does not count.
    """

    rms: float
    off: FloatArray
    rows: Callable[[FloatArray], FloatArray]
    off_mm: FloatArray


class ShapeGoal(NamedTuple):
    """A wanted shape, for the surface of a part in cells.

    Attributes
    ----------
    share : (V,)
        Of the area that counts, at each vertex.
    target_mm : (V, 3), optional
        Where each is wanted.
    """

    wanted: WantedShape
    place_mm: FloatArray
    carried: Any
    share: FloatArray
    target_mm: FloatArray | None
    tree: TriangleTree

    @classmethod
    def on(cls, wanted: WantedShape, cells: CutCells, facets: BoolArray | None) -> "ShapeGoal":
        """Pose a shape on the surface of cells; facets of it that count, or all."""
        surface = cells.surface
        shape = shape_functions(cells.vertex_local, cells.cell_mm)[0]
        carried = carrier(cells, cells.vertex_cell, shape)
        area = np.linalg.norm(surface.area_vectors_mm2, axis=1)
        area = area if facets is None else area * facets
        share = np.bincount(surface.faces.ravel(), np.repeat(area, 3), len(surface.vertices))
        target = None
        if wanted.rest is not None:
            place, which = triangle_tree(wanted.rest).closest(surface.vertices)
            target = carried_along(wanted.rest.triangles[which], wanted.moved[which], place)
        return cls(
            wanted, surface.vertices, carried, share / share.sum(), target,
            triangle_tree(wanted.surface),
        )  # fmt: skip

    def deviation(self, displacement_mm: FloatArray) -> Deviation:
        """Return how far the surface is off under the nodes' displacements, (N, 3)."""
        place = self.place_mm + self.carried @ displacement_mm
        greatest = self.wanted.greatest_mm
        scale = np.sqrt(self.share * self.wanted.target.weight) / greatest
        to, which = self.tree.closest(place) if self.target_mm is None else (self.target_mm, None)
        apart = place - to
        off_mm = np.linalg.norm(apart, axis=1)
        along, off = None, (scale[:, None] * apart).ravel()
        if which is not None:  # only the way to the nearest place counts
            far = off_mm > 1e-9 * greatest
            along = self.wanted.surface.normals[which]
            along[far] = apart[far] / off_mm[far, None]
            off = scale * off_mm

        def rows(moved: FloatArray) -> FloatArray:
            count = moved.shape[2]
            places = (self.carried @ moved.reshape(len(moved), -1)).reshape(-1, 3, count)
            if along is None:
                return np.asarray((scale[:, None, None] * places).reshape(-1, count))
            return np.asarray(scale[:, None] * np.einsum("vi,vin->vn", along, places))

        rms = float(np.sqrt(self.share @ off_mm**2)) / greatest
        return Deviation(rms, off, rows, off_mm * (self.share > 0.0))


def carried_along(rest: FloatArray, moved: FloatArray, place: FloatArray) -> FloatArray:
    """Return where places of triangles, (n, 3), go as these are moved, (n, 3, 3)."""
    one, other, to = rest[:, 1] - rest[:, 0], rest[:, 2] - rest[:, 0], place - rest[:, 0]
    aa, ab, bb = (np.sum(p * q, axis=1) for p, q in ((one, one), (one, other), (other, other)))
    a, b = np.sum(one * to, axis=1), np.sum(other * to, axis=1)
    det = np.maximum(aa * bb - ab * ab, 1e-300)
    v, w = (bb * a - ab * b) / det, (aa * b - ab * a) / det
    return np.asarray(np.einsum("nc,nci->ni", np.stack([1.0 - v - w, v, w], axis=1), moved))
