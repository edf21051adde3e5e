"""Hypotheses as sets of effect ids, and how many of them a diagnosis chooses from."""

from collections.abc import Iterable

__all__ = ["EFFECT_IDS", "NONE", "UNKNOWN", "Effects", "effects_of", "hypothesis_count", "named"]

Effects = tuple[str, ...]
"""Effect ids, sorted."""

NONE: Effects = ()
UNKNOWN: Effects = ("unknown",)

EFFECT_IDS = frozenset(
    {
        *("rate", "temperature", "moisture", "ageing", "orientation", "composition-offset"),
        *("interface-bleed", "softening", "permanent-set", "grip-slack", "grip-slip"),
        *("machine-compliance", "cross-section", "force-scale", "force-offset", "strain-scale"),
        *("skin", "material-law"),
    }
)
"""What a verdict may name; whatever else causes a gap is unknown."""


def effects_of(ids: Iterable[str]) -> Effects:
    """Return the hypothesis that a list of ids stands for.

    The list ["none"] is the empty one, and a list that has "unknown" beside others is "unknown":
    whoever says so says that the others do not suffice.
    """
    found = {i for i in ids if i not in ("none", "")}
    return UNKNOWN if "unknown" in found else tuple(sorted(found))


def named(effects: Effects) -> bool:
    """Tell whether a hypothesis names a cause: it is neither "none" nor "unknown"."""
    return effects not in (NONE, UNKNOWN)


def hypothesis_count(left_out: Iterable[str] = ()) -> int:
    """Return how many hypotheses there are: none, unknown, each effect and each pair.

    Parameters
    ----------
    left_out
        Effects that were not testable or not known to the diagnosis.
    """
    n = len(EFFECT_IDS - set(left_out))
    return 2 + n + n * (n - 1) // 2
