"""The main job: part + gradient + palette -> Plan."""

import hashlib
import math
import unicodedata
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from os import PathLike, fspath
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from planner import __version__
from planner.cutting.grid import default_pitch_mm
from planner.cutting.pieces import Pieces, split
from planner.errors import (
    ArgumentError,
    Caution,
    MeshError,
    ThinBandError,
    as_count,
    as_number,
    did_you_mean,
    positive,
)
from planner.fields.basic import Field, PlanarField, axis_field
from planner.fields.parse import Setting, TableFile, build_field
from planner.formats.mesh_file import decode_stl, read_mesh, stl_holds
from planner.formats.units import QUANTITY_UNITS, canonical_unit
from planner.grading.check import plan_checks
from planner.grading.dither import (
    CellCounts,
    DitherField,
    affordable_cells,
    count_cells,
    dither_pieces,
    dither_regions,
    fraction_checks,
)
from planner.grading.howto import with_howto
from planner.grading.printability import WITHIN_MM, CutPart, print_checks
from planner.grading.profile import (
    Band,
    Profile,
    StiffnessScale,
    equal_bands,
    natural_bands,
    shortfalls,
    stiffness_scale,
)
from planner.grading.regions import (
    MIXTURES_UNCALIBRATED,
    Laminate,
    Printed,
    alternatives,
    blend_segments,
    catalogue_material,
    laminated,
    mixed_bands,
    regions_of,
    shells_of,
    stiffness_check,
    tolerated_ratio,
    with_laminates,
)
from planner.grading.snap import MovedCut, snap_limit_mm, snapped_bands
from planner.grading.wish import End, Wish, Wished, targets_of, whole_wish
from planner.mesh.mesh import Mesh, join_shells, weld
from planner.mesh.part import Part, make_part, oversize, part_from_arrays, place, undersize
from planner.numerics import Float32Array, FloatArray, IntArray, Point, as_point
from planner.palette import Palette
from planner.plan import (
    Check,
    Finding,
    Gradient,
    PaletteUsed,
    PartGraded,
    Plan,
    Region,
    Shell,
    Stiffness,
    Unreachable,
    decode_plan,
)
from planner.printers import Printer, load_printer, palette_of

__all__ = ["grade", "open_part", "refuse_oversize"]


# ------------------------------------------------------------------------------------------------
# Where a part comes from: a file, or a mesh in memory.


@dataclass(frozen=True, slots=True)
class PartSource:
    """A validated part and what a plan says of its origin."""

    part: Part
    name: str
    file: str
    sha256: str
    unit: str
    warnings: tuple[str, ...]


def open_part(
    part: object,
    *,
    unit: str | None = None,
    name: str | None = None,
    tray_mm: tuple[float, float, float] | None = None,
    bodies: str | None = None,
) -> PartSource:
    """Read and validate a part.

    Parameters
    ----------
    part
        Path, mesh with ``vertices`` and ``faces``, or pair (vertices, faces).
    bodies
        See `planner.mesh.part.make_part`.

    Raises
    ------
    MeshError, FileError
        The file or the mesh cannot be used; the message says where and what to do.
    ArgumentError
        Not a path, mesh or pair; or an unknown unit.
    """
    if isinstance(part, (str, PathLike)):
        path = Path(fspath(part))
        file = read_mesh(path, unit)
        called = _safe(path.stem if name is None else name)
        made = make_part(file.triangles, name=called, tray_mm=tray_mm, bodies=bodies)
        asked = None if unit else undersize(made.mesh)
        warnings = (*file.notes, *made.warnings, *([asked] if asked else []))
        shown = path.name.encode("utf-8", "replace").decode("utf-8")  # any bytes make a name
        return PartSource(made, called, shown, file.sha256, file.unit, warnings)
    vertices, faces = _arrays(part)
    used = canonical_unit(unit or "mm")
    in_mm = vertices * QUANTITY_UNITS["length"][used]
    called = _safe(name or "part")
    made = part_from_arrays(in_mm, faces, name=called, tray_mm=tray_mm, bodies=bodies)
    digest = hashlib.sha256(vertices.tobytes() + faces.tobytes()).hexdigest()
    return PartSource(made, called, called, digest, used, made.warnings)


