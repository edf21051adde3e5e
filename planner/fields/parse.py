"""Fields as a user writes them: NAME: arguments, formulas, and fields made of fields."""

import ast
import hashlib
import itertools
import math
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np

from planner.errors import ArgumentError, FileError, MeshError, check_known, did_you_mean, refused
from planner.fields.basic import (
    AxisField,
    Field,
    FieldRegion,
    FunctionField,
    Quantity,
    Ramp,
    axis_field,
    project,
)
from planner.fields.solved import cells_of, geodesic_field, harmonic_field, over_cells, points_field
from planner.formats.field_file import GridTable, read_grid_table, read_point_table
from planner.formats.files import path_within, read_file
from planner.formats.mesh_file import EXTENSIONS, read_mesh
from planner.glance import place_text
from planner.mesh.distance import TriangleTree, triangle_tree
from planner.mesh.mesh import Mesh, Topology, connected
from planner.mesh.part import make_part
from planner.numerics import FloatArray, Point, as_point, numbers_in
from planner.voxels.columns import Grid

__all__ = ["Setting", "TableFile", "build_field", "field_of"]


# ------------------------------------------------------------------------------------------------
# A formula of position, read by planner itself: nothing of it is run as Python.


_Value = FloatArray | float

_VARIABLES = ("x", "y", "z", "r", "d", "u")
"""Position in the part's own coordinates, distance from the z axis of its file, and depth below its
surface, all in mm; and 0 to 1 along its longest side."""

_CONSTANTS = {"pi": np.pi, "e": np.e}
_FUNCTIONS: Mapping[str, tuple[int, Callable[..., _Value]]] = {
    "sin": (1, np.sin), "cos": (1, np.cos), "tan": (1, np.tan), "asin": (1, np.arcsin),
    "acos": (1, np.arccos), "atan": (1, np.arctan), "atan2": (2, np.arctan2),
    "sinh": (1, np.sinh), "cosh": (1, np.cosh), "tanh": (1, np.tanh), "exp": (1, np.exp),
    "log": (1, np.log), "sqrt": (1, np.sqrt), "abs": (1, np.abs), "hypot": (2, np.hypot),
    "min": (2, np.minimum), "max": (2, np.maximum), "clamp": (3, np.clip),
}  # fmt: skip
_BINARY: Mapping[type[ast.operator], Callable[[_Value, _Value], _Value]] = {
    ast.Add: np.add, ast.Sub: np.subtract, ast.Mult: np.multiply, ast.Div: np.true_divide,
    ast.Pow: np.power, ast.Mod: np.mod,
}  # fmt: skip
_LONGEST, _FORMULA_DEEPEST, _LARGEST = 1000, 60, 1e300


_Formula = Callable[[Mapping[str, _Value]], _Value]
"""The value of a formula, of the values of its names."""


def _formula(text: str) -> tuple[_Formula, set[str]]:
    """Read numbers, variables, + - * / ** ^ %, parentheses and functions; also which names it has.

    Raises
    ------
    ArgumentError
        Anything else, with what it is and what may stand there.
    """
    if len(text) > _LONGEST:
        raise ArgumentError(f"expression of {len(text)} characters; up to {_LONGEST} are read")
    try:
        plain = text.strip().replace("^", "**").replace("\N{MINUS SIGN}", "-")
        tree = ast.parse(plain, mode="eval")
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        place = getattr(error, "offset", None)
        where = f" near character {place}" if place else ""
        raise ArgumentError(
            f"expression {text!r}: it cannot be read{where}; write it like "
            '"0.5 + 0.5*sin(2*pi*x/20)"'
        ) from None
    used = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    return _formula_of(tree.body, text, 0), used


def _formula_of(node: ast.expr, text: str, depth: int) -> _Formula:
    if depth > _FORMULA_DEEPEST:
        raise ArgumentError(f"expression {text!r}: it is nested deeper than {_FORMULA_DEEPEST}")
    match node:
        case ast.Constant(value=bool()):
            pass
        case ast.Constant(value=int() | float() as number) if abs(number) < _LARGEST:
            return lambda known: float(number)
        case ast.Name(id=name):
            said = f"expression {text!r}: {name} is unknown; {{}}variables are"
            check_known(name, [*_VARIABLES, *_CONSTANTS], said)
            return lambda known: known[name]
        case ast.UnaryOp(op=ast.UAdd() | ast.USub() as sign, operand=operand):
            inner = _formula_of(operand, text, depth + 1)
            return inner if isinstance(sign, ast.UAdd) else lambda known: -inner(known)
        case ast.BinOp(op=operator, left=left, right=right) if type(operator) in _BINARY:
            first, second = (_formula_of(side, text, depth + 1) for side in (left, right))
            return lambda known: _BINARY[type(operator)](first(known), second(known))
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
            said = f"expression {text!r}: there is no function {name}; {{}}functions are"
            check_known(name, _FUNCTIONS, said)
            count, function = _FUNCTIONS[name]
            if len(arguments) != count:
                raise ArgumentError(
                    f"expression {text!r}: {name} takes {count} arguments, and got {len(arguments)}"
                )
            each = [_formula_of(argument, text, depth + 1) for argument in arguments]
            return lambda known: function(*(value(known) for value in each))
    part = ast.get_source_segment(text.strip().replace("^", "**"), node) or type(node).__name__
    raise ArgumentError(
        f"expression {text!r}: {part!r} may not stand there; numbers, variables, + - * / ** %, "
        "parentheses and functions may"
    )


