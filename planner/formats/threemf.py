"""3MF by lib3mf, read and written: the same bytes for the same content."""

import ctypes
import functools
import graphlib
import hashlib
import io
import re
import uuid
import zipfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from html import escape
from pathlib import Path
from typing import Any, TypeAlias

import lib3mf
import numpy as np
from numpy.typing import NDArray

from planner.errors import FileError, MeshError, OutputError, check_known, refused
from planner.formats.files import USUAL_LIMITS, UnfoldingLimits, read_file, unpacked
from planner.glance import channels
from planner.numerics import Float32Array, FloatArray, IntArray, inner_kernel, kernel

__all__ = [
    "Constituent",
    "ThreemfObject",
    "composite_name",
    "decode_threemf",
    "encode_threemf",
    "mixed_colour",
    "needs_one_mesh",
    "read_threemf",
]


# ------------------------------------------------------------------------------------------------
# What a 3MF file holds, as far as planner is concerned.


@dataclass(frozen=True, slots=True)
class Constituent:
    """A material of a mixture, its display colour, and its share, 0 to 1."""

    name: str
    colour: str
    share: float


def composite_name(constituents: Sequence[Constituent]) -> str:
    """Return what a mixture is called: ``FLX9740-62.5_FLX9750-37.5``, shares in per cent."""
    return "_".join(f"{part.name}-{100.0 * part.share:.1f}" for part in constituents)


def mixed_colour(constituents: Sequence[Constituent]) -> str:
    """Return the display colour of a mixture, ``#RRGGBB``."""
    mixed = [sum(part.share * channels(part.colour)[k] for part in constituents) for k in range(3)]
    return "#" + "".join(f"{min(255, round(channel)):02X}" for channel in mixed)


@dataclass(frozen=True, slots=True)
class ThreemfObject:
    """One mesh of a 3MF file, of one material or one mixture.

    Attributes
    ----------
    vertices, faces
        (n, 3) positions, float32 for writing, and (m, 3) outward triangles.
    material_name, colour
        Entry of the base material group, ``#RRGGBB``; empty when a file that was read has none.
        Of a mixture, `composite_name` and `mixed_colour` of its constituents.
    constituents
        Of a mixture: its materials and their shares, which add up to 1.
    metadata
        To write with the object; it is not read back. Names that the core specification knows are
        written as they are, others in `urn:planner:mixture:1`; they are plain words (letters,
        digits, ``_``, ``-``, ``.``).
    """

    name: str
    vertices: Float32Array | FloatArray
    faces: IntArray
    material_name: str = ""
    colour: str = ""
    metadata: Mapping[str, str] = field(default_factory=dict)
    constituents: tuple[Constituent, ...] = ()


@dataclass(frozen=True, slots=True)
class ThreemfModel:
    """What a 3MF file puts on the tray.

    Attributes
    ----------
    unit
        mm, um, cm, m, inch or ft; what the objects' coordinates are in.
    objects
        Each mesh as often as it is placed, where it is placed, in the order of the build items.
    remarks
        The reader's warnings, and what was left out.
    """

    unit: str
    objects: tuple[ThreemfObject, ...]
    remarks: tuple[str, ...]


# ------------------------------------------------------------------------------------------------
# What the build of a file unfolds to, counted from its text before anything is unfolded.


_Key = tuple[str, int]
"""An object: the archive's member that holds it, and its number there."""


@dataclass(slots=True)
class _Object:
    triangles: int = 0
    components: list[_Key] = field(default_factory=list)


def _check_structure(data: bytes, name: str, limits: UnfoldingLimits) -> None:
    """Refuse a 3MF file that holds, or unfolds to, more than planner reads.

    Nothing is built of it: of the members' text only what makes the structure is looked at
    (objects, components, build items, a triangle's first corner).
    Each object is counted once, however often it is placed. Whatever else is wrong with the file
    is left to its reader.

    Parameters
    ----------
    data, name
        The whole file, and what errors call it.

    Raises
    ------
    MeshError
        No zip archive, or one that does not hold what it promises; or more than a limit.
    """
    objects: dict[_Key, _Object] = {}
    items: list[_Key] = []
    called = f"{name}: not a 3MF file that can be read"
    try:
        for member, text in unpacked(data, called, limits.unpacked_bytes):
            for key in _scan(member, text, objects):
                items += [key] if key else []
                if len(objects) > limits.objects:
                    raise _refusal(name, f"holds more than {limits.objects:,} objects")
    except FileError as error:
        raise MeshError(str(error)) from error
    stored = sum(found.triangles for found in objects.values())
    cycle = "objects are components of each other; export the part again"
    with refused(MeshError, called, cycle, graphlib.CycleError):
        placed, triangles, depth = _unfold(objects, items)
    for what, got, most in (
        ("unfolds to {} objects, assemblies included", placed, limits.objects),
        ("unfolds to {} triangles", triangles, max(limits.triangles, stored)),
        ("nests components {} deep", depth, limits.depth),
    ):
        if got > most:
            said = what.format(f"{got:,}" if got < 10**15 else "over 10^15")
            raise _refusal(name, f"{said}, more than the {most:,} that planner reads")


