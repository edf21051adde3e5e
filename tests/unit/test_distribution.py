"""What `pip install` brings is this project: on the package index `planner` is another's name."""

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_the_distribution_has_a_name_of_its_own() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["name"] == "jetting-planner"
    assert list(project["scripts"]) == ["planner"]


def test_no_text_installs_the_other_planner() -> None:
    texts = [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("planner/**/*.py")]
    wrong = re.compile(r"pip[ \w.-]* install [^\n]*?(?<![\w/.-])planner(?![\w-])(?=\[|['\"`\s]|$)")
    assert wrong.search("pip install 'planner[plot]'")
    assert wrong.search("pip install -U planner")
    found = [
        f"{path.relative_to(ROOT)}: {line}"
        for path in texts
        for line in path.read_text(encoding="utf-8").splitlines()
        if wrong.search(re.split("&&|  #", line)[0])
    ]
    assert found == []
