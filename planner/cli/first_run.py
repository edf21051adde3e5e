"""The first run after installation: other processes compile the loops that it needs last.

The loops of the main job are compiled once, for some seconds, and kept. One process compiles one at
a time, so further processors rehearse the last stages of a plan on a small box meanwhile; what
they compile the run then finds. Whatever becomes of them, the run compiles by itself what it does
not find.
"""

import contextlib
import os
import subprocess
import sys
from collections.abc import Callable, Mapping
from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from planner.mesh.mesh import Mesh

__all__ = ["rehearse", "share_compiling"]

_started: list[subprocess.Popen[bytes]] = []


@cache
def share_compiling() -> None:
    """Start processes that rehearse stages of a plan, once something has to be compiled."""
    from planner.numerics import at_first_compilation

    at_first_compilation(_start)


def _start() -> None:
    # os.cpu_count() counts processors that this process may not use; not every system tells.
    allowed = getattr(os, "sched_getaffinity", None)
    processors = len(allowed(0)) if allowed else os.cpu_count() or 1
    # The run itself takes columns, walls with their sets, shells and pictures, in this order; what
    # it would meet last comes first here, after the columns that all of them need.
    shares = {1: [], 2: [["columns", "sets", "pictures", "shells", "walls"]]}.get(
        processors, [["columns", "pictures", "shells"], ["sets", "walls"]]
    )
    for stages in shares:
        code = f"from planner.cli.first_run import rehearse; rehearse({stages!r})"
        with contextlib.suppress(OSError):
            _started.append(
                subprocess.Popen(
                    [sys.executable, "-c", code],
                    stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                )
            )  # fmt: skip


def rehearse(stages: list[str]) -> None:
    """Go through stages of a plan on a box, so that their loops are compiled and kept."""
    for stage in stages:
        _STAGES[stage]()


def _box() -> "Mesh":
    """Return a box with a wall that is thin."""
    import numpy as np

    from planner.mesh.mesh import Mesh

    corners = np.array([(x, y, z) for x in (1, 5) for y in (1, 4) for z in (1, 1.3)])
    sides = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    faces = [half for a, b, c, d in sides for half in ((a, b, c), (a, c, d))]
    return Mesh(corners.astype(np.float64), np.array(faces, np.int32))


def _columns() -> None:
    from planner.voxels.columns import Grid, columns_of, snap

    # Of vertices on the grid: measuring a mesh is what the run itself compiles by now.
    box, grid = _box(), Grid((0.0, 0.0, 0.0), (1.0, 1.0, 0.1), (6, 6, 20))
    snapped = snap(box.vertices, grid)
    for _ in columns_of(snapped, box.faces, grid):
        pass


def _pictures() -> None:
    from planner.voxels.picture import pictures_of

    pictures_of([(_box(), "#808080")], width=32, height=32)


def _sets() -> None:
    from planner.voxels.thin_places import active_words, ball, empty_set, grow, morph

    nothing = empty_set(1, 1, 1)
    grow(nothing, nothing.copy(), 1)
    morph(nothing, ball(1), False, nothing, active_words(nothing, 1))


def _walls() -> None:
    from planner.voxels.thin_places import thin_solid_places, thin_space_places

    thin_solid_places(_box(), 0.6, listed=1)
    thin_space_places(_box(), 0.4, listed=1)


def _shells() -> None:
    import numpy as np

    from planner.grading.check import shell_checks
    from planner.mesh.mesh import join_shells

    box = _box()
    shell_checks(join_shells([box.triangles.astype(np.float32)]), box)


_STAGES: Mapping[str, Callable[[], None]] = {
    "columns": _columns,
    "pictures": _pictures,
    "shells": _shells,
    "sets": _sets,
    "walls": _walls,
}
