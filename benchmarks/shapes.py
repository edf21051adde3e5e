"""Design towards shapes, checked: manufactured gradients, a strip that becomes an S, a finger.

``python -m benchmarks.shapes`` runs all; ``... strip finger`` some. Every figure that is asked of
the design is printed with what it came to. ``... speed`` times whole commands on one processor:
the finger's tutorial, its 60 knots beside its 7, and a finger of 110 mm.
"""

import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import planner
from benchmarks.grade import PLANNER, run_once
from planner.formats.field_file import encode_vti
from planner.formats.mesh_file import encode_stl, read_mesh
from planner.inverse_design.controls import Controls
from planner.inverse_design.goals import carried_along
from planner.mesh.distance import triangle_tree
from planner.mesh.mesh import Mesh

__all__ = ["block", "main", "manufactured", "shape_after"]

SAMPLES = Path(__file__).parents[1] / "samples"
_Array = NDArray[np.float64]


def block(x_mm: float, y_mm: float, z_mm: float, steps: tuple[int, int, int]) -> Mesh:
    """Return a block whose sides are divided into so many steps, two triangles each."""
    corners: dict[tuple[int, int, int], int] = {}
    faces = []

    def at(place: tuple[int, int, int]) -> int:
        return corners.setdefault(place, len(corners))

    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for end in (0, steps[axis]):
            for i in range(steps[u]):
                for j in range(steps[v]):
                    four = []
                    for a, b in ((0, 0), (1, 0), (1, 1), (0, 1)):
                        place = [0, 0, 0]
                        place[axis], place[u], place[v] = end, i + a, j + b
                        four.append(at((place[0], place[1], place[2])))
                    four = four if end else four[::-1]
                    faces += [[four[0], four[1], four[2]], [four[0], four[2], four[3]]]
    size = np.array([x_mm, y_mm, z_mm]) / steps
    return Mesh(np.array(list(corners)) * size, np.array(faces, dtype=np.int32))


def shape_after(mesh: Mesh, made: planner.PartSimulation) -> _Array:
    """Return a mesh's triangles as a simulation deforms them."""
    surface = made.cells.surface
    place, which = triangle_tree(surface).closest(mesh.vertices)
    moved = (surface.vertices + made.steps.displacement_mm[-1])[surface.faces]
    return carried_along(surface.triangles[which], moved[which], place)[mesh.faces]


