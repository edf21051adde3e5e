"""Something about the data that a lab should look at."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

__all__ = ["Kind", "Problem", "gathered"]

Kind = Literal[
    "amplitude", "clipped", "dead", "dropout", "duplicate", "outlier", "protocol", "rate", "size",
    "spike", "units",
]  # fmt: skip


@dataclass(frozen=True, slots=True)
class Problem:
    """One problem.

    Attributes
    ----------
    specimen
        Its id, or None where the whole campaign has it.
    problem
        In words, without the specimen's name: what was found against what was expected.
    value, expected
        The same as figures, in the unit the words give; None where there is none.
    """

    kind: Kind
    specimen: str | None
    problem: str
    value: float | None = None
    expected: float | None = None


def gathered(problems: Sequence[Problem], of: int) -> tuple[Problem, ...]:
    """Make one problem of the whole campaign from equal ones of all `of` specimens, if over two."""
    if of > 2 and len(problems) == of and len({(p.kind, p.problem) for p in problems}) == 1:
        return (replace(problems[0], specimen=None),)
    return tuple(problems)
