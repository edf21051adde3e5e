"""Draw printability.svg from what planner finds: python docs/explanation/make_printability.py.

Small parts that show one finding each, and one whose cut is moved, are graded; their shells are cut
in the middle and drawn with the place and size that the finding tells.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import manifold3d
import numpy as np

import planner
from planner.grading.snap import snap_limit_mm
from planner.plan import Shell
from planner.printers import load_printer
from planner.report.svg import INK, in_rows, picture, rectangle, segment, text

TARGET = Path(__file__).with_name("printability.svg")
MACHINE = load_printer("connex3")
COLOURS = {material.id: material.colour for material in MACHINE.palette().materials}
FOUND, ASKED = "#c0392b", "#666666"
PX_PER_MM, WIDE, HIGH = 40.0, 256.0, 214.0
LONG_MM, DEPTH_MM, HIGH_MM = 5.0, 3.0, 2.5
SOFT, MIDDLE, HARD = 0.6, 1.03, 1.76  # MPa: FLX9740, FLX9750, FLX9760

Mesh = tuple[np.ndarray, np.ndarray]


def extruded(*outline: tuple[float, float]) -> Mesh:
    """Return a part of one outline in x and z, deep along y."""
    section = manifold3d.CrossSection([np.array(outline)])
    solid = manifold3d.Manifold.extrude(section, DEPTH_MM)
    return mesh(solid.rotate((90.0, 0.0, 0.0)).translate((0.0, DEPTH_MM, 0.0)))


def mesh(solid: manifold3d.Manifold) -> Mesh:
    """Return corners and triangles of a solid."""
    whole = solid.to_mesh()
    return np.asarray(whole.vert_properties, dtype=float)[:, :3], np.asarray(whole.tri_verts)


def roofs() -> Mesh:
    """Return a plate with three pyramids on it."""
    solid = manifold3d.Manifold.cube((LONG_MM, DEPTH_MM, 1.2))
    for x in (0.9, 2.5, 4.1):
        roof = manifold3d.Manifold.cylinder(1.2, 0.8, 0.0, 4).rotate((0.0, 0.0, 45.0))
        solid += roof.translate((x, DEPTH_MM / 2.0, 1.2))
    return mesh(solid)


FIN = ((0, 0), (5, 0), (5, 1), (3, 1), (3, 2.5), (2.5, 2.5), (2.5, 1), (0, 1))
SLOT = ((0, 0), (5, 0), (5, 2.5), (2.65, 2.5), (2.65, 0.8), (2.35, 0.8), (2.35, 2.5), (0, 2.5))
BLOCK = ((0, 0), (5, 0), (5, 2.5), (0, 2.5))
STEP = ((0, 0), (5, 0), (5, 1.35), (2, 1.35), (2, 2.5), (0, 2.5))
TWO_AT_HALF = ((0.0, SOFT), (0.5, SOFT), (0.501, MIDDLE), (1.0, MIDDLE))


@dataclass(frozen=True)
class Example:
    """A part to grade, whether it is measured along x or z, and the limit it is held to."""

    title: str
    part: Mesh
    axis: str
    profile: Sequence[tuple[float, float]]
    across: str
    limit: tuple[str, float]
    snap_mm: float | None = 0.0


WALL = ("minimum wall", MACHINE.minimum_wall_mm)
FEATURE = ("smallest feature", MACHINE.minimum_feature_mm)
MOVE = ("half the minimum wall", snap_limit_mm(None, MACHINE))
GENTLE = ((0.0, SOFT), (1.0, HARD))
EXAMPLES = (
    Example("thin-wall", extruded(*FIN), "x", GENTLE, "x", WALL),
    Example(
        "thin-band",
        extruded(*BLOCK),
        "x",
        ((0.0, SOFT), (0.44, SOFT), (0.47, MIDDLE), (0.54, HARD), (1.0, HARD)),
        "x",
        FEATURE,
    ),
    Example(
        "fragment",
        roofs(),
        "z",
        ((0.0, SOFT), (0.85, SOFT), (0.851, MIDDLE), (1.0, MIDDLE)),
        "z",
        FEATURE,
    ),
    Example("gap", extruded(*SLOT), "x", GENTLE, "x", FEATURE),
    Example("a cut beside a face (--snap 0)", extruded(*STEP), "z", TWO_AT_HALF, "z", FEATURE),
    Example("the same cut, moved", extruded(*STEP), "z", TWO_AT_HALF, "z", MOVE, None),
)
WHAT = {"thin-wall": "a wall", "thin-band": "a layer", "fragment": "separate bits", "gap": "a gap"}


def figure() -> bytes:
    """Grade the examples and draw what is found."""
    panels, width, bottom = in_rows(list(map(panel, EXAMPLES)), 3, (20.0, 58.0), (WIDE, HIGH))
    title = "What will not print, and a cut that is moved"
    whole = [*panels, *legend(20.0, bottom + 6.0)]
    return picture(width + 20.0, bottom + 30.0, whole, title=title)


def panel(example: Example) -> Callable[[float, float], Iterator[str]]:
    """Return what draws one example: its section, the finding's place and size, the limit."""
    snap = {} if example.snap_mm is None else {"snap_mm": example.snap_mm}
    plan = planner.grade(
        example.part, name="part", axis=example.axis, profile=list(example.profile), **snap
    )

    def draw(left: float, top: float) -> Iterator[str]:
        low = np.min([shell.vertices.min(axis=0) for shell in plan.shells], axis=0)

        def at(x_mm: float, z_mm: float) -> tuple[float, float]:
            return (
                left + PX_PER_MM * (x_mm - low[0]),
                top + 24.0 + PX_PER_MM * (HIGH_MM - (z_mm - low[2])),
            )

        yield text(left, top, example.title, size=14.0)
        middle = low[1] + DEPTH_MM / 2.0
        for shell in plan.shells:
            yield filled([[at(*p) for p in ring] for ring in section(shell, middle)],
                         COLOURS[shell.material])  # fmt: skip
        foot = top + 24.0 + PX_PER_MM * HIGH_MM + 22.0
        if plan.findings:
            (found,) = plan.findings
            x, _, z = found.place_mm
            yield from squeezed(at(x, z), found.size_mm * PX_PER_MM, example.across)
            said = f"{WHAT[found.kind]} of {found.size_mm:.2f} mm"
            yield text(left, foot, said, colour=FOUND)
        else:
            (moved,) = plan.gradient.snap["moved"]
            now = min(s.vertices[:, 2].min() for s in plan.shells if s is not plan.shells[0])
            asked = float(now) - moved["by_mm"]
            yield segment(
                at(low[0], asked), at(low[0] + LONG_MM, asked), colour=ASKED, width=1.5, dash="5,4"
            )
            said = f"moved by {moved['by_mm']:.2f} mm; dashed: as asked"
            yield text(left, foot, said, colour=ASKED)
        name, limit_mm = example.limit
        # The limit to the same scale, and in words.
        yield rectangle(left, foot + 12.0, limit_mm * PX_PER_MM, 5.0, colour=INK)
        yield text(left + 32.0, foot + 18.0, f"limit: {name}, {limit_mm:g} mm")

    return draw


