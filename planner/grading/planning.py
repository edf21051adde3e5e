"""The main job: part + gradient + palette -> Plan."""

from collections.abc import Callable
from pathlib import Path

from planner import __version__
from planner.arrays import FloatArray
from planner.errors import ArgumentError
from planner.formats.stl import decode_stl
from planner.geometry.fields import Field, PlanarField
from planner.geometry.fields.axis import axis_field
from planner.geometry.level_sets.grid import default_pitch_mm
from planner.geometry.level_sets.interface_area import affordable_pitch_mm
from planner.geometry.mesh import Mesh
from planner.geometry.placement import place
from planner.geometry.shells import Pieces, piece_volumes_mm3, split
from planner.grading.arguments import as_count, as_number, positive
from planner.grading.bands import Band, shortfalls
from planner.grading.blends.choice import blend_choice
from planner.grading.blends.design import Design, design_pieces
from planner.grading.blends.mixtures import MIXTURES_UNCALIBRATED
from planner.grading.curved_checks import interface_checks, voxel_checks
from planner.grading.curved_walls import Divided, wall_checks
from planner.grading.field_kinds import Setting
from planner.grading.field_spec import build_field
from planner.grading.findings import print_checks
from planner.grading.part_source import PartSource, open_part
from planner.grading.profile import Profile, between, read_profile
from planner.grading.regions import point, shells_of
from planner.grading.stiffness_scale import StiffnessScale, stiffness_scale
from planner.grading.verification import shell_checks
from planner.palette import Material, Palette
from planner.plan import (
    Check,
    Finding,
    Gradient,
    PaletteUsed,
    PartGraded,
    Plan,
    Point,
    Shell,
    Stiffness,
    Unreachable,
)
from planner.printers import Printer, palette_of
from planner.printers import printer as load_printer

__all__ = ["grade"]

Progress = Callable[[str], None]


def grade(
    part: object,
    *,
    from_: str | Material | None = None,
    to: str | Material | None = None,
    axis: str | tuple[float, float, float] | None = None,
    profile: str | Path | Profile = "log",
    bands: int | None = None,
    field: str | Field | Callable[[FloatArray], FloatArray] | None = None,
    pitch_mm: float | None = None,
    blend: str = "nearest",
    cell_mm: float | None = None,
    at_strain: float = 0.1,
    printer: str | Printer = "connex3",
    palette: str | Path | Palette | None = None,
    unit: str | None = None,
    name: str | None = None,
    progress: Progress = lambda stage: None,
) -> Plan:
    """Plan the print of a part whose stiffness follows a gradient.

    Parameters
    ----------
    part
        Path of a mesh file, a mesh with ``vertices`` and ``faces`` (such as ``trimesh.Trimesh``),
        or a pair (vertices, faces) in `unit`.
    from_, to
        Materials at the beginning and the end of the gradient, by id, alias or unique prefix.
        Not needed with a profile file, which names its own targets.
    axis
        Direction of the gradient: ``x``, ``-z``, ``"1,0,1"`` or three numbers; the part's longest
        extent by default.
    profile
        ``log``, ``linear``, ``smooth``, ``steps:N``, a CSV file, or a `Profile`.
    bands
        Cut into so many equal steps of the field, with `blend` ``nearest`` or ``mix``; by default
        the cuts lie where the nearest material, or the mixture, changes.
    field
        What the gradient follows instead of an axis: text as for ``--field``, such as
        ``"radial: point=0 0 5, to=12"``; a function of points (n, 3) in the part's coordinates
        that returns values from 0 to 1; or any `Field` over the part as placed for printing.
    pitch_mm
        Of the grid on which curved level sets are drawn; by default 0.5 mm, finer for parts smaller
        than 25 mm and coarser for those larger than 63 mm.
    blend
        How a target between two materials is met: ``nearest`` takes the nearer one; ``dither``
        deals cells of both, as many of each as the target needs; ``bands:N`` lets N pairs of
        thinner bands take turns from one material to the next; ``mix`` records mixtures, for
        printers that jet them.
    cell_mm
        Edge of the cells that ``dither`` deals; the printer's minimum feature by default.
    at_strain
        Working strain of the secant modulus.
    printer, palette
        By name, file or value; the printer's default palette if not given.
    unit
        Unit of the part's figures; mm unless the file says otherwise.
    name
        Name of the part; its file's stem by default.
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
    """
    machine = load_printer(printer)
    if field is not None and axis is not None:
        raise ArgumentError("give --axis or --field, not both; --field 'axis: z' is an axis too")
    pitch_mm = None if pitch_mm is None else positive(pitch_mm, "--pitch")
    bands = None if bands is None else as_count(bands, "--bands")
    at_strain = as_number(at_strain, "--at-strain")
    cell_mm = None if cell_mm is None else positive(cell_mm, "--cell")
    choice = blend_choice(blend)
    scale = stiffness_scale(palette_of(machine, palette), at_strain)
    target, start, end = _target(profile, from_, to, scale)

    progress("reading the part")
    source = open_part(part, unit=unit, name=name, tray_mm=machine.tray_mm)
    mesh, translation = place(source.part.mesh)
    given, pitch_mm = pitch_mm, default_pitch_mm(mesh) if pitch_mm is None else pitch_mm
    if field is None:
        along: Field = axis_field(axis, mesh)
    else:
        progress("building the field")
        along = build_field(field, Setting(mesh, point(translation), pitch_mm))

    progress("cutting the shells")
    design = design_pieces(
        choice, mesh, along, target, scale, machine, bands=bands, cell_mm=cell_mm
    )
    if design.dealt is None:
        _check_thickness(along, design.bands, machine, source.warnings)
        if given is None and not isinstance(along, PlanarField):
            pitch_mm = affordable_pitch_mm(mesh, along, design.levels, pitch_mm)
        pieces = split(mesh, along, design.levels, pitch_mm=pitch_mm)
    else:
        pieces = split(mesh, design.dealt, design.levels, pitch_mm=design.dealt.cell_mm)
    shells = shells_of(pieces, design.printed, at_strain, machine, source.name)
    regions = design.regions(pieces, shells, scale)

    progress("verifying the shells")
    checks = shell_checks([decode_stl(shell.stl, shell.file) for shell in shells], mesh)
    progress("looking for what will not print")
    dealing, dealt = design.checks(pieces, scale, machine)
    printing, findings, unsure = _printing(mesh, along, design, pieces, shells, pitch_mm, machine)
    described = dict(along.description())
    if not isinstance(along, PlanarField):
        described["pitch_mm"] = pitch_mm
    return Plan(
        schema=1,
        version=__version__,
        printer=machine.name,
        palette=PaletteUsed(scale.palette.name, scale.palette.sha256),
        part=_part_graded(source, point(translation)),
        gradient=Gradient(described, target.description(), start, end, bands, design.document()),
        stiffness=Stiffness("secant-nominal", at_strain),
        regions=regions,
        checks={**checks, **dealing, **printing},
        findings=(*dealt, *findings),
        warnings=(*source.warnings, *unsure),
        unreachable=_unreachable(target, scale),
        shells=shells,
        notes=machine.job_notes(),
    )


