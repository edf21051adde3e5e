"""Every option of a command reaches its function, or is used by the command itself."""

import ast
import inspect
import re
import textwrap
from dataclasses import fields, is_dataclass

import pytest

import planner
from planner.cli import gap, materials, plans, simulate

COMMANDS = {
    f"{module.__name__.rpartition('.')[2]} {name}": inspect.unwrap(command)
    for module in (gap, materials, plans, simulate)
    for name, command in vars(module).items()
    if inspect.isfunction(command)
    if re.search(r"cli\.run\(\s*planner\.", inspect.getsource(command))
}


def test_the_commands_that_pass_options_on_are_found():
    assert len(COMMANDS) >= 10


@pytest.mark.parametrize("command", COMMANDS.values(), ids=COMMANDS)
def test_no_option_is_lost(command):
    """`run` leaves out what the function has no parameter for; the command must read that."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(command)))
    calls = [n for n in ast.walk(tree) if isinstance(n, ast.Call) and is_named(n.func, "run")]
    read = {n.id for n in ast.walk(tree) if isinstance(n, ast.Name)}
    whole = {n.func.value.id for n in ast.walk(tree) if is_named(getattr(n, "func", 0), "printer")}
    parameters = inspect.signature(command).parameters.values()
    assert calls
    for call in calls:
        takes = {*inspect.signature(getattr(planner, call.args[0].attr)).parameters}
        groups = {p.name: p.annotation for p in parameters if is_dataclass(p.annotation)}
        lost = {p.name for p in parameters} - takes - read - {*groups}
        for name in groups.keys() - whole:  # what is left of a group makes a printer
            lost |= {field.name for field in fields(groups[name])} - takes
        assert not lost


def is_named(node, name):
    return isinstance(node, ast.Attribute) and node.attr == name
