"""The fields that have a name, each built from its arguments."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import MappingProxyType

import numpy as np

from planner.arrays import FloatArray
from planner.errors import ArgumentError
from planner.formats.field_file import read_grid_table, read_point_table
from planner.geometry.columns import Grid
from planner.geometry.fields import AxisField, Field, axis_field
from planner.geometry.fields.cells import CellValues, cells_of, solve_pitch_mm
from planner.geometry.fields.distance import DistanceField
from planner.geometry.fields.expression import ExpressionField, parse_expression
from planner.geometry.fields.geodesic import geodesic_field
from planner.geometry.fields.harmonic import harmonic_field
from planner.geometry.fields.patch import faces_within, smooth_patch
from planner.geometry.fields.radial import LineField, PointField
from planner.geometry.fields.ramp import Ramp
from planner.geometry.fields.table import TableField, points_field
from planner.geometry.fields.triangle_tree import TriangleTree, triangle_tree
from planner.geometry.mesh import Mesh
from planner.grading.field_arguments import FieldArguments, Point, mesh_in_place

__all__ = ["KINDS", "Setting"]

_SAMPLES = 100_000  # cells of the part's box, for the range of a quantity over the part


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
        extent_mm = np.ptp(self.mesh.bounds_mm, axis=0)
        coarse = float(np.cbrt(extent_mm.prod() / _SAMPLES))
        grid, inside = cells_of(self.mesh, max(coarse, float(extent_mm.max()) / 4000.0))
        return np.concatenate([self.mesh.vertices, grid.centre_mm(np.argwhere(inside))])

    @cached_property
    def surface(self) -> TriangleTree:
        """The part's surface, for distances."""
        return triangle_tree(self.mesh)


def _ramp(
    arguments: FieldArguments, setting: Setting, quantity: Callable[[FloatArray], FloatArray]
) -> Ramp:
    """Return where the gradient starts and ends: over all of the part if not said."""
    start, stop = arguments.number("from"), arguments.number("to")
    if start is None or stop is None:
        found = quantity(setting.samples_mm)
        start = float(found.min()) if start is None else start
        stop = float(found.max()) if stop is None else stop
    return Ramp(start, stop)


def _axis(text: str, setting: Setting) -> Field:
    words = text.replace(",", " ").split()
    return axis_field(",".join(words) if words else None, setting.mesh)


def _radial(text: str, setting: Setting) -> Field:
    given = FieldArguments.parse("radial", text, ("point", "line", "from", "to"), setting.origin_mm)
    unit = Ramp(0.0, 1.0)
    if given.only("point", "line") == "line":
        point, direction = given.line("line")
        ramp = _ramp(given, setting, LineField(point, direction, unit).values)
        return LineField(point, direction, ramp)
    if "point" in given.named:
        centre = given.point("point")
    else:
        x, y, z = setting.mesh.bounds_mm.mean(axis=0).tolist()
        centre = (x, y, z)
    return PointField(centre, _ramp(given, setting, PointField(centre, unit).values))


def _distance(text: str, setting: Setting) -> Field:
    keys = ("plane", "hole", "box", "from", "to")
    given = FieldArguments.parse("distance", text, keys, setting.origin_mm, words=1)
    which = given.only("plane", "hole", "box")
    if which and given.words:
        raise ArgumentError(f"field distance: give {given.words[0]} or {which}=, not both")
    if which == "plane":
        point, normal = given.line("plane")
        offset = float(np.dot(point, normal))
        ramp = _ramp(given, setting, AxisField(normal, offset, 1.0).values)
        if ramp.stop > ramp.start:
            return AxisField(normal, offset + ramp.start, ramp.stop - ramp.start)
        back = (-normal[0] + 0.0, -normal[1] + 0.0, -normal[2] + 0.0)
        return AxisField(back, -(offset + ramp.start), ramp.start - ramp.stop)
    signed = 0
    origin: dict[str, object]
    if which == "hole":
        picked = given.point("hole")
        tree = triangle_tree(smooth_patch(setting.mesh, np.array(picked)))
        origin = {"of": "hole", "point_mm": list(picked)}
    elif which == "box":
        box = given.box("box")
        patch = faces_within(setting.mesh, np.array(box.low_mm), np.array(box.high_mm))
        if not len(patch.faces):
            raise ArgumentError(
                "field distance: no face of the part lies wholly in box=; make it larger"
            )
        tree, origin = triangle_tree(patch), {"of": "faces", **box.description()}
    elif not given.words or given.words[0] == "surface":
        tree, origin, signed = setting.surface, {"of": "surface"}, 1
    else:
        file = Path(given.words[0])
        mesh, sha256 = mesh_in_place(file, setting.origin_mm, closed=False)
        tree, origin = triangle_tree(mesh), {"of": file.name, "sha256": sha256}
    plain = DistanceField(origin, Ramp(0.0, 1.0), tree, signed)
    if signed and "from" not in given.named:
        given.named["from"] = "0"
    return DistanceField(origin, _ramp(given, setting, plain.distance_mm), tree, signed)


