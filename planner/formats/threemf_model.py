"""What a 3MF file holds, as far as planner is concerned."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from planner.arrays import Float32Array, FloatArray, IntArray

__all__ = ["ThreemfModel", "ThreemfObject"]


@dataclass(frozen=True, slots=True)
class ThreemfObject:
    """One mesh of a 3MF file, of one material.

    Attributes
    ----------
    vertices, faces
        (n, 3) positions, float32 for writing, and (m, 3) outward triangles.
    material_name, colour
        Entry of the base material group, ``#RRGGBB``; empty when a file that was read has none.
    metadata
        Of the object. Names that the core specification knows are written as they are, others
        in `planner.formats.threemf.NAMESPACE`; they are plain words (letters, digits, ``_``,
        ``-``, ``.``).
    """

    name: str
    vertices: Float32Array | FloatArray
    faces: IntArray
    material_name: str = ""
    colour: str = ""
    metadata: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class ThreemfModel:
    """What a 3MF file puts on the tray.

    Attributes
    ----------
    unit
        mm, um, cm, m, inch or ft; what the objects' coordinates are in.
    objects
        Each mesh as often as it is placed, where it is placed, in the order of the build items.
    metadata
        Of the model.
    remarks
        The reader's warnings, and what was left out.
    """

    unit: str
    objects: tuple[ThreemfObject, ...]
    metadata: Mapping[str, str]
    remarks: tuple[str, ...]
