"""The gauge: limits are lowered to what stands, and never raised."""

import pytest

from benchmarks.house import lowered

SETTINGS = """[tool.planner.house]
"files" = { limit = 20, aim = 12 }  # a reason
"code lines" = { limit = 300, aim = 200 }
"""


def test_limits_fall_and_do_not_rise() -> None:
    made = lowered(SETTINGS, {"files": 17, "code lines": 400})
    assert made == SETTINGS.replace("limit = 20", "limit = 17")


def test_a_table_that_it_cannot_change_is_said() -> None:
    with pytest.raises(SystemExit, match='\'"files" = '):
        lowered(SETTINGS.replace("{ limit", "{limit"), {"files": 17})
