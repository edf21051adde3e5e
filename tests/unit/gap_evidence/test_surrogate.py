"""Interpolation between the nodes of the library's forms: exact at nodes, how good elsewhere."""

from collections.abc import Sequence

import numpy as np
import pytest

from planner.gap.effects import EFFECTS
from planner.gap.evidence.problem import Problem, SignedForm, node_weights, signed_forms
from planner.numerics import FloatArray
from planner.simulation.bar_solver import predict

SIGNED_FORMS = signed_forms(list(EFFECTS.values()))
PLACES = 8

USUAL_ERROR = 0.08
"""Of the RMS of what a form changes: below what any form may depart by (6 to 45 %)."""

COARSE = {
    ("ageing", "saturating"): 0.21,
    ("force-offset", "drifting"): 0.28,
    ("force-offset", "untared"): 0.15,
    ("grip-slack", "of-soft"): 0.17,
    ("grip-slip", "threshold"): 0.24,
    ("permanent-set", "graded"): 0.24,
    ("permanent-set", "power"): 0.32,
    ("permanent-set", "proportional"): 0.15,
    ("permanent-set", "threshold"): 0.18,
    ("rate", "graded-prony"): 0.20,
    ("rate", "prony"): 0.13,
}
"""Forms with a kink, a threshold, decades of time or forces near 0 within their range: what three
sizes and five values of a shape do not carry; 1.4 times as measured, so that none gets worse."""


def change(problem: Problem, signed: SignedForm, places: Sequence[Sequence[float]]) -> FloatArray:
    """Return what the forward model itself changes at places, (places, N)."""
    setup = problem.model.setup
    setups = [signed.form.apply(setup, signed.values(place)) for place in places]
    table = problem.table
    model = problem.model
    raw = np.array([model.predicted(predict(each, model.laws)) for each in setups])
    found: FloatArray = table.transformed(raw) - table.transformed(problem.unpredicted)
    return found


def named(problem: Problem, effect: str, form: str) -> list[SignedForm]:
    return [b for b in problem.signed_forms if (b.effect.id, b.form.name) == (effect, form)]


@pytest.mark.parametrize("shapes", [0, 1, 2])
def test_weights_are_one_at_a_node_and_carry_polynomials(shapes: int) -> None:
    signed = next(b for b in SIGNED_FORMS if b.shapes == shapes)
    nodes = signed.node_points()
    assert node_weights(nodes) == pytest.approx(np.eye(len(nodes)), abs=1e-12)
    # Third order in the size, being nought at 0; second order in each shape.
    values = [s**6 * np.prod([1.0 + x**2 for x in t]) for s, *t in nodes]
    at = [0.4, 0.3, -0.6][: 1 + shapes]
    expected = 0.4**6 * np.prod([1.0 + x**2 for x in at[1:]])
    assert node_weights(at) @ values == pytest.approx(expected, rel=1e-12)


def test_branches_have_their_nodes_one_after_another() -> None:
    first = 0
    for number, signed in enumerate(SIGNED_FORMS):
        assert (signed.number, signed.first) == (number, first)
        assert signed.own == slice(first, first := first + len(signed.node_points()))
    for id in EFFECTS:
        assert sum(b.weight for b in SIGNED_FORMS if b.effect.id == id) == pytest.approx(1.0)


@pytest.mark.parametrize(
    "signed", SIGNED_FORMS, ids=lambda b: f"{b.effect.id}-{b.form.name}{b.sign:+}"
)
def test_points_are_within_the_priors(signed: SignedForm) -> None:
    for s in (signed.least, 1.0):
        for t in (-1.0, 1.0):
            values = signed.values([s] + [t] * signed.shapes)
            for p in signed.form.parameters:
                value = abs(values[p.name]) if p is signed.form.size else values[p.name]
                slack = 1e-9 * max(abs(p.low), abs(p.high))
                assert p.low - slack <= value <= p.high + slack


def test_nodes_are_exact(everything: Problem) -> None:
    """A candidate at a node has the features that the forward model gave there."""
    for effect, form in (("rate", "prony"), ("interface-bleed", "gaussian")):
        (signed,) = named(everything, effect, form)
        place = signed.node_points()[-2]
        by_nodes = everything.nodes[:, signed.own] @ node_weights(place)
        exact = everything.noise.whiten(change(everything, signed, [list(place)])[0])
        assert by_nodes == pytest.approx(exact, rel=1e-9, abs=1e-9)


FORMS = sorted({(b.effect.id, b.form.name) for b in SIGNED_FORMS if b.effect.id != "material-law"})


@pytest.mark.slow
@pytest.mark.parametrize("effect", sorted({effect for effect, _ in FORMS}))
def test_between_nodes_forms_are_near(everything: Problem, effect: str) -> None:
    """At random places of the prior: RMS error over the RMS of the change, all places together."""
    for form in (f for e, f in FORMS if e == effect):
        errors, changes = [], []
        for signed in named(everything, effect, form):
            rng = np.random.default_rng(0)
            places = [
                [signed.least ** float(rng.uniform()), *rng.uniform(-1.0, 1.0, signed.shapes)]
                for _ in range(PLACES)
            ]
            exact = change(everything, signed, places)
            own = change(everything, signed, signed.node_points())
            errors.append(node_weights(places) @ own - exact)
            changes.append(exact)
        share = np.sqrt(np.mean(np.square(errors)) / max(np.mean(np.square(changes)), 1e-30))
        assert share < COARSE.get((effect, form), USUAL_ERROR) or not np.any(changes)
