"""Divide a part along curved level sets, and make sure that every shell is closed."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.arrays import FloatArray
from planner.errors import ArgumentError
from planner.geometry.audit import audit_welded
from planner.geometry.cut import squared_height
from planner.geometry.fields.field import Field
from planner.geometry.kernel import kernel
from planner.geometry.level_sets.divide_field import DividedField, divide_along
from planner.geometry.level_sets.grid import MOST_VERTICES
from planner.geometry.mend import flip_thin
from planner.geometry.mesh import Mesh, measure
from planner.geometry.topology import order_edges
from planner.geometry.weld import order_rows, sorted_corners

__all__ = ["ATTEMPTS", "FIRST_SHIFT", "split_curved"]

ATTEMPTS = 12
"""Grids to try: the second is needed where a level lies in a face or edge, a fifth hardly ever."""

FIRST_SHIFT = np.array([0.3702, 0.2131, 0.5316])
"""Of the first grid; see `planner.geometry.level_sets.divide_field.divide_along`."""

THIN_ATTEMPTS = 4
"""Of these, how many may go to triangles so thin that some readers drop them."""

_READ_MM = 1.5e-8  # trimesh drops triangles lower than 1e-8 mm
_SHARE = 2e-3  # of a pitch that levels move by from attempt to attempt
_STEP = np.array([0.7548776662, 0.5698402910, 0.4301597090])  # spreads evenly over a cube


def split_curved(mesh: Mesh, field: Field, levels: FloatArray, pitch_mm: float) -> DividedField:
    """Divide a part along level sets on a grid of a pitch.

    Decisions are exact, but points are rounded to float32 afterwards. Where surfaces nearly
    touch, points of different places can become one, and a shell then has an edge of four
    faces. The grid is moved in such a case, by a part of a pitch, and levels by a thousandth.

    Raises
    ------
    ArgumentError
        The pitch is none or too fine, the field is not finite, or no grid serves.
    """
    extent_mm = mesh.bounds_mm[1] - mesh.bounds_mm[0]
    if not (np.isfinite(pitch_mm) and pitch_mm > 0.0):
        raise ArgumentError(f"--pitch {pitch_mm}: it must be a positive number of mm")
    vertices = float((extent_mm / pitch_mm + 4.0).prod())
    longest = float(extent_mm.max()) / pitch_mm
    if vertices > MOST_VERTICES or longest > 16000:
        least = max(
            float(np.cbrt(extent_mm.prod() / MOST_VERTICES)), float(extent_mm.max()) / 15990
        )
        raise ArgumentError(
            f"--pitch {pitch_mm:g}: this part would need {vertices:.2g} grid points, and "
            f"{MOST_VERTICES:.2g} are possible; a pitch of {1.1 * least:.2g} mm or more fits"
        )
    best: tuple[int, DividedField] | None = None
    for attempt in range(ATTEMPTS):
        if best is not None and attempt >= THIN_ATTEMPTS:
            break
        shift = (FIRST_SHIFT + attempt * _STEP) % 1.0
        moved = levels + _moved(attempt) * pitch_mm / max(float(extent_mm.max()), pitch_mm)
        found = divide_along(mesh, field, moved, pitch_mm, shift)
        if found.broken or not _shells_close(found, len(levels) + 1):
            continue
        thin = _thin(found, len(mesh.vertices))
        if thin:
            flipped = _without_thin(found, len(mesh.vertices))
            fewer = _thin(flipped, len(mesh.vertices))
            if fewer < thin and _shells_close(flipped, len(levels) + 1):
                thin, found = fewer, flipped
        if best is None or thin < best[0]:
            best = thin, found
        if thin == 0:
            break
    if best is not None:
        return best[1]
    raise ArgumentError(
        f"field {field.name!r}: no grid of {pitch_mm:g} mm gives sound shells{_fault(found)}; the "
        "part touches itself there, or levels are too close for its size: mend the part, use "
        "fewer bands, or another --pitch"
    )


def _fault(divided: DividedField) -> str:
    """Say where the first shell that is not closed has its first fault."""
    for number in np.unique(divided.piece).tolist():
        shell = _shell(divided, number)
        place_mm = audit_welded(Mesh(divided.vertices.astype(np.float64), shell)).first_fault_mm
        if place_mm is not None:
            return " at ({:.4g}, {:.4g}, {:.4g}) mm as placed for printing".format(*place_mm)
    return ""


def _shell(divided: DividedField, number: int) -> NDArray[np.int32]:
    """Return the faces of a piece, outwards."""
    below, above = divided.cap_level == number, divided.cap_level == number - 1
    return np.concatenate(
        [
            divided.faces[divided.piece == number],
            divided.cap_faces[below],
            divided.cap_faces[above][:, ::-1],
        ]
    )


def _thin(divided: DividedField, first_new: int) -> int:
    """Count new triangles so thin that readers drop them."""
    limit = _READ_MM**2
    found = _count_thin(divided.vertices, divided.faces, np.int32(first_new), limit)
    return int(found + _count_thin(divided.vertices, divided.cap_faces, np.int32(0), limit))


@kernel
def _count_thin(vertices: Any, faces: Any, first_new: Any, limit: Any) -> Any:
    count = 0
    for f in range(faces.shape[0]):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        if max(a, max(b, c)) >= first_new and squared_height(vertices, a, b, c) < limit:
            count += 1
    return count


def _without_thin(divided: DividedField, first_new: int) -> DividedField:
    """Exchange the long sides of thin new triangles, within each piece and each interface."""
    faces, caps = divided.faces.copy(), divided.cap_faces.copy()
    new = (faces >= first_new).any(axis=1)
    for own, label in ((faces, np.where(new, divided.piece, -1)), (caps, divided.cap_level)):
        for value in np.unique(label[label >= 0]):
            members = np.flatnonzero(label == value)
            some = own[members]
            flip_thin(divided.vertices, some, flat=False)
            own[members] = some
    return replace(divided, faces=faces, cap_faces=caps)


def _moved(attempt: int) -> float:
    """Return the share of the pitch that levels move by, up and down in turn."""
    return _SHARE * ((attempt + 1) // 2) * (1 if attempt % 2 else -1)


def _shells_close(divided: DividedField, count: int) -> bool:
    """Tell whether each piece has each edge once each way, no face twice, and a volume."""
    for number in range(count):
        faces = _shell(divided, number)
        if not len(faces):
            continue
        order, starts, faces_at = order_edges(faces)
        if not (faces_at == 2).all():
            return False
        tail = faces.ravel()
        if (tail[order[starts]] == tail[order[starts + 1]]).any():
            return False
        if len(order_rows(*sorted_corners(faces))[1]) < len(faces):
            return False
        if not measure(divided.vertices, faces).volume_mm3[0] > 0.0:
            return False
    return bool((divided.piece >= 0).all() and (divided.piece < count).all())
