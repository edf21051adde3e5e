"""Time `planner grade` as a whole process on parts of 10 thousand to 2 million triangles.

python benchmarks/grade.py [RUNS]

Prints, for each part, the median wall time, processor time and peak memory over RUNS (default 5)
after one run that is not counted, and the time of --help against `python -c "import typer"`.
"""

import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import manifold3d as m3
import numpy as np

from planner.formats.stl import encode_stl

SAMPLES = Path(__file__).resolve().parents[1] / "samples"
LIMITS = {"dogbone": (1.5, None), "organic": (3.0, 400.0), "large": (15.0, None)}


def organic(segments: int) -> bytes:
    """A blob of 60 mm with bumps of several sizes; segments squared / 2 triangles."""

    def bump(points: np.ndarray) -> np.ndarray:
        x, y, z = points.T / 30.0
        radius = 1.0 + 0.12 * np.sin(5 * x + 1) * np.cos(4 * y) + 0.05 * np.sin(11 * z + 3 * x)
        return points * radius[:, None]

    mesh = m3.Manifold.sphere(30.0, segments).warp_batch(bump).to_mesh()
    vertices = np.asarray(mesh.vert_properties[:, :3], dtype=np.float32)
    return encode_stl(vertices, np.asarray(mesh.tri_verts), "organic")


def measure(command: list[str], runs: int) -> tuple[float, float, float]:
    """Return median wall seconds, processor seconds and peak MB of a command."""
    wall, cpu, peak = [], [], []
    for run in range(runs + 1):
        begin = time.perf_counter()
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        _, status, usage = os.wait4(process.pid, 0)
        if os.waitstatus_to_exitcode(status) not in (0, 1):
            raise SystemExit(f"{' '.join(command)} failed")
        if run:
            wall.append(time.perf_counter() - begin)
            cpu.append(usage.ru_utime + usage.ru_stime)
            peak.append(usage.ru_maxrss / 1024.0)
    return statistics.median(wall), statistics.median(cpu), statistics.median(peak)


def main() -> None:
    """Run the benchmark."""
    if sys.argv[1:2] == ["make"]:
        Path(sys.argv[2]).write_bytes(organic(int(sys.argv[3])))
        return
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    planner = [sys.executable, "-m", "planner"]
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        (folder / "dogbone.stl").write_bytes((SAMPLES / "dogbone.stl").read_bytes())
        for name, segments in (("organic", 812), ("large", 2000)):
            # In a process of its own: a child's peak memory begins at its parent's.
            arguments = [sys.executable, __file__, "make", str(folder / f"{name}.stl")]
            subprocess.run([*arguments, str(segments)], check=True)
        print(f"{'part':10} {'triangles':>10} {'wall s':>8} {'cpu s':>8} {'peak MB':>8}  limits")
        for part, (seconds, megabytes) in LIMITS.items():
            path = folder / f"{part}.stl"
            triangles = (path.stat().st_size - 84) // 50
            command = [*planner, "grade", str(path), "--from", "Tango", "--to", "Vero"]
            command += ["--axis", "x", "--bands", "10", "--force", "-o", str(folder / "out")]
            wall, cpu, peak = measure(command, runs)
            limits = f"{seconds} s" + (f", {megabytes:.0f} MB" if megabytes else "")
            print(f"{part:10} {triangles:10d} {wall:8.2f} {cpu:8.2f} {peak:8.0f}  {limits}")
    shown, _, _ = measure([*planner, "--help"], 2 * runs)
    imported, _, _ = measure([sys.executable, "-c", "import typer"], 2 * runs)
    print(
        f"--help {shown:.3f} s, import typer {imported:.3f} s, ratio {shown / imported:.2f} (2.5)"
    )


if __name__ == "__main__":
    main()
