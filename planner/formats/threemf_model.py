"""What a 3MF file holds, as far as planner is concerned."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from planner.arrays import Float32Array, FloatArray, IntArray

__all__ = ["Constituent", "ThreemfModel", "ThreemfObject", "composite_name", "mixed_colour"]


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
    channels = [
        sum(part.share * int(part.colour[place : place + 2], 16) for part in constituents)
        for place in (1, 3, 5)
    ]
    return "#" + "".join(f"{min(255, round(channel)):02X}" for channel in channels)


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
    metadata
        Of the model.
    remarks
        The reader's warnings, and what was left out.
    """

    unit: str
    objects: tuple[ThreemfObject, ...]
    metadata: Mapping[str, str]
    remarks: tuple[str, ...]
