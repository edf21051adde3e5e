"""compare.html: the same bytes for the same plans, what differs in words, and nothing that runs."""

import json
import shutil
from pathlib import Path

import pytest

import planner
from planner.cli import run


@pytest.fixture(scope="module")
def plans(samples: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The dogbone in two halves, soft to hard, and with a harder end."""
    root = tmp_path_factory.mktemp("plans")
    folders = []
    for to in ("FLX9750", "FLX9770"):
        plan = planner.grade(samples / "dogbone.stl", from_="FLX9740", to=to, bands=2)
        folders.append(plan.write(root / to))
    return folders[0], folders[1]


def test_the_same_bytes_each_time(plans: tuple[Path, Path]) -> None:
    page = planner.compare_page(*plans)
    assert page == planner.compare_page(*map(planner.read_plan, plans))
    assert len(page) < 1_000_000


def test_it_says_what_differs_and_marks_the_rows(plans: tuple[Path, Path]) -> None:
    page = planner.compare_page(*plans).decode()
    for difference in planner.diff(*plans):
        assert f'<td class="words">{difference.what}</td>' in page
    assert "What differs (" in page
    assert page.count('class="changed"') >= 2
    assert '<span class="volume">A alone</span>' in page
    same = planner.compare_page(plans[0], plans[0]).decode()
    assert "The plans mean the same." in same
    assert 'class="changed"' not in same


def test_names_are_words_and_no_markup(samples: Path, tmp_path: Path) -> None:
    part = tmp_path / "<script>alert(1)<!--.stl"
    part.write_bytes((samples / "dogbone.stl").read_bytes())
    plan = planner.grade(part, from_="Tango", to="FLX9795", bands=2)
    page = planner.compare_page(plan, plan).decode()
    assert "<script>alert" not in page
    assert "&lt;script&gt;alert(1)&lt;!--.stl: two plans" in page


def test_exit_codes_are_those_of_diff(
    plans: tuple[Path, Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    before, after = map(str, plans)
    assert run(["compare", before, after, "--no-open"]) == 1
    assert "compare.html" in capsys.readouterr().out
    assert run(["compare", before, before, "--no-open"]) == 2  # a page is there
    assert "--force" in capsys.readouterr().err
    assert run(["compare", before, before, "--no-open", "--force", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told == {
        "schema": 1, "page": "compare.html", "opened": False, "equal": True, "differences": [],
    }  # fmt: skip
    assert run(["compare", before, "nowhere", "-o", "x.html", "--no-open"]) == 2
    assert not Path("x.html").exists()


def test_an_altered_folder_is_refused(plans: tuple[Path, Path], tmp_path: Path) -> None:
    copy = Path(shutil.copytree(plans[0], tmp_path / "copy"))
    shell = next((copy / "stl").iterdir())
    shell.write_bytes(shell.read_bytes()[:-1] + b"\1")
    with pytest.raises(planner.errors.FileError, match="not what the plan was written with"):
        planner.compare_page(copy, plans[1])