def section(shell: Shell, y_mm: float) -> list[np.ndarray]:
    """Return the outlines, in x and z, of a shell cut at a y."""
    corners = np.asarray(shell.vertices, dtype=np.float32)
    solid = manifold3d.Manifold(manifold3d.Mesh(corners, np.asarray(shell.faces, dtype=np.uint32)))
    # y becomes the height, and z what y was, turned over.
    cut = solid.rotate((90.0, 0.0, 0.0)).slice(y_mm)
    return [np.asarray(ring) * (1.0, -1.0) for ring in cut.to_polygons()]


def filled(rings: Sequence[Sequence[tuple[float, float]]], colour: str) -> str:
    """Fill outlines of the picture."""
    path = "".join("M" + "L".join(f"{x:.2f},{y:.2f}" for x, y in ring) + "Z" for ring in rings)
    return f'<path d="{path}" fill="{colour}" fill-rule="evenodd"/>'


def squeezed(
    place: tuple[float, float], size: float, across: str, arm: float = 22.0
) -> Iterator[str]:
    """Draw two arrows towards each other, a size apart, along x or z."""
    for side in (-1.0, 1.0):
        tip = 0.5 * size * side
        for start, stop in (
            ((tip + arm * side, 0.0), (tip, 0.0)),
            ((tip + 7.0 * side, 4.0), (tip, 0.0)),
            ((tip + 7.0 * side, -4.0), (tip, 0.0)),
        ):
            ends = [(a, b) if across == "x" else (b, a) for a, b in (start, stop)]
            moved = [(place[0] + x, place[1] + y) for x, y in ends]
            yield segment(moved[0], moved[1], colour=FOUND, width=2.0)


def legend(left: float, top: float) -> Iterator[str]:
    """Draw the materials' colours with their names."""
    for name in ("FLX9740", "FLX9750", "FLX9760"):
        yield rectangle(left, top - 10.0, 12.0, 12.0, colour=COLOURS[name])
        yield text(left + 18.0, top, name, colour=INK)
        left += 92.0
    yield text(left, top, "parts 5 mm long, cut in the middle; sizes as planner finds them")


if __name__ == "__main__":
    TARGET.write_bytes(figure())
