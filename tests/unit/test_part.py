"""Parts: what is taken as it is, what is repaired and said, what is refused with its place."""

import itertools
import re

import manifold3d
import numpy as np
import pytest
import trimesh

from planner.errors import ArgumentError, MeshError
from planner.mesh.mesh import Topology, weld
from planner.mesh.part import make_part, open_part, undersize

BOX_CORNERS = np.array(list(itertools.product((0.0, 1.0), repeat=3)))
BOX_QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
BOX_FACES = np.array([f for a, b, c, d in BOX_QUADS for f in [(a, b, c), (a, c, d)]])


def box(size=(1, 1, 1), at=(0, 0, 0)):
    return (BOX_CORNERS * size + at)[BOX_FACES]


def solid(manifold):
    mesh = manifold.to_mesh64()
    return np.asarray(mesh.vert_properties)[np.asarray(mesh.tri_verts, dtype=np.int64), :3]


def sphere(radius=5.0, at=(0, 0, 0), segments=48):
    return solid(manifold3d.Manifold.sphere(radius, segments).translate(at))


def inward(triangles):
    return triangles[:, ::-1]


def volume(triangles):
    return np.einsum("ij,ij->", triangles[:, 0], np.cross(triangles[:, 1], triangles[:, 2])) / 6


def part(*bodies, **options):
    return make_part(np.concatenate(bodies), name="p", **options)


def is_closed(made):
    return Topology(weld(made.mesh.triangles)[1]).closed


def test_sound_mesh_is_taken_as_it_is():
    triangles = sphere(at=(100, -50, 3))
    made = part(triangles)
    assert np.array_equal(made.mesh.triangles, triangles)
    assert made.repairs == made.warnings == ()
    assert made.name == "p"


def test_same_soup_same_part():
    triangles = np.concatenate([sphere(), sphere(at=(3, 0, 0)), inward(box(at=(20, 0, 0)))])
    first, second = (make_part(triangles, name="p") for _ in range(2))
    assert first.mesh.vertices.tobytes() == second.mesh.vertices.tobytes()
    assert first.mesh.faces.tobytes() == second.mesh.faces.tobytes()
    assert first.repairs == second.repairs


def test_inside_out():
    made = part(inward(box((10, 10, 10))))
    assert made.mesh.volume_mm3 == pytest.approx(1000)
    assert made.repairs == ("the part was inside out: turned",)


def test_one_of_several_bodies_inside_out():
    made = part(box((4, 4, 4)), inward(box((4, 4, 4), at=(9, 0, 0))), box((4, 4, 4), at=(18, 0, 0)))
    assert made.mesh.volume_mm3 == pytest.approx(3 * 64)
    assert made.repairs == ("1 of 3 bodies were inside out: turned",)


@pytest.mark.parametrize("seed", range(5))
def test_faces_turned_over_at_random(seed):
    triangles = sphere()
    turned = np.random.default_rng(seed).random(len(triangles)) < 0.3
    made = part(np.where(turned[:, None, None], triangles[:, ::-1], triangles))
    assert made.mesh.volume_mm3 == pytest.approx(volume(triangles), rel=1e-12)
    assert made.repairs == (f"{turned.sum()} triangles were turned over: now all agree",)


def test_cavity_stays_a_cavity():
    triangles = np.concatenate([box((10, 10, 10)), inward(box((4, 4, 4), at=(3, 3, 3)))])
    made = make_part(triangles, name="p")
    assert np.array_equal(made.mesh.triangles, triangles)
    assert made.mesh.volume_mm3 == pytest.approx(1000 - 64)
    assert made.repairs == ()


def test_hollow_part_inside_out():
    made = part(inward(box((10, 10, 10))), box((4, 4, 4), at=(3, 3, 3)))
    assert made.mesh.volume_mm3 == pytest.approx(1000 - 64)
    assert made.repairs == ("the part was inside out: turned",)


