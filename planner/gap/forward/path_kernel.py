"""One test from rest to its last step: equilibrium of its slices, with all that they remember.

Every step solves for the strains of all slices and the one force that runs through them, by
Newton's method with the strains eliminated slice by slice. Within a step the stress of the law
changes evenly, so that relaxing terms follow exactly. Where Newton's method does not settle, the
force is bracketed and each slice's strain with it: slow, but certain to end with finite numbers.
"""

import math

from planner.arrays import FloatArray, IntArray
from planner.gap.forward.slice_stress import slice_stress
from planner.geometry.kernel import free_kernel, inner_kernel

__all__ = ["WORK_ROWS", "follow_path"]

WORK_ROWS = 10
"""Rows of the work array, each one value a slice."""

_STRAIN, _FORMER, _LARGEST, _LEFT, _STRESS, _STRESS_BEFORE, _SHARE, _REST, _ALONE, _STIFF = range(
    10
)
_LOW, _HIGH = -0.6, 4.0
_ITERATIONS = 40
_PATIENCE = 8
_BISECTIONS = 100
_TOLERANCE = 1e-10
_LONGEST = 0.25


@inner_kernel
def lost_travel(
    force: float, largest_N: float, slip: float, slip_from: float, slip_power: float,
    compliance: float, power: float,
) -> tuple[float, float]:  # fmt: skip
    """Return what slip and the machine take of the travel at a force, and its derivative."""
    lost, slope = 0.0, 0.0
    if compliance != 0.0:
        size = abs(force)
        if power == 1.0:
            lost, slope = compliance * size, compliance
        elif abs(power) < 1e-9:
            lost, slope = compliance * math.log1p(size), compliance / (1.0 + size)
        else:
            lost = compliance * math.expm1(power * math.log1p(size)) / power
            slope = compliance * (1.0 + size) ** (power - 1.0)
        if force < 0.0:
            lost = -lost
    if slip != 0.0:
        over = max(force, largest_N) - slip_from
        if over > 0.0:
            lost += slip * over**slip_power
            if force > largest_N:
                slope += slip * slip_power * max(over, 1e-9) ** (slip_power - 1.0)
    return lost, slope


@inner_kernel
def strain_at(
    force: float, area: float, share: float, rest: float, largest: float, left: float,
    softening: float, table: FloatArray, lower: int, upper: int, fraction: float,
    log_factor: float, log_tilt: float, cubics: FloatArray, step: float,
) -> float:  # fmt: skip
    """Return the strain at which a slice bears a force, by Newton's method within a bracket."""
    low, high = _LOW, _HIGH
    strain = 0.0
    for _ in range(_BISECTIONS):
        stress, tangent = slice_stress(
            strain, largest, left, softening, table, lower, upper, fraction, log_factor,
            log_tilt, cubics, step,
        )  # fmt: skip
        excess = area * (share * stress + rest) - force
        if excess > 0.0:
            high = strain
        else:
            low = strain
        if excess == 0.0 or high - low < 1e-15:
            break
        slope = area * share * tangent
        wanted = strain - excess / slope
        if not low < wanted < high:
            wanted = 0.5 * (low + high)
        if abs(wanted - strain) < 1e-14:
            break
        strain = wanted
    return strain


@inner_kernel
def bracketed_force(
    target: float, first: int, stop: int, largest_N: float, slip: float, slip_from: float,
    slip_power: float, compliance: float, power: float, lower: IntArray, upper: IntArray,
    slices: FloatArray, table: FloatArray, cubics: FloatArray, step: float, work: FloatArray,
) -> float:  # fmt: skip
    """Return the force at which strains and losses add up to the travel; leave the strains."""
    low, high, stride = -math.inf, math.inf, 1.0
    force = 0.0
    for _ in range(_BISECTIONS):
        length = 0.0
        for i in range(first, stop):
            work[_STRAIN, i] = strain_at(
                force, slices[1, i], work[_SHARE, i], work[_REST, i], work[_LARGEST, i],
                work[_LEFT, i], slices[5, i], table, lower[i], upper[i], slices[2, i],
                slices[3, i], slices[4, i], cubics, step,
            )  # fmt: skip
            length += slices[0, i] * work[_STRAIN, i]
        lost, _ = lost_travel(force, largest_N, slip, slip_from, slip_power, compliance, power)
        if target - lost - length > 0.0:
            low = force
        else:
            high = force
        if low > -math.inf and high < math.inf:
            if high - low <= 1e-13 * (abs(low) + abs(high)):
                break
            force = 0.5 * (low + high)
        else:  # one end is not known yet: go on in ever longer strides
            force += stride if high == math.inf else -stride
            stride *= 4.0
    for i in range(first, stop):
        work[_STRESS, i], _ = slice_stress(
            work[_STRAIN, i], work[_LARGEST, i], work[_LEFT, i], slices[5, i], table, lower[i],
            upper[i], slices[2, i], slices[3, i], slices[4, i], cubics, step,
        )  # fmt: skip
    return force


@inner_kernel
def set_strain(table: FloatArray, largest: float) -> float:
    """Return the set's table at a largest strain."""
    columns = len(table) - 1
    place = min(max(largest, 0.0), 1.0) * columns
    j = min(int(place), columns - 1)
    value: float = table[j] + (place - j) * (table[j + 1] - table[j])
    return value


