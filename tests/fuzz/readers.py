"""Every reader of planner's, with sound files to begin from."""

import json
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import mutations
import numpy as np
import structures
import trimesh

import planner
from planner.formats.field_file import read_grid_table, read_point_table
from planner.formats.mesh_file import encode_stl, read_mesh
from planner.formats.specimens import read_specimens
from planner.formats.tensile import read_tensile
from planner.formats.threemf import ThreemfObject, encode_threemf
from planner.gap.campaign_folder import read_campaign
from planner.gap.diagnosis import read_diagnosis
from planner.gap.virtual import read_design
from planner.grading.profile import read_moduli
from planner.inverse_design.goals import Target
from planner.materials.study import read_study
from planner.printers import load_printer, load_profile
from planner.simulation.bar import Bar
from planner.simulation.bar import read_profile as read_bar
from planner.simulation.loads import read_cases
from planner.simulation.part_response import PartResponse
from planner.testing import threemf_xml_hashes

__all__ = ["READERS", "Reader"]

ROOT = Path(__file__).resolve().parents[2]
SAMPLES = ROOT / "samples"
Files = Mapping[str, bytes]
Rng = np.random.Generator


@dataclass(frozen=True)
class Reader:
    """A reader, and how a file for it is made.

    Attributes
    ----------
    read
        Called with the folder that holds the files.
    make
        Returns the files, by name.
    """

    name: str
    read: Callable[[Path], Any]
    make: Callable[[Rng], Files]


def one_of(files: Files, change: Callable[[Rng, bytes], bytes] = mutations.mutated, but: str = ""):
    """Return a maker that changes one of the files (none whose name ends as `but`)."""
    names = [name for name in files if not (but and name.endswith(but))]

    def make(rng: Rng) -> Files:
        name = names[rng.integers(len(names))]
        return {**files, name: change(rng, files[name])}

    return make


def single(name: str, *seeds: bytes, change: Callable[[Rng, bytes], bytes] = mutations.mutated):
    """Return a maker of one file from any of the seeds."""
    return lambda rng: {name: change(rng, seeds[rng.integers(len(seeds))])}


# ------------------------------------------------------------------------------------------------
# Sound files.

BOX = trimesh.creation.box((2.0, 4.0, 6.0))
CORNERS, FACES = BOX.vertices.astype(np.float32), BOX.faces.astype(np.int32)
ITEM = ThreemfObject("box", CORNERS, FACES, "FLX9760", "#FF8000", {"coordinate": "0.5"})
ASCII_STL = "solid box\n" + "".join(
    "facet normal 0 0 0\nouter loop\n"
    + "".join(f"vertex {x} {y} {z}\n" for x, y, z in corners)
    + "endloop\nendfacet\n"
    for corners in BOX.triangles
) + "endsolid box\n"  # fmt: skip
GLB = BOX.export(file_type="glb")

GRID = np.stack(np.meshgrid(np.arange(3.0), np.arange(2.0), np.arange(2.0)), -1).reshape(-1, 3)
TABLE_CSV = "x_mm,y_mm,z_mm,strain\n" + "".join(
    f"{x},{y},{z},{k / 7}\n" for k, (x, y, z) in enumerate(GRID)
)

