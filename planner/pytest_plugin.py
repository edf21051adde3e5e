"""A plugin of pytest: golden plans, compared by meaning, and made anew with --update-goldens.

Importing planner costs nothing, and this file imports no more than pytest until a plan is compared.
"""

import re
import shlex
from collections.abc import Generator
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import pytest

if TYPE_CHECKING:
    from planner.plan import Plan

__all__ = ["golden_plan"]


_OPTION = "--update-goldens"
_WRITTEN = "golden plan written"


@pytest.hookimpl(wrapper=True)
def pytest_load_initial_conftests(parser: pytest.Parser) -> Generator[None, Any, Any]:
    """Add the option, unless a conftest.py or another plugin has one of that name: that one counts.

    To add it twice would end every run of a project that has planner installed and its own option.
    """
    loaded = yield
    if not hasattr(parser.parse_known_args([]), "update_goldens"):
        parser.getgroup("planner").addoption(
            _OPTION, action="store_true", help="write golden plans that are missing or differ"
        )
    return loaded


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Say which golden plans were written, so that someone looks at them."""
    reports = (r for each in terminalreporter.stats.values() for r in each)
    properties = (p for r in reports for p in getattr(r, "user_properties", ()))
    for path in sorted({str(value) for name, value in properties if name == _WRITTEN}):
        terminalreporter.write_line(f"{_WRITTEN}: {path}")


@pytest.fixture
def golden_plan(request: pytest.FixtureRequest) -> "GoldenPlan":
    """Compare a plan with the golden one beside the test: ``golden_plan(plan, "finger")``."""
    return GoldenPlan(request.node, bool(request.config.getoption("update_goldens", False)))


class GoldenPlan:
    """Compares plans with golden ones, as a test's `golden_plan`.

    Parameters
    ----------
    test
        Golden plans lie in ``goldens`` beside its file.
    update
        Write what is missing or differs, instead of failing.
    """

    def __init__(self, test: pytest.Item, update: bool) -> None:
        self.test = test
        self.update = update

    def __call__(
        self, plan: "Plan | str | Path", name: str | Path, *, tolerance: float = 1e-6
    ) -> None:
        """Fail unless a plan means what the golden plan does, with each difference in words.

        Parameters
        ----------
        plan
            What `planner.grade` or `planner.read_plan` returns, a plan.json, or its folder.
        name
            ``finger`` stands for goldens/finger.plan.json beside the test; what ends in ``.json``
            is a path, from the test's folder.
        tolerance
            Relative difference of volumes, masses and moduli that still counts as equal.
        """
        __tracebackhide__ = True
        from planner.errors import FileError
        from planner.formats.outputs import write_whole
        from planner.grading.check import diff
        from planner.plan import Plan, decode_plan, read_plan

        golden = self._file(name)
        made = plan if isinstance(plan, Plan) else read_plan(plan)
        data = made.json()
        differences = ["there is no such file"]
        if golden.is_file():
            try:
                found = diff(golden, decode_plan(data, made.name), tolerance=tolerance)
                differences = [difference.text for difference in found]
            except FileError as error:
                differences = [str(error)]
        if not differences:
            return
        if not self.update:
            self._fail(golden, differences)
        golden.parent.mkdir(parents=True, exist_ok=True)
        write_whole(golden, data)
        self.test.user_properties.append((_WRITTEN, str(golden)))

    def _file(self, name: str | Path) -> Path:
        beside = self.test.path.parent
        if str(name).endswith(".json"):
            return beside / name
        if not re.fullmatch(r"[\w.-]+", str(name)):
            pytest.fail(
                f"golden plan {str(name)!r}: a name has letters, digits, '.', '-' and '_'; a path "
                "ends in .json",
                pytrace=False,
            )
        return beside / "goldens" / f"{name}.plan.json"

    def _fail(self, golden: Path, differences: list[str]) -> NoReturn:
        __tracebackhide__ = True
        shown = [f"  {words}" for words in differences[:_SHOWN]]
        if len(differences) > _SHOWN:
            shown.append(f"  and {len(differences) - _SHOWN} more")
        command = f"pytest {_OPTION} {shlex.quote(self.test.nodeid)}"
        head = f"the plan is not the golden one, {golden}:"
        advice = f"if it is as you want it, make it the golden one: {command}"
        pytest.fail("\n".join([head, *shown, advice]), pytrace=False)


_SHOWN = 40
"""Differences told: what fits a screen."""
