"""Stiffness between a palette's grades or of two phases, and the blend that has a wanted one."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import InitVar, dataclass, field, replace
from functools import cache, partial
from importlib.resources import files
from typing import NamedTuple, TypeAlias, TypeVar

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from planner.errors import ArgumentError, Caution, PaletteError
from planner.glance import brief
from planner.materials.laws import Law, above_zero, make_law, positive_stretch, secant_modulus_MPa
from planner.numerics import BoolArray, FloatArray, IntArray, normal_quantile
from planner.palette import Palette

__all__ = [
    "Blend",
    "CoefficientModel",
    "TwoPhases",
    "bracketed",
    "gent_modulus_MPa",
    "interpolated",
    "left_out_remark",
    "nearest_on",
    "pchip_at",
    "pchip_slopes",
    "pchip_weights",
    "places_of",
    "thresholds_of",
]


# ------------------------------------------------------------------------------------------------
# A curve through the grades that rises where they rise: piecewise cubics by Fritsch and Butland.
#
# F. N. Fritsch, J. Butland, A method for constructing local monotone piecewise cubic interpolants,
# SIAM J. Sci. Stat. Comput. 5 (1984) 300, doi 10.1137/0905021. With gaps h and secant slopes s of
# the steps before (1) and after (2) a node, its slope is
#
#     d = (w1 + w2) / (w1 / s1 + w2 / s2),  w1 = h1 + 2 h2,  w2 = 2 h1 + h2,
#
# and 0 where s1 and s2 differ in sign. At an end, next to the step 1 and then 2, it is that of the
# parabola through three nodes, ((2 h1 + h2) s1 - h1 s2) / (h1 + h2); 0 where its sign is not s1's,
# and at most 3 s1 where s1 and s2 differ in sign. Two nodes have a straight line.


_Values = TypeVar("_Values", FloatArray, NDArray[np.complex128])


def pchip_slopes(coordinate: FloatArray, values: _Values) -> _Values:
    """Return the slopes at the nodes of the monotone cubic through values.

    Parameters
    ----------
    coordinate : (M,)
        Rising.
    values : (M, ...)
        One row a node. If complex, signs are those of the real parts, so that a tiny imaginary
        part v' i gives the derivative of the slopes along v' (a complex step).
    """
    slopes = np.zeros_like(values)
    gaps = np.diff(coordinate).reshape(-1, *(1,) * (values.ndim - 1))
    steps = np.diff(values, axis=0) / gaps
    if len(steps) < 2:
        slopes[:] = steps.sum(axis=0)
        return slopes
    before, after = steps[:-1], steps[1:]
    w1, w2 = gaps[:-1] + 2.0 * gaps[1:], 2.0 * gaps[:-1] + gaps[1:]
    same = np.sign(before.real) * np.sign(after.real) > 0.0
    denominator = np.where(same, w1 * after + w2 * before, 1.0)
    slopes[1:-1] = np.where(same, (w1 + w2) * before * after / denominator, 0.0)
    for end, k in ((0, (0, 1)), (-1, (-1, -2))):
        (h1, h2), (s1, s2) = gaps[list(k)], steps[list(k)]
        slope = ((2.0 * h1 + h2) * s1 - h1 * s2) / (h1 + h2)
        turns = np.sign(s1.real) != np.sign(s2.real)
        slope = np.where(turns & (np.abs(slope.real) > 3.0 * np.abs(s1.real)), 3.0 * s1, slope)
        slopes[end] = np.where(np.sign(slope.real) == np.sign(s1.real), slope, 0.0)
    return slopes


_Bracket: TypeAlias = tuple[IntArray, IntArray, FloatArray, FloatArray]


def bracketed(coordinate: FloatArray, m: FloatArray) -> _Bracket:
    """Return the nodes below and above places within them, how far between, 0..1, and the gap.

    At a node the share is 0; at the last one both are it.
    """
    lower = np.asarray(np.searchsorted(coordinate, m, side="right") - 1)
    upper = np.minimum(lower + 1, len(coordinate) - 1)
    gap = coordinate[upper] - coordinate[lower]
    return lower, upper, np.asarray((m - coordinate[lower]) / np.where(gap > 0.0, gap, 1.0)), gap


def pchip_weights(t: FloatArray, gap: FloatArray | float) -> tuple[FloatArray, ...]:
    """Return what the rise, and the slopes at both ends, add a share t of the gap on.

    Hermite's: a cubic is its value at t = 0, plus these times (rise, d0, d1).
    """
    rest = 1.0 - t
    return t * t * (3.0 - 2.0 * t), gap * t * rest * rest, -gap * t * t * rest


def pchip_at(values: FloatArray, slopes: FloatArray, bracket: _Bracket) -> FloatArray:
    """Return what the cubics through rows of values are at places, as `bracketed` has them."""
    lower, upper, t, gap = bracket
    rise, d0, d1 = pchip_weights(t, gap)
    found = values[lower] + rise * (values[upper] - values[lower])
    return np.asarray(found + (d0 * slopes[lower] + d1 * slopes[upper]))


# ------------------------------------------------------------------------------------------------
# The place of a mixture: where it lies on the scale that the logarithm of stiffness is even over.
#
# A coordinate counts the mixtures, and a printer's mixtures are not even steps of stiffness: they
# are named by their hardness, and from Shore A 85 to 95 a rubber stiffens as from 40 to 60. So the
# place is the logarithm of the modulus that Gent's relation gives for the nominal hardness; between
# the mixtures whose hardness is known it is the monotone cubic above over m, beyond them it goes
# straight on. A palette that tells no hardness has its coordinates for places.


def gent_modulus_MPa(shore_A: float) -> float:
    """Young's modulus of a rubber from Shore A (Gent, Rubber Chem. Technol. 31, 1958)."""
    return 0.0981 * (56.0 + 7.62336 * shore_A) / (0.137505 * (254.0 - 2.54 * shore_A))


