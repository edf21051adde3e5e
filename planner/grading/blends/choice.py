"""What ``--blend`` says."""

from dataclasses import dataclass
from typing import Literal

from planner.errors import ArgumentError, nearest_names

__all__ = ["BLENDS", "MOST_PERIODS", "BlendChoice", "blend_choice"]

BLENDS = ("nearest", "dither", "bands:N", "mix")
MOST_PERIODS = 1000


@dataclass(frozen=True, slots=True)
class BlendChoice:
    """A way to meet a target between two materials.

    Attributes
    ----------
    periods
        Of ``bands:N``, in each transition; else 0.
    """

    kind: Literal["nearest", "dither", "bands", "mix"]
    periods: int = 0


def blend_choice(text: object) -> BlendChoice:
    """Read what a user wrote.

    Raises
    ------
    ArgumentError
        No such blend, or N out of range.
    """
    if text == "nearest" or text == "dither" or text == "mix":
        return BlendChoice(text)
    if isinstance(text, str) and text.startswith("bands:"):
        try:
            periods = int(text.removeprefix("bands:"))
        except ValueError:
            periods = 0
        if not 1 <= periods <= MOST_PERIODS:
            raise ArgumentError(
                f"--blend {text}: N must be a whole number from 1 to {MOST_PERIODS}, as in bands:4"
            )
        return BlendChoice("bands", periods)
    near = nearest_names(str(text), ["nearest", "dither", "bands:4", "mix"])
    hint = f"did you mean {near[0]}? " if near else ""
    raise ArgumentError(f"--blend {text}: no such blend; {hint}it takes {', '.join(BLENDS)}")
