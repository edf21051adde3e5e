"""Estimate the scatter from specimens that were made and tested alike.

Differences between replicates do not know what is hidden: they are fitted by restricted maximum
likelihood with wide physical priors, so that two replicates a condition say what they can and a
campaign without any still has an honest, wide answer.
"""

import math

import numpy as np
import scipy.linalg
import scipy.optimize

from planner.arrays import FloatArray, IntArray
from planner.gap.features.table import BRANCHES, FeatureTable
from planner.gap.noise.blocks import specimen_block
from planner.gap.noise.scatter import Scatter

__all__ = ["USUAL", "estimate_scatter"]

USUAL = Scatter(
    specimen=0.03, batch=0.012, slope=0.012, wander=0.006, wander_length=0.15, sensor=1.0,
    field=0.003, field_relative=0.02, log_sd=0.5, degrees_of_freedom=0,
)  # fmt: skip
"""Jetted specimens scatter by 1 to 9 % within a print."""

_PRIOR_SD = {"specimen": 0.6, "batch": 0.5, "slope": 0.5, "wander": 0.5, "wander_length": 0.4,
             "sensor": 0.4}  # fmt: skip
_NAMES = tuple(_PRIOR_SD)
_FIELD = BRANCHES.index("field")


def estimate_scatter(
    table: FeatureTable,
    sensitivity: FloatArray,
    sensor_sd_N: FloatArray,
    batch_of: IntArray,
    path: FloatArray,
) -> Scatter:
    """Return the scatter of a campaign's specimens; `USUAL`, widely uncertain, without replicates.

    Parameters are those of `specimen_noise`.
    """
    groups = _groups(table)
    field, relative = _field_scatter(table)
    freedom = sum(len(g) - 1 for g in groups)
    if not freedom:
        return _with(np.zeros(len(_NAMES)), field, relative, USUAL.log_sd, 0)
    contrasts = [_contrasts(table, rows, batch_of) for rows in groups]

    def cost(logs: FloatArray) -> float:
        scatter = _with(logs, field, relative, 0.0, freedom)
        total = 0.5 * float(np.sum((logs / list(_PRIOR_SD.values())) ** 2))
        for rows, (values, batch_share) in zip(groups, contrasts, strict=True):
            first = slice(int(rows[0][0]), int(rows[0][-1]) + 1)
            own = specimen_block(table, sensitivity, scatter, sensor_sd_N, path, first)
            forces = np.flatnonzero(table.branch[rows[0]] != _FIELD)
            own = own[np.ix_(forces, forces)]
            h = scatter.batch * sensitivity[rows[0]][forces]
            shared = np.outer(h, h)
            for difference, share in zip(values, batch_share, strict=True):
                total += _half_deviance(difference[forces], own + share * shared)
        return total

    best = scipy.optimize.minimize(
        cost, np.zeros(len(_NAMES)), method="L-BFGS-B", bounds=[(-2.5, 2.5)] * len(_NAMES),
        options={"maxiter": 25},
    )  # fmt: skip
    log_sd = 1.0 / math.sqrt(1.0 / USUAL.log_sd**2 + 2.0 * freedom)
    return _with(best.x, field, relative, log_sd, freedom)


def _with(logs: FloatArray, field: float, relative: float, log_sd: float, freedom: int) -> Scatter:
    factor = dict(zip(_NAMES, np.exp(logs).tolist(), strict=True))
    level = USUAL.specimen * factor["specimen"]
    return Scatter(
        specimen=level,
        # Ratios to the specimens' level have priors of their own.
        batch=level * USUAL.batch / USUAL.specimen * factor["batch"],
        slope=level * USUAL.slope / USUAL.specimen * factor["slope"],
        wander=level * USUAL.wander / USUAL.specimen * factor["wander"],
        wander_length=USUAL.wander_length * factor["wander_length"],
        sensor=USUAL.sensor * factor["sensor"],
        field=field,
        field_relative=relative,
        log_sd=log_sd,
        degrees_of_freedom=freedom,
    )


def _half_deviance(values: FloatArray, covariance: FloatArray) -> float:
    factor = np.linalg.cholesky(covariance)
    whitened = scipy.linalg.solve_triangular(factor, values, lower=True, check_finite=False)
    return float(np.log(np.diagonal(factor)).sum() + 0.5 * whitened @ whitened)


def _groups(table: FeatureTable) -> list[list[IntArray]]:
    """Return, for each test with two specimens or more, the rows of each."""
    found: dict[int, dict[int, list[int]]] = {}
    for row, (test, specimen) in enumerate(
        zip(table.test.tolist(), table.specimen.tolist(), strict=True)
    ):
        found.setdefault(test, {}).setdefault(specimen, []).append(row)
    groups = []
    for specimens in found.values():
        lengths = {len(rows) for rows in specimens.values()}
        if len(specimens) > 1 and len(lengths) == 1:
            groups.append([np.array(rows) for rows in specimens.values()])
    return groups


def _contrasts(
    table: FeatureTable, rows: list[IntArray], batch_of: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Return orthonormal differences of replicates, and the share of batch variance in each."""
    count = len(rows)
    helmert = scipy.linalg.helmert(count)
    values = helmert @ table.measured[np.stack(rows)]
    batch = np.array([batch_of[table.specimen[r[0]]] for r in rows])
    members = (batch[:, None] == np.unique(batch)).astype(np.float64)
    if (batch < 0).any():
        members = np.zeros((count, 1))
    return values, np.sum((helmert @ members) ** 2, axis=1)


def _field_scatter(table: FeatureTable) -> tuple[float, float]:
    """Return the deviation of local strains from a smooth course over replicates or neighbours."""
    field = table.branch == _FIELD
    if not field.any():
        return USUAL.field, USUAL.field_relative
    differences, levels = [], []
    for rows in _groups(table):
        at = np.stack([r[table.branch[r] == _FIELD] for r in rows])
        raw = table.measured_raw[at]
        if raw.size:
            middle = raw.mean(axis=0)
            differences.append(((raw - middle) * math.sqrt(len(rows) / (len(rows) - 1.0))).ravel())
            levels.append(np.broadcast_to(np.abs(middle), raw.shape).ravel())
    if not differences:
        return USUAL.field, USUAL.field_relative
    squares = np.concatenate(differences) ** 2
    level = np.concatenate(levels) ** 2
    # Var = a + b level^2 by least squares on the squares, both kept positive.
    design = np.stack([np.ones_like(level), level], axis=1)
    scale = 1.0 / (np.median(squares) + level * 1e-3 + 1e-12)
    a, b = scipy.optimize.nnls(design * scale[:, None], squares * scale)[0].tolist()
    return math.sqrt(max(a, 1e-8)), math.sqrt(max(b, 1e-5))
