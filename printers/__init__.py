"""Printers that come with planner, each a plugin found by entry point."""
