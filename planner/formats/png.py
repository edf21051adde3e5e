"""Layer images as PNG: one compressed stream of the same bytes everywhere."""

import struct
import zlib
from dataclasses import dataclass
from functools import cache
from itertools import accumulate
from typing import Any

import numpy as np

from planner.numerics import IntArray, inner_kernel, kernel

__all__ = ["NOTHING", "ImageKind", "encode_layer"]


# ------------------------------------------------------------------------------------------------
# The one Huffman code that layers are compressed with.
#
# Rows of a layer are nearly all zeros once each pixel has its left neighbour taken off, so the code
# gives one bit to the longest match and one to "the byte before": 258 zeros take two bits, both 0.
# It never changes, so that the same layer is the same bytes with any version of zlib.


_END, _SYMBOLS, _DISTANCES = 256, 286, 4
# RFC 1951, 3.2.5: an entry of the code for lengths is so many lengths as its extra bits tell apart.
_LENGTH_EXTRA_BITS = (*(0,) * 8, *(n for n in range(1, 6) for _ in range(4)), 0)
_LENGTH_BASE = (*accumulate((1 << n for n in _LENGTH_EXTRA_BITS[:27]), initial=3), 258)
# RFC 1951, 3.2.7: the order in which the lengths of the code for code lengths stand.
_ORDER = (16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15)


def _lengths() -> list[int]:
    """Return bits by symbol: they sum to exactly 1 in units of 2^-bits, as decoders require."""
    bits = [10] * _END + [8] + [8] * 28 + [1]
    bits[0] = 4
    for frequent in (1, 2, 255):  # filters, and alpha's steps up (255) and down (1)
        bits[frequent] = 6
    bits[277:285] = [7] * 8  # 67 to 257 zeros
    return bits


def _codes(bits: list[int]) -> list[int]:
    """Return the canonical code of each symbol (RFC 1951, 3.2.2), turned round."""
    codes, code, before = [0] * len(bits), 0, 0
    for symbol in sorted((s for s in range(len(bits)) if bits[s]), key=lambda s: (bits[s], s)):
        code <<= bits[symbol] - before
        before = bits[symbol]
        codes[symbol] = int(f"{code:0{before}b}"[::-1], 2)
        code += 1
    return codes


