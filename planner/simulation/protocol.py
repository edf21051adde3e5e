"""What the crosshead does: displacement over time."""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from planner.arrays import FloatArray
from planner.errors import ArgumentError, nearest_names

__all__ = ["PROTOCOLS", "LoadingPath", "Protocol", "loading_path"]

Protocol = Literal["monotonic", "cyclic", "relaxation"]
PROTOCOLS: tuple[Protocol, ...] = get_args(Protocol)

_FIRST_HOLD = 1e-3  # of the hold: relaxation is read on a logarithmic scale of time


@dataclass(frozen=True, slots=True, eq=False)
class LoadingPath:
    """Displacement of the crosshead at times.

    Attributes
    ----------
    time_s, displacement_mm : (steps,)
        From rest at time 0; time rises, displacement is never below 0.
    """

    time_s: FloatArray
    displacement_mm: FloatArray

    def __post_init__(self) -> None:
        for name in ("time_s", "displacement_mm"):
            array = np.array(getattr(self, name), dtype=np.float64)
            array.setflags(write=False)
            object.__setattr__(self, name, array)
            if array.ndim != 1 or not np.isfinite(array).all():
                raise ArgumentError(f"loading path: {name} must be finite numbers, one a step")
        if self.time_s.shape != self.displacement_mm.shape or len(self.time_s) == 0:
            raise ArgumentError(
                f"loading path: {len(self.time_s)} times and {len(self.displacement_mm)} "
                "displacements; it needs one of each a step, and at least one step"
            )
        if not (np.diff(self.time_s) > 0.0).all():
            raise ArgumentError("loading path: time must rise from step to step")
        if (self.displacement_mm < 0.0).any():
            raise ArgumentError(
                f"loading path: displacement of {self.displacement_mm.min():g} mm; bars are "
                "pulled, not pressed: it must not fall below 0"
            )


def loading_path(
    protocol: str,
    *,
    to_displacement_mm: float,
    rate_mm_s: float,
    steps: int = 100,
    cycles: int = 1,
    hold_s: float = 100.0,
) -> LoadingPath:
    """Return the path of a protocol.

    Parameters
    ----------
    protocol
        ``monotonic``: up at constant rate. ``cyclic``: up and down, `cycles` times.
        ``relaxation``: up, then held for `hold_s` at times that are evenly spaced in their
        logarithm.
    steps
        Load steps of each leg; the start is one more.

    Raises
    ------
    ArgumentError
        An unknown protocol, or a figure outside what it may be.
    """
    for name, value in (("--rate", rate_mm_s), ("--hold-s", hold_s)):
        if not 0.0 < value < np.inf:
            raise ArgumentError(f"{name} {value:g}: it must be above 0 and finite")
    for name, count in (("--steps", steps), ("--cycles", cycles)):
        if not 1 <= count <= 10_000:
            raise ArgumentError(f"{name} {count}: it must be a whole number from 1 to 10000")
    up = np.linspace(0.0, to_displacement_mm, steps + 1)
    ramp_s = up / rate_mm_s
    if protocol == "monotonic":
        return LoadingPath(ramp_s, up)
    if protocol == "cyclic":
        turns = np.concatenate([up[1:], up[-2::-1]])
        displacement = np.concatenate([up[:1], np.tile(turns, cycles)])
        time = np.linspace(0.0, 2.0 * cycles * float(ramp_s[-1]), len(displacement))
        return LoadingPath(time, displacement)
    if protocol == "relaxation":
        held = np.geomspace(_FIRST_HOLD * hold_s, hold_s, steps)
        return LoadingPath(
            np.concatenate([ramp_s, ramp_s[-1] + held]),
            np.concatenate([up, np.full(steps, up[-1])]),
        )
    near = nearest_names(protocol, list(PROTOCOLS))
    hint = f"did you mean {near[0]}? " if near else ""
    raise ArgumentError(
        f"--protocol {protocol}: no such protocol; {hint}it may be {', '.join(PROTOCOLS)}"
    )
