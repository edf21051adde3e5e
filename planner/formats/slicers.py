"""What slicers read beside the 3MF specification: the extruder or filament of each shell.

No slicer takes it from base materials. Bambu Studio and OrcaSlicer read
``Metadata/model_settings.config``, which numbers the parts of an assembly; Cura reads metadata of
each mesh; PrusaSlicer makes an object of each component of an assembly, and parts of one object
only from ranges of triangles of one mesh, which ``Metadata/Slic3r_PE_model.config`` tells.
"""

from collections.abc import Sequence
from xml.sax.saxutils import quoteattr

from planner.errors import ArgumentError, did_you_mean

__all__ = [
    "BAMBU_PART",
    "CURA_NAMESPACE",
    "PRUSA_PART",
    "bambu_settings",
    "needs_one_mesh",
    "prusa_settings",
]

BAMBU_PART = "/Metadata/model_settings.config"
PRUSA_PART = "/Metadata/Slic3r_PE_model.config"
CURA_NAMESPACE = "http://software.ultimaker.com/xml/cura/3mf/2015/10"

_ONE_MESH = {"prusaslicer": True, "bambu": False, "orca": False, "cura": False}


def needs_one_mesh(slicer: str) -> bool:
    """Tell whether a slicer takes one part of many materials only as one mesh.

    Raises
    ------
    ArgumentError
        No slicer that planner knows; the message says what is near.
    """
    try:
        return _ONE_MESH[slicer.casefold()]
    except KeyError:
        raise ArgumentError(
            f"slicer {slicer!r}: no such slicer; "
            f"{did_you_mean(slicer, _ONE_MESH)}it may be {', '.join(_ONE_MESH)}"
        ) from None


def bambu_settings(assembly: int, name: str, parts: Sequence[tuple[int, str, int]]) -> bytes:
    """Return the part of a 3MF that gives each component of an assembly its filament.

    Parameters
    ----------
    assembly, name
        The assembly's identifier in the model, and what it is called.
    parts
        Identifier, name and filament (from 1) of each component's mesh.
    """
    lines = [
        line
        for id, part, filament in parts
        for line in (
            f'    <part id="{id}" subtype="normal_part">',
            f'      <metadata key="name" value={quoteattr(part)}/>',
            f'      <metadata key="extruder" value="{filament}"/>',
            "    </part>",
        )
    ]
    return _config(
        f'  <object id="{assembly}">',
        f'    <metadata key="name" value={quoteattr(name)}/>',
        *lines,
    )


def prusa_settings(mesh: int, name: str, volumes: Sequence[tuple[int, str, int]]) -> bytes:
    """Return the part of a 3MF that cuts one mesh into volumes and gives each its extruder.

    Parameters
    ----------
    mesh, name
        The mesh's identifier in the model, and what it is called.
    volumes
        Number of triangles, name and extruder (from 1) of each volume, in the mesh's order.
    """
    lines, first = [], 0
    for triangles, volume, extruder in volumes:
        lines += [
            f'    <volume firstid="{first}" lastid="{first + triangles - 1}">',
            f'      <metadata type="volume" key="name" value={quoteattr(volume)}/>',
            '      <metadata type="volume" key="volume_type" value="ModelPart"/>',
            f'      <metadata type="volume" key="extruder" value="{extruder}"/>',
            "    </volume>",
        ]
        first += triangles
    return _config(
        f'  <object id="{mesh}" instances_count="1">',
        f'    <metadata type="object" key="name" value={quoteattr(name)}/>',
        *lines,
    )


def _config(*lines: str) -> bytes:
    head = '<?xml version="1.0" encoding="UTF-8"?>'
    return "\n".join([head, "<config>", *lines, "  </object>", "</config>", ""]).encode("utf-8")
