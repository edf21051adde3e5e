"""Plan and Region: the result of grading a part, and reading one back."""

import dataclasses
import hashlib
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Literal

import msgspec

from planner.errors import ArgumentError, FileError, OutputError, did_you_mean, refused
from planner.formats.files import decode_document, json_of, path_within, read_file
from planner.formats.threemf import Constituent
from planner.glance import as_words, brief, counted, html_of, one_line, outcome, plotted
from planner.numerics import Float32Array, FloatArray, IntArray, Point

__all__ = [
    "Check",
    "Finding",
    "Gradient",
    "PaletteUsed",
    "PartGraded",
    "Plan",
    "Region",
    "Shell",
    "Stiffness",
    "Triangles",
    "Unreachable",
    "decode_plan",
    "plan_file",
    "read_plan",
    "read_shell",
    "read_shells",
]


_BESIDE = ("shells", "notes", "coupons", "file")
"""What a plan just made holds and plan.json does not."""

_ALWAYS = ("field", "profile", "start", "end", "bands")
_CALLED = {"start": "from", "end": "to"}
"""What plan.json tells of every gradient, null too, and what it calls otherwise."""

_MIXTURES = (
    "",
    "Files with two materials are mixtures. Only a printer whose software takes such ratios can",
    "print them, and they were not calibrated on a machine. Where the software lists catalogue",
    "materials alone, grade the part again with another `--blend`.",
)

_PICTURE = (600, 400)
"""Pixels of the pictures beside a plan; the 3MF has one of half that."""

_Pair = tuple[float, float]
_Box = tuple[Point, Point]
Triangles = Float32Array | FloatArray
"""Corners (k, 3, 3) of a shell, as placed for printing."""


@dataclass(frozen=True, slots=True)
class PaletteUsed:
    """The palette a plan was made with."""

    name: str
    sha256: str


@dataclass(frozen=True, slots=True)
class PartGraded:
    """The part a plan was made for; adding `translation_mm` takes it to where the shells are.

    Its `name` is what files are called by: the file's stem in plain letters.
    """

    name: str
    file: str
    sha256: str
    unit: str
    volume_mm3: float
    area_mm2: float
    bounds_mm: _Box
    triangles: int
    translation_mm: Point
    repairs: tuple[str, ...] = ()

    __repr__ = brief


@dataclass(frozen=True, slots=True)
class Gradient:
    """The wish: a field over the part, and a target along it (``from`` and ``to`` in the file).

    Attributes
    ----------
    start, end
        Ids of materials, or moduli such as ``0.5MPa``.
    blend
        How targets between two materials are met, where not by the nearer one.
    like
        Of a plan that follows an earlier one: the hash of that one's plan.json, its palette, and
        what stood at its ends.
    snap
        If cuts were moved so that no sliver is left: how far they might be, and each of them with
        its ``field``, where it was moved ``to``, and ``by_mm``.
    """

    field: Mapping[str, Any]
    profile: Mapping[str, Any]
    start: str | None
    end: str | None
    bands: int | None = None
    blend: Mapping[str, Any] | None = None
    like: Mapping[str, Any] | None = None
    snap: Mapping[str, Any] | None = None

    __repr__ = brief

    @property
    def kind(self) -> str:
        """Kind of its blend: ``nearest``, ``dither``, ``bands`` or ``mix``."""
        return str((self.blend or {}).get("kind", "nearest"))


@dataclass(frozen=True, slots=True)
class Stiffness:
    """What "modulus" means: secant of the nominal stress from rest to a working strain.

    Rigid grades are measured alike; plans of earlier versions have their initial modulus.

    Attributes
    ----------
    alternatives
        By option, such as "with --blend dither": the worst ratio of target and achieved modulus
        that it would leave, where that is smaller than the plan's own.
    """

    measure: Literal["secant-nominal"]
    at_strain: Annotated[float, msgspec.Meta(ge=0.0, lt=50.0)]  # as far as palettes reach
    rigid_measure: Literal["initial-modulus", "secant-nominal"] = "secant-nominal"
    alternatives: Mapping[str, float] = field(default_factory=dict)

    __repr__ = brief


