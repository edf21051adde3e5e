"""What bands are printed in, nearest or blended; as shells and regions."""

import functools
import hashlib
import itertools
import math
import operator
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from planner.cutting.pieces import Pieces, split
from planner.errors import ArgumentError
from planner.fields.basic import Field
from planner.formats.mesh_file import decode_stl, encode_stl, stl_holds
from planner.formats.threemf import Constituent, composite_name, mixed_colour
from planner.glance import in_percent
from planner.grading.printability import CutPart, print_checks
from planner.grading.profile import Band, Profile, StiffnessScale, equal_bands, natural_bands
from planner.materials.mixtures import TwoPhases
from planner.mesh.mesh import Mesh, compact, weld
from planner.numerics import FloatArray, as_point
from planner.palette import Palette
from planner.plan import Check, Finding, Region, Shell
from planner.printers import Printer

__all__ = [
    "BandDesign",
    "BlendSegment",
    "Printed",
    "band_design",
    "blend_segments",
    "blended",
    "catalogue_material",
    "error_text",
    "region_of",
    "shells_of",
]


# ------------------------------------------------------------------------------------------------
# What a piece of a part is printed in: a catalogue material, or a mixture of two.


@dataclass(frozen=True, slots=True)
class Printed:
    """A material to print in.

    Attributes
    ----------
    name
        Goes into file names.
    material
        Id of a catalogue material; None for a mixture.
    constituents
        Of a mixture: catalogue materials and their shares.
    """

    name: str
    material: str | None
    coordinate: float
    modulus_MPa: float
    interval_MPa: tuple[float, float]
    density_g_cm3: float | None
    colour: str
    operator_name: str
    constituents: tuple[Constituent, ...] = ()


def catalogue_material(scale: StiffnessScale, grade: int, machine: Printer) -> Printed:
    """Return a catalogue material by its place from soft to hard."""
    material = scale.palette.materials[grade]
    return Printed(
        name=material.id,
        material=material.id,
        coordinate=material.coordinate,
        modulus_MPa=scale.moduli_MPa[grade],
        interval_MPa=scale.intervals_MPa[grade],
        density_g_cm3=material.density_g_cm3,
        colour=material.colour,
        operator_name=machine.operator_name(material.id),
    )


def _mixture(scale: StiffnessScale, modulus_MPa: float, machine: Printer) -> Printed:
    """Return the mixture of two neighbouring materials that has a modulus.

    A modulus beyond the palette is clamped to it. The share of the harder material is how far the
    mixture's coordinate lies between the two: the palette knows no other measure.
    """
    place = scale.model.coordinate_for(modulus_MPa, scale.at_strain)
    lower, upper, fraction = scale.model.bracket(place)
    # Shares as their names tell them, so that one name is one mixture.
    share = round(float(fraction), 3)
    if share in (0.0, 1.0):
        return catalogue_material(scale, int(upper if share == 1.0 else lower), machine)
    pair = scale.palette.materials[int(lower)], scale.palette.materials[int(upper)]
    coordinate = pair[0].coordinate + share * (pair[1].coordinate - pair[0].coordinate)
    low, high = scale.model.modulus_interval_MPa(coordinate, scale.at_strain)
    shares = round(1.0 - share, 3), share
    parts = tuple(
        Constituent(material.id, material.colour, part)
        for material, part in zip(pair, shares, strict=True)
    )
    known = [
        m.density_g_cm3 * part for m, part in zip(pair, shares, strict=True) if m.density_g_cm3
    ]
    return Printed(
        name=composite_name(parts),
        material=None,
        coordinate=coordinate,
        modulus_MPa=float(scale.model.modulus_MPa(coordinate, scale.at_strain)),
        interval_MPa=(float(low), float(high)),
        density_g_cm3=sum(known) if len(known) == len(pair) else None,
        colour=mixed_colour(parts),
        operator_name=" + ".join(
            f"{100 * part.share:.1f} % {machine.operator_name(part.name)}" for part in parts
        ),
        constituents=parts,
    )


# ------------------------------------------------------------------------------------------------
# Bands of the part as shells to print and regions to report.