# ------------------------------------------------------------------------------------------------
# Distances, and regions of space that fields start from or end at.


def _from_point(centre_mm: Point, points_mm: FloatArray) -> FloatArray:
    """Return the distance of points (n, 3) from a point."""
    x, y, z = (points_mm - np.array(centre_mm)).T
    return np.asarray(np.sqrt(x * x + y * y + z * z))


def _from_line(point_mm: Point, direction: Point, points_mm: FloatArray) -> FloatArray:
    """Return the distance from a line by a point and its unit direction."""
    x, y, z = (points_mm - np.array(point_mm)).T
    a, b, c = direction
    p, q, r = y * c - z * b, z * a - x * c, x * b - y * a
    return np.asarray(np.sqrt(p * p + q * q + r * r))


def _from_surface(tree: TriangleTree, depth: bool, points_mm: FloatArray) -> FloatArray:
    """Return the exact distance from a surface; with `depth` positive inside, negative outside."""
    found, outside = tree.distances(points_mm)
    return np.where(outside, -found, found) if depth else found


def _box_region(low_mm: Point, high_mm: Point) -> FieldRegion:
    """Return what lies between two corners."""
    return FieldRegion(
        lambda points_mm: np.all((points_mm >= low_mm) & (points_mm <= high_mm), axis=1),
        {"box_mm": [list(low_mm), list(high_mm)]},
    )


def _ball_region(centre_mm: Point, radius_mm: float) -> FieldRegion:
    """Return what lies within a radius of a point."""
    return FieldRegion(
        lambda points_mm: np.square(points_mm - centre_mm).sum(axis=1) <= radius_mm**2,
        {"centre_mm": list(centre_mm), "radius_mm": radius_mm},
    )


def _half_space(point_mm: Point, normal: Point) -> FieldRegion:
    """Return what lies beyond a plane, where its normal points."""
    return FieldRegion(
        lambda points_mm: project(points_mm - point_mm, normal) >= 0.0,
        {"point_mm": list(point_mm), "normal": list(normal)},
    )


# ------------------------------------------------------------------------------------------------
# A smooth piece of a surface, such as the wall of a hole, from one picked point.

_PICKED = 0.01
"""How far beside the part's box such a point may be, of its longest side. Chosen: a point on a
face, picked on a screen, is off by less."""


_CREASE = np.cos(np.radians(40.0))


def _smooth_patch(mesh: Mesh, point_mm: FloatArray) -> Mesh:
    """Return the faces around the place nearest to a point, up to edges sharper than 40 degrees."""
    distance = triangle_tree(mesh).distances(point_mm[None])[0][0]
    # The face itself: the only one, or one of those, as near as that.
    corners = mesh.triangles
    box = np.maximum(corners.min(axis=1) - point_mm, point_mm - corners.max(axis=1)).max(axis=1)
    candidates = np.flatnonzero(box <= distance + 1e-9)
    off = [
        triangle_tree(Mesh(mesh.vertices, mesh.faces[[f]])).distances(point_mm[None])[0][0]
        for f in candidates.tolist()
    ]
    picked = int(candidates[int(np.argmin(off))])
    normal, twin = mesh.normals, Topology(mesh.faces).twin
    half = np.flatnonzero(twin >= 0)
    one, other = half // 3, twin[half] // 3
    smooth = (normal[one] * normal[other]).sum(axis=1) > _CREASE
    group = connected(len(mesh.faces), one[smooth], other[smooth])
    return Mesh(mesh.vertices, mesh.faces[group == group[picked]])


# ------------------------------------------------------------------------------------------------
# The arguments of a field as text: words, key=value pairs, numbers, regions.


_HALF = re.compile(r"^\s*([xyz])\s*([<>])=?\s*(\S+)\s*$")
_REGIONS = (
    "x<3, z>=20, box X0 Y0 Z0 X1 Y1 Z1, ball X Y Z RADIUS, plane PX PY PZ NX NY NZ (beyond it, "
    "where N points), or a closed mesh file"
)


