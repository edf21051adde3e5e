"""A campaign: what a lab measured, on which specimens, under which conditions."""

from collections import Counter
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, field, replace
from functools import cache
from types import MappingProxyType

import numpy as np

from planner.errors import FileError
from planner.formats.specimens import SPECIMEN_COLUMNS, SpecimenConditions
from planner.glance import brief, counted, one_line, plotted
from planner.materials.characterise import check_record
from planner.numerics import FloatArray, freeze
from planner.palette import Palette, Reference
from planner.simulation.bar import ProfileDesign
from planner.simulation.part_response import PartResponse

__all__ = [
    "BEYOND_GAUGE",
    "LONGEST_FACET",
    "TOLERANCES",
    "Campaign",
    "PartTest",
    "Specimen",
    "StrainField",
    "axis_columns",
    "column_levels",
    "condition_groups",
    "named",
    "replicate_groups",
    "stated",
]


# ------------------------------------------------------------------------------------------------
# One specimen of a campaign: what it is, how it was tested, what was measured.


BEYOND_GAUGE = 0.02
"""How far beyond the gauge's ends a place may be said to lie, of the gauge. Chosen: ends are marked
to half a millimetre of 25."""

LONGEST_FACET = 0.1
"""That is believed, of the gauge; facets that stand farther apart may be as long as that. Chosen:
one that averages over more shows no gradient."""


@dataclass(frozen=True, slots=True, eq=False)
class StrainField:
    """Strain along the axis, from image correlation.

    Attributes
    ----------
    time_s
        Rising, shape (t,), on the same clock as the specimen's record.
    x_mm
        Places along the undeformed gauge from its end, rising, shape (p,).
    strain
        Engineering strain, shape (t, p).
    facet_mm
        Length around a place over which the strain is a mean, 0 for a point; None where unknown.
    """

    time_s: FloatArray
    x_mm: FloatArray
    strain: FloatArray
    facet_mm: float | None = None

    __repr__ = brief

    def __post_init__(self) -> None:
        freeze(self, "time_s", "x_mm", "strain")
        shape = (len(self.time_s), len(self.x_mm))
        if self.strain.shape != shape:
            raise FileError(f"strain field: shape {self.strain.shape}; it must be {shape}")

    def slack_mm(self, gauge_mm: float) -> float:
        """Return how far beyond an end of the gauge its places may lie."""
        reach = float(np.median(np.diff(self.x_mm))) if self.facet_mm is None else self.facet_mm
        # Half a facet may touch the gauge from beyond.
        return max(min(reach, 0.5 * LONGEST_FACET * gauge_mm), BEYOND_GAUGE * gauge_mm)


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


_RECORD = ("time_s", "displacement_mm", "force_N")


