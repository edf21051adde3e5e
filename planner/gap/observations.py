"""The observation model: which features of each test are compared, measured and predicted."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from planner.errors import FileError
from planner.gap.campaign import (
    BEYOND_GAUGE,
    LONGEST_FACET,
    Campaign,
    Specimen,
    StrainField,
    condition_groups,
    named,
    replicate_groups,
)
from planner.gap.segments import (
    PATH_STEPS,
    ReplicateTest,
    SpecimenPath,
    forces_N,
    path_of,
    setup_of,
)
from planner.materials.characterise import noise_sd
from planner.numerics import BoolArray, FloatArray, IntArray
from planner.palette import Palette
from planner.simulation.bar import step_places_mm
from planner.simulation.bar_solver import PUSHED_END, Prediction, Setup, law_tables, predict

__all__ = ["BRANCHES", "SIDES", "FeatureTable", "ObservationModel", "seen_shares"]


# ------------------------------------------------------------------------------------------------
# The features that specimens are compared by, one row a feature.


BRANCHES = ("loading", "unloading", "reloading", "hold", "field")
"""Where on its path a specimen was: first loading, any way back, any later loading, a rest at the
end of a loading; "field" is strain along a bar, from image correlation, during the first loading.
"""


_SAME = 1e-3
"""Log ratio below which a chord is the tangent. Numerical: they differ by half of it at most, and
rounding by less than 1e-12."""


@dataclass(frozen=True, slots=True, eq=False)
class FeatureTable:
    """N features of all specimens, ordered by specimen.

    A force F is held as ``asinh(F / (2 s))``: its logarithm where it is far above the floor s, and
    its value over 2 s below, so that relative errors, offsets and zero crossings are all seen. The
    local strains of a field likewise.

    Attributes
    ----------
    specimen : (N,)
        Place in the campaign, rising.
    test : (N,)
        The test of the forward model that predicts it.
    replicates : (N,)
        Number of the specimens, of one test, that differ by scatter alone.
    step : (N,)
        Its step there.
    branch : (N,)
        Index into `BRANCHES`.
    strain : (N,)
        Nominal strain of the whole gauge at that step, its size where it is compressed.
    time_s : (N,)
        Since the test began; for "hold" since the hold began.
    x_mm : (N,)
        Place along the bar, NaN for forces.
    floor : (N,)
        The floor s, in N or a strain.
    measured : (N,)
        The transformed measurement.
    measured_raw : (N,)
        In N, or a strain.
    places : (N,)
        Of a camera in a bin, 0 for forces.
    overlap : (N, b)
        What a bin's places share with those of each bin of its frame: see `Bins.overlap`.
    """

    specimen: IntArray
    test: IntArray
    replicates: IntArray
    step: IntArray
    branch: IntArray
    strain: FloatArray
    time_s: FloatArray
    x_mm: FloatArray
    floor: FloatArray
    measured: FloatArray
    measured_raw: FloatArray
    places: FloatArray
    overlap: FloatArray

    def __len__(self) -> int:
        return len(self.specimen)

    @property
    def path(self) -> FloatArray:
        """How far along its test's steps each feature was read, 0 to 1."""
        return np.asarray(self.step / (PATH_STEPS - 1.0))

    @property
    def is_field(self) -> BoolArray:
        """Which rows are strains along a bar."""
        return np.asarray(self.branch == BRANCHES.index("field"))

    def transformed(self, raw: FloatArray) -> FloatArray:
        """Return forces or strains of these rows, (..., N), on the scale of `measured`."""
        return np.arcsinh(raw / (2.0 * self.floor))

    def raw(self, transformed: FloatArray) -> FloatArray:
        """Return what `transformed` is of."""
        return 2.0 * self.floor * np.sinh(transformed)

    def sensitivity(self, raw: FloatArray) -> FloatArray:
        """Return the derivative of `transformed` by the logarithm of its argument."""
        half = raw / (2.0 * self.floor)
        return half / np.sqrt(1.0 + half**2)

    def test_means(self, values: FloatArray) -> FloatArray:
        """Return values of these rows, (N,), as means over replicates."""
        keys = np.stack([self.test, self.step, self.branch, np.nan_to_num(self.x_mm, nan=-1.0)])
        _, of = np.unique(keys, axis=1, return_inverse=True)
        of = of.ravel()
        return np.asarray((np.bincount(of, values) / np.bincount(of))[of])

    def chord(self, raw: FloatArray) -> FloatArray:
        """Return the mean of `sensitivity` from `raw` to what each specimen's level makes of it.

        With it a factor on forces is a constant times the chord, however large the factor and
        however small the forces. The level is that of all its forces, or strains, together: noise
        of a small one is no gain, and would come out smaller for any that is above 0.
        """
        of = 2 * self.specimen + self.is_field
        sums = np.bincount(of, self.measured_raw * raw), np.bincount(of, raw**2)
        level = np.divide(*sums, out=np.ones_like(sums[0]), where=sums[1] > 0.0)[of]
        ratio = np.log(level, out=np.zeros_like(level), where=level > 0.0)
        rise = self.transformed(raw * np.exp(ratio)) - self.transformed(raw)
        clear = np.abs(ratio) > _SAME
        return np.asarray(np.divide(rise, ratio, out=self.sensitivity(raw), where=clear))


