"""Solids that make cutting hard, by family and seed: triangles in mm, as a user's file has them."""

from collections.abc import Callable

import numpy as np
from manifold3d import CrossSection, Manifold, OpType
from numpy.typing import NDArray

Triangles = NDArray[np.float64]
Rng = np.random.Generator


def triangles_of(solid: Manifold) -> Triangles:
    """Return the triangles (n, 3, 3) of a solid."""
    mesh = solid.to_mesh64()
    return np.asarray(mesh.vert_properties)[:, :3][np.asarray(mesh.tri_verts)]


def box(*size: float, at: tuple[float, float, float] = (0, 0, 0)) -> Manifold:
    return Manifold.cube(list(size)).translate(list(at))


def ball(radius: float, segments: int = 24, at: tuple[float, ...] = (0, 0, 0)) -> Manifold:
    return Manifold.sphere(radius, segments).translate(list(at))


def together(solids: list[Manifold]) -> Manifold:
    return Manifold.batch_boolean(solids, OpType.Add)


def _turned(solid: Manifold, rng: Rng) -> Manifold:
    return solid.rotate(list(rng.uniform(0, 360, 3)))


# ------------------------------------------------------------------------------------------------
# Solids by Boolean operations.


def needles(rng: Rng) -> Triangles:
    sticks = [
        _turned(Manifold.cylinder(rng.uniform(15, 40), rng.uniform(0.2, 1.0), 0.01, 5), rng)
        for _ in range(4)
    ]
    return triangles_of(together([ball(3, 12), *sticks]))


def thin_plate(rng: Rng) -> Triangles:
    return triangles_of(_turned(box(40, 30, rng.uniform(0.02, 0.4)), rng))


def flat_plate(rng: Rng) -> Triangles:
    return triangles_of(box(60, 40, rng.uniform(0.05, 0.3)))


def stairs(rng: Rng) -> Triangles:
    n = int(rng.integers(3, 9))
    return triangles_of(together([box(40 - 4 * k, 20, 3, at=(0, 0, 3 * k)) for k in range(n)]))


def steps_on_cuts(rng: Rng) -> Triangles:
    # Ten equal bands along z cut exactly where faces lie.
    return triangles_of(together([box(30, 30 - 3 * k, 2, at=(0, 0, 2 * k)) for k in range(10)]))


def boxes_united(rng: Rng) -> Triangles:
    return triangles_of(
        together(
            [
                _turned(box(*rng.uniform(2, 14, 3)), rng).translate(list(rng.uniform(0, 12, 3)))
                for _ in range(int(rng.integers(3, 9)))
            ]
        )
    )


def boxes_on_a_lattice(rng: Rng) -> Triangles:
    return triangles_of(
        together(
            [
                box(*rng.integers(1, 8, 3), at=tuple(rng.integers(0, 10, 3)))
                for _ in range(int(rng.integers(3, 10)))
            ]
        )
    )


def pitted(rng: Rng) -> Triangles:
    pits = [
        ball(rng.uniform(1, 6), int(rng.integers(4, 24)), at=tuple(rng.uniform(0, 20, 3)))
        for _ in range(6)
    ]
    return triangles_of(box(20, 16, 12) - together(pits))


def torus(rng: Rng) -> Triangles:
    ring = CrossSection.circle(rng.uniform(0.5, 7), 16).translate((8, 0))
    return triangles_of(Manifold.revolve(ring, int(rng.integers(5, 40))))


def nested_cavities(rng: Rng) -> Triangles:
    solid = Manifold()
    for k, radius in enumerate(np.arange(12.0, 2.0, -1.5)):
        at = tuple(rng.uniform(-0.3, 0.3, 3))
        solid = solid + ball(radius, 20, at) if k % 2 == 0 else solid - ball(radius, 20, at)
    return triangles_of(solid)


def slivers(rng: Rng) -> Triangles:
    return triangles_of(Manifold.cylinder(rng.uniform(40, 120), 6, 6.001, 360))


def fine_sphere(rng: Rng) -> Triangles:
    return triangles_of(ball(15, int(rng.integers(90, 140))))


def menger(rng: Rng) -> Triangles:
    solid, side = box(27, 27, 27), 27.0
    for level in range(2):
        third = side / 3
        holes = [
            box(30, third, third, at=(-1, third + i * side, third + j * side))
            for i in range(3**level)
            for j in range(3**level)
        ]
        along_x = together(holes)
        for turn in ([0, 0, 0], [90, 0, 90], [90, 90, 0]):
            solid -= along_x.translate([-13.5] * 3).rotate(turn).translate([13.5] * 3)
        side = third
    return triangles_of(solid)