@dataclass(frozen=True, slots=True, eq=False)
class Specimen(SpecimenConditions):
    """One specimen; None stands for what is unknown, never for "as the palette's reference".

    Attributes
    ----------
    id
        Its name in specimens.csv.
    time_s, displacement_mm, force_N
        The record: time rising, travel of the crosshead from rest, force positive in tension;
        shape (n,), n at least `MINIMUM_POINTS`. In compression both are negative.
    material, profile, part
        Exactly one is given: a material id of the palette, a graded bar's design, or a whole part
        with its supports and its load.
    width_mm, thickness_mm
        Nominal section; None for a graded bar whose design has its own, and where only the
        measured size is known.
    gauge_mm
        Undeformed gauge length; of a part, `PartResponse.gauge_mm`.
    orientation
        Of the gauge on the tray.
    covariates
        Further columns by name: text, number or None.
    strain_field
        Strain along the axis, if it was measured.
    time_recorded
        False where the record had no time and it was counted from travel and rate.
    force_unit_N, travel_unit_mm
        Of the numbers in its file; None where these are stresses, or strains.
    """

    id: str
    time_s: FloatArray
    displacement_mm: FloatArray
    force_N: FloatArray
    gauge_mm: float
    material: str | None = None
    profile: ProfileDesign | None = None
    part: PartTest | None = None
    covariates: Mapping[str, str | float | None] = field(default_factory=dict)
    strain_field: StrainField | None = None
    time_recorded: bool = True
    force_unit_N: float | None = 1.0
    travel_unit_mm: float | None = 1.0

    @one_line
    def __repr__(self) -> str:
        return f"{self.id}: {self.made_of}, {self.protocol}, {counted(len(self.time_s), 'point')}"

    def __post_init__(self) -> None:
        freeze(self, *_RECORD)
        where = f"specimen {self.id}"
        check_record(where, {name: getattr(self, name) for name in _RECORD})
        if sum(of is not None for of in (self.material, self.profile, self.part)) != 1:
            raise FileError(f"{where}: give exactly one of material, profile and part")
        if not 0.0 < self.gauge_mm < np.inf:
            raise FileError(f"{where}: gauge_mm is {self.gauge_mm:g}; it must be above 0")

    @property
    def made_of(self) -> str:
        """What it is: the material's id, or the name of its design or part."""
        design = self.profile if self.part is None else self.part.response
        return (self.material or "") if design is None else design.name

    @property
    def named(self) -> str:
        """The same, a bar or a part named as such."""
        kind = "" if self.material else "bar " if self.part is None else "part "
        return f"{kind}{self.made_of}"

    @property
    def coordinates(self) -> FloatArray | None:
        """Of its design or part; None of a coupon, which its material says."""
        design = self.profile if self.part is None else self.part.response
        return None if design is None else design.coordinate

    @property
    def pushed(self) -> bool:
        """Whether it is compressed: its travel goes down before it goes up half as far."""
        moved = self.displacement_mm - self.displacement_mm[0]
        far = np.abs(moved) >= 0.5 * np.max(np.abs(moved))
        return bool(moved[int(np.argmax(far))] < 0.0)

    @property
    def travel_mm(self) -> FloatArray:
        """Of the crosshead, the way it loads: positive where it pulls, or where it pushes.

        Where it was recorded so coarsely that it stands for some rows at each level, it goes on
        evenly from level to level.
        """
        even = _without_stairs(self.time_s, self.displacement_mm)
        return -even if self.pushed else even

    @property
    def load_N(self) -> FloatArray:
        """Force, the way it loads: positive in tension, or in a compressed specimen."""
        return -self.force_N if self.pushed else self.force_N

    @property
    def strain(self) -> FloatArray:
        """Travel the way it loads over gauge length."""
        return self.travel_mm / self.gauge_mm

    def strain_end(self, palette: Palette) -> float:
        """Return how far its part was simulated, or its law goes; of a bar's laws the farthest."""
        if self.part is not None:
            return float(self.part.response.displacement_mm[-1]) / self.gauge_mm
        if self.material is not None:
            return palette.resolve(self.material).elongation_at_break
        return max(m.elongation_at_break for m in palette.materials)

    def section_mm2(self, x_mm: FloatArray) -> FloatArray | None:
        """Return the undeformed section along the gauge, the design's where it has one.

        None where it is unknown.
        """
        design, area = self.profile, np.ones(np.shape(x_mm))
        for name in ("width_mm", "thickness_mm"):
            size = getattr(self, f"measured_{name}") or getattr(self, name)
            if design is not None and getattr(design, name) is not None:
                size = np.interp(x_mm, design.x_mm, getattr(design, name))
            if size is None:
                return None
            area *= size
        return area


_FEWEST_LEVELS = 5
"""Levels of travel without which there is no pace of stairs. Chosen: a pull between two holds has
fewer."""

_STAIRS = 0.25
"""Share of levels on which a coarse travel stands for two rows or more. Chosen: holds and turns are
far fewer, coarse travel stands on nearly all."""


def _without_stairs(time_s: FloatArray, travel_mm: FloatArray) -> FloatArray:
    """Return travel through the middle of each level that it stands at.

    A level that lasts longer than those beside it is a rest: travel arrives and leaves as fast as
    there, and rests between.
    """
    first = np.flatnonzero(np.diff(travel_mm, prepend=np.nan) != 0.0)
    last = np.append(first[1:], len(travel_mm)) - 1
    if len(first) < _FEWEST_LEVELS or np.mean(last > first) < _STAIRS:
        return travel_mm
    # A level begins and ends half-way to the rows beside it.
    edges = np.concatenate([time_s[:1], 0.5 * (time_s[last[:-1]] + time_s[first[1:]]), time_s[-1:]])
    lasts = np.diff(edges)
    beside = np.maximum(np.append(lasts[1:], 0.0), np.append(0.0, lasts[:-1]))
    half = 0.5 * np.minimum(lasts, beside)
    arrives, leaves = edges[:-1] + half, edges[1:] - half
    arrives[0], leaves[-1] = edges[0], edges[-1]
    knots = np.stack([arrives, np.maximum(leaves, arrives)], axis=1).ravel()
    return np.asarray(np.interp(time_s, knots, np.repeat(travel_mm[first], 2)))


# ------------------------------------------------------------------------------------------------
# Which specimens were made and tested alike, so that they differ by scatter alone.


TOLERANCES: Mapping[str, tuple[float, float]] = MappingProxyType(
    {c.name: c.tolerance for c in SPECIMEN_COLUMNS.values() if c.tolerance is not None}
)
"""How far apart, absolute and relative, two specimens of one condition may be."""


