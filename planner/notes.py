"""Notes: what was assumed, corrected or left out; and cautions, which ask for an act."""

from collections.abc import Sequence

__all__ = ["Caution", "listed"]


class Caution(str):
    """A note that the user should act on: a figure may be wrong until it is looked at.

    It is a text like any other note, so that files and documents hold both alike; a command line
    shows it as a warning.
    """

    __slots__ = ()


def listed(words: Sequence[str], most: int | None = None, last: str = "and") -> str:
    """Write a list in a sentence, a long one in short."""
    if most is not None and len(words) > most:
        return f"{', '.join(words[:most])} {last} {len(words) - most} more"
    if len(words) < 2:
        return "".join(words)
    return f"{', '.join(words[:-1])} {last} {words[-1]}"