@dataclass(frozen=True)
class FieldArguments:
    """Arguments of one field.

    Attributes
    ----------
    kind
        The field's name, for messages.
    words
        Those without a key.
    named
        By key.
    origin_mm
        Where the part's own origin lies, as placed; positions are moved by it.
    """

    kind: str
    words: tuple[str, ...]
    named: dict[str, str]
    origin_mm: Point

    @classmethod
    def parse(
        cls, kind: str, text: str, keys: Collection[str] | None, words: int, origin_mm: Point
    ) -> "FieldArguments":
        """Split at commas, and refuse keys that the field does not have; one word without keys.

        Raises
        ------
        ArgumentError
            An unknown or repeated key, or more words than `words`.
        """
        if keys is None:
            return cls(kind, (text,), {}, origin_mm)
        bare, named = [], dict[str, str]()
        for item in filter(None, (part.strip() for part in text.split(","))):
            key, equals, value = item.partition("=")
            key = key.strip()
            if not equals or not key.isidentifier():
                bare.append(item)
                continue
            if key not in keys:
                hint = did_you_mean(f"{key}=", [f"{known}=" for known in keys])
                raise ArgumentError(
                    f"field {kind}: there is no {key}=; {hint}it takes {', '.join(keys) or 'none'}"
                )
            if key in named:
                raise ArgumentError(f"field {kind}: {key}= is given twice")
            named[key] = value.strip()
        if len(bare) > words:
            raise ArgumentError(
                f"field {kind}: {bare[words]!r} is one too many; arguments are key=value, parted "
                f"by commas, numbers within one by spaces, with the keys {', '.join(keys)}"
            )
        return cls(kind, tuple(bare), named, origin_mm)

    def only(self, *keys: str) -> str | None:
        """Return which one of some keys is given, or None.

        Raises
        ------
        ArgumentError
            More than one.
        """
        given = [key for key in keys if key in self.named]
        if len(given) > 1:
            raise ArgumentError(f"field {self.kind}: give {'= or '.join(given)}=, not both")
        return given[0] if given else None

    def number(self, key: str) -> float | None:
        """Return a number, None where it is not given."""
        return self.numbers(key, 1)[0] if key in self.named else None

    def numbers(self, key: str, count: int, text: str | None = None) -> list[float]:
        """Return so many numbers of a key's text, or of a part of it.

        Raises
        ------
        ArgumentError
            Another count, or none.
        """
        text = self.named[key] if text is None else text
        found = numbers_in(text.replace("\N{MINUS SIGN}", "-").split(), float)
        if len(found) != count or not all(map(math.isfinite, found)):
            raise ArgumentError(
                f"field {self.kind}: {key}={text.strip()!r} must be {count} number"
                f"{'s, parted by spaces' if count > 1 else ''}"
            )
        return found

    def triple(self, key: str) -> Point | None:
        """Return three numbers as they are, None where they are not given."""
        return as_point(np.array(self.numbers(key, 3))) if key in self.named else None

    def point(self, key: str) -> Point:
        """Return a position as placed for printing."""
        return self._placed(self.numbers(key, 3))

    def line(self, key: str, text: str | None = None) -> tuple[Point, Point]:
        """Return a position as placed, and a unit direction."""
        *point, a, b, c = self.numbers(key, 6, text)
        length = math.hypot(a, b, c)
        if length == 0.0:
            raise ArgumentError(f"field {self.kind}: {key}= has a direction of length zero")
        return self._placed(point), (a / length, b / length, c / length)

    def box(self, key: str, text: str | None = None) -> tuple[Point, Point]:
        """Return the corners of a box as placed."""
        *one, a, b, c = self.numbers(key, 6, text)
        low, high = np.minimum(one, (a, b, c)), np.maximum(one, (a, b, c))
        return self._placed(low.tolist()), self._placed(high.tolist())

    def region(self, key: str) -> FieldRegion:
        """Return a region as placed.

        Raises
        ------
        ArgumentError, FileError
            It is none, or its mesh cannot be read.
        """
        text = self.named[key]
        if half := _HALF.match(text):
            axis, (at, normal) = "xyz".index(half[1]), np.zeros((2, 3))
            at[axis] = self.numbers(key, 1, half[3])[0] + self.origin_mm[axis]
            normal[axis] = 1.0 if half[2] == ">" else -1.0
            return _half_space(as_point(at), as_point(normal))
        word, _, rest = text.strip().partition(" ")
        if word == "box":
            return _box_region(*self.box(key, rest))
        if word == "ball":
            *centre, radius = self.numbers(key, 4, rest)
            if radius <= 0.0:
                raise ArgumentError(f"field {self.kind}: {key}= has a radius of {radius:g} mm")
            return _ball_region(self._placed(centre), radius)
        if word == "plane":
            return _half_space(*self.line(key, rest))
        if Path(text).suffix.casefold().lstrip(".") in EXTENSIONS:
            mesh, sha256 = _mesh_in_place(Path(text), self.origin_mm)
            tree, says = triangle_tree(mesh), {"file": Path(text).name, "sha256": sha256}
            return FieldRegion(lambda points_mm: ~tree.distances(points_mm)[1], says)
        raise ArgumentError(f"field {self.kind}: {key}={text!r} is no region; it may be {_REGIONS}")

    def _placed(self, own: Sequence[float]) -> Point:
        return as_point(np.add(own, self.origin_mm))


