import json

import numpy as np
import pytest

from planner.errors import ArgumentError
from planner.fields.basic import AxisField, Field, PlanarField, axis_field
from planner.mesh.mesh import Mesh

FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])


def tetrahedron(x=1.0, y=2.0, z=3.0):
    return Mesh(np.array([[0, 0, 0], [x, 0, 0], [0, y, 0], [0, 0, z]]), FACES)


@pytest.mark.parametrize(
    ("axis", "direction"),
    [
        ("x", (1, 0, 0)), ("-y", (0, -1, 0)), ("+Z", (0, 0, 1)), ("0,0,-5", (0, 0, -1)),
        ("1e200, 1e200,0", (2**-0.5, 2**-0.5, 0)), ((0, 3, 4), (0, 0.6, 0.8)),
        (np.array([0, 1e-200, 0]), (0, 1, 0)),
    ],
)  # fmt: skip
def test_directions(axis, direction):
    field = axis_field(axis, tetrahedron())
    assert field.direction == pytest.approx(direction, rel=1e-15)
    assert isinstance(field, Field)
    assert isinstance(field, PlanarField)


@pytest.mark.parametrize(("sides", "axis"), [((1, 2, 3), 2), ((4, 4, 4), 0), ((1, 4, 4), 1)])
def test_default_is_the_longest_side_x_before_y_before_z(sides, axis):
    assert axis_field(None, tetrahedron(*sides)).direction == tuple(np.eye(3)[axis])


@pytest.mark.parametrize("axis", ["-z", "1,2,3", "1 2 3", "0.3,-1,0.1"])
def test_field_runs_from_0_to_1_over_the_vertices(axis):
    mesh = tetrahedron(5, 7, 11)
    field = axis_field(axis, mesh)
    values = field.values(mesh.vertices)
    assert values.min() == 0
    # One subtraction and one division of numbers near 10.
    assert values.max() == pytest.approx(1, rel=1e-15)
    normal, offset_mm = field.plane(0.25)
    assert field.values(offset_mm * normal[None]) == pytest.approx(0.25, abs=1e-15)


def test_description_builds_the_field_again():
    field = axis_field("1,2,3", tetrahedron())
    described = json.loads(json.dumps(field.description()))
    assert described.pop("name") == field.name == "axis"
    assert AxisField(**(described | {"direction": tuple(described["direction"])})) == field


@pytest.mark.parametrize(
    "axis", ["w", "xy", "", "--x", "1,2", "1,2,3,4", "1,,2,3", "a,b,c", (1, 2)]
)
def test_what_is_no_direction_is_refused_with_what_is(axis):
    with pytest.raises(ArgumentError, match="allowed are x, y, z, -x"):
        axis_field(axis, tetrahedron())


@pytest.mark.parametrize(
    ("axis", "reason"),
    [("nan,0,1", "not finite"), ("inf,0,0", "not finite"), ("0,0,-0", "length zero")],
)
def test_directions_without_length(axis, reason):
    with pytest.raises(ArgumentError, match=reason):
        axis_field(axis, tetrahedron())


def test_a_part_that_is_flat_along_the_axis():
    with pytest.raises(ArgumentError, match="flat"):
        axis_field("z", tetrahedron(z=0.0))
