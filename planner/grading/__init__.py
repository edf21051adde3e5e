"""Grading: from a part and a wish for stiffness to a plan."""