def _refusal(name: str, what: str) -> MeshError:
    return MeshError(
        f"{name}: {what}; print fewer copies at once, export the part coarser, or read it from a "
        "script with higher limits (planner.formats.mesh_file.read_mesh)"
    )


_TAG = re.compile(  # of what is no comment; no value of XML has a "<"
    rb"<!--.*?(?:-->|\Z)|<\?.*?(?:\?>|\Z)|<(?:[\w.-]+:)?(object|component|item)"
    rb"""(\s(?:[^<>"']|"[^"<]*"|'[^'<]*')*+)>""",
    re.DOTALL,
)
_ATTRIBUTE = re.compile(rb"""([\w.-]+)\s*=\s*(?:"([^"]*)"|'([^']*)')""")
_CORNER = b"v1"
"""Each triangle has this attribute once, whatever its prefix and blanks."""


def _scan(member: str, text: bytes, objects: dict[_Key, _Object]) -> Iterator[_Key | None]:
    """Add the objects of a member of the archive, and yield what its build items place."""
    current, counted = _Object(), 0
    for tag in _TAG.finditer(text):
        current.triangles += text.count(_CORNER, counted, tag.start())
        counted = tag.end()
        said = {key: double or single for key, double, single in _ATTRIBUTE.findall(tag[2] or b"")}
        number = said.get(b"id" if tag[1] == b"object" else b"objectid")
        key = _key(member, said.get(b"path"), number)
        if key is None:  # the reader will say what is wrong
            continue
        if tag[1] == b"object":
            current = objects.setdefault(key, _Object())
        elif tag[1] == b"component":
            current.components.append(key)
        yield key if tag[1] == b"item" else None
    current.triangles += text.count(_CORNER, counted)


def _key(member: str, path: bytes | None, number: bytes | None) -> _Key | None:
    where = member if path is None else path.decode("utf-8", "replace").lstrip("/")
    try:
        return where.casefold(), int(number or b"")
    except ValueError:
        return None


def _unfold(objects: dict[_Key, _Object], items: list[_Key]) -> tuple[int, int, int]:
    """Return how many objects and triangles the items place, and how deep components are nested.

    Each object's own sum is made once, after those of its components. What refers to nothing adds
    nothing: the reader refuses it.

    Raises
    ------
    graphlib.CycleError
        Objects are components of each other.
    """
    known: dict[_Key, tuple[int, int, int]] = {}

    def of(keys: list[_Key]) -> tuple[int, int, int]:
        parts = [known[key] for key in keys if key in known]
        counts, triangles, depths = zip((0, 0, 0), *parts, strict=True)
        return sum(counts), sum(triangles), max(depths)

    within = {key: own.components for key, own in objects.items()}
    for key in graphlib.TopologicalSorter(within).static_order():
        if key in objects:
            count, triangles, depth = of(objects[key].components)
            known[key] = 1 + count, objects[key].triangles + triangles, 1 + depth
    return (*of(items)[:2], of([*known])[2])


# ------------------------------------------------------------------------------------------------
# 3MF read by lib3mf: every mesh where the build puts it.


_BAMBU_PART = "/Metadata/model_settings.config"
_PRUSA_PART = "/Metadata/Slic3r_PE_model.config"
_CURA_NAMESPACE = "http://software.ultimaker.com/xml/cura/3mf/2015/10"

_UNITS = ("um", "mm", "cm", "inch", "ft", "m")
"""What those of `lib3mf.ModelUnit` are called here, by their numbers."""


_wrapper = functools.cache(lib3mf.get_wrapper)

_UNKNOWN_ATTRIBUTE = 0x80A7
"""Of an extension, where lib3mf does not look for it, as trimesh writes them. The specification has
readers ignore what they do not know, unless the file requires the extension, which is an error."""


def read_threemf(path: str | Path) -> ThreemfModel:
    """Read a 3MF file; see `decode_threemf`.

    Raises
    ------
    MeshError
        The file cannot be opened, or see `decode_threemf`.
    """
    return decode_threemf(read_file(path, error=MeshError), str(path))