def test_body_inside_a_cavity():
    hollow = [box((10, 10, 10)), inward(box((8, 8, 8), at=(1, 1, 1)))]
    rattle = box((4, 4, 4), at=(3, 3, 3))
    made = part(*hollow, rattle)
    assert made.mesh.volume_mm3 == pytest.approx(1000 - 512 + 64)
    assert made.repairs == ()
    wrong = part(*hollow, inward(rattle))  # inward inside a cavity can only be an error
    assert wrong.mesh.volume_mm3 == pytest.approx(1000 - 512 + 64)
    assert wrong.repairs == ("1 of 3 bodies were inside out: turned",)


def test_overlapping_bodies_are_united():
    """Two unit-depth boxes that share a quarter: inclusion-exclusion gives the volume."""
    made = part(box((10, 10, 1)), box((10, 10, 1), at=(5, 5, 0.25)))
    assert made.mesh.volume_mm3 == pytest.approx(100 + 100 - 25 * 0.75)
    assert made.repairs == ("2 bodies overlapped (18.75 mm3 counted twice): united",)
    assert is_closed(made)


BLOCK, POCKET = box((8, 8, 16)), box((4, 4, 8), at=(2, 2, 8))
INSIDE, BESIDE = box((4, 4, 4), at=(2, 2, 2)), box((3, 3, 3), at=(20, 0, 0))
END = box((8, 8, 4), at=(0, 0, 12))
LEANING = solid(manifold3d.Manifold.cube((3, 3, 4), True).rotate((0, 0, 45)).translate((4, 4, 5)))
LEANING[..., 0] -= LEANING[..., 0].min()  # one edge in a face of the block


def turned(triangles, seed):
    """Turn triangles at random, by about 1, and round as a file does."""
    axes = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    axes[0] *= np.linalg.det(axes)
    return (triangles @ axes).astype(np.float32).astype(np.float64)


def mixed(triangles):
    return triangles[np.random.default_rng(0).permutation(len(triangles))]


@pytest.mark.parametrize(
    ("bodies", "cavities_mm3", "solids_mm3"),
    [
        pytest.param([BLOCK, inward(POCKET)], 896, 1024, id="pocket"),
        pytest.param([inward(POCKET), BLOCK], 896, 1024, id="pocket first"),
        pytest.param([inward(BLOCK), POCKET], 896, 1024, id="pocket, inside out"),
        pytest.param([mixed(np.concatenate([BLOCK, inward(POCKET)]))], 896, 1024, id="mixed"),
        *[
            pytest.param([turned(np.concatenate([BLOCK, inward(POCKET)]), s)], 896, 1024,
                         id=f"turned {s}")
            for s in range(6)
        ],
        pytest.param([BLOCK, inward(LEANING)], 1024 - 36, 1024, id="along an edge"),
        # The end's outer faces are the block's: they share edges, and their caps all corners.
        pytest.param([BLOCK, inward(END)], 768, 1024, id="end"),
        pytest.param([box((8, 8, 12)), END, inward(END)], 768, 1024, id="end filled"),
        pytest.param([BLOCK, inward(box((4, 4, 8), at=(2, 2, 12)))], 960, 1088, id="half outside"),
        pytest.param([BLOCK, inward(box((40, 40, 80), at=(-20, -20, 12)))], 768, 128_768,
                     id="larger"),
        pytest.param([BLOCK, inward(BLOCK)], 0, 1024, id="inverse"),
        pytest.param([mixed(np.concatenate([BLOCK, inward(BLOCK)]))], 0, 1024, id="two-sided"),
        pytest.param([BESIDE, BLOCK, inward(BLOCK)], 27, 1051, id="inverse beside another"),
        pytest.param([BLOCK, INSIDE], 960, 1024, id="solid in a solid"),
        pytest.param([inward(BLOCK), inward(INSIDE)], 960, 1024, id="all inward"),
        pytest.param(
            [box((10, 10, 10)), box((8, 8, 8), at=(1, 1, 1)), box((4, 4, 4), at=(3, 3, 3))],
            1000 - 512 + 64, 1000, id="solids in one another",
        ),
        pytest.param(
            [box((10, 10, 10)), box((10, 10, 10), at=(4, 4, 4)), inward(box((2, 2, 2), (6, 6, 6)))],
            2000 - 216 - 8, 2000 - 216, id="cavity in two",
        ),
        pytest.param(
            [BLOCK, inward(INSIDE), inward(POCKET)], 1024 - 64 - 128, 1024, id="one plain cavity"
        ),
    ],
)  # fmt: skip
def test_two_readings_are_told_and_one_is_chosen(bodies, cavities_mm3, solids_mm3):
    near = 1e-6  # float32 of what was turned
    with pytest.raises(MeshError, match=r"is a cavity or a solid: .*choose by `bodies`") as refused:
        part(*bodies)
    told = re.search("it has (.*) mm3 with cavities, (.*) mm3 with solids", str(refused.value))
    assert [float(text) for text in told.groups()] == pytest.approx(
        [cavities_mm3, solids_mm3], near
    )
    solids = part(*bodies, bodies="solids")
    assert solids.mesh.volume_mm3 == pytest.approx(solids_mm3, near)
    assert solids.repairs[-1].startswith(f"its {refused.value.args[0].split(' of its ')[1][0]} ")
    assert " bodies read as solids: " in solids.repairs[-1]
    assert is_closed(solids)
    if cavities_mm3 == 0:
        with pytest.raises(MeshError, match="nothing is left"):
            part(*bodies, bodies="cavities")
    else:
        cavities = part(*bodies, bodies="cavities")
        assert cavities.mesh.volume_mm3 == pytest.approx(cavities_mm3, near)
        assert is_closed(cavities)


