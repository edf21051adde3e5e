"""The main job: part + gradient + palette -> Plan."""

import contextlib
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from planner import __version__
from planner.cutting.grid import default_pitch_mm
from planner.errors import (
    ArgumentError,
    Caution,
    PlannerError,
    ThinBandError,
    as_count,
    as_number,
    check_known,
    positive,
)
from planner.fields.basic import Field, PlanarField, axis_field
from planner.fields.parse import Setting, TableFile, build_field
from planner.grading.check import plan_checks
from planner.grading.dither import CellDesign, cell_design
from planner.grading.howto import with_howto
from planner.grading.printability import WITHIN_MM, CutPart
from planner.grading.profile import (
    AS_SHOWN,
    Band,
    Profile,
    StiffnessScale,
    natural_bands,
    stiffness_scale,
)
from planner.grading.regions import BandDesign, band_design, blend_segments, error_text, shells_of
from planner.grading.snap import snap_limit_mm, snapped_bands
from planner.grading.wish import End, Wish, Wished, targets_of
from planner.materials.mixtures import TwoPhases
from planner.mesh.mesh import Mesh, join_shells
from planner.mesh.part import Part, moved_to_corner, open_part
from planner.numerics import FloatArray, Point, as_point, numbers_in
from planner.palette import Palette
from planner.plan import (
    Check,
    Finding,
    Gradient,
    PaletteUsed,
    PartGraded,
    Plan,
    Region,
    Stiffness,
    Unreachable,
    decode_plan,
)
from planner.printers import Printer, load_printer, palette_of

__all__ = ["grade"]


# ------------------------------------------------------------------------------------------------
# What ``--blend`` says.


_BLENDS = ("nearest", "dither", "bands:N", "mix")
_MOST_PERIODS = 1000


def _blend_of(text: object) -> tuple[str, int]:
    """Read what a user wrote: a way to meet a target between two materials, and N of ``bands:N``.

    Raises
    ------
    ArgumentError
        No such blend, or N out of range.
    """
    if isinstance(text, str) and text.startswith("bands:"):
        word = text.removeprefix("bands:")
        periods = next(iter(numbers_in([word], int)), word)
        return "bands", as_count(periods, f"`blend` {text}: N", _MOST_PERIODS)
    check_known(str(text), _BLENDS, f"`blend` {text}: no such blend; {{}}it takes")
    return str(text), 0


_MOST_BANDS = 10_000


def _design_pieces(
    blend: tuple[str, int], mesh: Mesh, field: Field, target: Profile, scale: StiffnessScale,
    machine: Printer, *, bands: int | None, cell_mm: float | None,
) -> BandDesign | CellDesign:  # fmt: skip
    """Decide what each place of a part is printed in.

    Parameters
    ----------
    bands
        Equal steps of the field, with ``nearest`` and ``mix``.
    cell_mm
        Edge of a cell, with ``dither``.

    Raises
    ------
    ArgumentError
        Options that do not go together or are out of range; too many cells.
    """
    kind, periods = blend
    if bands is not None and kind in ("dither", "bands"):
        raise ArgumentError(
            f"`bands` {bands}: it goes with `blend` nearest or mix"
            + ("; write `blend` bands:N for N periods" if kind == "bands" else "")
        )
    if cell_mm is not None and kind != "dither":
        raise ArgumentError(f"`cell_mm` {cell_mm:g}: it goes with `blend` dither")
    if kind == "dither":
        return cell_design(mesh, field, target, scale, machine, cell_mm)
    return band_design(kind, target, scale, machine, count=bands, periods=periods)


# ------------------------------------------------------------------------------------------------
# The main job: part + gradient + palette -> Plan.


_FEWEST_CELLS = 5
"""Along a part's longest side, if their size is stated. Chosen: of fewer, some materials of a round
field have none of a cell's corners, and no check can tell."""

_UNCALIBRATED = (
    "mixtures need a printer that jets them, as {printer} may not; their ratios are not calibrated"
)


