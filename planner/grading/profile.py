"""A palette's stiffness, the target along a field, and the bands of material that meet it."""

import functools
import itertools
import math
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from planner.errors import (
    ArgumentError,
    Caution,
    FileError,
    PaletteError,
    UnknownNameError,
    as_number,
    refused,
)
from planner.formats.tables import read_columns
from planner.formats.units import quantities_of, unit_factor
from planner.glance import brief, counted, html_of, one_line, plotted
from planner.materials.laws import make_law, secant_modulus_MPa, stability
from planner.materials.mixtures import CoefficientModel, left_out_remark, nearest_on, thresholds_of
from planner.numerics import FloatArray, IntArray
from planner.palette import SAME_K, Material, Palette
from planner.printers import Printer, palette_of

if TYPE_CHECKING:
    from planner.plan import Plan, Region

__all__ = [
    "AS_SHOWN",
    "SHAPES",
    "Band",
    "Profile",
    "StiffnessScale",
    "at_temperature",
    "dithered_profile",
    "equal_bands",
    "known_interval",
    "list_materials",
    "natural_bands",
    "profile_of",
    "read_moduli",
    "stated_modulus_MPa",
    "stiffness_scale",
]


# ------------------------------------------------------------------------------------------------
# Target stiffness along a field: modulus as a function of the field value u in 0..1.


_Shape = Literal["log", "linear", "smooth"]
SHAPES = get_args(_Shape)
_LEAST_MPa, _MOST_MPa = 1e-6, 1e7  # far beyond any solid that is printed


@dataclass(frozen=True, slots=True)
class Profile:
    """A target modulus, monotone between knots.

    Parameters
    ----------
    name
        As the user gave it.
    positions
        Knots in 0..1, from 0 to 1, never falling; a position that stands twice is a jump.
    moduli_MPa
        Target at each knot.
    shape
        Between knots a, b with t = 0..1: ``log`` E = Ea (Eb/Ea)^t; ``linear`` E = Ea + (Eb - Ea) t;
        ``smooth`` E = Ea (Eb/Ea)^(3 t^2 - 2 t^3).

    Raises
    ------
    ArgumentError
        Positions that do not run from 0 to 1, moduli that are none, another shape.
    """

    name: str
    positions: tuple[float, ...]
    moduli_MPa: tuple[float, ...]
    shape: _Shape

    __repr__ = brief

    def __post_init__(self) -> None:
        for name in ("positions", "moduli_MPa"):
            of = f"profile {self.name}: {name}"
            given = np.asarray(getattr(self, name), dtype=object).ravel()
            object.__setattr__(self, name, tuple(as_number(v, of) for v in given))
        if self.shape not in SHAPES:
            fault = f"shape is {self.shape!r}; it must be one of {', '.join(SHAPES)}"
            raise ArgumentError(f"profile {self.name}: {fault}")
        if len(self.positions) != len(self.moduli_MPa):
            raise ArgumentError(f"profile {self.name}: it needs a modulus for each position")
        for knot, fault in _faults(self.positions, self.moduli_MPa):
            where = f"knot {knot}: " if knot else ""
            raise ArgumentError(f"profile {self.name}: {where}{fault}")

    def modulus_MPa(self, u: FloatArray | float) -> FloatArray:
        """Return the target at field values `u`; at a jump, the value after it."""
        position = np.asarray(self.positions)
        u = np.asarray(u, dtype=float)
        segment = np.clip(np.searchsorted(position, u, side="right") - 1, 0, len(position) - 2)
        return self._within(segment, u)

    def _within(self, segment: IntArray | int, u: FloatArray | float) -> FloatArray:
        position, modulus = np.asarray(self.positions), np.asarray(self.moduli_MPa)
        begin, length = position[segment], position[np.add(segment, 1)] - position[segment]
        a, b = modulus[segment], modulus[np.add(segment, 1)]
        t = np.clip((u - begin) / np.where(length > 0, length, 1.0), 0.0, 1.0)
        if self.shape == "linear":
            return np.asarray(a + (b - a) * t)
        if self.shape == "smooth":
            t = t * t * (3.0 - 2.0 * t)
        return np.asarray(a * (b / a) ** t)

    def crossings(self, modulus_MPa: float) -> tuple[float, ...]:
        """Return the field values at which the target passes through a modulus, rising.

        Solved in closed form for every shape. A jump across the modulus counts; touching a
        knot from one side without passing does not.
        """
        found = []
        for i, (begin, end) in enumerate(itertools.pairwise(self.positions)):
            a, b = self.moduli_MPa[i], self.moduli_MPa[i + 1]
            if not (a < modulus_MPa <= b or b <= modulus_MPa < a):
                continue
            if self.shape == "linear":
                t = (modulus_MPa - a) / (b - a)
            else:
                t = math.log(modulus_MPa / a) / math.log(b / a)
            if self.shape == "smooth":
                # The root in 0..1 of 3 t^2 - 2 t^3 = y, by the trigonometric form of the cubic.
                t = 0.5 - math.sin(math.asin(max(-1.0, min(1.0, 1.0 - 2.0 * t))) / 3.0)
            found.append(begin + (end - begin) * min(max(t, 0.0), 1.0))
        return tuple(sorted(set(found)))

    def interval_MPa(self, start: float, stop: float) -> tuple[float, float]:
        """Return the lowest and highest target on the open interval (start, stop) of the field."""
        values = []
        for i, (begin, end) in enumerate(itertools.pairwise(self.positions)):
            low, high = max(begin, start), min(end, stop)
            if low < high:
                values += [float(self._within(i, low)), float(self._within(i, high))]
        return min(values), max(values)

    @property
    def jumps(self) -> list[float]:
        """Field values at which the target jumps."""
        return [a for a, b in itertools.pairwise(self.positions) if a == b]

    def stretches(
        self, moduli_MPa: Iterable[float], more: Iterable[float]
    ) -> Iterator[tuple[float, float, tuple[float, float]]]:
        """Divide the field where the target passes moduli, and at more of its values.

        Yields
        ------
        start, stop, target_MPa
            Of each stretch, and the lowest and highest target within.
        """
        cuts = [u for modulus in moduli_MPa for u in self.crossings(modulus)]
        for start, stop in itertools.pairwise(_distinct([*cuts, *more])):
            yield start, stop, self.interval_MPa(start, stop)

    def description(self) -> dict[str, Any]:
        """Return the profile as plan.json holds it."""
        knots = {"positions": list(self.positions), "moduli_MPa": list(self.moduli_MPa)}
        return {"name": self.name, "shape": self.shape, **knots}