def places_of(hardness: Sequence[tuple[float, float]], coordinate: ArrayLike) -> FloatArray:
    """Return the places of coordinates on the scale of `Palette.hardness`."""
    m = np.asarray(coordinate, dtype=np.float64)
    if not hardness:
        return m
    known, places, slopes = _scale(hardness)
    inside = np.clip(m, known[0], known[-1])
    place = pchip_at(places, slopes, bracketed(known, inside))
    return np.asarray(place + (m - inside) * slopes[np.where(m < known[0], 0, -1)])


def _coordinates_at(hardness: Sequence[tuple[float, float]], place: FloatArray) -> FloatArray:
    """Return the coordinates that have places: the inverse of `places_of`."""
    if not hardness:
        return place
    known, places, slopes = _scale(hardness)
    inside = np.clip(place, places[0], places[-1])
    found = _inverse(known, places, slopes, inside)
    return np.asarray(found + (place - inside) / slopes[np.where(place < places[0], 0, -1)])


def _scale(hardness: Sequence[tuple[float, float]]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the coordinates of known hardness, their places, and the slopes there."""
    known = np.array([m for m, _ in hardness])
    places = np.log([gent_modulus_MPa(shore) for _, shore in hardness])
    slopes = pchip_slopes(known, places)
    # The parabola's slope at an end may be 0, and beyond it nothing would rise.
    steps = np.diff(places) / np.diff(known)
    slopes[[0, -1]] = np.where(slopes[[0, -1]] > 0.0, slopes[[0, -1]], steps[[0, -1]])
    return known, places, slopes


# ------------------------------------------------------------------------------------------------
# Stiffness at any coordinate of a palette, between its catalogue grades too.
#
# At every strain the logarithm of the secant modulus is the monotone cubic above in the place.
# Hence a blend is stress-free at rest, is exact at the grades, lies between its neighbours and
# stiffens with m where the grades do; the course has no kink at a grade. About it stands a Wiener
# process in the place known at the grades, which gives the interval: a Brownian bridge between
# grades that are themselves uncertain.
#
# Laws of grades near to each other cross. Planning needs a ladder that rises at the one strain it
# works at; there a grade that lies below a softer one, but within both intervals, is taken as
# stiff as that one.


_LADDER_STRAINS = 201
_PLACES = (1 / 3, 1 / 2, 2 / 3)  # between grades: the middle, and where slopes weigh most


@dataclass(frozen=True, slots=True)
class Blend:
    """What stands at one coordinate: `fraction` of the way from grade `lower` to `upper`.

    Attributes
    ----------
    lower, upper
        Ids of materials; the same, with fraction 0, at a catalogue grade.
    """

    coordinate: float
    lower: str
    upper: str
    fraction: float


@dataclass(frozen=True, slots=True)
class CoefficientModel:
    """The consistent law of every mixture of a palette.

    Coordinates and strains are numbers or arrays that broadcast; results have their shape.

    Attributes
    ----------
    palette
        As `interpolated` has it.
    laws
        Of the catalogue grades, from soft to hard.
    strain_limit
        Smallest elongation at break of the elastic grades (of all, if none is elastic): up to
        there go the working strains.
    chosen
        Whether the way between grades was chosen already, from more grades than these.

    Raises
    ------
    PaletteError
        A grade is softer than one below it at every working strain, by more than their intervals
        leave open, its stiffness is not positive there, or a law is not stress-free at rest.
    """

    palette: Palette
    laws: tuple[Law, ...] = field(init=False)
    strain_limit: float = field(init=False)
    chosen: InitVar[bool] = False

    __repr__ = brief

    def __post_init__(self, chosen: bool) -> None:
        materials = self.palette.materials
        elastic = [m for m in materials if m.deformation == "elastic"] or materials
        for material in materials:
            if material.law.model == "ogden-thesis":
                raise PaletteError(
                    f"palette {self.palette.name}: material {material.id!r}: law: "
                    f"{material.law.model} is not stress-free at rest; give it under 'published' "
                    "and a stress-free law here"
                )
        if not chosen:
            object.__setattr__(self, "palette", interpolated(self.palette))
        object.__setattr__(self, "laws", tuple(make_law(m.law) for m in materials))
        object.__setattr__(self, "strain_limit", min(m.elongation_at_break for m in elastic))
        _check_ladder(self)

    def ladder_MPa(self, at_strain: float) -> FloatArray:
        """Return the moduli that planning goes by at a strain: no grade's is below a softer one's.

        Raises
        ------
        ArgumentError
            The strain is no working strain.
        PaletteError
            A grade is softer there than one below it, by more than their intervals leave open.
        """
        if not 0.0 <= at_strain <= self.strain_limit:
            raise ArgumentError(
                f"`at_strain` {at_strain:g}: the working strain must be from 0 (at rest) to "
                f"{self.strain_limit:g}, where the first elastic material of palette "
                f"{self.palette.name} breaks; strains are fractions, so 10 % is 0.1"
            )
        if said := _behind(self, np.array([at_strain])).said(self):
            strains = _working_strains(self)
            turned = np.asarray(_behind(self, strains).beyond.any(axis=0))
            good = f"at strains {_runs(strains, ~turned)} it does (`at_strain`); or "
            raise PaletteError(
                f"palette {self.palette.name}: {said} at strain {at_strain:g}; stiffness must rise "
                f"with the coordinate there: {'' if turned.all() else good}{_MEND}"
            )
        return np.maximum.accumulate(self.grade_moduli_MPa(at_strain))

    def remarks(self, ids: Collection[str] | None = None) -> Iterator[str]:
        """Say where laws cross and where mixtures soften, of the materials named, or of all.

        What goes beyond the intervals is a `Caution`.
        """
        names, strains = [m.id for m in self.palette.materials], _working_strains(self)
        shown = {*names} if ids is None else {*ids}
        _, others, lags, beyond = _behind(self, strains)
        pairs = {(k, int(others[k, i])) for k, i in np.argwhere(lags > 0.0).tolist()}
        for grade, other in sorted(pairs):
            if not {names[grade], names[other]} <= shown:
                continue
            turned = (others[grade] == other) & (lags[grade] > 0.0)
            most = 100.0 * -np.expm1(-lags[grade, turned].max())
            softer = (
                f"{names[grade]} is softer than {names[other]} at strains "
                f"{_runs(strains, turned)}, by up to {most:.2g} %"
            )
            if not (turned & beyond[grade]).any():
                yield f"{softer}, within their intervals; planned as equal there"
            else:
                yield Caution(f"{softer}, beyond their intervals: plan at other strains")
        for k, strain in _falling(self):
            if {*names[k : k + 2]} <= shown:
                yield Caution(
                    f"between {names[k]} and {names[k + 1]} the stress of a mixture "
                    f"falls from strain {strain:.3g} on, and theirs not: do not blend them"
                )

    @property
    def coordinates(self) -> FloatArray:
        """Coordinates of the grades, strictly rising."""
        return np.array([m.coordinate for m in self.palette.materials])

    @property
    def breaks(self) -> FloatArray:
        """Elongations at break of the grades."""
        return np.array([m.elongation_at_break for m in self.palette.materials])

    def coordinates_between(self, count: int) -> FloatArray:
        """Return coordinates of all mixtures, in so many steps from grade to grade."""
        c = self.coordinates
        return np.append(np.linspace(c[:-1], c[1:], count, endpoint=False, axis=1), c[-1])

    @property
    def places(self) -> FloatArray:
        """Places of the grades (`places_of`), strictly rising."""
        return places_of(self.palette.hardness, self.coordinates)

    def grade_moduli_MPa(self, at_strain: ArrayLike) -> FloatArray:
        """Return the secant moduli of the grades: one row a grade, soft to hard.

        A grade that breaks before the strain has its secant at its break: beyond it has none.
        """
        return np.stack([*map(secant_modulus_MPa, self.laws, self._held(at_strain))])

    def _held(self, at_strain: ArrayLike) -> FloatArray:
        """Return the strain of each grade, a row each: as asked, or its break."""
        strain = np.asarray(at_strain, dtype=np.float64)
        positive_stretch(1.0 + strain)
        return np.asarray(np.minimum(strain, self.breaks.reshape(-1, *(1,) * strain.ndim)))

    def modulus_MPa(self, coordinate: ArrayLike, at_strain: ArrayLike) -> FloatArray:
        """Return the secant modulus of the nominal stress; that of grades as they hold it.

        Raises
        ------
        ArgumentError
            A coordinate outside the palette, or a strain not above -1.
        """
        return self._between(coordinate, self.grade_moduli_MPa(at_strain))

    def nominal_stress_MPa(self, coordinate: ArrayLike, stretch: ArrayLike) -> FloatArray:
        """Return the nominal stress, of laws that are followed beyond the grades' breaks too.

        Raises
        ------
        ArgumentError
            A coordinate outside the palette, or a stretch not above 0.
        """
        strain = positive_stretch(stretch) - 1.0
        ladder = np.stack([secant_modulus_MPa(law, strain) for law in self.laws])
        return self._between(coordinate, ladder) * strain

    def _between(self, coordinate: ArrayLike, ladder: FloatArray) -> FloatArray:
        """Return the moduli at coordinates, of those of the grades."""
        lower, upper, t, gap = self.bracketed(coordinate)
        # Beyond the working strains a law may lose its logarithm: nan says it.
        with np.errstate(invalid="ignore", divide="ignore"):
            slopes = pchip_slopes(self.places, np.log(ladder))
            softer, harder = _rows(ladder, lower), _rows(ladder, upper)
            rise, d0, d1 = pchip_weights(t, gap)
            more = rise * np.log(harder / softer)
            more += d0 * _rows(slopes, lower) + d1 * _rows(slopes, upper)
        return np.asarray(softer * np.exp(np.where(t > 0.0, more, 0.0)))

    def modulus_interval_MPa(
        self, coordinate: ArrayLike, at_strain: ArrayLike
    ) -> tuple[FloatArray, FloatArray]:
        """Return the interval that holds the moduli of 95 % of prints.

        ln(modulus) is normal about the model's, with variance
        ((1-t) sa + t sb)² + σ² (b - a) t (1-t), t the share of the way between the places a and
        b of the grades beside: the grades' own `Material.modulus_log_sd`, and the bridge of a
        Wiener process whose σ the palette's grades give when each in turn is left out and
        predicted from the others. Neighbours' errors are taken to go together (one source, one
        lab, one reading), so that they do not average out between: at a grade the interval is its
        own, between grades it is wider than their mean. As stiffness rises with the coordinate,
        it ends where the intervals of both grades end. A grade that others read otherwise has an
        interval that holds their intervals too.

        Raises
        ------
        ArgumentError
            As `modulus_MPa`.
        """
        normal = normal_quantile()
        modulus = self.modulus_MPa(coordinate, at_strain)
        variance, own = self.wiener_variance(at_strain), self.own_log_sds(at_strain, normal)
        lower, upper, _ = self.bracket(coordinate)
        ladder = self.grade_moduli_MPa(at_strain)
        rows = [(_rows(side, lower), _rows(side, upper)) for side in own]
        less, more = (np.exp(normal * self.log_sd(coordinate, variance, *ends)) for ends in rows)
        down, up = np.exp(normal * own)
        least = np.minimum(*(_rows(ladder / down, k) for k in (lower, upper)))
        most = np.maximum(*(_rows(ladder * up, k) for k in (lower, upper)))
        return np.maximum(modulus / less, least), np.minimum(modulus * more, most)

    def own_log_sds(self, at_strain: ArrayLike, normal: float) -> FloatArray:
        """Return the grades' standard deviations of ln(modulus) downwards and upwards.

        They are those of `Material.uncertainty` at the strain, else `Material.modulus_log_sd`, or
        so much more that `normal` of them reach what `normal` deviations of another reading reach;
        shape (2, grades, ...).
        """
        moduli, strains = self.grade_moduli_MPa(at_strain), self._held(at_strain)
        sds = np.empty((2, *moduli.shape))
        for k, material in enumerate(self.palette.materials):
            sds[:, k] = material.modulus_log_sd
            if (known := material.uncertainty) is not None and known.strain:
                sds[:, k] = np.interp(strains[k], known.strain, known.log_sd)
            for other in material.readings:
                secant = secant_modulus_MPa(make_law(other.law), strains[k])
                higher = np.log(secant / moduli[k]) / normal
                sds[0, k] = np.maximum(sds[0, k], other.modulus_log_sd - higher)
                sds[1, k] = np.maximum(sds[1, k], other.modulus_log_sd + higher)
        return sds

    def log_sd(
        self, coordinate: ArrayLike, variance: ArrayLike, softer: FloatArray, harder: FloatArray
    ) -> FloatArray:
        """Return the standard deviation of ln(modulus).

        Parameters
        ----------
        variance
            σ², as `wiener_variance` has it.
        softer, harder
            That of the grades below and above, as `own_log_sds` has them of one side.
        """
        _, _, t, gap = self.bracketed(coordinate)
        bridge = np.asarray(variance) * gap * t * (1.0 - t)
        return np.asarray(np.sqrt(((1.0 - t) * softer + t * harder) ** 2 + bridge))

    def wiener_variance(self, at_strain: ArrayLike) -> FloatArray:
        """Return σ², the variance of ln(modulus) a unit of place, at a strain.

        The mean square of what each grade between the others is off their monotone cubic, each
        over the variance that a bridge of σ = 1 has there, h1 h2 / (h1 + h2) of the gaps beside
        it. The grades' own scatter is not taken off, so σ errs on the wide side. Two grades leave
        nothing out, and all that is known is that a mixture lies between them: σ² is step²/3 over
        the gap, so that half-way the variance is that of a uniform place on the step, step²/12.
        One grade has none.
        """
        c, log_moduli = self.places, np.log(self.grade_moduli_MPa(at_strain))
        if len(c) < 3:
            steps = np.diff(log_moduli, axis=0)
            return np.asarray(np.sum(steps**2, axis=0) / (3.0 * (c[-1] - c[0] or 1.0)))
        squares = []
        for k in range(1, len(c) - 1):
            h1, h2 = c[k] - c[k - 1], c[k + 1] - c[k]
            off = log_moduli[k] - _foretold(c, log_moduli, k)
            squares.append(off**2 * (h1 + h2) / (h1 * h2))
        return np.asarray(np.mean(squares, axis=0))

    def bracket(self, coordinate: ArrayLike) -> tuple[IntArray, IntArray, FloatArray]:
        """Return the grades below and above, and how far between them, 0..1.

        At a grade the fraction is 0; at the last one both are it.

        Raises
        ------
        ArgumentError
            A coordinate outside the palette.
        """
        c = self.coordinates
        lower, upper, _, _ = self.bracketed(coordinate)
        gap = np.where(upper > lower, c[upper] - c[lower], 1.0)
        # A place may round to the grade's where the coordinate is a hair below it.
        m = np.asarray(coordinate, dtype=np.float64)
        return lower, upper, np.maximum(m - c[lower], 0.0) / gap

    def bracketed(self, coordinate: ArrayLike) -> _Bracket:
        """Return the grades below and above, how far between their places, and their gap."""
        m = np.asarray(coordinate, dtype=np.float64)
        c = self.coordinates
        allowed = (m >= c[0]) & (m <= c[-1])
        if not allowed.all():
            raise ArgumentError(
                f"coordinate {m[~allowed].flat[0]:g}: palette {self.palette.name} goes from "
                f"{c[0]:g} to {c[-1]:g}"
            )
        return bracketed(self.places, places_of(self.palette.hardness, m))

    def coordinate_for(self, modulus_MPa: ArrayLike, at_strain: float) -> FloatArray:
        """Return the coordinate whose secant modulus is wanted, clamped to the palette.

        The exact inverse of `modulus_MPa` within the range, where grades do not cross.

        Raises
        ------
        ArgumentError
            A modulus is not above 0, or the strain not a working strain.
        PaletteError
            As `ladder_MPa`.
        """
        ladder, c = self.ladder_MPa(at_strain), self.coordinates
        target = np.clip(above_zero(modulus_MPa, _POSITIVE), ladder[0], ladder[-1])
        places, moduli = self.places, np.log(ladder)
        place = _inverse(places, moduli, pchip_slopes(places, moduli), np.log(target))
        at = np.searchsorted(ladder, target)  # of a grade's own modulus, exactly its coordinate
        found = np.clip(_coordinates_at(self.palette.hardness, place), c[0], c[-1])
        return np.asarray(np.where(ladder[at] == target, c[at], found))

    def blend_for(self, modulus_MPa: float, at_strain: float) -> Blend:
        """Return the blend at `coordinate_for` a modulus."""
        return self.blend_at(float(self.coordinate_for(float(modulus_MPa), at_strain)))

    def blend_at(self, coordinate: float) -> Blend:
        """Return what stands at a coordinate.

        Raises
        ------
        ArgumentError
            The coordinate is outside the palette.
        """
        lower, upper, t = self.bracket(coordinate)
        ids = [material.id for material in self.palette.materials]
        return Blend(coordinate, ids[int(lower)], ids[int(upper if t > 0.0 else lower)], float(t))


def _rows(table: FloatArray, row: IntArray) -> FloatArray:
    """Return, of a table with a row a grade, the elements in the rows given; both broadcast."""
    table = table.reshape(len(table), *(1,) * (row.ndim + 1 - table.ndim), *table.shape[1:])
    table, row = np.broadcast_arrays(table, row)
    return np.asarray(np.take_along_axis(table, row[:1], axis=0)[0])


_MEND = "give the materials in the order of their stiffness (`order` of a fit), or leave one out"


class _Behind(NamedTuple):
    """How far grades' laws lie below the stiffest of those softer, (grades, strains) each.

    Attributes
    ----------
    other
        Which one that is; the softest is its own.
    lag
        ln of its modulus over the grade's.
    beyond
        Whether it is the stiffer by more than both 95 % intervals leave open.
    """

    moduli_MPa: FloatArray
    other: IntArray
    lag: FloatArray
    beyond: BoolArray

    def said(self, model: CoefficientModel) -> str:
        """Say which grade is first to lie beyond at all strains, by the first strain; else ""."""
        each = zip(model.palette.materials, self.moduli_MPa[:, 0], strict=True)
        called = [f"{material.id} ({modulus:.4g} MPa)" for material, modulus in each]
        for k in np.flatnonzero(self.beyond.all(axis=1)):
            return f"{called[k]} is not stiffer than {called[self.other[k, 0]]}"
        return ""


def _behind(model: CoefficientModel, strains: FloatArray) -> _Behind:
    """Compare every grade with all that are softer."""
    moduli = model.grade_moduli_MPa(strains)
    normal = normal_quantile()
    down, up = normal * model.own_log_sds(strains, normal)
    other = np.stack([np.argmax(moduli[: max(k, 1)], axis=0) for k in range(len(moduli))])
    lag = np.log(_rows(moduli, other) / moduli)
    beyond = (lag >= 0.0) & (lag >= np.hypot(up, _rows(down, other)))
    beyond[0] = False
    return _Behind(moduli, other, lag, beyond)


def _working_strains(model: CoefficientModel) -> FloatArray:
    return np.linspace(0.0, model.strain_limit, _LADDER_STRAINS)


def _runs(strains: FloatArray, held: BoolArray) -> str:
    """Return the strains at which something holds: "0 to 0.04, 0.3 to 0.72"."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], held, [False]]).astype(np.int8)))
    ends = zip(strains[edges[::2]], strains[edges[1::2] - 1], strict=True)
    return ", ".join(f"{a:.2g} to {b:.2g}" if a < b else f"{a:.2g}" for a, b in ends)


