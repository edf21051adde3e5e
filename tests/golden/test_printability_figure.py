"""The figure of docs/explanation/printability.md is what planner finds today."""

import runpy
from pathlib import Path

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "explanation"


def test_the_figure_shows_what_is_found() -> None:
    made = runpy.run_path(str(FOLDER / "make_printability.py"))
    assert made["figure"]() == made["TARGET"].read_bytes()
