"""A print-job mixture planner for multi-material jetting printers.

>>> import planner
>>> plan = planner.grade("finger.stl", from_="Tango", to="Vero", axis="x")  # doctest: +SKIP
>>> plan.write("finger-graded")  # doctest: +SKIP

Every command of the command line is a function here, with the same names and defaults;
docs/reference/python.md lists them. Names are imported on first use, so that ``import planner``
costs nothing.
"""

import re
from importlib import import_module
from typing import Any

__version__ = "0.1.0"

_STUB = __spec__.loader.get_data(f"{__path__[0]}/__init__.pyi").decode()
"""Where names come from stands once, for type checkers too."""

_HOME = {name: module for module, name in re.findall(r"(?m)^from (\S+) import (\w+)", _STUB)}
__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'planner' has no attribute {name!r}")
    return getattr(import_module(_HOME[name], __name__), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