def decode_threemf(data: bytes, name: str, limits: UnfoldingLimits = USUAL_LIMITS) -> ThreemfModel:
    """Read the bytes of a 3MF file: every model object where the build items put it.

    Transforms of items and nested components are applied; a mirrored object's triangles are
    turned over, so that outside stays outside. A mesh whose triangles are of several materials
    gives an object a material. Supports and bare surfaces are left out.

    Parameters
    ----------
    data, name
        The whole file, and what errors call it.
    limits
        What the file may hold and its build unfold to, counted before anything is unfolded.

    Raises
    ------
    MeshError
        No 3MF, or more than `limits`; or it holds what is no mesh: a beam lattice, an implicit
        volume.
    """
    _check_structure(data, name, limits)
    model = _wrapper().CreateModel()
    reader = model.QueryReader("3mf")
    remarks = []
    with refused(MeshError, name, "not a 3MF file that can be read: {}", lib3mf.ELib3MFException):
        # lib3mf's own method makes a list of the bytes.
        content = ctypes.cast(ctypes.c_char_p(data), ctypes.POINTER(ctypes.c_uint8))
        read, size = _wrapper().lib.lib3mf_reader_readfrombuffer, ctypes.c_uint64(len(data))
        _wrapper().checkError(reader, read(reader._handle, size, content))
        warnings = [reader.GetWarning(i) for i in range(reader.GetWarningCount())]
        told = [text for code, text in warnings if code != _UNKNOWN_ATTRIBUTE]
        remarks += [f"3MF reader: {text}" for text in dict.fromkeys(told)]
        stored: dict[int, list[ThreemfObject]] = {}
        objects: list[ThreemfObject] = []
        for mesh, matrix in _meshes(model.GetBuildItems(), name, remarks):
            number = mesh.GetUniqueResourceID()
            if number not in stored:
                stored[number] = [*_objects(model, mesh)]
            objects += [_placed(each, matrix, name) for each in stored[number]]
        return ThreemfModel(_UNITS[model.GetUnit()], tuple(objects), tuple(remarks))


def _meshes(items: Any, name: str, remarks: list[str]) -> Iterator[tuple[Any, FloatArray]]:
    """Yield the meshes of a build in its order, each with the matrix from its points to the tray.

    Without recursion, since components may be nested deeper than Python recurs.
    """
    waiting = []
    while items.MoveNext():
        item = items.GetCurrent()
        waiting.append((item.GetObjectResource(), _matrix(item.GetObjectTransform())))
    waiting.reverse()
    while waiting:
        resource, matrix = waiting.pop()
        called = f"object {resource.GetName() or resource.GetResourceID()!r}"
        if resource.GetType() != lib3mf.ObjectType.Model and not resource.IsComponentsObject():
            remark = f"{called} is no model but support or a surface: left out"
            remarks += [] if remark in remarks else [remark]
        elif resource.IsComponentsObject():
            for number in reversed(range(resource.GetComponentCount())):
                component = resource.GetComponent(number)
                own = _matrix(component.GetTransform())
                with np.errstate(over="ignore", invalid="ignore"):  # told where it is applied
                    waiting.append((component.GetObjectResource(), own @ matrix))
        elif not resource.IsMeshObject() or resource.BeamLattice().GetBeamCount() > 0:
            raise MeshError(
                f"{name}: {called} is an implicit volume or a beam lattice; planner reads meshes: "
                "export the part as triangles"
            )
        else:
            yield resource, matrix


def _matrix(transform: Any) -> FloatArray:
    """Return a transform as the 4x4 matrix that row vectors (x, y, z, 1) are multiplied by."""
    matrix = np.eye(4)
    matrix[:, :3] = np.frombuffer(transform, dtype=np.float32).reshape(4, 3)
    return matrix


def _placed(item: ThreemfObject, matrix: FloatArray, name: str) -> ThreemfObject:
    if np.array_equal(matrix, np.eye(4)):
        return item
    x, y, z = item.vertices.astype(np.float64).T
    with np.errstate(over="ignore", invalid="ignore"):
        vertices = np.stack([x * a + y * b + z * c + d for a, b, c, d in matrix.T[:3]], axis=1)
        mirrored = np.linalg.det(matrix) < 0.0
    if not (np.isfinite(matrix).all() and np.isfinite(vertices).all()):
        raise MeshError(
            f"{name}: object {item.name!r} is placed by a transform that is not finite or too "
            f"large: {matrix[:, :3].ravel().tolist()}; export the part again"
        )
    faces = np.ascontiguousarray(item.faces[:, ::-1]) if mirrored else item.faces
    return replace(item, vertices=vertices, faces=faces)