def _check_ladder(model: CoefficientModel) -> None:
    name, strains = model.palette.name, _working_strains(model)
    for material, row in zip(model.palette.materials, model.grade_moduli_MPa(strains), strict=True):
        if (bad := ~((row > 0.0) & np.isfinite(row))).any():
            raise PaletteError(
                f"palette {name}: material {material.id!r}: law: the secant modulus is "
                f"{row[bad][0]:g} MPa at strain {strains[bad][0]:g}; it must be above 0 at all "
                f"working strains, 0 to {model.strain_limit:g}"
            )
    if said := _behind(model, strains).said(model):
        raise PaletteError(
            f"palette {name}: {said} at any working strain, 0 to {model.strain_limit:g}, beyond "
            f"what their intervals leave open: {_MEND}"
        )


def _falling(model: CoefficientModel) -> Iterator[tuple[int, float]]:
    """Yield the softer of two whose mixtures' stress falls where theirs rises, and from where on.

    The slope at a grade weighs the one beyond it up to -0.3: where that stiffens while it draws
    near, and the two between hardly rise, a mixture's stress may fall.
    """
    strains = _working_strains(model)
    between = model.coordinates[:-1] + np.outer(_PLACES, np.diff(model.coordinates))
    stress = model.nominal_stress_MPa(between[..., None], 1.0 + strains)
    rising = np.diff(model.grade_moduli_MPa(strains) * strains) > 0.0
    rising &= strains[1:] <= model.breaks[:, None]  # beyond its break nothing is known of a grade
    bad = (np.diff(stress) <= 0.0).any(axis=0) & rising[:-1] & rising[1:]
    for k in np.flatnonzero(bad.any(axis=1)).tolist():
        yield k, float(strains[1 + np.argmax(bad[k])])


