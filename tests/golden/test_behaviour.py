"""Every command does what it did: exit code, what it prints and every file it writes.

After a change that is meant to be seen: ``python tests/golden/behaviour.py update``.
"""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from behaviour import REMAKE, run_case, wrong_in
from behaviour_cases import CASES
from behaviour_meaning import differences_of

# Those of a second or more whose commands other cases run too.
SLOW = {
    "blend-bands", "blend-mix", "field-composed", "field-distance", "field-geodesic",
    "field-harmonic", "field-radial", "field-refused", "field-table", "fit-laws", "gap-altered",
    "gap-camera", "gap-design", "gap-design-refused", "gap-none", "gap-two-effects", "gap-without",
    "grade-axes", "grade-findings", "grade-profiles", "refused-meshes", "refused-options",
    "slices-blends", "slices-refused", "tensile-refused",
}  # fmt: skip


# Diagnoses, laws and slices of which other cases and tests show the same; by hand with -m long.
LONG = {"fit-laws", "gap-altered", "gap-camera", "gap-two-effects", "gap-without", "slices-blends"}


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(
            name, marks=[pytest.mark.slow] * (name in SLOW) + [pytest.mark.long] * (name in LONG)
        )
        for name in CASES
    ],
)
def test_as_before(name: str) -> None:
    lines = wrong_in(name, run_case(name))
    if lines:
        what = "\n  ".join(lines)
        pytest.fail(f"{name} differs:\n  {what}\nif that is meant: {REMAKE} {name}", pytrace=False)


def test_a_difference_is_said_by_meaning() -> None:
    old, new = b'{"a": [1, {"b": 2.0}], "c": 1}', b'{"a": [1, {"b": 2.5}], "d": 1}'
    assert differences_of("x.json", old, old) == []
    assert differences_of("x.json", old, new) == [
        "x.json:", "  a[1].b: 2.0 -> 2.5", "  c: 1 -> (gone)", "  d: (new) -> 1",
    ]  # fmt: skip
    assert differences_of("x.csv", b"a\nb\n", b"a\nc\n")[2:] == ["   a", "  -b", "  +c"]
    assert differences_of("x.stl", b"12", None) == ["x.stl: no longer there"]
    assert differences_of("x.stl", b"12", b"123")[0].startswith("x.stl: 2 bytes")
    assert differences_of("exit", b"0\n", b"1\n") == ["exit: 0 -> 1"]
