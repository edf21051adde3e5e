"""What the diagnosis should reach, and whether it does."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from statistics import fmean, median

from benchmarks.withheld.scoring import Score
from benchmarks.withheld.summary import Rate

__all__ = ["LEFT_OUT", "Target", "targets"]

LEFT_OUT = "left out"
"""The tier of campaigns diagnosed without the effect that they hide."""

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

    def of(*tiers: str, snr: tuple[float, float] = (0.0, float("inf"))) -> list[Score]:
        return [
            s for s in scores if s.tier in tiers and (s.snr is None or snr[0] <= s.snr < snr[1])
        ]

    library, other, left_out = of("library"), of("other"), of(LEFT_OUT)
    pairs, seen = of("pair"), [s for s in scores if s.tier != LEFT_OUT]
    named = [*library, *other, *pairs]
    rows = [
        _least("library, SNR > 4: top-1", 0.95, of("library", snr=(4, 1e9)), _top_1),
        _least("library, SNR 2-4: top-1", 0.85, of("library", snr=(2, 4)), _top_1),
        _mean("library: mean probability on the truth", 0.85, [s.probability for s in library]),
        _least("library: truth in the class", 0.98, library, lambda s: s.class_hit),
        _least("other forms: top-1", 0.85, other, _top_1),
        _most("other forms: spurious companion", 0.10, other, lambda s: s.companion),
        _least("left out: unknown or a class", 0.85, left_out, lambda s: s.open),
        _most("left out: sure but wrong", 0.05, left_out, lambda s: s.misattributed),
        _least("unclaimed: unknown or a class", 0.85, of("unclaimed"), lambda s: s.open),
        _most("unclaimed: sure but wrong", 0.05, of("unclaimed"), lambda s: s.misattributed),
        _most("none: false alarm", 0.02, of("none"), lambda s: s.false_alarm),
        _most("none, t4 tails: false alarm", 0.05, of("none-t4"), lambda s: s.false_alarm),
        _most("none, 1.6 x scatter: false alarm", 0.05, of("none-scatter"), _false_alarm),
        _least("two effects: both", 0.85, pairs, _top_1),
        _least("two effects: at least one", 0.98, pairs, lambda s: s.partly),
        _least("where: true axis among the first two", 0.90, seen, lambda s: s.where_hit),
    ]
    errors = [s.closure_error for s in named if s.closure_error is not None]
    if errors:
        error = median(errors)
        got = f"{error:.3f} ({len(errors)})"
        rows.append(Target("how far: median closure error", "<= 0.05", got, error <= 0.05))
    else:
        rows.append(Target("how far: median closure error", "<= 0.05", "", None))
    covered = _rate(named, lambda s: s.covered)
    share = covered.share
    met = None if share is None else 0.85 <= share <= 0.95
    rows.append(Target("how far: 90 % interval covers", "85-95 %", _text(covered), met))
    return [*rows, _cost([s.seconds for s in scores if s.seconds is not None], specimens)]


def _top_1(score: Score) -> bool:
    return score.top_1


def _false_alarm(score: Score) -> bool | None:
    return score.false_alarm


def _rate(scores: Iterable[Score], value: _Value) -> Rate:
    values = [v for s in scores if (v := value(s)) is not None]
    return Rate(sum(values), len(values))


def _text(rate: Rate) -> str:
    if rate.share is None:
        return ""
    low, high = (100 * end for end in rate.interval)
    return f"{100 * rate.share:.0f} % [{low:.0f}, {high:.0f}] ({rate.hits}/{rate.of})"


def _least(name: str, least: float, scores: Iterable[Score], value: _Value) -> Target:
    rate = _rate(scores, value)
    met = None if rate.share is None else rate.share >= least
    return Target(name, f">= {100 * least:.0f} %", _text(rate), met)


def _most(name: str, most: float, scores: Iterable[Score], value: _Value) -> Target:
    rate = _rate(scores, value)
    met = None if rate.share is None else rate.share <= most
    return Target(name, f"<= {100 * most:.0f} %", _text(rate), met)


def _mean(name: str, least: float, values: Sequence[float]) -> Target:
    wanted = f">= {least:g}"
    if not values:
        return Target(name, wanted, "", None)
    return Target(name, wanted, f"{fmean(values):.3f} ({len(values)})", fmean(values) >= least)


def _cost(seconds: Sequence[float], specimens: int) -> Target:
    most = 10.0 if specimens <= 30 else 60.0
    name = f"cost: longest of {specimens} specimens"
    if not seconds:
        return Target(name, f"<= {most:g} s", "", None)
    got = f"{max(seconds):.1f} s (median {median(seconds):.1f} s)"
    return Target(name, f"<= {most:g} s", got, max(seconds) <= most)