@pytest.mark.parametrize(
    ("bodies", "volume_mm3", "repairs"),
    [
        pytest.param([BLOCK, inward(INSIDE)], 960, (), id="plain cavity"),
        pytest.param([BLOCK, BLOCK], 1024,
                     ("2 bodies overlapped (1024 mm3 counted twice): united",), id="doubled"),
        pytest.param([BLOCK, POCKET], 1024,
                     ("2 bodies overlapped (128 mm3 counted twice): united",), id="touches within"),
        # What would take nothing away is no cavity.
        pytest.param([BLOCK, inward(BESIDE)], 1051, ("1 of 2 bodies were inside out: turned",),
                     id="inward beside"),
        pytest.param([BLOCK, inward(box((4, 4, 8), at=(2, 2, 16)))], 1152,
                     ("1 of 2 bodies were inside out: turned", "2 bodies touched: united"),
                     id="inward upon"),
        pytest.param([box((20, 20, 20), (-5, -5, -2)), BLOCK, inward(BLOCK)], 8000,
                     ("3 bodies united",), id="inverse inside another"),
        # A hollow body and a rod that goes through it are each sound: their union is one.
        pytest.param([box((9, 9, 9)), inward(box((5, 5, 5), at=(2, 2, 2))),
                      box((19, 1, 1), at=(-5, 4, 4))], 729 - 125 + 10 + 5,
                     ("2 bodies overlapped (4 mm3 counted twice): united",), id="rod in a hollow"),
        pytest.param([box((9, 9, 9)), inward(box((5, 5, 5), at=(2, 2, 2))),
                      box((7, 1, 1), at=(1, 4, 4))], 729 - 125 + 5,
                     ("2 bodies overlapped (2 mm3 counted twice): united",), id="rib in a hollow"),
    ],
)  # fmt: skip
def test_one_reading_is_taken(bodies, volume_mm3, repairs):
    made = part(*bodies)
    assert made.mesh.volume_mm3 == pytest.approx(volume_mm3)
    assert made.repairs == repairs
    asked = part(*bodies, bodies="cavities")  # where there is no doubt, it changes nothing
    assert np.array_equal(asked.mesh.triangles, made.mesh.triangles)
    assert asked.repairs == made.repairs


def test_solids_fill_plain_cavities_too():
    made = part(BLOCK, inward(INSIDE), bodies="solids")
    assert made.mesh.volume_mm3 == pytest.approx(1024)
    assert made.repairs == (
        "its 2 bodies read as solids: 960 mm3 with cavities, 1024 mm3 with solids",
    )


def test_another_word_for_bodies():
    with pytest.raises(ArgumentError, match="`bodies` solid: did you mean solids"):
        part(BLOCK, bodies="solid")