# ------------------------------------------------------------------------------------------------
# What each way between grades is worth: each inner grade is left out and predicted by the others.


_LEFT_OUT_STRAINS = 41


def left_out_errors(palette: Palette) -> dict[str, float]:
    """Return how far grades left out in turn are off what the others predict, by way.

    ``hardness`` and ``coordinate`` are the monotone cubic of ln(secant modulus), which at one
    strain is that of ln(stress), over places by hardness and over m.

    Parameters
    ----------
    palette
        Of four materials or more.

    Returns
    -------
    dict
        Root mean square error of nominal stress up to the grade's break over its largest, the mean
        of the inner grades; hardness only where the palette tells it.
    """
    materials = palette.materials
    m = np.array([material.coordinate for material in materials])
    ways = {"hardness": places_of(palette.hardness, m)} if palette.hardness else {}
    ways["coordinate"] = m
    off: dict[str, list[float]] = {way: [] for way in ways}
    breaks = [material.elongation_at_break for material in materials]
    strains = np.linspace(0.0, breaks[1:-1], _LEFT_OUT_STRAINS, axis=1)[:, 1:]
    rows = zip(materials, [np.minimum(strains, end) for end in breaks], strict=True)
    with np.errstate(invalid="ignore", divide="ignore"):  # of a law that is refused later
        every = np.log([secant_modulus_MPa(make_law(one.law), e) for one, e in rows])
    for k, strain in enumerate(strains, start=1):
        logs, own = every[:, k - 1], np.exp(every[k, k - 1]) * strain
        for way, x in ways.items():
            error = np.exp(_foretold(x, logs, k)) * strain - own
            off[way].append(float(np.sqrt(np.mean(error**2)) / own.max()))
    return {way: float(np.mean(values)) for way, values in off.items()}


