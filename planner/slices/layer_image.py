"""A layer's runs as a PNG, without ever making its pixels."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.arrays import IntArray
from planner.formats.png import PngHeader, Rgba, encode_png
from planner.slices.deflate_code import deflate_code
from planner.slices.deflate_kernel import deflate_rows

__all__ = ["NOTHING", "ImageKind", "encode_layer"]

NOTHING: Rgba = (0, 0, 0, 0)
"""Where nothing is printed."""

_BITS_A_ROW = 6 + 4 + 16  # filter, and what a stretch of zeros takes beside its longest matches
_BITS_AN_EDGE = 4 * (10 + 4 + 16)


@dataclass(frozen=True, slots=True)
class ImageKind:
    """How layers look: what all images of a stack share.

    Attributes
    ----------
    colours
        By material, in the order of labels from 1 on.
    indexed
        Whether pixels are indices into a palette, not RGBA.
    pixel_mm
        Edges of a pixel along x and y.
    """

    colours: tuple[Rgba, ...]
    indexed: bool
    pixel_mm: tuple[float, float]

    def pixels(self) -> NDArray[np.uint8]:
        """Return the bytes of a pixel by label."""
        if self.indexed:
            return np.arange(len(self.colours) + 1, dtype=np.uint8)[:, None].copy()
        return np.array([NOTHING, *self.colours], np.uint8)


def encode_layer(
    offsets: IntArray,
    start: IntArray,
    stop: IntArray,
    label: IntArray,
    rows: tuple[int, int],
    width: int,
    kind: ImageKind,
) -> bytes:
    """Return the PNG of some rows of labelled runs.

    Parameters
    ----------
    offsets : (rows + 1,) int64
        Row r has the runs ``offsets[r]`` to ``offsets[r + 1]``.
    start, stop : (runs,) int32
        Runs of a row rise and do not overlap.
    label : (runs,) int32
        From 1 on.
    rows
        First row of the image, and the one after its last.
    """
    first, last = rows
    pixel, code = kind.pixels(), deflate_code()
    a_row = _BITS_A_ROW + 2 * (width * pixel.shape[1] // 258 + 1)
    runs = int(offsets[last] - offsets[first])
    bits = code.head_bits + (last - first) * a_row + 2 * runs * _BITS_AN_EDGE + 64
    stream = np.zeros(bits // 8 + 8, np.uint8)
    stream[: len(code.head)] = code.head
    place, adler = deflate_rows(
        *(offsets, start, stop, label, first, last, width, pixel),
        *(code.literal, code.literal_bits, code.match, code.match_bits),
        *(stream, code.head_bits),
    )
    end = (int(place) + 7) // 8
    data = stream[:end].tobytes() + int(adler).to_bytes(4, "big")
    palette = (NOTHING, *kind.colours) if kind.indexed else None
    return encode_png(PngHeader(width, last - first, kind.pixel_mm, palette), data)