def _faults(positions: Sequence[float], moduli_MPa: Sequence[float]) -> Iterator[tuple[int, str]]:
    """Yield the knots, counted from 1, that break the rules of a `Profile`; 0 means all."""
    for k, (position, modulus) in enumerate(zip(positions, moduli_MPa, strict=True)):
        if not 0.0 <= position <= 1.0 or (k and position < positions[k - 1]):
            yield k + 1, f"position is {position:g}; positions rise from 0 to 1"
        if k > 1 and position == positions[k - 2]:
            yield k + 1, f"position {position:g} stands three times; a jump is two rows"
        if not _LEAST_MPa <= modulus <= _MOST_MPa:
            limits = f"it must be above 0, {_LEAST_MPa:g} to {_MOST_MPa:g}"
            yield k + 1, f"modulus_MPa is {modulus:g}; {limits}"
    if len(positions) < 2 or positions[0] != 0.0 or positions[-1] != 1.0:
        yield 0, "it needs rows from position 0 to position 1"


_MODULUS = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?)\s*(\D.*)?", re.IGNORECASE)


def stated_modulus_MPa(text: str, bare: str = "") -> float | None:
    """Return the modulus of "500kPa", "5 N/mm2"; None where the text is none.

    Parameters
    ----------
    text
        As a person writes it.
    bare
        The unit of a figure that has none; by default such a figure is no modulus.
    """
    figure = _MODULUS.fullmatch(text.strip())
    unit = "" if figure is None else figure[2] or bare
    # Nobody means SI's millipascal.
    if figure is None or unit == "mPa" or "stress" not in quantities_of(unit):
        return None
    return float(figure[1]) * unit_factor("stress", unit, where=text)


