"""The Python interface: all that the commands do, under the same names, with the same defaults."""

import ast
import builtins
import contextlib
import doctest
import inspect
import io
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer

import planner
from planner.cli import app, run

PAGE = (Path(__file__).parents[2] / "docs/reference/python.md").read_text(encoding="utf-8")
COMMANDS = dict(re.findall(r"^\| `planner ([\w ]+)` \| `planner\.(\w+)`", PAGE, re.MULTILINE))
BEHIND = {"simulate": ("simulate_bar", "simulate_part")}  # called by what its options are of
FUNCTIONS = {n: f for n in planner.__all__ if inspect.isfunction(f := getattr(planner, n))}
# What a command does with a result: where it is written, and what of it is printed.
OF_THE_COMMAND = {
    "output",
    "force",
    "strict",
    "dry_run",
    "no_page",
    "slicer",
    "no_open",
    "tray",  # of the printer, as load_printer takes it
    "minimum_wall_mm",
    "minimum_feature_mm",
    "field",
    "names",
    "as_program",
    "figure",
    "tables",
    "deformed",
    "vtu",
    "volume",
    "page",
    "as_json",
    "quiet",
    "case",  # beside `cases`
}


def commands() -> dict[str, Any]:
    group: Any = typer.main.get_command(app)
    below = {f"gap {name}": c for name, c in group.commands["gap"].commands.items()}
    return {name: c for name, c in group.commands.items() if name != "gap"} | below


def test_every_command_has_its_function() -> None:
    assert set(COMMANDS) == set(commands())
    assert set(COMMANDS.values()) <= set(planner.__all__)


@pytest.mark.parametrize(("command", "name"), COMMANDS.items())
def test_a_function_takes_what_its_command_takes_with_the_same_defaults(command, name) -> None:
    behind = BEHIND.get(name)
    functions = [getattr(planner, n) for n in behind] + [planner.LoadCase] if behind else []
    arguments = inspect.signature(getattr(planner, name)).parameters
    for function in functions:
        arguments = {**inspect.signature(function).parameters, **arguments}
    for option in commands()[command].params:
        if behind and option.name in {"steps", "cases"}:  # each has its own
            assert option.default is None
        elif option.name not in arguments:
            assert option.name in OF_THE_COMMAND, option.name
        elif not option.required and option.name not in {"output", "force"}:
            default = arguments[option.name].default
            assert option.default == (None if default == () else default), option.name
        elif option.required:
            assert arguments[option.name].default is inspect.Parameter.empty, option.name


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_function_is_told_whole(name: str) -> None:
    told = sections(FUNCTIONS[name])
    parameters = set(inspect.signature(FUNCTIONS[name]).parameters)
    keys = entries(told.get("Parameters", ""))
    assert {word.strip() for key in keys for word in key.split(",")} == parameters
    assert "Examples" in told
    assert {"Returns", "Yields"} & set(told) or name == "write_palette"
    assert (
        "Raises" in told or name in {"installed_printers", "fit_tables"} or name.endswith("_figure")
    )


def examples(name: str) -> list[doctest.Example]:
    return doctest.DocTestParser().get_examples(inspect.getdoc(FUNCTIONS[name]) or "")


@pytest.mark.parametrize("name", FUNCTIONS)
def test_examples_name_nothing_that_is_not_there(name: str) -> None:
    """Eight wrote to a Path that nothing imported."""
    known = {"planner", *dir(builtins)}
    for example in examples(name):
        nodes = [*ast.walk(ast.parse(example.source))]
        known |= {node.name for node in nodes if isinstance(node, ast.alias)}
        known |= {node.arg for node in nodes if isinstance(node, ast.arg)}
        names = [node for node in nodes if isinstance(node, ast.Name)]
        known |= {node.id for node in names if isinstance(node.ctx, ast.Store)}
        assert {node.id for node in names} <= known, example.source


@pytest.mark.parametrize("name", ["file_schema", "invert", "list_materials", "simulate_bar"])
def test_examples_give_what_they_show(name: str) -> None:
    there: dict[str, Any] = {"planner": planner}
    for example in examples(name):
        shown = io.StringIO()
        with contextlib.redirect_stdout(shown):
            exec(compile(example.source, name, "single"), there)
        assert shown.getvalue() == example.want, example.source


