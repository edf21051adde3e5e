"""The gap between simulation and measurement: the data, where it lies and what causes it."""