@free_kernel
def follow_path(
    first_slice: IntArray, time_s: FloatArray, travel_mm: FloatArray, boundary: FloatArray,
    lower: IntArray, upper: IntArray, slices: FloatArray, relaxing: FloatArray,
    times: FloatArray, softening_table: FloatArray, set_table: FloatArray, cubics: FloatArray,
    step: float, work: FloatArray, memory: FloatArray, decay: FloatArray, force_N: FloatArray,
    strain: FloatArray,
) -> None:  # fmt: skip
    """Fill in force and strains of every step of every test.

    Parameters
    ----------
    travel_mm : (P, T)
        What reaches specimen, grips and machine.
    boundary : (5, P)
        Of slip its size, threshold and power, of the compliance its size and power.
    slices : (7, S)
        Length, area, fraction towards the harder material, log factor, log tilt, softening,
        share of the set.
    memory : (S, K)
        Work space of the relaxing terms, and `work`, (`WORK_ROWS`, S), of the slices.
    decay : (2, K)
        Work space: what a step leaves of a term, and adds to it a unit of stress.
    """
    tests, steps = travel_mm.shape
    terms = len(times)
    for p in range(tests):
        first, stop = first_slice[p], first_slice[p + 1]
        slip, slip_from, slip_power = boundary[0, p], boundary[1, p], boundary[2, p]
        compliance, power = boundary[3, p], boundary[4, p]
        relaxes = False
        total_length, scale = 0.0, math.inf
        for i in range(first, stop):
            for row in range(WORK_ROWS):
                work[row, i] = 0.0
            work[_SHARE, i] = 1.0
            for k in range(terms):
                memory[i, k] = 0.0
                relaxes = relaxes or relaxing[i, k] != 0.0
            total_length += slices[0, i]
            _, tangent = slice_stress(
                0.0, 0.0, 0.0, 0.0, softening_table, lower[i], upper[i], slices[2, i],
                slices[3, i], slices[4, i], cubics, step,
            )  # fmt: skip
            scale = min(scale, slices[1, i] * tangent)
        force, largest_N, settled, before = 0.0, 0.0, 0.0, 0.0
        for t in range(steps):
            target = travel_mm[p, t]
            if relaxes:
                duration = time_s[p, t] - time_s[p, max(t - 1, 0)]
                for k in range(terms):
                    spent = duration / times[k]
                    gone = -math.expm1(-spent)
                    decay[0, k] = 1.0 - gone
                    decay[1, k] = gone / spent if spent > 1e-12 else 1.0
                for i in range(first, stop):
                    share, rest = 1.0, 0.0
                    for k in range(terms):
                        # Of what is new, a step leaves decay[1] of each relaxing share.
                        share -= relaxing[i, k] * (1.0 - decay[1, k])
                        rest += memory[i, k] * decay[0, k]
                        rest -= relaxing[i, k] * decay[1, k] * work[_STRESS_BEFORE, i]
                    work[_SHARE, i] = share
                    work[_REST, i] = rest
            # Go on as before where the crosshead does: a better start than standing still.
            ahead = 0.0
            if settled != before:
                ahead = (target - settled) / (settled - before)
            if not 0.0 < ahead < 4.0:
                ahead = 0.0
            for i in range(first, stop):
                now = work[_STRAIN, i]
                work[_STRAIN, i] = now + ahead * (now - work[_FORMER, i])
                work[_FORMER, i] = now
            solved = False
            for iteration in range(_ITERATIONS):
                worst, length, soft, elongation = 0.0, 0.0, 0.0, 0.0
                for i in range(first, stop):
                    e = work[_STRAIN, i]
                    stress, tangent = slice_stress(
                        e, work[_LARGEST, i], work[_LEFT, i], slices[5, i], softening_table,
                        lower[i], upper[i], slices[2, i], slices[3, i], slices[4, i], cubics,
                        step,
                    )  # fmt: skip
                    work[_STRESS, i] = stress
                    stiff = slices[1, i] * work[_SHARE, i] * tangent
                    excess = slices[1, i] * (work[_SHARE, i] * stress + work[_REST, i]) - force
                    worst = max(worst, abs(excess))
                    work[_STIFF, i] = stiff
                    alone = e - excess / stiff
                    work[_ALONE, i] = alone
                    elongation += slices[0, i] * e
                    length += slices[0, i] * alone
                    soft += slices[0, i] / stiff
                lost, slope = lost_travel(
                    force, largest_N, slip, slip_from, slip_power, compliance, power
                )
                gap = abs(target - lost - elongation)
                if worst <= _TOLERANCE * (abs(force) + 1e-4 * scale) and (
                    gap <= _TOLERANCE * total_length
                ):
                    solved = True
                    break
                change = (target - lost - length) / (soft + slope)
                # Kinks can send Newton's method to and fro; half a step ends that.
                part = 1.0 if iteration < _PATIENCE else 0.5
                force += part * change
                for i in range(first, stop):
                    move = work[_ALONE, i] + change / work[_STIFF, i] - work[_STRAIN, i]
                    e = work[_STRAIN, i] + part * min(max(move, -_LONGEST), _LONGEST)
                    work[_STRAIN, i] = min(max(e, _LOW), _HIGH)
            if not solved:
                force = bracketed_force(
                    target, first, stop, largest_N, slip, slip_from, slip_power, compliance,
                    power, lower, upper, slices, softening_table, cubics, step, work,
                )  # fmt: skip
            for i in range(first, stop):
                e, stress, old = work[_STRAIN, i], work[_STRESS, i], work[_STRESS_BEFORE, i]
                if relaxes:
                    for k in range(terms):
                        memory[i, k] = (
                            memory[i, k] * decay[0, k]
                            + relaxing[i, k] * (stress - old) * decay[1, k]
                        )
                work[_STRESS_BEFORE, i] = stress
                if e > work[_LARGEST, i]:
                    work[_LARGEST, i] = e
                    if slices[6, i] != 0.0:
                        work[_LEFT, i] = min(slices[6, i] * set_strain(set_table, e), 0.95 * e)
                strain[t, i] = e
            force_N[p, t] = force
            largest_N = max(largest_N, force)
            before, settled = settled, target