def grade(
    part: object,
    *,
    like: str | Path | Plan | None = None,
    from_: End | None = None,
    to: End | None = None,
    axis: str | tuple[float, float, float] | None = None,
    profile: Wished | None = None,
    bands: int | None = None,
    field: str | Field | TableFile | Callable[[FloatArray], FloatArray] | None = None,
    pitch_mm: float | None = None,
    blend: str | None = None,
    cell_mm: float | None = None,
    snap_mm: float | None = None,
    at_strain: float | None = None,
    tolerance: float | None = None,
    printer: str | Path | Printer | None = None,
    palette: str | Path | Palette | None = None,
    unit: str | None = None,
    bodies: str | None = None,
    name: str | None = None,
    coupons: bool = False,
    force_oversize: bool = False,
    progress: Callable[[str], None] | None = None,
) -> Plan:
    """Plan the print of a part whose stiffness follows a gradient.

    Parameters
    ----------
    part
        Path of a mesh file, a mesh with ``vertices`` and ``faces`` (such as ``trimesh.Trimesh``),
        or a pair (vertices, faces) in `unit`.
    like
        An earlier plan, its plan.json or its folder: its targets in MPa are to be met again, with
        another palette. What else is not stated is as it was there: field, profile, blend, bands,
        strain, tolerance, printer and unit.
    from_, to
        What stands at the beginning and the end of the gradient: a material by id, alias or
        unique prefix; or a modulus, in MPa or as text with its unit, ``"500kPa"``. Not needed
        with `like`, or with a profile file, which names its own targets.
    axis
        Direction of the gradient: ``x``, ``-z``, ``"1,0,1"`` or three numbers; the part's longest
        extent by default.
    profile
        ``log`` (by default), ``linear``, ``smooth``, ``steps:N``, ``grades`` (an equal length of
        each material from the one nearest to `from_` to that nearest to `to`), a CSV file, or a
        `Profile`. Also rows of (position, modulus), positions rising from 0 to 1, moduli as
        `from_` and `to`; or a function of the position that returns MPa. What is not a name has
        its own targets.
    bands
        Cut into so many equal steps of the field, with `blend` ``nearest`` or ``mix``; by default
        the cuts lie where the nearest material, or the mixture, changes.
    field
        What the gradient follows instead of an axis: text such as
        ``"radial: point=0 0 5, to=12"``; a function of points (n, 3) in the part's coordinates
        that returns values from 0 to 1; or any `Field` over the part as placed for printing.
    pitch_mm
        Of the cells in which curved level sets are drawn, all alike; without it they are divided
        until interfaces lie within 20 um of the field.
    blend
        How a target between two materials is met: ``nearest``, by default, takes the nearer one;
        ``dither`` deals cells of both, as many of each as the target needs; ``bands:N`` lets N
        pairs of thinner bands take turns from one material to the next; ``mix`` records mixtures,
        for printers that jet them.
    cell_mm
        Edge of the cells that ``dither`` deals; by default the printer's minimum feature, larger
        where a large part would have more of them than can be computed with.
    snap_mm
        How far a cut may be moved so that no sliver is left between it and a face of the part
        that lies alongside; half the printer's minimum wall by default, 0 for not at all. Of
        `blend` ``nearest`` and ``mix``.
    at_strain
        Working strain of the secant modulus; 0.1 by default.
    tolerance
        Largest ratio between target and achieved modulus, either way, that is no finding, as 1.25;
        or below 1 a share, as 0.25 for 25 %; 2 by default. It is the limit of the check
        ``worst_stiffness_error``.
    printer, palette
        By name, file or value; the Connex3 and the printer's default palette if not given.
    unit
        Unit of the part's figures; mm unless the file says otherwise.
    bodies
        What bodies of the part are whose winding does not tell, where its volume depends on it:
        ``cavities``, taken away from the solids around them; or ``solids``: then every body is
        one, whichever way it is wound, and all are united.
    name
        Name of the part; its file's stem by default.
    coupons
        Lay a tensile coupon of each material beside the part: further files of the folder.
    force_oversize
        Plan a part that the printer's tray does not hold, whichever way it is turned by right
        angles: a finding then, an error otherwise.
    progress
        Called with the name of each stage as it begins.

    Returns
    -------
    Plan
        `Plan.write` puts it on disk. `Plan.ok` is false when something was found.

    Raises
    ------
    PlannerError
        Bad input, with what to do about it.

    Examples
    --------
    >>> plan = planner.grade("finger.stl", from_="Tango", to="Vero", axis="x")  # doctest: +SKIP
    >>> plan.write("finger-graded")  # doctest: +SKIP
    """
    stated = Wish(
        start=from_, end=to, profile=profile, axis=axis, field=field,
        pitch_mm=None if pitch_mm is None else positive(pitch_mm, "`pitch_mm`"),
        bands=None if bands is None else as_count(bands, "`bands`", _MOST_BANDS),
        blend=blend,
        cell_mm=None if cell_mm is None else positive(cell_mm, "`cell_mm`"),
        at_strain=None if at_strain is None else as_number(at_strain, "`at_strain`"),
        tolerance=None if tolerance is None else as_number(tolerance, "`tolerance`"),
        printer=printer, palette=palette, unit=unit,
    )  # fmt: skip
    wish, earlier = stated.whole(like)
    assert wish.printer is not None
    assert wish.at_strain is not None
    assert wish.tolerance is not None
    machine = load_printer(wish.printer)
    by = _blend_of(wish.blend)
    scale = stiffness_scale(palette_of(wish.palette, machine), wish.at_strain)
    target, start, end = targets_of(wish, scale)
    limit = _tolerated_ratio(wish.tolerance)
    farthest_mm = snap_limit_mm(snap_mm, machine)

    tell = progress or (lambda stage: None)
    tell("reading the part")
    source = open_part(
        part, unit=wish.unit, name=name, tray_mm=machine.tray_mm, bodies=bodies,
        oversize=force_oversize,
    )  # fmt: skip
    mesh, translation = moved_to_corner(source.mesh)
    coarsest_mm = float(np.ptp(mesh.bounds_mm, axis=0).max()) / _FEWEST_CELLS
    if wish.pitch_mm is not None and wish.pitch_mm > coarsest_mm:
        raise ArgumentError(
            f"`pitch_mm` {wish.pitch_mm:g}: cells so large miss what a field does within the part; "
            f"it must be {coarsest_mm:.2g} mm or less, a fifth of the longest side"
        )
    pitch_mm = default_pitch_mm(mesh) if wish.pitch_mm is None else wish.pitch_mm
    if wish.field is None:
        along: Field = axis_field(wish.axis, mesh)
    else:
        tell("building the field")
        along = build_field(wish.field, Setting(mesh, as_point(translation), pitch_mm))

    tell("cutting the shells")
    design = _design_pieces(
        by, mesh, along, target, scale, machine, bands=wish.bands, cell_mm=wish.cell_mm
    )
    moved: Sequence[Mapping[str, float]] = ()
    if isinstance(design, BandDesign):
        if not design.periods:
            bands_now, moved = snapped_bands(
                mesh, along, design.bands, target, snap_mm=farthest_mm, machine=machine
            )
            design = replace(design, bands=bands_now)
        _check_thickness(along, design.bands, bool(design.periods), machine, source.warnings)
    within_mm = WITHIN_MM if wish.pitch_mm is None else math.inf
    pieces = design.cut(mesh, along, pitch_mm, within_mm)
    shells = tuple(shells_of(pieces, design.printed, scale, machine, source.name))
    regions = tuple(design.regions(pieces, shells, scale))

    tell("looking for what will not print")
    cut = CutPart(mesh, along, pieces, pitch_mm, within_mm, as_point(translation), np.empty(0))
    printing, findings, cautions = design.held(cut, shells, scale, machine)
    known = (*_idle(stated.pitch_mm, along, regions, target, scale), *_remarks(scale, regions))
    stiffness, off, others = _stiffness_check(
        regions, limit, target, scale, blend=by[0],
        nearest=_to_nearest(wish.bands, stated.bands, bool(moved)),
    )  # fmt: skip
    followed = () if earlier is None else earlier.remarks(source.sha256)
    mixed = any(what.material is None for what in design.printed)
    unsure = (_UNCALIBRATED.format(printer=machine.title),) if mixed else ()
    described = dict(along.description())
    if not isinstance(along, PlanarField):
        described["pitch_mm"] = pitch_mm
        if math.isfinite(within_mm):
            described["within_mm"] = within_mm
    plan = Plan(
        schema=1,
        version=__version__,
        printer=machine.name,
        voxel_mm=_own_voxel_mm(machine),
        palette=PaletteUsed(scale.palette.name, scale.palette.sha256),
        part=_part_graded(source, as_point(translation)),
        gradient=Gradient(
            described,
            target.description(),
            start,
            end,
            wish.bands,
            design.says,
            None if earlier is None else earlier.says,
            {"limit_mm": farthest_mm, "moved": moved} if moved else None,
        ),
        stiffness=Stiffness("secant-nominal", scale.at_strain, alternatives=others),
        regions=regions,
        checks={"worst_stiffness_error": stiffness, **printing},
        findings=(*off, *findings),
        warnings=(*map(Caution, (*source.warnings, *followed, *unsure, *cautions)), *known),
        unreachable=_unreachable(target, scale),
        shells=shells,
    )
    tell("verifying the shells")
    return with_howto(_verified(plan, mesh), mesh, machine, scale, known, coupons=coupons)


