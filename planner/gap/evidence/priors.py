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
    claimed
        Of an unknown, the share along axes that some effect of the library claims.
    coarseness_nats
        Gain at which evidence counts half: no form is exact, and the more strongly an effect
        shows, the smaller are the misfits of its form that would pass for further effects.
        A coarsened posterior, Miller & Dunson, J. Am. Stat. Assoc. 114, 2019, 1113.
    """

    none: float = 0.66
    single: float = 0.054
    pair: float = 0.0017
    unknown: float = 0.2843
    beside: float = 0.05
    claimed: float = 0.2
    coarseness_nats: float = 400.0