def interpolated(palette: Palette) -> Palette:
    """Return a palette as mixtures are made of it: without its hardness where that loses.

    It loses where grades, left out in turn, are predicted better over m. With three grades or
    fewer too little is left out to tell.
    """
    if palette.hardness and len(palette.materials) > 3:
        off = left_out_errors(palette)
        if off["hardness"] > off["coordinate"]:
            return replace(palette, hardness=()).known_by(palette.sha256)
    return palette


def _foretold(x: FloatArray, rows: FloatArray, k: int) -> FloatArray:
    """Return what the monotone cubic through all other rows, at places x, is at row k's place."""
    others, h1, h2 = np.delete(rows, k, axis=0), x[k] - x[k - 1], x[k + 1] - x[k]
    bracket = np.array(k - 1), np.array(k), h1 / (h1 + h2), h1 + h2
    return pchip_at(others, pchip_slopes(np.delete(x, k), others), bracket)


def left_out_remark(palette: Palette) -> Iterator[str]:
    """Say what the ways between grades are worth on a palette; nothing of three grades or fewer."""
    if len(palette.materials) > 3:
        used, error = min(left_out_errors(palette).items(), key=lambda one: one[1])
        yield (
            f"between grades a cubic over {'hardness' if used == 'hardness' else 'm'} is used: a "
            f"grade that is left out it misses by {100 * error:.2g} % of its stress"
        )


