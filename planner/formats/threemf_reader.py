"""3MF read by lib3mf: every mesh where the build puts it."""

import ctypes
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import lib3mf
import numpy as np
from numpy.typing import NDArray

from planner.arrays import Float32Array, FloatArray
from planner.errors import MeshError
from planner.formats.threemf_model import (
    Constituent,
    ThreemfModel,
    ThreemfObject,
    composite_name,
    mixed_colour,
)

__all__ = ["decode_threemf", "read_threemf"]

_MOST_OBJECTS, _MOST_TRIANGLES = 10_000, 100_000_000
_UNITS = {
    lib3mf.ModelUnit.MicroMeter: "um",
    lib3mf.ModelUnit.MilliMeter: "mm",
    lib3mf.ModelUnit.CentiMeter: "cm",
    lib3mf.ModelUnit.Inch: "inch",
    lib3mf.ModelUnit.Foot: "ft",
    lib3mf.ModelUnit.Meter: "m",
}


def read_threemf(path: str | Path, *, strict: bool = False) -> ThreemfModel:
    """Read a 3MF file; see `decode_threemf`.

    Raises
    ------
    MeshError
        The file cannot be opened, or see `decode_threemf`.
    """
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise MeshError(f"{path}: cannot be read ({error.strerror or error})") from error
    return decode_threemf(data, str(path), strict=strict)


def decode_threemf(data: bytes, name: str, *, strict: bool = False) -> ThreemfModel:
    """Read the bytes of a 3MF file: every model object where the build items put it.

    Transforms of items and nested components are applied; a mirrored object's triangles are
    turned over, so that outside stays outside. Supports and bare surfaces are left out.

    Parameters
    ----------
    data, name
        The whole file, and what errors call it.
    strict
        Take the file only if it follows the specification to the letter.

    Raises
    ------
    MeshError
        No 3MF, or it holds what is no mesh: a beam lattice, an implicit volume.
    """
    wrapper = lib3mf.get_wrapper()
    model = wrapper.CreateModel()
    reader = model.QueryReader("3mf")
    reader.SetStrictModeActive(strict)
    remarks = []
    try:
        _read_from(reader, data)
        warnings = [reader.GetWarning(i)[-1] for i in range(reader.GetWarningCount())]
        remarks += [f"3MF reader: {text}" for text in dict.fromkeys(warnings)]
        objects: list[ThreemfObject] = []
        count = 0
        items = model.GetBuildItems()
        while items.MoveNext():
            item = items.GetCurrent()
            matrix = _matrix(item.GetObjectTransform()) if item.HasObjectTransform() else np.eye(4)
            for mesh, placed in _meshes(wrapper, item.GetObjectResource(), matrix, name, remarks):
                count += mesh.GetTriangleCount()
                if count > _MOST_TRIANGLES or len(objects) == _MOST_OBJECTS:
                    raise MeshError(
                        f"{name}: the build has more than {_MOST_OBJECTS} objects or "
                        f"{_MOST_TRIANGLES} triangles, components counted as often as they are "
                        "placed; print fewer copies at once"
                    )
                objects.append(_object(wrapper, model, mesh, placed))
        heading = _metadata(model.GetMetaDataGroup())
        return ThreemfModel(_UNITS[model.GetUnit()], tuple(objects), heading, tuple(remarks))
    except lib3mf.ELib3MFException as error:
        raise MeshError(f"{name}: not a 3MF file that can be read: {error}") from error


def _read_from(reader: Any, data: bytes) -> None:
    place = 0

    def read(address: int, size: int, _: int) -> None:
        nonlocal place
        chunk = data[place : place + size]
        ctypes.memmove(address, chunk, len(chunk))
        place += size

    def seek(position: int, _: int) -> None:
        nonlocal place
        place = position

    reader.ReadFromCallback(lib3mf.ReadCallback(read), len(data), lib3mf.SeekCallback(seek), None)