def _target(
    profile: str | Path | Profile,
    from_: str | Material | None,
    to: str | Material | None,
    scale: StiffnessScale,
) -> tuple[Profile, str | None, str | None]:
    """Return the target along the field and the ids of the materials at its ends."""
    palette = scale.palette
    start, end = _material_id(from_, palette), _material_id(to, palette)
    if isinstance(profile, Profile):
        return profile, start, end
    if not isinstance(profile, (str, Path)):
        raise ArgumentError(
            f"profile is a {type(profile).__name__}; give a name, a CSV file or a planner.Profile"
        )
    if isinstance(profile, Path) or profile.casefold().endswith(".csv"):
        if start is not None or end is not None:
            raise ArgumentError(
                f"--profile {profile} names its own targets; leave out --from and --to"
            )
        moduli = {m.id: scale.modulus_of(m.id) for m in palette.materials}
        return read_profile(profile, moduli, lambda called: palette.resolve(called).id), None, None
    if start is None or end is None:
        ids = ", ".join(material.id for material in palette.materials)
        raise ArgumentError(
            "give both ends of the gradient, as in --from Tango --to Vero; palette "
            f"{palette.name} has {ids}"
        )
    if start == end:
        raise ArgumentError(
            f"--from {from_} and --to {to} are one material, {start}; a gradient needs two"
        )
    return between(profile, scale.modulus_of(start), scale.modulus_of(end)), start, end


def _material_id(material: str | Material | None, palette: Palette) -> str | None:
    if material is None:
        return None
    if not isinstance(material, (str, Material)):
        raise ArgumentError(
            f"an end of the gradient is a {type(material).__name__}; give the name of a material"
        )
    return palette.resolve(material if isinstance(material, str) else material.id).id


def _printing(
    mesh: Mesh, along: Field, design: Design, pieces: Pieces, shells: tuple[Shell, ...],
    pitch_mm: float, machine: Printer,
) -> tuple[dict[str, Check], tuple[Finding, ...], tuple[str, ...]]:  # fmt: skip
    """Hold the pieces against the printer; also say what is not sure."""
    volumes_mm3 = piece_volumes_mm3(pieces)
    if design.dealt is not None:
        # Walls of the part as a whole: cells of two materials hold each other.
        whole = axis_field(None, mesh)
        checks, findings = print_checks(
            mesh, whole, (), ("the part",), volumes_mm3.sum(keepdims=True), machine
        )
        cell_mm, least_mm = design.dealt.cell_mm, machine.minimum_feature_mm
        checks["cell_mm"] = Check(cell_mm, least_mm, cell_mm >= least_mm * (1.0 - 1e-9))
        return {**checks, **voxel_checks(pieces, mesh, volumes_mm3, machine)}, findings, ()
    levels = design.levels
    materials = [what.name for what in design.printed]
    checks, findings = print_checks(mesh, along, levels.tolist(), materials, volumes_mm3, machine)
    unsure: tuple[str, ...] = ()
    if any(what.material is None for what in design.printed):
        unsure = (MIXTURES_UNCALIBRATED.format(printer=machine.title),)
    if isinstance(along, PlanarField):
        return checks, findings, unsure
    drawn, more = interface_checks(pieces, along, levels, pitch_mm, mesh, volumes_mm3, machine)
    fewer = "periods" if design.choice.kind == "bands" else "bands"
    cure = f"take fewer {fewer}, a gentler profile there"
    divided = Divided(mesh, along, levels, pieces, materials, shells, pitch_mm, cure)
    walls, thin = wall_checks(divided, machine)
    return {**checks, **walls, **drawn}, (*findings, *thin, *more), unsure


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
        unit = next((warning for warning in warnings if "--unit" in warning), None)
        raise ArgumentError(
            f"a band of {1000 * thickness_mm:.3g} um at field {thinnest.start:.6g} is thinner than "
            f"a layer of {machine.title}, {1000 * machine.layer_mm:g} um, on a gradient of "
            f"{span_mm:.4g} mm; "
            + (unit or f"use fewer bands (up to {fit} can fit) or a gentler profile")
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
        bounds_mm=(point(low), point(high)),
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