def shells_of(
    pieces: Pieces, printed: Sequence[Printed], scale: StiffnessScale, machine: Printer, name: str
) -> Iterator[Shell]:
    """Unite the pieces of each material or mixture into one shell set, from soft to hard.

    Shells are what readers of their files find.
    """
    names = np.array([what.name for what in printed])
    occupied = pieces.volumes_mm3 > 0.0
    used_ones = {what.name: what for what, some in zip(printed, occupied, strict=True) if some}
    mixed = (part.name for what in used_ones.values() for part in what.constituents)
    ids = {*mixed, *(what.material for what in used_ones.values() if what.material)}
    resins = _resins_of(scale.palette, machine, ids)
    from_soft = sorted(used_ones.values(), key=lambda what: what.coordinate)
    for number, what in enumerate(from_soft, start=1):
        faces = pieces.shell_faces(np.flatnonzero(names == what.name))
        used, faces = compact(faces, len(pieces.vertices))
        vertices = pieces.vertices.take(used, axis=0)
        header = f"{name} {what.operator_name} unit=mm"
        file = f"stl/{name}__{number:02d}_{what.name}.stl"
        data = encode_stl(vertices, faces, header)
        if not stl_holds(data, vertices, faces):
            vertices, faces = weld(decode_stl(data, file).astype(np.float32))
        yield Shell(
            material=what.name,
            operator_name=what.operator_name,
            colour=what.colour,
            file=file,
            vertices=vertices,
            faces=faces,
            header=header,
            sha256=hashlib.sha256(data).hexdigest(),
            properties={
                "coordinate": f"{what.coordinate:.9g}",
                "modulus_MPa": f"{what.modulus_MPa:.9g}",
                "at_strain": f"{scale.at_strain:.9g}",
                "operator_name": what.operator_name,
                "base_resins": ", ".join(resins),
            },
            constituents=what.constituents,
        )


def _resins_of(palette: Palette, machine: Printer, ids: Collection[str]) -> tuple[str, ...]:
    """Return what materials of a palette are jetted from, those of the ids given.

    As the palette says; else the printer's own resins for materials that it knows, and the others
    are resins themselves: a lab's own.
    """
    if palette.base_resins:
        return palette.base_resins
    made = {
        called.casefold()
        for name in machine.palettes
        for material in machine.palette(name).materials
        for called in (material.id, *material.aliases)
    }
    used = (m for m in palette.materials if m.id in ids)
    foreign = tuple(m.id for m in used if made.isdisjoint(map(str.casefold, (m.id, *m.aliases))))
    return foreign if len(foreign) == len({*ids}) else (*machine.base_resins, *foreign)


def region_of(
    band: Band, what: Printed, volume_mm3: float, bounds_mm: FloatArray, shells: Sequence[Shell]
) -> Region:
    """Report a band that is printed in one material or mixture.

    Its number is that of its shell, from soft to hard, as in the shell's file name.
    """
    low, high = band.target_MPa
    number = [shell.material for shell in shells].index(what.name)
    shell, blend = shells[number], dict[str, Any]()
    if what.material is None:
        lower, upper = what.constituents
        blend = {"kind": "mix", "name": what.name, "lower": lower.name, "upper": upper.name}
        blend["fraction"] = upper.share
    return Region(
        index=number + 1,
        material=what.material,
        coordinate=what.coordinate,
        field=(band.start, band.stop),
        target_modulus_MPa=(low, high),
        modulus_MPa=what.modulus_MPa,
        modulus_interval_MPa=what.interval_MPa,
        error=(what.modulus_MPa / high - 1.0, what.modulus_MPa / low - 1.0),
        volume_mm3=volume_mm3,
        mass_g=what.density_g_cm3 and volume_mm3 * what.density_g_cm3 / 1000.0,
        bounds_mm=(as_point(bounds_mm[0]), as_point(bounds_mm[1])),
        file=shell.file,
        sha256=shell.sha256,
        triangles=len(shell.faces),
        blend=blend or None,
    )


def blended(
    region: Region, scale: StiffnessScale, pair: tuple[int, int], modulus_MPa: float,
    error: tuple[float, float], estimate_error: float, kind: str, says: Mapping[str, Any],
) -> Region:  # fmt: skip
    """Say of a region what its material comes to together with another.

    The interval holds a print's modulus with 95 % probability. The materials' errors go together,
    as everywhere in planning: the wider of their intervals is taken, either way, and the relative
    error of the estimate is added to it.

    Parameters
    ----------
    pair
        Places of both materials from soft to hard.
    error
        Of the modulus against the highest and the lowest target.
    kind, says
        Of the blend, and more that the plan says of it.
    """
    ends = [(scale.moduli_MPa[k], *scale.intervals_MPa[k]) for k in pair]
    less = max(own / low for own, low, _ in ends) * (1.0 + estimate_error)
    more = max(high / own for own, _, high in ends) * (1.0 + estimate_error)
    lower, upper = (scale.palette.materials[k].id for k in pair)
    interval = modulus_MPa / less, modulus_MPa * more
    blend = {"kind": kind, "lower": lower, "upper": upper, **says}
    return replace(
        region, modulus_MPa=modulus_MPa, modulus_interval_MPa=interval, error=error, blend=blend
    )


