"""Fields: what a gradient follows through a part."""
