"""Cut random and real parts along curved fields, audit every shell, and time a large case.

python benchmarks/field_shells.py [--shells N] [--seed S] [--timing]

Every shell is judged from its float32 soup as its readers find it: our audit, manifold3d's
import, trimesh with process and validate; all shells of a part together must cancel to the part's
own surface. Parts lie at random places before they are placed, some 400 mm away from the origin.
Real meshes are taken from ../shared/data/meshes where that is.
"""

import argparse
import collections
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import trimesh
from manifold3d import CrossSection, Error, Manifold
from manifold3d import Mesh as SolidMesh

from benchmarks.audit import audit
from planner.cutting.pieces import split
from planner.errors import PlannerError
from planner.fields.parse import Setting, build_field
from planner.formats.mesh_file import read_mesh
from planner.grading.check import interfaces_cancel
from planner.mesh.mesh import Mesh, join_shells, weld
from planner.mesh.part import make_part, moved_to_corner

MESHES = Path(__file__).parents[2] / "shared/data/meshes"
UNITS = {".STL": 25.4}


def solid(kind, rng):
    """A closed solid of about unit size."""
    if kind == "ball":
        return Manifold.sphere(1, int(rng.integers(4, 60)))
    if kind == "ring":
        ring = CrossSection.circle(0.3, int(rng.integers(4, 30))).translate((1, 0))
        return Manifold.revolve(ring, int(rng.integers(5, 60)))
    if kind == "drilled":
        drill = Manifold.cylinder(4, 0.3, 0.3, 24, True)
        return Manifold.sphere(1, 32) - drill - drill.rotate([90, 0, 0])
    if kind == "thin walls":
        outer = Manifold.cube([1, 0.7, 0.6])
        return outer - Manifold.cube([0.94, 0.64, 0.6]).translate([0.03, 0.03, 0.03])
    if kind == "gyroid":
        size = 2 * np.pi * rng.uniform(0.7, 1.5)

        def sheet(x, y, z):
            waves = np.sin(x) * np.cos(y) + np.sin(y) * np.cos(z) + np.sin(z) * np.cos(x)
            return 0.5 - abs(waves)

        found = Manifold.level_set(sheet, [0, 0, 0, size, size, size], 0.4)
        return found.scale([1 / size] * 3)
    found = Manifold.cube([1, 1, 1])
    for _ in range(int(rng.integers(1, 6))):
        if kind == "pitted":
            ball = Manifold.sphere(rng.uniform(0.1, 0.5), int(rng.integers(4, 40)))
            found -= ball.translate(rng.uniform(0, 1, 3))
        else:
            # Sides on a lattice of 0.1: many faces lie in planes of others.
            box = Manifold.cube(np.round(rng.uniform(0.2, 1, 3), 1))
            found += box.translate(np.round(rng.uniform(-0.5, 0.9, 3), 1))
    return found


KINDS = ("ball", "ring", "drilled", "thin walls", "gyroid", "pitted", "boxes")


def random_part(rng):
    kind = KINDS[rng.integers(len(KINDS))]
    found = solid(kind, rng)
    if rng.random() < 0.5:
        found = found.rotate(rng.uniform(0, 360, 3))
    raw = found.scale(rng.uniform(0.5, 2, 3) * 10 ** rng.uniform(0.3, 1.9)).to_mesh()
    vertices = np.asarray(raw.vert_properties)[:, :3] + rng.uniform(-400, 400, 3)
    return kind, vertices[np.asarray(raw.tri_verts)].astype(np.float64)


def real_parts():
    for path in sorted(MESHES.glob("*")) if MESHES.is_dir() else ():
        if path.suffix.casefold() not in (".stl", ".3mf", ".obj", ".ply"):
            continue
        try:
            scale = UNITS.get(path.suffix, 1.0)
            triangles = read_mesh(path).triangles * scale
            make_part(triangles, name=path.name)
        except PlannerError as error:
            print(f"  left out: {str(error)[:110]}")
            continue
        yield path.name, triangles


