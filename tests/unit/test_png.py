"""Layers as PNG: what a reader decodes is what was drawn, and the code is a lawful one."""

import io
import itertools
import zlib

import numpy as np
import pytest
from PIL import Image

from planner.formats.png import NOTHING, ImageKind, _lengths, encode_layer

COLOURS = ((251, 215, 36, 255), (1, 0, 255, 255), (200, 17, 99, 255))


def runs_of(image: np.ndarray) -> tuple[np.ndarray, ...]:
    """Runs of equal labels above 0, row by row."""
    offsets, runs = [0], []
    for row in image:
        edges = np.flatnonzero(np.diff(np.concatenate([[-1], row, [-1]])))
        runs += [(a, b, row[a]) for a, b in itertools.pairwise(edges) if row[a]]
        offsets.append(len(runs))
    start, stop, label = np.array(runs, np.int32).reshape(-1, 3).T.copy()
    return np.array(offsets, np.int64), start, stop, label


def some_image(random: np.random.Generator, width: int) -> np.ndarray:
    """Rows of random stretches, some as the row before."""
    image = np.zeros((random.integers(1, 30), width), int)
    for j in range(len(image)):
        if j and random.random() < 0.4:
            image[j] = image[j - 1]
        else:
            new = random.random(width) < random.choice([0.01, 0.3, 0.9])
            values = random.integers(0, len(COLOURS) + 1, width)
            last = np.maximum.accumulate(np.where(new, np.arange(width), 0))
            image[j] = values[last]
    return image


@pytest.mark.parametrize("indexed", [False, True])
@pytest.mark.parametrize("width", [1, 3, 40, 65, 1000])
def test_pillow_reads_what_was_drawn(width: int, indexed: bool) -> None:
    random = np.random.default_rng(width)
    for _ in range(10):
        image = some_image(random, width)
        kind = ImageKind(COLOURS, indexed, (0.042, 0.085))
        data = encode_layer(runs_of(image), (0, len(image)), width, kind)
        Image.open(io.BytesIO(data)).verify()
        read = Image.open(io.BytesIO(data))
        if indexed:
            assert read.mode == "P"
            assert np.array_equal(np.asarray(read), image)
        pixels = np.asarray(read.convert("RGBA"))
        assert np.array_equal(pixels, np.array([NOTHING, *COLOURS], np.uint8)[image])
        # 25.4 / 0.042 and 25.4 / 0.085 dots an inch; PNG keeps whole pixels a metre, half of one
        # in 11765 is 4e-5
        assert read.info["dpi"] == pytest.approx((25.4 / 0.042, 25.4 / 0.085), rel=1e-4)


def test_rows_from_the_middle_of_a_slab() -> None:
    """A layer's first row never leans on the layer below."""
    image = np.repeat([[0, 1, 1, 2, 0]], 6, axis=0)
    kind = ImageKind(COLOURS, False, (0.1, 0.1))
    whole = runs_of(image)
    assert encode_layer(whole, (3, 6), 5, kind) == encode_layer(whole, (0, 3), 5, kind)


def test_the_code_is_complete() -> None:
    """Kraft's sum is exactly 1: every decoder that follows RFC 1951 takes it."""
    assert sum(2.0**-bits for bits in _lengths()) == 1.0


def test_every_match_and_literal_decodes() -> None:
    """Stretches of every length to 600 pixels between single ones: all match codes are used."""
    width = sum(range(600)) + 600
    row = np.zeros(width, int)
    row[np.cumsum(np.arange(600)) + np.arange(600)] = 1
    kind = ImageKind(((7, 7, 7, 7),), True, (0.1, 0.1))
    data = encode_layer(runs_of(row[None]), (0, 1), width, kind)
    assert np.array_equal(np.asarray(Image.open(io.BytesIO(data))), row[None])


def test_the_bytes_are_these_for_ever() -> None:
    """The whole file is our own making: its checksum holds with any zlib, on any machine."""
    image = np.zeros((40, 300), int)
    image[5:30, 20:290] = 1
    image[10:20, 100:200] = 2
    kind = ImageKind(COLOURS, False, (0.042, 0.042))
    assert zlib.crc32(encode_layer(runs_of(image), (0, 40), 300, kind)) == 1041557812
