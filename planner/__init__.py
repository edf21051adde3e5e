"""A print-job mixture planner for multi-material jetting printers.

>>> import planner
>>> plan = planner.grade("finger.stl", from_="Tango", to="Vero", axis="x")  # doctest: +SKIP
>>> plan.write("finger-graded")  # doctest: +SKIP

Every command of the command line is a function here, with the same names and defaults;
docs/reference/python.md lists them. Names are imported on first use, so that ``import planner``
costs nothing.
"""

import lazy_loader

__version__ = "0.1.0"

__getattr__, _names, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __dir__() -> list[str]:
    return [*_names(), "__version__"]