# ------------------------------------------------------------------------------------------------
# From a wanted stiffness back to a place or a grade.


def thresholds_of(ladder_MPa: ArrayLike) -> FloatArray:
    """Return the geometric means of neighbours on a ladder of rising moduli."""
    moduli = np.asarray(ladder_MPa, dtype=np.float64)
    return np.sqrt(moduli[:-1] * moduli[1:])


def nearest_on(ladder_MPa: ArrayLike, modulus_MPa: ArrayLike) -> IntArray:
    """Return the rung nearest in log stiffness on a ladder, of equal ones the first.

    Raises
    ------
    ArgumentError
        A modulus is not above 0.
    """
    ladder = np.asarray(ladder_MPa, dtype=np.float64)
    rung = np.searchsorted(thresholds_of(ladder), above_zero(modulus_MPa, _POSITIVE), side="left")
    return np.asarray(np.searchsorted(ladder, ladder[rung], side="left"))


def _inverse(
    nodes: FloatArray, values: FloatArray, slopes: FloatArray, wanted: FloatArray
) -> FloatArray:
    """Return where a rising cubic through nodes has the values wanted, clamped to its range."""
    wanted = np.clip(wanted, values[0], values[-1])
    lower, upper, _, _ = bracketed(values, wanted)
    gaps, rises = np.diff(nodes, append=nodes[-1]), np.diff(values, append=values[-1])
    ahead = np.append(slopes[1:], 0.0)
    square = 3.0 * rises - gaps * (2.0 * slopes + ahead)
    cube = gaps * (slopes + ahead) - 2.0 * rises
    cubics = np.stack([gaps * slopes, square, cube])
    t = _rising_root((wanted - values[lower]).ravel(), cubics, lower.ravel())
    return np.minimum(nodes[lower] + t.reshape(wanted.shape) * gaps[lower], nodes[upper])


