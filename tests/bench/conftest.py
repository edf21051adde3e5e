"""Tests of the bench that checks the diagnosis: all bear its marker, and run by name."""

from pathlib import Path
from zlib import crc32

import pytest

HERE = Path(__file__).parent
OF_REALITY = ("test_reality_", "test_camera")
"""Files on how campaigns are made, which nothing of planner's gap decides. One in three of their
tests runs with every change, and all do with `pytest -m bench tests/bench`. The contract of every
tier, in test_reality, is asked with every change, of a set each."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if item.path.is_relative_to(HERE):
            item.add_marker(pytest.mark.bench)
            if item.path.stem.startswith(OF_REALITY) and crc32(item.nodeid.encode()) % 3:
                item.add_marker(pytest.mark.long)
