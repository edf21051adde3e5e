"""Make the sample parts: python samples/make_samples.py [FOLDER].

- dogbone.stl: tensile specimen after ASTM D638 type IV, 115 x 19 x 4 mm.
- dogbone-thesis.stl: the same scaled by 0.891, as Hemleben's 2017 thesis tested "a scaled size of
  Type IV". The thesis does not print the scale; its 1 mm/s and a strain rate of 0.034 /s make the
  narrow section 29.4 mm long, where D638 has 33 mm.
- finger.stl: a pneumatic bending finger, 96 mm long, with six chambers and an inlet at its root.
- gripper.stl: a two-jaw compliant gripper, one piece, 100 mm high.
- finger-strain.csv: strain in the finger as it curls, on a grid, as a simulation would write it:
  made up, largest at the top and bottom, towards the tip.
"""

import itertools
import sys
from pathlib import Path

import manifold3d as m3
import numpy as np

from planner.formats.mesh_file import encode_stl

THESIS_SCALE = 29.4 / 33.0
FIRST_CHAMBER = 6.0


def dogbone() -> m3.Manifold:
    """Make an ASTM D638 type IV specimen: 33 x 6 mm narrow section, fillets of 14 and 25 mm."""
    length, grip_width, narrow_width, narrow_length = 115.0, 19.0, 6.0, 33.0
    inner_radius, outer_radius, thickness = 14.0, 25.0, 4.0
    # Along the edge: straight, an arc of the inner radius, an arc of the outer one back to
    # straight. Both turn by the angle at which the half-width has grown from 3 to 9.5 mm.
    rise = 0.5 * (grip_width - narrow_width)
    turn = np.arccos(1.0 - rise / (inner_radius + outer_radius))
    first = np.linspace(0.0, turn, 24)
    edge = [
        (
            0.5 * narrow_length + inner_radius * np.sin(a),
            0.5 * narrow_width + inner_radius * (1 - np.cos(a)),
        )
        for a in first
    ]
    run = (inner_radius + outer_radius) * np.sin(turn)
    edge += [
        (
            0.5 * narrow_length + run - outer_radius * np.sin(a),
            0.5 * grip_width - outer_radius * (1 - np.cos(a)),
        )
        for a in first[::-1][1:]
    ]
    edge += [(0.5 * length, 0.5 * grip_width)]
    quarter = np.array(edge)
    half = np.vstack([quarter, quarter[::-1] * [1, -1]])
    outline = np.vstack([half, half[::-1] * [-1, 1]])
    section = m3.CrossSection([outline[::-1]], m3.FillRule.NonZero)
    # Refined so that a gradient shows on the surface as it would on a scanned or CAD mesh.
    return m3.Manifold.extrude(section, thickness, n_divisions=3).refine_to_length(1.6)


def finger() -> m3.Manifold:
    """Make a bending finger, tip at x = 0: six chambers on a channel over a flat, stiffer floor."""
    length, pitch, chamber, wall, width = 97.0, 14.0, 11.0, 1.8, 16.0
    floor = _box(0.0, length, -width / 2, width / 2, 0.0, 4.0)
    heel = _box(length - 13.0, length, -width / 2, width / 2, 0.0, 4.0)
    solids = [
        floor,
        m3.Manifold.hull(heel + _pin(length - 7.0, 10.0, 7.0, 12.0)),  # the root
        _box(7.0, length - 10.0, -4.0, 4.0, 0.0, 8.6),  # around the channel
        _box(0.0, 8.0, -width / 2, width / 2, 0.0, 8.0),  # the tip
    ]
    cavities = [_box(7.0, length + 1.0, -2.0, 2.0, 4.0, 7.0)]
    for i in range(6):
        x = FIRST_CHAMBER + pitch * i
        solids.append(_chamber(x, chamber, 0.0, 0.0, width))
        cavities.append(_chamber(x, chamber, wall, 4.0, width))
    body = m3.Manifold.batch_boolean(solids, m3.OpType.Add)
    return body - m3.Manifold.batch_boolean(cavities, m3.OpType.Add)