def _mesh_in_place(path: Path, origin_mm: Point, *, closed: bool = True) -> tuple[Mesh, str]:
    """Read a mesh that lies in the part's own coordinates, moved to where the part is placed.

    Raises
    ------
    FileError, MeshError
        It cannot be read, or is not closed where it must be.
    """
    file = read_mesh(path)
    triangles: FloatArray = file.triangles + np.array(origin_mm)
    if closed:
        return make_part(triangles, name=path.name).mesh, file.sha256
    faces = np.arange(3 * len(triangles), dtype=np.int32).reshape(-1, 3)
    mesh = Mesh(triangles.reshape(-1, 3), faces)
    if not mesh.area_mm2 > 0.0:
        raise MeshError(f"{path}: has no area; export it again")
    return mesh, file.sha256


# ------------------------------------------------------------------------------------------------
# The fields that have a name, each built from its arguments.


_SAMPLES = 100_000  # cells of the part's box, for the range of a quantity over the part

_DEPTH_MM, _HALVED = 1e-3, 512
"""Numerical: how near the greatest depth is found, and how far below the surface a formula is asked
that has no value outside; and how many cells are halved at a time."""

_CORNERS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))


@dataclass(frozen=True, eq=False)
class Setting:
    """What fields are built over.

    Attributes
    ----------
    mesh
        The part as placed.
    origin_mm
        Where the part's own origin lies, as placed.
    pitch_mm
        Of the grid that level sets are drawn on.
    """

    mesh: Mesh
    origin_mm: Point
    pitch_mm: float

    @cached_property
    def samples_mm(self) -> FloatArray:
        """The part's vertices and points within it."""
        grid, inside = cells_of(self.mesh, self._coarse_mm)
        # Cells of thin walls have their middle outside.
        within = self.surface.moved_within(grid.centre_mm(np.argwhere(inside)), 0.0)
        return np.concatenate([self.mesh.vertices, within])

    @property
    def _coarse_mm(self) -> float:
        extent_mm = np.ptp(self.mesh.bounds_mm, axis=0)
        return max(math.cbrt(extent_mm.prod() / _SAMPLES), float(extent_mm.max()) / 4000.0)

    def greatest(self, quantity: Quantity, *, outside: bool = True) -> float:
        """Return the greatest value within of one that rises by 1 mm a mm at most, to `_DEPTH_MM`.

        The cells that hold most are halved. What they reach beyond the part must be no greater than
        what is within, or is moved to the surface.
        """
        # Beyond the part as far as the next cell: its middle may lie outside, and the place in it.
        points, half_mm = self.samples_mm, (0.5 if outside else 1.0) * self._coarse_mm
        values = quantity(points)
        while half_mm > _DEPTH_MM:
            best, half_mm = values.max(), 0.5 * half_mm
            points = points[np.argsort(-values, kind="stable")[:_HALVED]]
            finer = (points[:, None] + half_mm * _CORNERS).reshape(-1, 3)
            if not outside:
                finer = finer[quantity(finer) > best]
                finer = np.concatenate([points, self.surface.moved_within(finer, 0.0)])
            points = finer
            values = quantity(points)
            if not outside and values.max() > best + 0.03 * half_mm:
                half_mm *= 2.0  # such steps lead on
        return float(values.max())

    @cached_property
    def surface(self) -> TriangleTree:
        """The part's surface, for distances."""
        return triangle_tree(self.mesh)


def _ramp(
    given: FieldArguments, setting: Setting, quantity: Quantity, *, exact: bool = False
) -> Ramp:
    """Return where the gradient starts and ends: over all of the part if not said.

    With `exact` the least is sought between samples, as where a mesh lies within; the greatest of
    radii is at a vertex, and of distances mostly.
    """
    start, stop = given.number("from"), given.number("to")
    if start is not None and stop is not None:
        return Ramp(start, stop)
    if exact and start is None:
        start = -setting.greatest(lambda points: -quantity(points), outside=False)
    return Ramp.over(quantity(setting.samples_mm), start, stop)


def _axis(given: FieldArguments, setting: Setting) -> Field:
    words = given.words[0].replace(",", " ").split()
    return axis_field(",".join(words) if words else None, setting.mesh)


