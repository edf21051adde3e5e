"""Which hypothesis the figures speak for."""
