"""Diagnoses made by hand: a cause, none, an unknown, a pair, a single specimen."""

from dataclasses import replace

import numpy as np
import pytest

from planner.formats.units import UnitOf
from planner.gap.diagnosis import (
    Detectable,
    Diagnosis,
    Experiment,
    FoundEffect,
    Gap,
    Hypothesis,
    Location,
    QualityProblem,
    Traces,
    Untestable,
)


def make_traces() -> Traces:
    """Two tests of one and two specimens: the palette is 25 % high in the first, right in the
    second; rows of measured_N are not in the order of the tests.
    """
    travel = np.linspace(0.0, 10.0, 11)
    force = 2.0 * travel
    return Traces(
        label=("soft, 0.05 mm/s", "hard <&> 5 mm/s"),
        rows=[[1], [0, 2]],
        travel_mm=np.stack([travel, travel]),
        time_s=np.stack([travel / 0.05, travel / 5.0]),
        before_N=np.stack([1.25 * force, force]),
        after_N=np.stack([force, force]),
        measured_N=np.stack([force, force, 1.02 * force]),
        residual_before=np.array([0.0, -0.125, 0.01]),
        residual_after=np.array([0.0, 0.0, 0.01]),
        peaks_N=np.array([[20.2], [20.0], [20.2]]),
        columns={
            "specimen": ("A", "B", "C"),
            "material": ("hard", "soft", "hard"),
            "rate_mm_s": (5.0, 0.05, 5.0),
            "temperature_C": (23.0, None, 24.0),
            "gauge_mm": (20.0, 20.0, 20.0),
        },
    )


RATE = Diagnosis(
    campaign="spring <1>",
    palette="lab",
    palette_sha256="ab" * 32,
    specimens=3,
    tests=2,
    verdict="rate",
    ranking=(
        Hypothesis(("rate",), 0.912345678, 0.25),
        Hypothesis(("machine-compliance", "rate"), 0.06, 0.5),
        Hypothesis((), 1e-9),
    ),
    same_class=(("rate",),),
    not_testable=(
        Untestable("softening", "no specimen was unloaded"),
        Untestable("permanent-set", "no specimen was unloaded"),
    ),
    where=(
        Location("rate_mm_s", 0.81, (0.7, 0.9), 1e-5, "force 20 % below prediction at 0.05 mm/s"),
        Location("operator", 0.04, (0.0, 0.1), 0.4, ""),
    ),
    gap=Gap(0.21, 0.03, 0.025, 0.973, (0.93, 0.99), 0.16, 0.04, "leave one condition out"),
    effect=(
        FoundEffect(
            "rate", "prony", {"share": 0.42, "centre": 12.3},
            {"share": (0.36, 0.47), "centre": (8.0, np.inf)}, {"share": "1", "centre": "s"},
        ),
    ),
    remainder=(),
    data_quality=(QualityProblem("B", "units", "load 4.45 times its replicates': pounds-force?"),),
    next_experiments=(
        Experiment(
            {"rate_mm_s": np.float64(0.005), "replicates": np.int64(3)},
            (("machine-compliance+rate", "rate"),), 1.2, 3.0, "",
        ),
        Experiment(
            {"profile": "soft-to-hard"}, (), 0.1, 1.0, "a bar", 2,
            {"profile": "profiles/soft-to-hard.csv", "width_mm": 6.0, "thickness_mm": 3.0,
             "gauge_mm": 20.0, "rate_mm_s": 0.5, "soak_h": 0.0, "protocol": "cyclic",
             "to_strain": 0.15},
            {"x_mm": (0.0, 10.0, 10.0, 20.0), "coordinate": (0.0, 0.0, 1.0, 1.0)},
        ),
    ),
    detectable=(Detectable("rate", "rise", 0.02, "1"), Detectable("skin", "depth", None, "mm")),
    limitations=("one specimen a condition",),
    unit_of=(UnitOf("force", "lbf", ("B",)),),
    recalibration={"soft": (0.031, 0.02)},
    traces=make_traces(),
)  # fmt: skip
NONE = replace(
    RATE, verdict="none", ranking=(Hypothesis((), 0.94),), same_class=((),), where=(), effect=(),
    gap=Gap(0.03, None, 0.029, None, None, None, None, ""), next_experiments=(),
)  # fmt: skip
UNKNOWN = replace(
    RATE, verdict="unknown", ranking=(Hypothesis(("unknown",), 0.7, 1.0),), effect=(),
    same_class=(("unknown",),), gap=replace(RATE.gap, after=None, closed=None,
    closed_interval=None), remainder=RATE.where[:1],
)  # fmt: skip
PAIR = replace(
    RATE, verdict="rate+temperature",
    ranking=(Hypothesis(("rate", "temperature"), 0.5, 0.0), Hypothesis(("ageing", "rate"), 0.4)),
    same_class=(("rate", "temperature"), ("ageing", "rate")),
    gap=replace(RATE.gap, after=0.25, closed=-0.2, closed_interval=(-0.5, 0.1),
    negative_transfer=True),
)  # fmt: skip
ONE = replace(
    RATE, specimens=1, tests=1, where=(), traces=None, data_quality=(), not_testable=(),
    gap=Gap(0.3, None, None, None, None, None, None, ""),
)  # fmt: skip
ALL = {"rate": RATE, "none": NONE, "unknown": UNKNOWN, "pair": PAIR, "one": ONE}


@pytest.fixture
def examples() -> dict[str, Diagnosis]:
    return dict(ALL)


@pytest.fixture(params=ALL)
def diagnosis(request: pytest.FixtureRequest) -> Diagnosis:
    return ALL[request.param]


@pytest.fixture
def traces() -> Traces:
    return make_traces()