def _chamber(x: float, length: float, wall: float, floor: float, width: float) -> m3.Manifold:
    """Make a bellow with a round top, or with a wall and a floor the cavity in it."""
    half = width / 2 - wall
    box = _box(x + wall, x + length - wall, -half, half, floor, 14.0)
    return m3.Manifold.hull(box + _pin(x + length / 2, 14.5, length / 2 - wall, 2 * half))


def gripper() -> m3.Manifold:
    """Make a palm with two curved jaws on thin hinges and a bore for the actuator."""
    thickness = 12.0
    palm = m3.CrossSection.square([60.0, 24.0]).translate([-30.0, 0.0])
    jaw = []
    for t in np.linspace(0.0, 1.0, 33):
        x, z = 22.0 + 20.0 * np.sin(np.pi * t) * (1 - 0.35 * t) - 14.0 * t, 20.0 + 80.0 * t
        jaw.append(m3.CrossSection.circle(5.5 - 2.2 * t, 40).translate([x, z]))
    half = m3.CrossSection.batch_boolean(
        [m3.CrossSection.batch_hull([a, b]) for a, b in itertools.pairwise(jaw)],
        m3.OpType.Add,
    )
    outline = palm + half + half.mirror([1.0, 0.0])
    plate = m3.Manifold.extrude(outline, thickness).translate([0.0, 0.0, -thickness / 2])
    upright = plate.rotate([90.0, 0.0, 0.0])
    bore = m3.Manifold.cylinder(26.0, 4.0, 4.0, 64).translate([0.0, 0.0, -1.0])
    holes = [
        m3.Manifold.cylinder(40.0, 1.7, 1.7, 32, center=True)
        .rotate([90.0, 0.0, 0.0])
        .translate([x, 0.0, 8.0])
        for x in (-22.0, 22.0)
    ]
    return upright - m3.Manifold.batch_boolean([bore, *holes], m3.OpType.Add)


def _box(x0: float, x1: float, y0: float, y1: float, z0: float, z1: float) -> m3.Manifold:
    return m3.Manifold.cube([x1 - x0, y1 - y0, z1 - z0]).translate([x0, y0, z0])


def _pin(x: float, z: float, radius: float, width: float) -> m3.Manifold:
    """Make a cylinder along y, centred."""
    pin = m3.Manifold.cylinder(width, radius, radius, 48, center=True)
    return pin.rotate([90.0, 0.0, 0.0]).translate([x, 0.0, z])


def parts() -> dict[str, m3.Manifold]:
    """Return every sample by its file's stem, standing on z = 0."""
    made = {
        "dogbone": dogbone(),
        "dogbone-thesis": dogbone().scale([THESIS_SCALE] * 3),
        "finger": finger(),
        "gripper": gripper(),
    }
    return {
        name: part.translate([0.0, 0.0, -part.bounding_box()[2]]) for name, part in made.items()
    }


def finger_strain() -> str:
    """Return the strain of the curling finger on a grid that holds it, as CSV."""
    places = itertools.product(
        np.linspace(-1.0, 98.0, 12), np.linspace(-9.0, 9.0, 3), np.linspace(-1.0, 21.0, 9)
    )
    bent = [(x, y, z, abs(z - 10.0) / 11.0 * (0.3 + 0.7 * (97.0 - x) / 98.0)) for x, y, z in places]
    rows = [f"{x:g},{y:g},{z:g},{0.02 + 0.28 * share:.4f}" for x, y, z, share in bent]
    return "\n".join(["x_mm,y_mm,z_mm,strain", *rows, ""])


def main() -> None:
    """Write every sample: parts as binary STL, and the strain."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent
    for name, part in parts().items():
        mesh = part.to_mesh()
        vertices = np.asarray(mesh.vert_properties[:, :3], dtype=np.float32)
        data = encode_stl(vertices, np.asarray(mesh.tri_verts), f"{name} in mm")
        (folder / f"{name}.stl").write_bytes(data)
        print(f"{name}.stl: {len(mesh.tri_verts)} triangles, {part.volume():.1f} mm3")
    (folder / "finger-strain.csv").write_text(finger_strain(), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
