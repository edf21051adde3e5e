"""The DuoJet 150, an invented printer with Lastik and Durol."""

from importlib.resources import files

from planner.printers import load_profile

__all__ = ["PRINTER"]

PRINTER = load_profile(files(__name__))