def read_moduli(
    path: str | Path, moduli_MPa: Mapping[str, float], resolve: Callable[[str], str]
) -> Profile:
    """Read a profile from a CSV file.

    Parameters
    ----------
    path
        Columns ``position`` (0..1, rising; twice for a jump) and ``modulus_MPa`` or ``material``.
        The target is log-linear between rows.
    moduli_MPa
        Modulus of each material by id.
    resolve
        Turns a material's name into its id.

    Raises
    ------
    FileError
        The file cannot be read, or a row breaks the rules; the message names the line.
    """
    path = Path(path)
    file = read_columns(
        path, {"position": None, "modulus_MPa": "stress"}, texts=("material",),
        optional=("modulus_MPa", "material"), others=True,
    )  # fmt: skip
    if ("material" in file.texts) == ("modulus_MPa" in file.numbers):
        raise FileError(
            f"{path.name}: it needs position and one of the columns modulus_MPa and material"
        )
    places = [f"{path.name}, line {line}" for line in file.lines]
    positions = file.numbers["position"].tolist()
    asked = file.numbers.get("modulus_MPa", np.empty(0)).tolist()
    for where, name in zip(places, file.texts.get("material", ()), strict=False):
        with refused(FileError, where, "{}", UnknownNameError):
            asked.append(moduli_MPa[resolve(name)])
    for knot, fault in _faults(positions, asked):
        raise FileError(f"{[path.name, *places][knot]}: {fault}")
    return Profile(path.name, tuple(positions), tuple(asked), "log")


# ------------------------------------------------------------------------------------------------
# A palette as a ladder of stiffness at one working strain.


AS_SHOWN = 5e-3
"""Relative: moduli are shown with three digits, and one that is written so is the one meant."""


@dataclass(frozen=True, slots=True)
class StiffnessScale:
    """The modulus of each material of a palette, softest first, and the model between them.

    Attributes
    ----------
    moduli_MPa
        Secant moduli of the nominal stress at `at_strain`, never falling
        (`CoefficientModel.ladder_MPa`); at its break of a material that breaks before.
    intervals_MPa
        95 % interval of each.
    warming
        What to know of a palette at another temperature, one sentence each.
    """

    palette: Palette
    at_strain: float
    model: CoefficientModel
    moduli_MPa: tuple[float, ...]
    intervals_MPa: tuple[tuple[float, float], ...]
    warming: tuple[str, ...] = ()

    _repr_html_ = html_of
    plot = plotted

    @one_line
    def __repr__(self) -> str:
        return (
            f"{self.palette.name}: {counted(len(self.moduli_MPa), 'material')}, "
            f"{min(self.moduli_MPa):.3g} to {max(self.moduli_MPa):.3g} MPa at strain "
            f"{self.at_strain:g}"
        )

    def modulus_of(self, material_id: str) -> float:
        """Return a material's modulus in MPa, by its id, alias or unique prefix."""
        return self.moduli_MPa[self.palette.materials.index(self.palette.resolve(material_id))]

    def broken(self, material: Material) -> bool:
        """Tell whether a material breaks before the working strain."""
        return material.elongation_at_break < self.at_strain

    def remarks(self, ids: Collection[str] | None = None) -> tuple[str, ...]:
        """Return what a reader of the moduli has to know, a sentence each.

        Which materials break before the working strain, which are read otherwise by others,
        which laws are not stable up to the break, and which cross. What asks for an act is a
        `Caution`.

        Parameters
        ----------
        ids
            The materials whose moduli are shown; all by default.
        """
        shown = [m for m in self.palette.materials if ids is None or m.id in ids]
        broken = [f"{m.id} ({m.elongation_at_break:.3g})" for m in shown if self.broken(m)]
        said: list[str] = []
        if broken:
            past = f"strain {self.at_strain:g} is past the break of {', '.join(broken)}"
            said.append(Caution(f"{past}: stiffness there is the secant modulus at break"))
        readings: dict[str, dict[str, float]] = {}
        for material in shown:
            held = min(self.at_strain, material.elongation_at_break)
            for reading in material.readings:
                other = float(secant_modulus_MPa(make_law(reading.law), held))
                by = readings.setdefault(reading.name, {})
                by[material.id] = other / self.modulus_of(material.id)
        said += (*_unsound(shown), *self.model.remarks(ids))
        if ids is None:
            said += left_out_remark(self.palette)
        said += [
            f"by {name} {_from_to([*by])} {'is' if len(by) == 1 else 'are'} "
            f"{_from_to([f'{ratio:.2g}' for ratio in sorted(by.values())])} times as stiff; "
            "intervals hold both, --palette chooses"
            for name, by in readings.items()
        ]
        return tuple(said)

    def document(self) -> dict[str, Any]:
        """Return the materials and their stiffness as JSON holds them."""
        rows = zip(self.palette.materials, self.moduli_MPa, self.intervals_MPa, strict=True)
        return {
            "schema": 1,
            "palette": self.palette.name,
            "at_strain": self.at_strain,
            "materials": [
                {
                    "id": material.id,
                    "coordinate": material.coordinate,
                    "modulus_MPa": modulus,
                    "modulus_interval_MPa": known_interval(interval),
                    "modulus_at_strain": min(self.at_strain, material.elongation_at_break),
                    "elongation_at_break": material.elongation_at_break,
                    "density_g_cm3": material.density_g_cm3,
                    "deformation": material.deformation,
                    "aliases": list(material.aliases),
                    "colour": material.colour,
                }
                for material, modulus, interval in rows
            ],
            "notes": list(self.remarks()),
        }


