"""Time `planner grade` as a whole process, as a user waits for it, against the planar plan.

python benchmarks/grade.py [RUNS] [CASE ...]

Prints, for each case, the median wall time, processor time and peak memory over RUNS (default 5)
after one run that is not counted, the processor time over that of the planar plan of the same
part, and its limits with met or missed. Then the main job's first run after installation, when
nothing is compiled yet, against its second; and --help against `python -c "import typer"`.
Limits are of processor time, which other work on the machine changes least.
"""

import os
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import manifold3d as m3
import numpy as np

from planner.formats.mesh_file import encode_stl

SAMPLES = Path(__file__).resolve().parents[1] / "samples"
SEGMENTS = {"organic": 812, "large": 2000}
PLANNER = [sys.executable, "-m", "planner"]
FIRST_RUN_LIMIT_S = 3.0
HELP_LIMIT = 2.5


@dataclass(frozen=True)
class Case:
    """One command, the case that is the planar plan of the same part, and its limits."""

    part: str
    options: tuple[str, ...] = ()
    planar: str = ""
    seconds: float | None = None
    megabytes: float | None = None
    ratio: float | None = None


TEN_PLANES = ("--axis", "x", "--bands", "10")
CASES = {
    "dog-bone": Case("dogbone", seconds=1.0),
    "finger": Case("finger"),
    "finger, distance": Case("finger", ("--field", "distance: surface"), "finger", 4.0),
    "finger, dither": Case("finger", ("--blend", "dither"), "finger", 8.0),
    "organic": Case("organic", TEN_PLANES, seconds=2.5),
    "organic, radial": Case(
        "organic",
        ("--field", "radial: point=0 0 0", "--bands", "10"),
        "organic",
        megabytes=700.0,
        ratio=2.0,
    ),
    "large": Case("large", TEN_PLANES, seconds=15.0),
}


@dataclass(frozen=True)
class Cost:
    """What a command takes: medians over its runs."""

    wall_s: float
    cpu_s: float
    peak_MB: float


def organic(segments: int) -> bytes:
    """A blob of 60 mm with bumps of several sizes; segments squared / 2 triangles."""

    def bump(points: np.ndarray) -> np.ndarray:
        x, y, z = points.T / 30.0
        radius = 1.0 + 0.12 * np.sin(5 * x + 1) * np.cos(4 * y) + 0.05 * np.sin(11 * z + 3 * x)
        return points * radius[:, None]

    mesh = m3.Manifold.sphere(30.0, segments).warp_batch(bump).to_mesh()
    vertices = np.asarray(mesh.vert_properties[:, :3], dtype=np.float32)
    return encode_stl(vertices, np.asarray(mesh.tri_verts), "organic")


def run_once(command: list[str], compiled: Path | None = None) -> Cost:
    """Run a command; `compiled` is where compiled loops are kept, if not in the usual place."""
    place = {"NUMBA_CACHE_DIR": str(compiled)} if compiled else {}
    begin = time.perf_counter()
    process = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env={**os.environ, **place}
    )
    _, status, usage = os.wait4(process.pid, 0)
    wall_s = time.perf_counter() - begin
    if os.waitstatus_to_exitcode(status) not in (0, 1):
        raise SystemExit(f"{' '.join(command)} failed")
    return Cost(wall_s, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024.0)


def median(costs: list[Cost]) -> Cost:
    """Return the median of each figure."""
    return Cost(
        statistics.median(c.wall_s for c in costs),
        statistics.median(c.cpu_s for c in costs),
        statistics.median(c.peak_MB for c in costs),
    )


def measure(command: list[str], runs: int) -> Cost:
    """Return the median cost of a command after one run that is not counted."""
    return median([run_once(command) for _ in range(runs + 1)][1:])


def measure_first(command: list[str], scratch: Path, runs: int) -> tuple[Cost, Cost]:
    """Return the median costs of runs that find nothing compiled, and of runs just after."""
    firsts, seconds = [], []
    for _ in range(runs):
        compiled = scratch / "compiled"
        firsts.append(run_once(command, compiled))
        seconds.append(run_once(command, compiled))
        shutil.rmtree(compiled)
    return median(firsts), median(seconds)


def judged(value: float, limit: float | None, unit: str) -> str:
    """Say a limit and whether it is met, or nothing."""
    if limit is None:
        return ""
    return f"{limit:g} {unit} {'met' if value <= limit else 'MISSED'}"


def main() -> None:
    """Run the benchmark."""
    if sys.argv[1:2] == ["make"]:
        Path(sys.argv[2]).write_bytes(organic(int(sys.argv[3])))
        return
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    chosen = {name: CASES[name] for name in sys.argv[2:] or CASES}
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        output = ["--force", "-o", str(folder / "out")]

        def command(case: Case) -> list[str]:
            path = folder / f"{case.part}.stl"
            if not path.exists() and case.part in SEGMENTS:
                # In a process of its own: a child's peak memory begins at its parent's.
                make = [sys.executable, __file__, "make", str(path), str(SEGMENTS[case.part])]
                subprocess.run(make, check=True)
            elif not path.exists():
                path.write_bytes((SAMPLES / path.name).read_bytes())
            return [*PLANNER, "grade", str(path), "--from", "Tango", "--to", "Vero", *case.options]

        print(
            f"{'case':16} {'triangles':>9} {'wall s':>7} {'cpu s':>7} {'peak MB':>8} "
            f"{'x planar':>8}  limits"
        )
        costs: dict[str, Cost] = {}
        for name, case in chosen.items():
            cost = costs[name] = measure(command(case) + output, runs)
            triangles = ((folder / f"{case.part}.stl").stat().st_size - 84) // 50
            ratio = cost.cpu_s / costs[case.planar].cpu_s if case.planar in costs else 1.0
            limits = (
                judged(cost.cpu_s, case.seconds, "s"),
                judged(cost.peak_MB, case.megabytes, "MB"),
                judged(ratio, case.ratio, "x"),
            )
            print(
                f"{name:16} {triangles:9d} {cost.wall_s:7.2f} {cost.cpu_s:7.2f} "
                f"{cost.peak_MB:8.0f} {ratio:8.2f}  {', '.join(filter(None, limits))}",
                flush=True,
            )
        first, second = measure_first(command(CASES["finger"]) + output, folder, runs)
    for what in ("wall", "cpu"):
        before, after = (getattr(cost, f"{what}_s") for cost in (first, second))
        limit = judged(before - after, FIRST_RUN_LIMIT_S, "s") if what == "wall" else ""
        print(
            f"first run {before:.2f} s {what}, second {after:.2f} s, {before - after:.2f}  {limit}"
        )
    shown = measure([*PLANNER, "--help"], 2 * runs).wall_s
    imported = measure([sys.executable, "-c", "import typer"], 2 * runs).wall_s
    ratio = shown / imported
    print(f"--help {shown:.3f} s, import typer {imported:.3f} s  {judged(ratio, HELP_LIMIT, 'x')}")


if __name__ == "__main__":
    main()
