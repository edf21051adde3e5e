"""The area of interfaces before they are drawn, and the pitch that follows from it."""

import numpy as np
import pytest

from planner.cutting.grid import affordable_pitch_mm, interface_area_mm2
from planner.fields.basic import FunctionField
from planner.mesh.mesh import Mesh

CUBE = Mesh(
    np.array([[x, y, z] for x in (0.0, 20.0) for y in (0.0, 20.0) for z in (0.0, 20.0)]),
    np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
              [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]),
)  # fmt: skip


def about(centre, length_mm):
    return FunctionField(
        "radial", lambda p: np.linalg.norm(p - np.asarray(centre), axis=1) / length_mm
    )


@pytest.mark.parametrize("pitch_mm", [0.25, 0.5, 1.0])
def test_spheres_have_their_area(pitch_mm: float) -> None:
    """Lines along three axes see a sphere to half a pitch of its radius: 10 % at the coarsest."""
    radii = np.array([4.0, 6.0, 9.0])
    field = about([10.0, 10.0, 10.0], 10.0)
    found = interface_area_mm2(CUBE, field, radii / 10.0, pitch_mm)
    assert found == pytest.approx(4.0 * np.pi * np.sum(radii**2), rel=0.1 * pitch_mm + 0.01)


def test_no_level_within_has_no_area() -> None:
    assert interface_area_mm2(CUBE, about([10.0] * 3, 10.0), np.array([5.0]), 0.5) == 0.0


def test_few_interfaces_keep_the_usual_pitch() -> None:
    field = about([10.0] * 3, 10.0)
    assert affordable_pitch_mm(CUBE, field, np.array([0.5]), 0.5) == 0.5


def test_many_get_a_coarser_one_up_to_twice() -> None:
    """Thirty spheres of 1.7e4 mm2 make 2.1 million faces at 0.5 mm: 0.59 mm make 1.5 million."""
    field = about([10.0] * 3, 10.0)
    many = np.sqrt(np.linspace(0.05, 0.85, 30))
    area = float(4.0 * np.pi * np.sum((10.0 * many) ** 2))
    expected = np.sqrt(30.0 * area / 1.5e6)
    assert affordable_pitch_mm(CUBE, field, many, 0.5) == pytest.approx(expected, rel=0.03)
    assert affordable_pitch_mm(CUBE, field, np.sqrt(np.linspace(0.05, 0.85, 600)), 0.5) == 1.0