def field_text(mesh, rng):
    """A field somewhere about the part, as a user would write it, in placed coordinates."""
    low, high = mesh.bounds_mm
    size = high - low

    def near():
        return " ".join(f"{v:.4f}" for v in low + rng.uniform(-0.2, 1.2, 3) * size)

    normal = np.eye(3)[rng.integers(3)] if rng.random() < 0.5 else rng.normal(size=3)
    way = " ".join(f"{v:.4f}" for v in normal)
    axis = "xyz"[rng.integers(3)]
    k = "xyz".index(axis)
    kinds = (
        f"radial: point={near()}",
        f"radial: line={near()} {way}",
        "distance: surface",
        f"distance: hole={near()}",
        f"expression: 0.5 + 0.5*sin({rng.uniform(2, 8) / size[0]:.4g}*x)*cos("
        f"{rng.uniform(2, 8) / size[1]:.4g}*y + {1 / size[2]:.4g}*z)",
        f"expression: ({axis} - {low[k]:.6f})/{size[k]:.6f}",
        f"min(radial: point={near()}; distance: surface)",
        f"max(axis: {axis}; radial: line={near()} {way})",
        f"blend(axis: x; radial: point={near()}; 0.5)",
        f"clamp(radial: point={near()}; 0.3; 0.7)",
        f"harmonic: from={axis}<{low[k] + 0.15 * size[k]:.4f}, "
        f"to={axis}>{low[k] + 0.85 * size[k]:.4f}",
        f"geodesic: start={axis}<{low[k] + 0.15 * size[k]:.4f}",
    )
    return kinds[rng.integers(len(kinds))]


def levels_for(field, mesh, rng):
    """Levels at random, some through vertices of the part, some close together."""
    at = field.values(mesh.vertices[rng.integers(len(mesh.vertices), size=2)])
    levels = np.concatenate([rng.uniform(0.02, 0.98, rng.integers(1, 8)), at])
    if rng.random() < 0.4:
        levels = np.append(levels, levels[0] + 0.003)
    levels = np.sort(levels[(levels > 0.001) & (levels < 0.999)])
    return levels[np.diff(levels, prepend=0.0) > 1e-3]


def watertight(soup):
    return trimesh.Trimesh(*weld(soup), process=True, validate=True).is_watertight


def faults(pieces, mesh):
    """How many shells there are, and what is wrong with them.

    trimesh joins and drops what is nearer than 1e-8 mm: a part that it opens is no test of cuts.
    """
    whole = watertight(mesh.triangles.astype(np.float32))
    soups = [pieces.vertices[pieces.shell_faces([i])] for i in range(pieces.count)]
    soups = [soup for soup in soups if len(soup)]
    found = collections.Counter()
    for soup in soups:
        vertices, faces = weld(soup)
        imported = Manifold(SolidMesh(vertices, faces.astype(np.uint32)))
        found["unsound"] += not audit(soup).sound or imported.status() != Error.NoError
        found["open in trimesh"] += whole and not watertight(soup)
    found["parts that do not fit"] += not interfaces_cancel(join_shells(soups), mesh)
    return len(soups), found


