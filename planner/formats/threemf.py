"""3MF by lib3mf: one object a material under one assembly, the same bytes for the same content."""

import ctypes
import hashlib
import re
import uuid
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import lib3mf
import numpy as np

from planner.errors import OutputError
from planner.formats.archive import canonical_archive, member_hashes
from planner.formats.threemf_model import ThreemfModel, ThreemfObject
from planner.formats.threemf_reader import decode_threemf, read_threemf

__all__ = [
    "NAMESPACE",
    "ThreemfModel",
    "ThreemfObject",
    "decode_threemf",
    "encode_threemf",
    "read_threemf",
    "threemf_xml_hashes",
    "write_threemf",
]

NAMESPACE = "urn:planner:mixture:1"
"""XML namespace of the metadata that the 3MF core specification has no name for."""

_WELL_KNOWN: tuple[str, ...] = (
    "Title",
    "Designer",
    "Description",
    "Copyright",
    "LicenseTerms",
    "Rating",
)
_WELL_KNOWN += ("CreationDate", "ModificationDate", "Application")
_UUIDS = uuid.uuid5(uuid.NAMESPACE_URL, NAMESPACE)
_FIRST = ("[Content_Types].xml", "_rels/.rels", "3D/3dmodel.model")
_DECIMALS = 9  # from 1 mm up nothing moves by more than one unit in the last place; by 6, eight


def write_threemf(
    path: str | Path,
    objects: Sequence[ThreemfObject],
    assembly_name: str,
    metadata: Mapping[str, str] | None = None,
) -> None:
    """Write the file that `encode_threemf` makes.

    Raises
    ------
    OutputError
        It cannot be written, or the content cannot be said in 3MF.
    """
    data = encode_threemf(objects, assembly_name, metadata)
    try:
        Path(path).write_bytes(data)
    except OSError as error:
        raise OutputError(f"{path}: {error.strerror or error}") from error


def encode_threemf(
    objects: Sequence[ThreemfObject],
    assembly_name: str,
    metadata: Mapping[str, str] | None = None,
) -> bytes:
    """Make a 3MF file in mm: the objects as components of one assembly, built once.

    Each material is one ``<base>`` with its display colour, each mixture one ``<composite>`` of
    such materials with its mixing ratios (materials extension). The identifiers of objects,
    components, item and build are derived from the content (UUID version 5), so that equal
    content gives equal bytes.

    Parameters
    ----------
    objects
        At least one, each with at least one triangle.
    assembly_name
        Name of the assembly, and the model's title unless `metadata` has one.
    metadata
        Of the model, as `ThreemfObject.metadata`.

    Raises
    ------
    OutputError
        No objects, or a mesh, colour or metadata that 3MF cannot hold.
    """
    if not objects:
        raise OutputError(f"3MF of {assembly_name}: no objects; a file needs at least one")
    wrapper = lib3mf.get_wrapper()
    model = wrapper.CreateModel()
    model.SetUnit(lib3mf.ModelUnit.MilliMeter)
    heading = {"Title": assembly_name, "Application": "planner"}
    _add_metadata(model.GetMetaDataGroup(), {**heading, **(metadata or {})}, assembly_name)
    bases = model.AddBaseMaterialGroup()
    palette = _Materials(wrapper, model, bases)
    digests = []
    try:
        assembly = model.AddComponentsObject()
        identity = wrapper.GetIdentityTransform()
        for number, item in enumerate(objects, start=1):
            group, entry = palette.property_of(item)
            digests.append(_digest(item))
            mesh = _add_mesh(wrapper, model, item)
            mesh.SetUUID(_identifier("object", number, digests[-1]))
            mesh.SetObjectLevelProperty(group, entry)
            component = assembly.AddComponent(mesh, identity)
            component.SetUUID(_identifier("component", number, digests[-1]))
        whole = hashlib.sha256(
            "\n".join((_text(assembly_name), *digests)).encode("utf-8")
        ).hexdigest()
        assembly.SetName(_text(assembly_name))
        assembly.SetUUID(_identifier("assembly", 0, whole))
        model.AddBuildItem(assembly, identity).SetUUID(_identifier("item", 0, whole))
        model.SetBuildUUID(_identifier("build", 0, whole))
        return canonical_archive(_written(model), _FIRST)
    except lib3mf.ELib3MFException as error:
        raise OutputError(f"3MF of {assembly_name}: {error}") from error


