"""Errors of force along measured curves, relative to the largest force of each test."""

from collections.abc import Sequence

import numpy as np

from planner.arrays import FloatArray
from planner.gap.diagnosis import Traces

__all__ = ["error_along", "error_of_tests", "rows_of_test", "test_of_rows"]


def rows_of_test(traces: Traces, test: int) -> Sequence[int]:
    """Return the rows of `measured_N` that belong to a test."""
    places = {id: row for row, id in enumerate(_ids(traces))}
    return [places[id] for id in traces.specimen_ids[test] if id in places]


def test_of_rows(traces: Traces) -> dict[int, int]:
    """Return the test of each row of `measured_N`."""
    return {row: test for test in range(len(traces.label)) for row in rows_of_test(traces, test)}


def error_along(traces: Traces, predicted_N: FloatArray) -> FloatArray:
    """Return measured less predicted over the test's largest force, (n, T); NaN where unknown.

    Parameters
    ----------
    predicted_N : (P, T)
        `before_N` or `after_N`.
    """
    errors = np.full(traces.measured_N.shape, np.nan)
    for row, test in test_of_rows(traces).items():
        predicted, measured = predicted_N[test], traces.measured_N[row]
        largest = np.nanmax(np.abs(measured), initial=0.0)
        if largest > 0.0:
            errors[row] = (measured - predicted) / largest
    return errors


def error_of_tests(traces: Traces) -> FloatArray:
    """Return each test's root mean square error before, (P,); NaN where nothing was measured."""
    squares = error_along(traces, traces.before_N) ** 2
    found = np.full(len(traces.label), np.nan)
    for test in range(len(traces.label)):
        of_test = squares[list(rows_of_test(traces, test))]
        if np.isfinite(of_test).any():
            found[test] = np.sqrt(np.nanmean(of_test))
    return found


def _ids(traces: Traces) -> Sequence[str]:
    """Return the specimens in the order of `measured_N`; that of the tests where none is given."""
    return traces.specimens or [id for ids in traces.specimen_ids for id in ids]
