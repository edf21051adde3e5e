"""Force equilibrium of a bar in series, step by step under displacement control.

At every step one force F runs through all slices, area P(strain) = F, and their elongations add
up to the displacement of the ends. Newton's method on all strains and the force together costs
one evaluation of the law an iteration: the strains are eliminated slice by slice, and the force
alone remains.
"""

from dataclasses import dataclass

import numpy as np

from planner.arrays import FloatArray
from planner.simulation.bar import Bar
from planner.simulation.response import Response

__all__ = ["Equilibrium", "solve"]

_TOLERANCE = 1e-11
_ITERATIONS = 16
_FINEST = 2.0**-14  # of a step: halved so often, a step is given up


@dataclass(frozen=True, slots=True, eq=False)
class Equilibrium:
    """The states that were reached.

    Attributes
    ----------
    force_N : (steps,)
    strain, stress_MPa, tangent_MPa : (steps, n)
        Of each slice; steps may be fewer than were asked for.
    end_mm : float
        Displacement of the last state, or where on the way to the next step the path ended.
    stopped_at : int or None
        The slice whose law ends there, if one does.
    """

    force_N: FloatArray
    strain: FloatArray
    stress_MPa: FloatArray
    tangent_MPa: FloatArray
    end_mm: float
    stopped_at: int | None


@dataclass(slots=True)
class _State:
    displacement_mm: float
    force_N: float
    strain: FloatArray
    stress_MPa: FloatArray
    tangent_MPa: FloatArray


def solve(bar: Bar, response: Response, displacement_mm: FloatArray) -> Equilibrium:
    """Pull a bar through displacements of its ends, none below 0.

    A step on which Newton's method fails is halved until it succeeds. It cannot where a slice
    would leave `Response.strain_limit`: then the states up to the step before are returned.
    """
    strain = np.zeros_like(bar.area_mm2)
    state = _State(0.0, 0.0, strain, *response.stress_and_tangent_MPa(strain))
    states: list[_State] = []
    stopped_at = None
    for target in displacement_mm.tolist():
        reached = _advance(bar, response, state, target)
        state = reached[0]
        if not reached[1]:
            stopped_at = int(np.argmax(state.strain / response.strain_limit))
            break
        states.append(state)
    empty = np.empty((0, len(strain)))
    return Equilibrium(
        np.array([s.force_N for s in states]),
        np.array([s.strain for s in states]) if states else empty,
        np.array([s.stress_MPa for s in states]) if states else empty,
        np.array([s.tangent_MPa for s in states]) if states else empty,
        state.displacement_mm,
        stopped_at,
    )


def _advance(bar: Bar, response: Response, state: _State, target: float) -> tuple[_State, bool]:
    """Go to a displacement in as few parts as it takes; also say whether it was reached."""
    begin, part, done = state.displacement_mm, 1.0, 0.0
    while done < 1.0:
        share = min(done + part, 1.0)
        trial = _newton(bar, response, state, begin + share * (target - begin))
        if trial is not None:
            state, done, part = trial, share, 2.0 * part
        elif part > _FINEST:
            part *= 0.5
        else:
            return state, False
    return state, True


def _newton(bar: Bar, response: Response, state: _State, target: float) -> _State | None:
    """Solve one step from a state near by; None where the iteration does not settle."""
    length, area = bar.length_mm, bar.area_mm2
    if target == 0.0:
        strain = np.zeros_like(area)
        return _State(0.0, 0.0, strain, *response.stress_and_tangent_MPa(strain))
    force, strain, stress, tangent = (
        state.force_N,
        state.strain,
        state.stress_MPa,
        state.tangent_MPa,
    )
    for _ in range(_ITERATIONS):
        stiffness = area * tangent
        alone = strain + (force - area * stress) / stiffness
        change = (target - float(length @ alone)) / float(np.sum(length / stiffness))
        force += change
        wanted = alone + change / stiffness
        strain = np.clip(wanted, 0.0, response.strain_limit)
        stress, tangent = response.stress_and_tangent_MPa(strain)
        residual = float(np.abs(area * stress - force).max())
        if residual <= _TOLERANCE * abs(force) and (strain == wanted).all():
            return _State(target, force, strain, stress, tangent)
    return None