@dataclass(frozen=True, slots=True)
class Region:
    """One band of the part: what was wanted, and what is printed there.

    Attributes
    ----------
    field
        Field values at which it begins and ends.
    target_modulus_MPa
        Lowest and highest target within it.
    modulus_MPa, modulus_interval_MPa
        Achieved modulus, and the interval that holds it with 95 % probability.
    error
        Achieved over highest target - 1, and achieved over lowest target - 1.
    mass_g
        None where the palette tells no density.
    file, sha256, triangles
        The STL that holds it; regions of one material share a file.
    material, blend
        A catalogue material, or a mixture that `blend` describes. With both, `blend` says how the
        material meets the target together with its neighbour; moduli are those of the two.
    """

    index: int
    coordinate: float
    field: _Pair
    target_modulus_MPa: _Pair
    modulus_MPa: float
    modulus_interval_MPa: _Pair
    error: _Pair
    volume_mm3: float
    mass_g: float | None
    bounds_mm: _Box
    file: str
    sha256: str
    triangles: int
    material: str | None = None
    blend: Mapping[str, Any] | None = None

    @one_line
    def __repr__(self) -> str:
        return (
            f"{self.index}: {self.printed}, field {self.field[0]:.3g} .. {self.field[1]:.3g}, "
            f"{self.modulus_MPa:.3g} MPa, {self.volume_mm3:.5g} mm3"
        )

    @property
    def printed(self) -> str:
        """The material or mixture that it is printed in, as its file is called."""
        return self.material or str((self.blend or {}).get("name", ""))


@dataclass(frozen=True, slots=True)
class Check:
    """One thing that was verified: a value against its limit."""

    value: float
    limit: float
    ok: bool

    def __post_init__(self) -> None:
        # Counts too are figures: a plan reads back equal to the one that was written.
        object.__setattr__(self, "value", float(self.value))
        object.__setattr__(self, "limit", float(self.limit))


@dataclass(frozen=True, slots=True)
class Finding:
    """Something that will not print as planned, with its place and size.

    Attributes
    ----------
    place_mm
        In the coordinates of the files that are printed.
    drawn_mm
        The same place in the coordinates of the part's own file, in mm; as in the message.
    """

    kind: str
    message: str
    material: str | None = None
    place_mm: Point | None = None
    drawn_mm: Point | None = None
    size_mm: float | None = None

    __repr__ = brief


@dataclass(frozen=True, slots=True)
class Unreachable:
    """A stretch of the field whose target no material reaches."""

    field: _Pair
    target_modulus_MPa: _Pair
    nearest: str
    modulus_MPa: float

    __repr__ = brief


@dataclass(frozen=True, slots=True)
class Shell:
    """All of a part that is printed in one material, as it goes to the files.

    Attributes
    ----------
    vertices, faces
        (n, 3) float32 mm and (m, 3); closed, normals outwards.
    header, sha256
        Of its binary STL: the text that it begins with, and the hash of the whole.
    properties
        What the 3MF records of the material: coordinate, modulus, base resins.
    constituents
        Of a mixture: its catalogue materials and their shares.
    """

    material: str
    operator_name: str
    colour: str
    file: str
    vertices: Float32Array
    faces: IntArray
    header: str
    sha256: str
    properties: Mapping[str, str]
    constituents: tuple[Constituent, ...] = ()

    __repr__ = brief

    @property
    def stl(self) -> bytes:
        """The bytes of its binary STL, made anew each time: they are larger than the mesh."""
        from planner.formats.mesh_file import encode_stl

        return encode_stl(self.vertices, self.faces, self.header)


