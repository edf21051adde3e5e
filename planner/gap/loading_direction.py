"""Whether a record is of a pull or of a push, whichever way its channels count."""

from collections.abc import Callable, Iterable
from typing import Literal

import numpy as np

from planner.numerics import FloatArray

__all__ = ["Mode", "said_mode", "turned"]

Mode = Literal["tension", "compression"]

_WORDS: dict[str, Mode] = {
    **dict.fromkeys(("compression", "compressive", "compressed", "pushed"), "compression"),
    **dict.fromkeys(("tension", "tensile", "pulled"), "tension"),
}

_UNIAXIAL = "uniaxial "


def said_mode(cells: Iterable[object]) -> Mode | None:
    """Return what a row of specimens.csv says of the way of loading; None where it says nothing.

    A cell says so by one word alone: a batch that was moulded by compression may be pulled.
    """
    texts = (cell.casefold().removeprefix(_UNIAXIAL) for cell in cells if isinstance(cell, str))
    return next((_WORDS[text] for text in texts if text in _WORDS), None)


_TURNED_RATIO = 5.0
"""Largest value below zero over the largest above, of what was recorded with its sign turned.
Chosen: a way back past zero is small beside the pull, so that anything well above 1 does."""


def turned(
    force_N: FloatArray,
    travel_mm: FloatArray,
    *,
    said: Mode | None,
    gauge_mm: float,
    area_mm2: float | None,
    stress_MPa: Callable[[FloatArray], FloatArray] | None,
    notes: list[str],
) -> tuple[FloatArray, FloatArray]:
    """Return force and travel, both positive in tension and negative in compression.

    What is said of a specimen holds. Else both negative are a push, both positive a pull. Where
    one alone is negative, the curve tells, by the law that it is nearer to at any stiffness; where
    laws are too much alike for that, a piece that is wider than long was pushed: no grip holds it.

    Parameters
    ----------
    stress_MPa
        The material's law, nominal stress of stretches; None where there is none.
    notes
        What was turned or looks odd is added.
    """
    down = {"force": _is_negative(force_N), "travel": _is_negative(travel_mm)}
    names = [name for name, negative in down.items() if negative]
    which = " and ".join(names) or "none"
    curve = None if stress_MPa is None else _kind(force_N, travel_mm, gauge_mm, stress_MPa)
    if said is not None:
        mode = said
    elif len(names) != 1:
        mode = "compression" if names else "tension"
    elif curve is not None:
        mode = curve
    else:
        squat = area_mm2 is not None and gauge_mm**2 < area_mm2
        mode = "compression" if squat else "tension"
    pushed = mode == "compression"
    if pushed and len(names) == 2:
        notes.append("travel and force are negative; it is compared as compressed")
    elif pushed and said is not None:
        notes.append("compared as compressed, as specimens.csv says")
    elif pushed:
        why = "the curve bends as in compression" if curve else "it is wider than long"
        notes.append(
            f"{which} alone is negative and {why}; it is compared as compressed: if it was pulled, "
            "write tension in a column 'mode'"
        )
    else:
        notes += [f"{name} is negative in tension; its sign was turned" for name in names]
        if said is None and curve == "compression":
            notes.append(
                "compared as pulled, but the curve bends as in compression; if it was pushed, "
                "write compression in a column 'mode'"
            )
    turn = [name for name, negative in down.items() if negative is not pushed]
    return (
        -force_N if "force" in turn else force_N,
        -travel_mm if "travel" in turn else travel_mm,
    )


def _is_negative(values: FloatArray) -> bool:
    return float(-values.min()) > _TURNED_RATIO * abs(float(values.max()))


_PLACES = 40
"""Strains at which a curve is looked at. Numerical: laws are straight over a fortieth of them."""

_FARTHEST = 0.6
"""Strain up to which a curve is looked at. Chosen: a law in compression ends soon after."""


def _kind(
    force_N: FloatArray,
    travel_mm: FloatArray,
    gauge_mm: float,
    stress_MPa: Callable[[FloatArray], FloatArray],
) -> Mode | None:
    """Return the way of loading whose law a first loading is nearer to, at any stiffness.

    None where the two laws differ by less than the nearer one is missed by.
    """
    moved = np.abs(travel_mm - travel_mm[0])
    top = int(np.argmax(moved >= 0.95 * moved.max()))
    strain, load = moved[: top + 1] / gauge_mm, np.abs(force_N[: top + 1])
    end = min(float(strain.max()), _FARTHEST)
    at = np.linspace(0.0, end, _PLACES + 1)[1:]
    if not end > 0.0 or not load.max() > 0.0:
        return None
    rising, first = np.unique(np.maximum.accumulate(strain), return_index=True)
    measured = _of_size_one(np.interp(at, rising, load[first]))
    pulled, pushed = _of_size_one(stress_MPa(1.0 + at)), _of_size_one(-stress_MPa(1.0 - at))
    missed: dict[Mode, float] = {
        "tension": _distance(measured, pulled),
        "compression": _distance(measured, pushed),
    }
    nearer = min(missed, key=lambda mode: missed[mode])
    return nearer if missed[nearer] < _distance(pulled, pushed) - missed[nearer] else None


def _of_size_one(values: FloatArray) -> FloatArray:
    return np.asarray(values / max(float(np.linalg.norm(values)), 1e-300))


def _distance(one: FloatArray, other: FloatArray) -> float:
    return float(np.linalg.norm(one - other))