# ------------------------------------------------------------------------------------------------
# Stretches of the field over which the target stays between the same two materials.


_SAME = 1e-9  # relative: a target this near to a material's modulus is that


@dataclass(frozen=True, slots=True)
class BlendSegment:
    """A stretch of the field between two neighbouring materials.

    Attributes
    ----------
    start, stop
        Field values.
    lower, upper
        Places of the materials from soft (0) to hard; the same where the target is one material's
        modulus, or beyond the softest or the hardest.
    target_MPa
        Lowest and highest target.
    ends_MPa
        Targets where it begins and ends.
    run
        How many jumps of the target lie before it.
    """

    start: float
    stop: float
    lower: int
    upper: int
    target_MPa: tuple[float, float]
    ends_MPa: tuple[float, float]
    run: int


def blend_segments(profile: Profile, moduli_MPa: tuple[float, ...]) -> tuple[BlendSegment, ...]:
    """Divide the field where the target passes the modulus of a material.

    Parameters
    ----------
    moduli_MPa
        Of the catalogue materials, strictly rising.
    """
    found = []
    for start, stop, target_MPa in profile.stretches(moduli_MPa, profile.jumps):
        lower, upper = _neighbours(*target_MPa, moduli_MPa)
        inner = 1e-9 * (stop - start)  # a jump's own value is that after it
        ends = [float(profile.modulus_MPa(u)) for u in (start, stop - inner)]
        run = sum(jump <= start + inner for jump in profile.jumps)
        found.append(BlendSegment(start, stop, lower, upper, target_MPa, (ends[0], ends[1]), run))
    return tuple(found)


def _neighbours(low: float, high: float, moduli_MPa: tuple[float, ...]) -> tuple[int, int]:
    place = int(np.searchsorted(moduli_MPa, math.sqrt(low * high)))
    lower, upper = max(place - 1, 0), min(place, len(moduli_MPa) - 1)
    for grade in (lower, upper):
        if all(math.isclose(e, moduli_MPa[grade], rel_tol=_SAME) for e in (low, high)):
            return grade, grade
    return lower, upper


# ------------------------------------------------------------------------------------------------
# Thinner bands of two materials in turn, as a laminate in series along the gradient.


_THINNEST = 1e-9  # of the field: a share below is none


@dataclass(frozen=True, slots=True)
class Laminate:
    """Two bands, one of either material, or one where the share is 0 or 1.

    Attributes
    ----------
    start, stop
        Field values.
    pair
        Places of the two materials from soft to hard.
    share
        Of the length along the field that is of the harder one.
    modulus_MPa
        In series: the harmonic mean.
    """

    start: float
    stop: float
    pair: tuple[int, int]
    share: float
    modulus_MPa: float


def laminated(
    profile: Profile, along: Sequence[BlendSegment], moduli_MPa: tuple[float, ...], periods: int
) -> tuple[tuple[Band, Laminate | None], ...]:
    """Divide each stretch between two materials into periods that stretch as the target does.

    Under one force a period elongates by the mean of the target's compliance, exactly: the
    materials lie in series. Each period begins with the material that the one before ended with;
    but where the gradient begins and ends lies the material nearer to the target there, because
    fields are held at their ends: beyond a distance of 3 mm, say, all of the part is the last band.

    Returns
    -------
    tuple of (Band, Period)
        Bands along the field, and the period each belongs to; None outside transitions.
    """
    found: list[tuple[Band, Laminate | None]] = []
    for stretch in along:
        if stretch.lower == stretch.upper:
            band = Band(stretch.start, stretch.stop, stretch.lower, stretch.target_MPa)
            found.append((band, None))
            continue
        edges = np.linspace(stretch.start, stretch.stop, periods + 1).tolist()
        pair = stretch.lower, stretch.upper
        soft_MPa, hard_MPa = (moduli_MPa[grade] for grade in pair)
        layers, middle_MPa = TwoPhases(soft_MPa, hard_MPa), math.sqrt(soft_MPa * hard_MPa)
        begins_hard, ends_hard = (end > middle_MPa for end in stretch.ends_MPa)
        for start, stop in itertools.pairwise(edges):
            target_MPa = profile.interval_MPa(start, stop)
            share = _share(profile, layers, start, stop)
            period = Laminate(start, stop, pair, share, float(layers.reuss_MPa(share)))
            if not found:
                hard_first = begins_hard
            elif stretch is along[-1] and stop == stretch.stop:
                hard_first = not ends_hard
            else:
                hard_first = found[-1][0].grade == stretch.upper
            middle = start + (share if hard_first else 1.0 - share) * (stop - start)
            in_turn = reversed(pair) if hard_first else pair
            for grade, low, high in zip(in_turn, (start, middle), (middle, stop), strict=True):
                if high - low > _THINNEST:
                    found.append((Band(low, high, grade, target_MPa), period))
    return tuple(found)


