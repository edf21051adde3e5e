"""Canonical JSON: equal content is equal bytes, and figures keep nine digits."""

import json
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner.errors import FileError
from planner.formats.files import decode_document, encode_document

figures = st.floats(allow_nan=False, allow_infinity=False, min_value=-1e12, max_value=1e12)
values = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**53), 2**53) | st.text() | figures,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=12,
)


def _close(a: object, b: object) -> bool:
    if isinstance(a, float) and isinstance(b, (int, float)):
        # Nine significant digits: half a unit in the ninth is 5e-9 at worst.
        return math.isclose(a, b, rel_tol=5e-9, abs_tol=0.0)
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(map(_close, a, b))
    if isinstance(a, dict) and isinstance(b, dict):
        return list(a) == list(b) and all(_close(a[k], b[k]) for k in a)
    return a == b


@settings(deadline=None, derandomize=True, max_examples=50)
@given(st.dictionaries(st.text(), values, max_size=5))
def test_round_trip_keeps_order_and_nine_digits(document: dict) -> None:
    data = encode_document(document)
    read = json.loads(data)
    assert _close(document, read)
    assert encode_document(read) == data


def test_last_bits_do_not_reach_the_file() -> None:
    assert encode_document({"x": 0.1 + 0.2}) == encode_document({"x": 0.3})
    assert encode_document({"x": -0.0}) == encode_document({"x": 0.0})


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_no_figure_that_is_none(value: float) -> None:
    with pytest.raises(ValueError, match="JSON"):
        encode_document({"a": [{"b": value}]})


def test_reading_names_the_file_and_the_fault() -> None:
    with pytest.raises(FileError, match=r"broken\.json"):
        decode_document(b"{", dict, "broken.json")