def column_levels(name: str, cells: Sequence[float | str | None]) -> tuple[int | str | None, ...]:
    """Return each cell's level; None stays unknown.

    Of texts it is the text. Numbers are counted from the lowest: sorted ones are of one level while
    each is within the column's tolerance of the level's first.
    """
    if any(isinstance(cell, str) for cell in cells):
        return tuple(None if cell is None else str(cell) for cell in cells)
    absolute, relative = TOLERANCES.get(name, (0.0, 1e-9))
    found: list[int | None] = [None] * len(cells)
    level, first = -1, 0.0
    for value, place in sorted((float(v), i) for i, v in enumerate(cells) if v is not None):
        if level < 0 or value - first > max(absolute, relative * abs(first)):
            level, first = level + 1, value
        found[place] = level
    return tuple(found)


def _condition_keys(specimens: Sequence[Specimen]) -> tuple[Hashable, ...]:
    """Return a key for each specimen; equal keys mean made and tested alike.

    Material or design, nominal size, orientation, protocol, rate, temperature, soaking and age
    count, figures within `TOLERANCES`; further columns do not. Two unknowns count as alike.
    Sizes that were measured one by one differ by some per cent and are one size; forces are
    compared on each one's own section.
    """
    levels = [column_levels(name, [getattr(s, name) for s in specimens]) for name in TOLERANCES]
    made = [(s.material, _design_key(s.profile), s.part and id(s.part.response)) for s in specimens]
    tested = [(s.orientation, s.protocol, s.pushed) for s in specimens]
    return tuple(zip(made, tested, *levels, strict=True))


def condition_groups(specimens: Sequence[Specimen]) -> tuple[tuple[int, ...], ...]:
    """Return the places of specimens of one prediction, in order of appearance, singles included.

    Further columns, which no prediction knows, do not count.
    """
    return _grouped(_condition_keys(specimens))


def replicate_groups(
    specimens: Sequence[Specimen], *, with_batch: bool = False
) -> tuple[tuple[int, ...], ...]:
    """Return the places of specimens that are alike, in order of appearance, singles included.

    Further columns count where they are conditions: a laboratory, a treatment. A condition is
    repeated, what is a specimen's own is not: a serial number, the humidity at its test, or who
    happened to test it. So a column counts that leaves `_KEEPING` of the specimens that have a
    replicate with one; columns are asked by their number of levels, the fewest first, each with
    those before that count. Their order in the file says nothing.
    """
    keys: list[Hashable] = list(_condition_keys(specimens))
    least, names = _KEEPING * _repeated(keys), {n for s in specimens for n in s.covariates}
    cells = {name: [s.covariates.get(name) for s in specimens] for name in names}
    for name in sorted(names, key=lambda n: (len(set(cells[n])), n)):
        finer = [*zip(keys, cells[name], strict=True)]
        if _repeated(finer) >= least:
            keys = [*finer]
    if with_batch:
        keys = [(key, s.batch) for key, s in zip(keys, specimens, strict=True)]
    return _grouped(keys)


_KEEPING = 0.8
"""Share of specimens with a replicate that keep one where a column is a condition. Chosen: of pairs
whose column was drawn by chance from two levels half do, of threes three quarters, of fours seven
eighths, whose other comparisons suffice."""


def _repeated(keys: Sequence[Hashable]) -> int:
    """Return how many have an equal."""
    return sum(count for count in Counter(keys).values() if count > 1)


def _grouped(keys: Iterable[Hashable]) -> tuple[tuple[int, ...], ...]:
    groups: dict[Hashable, list[int]] = {}
    for place, key in enumerate(keys):
        groups.setdefault(key, []).append(place)
    return tuple(tuple(group) for group in groups.values())


def _design_key(design: ProfileDesign | None) -> Hashable:
    columns = ("x_mm", "coordinate", "width_mm", "thickness_mm")
    arrays = (getattr(design, name, None) for name in columns)
    return tuple(None if a is None else np.round(a, 6).tobytes() for a in arrays)


# ------------------------------------------------------------------------------------------------
# The conditions at which a palette was measured.


_STANDARD = Reference(
    strain_rate_per_s=0.03,
    **{name: c.usual for name, c in SPECIMEN_COLUMNS.items() if c.usual is not None},
    orientation="x",
)
"""What stands in where a palette does not say at which conditions it was measured. Convention: a
tensile test at some 50 mm/min on a 25 mm gauge, in a laboratory."""


@cache
def stated(*references: Reference) -> Reference:
    """Return every condition as the first reference that states it, or else the standard."""
    known = zip(*map(astuple, (*references, _STANDARD)), strict=True)
    return Reference(*(next(v for v in values if v is not None) for values in known))


# ------------------------------------------------------------------------------------------------
# What a campaign cannot tell, whatever is made of it.


