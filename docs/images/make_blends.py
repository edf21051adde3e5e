"""Draw a dithered finger, cut open: python docs/images/make_blends.py."""

import tempfile
from pathlib import Path

from render import draw, png

import planner

HERE = Path(__file__).parent


def main() -> None:
    """Draw it."""
    plan = planner.grade(
        HERE.parents[1] / "samples/finger.stl",
        from_="Tango",
        to="FLX9795",
        axis="x",
        blend="dither",
        cell_mm=1.0,
    )
    with tempfile.TemporaryDirectory() as folder:
        written = plan.write(Path(folder) / "plan")
        (HERE / "blend-dither.png").write_bytes(png(draw(written, 35.0, "y", 900)))


if __name__ == "__main__":
    main()
