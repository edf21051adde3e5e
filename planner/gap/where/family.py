"""P-values over a family of axes: how often the clearest of all is as clear without a gap.

Westfall and Young's single-step minimum of p-values. The figure of each axis is brought to one
scale by its own draws first, so that none dominates; the draws then say how often the smallest of
all is as small, whatever the axes have in common. An axis is never clearer than its own figure
says, which is exact for normal noise even where draws trade what is not quite alike.

What draws cannot resolve follows from the tail of the figure's logarithm, which is exponential (a
generalised Pareto tail of shape 0, fitted to the clearest tenth of draws, never thinner than that
of a true p-value).
"""

import numpy as np

from planner.arrays import FloatArray

__all__ = ["family_wise", "rank_p", "tail_p"]

SMALLEST = 1e-12
"""A tail fitted to a thousand draws says nothing about less."""

_TIES = 1e-9


def family_wise(p: FloatArray, drawn: FloatArray, least: FloatArray) -> FloatArray:
    """Return family-wise p-values of axes, (A,), from figures like p-values.

    Parameters
    ----------
    p : (A,)
    drawn : (A, P)
        Of draws without a gap, each draw the same for all axes.
    least : (A,)
        The chance of a draw that shows the very same, which `drawn` is without.
    """
    own = np.array(
        [
            min(1.0, c + max(a, tail_p(-float(np.log(a)), -np.log(b), 1.0)))
            for a, b, c in zip(np.minimum(p, 1.0), drawn, least, strict=True)
        ]
    )
    clearest = -np.log(np.min([rank_p(-d) for d in drawn], axis=0))
    return np.array([max(a, tail_p(-float(np.log(a)), clearest, 1.0)) for a in own])


def rank_p(figures: FloatArray) -> FloatArray:
    """Return the share of draws whose figure is as large as each one's own."""
    ordered = np.sort(figures)
    as_large = len(figures) - np.searchsorted(ordered, figures, side="left")
    share: FloatArray = as_large / len(figures)
    return share


def _counted(figure: float, drawn: FloatArray) -> float:
    """Return the share of draws, the seen one among them, whose figure is as large."""
    as_large = drawn >= figure - _TIES * max(abs(figure), 1.0)
    return (1.0 + float(np.sum(as_large))) / (len(drawn) + 1.0)


def tail_p(figure: float, drawn: FloatArray, thinnest: float) -> float:
    """Return the chance of a figure as large as this, by its draws and their exponential tail.

    Parameters
    ----------
    figure, drawn
        Large where it is clear; the tail falls exponentially.
    thinnest
        The least mean excess over a high threshold that is believed.
    """
    counted = _counted(figure, drawn)
    if counted > 1.5 / (len(drawn) + 1.0) or len(drawn) < 50:
        return counted
    threshold = float(np.quantile(drawn, 0.9))
    beyond = drawn[drawn > threshold]
    mean = max(float(np.mean(beyond - threshold)) if len(beyond) else 0.0, thinnest)
    share = len(beyond) / len(drawn)
    tail = share * float(np.exp(-(figure - threshold) / mean))
    return float(np.clip(tail, SMALLEST, counted))
