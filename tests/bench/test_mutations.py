"""Mutations are single changes of the core, the same in every run, and code that still parses."""

import ast
import collections

from benchmarks.mutations import ROOMS, ROOT, chosen, noticing


def test_each_changes_one_function_of_a_room_into_another_that_parses() -> None:
    drawn = chosen(20, seed=1)
    assert drawn == chosen(20, seed=1)
    assert collections.Counter(one.room for one in drawn) == dict.fromkeys(ROOMS, 4)
    assert len({(one.file, one.function) for one in drawn}) == 20
    for one in drawn:
        source = (ROOT / one.file).read_bytes()
        mutated = source[: one.start] + one.text.encode() + source[one.end :]
        trees = [ast.dump(ast.parse(text)) for text in (source, mutated)]
        assert trees[0] != trees[1], one.name


def test_tests_that_enter_the_function_come_first_and_short_ones_before_long_ones() -> None:
    (mutation, *_) = chosen(5, seed=1)
    here, beside = (f"{mutation.file}:{name}" for name in (mutation.function, "other"))
    made = {
        "far": {"slow": False, "seconds": 0.1, "enters": ["planner/elsewhere.py:f"]},
        "beside": {"slow": False, "seconds": 0.1, "enters": [beside]},
        "long": {"slow": False, "seconds": 9.0, "enters": [here, beside]},
        "short": {"slow": False, "seconds": 1.0, "enters": [here]},
        "slow": {"slow": True, "seconds": 1.0, "enters": [here]},
    }
    assert noticing(mutation, made, slow=False) == ["short", "long", "beside"]
    assert noticing(mutation, made, slow=True) == ["slow"]