def _radial(given: FieldArguments, setting: Setting) -> Field:
    if given.only("point", "line") == "line":
        point, direction = given.line("line")
        quantity = partial(_from_line, point, direction)
        says = {"point_mm": list(point), "direction": list(direction)}
    else:
        middle = as_point(setting.mesh.bounds_mm.mean(axis=0))
        centre = given.point("point") if "point" in given.named else middle
        quantity, says = partial(_from_point, centre), {"centre_mm": list(centre)}
    return _ramp(given, setting, quantity, exact=True).along(quantity, "radial", says)


def _distance(given: FieldArguments, setting: Setting) -> Field:
    which, depth, says = given.only("plane", "hole", "box"), False, dict[str, object]()
    if which and given.words:
        raise ArgumentError(f"field distance: give {given.words[0]} or {which}=, not both")
    if which == "plane":
        point, normal = given.line("plane")
        offset = float(np.dot(point, normal))
        ramp = _ramp(given, setting, AxisField(normal, offset, 1.0).values)
        if ramp.stop > ramp.start:
            return AxisField(normal, offset + ramp.start, ramp.stop - ramp.start)
        back = as_point(0.0 - np.array(normal))
        return AxisField(back, -(offset + ramp.start), ramp.start - ramp.stop)
    if which == "hole":
        picked, (low, high) = given.point("hole"), setting.mesh.bounds_mm
        beside = np.maximum(low - picked, picked - high).max()
        if beside > _PICKED * (high - low).max():
            raise ArgumentError(
                f"field distance: the point of hole= lies beside the part, {beside:.3g} mm out of "
                "its box; give a point on the wall of the hole"
            )
        tree = triangle_tree(_smooth_patch(setting.mesh, np.array(picked)))
        says = {"of": "hole", "point_mm": list(picked)}
    elif which == "box":
        (low_mm, high_mm), corners = given.box("box"), setting.mesh.triangles
        held = ((corners >= low_mm) & (corners <= high_mm)).all(axis=(1, 2))
        if not held.any():
            raise ArgumentError(
                "field distance: no face of the part lies wholly in box=; make it larger"
            )
        tree = triangle_tree(Mesh(setting.mesh.vertices, setting.mesh.faces[held]))
        says = {"of": "faces", "box_mm": [list(low_mm), list(high_mm)]}
    elif not given.words or given.words[0] == "surface":
        tree, says, depth = setting.surface, {"of": "surface"}, True
    else:
        file = Path(given.words[0])
        mesh, sha256 = _mesh_in_place(file, setting.origin_mm, closed=False)
        tree, says = triangle_tree(mesh), {"of": file.name, "sha256": sha256}
    quantity = partial(_from_surface, tree, depth)
    if not depth:
        return _ramp(given, setting, quantity, exact=True).along(quantity, "distance", says)
    start, stop = given.number("from") or 0.0, given.number("to")
    ramp = Ramp(start, setting.greatest(quantity) if stop is None else stop)
    return ramp.along(quantity, "distance", says)


def _harmonic(given: FieldArguments, setting: Setting) -> Field:
    if len(given.named) < 2:
        raise ArgumentError(
            "field harmonic: give both end regions, as in from=x<3, to=ball 40 0 5 6"
        )
    start, end = given.region("from"), given.region("to")
    return harmonic_field(setting.mesh, start, end, setting.pitch_mm, setting.origin_mm)


def _geodesic(given: FieldArguments, setting: Setting) -> Field:
    if "start" not in given.named:
        raise ArgumentError("field geodesic: give where ways begin, as in start=x<3")
    region, ends = given.region("start"), (given.number("from"), given.number("to"))
    return geodesic_field(setting.mesh, region, setting.pitch_mm, ends, setting.origin_mm)


def _expression(given: FieldArguments, setting: Setting) -> Field:
    text = given.words[0].strip().strip('"')
    formula, used = _formula(text)
    along = axis_field(None, setting.mesh)

    def valued(points_mm: FloatArray) -> FloatArray:
        x, y, z = (points_mm - np.array(setting.origin_mm)).T
        known: dict[str, _Value] = {"x": x, "y": y, "z": z, **_CONSTANTS}
        if "r" in used:
            known["r"] = np.sqrt(x * x + y * y)
        if "d" in used:
            known["d"] = _from_surface(setting.surface, True, points_mm)
        if "u" in used:
            known["u"] = along.values(points_mm)
        with np.errstate(all="ignore"):  # what is not finite is told with its place
            found = np.asarray(formula(known), dtype=np.float64)
        return np.array(np.broadcast_to(found, len(points_mm)))

    def values(points_mm: FloatArray) -> FloatArray:
        found = valued(points_mm)
        if (bad := ~np.isfinite(found)).any():
            held = setting.surface.moved_within(points_mm[bad], _DEPTH_MM)
            found[bad] = again = valued(held)
            if not np.isfinite(again).all():
                first = int(np.argmin(np.isfinite(again)))
                place = place_text(held[first] - setting.origin_mm)
                raise ArgumentError(
                    f"expression {text!r}: it is {again[first]} at {place}; it must be finite "
                    "over the part"
                )
        return found

    says = {"expression": text, "origin_mm": list(setting.origin_mm)}
    return FunctionField("expression", values, says)


