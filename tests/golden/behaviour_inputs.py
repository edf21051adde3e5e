"""Small inputs for the cases of behaviour: meshes, tables, palettes and campaigns, some broken.

Each function writes its files into the folder it is given; nothing here uses planner.
"""

import base64
import csv
import io
import math
import shutil
import struct
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

__all__ = [
    "altered_lab",
    "bad_fields",
    "bad_laboratories",
    "bad_meshes",
    "bad_palettes",
    "bad_profiles",
    "bad_tensile",
    "bars",
    "campaign",
    "columns",
    "copy_samples",
    "damage_shell",
    "edit",
    "meshes",
    "palette",
    "profiles",
    "remove",
    "specimens",
    "tables",
    "write",
]

Step = Callable[[Path], None]
_SIDES = (
    (0, 2, 1), (1, 2, 3), (4, 5, 6), (5, 7, 6), (0, 1, 4), (1, 5, 4),
    (2, 6, 3), (3, 6, 7), (0, 4, 2), (2, 4, 6), (1, 3, 5), (3, 7, 5),
)  # fmt: skip
_LAWS = {"Gum": (0.0, 0.4), "Sole": (0.5, 1.5), "Heel": (1.0, 6.0)}


# Meshes


def _stl(triangles: np.ndarray) -> bytes:
    data = np.zeros(len(triangles), dtype=[("v", "<f4", (4, 3)), ("a", "<u2")])
    data["v"][:, 1:] = triangles
    return bytes(80) + struct.pack("<I", len(triangles)) + data.tobytes()


def _box(size: Sequence[float], at: Sequence[float] = (0.0, 0.0, 0.0)) -> np.ndarray:
    corners = np.array([[i & 1, i >> 1 & 1, i >> 2] for i in range(8)]) * size + np.array(at)
    return corners[np.array(_SIDES)]


def _washer(outer: float, inner: float, height: float, sides: int = 24) -> np.ndarray:
    angles = [2 * math.pi * k / sides for k in range(sides)]
    ring = {
        (r, z): [(r * math.cos(a), r * math.sin(a), z) for a in angles]
        for r in (outer, inner)
        for z in (0.0, height)
    }
    found = []
    for k in range(sides):
        n = (k + 1) % sides
        low, high = ring[outer, 0.0], ring[outer, height]
        hole_low, hole_high = ring[inner, 0.0], ring[inner, height]
        for a, b, c, d in (
            (low[k], low[n], high[n], high[k]),
            (hole_low[n], hole_low[k], hole_high[k], hole_high[n]),
            (high[k], high[n], hole_high[n], hole_high[k]),
            (low[n], low[k], hole_low[k], hole_low[n]),
        ):
            found += [(a, b, c), (a, c, d)]
    return np.array(found)


