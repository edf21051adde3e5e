"""Specimens that are yet to be tested, on the ways that their protocols will take them."""
