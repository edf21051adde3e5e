"""Whole parts as specimens: how they were held and loaded, and what laws make of that."""

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from planner.errors import ArgumentError, FileError
from planner.formats.files import path_within
from planner.formats.specimens import ListedSpecimen
from planner.palette import Palette
from planner.plan import plan_file
from planner.simulation.part_response import PartResponse, read_response

__all__ = ["PartReader", "PartTest"]


@dataclass(frozen=True, slots=True)
class PartTest:
    """How a whole part was held and loaded, and what the palette's laws make of it.

    Attributes
    ----------
    response
        Force and shares along that motion.
    fix, move, load
        As the lab wrote them: selectors, and a displacement or a force; "" where it did not.
    """

    response: PartResponse
    fix: str = ""
    move: str = ""
    load: str = ""

    @property
    def name(self) -> str:
        """Of the part."""
        return self.response.name


_Simulated = Callable[..., PartResponse]


@dataclass(slots=True)
class PartReader:
    """Reads the parts of a campaign, each with its supports and its load once.

    Attributes
    ----------
    folder
        What paths are relative to, and lie in.
    """

    folder: Path
    palette: Palette
    _known: dict[tuple[str, str, str, str], PartTest] = field(default_factory=dict)

    def read(self, row: ListedSpecimen) -> PartTest:
        """Return the part that a row names: a plan, which is simulated, or a response.

        Raises
        ------
        FileError
            No such file, supports or a load that are missing or not understood, or a part that
            cannot be simulated so.
        """
        key = (row.part, row.fix, row.move, row.load)
        if key not in self._known:
            self._known[key] = PartTest(self._response(*key), *key[1:])
        return self._known[key]

    def _response(self, part: str, fix: str, move: str, load: str) -> PartResponse:
        path = path_within(self.folder, part)
        if path.is_file() and path.name != "plan.json":
            return read_response(path)
        if not fix or bool(move) == bool(load):
            raise FileError(
                f"part {part}: give 'fix' and one of 'move' and 'load' (got {fix!r}, {move!r} and "
                f"{load!r}), as in fix x<1 and move x=max: 10,0,0 mm"
            )
        plan = plan_file(path)
        # The solid's solver is slow to import, and few campaigns hold parts.
        from planner.simulation.part_sensitivity import part_response

        supports = re.split(r"\s*;\s*", fix)
        try:
            return part_response(plan, self.palette, fix=supports, move=move, load=load)
        except ArgumentError as error:
            raise FileError(f"part {part}: {error}") from error
