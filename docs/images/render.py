"""Draw a plan's shells: python docs/images/render.py FOLDER PICTURE.png [AZIMUTH [x|y|z [WIDTH]]].

With an axis, the half of the part in front of its middle is left out. Orthographic, shaded by a
fixed light, one colour a material, with a depth buffer; numpy alone.
"""

import struct
import sys
import zlib
from pathlib import Path

import numpy as np

import planner
from planner.cutting.pieces import split
from planner.fields.basic import AxisField
from planner.formats.mesh_file import decode_stl
from planner.mesh.mesh import Mesh, weld

WIDTH, OVERSAMPLE, MARGIN = 1200, 2, 40
ELEVATION = 30.0
LIGHT = np.array([0.25, 0.75, -0.61])  # right, up and into the picture


def behind(soup: np.ndarray, axis: str, at_mm: float) -> np.ndarray:
    """Return what of a shell lies beyond a plane, closed by its section."""
    vertices, faces = weld(soup.astype(np.float32))
    normal = tuple(float(axis == name) for name in "xyz")
    low, high = vertices[:, "xyz".index(axis)].min(), vertices[:, "xyz".index(axis)].max()
    if not low < at_mm < high:
        return soup if low >= at_mm else soup[:0]
    field = AxisField(normal, at_mm - 500.0, 1000.0)
    pieces = split(Mesh(vertices.astype(float), faces), field, [0.5])
    return pieces.vertices[pieces.shell_faces([1])]


def draw(folder: Path, azimuth: float, section: str | None = None, wide: int = WIDTH) -> np.ndarray:
    """Return the picture, (height, width, 3) uint8."""
    plan = planner.read_plan(folder)
    colours = {m.id: m.colour for m in planner.load_printer(plan.printer).palette().materials}
    files = {region.file: colours[region.material or ""] for region in plan.regions}
    a, e = np.radians([azimuth, ELEVATION])
    right = np.array([np.cos(a), np.sin(a), 0.0])
    into = np.array([-np.sin(a) * np.cos(e), np.cos(a) * np.cos(e), -np.sin(e)])
    view = np.stack([right, np.cross(right, into), into], axis=1)
    soups, shades = [], []
    for file, colour in files.items():
        soup = decode_stl((folder / file).read_bytes(), file)
        if section is not None:
            bounds = np.array(plan.part.bounds_mm) + plan.part.translation_mm
            soup = behind(soup, section, float(bounds[:, "xyz".index(section)].mean()))
        soup = soup.astype(float) @ view
        normal = np.cross(soup[:, 1] - soup[:, 0], soup[:, 2] - soup[:, 0])
        # Axes (right, up, into) are left-handed, which turns the cross product over.
        normal /= -np.linalg.norm(normal, axis=1, keepdims=True) - 1e-30
        rgb = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)])
        soups.append(soup)
        shades.append((0.55 + 0.45 * np.clip(normal @ LIGHT, 0, 1))[:, None] * rgb)
    seen, shade = np.concatenate(soups), np.concatenate(shades)
    seen[:, :, 1] *= -1.0  # rows run down
    low, high = seen.reshape(-1, 3).min(0), seen.reshape(-1, 3).max(0)
    width, margin = wide * OVERSAMPLE, MARGIN * OVERSAMPLE
    scale = (width - 2 * margin) / (high[0] - low[0])
    height = int(scale * (high[1] - low[1])) + 2 * margin
    height -= height % OVERSAMPLE
    seen[:, :, :2] = (seen[:, :, :2] - low[:2]) * scale + margin
    picture, depth = np.full((height, width, 3), 255.0), np.full((height, width), np.inf)
    for triangle, colour in zip(seen, shade, strict=True):
        _fill(triangle, colour, picture, depth)
    small = picture.reshape(height // OVERSAMPLE, OVERSAMPLE, wide, OVERSAMPLE, 3).mean((1, 3))
    return small.round().astype(np.uint8)


def _fill(triangle: np.ndarray, colour: np.ndarray, picture: np.ndarray, depth: np.ndarray) -> None:
    (x0, y0, z0), (x1, y1, z1), (x2, y2, z2) = triangle
    area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
    rows = slice(int(min(y0, y1, y2)), int(max(y0, y1, y2)) + 2)
    columns = slice(int(min(x0, x1, x2)), int(max(x0, x1, x2)) + 2)
    if abs(area) < 1e-9:
        return
    y, x = np.mgrid[rows, columns]
    v = ((x - x0) * (y2 - y0) - (x2 - x0) * (y - y0)) / area
    w = ((x1 - x0) * (y - y0) - (x - x0) * (y1 - y0)) / area
    z = z0 + v * (z1 - z0) + w * (z2 - z0)
    nearer = (v >= -1e-9) & (w >= -1e-9) & (v + w <= 1 + 1e-9) & (z < depth[rows, columns])
    depth[rows, columns][nearer] = z[nearer]
    picture[rows, columns][nearer] = colour


def png(picture: np.ndarray) -> bytes:
    """Encode an RGB picture."""
    height, width, _ = picture.shape
    lines = np.concatenate([np.zeros((height, 1), np.uint8), picture.reshape(height, -1)], axis=1)

    def chunk(kind: bytes, data: bytes) -> bytes:
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    data = zlib.compress(lines.tobytes(), 9)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", data) + chunk(b"IEND", b"")


if __name__ == "__main__":
    turned = float(sys.argv[3]) if len(sys.argv) > 3 else 35.0
    cut = sys.argv[4] if len(sys.argv) > 4 else None
    wide = int(sys.argv[5]) if len(sys.argv) > 5 else WIDTH
    Path(sys.argv[2]).write_bytes(png(draw(Path(sys.argv[1]), turned, cut, wide)))
