"""Laws fitted to tensile tests, with intervals and a choice among them."""
