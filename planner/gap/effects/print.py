"""Effects of the print: mixture, law, interfaces, orientation, section and skin."""

import math
from collections.abc import Sequence

import numpy as np
from scipy.special import erfc

from planner.gap.diagnosis import FoundEffect
from planner.gap.effect import Values, kept_below, place_on_palette
from planner.numerics import FloatArray
from planner.simulation.bar import ProfileDesign
from planner.simulation.bar_solver import Setup

# ------------------------------------------------------------------------------------------------
# Composition offset: the machine jets another mixture than was asked for.


_WIDTH = 0.3
"""Of the range over which mixtures are off that much. Chosen: a few neighbours of ten mixtures."""


def _shifted(setup: Setup, shift: FloatArray) -> Setup:
    """Move slices by shares of the palette's range, (S,), ever less where its end is near."""
    place = place_on_palette(setup)
    moved = kept_below(shift, np.maximum(np.where(shift > 0.0, 1.0 - place, place), 0.0))
    low, high = setup.coordinate_range
    return setup.with_(coordinate=np.clip(setup.coordinate + (high - low) * moved, low, high))


def _constant(setup: Setup, values: Values) -> Setup:
    """All mixtures alike, but for the palette's ends."""
    return _shifted(setup, np.full(len(setup.coordinate), values["shift"]))


def _dot_gain(setup: Setup, values: Values) -> Setup:
    """Mixtures, but not their pure parts: droplets of one spread over the other's."""
    place = place_on_palette(setup)
    return _shifted(setup, 4.0 * values["shift"] * place * (1.0 - place))


def _hard_jets(setup: Setup, values: Values) -> Setup:
    """Move mixtures the more, the more hard resin was asked for."""
    return _shifted(setup, values["shift"] * place_on_palette(setup))


def _graded(setup: Setup, values: Values) -> Setup:
    """Most for the mixtures about one place on the palette."""
    away = (place_on_palette(setup) - values["peak"]) / _WIDTH
    return _shifted(setup, values["shift"] * np.exp(-(away**2)))


# ------------------------------------------------------------------------------------------------
# Material law: the palette's law of one material is off, by a factor or more with strain.


def _material_law(
    setup: Setup, values: Values, *, nodes: Sequence[float], peak: FloatArray
) -> Setup:
    """One of the materials at `nodes`; mixtures in part, as their laws are interpolated."""
    hat = np.interp(setup.coordinate, nodes, peak)
    factor, tilt = (values.get(name, 0.0) for name in ("log_factor", "log_tilt"))
    return setup.stiffened(factor * hat).with_(log_tilt=setup.log_tilt + tilt * hat)


# ------------------------------------------------------------------------------------------------
# Interface bleed: droplets of neighbouring mixtures run into each other before they cure.


