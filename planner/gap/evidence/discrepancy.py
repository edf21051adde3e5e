"""No form is exact: by how much a real effect may depart from one that is named rightly.

Whatever a form changes, it may change some more on one branch of the path, at one level of a
covariate, in one material. Without this, the least misfit of a strong effect's form would be taken
for a second effect.
"""

from collections.abc import Sequence

import numpy as np
import scipy.linalg

from planner.arrays import FloatArray
from planner.gap.campaign import Campaign
from planner.gap.conditions import TOLERANCES, levels
from planner.gap.evidence.candidate import Candidate
from planner.gap.evidence.weights import node_weights
from planner.gap.features.table import BRANCHES, FeatureTable
from planner.gap.noise import SpecimenNoise

__all__ = ["discrepancy_factors", "discrepancy_patterns"]

SD = 0.15
"""Of an effect's size from branch to branch and from level to level."""

MATERIAL_SD = 0.40
"""Of its size from material to material: how effects go with the mixture is hardly known."""

COURSE_SD = 0.45
"""Of its change from the beginning of a path to its end."""

TEST_SD = 0.06
"""Of its size from test to test and branch to branch, whatever they are."""

_LEVELS = ("rate_mm_s", "temperature_C", "soak_h", "age_days", "thickness_mm", "width_mm")


def discrepancy_factors(campaign: Campaign, table: FeatureTable) -> FloatArray:
    """Return what multiplies an effect's change of the figures, (N, k), of prior deviation 1."""
    specimens = campaign.specimens
    columns: list[FloatArray] = [SD * (table.branch == k) for k in range(len(BRANCHES))]
    peak = np.zeros(len(specimens))
    np.maximum.at(peak, table.specimen, table.strain)
    travel = 2.0 * table.strain / np.maximum(peak[table.specimen], 1e-12) - 1.0
    columns += [COURSE_SD * travel * (table.branch == k) for k in range(len(BRANCHES))]
    columns.append(COURSE_SD * (2.0 * travel**2 - 1.0))
    hold = table.branch == BRANCHES.index("hold")
    if hold.any():
        decades = np.log10(np.maximum(table.time_s, 0.1) / 10.0)
        columns += [COURSE_SD * hold * decades, COURSE_SD * hold * (decades**2 - 0.5)]
    cells: list[tuple[float, Sequence[object]]] = [
        (SD, levels([getattr(s, name) for s in specimens], *TOLERANCES[name])) for name in _LEVELS
    ]
    pieces = [s.material if s.profile is None else s.profile.name for s in specimens]
    cells += [(MATERIAL_SD, pieces), (SD, [s.orientation for s in specimens])]
    for sd, cell in cells:
        distinct = list(dict.fromkeys(cell))
        if 1 < len(distinct) <= 8:
            for value in distinct:
                of_it = np.array([c == value for c in cell])
                columns.append(sd * of_it[table.specimen])
    for test in np.unique(table.test).tolist():
        of_test = table.test == test
        columns += [
            TEST_SD * (of_test & (table.branch == k))
            for k in np.unique(table.branch[of_test]).tolist()
        ]
    return np.stack(columns, axis=1)


def discrepancy_patterns(
    candidate: Candidate,
    node_figures: FloatArray,
    factors: FloatArray,
    noise: SpecimenNoise,
    table: FeatureTable,
) -> tuple[FloatArray, FloatArray]:
    """Return whitened patterns of prior deviation 1, (N, k): of specimens' own sizes, of the form.

    The first are those of effects whose size is each specimen's own, the second what a form may
    depart by.
    """
    own, form = [], []
    for branch, place in zip(candidate.branches, candidate.places, strict=True):
        nodes = slice(branch.first, branch.first + branch.nodes)
        change = (node_weights(branch, place) @ node_figures[nodes])[:, None]
        form.append(change * factors)
        cv = branch.effect.individual
        if cv > 0.0:
            own.append(cv * change * (table.specimen[:, None] == np.unique(table.specimen)))
    columns = np.concatenate([*own, *form], axis=1)
    white = np.empty_like(columns)
    for rows, factor in zip(noise.rows, noise.factors, strict=True):
        white[rows] = scipy.linalg.solve_triangular(
            factor, columns[rows], lower=True, check_finite=False
        )
    count = sum(part.shape[1] for part in own)
    return white[:, :count], white[:, count:]