def _share(profile: Profile, layers: TwoPhases, start: float, stop: float) -> float:
    """Return the share of the harder material that has the mean of the target's compliance."""
    # Between knots the target is smooth, and Gauss' rule of 8 nodes exact to rounding.
    nodes, weights = np.polynomial.legendre.leggauss(8)
    knots = [start, *(u for u in profile.positions if start < u < stop), stop]
    compliance = 0.0
    for low, high in itertools.pairwise(knots):
        u = 0.5 * (low + high) + 0.5 * (high - low) * nodes
        compliance += float(0.5 * (high - low) * (weights @ (1.0 / profile.modulus_MPa(u))))
    share = float(layers.reuss_share(compliance / (stop - start)))
    if not _THINNEST < share * (stop - start) < stop - start - _THINNEST:
        return float(math.floor(share + 0.5))
    return share


# ------------------------------------------------------------------------------------------------
# Bands of true mixtures, for printers that jet them.


_MOST_MIXTURES = 99
"""Each is a file of its own."""

_MOST_KEPT = _MOST_MIXTURES // 2  # of moduli that the target keeps: the others are steps between

_STEP = 1.2  # of the modulus from mixture to mixture: within 10 % of the target


def _mixed_bands(
    profile: Profile, scale: StiffnessScale, count: int | None, machine: Printer
) -> tuple[tuple[Band, ...], tuple[Printed, ...]]:
    """Cut where the mixture changes, and say what each band is printed in.

    Parameters
    ----------
    count
        Equal steps of the field; by default steps of the modulus of up to 20 %, both ends of the
        gradient among them, and every modulus that the target keeps over a stretch.

    Raises
    ------
    ArgumentError
        More than 99 bands.
    """
    if count is None:
        ladder = _rungs_MPa(profile, scale.moduli_MPa[0], scale.moduli_MPa[-1])
        bands = natural_bands(profile, ladder)
        moduli = [ladder[band.grade] for band in bands]
    else:
        if count > _MOST_MIXTURES:
            raise ArgumentError(
                f"`blend` mix `bands` {count}: each mixture is a file of its own; up to "
                f"{_MOST_MIXTURES} are possible"
            )
        bands = equal_bands(profile, scale.moduli_MPa, count)
        moduli = [math.sqrt(band.target_MPa[0] * band.target_MPa[1]) for band in bands]
    pairs = zip(bands, (_mixture(scale, modulus, machine) for modulus in moduli), strict=True)
    # Neighbours may come to one mixture, shares being kept to 0.1 %.
    alike = [list(group) for _, group in itertools.groupby(pairs, key=operator.itemgetter(1))]
    joined = (functools.reduce(Band.joined, (band for band, _ in group)) for group in alike)
    return tuple(joined), tuple(group[0][1] for group in alike)


def _rungs_MPa(profile: Profile, softest_MPa: float, stiffest_MPa: float) -> tuple[float, ...]:
    """Return the moduli that mixtures are made for, rising."""
    knots = list(itertools.pairwise(zip(profile.positions, profile.moduli_MPa, strict=True)))
    kept = {MPa for (begin, MPa), (end, same) in knots if begin < end and MPa == same}
    # Where there are too many for a mixture each, they share: steps of 20 % are what all can have.
    kept = {*profile.interval_MPa(0.0, 1.0), *(kept if len(kept) <= _MOST_KEPT else ())}
    inside = np.unique(np.clip(sorted(kept), softest_MPa, stiffest_MPa)).tolist()
    found = inside[:1]
    for high in inside[1:]:
        if high > found[-1] * 1.001:
            steps = max(1, math.ceil(math.log(high / found[-1]) / math.log(_STEP) - 1e-9))
            found += np.geomspace(found[-1], high, steps + 1).tolist()[1:]
    return tuple(found)


# ------------------------------------------------------------------------------------------------
# Bands along a field: what to cut a part along, and what each piece is printed in.