@dataclass(frozen=True, slots=True)
class Plan:
    """What to print where: the content of plan.json, and the shells of a plan just made.

    Attributes
    ----------
    voxel_mm
        Pixel and layer of the printer where its name alone does not tell them: of one that is not
        installed, or whose file has others.
    coupons
        Of a plan just made: the files of test coupons, by their paths in its folder.
    file
        The plan.json that it was read from, where its shells are; None of a plan just made.
    files_sha256
        The SHA-256 of each other file of that folder, as it was written; empty of a plan just made.
    """

    schema: Literal[1]
    version: str
    printer: str
    palette: PaletteUsed
    part: PartGraded
    gradient: Gradient
    stiffness: Stiffness
    regions: tuple[Region, ...]
    checks: Mapping[str, Check]
    findings: tuple[Finding, ...] = ()
    warnings: tuple[str, ...] = ()
    unreachable: tuple[Unreachable, ...] = ()
    voxel_mm: tuple[float, float, float] | None = None
    shells: tuple[Shell, ...] = field(default=(), repr=False, compare=False)
    notes: str = field(default="", repr=False, compare=False)
    coupons: Mapping[str, bytes] = field(default_factory=dict, repr=False, compare=False)
    file: Path | None = field(default=None, repr=False, compare=False)
    files_sha256: Mapping[str, str] = field(default_factory=dict, repr=False, compare=False)

    _repr_html_ = html_of
    plot = plotted

    @one_line
    def __repr__(self) -> str:
        failed = sum(not check.ok for check in self.checks.values())
        beyond = (len(self.unreachable), "target out of reach")
        wrong = outcome((failed, "check failed"), (len(self.findings), "finding"), beyond)
        materials = counted(len({r.printed for r in self.regions}), "material")
        return (
            f"{self.name}: {materials}, {counted(len(self.regions), 'region')}, "
            f"{self.part.volume_mm3:.5g} mm3, {self.palette.name}; {wrong}"
        )

    @property
    def folder(self) -> Path | None:
        """The folder that it was read from; None of a plan just made."""
        return None if self.file is None else self.file.parent

    @property
    def name(self) -> str:
        """The part's name, which its files begin with."""
        return self.part.name

    @property
    def ok(self) -> bool:
        """Whether every target is reached, every check holds and nothing was found."""
        checks = all(check.ok for check in self.checks.values())
        return checks and not self.findings and not self.unreachable

    @property
    def mass_g(self) -> float | None:
        """What all regions weigh; None where the palette tells no density of one."""
        return _total_mass_g(self.regions)

    def document(self) -> dict[str, Any]:
        """Return the plan as plan.json holds it."""
        names = [each.name for each in dataclasses.fields(self) if each.name not in _BESIDE]
        stated = {name: getattr(self, name) for name in names}
        stated["warnings"] = list(map(str, self.warnings))  # a caution is a text in files
        document: dict[str, Any] = _without_none(msgspec.to_builtins(stated))
        gradient = dict.fromkeys(_ALWAYS) | document["gradient"]
        document["gradient"] = {_CALLED.get(name, name): gradient[name] for name in gradient}
        if not document["files_sha256"]:
            del document["files_sha256"]
        return document

    json = json_of

    def howto(self) -> str:
        """Return the text of HOWTO.md: what the operator does, and which material goes where.

        Raises
        ------
        OutputError
            The plan was read back from a folder, where the text lies.
        """
        if not self.shells:
            raise OutputError(f"plan of {self.part.file}: read back; HOWTO.md is in its folder")
        rows = [
            f"| `{Path(shell.file).name}` | {as_words(shell.operator_name)} | "
            f"{_grams(r for r in self.regions if r.file == shell.file)} | {shell.colour} |"
            for shell in self.shells
        ]
        mixed = any(shell.constituents for shell in self.shells)
        head = ["## Which material to which file", "", "| file | material | grams | colour |"]
        total = [f"| all | | {_grams(self.regions)} | |", *(_MIXTURES if mixed else ()), ""]
        notes = [self.notes.rstrip(), "", *head, "| --- | --- | --- | --- |"]
        return "\n".join([*notes, *rows, *total])

    def write(
        self,
        output: str | Path | None = None,
        *,
        force: bool = False,
        page: bytes | None = None,
        slicer: str | None = None,
        beside: Mapping[str, bytes] = MappingProxyType({}),
    ) -> Path:
        """Write plan.json, 3MF, STL set, how-to and pictures of the part into a folder.

        The folder is whole or absent: everything goes to a temporary sibling first.

        Parameters
        ----------
        output
            Folder to write; ``<part>-graded`` in the working directory by default.
        force
            Replace an earlier plan in that place.
        page
            Content of plan.html, as `planner.plan_page` returns it; none is written by default.
        slicer
            Whom the 3MF is for: prusaslicer gets all shells as one mesh, which it needs to show
            one object; bambu, orca and cura get what is written by default.
        beside
            More files of the folder, by name, such as a design's.

        Returns
        -------
        pathlib.Path
            The folder.

        Raises
        ------
        ArgumentError
            No such slicer.
        OutputError
            The folder exists already, or cannot be written; or the plan was read back from a
            folder, which can be copied instead.
        """
        from planner.formats.outputs import new_folder
        from planner.formats.threemf import ThreemfObject, encode_threemf, needs_one_mesh
        from planner.voxels.picture import pictures_of

        if not self.shells:
            where = "its folder" if self.folder is None else str(self.folder)
            raise OutputError(
                f"plan of {self.part.file}: it was read back, and its shells lie in files: copy "
                f"{where}, or grade the part again"
            )
        one_mesh = slicer is not None and needs_one_mesh(slicer)
        target = Path(f"{self.name}-graded" if output is None else output)
        with new_folder(target, force=force) as scratch:
            (scratch / "stl").mkdir()
            for shell in self.shells:
                data = shell.stl
                if hashlib.sha256(data).hexdigest() != shell.sha256:
                    raise OutputError(
                        f"{shell.file}: the shell has changed since it was verified; grade the "
                        "part again"
                    )
                (scratch / shell.file).write_bytes(data)
                del data
            objects = [
                ThreemfObject(
                    name=Path(shell.file).stem,
                    vertices=shell.vertices,
                    faces=shell.faces,
                    material_name=shell.material,
                    colour=shell.colour,
                    metadata=shell.properties,
                    constituents=shell.constituents,
                )
                for shell in self.shells
            ]
            solids = [(each.vertices, each.faces, each.colour) for each in self.shells]
            drawn = pictures_of(solids, width=_PICTURE[0], height=_PICTURE[1])
            model = encode_threemf(objects, self.name, thumbnail=drawn.thumbnail, one_mesh=one_mesh)
            files = {
                "part.png": drawn.outside,
                "section.png": drawn.section,
                f"{self.name}.3mf": model,
                "HOWTO.md": self.howto().encode("utf-8"),
                **({} if page is None else {"plan.html": page}),
                **self.coupons,
                **beside,
                "plan.json": self.json(),
            }
            for name, data in files.items():
                (scratch / name).parent.mkdir(exist_ok=True)
                (scratch / name).write_bytes(data)
        return target


