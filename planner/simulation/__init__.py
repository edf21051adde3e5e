"""How a graded bar pulls."""