PALETTE = (SAMPLES / "warm-lab/palette.toml").read_bytes()
CAMPAIGN = {
    "campaign.toml": b'schema = 1\nname = "lab"\nprinter = "connex3"\npalette = "palette.toml"\n',
    "palette.toml": PALETTE,
    "specimens.csv": (
        b"specimen,material,profile,width_mm,thickness_mm,gauge_mm,rate_mm_s,temperature_C,"
        b"orientation,protocol,batch,operator\n"
        b"S1,FLX9760,,6,3,25,0.85,23,x,monotonic,1,A\nS2,FLX9760,,6,3,25,0.85,40,y,cyclic,1,B\n"
        b"S3,,profiles/bar.csv,6,3,25,0.85,23,x,monotonic,2,A\n"
    ),
    "curves.csv": b"specimen,time_s,displacement_mm,force_N\n"
    + "".join(
        f"S{s},{0.1 * k},{0.5 * k},{0.3 * k + 0.01 * s}\n" for s in (1, 2, 3) for k in range(25)
    ).encode(),
    "fields.csv": b"specimen,time_s,x_mm,strain,facet_mm\n"
    + "".join(f"S3,{0.5 * k},{x},{0.01 * k},1\n" for k in range(5) for x in (5, 12)).encode(),
    "profiles/bar.csv": b"x_mm,coordinate,width_mm\n0,0.4,6\n12.5,0.5,6\n25,0.6,6\n",
}
DIAGNOSIS = {
    "schema": 1, "campaign": "lab", "palette": {"name": "lab", "sha256": "ab" * 32},
    "specimens": 12, "tests": 6, "verdict": "rate",
    "ranking": [{"effects": ["rate"], "probability": 0.97}, {"effects": [], "probability": 0.01}],
    "class": [["rate"]], "not_testable": ["temperature"],
    "where": [{"axis": "rate_mm_s", "share": 0.81, "p": 1e-5, "detail": "at 5 mm/s"}],
    "gap": {"before": 0.21, "after": 0.03, "floor": 0.025, "closed": 0.97,
            "closed_interval": [0.93, 0.99], "recalibration_only": 0.35, "held_out": "rate"},
    "effect": {"rate": {"form": "power-law", "parameters": {"rise": 0.1},
                        "interval": {"rise": [0.05, 0.2]}}},
    "remainder": {"significant": False, "where": []},
    "data_quality": [{"specimen": "S1", "problem": "clipped"}],
    "next_experiments": [{"change": {"rate_mm_s": 5.0}, "splits": [["rate", "skin"]],
                          "expected_gain_nats": 1.2}],
}  # fmt: skip
RESPONSE = PartResponse(
    "finger", np.array([1.0, 2.0]), np.array([0.5, 0.9]), np.array([0.2, 0.8]),
    np.full((2, 2), 0.1), np.full((2, 2), 0.5), 2.0
).encode()  # fmt: skip
CASES = b"""[[case]]
name = "push"
target = "x=min uz=-12 mm"
fix = ["x<1"]
load = "x=max: 0,0,-1 N"
gravity = "-z"
[[case]]
target = ["x=max stiffness=2 N/mm", "shape: s.csv"]
move = "x=max: 10,0,0 mm"
"""
SHAPE = b"x_mm,y_mm,z_mm,ux_mm,uy_mm,uz_mm\n0,0,0,0,0,1\n5,0,0,0,0,2\n"
GRADE_PROFILE = b"position,modulus_MPa\n0,0.5\n0.4,1\n0.4,2\n1,7\n"
MATERIAL_PROFILE = b"position,material\n0,Tango\n1,FLX9785\n"
TENSILE = tuple(
    (SAMPLES / "tensile" / name).read_bytes()
    for name in ("medium-1.csv", "rigid-1.csv", "soft-1.txt")
)
ABROAD = (
    "Zeit (s);Weg (mm);Kraft (N)\n" + "".join(f"0,{k};{k},5;1.234,{k}\n" for k in range(9)),
    "時間\tストローク\t試験力\n秒\tmm\tN\n" + "".join(f"{k}\t{k}.1\t{k}.2\n" for k in range(9)),
    "specimen,time_s,strain,stress_MPa\n"
    + "".join(f"{s},{k},0.0{k},{k}\n" for s in "AB" for k in range(9)),
)
ENCODED = (ABROAD[0].encode("cp1252"), ABROAD[1].encode("cp932"), ABROAD[1].encode("utf-16"),
           ABROAD[2].encode())  # fmt: skip
STUDY = {
    name: (SAMPLES / "tensile" / name).read_bytes()
    for name in ("specimens.csv", "medium-1.csv", "rigid-1.csv", "soft-1.txt")
}
STUDY["specimens.csv"] = b"\n".join(
    line
    for line in STUDY["specimens.csv"].splitlines()
    if line.count(b"-2") + line.count(b"-3") == 0
)


def plan_folder() -> Files:
    """Return the files of a plan of the box, in three materials."""
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "box.stl"
        path.write_bytes(encode_stl(CORNERS, FACES, "x"))
        target = planner.grade(path, from_="Tango", to="FLX9750", axis="z").write(
            Path(folder) / "out"
        )
        planner.check(target)  # compiles what later inputs need
        return {
            str(f.relative_to(target)): f.read_bytes() for f in target.rglob("*") if f.is_file()
        }


PLAN = plan_folder()
PRINTER = {
    name: (ROOT / "printers/connex3" / name).read_bytes()
    for name in ("printer.toml", "job_notes.md")
}
CONNEX = load_printer("connex3")
KNOWN = planner.load_palette(SAMPLES / "warm-lab/palette.toml")
MODULI = {material.id: 1.0 + k for k, material in enumerate(KNOWN.materials)}


def zipped_mutations(rng: Rng, data: bytes) -> bytes:
    try:
        return (
            structures.rezipped(rng, data) if rng.random() < 0.7 else mutations.mutated(rng, data)
        )
    except (zipfile.BadZipFile, ValueError):
        return mutations.mutated(rng, data)


def npy_seed() -> bytes:
    out = BytesIO()
    np.save(out, np.arange(24.0).reshape(2, 3, 4))
    return out.getvalue()


def mesh(kind: str, *seeds: bytes, change=mutations.mutated, name: str = "") -> Reader:
    file = f"part.{kind}"
    return Reader(
        name or kind, lambda at: read_mesh(at / file), single(file, *seeds, change=change)
    )