def _total_mass_g(regions: Iterable[Region]) -> float | None:
    """Return what regions weigh in all; None where that of one is unknown."""
    masses = [region.mass_g for region in regions]
    known = [mass for mass in masses if mass is not None]
    return sum(known) if len(known) == len(masses) else None


def _grams(regions: Iterable[Region]) -> str:
    mass = _total_mass_g(regions)
    return "-" if mass is None else f"{mass:#.3g}"


def plan_file(plan: str | Path | Plan) -> Path:
    """Return the plan.json that is meant: itself, the one in a folder, or the one a plan is from.

    Raises
    ------
    FileError
        There is none; or the plan was not read from a file, or it is another one by now.
    """
    from planner.formats.mesh_file import EXTENSIONS

    if isinstance(plan, Plan):
        return _file_of(plan)
    said = "give a plan.json, its folder or a planner.Plan"
    with refused(ArgumentError, f"plan {plan!r}", said, TypeError):
        path = Path(plan)
    if path.is_dir():
        file = path_within(path, "plan.json")
        if not file.is_file():
            raise FileError(f"{path}: no plan.json in this folder; give a folder that grade wrote")
        return file
    if not path.is_file():
        siblings = [p.name for p in path.parent.iterdir()] if path.parent.is_dir() else []
        hint = did_you_mean(path.name, siblings)
        raise FileError(f"{path}: no such file or folder; {hint}give a plan.json or its folder")
    if path.suffix.casefold().lstrip(".") in EXTENSIONS:
        raise FileError(f"{path}: a mesh and no plan; give the folder that planner grade wrote")
    return path


def _file_of(plan: Plan) -> Path:
    if plan.file is None:
        raise FileError(
            f"plan of {plan.part.file}: it lies in no folder yet; write it, and give the folder "
            "that `Plan.write` returns"
        )
    if not plan.file.is_file():
        raise FileError(
            f"{plan.file}: the plan of {plan.part.file} was read from here, and is here no more; "
            "read it from where it is now"
        )
    if read_plan(plan.file) != plan:
        raise FileError(
            f"{plan.file}: it is not the plan of {plan.part.file} that was read from here; read it "
            "again"
        )
    return plan.file