@dataclass(frozen=True, slots=True, eq=False)
class BandDesign:
    """Bands along a gradient, each of one material or mixture.

    Attributes
    ----------
    target
        Along the gradient.
    bands, printed
        Field and target of each, and what it is printed in.
    says
        What a plan says of how targets between two materials are met, if not by the nearer one.
    periods
        Of each band, where two materials take turns; else empty.
    """

    target: Profile
    bands: tuple[Band, ...]
    printed: tuple[Printed, ...]
    says: Mapping[str, object] | None = None
    periods: tuple[Laminate | None, ...] = ()

    @property
    def levels(self) -> FloatArray:
        """Values of the field between bands."""
        return np.array([band.start for band in self.bands[1:]])

    def cut(self, mesh: Mesh, along: Field, pitch_mm: float, within_mm: float) -> Pieces:
        """Divide the part."""
        return split(mesh, along, self.levels, pitch_mm=pitch_mm, within_mm=within_mm)

    def regions(
        self, pieces: Pieces, shells: Sequence[Shell], scale: StiffnessScale
    ) -> Iterator[Region]:
        """Yield each band that holds any of the part, and what turns come to in series."""
        turns = self.periods or (None,) * len(self.bands)
        held = zip(pieces.volumes_mm3.tolist(), pieces.bounds_mm, strict=True)
        each = zip(self.bands, self.printed, turns, held, strict=True)
        for band, what, turn, (volume_mm3, bounds_mm) in each:
            if not volume_mm3 > 0.0:
                continue
            if turn is None or turn.share in (0.0, 1.0):
                held_of = band.within(pieces.field_range, self.target)
                yield region_of(held_of, what, volume_mm3, bounds_mm, shells)
            else:
                low, high = band.target_MPa
                error = (turn.modulus_MPa / high - 1.0, turn.modulus_MPa / low - 1.0)
                says = {"field": [turn.start, turn.stop], "share": turn.share}
                region = region_of(band, what, volume_mm3, bounds_mm, shells)
                yield blended(region, scale, turn.pair, turn.modulus_MPa, error, 0.0, "bands", says)

    def _fewer(self, along: Field, machine: Printer) -> str:
        """Say what makes thin bands thicker: equal ones, so many as have room along the field."""
        if self.periods:
            return "take fewer periods (--blend bands:N)"
        span_mm, count = along.description().get("span_mm"), len(self.bands)
        # Equal already, but for cuts that were moved by a tenth of a band at most on either side.
        if np.ptp([band.stop - band.start for band in self.bands]) < 0.41 / count:
            count -= 1
        if isinstance(span_mm, float):
            count = min(count, int(span_mm / machine.minimum_feature_mm))
        return f"take --bands {max(count, 1)} or fewer"

    def held(
        self, part: CutPart, shells: Sequence[Shell], scale: StiffnessScale, machine: Printer
    ) -> tuple[dict[str, Check], tuple[Finding, ...], list[str]]:
        """Hold the pieces against the printer."""
        cures = self._fewer(part.field, machine), "a gentler profile there"
        names = [what.name for what in self.printed]
        own = replace(part, levels=self.levels, names=names, shells=shells, cures=cures)
        return print_checks(own, machine)


def band_design(
    kind: str, target: Profile, scale: StiffnessScale, machine: Printer, *, count: int | None,
    periods: int,
) -> BandDesign:  # fmt: skip
    """Cut where the nearest material changes, or the mixture, or where two take turns.

    Parameters
    ----------
    kind
        ``nearest``, ``mix`` or ``bands``.
    count
        Equal steps of the field, with ``nearest`` and ``mix``.
    periods
        Of each transition, with ``bands``.

    Raises
    ------
    ArgumentError
        Too many bands, each of a mixture of its own.
    """
    moduli = scale.moduli_MPa
    if kind == "mix":
        return BandDesign(target, *_mixed_bands(target, scale, count, machine), {"kind": "mix"})
    says, turns = None, ()
    if kind == "bands":
        laminate = laminated(target, blend_segments(target, moduli), moduli, periods)
        bands, turns = zip(*laminate, strict=True)
        says = {"kind": "bands", "periods": periods}
    else:
        bands = equal_bands(target, moduli, count) if count else natural_bands(target, moduli)
    printed = tuple(catalogue_material(scale, band.grade, machine) for band in bands)
    return BandDesign(target, bands, printed, says, turns)


def error_text(ratio: float) -> str:
    """Say a ratio as an error: in per cent where it is as many above as below, or as a factor."""
    return in_percent(ratio - 1.0) if ratio < 1.1 else f"a factor of {ratio:.3g}"