_BISECTIONS = 60
"""Numerical: halves of 1 that reach below a rounding of it."""


def _rising_root(value: FloatArray, cubics: FloatArray, piece: IntArray) -> FloatArray:
    """Return where, 0 to 1, rising cubics without constant term have values of their range.

    By Newton's method within brackets. What has not settled is taken on alone: at an end without
    slope the root is multiple, and only the brackets get there.

    Parameters
    ----------
    cubics : (3, M)
        Coefficients of t, t² and t³.
    piece : (n,)
        Which cubic each value, (n,), is of.
    """
    rise = cubics.sum(axis=0)[piece]
    found = value / np.where(rise > 0.0, rise, 1.0)
    todo, t = np.arange(len(value)), found.copy()
    low, high = np.zeros_like(t), np.ones_like(t)
    for _ in range(_BISECTIONS):
        a1, a2, a3 = cubics[:, piece[todo]]
        excess = t * (a1 + t * (a2 + t * a3)) - value[todo]
        low, high = np.where(excess <= 0.0, t, low), np.where(excess >= 0.0, t, high)
        with np.errstate(invalid="ignore", divide="ignore"):
            better = t - excess / (a1 + t * (2.0 * a2 + t * 3.0 * a3))
        better = np.where((better >= low) & (better <= high), better, 0.5 * (low + high))
        found[todo] = better
        on = np.abs(better - t) > 1e-15
        if not on.any():
            break
        todo, t, low, high = todo[on], better[on], low[on], high[on]
    return found


_POSITIVE = "modulus {:g} MPa: it must be above 0 and finite"


# ------------------------------------------------------------------------------------------------
# The modulus of a mixture of two phases, both incompressible: bounds, and that of cells of both
# dealt by the blue-noise tile.
#
# Elastomers change their volume a thousand times less readily than their shape, and the laws that
# planning uses are incompressible throughout: Poisson's ratio is 1/2, the bulk modulus infinite,
# and E = 3 µ for the phases and for what they make. Hashin and Shtrikman's bounds on µ are then
# bounds on E.
#
# Dealt cells have the modulus E-^(1-w) E+^w between these bounds E- and E+, with w from a table
# that `benchmarks/calibrate_dither.py` solves on the very pattern, corners bevelled. Phases are
# taken as linear, each with its secant modulus at the working strain; strains within a cell of two
# elastomers differ, so at finite strain this is an approximation.


