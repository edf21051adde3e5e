"""Write the layer shown in docs/how-to/write-slices.md: python docs/images/make_layer.py."""

import shutil
import tempfile
from pathlib import Path

import planner

HERE = Path(__file__).parent
SAMPLES = HERE.parents[1] / "samples"
HEIGHT_MM = 8.0


def main() -> None:
    """Grade the finger from its skin inwards, slice it, and keep one image as it is."""
    plan = planner.grade(
        SAMPLES / "finger.stl", from_="Tango", to="Vero", field="distance: surface, to=3"
    )
    with tempfile.TemporaryDirectory() as scratch:
        folder = plan.write(Path(scratch) / "plan")
        stack = planner.write_slices(folder, Path(scratch) / "slices", indexed=True)
        layer = int(HEIGHT_MM / stack.grid.pitch_mm[2])
        shutil.copyfile(Path(scratch) / "slices" / stack.files[layer], HERE / "layer.png")


if __name__ == "__main__":
    main()
