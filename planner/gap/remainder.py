"""Where the gap lies, what remains of it after the effect, and what the laws ask for beside it."""

from collections.abc import Mapping

import numpy as np

from planner.arrays import FloatArray
from planner.gap.diagnosis import Place
from planner.gap.evidence.candidate import Candidate
from planner.gap.evidence.problem import Problem
from planner.gap.evidence.weights import figures_of
from planner.gap.where import Noise, localise

__all__ = ["places_of", "recalibration_of"]

SIGNIFICANT = 0.01
"""Family-wise: a remainder is named only where it is hardly chance."""


def places_of(
    problem: Problem, chosen: Candidate, rng: np.random.Generator
) -> tuple[tuple[Place, ...], tuple[Place, ...]]:
    """Return where the gap lies, and where a significant one is left after the chosen effects."""
    noise = Noise(
        problem.noise.blocks,
        np.concatenate([problem.calibration_figures.T, problem.noise.batch], axis=1),
        problem.scatter.log_sd,
    )
    before = localise(problem.campaign, problem.table, problem.residual, noise, rng)
    if not chosen.effects:
        return before, tuple(p for p in before if p.p < SIGNIFICANT)
    left = problem.residual - explained(problem, chosen)
    after = localise(problem.campaign, problem.table, left, noise, rng)
    return before, tuple(p for p in after if p.p < SIGNIFICANT)


def explained(problem: Problem, chosen: Candidate) -> FloatArray:
    """Return what the chosen effects change of the figures, (N,)."""
    change = figures_of(chosen, problem.node_figures)
    if chosen.members is not None:
        force = np.where(problem.table.is_field, 0.0, problem.sensitivity)
        change = change + chosen.log_gain * chosen.members[problem.table.specimen] * force
    return change


def recalibration_of(problem: Problem, chosen: Candidate) -> Mapping[str, tuple[float, float]]:
    """Return each material's posterior level, ln of a factor on its stress, and its deviation."""
    columns = problem.whitened.columns
    first = columns.shape[1] - problem.whitened.nuisances
    j = columns[:, first:]
    left = columns[:, 0].copy()
    for branch, place in zip(chosen.branches, chosen.places, strict=True):
        one = Candidate((branch.effect.id,), (branch,), (place,))
        left -= _whitened_figures(problem, one)
    if chosen.members is not None:
        left -= columns[:, problem.gains] @ (chosen.log_gain * chosen.members)
    inner = np.linalg.inv(j.T @ j + np.eye(j.shape[1]))
    best = inner @ (j.T @ left)
    return {
        way.material: (float(best[k] * way.sd), float(np.sqrt(inner[k, k]) * way.sd))
        for k, way in enumerate(problem.ways)
        if way.kind == "level"
    }


def _whitened_figures(problem: Problem, candidate: Candidate) -> FloatArray:
    start = problem.nodes.start
    stop = start + len(problem.node_figures)
    return figures_of(candidate, problem.whitened.columns[:, start:stop].T)