def _table(given: FieldArguments, setting: Setting) -> Field:
    path = _file(given, ".csv, .npy or .vti")
    first, step = given.triple("origin"), given.triple("step")
    lies = (first, step) if first and step else None
    if (first or step) and path.suffix.casefold() in (".csv", ".vti"):
        raise ArgumentError(
            f"field table: {path.name} says itself where it lies; leave out origin= and step="
        )
    table = read_grid_table(path, array=given.named.get("array"), lies=lies)
    return _tabled(path.name, table, given, setting)


def _tabled(name: str, table: GridTable, given: FieldArguments, setting: Setting) -> Field:
    corner = np.array(table.first_mm) - 0.5 * np.array(table.spacing_mm) + setting.origin_mm
    nx, ny, nz = table.values.shape
    quantity = over_cells(Grid(as_point(corner), table.spacing_mm, (nx, ny, nz)), table.values)
    says = {"file": name, "sha256": table.sha256}
    says |= _outside(name, corner, corner + np.multiply(table.spacing_mm, (nx, ny, nz)), setting)
    if given.named.get("array"):
        says["array"] = given.named["array"]
    return _ramp(given, setting, quantity).along(quantity, "table", says, length=False)


@dataclass(frozen=True)
class TableFile:
    """A table of values beside a plan, and which of them are its field: as it stands, 0 to 1.

    Attributes
    ----------
    data
        The file's bytes, where it is not yet written.
    """

    path: Path
    array: str
    data: bytes | None = None

    def field(self, setting: Setting) -> Field:
        """Return the field of the values."""
        table = read_grid_table(self.path, array=self.array, data=self.data)
        named = {"array": self.array, "from": "0", "to": "1"}
        given = FieldArguments("table", (), named, setting.origin_mm)
        return _tabled(self.path.name, table, given, setting)


def field_of(says: Mapping[str, Any], origin_mm: Point, folder: Path | None) -> str | TableFile:
    """Return a plan's field as `build_field` takes it; see `field_text`.

    Parameters
    ----------
    folder
        The plan's own, if it has one: a table there is read from there.
    """
    ours = says.get("name") == "table" and says.get("array") and (says.get("from"), says.get("to"))
    if folder is not None and ours == (0.0, 1.0):
        path = path_within(folder, str(says["file"]))
        if path.is_file() and hashlib.sha256(read_file(path)).hexdigest() == says.get("sha256"):
            return TableFile(path, str(says["array"]))
    return field_text(says, origin_mm)


def _points(given: FieldArguments, setting: Setting) -> Field:
    path = _file(given, ".csv or .vtu")
    points, values, sha256 = read_point_table(path, array=given.named.get("array"))
    at, ends = points + np.array(setting.origin_mm), (given.number("from"), given.number("to"))
    outside = _outside(path.name, at.min(axis=0), at.max(axis=0), setting)
    which = {key: text for key, text in given.named.items() if key == "array"}
    return points_field({"file": path.name, "sha256": sha256, **outside, **which}, at, values, ends)


_OUTSIDE = 0.01
"""Share of a part beyond a table that is told. Chosen: grids may end short of a rounded face."""


def _outside(name: str, low: FloatArray, high: FloatArray, setting: Setting) -> dict[str, Any]:
    """Return what a plan says of the share of the part that lies outside a table's box.

    Raises
    ------
    ArgumentError
        All of it does: the table is that of something else.
    """
    samples, reach = setting.samples_mm, 1e-9 * np.ptp(setting.mesh.bounds_mm)
    beyond = ((samples < low - reach) | (samples > high + reach)).any(axis=1).mean()
    if beyond == 1.0:
        table, part = (
            " x ".join(f"{a:.4g}..{b:.4g}" for a, b in (np.array(box) - setting.origin_mm).T)
            for box in ((low, high), setting.mesh.bounds_mm)
        )
        raise ArgumentError(
            f"field: {name} holds values for {table} mm, where nothing of the part is, which lies "
            f"in {part} mm; check its origin and its unit"
        )
    return {"outside": float(beyond)} if beyond > _OUTSIDE else {}


def _file(given: FieldArguments, endings: str) -> Path:
    if not given.words:
        raise ArgumentError(f"field {given.kind}: give a file ({endings})")
    return Path(given.words[0])