# ------------------------------------------------------------------------------------------------
# What a facet sees of a bar: the mean of the strain over its length.


_POINT_MM = 1e-3
"""Length for a facet of none: a point on a step sees half of either side. Numerical: less than any
slice or pixel."""


def seen_shares(setup: Setup, number: int, x_mm: FloatArray, facet_mm: float) -> FloatArray:
    """Return what facets see of a bar as shares of its slices' strains, (p, slices of the bar).

    Strain is linear between the middles of slices, but for the design's steps: there it jumps.

    Parameters
    ----------
    number
        The bar, among the setup's tests.
    x_mm : (p,)
        Middles of the facets along the gauge; of one that reaches beyond an end, what is on the
        gauge counts.
    facet_mm
        Their length.
    """
    from scipy.interpolate import PPoly  # of a camera's facets alone: slow to import

    own = slice(int(setup.first_slice[number]), int(setup.first_slice[number + 1]))
    middle, length = setup.x_mm[own], setup.length_mm[own]
    edges = np.append(middle - 0.5 * length, middle[-1] + 0.5 * length[-1])
    design, end = setup.designs[number], edges[-1]
    assert design is not None
    steps = step_places_mm(design) * (end / design.length_mm)
    # Slices end at steps: each block between two has knots at its ends and at middles of slices.
    cut = np.searchsorted(middle, np.concatenate([[0.0], steps, [end]]))
    at, of = [], []
    for first, stop in pairwise(cut.tolist()):
        at += [edges[first], *middle[first:stop], edges[stop]]
        of += [first, *range(first, stop), stop - 1]
    value, width = np.eye(len(middle))[of], np.diff(at)
    rises = np.diff(value, axis=0)
    inside = width > 0.0
    strain = PPoly([rises[inside] / width[inside, None], value[:-1][inside]], np.unique(at))
    moved = strain.antiderivative()
    half = 0.5 * max(facet_mm, _POINT_MM)
    begin = np.clip(x_mm - half, 0.0, end - _POINT_MM)
    stop_mm = np.clip(x_mm + half, _POINT_MM, end)
    return np.asarray((moved(stop_mm) - moved(begin)) / (stop_mm - begin)[:, None])


# ------------------------------------------------------------------------------------------------
# Bins of places: features, with what they would be were facets longer, shorter or elsewhere.


_BINS_MOST = 16
"""Of a camera's places. Chosen: a sixteenth of the gauge is less than the longest facet that is
believed."""

_PLACES_LEAST = 3
"""Of a camera in a bin. Chosen: its facets overlap, so that a place tells of its neighbours too."""

_LENGTHS = 6
"""Equally likely lengths of a facet that nobody states, evenly from a point to the longest.
Numerical: steps of 2 % of the gauge, twice what places may be off by."""

SIDES = np.linspace(-2.0, 2.0, 7)
"""Where places may lie, in deviations of where the gauge begins in the camera's picture, of which
`BEYOND_GAUGE` is two. Numerical: steps of 0.2 mm of a gauge of 32 mm, which
is little beside a facet."""


