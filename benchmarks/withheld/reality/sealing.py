"""The truth of a set of campaigns, in a file whose hash can be published before anyone opens it."""

import hashlib
import json
from collections.abc import Sequence
from typing import Any

from benchmarks.withheld.reality.campaign import Campaign

__all__ = ["seal", "sha256"]

_DIGITS = 6


def seal(campaigns: Sequence[Campaign], made_by: dict[str, Any]) -> bytes:
    """Return the truth file: JSON, one entry a campaign folder.

    Parameters
    ----------
    made_by
        What it takes to make the same campaigns again, the seed with it.
    """
    truths = {c.name: _rounded(c.truth) for c in sorted(campaigns, key=lambda c: c.name)}
    document = {"schema": 1, "kind": "withheld-truth", "made_by": made_by, "campaigns": truths}
    return (json.dumps(document, indent=1, sort_keys=True) + "\n").encode()


def sha256(sealed: bytes) -> str:
    """Return the hash to publish."""
    return hashlib.sha256(sealed).hexdigest()


def _rounded(value: Any) -> Any:
    """Return the value with numbers to six digits: the last ones differ between machines."""
    match value:
        case float():
            return float(f"{value:.{_DIGITS}g}")
        case dict():
            return {k: _rounded(v) for k, v in value.items()}
        case list():
            return [_rounded(v) for v in value]
    return value
