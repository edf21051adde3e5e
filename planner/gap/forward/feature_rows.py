"""From curves on steps to the table of features."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from planner.arrays import FloatArray, IntArray
from planner.gap.features import BRANCHES, FeatureTable
from planner.gap.forward.assemble import MountedTest
from planner.gap.forward.field_bins import FieldWeights, bin_edges_mm, bin_means
from planner.gap.forward.legs import Path
from planner.gap.forward.setup import Setup
from planner.gap.forward.steps import feature_places
from planner.gap.specimen import Specimen

__all__ = ["feature_table"]

_FORCE_SHARE = 0.02
_STRAIN_FLOOR = 0.01


@dataclass(slots=True)
class _Rows:
    """Columns of the table, and of the weights, in the making."""

    columns: dict[str, list[float]] = field(
        default_factory=lambda: {
            name: []
            for name in ("specimen", "test", "step", "branch", "strain", "time_s", "x_mm",
                         "floor", "raw")
        }
    )  # fmt: skip
    feature: list[int] = field(default_factory=list)
    slice_: list[int] = field(default_factory=list)
    weight: list[float] = field(default_factory=list)

    def add(self, **values: float) -> None:
        for name, column in self.columns.items():
            column.append(values[name])

    def places(self, name: str) -> IntArray:
        return np.array(self.columns[name], dtype=np.int64)


def feature_table(
    specimens: Sequence[Specimen],
    tests: Sequence[MountedTest],
    paths: Mapping[int, Path],
    setup: Setup,
    measured_N: FloatArray,
    sensor_sd_N: FloatArray,
    peak_N: FloatArray,
) -> tuple[FeatureTable, FieldWeights]:
    """Return the features of all specimens that a test has, and how fields are made up.

    Parameters
    ----------
    peak_N
        Of each test, as the palette's laws predict it.
    """
    rows = _Rows()
    test_of = {place: number for number, test in enumerate(tests) for place in test.places}
    for place in sorted(test_of):
        number = test_of[place]
        test = tests[number]
        travel = setup.travel_mm[number]
        floor = max(_FORCE_SHARE * float(peak_N[number]), 2.0 * float(sensor_sd_N[place]))
        common = {"specimen": place, "test": number}
        for step in _feature_steps(test):
            leg = test.walk.legs[test.walk.leg[step]]
            begin_s = test.time_s[_leg_start(test, step)] if leg.kind == "hold" else 0.0
            rows.add(
                **common,
                step=step,
                branch=BRANCHES.index(leg.kind),
                strain=travel[step] / setup.gauge_mm[number],
                time_s=test.time_s[step] - begin_s,
                x_mm=np.nan,
                floor=floor,
                raw=measured_N[place, step],
            )
        seen = specimens[place].strain_field
        if seen is not None and setup.designs[number] is not None:
            edges, bin_of = bin_edges_mm(seen.x_mm, specimens[place].gauge_mm)
            for step in field_steps(test):
                means = bin_means(seen, paths[place], float(travel[step]), bin_of)
                if means is None:
                    continue
                for (begin, end), mean in zip(edges.tolist(), means.tolist(), strict=True):
                    _weigh(rows, setup, number, begin, end)
                    rows.add(
                        **common,
                        step=step,
                        branch=BRANCHES.index("field"),
                        strain=travel[step] / setup.gauge_mm[number],
                        time_s=test.time_s[step],
                        x_mm=0.5 * (begin + end),
                        floor=_STRAIN_FLOOR,
                        raw=mean,
                    )
    raw = np.array(rows.columns["raw"])
    floors = np.array(rows.columns["floor"])
    table = FeatureTable(
        specimen=rows.places("specimen"),
        test=rows.places("test"),
        step=rows.places("step"),
        branch=rows.places("branch"),
        strain=np.array(rows.columns["strain"]),
        time_s=np.array(rows.columns["time_s"]),
        x_mm=np.array(rows.columns["x_mm"]),
        floor=floors,
        measured=np.arcsinh(raw / (2.0 * floors)),
        measured_raw=raw,
    )
    weights = FieldWeights(
        np.array(rows.feature, dtype=np.int64),
        np.array(rows.slice_, dtype=np.int64),
        np.array(rows.weight, dtype=np.float64),
    )
    return table, weights


def field_steps(test: MountedTest) -> list[int]:
    """Return the steps of the test that are frames of its strain field."""
    return [_step_at(test, 0, fraction) for fraction in test.frames]


def _feature_steps(test: MountedTest) -> list[int]:
    return [
        _step_at(test, leg, fraction)
        for leg, places in enumerate(feature_places(test.walk.legs))
        for fraction in places
    ]


def _step_at(test: MountedTest, leg: int, fraction: float) -> int:
    here = np.flatnonzero((test.walk.leg == leg) & (np.arange(len(test.walk.leg)) > 0))
    return int(here[np.argmin(np.abs(test.walk.fraction[here] - fraction))])


def _leg_start(test: MountedTest, step: int) -> int:
    """Return the step at which the leg of a step begins, the last one of the leg before."""
    return int(np.flatnonzero(test.walk.leg == test.walk.leg[step])[0]) - 1


def _weigh(rows: _Rows, setup: Setup, number: int, begin: float, end: float) -> None:
    """Note the slices that a bin covers, each by the share it has of it."""
    first, stop = int(setup.first_slice[number]), int(setup.first_slice[number + 1])
    middle, half = setup.x_mm[first:stop], 0.5 * setup.length_mm[first:stop]
    overlap = np.minimum(middle + half, end) - np.maximum(middle - half, begin)
    covered = np.flatnonzero(overlap > 0.0)
    feature = len(rows.columns["raw"])
    rows.feature += [feature] * len(covered)
    rows.slice_ += (first + covered).tolist()
    rows.weight += (overlap[covered] / overlap[covered].sum()).tolist()