_Build = Callable[[FieldArguments, Setting], Field]

# How each field is built; the keys that it takes (None: its text as it stands), and how many words.
_KINDS: Mapping[str, tuple[_Build, tuple[str, ...] | None, int]] = {
    "axis": (_axis, None, 1),
    "radial": (_radial, ("point", "line", "from", "to"), 0),
    "distance": (_distance, ("plane", "hole", "box", "from", "to"), 1),
    "harmonic": (_harmonic, ("from", "to"), 0),
    "geodesic": (_geodesic, ("start", "from", "to"), 0),
    "expression": (_expression, None, 1),
    "table": (_table, ("array", "origin", "step", "from", "to"), 1),
    "points": (_points, ("array", "from", "to"), 1),
}


# ------------------------------------------------------------------------------------------------
# A field as a user writes it: NAME: arguments, or min, max, blend, clamp of such.


_COMPOSED = re.compile(r"^\s*(\w+)\s*\((.*)\)\s*$", re.DOTALL)
_NAMED = re.compile(r"^\s*([\w-]+)\s*(?::(.*))?$", re.DOTALL)
_FIELD_DEEPEST = 20
_RULES = {
    "min": "(field; field; ...)",
    "max": "(field; field; ...)",
    "blend": "(field; field; weight 0 to 1)",
    "clamp": "(field; lowest; highest)",
}


def build_field(wish: object, setting: Setting) -> Field:
    """Build a field over a placed part.

    Parameters
    ----------
    wish
        Text such as ``radial: point=0 0 5, to=12`` or ``min(axis: x; distance: surface)``; a
        `Field` in the coordinates of the placed part; or a function of points (n, 3) in the
        part's own coordinates.
    setting
        The part, where it was placed, and the pitch.

    Raises
    ------
    ArgumentError
        No such field, or arguments that it does not take; the message says what is near.
    """
    if isinstance(wish, str):
        return _parse(wish, setting, 0)
    if isinstance(wish, TableFile):
        return wish.field(setting)
    if isinstance(wish, Field):
        return wish
    if callable(wish):
        return _user_function(wish, setting.origin_mm)
    raise ArgumentError(
        f"field is a {type(wish).__name__}; give text, a planner Field, or a function of points"
    )


def _user_function(function: Callable[[FloatArray], FloatArray], origin_mm: Point) -> Field:
    """Return what a function of points in the part's own coordinates returns, as a field."""
    called = getattr(function, "__qualname__", type(function).__name__)

    def values(points_mm: FloatArray) -> FloatArray:
        return np.asarray(function(points_mm - np.array(origin_mm)), dtype=np.float64)

    return FunctionField("function", values, {"function": called, "origin_mm": list(origin_mm)})


def _parse(text: str, setting: Setting, depth: int) -> Field:
    if depth > _FIELD_DEEPEST:
        raise ArgumentError(f"`field`: fields are nested deeper than {_FIELD_DEEPEST}")
    composed = _COMPOSED.match(text)
    if composed and composed[1] in _RULES:
        return _composed(composed[1], _parts(composed[2]), text, setting, depth + 1)
    named = _NAMED.match(text)
    name = named[1] if named else text.split("(")[0].split(":")[0].strip()
    if named is None or name not in _KINDS:
        hint = did_you_mean(name, [*_KINDS, *_RULES])
        if name in _RULES:
            hint = f"write {name}{_RULES[name]}; "
        raise ArgumentError(
            f"`field` {text.strip()!r}: there is no field {name!r}; {hint}there are "
            f"{', '.join(_KINDS)}, and {', '.join(_RULES)} of such, as in min(axis: x; axis: y)"
        )
    build, keys, words = _KINDS[name]
    given = FieldArguments.parse(name, named[2] or "", keys, words, setting.origin_mm)
    return build(given, setting)


def _parts(text: str) -> list[str]:
    """Split at semicolons outside parentheses."""
    parts, depth, last = [], 0, 0
    for place, letter in enumerate(text):
        depth += (letter == "(") - (letter == ")")
        if letter == ";" and depth == 0:
            parts.append(text[last:place])
            last = place + 1
    return [*parts, text[last:]]


