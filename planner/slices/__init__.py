"""A plan as the printer's own layers."""
