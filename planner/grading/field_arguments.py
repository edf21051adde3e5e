"""The arguments of a field as text: words, key=value pairs, numbers, regions."""

import math
import re
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planner.arrays import FloatArray
from planner.errors import ArgumentError, MeshError, nearest_names
from planner.formats.mesh_file import EXTENSIONS, read_mesh
from planner.geometry.fields.region import Ball, Box, HalfSpace, Region, inside_mesh
from planner.geometry.mesh import Mesh
from planner.geometry.part import make_part

__all__ = ["FieldArguments", "mesh_in_place"]

_HALF = re.compile(r"^\s*([xyz])\s*([<>])=?\s*(\S+)\s*$")
_REGIONS = (
    "x<3, z>=20, box X0 Y0 Z0 X1 Y1 Z1, ball X Y Z RADIUS, plane PX PY PZ NX NY NZ (beyond it, "
    "where N points), or a closed mesh file"
)

Point = tuple[float, float, float]


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
        cls, kind: str, text: str, keys: Collection[str], origin_mm: Point, words: int = 0
    ) -> "FieldArguments":
        """Split at commas, and refuse keys that the field does not have.

        Raises
        ------
        ArgumentError
            An unknown or repeated key, or more words than `words`.
        """
        bare, named = [], dict[str, str]()
        for item in filter(None, (part.strip() for part in text.split(","))):
            key, equals, value = item.partition("=")
            key = key.strip()
            if not equals or not key.isidentifier():
                bare.append(item)
                continue
            if key not in keys:
                near = nearest_names(key, list(keys))
                hint = f"did you mean {near[0]}=? " if near else ""
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

    def numbers(self, key: str, count: int) -> list[float]:
        """Return so many numbers.

        Raises
        ------
        ArgumentError
            Another count, or none.
        """
        return self._numbers(self.named[key], f"{key}=", count)

    def point(self, key: str) -> Point:
        """Return a position as placed for printing."""
        x, y, z = self.numbers(key, 3)
        return self._placed(x, y, z)

    def line(self, key: str) -> tuple[Point, Point]:
        """Return a position as placed, and a unit direction."""
        x, y, z, a, b, c = self.numbers(key, 6)
        return self._placed(x, y, z), self._unit((a, b, c), f"{key}=")

    def box(self, key: str) -> Box:
        """Return a box as placed."""
        return self._box(self.numbers(key, 6))

    def region(self, key: str) -> Region:
        """Return a region as placed.

        Raises
        ------
        ArgumentError, FileError
            It is none, or its mesh cannot be read.
        """
        text = self.named[key]
        half = _HALF.match(text)
        what = f"{key}="
        if half:
            axis = "xyz".index(half[1])
            value = self._numbers(half[3], what, 1)[0]
            sign = 1.0 if half[2] == ">" else -1.0
            at, normal = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
            at[axis], normal[axis] = value + self.origin_mm[axis], sign
            return HalfSpace((at[0], at[1], at[2]), (normal[0], normal[1], normal[2]))
        word, _, rest = text.strip().partition(" ")
        if word == "box":
            return self._box(self._numbers(rest, what, 6))
        if word == "ball":
            x, y, z, radius = self._numbers(rest, what, 4)
            if radius <= 0.0:
                raise ArgumentError(f"field {self.kind}: {what} has a radius of {radius:g} mm")
            return Ball(self._placed(x, y, z), radius)
        if word == "plane":
            x, y, z, a, b, c = self._numbers(rest, what, 6)
            return HalfSpace(self._placed(x, y, z), self._unit((a, b, c), what))
        if Path(text).suffix.casefold().lstrip(".") in EXTENSIONS:
            mesh, sha256 = mesh_in_place(Path(text), self.origin_mm)
            return inside_mesh(mesh, Path(text).name, sha256)
        raise ArgumentError(f"field {self.kind}: {what}{text!r} is no region; it may be {_REGIONS}")

    def _numbers(self, text: str, what: str, count: int) -> list[float]:
        try:
            found = [float(word) for word in text.split()]
        except ValueError:
            found = []
        if len(found) != count or not all(map(math.isfinite, found)):
            raise ArgumentError(
                f"field {self.kind}: {what}{text.strip()!r} must be {count} number"
                f"{'s, parted by spaces' if count > 1 else ''}"
            )
        return found

    def _placed(self, x: float, y: float, z: float) -> Point:
        a, b, c = self.origin_mm
        return x + a, y + b, z + c

    def _unit(self, direction: Point, what: str) -> Point:
        length = math.hypot(*direction)
        if length == 0.0:
            raise ArgumentError(f"field {self.kind}: {what} has a direction of length zero")
        a, b, c = direction
        return a / length, b / length, c / length

    def _box(self, corners: list[float]) -> Box:
        low, high = np.minimum(corners[:3], corners[3:]), np.maximum(corners[:3], corners[3:])
        return Box(self._placed(*low.tolist()), self._placed(*high.tolist()))


def mesh_in_place(path: Path, origin_mm: Point, *, closed: bool = True) -> tuple[Mesh, str]:
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
