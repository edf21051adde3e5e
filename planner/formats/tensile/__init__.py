"""Tensile test files: what a testing machine exports, and the list of specimens beside it."""

from planner.formats.tensile.reader import read_tensile
from planner.formats.tensile.specimens import Specimen, read_specimens
from planner.formats.tensile.table import TensileTable

__all__ = ["Specimen", "TensileTable", "read_specimens", "read_tensile"]
