"""Schemas as taplo follows them, which Even Better TOML in VS Code runs: `#:schema` on line one."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from planner.cli import run

TAPLO = shutil.which("taplo", path=str(Path(sys.executable).parent)) or shutil.which("taplo")
pytestmark = pytest.mark.skipif(TAPLO is None, reason="taplo is not installed")


def _said(folder: Path, file: str) -> tuple[int, str]:
    done = subprocess.run([TAPLO, "lint", file], cwd=folder, capture_output=True, text=True)
    return done.returncode, done.stderr


def test_a_new_printer_and_its_palette_are_valid_and_slips_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["printers", "new", "myjet"]) == 0
    package = tmp_path / "myjet-printer" / "myjet_printer"
    slips = {
        "printer.toml": ("support =", "suport =", '"support" is a required property'),
        "palettes/myjet-palette.toml": ("alpha =", "alfa =", '"alpha" is a required property'),
    }
    for name, (word, slip, told) in slips.items():
        assert _said(package, name)[0] == 0
        text = (package / name).read_text(encoding="utf-8")
        assert word in text
        (package / name).write_text(text.replace(word, slip, 1), encoding="utf-8")
        code, said = _said(package, name)
        assert code != 0
        assert told in said


def test_a_campaign_is_valid(tmp_path: Path, samples: Path) -> None:
    assert run(["schema", "campaign", "-o", str(tmp_path / "campaign.json")]) == 0
    campaign = (samples / "warm-lab" / "campaign.toml").read_text(encoding="utf-8")
    (tmp_path / "campaign.toml").write_text(f"#:schema ./campaign.json\n{campaign}")
    assert _said(tmp_path, "campaign.toml")[0] == 0
    (tmp_path / "campaign.toml").write_text(f"#:schema ./campaign.json\n{campaign}\nodd = 1\n")
    assert _said(tmp_path, "campaign.toml")[0] != 0