def _unsound(materials: Sequence[Material]) -> list[str]:
    """Say at which stretches laws are stable that are not from 0.6 to their break."""
    return [
        Caution(f"{material.id}: its law is stable (Drucker) only at stretch {', '.join(limits)}")
        for material in materials
        if (limits := stability(make_law(material.law), material.elongation_at_break).limits)
    ]


def _from_to(words: Sequence[str]) -> str:
    return " to ".join(dict.fromkeys((words[0], words[-1])))


def known_interval(interval: tuple[float, float]) -> list[float] | None:
    """Return an interval as JSON holds it; null of a palette that states no uncertainty."""
    return list(interval) if interval[0] < interval[1] else None


def list_materials(
    *,
    printer: str | Printer = "connex3",
    palette: str | Path | Palette | None = None,
    at_strain: float = 0.1,
    temperature_C: float | None = None,
) -> StiffnessScale:
    """List a palette's materials from soft to hard, with their stiffness.

    Parameters
    ----------
    printer, palette
        By name, file or value; the printer's default palette if not given.
    at_strain
        Working strain: stiffness is the secant modulus of the nominal stress up to it; at 0 the
        tangent at rest.
    temperature_C
        Of use, where it is not the palette's own; see `at_temperature`.

    Returns
    -------
    StiffnessScale
        Materials are those of its palette.

    Raises
    ------
    ArgumentError
        The strain is below 0, or a hyperelastic material breaks before it.
    UnknownNameError, PaletteError
        No such printer or palette, a palette whose stiffness does not rise, or one that tells
        nothing of temperature.

    Examples
    --------
    >>> round(planner.list_materials(at_strain=0.3).modulus_of("TangoPlus"), 3)  # doctest: +SKIP
    0.349
    """
    chosen, warming = palette_of(palette, printer), tuple[str, ...]()
    if temperature_C is not None:
        chosen, warming = at_temperature(temperature_C, palette=chosen)
    return replace(stiffness_scale(chosen, at_strain), warming=warming)


def at_temperature(
    temperature_C: float,
    *,
    palette: str | Path | Palette | None = None,
    printer: str | Printer = "connex3",
) -> tuple[Palette, tuple[str, ...]]:
    """Return a palette as it is at a temperature, and what is to be known of it.

    ln(stress) falls straight with temperature, by the slope between the two temperatures that a
    grade was tested at. Between tested grades the slope is straight over the coordinate, beyond
    them that of the last. How sure it is adds to the deviations of `Material`.

    Parameters
    ----------
    temperature_C
        Of use.
    palette, printer
        A palette with a table ``[temperature]``, by name, file or value.

    Returns
    -------
    tuple
        The palette, and one sentence each: the factors, what is an extrapolation.

    Raises
    ------
    PaletteError
        The palette tells nothing of temperature, or not at which its laws were measured.

    Examples
    --------
    >>> warm, notes = planner.at_temperature(33, palette="lab.toml")  # doctest: +SKIP
    >>> planner.write_palette(warm, "warm.toml")  # doctest: +SKIP
    """
    chosen, temperature_C = palette_of(palette, printer), as_number(temperature_C, "temperature")
    table, own_C = chosen.temperature, chosen.reference.temperature_C
    if table is None or own_C is None:
        raise PaletteError(
            f"palette {chosen.name}: it cannot be told at {temperature_C:g} degC; it needs "
            "[reference] temperature_C and a table [temperature], which planner fit makes of tests "
            "at two temperatures (column temperature_C)"
        )
    low, high = np.array(table.low_C), np.array(table.high_C)
    m = [material.coordinate for material in chosen.materials]
    warmer = temperature_C - own_C
    log = np.interp(m, table.coordinate, np.log(table.factor) / (high - low)) * warmer
    sd = np.interp(m, table.coordinate, np.array(table.log_sd) / (high - low)) * abs(warmer)
    warmed = [
        material.changed([law.stiffened(factor) for law in material.laws], own)
        for material, factor, own in zip(chosen.materials, np.exp(log).tolist(), sd, strict=True)
    ]
    told = ", ".join(f"{one.id} {np.exp(v):.2g}" for one, v in zip(warmed, log, strict=True))
    notes = [f"at {temperature_C:g} degC, of stress at {own_C:g} degC: {told}"]
    if not low.min() - SAME_K <= temperature_C <= high.max() + SAME_K:
        notes.append(
            Caution(
                f"{temperature_C:g} degC is an extrapolation: grades were tested from "
                f"{low.min():g} to {high.max():g} degC, and through a glass transition stress "
                "falls by more than the straight line says; test at that temperature"
            )
        )
    first, last = table.coordinate[0], table.coordinate[-1]
    if beyond := [one.id for one in warmed if not first <= one.coordinate <= last]:
        notes.append(
            Caution(
                f"{', '.join(beyond)}: beyond the grades tested at two temperatures, m {first:g} "
                f"to {last:g}; the nearest one's factor is taken: an extrapolation"
            )
        )
    use = replace(chosen.reference, temperature_C=temperature_C)
    name = f"{chosen.name}-at-{temperature_C:g}C"
    made = replace(chosen, name=name, materials=tuple(warmed), reference=use)
    return made.as_written(), tuple(notes)