def _limitations_of(palette: Palette, specimens: Sequence[Specimen]) -> Iterator[str]:
    """Yield one sentence a limitation that palette and specimens themselves show."""
    if palette.temperature is not None and any(s.temperature_C is not None for s in specimens):
        yield (
            "the palette's own table of temperatures is not used: a gap with temperature is told "
            "against its laws as they stand, at the temperature they were measured at"
        )
    if len(specimens) == 1:
        yield (
            "one specimen only: no condition varies and there is no scatter to judge a gap by, "
            "so no cause can be named"
        )
    elif all(len(group) == 1 for group in replicate_groups(specimens)):
        yield (
            "one specimen a condition: without replicates the scatter between specimens is "
            "assumed, not measured; repeat at least one condition three times"
        )
    for name, column in SPECIMEN_COLUMNS.items():
        unknown = [s.id for s in specimens if getattr(s, name) is None]
        if unknown and not column.is_size:
            of = "all specimens" if len(unknown) == len(specimens) else named(unknown)
            yield f"{name} is unknown for {of}; it is not taken to be at the palette's reference"
    if pushed := [s for s in specimens if s.pushed]:
        far = max(float(np.max(np.abs(s.strain))) for s in pushed)
        yield (
            f"{named([s.id for s in pushed])}: compressed, to a strain of {far:.2g}; a palette's "
            "laws are fitted to tension and extrapolated there, so that a gap may be the law's own"
        )


def named(ids: Sequence[str], most: int = 6) -> str:
    """Write a list of specimens in words, a long one in short."""
    if len(ids) > most:
        return f"{len(ids)} specimens ({', '.join(ids[:most])}, ...)"
    return f"{'specimen' if len(ids) == 1 else 'specimens'} {', '.join(ids)}"


# ------------------------------------------------------------------------------------------------
# A campaign: the specimens that a lab printed from one palette, and what it measured.


@dataclass(frozen=True, slots=True)
class Campaign:
    """What a lab measured, ready to be compared with what the palette's laws predict.

    Attributes
    ----------
    printer
        Name of the printer.
    covariates
        Names of the columns beyond those that planner knows, in the file's order.
    notes
        The lab's own, from campaign.toml.
    remarks
        What was corrected, assumed or left out in making it; one sentence each.

    Raises
    ------
    FileError
        No specimen, or two of one id.
    """

    name: str
    printer: str
    palette: Palette
    specimens: tuple[Specimen, ...]
    covariates: tuple[str, ...] = ()
    notes: str = ""
    remarks: tuple[str, ...] = ()

    plot = plotted

    @one_line
    def __repr__(self) -> str:
        held = counted(len(self.specimens), "specimen")
        return f"{self.name}: {held}, {self.printer}, {self.palette.name}"

    def __post_init__(self) -> None:
        if not self.specimens:
            raise FileError(f"campaign {self.name}: no specimen with a curve; add some")
        ids = [s.id for s in self.specimens]
        if (double := next((i for i in ids if ids.count(i) > 1), None)) is not None:
            raise FileError(f"campaign {self.name}: two specimens {double!r}; ids must differ")

    @property
    def limitations(self) -> tuple[str, ...]:
        """The remarks, and what the specimens cannot tell whatever is made of them."""
        return (*self.remarks, *_limitations_of(self.palette, self.specimens))

    def specimen(self, id: str) -> Specimen:
        """Return a specimen by its id.

        Raises
        ------
        KeyError
            There is none of that id.
        """
        return {specimen.id: specimen for specimen in self.specimens}[id]

    def replicates(self) -> tuple[tuple[Specimen, ...], ...]:
        """Return the specimens grouped by condition, singles included."""
        groups = replicate_groups(self.specimens)
        return tuple(tuple(self.specimens[i] for i in group) for group in groups)

    def with_modes(self) -> "Campaign":
        """Return the campaign with a column that tells tension from compression, if it has both.

        Laws that were measured in tension may be off in compression alone: a gap may lie along it.
        """
        if len({s.pushed for s in self.specimens}) < 2 or "mode" in self.covariates:
            return self
        told = [
            replace(
                s, covariates={**s.covariates, "mode": "compression" if s.pushed else "tension"}
            )
            for s in self.specimens
        ]
        return replace(self, specimens=tuple(told), covariates=(*self.covariates, "mode"))


# ------------------------------------------------------------------------------------------------
# What each specimen has on every axis that a column of specimens.csv gives.


def axis_columns(campaign: Campaign) -> Mapping[str, tuple[float | str | None, ...]]:
    """Return the columns by name, each with a value a specimen in the campaign's order.

    ``material`` holds the name of a graded bar's design or of a part, ``specimen`` the id; further
    columns stand last under their own names.
    """
    specimens = campaign.specimens
    fields = {"specimen": "id", "material": "made_of"} | {name: name for name in SPECIMEN_COLUMNS}
    return {
        **{name: tuple(getattr(s, field) for s in specimens) for name, field in fields.items()},
        **{n: tuple(s.covariates.get(n) for s in specimens) for n in campaign.covariates},
    }