def _objects(model: Any, mesh: Any) -> Iterator[ThreemfObject]:
    """Yield what a mesh holds, an object for each of its materials, where the mesh itself lies."""
    vertices = _array(mesh, "vertices", lib3mf.Position, np.float32, 3)
    faces = _array(mesh, "triangleindices", lib3mf.Triangle, np.int32, 3)
    for used, (material, colour, parts) in _materials(model, mesh):
        corners, own = vertices, faces
        if used is not None:
            kept, own = np.unique(faces[used], return_inverse=True)
            corners, own = vertices[kept], own.reshape(-1, 3).astype(np.int32)
        yield ThreemfObject(mesh.GetName(), corners, own, material, colour, constituents=parts)


def _array(mesh: Any, what: str, type_: Any, dtype: Any, width: int) -> NDArray[Any]:
    """Copy one of a mesh's arrays at once; lib3mf's own getters make a list of objects."""
    count = mesh.GetVertexCount() if what == "vertices" else mesh.GetTriangleCount()
    buffer = (type_ * count)()
    get = getattr(_wrapper().lib, f"lib3mf_meshobject_get{what}")
    _wrapper().checkError(
        mesh, get(mesh._handle, ctypes.c_uint64(count), ctypes.c_uint64(0), buffer)
    )
    return np.frombuffer(buffer, dtype=dtype).reshape(-1, width).copy()


_Material = tuple[str, str, tuple[Constituent, ...]]


def _materials(model: Any, mesh: Any) -> list[tuple[NDArray[np.intp] | None, _Material]]:
    """Return a mesh's materials, each with the triangles that are of it; None: all of them."""
    group, entry, has = mesh.GetObjectLevelProperty()
    whole = _material(model, group if has else 0, entry)
    properties = _array(mesh, "alltriangleproperties", lib3mf.TriangleProperties, np.uint32, 4)
    # One number for group and entry: a material's property is one for the whole triangle.
    keys = properties[:, 0].astype(np.uint64) << 32 | properties[:, 1]
    if not len(keys):
        return [(None, whole)]
    if (keys == keys[0]).all():
        keys = keys[:1]
    kinds, first, which = np.unique(keys, return_index=True, return_inverse=True)
    triangles: dict[_Material, list[NDArray[np.intp]]] = {}
    for kind in np.argsort(first):
        group, entry = divmod(int(kinds[kind]), 1 << 32)
        found = _material(model, group, entry) if group else whole
        triangles.setdefault(found, []).append(np.flatnonzero(which == kind))
    if len(triangles) == 1:
        return [(None, found)]
    return [(np.sort(np.concatenate(parts)), found) for found, parts in triangles.items()]


def _material(model: Any, group: int, entry: int) -> _Material:
    """Return the material that a property means, its colour, and what it is mixed of."""
    kind = model.GetPropertyTypeByID(group) if group else lib3mf.PropertyType.NoPropertyType
    if kind == lib3mf.PropertyType.BaseMaterial:
        return *_base(model.GetBaseMaterialGroupByID(group), entry), ()
    if kind != lib3mf.PropertyType.Composite:
        return "", "", ()
    composites = model.GetCompositeMaterialsByID(group)
    bases = composites.GetBaseMaterialGroup()
    # A group's composites share one list of materials: those without a share are left out.
    mixed = (part for part in composites.GetComposite(entry) if part.MixingRatio > 0.0)
    parts = tuple(Constituent(*_base(bases, one.PropertyID), one.MixingRatio) for one in mixed)
    return composite_name(parts), mixed_colour(parts), parts


def _base(bases: Any, entry: int) -> tuple[str, str]:
    red, green, blue, _ = _wrapper().ColorToRGBA(bases.GetDisplayColor(entry))
    return bases.GetName(entry), f"#{red:02X}{green:02X}{blue:02X}"


# ------------------------------------------------------------------------------------------------
# 3MF by lib3mf: one object a material under one assembly, or all as one mesh for a slicer that
# needs it; the same bytes for the same content.


_NAMESPACE = "urn:planner:mixture:1"
"""XML namespace of the metadata that the 3MF core specification has no name for."""

_WELL_KNOWN = (
    *("Title", "Designer", "Description", "Copyright", "LicenseTerms", "Rating"),
    *("CreationDate", "ModificationDate", "Application"),
)
_SETTINGS = "urn:planner:slicer-settings:1"
"""Relationship from the model to what slicers read beside it."""

_THUMBNAIL = "/Metadata/Thumbnail.png"
"""Readers find it by its relationship. assimp up to 5.3 takes pictures called thumbnail for
textures, and crashes (github.com/assimp/assimp/issues/5328); names of parts do not count case."""

_UUIDS = uuid.uuid5(uuid.NAMESPACE_URL, _NAMESPACE)
_FIRST = ("[Content_Types].xml", "_rels/.rels", "3D/3dmodel.model")

