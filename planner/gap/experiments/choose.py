"""Choose the tests that tell most per hour."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
import scipy.linalg
from scipy.special import logsumexp

from planner.arrays import FloatArray
from planner.gap.diagnosis import Experiment, Hypothesis
from planner.gap.evidence.applied import applied
from planner.gap.evidence.candidate import Candidate
from planner.gap.evidence.posterior import UNKNOWN
from planner.gap.evidence.problem import Problem
from planner.gap.evidence.weigh import Weighed
from planner.gap.evidence.weights import figures_of
from planner.gap.experiments.candidates import Trial, trial_campaign, trials_of
from planner.gap.forward import predict
from planner.gap.forward.mount import mount
from planner.gap.noise import calibration_columns, specimen_noise
from planner.gap.noise.blocks import place_on_path
from planner.gap.noise.calibration import Calibration, calibrations, step

__all__ = ["next_experiments"]

HYPOTHESES = 6
DRAWS = 64
TOLD_APART = 2.0
"""Standard deviations between what two hypotheses predict, at which a test splits them."""

LEAST_SHARE = 0.02
"""No hypothesis among those weighed is taken to be less probable than this: a test that would
overturn the verdict is worth something."""


def next_experiments(
    problem: Problem, weighed: Weighed, ranking: Sequence[Hypothesis], rng: np.random.Generator
) -> tuple[Experiment, ...]:
    """Return the three tests with the largest expected information per hour.

    The information is that between the hypothesis and the measured figures, by sampling, among the
    most probable hypotheses at their best parameters.
    """
    known = [h for h in ranking if h.effects != UNKNOWN and h.effects in weighed.best]
    known = known[:HYPOTHESES]
    if len(known) < 2:
        return ()
    share = np.maximum([h.probability for h in known], LEAST_SHARE)
    share /= share.sum()
    candidates = [weighed.best[h.effects] for h in known]
    trials = trials_of(problem.campaign, problem.mounted.setup)
    means, covariances = _predicted(problem, candidates, trials)
    found = []
    widest = max(mean.shape[1] for mean in means)
    noise = rng.standard_normal((len(known) * DRAWS, widest))
    for trial, mean, covariance in zip(trials, means, covariances, strict=True):
        gain, distance = _information(mean, covariance, share, noise)
        splits = sorted(
            combinations(range(len(known)), 2),
            key=lambda p: -float(distance[p] * share[list(p)].min()),
        )
        named = tuple(
            (_name(known[a]), _name(known[b])) for a, b in splits[:3] if distance[a, b] > TOLD_APART
        )
        found.append(Experiment(dict(trial.change), named, gain, trial.hours, _detail(trial)))
    found.sort(key=lambda e: -e.expected_gain_nats / e.hours)
    return tuple(found[:3])


def _predicted(
    problem: Problem, candidates: Sequence[Candidate], trials: Sequence[Trial]
) -> tuple[list[FloatArray], list[FloatArray]]:
    """Return, of each trial, the hypotheses' figures (K, d) and their covariance (d, d)."""
    mounted = mount(trial_campaign(problem.campaign, tuple(trials)))
    table, laws = mounted.table, mounted.laws
    ways = calibrations(problem.campaign.palette, mounted.setup)
    setups = [mounted.setup, *(way.applied(mounted.setup, step(way)) for way in ways)]
    # One by one: a subset's gain holds for new specimens with the share it has of old ones.
    setups += [applied(c, mounted.setup) for c in candidates]
    raw = np.stack([mounted.predicted(predict(s, laws)) for s in setups])
    for k, candidate in enumerate(candidates):
        if candidate.members is not None and candidate.log_gain:
            raw[1 + len(ways) + k] *= np.exp(candidate.log_gain * candidate.members.mean())
    figures = table.transformed(raw)
    shared = calibration_columns(ways, figures[1 : 1 + len(ways)], figures[0])
    known, sizes = _known_laws(problem, candidates, ways)
    learned = figures[1 + len(ways) :] + sizes @ shared.T
    sensor = np.full(len(trials), float(np.median(problem.mounted.sensor_sd_N)))
    path = place_on_path(table, mounted.setup.time_s.shape[1] - 1)
    noise = specimen_noise(
        table, table.sensitivity(raw[0]), problem.scatter, sensor, np.full(len(trials), -1), path
    )
    by_specimen = dict(zip(np.unique(table.specimen).tolist(), range(len(noise.rows)), strict=True))
    means, covariances = [], []
    for place in range(len(trials)):
        rows = noise.rows[by_specimen[place]]
        means.append(learned[:, rows])
        own = noise.blocks[by_specimen[place]]
        covariances.append(own + shared[rows] @ known @ shared[rows].T)
    return means, covariances


def _known_laws(
    problem: Problem, candidates: Sequence[Candidate], ways: Sequence[Calibration]
) -> tuple[FloatArray, FloatArray]:
    """Return what the campaign has taught about the trials' ways of being off.

    Materials that it tested are known much better than the palette says, and each hypothesis has
    its own idea of them: covariance (q, q), and sizes under each hypothesis (K, q), in deviations.
    """
    white = problem.whitened
    kept = white.columns.shape[1] - white.nuisances
    j = white.columns[:, kept:]
    inverse = np.linalg.inv(j.T @ j + np.eye(j.shape[1]))
    by_name = {(way.material, way.kind): k for k, way in enumerate(problem.ways) if way.material}
    pairs = [(k, by_name.get((way.material, way.kind))) for k, way in enumerate(ways)]
    at = [k for k, of in pairs if of is not None]
    taken = [of for _, of in pairs if of is not None]
    known = np.eye(len(ways))
    known[np.ix_(at, at)] = inverse[np.ix_(taken, taken)]
    sizes = np.zeros((len(candidates), len(ways)))
    nodes = white.columns[:, problem.nodes]
    for row, candidate in zip(sizes, candidates, strict=True):
        left = white.columns[:, 0] - figures_of(candidate, nodes.T)
        if candidate.members is not None:
            left -= white.columns[:, problem.gains] @ (candidate.log_gain * candidate.members)
        row[at] = (inverse @ (j.T @ left))[taken]
    return known, sizes


def _information(
    mean: FloatArray, covariance: FloatArray, share: FloatArray, noise: FloatArray
) -> tuple[float, FloatArray]:
    """Return the mutual information in nats, and distances between hypotheses in deviations."""
    factor = np.linalg.cholesky(covariance)
    white = scipy.linalg.solve_triangular(factor, mean.T, lower=True).T
    distance = np.sqrt(np.sum((white[:, None] - white[None]) ** 2, axis=2))
    count, d = white.shape
    drawn = np.repeat(white, DRAWS, axis=0) + noise[:, :d]
    log = -0.5 * np.sum((drawn[:, None] - white[None]) ** 2, axis=2) + np.log(share)
    own = log[np.arange(count * DRAWS), np.repeat(np.arange(count), DRAWS)]
    gain = own - logsumexp(log, axis=1) - np.repeat(np.log(share), DRAWS)
    # Of a sample it may come out below nought, which information is not.
    return max(float(np.repeat(share, DRAWS) @ gain / DRAWS), 0.0), distance


def _name(hypothesis: Hypothesis) -> str:
    return "+".join(hypothesis.effects) or "none"


def _detail(trial: Trial) -> str:
    what = ", ".join(f"{name} {value}" for name, value in trial.change.items())
    return f"one specimen of the usual kind with {what}; about {trial.hours:.1f} h"