def _own_voxel_mm(machine: Printer) -> Point | None:
    """Return the edges of a printer's voxel, unless its name alone tells them."""
    own = (*machine.pixel_mm, machine.layer_mm)
    with contextlib.suppress(PlannerError):
        named = load_printer(machine.name)
        return None if (*named.pixel_mm, named.layer_mm) == own else own
    return own


def _verified(plan: Plan, placed: Mesh) -> Plan:
    """Add the checks that ``planner check`` makes of a plan's files, and what does not hold."""
    as_read = decode_plan(plan.json(), "plan.json")
    shells = join_shells((each.vertices, each.faces.astype(np.int32)) for each in plan.shells)
    checks, problems = plan_checks(as_read, [shell.file for shell in plan.shells], shells, placed)
    if not problems:
        del checks["plan_disagreements"]  # a plan that is what its files are does not say so
    findings = [Finding(kind="disagreement", message=problem) for problem in problems]
    if not checks["volume_error"].ok:
        findings.append(_volume_finding(checks["volume_error"], placed))
    return replace(plan, checks={**checks, **plan.checks}, findings=(*plan.findings, *findings))


def _volume_finding(check: Check, placed: Mesh) -> Finding:
    """Say why shells have not the part's volume: rounding moves walls by steps of float32."""
    farthest_mm = float(placed.bounds_mm.max())
    step_mm = float(np.spacing(np.float32(farthest_mm)))
    wall_mm = 2.0 * placed.volume_mm3 / placed.area_mm2  # were it a plate
    message = (
        f"the shells have {check.value:.2g} of the part's volume too much or too little, over "
        f"{check.limit:g}: mesh files hold places in steps of {1e6 * step_mm:.2g} nm at "
        f"{farthest_mm:.0f} mm, which is much for walls of {wall_mm:.2g} mm; lay flat walls along "
        "the axes, or make them thicker"
    )
    return Finding(kind="volume", message=message, size_mm=wall_mm)


