"""The gauge: what it counts; limits are lowered to what stands, and never raised."""

from pathlib import Path

import pytest

from benchmarks.house import lowered, passed

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


def test_a_file_is_passed_where_a_function_of_it_runs(tmp_path: Path) -> None:
    """Not where a class is made on import, as in a command's options that another command has."""
    files = {
        "__init__": "",
        "cli": "from planner import options, work\ndef run(words): work.done(words)\n",
        "options": "class Options:\n    force: bool = False\n",
        "work": "def done(words): return [word for word in words]\n",
    }
    (tmp_path / "planner").mkdir()
    (tmp_path / "samples").mkdir()
    for name, text in files.items():
        (tmp_path / "planner" / f"{name}.py").write_text(text, "utf-8")
    assert passed(tmp_path, ["grade"]) == 2  # cli and work