def refuse_oversize(source: PartSource, machine: Printer) -> None:
    """Stop at a part that the printer's tray does not hold, before the work.

    Raises
    ------
    MeshError
        With its size, the tray's, the unit that it looks like, and what to do.
    """
    words = oversize(source.part.mesh, machine.tray_mm, source.unit)
    if words is not None:
        raise MeshError(
            f"{source.file}: {words}; scale or divide the part, or take it as it is with "
            "`force_oversize`"
        )


def _arrays(part: object) -> tuple[FloatArray, IntArray]:
    vertices = getattr(part, "vertices", None)
    faces = getattr(part, "faces", None)
    if vertices is None and isinstance(part, tuple) and len(part) == 2:
        vertices, faces = part
    try:
        return (
            np.ascontiguousarray(vertices, dtype=np.float64),
            np.ascontiguousarray(faces, dtype=np.int64),
        )
    except (TypeError, ValueError):
        raise ArgumentError(
            "a part must be a path, a mesh with vertices (n, 3) and faces (m, 3), or a pair of "
            f"these arrays; got {type(part).__name__}"
        ) from None


def _safe(name: str) -> str:
    """Keep what any file system and any reader of STL headers takes."""
    plain = unicodedata.normalize("NFKD", name)  # an accent becomes a mark of its own
    bare = (c for c in plain if not unicodedata.combining(c))
    kept = "".join(c if c.isascii() and (c.isalnum() or c in "._-") else "-" for c in bare)
    return kept.strip(".-") or "part"


# ------------------------------------------------------------------------------------------------
# What ``--blend`` says.


_BLENDS = ("nearest", "dither", "bands:N", "mix")
_MOST_PERIODS = 1000


@dataclass(frozen=True, slots=True)
class BlendChoice:
    """A way to meet a target between two materials.

    Attributes
    ----------
    periods
        Of ``bands:N``, in each transition; else 0.
    """

    kind: Literal["nearest", "dither", "bands", "mix"]
    periods: int = 0


def _blend_choice(text: object) -> BlendChoice:
    """Read what a user wrote.

    Raises
    ------
    ArgumentError
        No such blend, or N out of range.
    """
    if text == "nearest" or text == "dither" or text == "mix":
        return BlendChoice(text)
    if isinstance(text, str) and text.startswith("bands:"):
        try:
            periods = int(text.removeprefix("bands:"))
        except ValueError:
            periods = 0
        if not 1 <= periods <= _MOST_PERIODS:
            raise ArgumentError(
                f"`blend` {text}: N must be a whole number from 1 to {_MOST_PERIODS}, as in bands:4"
            )
        return BlendChoice("bands", periods)
    hint = did_you_mean(str(text), ["nearest", "dither", "bands:4", "mix"])
    raise ArgumentError(f"`blend` {text}: no such blend; {hint}it takes {', '.join(_BLENDS)}")


# ------------------------------------------------------------------------------------------------
# What to cut a part along, at which levels, and what each piece is printed in.


_MOST_BANDS = 10_000


_Held = tuple[dict[str, Check], tuple[Finding, ...], list[str]]


@dataclass(frozen=True, slots=True, eq=False)
class BandDesign:
    """Bands along a gradient, each of one material or mixture.

    Attributes
    ----------
    bands, printed
        Field and target of each, and what it is printed in.
    says
        What a plan says of how targets between two materials are met, if not by the nearer one.
    periods
        Of each band, where two materials take turns; else empty.
    """

    bands: tuple[Band, ...]
    printed: tuple[Printed, ...]
    says: Mapping[str, object] | None = None
    periods: tuple[Laminate | None, ...] = ()

    @property
    def levels(self) -> FloatArray:
        """Values of the field between bands."""
        return np.array([band.start for band in self.bands[1:]])

    def cut(self, mesh: Mesh, along: Field, pitch_mm: float, within_mm: float) -> Pieces:
        """Divide the part."""
        return split(mesh, along, self.levels, pitch_mm=pitch_mm, within_mm=within_mm)

    def regions(
        self, pieces: Pieces, shells: Sequence[Shell], scale: StiffnessScale
    ) -> tuple[Region, ...]:
        """Report what was cut, with what it comes to together."""
        regions = regions_of(pieces, self.bands, self.printed, shells)
        if self.periods:
            return with_laminates(regions, tuple(zip(self.bands, self.periods, strict=True)), scale)
        return regions

    def _fewer(self, along: Field, machine: Printer) -> str:
        """Say what makes thin bands thicker: equal ones, so many as have room along the field."""
        if self.periods:
            return "take fewer periods (--blend bands:N)"
        span_mm, count = along.description().get("span_mm"), len(self.bands)
        # Equal already, but for cuts that were moved by a tenth of a band at most on either side.
        if np.ptp([band.stop - band.start for band in self.bands]) < 0.41 / count:
            count -= 1
        if isinstance(span_mm, float):
            count = min(count, int(span_mm / machine.minimum_feature_mm))
        return f"take --bands {max(count, 1)} or fewer"

    def held(
        self, part: CutPart, shells: Sequence[Shell], scale: StiffnessScale, machine: Printer
    ) -> _Held:
        """Hold the pieces against the printer."""
        cure = f"{self._fewer(part.field, machine)}, a gentler profile there"
        names = [what.name for what in self.printed]
        own = replace(part, levels=self.levels, names=names, shells=shells, cure=cure)
        return print_checks(own, machine)