def gyroid(rng: Rng) -> Triangles:
    size, thick = float(2 * np.pi * rng.uniform(0.7, 1.2)), rng.uniform(0.25, 0.6)

    def sheet(x: float, y: float, z: float) -> float:
        waves = np.sin(x) * np.cos(y) + np.sin(y) * np.cos(z) + np.sin(z) * np.cos(x)
        return float(thick - abs(waves))

    solid = Manifold.level_set(sheet, [0, 0, 0, size, size, size], 0.5)
    return triangles_of(solid.scale([20 / size] * 3))


def many_bodies(rng: Rng) -> Triangles:
    places = np.stack(np.meshgrid(*[np.arange(4)] * 3), axis=-1).reshape(-1, 3) * 6.0
    balls = [ball(rng.uniform(0.5, 2.9), 8, at=tuple(place)) for place in places]
    return triangles_of(Manifold.compose(balls))


def drilled(rng: Rng) -> Triangles:
    drills = [
        Manifold.cylinder(20, 0.8, 0.8, 12, True).translate([x, y, 2])
        for x in range(3, 30, 4)
        for y in range(3, 20, 4)
    ]
    return triangles_of(box(32, 22, 4) - together(drills))


def twisted(rng: Rng) -> Triangles:
    section = CrossSection.square((6, 2), True)
    return triangles_of(section.extrude(40, 60, float(rng.uniform(90, 900)), (0.6, 1.4)))


def comb(rng: Rng) -> Triangles:
    thick = rng.uniform(0.1, 0.9)
    fins = [box(thick, 10, 12, at=(1.7 * k, 0, 2)) for k in range(16)]
    return triangles_of(together([box(27, 10, 2.5), *fins]))


def star(rng: Rng) -> Triangles:
    n = int(rng.integers(5, 40))
    angles = np.arange(2 * n) * np.pi / n
    radii = np.where(np.arange(2 * n) % 2, rng.uniform(0.3, 6), 15)
    points = np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)
    return triangles_of(CrossSection([points.tolist()]).extrude(float(rng.uniform(0.3, 20))))


def hedgehog(rng: Rng) -> Triangles:
    spikes = [_turned(Manifold.cylinder(14, 0.8, 0.0, 4), rng) for _ in range(25)]
    return triangles_of(together([ball(5, 16), *spikes]))


def struts(rng: Rng) -> Triangles:
    bars = []
    for axis in range(3):
        size = [1.2, 1.2, 1.2]
        size[axis] = 21.0
        for i in range(4):
            for j in range(4):
                at = [6.0 * i, 6.0 * j]
                at.insert(axis, 0.0)
                bars.append(box(*size, at=tuple(at)))
    return triangles_of(together(bars))


def hulls(rng: Rng) -> Triangles:
    return triangles_of(
        together([Manifold.hull_points(rng.normal(0, 6, (6, 3)).tolist()) for _ in range(5)])
    )


def wavy_sheet(rng: Rng) -> Triangles:
    def bend(points: NDArray[np.float64]) -> NDArray[np.float64]:
        x, y, z = points.T
        return np.stack([x, y, z + 3 * np.sin(x / 4) * np.cos(y / 5)], axis=1)

    sheet = box(40, 30, rng.uniform(0.1, 0.8)).refine(14)
    return triangles_of(sheet.warp_batch(bend))


def near_coplanar(rng: Rng) -> Triangles:
    def shift(points: NDArray[np.float64]) -> NDArray[np.float64]:
        return points + rng.normal(0, 10.0 ** rng.integers(-7, -3), points.shape)

    return triangles_of(box(20, 20, 10).refine(6).warp_batch(shift))


def hardly_turned(rng: Rng) -> Triangles:
    angle = 10.0 ** rng.uniform(-8, -3)
    return triangles_of(
        together([box(20, 20, 4, at=(0, 0, 4 * k)).rotate([0, angle * k, 0]) for k in range(4)])
    )


def crossing_slabs(rng: Rng) -> Triangles:
    slabs = [_turned(Manifold.cube([24, 24, 0.5], True), rng) for _ in range(6)]
    return triangles_of(together(slabs))


def bumps(rng: Rng) -> Triangles:
    waves = rng.uniform(3, 12, 3)

    def bump(points: NDArray[np.float64]) -> NDArray[np.float64]:
        x, y, z = points.T / 15.0
        more = 0.15 * np.sin(waves[0] * x) * np.cos(waves[1] * y) + 0.08 * np.sin(waves[2] * z)
        return points * (1 + more)[:, None]

    return triangles_of(ball(15, 64).warp_batch(bump))


# ------------------------------------------------------------------------------------------------
# Sizes and places that single precision feels.


def kilometre(rng: Rng) -> Triangles:
    return boxes_united(rng) * 2e4


def micrometre(rng: Rng) -> Triangles:
    return pitted(rng) * 1e-3


def far_away(rng: Rng) -> Triangles:
    return boxes_united(rng) + rng.uniform(-1, 1, 3) * 10.0 ** rng.uniform(3, 6)