def _meshes(
    wrapper: Any, resource: Any, matrix: FloatArray, name: str, remarks: list[str]
) -> Iterator[tuple[Any, FloatArray]]:
    """Yield the meshes under an object, each with the matrix from its points to the tray."""
    called = f"object {resource.GetName() or resource.GetResourceID()!r}"
    if resource.GetType() != lib3mf.ObjectType.Model and not resource.IsComponentsObject():
        remark = f"{called} is no model but support or a surface: left out"
        remarks += [] if remark in remarks else [remark]
    elif resource.IsComponentsObject():
        for number in range(resource.GetComponentCount()):
            component = resource.GetComponent(number)
            own = _matrix(component.GetTransform()) if component.HasTransform() else np.eye(4)
            inner = component.GetObjectResource()
            yield from _meshes(wrapper, inner, own @ matrix, name, remarks)
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


def _object(wrapper: Any, model: Any, mesh: Any, matrix: FloatArray) -> ThreemfObject:
    stored = _array(wrapper, mesh, "vertices", lib3mf.Position, np.float32)
    faces = _array(wrapper, mesh, "triangleindices", lib3mf.Triangle, np.uint32).astype(np.int32)
    vertices: Float32Array | FloatArray = stored
    if not np.array_equal(matrix, np.eye(4)):
        x, y, z = stored.astype(np.float64).T
        vertices = np.stack(
            [x * row[0] + y * row[1] + z * row[2] + row[3] for row in matrix.T[:3]], axis=1
        )
        if np.linalg.det(matrix) < 0.0:
            faces = np.ascontiguousarray(faces[:, ::-1])
    material, colour, constituents = _material(wrapper, model, mesh)
    metadata = _metadata(mesh.GetMetaDataGroup())
    return ThreemfObject(mesh.GetName(), vertices, faces, material, colour, metadata, constituents)


def _array(wrapper: Any, mesh: Any, what: str, type_: Any, dtype: Any) -> NDArray[Any]:
    """Copy one of a mesh's arrays at once; lib3mf's own getters make a list of objects."""
    count = mesh.GetVertexCount() if what == "vertices" else mesh.GetTriangleCount()
    buffer = (type_ * count)()
    get = getattr(wrapper.lib, f"lib3mf_meshobject_get{what}")
    wrapper.checkError(mesh, get(mesh._handle, ctypes.c_uint64(count), ctypes.c_uint64(0), buffer))
    return np.frombuffer(buffer, dtype=dtype).reshape(-1, 3).copy()


def _material(wrapper: Any, model: Any, mesh: Any) -> tuple[str, str, tuple[Constituent, ...]]:
    """Return an object's material, its colour, and what it is mixed of."""
    group, entry, has = mesh.GetObjectLevelProperty()
    kind = model.GetPropertyTypeByID(group) if has else lib3mf.PropertyType.NoPropertyType
    if kind == lib3mf.PropertyType.BaseMaterial:
        return *_base(wrapper, model.GetBaseMaterialGroupByID(group), entry), ()
    if kind != lib3mf.PropertyType.Composite:
        return "", "", ()
    composites = model.GetCompositeMaterialsByID(group)
    bases = composites.GetBaseMaterialGroup()
    # A group's composites share one list of materials: those without a share are left out.
    parts = tuple(
        Constituent(*_base(wrapper, bases, part.PropertyID), part.MixingRatio)
        for part in composites.GetComposite(entry)
        if part.MixingRatio > 0.0
    )
    return composite_name(parts), mixed_colour(parts), parts


def _base(wrapper: Any, bases: Any, entry: int) -> tuple[str, str]:
    red, green, blue, _ = wrapper.ColorToRGBA(bases.GetDisplayColor(entry))
    return bases.GetName(entry), f"#{red:02X}{green:02X}{blue:02X}"


def _metadata(group: Any) -> dict[str, str]:
    entries = (group.GetMetaData(i) for i in range(group.GetMetaDataCount()))
    return {entry.GetName(): entry.GetValue() for entry in entries}
