"""What is believed before any data: how often campaigns hide nothing, one effect, two, or more."""

from dataclasses import dataclass

__all__ = ["Priors"]


@dataclass(frozen=True, slots=True)
class Priors:
    """Prior probabilities of kinds of hypothesis; each kind's is shared equally by its members.

    Attributes
    ----------
    none, single, pair
        Nothing, one effect, two effects of the library.
    unknown
        A pattern that no effect explains, alone.
    beside
        Of any hypothesis with effects, the share that has an unknown beside it.
    """

    none: float = 0.65
    single: float = 0.20
    pair: float = 0.03
    unknown: float = 0.12
    beside: float = 0.10
