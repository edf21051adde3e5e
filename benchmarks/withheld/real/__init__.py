"""Campaigns from published measurements, for which nobody made up the cause."""