@dataclass(frozen=True, slots=True, eq=False)
class CellDesign:
    """Cells of two materials among each other: their lattice, and what they come to."""

    dealt: DitherField
    counted: CellCounts
    printed: tuple[Printed, ...]
    stated: bool

    @property
    def says(self) -> Mapping[str, object]:
        """What a plan says of how targets between two materials are met."""
        return {"kind": "dither", "cell_mm": self.dealt.cell_mm, "tile": "blue-noise-32"}

    def cut(self, mesh: Mesh, along: Field, pitch_mm: float, within_mm: float) -> Pieces:
        """Divide the part along the cells, whatever the pitch of the field's own grid."""
        return split(mesh, self.dealt, self.dealt.levels, pitch_mm=self.dealt.cell_mm, follow=False)

    def regions(
        self, pieces: Pieces, shells: Sequence[Shell], scale: StiffnessScale
    ) -> tuple[Region, ...]:
        """Report what was cut, with what it comes to together."""
        return dither_regions(pieces, self.printed, shells, self.dealt, self.counted, scale)

    def held(
        self, part: CutPart, shells: Sequence[Shell], scale: StiffnessScale, machine: Printer
    ) -> _Held:
        """Hold cells against what was wanted, and the part as a whole against the printer.

        Cells of two materials hold each other: only walls of the part can be too thin.
        """
        cell_mm, least_mm = self.dealt.cell_mm, machine.minimum_feature_mm
        smaller = f"take a smaller --cell, down to {least_mm:g}"
        # One that is not stated is as small as it can be.
        cure = smaller if self.stated and cell_mm > least_mm else "take --blend nearest"
        checks, findings = fraction_checks(part.pieces, self.dealt, self.counted, scale, cure)
        fine = cell_mm >= least_mm * (1.0 - 1e-9)
        if not fine:
            message = (
                f"cells of {cell_mm:g} mm are smaller than what {machine.title} prints "
                f"undistorted, {least_mm:g} mm: their volumes will be off; take --cell {least_mm:g}"
            )
            findings = (Finding(kind="cell", message=message, size_mm=cell_mm), *findings)
        mean_wall_mm = 2.0 * part.mesh.volume_mm3 / part.mesh.area_mm2  # were it a plate
        if cell_mm > mean_wall_mm:
            message = (
                f"cells of {cell_mm:g} mm are thicker than the part, whose walls are "
                f"{mean_wall_mm:.3g} mm on the mean: a place holds whichever cell happens to "
                f"be there, and stretches of the gradient may have none; {cure}"
            )
            findings = (Finding(kind="cell", message=message, size_mm=cell_mm), *findings)
        walls, thin, cautions = print_checks(part, machine)
        checks = {**checks, **walls, "cell_mm": Check(cell_mm, least_mm, fine)}
        return checks, (*findings, *thin), cautions


