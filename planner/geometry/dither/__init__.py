"""Cells of two materials dealt so that every place has its share of both, and how they are cut."""
