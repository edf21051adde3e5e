"""What a verdict means where no palette can hold it: what to do instead, with figures."""

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType

from planner.gap.diagnosis import FoundEffect

__all__ = ["TEST_EFFECTS", "instead"]

TEST_EFFECTS = (
    "force-offset", "force-scale", "grip-slack", "grip-slip", "machine-compliance", "strain-scale",
)  # fmt: skip
"""Effects of the test itself: what was printed is as predicted, what was read is not."""

_TEST: Mapping[str, str] = MappingProxyType(
    {
        "force-offset": "zero the load cell before every test, or take the offset off the curves",
        "force-scale": "check the load cell's calibration and the unit of force, and divide the "
        "curves by the factor",
        "grip-slack": "take the toe off the curves, or start at a small preload",
        "grip-slip": "grip harder, or read the strain from the specimen, not from the grips",
        "machine-compliance": "take compliance times force off the travel, or read the strain "
        "from the specimen",
        "strain-scale": "measure the gauge length that strains, and divide the travel by it",
    }
)


def instead(found: FoundEffect, width_mm: float, thickness_mm: float) -> str:
    """Return a sentence on an effect that a palette cannot hold.

    Parameters
    ----------
    width_mm, thickness_mm
        Of the section that figures are given for.
    """
    if found.id in TEST_EFFECTS:
        return (
            f"{found.id}: the print was right, the measurement was off ({_figures(found)}); the "
            f"palette stays as it is: {_TEST[found.id]}, and diagnose again"
        )
    return _OTHERS[found.id](found, width_mm, thickness_mm)


def _figures(found: FoundEffect) -> str:
    return ", ".join(
        f"{name} {value:.3g}{'' if (u := found.units.get(name, '1')) == '1' else ' ' + u}"
        for name, value in found.parameters.items()
    )


def _section(found: FoundEffect, width_mm: float, thickness_mm: float) -> str:
    head = f"{found.id}: the section is other than drawn, which no palette can hold; "
    if found.form == "rounded":
        lost = (4.0 - math.pi) * found.parameters["radius"] ** 2
        return (
            f"{head}corners of {found.parameters['radius']:.2f} mm take {lost:.2f} mm2 off every "
            f"section: draw a section of {width_mm:g} x {thickness_mm:g} mm "
            f"{lost / width_mm:.2f} mm thicker"
        )
    over = found.parameters["oversize"]
    which = {
        "thickness": "the thickness (across the layers)",
        "width": "the width",
    }.get(found.form, "width and thickness each")
    return f"{head}draw {which} {abs(over):.2f} mm {'smaller' if over > 0.0 else 'larger'}"


def _skin(found: FoundEffect, width_mm: float, thickness_mm: float) -> str:
    depth = found.parameters["depth"]
    excess = math.expm1(found.parameters["log_stiffness"])

    def stress_factor(scale: float) -> float:
        inside = 1.0
        if found.form != "faces":
            inside *= max(1.0 - 2.0 * depth / (width_mm * scale), 0.0)
        if found.form != "edges":
            inside *= max(1.0 - 2.0 * depth / (thickness_mm * scale), 0.0)
        return 1.0 + excess * (1.0 - inside)

    return (
        f"skin: a layer of {depth:.2f} mm bears {1.0 + excess:.2f} times the inside's stress, so "
        "the stiffness goes with the size of the section, which no palette can hold: about "
        f"{stress_factor(1.0):.2f} times the law's at {width_mm:g} x {thickness_mm:g} mm, "
        f"{stress_factor(3.0):.2f} times at three times that; divide the target by the factor of "
        "your section, or take the skin off"
    )


def _bleed(found: FoundEffect, width_mm: float, thickness_mm: float) -> str:
    length = next(iter(found.parameters.values()))
    reach = {"gaussian": 2.0, "exponential": 2.0}.get(found.form, 1.0) * length
    return (
        f"interface-bleed: mixtures run into each other over about {reach:.2f} mm to either side "
        "of a boundary, which is a property of the design, not of a palette: keep bands wider "
        f"than {2.0 * reach:.2f} mm, and draw steps as ramps where it matters"
    )


def _unloading(found: FoundEffect, width_mm: float, thickness_mm: float) -> str:
    return (
        f"{found.id} ({_figures(found)}): it changes what follows the first loading alone; the "
        "law, which is the first loading's, stays as it is; a part that is used over and over is "
        "softer than planned below its largest strain so far"
    )


_OTHERS: Mapping[str, Callable[[FoundEffect, float, float], str]] = MappingProxyType(
    {
        "cross-section": _section,
        "skin": _skin,
        "interface-bleed": _bleed,
        "softening": _unloading,
        "permanent-set": _unloading,
    }
)
