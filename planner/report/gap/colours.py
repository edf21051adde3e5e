"""Colours that mean the same in every figure, told apart by the colour-blind and in grey."""

__all__ = ["AFTER", "BASELINE", "BEFORE", "MEASURED", "PALE", "QUIET"]

BEFORE = "#c0562b"
"""What the palette alone predicts."""

AFTER = "#1f5fa8"
"""With the verdict's effects."""

MEASURED = "#222222"

BASELINE = "#9aa3ad"
"""What the effects are held against."""

PALE = "#c9d8ea"
"""The part of a bar that needs something unknown."""

QUIET = "#5c5c5c"
"""Notes."""
