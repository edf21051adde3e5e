"""How much specimens made alike differ."""

from dataclasses import dataclass

__all__ = ["Scatter"]


@dataclass(frozen=True, slots=True)
class Scatter:
    """Standard deviations, of the logarithm of force unless named otherwise.

    Attributes
    ----------
    specimen, batch
        Of the level of a whole curve.
    slope
        Of the change of that level from the start of a path to its end.
    wander, wander_length
        Of what comes and goes along a path, and the share of the path over which it lasts.
    sensor
        Factor on the force noise that each record shows.
    field, field_relative
        Of a local strain: its own, and relative to it.
    log_sd
        How far all of it may be off, as a standard deviation of its logarithm.
    degrees_of_freedom
        Of the replicates behind it; 0 where there are none.
    """

    specimen: float
    batch: float
    slope: float
    wander: float
    wander_length: float
    sensor: float
    field: float
    field_relative: float
    log_sd: float
    degrees_of_freedom: int
