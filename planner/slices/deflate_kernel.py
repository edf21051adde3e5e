"""The loop behind `planner.slices.layer_image`: runs of a layer to a zlib stream.

Work and memory grow with the runs, not with the pixels: pixels are never made.
"""

from typing import Any

from planner.geometry.kernel import inner_kernel, kernel

__all__ = ["deflate_rows"]

_ADLER = 65521
_SAME_AS_LEFT, _SAME_AS_ABOVE = 1, 2  # PNG's filters "sub" and "up"


@inner_kernel
def _put(stream: Any, place: Any, code: Any) -> None:
    # Write a code of up to 16 bits at bit `place`; the stream is zero from there on.
    first, value = place >> 3, code << (place & 7)
    stream[first] |= value & 255
    stream[first + 1] |= (value >> 8) & 255
    stream[first + 2] |= (value >> 16) & 255


@inner_kernel
def _put_zeros(
    stream: Any, place: Any, zeros: Any, literal: Any, literal_bits: Any, match: Any, bits: Any
) -> Any:
    # One zero as it is, then repetitions of it; 258 of them are two bits that are zero already.
    if zeros > 0:
        _put(stream, place, literal[0])
        place += literal_bits[0]
        place += 2 * ((zeros - 1) // 258)
        rest = (zeros - 1) % 258
        if rest < 3:
            for _ in range(rest):
                _put(stream, place, literal[0])
                place += literal_bits[0]
        else:
            _put(stream, place, match[rest])
            place += bits[rest]
    return place


@kernel
def deflate_rows(
    offsets: Any,
    start: Any,
    stop: Any,
    label: Any,
    first: Any,
    last: Any,
    width: Any,
    pixel: Any,
    literal: Any,
    literal_bits: Any,
    match: Any,
    match_bits: Any,
    stream: Any,
    place: Any,
) -> Any:
    """Write rows first <= r < last of runs, filtered and compressed, and return the end in bits.

    Parameters
    ----------
    pixel : (labels + 1, bytes a pixel) uint8
        Bytes of a pixel by label; 0 is where no run is.
    stream, place
        Zeroed bytes with the stream's head, and the bits that this has.

    Returns
    -------
    place, adler
        Bits written, and the checksum of what they mean.
    """
    size = pixel.shape[1]
    low, high = 1, 0  # Adler-32
    for r in range(first, last):
        repeated = r > first and offsets[r + 1] - offsets[r] == offsets[r] - offsets[r - 1]
        if repeated:
            back = offsets[r] - offsets[r - 1]
            for n in range(offsets[r], offsets[r + 1]):
                if (
                    start[n] != start[n - back]
                    or stop[n] != stop[n - back]
                    or label[n] != label[n - back]
                ):
                    repeated = False
                    break
        row_filter = _SAME_AS_ABOVE if repeated else _SAME_AS_LEFT
        _put(stream, place, literal[row_filter])
        place += literal_bits[row_filter]
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
                value = (int(pixel[now, channel]) - int(pixel[before, channel])) & 255
                if value == 0:
                    zeros += 1
                else:
                    place = _put_zeros(
                        stream, place, zeros, literal, literal_bits, match, match_bits
                    )
                    zeros = 0
                    _put(stream, place, literal[value])
                    place += literal_bits[value]
                    low = (low + value) % _ADLER
                high = (high + low) % _ADLER
            at, before = edge + 1, now
        zeros += (width - at) * size
        high = (high + (width - at) * size * low) % _ADLER
        place = _put_zeros(stream, place, zeros, literal, literal_bits, match, match_bits)
    _put(stream, place, literal[256])
    return place + literal_bits[256], (high << 16) | low