def threemf_xml_hashes(path: str | Path) -> dict[str, str]:
    """Return the SHA-256 of each part of a 3MF file by name, before compression.

    Raises
    ------
    FileError
        The file is missing or no zip archive.
    """
    return member_hashes(path)


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

    def __init__(self, wrapper: Any, model: Any, bases: Any) -> None:
        self.wrapper, self.model, self.bases = wrapper, model, bases
        self.composites: Any = None
        self.entries: dict[object, int] = {}

    def property_of(self, item: ThreemfObject) -> tuple[int, int]:
        """Return the group and entry of an object's material, made where it is new."""
        if not item.constituents:
            entry = self._base(item.name, item.material_name, item.colour)
            return self.bases.GetUniqueResourceID(), entry
        total = sum(part.share for part in item.constituents)
        if not (abs(total - 1.0) < 1e-6 and min(part.share for part in item.constituents) >= 0.0):
            raise OutputError(
                f"3MF object {item.name}: the shares of its mixture add up to {total:g}; they must "
                "be 0 to 1 and add up to 1"
            )
        if item.constituents not in self.entries:
            parts = [
                lib3mf.CompositeConstituent(
                    self._base(item.name, part.name, part.colour), part.share
                )
                for part in item.constituents
            ]
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
            shown = self.wrapper.RGBAToColor(*bytes.fromhex(colour[1:]), 255)
            self.entries[name, colour] = self.bases.AddMaterial(_text(name), shown)
        return self.entries[name, colour]


def _add_metadata(group: Any, metadata: Mapping[str, str], owner: str) -> None:
    for name, value in metadata.items():
        if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_.-]*", name):
            raise OutputError(
                f"3MF of {owner}: metadata {name!r}: a name begins with a letter and goes on "
                "with letters, digits, '_', '.' and '-'"
            )
        namespace = "" if name in _WELL_KNOWN else NAMESPACE
        group.AddMetaData(namespace, name, _text(value), "xs:string", True)


def _add_mesh(wrapper: Any, model: Any, item: ThreemfObject) -> Any:
    vertices = np.ascontiguousarray(item.vertices, dtype=np.float32)
    faces = np.ascontiguousarray(item.faces, dtype=np.uint32)
    if len(faces) == 0 or not np.isfinite(vertices).all():
        fault = "no triangles" if len(faces) == 0 else "a vertex that is not finite"
        raise OutputError(f"3MF object {item.name}: {fault}; leave it out or mend the mesh")
    mesh = model.AddMeshObject()
    # lib3mf's own SetGeometry takes Python lists: 700 times slower on a million triangles.
    wrapper.checkError(
        mesh,
        wrapper.lib.lib3mf_meshobject_setgeometry(
            mesh._handle,
            ctypes.c_uint64(len(vertices)),
            (lib3mf.Position * len(vertices)).from_buffer_copy(vertices),
            ctypes.c_uint64(len(faces)),
            (lib3mf.Triangle * len(faces)).from_buffer_copy(faces),
        ),
    )
    mesh.SetName(_text(item.name))
    _add_metadata(mesh.GetMetaDataGroup(), item.metadata, item.name)
    return mesh


def _written(model: Any) -> bytes:
    writer = model.QueryWriter("3mf")
    writer.SetDecimalPrecision(_DECIMALS)
    stream = bytearray()
    place = 0

    def write(address: int, size: int, _: int) -> None:
        nonlocal place
        stream[place : place + size] = ctypes.string_at(address, size)
        place += size

    def seek(position: int, _: int) -> None:
        nonlocal place
        place = position

    writer.WriteToCallback(lib3mf.WriteCallback(write), lib3mf.SeekCallback(seek), None)
    return bytes(stream)