def _remarks(scale: StiffnessScale, regions: Sequence[Region]) -> tuple[str, ...]:
    """Return what to know of the moduli of the grades that the regions are printed in."""
    lower, upper, t = scale.model.bracket([region.coordinate for region in regions])
    used = {*lower.tolist(), *np.where(t > 0.0, upper, lower).tolist()}
    return scale.remarks({scale.palette.materials[k].id for k in used})


def _idle(
    pitch_mm: float | None, field: Field, regions: Sequence[Region], target: Profile,
    scale: StiffnessScale,
) -> Iterator[Caution]:  # fmt: skip
    """Yield what was asked for and does nothing."""
    if pitch_mm is not None and isinstance(field, PlanarField):
        yield Caution(f"cells of {pitch_mm:g} mm do nothing: along an axis a cut is a plane")
    if outside := field.description().get("outside"):
        yield Caution(
            f"{100.0 * float(str(outside)):.0f} % of the part lies outside "
            f"{field.description()['file']}: there its nearest values hold"
        )
    low, high = regions[0].field[0], regions[-1].field[1]
    one = len({region.printed for region in regions}) == 1 and high - low < 1.0
    if one and len(natural_bands(target, scale.moduli_MPa)) > 1:
        yield Caution(
            f"all of the part is {regions[0].printed}: it lies within {low:.3g} to {high:.3g} of a "
            "gradient from 0 to 1; check where the field begins and ends"
        )