class Bins:
    """Bins of a camera's places along a bar of S slices, by number among the setup's tests.

    Attributes
    ----------
    x_mm : (b,)
        Mean of the places in each.
    of_place : (p,)
        The bin of each place.
    places : (b,)
        How many are in each.
    shares : (L, sides, b, S)
        What a bin sees of the slices' strains: with facets of each likely length, or of the stated
        one, and places aside from where they are said to be by each of `SIDES`.
    overlap : (b, b)
        Mean share of a facet that places of two bins have in common.
    """

    def __init__(self, field: StrainField, setup: Setup, number: int) -> None:
        x, gauge = field.x_mm, float(setup.gauge_mm[number])
        count = max(1, min(_BINS_MOST, len(x) // _PLACES_LEAST))
        self.of_place = np.arange(len(x)) * count // len(x)
        _, first, self.places = np.unique(self.of_place, return_index=True, return_counts=True)

        def binned(rows: FloatArray) -> FloatArray:
            return np.asarray(np.add.reduceat(rows, first) / self.places[:, None])

        if field.facet_mm is None:
            longest = max(LONGEST_FACET * gauge, float(np.median(np.diff(x))))
            lengths = np.linspace(0.0, longest, _LENGTHS).tolist()
        else:
            lengths = [field.facet_mm]
        aside = x + 0.5 * BEYOND_GAUGE * gauge * SIDES[:, None]
        of_length = [seen_shares(setup, number, aside.ravel(), facet) for facet in lengths]
        seen = np.reshape(of_length, (len(lengths), *aside.shape, -1))
        far = np.abs(np.subtract.outer(x, x))
        alike = np.mean([np.maximum(1.0 - far / max(w, _POINT_MM), 0.0) for w in lengths], axis=0)
        self.x_mm = binned(x[:, None])[:, 0]
        self.shares = np.add.reduceat(seen, first, axis=2) / self.places[:, None]
        self.overlap = binned(binned(alike).T)

    def means(self, field: StrainField, path: SpecimenPath, travel_mm: float) -> FloatArray | None:
        """Return the mean strain of each bin at a travel of the first loading.

        Between two frames it is linear in the travel. None without a frame that is near.
        """
        travels, strains = _frames_of(field, path)
        if not np.any(np.abs(travels - travel_mm) <= _NEAR * travel_mm):
            return None
        order = np.argsort(travels, kind="stable")
        within = float(np.clip(travel_mm, travels[order[0]], travels[order[-1]]))
        strain = [np.interp(within, travels[order], at) for at in strains[order].T]
        sums = np.bincount(self.of_place, np.array(strain) * (travel_mm / within))
        return np.asarray(sums / self.places)


_NEAR = 0.1
"""A frame this much of its travel away from an instant still counts, its strains scaled. Chosen:
over a tenth more travel, strains along a bar grow nearly in proportion to it."""


def _frames_of(field: StrainField, path: SpecimenPath) -> tuple[FloatArray, FloatArray]:
    """Return travels, (f,), and strains, (f, p), of the frames taken in the first loading."""
    segment = path.segments[0]
    time = field.time_s - path.shift_s
    inside = (time > segment.begin_s) & (time <= segment.end_s * (1.0 + 1e-9))
    return np.interp(time[inside], path.time_s, path.travel_mm), field.strain[inside]


# ------------------------------------------------------------------------------------------------
# Strains of bins, made up of strains of slices.


class FieldWeights:
    """How strains of slices make up the features that are strains of bins.

    Parameters
    ----------
    seen_at
        Of each frame the first row, the bar's first slice, its bins.

    Attributes
    ----------
    feature, slice_ : (m,)
        Row of the feature table, and slice of the setup.
    weight : (L, sides, m)
        Of a feature's all sum to 1, for facets of each likely length and places: see `Bins.shares`.
        L is 1 where all lengths are stated.
    begins : (F,)
        Where the entries of each feature begin.
    """

    def __init__(self, seen_at: Sequence[tuple[int, int, Bins]]) -> None:
        lengths = max((len(bins.shares) for *_, bins in seen_at), default=1)
        places, weights = [np.zeros((2, 0), np.int64)], [np.zeros((lengths, len(SIDES), 0))]
        for row, first, bins in seen_at:
            of_bin, slice_ = np.nonzero(np.any(bins.shares != 0.0, axis=(0, 1)))
            places.append(np.stack([row + of_bin, first + slice_]))
            own = bins.shares[:, :, of_bin, slice_]
            weights.append(np.broadcast_to(own, (lengths, *own.shape[1:])))
        self.weight = np.concatenate(weights, axis=2)
        self.feature, self.slice_ = np.concatenate(places, axis=1)
        self.begins = np.flatnonzero(np.diff(self.feature, prepend=-1))

    def at_sides(self, sides: IntArray) -> FloatArray:
        """Return the weights for each length with places where they seem to lie, (L, m).

        Parameters
        ----------
        sides : (L, F)
            Of each feature: see `Bins.shares`.
        """
        of_entry = np.repeat(sides, np.diff(self.begins, append=len(self.feature)), axis=1)
        return np.take_along_axis(self.weight, of_entry[:, None], axis=1)[:, 0]


# ------------------------------------------------------------------------------------------------
# The observation model of a campaign: specimens as tests of the forward model, curves as features.


_FORCE_SHARE = 0.1
"""Of a test's largest force: where relative errors go over into absolute ones. Chosen: above what
slack and zeros make of small forces, below most of a curve."""

_STRAIN_FLOOR = 0.01
"""The same of strains along a bar. Chosen: some times the noise of image correlation."""

_BREAK_SHARE = 1.3
"""A test counts up to this many times the elongation at break, in compression to `PUSHED_END`.
Chosen: specimens stronger than the mean are used, and laws are not asked far beyond their tests."""

_ROUNDS = 4
"""In which bars are cut short, at most. Numerical: what is cut where a strain is first too far has
none left; another round sees to the steps' new places."""


class ObservationModel:
    """A campaign as the forward model sees it: n specimens in P tests of T steps.

    Replicates that went the same way, whatever their batch, share one test.

    Attributes
    ----------
    setup
        With no effect.
    laws
        The palette's.
    alone
        What the palette alone predicts.
    tests
        Places in the campaign of each test's specimens.
    replicates
        The same, a test's specimens apart that a further column tells apart.
    test_of : (n,)
        The other way about; -1 for a specimen that is left out.
    table
        The features of all specimens.
    field_weights
        How features that are strains of a bar are made up.
    measured_N : (n, T)
        Force of each specimen on its test's steps, times the test's section over its own; NaN
        for one that is left out.
    sensor_sd_N : (n, T)
        What the noise of the record makes of each of `measured_N`.
    limitations
        What was left out, a sentence each.
    weight : (m,)
        Those of `field_weights` that strains are predicted with.

    Raises
    ------
    FileError
        No specimen loads over enough rows to be compared.
    PaletteError
        A law that nothing can be predicted with.
    """

    def __init__(self, campaign: Campaign) -> None:
        self.laws = law_tables(campaign.palette)
        specimens = campaign.specimens
        paths = _paths(specimens)
        limits = {}
        for place, path in paths.items():
            one = specimens[place]
            share = 1.0 if one.part else _BREAK_SHARE
            strain = PUSHED_END if one.pushed else share * one.strain_end(campaign.palette)
            limits[place] = path.gauge_mm * strain
        past: set[int] = set()
        for _ in range(_ROUNDS):
            short = {place: path.until(limits[place]) for place, path in paths.items()}
            past |= {place for place in paths if short[place].segments != paths[place].segments}
            paths = {place: path for place, path in short.items() if path.segments}
            if not paths:
                raise FileError(
                    f"campaign {campaign.name}: no specimen loads over enough points to be "
                    "compared; check the columns of travel and force"
                )
            tests = _tests(specimens, paths)
            self.setup = setup_of(campaign, tests)
            self.alone = predict(self.setup, self.laws)
            if not (ends := _bar_limits_mm(self.setup, self.alone, campaign.palette)):
                break
            for number, end in ends.items():
                limits |= dict.fromkeys(tests[number].places, end)
        self.measured_N: FloatArray
        self.measured_N, noise = forces_N(specimens, tests)
        sensor = np.array([_sensor_sd_N(specimen.force_N) for specimen in specimens])
        self.sensor_sd_N = sensor[:, None] * noise
        self.tests = tuple(test.places for test in tests)
        self.test_of: IntArray = np.full(len(specimens), -1)
        for number, places in enumerate(self.tests):
            self.test_of[list(places)] = number
        self.replicates = tuple(
            tuple(place for place in group if self.test_of[place] == number)
            for group in replicate_groups(specimens)
            for number in sorted({int(self.test_of[place]) for place in group} - {-1})
        )
        self.table, self.field_weights = self._features(specimens, tests, sensor)
        weights = self.field_weights.weight
        self.weight = weights[len(weights) // 2, len(SIDES) // 2]
        self.limitations = tuple(_limitations(specimens, paths, past))

    def _features(
        self, specimens: Sequence[Specimen], tests: Sequence[ReplicateTest], sensor_sd_N: FloatArray
    ) -> tuple[FeatureTable, FieldWeights]:
        """Return the features of all specimens that a test has, and how fields are made up."""
        setup, alike = self.setup, self.test_of.copy()
        for number, members in enumerate(self.replicates):
            alike[list(members)] = number
        peak_N = np.abs(self.alone.force_N).max(axis=1)
        rows = list[tuple[float, ...]]()
        seen_at = list[tuple[int, int, Bins]]()
        for place, number in sorted((p, k) for k, test in enumerate(tests) for p in test.places):
            test, travel, gauge = tests[number], setup.travel_mm[number], setup.gauge_mm[number]
            floor = max(_FORCE_SHARE * float(peak_N[number]), 2.0 * float(sensor_sd_N[place]))
            for step in test.feature_steps():
                segment = test.segments[test.segment[step]]
                # A hold's time counts from the last step of the segment before.
                first = int(np.argmax(test.segment == test.segment[step]))
                begin_s = test.time_s[first - 1] if segment.kind == "hold" else 0.0
                rows.append((
                    place, number, step, BRANCHES.index(segment.kind), travel[step] / gauge,
                    test.time_s[step] - begin_s, np.nan, floor, self.measured_N[place, step],
                ))  # fmt: skip
            seen = specimens[place].strain_field
            if seen is None or setup.designs[number] is None:
                continue
            bins = Bins(seen, setup, number)
            for step in (test.step_at(0, fraction) for fraction in test.frames):
                if (means := bins.means(seen, test.paths[place], float(travel[step]))) is None:
                    continue
                seen_at.append((len(rows), int(setup.first_slice[number]), bins))
                rows += [
                    (place, number, step, BRANCHES.index("field"), travel[step] / gauge,
                     test.time_s[step], x, _STRAIN_FLOOR, mean)
                    for x, mean in zip(bins.x_mm, means, strict=True)
                ]  # fmt: skip
        places, overlap = np.zeros(len(rows)), np.zeros((len(rows), _BINS_MOST if seen_at else 0))
        for row, _, bins in seen_at:
            here = slice(row, row + len(bins.x_mm))
            places[here], overlap[here, : len(bins.x_mm)] = bins.places, bins.overlap
        numbers = ("specimen", "test", "step", "branch")
        figures = ("strain", "time_s", "x_mm", "floor", "measured_raw")
        columns: dict[str, Any] = dict(zip((*numbers, *figures), np.array(rows).T, strict=True))
        columns |= {name: columns[name].astype(np.int64) for name in numbers}
        table = FeatureTable(
            **columns,
            replicates=alike[columns["specimen"]],
            measured=np.arcsinh(columns["measured_raw"] / (2.0 * columns["floor"])),
            places=places,
            overlap=overlap,
        )
        return table, FieldWeights(seen_at)

    @property
    def peaks_N(self) -> FloatArray:
        """The size of each specimen's largest force, (n, 1)."""
        return np.asarray(np.maximum(np.abs(self.measured_N).max(axis=1, keepdims=True), 1e-12))

    def predicted(self, prediction: Prediction) -> FloatArray:
        """Return what a prediction says of every feature, in N or as a strain, (N,)."""
        table = self.table
        raw = prediction.force_N[table.test, table.step]
        raw[table.is_field] = self.seen(prediction, self.weight)
        return np.asarray(raw)

    def seen(self, prediction: Prediction, weight: FloatArray) -> FloatArray:
        """Return strains of bins, (..., rows of fields), by some of `field_weights`, (..., m)."""
        feature = self.field_weights.feature
        strain = prediction.strain[self.table.step[feature], self.field_weights.slice_]
        return np.asarray(np.add.reduceat(weight * strain, self.field_weights.begins, axis=-1))


def _paths(specimens: Sequence[Specimen]) -> dict[int, SpecimenPath]:
    """Return the paths of specimens that load, those of one prediction on the first one's gauge."""
    paths: dict[int, SpecimenPath] = {}
    for group in condition_groups(specimens):
        loading = {place: path for place in group if (path := path_of(specimens[place]))}
        for place, path in loading.items():
            paths[place] = path.on_gauge(next(iter(loading.values())).gauge_mm)
    return dict(sorted(paths.items()))


def _tests(specimens: Sequence[Specimen], paths: Mapping[int, SpecimenPath]) -> list[ReplicateTest]:
    """Gather specimens that went the same way; each with the first that it agrees with."""
    tests: list[ReplicateTest] = []
    for group in condition_groups(specimens):
        left = [place for place in group if place in paths]
        while left:
            alike = {place: paths[place] for place in left if paths[left[0]].is_like(paths[place])}
            left = [place for place in left if place not in alike]
            tests.append(ReplicateTest(alike, _frame_fractions(specimens, alike)))
    return sorted(tests, key=lambda test: test.places[0])


def _frame_fractions(
    specimens: Sequence[Specimen], paths: Mapping[int, SpecimenPath]
) -> tuple[float, ...]:
    """Return at which fractions of a test's first loading fields are compared: two or none.

    From where the bar is strained by `_STRAIN_FLOOR`.
    """
    end = min(path.segments[0].end_mm for path in paths.values())
    for place, path in paths.items():
        seen, least = specimens[place].strain_field, _STRAIN_FLOOR * path.gauge_mm
        if seen is not None and specimens[place].profile is not None:
            travels = _frames_of(seen, path)[0]
            travels = travels[(travels > least) & (travels <= end * (1.0 + 1e-9))]
            if len(travels):
                middle = int(np.argmin(np.abs(travels - 0.5 * travels[-1])))
                return tuple(sorted({float(travels[i]) / end for i in (middle, -1)}))
    return ()


def _sensor_sd_N(force_N: FloatArray) -> float:
    """Return the noise of a force; of a coarse one, that of rounding, if more."""
    noise = noise_sd(force_N)
    if not len(steps := np.diff(np.unique(force_N))):
        return noise
    digit = float(np.min(steps))
    multiples = steps / digit
    rounded = np.abs(multiples - np.round(multiples)) < 1e-3 * multiples
    return max(noise, digit / np.sqrt(12.0)) if rounded.all() else noise


def _bar_limits_mm(setup: Setup, prediction: Prediction, palette: Palette) -> dict[int, float]:
    """Return, of bars in which a slice is strained too far, the travel up to which none is.

    A part's corners are strained farther than what decides its force: there the mean over shares
    of the force counts.
    """
    at, breaks = np.array([(m.coordinate, m.elongation_at_break) for m in palette.materials]).T
    most = _BREAK_SHARE * np.interp(setup.coordinate, at, breaks)
    most = np.where(prediction.strain < 0.0, PUSHED_END, most)
    reached = np.abs(prediction.strain) / (most * (1.0 + 1e-6))
    limits = {}
    for number, part in enumerate(setup.parts):  # coupons were cut at their limits before
        here = slice(int(setup.first_slice[number]), int(setup.first_slice[number + 1]))
        farthest = reached[:, here].max(axis=1)
        if part is not None:
            farthest = np.sum(part.at(setup.travel_mm[number])[2] * reached[:, here], axis=1)
        if len(late := np.flatnonzero(farthest > 1.0)):
            limits[number] = float(setup.travel_mm[number, : late[0]].max())
    return limits


def _limitations(
    specimens: Sequence[Specimen], paths: Mapping[int, SpecimenPath], past: set[int]
) -> Iterable[str]:
    parts = {place for place, specimen in enumerate(specimens) if specimen.part is not None}
    past = past & set(paths)
    told = {
        "no loading of enough points; left out": set(range(len(specimens))) - set(paths),
        "broke; only what came before is compared": {k for k, p in paths.items() if p.broken},
        f"compared up to {_BREAK_SHARE:g} times the elongation at break, or to a strain of "
        f"-{PUSHED_END:g}, only": past - parts,
        "compared as far as the part was simulated, or its laws go": past & parts,
        "of many cycles those between the first and the last are compared in groups, at the end of "
        "each": {k for k, p in paths.items() if any(s.cycles > 1 for s in p.segments)},
        "the section is unknown; it is taken to be 1 mm2": {
            k for k in set(paths) - parts if specimens[k].section_mm2(np.zeros(1)) is None
        },
    }
    for what, places in told.items():
        if places:
            yield f"{named([specimens[place].id for place in sorted(places)])}: {what}"
