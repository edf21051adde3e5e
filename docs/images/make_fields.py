"""Grade the samples along fields and draw them: python docs/images/make_fields.py [NAME ...].

Each field's command stands in docs/how-to/grade-along-a-field.md as well.
"""

import sys
import tempfile
from pathlib import Path

from render import draw, png

import planner

HERE = Path(__file__).parent
SAMPLES = HERE.parents[1] / "samples"
WAVES = "0.5 + 0.3*sin(2*pi*x/20) + 0.2*cos(2*pi*z/12)"
FIELDS = {
    # name: part, field, azimuth, section
    "radial": ("gripper", "radial: line=0 0 0 0 1 0", 35.0, None),
    "distance": ("finger", "distance: surface, to=3", 35.0, "y"),
    "hole": ("gripper", "distance: hole=22 0 9.7, to=30", 20.0, None),
    "harmonic": ("gripper", "harmonic: from=z<4, to=z>98", 20.0, None),
    "geodesic": ("finger", "geodesic: start=ball 97 0 10 8", 35.0, "y"),
    "expression": ("dogbone", f"expression: {WAVES}", 20.0, None),
    "table": ("finger", f"table: {SAMPLES / 'finger-strain.csv'}", 35.0, "y"),
    "blend": ("dogbone", "blend(axis: x; radial: point=0 0 2, from=40, to=0; 0.5)", 20.0, None),
    "min": ("gripper", "min(axis: z; radial: point=0 0 110, from=0, to=60)", 20.0, None),
}
WIDTH, PITCH_MM = 480, 1.0


def main() -> None:
    """Draw those named, or all."""
    for name in sys.argv[1:] or FIELDS:
        part, field, azimuth, section = FIELDS[name]
        plan = planner.grade(
            SAMPLES / f"{part}.stl", from_="Tango", to="Vero", field=field, pitch_mm=PITCH_MM
        )
        with tempfile.TemporaryDirectory() as folder:
            written = plan.write(Path(folder) / "plan")
            picture = png(draw(written, azimuth, section, WIDTH))
        (HERE / f"field-{name}.png").write_bytes(picture)


if __name__ == "__main__":
    main()
