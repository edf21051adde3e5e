"""Figures, profiles, paths and bars that planner.simulate refuses, and what it says."""

from pathlib import Path

import numpy as np
import pytest

import planner
from planner.errors import ArgumentError, FileError, PlannerError
from planner.simulation.bar import Bar


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"to_strain": 0.0}, "above 0"),
        ({"to_strain": 30.0}, "30 % is 0.3"),
        ({"to_strain": float("nan")}, "a finite number"),
        ({"slices": 0}, "slices"),
        ({"slices": 1}, "`slices` 1: it must be a whole number from 10 to 10000"),
        ({"steps": 0}, "steps"),
        ({"protocol": "cyclic", "steps": 10_000, "cycles": 2000}, "20 million"),
        ({"protocol": "cyclical"}, "did you mean cyclic"),
        ({"protocol": "creep"}, "monotonic, cyclic, relaxation"),
        ({"protocol": "cyclic", "cycles": 0}, "cycles"),
        ({"cycles": 4}, "`cycles` 4: it goes with `protocol` cyclic"),
        ({"hold_s": 5.0}, "`hold_s` 5: it goes with `protocol` relaxation"),
        ({"rate_mm_s": -1.0}, "rate_mm_s"),
        ({"hold_s": 0.0}, "hold_s"),
        ({"level": 1.0}, "level"),
        ({"width_mm": 0.0}, "width"),
        ({"gauge_mm": float("inf")}, "gauge"),
        ({"between_mm": (0.0, 40.0)}, "lie on the bar"),
        ({"between_mm": (10.0, 5.0)}, "must rise"),
    ],
)
def test_arguments_out_of_range(options: dict, reason: str) -> None:
    with pytest.raises(ArgumentError, match=reason):
        planner.simulate("Tango", **options)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "the file is empty"),
        ("x_mm\n0\n", "coordinate"),
        ("x_mm,coordinate,colour\n", "'colour'"),
        ("x_mm,coordinate\n0,0.5\n", "beginning to its end"),
        ("x_mm,coordinate\n0,0.5\n0,0.5\n", "beginning to its end"),
        ("x_mm,coordinate\n0,0.5\n-1,0.5\n", "line 3: x_mm falls"),
        ("x_mm,coordinate\n0,0.5\n1,0\n1,1\n1,0\n", "three times"),
        ("x_mm,coordinate\n0,0.5\n9,1.6\n", "goes from 0 to 1.5"),
        ("x_mm,coordinate\n0,0.5\n9,nan\n", "line 3, column 'coordinate': 'nan' is no finite"),
        ("x_mm,coordinate\n0,0.5\n9\n", "line 3: 1 cells for 2 columns"),
        ("x_mm,coordinate,width_mm\n0,0.5,3\n9,1,0\n", "width_mm is 0"),
    ],
)
def test_profiles_that_are_none(tmp_path: Path, text: str, reason: str) -> None:
    path = tmp_path / "bar.csv"
    path.write_text(text)
    with pytest.raises(FileError, match=reason):
        planner.simulate(path)


@pytest.mark.parametrize(
    ("edges", "coordinate", "area", "reason"),
    [
        ([0.0, 1.0], [0.5, 0.5], [1.0, 1.0], "n \\+ 1 edges"),
        ([0.0, 0.0], [0.5], [1.0], "must rise"),
        ([0.0, 1.0], [np.nan], [1.0], "finite"),
        ([0.0, 1.0], [0.5], [0.0], "no cross-section"),
        ([0.0], [], [], "n slices"),
        ([0.0, 1.0], [1.6], [1.0], "goes from 0 to 1.5"),
    ],
)
def test_bars_that_are_none(edges: list, coordinate: list, area: list, reason: str) -> None:
    with pytest.raises(PlannerError, match=reason):
        planner.simulate(Bar(np.array(edges), np.array(coordinate), np.array(area)))
