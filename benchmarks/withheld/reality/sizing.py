"""How large a cause is made: as visible as was drawn, within its physical range."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.withheld.reality.bench import Bench, FloatArray
from benchmarks.withheld.reality.solver import solve
from benchmarks.withheld.reality.strength import Yardstick, level_excess, relative_excess
from benchmarks.withheld.reality.tiers import Cause

__all__ = ["Hidden", "force_N", "hide", "hide_cancelling", "mounted_with"]

_CORRECTIONS = 3
_CLOSE = 0.05


@dataclass(frozen=True)
class Hidden:
    """A cause at its final size."""

    cause: Cause
    size: float


def force_N(benches: Sequence[Bench], hidden: Sequence[Hidden] = ()) -> FloatArray:
    """Return what ideal sensors with the benches' faults would show, by specimen number."""
    rows = sum(len(b.design) for b in benches)
    force = np.zeros((rows, benches[0].motion.time_s.shape[1]))
    for bench in benches:
        faulty = mounted_with(bench, hidden)
        response = solve(faulty)
        force[bench.design.number] = faulty.gain * response.force_N + faulty.offset_N
    return force


def mounted_with(bench: Bench, hidden: Sequence[Hidden]) -> Bench:
    """Return a bench with what is hidden in it, from the composition to the sensor."""
    for item in sorted(hidden, key=lambda h: h.cause.effect.stage):
        bench = item.cause.form.apply(bench, item.size, item.cause.shape)
    return bench


def hide(benches: Sequence[Bench], cause: Cause, plain_N: FloatArray, by: Yardstick) -> Hidden:
    """Find the size at which the cause has the signal-to-noise ratio that was wanted of it.

    One whose size is given keeps it.
    """
    form = cause.form
    if cause.size is not None:
        return Hidden(cause, cause.size)
    size = float(np.sqrt(form.low * form.high))
    for _ in range(_CORRECTIONS):
        seen = by.snr(_level(benches, Hidden(cause, size), plain_N))
        if abs(seen / cause.wanted_snr - 1.0) < _CLOSE:
            break
        grown = size * cause.wanted_snr / max(seen, 1e-9)
        size = float(np.clip(grown, form.low, form.high))
    return Hidden(cause, size)


def hide_cancelling(
    benches: Sequence[Bench], causes: tuple[Cause, ...], plain_N: FloatArray, by: Yardstick
) -> tuple[Hidden, Hidden]:
    """Hide the first cause, and the second so that it takes back as much of it as it can.

    Either may change its sign for that; the second is as large as makes the sum of the two
    specimens' excess smallest. Where its range ends before, the first is made smaller.
    """
    first, second = causes
    choices = []
    for one, other in _signs(first, second):
        hidden = hide(benches, one, plain_N, by)
        level = _level(benches, hidden, plain_N)
        trial = Hidden(other, float(np.sqrt(other.form.low * other.form.high)))
        taken = _level(benches, trial, plain_N)
        ideal = -trial.size * float(level @ taken) / float(taken @ taken)
        size = float(np.clip(ideal, other.form.low, other.form.high))
        less = float(np.clip(hidden.size * size / max(ideal, size), one.form.low, hidden.size))
        level = level * less / hidden.size
        left = level + taken * size / trial.size
        left_share = float(left @ left) / float(level @ level)
        choices.append((left_share, Hidden(one, less), Hidden(other, size)))
    _, hidden, taking = min(choices, key=lambda choice: choice[0])
    return hidden, taking


def _signs(first: Cause, second: Cause) -> list[tuple[Cause, Cause]]:
    ones, others = ([c for c in (cause, cause.opposite()) if c] for cause in (first, second))
    return [(one, other) for one in ones for other in others]


def _level(benches: Sequence[Bench], hidden: Hidden, plain_N: FloatArray) -> FloatArray:
    return level_excess(relative_excess(force_N(benches, [hidden]), plain_N))