def _composed(rule: str, parts: list[str], text: str, setting: Setting, depth: int) -> Field:
    wish, numbers = f"`field` {text.strip()!r}", dict[str, float]()
    if len(parts) < 2 if rule in ("min", "max") else len(parts) != 3:
        raise ArgumentError(f"{wish}: {rule} takes {_RULES[rule]}")
    if rule == "blend":
        *parts, last = parts
        numbers = {"weight": _number(last, wish)}
        if not 0.0 <= numbers["weight"] <= 1.0:
            raise ArgumentError(f"{wish}: the weight {numbers['weight']:g} is not 0 to 1")
    elif rule == "clamp":
        low, high = (_number(part, wish) for part in parts[1:])
        if not low < high:
            raise ArgumentError(f"{wish}: {low:g} is not below {high:g}")
        parts, numbers = parts[:1], {"low": low, "high": high}
    fields = [_parse(part, setting, depth) for part in parts]

    def values(points_mm: FloatArray) -> FloatArray:
        found = [one.values(points_mm) for one in fields]
        if rule == "blend":
            return (1.0 - numbers["weight"]) * found[0] + numbers["weight"] * found[1]
        if rule == "clamp":
            return np.clip(found[0], numbers["low"], numbers["high"])
        return np.asarray((np.minimum if rule == "min" else np.maximum).reduce(found))

    return FunctionField(rule, values, {"fields": [one.description() for one in fields], **numbers})


def _number(part: str, wish: str) -> float:
    with refused(ArgumentError, wish, f"{part.strip()!r} must be a number", ValueError):
        return float(part)


# ------------------------------------------------------------------------------------------------
# The way back: from what a plan says of its field to the text that builds it again.


def field_text(says: Mapping[str, Any], origin_mm: Point) -> str:
    """Return a field, as its description tells it, as a user would write it.

    Parameters
    ----------
    says
        `Field.description`, positions as placed.
    origin_mm
        Where the part's own origin lay then.

    Raises
    ------
    ArgumentError
        The field is made of a file or a function, which its description does not hold.
    FileError
        No description that planner writes.
    """
    said = "it is not one that planner writes ({}); give the field again with `field` or `axis`"
    with refused(FileError, "plan.json: gradient.field", said, KeyError, TypeError, ValueError):
        return _text_of(says, origin_mm)


def _text_of(says: Mapping[str, Any], origin_mm: Point) -> str:
    name = says["name"]
    if name in _RULES:
        parts = [_text_of(one, origin_mm) for one in says["fields"]]
        numbers = [repr(float(says[key])) for key in ("weight", "low", "high") if key in says]
        return f"{name}({'; '.join([*parts, *numbers])})"
    if name == "axis":
        normal = [float(c) for c in says["direction"]]
        start = float(says["start_mm"]) - float(np.dot(normal, origin_mm))
        stop = start + float(says["span_mm"])
        plane = " ".join(map(repr, [0.0, 0.0, 0.0, *normal]))
        return f"distance: plane={plane}, from={start!r}, to={stop!r}"
    if name == "expression":
        text = str(says["expression"])
        if ";" in text:  # it would part this field into several, such as a table from any file
            raise ValueError(f"expression {text!r} holds a ';'")
        return f"expression: {text}"
    if name == "harmonic":
        first, last = (_region_text(says[key], origin_mm) for key in ("from", "to"))
        return f"harmonic: from={first}, to={last}"
    told = [f"{end}={float(says[f'{end}_mm'])!r}" for end in ("from", "to") if "to_mm" in says]
    ends = ", ".join(told)
    if name == "geodesic":
        return f"geodesic: start={_region_text(says['start'], origin_mm)}, {ends}"
    if name == "radial" and "direction" in says:
        return f"radial: line={_words(says, 'point_mm', origin_mm, *says['direction'])}, {ends}"
    if name == "radial":
        return f"radial: point={_words(says, 'centre_mm', origin_mm)}, {ends}"
    of = says.get("of") if name == "distance" else None
    if of == "surface":
        return f"distance: surface, {ends}"
    if of == "hole":
        return f"distance: hole={_words(says, 'point_mm', origin_mm)}, {ends}"
    if of == "faces":
        return f"distance: box={_words(says, 'box_mm', origin_mm)}, {ends}"
    raise _not_held(name, says.get("file") or says.get("function") or of)


def _region_text(says: Mapping[str, Any], origin_mm: Point) -> str:
    if "box_mm" in says:
        return f"box {_words(says, 'box_mm', origin_mm)}"
    if "radius_mm" in says:
        return f"ball {_words(says, 'centre_mm', origin_mm, says['radius_mm'])}"
    if "normal" in says:
        return f"plane {_words(says, 'point_mm', origin_mm, *says['normal'])}"
    raise _not_held("region", says["file"])


def _not_held(name: str, made_of: object) -> ArgumentError:
    return ArgumentError(
        f"the plan's field, {name}, is made of {made_of}, which plan.json does not hold: give the "
        "field again with `field`"
    )


def _words(says: Mapping[str, Any], key: str, origin_mm: Point, *more: float) -> str:
    """Return a position, or corners of a box, in the part's own coordinates, and more numbers."""
    corners = says[key] if key == "box_mm" else [says[key]]
    own = [float(c) - o for corner in corners for c, o in zip(corner, origin_mm, strict=True)]
    return " ".join(map(repr, [*own, *map(float, more)]))
