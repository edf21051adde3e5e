"""What the diagnosis should reach, and whether it does."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from statistics import fmean, median

from benchmarks.withheld.scoring import Score
from benchmarks.withheld.summary import Rate, of_oracle

__all__ = ["LEFT_OUT", "Target", "targets"]

LEFT_OUT = "left out"
"""The tier of campaigns diagnosed without the effect that they hide."""

_FEWEST = 60
_MEGABYTES = 1000.0
_SECONDS = {30: 10.0, 120: 30.0}
"""The most for campaigns of up to so many specimens."""

_Value = Callable[[Score], bool | None]


@dataclass(frozen=True)
class Target:
    """One figure to reach.

    Attributes
    ----------
    wanted, got
        As text, shares with Wilson's interval at 95 %.
    met
        By the figure itself, not its interval; None where nothing was counted.
    """

    name: str
    wanted: str
    got: str
    met: bool | None


def targets(scores: Sequence[Score], specimens: int) -> list[Target]:
    """Hold scores against the targets.

    Parameters
    ----------
    specimens
        Of each campaign: the cost's target depends on it.
    """

    def of(*tiers: str) -> list[Score]:
        return [s for s in scores if s.tier in tiers]

    library, other, left_out, none = of("library"), of("other"), of(LEFT_OUT), of("none")
    pairs, seen = of("pair"), [s for s in scores if s.tier != LEFT_OUT]
    errors = [s.closure_error for s in (*library, *other, *pairs) if s.closure_error is not None]
    fewest = min(map(len, (library, other, left_out, none)))
    seconds = [s.seconds for s in scores if s.seconds is not None]
    megabytes = [s.megabytes for s in scores if s.megabytes is not None]
    slowest = next((v for most, v in _SECONDS.items() if specimens <= most), _SECONDS[120])
    log_score = fmean(s.log_score for s in seen) if seen else None
    return [
        Target(
            "campaigns, the fewest of library, other, left out and none",
            f">= {_FEWEST}",
            str(fewest),
            fewest >= _FEWEST,
        ),
        _share("library: named, of what the oracle names", 0.90, library),
        _share("other forms: named, of what the oracle names", 0.85, other),
        _least("one effect: truth in the class", 0.95, [*library, *other], lambda s: s.class_hit),
        _least("left out: unknown or a class", 0.70, left_out, lambda s: s.open),
        _most("left out: sure but wrong", 0.05, left_out, lambda s: s.misattributed),
        _most("none: false alarm", 0.02, none, lambda s: s.false_alarm),
        _least("two effects: both", 0.70, pairs, lambda s: s.top_1),
        _least("two effects: at least one", 0.95, pairs, lambda s: s.partly),
        _least("where: true axis among the first two", 0.90, seen, lambda s: s.where_hit),
        Target(
            "log score",
            "> -1.1",
            "" if log_score is None else f"{log_score:.2f} ({len(seen)})",
            None if log_score is None else log_score > -1.1,
        ),
        Target(
            "how far: median closure error",
            "<= 0.07",
            f"{median(errors):.3f} ({len(errors)})" if errors else "",
            median(errors) <= 0.07 if errors else None,
        ),
        Target(
            f"cost: longest of {specimens} specimens",
            f"<= {slowest:g} s",
            f"{max(seconds):.1f} s (median {median(seconds):.1f} s)" if seconds else "",
            max(seconds) <= slowest if seconds else None,
        ),
        Target(
            "cost: most memory of a process",
            f"< {_MEGABYTES:g} MB",
            f"{max(megabytes):.0f} MB" if megabytes else "",
            max(megabytes) < _MEGABYTES if megabytes else None,
        ),
    ]


def _rate(scores: Iterable[Score], value: _Value) -> Rate:
    values = [v for s in scores if (v := value(s)) is not None]
    return Rate(sum(values), len(values))


def _text(rate: Rate) -> str:
    if rate.share is None:
        return ""
    low, high = (100 * end for end in rate.interval)
    return f"{100 * rate.share:.0f} % [{low:.0f}, {high:.0f}] ({rate.hits}/{rate.of})"


def _share(name: str, least: float, scores: Sequence[Score]) -> Target:
    share = of_oracle(_rate(scores, lambda s: s.beside_oracle), _rate(scores, lambda s: s.oracle))
    return Target(
        name,
        f">= {100 * least:.0f} %",
        "" if share is None else share.text + f" ({share.ours}/{share.oracles})",
        None if share is None else share.value >= least,
    )


def _least(name: str, least: float, scores: Iterable[Score], value: _Value) -> Target:
    rate = _rate(scores, value)
    met = None if rate.share is None else rate.share >= least
    return Target(name, f">= {100 * least:.0f} %", _text(rate), met)


def _most(name: str, most: float, scores: Iterable[Score], value: _Value) -> Target:
    rate = _rate(scores, value)
    met = None if rate.share is None else rate.share <= most
    return Target(name, f"<= {100 * most:.0f} %", _text(rate), met)
