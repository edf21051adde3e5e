"""A stack of layers as written: what of each material is where, and the files that say so."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.formats.folder import FolderKind
from planner.formats.json_document import encode_document
from planner.formats.png import Rgba
from planner.geometry.columns import Grid
from planner.plan import PartGraded
from planner.slices.layer_image import NOTHING

__all__ = ["SLICES", "SliceStack", "SlicedMaterial", "layer_file"]

SLICES = FolderKind("slices.json", ("slices.json", "layers.csv", "layer_*.png"))
"""The folder of a stack."""


def layer_file(index: int) -> str:
    """Return the name of a layer's image."""
    return f"layer_{index:05d}.png"


@dataclass(frozen=True, slots=True)
class SlicedMaterial:
    """What of a stack is one material.

    Attributes
    ----------
    rgba
        Its pixels' colour, which no other material has.
    file, sha256
        The shell that it was made from.
    """

    material: str
    operator_name: str
    rgba: Rgba
    file: str
    sha256: str
    voxels: int
    volume_mm3: float


@dataclass(frozen=True, eq=False)
class SliceStack:
    """The content of slices.json and layers.csv.

    Attributes
    ----------
    voxels : (layers, materials) int64
        Voxels of each material by layer.
    overlapping
        Voxels that lie in more than one shell; each was drawn once.
    open_rows
        Rows of voxels that enter a shell and do not leave it.
    """

    version: str
    printer: str
    plan_sha256: str
    part: PartGraded
    grid: Grid
    indexed: bool
    materials: tuple[SlicedMaterial, ...]
    voxels: NDArray[np.int64]
    overlapping: int
    open_rows: int

    @property
    def findings(self) -> tuple[str, ...]:
        """What is wrong with the plan's shells, in words."""
        found = []
        if self.overlapping:
            found.append(
                f"{self.overlapping} voxels lie in more than one shell; each is drawn once"
            )
        if self.open_rows:
            found.append(f"{self.open_rows} rows of voxels enter a shell that they do not leave")
        return tuple(f"{text}: run planner check on the plan" for text in found)

    @property
    def ok(self) -> bool:
        """Whether every voxel lies in one shell or in none."""
        return not self.findings

    @property
    def files(self) -> tuple[str, ...]:
        """Names of the images, from the lowest layer up."""
        return tuple(layer_file(index) for index in range(self.grid.shape[2]))

    def document(self) -> dict[str, Any]:
        """Return the stack as slices.json holds it."""
        return {
            "schema": 1,
            "version": self.version,
            "printer": self.printer,
            "plan": {"sha256": self.plan_sha256},
            "part": {
                "name": self.part.name,
                "file": self.part.file,
                "sha256": self.part.sha256,
                "translation_mm": list(self.part.translation_mm),
            },
            "grid": {
                "origin_mm": list(self.grid.origin_mm),
                "pitch_mm": list(self.grid.pitch_mm),
                "shape": list(self.grid.shape),
            },
            "images": {
                "pixels": "indexed" if self.indexed else "rgba",
                "column": "x",
                "row": "y",
                "layer": "z",
                "nothing": list(NOTHING),
            },
            "materials": [
                {
                    "label": label,
                    "material": each.material,
                    "operator_name": each.operator_name,
                    "rgba": list(each.rgba),
                    "file": each.file,
                    "sha256": each.sha256,
                    "voxels": each.voxels,
                    "volume_mm3": each.volume_mm3,
                }
                for label, each in enumerate(self.materials, 1)
            ],
            "overlapping_voxels": self.overlapping,
            "open_rows": self.open_rows,
            "layers": "layers.csv",
            "files": list(self.files),
        }

    def json(self) -> bytes:
        """Return the bytes of slices.json."""
        return encode_document(self.document())

    def csv(self) -> bytes:
        """Return the bytes of layers.csv."""
        return ("\n".join(self._rows()) + "\n").encode("utf-8")

    def _rows(self) -> Iterator[str]:
        yield ",".join(["layer", "z_mm", *(each.material for each in self.materials)])
        bottom_mm, edge_mm = self.grid.origin_mm[2], self.grid.pitch_mm[2]
        for index, counts in enumerate(self.voxels.tolist()):
            yield ",".join(
                [str(index), f"{bottom_mm + (index + 0.5) * edge_mm:.9g}", *map(str, counts)]
            )
