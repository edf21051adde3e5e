"""What a naive analyst would do: fit every effect to all points, and let the BIC choose.

Each single effect of the library, in each of its forms, by ordinary least squares beside the
palette as it is; every figure of every curve counts as an independent point of one variance. There
is no scatter from specimen to specimen, no batch, no calibration, no pair and no unknown. Between
the nodes at which a form is predicted its figures are interpolated, as the diagnosis does.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.withheld.scoring import Effects
from planner.gap.campaign import Campaign
from planner.gap.campaign_folder import read_campaign
from planner.gap.effect import untestable
from planner.gap.effects import effects_for
from planner.gap.evidence.problem import SignedForm, node_weights, signed_forms
from planner.gap.observations import ObservationModel
from planner.numerics import FloatArray
from planner.simulation.bar_solver import predict

__all__ = ["least_sum_of_squares", "naive_answer", "naive_bic", "schwarz_probabilities"]

_SIZES, _SHAPES = 81, 9
"""Places of a grid along a size and along a parameter of shape."""


def naive_answer(folder: Path, without: tuple[str, ...] = ()) -> dict[str, Any]:
    """Read a campaign and return the naive analyst's answer, as a diagnosis' document has it."""
    with threadpool_limits(1, user_api="blas"):
        return naive_bic(read_campaign(folder), without)


def naive_bic(campaign: Campaign, without: Sequence[str] = ()) -> dict[str, Any]:
    """Return the scored part of a document: verdict, ranking, class; nothing of where or gap."""
    effects = {id: e for id, e in effects_for(campaign.palette).items() if id not in without}
    reasons = {id for id, e in effects.items() if untestable(e, campaign) is not None}
    forms = signed_forms([e for id, e in effects.items() if id not in reasons])
    model = ObservationModel(campaign)
    setups = [model.setup]
    for signed in forms:
        setups += [signed.form.apply(model.setup, signed.values(p)) for p in signed.node_points()]
    raw = np.stack([model.predicted(predict(each, model.laws)) for each in setups])
    features = model.table.transformed(raw)
    residual = model.table.measured - features[0]
    changes = features[1:] - features[0]
    scores: dict[Effects, float] = {(): schwarz(float(residual @ residual), len(residual), 0)}
    for signed in forms:
        nodes = changes[signed.own]
        rss = least_sum_of_squares(signed, nodes, residual)
        score = schwarz(rss, len(residual), 1 + signed.shapes)
        key: Effects = (signed.effect.id,)
        scores[key] = min(scores.get(key, np.inf), score)
    ranking = schwarz_probabilities(scores)
    verdict = next(iter(ranking))
    return {
        "verdict": "+".join(verdict) or "none",
        "ranking": [{"effects": list(e), "probability": p} for e, p in ranking.items()],
        "class": [list(verdict)],
        "not_testable": sorted(reasons),
        "where": [],
        "gap": {},
    }


def least_sum_of_squares(signed: SignedForm, nodes: FloatArray, residual: FloatArray) -> float:
    """Return the least sum of squares over a grid of a branch's sizes and shapes."""
    axes = [np.linspace(signed.least, 1.0, _SIZES)]
    axes += [np.linspace(-1.0, 1.0, _SHAPES)] * signed.shapes
    places = np.stack([x.ravel() for x in np.meshgrid(*axes, indexing="ij")], axis=1)
    weights = node_weights(places)
    explained = 2.0 * weights @ (nodes @ residual)
    explained -= np.sum((weights @ (nodes @ nodes.T)) * weights, axis=1)
    return float(residual @ residual - explained.max())


def schwarz(rss: float, points: int, parameters: int) -> float:
    """Return Schwarz's criterion (Ann. Stat. 6, 1978) of a fit with a free variance."""
    return points * float(np.log(rss / points)) + parameters * float(np.log(points))


def schwarz_probabilities(
    scores: Mapping[Effects, float],
) -> dict[Effects, float]:
    """Return exp(-BIC / 2), normalised, most probable first."""
    least = min(scores.values())
    weight = {key: float(np.exp(-0.5 * (value - least))) for key, value in scores.items()}
    total = sum(weight.values())
    return {k: weight[k] / total for k in sorted(weight, key=lambda k: (-weight[k], k))}