def test_a_body_without_volume_that_crosses_itself_is_not_dropped():
    """A prism over a bow-tie: one half of it is wound inwards, so that the halves cancel."""
    low = np.array([[0, 0, 0], [4, 4, 0], [4, 0, 0], [0, 4, 0]], dtype=float)
    high = np.add(low, [0, 0, 5])
    sides = [(low[i], low[i - 3], high[i - 3], high[i]) for i in range(4)]
    quads = np.array([*sides, low[::-1], high])
    bow_tie = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    with pytest.raises(MeshError, match=r"crosses itself .* wound inwards in as much"):
        part(BESIDE, bow_tie)


def test_overlap_leaves_other_bodies_and_cavities_alone():
    far = sphere(at=(100, 0, 0))
    hollow = [box((10, 10, 10)), inward(box((4, 4, 4), at=(3, 3, 3)))]
    made = part(far, *hollow, box((10, 10, 10), at=(9, 1, 1)))
    assert made.mesh.volume_mm3 == pytest.approx(volume(far) + 2000 - 64 - 81, rel=1e-9)
    assert np.array_equal(made.mesh.triangles[: len(far)], far)


def test_bounding_boxes_that_overlap_are_no_overlap():
    """Two tilted plates side by side: their boxes overlap, they do not."""
    plate = manifold3d.Manifold.cube((20, 20, 1)).rotate((45, 0, 0))
    triangles = np.concatenate([solid(plate), solid(plate.translate((0, 0, 3)))])
    made = make_part(triangles, name="p")
    assert np.array_equal(made.mesh.triangles, triangles)
    assert made.repairs == ()


def test_boxes_face_to_face_become_one():
    made = part(box((5, 5, 5)), box((5, 5, 5), at=(5, 0, 0)))
    assert made.mesh.volume_mm3 == pytest.approx(250)
    assert made.repairs == ("2 pairs of opposite triangles dropped: a wall without thickness",)
    assert is_closed(made)


def test_bodies_that_share_an_edge_and_overlap_are_united():
    """A prism stands on half of a box's top: they share an edge of the box, faces touch."""
    made = part(box((4, 4, 4)), box((2, 4, 4), at=(0, 0, 4)))
    assert made.mesh.volume_mm3 == pytest.approx(64 + 32)
    assert made.repairs == ("2 bodies touched: united",)
    assert is_closed(made)


@pytest.mark.parametrize(
    ("size", "at", "contact_mm2"),
    [((2, 2, 4), (1, 1, 4), 4), ((4, 4, 4), (4, 1, 2), 6), ((3, 1, 1), (0.5, 2, -1), 3)],
    ids=["a post on a plate", "side by side", "below"],
)
@pytest.mark.parametrize("noise_mm", [0.0, 1e-15], ids=["exact", "float64"])
def test_bodies_that_touch_in_a_face_are_one_wherever_their_corners_lie(
    size: tuple[float, ...], at: tuple[float, ...], contact_mm2: float, noise_mm: float
) -> None:
    """An assembly's parts share no edge: what they touch in is no surface, and no gap."""
    one, other = box((4, 4, 4)), box(size, at=at) + noise_mm
    made = part(one, other)
    assert made.repairs == ("2 bodies touched: united",)
    assert made.mesh.volume_mm3 == pytest.approx(volume(one) + volume(other))
    alone = [make_part(each, name="p").mesh.area_mm2 for each in (one, other)]
    assert made.mesh.area_mm2 == pytest.approx(sum(alone) - 2 * contact_mm2)
    assert is_closed(made)


ASKEW = trimesh.transformations.euler_matrix(0.3, 0.5, 0.7)[:3, :3]


@pytest.mark.parametrize("seed", range(8))
def test_bodies_that_touch_askew_are_one_or_two_and_have_no_slits(seed: int) -> None:
    """Rounded to float32 they overlap in places by 1e-6 mm, and are as far apart in others."""
    both = np.concatenate([box((20, 10, 6)), box((20, 10, 6), at=(20, 3, 2))])
    moved = both @ ASKEW + np.random.default_rng(seed).uniform(-50, 50, 3)
    made = make_part(moved.astype(np.float32).astype(np.float64), name="p")
    assert any(
        made.mesh.area_mm2 == pytest.approx(area_mm2) for area_mm2 in (2 * 760, 2 * 760 - 2 * 28)
    )


