"""Voxel columns, labels and wall checks: time, memory and exactness, beside trimesh.

Run ``python benchmarks/columns.py`` (a minute or two), or with ``--quick`` for the columns alone.
"""

import argparse
import resource
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import trimesh

from planner.mesh.mesh import Mesh
from planner.voxels.columns import dense, grid_for, iterate_columns, voxelize
from planner.voxels.thin_places import thin_solid_places

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
        error = columns.voxels * columns.grid.voxel_mm3 / mesh.volume_mm3 - 1
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


def walls() -> None:
    parts = {
        "bar of 115 x 19 x 4 mm": Mesh(*_box(115, 19, 4)),
        "organic of 100 x 80 x 60 mm": organic(6, (100, 80, 60)),
        "box of 200 mm": Mesh(*_box(200, 200, 200)),
    }
    for name, mesh in parts.items():
        took, (found, more) = best(lambda m=mesh: thin_solid_places(m, 0.6, listed=3), times=1)
        print(
            f"walls, {name}: {took:.2f} s, {len(found) + more} places, peak {peak_MB():.0f} MB",
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
    thin_solid_places(warm, 0.6, listed=3)
    part = organic(7, (110, 82, 70))
    if not quick:  # trimesh last: it would set the peak memory
        filling_the_tray()
        walls()
    beside_trimesh(part)
