"""The Stratasys Objet500 Connex3 with TangoPlus or Agilus30 and VeroWhitePlus."""

from importlib.resources import files

from planner.printers import load_profile

__all__ = ["PRINTER"]

PRINTER = load_profile(files(__name__))