def _head(bits: list[int]) -> tuple[IntArray, int]:
    # A code for the lengths themselves: the commonest in two bits, six in three.
    meta = [0 if n not in {0, *bits} else 2 if n == 10 else 3 for n in range(19)]
    meta_codes = _codes(meta)
    last = max(i for i, n in enumerate(_ORDER) if meta[n])
    text = [(0x78, 8), (0x01, 8), (1, 1), (2, 2)]
    text += [(_SYMBOLS - 257, 5), (_DISTANCES - 1, 5), (last + 1 - 4, 4)]
    text += [(meta[n], 3) for n in _ORDER[: last + 1]]
    # Distances 1 and 4 have a bit each, though the second is not used: some decoders refuse one.
    text += [(meta_codes[n], meta[n]) for n in (*bits, 1, 0, 0, 1)]
    number, place = 0, 0
    for value, size in text:
        number |= value << place
        place += size
    return np.frombuffer(number.to_bytes(place // 8 + 1, "little"), np.uint8).copy(), place


_REPEATED = _END - 2
"""Added to the length of a repetition of the byte before, from 3 on, for its place in the code."""


@cache
def _deflate_code() -> tuple[IntArray, int, IntArray, IntArray]:
    """Return what a stream begins with, and the code, first bit sent lowest.

    Returns
    -------
    head, head_bits : (bytes,) uint8, int
        Zlib's two bytes, and a last block that brings this code.
    codes, bits : (513,) int64
        The code and its length of each byte, of the end of the block, and of each repetition.
    """
    bits = _lengths()
    codes = _codes(bits)
    rows = [*zip(codes, bits, strict=True)][: _END + 1]
    for length in range(3, 259):
        entry = max(i for i, base in enumerate(_LENGTH_BASE) if base <= length)
        code, size = codes[_END + 1 + entry], bits[_END + 1 + entry]
        more = _LENGTH_EXTRA_BITS[entry] + 1  # and distance 1, a zero bit
        rows.append((code | (length - _LENGTH_BASE[entry]) << size, size + more))
    return *_head(bits), *np.array(rows, np.int64).T.copy()


# ------------------------------------------------------------------------------------------------
# The loop behind `planner.formats.png`: runs of a layer to a zlib stream.
#
# Work and memory grow with the runs, not with the pixels: pixels are never made.


_ADLER = 65521
_SAME_AS_LEFT, _SAME_AS_ABOVE = 1, 2  # PNG's filters "sub" and "up"


@inner_kernel
def _put(stream: Any, place: Any, symbol: Any, codes: Any, bits: Any) -> Any:
    # Write a code of up to 16 bits at bit `place`; the stream is zero from there on.
    first, value = place >> 3, codes[symbol] << (place & 7)
    stream[first] |= value & 255
    stream[first + 1] |= (value >> 8) & 255
    stream[first + 2] |= (value >> 16) & 255
    return place + bits[symbol]


@inner_kernel
def _put_zeros(stream: Any, place: Any, zeros: Any, codes: Any, bits: Any) -> Any:
    # One zero as it is, then repetitions of it; 258 of them are two bits that are zero already.
    # Symbols are of one integer type, so that `_put` is compiled once.
    if zeros > 0:
        place = _put(stream, place, np.int64(0), codes, bits) + 2 * ((zeros - 1) // 258)
        rest = (zeros - 1) % 258
        if rest >= 3:
            return _put(stream, place, _REPEATED + rest, codes, bits)
        for _ in range(rest):
            place = _put(stream, place, np.int64(0), codes, bits)
    return place


@kernel
def _deflate_rows(
    runs: Any, first: Any, last: Any, width: Any, pixel: Any, code: Any, stream: Any, place: Any
) -> Any:
    """Write rows first <= r < last of runs, filtered and compressed, and return the end in bits.

    Parameters
    ----------
    runs, code
        Offsets, start, stop and label; codes and their bits.
    pixel : (labels + 1, bytes a pixel) uint8
        Bytes of a pixel by label; 0 is where no run is.
    stream, place
        Zeroed bytes with the stream's head, and the bits that this has.

    Returns
    -------
    place, adler
        Bits written, and the checksum of what they mean.
    """
    (offsets, start, stop, label), (codes, bits) = runs, code
    size = pixel.shape[1]
    low, high = 1, 0  # Adler-32
    for r in range(first, last):
        back = offsets[r] - offsets[max(r - 1, 0)]
        repeated = r > first and offsets[r + 1] - offsets[r] == back
        for n in range(offsets[r], offsets[r + 1]):
            if not repeated:
                break
            same = start[n] == start[n - back] and stop[n] == stop[n - back]
            repeated = same and label[n] == label[n - back]
        row_filter = _SAME_AS_ABOVE if repeated else _SAME_AS_LEFT
        place = _put(stream, place, row_filter, codes, bits)
        low = (low + row_filter) % _ADLER
        high = (high + low) % _ADLER
        zeros, at, before = 0, 0, 0  # zeros that wait, pixels done, the last one's label
        steps = 0 if repeated else 2 * (offsets[r + 1] - offsets[r])
        for step in range(steps):
            n = offsets[r] + (step >> 1)
            if step & 1 == 0:
                edge, now = start[n], label[n]
            else:
                edge, now = stop[n], 0
                if edge == width or (n + 1 < offsets[r + 1] and start[n + 1] == edge):
                    continue  # the next run begins here
            zeros += (edge - at) * size
            high = (high + (edge - at) * size * low) % _ADLER
            for channel in range(size):
                value = (np.int64(pixel[now, channel]) - pixel[before, channel]) & 255
                if value == 0:
                    zeros += 1
                else:
                    place = _put_zeros(stream, place, zeros, codes, bits)
                    zeros = 0
                    place = _put(stream, place, value, codes, bits)
                    low = (low + value) % _ADLER
                high = (high + low) % _ADLER
            at, before = edge + 1, now
        zeros += (width - at) * size
        high = (high + (width - at) * size * low) % _ADLER
        place = _put_zeros(stream, place, zeros, codes, bits)
    return _put(stream, place, np.int64(_END), codes, bits), (high << 16) | low


# ------------------------------------------------------------------------------------------------
# PNG: the container around pixels that are compressed already.


_Rgba = tuple[int, int, int, int]
_Runs = tuple[IntArray, IntArray, IntArray, IntArray]

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_PER_METRE = 1
_TRUECOLOUR_ALPHA, _INDEXED = 6, 3


def _encode_png(width: int, height: int, kind: "ImageKind", zlib_stream: bytes) -> bytes:
    """Return the bytes of a PNG file of 8 bits a channel, of filtered rows, compressed."""
    colour = _INDEXED if kind.indexed else _TRUECOLOUR_ALPHA
    header = struct.pack(">IIBBBBB", width, height, 8, colour, 0, 0, 0)
    per_metre = [min(round(1000.0 / edge), 2**31 - 1) for edge in kind.pixel_mm]
    chunks = [(b"IHDR", header), (b"pHYs", struct.pack(">IIB", *per_metre, _PER_METRE))]
    if kind.indexed:
        palette = np.array([NOTHING, *kind.colours], np.uint8)
        chunks += [(b"PLTE", palette[:, :3].tobytes()), (b"tRNS", palette[:, 3].tobytes())]
    chunks += [(b"IDAT", zlib_stream), (b"IEND", b"")]
    return _SIGNATURE + b"".join(
        struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
        for name, data in chunks
    )


# ------------------------------------------------------------------------------------------------
# A layer's runs as a PNG, without ever making its pixels.


NOTHING: _Rgba = (0, 0, 0, 0)
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

    colours: tuple[_Rgba, ...]
    indexed: bool
    pixel_mm: tuple[float, float]


def encode_layer(runs: _Runs, rows: tuple[int, int], width: int, kind: ImageKind) -> bytes:
    """Return the PNG of some rows of labelled runs.

    Parameters
    ----------
    runs
        Offsets (rows + 1,) int64: row r has the runs ``offsets[r]`` to ``offsets[r + 1]``; start
        and stop (runs,) int32, which rise in a row and do not overlap; label (runs,) int32, from 1
        on.
    rows
        First row of the image, and the one after its last.
    """
    first, last = rows
    head, head_bits, codes, lengths = _deflate_code()
    pixel = np.array([NOTHING, *kind.colours], np.uint8)  # its bytes by label
    if kind.indexed:
        pixel = np.arange(len(pixel), dtype=np.uint8)[:, None].copy()
    code = (codes, lengths)
    a_row = _BITS_A_ROW + 2 * (width * pixel.shape[1] // 258 + 1)
    edges = 2 * int(runs[0][last] - runs[0][first])
    bits = head_bits + (last - first) * a_row + edges * _BITS_AN_EDGE + 64
    stream = np.zeros(bits // 8 + 8, np.uint8)
    stream[: len(head)] = head
    place, adler = _deflate_rows(runs, first, last, width, pixel, code, stream, head_bits)
    data = stream[: (int(place) + 7) // 8].tobytes() + int(adler).to_bytes(4, "big")
    return _encode_png(width, last - first, kind, data)
