"""The one Huffman code that layers are compressed with.

Rows of a layer are nearly all zeros once each pixel has its left neighbour taken off, so the code
gives one bit to the longest match and one to "the byte before": 258 zeros take two bits, both 0.
It never changes, so that the same layer is the same bytes with any version of zlib.
"""

from functools import cache
from typing import NamedTuple

import numpy as np

from planner.arrays import IntArray

__all__ = ["DeflateCode", "deflate_code"]

_END, _SYMBOLS, _DISTANCES = 256, 286, 4
_LENGTH_BASE = (
    *(3, 4, 5, 6, 7, 8, 9, 10, 11, 13, 15, 17, 19, 23, 27, 31, 35, 43, 51, 59, 67, 83, 99, 115),
    *(131, 163, 195, 227, 258),
)
_LENGTH_EXTRA_BITS = (*(0,) * 8, *(n for n in range(1, 6) for _ in range(4)), 0)
# RFC 1951, 3.2.7: the order in which the lengths of the code for code lengths stand.
_ORDER = (16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15)


class DeflateCode(NamedTuple):
    """Tables of the code, first bit sent lowest.

    Attributes
    ----------
    head, head_bits : (bytes,) uint8, int
        What a stream begins with: zlib's two bytes, and a last block that brings this code.
    literal, literal_bits : (257,) int64
        Code and its length for each byte, and for the end of the block.
    match, match_bits : (259,) int64
        The same, by length, for a repetition of the byte before; from 3 on.
    """

    head: IntArray
    head_bits: int
    literal: IntArray
    literal_bits: IntArray
    match: IntArray
    match_bits: IntArray


def _lengths() -> list[int]:
    """Return bits by symbol: they sum to exactly 1 in units of 2^-bits, as decoders require."""
    bits = [10] * _END + [8] + [8] * 28 + [1]
    bits[0] = 4
    for frequent in (1, 2, 255):  # filters, and alpha's steps up (255) and down (1)
        bits[frequent] = 6
    for length in range(277, 285):  # 67 to 257 zeros
        bits[length] = 7
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
    used = sorted({0, *bits})
    meta = [0] * 19  # a code for the lengths themselves: the commonest in two bits, six in three
    for n in used:
        meta[n] = 2 if n == 10 else 3
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


@cache
def deflate_code() -> DeflateCode:
    """Return the code."""
    bits = _lengths()
    codes = _codes(bits)
    match, match_bits = [0, 0, 0], [0, 0, 0]
    for length in range(3, 259):
        entry = max(i for i, base in enumerate(_LENGTH_BASE) if base <= length)
        extra, size = length - _LENGTH_BASE[entry], bits[_END + 1 + entry]
        match.append(codes[_END + 1 + entry] | extra << size)
        match_bits.append(size + _LENGTH_EXTRA_BITS[entry] + 1)  # and distance 1, a zero bit
    head, head_bits = _head(bits)
    first = slice(0, _END + 1)
    tables = (codes[first], bits[first], match, match_bits)
    return DeflateCode(head, head_bits, *(np.array(t, np.int64) for t in tables))