def read_plan(path: str | Path) -> Plan:
    """Read a plan from plan.json or the folder that holds it; its shells stay in their files.

    Its figures have the nine digits that the file keeps. It remembers where it was read from, and
    goes wherever its folder goes: to `simulate`, `check`, `view`, `plan_page`, `write_slices`.

    Parameters
    ----------
    path
        The plan.json, or the folder that `Plan.write` or ``planner grade`` wrote.

    Returns
    -------
    Plan
        Its shells stay in their files, so that it cannot be written again.

    Raises
    ------
    FileError
        The file is missing, or is no plan of schema 1; the message names the key.

    Examples
    --------
    >>> planner.read_plan("finger-graded").regions[0].material  # doctest: +SKIP
    'TangoPlus'
    """
    file = plan_file(path)
    # A program may change its working directory between reading a plan and using it.
    return dataclasses.replace(decode_plan(read_file(file), str(file)), file=file.absolute())


def decode_plan(data: bytes, name: str) -> Plan:
    """Read the bytes of a plan.json, which errors call `name`; see `read_plan`."""
    document = decode_document(data, dict[str, Any], name)
    gradient = document.get("gradient")
    if isinstance(gradient, dict):
        gradient |= {name: gradient.pop(called, None) for name, called in _CALLED.items()}
    for kept_beside in _BESIDE:
        document.pop(kept_beside, None)
    said = "{}; it is not a plan.json of schema 1"
    with refused(FileError, name, said, msgspec.ValidationError):
        plan = msgspec.convert(document, Plan)
    with refused(FileError, name, f"blend or snap: {said}", msgspec.ValidationError):
        for region in plan.regions:
            msgspec.convert(region.blend, _Dithered | _InTurn | _Mixed | None)
        msgspec.convert(plan.gradient.snap, _Snapped | None)
    if not _NAME.fullmatch(plan.name):
        raise FileError(
            f"{name}: part.name is {plan.name!r}; files are called by it: it may hold letters, "
            "digits, '.', '-' and '_'"
        )
    return plan


_NAME = re.compile(r"[A-Za-z0-9._-]+")


class _Blended(msgspec.Struct, tag_field="kind"):
    """What every blend of a region has; with its further keys it is kept as it stands."""

    lower: str
    upper: str


class _Dithered(_Blended, tag="dither"):
    volume_fraction: float
    moduli_MPa: _Pair


class _InTurn(_Blended, tag="bands"):
    share: float


class _Mixed(_Blended, tag="mix"):
    fraction: float
    name: str


class _Cut(msgspec.Struct):
    by_mm: float


class _Snapped(msgspec.Struct):
    moved: tuple[_Cut, ...]


# ------------------------------------------------------------------------------------------------
# The shells of a plan, which it holds where it was just made, and which else lie in its folder.


def read_shells(plan: Plan) -> Iterator[tuple[str, Triangles]]:
    """Yield a plan's shells by file, from soft to hard, those of the plan's folder unaltered.

    Raises
    ------
    FileError
        A shell is missing, lies outside the folder, or is not the one that the plan was written
        with; or there is none.
    """
    from planner.formats.mesh_file import decode_stl

    for shell in plan.shells:
        yield shell.file, decode_stl(shell.stl, shell.file)
    if plan.shells:
        return
    folder = plan_file(plan).parent
    files = {region.file: region for region in plan.regions}
    for file in sorted(files):
        data, altered = read_shell(folder, files[file])
        if altered:
            raise FileError(
                f"{folder / file}: its content is not what the plan was written with; grade the "
                "part again (planner check says what else is wrong)"
            )
        yield file, decode_stl(data, file)
    if not files:
        raise FileError(f"{folder}: the plan has no regions; grade the part again")


def read_shell(folder: Path, region: Region) -> tuple[bytes, bool]:
    """Return a region's STL from the plan's folder, and whether it has been altered.

    Raises
    ------
    FileError
        It is missing, or lies outside the folder.
    """
    place = path_within(folder, region.file)
    data = read_file(place, advice="keep it beside plan.json, or grade the part again")
    return data, hashlib.sha256(data).hexdigest() != region.sha256


def _without_none(value: Any) -> Any:
    if isinstance(value, dict):
        # A mass that is unknown is there, as null.
        return {k: _without_none(v) for k, v in value.items() if v is not None or k == "mass_g"}
    return [_without_none(v) for v in value] if isinstance(value, (list, tuple)) else value
