"""Changes of a valid file: bytes, pieces, lines, and words of text."""

import re

import numpy as np

__all__ = ["mutated", "strange_word"]

WORDS: tuple[bytes, ...] = (
    *(b"nan", b"inf", b"-inf", b"1e400", b"-1e400", b"1e308", b"-1e308", b"1e-320", b"-1", b"0"),
    *(b"-0.0", b"99999999999999999999", b"4294967295", b"2147483648", b"1e39", b"1_000", b"0x10"),
    *(b"1,5", b"", b" ", b"true", b"null", b"x", b"''", b'"', b"'", b"[", b"]", b"{", b"}", b"="),
    *(b"\n", b"\r", b"\t", b";", b",", b"\0", b"\x1b[31m", b"\xff", b"\xc2\xa0", b"\xed\xa0\x80"),
    *("µm".encode(), "名前".encode(), "é".encode("cp1252"), "\u2028".encode(), b"`part`", b"{x}"),
    *(b"1970-01-01", b"%", b"../..", b"/dev/zero", b"#", b"//", b"&amp;", b"<a>", b"</x>"),
    *(10_000 * b"x", 5_000 * b"9", 20_000 * b"[", 20_000 * b"{", 3_000 * b"a ", 3_000 * b"1,"),
    *(20_000 * b"(", 2_000 * b'{"a":', 5_000 * b"a.", 500 * b"<a>"),
)
TOKEN = re.compile(rb"[-+.\w]+")
INTEGERS = (0, 1, 0x7F, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 0x7F800000,
            0x7FC00000, 0xFF800000, 0x7FFFFFFFFFFFFFFF, 0xFFFFFFFFFFFFFFFF)  # fmt: skip
"""Ends of ranges, and infinity and no number as floats."""


def strange_word(rng: np.random.Generator) -> bytes:
    return WORDS[rng.integers(len(WORDS))]


def mutated(rng: np.random.Generator, data: bytes) -> bytes:
    """Return the bytes after none to four changes; binary and text alike."""
    changes = (_digit, _digit, _token, _token, _bytes, _integer, _cut, _drop, _repeat, _line, _swap)
    for _ in range(rng.choice((0, 1, 1, 1, 1, 1, 2, 2, 3, 4))):
        data = changes[rng.integers(len(changes))](rng, data)
    return data


def _place(rng: np.random.Generator, data: bytes) -> int:
    return int(rng.integers(len(data) + 1))


def _stretch(rng: np.random.Generator, data: bytes) -> tuple[int, int]:
    start = _place(rng, data)
    return start, min(start + int(2.0 ** rng.uniform(0, 10)), len(data))


def _token(rng: np.random.Generator, data: bytes) -> bytes:
    """Replace one number or word, those near the beginning as often as all others."""
    words = [found.span() for found in TOKEN.finditer(data)]
    if not words:
        return data + strange_word(rng)
    few = words[: 1 + len(words) // 10] if rng.random() < 0.5 else words
    start, end = few[rng.integers(len(few))]
    return data[:start] + strange_word(rng) + data[end:]


def _digit(rng: np.random.Generator, data: bytes) -> bytes:
    """Write another digit, so that a file often stays sound."""
    places = [found.start() for found in re.finditer(rb"\d", data)]
    if not places:
        return data
    place = places[rng.integers(len(places))]
    return data[:place] + str(rng.integers(10)).encode() + data[place + 1 :]


def _bytes(rng: np.random.Generator, data: bytes) -> bytes:
    changed = bytearray(data)
    for place in rng.integers(max(len(data), 1), size=rng.integers(1, 9)):
        changed[place : place + 1] = rng.bytes(1)
    return bytes(changed)


def _integer(rng: np.random.Generator, data: bytes) -> bytes:
    """Write an extreme number of 1 to 8 bytes over what stands there."""
    size = int(2 ** rng.integers(4))
    number = INTEGERS[rng.integers(len(INTEGERS))] % (1 << 8 * size)
    place = _place(rng, data) if rng.random() < 0.5 else int(rng.integers(min(len(data), 200) + 1))
    order = "little" if rng.random() < 0.8 else "big"
    return data[:place] + number.to_bytes(size, order) + data[place + size :]


def _cut(rng: np.random.Generator, data: bytes) -> bytes:
    return data[: _place(rng, data)]


def _drop(rng: np.random.Generator, data: bytes) -> bytes:
    start, end = _stretch(rng, data)
    return data[:start] + data[end:]


def _repeat(rng: np.random.Generator, data: bytes) -> bytes:
    start, end = _stretch(rng, data)
    times = int(2.0 ** rng.uniform(0, 10)) if end - start < 100 else 2
    return data[:end] + times * data[start:end] + data[end:]


def _swap(rng: np.random.Generator, data: bytes) -> bytes:
    (a, b), (c, d) = sorted((_stretch(rng, data), _stretch(rng, data)))
    b = min(b, c)
    return data[:a] + data[c:d] + data[b:c] + data[a:b] + data[d:]


def _line(rng: np.random.Generator, data: bytes) -> bytes:
    """Drop, repeat, empty or move a line."""
    lines = data.splitlines(keepends=True)
    if not lines:
        return data
    at = int(rng.integers(len(lines)))
    way = rng.integers(4)
    if way == 0:
        del lines[at]
    elif way == 1:
        lines.insert(int(rng.integers(len(lines) + 1)), lines[at])
    elif way == 2:
        lines[at] = b"\n"
    else:
        lines.append(lines.pop(at))
    return b"".join(lines)
