"""Findings about walls, layers, bits and gaps, in words."""

import math
from collections.abc import Sequence

from planner.geometry.fragments import Fragments
from planner.geometry.solid_walls import ThinPlace
from planner.plan import Finding
from planner.printers import Printer

__all__ = ["band_words", "bits_words", "gap_words", "wall_words"]


def wall_words(place: ThinPlace, material: str, machine: Printer, unlisted: int) -> Finding:
    """Say where the part as a whole is thinner than the minimum wall."""
    message = (
        f"{material}: a wall of {place.size_mm:.2f} mm{_at(place)} is below the minimum wall of "
        f"{machine.minimum_wall_mm:g} mm; thicken the part there{_more(unlisted, 'walls')}"
    )
    return Finding("thin-wall", message, material, place.place_mm, place.size_mm)


def band_words(
    place: ThinPlace, material: str, field: float, machine: Printer, cure: str, unlisted: int
) -> Finding:
    """Say where a layer of one material is thinner than the minimum feature."""
    limit_mm = machine.minimum_feature_mm
    # Rounded up, so that it is enough
    larger = math.ceil(10.0 * limit_mm / max(place.size_mm, machine.layer_mm)) / 10.0
    message = (
        f"{material}: a layer of {place.size_mm:.2f} mm{_at(place)}, field {field:.3f}, is below "
        f"the smallest feature of {limit_mm:g} mm: it blurs into its neighbours and will not have "
        f"its stiffness; {cure}, or a part {larger:.1f} times as large"
        f"{_more(unlisted, f'places of {material}')}"
    )
    return Finding("thin-band", message, material, place.place_mm, place.size_mm)


def bits_words(bits: Fragments, material: str, machine: Printer, cure: str) -> Finding:
    """Say how many separate bits of a material are smaller than the minimum feature."""
    what = "a separate bit" if bits.count == 1 else f"{bits.count} separate bits, the largest"
    message = (
        f"{material}: {what} of {_size(bits.extent_mm)} mm and {bits.volume_mm3:.2g} mm3 at "
        f"{_place(bits.place_mm)} mm, smaller than the smallest feature of "
        f"{machine.minimum_feature_mm:g} mm, will not print as drawn; {cure}"
    )
    return Finding("fragment", message, material, bits.place_mm, max(bits.extent_mm))


def gap_words(place: ThinPlace, machine: Printer, unlisted: int) -> Finding:
    """Say where empty space is narrower than the minimum feature."""
    message = (
        f"a gap of {place.size_mm:.2f} mm{_at(place)} is narrower than the smallest feature of "
        f"{machine.minimum_feature_mm:g} mm: it will fuse or hold support; widen or close it"
        f"{_more(unlisted, 'gaps')}"
    )
    return Finding("gap", message, None, place.place_mm, place.size_mm)


def _at(place: ThinPlace) -> str:
    return f" at {_place(place.place_mm)} mm over {_size(place.extent_mm)} mm"


def _place(place_mm: Sequence[float]) -> str:
    return "(" + ", ".join(f"{coordinate:.2f}" for coordinate in place_mm) + ")"


def _size(extent_mm: Sequence[float]) -> str:
    return " x ".join(f"{length:.2f}" for length in extent_mm)


def _more(unlisted: int, what: str) -> str:
    return f"; and {unlisted} more {what}" if unlisted else ""