_Text: TypeAlias = Iterator[bytes | memoryview]
"""Of a mesh, piece by piece: all of it takes a hundred MB a million triangles."""


def encode_threemf(
    objects: Sequence[ThreemfObject],
    assembly_name: str,
    *,
    thumbnail: bytes | None = None,
    one_mesh: bool = False,
) -> bytes:
    """Make a 3MF file in mm: the objects as components of one assembly, built once.

    Each material is one ``<base>`` with its display colour, each mixture one ``<composite>`` of
    such materials with its mixing ratios (materials extension). The identifiers of objects,
    components, item and build are derived from the content (UUID version 5), so that equal
    content gives equal bytes. Slicers' settings (`needs_one_mesh`) number the materials
    from 1, in the order of the objects.

    Parameters
    ----------
    objects
        At least one, each with at least one triangle.
    assembly_name
        Name of the assembly, and the model's title.
    thumbnail
        PNG that file managers show of it.
    one_mesh
        Put all objects into one mesh, one after the other, each triangle with its material; the
        objects' metadata has no place there. PrusaSlicer makes parts of one object from it alone.

    Raises
    ------
    OutputError
        No objects, or a mesh, colour or metadata that 3MF cannot hold.
    """
    if not objects:
        raise OutputError(f"3MF of {assembly_name}: no objects; a file needs at least one")
    model = _wrapper().CreateModel()
    model.SetUnit(lib3mf.ModelUnit.MilliMeter)
    heading = {"Title": assembly_name, "Application": "planner"}
    _add_metadata(model.GetMetaDataGroup(), heading, assembly_name)
    palette = _Materials(model)
    for item in objects:
        _check_mesh(item, assembly_name)
    with refused(OutputError, f"3MF of {assembly_name}", "{}", lib3mf.ELib3MFException):
        materials = [palette.property_of(item) for item in objects]
        extruders = {material: n for n, material in enumerate(dict.fromkeys(materials), start=1)}
        pairs = zip(objects, materials, strict=True)
        shells = [_Shell(item, of, extruders[of], _digest(item)) for item, of in pairs]
        add = _add_one_mesh if one_mesh else _add_assembly
        whole, meshes = add(model, shells, _text(assembly_name))
        layout = ("one mesh",) if one_mesh else ()
        content = (_text(assembly_name), *layout, *(shell.digest for shell in shells))
        digest = hashlib.sha256("\n".join(content).encode()).hexdigest()
        whole.SetName(_text(assembly_name))
        whole.SetUUID(_identifier("assembly", 0, digest))
        item = model.AddBuildItem(whole, _wrapper().GetIdentityTransform())
        item.SetUUID(_identifier("item", 0, digest))
        model.SetBuildUUID(_identifier("build", 0, digest))
        if thumbnail is not None:
            picture = model.CreatePackageThumbnailAttachment()
            picture.SetPath(_THUMBNAIL)
            picture.ReadFromBuffer(thumbnail)
        bare = bytes(model.QueryWriter("3mf").WriteToBuffer())
    return _archive(_filled(bare, meshes))


@dataclass(frozen=True, slots=True)
class _Shell:
    """An object to write, its material as group and entry of the model, and a hash of it all.

    Materials are counted from 1, in the order of the shells: that is the `extruder`.
    """

    item: ThreemfObject
    material: tuple[int, int]
    extruder: int
    digest: str


def _add_assembly(model: Any, shells: Sequence[_Shell], name: str) -> tuple[Any, list[_Text]]:
    assembly = model.AddComponentsObject()
    parts, meshes = [], list[_Text]()
    for count, shell in enumerate(shells, start=1):
        item = shell.item
        mesh = _add_mesh(model, item.name)
        meshes.append(_mesh_text(item.vertices, [(item.faces, b"")]))
        _add_metadata(mesh.GetMetaDataGroup(), item.metadata, item.name)
        # Cura counts from 0, the others from 1.
        mesh.GetMetaDataGroup().AddMetaData(
            _CURA_NAMESPACE, "extruder_nr", str(shell.extruder - 1), "xs:integer", True
        )
        mesh.SetUUID(_identifier("object", count, shell.digest))
        mesh.SetObjectLevelProperty(*shell.material)
        component = assembly.AddComponent(mesh, _wrapper().GetIdentityTransform())
        component.SetUUID(_identifier("component", count, shell.digest))
        opening = f'part id="{mesh.GetModelResourceID()}" subtype="normal_part"'
        parts.append((opening, {"name": _text(item.name), "extruder": shell.extruder}))
    opening = f'object id="{assembly.GetModelResourceID()}"'
    _attach(model, _BAMBU_PART, _settings(opening, name, parts))
    return assembly, meshes


