"""Bands that are thinner than a printer's minimum wall, along fields that are lengths."""

import itertools
from collections.abc import Sequence

from planner.geometry.fields import Field
from planner.grading.bands import Band
from planner.palette import Palette
from planner.plan import Finding
from planner.printers import Printer

__all__ = ["thin_bands"]


def thin_bands(
    field: Field, bands: Sequence[Band], palette: Palette, machine: Printer
) -> tuple[Finding, ...]:
    """Find the thinnest band of each material, neighbours of one material being one.

    Fields in mm alone are looked at: radii, distances, ways. The first and the last band, which
    the part may end within, are not.
    """
    described = field.description()
    begin, end = described.get("from_mm"), described.get("to_mm")
    if not (isinstance(begin, float) and isinstance(end, float)):
        return ()
    whole = []
    for grade, several in itertools.groupby(bands, key=lambda band: band.grade):
        own = list(several)
        whole.append((grade, own[0].start, own[-1].stop))
    found: dict[int, tuple[float, float]] = {}
    count: dict[int, int] = {}
    for grade, start, stop in whole[1:-1]:
        thickness_mm = (stop - start) * abs(end - begin)
        if thickness_mm < machine.minimum_wall_mm:
            count[grade] = count.get(grade, 0) + 1
            found[grade] = min(found.get(grade, (thickness_mm, start)), (thickness_mm, start))
    return tuple(
        Finding(
            kind="thin-wall",
            message=f"{palette.materials[grade].id}: a band of {thickness_mm:.2f} mm at "
            f"{begin + start * (end - begin):.2f} mm along the field is below the minimum wall of "
            f"{machine.minimum_wall_mm:g} mm"
            + (f"; and {count[grade] - 1} more" if count[grade] > 1 else "")
            + "; take fewer periods",
            material=palette.materials[grade].id,
            size_mm=thickness_mm,
        )
        for grade, (thickness_mm, start) in sorted(found.items())
    )