def stiffness_scale(palette: Palette, at_strain: float) -> StiffnessScale:
    """Measure a palette's stiffness at a working strain.

    Raises
    ------
    ArgumentError
        The strain is below 0, or a hyperelastic material breaks before it.
    PaletteError
        The palette's stiffness does not rise with the coordinate at that strain.
    """
    model, at_strain = CoefficientModel(palette), as_number(at_strain, "`at_strain`")
    moduli = model.ladder_MPa(at_strain)
    low, high = model.modulus_interval_MPa(model.coordinates, at_strain)
    intervals = tuple(zip(low.tolist(), np.maximum(high, moduli).tolist(), strict=True))
    return StiffnessScale(palette, at_strain, model, tuple(moduli.tolist()), intervals)


# ------------------------------------------------------------------------------------------------
# Where the material changes: from a target along the field to bands of catalogue materials.


# Positions nearer than this to each other or to an end are one position: far below any printer's
# pixel on any part that fits a tray, far above rounding.
_SAME_POSITION = 1e-9


@dataclass(frozen=True, slots=True)
class Band:
    """A stretch of the field printed in one material.

    Attributes
    ----------
    start, stop
        Field values.
    grade
        Place of the material from soft (0) to hard.
    target_MPa
        Lowest and highest target in the band.
    """

    start: float
    stop: float
    grade: int
    target_MPa: tuple[float, float]

    def joined(self, after: "Band") -> "Band":
        """Return this band and the next one as one, printed in the next one's material."""
        (a, b), (c, d) = self.target_MPa, after.target_MPa
        return Band(self.start, after.stop, after.grade, (min(a, c), max(b, d)))

    def within(self, field_range: tuple[float, float], target: Profile) -> "Band":
        """Return the band with no more of the field, and of its targets, than a part has."""
        # Outwards to a millionth: rounding makes no part end just before its field does.
        start = max(self.start, math.floor(1e6 * field_range[0]) / 1e6)
        stop = min(self.stop, max(start + 1e-6, math.ceil(1e6 * field_range[1]) / 1e6))
        if (start, stop) == (self.start, self.stop) or not start < stop:
            return self
        return Band(start, stop, self.grade, target.interval_MPa(start, stop))


def natural_bands(profile: Profile, moduli_MPa: tuple[float, ...]) -> tuple[Band, ...]:
    """Cut where the catalogue material nearest in log stiffness changes.

    Parameters
    ----------
    profile
        Target along the field.
    moduli_MPa
        Of the catalogue materials, strictly rising.
    """
    cuts = thresholds_of(moduli_MPa).tolist()
    bands = [_band(moduli_MPa, *stretch) for stretch in profile.stretches(cuts, profile.jumps)]
    alike = itertools.groupby(bands, key=lambda band: band.grade)
    return tuple(functools.reduce(Band.joined, group) for _, group in alike)