def _add_one_mesh(model: Any, shells: Sequence[_Shell], name: str) -> tuple[Any, list[_Text]]:
    mesh = _add_mesh(model, name)
    mesh.SetObjectLevelProperty(*shells[0].material)
    parts, volumes = [], []
    first = start = 0
    for shell in shells:
        group, entry = shell.material
        number = model.GetResourceByID(group).GetModelResourceID()
        # lib3mf counts entries from 1, its files from 0.
        parts.append((shell.item.faces + start, f' pid="{number}" p1="{entry - 1}"'.encode()))
        start += len(shell.item.vertices)
        end = first + len(shell.item.faces)
        said = {"name": _text(shell.item.name), "volume_type": "ModelPart"}
        opening = f'volume firstid="{first}" lastid="{end - 1}"'
        volumes.append((opening, {**said, "extruder": shell.extruder}))
        first = end
    vertices = np.concatenate([shell.item.vertices for shell in shells])
    opening = f'object id="{mesh.GetModelResourceID()}" instances_count="1"'
    _attach(model, _PRUSA_PART, _settings(opening, name, volumes, typed=True))
    return mesh, [_mesh_text(vertices, parts)]


def _attach(model: Any, path: str, content: bytes) -> None:
    model.AddCustomContentType("config", "application/xml")
    model.AddAttachment(path, _SETTINGS).ReadFromBuffer(content)


def _identifier(kind: str, number: int, digest: str) -> str:
    return str(uuid.uuid5(_UUIDS, f"{kind}/{number}/{digest}"))


def _digest(item: ThreemfObject) -> str:
    text = "\n".join((item.name, item.material_name, item.colour, *map(str, item.metadata.items())))
    text += "".join(f"\n{part.name} {part.colour} {part.share!r}" for part in item.constituents)
    digest = hashlib.sha256(_text(text).encode("utf-8"))
    digest.update(np.ascontiguousarray(item.vertices, dtype="<f4").tobytes())
    digest.update(np.ascontiguousarray(item.faces, dtype="<i4").tobytes())
    return digest.hexdigest()


def _text(value: str) -> str:
    """Replace what XML cannot hold: control characters, and halves of surrogate pairs.

    Such halves stand for the bytes of a file name that are not UTF-8.
    """
    return re.sub(r"[^\t\n\r -\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]", "?", value)


class _Materials:
    """The materials and mixtures of a model, each once."""

    def __init__(self, model: Any) -> None:
        self.model, self.bases = model, model.AddBaseMaterialGroup()
        self.composites: Any = None
        self.entries: dict[object, int] = {}

    def property_of(self, item: ThreemfObject) -> tuple[int, int]:
        """Return the group and entry of an object's material, made where it is new."""
        if not item.constituents:
            entry = self._base(item.name, item.material_name, item.colour)
            return self.bases.GetUniqueResourceID(), entry
        shares = [part.share for part in item.constituents]
        total = sum(shares)
        if not (abs(total - 1.0) < 1e-6 and min(shares) >= 0.0):
            raise OutputError(
                f"3MF object {item.name}: the shares of its mixture add up to {total:g}; they must "
                "be 0 to 1 and add up to 1"
            )
        if item.constituents not in self.entries:
            bases = [self._base(item.name, part.name, part.colour) for part in item.constituents]
            parts = list(map(lib3mf.CompositeConstituent, bases, shares))
            if self.composites is None:
                self.composites = self.model.AddCompositeMaterials(self.bases)
            self.entries[item.constituents] = self.composites.AddComposite(parts)
        return self.composites.GetUniqueResourceID(), self.entries[item.constituents]

    def _base(self, owner: str, name: str, colour: str) -> int:
        if (name, colour) not in self.entries:
            if not re.fullmatch(r"#[0-9A-Fa-f]{6}", colour):
                raise OutputError(
                    f"3MF object {owner}: colour is {colour!r}; write it as '#RRGGBB'"
                )
            shown = _wrapper().RGBAToColor(*bytes.fromhex(colour[1:]), 255)
            self.entries[name, colour] = self.bases.AddMaterial(_text(name), shown)
        return self.entries[name, colour]


def _add_metadata(group: Any, metadata: Mapping[str, str], owner: str) -> None:
    for name, value in metadata.items():
        if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_.-]*", name):
            raise OutputError(
                f"3MF of {owner}: metadata {name!r}: a name begins with a letter and goes on "
                "with letters, digits, '_', '.' and '-'"
            )
        namespace = "" if name in _WELL_KNOWN else _NAMESPACE
        group.AddMetaData(namespace, name, _text(value), "xs:string", True)


