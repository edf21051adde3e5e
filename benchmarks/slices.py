"""planner slices: time, memory and size on disk, beside trimesh, and how they grow.

Run ``python benchmarks/slices.py`` (a minute or two), or with ``--quick`` without trimesh. Each row
is a process of its own: CPU time and memory with start and imports, wall time without. What is
written is removed.
"""

import argparse
import json
import math
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from planner.slices import write_slices

SAMPLES = Path(__file__).parents[1] / "samples"
NATIVE = (0.042, 0.042, 0.03)
TRAY_MM = (490.0, 390.0, 200.0)
TRAY_SLAB_MM = 6.0
"""Height of the tray-filling part that is sliced; the whole is that many times more."""


def in_a_process(task: str, *arguments: object) -> dict[str, float]:
    """Run one of the tasks below alone; return its result, CPU s and peak MB."""
    command = [sys.executable, __file__, "--task", task, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def slice_task(plan: str, pitch: str, indexed: str) -> dict[str, float]:
    with tempfile.TemporaryDirectory() as scratch:
        target, edges = Path(scratch) / "s", [float(p) for p in pitch.split(",")]
        stack = write_slices(plan, target, pitch_mm=edges, indexed=indexed == "True")
        size = sum(file.stat().st_size for file in target.iterdir())
    return {
        "voxels": float(np.prod(np.array(stack.grid.shape, float))),
        "mm3": float(stack.voxels.sum() * stack.grid.voxel_mm3),
        "MB": size / 1e6,
        "layers": stack.grid.shape[2],
    }


def trimesh_task(plan: str, pitch: str) -> dict[str, float]:
    """The same by trimesh's own voxels and pillow: cubes only, each shell filled on its own."""
    import trimesh
    from PIL import Image

    edge, total = float(pitch), 0.0
    shells = [trimesh.load(f) for f in sorted((Path(plan) / "stl").iterdir())]
    low = np.min([s.bounds[0] for s in shells], axis=0)
    high = np.max([s.bounds[1] for s in shells], axis=0)
    grid = np.zeros((np.ceil((high - low) / edge) + 3).astype(int), np.uint8)
    for label, shell in enumerate(shells, 1):
        voxels = shell.voxelized(edge).fill()
        total += voxels.filled_count * edge**3
        grid[tuple(np.rint((voxels.points - low) / edge).astype(int).T)] = label
    colours = np.random.default_rng(0).integers(0, 256, (256, 4), dtype=np.uint8)
    with tempfile.TemporaryDirectory() as scratch:
        for k in range(grid.shape[2]):
            Image.fromarray(colours[grid[:, :, k].T]).save(Path(scratch) / f"{k}.png")
        size = sum(file.stat().st_size for file in Path(scratch).iterdir())
    return {"voxels": float(grid.size), "mm3": total, "MB": size / 1e6, "layers": grid.shape[2]}


def plan_of(part: Path | tuple[np.ndarray, np.ndarray], folder: Path, **options: object) -> Path:
    import planner

    return planner.grade(part, from_="Tango", to="Vero", axis="x", **options).write(folder)


def organic(subdivisions: int, size_mm: tuple[float, float, float]) -> tuple[np.ndarray, ...]:
    """A bumpy ball of 20 x 4^subdivisions triangles that fills a box."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions, 10.0)
    x, y, _ = ball.vertices.T
    vertices = ball.vertices * (1 + 0.2 * np.sin(0.7 * x) * np.cos(0.5 * y))[:, None]
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    return (vertices - low) / (high - low) * size_mm, ball.faces


def row(what: str, plan: Path, pitch: tuple[float, ...], *, indexed: bool = False) -> dict:
    found = in_a_process("slice", plan, ",".join(map(str, pitch)), indexed)
    print(
        f"{what:34} {found['voxels']:9.2e} {found['cpu_s']:7.2f} {found['wall_s']:7.2f} "
        f"{found['peak_MB']:6.0f} {found['MB']:8.2f} {found['mm3']:11.1f}",
        flush=True,
    )
    return found


def peak_MB() -> float:
    """Peak of this process alone: getrusage's begins with that of the one that started it."""
    status = Path("/proc/self/status").read_text()
    return int(status.partition("VmHWM:")[2].split()[0]) / 1024


def main(quick: bool) -> None:
    scratch = Path(tempfile.mkdtemp())
    print(f"{'part, pitch':34} {'voxels':>9} {'CPU s':>7} {'wall s':>7} {'MB':>6} {'on disk':>8}")
    try:
        dogbone = plan_of(SAMPLES / "dogbone.stl", scratch / "dogbone")
        row("dog-bone 42x85x30 um", dogbone, (0.042, 0.085, 0.03))  # compiles, where it is new
        row("dog-bone 42x85x30 um", dogbone, (0.042, 0.085, 0.03))
        row("dog-bone 42x85x30 um, indexed", dogbone, (0.042, 0.085, 0.03), indexed=True)
        for name in ("dogbone", "finger", "gripper"):
            plan = plan_of(SAMPLES / f"{name}.stl", scratch / f"{name}-native")
            row(f"{name}, native", plan, NATIVE)
        for factor in (16, 8, 4, 2, 1, 0.5):
            pitch = tuple(factor * p for p in NATIVE)
            row(f"finger, {factor:g} x native", scratch / "finger-native", pitch)
        for subdivisions in (5, 6, 7, 8):
            mesh = organic(subdivisions, (110, 82, 70))
            plan = plan_of(mesh, scratch / f"organic-{subdivisions}")
            row(f"organic, {20 * 4**subdivisions} triangles, native", plan, NATIVE)
        tray(scratch)
        if not quick:
            for edge in (0.8, 0.4, 0.2):
                row(f"dog-bone {edge} mm", dogbone, (edge, edge, edge))
                found = in_a_process("trimesh", dogbone, edge)
                print(
                    f"{f'  trimesh {edge} mm':34} {found['voxels']:9.2e} {found['cpu_s']:7.2f} "
                    f"{found['wall_s']:7.2f} {found['peak_MB']:6.0f} {found['MB']:8.2f} "
                    f"{found['mm3']:11.1f}",
                    flush=True,
                )
    finally:
        shutil.rmtree(scratch)


def tray(scratch: Path) -> None:
    """A part as wide as the tray, as high as a few mm; the rest of its height is more of it."""
    bumpy = organic(7, (TRAY_MM[0], TRAY_MM[1], TRAY_SLAB_MM))
    plan = plan_of(bumpy, scratch / "tray")
    found = row(f"tray, {TRAY_SLAB_MM:g} mm of {TRAY_MM[2]:g}", plan, NATIVE)
    times = math.ceil(TRAY_MM[2] / NATIVE[2]) / found["layers"]
    print(
        f"  the whole, {times * found['voxels']:.1e} voxels: about {times * found['cpu_s']:.0f} "
        f"CPU s and {times * found['MB'] / 1000:.1f} GB on disk"
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="without trimesh")
    parser.add_argument("--task", nargs="+", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.task:
        begin = time.perf_counter()
        task = {"slice": slice_task, "trimesh": trimesh_task}[given.task[0]]
        result = task(*given.task[1:])
        used = resource.getrusage(resource.RUSAGE_SELF)
        result["wall_s"] = time.perf_counter() - begin
        result["cpu_s"] = used.ru_utime + used.ru_stime
        result["peak_MB"] = peak_MB()
        print(json.dumps(result))
    else:
        main(given.quick)
