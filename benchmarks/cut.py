"""Time the planar cutter against manifold3d and trimesh: nine levels along the longest axis.

python benchmarks/cut.py [--quick]

Each figure is the median of one to five runs after one to warm up. manifold3d bisects with
split_by_plane, starting from a finished Manifold. trimesh caps only with shapely installed.
"""

import statistics
import sys
import time
from itertools import pairwise

import numpy as np
import trimesh
from manifold3d import CrossSection, Manifold

from benchmarks.audit import audit
from planner.cutting.pieces import split
from planner.fields.basic import axis_field
from planner.grading.check import interfaces_cancel
from planner.mesh.mesh import Mesh, join_shells
from planner.mesh.part import moved_to_corner

LEVELS = np.arange(1, 10) / 10


def dog_bone():
    x = np.linspace(-40, 40, 1000)
    half = 3 + 6 * np.clip((abs(x) - 16) / 10, 0, 1) ** 2
    return CrossSection([np.c_[np.r_[x, x[::-1]], np.r_[-half, half[::-1]]]]).extrude(3)


def gyroid(edge_mm, size_mm=40.0):
    k = 6 * np.pi / size_mm

    def solid(x, y, z):
        sx, sy, sz = np.sin(k * np.array([x, y, z]))
        cx, cy, cz = np.cos(k * np.array([x, y, z]))
        return 0.5 - abs(sx * cy + sy * cz + sz * cx)

    return Manifold.level_set(solid, [0, 0, 0, size_mm, size_mm, size_mm], edge_mm)


def median_s(function, runs=5):
    function()
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def bisect(solid, normal, offsets):
    """All pieces of a Manifold between planes, halving the range of planes each time."""
    if not len(offsets):
        return [solid]
    middle = len(offsets) // 2
    above, below = solid.split_by_plane(normal, offsets[middle])
    return [
        *bisect(below, normal, offsets[:middle]), *bisect(above, normal, offsets[middle + 1 :]),
    ]  # fmt: skip


def by_manifold3d(solid, normal, offsets):
    # Manifold evaluates lazily: asking for the meshes makes it work.
    return [piece.to_mesh() for piece in bisect(solid, normal, offsets)]


def by_trimesh(mesh, normal, offsets):
    part = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    pieces = []
    for low, high in pairwise([None, *offsets, None]):
        piece = part
        if low is not None:
            piece = piece.slice_plane(normal * low, normal, cap=True, engine="manifold")
        if high is not None:
            piece = piece.slice_plane(normal * high, -normal, cap=True, engine="manifold")
        pieces.append(piece)
    return pieces


def run(name, solid):
    raw = solid.to_mesh()
    source = Mesh(np.asarray(raw.vert_properties)[:, :3], np.asarray(raw.tri_verts))
    mesh, translation_mm = moved_to_corner(source)
    moved = solid.translate(translation_mm.tolist())
    field = axis_field(None, mesh)
    normal, offsets = field.plane(0.0)[0], [field.plane(level)[1] for level in LEVELS]
    pieces = split(mesh, field, LEVELS)
    soups = [pieces.vertices[pieces.shell_faces([i])] for i in range(pieces.count)]
    ours = median_s(lambda: split(mesh, field, LEVELS))
    theirs = median_s(lambda: by_manifold3d(moved, normal, offsets), runs=3)
    print(f"{name}: {len(mesh.faces)} triangles")
    print(f"  place                  {median_s(lambda: moved_to_corner(source), 3):9.4f} s")
    print(f"  split                  {ours:9.4f} s")
    print(f"  manifold3d             {theirs:9.4f} s   {theirs / ours:6.1f} x")
    try:
        sliced = median_s(lambda: by_trimesh(mesh, normal, offsets), runs=1)
        print(f"  trimesh slice_plane    {sliced:9.4f} s   {sliced / ours:6.1f} x")
    except ImportError as missing:
        print(f"  trimesh slice_plane    {missing}")
    soup = mesh.triangles.astype(np.float32)
    print(f"  audit of the part      {median_s(lambda: audit(soup), 3):9.4f} s")
    sound = sum(audit(soup).sound for soup in soups)
    fit = interfaces_cancel(join_shells(soups), mesh)
    print(f"  sound shells {sound} of {len(soups)}, interfaces coincide: {fit}")


if __name__ == "__main__":
    run("dog-bone", dog_bone())
    run("gyroid, coarse", gyroid(0.8))
    if "--quick" not in sys.argv:
        run("gyroid, fine", gyroid(0.28))