def _add_mesh(model: Any, name: str) -> Any:
    """Add a mesh of one triangle, in whose place `_filled` puts another."""
    mesh = model.AddMeshObject()
    corners = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    places = [mesh.AddVertex(lib3mf.Position((ctypes.c_float * 3)(*each))) for each in corners]
    mesh.AddTriangle(lib3mf.Triangle((ctypes.c_uint32 * 3)(*places)))
    mesh.SetName(_text(name))
    return mesh


def _check_mesh(item: ThreemfObject, assembly_name: str) -> None:
    """Refuse what readers do not take."""
    a, b, c = item.faces.T
    if len(item.faces) == 0 or not np.isfinite(item.vertices).all():
        fault = "no triangles" if len(item.faces) == 0 else "a vertex that is not finite"
    elif item.faces.min() < 0 or item.faces.max() >= len(item.vertices):
        fault = "a triangle whose vertex is not there"
    elif ((a == b) | (b == c) | (c == a)).any():
        fault = "a triangle with one vertex twice"
    else:
        return
    raise OutputError(
        f"3MF of {assembly_name}: object {item.name}: {fault}; leave it out or mend the mesh"
    )


_MESH = re.compile(rb"<vertices>.*?</triangles>", re.DOTALL)


def _filled(bare: bytes, meshes: Sequence[_Text]) -> Iterator[tuple[str, _Text]]:
    """Yield the members of a file, with the text of meshes in the places of those there."""
    members = dict(unpacked(bare, "3MF"))
    for member in (*_FIRST, *sorted(members.keys() - _FIRST)):
        yield member, _with_meshes(members[member], meshes)


def _with_meshes(text: bytes, meshes: Sequence[_Text]) -> _Text:
    first, *rest = _MESH.split(text)
    yield first
    for mesh, after in zip(meshes if rest else (), rest, strict=True):
        yield from mesh
        yield after


# ------------------------------------------------------------------------------------------------
# The zip archive of a file, in one canonical form.


_FAST = 1  # of zlib: a quarter larger than usual, in a fifth of the time
_UNIX, _UNIX_FILE = 3, 0o100644 << 16


def _archive(members: Iterable[tuple[str, _Text]]) -> bytes:
    """Make a zip archive with fixed dates and permissions, and without zip64.

    Some readers of 3MF take neither zip64 nor a date of zero, both of which lib3mf writes.

    Parameters
    ----------
    members
        In the archive's order: name, and content piece by piece.

    Raises
    ------
    OutputError
        A member or the whole has more than 2 GiB, for which `zipfile` takes zip64.
    """
    data, most = io.BytesIO(), "takes more than 2 GiB ({}); reduce the number of triangles"
    with (
        refused(OutputError, "3MF", most, zipfile.LargeZipFile, RuntimeError),
        zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED, False, compresslevel=_FAST) as archive,
    ):
        for name, pieces in members:
            with archive.open(name, "w") as file:
                file.writelines(pieces)
            made = archive.getinfo(name)
            made.create_system, made.external_attr = _UNIX, _UNIX_FILE
    return data.getvalue()


# ------------------------------------------------------------------------------------------------
# Meshes as text: figures as short as float32 needs to be read back the same.


_ROWS = 1 << 16  # at a time: 5 MB of text


def _mesh_text(vertices: Float32Array | FloatArray, parts: list[tuple[IntArray, bytes]]) -> _Text:
    """Write the elements ``vertices`` and ``triangles`` of a mesh, piece by piece.

    Nine digits tell all values of float32 apart, and mostly seven or eight do. lib3mf writes as
    many decimals of all, by a unit in the last place of float32 off, and takes four times as long.

    Parameters
    ----------
    vertices
        (n, 3) finite positions, to write as float32.
    parts
        (m, 3) corners, and what their ``triangle`` elements have besides: `` pid="1" p1="0"``.
    """
    yield b"<vertices>\n"
    yield from _elements(vertices, b'<vertex x="\0" y="\0" z="\0"/>\n', whole=False)
    yield b"</vertices>\n<triangles>\n"
    for corners, besides in parts:
        form = b'<triangle v1="\0" v2="\0" v3="\0"' + besides + b"/>\n"
        yield from _elements(corners, form, whole=True)
    yield b"</triangles>"


def _elements(figures: FloatArray | Float32Array | IntArray, form: bytes, *, whole: bool) -> _Text:
    """Write an element for each row of figures, (n, 3), which take the place of a form's zeros."""
    signs = np.frombuffer(form, np.uint8)
    for start in range(0, len(figures), _ROWS):
        rows = np.array(figures[start : start + _ROWS], np.float64, order="C")
        text = np.empty(len(rows) * (len(form) + 3 * _LONGEST_FIGURE), np.uint8)
        yield text[: _write_rows(rows, signs, whole, text)].data


_LONGEST_FIGURE = len(str(2**63))