def long_and_thin(rng: Rng) -> Triangles:
    return triangles_of(box(200, 1, rng.uniform(0.4, 1)).rotate([0, 0, float(rng.uniform(0, 5))]))


# ------------------------------------------------------------------------------------------------
# Meshes that touch or cross themselves, or are open: refused, repaired, or cut soundly.


def touching_edge(rng: Rng) -> Triangles:
    return np.concatenate([triangles_of(box(8, 8, 8)), triangles_of(box(8, 8, 8, at=(8, 8, 0)))])


def touching_vertex(rng: Rng) -> Triangles:
    return np.concatenate([triangles_of(box(8, 8, 8)), triangles_of(box(8, 8, 8, at=(8, 8, 8)))])


def touching_face(rng: Rng) -> Triangles:
    return np.concatenate([triangles_of(box(8, 8, 8)), triangles_of(box(6, 6, 6, at=(8, 1, 1)))])


def surface_of(family: str, triangles: Triangles) -> Triangles:
    """Return what counts as the surface of a solid: not the faces at which its bodies touch."""
    if family != touching_face.__name__:
        return triangles
    return triangles_of(together([box(8, 8, 8), box(6, 6, 6, at=(8, 1, 1))]))


def overlapping_bodies(rng: Rng) -> Triangles:
    return np.concatenate(
        [triangles_of(box(8, 8, 8)), triangles_of(ball(5, 20, at=tuple(rng.uniform(2, 8, 3))))]
    )


def body_in_body(rng: Rng) -> Triangles:
    return np.concatenate([triangles_of(box(12, 12, 12)), triangles_of(ball(3, 16, at=(6, 6, 6)))])


def horn_torus(rng: Rng) -> Triangles:
    # A ring whose hole has closed to a point: it touches itself there.
    n, m = 24, 16
    around, about = np.arange(n) * 2 * np.pi / n, np.arange(m) * 2 * np.pi / m
    u, v = np.meshgrid(around, about, indexing="ij")
    radius = 6 * (1 + np.cos(v))
    points = np.stack([radius * np.cos(u), radius * np.sin(u), 6 * np.sin(v)], axis=2)
    points[:, m // 2] = 0.0
    right, up = np.roll(points, -1, axis=0), np.roll(points, -1, axis=1)
    both = np.roll(right, -1, axis=1)
    halves = [np.stack(three, axis=2) for three in ((points, right, both), (points, both, up))]
    soup = np.concatenate([half.reshape(-1, 3, 3) for half in halves])
    return soup[np.ptp(soup, axis=1).max(axis=1) > 0]


def figure_of_eight(rng: Rng) -> Triangles:
    # A tube along a curve that passes through itself.
    n, m = 80, 12
    t = np.arange(n) * 2 * np.pi / n
    line = np.stack([10 * np.sin(t), 10 * np.sin(t) * np.cos(t), 0.8 * np.cos(t)], axis=1)
    ahead = np.roll(line, -1, axis=0) - np.roll(line, 1, axis=0)
    ahead /= np.linalg.norm(ahead, axis=1)[:, None]
    side = np.cross(ahead, [0, 0, 1.0])
    side /= np.linalg.norm(side, axis=1)[:, None]
    above = np.cross(side, ahead)
    v = np.arange(m) * 2 * np.pi / m
    rim = np.cos(v)[None, :, None] * side[:, None] + np.sin(v)[None, :, None] * above[:, None]
    points = line[:, None] + rng.uniform(0.3, 1.6) * rim
    right, up = np.roll(points, -1, axis=0), np.roll(points, -1, axis=1)
    both = np.roll(right, -1, axis=1)
    halves = [np.stack(three, axis=2) for three in ((points, both, right), (points, up, both))]
    return np.concatenate([half.reshape(-1, 3, 3) for half in halves])


def inside_out(rng: Rng) -> Triangles:
    return pitted(rng)[:, ::-1]


def doubled_faces(rng: Rng) -> Triangles:
    soup = boxes_united(rng)
    return np.concatenate([soup, soup[rng.integers(0, len(soup), 3)]])


def open_box(rng: Rng) -> Triangles:
    return boxes_united(rng)[1:]


FAMILIES: dict[str, Callable[[Rng], Triangles]] = {
    make.__name__: make
    for make in (
        needles, thin_plate, flat_plate, stairs, steps_on_cuts, boxes_united, boxes_on_a_lattice,
        pitted, torus, nested_cavities, slivers, fine_sphere, menger, gyroid, many_bodies, drilled,
        twisted, comb, star, hedgehog, struts, hulls, wavy_sheet, near_coplanar, hardly_turned,
        crossing_slabs, bumps, kilometre, micrometre, far_away, long_and_thin, touching_edge,
        touching_vertex, touching_face, overlapping_bodies, body_in_body, horn_torus,
        figure_of_eight, inside_out, doubled_faces, open_box,
    )
}  # fmt: skip
