"""Where each form is evaluated, so that everything in between follows by interpolation.

The figures of a form are smooth in its parameters: four sizes, five values of a first parameter of
shape and three of a second carry them. Sizes are spaced as squares, being nought at the first,
which needs no evaluation: with size = high s^2, figures that are linear in the size are a parabola
in s.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from math import prod

from planner.gap.effects.effect import Effect, Form, Parameter

__all__ = ["SHAPE_NODES", "SIZE_NODES", "Branch", "branches_of", "value_at"]

SIZE_NODES = (0.25, 0.5, 0.75, 1.0)
"""Of s, the root of size over its largest."""

SHAPE_NODES = ((-0.932, -0.576, 0.0, 0.576, 0.932), (-0.85, 0.0, 0.85))
"""Of the ranges, -1 to 1, of a form's first shape parameter and of its second: nearly Chebyshev's.
Times of relaxation over decades take five."""


@dataclass(frozen=True, slots=True)
class Branch:
    """One form with one sign of its size.

    Attributes
    ----------
    number
        Among all branches.
    first
        Its first node among all nodes.
    weight
        Its share of the prior among the effect's branches.
    """

    number: int
    effect: Effect
    form: Form
    sign: float
    first: int
    weight: float

    @property
    def shapes(self) -> int:
        """Number of shape parameters."""
        return len(self.form.parameters) - 1

    @property
    def nodes(self) -> int:
        """Number of nodes."""
        return len(SIZE_NODES) * prod(len(nodes) for nodes in SHAPE_NODES[: self.shapes])

    def values(self, place: Sequence[float]) -> dict[str, float]:
        """Return the parameters at a place: s, then shapes in -1 to 1."""
        size = self.form.size
        values = {size.name: self.sign * size.high * place[0] ** 2}
        for parameter, at in zip(self.form.parameters[1:], place[1:], strict=True):
            values[parameter.name] = value_at(parameter, at)
        return values

    def node_values(self) -> list[dict[str, float]]:
        """Return the parameters of its nodes, sizes slowest."""
        grid = product(SIZE_NODES, *SHAPE_NODES[: self.shapes])
        return [self.values(place) for place in grid]

    @property
    def least(self) -> float:
        """The smallest s."""
        return float((self.form.size.low / self.form.size.high) ** 0.5)


def value_at(parameter: Parameter, at: float) -> float:
    """Return a shape parameter's value at a place of its range, -1 to 1."""
    share = 0.5 * (at + 1.0)
    if parameter.log:
        return float(parameter.low * (parameter.high / parameter.low) ** share)
    return float(parameter.low + share * (parameter.high - parameter.low))


def branches_of(effects: Sequence[Effect]) -> tuple[Branch, ...]:
    """Return all branches of the effects, numbered, with their nodes one after another."""
    found: list[Branch] = []
    first = 0
    for effect in effects:
        for form in effect.forms:
            signs = (1.0, -1.0) if form.size.signed else (1.0,)
            for sign in signs:
                weight = form.weight / sum(f.weight for f in effect.forms) / len(signs)
                branch = Branch(len(found), effect, form, sign, first, weight)
                found.append(branch)
                first += branch.nodes
    return tuple(found)