def equal_bands(profile: Profile, moduli_MPa: tuple[float, ...], count: int) -> tuple[Band, ...]:
    """Cut into equal steps of the field, each the material nearest to its middle in log stiffness.

    The middle is the geometric mean of the lowest and the highest target in the band, which
    makes the largest log error smallest.
    """
    steps = itertools.pairwise(i / count for i in range(count + 1))
    return tuple(_band(moduli_MPa, a, b, profile.interval_MPa(a, b)) for a, b in steps)


def _band(
    moduli_MPa: tuple[float, ...], start: float, stop: float, target_MPa: tuple[float, float]
) -> Band:
    low, high = target_MPa
    return Band(start, stop, int(nearest_on(moduli_MPa, math.sqrt(low * high))), target_MPa)


def _distinct(positions: list[float]) -> list[float]:
    """Return 0, the positions that are not the same as another or an end, rising, and 1."""
    edges = [0.0]
    for u in sorted(positions):
        if u - edges[-1] > _SAME_POSITION and 1.0 - u > _SAME_POSITION:
            edges.append(u)
    return [*edges, 1.0]


# ------------------------------------------------------------------------------------------------
# What a dithered plan comes to along its field: its blend as one material at every place.


_POINTS = 65  # of a stretch; the coordinate between them is off by 1e-4 of a grade at most


def dithered_profile(plan: "Plan", palette: Palette) -> tuple[FloatArray, FloatArray]:
    """Return field values from 0 to 1 and the coordinate at each, linear between.

    Cells are small against the part, so a place behaves as the mixture does, whose modulus is the
    target: it is given the coordinate at which a homogeneous mixture has this modulus. If the
    palette is not the plan's, the modulus is moved with those of the two materials: what counts
    is its place between them, in the logarithm. A value that stands twice is a step.

    Raises
    ------
    FileError
        The plan's blends or profile are not what planner writes.
    UnknownNameError
        The palette lacks a material of the plan.
    PaletteError
        The palette's stiffness does not rise with the coordinate.
    """
    profile, model = profile_of(plan.gradient.profile), CoefficientModel(palette)
    at_strain = min(plan.stiffness.at_strain, model.strain_limit)
    by_stretch = {region.field: region for region in plan.regions}
    field, coordinate = [], []
    for (start, stop), region in sorted(by_stretch.items()):
        u = np.linspace(start, stop, _POINTS)
        field.append(u)
        coordinate.append(_coordinates_of(region, u, profile, model, at_strain))
    return np.concatenate(field), np.concatenate(coordinate)


def _coordinates_of(
    region: "Region", u: FloatArray, profile: Profile, model: CoefficientModel, at_strain: float
) -> FloatArray:
    blend, palette = region.blend, model.palette
    if blend is None:
        return np.full(len(u), palette.resolve(region.printed).coordinate)
    where = f"plan.json: region {region.index}"
    said = "its blend is not that of dithered cells ({}); grade the part again"
    with refused(FileError, where, said, KeyError, TypeError, ValueError):
        lower, upper = (palette.resolve(str(blend[name])).coordinate for name in ("lower", "upper"))
        soft, hard = (float(modulus) for modulus in blend["moduli_MPa"])
        if not 0.0 < soft < hard < np.inf:
            raise ValueError(f"moduli are {soft:g} and {hard:g}, not the softer's and the harder's")
    # At a jump the profile has the value after it: keep within the stretch.
    inner = np.clip(u, u[0] + 1e-9 * (u[-1] - u[0]), u[-1] - 1e-9 * (u[-1] - u[0]))
    t = np.clip(np.log(profile.modulus_MPa(inner) / soft) / np.log(hard / soft), 0.0, 1.0)
    softer, harder = model.modulus_MPa([lower, upper], at_strain).tolist()
    return model.coordinate_for(softer * (harder / softer) ** t, at_strain)


def profile_of(description: Mapping[str, Any]) -> Profile:
    """Return a profile as `Profile.description` tells it.

    Raises
    ------
    FileError
        It is not one that planner writes.
    """
    said = "it is not one that planner writes ({}); grade the part again"
    with refused(FileError, "plan.json: gradient.profile", said, KeyError, TypeError):
        name = str(description["name"])
        knots = tuple(description["positions"]), tuple(description["moduli_MPa"])
        return Profile(name, *knots, description["shape"])
