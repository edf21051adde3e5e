"""Voxel columns, labels and wall checks: time, memory and exactness, beside trimesh.

Run ``python benchmarks/columns.py`` (a minute or two), or with ``--quick`` for the columns alone.
"""

import argparse
import itertools
import resource
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import trimesh

from planner.fields.basic import axis_field
from planner.mesh.mesh import Mesh
from planner.voxels.columns import dense, grid_for, iterate_columns, label_columns, layers, voxelize
from planner.voxels.thin_places import thin_walls

NATIVE = (0.042, 0.042, 0.03)


def organic(subdivisions: int, size_mm: tuple[float, float, float]) -> Mesh:
    """Return a bumpy ball of 20 x 4^subdivisions triangles that fills a box."""
    ball = trimesh.creation.icosphere(subdivisions, 10.0)
    x, y, _ = ball.vertices.T
    vertices = ball.vertices * (1 + 0.2 * np.sin(0.7 * x) * np.cos(0.5 * y))[:, None]
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    return Mesh((vertices - low) / (high - low) * size_mm, ball.faces)


def best(run: Callable[[], Any], times: int = 3) -> tuple[float, Any]:
    """Return the shortest time of some runs in s, and the last result."""
    took = []
    for _ in range(times):
        start = time.perf_counter()
        result = run()
        took.append(time.perf_counter() - start)
    return min(took), result


def peak_MB() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def beside_trimesh(mesh: Mesh) -> None:
    print(f"{len(mesh.faces)} triangles in {np.ptp(mesh.bounds_mm, axis=0).round()} mm")
    print("pitch/mm   columns/s  volume error  dense/s   trimesh/s  volume error  ratio")
    body = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    for pitch in (2.0, 1.0, 0.5, 0.2, 0.1, NATIVE):
        ours, columns = best(lambda p=pitch: voxelize(mesh, p))
        error = columns.volume_mm3 / mesh.volume_mm3 - 1
        row = f"{pitch!s:22.22} {ours:8.4f} {error:+10.1e}"
        if np.prod(np.array(columns.grid.shape, float)) < 1e9:
            row += f" {best(lambda c=columns: dense(c))[0]:8.3f}"
        if isinstance(pitch, float) and pitch >= 0.5:
            theirs, voxels = best(lambda p=pitch: body.voxelized(p).fill(), times=1)
            surplus = voxels.filled_count * pitch**3 / mesh.volume_mm3 - 1
            row += f" {theirs:8.2f} {surplus:+10.1e} {theirs / ours:8.0f}x"
        print(row, flush=True)


def filling_the_tray() -> None:
    for mesh in (organic(2, (490, 390, 200)), organic(8, (490, 390, 200))):
        grid = grid_for(mesh.bounds_mm, NATIVE)
        start, voxels, runs = time.perf_counter(), 0, 0
        for slab in iterate_columns(mesh, grid):
            voxels += slab.voxels
            runs += len(slab.start)
        took = time.perf_counter() - start
        error = voxels * grid.voxel_mm3 / mesh.volume_mm3 - 1
        print(
            f"tray, {len(mesh.faces)} triangles: {took:.2f} s, {runs:.2e} runs, "
            f"error {error:+.1e}, peak {peak_MB():.0f} MB"
        )


def labelling(mesh: Mesh) -> None:
    columns = voxelize(mesh, NATIVE)
    levels = np.linspace(0, 1, 11)[1:-1]
    for axis in ("z", "x", (1.0, 2.0, 3.0)):
        took, labelled = best(lambda a=axis: label_columns(columns, axis_field(a, mesh), levels))
        print(f"9 levels along {axis}: {took:.3f} s, {len(labelled.start):.2e} runs")
    took, images = best(lambda: layers(labelled, 1000, 1064))
    print(f"64 layers: {took:.3f} s, {images.size / took:.2e} voxels/s")


def walls() -> None:
    parts = {
        "bar of 115 x 19 x 4 mm": Mesh(*_box(115, 19, 4)),
        "organic of 100 x 80 x 60 mm": organic(6, (100, 80, 60)),
        "box of 200 mm": Mesh(*_box(200, 200, 200)),
    }
    for (name, mesh), bands in itertools.product(parts.items(), (1, 9)):
        levels = np.linspace(0, 1, bands + 1)[1:-1]
        field = axis_field("x", mesh)
        took, found = best(
            lambda m=mesh, f=field, v=levels, n=bands: thin_walls(m, f, v, range(n), 0.6), times=1
        )
        print(
            f"walls, {name}, {bands} bands: {took:.2f} s, {len(found)} findings, "
            f"peak {peak_MB():.0f} MB",
            flush=True,
        )


def _box(*extents: float) -> tuple[np.ndarray, np.ndarray]:
    box = trimesh.creation.box(extents)
    return np.asarray(box.vertices), np.asarray(box.faces)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="columns beside trimesh only")
    quick = parser.parse_args().quick
    warm = Mesh(*_box(3, 3, 0.4))
    thin_walls(warm, axis_field("x", warm), (0.5,), "ab", 0.6)
    part = organic(7, (110, 82, 70))
    if not quick:  # trimesh last: it would set the peak memory
        filling_the_tray()
        labelling(part)
        walls()
    beside_trimesh(part)