def _harmonic(text: str, setting: Setting) -> Field:
    given = FieldArguments.parse("harmonic", text, ("from", "to"), setting.origin_mm)
    if len(given.named) < 2:
        raise ArgumentError(
            "field harmonic: give both end regions, as in from=x<3, to=ball 40 0 5 6"
        )
    pitch_mm = solve_pitch_mm(setting.mesh, setting.pitch_mm)
    start, end = given.region("from"), given.region("to")
    return harmonic_field(setting.mesh, start, end, pitch_mm, setting.origin_mm)


def _geodesic(text: str, setting: Setting) -> Field:
    given = FieldArguments.parse("geodesic", text, ("start", "from", "to"), setting.origin_mm)
    if "start" not in given.named:
        raise ArgumentError("field geodesic: give where ways begin, as in start=x<3")
    pitch_mm = solve_pitch_mm(setting.mesh, setting.pitch_mm)
    return geodesic_field(
        setting.mesh,
        given.region("start"),
        pitch_mm,
        given.number("from"),
        given.number("to"),
        setting.origin_mm,
    )


def _expression(text: str, setting: Setting) -> Field:
    text = text.strip().strip('"')
    parse_expression(text)
    along = axis_field(None, setting.mesh)

    def depth(points_mm: FloatArray) -> FloatArray:
        return DistanceField({}, Ramp(0.0, 1.0), setting.surface, 1).distance_mm(points_mm)

    return ExpressionField(text, setting.origin_mm, {"d": depth, "u": along.values})


def _table(text: str, setting: Setting) -> Field:
    keys = ("array", "origin", "step", "from", "to")
    given = FieldArguments.parse("table", text, keys, setting.origin_mm, words=1)
    if not given.words:
        raise ArgumentError("field table: give a file (.csv, .npy or .vti)")
    path = Path(given.words[0])
    first = given.numbers("origin", 3) if "origin" in given.named else None
    step = given.numbers("step", 3) if "step" in given.named else None
    table = read_grid_table(
        path,
        array=given.named.get("array"),
        first_mm=None if first is None else (first[0], first[1], first[2]),
        spacing_mm=None if step is None else (step[0], step[1], step[2]),
    )
    corner = np.array(table.first_mm) - 0.5 * np.array(table.spacing_mm) + setting.origin_mm
    x, y, z = corner.tolist()
    nx, ny, nz = table.values.shape
    cells = CellValues(Grid((x, y, z), table.spacing_mm, (nx, ny, nz)), table.values)
    return TableField(path.name, table.sha256, _ramp(given, setting, cells.at), cells)


def _points(text: str, setting: Setting) -> Field:
    given = FieldArguments.parse("points", text, ("array", "from", "to"), setting.origin_mm, 1)
    if not given.words:
        raise ArgumentError("field points: give a file (.csv or .vtu)")
    path = Path(given.words[0])
    table = read_point_table(path, array=given.named.get("array"))
    at = table.points_mm + np.array(setting.origin_mm)
    return points_field(
        path.name, table.sha256, at, table.values, given.number("from"), given.number("to")
    )


KINDS: Mapping[str, Callable[[str, Setting], Field]] = MappingProxyType(
    {
        "axis": _axis,
        "radial": _radial,
        "distance": _distance,
        "harmonic": _harmonic,
        "geodesic": _geodesic,
        "expression": _expression,
        "table": _table,
        "points": _points,
    }
)