def prism(outline: np.ndarray, turn: int, rotation: np.ndarray) -> np.ndarray:
    """A polygon's prism of height 8, divided as readers divide polygons: fans from one corner."""
    low, count = np.roll(outline, turn, axis=0), len(outline)
    points = np.concatenate([np.insert(low, 2, z, axis=1) for z in (0.0, 8.0)]) @ rotation
    points = points.astype(np.float32).astype(np.float64)
    fans = np.array([(0, i, i + 1) for i in range(1, count - 1)])
    sides = [(i, (i + 1) % count, i + count) for i in range(count)]
    rest = [((i + 1) % count, (i + 1) % count + count, i + count) for i in range(count)]
    return points[np.concatenate([fans[:, ::-1], fans + count, sides, rest])]


NOTCHED = {
    "L": [(0, 0), (20, 0), (20, 5), (5, 5), (5, 20), (0, 20)],
    "dart": [(0, 0), (10, 4), (0, 8), (3, 4)],
    "comb": [(0, 0), (30, 0), (30, 20), (25, 20), (25, 5), (20, 5), (20, 20), (15, 20), (15, 5),
             (10, 5), (10, 20), (5, 20), (5, 8), (0, 8)],
}  # fmt: skip


@pytest.mark.parametrize("rotation", [np.eye(3), ASKEW], ids=["flat", "askew"])
@pytest.mark.parametrize("name", NOTCHED)
def test_polygons_with_a_notch_have_their_own_shape_whatever_corner_they_begin_at(
    name: str, rotation: np.ndarray
) -> None:
    outline = np.array(NOTCHED[name], dtype=float)
    beside = np.roll(outline, -1, axis=0)
    base_mm2 = 0.5 * float(np.linalg.det(np.stack([outline, beside], axis=1)).sum())
    round_mm = float(np.linalg.norm(beside - outline, axis=1).sum())
    for turn in range(len(outline)):
        made = make_part(prism(outline, turn, rotation), name="p")
        assert made.mesh.volume_mm3 == pytest.approx(8 * base_mm2)  # 1e-6: float32 leaves 1e-7
        assert made.mesh.area_mm2 == pytest.approx(2 * base_mm2 + 8 * round_mm)
        assert is_closed(made)
        assert all("folded polygon" in told for told in made.repairs)


def test_bodies_that_touch_along_an_edge_are_refused():
    with pytest.raises(
        MeshError,
        match=r"1 edge in all 2 mm long with up to 4 faces, the first "
        r"at \(2, 2, 1\) mm: bodies or walls touch",
    ):
        part(box((2, 2, 2)), box((2, 2, 2), at=(2, 2, 0)))


def test_body_that_touches_itself_along_an_edge_is_refused():
    """A U of boxes whose ends meet at one edge: the faces pair up, the contact remains."""
    bent = box((4, 1, 1)), box((1, 3, 1), at=(0, 1, 0)), box((3, 1, 1), at=(1, 3, 0))
    closing = box((1, 2, 1), at=(4, 1, 0))
    with pytest.raises(MeshError, match="touch along a line"):
        part(*bent, closing)


def test_bodies_that_touch_at_a_point_are_taken():
    made = part(box((2, 2, 2)), box((2, 2, 2), at=(2, 2, 2)))
    assert made.mesh.volume_mm3 == pytest.approx(16)
    assert made.repairs == ()


def test_faces_that_occur_twice():
    triangles = box((3, 3, 3))
    rolled = np.roll(triangles[2:5], 1, axis=1)  # the same faces from another corner
    made = part(triangles, rolled)
    assert np.array_equal(made.mesh.triangles, triangles)
    assert made.repairs == ("3 triangles that occur twice dropped",)