def _design_pieces(
    choice: BlendChoice, mesh: Mesh, field: Field, target: Profile, scale: StiffnessScale,
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
    if bands is not None and choice.kind in ("dither", "bands"):
        raise ArgumentError(
            f"`bands` {bands}: it goes with `blend` nearest or mix"
            + ("; write `blend` bands:N for N periods" if choice.kind == "bands" else "")
        )
    if bands is not None and not 1 <= bands <= _MOST_BANDS:
        raise ArgumentError(f"`bands` {bands}: it must be a whole number from 1 to {_MOST_BANDS}")
    if cell_mm is not None and choice.kind != "dither":
        raise ArgumentError(f"`cell_mm` {cell_mm:g}: it goes with `blend` dither")
    moduli = scale.moduli_MPa
    if choice.kind == "mix":
        return BandDesign(*mixed_bands(target, scale, bands, machine), {"kind": "mix"})
    if choice.kind == "dither":
        return _dithered(mesh, field, target, scale, machine, cell_mm)
    says, periods = None, ()
    if choice.kind == "bands":
        laminate = laminated(target, blend_segments(target, moduli), moduli, choice.periods)
        steps, periods = zip(*laminate, strict=True)
        says = {"kind": "bands", "periods": choice.periods}
    elif bands is None:
        steps = natural_bands(target, moduli)
    else:
        steps = equal_bands(target, moduli, bands)
    printed = tuple(catalogue_material(scale, band.grade, machine) for band in steps)
    return BandDesign(steps, printed, says, periods)


def _dithered(
    mesh: Mesh, field: Field, target: Profile, scale: StiffnessScale, machine: Printer,
    cell_mm: float | None,
) -> CellDesign:  # fmt: skip
    along = blend_segments(target, scale.moduli_MPa)
    pieces = dither_pieces(along)
    least_mm = machine.minimum_feature_mm if cell_mm is None else cell_mm
    dealt = DitherField(field, target, scale.moduli_MPa, along, pieces, mesh.bounds_mm[0], least_mm)
    dealt = affordable_cells(mesh, dealt, stated=cell_mm is not None)
    printed = tuple(catalogue_material(scale, piece.grade, machine) for piece in pieces)
    return CellDesign(dealt, count_cells(mesh, dealt), printed, cell_mm is not None)


# ------------------------------------------------------------------------------------------------
# The main job: part + gradient + palette -> Plan.


_Progress = Callable[[str], None]


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
    tolerance: float = 2.0,
    printer: str | Path | Printer | None = None,
    palette: str | Path | Palette | None = None,
    unit: str | None = None,
    bodies: str | None = None,
    name: str | None = None,
    coupons: bool = False,
    force_oversize: bool = False,
    progress: _Progress = lambda stage: None,
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
        strain, printer and unit.
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
        or below 1 a share, as 0.25 for 25 %. It is the limit of the check
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
        bands=None if bands is None else as_count(bands, "`bands`"),
        blend=blend,
        cell_mm=None if cell_mm is None else positive(cell_mm, "`cell_mm`"),
        at_strain=None if at_strain is None else as_number(at_strain, "`at_strain`"),
        printer=printer, palette=palette, unit=unit,
    )  # fmt: skip
    wish, earlier = whole_wish(stated, like)
    assert wish.printer is not None
    assert wish.at_strain is not None
    machine = load_printer(wish.printer)
    choice = _blend_choice(wish.blend)
    scale = stiffness_scale(palette_of(wish.palette, machine), wish.at_strain)
    target, start, end = targets_of(wish, scale)
    limit = tolerated_ratio(as_number(tolerance, "`tolerance`"))
    farthest_mm = snap_limit_mm(
        None if snap_mm is None else as_number(snap_mm, "`snap_mm`"), machine
    )

    progress("reading the part")
    source = open_part(part, unit=wish.unit, name=name, tray_mm=machine.tray_mm, bodies=bodies)
    if not force_oversize:
        refuse_oversize(source, machine)
    mesh, translation = place(source.part.mesh)
    pitch_mm = default_pitch_mm(mesh) if wish.pitch_mm is None else wish.pitch_mm
    if wish.field is None:
        along: Field = axis_field(wish.axis, mesh)
    else:
        progress("building the field")
        along = build_field(wish.field, Setting(mesh, as_point(translation), pitch_mm))

    progress("cutting the shells")
    design = _design_pieces(
        choice, mesh, along, target, scale, machine, bands=wish.bands, cell_mm=wish.cell_mm
    )
    moved: tuple[MovedCut, ...] = ()
    if isinstance(design, BandDesign):
        if not design.periods:
            bands_now, moved = snapped_bands(
                mesh, along, design.bands, target, snap_mm=farthest_mm, machine=machine
            )
            design = replace(design, bands=bands_now)
        _check_thickness(along, design.bands, machine, source.warnings)
    within_mm = WITHIN_MM if wish.pitch_mm is None else math.inf
    pieces = design.cut(mesh, along, pitch_mm, within_mm)
    shells = shells_of(pieces, design.printed, scale, machine, source.name)
    regions = design.regions(pieces, shells, scale)

    progress("looking for what will not print")
    cut = CutPart(mesh, along, pieces, pitch_mm, within_mm, as_point(translation), np.empty(0))
    printing, findings, cautions = design.held(cut, shells, scale, machine)
    known = _remarks(scale, regions)
    others = alternatives(
        regions, target, scale, equal_bands=wish.bands is not None,
        moved=bool(moved) and choice.kind == "nearest",
    )  # fmt: skip
    stiffness, off = stiffness_check(regions, limit, others)
    followed = () if earlier is None else earlier.remarks(source.sha256)
    unsure: tuple[str, ...] = ()
    if any(what.material is None for what in design.printed):
        unsure = (MIXTURES_UNCALIBRATED.format(printer=machine.title),)
    described = dict(along.description())
    if not isinstance(along, PlanarField):
        described["pitch_mm"] = pitch_mm
        if math.isfinite(within_mm):
            described["within_mm"] = within_mm
    plan = Plan(
        schema=1,
        version=__version__,
        printer=machine.name,
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
            {"limit_mm": farthest_mm, "moved": [asdict(cut) for cut in moved]} if moved else None,
        ),
        stiffness=Stiffness(
            "secant-nominal",
            scale.at_strain,
            alternatives=others,
        ),
        regions=regions,
        checks={"worst_stiffness_error": stiffness, **printing},
        findings=(*off, *findings),
        warnings=(*map(Caution, (*source.warnings, *followed, *unsure, *cautions)), *known),
        unreachable=_unreachable(target, scale),
        shells=shells,
    )
    progress("verifying the shells")
    return with_howto(_verified(plan, mesh), mesh, machine, scale, known, coupons=coupons)


