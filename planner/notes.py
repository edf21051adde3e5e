"""Notes: what was assumed, corrected or left out; and cautions, which ask for an act."""

__all__ = ["Caution"]


class Caution(str):
    """A note that the user should act on: a figure may be wrong until it is looked at.

    It is a text like any other note, so that files and documents hold both alike; a command line
    shows it as a warning.
    """

    __slots__ = ()
