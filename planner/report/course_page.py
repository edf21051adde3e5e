"""What the page of a design shows beside that of its plan: the part from rest to full load."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from planner.numerics import FloatArray, Point
from planner.report.display import Shown, thinned
from planner.report.page import packed
from planner.report.svg import ramp

if TYPE_CHECKING:
    from planner.inverse_design.design import Course

__all__ = ["course_controls", "course_data"]


_SCALE = ("#F4F1DE", "#F2CC8F", "#E07A5F", "#B5374A", "#6D1A36")
"""From nothing left to the most: lightness falls all the way."""

_COUNTS = 65535
"""Positions along the longest edge of the box: what 16 bits count."""

_MOST_TRIANGLES = 20_000
"""Of a wanted shape, of which the sharp edges are drawn alone."""


def course_data(
    courses: "Sequence[Course]", display: Shown, moved_mm: Point
) -> tuple[Shown, dict[str, Any], str]:
    """Return what the viewer shows of a design.

    Returns
    -------
    display : Shown
        The shells, and behind them the shapes that are wanted, on a grid that holds all frames.
    document
        What the viewer's JSON holds of the course.
    frames : str
        Places and values of all frames, in base64.
    """
    shift = np.array(moved_mm)
    printed = [display.origin_mm + display.step_mm * points for points, _ in display.shells]
    frames: list[tuple[str, int | None, list[FloatArray], list[FloatArray]]] = []
    shapes: list[tuple[FloatArray, Any]] = []
    top = max((float(c.off_mm.max()) for c in courses if c.off_mm is not None), default=0.0)
    for course in courses:
        number = None
        if course.wanted is not None:
            number = len(display.shells) + len(shapes)
            kept, faces = thinned(course.wanted.vertices, course.wanted.faces, _MOST_TRIANGLES)
            shapes.append((course.wanted.vertices[kept] + shift, faces))
        off = [_left(course, places - shift, top) for places in printed]
        count = len(course.share)
        flat = course.displacement_mm.transpose(1, 0, 2).reshape(-1, 3 * count)
        moves = [course.cells.interpolated(places - shift, flat) for places in printed]
        for k, share in enumerate(course.share):
            places = [p + m[:, 3 * k : 3 * k + 3] for p, m in zip(printed, moves, strict=True)]
            name = f"{course.case}, " if course.case else ""
            frames.append((f"{name}load {share:.3g}", number, places, off))
    everything = [p for _, _, places, _ in frames for p in places] + [p for p, _ in shapes]
    low = np.min([p.min(axis=0) for p in everything], axis=0)
    high = np.max([p.max(axis=0) for p in everything], axis=0)
    step_mm = float((high - low).max()) / _COUNTS or 1.0

    def counts(places: FloatArray) -> Any:
        return np.floor((places - low) / step_mm + 0.5).astype(np.uint16)

    first = [(counts(p), faces) for p, (_, faces) in zip(printed, display.shells, strict=True)]
    last = [(counts(p), faces) for p, faces in shapes]
    parts = [
        counts(p).astype("<u2").tobytes() + np.rint(255.0 * v).astype("u1").tobytes()
        for _, _, places, off in frames
        for p, v in zip(places, off, strict=True)
    ]
    document = {
        "printed": len(first),
        "frames": [{"text": text, "shape": number} for text, number, *_ in frames],
        "scale": ramp(_SCALE, range(5), np.linspace(0.0, 4.0, 256)),
        "top_mm": top,
    }
    # The last frame of the first case is what the slider begins with; the grid holds all of them.
    shown = replace(display, origin_mm=low, step_mm=step_mm, shells=(*first, *last))
    return shown, document, packed(parts)


def _left(course: "Course", places_mm: FloatArray, top: float) -> FloatArray:
    """Return how far the surface nearest to places is off what is wanted, over the most."""
    from scipy.spatial import KDTree

    if course.off_mm is None or top <= 0.0:
        return np.zeros(len(places_mm))
    nearest = KDTree(course.cells.surface.vertices).query(places_mm)[1]
    return np.asarray(course.off_mm[nearest] / top)


def course_controls(document: dict[str, Any]) -> Iterator[str]:
    """Yield the slider and what stands beside it."""
    frames = document["frames"]
    last = next(k for k in reversed(range(len(frames))) if frames[k]["shape"] == frames[0]["shape"])
    yield '<fieldset id="load" data-needs-view hidden><legend>Load</legend><div class="slide">'
    yield (
        f'<input type="range" id="course-step" min="0" max="{len(frames) - 1}" value="{last}" '
        'step="1" aria-label="Step of the load">'
    )
    yield '<output id="course-words" for="course-step"></output></div>'
    if any(frame["shape"] is not None for frame in frames):
        words = f"what is left, up to {document['top_mm']:.3g} mm"
        yield '<label class="tick"><input type="checkbox" id="course-wanted" checked> outline of '
        yield "the wanted shape</label>"
        yield '<label class="tick"><input type="checkbox" id="course-left">'
        yield f"{escape(words)}</label>"
        ramp = ",".join(_SCALE)
        yield f'<div class="scale" style="background:linear-gradient(90deg,{ramp})"></div>'
    else:
        yield '<input type="checkbox" id="course-wanted" hidden>'
    yield "</fieldset>"
