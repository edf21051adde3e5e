"""Stiffness of two materials printed as one: bounds, and solutions of a periodic cell."""