@kernel
def _write_rows(rows: Any, signs: Any, whole: Any, text: Any) -> Any:
    """Write the elements; return how long they are."""
    at = none = np.int64(0)  # literals of Python would be types of their own for _put_number
    for i in range(len(rows)):
        column = 0
        for sign in signs:
            if sign != 0:
                text[at] = sign
                at += 1
                continue
            if whole:
                at = _put_number(text, at, np.int64(rows[i, column]), none)
            else:
                at = _put_float(text, at, np.float32(rows[i, column]))
            column += 1
    return at


@inner_kernel
def _put_number(text: Any, at: Any, number: Any, decimals: Any) -> Any:
    """Write a number that is not negative, with a point before its last digits, the decimals."""
    digits: Any = 1
    rest = number // 10
    while rest > 0 or digits <= decimals:
        digits, rest = digits + 1, rest // 10
    point = at + digits - decimals
    end = at + digits + (1 if decimals > 0 else 0)
    for i in range(end - 1, at - 1, -1):
        if i == point:
            text[i] = 46
        else:
            text[i] = 48 + number % 10
            number //= 10
    return end


_TENS = 10.0 ** np.arange(15)  # exact


@inner_kernel
def _put_float(text: Any, at: Any, value: Any) -> Any:
    """Write the fewest digits from which float32 is read back, with an exponent if far from 1."""
    if value == 0.0:
        text[at] = 48
        return at + 1
    if value < 0.0:
        text[at] = 45
        at += 1
    left = abs(np.float64(value))
    exponent = np.int64(0)  # what is written as such
    while left >= 1e9:
        left, exponent = left / 10.0, exponent + 1
    while left < 1e-6:
        left, exponent = left * 10.0, exponent - 1
    before = np.int64(-5)  # digits before the point
    while before < 9 and left >= (_TENS[before] if before >= 0 else 1.0 / _TENS[-before]):
        before += 1
    digits: Any = 0
    decimals: Any = 0
    for figures in range(7 if exponent == 0 else 9, 10):
        decimals = max(figures - before, 0)
        digits = np.int64(np.rint(left * _TENS[decimals]))
        if np.float32(digits / _TENS[decimals]) == np.float32(left):
            break
    while decimals > 0 and digits % 10 == 0:
        digits, decimals = digits // 10, decimals - 1
    at = _put_number(text, at, digits, decimals)
    if exponent != 0:
        text[at] = 101
        at += 1
        if exponent < 0:
            text[at] = 45
            at += 1
        at = _put_number(text, at, abs(exponent), np.int64(0))
    return at


# ------------------------------------------------------------------------------------------------
# What slicers read beside the specification: the extruder or filament of each shell.
#
# No slicer takes it from base materials. Bambu Studio and OrcaSlicer read
# Metadata/model_settings.config, which numbers the parts of an assembly; Cura reads metadata of
# each mesh; PrusaSlicer makes an object of each component of an assembly, and parts of one object
# only from ranges of triangles of one mesh, which Metadata/Slic3r_PE_model.config tells.


_ONE_MESH = {"prusaslicer": True, "bambu": False, "orca": False, "cura": False}


def needs_one_mesh(slicer: str) -> bool:
    """Tell whether a slicer takes one part of many materials only as one mesh.

    Raises
    ------
    ArgumentError
        No slicer that planner knows; the message says what is near.
    """
    name = slicer.casefold()
    check_known(name, _ONE_MESH, f"slicer {slicer!r}: no such slicer; {{}}it may be")
    return _ONE_MESH[name]


_Part: TypeAlias = tuple[str, Mapping[str, object]]
"""An element with its attributes, and what is said of it."""


def _settings(opening: str, name: str, parts: Sequence[_Part], *, typed: bool = False) -> bytes:
    """Return the part of a 3MF that says which part of an object has which extruder.

    Parameters
    ----------
    opening, name
        The object's element with its attributes, and what it is called.
    parts
        Of each component or volume.
    typed
        Whether what is said has the element's name as its type.
    """

    def element(opening: str, said: Mapping[str, object], indent: str) -> list[str]:
        of = f'type="{opening.partition(" ")[0]}" ' if typed else ""
        return [f"{indent}<{opening}>"] + [
            f'{indent}  <metadata {of}key="{key}" value="{escape(str(value))}"/>'
            for key, value in said.items()
        ]

    lines = ['<?xml version="1.0" encoding="UTF-8"?>', "<config>"]
    lines += element(opening, {"name": name}, "  ")
    for part, said in parts:
        lines += [*element(part, said, "    "), f"    </{part.partition(' ')[0]}>"]
    return "\n".join([*lines, "  </object>", "</config>", ""]).encode("utf-8")