def _check_thickness(
    field: Field, bands: tuple[Band, ...], periods: bool, machine: Printer,
    warnings: tuple[str, ...],
) -> None:  # fmt: skip
    """Refuse bands thinner than the printer's layer, where the field has a length."""
    span_mm = field.description().get("span_mm")
    if not isinstance(span_mm, float):
        return
    thinnest = min(bands, key=lambda band: band.stop - band.start)
    thickness_mm = (thinnest.stop - thinnest.start) * span_mm
    if thickness_mm < machine.layer_mm * (1.0 - 1e-9):  # so many equal ones are thin by rounding
        fit = int(span_mm / machine.layer_mm)
        unit = next((w.replace("--unit", "`unit`") for w in warnings if "--unit" in w), None)
        fewer = "take fewer periods" if periods else f"take `bands` {fit} or fewer"
        advice = f"{fewer}, or a gentler profile" if fit else "the part is too small; check `unit`"
        raise ThinBandError(
            f"a band of {1000 * thickness_mm:.3g} um at field {thinnest.start:.6g} is thinner than "
            f"a layer of {machine.title}, {1000 * machine.layer_mm:g} um, on a gradient of "
            f"{span_mm:.4g} mm; {unit or advice}"
        )


def _part_graded(source: Part, translation_mm: Point) -> PartGraded:
    mesh = source.mesh
    return PartGraded(
        name=source.name,
        file=source.file,
        sha256=source.sha256,
        unit=source.unit,
        volume_mm3=mesh.volume_mm3,
        area_mm2=mesh.area_mm2,
        bounds_mm=(as_point(mesh.bounds_mm[0]), as_point(mesh.bounds_mm[1])),
        triangles=len(mesh.faces),
        translation_mm=translation_mm,
        repairs=source.repairs,
    )


def shortfalls(profile: Profile, moduli_MPa: tuple[float, ...]) -> tuple[Band, ...]:
    """Find where the target lies below the softest or above the hardest material: the nearest."""
    ends = softest, hardest = moduli_MPa[0], moduli_MPa[-1]
    found = []
    for start, stop, (low, high) in profile.stretches(ends, profile.positions):
        if low < softest * (1.0 - AS_SHOWN):
            found.append(Band(start, stop, 0, (low, high)))
        elif high > hardest * (1.0 + AS_SHOWN):
            found.append(Band(start, stop, len(moduli_MPa) - 1, (low, high)))
    return tuple(found)


def _unreachable(target: Profile, scale: StiffnessScale) -> tuple[Unreachable, ...]:
    return tuple(
        Unreachable(
            field=(missed.start, missed.stop),
            target_modulus_MPa=missed.target_MPa,
            nearest=scale.palette.materials[missed.grade].id,
            modulus_MPa=scale.moduli_MPa[missed.grade],
        )
        for missed in shortfalls(target, scale.moduli_MPa)
    )


# ------------------------------------------------------------------------------------------------
# How far what is printed is off the target stiffness, and what another blend would make of it.
#
# An error is a ratio, 1 or more: achieved over target where what is printed is too stiff, target
# over achieved where it is too soft. A ratio of 2 is as bad either way.


_ROUNDING = 1e-9
"""Relative: a stated tolerance is often the error that an earlier plan told, as printed."""

_LARGEST = 1e6
"""Of a tolerance; a palette from rubber to glass spans less."""