def sections(thing: Any) -> dict[str, str]:
    """Return the text of each section of a numpydoc docstring."""
    parts = re.split(r"^([A-Z][a-z]+)\n-{3,}\n", inspect.getdoc(thing) or "", flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def entries(section: str) -> list[str]:
    """Return the names or types that a section says something of."""
    return re.findall(r"^(\S.*)$", section, re.MULTILINE)


def test_the_page_lists_every_public_name_once() -> None:
    lists = re.findall(r":toctree: generated\n\n(.*?)```", PAGE, re.DOTALL)
    assert sorted(" ".join(lists).split()) == sorted(planner.__all__)


def test_every_public_name_is_there_after_everything_is_imported() -> None:
    """No module hides one: ``import planner.slices`` makes planner.slices that package."""
    code = (
        "import planner, planner.cli, importlib, pkgutil\n"
        "for m in pkgutil.walk_packages(planner.__path__, 'planner.'):\n"
        "    m.name.endswith('__main__') or importlib.import_module(m.name)\n"
        "assert not [n for n in planner.__all__ if n in vars(planner)]\n"
        "assert set(planner.__all__) <= set(dir(planner))\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_importing_planner_imports_nothing_else() -> None:
    code = (
        "import sys; before = set(sys.modules); import planner\n"
        "roots = {name.partition('.')[0] for name in set(sys.modules) - before}\n"
        "assert not roots - sys.stdlib_module_names - {'planner'}, roots\n"
        "assert not [name for name in sys.modules if name.startswith('planner.')]\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


BLOCK = "grade finger.stl --from Tango --to Vero"
DESIGN = "design finger.stl --from Tango --to Vero"
WRONG = [
    ("grade", {"from_": "Tango"}, "grade finger.stl --from Tango", "`from_` Tango `to` Vero"),
    ("grade", {"from_": "Tango", "to": "Tango"}, "grade finger.stl --from Tango --to Tango",
     "`from_` Tango and `to` Tango are one"),
    ("grade", {"pitch_mm": 0.0}, f"{BLOCK} --pitch 0", "`pitch_mm` 0: it must be above 0"),
    ("grade", {"bands": 0}, f"{BLOCK} --bands 0", "`bands` 0: it must be"),
    ("grade", {"at_strain": 10.0}, f"{BLOCK} --at-strain 10", "`at_strain` 10: the working"),
    ("grade", {"cell_mm": 0.5}, f"{BLOCK} --cell 0.5", "`cell_mm` 0.5: it goes with `blend`"),
    ("grade", {"profile": "lgo"}, f"{BLOCK} --profile lgo", "`profile` lgo: no such profile; did"),
    ("grade", {"unit": "inhc"}, f"{BLOCK} --unit inhc", "`unit` inhc: no such unit; did you mean"),
    ("grade", {"unit": ""}, f"{BLOCK} --unit=", "`unit` '': no such unit"),
    ("grade", {"axis": "x", "field": "axis: z"}, [*BLOCK.split(), "--axis", "x", "--field",
     "axis: z"], "give `axis` or `field`, not both"),
    ("simulate", {"to_strain": 0.0}, "simulate FLX9760 --to-strain 0", "`to_strain` 0: it must"),
    ("simulate", {"rate_mm_s": 0.0}, "simulate FLX9760 --rate 0", "`rate_mm_s` 0: it must be"),
    ("simulate", {"hold_s": -1.0}, "simulate FLX9760 --hold-s -1", "`hold_s` -1: it must be"),
    ("simulate", {"between_mm": (9.0, 3.0)}, "simulate FLX9760 --between 9:3",
     "`between_mm` 9:3: it must rise"),
    ("design", {"target": "x=min uz=-1 mm", "knots": 1}, [*DESIGN.split(), "--target",
     "x=min uz=-1 mm", "--knots", "1"], "`knots` 1: it must be a whole number from 2 to"),
    ("design", {"target": "x=min uw=-1 mm"}, [*DESIGN.split(), "--target", "x=min uw=-1 mm"],
     "`target` x=min uw=-1 mm: no such quantity 'uw'"),
    ("design", {"target": "x=min uz=-1"}, [*DESIGN.split(), "--target", "x=min uz=-1"],
     "`target` x=min uz=-1: the unit is missing"),
    ("design", {"target": "x=min uz=-1 mm", "prefer": "smoth"}, [*DESIGN.split(), "--target",
     "x=min uz=-1 mm", "--prefer", "smoth"], "`prefer` smoth: did you mean smooth"),
    ("design", {}, DESIGN, "`target` is missing"),
    ("invert", {}, "invert --modulus 0", "`modulus_MPa` 0: it must be above 0"),
    ("list_materials", {"at_strain": -0.1}, "materials --at-strain -0.1", "`at_strain` -0.1: the"),
    ("design_campaign", {"budget": 1000}, "gap design --effects rate --budget 1000 -o d",
     "`budget` 1000: it must be a whole number from 1 to 400"),
    ("design_campaign", {"budget": 8, "gauge_mm": 0.0},
     "gap design --effects rate --budget 8 --gauge-mm 0 -o d", "`gauge_mm` 0: it must be"),
    ("synthesise_campaign", {"scatter": 1.0}, "gap simulate --design lab --scatter 1 -o d",
     "`scatter` 1: it must be from 0 to 0.3"),
    ("synthesise_campaign", {"effect": "rtae"}, "gap simulate --design lab --effect rtae -o d",
     "`effect` rtae: no such effect; did you mean rate"),
    ("diagnose", {"without": "rat"}, "gap diagnose lab --without rat", "`without` rat: no such"),
]  # fmt: skip
FIRST = {
    "grade": ["finger.stl"], "design": ["finger.stl"], "simulate": ["FLX9760"], "invert": [0.0],
    "list_materials": [],
    "design_campaign": ["rate"], "synthesise_campaign": ["lab"], "diagnose": ["lab"],
}  # fmt: skip
OPTIONS = {
    "`from_`": "--from", "`pitch_mm`": "--pitch", "`cell_mm`": "--cell", "`rate_mm_s`": "--rate",
    "`between_mm`": "--between", "`modulus_MPa`": "--modulus",
}  # fmt: skip


@pytest.mark.parametrize(("name", "wrong", "command", "says"), WRONG)
def test_messages_name_arguments_in_python_and_options_on_the_command_line(
    samples: Path, tmp_path: Path, monkeypatch, capsys, name, wrong, command, says
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("finger.stl").symlink_to(samples / "finger.stl")
    Path("lab").symlink_to(samples / "warm-lab")
    if name in {"grade", "design"} and "from_" not in wrong:
        wrong = {"from_": "Tango", "to": "Vero", **wrong}
    with pytest.raises(planner.PlannerError) as caught:
        getattr(planner, name)(*FIRST[name], **wrong)
    assert says in str(caught.value)
    assert "--" not in str(caught.value)
    assert run(command.split() if isinstance(command, str) else command) == 2
    shown = str(caught.value)
    for argument, option in OPTIONS.items():
        shown = shown.replace(argument, option)
    words = shown.split("`")
    words[1::2] = ["--" + word.strip("_").replace("_", "-") for word in words[1::2]]
    assert capsys.readouterr().err == f"planner: {''.join(words)}\n"


def test_a_seed_is_asked_for_at_once(samples: Path) -> None:
    """A diagnosis took a minute, and then ended in a TypeError."""
    with pytest.raises(planner.PlannerError, match=r"`seed` -1: it must be a whole number"):
        planner.diagnose(samples / "warm-lab", seed=-1)


def test_starts_are_counted_and_an_order_may_be_an_array(samples: Path) -> None:
    """Two and a half starts were three, and an array ended in numpy's ValueError."""
    tests = samples / "tensile"
    with pytest.raises(planner.PlannerError, match=r"`starts` 2.5: it must be a whole number"):
        planner.fit(tests, starts=2.5)  # type: ignore[arg-type]
    order = np.array(["SYN-soft", "SYN-medium", "SYN-rigid"])
    fitted = planner.fit(tests, law="neo-hookean", starts=2, order=order, compare=False)
    assert [material.id for material in fitted.palette.materials] == order.tolist()


def test_a_size_may_be_an_array_of_one_number() -> None:
    """As xarray and pandas give them; it ended in a TypeError."""
    made = planner.design_campaign("rate", 4, gauge_mm=np.array(25.0))  # type: ignore[arg-type]
    assert {specimen.gauge_mm for specimen in made.campaign.specimens} == {25.0}
    with pytest.raises(planner.PlannerError, match=r"`width_mm` 1e.06: it must be from"):
        planner.design_campaign("rate", 4, width_mm=np.array(1e6))  # type: ignore[arg-type]
