"""The plugin of pytest: golden plans in other people's tests."""

import dataclasses
import json
import tomllib
from pathlib import Path

import pytest

import planner
from planner.plan import Plan

pytest_plugins = ("pytester",)

PLUGIN = ("-p", "no:planner", "-p", "planner.pytest_plugin", "-p", "no:cacheprovider")
"""By its module, so that these tests are of this checkout, whatever is installed."""

TEST = """
import planner

def test_part(golden_plan):
    golden_plan(planner.read_plan("made.json"), "part")
"""


@pytest.fixture(scope="module")
def plan(samples: Path) -> Plan:
    return planner.grade(samples / "dogbone.stl", from_="Tango", to="FLX9750", axis="x")


@pytest.fixture
def project(pytester: pytest.Pytester, plan: Plan) -> pytest.Pytester:
    """A project with one test of a plan, whose golden plan is the same."""
    (pytester.path / "made.json").write_bytes(plan.json())
    (pytester.path / "goldens").mkdir()
    (pytester.path / "goldens" / "part.plan.json").write_bytes(plan.json())
    pytester.makepyfile(test_parts=TEST)
    return pytester


def stiffer(plan: Plan, by: float) -> Plan:
    first = plan.regions[0]
    changed = dataclasses.replace(first, modulus_MPa=first.modulus_MPa * (1.0 + by))
    return dataclasses.replace(plan, regions=(changed, *plan.regions[1:]))


def test_pytest_finds_it() -> None:
    table = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text("utf-8"))
    assert table["project"]["entry-points"]["pytest11"] == {"planner": "planner.pytest_plugin"}


def test_a_plan_that_means_the_same_passes(project: pytest.Pytester, plan: Plan) -> None:
    file = project.path / "made.json"
    other = json.loads(file.read_text("utf-8")) | {"version": "9.9"}
    file.write_text(json.dumps(other), "utf-8")
    project.runpytest(*PLUGIN).assert_outcomes(passed=1)


def test_differences_are_told_in_words_with_what_to_do(
    project: pytest.Pytester, plan: Plan
) -> None:
    (project.path / "made.json").write_bytes(stiffer(plan, 0.01).json())
    found = project.runpytest(*PLUGIN)
    found.assert_outcomes(failed=1)
    found.stdout.fnmatch_lines(
        [
            "the plan is not the golden one, */goldens/part.plan.json:",
            "  *modulus*region 1*0.359*->*0.36*",
            "*make it the golden one: pytest --update-goldens test_parts.py::test_part",
        ]
    )
    found.stdout.no_fnmatch_line("*pytest_plugin.py*")


def test_updating_writes_it_says_so_and_then_it_passes(
    project: pytest.Pytester, plan: Plan
) -> None:
    golden, changed = project.path / "goldens" / "part.plan.json", stiffer(plan, 0.01)
    (project.path / "made.json").write_bytes(changed.json())
    found = project.runpytest(*PLUGIN, "--update-goldens")
    found.assert_outcomes(passed=1)
    found.stdout.fnmatch_lines([f"golden plan written: {golden}"])
    assert golden.read_bytes() == changed.json()
    again = project.runpytest(*PLUGIN, "--update-goldens")
    again.stdout.no_fnmatch_line("golden plan written*")
    project.runpytest(*PLUGIN).assert_outcomes(passed=1)


@pytest.mark.slow
def test_workers_of_xdist_say_what_they_wrote(project: pytest.Pytester) -> None:
    golden = project.path / "goldens" / "part.plan.json"
    golden.unlink()
    found = project.runpytest_subprocess(*PLUGIN, "-n", "1", "--update-goldens")
    found.assert_outcomes(passed=1)
    found.stdout.fnmatch_lines([f"golden plan written: {golden}"])


@pytest.mark.parametrize("content", [None, b"{", b"[]", b'{"schema": 1}'])
def test_a_golden_plan_that_is_missing_or_broken_is_made(
    project: pytest.Pytester, plan: Plan, content: bytes | None
) -> None:
    golden = project.path / "goldens" / "part.plan.json"
    golden.unlink()
    if content is not None:
        golden.write_bytes(content)
    found = project.runpytest(*PLUGIN)
    found.assert_outcomes(failed=1)
    says = "there is no such file" if content is None else "*part.plan.json:*"
    found.stdout.fnmatch_lines([f"  {says}", "*pytest --update-goldens test_parts.py::test_part"])
    project.runpytest(*PLUGIN, "--update-goldens").assert_outcomes(passed=1)
    assert golden.read_bytes() == plan.json()


def test_names_paths_folders_and_tolerance(project: pytest.Pytester, plan: Plan) -> None:
    (project.path / "made.json").write_bytes(stiffer(plan, 0.01).json())
    plan.write(project.path / "bar")
    project.makepyfile(
        test_parts="""
        import planner
        from pathlib import Path

        def test_tolerance(golden_plan):
            golden_plan("made.json", "part", tolerance=0.02)

        def test_path(golden_plan):
            golden_plan("bar", "bar/plan.json")
            golden_plan(Path("bar"), Path("bar/plan.json"), tolerance=0.0)

        def test_name(golden_plan):
            golden_plan("bar", "../part")
        """
    )
    found = project.runpytest(*PLUGIN, "--update-goldens")
    found.assert_outcomes(passed=2, failed=1)
    found.stdout.fnmatch_lines(["golden plan '../part': a name has letters*"])


# ------------------------------------------------------------------------------------------------
# Those who do not use it do not notice it.


def test_it_imports_nothing_heavy(project: pytest.Pytester) -> None:
    project.makepyfile(
        test_parts="""
        import sys

        def test_nothing_is_imported():
            heavy = {"numpy", "scipy", "numba", "msgspec", "planner.plan"}
            assert not heavy & set(sys.modules)
        """
    )
    project.runpytest_subprocess(*PLUGIN).assert_outcomes(passed=1)


def test_an_option_of_the_same_name_stays_the_projects_own(project: pytest.Pytester) -> None:
    """The conftest.py of a project, and the plugin pytest-golden, have one."""
    project.makeconftest(
        """
        def pytest_addoption(parser):
            parser.addoption("--update-goldens", action="store_true", help="ours")
        """
    )
    found = project.runpytest(*PLUGIN, "--help")
    found.stdout.fnmatch_lines(["*--update-goldens*ours"])
    (project.path / "goldens" / "part.plan.json").unlink()
    project.runpytest(*PLUGIN, "--update-goldens").assert_outcomes(passed=1)