def grid(kind: str, make: Callable[[Rng], bytes], name: str = "") -> Reader:
    lies = ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)) if kind == "npy" else None
    return Reader(
        name or kind,
        lambda at: read_grid_table(at / f"table.{kind}", lies=lies),
        lambda rng: {f"table.{kind}": make(rng)},
    )


def points(kind: str, make: Callable[[Rng], bytes]) -> Reader:
    return Reader(
        f"points {kind}",
        lambda at: read_point_table(at / f"points.{kind}"),
        lambda rng: {f"points.{kind}": make(rng)},
    )


def changed(seed: bytes) -> Callable[[Rng], bytes]:
    return lambda rng: mutations.mutated(rng, seed)


READERS: tuple[Reader, ...] = (
    mesh("stl", encode_stl(CORNERS, FACES, "box"), name="stl binary"),
    mesh("stl", ASCII_STL.encode(), name="stl ascii"),
    mesh("obj", BOX.export(file_type="obj").encode()),
    mesh("off", BOX.export(file_type="off").encode()),
    mesh("ply", trimesh.exchange.ply.export_ply(BOX, encoding="ascii"), name="ply ascii"),
    mesh("ply", trimesh.exchange.ply.export_ply(BOX), name="ply binary"),
    mesh("glb", GLB),
    mesh("glb", GLB, change=structures.glb, name="glb tree"),
    mesh("3mf", encode_threemf([ITEM, ITEM], "box"), encode_threemf([ITEM], "box", one_mesh=True),
         change=zipped_mutations),
    mesh("3mf", b"", change=lambda rng, _: structures.threemf(rng), name="3mf structure"),
    Reader("3mf hashes", lambda at: threemf_xml_hashes(at / "x.3mf"),
           single("x.3mf", encode_threemf([ITEM], "box"), change=zipped_mutations)),
    grid("csv", changed(TABLE_CSV.encode()), "grid csv"),
    grid("npy", changed(npy_seed())),
    grid("npy", structures.npy, "npy head"),
    grid("vti", lambda rng: structures.vtk(rng, "ImageData"), "vti structure"),
    grid("vti", lambda rng: mutations.mutated(rng, structures.vtk(rng, "ImageData"))),
    points("csv", changed(TABLE_CSV.encode())),
    points("vtu", lambda rng: structures.vtk(rng, "UnstructuredGrid")),
    Reader("palette", lambda at: planner.load_palette(at / "palette.toml"),
           single("palette.toml", PALETTE)),
    Reader("printer", lambda at: load_profile(at), one_of(PRINTER, but=".md")),
    Reader("plan", lambda at: planner.read_plan(at), single("plan.json", PLAN["plan.json"])),
    Reader("plan folder", lambda at: planner.check(at), one_of(PLAN, but=".png")),
    Reader("campaign", lambda at: read_campaign(at), one_of(CAMPAIGN)),
    Reader("campaign design", lambda at: read_design(at, KNOWN, printer=CONNEX, camera=False),
           one_of(CAMPAIGN)),
    Reader("specimens", lambda at: read_specimens(at / "specimens.csv"),
           single("specimens.csv", CAMPAIGN["specimens.csv"], STUDY["specimens.csv"])),
    Reader("tensile", lambda at: read_tensile(at / "test.csv"), single("test.csv", *TENSILE)),
    Reader("tensile abroad", lambda at: read_tensile(at / "test.csv"),
           single("test.csv", *ENCODED)),
    Reader("study", lambda at: read_study([at]), one_of(STUDY)),
    Reader("grade profile",
           lambda at: read_moduli(at / "p.csv", MODULI, lambda name: KNOWN.resolve(name).id),
           single("p.csv", GRADE_PROFILE, MATERIAL_PROFILE)),
    Reader("bar profile", lambda at: read_bar(at / "p.csv", palette=KNOWN, gauge_mm=25.0),
           single("p.csv", CAMPAIGN["profiles/bar.csv"])),
    Reader("simulated bar", lambda at: Bar.read(
               at / "p.csv", KNOWN, slices=50, width_mm=6.0, thickness_mm=3.0),
           single("p.csv", b"x_mm,coordinate,width_mm,thickness_mm\n0,0.1,6,3\n25,0.6,6,3\n")),
    Reader("load cases", lambda at: [Target.read(text) for case in read_cases(at / "cases.toml")
                                     for text in case.target if not text.startswith("shape:")],
           single("cases.toml", CASES)),
    Reader("shape", lambda at: Target.read(f"shape: {at / 's.csv'}"), single("s.csv", SHAPE)),
    Reader("diagnosis", lambda at: read_diagnosis(at / "diagnosis.json"),
           single("diagnosis.json", json.dumps(DIAGNOSIS).encode())),
    Reader("response", lambda at: PartResponse.read(at / "r.json"), single("r.json", RESPONSE)),
)  # fmt: skip
