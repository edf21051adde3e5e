"""The naive analyst that the diagnosis is held against."""

import math
from pathlib import Path

import numpy as np
import pytest

from benchmarks.withheld.naive_bic import (
    least_sum_of_squares,
    naive_answer,
    schwarz,
    schwarz_probabilities,
)
from benchmarks.withheld.reality.__main__ import main
from benchmarks.withheld.scoring import read_answer
from planner.errors import PlannerError
from planner.gap.effects import EFFECTS
from planner.gap.evidence.problem import node_weights, signed_forms


def test_schwarz_weighs_fit_against_parameters() -> None:
    # Two parameters that halve the sum of squares of 100 points: 100 ln 2 - 2 ln 100 = 60.1
    gain = schwarz(4.0, 100, 0) - schwarz(2.0, 100, 2)
    assert gain == pytest.approx(100 * math.log(2) - 2 * math.log(100))
    found = schwarz_probabilities({(): 2.0, ("rate",): 0.0})
    assert list(found) == [("rate",), ()]
    assert found[("rate",)] == pytest.approx(1 / (1 + math.exp(-1.0)))


def test_the_grid_finds_the_place_that_made_the_data() -> None:
    signed = next(b for b in signed_forms([EFFECTS["rate"]]) if b.form.name == "prony")
    nodes = np.random.default_rng(1).normal(size=(len(signed.node_points()), 300))
    # A place of the grid itself: what is left is rounding
    place = [signed.least + 0.5 * (1.0 - signed.least), 0.25, -0.5]
    made = node_weights(place) @ nodes
    assert least_sum_of_squares(signed, nodes, made) == pytest.approx(0.0, abs=1e-9 * made @ made)


def test_it_answers_as_a_diagnosis_does(tmp_path: Path) -> None:
    made = ["make", "--set", "development", "--tier", "none-scatter", "--count", "1"]
    assert main([*made, "--seed", "41", "--specimens", "20", "-o", str(tmp_path / "c")]) == 0
    (folder,) = (tmp_path / "c").iterdir()
    answer = read_answer(naive_answer(folder, ("rate",)), "c")
    assert sum(p for _, p in answer.ranking) == pytest.approx(1.0)
    assert answer.verdict == answer.ranking[0][0]
    assert ("rate",) not in dict(answer.ranking)
    # The known failing of points taken for independent: sure of an effect where there is none
    assert answer.verdict != ()
    assert answer.ranking[0][1] > 0.8
    with pytest.raises(PlannerError):
        naive_answer(tmp_path / "nothing")
