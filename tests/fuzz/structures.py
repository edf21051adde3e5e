"""Files made from their structure, sound but for figures that promise too much or nothing."""

import base64
import io
import json
import struct
import zipfile
import zlib

import numpy as np
from mutations import mutated, strange_word

__all__ = ["glb", "npy", "rezipped", "threemf", "vtk"]

CORNERS = np.array([[0, 0, 0], [9, 0, 0], [0, 9, 0], [0, 0, 9]], dtype=np.float64)
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
TYPES = (
    '<?xml version="1.0"?><Types xmlns="http://schemas.openxmlformats.org/package/2006/'
    'content-types"><Default Extension="rels" ContentType="application/vnd.openxmlformats-'
    'package.relationships+xml"/><Default Extension="model" ContentType="application/'
    'vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>'
)
RELATIONS = (
    '<?xml version="1.0"?><Relationships xmlns="http://schemas.openxmlformats.org/package/2006/'
    'relationships"><Relationship Target="/3D/3dmodel.model" Id="r" Type="http://schemas.'
    'microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>'
)


def pick(rng, *options):
    return options[rng.integers(len(options))]


def word(rng, usual):
    """Return the usual word, or rarely a strange one that XML can hold."""
    if rng.random() < 0.997:
        return str(usual)
    return strange_word(rng).decode("latin-1").replace("<", "").replace("&", "").replace('"', "")


def zipped(members):
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return out.getvalue()


