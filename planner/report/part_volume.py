"""The volume of a loaded part with what stands inside it, for ParaView."""

import numpy as np

from planner.formats.field_file import HEXAHEDRON, TETRAHEDRON, WEDGE, encode_vtu
from planner.mesh.clip import clip_hexahedra
from planner.mesh.distance import nearest, triangle_tree
from planner.numerics import FloatArray
from planner.simulation.element import shape_functions
from planner.simulation.part import PartSimulation
from planner.simulation.response import hats, in_cells

__all__ = ["part_volume"]


_ACROSS = 3
"""Small hexahedra along a cell's edge: one for each quadrature point of a full cell."""

_NEAR = 1e-3
# of a cell's edge: a corner this near to the surface is on it, so that no sliver is cut off.

_CORNERS = np.array(
    [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
)


def part_volume(result: PartSimulation) -> bytes:
    """Return the volume of a loaded part at rest, with what stands in it at the last step: VTU.

    Each cell is 27 small hexahedra; those at the surface are clipped by it into wedges and
    tetrahedra. Points have ``displacement_mm``. Cells have, of the quadrature point that is
    nearest to them in their cell, Cauchy's ``stress_MPa`` (xx, yy, zz, xy, yz, xz), ``energy_MPa``
    (stored, over the volume at rest), ``coordinate``, ``material`` (number of the palette's
    nearest, from 0), ``strain_over_break`` (largest principal strain over the elongation at break,
    by the mean over neighbouring cells) and ``cell``, the number of the solver's cell.

    Parameters
    ----------
    result
        What `planner.simulate` returns of a whole part.

    Returns
    -------
    bytes
        The file; the same for the same result.

    Raises
    ------
    AttributeError
        Not of a result of a whole part.

    Examples
    --------
    >>> bent = planner.simulate("bar", fix="x=min", gravity="-z")  # doctest: +SKIP
    >>> Path("bent.vtu").write_bytes(planner.part_volume(bent))  # doctest: +SKIP
    """
    cells, fields = result.cells, result.steps.fields
    coordinate = result.coordinate
    grades = np.array([material.coordinate for material in result.palette.materials])
    steps = np.stack(np.meshgrid(*3 * [np.arange(_ACROSS + 1)], indexing="ij"), axis=-1)
    steps = steps.reshape(-1, 3)  # z fastest
    # A place on a face, edge or corner is shared by the cells that share the node there.
    part = np.where(steps == 0, 0, np.where(steps == _ACROSS, 2, 1))
    owner = cells.nodes[:, part @ np.array([1, 3, 9])]
    place = _ACROSS * cells.index[:, None].astype(np.int64) + steps
    wide = place.max(axis=(0, 1)) + 1
    key = (place[..., 0] * wide[1] + place[..., 1]) * wide[2] + place[..., 2]
    _, first, number = np.unique(
        np.stack([owner.ravel(), key.ravel()], axis=1),
        axis=0,
        return_index=True,
        return_inverse=True,
    )
    number = number.reshape(owner.shape)
    local = 2.0 * steps / _ACROSS - 1.0
    shape, _ = shape_functions(local, cells.cell_mm)
    moved = np.einsum("sa,nai->nsi", shape, fields.displacement_mm[cells.nodes])
    points = cells.origin_mm + place.reshape(-1, 3)[first] / _ACROSS * cells.cell_mm
    u = moved.reshape(-1, 3)[first]

    low = steps[(steps < _ACROSS).all(axis=1)]
    at = (low[:, None] + _CORNERS) @ np.array([(_ACROSS + 1) ** 2, _ACROSS + 1, 1])
    corners, cell = number[:, at].reshape(-1, 8), np.repeat(np.arange(len(number)), len(low))
    point, of, inner = in_cells(cells, points[corners].mean(axis=1))
    mine = of == cell  # another piece of material may stand there
    corners, cell, point, inner = corners[mine], cell[mine], point[mine], inner[mine]

    distance = np.full(len(points), -1.0)
    volume = np.zeros(tuple(cells.index.max(axis=0) + 1))
    np.add.at(volume, tuple(cells.index.T), np.add.reduceat(cells.weights_mm3, cells.offsets[:-1]))
    full = volume[tuple(cells.index.T)] > (1.0 - 1e-9) * np.prod(cells.cell_mm)
    asked = np.unique(corners[~full[cell]])
    away, outside = nearest(triangle_tree(cells.surface), points[asked])
    distance[asked] = np.where(outside, away, -away) - _NEAR * float(cells.cell_mm.min())
    kept = clip_hexahedra(corners, points, distance)

    def cut(values: FloatArray) -> FloatArray:
        a, b = values[kept.edge[:, 0]], values[kept.edge[:, 1]]
        return np.concatenate([values, a + kept.share[:, None] * (b - a)])

    used = np.concatenate([kept.of_hexahedron, kept.of_wedge, kept.of_tetrahedron])
    point, shares = point[used], hats(inner[used])
    return encode_vtu(
        cut(points),
        [(HEXAHEDRON, kept.hexahedra), (WEDGE, kept.wedges), (TETRAHEDRON, kept.tetrahedra)],
        point_data={"displacement_mm": cut(u)},
        cell_data={
            "material": np.abs(coordinate[point][:, None] - grades).argmin(axis=1).astype(np.int32),
            "coordinate": coordinate[point],
            "stress_MPa": fields.stress_MPa[point].astype(np.float32),
            "energy_MPa": fields.energy_MPa[point].astype(np.float32),
            "strain_over_break": np.einsum(
                "mc,mc->m", shares, fields.strain_over_break[cell[used]]
            ).astype(np.float32),
            "cell": cell[used].astype(np.int32),
        },
    )
