"""What the figures draw, and that they stand alone."""

import xml.etree.ElementTree as ElementTree
from dataclasses import replace

import numpy as np
import pytest

from planner.gap.diagnosis import Diagnosis, Location, Traces, signed_error
from planner.report.gap_figures import figures_of, points_along

Examples = dict[str, Diagnosis]


def test_errors_follow_the_specimens_not_the_rows(traces: Traces) -> None:
    """The first test, of specimen B in the second row, is predicted 25 % of its force too high:
    at the last step by 25 % of the largest; the second is right for A and 2 % low for C, of the
    mean of both.
    """
    errors = traces.errors(traces.before_N)
    assert errors[:, -1] == pytest.approx([0.0, -0.25, 0.02 / 1.01])


def test_points_along_axes(traces: Traces) -> None:
    rate = points_along(traces, "rate_mm_s")
    assert rate is not None
    assert rate.log  # 0.05 to 5 mm/s
    assert rate.x == pytest.approx(np.log10([5.0, 0.05, 5.0]))
    material = points_along(traces, "material")
    assert material is not None
    assert (material.names, material.x.tolist()) == (("hard", "soft"), [0.0, 1.0, 0.0])
    temperature = points_along(traces, "temperature_C")
    assert temperature is not None
    assert np.isnan(temperature.x[1])  # unknown, not at the reference
    strain = points_along(traces, "strain")
    assert strain is not None
    assert strain.x.max() == pytest.approx(10.0 / 20.0)
    assert points_along(traces, "position") is None


def test_branches_are_told_by_the_travel(traces: Traces) -> None:
    """Up, hold, down, up again: errors of 0, 10, 20 and 30 % of the largest force."""
    travel = np.array([[0.0, 1.0, 2.0, 2.0, 2.0, 1.0, 0.5, 1.0, 1.5]])
    shift = np.array([0.0, 0.0, 0.0, 0.1, 0.1, 0.2, 0.2, 0.3, 0.3])
    one = replace(
        traces,
        label=("t",),
        rows=[[0]],
        peaks_N=np.ones((1, 1)),
        travel_mm=travel,
        time_s=np.arange(9.0)[None],
        before_N=np.ones((1, 9)) - shift,
        after_N=np.ones((1, 9)),
        measured_N=np.ones((1, 9)),
    )
    points = points_along(one, "branch")
    assert points is not None
    errors = {points.names[int(x)]: e for x, e in zip(points.x, points.before, strict=True)}
    assert errors == pytest.approx(
        {"loading": 0.0, "hold": 0.1, "unloading": 0.2, "reloading": 0.3}
    )


def test_a_sign_is_that_of_the_mean() -> None:
    """Root mean squares: 0.5 of (0.7, 0.1), below 0 where most is below."""
    assert signed_error(np.array([[0.7, 0.1], [-0.7, 0.1]])) == pytest.approx([0.5, -0.5])


def test_marks_tell_specimen_conditions_and_error(examples: Examples) -> None:
    drawn = figures_of(examples["rate"])
    words = {
        title.text or ""
        for svg in (drawn["residuals"], drawn["curves"])
        for title in ElementTree.fromstring(svg).iterfind(".//{*}g/{*}title")
    }
    b = "B: soft, crosshead speed 0.05 mm/s; error -12 % (palette alone), 0 % (with the verdict's"
    a = "measured, A: hard, crosshead speed 5 mm/s, temperature 23 °C; error 0 % (palette alone)"
    for begun in (b, a, "predicted, palette alone: hard <&> 5 mm/s"):
        assert any(each.replace("\xa0", " ").startswith(begun) for each in words), begun
    assert drawn["residuals"].count(b"error, % of the largest force") == 2


def test_figures_are_self_contained_svg(diagnosis: Diagnosis) -> None:
    drawn = figures_of(diagnosis)
    of_curves = [] if diagnosis.traces is None else ["residuals", "curves"]
    assert sorted(drawn) == sorted(["evidence", "closure", *of_curves])
    for svg in drawn.values():
        assert ElementTree.fromstring(svg).tag == "{http://www.w3.org/2000/svg}svg"
        assert b"nan" not in svg
        assert svg.count(b"http") == 1  # the name space


def test_without_effects_the_palette_alone_is_drawn(examples: Examples) -> None:
    """Along curves, too: no warning, no nan."""
    axes = tuple(Location(a, 0.5, (0.4, 0.6), 0.001, "") for a in ("strain", "time", "branch"))
    diagnosis = replace(examples["rate"], verdict="unknown", effect=(), where=axes)
    drawn = figures_of(diagnosis)
    assert len(drawn) == 4
    assert not any(b"nan" in svg for svg in drawn.values())
