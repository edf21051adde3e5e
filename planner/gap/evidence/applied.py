"""A setup with a candidate's effects, and the force that each specimen would then show."""

from planner.arrays import FloatArray
from planner.gap.evidence.candidate import Candidate
from planner.gap.evidence.problem import Problem
from planner.gap.forward import Setup, predict

__all__ = ["applied", "specimen_forces_N"]

_STAGES = ("composition", "law", "geometry", "boundary", "sensor")


def applied(candidate: Candidate, setup: Setup) -> Setup:
    """Return a setup with the candidate's effects, each at its stage.

    What holds for some specimens only is left to `specimen_forces_N`.
    """
    for branch, values in sorted(
        candidate.values(), key=lambda item: _STAGES.index(item[0].effect.stage)
    ):
        setup = branch.form.apply(setup, values)
    return setup


def specimen_forces_N(problem: Problem, candidate: Candidate, setup: Setup) -> FloatArray:
    """Return predicted forces on each specimen's test's steps, (n, T).

    Parameters
    ----------
    setup
        Without the candidate's effects.
    """
    force = predict(applied(candidate, setup), problem.laws).force_N
    mounted = problem.mounted
    rows = [0] * len(problem.campaign.specimens)
    for test, members in enumerate(mounted.tests):
        for place in members:
            rows[place] = test
    forces: FloatArray = force[rows]
    if candidate.members is not None:
        factor = 1.0 + candidate.members * (2.718281828459045**candidate.log_gain - 1.0)
        forces = forces * factor[:, None]
    return forces
