"""The search for some specimens whose force is off by one factor."""

import numpy as np

from planner.arrays import FloatArray
from planner.geometry.kernel import kernel

__all__ = ["best_subset"]

_ROUNDS = 30
_SETTLED = 1e-4


@kernel
def best_subset(
    b: FloatArray, h: FloatArray, gammas: FloatArray, shares: FloatArray,
    belief: FloatArray, best_belief: FloatArray, evidence: FloatArray,
) -> int:  # fmt: skip
    """Fill the log evidence of each logarithm of gain; return the best one, its beliefs filled.

    With members z, each of them one with probability `share`, the log likelihood over that of none
    is g z'b - g^2 z'Hz / 2. Its sum over all z is bounded from below by independent beliefs q in
    each specimen (mean field), improved one by one:

        sum q g b - g^2/2 (q'Hq + sum q (1 - q) H_ii) + entropy of q + q ln s + (1 - q) ln(1 - s)

    Parameters
    ----------
    b : (n,), h : (n, n)
        Inner products of the specimens' own gains with the residual and one another.
    shares : (m,)
        Shares of members, equally probable.
    belief, best_belief : (n,)
        Workspace, and the beliefs at the best gain.
    evidence : (gammas,)
    """
    n, m = len(b), len(shares)
    bounds = np.empty(m)
    best, best_value = 0, -np.inf
    pull = np.empty(n)
    for k in range(len(gammas)):
        gamma = gammas[k]
        square = gamma * gamma
        for s in range(m):
            odds = np.log(shares[s] / (1.0 - shares[s]))
            for i in range(n):
                belief[i] = 1.0 if gamma * b[i] > 0.5 * square * h[i, i] else 0.0
            for i in range(n):
                total = 0.0
                for j in range(n):
                    total += h[i, j] * belief[j]
                pull[i] = total
            for _ in range(_ROUNDS):
                moved = 0.0
                for i in range(n):
                    others = pull[i] - h[i, i] * belief[i]
                    logit = gamma * b[i] - square * (others + 0.5 * h[i, i]) + odds
                    new = 1.0 / (1.0 + np.exp(-min(max(logit, -700.0), 700.0)))
                    change = new - belief[i]
                    if change != 0.0:
                        belief[i] = new
                        for j in range(n):
                            pull[j] += change * h[i, j]
                        moved = max(moved, abs(change))
                if moved < _SETTLED:
                    break
            value = 0.0
            for i in range(n):
                q = belief[i]
                value += q * gamma * b[i]
                value -= 0.5 * square * (q * pull[i] + q * (1.0 - q) * h[i, i])
                if q > 0.0:
                    value += q * (np.log(shares[s]) - np.log(q))
                if q < 1.0:
                    value += (1.0 - q) * (np.log(1.0 - shares[s]) - np.log(1.0 - q))
            bounds[s] = value
            if value > best_value and np.sum(belief > 0.5) > 0:
                best, best_value = k, value
                best_belief[:] = belief
        most = np.max(bounds)
        evidence[k] = most + np.log(np.sum(np.exp(bounds - most)) / m)
    return best
