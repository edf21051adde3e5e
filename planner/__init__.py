"""A print-job mixture planner for multi-material jetting printers."""

__version__ = "0.1.0"