def _stl(file: Path, triangles: _Array) -> Path:
    corners = np.arange(triangles.size // 3, dtype=np.int32).reshape(-1, 3)
    file.write_bytes(encode_stl(triangles.reshape(-1, 3).astype(np.float32), corners, file.stem))
    return file


_HELD = {"fix": "x=min", "load": "x=max: 0,0.3,-0.5 N"}
_ENDS = {"from_": "Tango", "to": "FLX9795"}


def manufactured(seed: int, folder: Path, *, cell_mm: float = 3.0) -> tuple[float, float, float]:
    """Find a random gradient again from the surface that it bends a block to.

    The wanted surface is that of smaller cells (by 1.3), which the search never sees.

    Returns
    -------
    rms, largest : float
        Deviation of the surface that the found gradient has, over its longest way.
    correlation : float
        Of ln(modulus), found against true, over the block.
    """
    mesh = block(40.0, 12.0, 6.0, (20, 6, 3))
    rng = np.random.default_rng(seed)
    controls = Controls.lattice(mesh.bounds_mm, (5, 3, 3), [])
    steps = np.array([24, 8, 8])
    spacing = np.ptp(mesh.bounds_mm, axis=0) / steps
    index = np.stack(np.meshgrid(*(np.arange(n + 1) for n in steps), indexing="ij"), axis=-1)
    places = index.reshape(-1, 3) * spacing
    truth = controls.basis(places) @ rng.uniform(0.1, 0.9, len(controls.even))
    table = {"position": truth.reshape(steps + 1).astype(np.float32)}
    data = encode_vti(np.zeros(3), spacing, table)
    (folder / "random.vti").write_bytes(data)
    part = _stl(folder / "block.stl", mesh.vertices[mesh.faces])
    field = f"table: {folder / 'random.vti'}, array=position, from=0, to=1"
    plan = planner.grade(part, field=field, blend="dither", **_ENDS)
    plan.write(folder / "true", beside={"random.vti": data})
    (bent,) = planner.simulate_part(
        folder / "true", planner.LoadCase(**_HELD), cell_mm=cell_mm / 1.3, steps=1,
        compare_cells=False,
    )  # fmt: skip
    wanted = _stl(folder / "bent.stl", shape_after(mesh, bent))
    made = planner.design(
        part, target=f"shape: {wanted}", free="6x3x3", cell_mm=cell_mm, blend="dither", **_HELD,
        **_ENDS,
    )  # fmt: skip
    (row,) = made.reached
    way = row.printed / (row.error or 1.0)
    found = Controls.lattice(mesh.bounds_mm, made.free["counts"], []).basis(places) @ made.values
    return row.error or 0.0, (row.largest or 0.0) / way, float(np.corrcoef(truth, found)[0, 1])


def _run_manufactured() -> bool:
    ok = True
    for seed in range(5):
        begun = time.process_time()
        with tempfile.TemporaryDirectory() as folder:
            rms, largest, correlation = manufactured(seed, Path(folder))
        ok &= largest < 0.02
        print(
            f"manufactured {seed}: off by {100 * rms:.2f} % of the longest way (rms), "
            f"{100 * largest:.2f} % at most (2 % allowed); correlation of ln(modulus) "
            f"{correlation:.2f}; {time.process_time() - begun:.0f} CPU s",
            flush=True,
        )
    return ok


def strip(folder: Path) -> planner.PartDesign:
    """Design a flat strip that becomes an S where its end is pulled: straight on, by 20 N.

    Soft on one side and stiff on the other, a strip that is pulled bends until its stiff side lies
    in the line of the pull. Where the sides change places, it goes from one line to the other.
    """
    mesh = block(100.0, 16.0, 10.0, (50, 4, 4))
    places = mesh.triangles
    x, z = places[..., 0], places[..., 2] - 5.0
    wave = 2.0 * np.pi * x / 100.0
    lift = 3.0 * (x / 100.0 - np.sin(wave) / (2.0 * np.pi))
    turn = np.arctan(0.03 * (1.0 - np.cos(wave)))
    bent = np.stack(
        [1.05 * x - z * np.sin(turn), places[..., 1], 5.0 + lift + z * np.cos(turn)], axis=-1
    )
    _stl(folder / "strip.stl", places)
    _stl(folder / "s.stl", bent)
    return planner.design(
        folder / "strip.stl", from_="Tango", to="Vero", fix="x=min", load="x=max: 20,0,0 N",
        target=f"shape: {folder / 's.stl'}", free="8x1x3", cell_mm=4.0, tolerance=0.04, steps=4,
    )  # fmt: skip


def _run_strip() -> bool:
    with tempfile.TemporaryDirectory() as folder:
        made = strip(Path(folder))
    (row,) = made.reached
    print(
        f"strip to an S: {row.printed:.3f} mm off (rms), {100 * (row.error or 0.0):.1f} % of the "
        f"longest way, {row.largest:.3f} mm at most"
    )
    return made.ok


def finger(*, cell_mm: float = 3.0) -> planner.PartDesign:
    """Design the finger: 5 mm down under 20 kPa, and at most a tenth of that under a side load."""
    side = planner.LoadCase(
        fix="x=max", load="x=min: 0,0.02,0 N", limit="x=min uy<0.5 mm", name="side"
    )
    return planner.design(
        SAMPLES / "finger.stl", from_="Tango", to="Vero", fix="x=max", pressure="cavity: 20 kPa",
        target="x=min uz=-5 mm", cases=[side], free="8x3x3", symmetric="y", blend="dither",
        cell_mm=cell_mm,
    )  # fmt: skip


def _run_finger() -> bool:
    begun = time.process_time()
    made = finger()
    for row in made.reached:
        print(
            f"finger, {row.case}: {row.target}: {row.printed:.3f} {row.unit} printed, "
            f"{row.continuous:.3f} wanted of the gradient; softest and stiffest {row.reach}"
        )
    for found in made.findings:
        print(f"  {found.message}")
    print(f"  {time.process_time() - begun:.0f} CPU s")
    return made.ok


_TUTORIAL_S, _KNOTS, _LONG_S = 20.0, 2.0, 120.0
"""Processor time: of the tutorial's design, of 60 knots over 7, of a finger of 110 mm."""


def _run_speed() -> bool:
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    finger = SAMPLES / "finger.stl"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        triangles = np.asarray(read_mesh(finger).triangles, dtype=np.float64)
        long = _stl(folder / "long.stl", triangles * 110.0 / float(np.ptp(triangles[..., 0])))

        def cpu_s(part: Path, *options: str) -> float:
            command = [
                *PLANNER, "design", str(part), "--from", "Tango", "--to", "Vero", "--axis", "x",
                "--fix", "x=max", "--load", "x=min: 0,0,-0.5 N", "--target", "x=min uz=-12 mm",
                "--limit", "strain/break<0.5", "--cell", "2", *options,
                "--output", str(folder / "out"), "--force",
            ]  # fmt: skip
            return run_once(command).cpu_s

        cpu_s(finger, "--cell", "6")  # compiles
        tutorial_s, many_s, long_s = cpu_s(finger), cpu_s(finger, "--knots", "60"), cpu_s(long)
    ratio = many_s / tutorial_s
    print(
        f"speed on one processor: the tutorial {tutorial_s:.1f} CPU s ({_TUTORIAL_S:g} allowed); "
        f"60 knots {many_s:.1f} CPU s, {ratio:.2f} times 7 ({_KNOTS:g}); 110 mm {long_s:.1f} CPU s "
        f"({_LONG_S:g})"
    )
    return tutorial_s <= _TUTORIAL_S and ratio <= _KNOTS and long_s <= _LONG_S


def main(*names: str) -> None:
    """Run the benchmarks of these names, or all; exit with 1 if a figure is missed."""
    runs = {
        "manufactured": _run_manufactured,
        "strip": _run_strip,
        "finger": _run_finger,
        "speed": _run_speed,
    }
    ok = [runs[name]() for name in names or runs]
    sys.exit(0 if all(ok) else 1)


if __name__ == "__main__":
    main(*sys.argv[1:])
