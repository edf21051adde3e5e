"""The probability of each hypothesis as bars."""

from collections.abc import Iterator

from planner.gap.diagnosis import Diagnosis, Hypothesis
from planner.report.gap.colours import AFTER, PALE, QUIET
from planner.report.gap.wording import id_of, probability
from planner.report.svg import GREY, picture, rectangle, segment, text

__all__ = ["evidence_figure"]

_MOST, _LEAST = 8, 0.005
_LEFT, _WIDTH, _RIGHT, _TOP, _STEP, _BAR = 290.0, 380.0, 90.0, 82.0, 28.0, 17.0


def evidence_figure(diagnosis: Diagnosis) -> bytes:
    """Return the figure as SVG: most probable first, the part that needs an unknown pale."""
    shown = [
        h
        for h in diagnosis.ranking[:_MOST]
        if h.probability >= _LEAST or id_of(h.effects) in ("none", diagnosis.verdict)
    ]
    title = "How probable each explanation is"
    bottom = _TOP + _STEP * max(len(shown), 1)
    parts = [text(20.0, 28.0, title, size=15.0), *_key()]
    for tick in (0.0, 0.25, 0.5, 0.75, 1.0):
        x = _LEFT + _WIDTH * tick
        parts.append(segment((x, _TOP - 4.0), (x, bottom), colour="#e4e4e4"))
        parts.append(text(x, bottom + 16.0, f"{tick:g}", anchor="middle", colour=QUIET))
    for number, hypothesis in enumerate(shown):
        parts += _bar(diagnosis, hypothesis, _TOP + _STEP * number)
    parts.append(segment((_LEFT, _TOP - 4.0), (_LEFT, bottom), colour=GREY))
    if len(diagnosis.same_class) > 1:
        parts.append(text(20.0, bottom + 36.0, "● not to be told apart here", colour=QUIET))
    rest = 1.0 - sum(h.probability for h in shown)
    if rest >= 5e-4:
        note = f"all others together: {probability(rest)}"
        parts.append(text(_LEFT + _WIDTH, bottom + 36.0, note, anchor="end", colour=QUIET))
    return picture(_LEFT + _WIDTH + _RIGHT, bottom + 50.0, parts, title=title)


def _bar(diagnosis: Diagnosis, hypothesis: Hypothesis, top: float) -> Iterator[str]:
    name = id_of(hypothesis.effects)
    alike = len(diagnosis.same_class) > 1 and hypothesis.effects in diagnosis.same_class
    mark = "● " if alike else ""
    middle = top + 0.5 * _BAR + 4.0
    yield text(_LEFT - 10.0, middle, mark + name, anchor="end")
    width = _WIDTH * min(hypothesis.probability, 1.0)
    plain = width * (1.0 - min(max(hypothesis.with_unknown, 0.0), 1.0))
    if hypothesis.effects == ("unknown",):
        plain = 0.0
    yield rectangle(_LEFT, top, plain, _BAR, colour=AFTER)
    yield rectangle(_LEFT + plain, top, width - plain, _BAR, colour=PALE)
    yield text(_LEFT + width + 8.0, middle, probability(hypothesis.probability))


def _key() -> Iterator[str]:
    yield rectangle(_LEFT, 48.0, 12.0, 12.0, colour=AFTER)
    yield text(_LEFT + 18.0, 58.0, "by itself", colour=QUIET)
    yield rectangle(_LEFT + 92.0, 48.0, 12.0, 12.0, colour=PALE)
    yield text(_LEFT + 110.0, 58.0, "needs something unknown", colour=QUIET)
