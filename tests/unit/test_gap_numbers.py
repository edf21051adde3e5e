"""Every number of the diagnosis says what it is and where it comes from."""

import ast
import runpy
from pathlib import Path
from typing import Any

import pytest

FOLDER = Path(__file__).parents[2] / "docs" / "reference"


@pytest.fixture(scope="module")
def script() -> dict[str, Any]:
    return runpy.run_path(str(FOLDER / "make_numbers.py"))


def test_the_tables_have_every_number(script: dict[str, Any]) -> None:
    made = script["tables"]()
    assert all(f"`{name}`" in made for number in script["numbers"]() for name in number.names)


def test_no_number_is_without_its_meaning_and_its_source(script: dict[str, Any]) -> None:
    found = script["numbers"]()
    bare = [f"{n.module}: {', '.join(n.names)}" for n in found if not (n.meaning and n.kind)]
    assert bare == [], f"say under each what it is, then one of {', '.join(script['KINDS'])}: why"


def test_priors_are_among_the_numbers(script: dict[str, Any]) -> None:
    names = {name for number in script["numbers"]() for name in number.names}
    assert {"Priors.none", "Priors.temperature"} <= names


def test_numbers_without_a_line_between_share_the_text_below(script: dict[str, Any]) -> None:
    text = (
        '_A, _B = 1.0, 2\n_C = 3\n"""What they are. Chosen: why."""\n\n_D = _C[4]\n_E = 5\n'
        '_OF_AN_EFFECT = Parameter("size", 0.1, 1.0)\n_TEXT = "6"\n'
    )
    found = [
        (n.names, n.values, n.meaning, n.kind, n.source)
        for n in script["_constants"]("some.py", ast.parse(text).body)
    ]
    assert found == [
        (("_A", "_B", "_C"), ("`1.0`", "`2`", "`3`"), "What they are.", "Chosen", "why."),
        (("_E",), ("`5`",), "", "", ""),
    ]


def test_fields_go_by_their_own_text_or_their_class(script: dict[str, Any]) -> None:
    text = (
        'class A:\n    """What.\n\n    Calibrated: how.\n\n    Attributes\n    ----------\n'
        '    one, two\n        Both.\n    three\n        Third. Chosen: why.\n    """\n\n'
        "    one: float = 1.0\n    two: float = 2.0\n    three: int = 3\n"
    )
    found = [
        (n.names, n.meaning, n.kind, n.source)
        for n in script["_constants"]("some.py", ast.parse(text).body)
    ]
    assert found == [
        (("A.one", "A.two"), "Both.", "Calibrated", "how."),
        (("A.three",), "Third.", "Chosen", "why."),
    ]