def _indexed(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    points, index = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    return points, index.reshape(-1, 3)


def _ascii_stl(triangles: np.ndarray) -> str:
    lines = ["solid block"]
    for triangle in triangles:
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += [f"vertex {x:g} {y:g} {z:g}" for x, y, z in triangle]
        lines += ["endloop", "endfacet"]
    return "\n".join([*lines, "endsolid block", ""])


def meshes(folder: Path) -> None:
    """Write a block, also in other formats and small, a washer, a plate, a ramp, two bodies."""
    block = _box((24.0, 10.0, 8.0))
    (folder / "block.stl").write_bytes(_stl(block))
    (folder / "small.stl").write_bytes(_stl(block / 25.4))
    (folder / "washer.stl").write_bytes(_stl(_washer(10.0, 4.0, 6.0)))
    (folder / "plate.stl").write_bytes(_stl(_box((20.0, 10.0, 0.4))))
    ramp = _box((24.0, 10.0, 4.0))
    ramp[..., 2] *= 0.05 + ramp[..., 0] / 24.0
    (folder / "ramp.stl").write_bytes(_stl(ramp))
    apart = np.concatenate([block, _box((8.0, 8.0, 8.0), (30.0, 0.0, 0.0))])
    (folder / "two.stl").write_bytes(_stl(apart))
    (folder / "core.stl").write_bytes(_stl(_box((4.0, 4.0, 4.0), (10.0, 3.0, 2.0))))
    (folder / "ascii.stl").write_text(_ascii_stl(block))
    points, faces = _indexed(block)
    rows = "\n".join(f"{x:g} {y:g} {z:g}" for x, y, z in points)
    corners = "\n".join(f"3 {a} {b} {c}" for a, b, c in faces)
    (folder / "block.off").write_text(f"OFF\n{len(points)} {len(faces)} 0\n{rows}\n{corners}\n")
    (folder / "block.ply").write_text(
        f"ply\nformat ascii 1.0\nelement vertex {len(points)}\nproperty float x\n"
        f"property float y\nproperty float z\nelement face {len(faces)}\n"
        f"property list uchar int vertex_indices\nend_header\n{rows}\n{corners}\n"
    )
    vertices = "".join(f"v {x:g} {y:g} {z:g}\n" for x, y, z in points)
    triangles = "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in faces)
    (folder / "block.obj").write_text(vertices + triangles)


def bad_meshes(folder: Path) -> None:
    """Write meshes that are refused, or repaired in sight."""
    block = _box((24.0, 10.0, 8.0))
    turned = block.copy()
    turned[3] = turned[3, ::-1]
    inside_out = block[:, ::-1]
    lost = block.copy()
    lost[5, 1, 2] = np.nan
    far = block.copy()
    far[5, 1, 2] = np.inf
    flat = block.copy()
    flat[..., 2] = 0.0
    overlapping = np.concatenate([block, _box((8.0, 8.0, 8.0), (20.0, 1.0, 0.0))])
    sharp = np.concatenate([block, block[:1]])
    for name, triangles in {
        "open": block[:-2],
        "turned": turned,
        "inside-out": inside_out,
        "nan": lost,
        "inf": far,
        "flat": flat,
        "overlapping": overlapping,
        "double": sharp,
        "huge": block * (25.0, 0.4, 0.4),
        "metres": block / 1000.0,
        "tiny": block / 50.0,
    }.items():
        (folder / f"{name}.stl").write_bytes(_stl(triangles))
    (folder / "empty.stl").write_bytes(b"")
    (folder / "none.stl").write_bytes(_stl(block[:0]))
    (folder / "text.stl").write_text("no mesh at all\n")
    (folder / "short.stl").write_bytes(_stl(block)[:-100])
    (folder / "part.step").write_text("ISO-10303-21;\n")
    (folder / "part.3mf").write_text("no archive\n")
    (folder / "folder.stl").mkdir()


# Profiles and values in space


def profiles(folder: Path) -> None:
    """Write profiles for --profile."""
    write("moduli.csv", "position,modulus_MPa\n0,0.5\n0.4,3\n1,60\n")(folder)
    write("jump.csv", "position,modulus_MPa\n0,1\n0.5,1\n0.5,9\n1,9\n")(folder)
    write("named.csv", "position,material\n0,Tango\n0.3,FLX9760\n0.7,FLX9760\n1,Vero\n")(folder)
    write("far.csv", "position,modulus_MPa\n0,0.001\n1,90000\n")(folder)


def bad_profiles(folder: Path) -> None:
    """Write profiles that are refused."""
    for name, text in {
        "empty": "",
        "heading": "position,modulus_MPa\n",
        "columns": "place,stiffness\n0,1\n1,2\n",
        "word": "position,modulus_MPa\n0,1\n1,stiff\n",
        "nan": "position,modulus_MPa\n0,nan\n1,2\n",
        "negative": "position,modulus_MPa\n0,-1\n1,2\n",
        "falling": "position,modulus_MPa\n0,1\n0.6,2\n0.4,3\n1,4\n",
        "short": "position,modulus_MPa\n0.1,1\n0.9,2\n",
        "misspelt": "position,material\n0,Tnago\n1,Vero\n",
        "ragged": "position,modulus_MPa\n0,1,2\n1\n",
        "both": "position,modulus_MPa,material\n0,1,Tango\n1,2,Vero\n",
    }.items():
        write(f"{name}.csv", text)(folder)
    (folder / "binary.csv").write_bytes(b"\xff\xfe\x00position")


def _grid() -> tuple[np.ndarray, np.ndarray]:
    axes = [np.linspace(-1.0, end, n) for end, n in ((25.0, 14), (11.0, 4), (9.0, 3))]
    places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    values = places[..., 0] + 0.25 * places[..., 1] ** 2 - 0.5 * places[..., 2]
    return places, np.round(values, 6)


def tables(folder: Path) -> None:
    """Write one field of the block as grid.csv, points.csv, grid.npy, grid.vti and points.vtu."""
    places, values = _grid()
    rows = [
        f"{x:g},{y:g},{z:g},{v:g},{-v:g}"
        for (x, y, z), v in zip(places.reshape(-1, 3), values.ravel(), strict=True)
    ]
    write("two.csv", "\n".join(["x_mm,y_mm,z_mm,strain,back", *rows]) + "\n")(folder)
    write("grid.csv", "\n".join(["x_mm,y_mm,z_mm,strain", *(r.rsplit(",", 1)[0] for r in rows)]))(
        folder
    )
    loose = ["x_mm,y_mm,z_mm,strain", *(r.rsplit(",", 1)[0] for r in rows[::5])]
    write("points.csv", "\n".join(loose) + "\n")(folder)
    np.save(folder / "grid.npy", values)
    spacing = (2.0, 4.0, 5.0)
    numbers = " ".join(f"{v:g}" for v in values.transpose(2, 1, 0).ravel())
    write(
        "grid.vti",
        '<?xml version="1.0"?><VTKFile type="ImageData" version="0.1" byte_order="LittleEndian">'
        '<ImageData WholeExtent="0 13 0 3 0 2" Origin="-1 -1 -1" Spacing="{} {} {}">'
        '<Piece Extent="0 13 0 3 0 2"><PointData><DataArray type="Float64" Name="strain" '
        'format="ascii">{}</DataArray></PointData></Piece></ImageData></VTKFile>'.format(
            *spacing, numbers
        ),
    )(folder)
    points = places.reshape(-1, 3)[::5]
    packed = points.astype("<f4").tobytes()
    coded = base64.b64encode(struct.pack("<I", len(packed)) + packed).decode()
    numbers = " ".join(f"{v:g}" for v in values.ravel()[::5])
    write(
        "points.vtu",
        '<?xml version="1.0"?><VTKFile type="UnstructuredGrid" version="0.1" '
        f'byte_order="LittleEndian"><UnstructuredGrid><Piece NumberOfPoints="{len(points)}" '
        'NumberOfCells="0"><PointData><DataArray type="Float64" '
        f'Name="strain" format="ascii">{numbers}</DataArray></PointData><Points><DataArray '
        f'type="Float32" Name="Points" NumberOfComponents="3" format="binary">{coded}</DataArray>'
        "</Points></Piece></UnstructuredGrid></VTKFile>",
    )(folder)


def bad_fields(folder: Path) -> None:
    """Write tables that are refused."""
    head = "x_mm,y_mm,z_mm,a\n"
    write("nan.csv", head + "0,0,0,1\n1,0,0,nan\n")(folder)
    write("nothing.csv", head)(folder)
    write("uneven.csv", head + "0,0,0,1\n1,0,0,1\n3,0,0,1\n")(folder)
    write("columns.csv", "x,y,z,a\n0,0,0,1\n")(folder)
    write("two.csv", "x_mm,y_mm,z_mm,a,b\n0,0,0,1,2\n1,0,0,1,2\n")(folder)
    write("table.txt", "1\n")(folder)
    write("broken.vti", "<VTKFile")(folder)
    (folder / "broken.npy").write_bytes(b"12")
    np.save(folder / "nan.npy", np.full((2, 2, 2), np.nan))
    np.save(folder / "flat.npy", np.zeros((2, 2)))


# Palettes


def palette(folder: Path) -> None:
    """Write user.toml, a palette of three materials, and samples.toml, the warm lab's own."""
    write("user.toml", _palette(_LAWS))(folder)
    shutil.copy(folder / "samples" / "warm-lab" / "palette.toml", folder / "samples.toml")


def _palette(laws: Mapping[str, tuple[float, float]], more: str = "") -> str:
    text = (
        'schema = 1\nname = "user"\nkind = "palette"\nsource = "made up"\n\n[reference]\n'
        "strain_rate_per_s = 0.034\ntemperature_C = 23.0\nsoak_h = 0.0\nage_days = 9.0\n"
        'orientation = "x"\n'
    )
    for id, (coordinate, stiffness) in laws.items():
        text += (
            f'\n[[material]]\nid = "{id}"\naliases = []\ncoordinate = {coordinate}\n'
            "elongation_at_break = 0.8\ndensity_g_cm3 = 1.14\n"
            f'deformation = "elastic"\nmodulus_log_sd = 0.1\ncolour = "#4060A0"\n'
            f'source = "made up"\n{more}[material.law]\nmodel = "ogden"\n'
            f"mu_MPa = [{stiffness}]\nalpha = [2.0]\n"
        )
    return text


def bad_palettes(folder: Path) -> None:
    """Write palettes that are refused."""
    good = _palette(_LAWS)
    for name, text in {
        "empty": "",
        "syntax": "schema = = 1",
        "schema": good.replace("schema = 1", "schema = 9"),
        "unknown": _palette(_LAWS, "hardness = 3\n"),
        "crossing": _palette({**_LAWS, "Heel": (1.0, 0.2)}),
        "same": good.replace('"Sole"', '"Gum"'),
        "one": _palette({"Gum": (0.0, 0.4)}),
        "density": good.replace("density_g_cm3 = 1.14", "density_g_cm3 = -1"),
        "law": good.replace('"ogden"', '"ogdn"'),
        "missing": good.replace("coordinate = 0.5\n", ""),
        "colour": good.replace("#4060A0", "blue"),
        "unstable": good.replace("mu_MPa = [1.5]", "mu_MPa = [-1.5]"),
    }.items():
        write(f"{name}.toml", text)(folder)


# Bars to simulate


def bars(folder: Path) -> None:
    """Write bars for planner simulate, some of which are refused."""
    for name, text in {
        "bar": "x_mm,coordinate\n0,0\n10,0.5\n10,0.8\n30,1\n",
        "waist": "x_mm,coordinate,width_mm,thickness_mm\n0,0.5,8,3\n10,0.5,5,3\n20,0.7,8,3\n",
        "bad-range": "x_mm,coordinate\n0,0\n10,7\n",
        "bad-order": "x_mm,coordinate\n0,0\n10,1\n5,1\n",
        "bad-columns": "x,m\n0,0\n10,1\n",
        "bad-cell": "x_mm,coordinate\n0,0\n10,much\n",
        "bad-width": "x_mm,coordinate,width_mm\n0,0,3\n10,1,-3\n",
        "bad-empty": "",
    }.items():
        write(f"{name}.csv", text)(folder)


# Tensile tests


def _curve(gain: float = 1.0, count: int = 40) -> list[tuple[float, float]]:
    """Travel in mm and force in N of a rubber of 3 x 2 mm, 15 mm long."""
    stretches = [1.0 + 0.8 * k / (count - 1) for k in range(count)]
    return [(15.0 * (s - 1.0), gain * 6.0 * 0.4 * (s - s**-2)) for s in stretches]


def _tensile(head: str, rows: Iterable[tuple[float, float]]) -> str:
    return "\n".join([head, *(f"{a:.6f},{b:.6f}" for a, b in rows)]) + "\n"


def columns(folder: Path) -> None:
    """Write tests without headings, by stretch and stress, of two materials."""
    for name, gain in {"A-1": 1.0, "A-2": 1.06, "B-1": 3.0, "B-2": 2.9}.items():
        rows = [(1.0 + x / 15.0, f / 6.0) for x, f in _curve(gain)]
        text = "\n".join(f"{a:.6f};{b:.6f};0" for a, b in rows).replace(".", ",")
        write(f"bare/{name}.csv", text + "\n")(folder)
    for name, gain in {"C-1": 1.0, "C-2": 1.05, "C-3": 5.0}.items():
        write(f"apart/{name}.csv", _tensile("displacement_mm,force_N", _curve(gain)))(folder)


def bad_tensile(folder: Path) -> None:
    """Write tests that are refused."""
    good = _curve()
    for name, text in {
        "empty": "",
        "words": "this is no test\n",
        "few": _tensile("displacement_mm,force_N", good[:4]),
        "unit": _tensile("displacement (mm),force (stone)", good),
        "cell": _tensile("displacement_mm,force_N", good).replace("1.538462", "much"),
        "unloaded": _tensile("displacement_mm,force_N", [(x, 0.0) for x, _ in good]),
        "swapped": _tensile("force_N,displacement_mm", [(x, 100.0 * f) for x, f in good]),
        "percent": _tensile("strain,stress_MPa", [(x / 0.15, 100.0 * f) for x, f in good]),
        "back": _tensile("displacement_mm,force_N", good + good[::-1]),
        "one-column": "force_N\n1\n2\n3\n4\n5\n6\n7\n8\n9\n",
    }.items():
        write(f"{name}.csv", text)(folder)
    (folder / "bytes.csv").write_bytes(bytes(range(256)))


# Campaigns

_USUAL: Mapping[str, Any] = {
    "material": "FLX9760", "profile": "", "width_mm": 6, "thickness_mm": 3, "gauge_mm": 25,
    "rate_mm_s": 0.85, "temperature_C": 23, "soak_h": 0, "age_days": 9, "orientation": "x",
    "protocol": "monotonic", "batch": 1,
}  # fmt: skip


def _rows(kind: str) -> list[dict[str, Any]]:
    cells: list[dict[str, Any]]
    if kind == "rates":
        cells = [{"material": m, "rate_mm_s": r} for m in ("FLX9760", "TangoPlus")
                 for r in (0.85, 8.5)]  # fmt: skip
    elif kind == "two":
        cells = [{"rate_mm_s": r, "soak_h": s} for r in (0.85, 8.5) for s in (0, 48)]
        cells += [{"material": "TangoPlus", "protocol": "cyclic", "rate_mm_s": 8.5}]
    else:
        cells = [{"material": "", "profile": "profiles/step.csv", "gauge_mm": 32}, {}]
        cells += [{"material": "TangoPlus"}]
    rows = [{**_USUAL, **cell, "batch": batch} for cell in cells for batch in (1, 2)]
    return [{"specimen": f"S{k:02d}", **row} for k, row in enumerate(rows)]


def _csv(rows: Sequence[Mapping[str, Any]]) -> str:
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def specimens(kind: str) -> Step:
    """Return what writes KIND.csv, a list of specimens: rates or two."""
    return write(f"{kind}.csv", _csv(_rows(kind)))


def campaign(folder: Path) -> None:
    """Write bars/, a campaign that nobody has measured yet, with a graded bar."""
    write("bars/campaign.toml", _campaign_toml())(folder)
    write("bars/specimens.csv", _csv(_rows("bars")))(folder)
    write("bars/curves.csv", "specimen,time_s,displacement_mm,force_N\n")(folder)
    write("bars/profiles/step.csv", "x_mm,coordinate\n0,0\n16,0\n16,1\n32,1\n")(folder)


def _campaign_toml() -> str:
    return 'schema = 1\nname = "bars"\nprinter = "connex3"\npalette = "connex3-tango-vero"\n'


def altered_lab(folder: Path) -> None:
    """Write lab/: the warm lab with a load in pounds-force, a clipped one and a wrong rate."""
    copy_samples("warm-lab", "lab")(folder)
    with (folder / "lab" / "curves.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    peaks: dict[str, float] = {}
    for row in rows:
        peaks[row["specimen"]] = max(peaks.get(row["specimen"], 0.0), float(row["force_N"]))
    for row in rows:
        force = float(row["force_N"])
        if row["specimen"] == "SIM-D01a":
            row["force_N"] = f"{force / 4.4482216:.9g}"
        elif row["specimen"] == "SIM-D05b":
            row["force_N"] = f"{min(force, 0.6 * peaks['SIM-D05b']):.9g}"
        elif row["specimen"] == "SIM-D07a":
            row["time_s"] = f"{2.0 * float(row['time_s']):.9g}"
    (folder / "lab" / "curves.csv").write_text(_csv(rows))


def bad_laboratories(folder: Path) -> None:
    """Write campaigns that are refused, each in a folder of its own."""
    good = folder / "samples" / "warm-lab"
    listed, measured = (good / "specimens.csv").read_text(), (good / "curves.csv").read_text()
    toml = (good / "campaign.toml").read_text()
    for name, file, text in (
        ("no-column", "curves.csv", measured.replace("force_N", "weight", 1)),
        ("no-rate", "specimens.csv", listed.replace("width_mm", "breite", 1)),
        ("material", "specimens.csv", listed.replace("FLX9760", "FLX9706", 1)),
        ("unit", "specimens.csv", listed.replace("rate_mm_s", "rate_stone", 1)),
        ("cell", "curves.csv", measured.replace("0.046875", "far", 1)),
        ("hot", "specimens.csv", listed.replace(",40,0,9,", ",4000,0,9,", 1)),
        ("protocol", "specimens.csv", listed.replace("monotonic", "monotone", 1)),
        ("toml", "campaign.toml", "schema = = 1"),
        ("key", "campaign.toml", toml + "colour = 3\n"),
        ("palette", "campaign.toml", toml.replace("palette.toml", "nothing.toml")),
        ("empty", "curves.csv", ""),
        ("nobody", "specimens.csv", listed.splitlines()[0] + "\n"),
    ):
        copy_samples("warm-lab", f"bad-{name}")(folder)
        (folder / f"bad-{name}" / file).write_text(text)
    (folder / "nothing").mkdir()


# Steps between commands


def write(name: str, text: str) -> Step:
    """Return what writes a text file."""

    def step(folder: Path) -> None:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8", newline="\n")

    return step


def edit(name: str, old: str, new: str) -> Step:
    """Return what replaces a text in a file; the text must be there."""

    def step(folder: Path) -> None:
        text = (folder / name).read_text(encoding="utf-8")
        if old not in text:
            raise ValueError(f"{name} has no {old!r}")
        (folder / name).write_text(text.replace(old, new), encoding="utf-8", newline="\n")

    return step


def remove(name: str) -> Step:
    """Return what removes a file."""
    return lambda folder: (folder / name).unlink()


def damage_shell(plan: str) -> Step:
    """Return what flips one bit of a plan's first shell."""

    def step(folder: Path) -> None:
        path = min((folder / plan / "stl").iterdir())
        data = bytearray(path.read_bytes())
        data[200] ^= 0x10
        path.write_bytes(data)

    return step


def copy_samples(name: str, to: str) -> Step:
    """Return what copies a folder of samples."""
    return lambda folder: (
        shutil.copytree(folder / "samples" / name, folder / to, dirs_exist_ok=True) and None
    )
