"""PNG: the container around pixels that are compressed already."""

import struct
import zlib
from dataclasses import dataclass

__all__ = ["PngHeader", "Rgba", "encode_png"]

Rgba = tuple[int, int, int, int]

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_PER_METRE = 1
_TRUECOLOUR_ALPHA, _INDEXED = 6, 3


@dataclass(frozen=True, slots=True)
class PngHeader:
    """What a PNG says of its pixels, 8 bits a channel.

    Attributes
    ----------
    pixel_mm
        Edges of a pixel along the row and down the column.
    palette
        Colours by index; None for RGBA pixels.
    """

    width: int
    height: int
    pixel_mm: tuple[float, float]
    palette: tuple[Rgba, ...] | None = None


def encode_png(header: PngHeader, zlib_stream: bytes) -> bytes:
    """Return the bytes of a PNG file.

    Parameters
    ----------
    zlib_stream
        The filtered rows, compressed.
    """
    kind = _TRUECOLOUR_ALPHA if header.palette is None else _INDEXED
    size = struct.pack(">IIBBBBB", header.width, header.height, 8, kind, 0, 0, 0)
    per_metre = [min(round(1000.0 / edge), 2**31 - 1) for edge in header.pixel_mm]
    chunks = [(b"IHDR", size), (b"pHYs", struct.pack(">IIB", *per_metre, _PER_METRE))]
    if header.palette is not None:
        chunks.append((b"PLTE", b"".join(bytes(colour[:3]) for colour in header.palette)))
        chunks.append((b"tRNS", bytes(colour[3] for colour in header.palette)))
    chunks += [(b"IDAT", zlib_stream), (b"IEND", b"")]
    return _SIGNATURE + b"".join(_chunk(name, data) for name, data in chunks)


def _chunk(name: bytes, data: bytes) -> bytes:
    check = zlib.crc32(data, zlib.crc32(name))
    return b"".join((struct.pack(">I", len(data)), name, data, struct.pack(">I", check)))