def sweep(wanted, seed):
    shells, parts, refused, total = 0, 0, 0, collections.Counter()
    own, cpu_s = list(real_parts()), 0.0
    print(f"{len(own)} real meshes")
    number = seed
    while shells < wanted:
        rng = np.random.default_rng(number)
        kind, triangles = own[number % len(own)] if own and number % 4 == 0 else random_part(rng)
        number += 1
        try:
            mesh, _ = moved_to_corner(make_part(triangles, name=kind).mesh)
        except PlannerError:
            continue  # edges that touch: refused before any cut
        if not audit(mesh.triangles.astype(np.float32)).sound:
            continue
        extent = np.ptp(mesh.bounds_mm, axis=0)
        coarsest = float(extent.max()) / rng.uniform(8, 60)
        pitch_mm = max(coarsest, float(np.cbrt(extent.prod() / 3e5)))
        text = field_text(mesh, rng)
        try:
            field = build_field(text, Setting(mesh, (0.0, 0.0, 0.0), pitch_mm))
        except PlannerError:
            continue  # a region that holds nothing of a coarse part
        levels = levels_for(field, mesh, rng)
        if not len(levels):
            continue
        # Half of them are divided where the field bends and at its creases.
        within_mm = pitch_mm * 10 ** rng.uniform(-1.7, -0.5) if number % 2 else np.inf
        start = time.process_time()
        try:
            pieces = split(mesh, field, levels, pitch_mm=pitch_mm, within_mm=within_mm)
        except PlannerError as error:
            refused += 1
            print(f"  {number - 1} {kind}, {text}: refused: {str(error)[:90]}", flush=True)
            continue
        cpu_s += time.process_time() - start
        count, found = faults(pieces, mesh)
        shells, parts = shells + count, parts + 1
        for what, times in found.items():
            if times:
                print(f"  {number - 1} {kind}, {text}: {times} {what}", flush=True)
        total += found
    print(f"{shells} shells of {parts} parts in {cpu_s:.1f} CPU s; {refused} parts refused")
    for what in ("unsound", "parts that do not fit", "open in trimesh"):
        print(f"{what}: {total[what]}")
    return total["unsound"] + total["parts that do not fit"]


def blob(edge_mm):
    """Fourteen balls melted into each other, about 38 mm across."""
    rng = np.random.default_rng(3)
    centre, radius = rng.uniform(-14, 14, (14, 3)), rng.uniform(5, 9, 14)

    def depth(x, y, z):
        off = np.sqrt(((np.array([x, y, z]) - centre) ** 2).sum(axis=1)) - radius
        return 1.5 * np.log(np.exp(-off / 1.5).sum())

    raw = Manifold.level_set(depth, [-27, -27, -27, 27, 27, 27], edge_mm).to_mesh()
    vertices = np.asarray(raw.vert_properties)[:, :3].astype(np.float64)
    return moved_to_corner(Mesh(vertices, np.asarray(raw.tri_verts)))[0]


def case(file, pitch_mm):
    """Time one case in a process of its own, whose peak memory is then its own too."""
    mesh = Mesh(*np.load(file).values())
    x, y, z = mesh.bounds_mm.mean(axis=0)
    text = f"radial: point={x:.3f} {y:.3f} {z:.3f}, from=0, to=20"
    field = build_field(text, Setting(mesh, (0.0, 0.0, 0.0), pitch_mm))
    cube = Manifold.cube([3, 3, 3]).translate([x, y, z]).to_mesh()
    small = Mesh(np.asarray(cube.vert_properties)[:, :3], np.asarray(cube.tri_verts))
    split(moved_to_corner(small)[0], field, [0.9], pitch_mm=0.5)  # the kernels are loaded
    start = time.process_time()
    pieces = split(mesh, field, np.arange(1, 10) / 10, pitch_mm=pitch_mm)
    cpu_s = time.process_time() - start
    status = Path("/proc/self/status").read_text()
    peak_mb = int(re.search(r"VmHWM:\s*(\d+)", status)[1]) / 1024
    print(
        f"  {len(mesh.faces):7d} triangles, {pitch_mm:.2f} mm: {cpu_s:5.2f} CPU s, "
        f"{len(pieces.cap_faces):8d} interface triangles, peak {peak_mb:.0f} MB",
        flush=True,
    )


def timing():
    print("ten bands about a point; peak memory is the whole process's", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        for edge_mm in (0.5, 0.26):
            mesh, file = blob(edge_mm), f"{folder}/part.npz"
            np.savez(file, vertices=mesh.vertices, faces=mesh.faces)
            for pitch_mm in ("1.0", "0.5", "0.25"):
                subprocess.run([sys.executable, __file__, "--case", file, pitch_mm], check=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--shells", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--timing", action="store_true")
    parser.add_argument("--case", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.case:
        case(options.case[0], float(options.case[1]))
    elif options.timing:
        timing()
    else:
        sys.exit(1 if sweep(options.shells, options.seed) else 0)
