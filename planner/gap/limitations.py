"""What a campaign cannot tell, whatever is made of it."""

from collections.abc import Iterator, Sequence

import numpy as np

from planner.gap.conditions import replicate_groups
from planner.gap.specimen import Specimen
from planner.palette import Palette

__all__ = ["limitations_of", "named"]

_CONDITIONS = (
    "rate_mm_s", "temperature_C", "soak_h", "age_days", "orientation", "protocol", "batch",
)  # fmt: skip


def limitations_of(specimens: Sequence[Specimen], palette: Palette) -> tuple[str, ...]:
    """Return one sentence a limitation that the specimens themselves show."""
    return (
        *_of_number(specimens),
        *_of_replicates(specimens),
        *_of_unknowns(specimens),
        *_of_range(specimens, palette),
    )


def _of_number(specimens: Sequence[Specimen]) -> Iterator[str]:
    if len(specimens) == 1:
        yield (
            "one specimen only: no condition varies and there is no scatter to judge a gap by, "
            "so no cause can be named"
        )


def _of_replicates(specimens: Sequence[Specimen]) -> Iterator[str]:
    groups = replicate_groups(specimens)
    if len(specimens) > 1 and all(len(group) == 1 for group in groups):
        yield (
            "one specimen a condition: without replicates the scatter between specimens is "
            "assumed, not measured; repeat at least one condition three times"
        )


def _of_unknowns(specimens: Sequence[Specimen]) -> Iterator[str]:
    for name in _CONDITIONS:
        unknown = [s.id for s in specimens if getattr(s, name) is None]
        if not unknown:
            continue
        of = "all specimens" if len(unknown) == len(specimens) else named(unknown)
        yield f"{name} is unknown for {of}; it is not taken to be at the palette's reference"


def _of_range(specimens: Sequence[Specimen], palette: Palette) -> Iterator[str]:
    beyond: dict[tuple[float, str], list[Specimen]] = {}
    for s in specimens:
        end = _range_of(s, palette)
        if float(np.max(s.strain)) > end[0] * (1.0 + 1e-9):
            beyond.setdefault(end, []).append(s)
    for (reach, of), over in beyond.items():
        peak = max(float(np.max(s.strain)) for s in over)
        yield (
            f"{named([s.id for s in over])}: strained to {peak:.4g}, past {reach:g}, where the "
            f"law of {of} ends; what lies beyond is not compared"
        )


def _range_of(specimen: Specimen, palette: Palette) -> tuple[float, str]:
    """Return the largest strain with a law, on average over the bar, and whose it is."""
    if specimen.profile is None:
        material = palette.resolve(specimen.material or "")
        return material.elongation_at_break, material.id
    low, high = (float(f(specimen.profile.coordinate)) for f in (np.min, np.max))
    printed = [m for m in palette.materials if low - 1e-6 <= m.coordinate <= high + 1e-6]
    among = printed or list(palette.materials)
    widest = max(among, key=lambda m: m.elongation_at_break)
    return widest.elongation_at_break, widest.id


def named(ids: Sequence[str], most: int = 6) -> str:
    """Write a list of specimens in words, a long one in short."""
    if len(ids) > most:
        return f"{len(ids)} specimens ({', '.join(ids[:most])}, ...)"
    return f"{'specimen' if len(ids) == 1 else 'specimens'} {', '.join(ids)}"
