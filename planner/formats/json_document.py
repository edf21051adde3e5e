"""JSON documents in one canonical form, so that equal content is equal bytes."""

import json
import math
from collections.abc import Mapping
from typing import Any, TypeVar

import msgspec

from planner.errors import FileError

__all__ = ["SIGNIFICANT_DIGITS", "decode_document", "encode_document"]

T = TypeVar("T")

SIGNIFICANT_DIGITS = 9
"""Figures are rounded to this: far finer than any measurement, coarser than the last bits in
which mathematical libraries of different machines differ."""


def encode_document(document: Mapping[str, Any]) -> bytes:
    """Write a JSON document in canonical form.

    Keys in the order given, two-space indent, lists of plain values on one line, figures
    rounded to `SIGNIFICANT_DIGITS`, a newline at the end; UTF-8.

    Raises
    ------
    ValueError
        A figure is not finite.
    """
    return (_encode(_rounded(document), "") + "\n").encode("utf-8")


def decode_document(data: bytes, type_: type[T], name: str) -> T:
    """Read a JSON document into a typed value.

    Raises
    ------
    FileError
        Not JSON, or not of that type; the message names the key.
    """
    try:
        return msgspec.json.decode(data, type=type_)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise FileError(f"{name}: not the JSON document that it should be: {error}") from error


def _rounded(value: Any) -> Any:
    if isinstance(value, float):
        if not math.isfinite(value):
            raise ValueError(f"{value} cannot be written to JSON")
        return float(f"{value:.{SIGNIFICANT_DIGITS}g}") + 0.0  # + 0.0 turns -0.0 into 0.0
    if isinstance(value, Mapping):
        return {str(k): _rounded(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_rounded(v) for v in value]
    return value


def _encode(value: Any, indent: str) -> str:
    inner = indent + "  "
    if isinstance(value, dict) and value:
        items = (f"{inner}{json.dumps(k)}: {_encode(v, inner)}" for k, v in value.items())
        return "{\n" + ",\n".join(items) + f"\n{indent}}}"
    if isinstance(value, list) and any(isinstance(v, dict) for v in value):
        items = (inner + _encode(v, inner) for v in value)
        return "[\n" + ",\n".join(items) + f"\n{indent}]"
    return json.dumps(value, ensure_ascii=False)
