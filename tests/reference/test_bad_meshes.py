"""What becomes of each real mesh, and why."""

import numpy as np
import pytest

from benchmarks.audit import audit
from planner.errors import MeshError
from planner.formats.mesh_file import read_mesh
from planner.mesh.part import make_part, undersize


def load(shared_data, file, unit=None):
    mesh = read_mesh(shared_data / "meshes" / file, unit)
    return make_part(mesh.triangles, name=mesh.name)


@pytest.mark.parametrize(
    ("file", "unit", "faces", "volume_mm3", "repair"),
    [
        # Volumes: trimesh 5.2's, in the files' units. Sound, in metres.
        ("ADIS16480.STL", "m", 7436, 28192.470210, ""),
        # In inches; corners at 1e-17 instead of zero leave edges open until they are joined.
        ("angle_block.STL", "inch", 704, 1.145522543 * 25.4**3, "joined to others"),
        ("featuretype.STL", "inch", 3476, 11.627733431 * 25.4**3, "joined to others"),
        # Sound in spite of its name.
        ("busted.STL", None, 3878, 526.448909944, ""),
        # 17 objects placed by build items; 24 triangles repeat a corner.
        ("cube_gears.3mf", None, 25668, None, "two equal corners dropped"),
        ("cube_gears_prod.3mf", None, 25668, None, "two equal corners dropped"),
        # Two bodies, some of whose faces are turned over.
        ("multibody.stl", None, 32, None, "turned over"),
        # Closed already.
        ("quadknot.obj", None, 2880, 1057307.771492, ""),
        ("torus.3mf", None, 2200, None, ""),
    ],
)
def test_taken(shared_data, file, unit, faces, volume_mm3, repair):
    part = load(shared_data, file, unit)
    assert len(part.mesh.faces) == faces
    assert repair in " ".join(part.repairs)
    assert bool(part.repairs) == bool(repair)
    report = audit(part.mesh.triangles)
    assert report.closed
    assert report.volume_mm3 > 0
    if volume_mm3 is not None:
        # 1e-8: the figures above have nine digits or more
        assert part.mesh.volume_mm3 == pytest.approx(volume_mm3, rel=1e-8)


def test_unit_of_a_part_in_metres(shared_data):
    question = undersize(load(shared_data, "ADIS16480.STL").mesh)
    assert "in m it would be 44 x 14 x 47 mm: --unit m" in (question or "")


@pytest.mark.parametrize(
    ("file", "message"),
    [
        ("empty.stl", "holds no triangles"),
        # Six holes far wider than rounding.
        ("teapot.stl", "the surface is open: 64 edges with one face around 6 holes"),
        ("soup.stl", "its 100 triangles share no edge"),
        # Two cubes that touch along an edge: no cross-section joins them.
        (
            "shared.STL",
            r"1 edge in all 1 mm long with up to 4 faces, the first at \(0\.5, 0\.5, 0\)",
        ),
        # Many bodies that still touch along edges where they were united.
        ("cycloidal.ply", r"\d+ edges in all .* mm long with up to 4 faces"),
    ],
)
def test_refused(shared_data, file, message):
    with pytest.raises(MeshError, match=message):
        load(shared_data, file)


def test_the_same_gears_either_way(shared_data):
    """The production extension keeps objects elsewhere in the archive: same part."""
    plain = load(shared_data, "cube_gears.3mf").mesh
    production = load(shared_data, "cube_gears_prod.3mf").mesh
    extents = [np.ptp(mesh.bounds_mm, axis=0) for mesh in (plain, production)]
    assert plain.volume_mm3 == pytest.approx(production.volume_mm3, rel=1e-6)  # the same reason
    assert np.allclose(*extents, atol=1e-4)  # the two files' transforms differ in the fifth digit
