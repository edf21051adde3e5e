"""The diagnosis with one of its parts taken out, to see what the part is worth.

Only what weighs hypotheses is run: a verdict, a ranking and a class, without where and how far.
"""

from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from planner.gap.campaign import Campaign
from planner.gap.campaign_folder import read_campaign
from planner.gap.diagnose import LEAST_PROBABILITY, RANKED, prepared
from planner.gap.evidence.problem import Problem
from planner.gap.evidence.weigh import Priors, class_of, evidence_of, ranking_of, weigh
from planner.gap.noise import NoisyFeatures, discrepancy_columns
from planner.numerics import FloatArray

__all__ = ["FULL", "VARIANTS", "ablated_answers", "problem_of", "weighed_answer"]

FULL = "full"
"""The name of the diagnosis as it is."""

_NONE = 1e-12
"""A prior, or a deviation of the logarithm of force, that is nought for all purposes."""

_Part = tuple[Problem, Priors]


def altered(problem: Problem, **changes: Any) -> Problem:
    """Return a copy with some attributes changed."""
    other = copy(problem)
    vars(other).update(changes)
    return other


def _as_it_is(problem: Problem, priors: Priors) -> _Part:
    return problem, priors


def _without_specimens(problem: Problem, priors: Priors) -> _Part:
    """Every figure differs by the sensor alone: no specimen, batch, slope, wandering or toe."""
    none = dict.fromkeys(("specimen", "batch", "slope", "wander", "toe"), _NONE)
    scatter = replace(problem.scatter, **none, field_shared=0.0)
    unknown = np.full(len(problem.campaign.specimens), -1)
    sensor_sd_N = problem.model.sensor_sd_N
    features = NoisyFeatures(problem.table, problem.sensitivity, sensor_sd_N, unknown)
    noise = features.noise(scatter)
    names = ("target", "nodes", "gains", "patterns", "nuisances", "discrepancy")
    parts = {n: noise.whiten(_unwhitened(problem, getattr(problem, n))) for n in names}
    kept = problem.nuisances.shape[1] - problem.noise.batch.shape[1]
    parts["nuisances"] = parts["nuisances"][:, :kept]
    of_laws = problem.of_laws[:kept]
    return altered(problem, scatter=scatter, noise=noise, of_laws=of_laws, **parts), priors


def _without_calibration(problem: Problem, priors: Priors) -> _Part:
    """Take the palette's laws for exact: neither level nor course of a grade is uncertain."""
    courses = discrepancy_columns(problem.campaign, problem.table, problem.sensitivity).shape[1]
    gone = len(problem.calibrations) + courses
    less = altered(
        problem,
        calibrations=(),
        calibration=problem.calibration[:, gone:],
        nuisances=problem.nuisances[:, gone:],
        of_laws=problem.of_laws[gone:],
    )
    return less, priors


def _without_unknown(problem: Problem, priors: Priors) -> _Part:
    """Nothing but the library's effects, their pairs and none."""
    return problem, replace(priors, unknown=_NONE, beside=_NONE)


def _flat(problem: Problem, priors: Priors) -> _Part:
    """None, unknown, every effect and every pair alike, half of them with an unknown beside."""
    n = len({signed.effect.id for signed in problem.signed_forms})
    pairs = n * (n - 1) / 2
    total = 2.0 + n + pairs
    shares = {"none": 1.0, "unknown": 1.0, "single": float(n), "pair": max(pairs, _NONE)}
    flat = {name: share / total for name, share in shares.items()}
    return problem, replace(priors, beside=0.5, **flat)


VARIANTS: Mapping[str, Callable[[Problem, Priors], _Part]] = MappingProxyType(
    {
        FULL: _as_it_is,
        "without specimen effects": _without_specimens,
        "without unknown": _without_unknown,
        "fixed base parameters": _without_calibration,
        "flat priors": _flat,
    }
)


def ablated_answers(folder: Path, without: tuple[str, ...] = ()) -> dict[str, Any]:
    """Return, by variant, the scored part of a diagnosis' document of a campaign."""
    with threadpool_limits(1, user_api="blas"):
        problem, reasons = problem_of(read_campaign(folder), without)
        return {
            name: weighed_answer(*variant(problem, Priors()), reasons)
            for name, variant in VARIANTS.items()
        }


def problem_of(
    campaign: Campaign, without: tuple[str, ...] = ()
) -> tuple[Problem, tuple[str, ...]]:
    """Return a campaign ready for weighing, and the effects that it cannot test."""
    problem, reasons, _ = prepared(campaign, without)
    return problem, tuple(reason.id for reason in reasons)


def weighed_answer(problem: Problem, priors: Priors, reasons: tuple[str, ...]) -> dict[str, Any]:
    """Weigh all hypotheses and return the scored part of a document, cut as a diagnosis is."""
    weighed = weigh(problem, priors)
    evidence = evidence_of(problem, weighed)
    ranking = ranking_of(evidence, priors)
    verdict = ranking[0].effects
    alike = class_of(problem, weighed, evidence, ranking, verdict)
    return {
        "verdict": "+".join(verdict) or "none",
        "ranking": [
            {
                "effects": list(h.effects),
                "probability": min(h.probability, 1.0),
                "with_unknown": min(h.with_unknown, 1.0),
            }
            for h in ranking[:RANKED]
            if h.probability >= LEAST_PROBABILITY
        ],
        "class": [list(effects) for effects in alike],
        "not_testable": list(reasons),
        "where": [],
        "gap": {},
    }


def _unwhitened(problem: Problem, whitened: FloatArray) -> FloatArray:
    """Return columns as they were before whitening, (N, X)."""
    columns = np.empty_like(whitened)
    for rows, block in zip(problem.noise.rows, problem.noise.blocks, strict=True):
        columns[rows] = np.linalg.cholesky(block) @ whitened[rows]
    return columns