def test_fin_without_thickness():
    triangles = box((3, 3, 3))
    fin = np.array([[[0, 0, 3], [3, 0, 3], [1, 0, 9]]], dtype=float)
    made = part(triangles, fin, inward(fin))
    assert np.array_equal(made.mesh.triangles, triangles)
    assert len(made.repairs) == 1


def test_degenerate_faces():
    triangles = box((3, 3, 3))
    needle = triangles[:2, [0, 0, 1]]
    made = part(needle, triangles)
    assert np.array_equal(made.mesh.triangles, triangles)
    assert made.repairs == ("2 triangles with two equal corners dropped",)


def test_body_without_volume_is_dropped():
    leaf = np.array([[[50, 0, 0], [53, 0, 0], [50, 3, 0]]], dtype=float)
    made = part(box((3, 3, 3)), leaf, inward(leaf))
    assert made.mesh.volume_mm3 == pytest.approx(27)
    assert made.repairs == ("1 of 2 bodies without volume dropped",)


def test_near_vertices_are_joined():
    """One corner of one face is off by a millionth of the extent."""
    triangles = box((10, 10, 10))
    triangles[0, 0] += 1e-5
    made = part(triangles)
    assert is_closed(made)
    assert made.mesh.volume_mm3 == pytest.approx(1000, rel=1e-5)
    assert "joined to others at most 1.7e-05 mm away" in made.repairs[0]


def test_gap_wider_than_the_tolerance_stays_open():
    triangles = box((10, 10, 10))
    triangles[0, 0] += 1e-3
    with pytest.raises(MeshError, match="open"):
        part(triangles)


def test_edge_that_ends_on_another():
    """One of two faces along an edge is divided at its middle, the other is not."""
    triangles = box((10, 10, 10))
    a, b, c = triangles[0]
    halves = np.array([[a, (a + b) / 2, c], [(a + b) / 2, b, c]])
    made = part(halves, triangles[1:])
    assert is_closed(made)
    assert made.mesh.volume_mm3 == pytest.approx(1000)
    assert made.repairs == ("1 edge that ends on the middle of another joined to it",)


def test_open_mesh_says_where():
    triangles = box((10, 10, 10), at=(5, 0, 0))
    with pytest.raises(
        MeshError,
        match=r"p: the surface is open: 4 edges with one face around 1 "
        r"hole of 40 mm around \(10, 5, 10\) mm",
    ):
        part(triangles[:-2])


def test_two_holes():
    triangles = sphere()
    far_apart = [np.argmin(triangles[:, 0, 0]), np.argmax(triangles[:, 0, 0])]
    with pytest.raises(MeshError, match="6 edges with one face around 2 holes, the longest of"):
        part(np.delete(triangles, far_apart, axis=0))


def test_soup():
    with pytest.raises(MeshError, match="its 40 triangles share no edge"):
        part(np.random.default_rng(0).random((40, 3, 3)))


def test_moebius_strip():
    with pytest.raises(MeshError, match="open"):
        part(moebius())


def moebius(steps=24):
    angle = np.linspace(0, 2 * np.pi, steps + 1)[:, None]
    side = np.array([-1.0, 1.0])
    radius = 10 + side * np.cos(angle / 2)
    rim = np.stack([radius * np.cos(angle), radius * np.sin(angle), side * np.sin(angle / 2)], -1)
    rim[-1] = rim[0, ::-1]
    a, b, c, d = rim[:-1, 0], rim[1:, 0], rim[1:, 1], rim[:-1, 1]
    return np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def test_surface_with_one_side():
    """The projective plane with six vertices: every edge has two faces, none can agree."""
    points = np.random.default_rng(3).random((6, 3)) * 10
    faces = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5), (0, 5, 1)]
    faces += [(1, 2, 4), (2, 3, 5), (3, 4, 1), (4, 5, 2), (5, 1, 3)]
    with pytest.raises(MeshError, match="one side only"):
        part(points[np.array(faces)])


