"""Build the site: sphinx-build -W docs docs/_build.

What follows from the code is written anew at each build, into docs/reference/generated: a page for
each public name from its docstring, the commands from their own help, the tables of the diagnosis.
"""

import html
import re
import runpy
import subprocess
import sys
from pathlib import Path

import planner

project, author = "planner", "the planner contributors"
version = release = planner.__version__
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "numpydoc",
    "sphinx_copybutton",
]
exclude_patterns = ["_build", "reference/generated/*.md"]  # other pages take these in

html_theme = "furo"
html_title = f"planner {version}"
html_copy_source = False
smartquotes = False  # --option stays two hyphens

myst_enable_extensions = ["attrs_block"]
myst_heading_anchors = 4
myst_links_external_new_tab = True

autodoc_preserve_defaults = True
autodoc_typehints = "none"  # the docstrings state types, shapes and units
numpydoc_class_members_toctree = False
numpydoc_show_inherited_class_members = False
copybutton_prompt_text = "$ "

HERE = Path(__file__).parent


def made(script: str, function: str) -> str:
    """Return what a function of one of the scripts in docs/reference returns."""
    return str(runpy.run_path(str(HERE / "reference" / f"make_{script}.py"))[function]())


def generated() -> dict[str, str]:
    """Return the text of each generated file."""
    typer = [sys.executable, "-m", "typer", "planner.cli", "utils", "docs", "--name", "planner"]
    commands = subprocess.run(typer, capture_output=True, encoding="utf-8", check=True).stdout
    commands = re.sub(  # what the terminal shows in bold is a command to type
        r'<span style="font-weight: bold">(.*?)</span>',
        lambda found: f"`{html.unescape(found[1])}`",
        commands.partition("\n## ")[2],
    )
    return {
        "commands.md": f"## {commands}",
        "effects.md": made("effects", "tables"),
        "numbers.md": made("numbers", "tables"),
        "tree.txt": made("tree", "tree"),
    }


folder = HERE / "reference" / "generated"
folder.mkdir(exist_ok=True)
for name, text in generated().items():
    (folder / name).write_text(text, encoding="utf-8")