def _gaussian(distance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Tail, and tail's integral, of a normal density of standard deviation 1, from distances."""
    tail = 0.5 * erfc(distance / np.sqrt(2.0))
    return tail, np.exp(-0.5 * distance**2) / np.sqrt(2.0 * np.pi) - distance * tail


def _exponential(distance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Tail, and tail's integral, of a two-sided exponential of mean distance 1."""
    tail = 0.5 * np.exp(-distance)
    return tail, tail


def _droplet(distance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Tail, and tail's integral, of a parabola, the section of a cap, of half-width 1."""
    inside = np.minimum(distance, 1.0)
    left = 1.0 - inside
    return 0.25 * left**2 * (2.0 + inside), left**3 * (3.0 + inside) / 16.0


def _corners(design: ProfileDesign) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Places of a design's steps and bends, with the step of its coordinate and of its slope.

    Beyond the gauge a bar goes on as it ends.
    """
    x = design.x_mm
    run, rise = np.diff(x), np.diff(design.coordinate)
    step = run <= 1e-9 * x[-1]
    slope = np.where(step, 0.0, rise / np.where(step, 1.0, run))
    place = np.concatenate([x, x[:-1][step]])
    bend = np.concatenate([np.diff(slope, prepend=0.0, append=0.0), np.zeros(int(step.sum()))])
    jump = np.concatenate([np.zeros(len(x)), rise[step]])
    used = (bend != 0.0) | (jump != 0.0)
    return place[used], jump[used], bend[used]


_KERNELS = {"gaussian": _gaussian, "exponential": _exponential, "droplet": _droplet}


def _bled(setup: Setup, values: Values, *, kernel: str) -> Setup:
    """Bars take the exact convolution of their designs with a kernel.

    Convolution turns a unit step at distance r into one that is off by the kernel's tail beyond
    |r|, and a bend into one that is off by the tail's integral.
    """
    length_mm = values["length"]
    if length_mm <= 0.0:
        return setup
    coordinate = setup.coordinate.copy()
    for test, design in enumerate(setup.designs):
        if design is None:
            continue
        place, jump, bend = _corners(design)
        slices = slice(setup.first_slice[test], setup.first_slice[test + 1])
        from_corner = setup.x_mm[slices, None] - place
        tail, integral = _KERNELS[kernel](np.abs(from_corner) / length_mm)
        coordinate[slices] += (-np.sign(from_corner) * tail) @ jump
        coordinate[slices] += length_mm * (integral @ bend)
    return setup.with_(coordinate=np.clip(coordinate, *setup.coordinate_range))


def _wide_bands(found: FoundEffect, width_mm: float, thickness_mm: float) -> str:
    length = next(iter(found.parameters.values()))
    reach = {"gaussian": 2.0, "exponential": 2.0}.get(found.form, 1.0) * length
    return (
        f"interface-bleed: mixtures run into each other over about {reach:.2f} mm to either side "
        "of a boundary, which is a property of the design, not of a palette: keep bands wider "
        f"than {2.0 * reach:.2f} mm, and draw steps as ramps where it matters"
    )


# ------------------------------------------------------------------------------------------------
# Orientation: swaths and layers make a part stiffer along some directions of the tray.


def _along(setup: Setup, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> FloatArray:
    """Pick each test's number by its direction, less that of the palette's own, on slices."""
    numbers = np.array([x, y, z])
    start = numbers["xyz".index(setup.reference.orientation or "x")]
    return setup.on_slices(numbers[setup.orientation] - start)


_GROWTH = 0.5
"""Of a change with strain, of itself. Chosen: from small strains to large ones it may double or
vanish, within two deviations."""


def _stiffer_along(setup: Setup, values: Values, *, axis: str, growth: float = _GROWTH) -> Setup:
    """One direction against the other two, perhaps growing with strain."""
    change = _along(setup, **{axis: values["change"]})
    tilt = growth * values.get("growth", 0.0) * change
    return setup.stiffened(change).with_(log_tilt=setup.log_tilt + tilt)


def _three_way(setup: Setup, values: Values) -> Setup:
    """All three directions differ, y between x and z or a little beyond."""
    change = values["change"]
    return setup.stiffened(_along(setup, y=values["part"] * change, z=change))


# ------------------------------------------------------------------------------------------------
# Cross-section: jetted parts print larger or smaller than drawn, and with rounded edges.


_LEAST = 0.1
"""Share of the drawn size below which none shrinks. Numerical: a section must be left; no print is
off by so much."""


def _sizes_mm(setup: Setup) -> dict[str, FloatArray]:
    """Return width and thickness as drawn, (S,); a bar's design goes before the test's own size."""
    drawn = {"width": setup.width_mm, "thickness": setup.thickness_mm}
    sizes = {side: setup.on_slices(size) for side, size in drawn.items()}
    for test, design in enumerate(setup.designs):
        slices = slice(setup.first_slice[test], setup.first_slice[test + 1])
        for name, size in sizes.items():
            along = getattr(design, f"{name}_mm", None)
            if design is not None and along is not None:
                size[slices] = np.interp(setup.x_mm[slices], design.x_mm, along)
    return sizes


def _grown(setup: Setup, values: Values, *, sides: Sequence[str]) -> Setup:
    """Larger than drawn in width, thickness or both."""
    drawn, more_mm = _sizes_mm(setup), values["oversize"]
    ratio = np.prod([np.maximum(1.0 + more_mm / drawn[s], _LEAST) for s in sides], axis=0)
    return setup.with_(area_mm2=setup.area_mm2 * ratio)


def _rounded(setup: Setup, values: Values) -> Setup:
    """Four corners rounded, at most to a half circle of the smaller size."""
    width, thickness = _sizes_mm(setup).values()
    half = 0.5 * np.minimum(width, thickness)
    radius = values["radius"] / (1.0 + (values["radius"] / half) ** 4) ** 0.25
    ratio = 1.0 - (4.0 - np.pi) * radius**2 / (width * thickness)
    return setup.with_(area_mm2=setup.area_mm2 * ratio)


def _draw_smaller(found: FoundEffect, width_mm: float, thickness_mm: float) -> str:
    head = f"{found.id}: the section is other than drawn, which no palette can hold; "
    if found.form == "rounded":
        lost = (4.0 - math.pi) * found.parameters["radius"] ** 2
        return (
            f"{head}corners of {found.parameters['radius']:.2f} mm take {lost:.2f} mm2 off every "
            f"section: draw a section of {width_mm:g} x {thickness_mm:g} mm "
            f"{lost / width_mm:.2f} mm thicker"
        )
    over = found.parameters["oversize"]
    which = {"thickness": "the thickness (across the layers)", "width": "the width"}.get(
        found.form, "width and thickness each"
    )
    return f"{head}draw {which} {abs(over):.2f} mm {'smaller' if over > 0.0 else 'larger'}"


# ------------------------------------------------------------------------------------------------
# Skin: a surface layer, cured or wetted otherwise, that is stiffer or softer than the inside.


def _covered(setup: Setup, values: Values, *, sides: Sequence[str]) -> Setup:
    """Layers lie across width, thickness or both.

    Two skins leave a share of a size inside; such that meet leave nothing, smoothly.
    """
    drawn, depth = _sizes_mm(setup), values["depth"]
    inside = np.prod([1.0 - kept_below(2.0 * depth / drawn[s], 1.0) for s in sides], axis=0)
    return setup.stiffened(np.log1p(math.expm1(values["log_stiffness"]) * (1.0 - inside)))


def _take_off(found: FoundEffect, width_mm: float, thickness_mm: float) -> str:
    depth = found.parameters["depth"]
    excess = math.expm1(found.parameters["log_stiffness"])

    bare = {"faces": width_mm, "edges": thickness_mm}
    sizes_mm = [size for form, size in bare.items() if form != found.form]

    def stress_factor(scale: float) -> float:
        inside = math.prod(max(1.0 - 2.0 * depth / (size * scale), 0.0) for size in sizes_mm)
        return 1.0 + excess * (1.0 - inside)

    return (
        f"skin: a layer of {depth:.2f} mm bears {1.0 + excess:.2f} times the inside's stress, so "
        "the stiffness goes with the size of the section, which no palette can hold: about "
        f"{stress_factor(1.0):.2f} times the law's at {width_mm:g} x {thickness_mm:g} mm, "
        f"{stress_factor(3.0):.2f} times at three times that; divide the target by the factor of "
        "your section, or take the skin off"
    )