_NODES = 513


@cache
def _dither_table() -> dict[str, FloatArray]:
    """Return where the modulus of dealt cells lies between the bounds.

    Returns
    -------
    volume : (V,)
        Volume fractions of the harder phase, rising.
    contrast : (C,)
        Harder modulus over softer one, rising.
    weight : (V, C)
        w at each volume and contrast.
    error : (C,)
        Largest relative error of a modulus, of any direction, at each contrast. Most of it is that
        cells are bevelled along one diagonal of their cubes, in which the pattern is stiffest.
    """
    path = files("planner.materials") / "dithered.json"
    return {name: np.array(v) for name, v in msgspec.json.decode(path.read_bytes()).items()}


@dataclass(frozen=True, slots=True)
class TwoPhases:
    """Moduli of two phases, the softer first, and of what they make at volume fractions, 0 to 1.

    A fraction is that of the harder one.
    """

    soft_MPa: float
    hard_MPa: float

    def voigt_MPa(self, fraction: ArrayLike) -> FloatArray:
        """Return the arithmetic mean: phases side by side along the load, equal strain."""
        f = np.asarray(fraction, dtype=np.float64)
        return np.asarray((1.0 - f) * self.soft_MPa + f * self.hard_MPa)

    def reuss_MPa(self, fraction: ArrayLike) -> FloatArray:
        """Return the harmonic mean: layers across the load, equal stress."""
        f = np.asarray(fraction, dtype=np.float64)
        return np.asarray(1.0 / ((1.0 - f) / self.soft_MPa + f / self.hard_MPa))

    def reuss_share(self, compliance_per_MPa: ArrayLike) -> FloatArray:
        """Return the share of the harder layer at which layers have a mean compliance, 0 to 1.

        The inverse of `reuss_MPa`; compliances beyond those of the layers are clamped to them.
        """
        wanted = np.asarray(compliance_per_MPa, dtype=np.float64)
        share = (1.0 / self.soft_MPa - wanted) / (1.0 / self.soft_MPa - 1.0 / self.hard_MPa)
        return np.clip(share, 0.0, 1.0)

    def hashin_shtrikman_MPa(self, fraction: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return the bounds of any isotropic mixture (Hashin and Shtrikman 1963)."""
        f, soft, hard = np.asarray(fraction, dtype=np.float64), self.soft_MPa, self.hard_MPa
        return _mixed(soft, hard, f, 0.4 / soft), _mixed(hard, soft, 1.0 - f, 0.4 / hard)

    def dithered_MPa(self, fraction: ArrayLike) -> FloatArray:
        """Return the modulus of dealt cells.

        Beyond the table's largest contrast its last column is used, and the bounds alone are sure.
        """
        f = np.asarray(fraction, dtype=np.float64)
        low, high = self.hashin_shtrikman_MPa(f)
        w = np.interp(f, _dither_table()["volume"], self._at_contrast("weight"))
        return np.asarray(low ** (1.0 - w) * high**w)

    def dithered_fraction(self, modulus_MPa: ArrayLike) -> FloatArray:
        """Return the fraction at which dealt cells have a modulus.

        The inverse of `dithered_MPa` within 1e-6: it rises with the modulus, from exactly 0 at the
        softer phase's to exactly 1 at the harder one's, and stays there beyond.
        """
        volume = np.linspace(0.0, 1.0, _NODES)
        ladder = np.log(self.dithered_MPa(volume))
        wanted = np.log(np.asarray(modulus_MPa, dtype=np.float64))
        found = np.interp(wanted, ladder, volume)
        slope = np.interp(found, volume, np.gradient(ladder, volume))  # and a step of Newton's
        off = np.log(self.dithered_MPa(found)) - wanted
        found = np.clip(found - off / slope, 0.0, 1.0)
        found = np.where(wanted <= np.log(self.soft_MPa), 0.0, found)
        return np.asarray(np.where(wanted >= np.log(self.hard_MPa), 1.0, found))

    @property
    def dither_error(self) -> float:
        """Largest relative error of `dithered_MPa`; beyond the largest contrast it is not known."""
        return float(self._at_contrast("error"))

    def _at_contrast(self, name: str) -> FloatArray:
        """Return figures of the table at the phases' contrast, or at the end nearest to it."""
        table, contrast = _dither_table(), np.log(self.hard_MPa / self.soft_MPa)
        at = partial(np.interp, contrast, np.log(table["contrast"]))
        return np.asarray(np.apply_along_axis(at, -1, table[name]))


def _mixed(matrix: float, other: float, share: FloatArray, of: float) -> FloatArray:
    """Return matrix + share / (1 / (other - matrix) + (1 - share) of), without dividing by zero."""
    step = other - matrix
    return np.asarray(matrix + share * step / (1.0 + (1.0 - share) * of * step))