def _tolerated_ratio(stated: float) -> float:
    """Return the largest ratio that is no finding.

    Parameters
    ----------
    stated
        The ratio, as 1.25; or, below 1, by what share the stiffness may be too large, as 0.25.

    Raises
    ------
    ArgumentError
        Below 0, or so large that nothing could miss it.
    """
    if not 0.0 <= stated <= _LARGEST:
        raise ArgumentError(
            f"`tolerance` {stated:g}: it must be from 0 to {_LARGEST:g}: a ratio, as 1.25, or "
            "below 1 a share, as 0.25 for 25 %"
        )
    return stated if stated >= 1.0 else 1.0 + stated


def _stiffness_check(
    regions: Sequence[Region], limit: float, target: Profile, scale: StiffnessScale, *,
    blend: str, nearest: str,
) -> tuple[Check, tuple[Finding, ...], dict[str, float]]:  # fmt: skip
    """Hold the stiffness of all regions against what was wanted there.

    Parameters
    ----------
    limit
        Of `_tolerated_ratio`.
    blend
        How targets between two materials are met.
    nearest
        The option by which all places get the nearest material, if they have it not.

    Returns
    -------
    check : Check
        The worst ratio of all regions, with its limit.
    findings : tuple of Finding
        Where the worst is, and what would make it smaller; empty where the check holds.
    others : dict
        The worst ratio that other options would leave, where it is smaller. Of cells of two
        materials it is the error of their homogenised modulus; each cell by itself is one of the
        two.
    """
    worst = max(regions, key=_region_error)
    ratio, moduli = _region_error(worst), scale.moduli_MPa
    between = [s for s in blend_segments(target, moduli) if s.lower < s.upper]
    shares = (TwoPhases(moduli[s.lower], moduli[s.upper]).dither_error for s in between)
    beyond = _worst_of(shortfalls(target, moduli), moduli)
    cells = max([beyond, *(1.0 / (1.0 - share) for share in shares)])
    found = {} if blend == "dither" else {"with --blend dither": cells}
    if blend == "nearest" and nearest:
        found = {nearest: _worst_of(natural_bands(target, moduli), moduli), **found}
    others = {option: error for option, error in found.items() if error < ratio * (1.0 - 1e-6)}
    check = Check(ratio, limit, ratio <= limit * (1.0 + _ROUNDING))
    if check.ok:
        return check, (), others
    low, high = worst.target_modulus_MPa
    better = [f"{option} it is {error_text(error)}" for option, error in others.items()]
    message = (
        f"{worst.printed}: {worst.modulus_MPa:.3g} MPa where {low:.3g} .. {high:.3g} MPa is "
        f"wanted, at field {worst.field[0]:.3f} .. {worst.field[1]:.3f}: the stiffness is off by "
        f"up to {error_text(ratio)}, more than the tolerance, {error_text(limit)}; "
        + "; ".join([*better, f"--tolerance {_rounded_up(ratio):g} accepts it"])
    )
    return check, (Finding("stiffness", message, worst.material),), others


def _to_nearest(bands: int | None, stated: int | None, moved: bool) -> str:
    """Return the option that undoes equal bands, or cuts that were moved off the part's faces."""
    if bands is not None:  # an earlier plan's go where a blend is stated
        return "with --blend nearest" if stated is None else "without --bands"
    return "with --snap 0" if moved else ""


def _region_error(region: Region) -> float:
    """Return by what ratio a region is off its target, at its worst place."""
    return max(1.0 + region.error[1], 1.0 / (1.0 + region.error[0]))


def _worst_of(bands: Sequence[Band], moduli: Sequence[float]) -> float:
    """Return the worst ratio of target and modulus in bands; 1 of none."""
    ratios = ((moduli[b.grade] / b.target_MPa[0], b.target_MPa[1] / moduli[b.grade]) for b in bands)
    return max((ratio for each in ratios for ratio in each), default=1.0)


def _rounded_up(value: float) -> float:
    """Return two significant digits that are not below a value."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return math.ceil(value / unit - 1e-9) * unit