def _verified(plan: Plan, placed: Mesh) -> Plan:
    """Add the checks that ``planner check`` makes of a plan's files, and what does not hold."""
    as_read = decode_plan(plan.json(), "plan.json")
    shells = join_shells(map(_read_back, plan.shells))
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


def _read_back(shell: Shell) -> tuple[Float32Array, NDArray[np.int32]]:
    """Return vertices and faces as the reader of a shell's file finds them."""
    data = shell.stl
    if stl_holds(data, shell.vertices, shell.faces):
        return shell.vertices, shell.faces.astype(np.int32)
    return weld(decode_stl(data, shell.file).astype(np.float32))


def _remarks(scale: StiffnessScale, regions: Sequence[Region]) -> tuple[str, ...]:
    """Return what to know of the moduli of the grades that the regions are printed in."""
    lower, upper, t = scale.model.bracket([region.coordinate for region in regions])
    used = {*lower.tolist(), *np.where(t > 0.0, upper, lower).tolist()}
    return scale.remarks({scale.palette.materials[k].id for k in used})


def _check_thickness(
    field: Field, steps: tuple[Band, ...], machine: Printer, warnings: tuple[str, ...]
) -> None:
    """Refuse bands thinner than the printer's layer, where the field has a length."""
    span_mm = field.description().get("span_mm")
    if not isinstance(span_mm, float):
        return
    thinnest = min(steps, key=lambda band: band.stop - band.start)
    thickness_mm = (thinnest.stop - thinnest.start) * span_mm
    if thickness_mm < machine.layer_mm:
        fit = int(span_mm / machine.layer_mm)
        unit = next((w.replace("--unit", "`unit`") for w in warnings if "--unit" in w), None)
        raise ThinBandError(
            f"a band of {1000 * thickness_mm:.3g} um at field {thinnest.start:.6g} is thinner than "
            f"a layer of {machine.title}, {1000 * machine.layer_mm:g} um, on a gradient of "
            f"{span_mm:.4g} mm; {unit or f'take `bands` {fit} or fewer, or a gentler profile'}"
        )


def _part_graded(source: PartSource, translation_mm: Point) -> PartGraded:
    mesh = source.part.mesh
    low, high = mesh.bounds_mm
    return PartGraded(
        name=source.name,
        file=source.file,
        sha256=source.sha256,
        unit=source.unit,
        volume_mm3=mesh.volume_mm3,
        area_mm2=mesh.area_mm2,
        bounds_mm=(as_point(low), as_point(high)),
        triangles=len(mesh.faces),
        translation_mm=translation_mm,
        repairs=source.part.repairs,
    )


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
