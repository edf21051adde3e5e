"""The list of slow tests names what is there: a test of another name would be quick again."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_every_slow_test_is_there():
    for name in (ROOT / "tests/slow.txt").read_text(encoding="utf-8").splitlines():
        file, function = name.split("[")[0].split("::")
        assert f"def {function}(" in (ROOT / file).read_text(encoding="utf-8"), name