def rezipped(rng, data):
    """Change a member within a zip archive, not the archive around it."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    name = pick(rng, *members)
    members[name] = mutated(rng, members[name])
    return zipped(members)


def threemf(rng):
    """Return a 3MF of meshes and of components that chain, double, fan out or turn back."""
    count = int(rng.integers(1, 12)) if rng.random() < 0.8 else int(rng.integers(12, 3000))
    transforms = ("", "", ' transform="{} 0 0 0 1 0 0 0 1 {} 0 0"')

    def transform():
        return pick(rng, *transforms).format(word(rng, 1), word(rng, 5))

    objects = []
    for number in range(1, count + 1):
        kind = pick(rng, "mesh", "mesh", "chain", "chain", "double", "fan")
        if number == 1 or rng.random() < 0.02:
            kind = pick(rng, "empty", "back") if number > 1 else "mesh"
        if kind == "mesh":
            places = [[word(rng, c) for c in corner] for corner in CORNERS]
            corners = "".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in places)
            turns = [[word(rng, c) for c in face] for face in FACES]
            faces = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in turns)
            inner = f"<mesh><vertices>{corners}</vertices><triangles>{faces}</triangles></mesh>"
        else:
            times = {"chain": 1, "double": 2, "fan": 30, "empty": 0, "back": 1}[kind]
            inner = "".join(
                f'<component objectid="{word(rng, number - 1 if kind != "back" else number + 1)}"'
                f"{transform()}/>"
                for _ in range(times)
            )
            inner = f"<components>{inner}</components>"
        use = word(rng, pick(rng, "model", "model", "model", "support", "surface"))
        objects.append(f'<object id="{word(rng, number)}" type="{use}">{inner}</object>')
    items = "".join(
        f'<item objectid="{word(rng, pick(rng, 1, count))}"{transform()}/>'
        for _ in range(rng.integers(0, 4))
    )
    unit = word(rng, pick(rng, "millimeter", "inch", "micron"))
    space = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
    model = (
        f'<?xml version="1.0"?><model unit="{unit}" xmlns="{space}"><resources>'
        f"{''.join(objects)}</resources><build>{items}</build></model>"
    )
    filler = b" " * int(10 ** rng.uniform(0, 8)) if rng.random() < 0.05 else b""
    data = bytearray(
        zipped(
            {
                "[Content_Types].xml": TYPES,
                "_rels/.rels": RELATIONS,
                "3D/3dmodel.model": model.encode("utf-8", "replace") + filler,
            }
        )
    )
    if rng.random() < 0.2:  # a directory that lies about a size
        at = data.rfind(b"PK\x01\x02")
        struct.pack_into("<I", data, at + 24, int(2 ** rng.uniform(0, 32)) - 1)
    return bytes(data)


def npy(rng):
    """Return a .npy whose head and data need not agree."""
    descr = pick(rng, "'<f8'", "'>f4'", "'<i4'", "'|b1'", "'<c16'", "'|O'", "[('a', '<f8')]",
                 "'<U9'", "'<f16'", "'<M8[s]'", "'<f99'", "'V8'", "(" * 5000)  # fmt: skip
    sizes = [pick(rng, 2, 3, 4, 0, 1, 10**6, 10**18, -1) for _ in range(rng.integers(0, 6))]
    shape = pick(rng, tuple(sizes), (2, 3, 4), (2, 3, 4), "[" * 5000)
    head = f"{{'descr': {descr}, 'fortran_order': {pick(rng, True, False, 1)}, 'shape': {shape}, }}"
    text = head.encode() if rng.random() < 0.8 else mutated(rng, head.encode())
    version = pick(rng, b"\x01\x00", b"\x01\x00", b"\x02\x00", b"\x03\x00", b"\x09\x00")
    length = len(text) if rng.random() < 0.9 else int(2 ** rng.uniform(0, 32)) - 1
    size = (
        struct.pack("<H", length % 65536) if version == b"\x01\x00" else struct.pack("<I", length)
    )
    values = rng.normal(size=pick(rng, 24, 24, 48, 3)).tobytes()
    return b"\x93NUMPY" + version + size + text + values


def vtk(rng, kind):
    """Return VTI or VTU of any encoding, with lengths and figures that may be anything."""
    form = pick(rng, "ascii", "binary", "zlib", "appended", "appended-zlib")
    wide = rng.random() < 0.3
    word_size = "Q" if wide else "I"
    appended = b""

    def number(usual):
        if rng.random() < 0.95:
            return int(usual)
        return pick(rng, 0, 1, 2**31, 2**32 - 1, int(usual) + 1, 10**9)

    def array(name, values, more=""):
        nonlocal appended
        tag = f'<DataArray type="{word(rng, "Float64")}" Name="{name}" {more} format='
        data = values.astype("<f8").tobytes()
        if form == "ascii":
            return f'{tag}"ascii">{" ".join(word(rng, v) for v in values.ravel())}</DataArray>'
        if form.endswith("zlib"):
            pieces = [data[:96], data[96:]] if rng.random() < 0.5 and len(data) > 96 else [data]
            packed = [zlib.compress(piece) for piece in pieces]
            if rng.random() < 0.1:
                packed[0] = zlib.compress(bytes(10**7))
            last = len(pieces[-1]) if len(pieces) > 1 else 0
            lengths = [len(pieces), len(pieces[0]), last, *map(len, packed)]
            head = struct.pack(f"<{len(lengths)}{word_size}", *map(number, lengths))
            body = b"".join(packed)
        else:
            head, body = struct.pack(f"<{word_size}", number(len(data))), data
        if form.startswith("appended"):
            offset = len(appended)
            appended += head + body
            return f'{tag}"appended" offset="{word(rng, offset)}"/>'
        parts = (head, body) if form == "zlib" else (head + body,)
        return f'{tag}"binary">{b"".join(map(base64.b64encode, parts)).decode()}</DataArray>'

    n = int(rng.integers(1, 30))
    if kind == "ImageData":
        sizes = [pick(rng, 1, 2, 3) for _ in range(3)]
        extent = " ".join(f"0 {word(rng, number(size - 1))}" for size in sizes)
        values = array("v", rng.normal(size=int(np.prod(sizes))))
        numbers = " ".join(word(rng, 0.5) for _ in range(3))
        body = (
            f'<ImageData WholeExtent="{extent}" Origin="{numbers}" Spacing="{numbers}"><Piece '
            f'Extent="{extent}"><PointData>{values}</PointData></Piece></ImageData>'
        )
    else:
        values = array("v", rng.normal(size=n))
        points = array("Points", rng.normal(size=(n, 3)), 'NumberOfComponents="3"')
        piece = (
            f'<Piece NumberOfPoints="{word(rng, number(n))}"><PointData>{values}</PointData>'
            f"<Points>{points}</Points></Piece>"
        )
        body = f"<UnstructuredGrid>{int(rng.integers(1, 4)) * piece}</UnstructuredGrid>"
    packer = ' compressor="vtkZLibDataCompressor"' if form.endswith("zlib") else ""
    text = (
        f'<?xml version="1.0"?><VTKFile type="{kind}" byte_order="LittleEndian" '
        f'header_type="UInt{64 if wide else 32}"{packer}>{body}'
    ).encode("utf-8", "replace")
    tail = b'<AppendedData encoding="raw">_' + appended + b"</AppendedData>" if appended else b""
    return text + tail + b"</VTKFile>"


def glb(rng, data):
    """Return a GLB whose tree is changed, with lengths that fit; or nodes of any shape."""
    size = int.from_bytes(data[12:16], "little")
    tree, rest = data[20 : 20 + size], data[20 + size :]
    if rng.random() < 0.5:
        told = json.loads(tree)
        count = int(10 ** rng.uniform(0, 3.3))
        kind = pick(rng, "chain", "double", "flat", "cycle")
        nodes = [{"mesh": 0} for _ in range(count)]
        for k, node in enumerate(nodes[:-1]):
            if kind != "flat":
                node["children"] = (k + 1 if kind != "double" else k + 1 - k % 2,)
        if kind == "cycle":
            nodes[-1]["children"] = [0]
        nodes[0]["matrix"] = [pick(rng, 1.0, 0.0, 1e300, float("nan")) for _ in range(16)]
        told["nodes"], told["scenes"] = nodes, [{"nodes": list(range(count))[: 1 + count // 2]}]
        tree = json.dumps(told).encode()
    else:
        tree = mutated(rng, tree)
    tree += b" " * (-len(tree) % 4)
    whole = (2, 20 + len(tree) + len(rest), len(tree))
    return b"glTF" + b"".join(n.to_bytes(4, "little") for n in whole) + b"JSON" + tree + rest
