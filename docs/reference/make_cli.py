"""Write docs/reference/cli.md from the commands themselves: python docs/reference/make_cli.py."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer

from planner.cli import app

TARGET = Path(__file__).with_name("cli.md")

HEAD = """# The command line

Made by `docs/reference/make_cli.py`; do not edit.

Exit codes of every command: 0 done; 1 done, but with a finding (a target out of reach, a check
that failed, a difference, a gap); 2 wrong usage or bad input, with the reason in one line on
stderr and nothing written; 130 interrupted, 143 ended by SIGTERM; 70 an internal error. `--json`
prints one JSON document on stdout and nothing else there. Colours follow the terminal and
`NO_COLOR`.
"""


def reference() -> str:
    """Return the page."""
    group = typer.main.get_command(app)
    lines = [HEAD]
    for name, command in _commands(group):
        text = _plain(command.callback.__doc__ or "")
        summary, _, rest = text.partition("\n\n")
        arguments = [p for p in command.params if p.param_type_name == "argument"]
        options = [p for p in command.params if p.param_type_name == "option"]
        usage = " ".join(["planner", name, *(p.name.upper() for p in arguments), "[OPTIONS]"])
        lines += [f"## planner {name}", "", f"`{usage}`", "", summary, "", rest.strip(), ""]
        lines += ["| | |", "| --- | --- |"]
        lines += [f"| `{p.name.upper()}` | {_plain(p.help or '')} |" for p in arguments]
        for p in options:
            default = p.default
            shown = ""
            if isinstance(default, (int, float, str)) and not isinstance(default, bool):
                shown = f" Default: `{default}`."
            names = ", ".join(f"`{n}`" for n in [*p.opts, *p.secondary_opts])
            lines.append(f"| {names} | {_plain(p.help or '')}{shown} |")
        lines.append("")
    return "\n".join(lines).rstrip() + "\n"


def _commands(group: Any) -> Iterator[tuple[str, Any]]:
    """Yield every command by the words that call it, sorted; of a group, its own commands."""
    for name, command in sorted(group.commands.items()):
        if not hasattr(command, "commands"):
            yield name, command
            continue
        for inner, below in _commands(command):
            yield f"{name} {inner}", below


def _plain(text: str) -> str:
    """Turn rich markup into Markdown and unwrap lines within paragraphs."""
    text = re.sub(r"\[bold\](.*?)\[/bold\]", r"`\1`", text, flags=re.DOTALL)
    paragraphs = [" ".join(p.split()) for p in text.split("\n\n")]
    return "\n\n".join(p for p in paragraphs if p).replace("|", r"\|")


if __name__ == "__main__":
    TARGET.write_text(reference(), encoding="utf-8", newline="\n")
