"""The search for some specimens whose force is off by one factor."""

import numpy as np

from planner.arrays import FloatArray
from planner.geometry.kernel import kernel

__all__ = ["best_subset"]

_ROUNDS = 12


@kernel
def best_subset(
    b: FloatArray, h: FloatArray, gammas: FloatArray, log_prior: FloatArray, smallest: int,
    member: FloatArray, best_member: FloatArray, evidence: FloatArray,
) -> int:  # fmt: skip
    """Fill the log evidence of each logarithm of gain, and the best one's members; return it.

    With members z, the log likelihood over that of none is g z'b - g^2 z'Hz / 2. Members are
    flipped one at a time while that helps; what each doubtful member adds is summed as if the
    others were settled.

    Parameters
    ----------
    b : (n,), h : (n, n)
        Inner products of the specimens' own gains with the residual and one another.
    log_prior : (n + 1,)
        Of one subset, by its number of members.
    """
    n = len(b)
    best, best_value = 0, -np.inf
    pull = np.empty(n)
    for k in range(len(gammas)):
        gamma = gammas[k]
        for i in range(n):
            member[i] = 1.0 if gamma * b[i] > 0.5 * gamma * gamma * h[i, i] else 0.0
        count = int(member.sum())
        for i in range(n):
            total = 0.0
            for j in range(n):
                total += h[i, j] * member[j]
            pull[i] = total
        for _ in range(_ROUNDS):
            moved = False
            for i in range(n):
                sign = 1.0 - 2.0 * member[i]
                change = sign * gamma * b[i] - gamma * gamma * (sign * pull[i] + 0.5 * h[i, i])
                to = count + int(sign)
                if to < 0:
                    continue
                change += log_prior[to] - log_prior[count]
                if change > 1e-9:
                    member[i] = 1.0 - member[i]
                    count = to
                    moved = True
                    for j in range(n):
                        pull[j] += sign * h[i, j]
            if not moved:
                break
        value = log_prior[count]
        doubt = 0.0
        for i in range(n):
            value += member[i] * (gamma * b[i] - 0.5 * gamma * gamma * pull[i])
            sign = 1.0 - 2.0 * member[i]
            change = sign * gamma * b[i] - gamma * gamma * (sign * pull[i] + 0.5 * h[i, i])
            doubt += np.log1p(np.exp(min(change + log_prior[max(count + int(sign), 0)]
                                         - log_prior[count], 0.0)))  # fmt: skip
        evidence[k] = value + doubt if count >= smallest else -np.inf
        if count >= smallest and value > best_value:
            best, best_value = k, value
            best_member[:] = member
    return best