@pytest.mark.parametrize(
    "triangles",
    [
        np.array([[[0, 0, 0], [3, 0, 0], [0, 3, 0]], [[0, 0, 0], [0, 3, 0], [3, 0, 0]]], float),
        box((5, 5, 0)),
        box((5, 5, 1e-9)),
    ],
)
def test_no_volume(triangles):
    with pytest.raises(MeshError, match="encloses no volume"):
        part(triangles)


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e30])
def test_impossible_coordinates(value):
    triangles = box((5, 5, 5))
    triangles[3, 1, 2] = value
    with pytest.raises(MeshError, match=re.escape(f"triangle 4 has a coordinate of {value}")):
        part(triangles)


def test_empty():
    with pytest.raises(MeshError, match="no triangles"):
        make_part(np.empty((0, 3, 3)), name="p")


def test_edges_whose_squared_length_is_zero():
    """Two boxes of 1e-200 mm side by side, four faces at their common edge."""
    box = np.array(trimesh.creation.box((2, 4, 6)).triangles)
    beside = box + np.array([2.0, 4.0, 0.0])
    with pytest.raises(MeshError, match="encloses no volume"):
        make_part(1e-200 * np.concatenate([box, beside]), name="p")


def test_surface_that_crosses_itself():
    """A sphere pulled through itself: the cap is turned inside out beyond the far side."""
    triangles = sphere(10.0, segments=64)
    z = triangles[:, :, 2]
    triangles[:, :, 2] = np.where(z > 8, z - 25, z)
    with pytest.raises(MeshError, match=r"the surface crosses itself: .* mm3; unite or mend"):
        part(triangles)


def test_one_body_that_overlaps_itself():
    """A thick helix whose turns overlap is one closed surface, enclosed twice in places."""
    turns, circle = np.linspace(0, 4 * np.pi, 121), np.linspace(0, 2 * np.pi, 24, endpoint=False)
    u, v = np.repeat(turns, 24), np.tile(circle, 121)
    radius = 10 + 2 * np.cos(v)
    rise = 2 * np.sin(v) + u / (2 * np.pi)
    points = np.stack([radius * np.cos(u), radius * np.sin(u), rise], axis=1)
    ring = np.arange(24)
    faces = [
        f
        for k in range(120)
        for i, j in zip(ring, np.roll(ring, -1), strict=True)
        for f in [
            (24 * k + i, 24 * k + 24 + i, 24 * k + 24 + j),
            (24 * k + i, 24 * k + 24 + j, 24 * k + j),
        ]
    ]
    faces += [(0, i + 1, i) for i in range(1, 23)][::-1]
    last = 24 * 120
    faces += [(last, last + i, last + i + 1) for i in range(1, 23)]
    with pytest.raises(MeshError, match="enclosed 2 times"):
        open_part((points, np.array(faces)))


def test_unit_hints():
    assert undersize(part(sphere(0.02)).mesh).endswith("in m it would be 40 x 40 x 40 mm: --unit m")
    few_mm = undersize(part(box((4.3, 0.8, 0.9))).mesh)
    assert few_mm == (
        "the part is 4.3 x 0.8 x 0.9 mm; in inches it would be 109 x 20.3 x 22.9 mm: --unit inch"
    )
    assert undersize(part(box((5.0, 0.8, 0.9))).mesh) is None
    tray = (490.0, 390.0, 200.0)

    def warnings(*size):
        return open_part((BOX_CORNERS * size, BOX_FACES), tray_mm=tray).warnings

    assert warnings(400, 300, 100) == ()
    (long,) = warnings(100, 480, 100)
    assert "turn it to fit" in long
    (huge,) = warnings(1e5, 1e4, 1e4)
    assert "in um it would be 100 x 10 x 10 mm: --unit um" in huge


def test_arrays():
    made = open_part((BOX_CORNERS, BOX_FACES), name="cube")
    assert made.name == "cube"
    assert made.mesh.volume_mm3 == pytest.approx(1)


@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    [
        (BOX_CORNERS[:, :2], BOX_FACES, r"\(n, 3\)"),
        (BOX_CORNERS, BOX_FACES + 1, "faces name vertices 1 to 8; there are 8"),
        (BOX_CORNERS, BOX_FACES - 1, "faces name vertices -1 to 6"),
    ],
)
def test_arrays_that_are_no_mesh(vertices, faces, message):
    with pytest.raises(ArgumentError, match=message):
        open_part((vertices, faces))
