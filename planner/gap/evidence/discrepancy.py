"""No form is exact: by how much a real effect may depart from one that is named rightly.

Whatever a form changes, it may change some more on one branch of the path, at one level of a
covariate, in one material. Without this, the least misfit of a strong effect's form would be taken
for a second effect.

What belongs to the test (geometry, boundary, sensor) departs along the path alone: grips do not
know how warm it is. A form that could depart at every level of every covariate would explain
anything, if only it is large enough.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from planner.arrays import FloatArray, IntArray
from planner.gap.campaign import Campaign
from planner.gap.conditions import TOLERANCES, levels
from planner.gap.effects.effect import Stage
from planner.gap.evidence.candidate import Candidate
from planner.gap.evidence.weights import node_weights
from planner.gap.features.table import BRANCHES, FeatureTable
from planner.gap.noise import SpecimenNoise

__all__ = ["Departures", "Factors", "departures", "discrepancy_factors"]

SD = 0.15
"""Of an effect's size from branch to branch and from level to level."""

MATERIAL_SD = 0.40
"""Of its size from material to material: how effects go with the mixture is hardly known."""

COURSE_SD = 0.45
"""Of its change from the beginning of a path to its end."""

TEST_SD = 0.06
"""Of its size from test to test and branch to branch, whatever they are."""

_LEVELS = ("rate_mm_s", "temperature_C", "soak_h", "age_days", "thickness_mm", "width_mm")


@dataclass(frozen=True, slots=True, eq=False)
class Factors:
    """What multiplies an effect's change of the figures, of prior deviation 1.

    Attributes
    ----------
    path : (N, k)
        Along each test's path.
    conditions : (N, m)
        From condition to condition, material to material.
    """

    path: FloatArray
    conditions: FloatArray

    def of(self, stage: Stage) -> FloatArray:
        """Return those of an effect of a stage."""
        if stage in ("composition", "law"):
            return np.concatenate([self.path, self.conditions], axis=1)
        return self.path


def discrepancy_factors(campaign: Campaign, table: FeatureTable) -> Factors:
    """Return what any effect's form may depart by in a campaign."""
    specimens = campaign.specimens
    path: list[FloatArray] = [SD * (table.branch == k) for k in range(len(BRANCHES))]
    peak = np.zeros(len(specimens))
    np.maximum.at(peak, table.specimen, table.strain)
    travel = 2.0 * table.strain / np.maximum(peak[table.specimen], 1e-12) - 1.0
    path += [COURSE_SD * travel * (table.branch == k) for k in range(len(BRANCHES))]
    path.append(COURSE_SD * (2.0 * travel**2 - 1.0))
    hold = table.branch == BRANCHES.index("hold")
    if hold.any():
        decades = np.log10(np.maximum(table.time_s, 0.1) / 10.0)
        path += [COURSE_SD * hold * decades, COURSE_SD * hold * (decades**2 - 0.5)]
    for test in np.unique(table.test).tolist():
        of_test = table.test == test
        path += [
            TEST_SD * (of_test & (table.branch == k))
            for k in np.unique(table.branch[of_test]).tolist()
        ]
    cells: list[tuple[float, Sequence[object]]] = [
        (SD, levels([getattr(s, name) for s in specimens], *TOLERANCES[name])) for name in _LEVELS
    ]
    pieces = [s.material if s.profile is None else s.profile.name for s in specimens]
    cells += [(MATERIAL_SD, pieces), (SD, [s.orientation for s in specimens])]
    conditions: list[FloatArray] = []
    for sd, cell in cells:
        distinct = list(dict.fromkeys(cell))
        if 1 < len(distinct) <= 8:
            for value in distinct:
                of_it = np.array([c == value for c in cell])
                conditions.append(sd * of_it[table.specimen])
    none = np.zeros((len(table), 0))
    return Factors(np.stack(path, axis=1), np.stack(conditions, axis=1) if conditions else none)


@dataclass(frozen=True, slots=True, eq=False)
class Departures:
    """Whitened patterns of prior deviation 1, at a candidate's place.

    Attributes
    ----------
    columns : (N, k)
        Those of specimens' own sizes first, then what forms may depart by.
    own
        How many are of specimens' own sizes.
    branch : (k,)
        Which of the candidate's branches each belongs to: it grows as that one's size.
    """

    columns: FloatArray
    own: int
    branch: IntArray


def departures(
    candidate: Candidate,
    node_figures: FloatArray,
    factors: Factors,
    noise: SpecimenNoise,
    table: FeatureTable,
) -> Departures:
    """Return what a candidate may depart by."""
    own, form = [], []
    of_own, of_form = [], []
    for k, (branch, place) in enumerate(zip(candidate.branches, candidate.places, strict=True)):
        nodes = slice(branch.first, branch.first + branch.nodes)
        change = (node_weights(branch, place) @ node_figures[nodes])[:, None]
        form.append(change * factors.of(branch.effect.stage))
        of_form.append(np.full(form[-1].shape[1], k))
        cv = branch.effect.individual
        if cv > 0.0:
            own.append(cv * change * (table.specimen[:, None] == np.unique(table.specimen)))
            of_own.append(np.full(own[-1].shape[1], k))
    columns = np.concatenate([*own, *form], axis=1)
    white = np.empty_like(columns)
    for rows, factor in zip(noise.rows, noise.factors, strict=True):
        white[rows] = scipy.linalg.solve_triangular(
            factor, columns[rows], lower=True, check_finite=False
        )
    count = sum(part.shape[1] for part in own)
    return Departures(white, count, np.concatenate([*of_own, *of_form]).astype(np.int64))
