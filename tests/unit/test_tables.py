"""Text tables: figures that no test measures, and headings that take a pattern's time."""

import time

import numpy as np
import pytest

from planner.errors import FileError
from planner.formats.specimens import read_specimens
from planner.formats.tables import finite_numbers, read_columns
from planner.formats.tensile import read_tensile


@pytest.mark.parametrize("figure", ["1e300", "-1e31", "1e308"])
def test_figures_that_would_overflow_are_refused_at_their_line(figure, tmp_path):
    path = tmp_path / "test.csv"
    rows = [f"{k},{k},{k}" for k in range(20)]
    rows[7] = f"7,7,{figure}"
    path.write_text("time_s,displacement_mm,force_kN\n" + "\n".join(rows) + "\n")
    with pytest.raises(FileError, match=rf"line 9, .*'{figure}' is beyond 1e\+30"):
        read_tensile(path)
    path.write_text(f"specimen,material,width_mm\nA,B,{figure.removeprefix('-')}\n")
    with pytest.raises(FileError, match=r"width_mm is .*; it must be a number above 0"):
        read_specimens(path)


def test_figures_up_to_the_largest_are_read_with_their_factor():
    numbers = finite_numbers({1: "1e30", 2: "-1e30", 3: "2"}, ",", "x", "force", 1000.0)
    np.testing.assert_allclose(numbers, [1e33, -1e33, 2000.0], rtol=1e-15)


@pytest.mark.parametrize("heading", [20_000 * "(", 20_000 * "[ ", 20_000 * " a", 20_000 * "/"])
def test_a_long_heading_is_unknown_at_once(heading, tmp_path):
    """5 s where each bracket was tried with each other."""
    path = tmp_path / "a.csv"
    path.write_text(f"x_mm,{heading}\n0,1\n1,2\n")
    begin = time.process_time()
    with pytest.raises(FileError, match="unknown column"):
        read_columns(path, {"x_mm": "length", "width_mm": "length"})
    with pytest.raises(FileError):
        read_tensile(path)
    path.write_text(f"specimen,material,{heading}\nA,B,1\n")
    assert read_specimens(path)[0].material == "B"
    assert time.process_time() - begin < 1.0
