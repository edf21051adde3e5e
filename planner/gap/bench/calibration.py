"""Whether probabilities mean what they say."""

from collections.abc import Sequence

import numpy as np
from scipy.stats import rankdata

__all__ = ["area_under_curve", "expected_calibration_error"]


def expected_calibration_error(
    probabilities: Sequence[float], right: Sequence[bool], bins: int = 10
) -> float | None:
    """Return the mean distance of how often it was right from how sure it was.

    Over bins of equal width, weighted by what is in them (Naeini et al., AAAI 2015); None of
    nothing. Biased upwards where the bins hold few.
    """
    if not len(probabilities):
        return None
    p, hit = np.asarray(probabilities, dtype=float), np.asarray(right, dtype=float)
    place = np.minimum((p * bins).astype(int), bins - 1)
    apart = np.bincount(place, weights=hit - p, minlength=bins)
    return float(np.abs(apart).sum() / len(p))


def area_under_curve(scores: Sequence[float], positive: Sequence[bool]) -> float | None:
    """Return the probability that a positive case scores above a negative one, ties by half.

    The area under the receiver operating characteristic (Hanley & McNeil, Radiology 143, 1982);
    None where there is but one kind of case.
    """
    label = np.asarray(positive, dtype=bool)
    of, others = int(label.sum()), int((~label).sum())
    if not (of and others):
        return None
    ranks = rankdata(np.asarray(scores, dtype=float))
    return float((ranks[label].sum() - 0.5 * of * (of + 1)) / (of * others))
