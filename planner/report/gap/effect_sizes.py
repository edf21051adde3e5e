"""How large the effects of a verdict are, and how large one had to be to be seen, in words."""

import math
from collections.abc import Iterator, Sequence

from planner.gap.diagnosis import Detectable, FoundEffect
from planner.gap.effects import EFFECTS
from planner.report.gap.wording import figure, listed, percent

__all__ = ["detectable_words", "meaning", "shown", "size_words"]

_SPECIMENS = 6
_SEEN = 8
_LOG_STRESS = "of ln stress"


def size_words(effects: Sequence[FoundEffect]) -> Iterator[str]:
    """Yield a sentence an effect: its parameters with their 90 % intervals."""
    for effect in effects:
        sizes = []
        for name, value in effect.parameters.items():
            unit = effect.units.get(name, "1")
            ends = effect.interval.get(name)
            words = meaning(effect.id, effect.form, name)
            within = "" if ends is None else f" (90 % interval {_span(name, words, unit, ends)})"
            sizes.append(f"{_label(name, words)} {shown(name, words, unit, value)}{within}")
        of = ""
        if effect.specimens:
            of = f" (in {listed(effect.specimens, most=_SPECIMENS)} only)"
        form = f", as {effect.form}" if effect.form else ""
        yield f"{effect.id}{form}{of}: {'; '.join(sizes)}."


def detectable_words(detectable: Sequence[Detectable]) -> Iterator[str]:
    """Yield the smallest size of each effect that would have been seen, the first few alone."""
    seen = [d for d in detectable if d.size is not None]
    for d in seen[:_SEEN]:
        words = meaning(d.id, "", d.parameter)
        assert d.size is not None
        size = shown(d.parameter, words, d.unit, d.size)
        yield f"{d.id} from {_label(d.parameter, words)} {size}."
    if len(seen) > _SEEN:
        yield f"{len(seen) - _SEEN} more of these are in diagnosis.json."
    blind = [d.id for d in detectable if d.size is None]
    if blind:
        yield f"Not seen at any size that it may have: {listed(blind)}."


def meaning(effect: str, form: str, parameter: str) -> str:
    """Return what a parameter means, as the effect's form says it; "" where none does."""
    known = EFFECTS.get(effect)
    forms = () if known is None else known.forms
    for one in sorted(forms, key=lambda f: f.name != form):
        for candidate in one.parameters:
            if candidate.name == parameter:
                return candidate.meaning
    return ""


def shown(name: str, words: str, unit: str, value: float) -> str:
    """Return a value as a lab writes it: logarithms as ratios or per cent, units beside figures."""
    if name.startswith("log_"):
        return f"{figure(math.exp(value))} times"
    if words.startswith(_LOG_STRESS):
        return _signed_percent(math.expm1(value))
    return figure(value) if unit in ("1", "") else f"{figure(value)} {unit}"


def _label(name: str, words: str) -> str:
    """Name a parameter with its meaning, if that says more."""
    if name.startswith("log_"):
        name = name.removeprefix("log_")
        words = words.removeprefix("ln of ")
    elif words.startswith(_LOG_STRESS):
        words = "of stress" + words.removeprefix(_LOG_STRESS)
    if not words:
        return name
    if words.startswith(f"{name} "):
        return words
    return f"{name} {words}" if words.startswith("of ") else f"{name} ({words})"


def _span(name: str, words: str, unit: str, ends: tuple[float, float]) -> str:
    low, high = (shown(name, words, unit, end) if math.isfinite(end) else "open" for end in ends)
    # A unit that both ends share is written once.
    for suffix in (f" {unit}", " %", " times"):
        if low.endswith(suffix) and high.endswith(suffix):
            return f"{low.removesuffix(suffix)} to {high}"
    return f"{low} to {high}"


def _signed_percent(change: float) -> str:
    return f"{'+' if change > 0.0 else ''}{percent(change)}"
