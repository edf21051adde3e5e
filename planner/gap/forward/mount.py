"""Mount a campaign: its specimens as tests of the forward model, its curves as features."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from planner.arrays import FloatArray
from planner.errors import FileError
from planner.gap.campaign import Campaign
from planner.gap.conditions import replicate_groups
from planner.gap.features import FeatureTable
from planner.gap.forward.assemble import MountedTest, assemble, mean_section_mm2, mean_times_s
from planner.gap.forward.feature_rows import feature_table
from planner.gap.forward.field_bins import FieldWeights, frame_travels_mm
from planner.gap.forward.law_tables import LawTables, law_tables
from planner.gap.forward.legs import Leg, Path, path_of
from planner.gap.forward.read_off import forces_N
from planner.gap.forward.setup import Setup
from planner.gap.forward.solve import Prediction, predict
from planner.gap.forward.steps import agree, cut, walk_of
from planner.gap.limitations import named
from planner.gap.specimen import Specimen
from planner.materials.rupture import noise_sd
from planner.palette import Palette

__all__ = ["Mounted", "mount"]

STRAIN_MOST = 2.5
BREAK_SHARE = 1.3
"""A test counts up to a strain of `STRAIN_MOST` and to this many times the elongation at break."""

_ROUNDS = 4


@dataclass(frozen=True, slots=True, eq=False)
class Mounted:
    """A campaign as the forward model sees it: n specimens in P tests of T steps.

    Attributes
    ----------
    setup
        With no effect.
    laws
        The palette's.
    tests
        Places in the campaign of each test's specimens.
    test_of : (n,)
        The other way about; -1 for a specimen that is left out.
    legs
        Of each test, the mean of its specimens'.
    leg_of_step : (P, T)
        Index into `legs`.
    table
        The features of all specimens.
    field_weights
        How features that are strains of a bar are made up.
    measured_N : (n, T)
        Force of each specimen on its test's steps, times the test's section over its own; NaN
        for one that is left out.
    sensor_sd_N : (n,)
        Noise of the force, point to point.
    limitations
        What was left out, a sentence each.
    """

    setup: Setup
    laws: LawTables
    tests: tuple[tuple[int, ...], ...]
    test_of: np.ndarray[tuple[int], np.dtype[np.int64]]
    legs: tuple[tuple[Leg, ...], ...]
    leg_of_step: np.ndarray[tuple[int, int], np.dtype[np.int64]]
    table: FeatureTable
    field_weights: FieldWeights
    measured_N: FloatArray
    sensor_sd_N: FloatArray
    limitations: tuple[str, ...]

    def predicted(self, prediction: Prediction) -> FloatArray:
        """Return what a prediction says of every feature, in N or as a strain, (N,)."""
        table, weights = self.table, self.field_weights
        raw = prediction.force_N[table.test, table.step]
        if len(weights.feature):
            strain = prediction.strain[table.step[weights.feature], weights.slice_]
            sums = np.bincount(weights.feature, weights.weight * strain, minlength=len(table))
            raw = np.where(table.is_field, sums, raw)
        return np.asarray(raw)


def mount(campaign: Campaign) -> Mounted:
    """Mount a campaign.

    Replicates that went the same way, whatever their batch, share one test.

    Raises
    ------
    FileError
        No specimen loads over enough rows to be compared.
    PaletteError
        A law that nothing can be predicted with.
    """
    laws = law_tables(campaign.palette)
    specimens = campaign.specimens
    found = {place: path_of(s) for place, s in enumerate(specimens)}
    paths = {place: path for place, path in found.items() if path is not None}
    limits = {place: _coupon_limit_mm(specimens[place], campaign.palette) for place in paths}
    past: set[int] = set()
    for _ in range(_ROUNDS):
        short = {place: cut(path, limits[place]) for place, path in paths.items()}
        past |= {place for place in paths if _shorter(short[place], paths[place])}
        paths = {place: path for place, path in short.items() if path.legs}
        if not paths:
            raise FileError(
                f"campaign {campaign.name}: no specimen loads over enough points to be compared; "
                "check the columns of travel and force"
            )
        tests = _tests(specimens, paths)
        setup = assemble(campaign, tests, paths)
        prediction = predict(setup, laws)
        ends = _bar_limits_mm(setup, prediction, campaign.palette)
        if not ends:
            break
        limits.update(
            (place, end) for number, end in ends.items() for place in tests[number].places
        )
    measured, sensor = _measured(specimens, tests, paths)
    table, weights = feature_table(
        specimens, tests, paths, setup, measured, sensor, prediction.force_N.max(axis=1)
    )
    test_of = np.full(len(specimens), -1)
    for number, test in enumerate(tests):
        test_of[list(test.places)] = number
    return Mounted(
        setup=setup,
        laws=laws,
        tests=tuple(test.places for test in tests),
        test_of=test_of,
        legs=tuple(test.walk.legs for test in tests),
        leg_of_step=np.stack([test.walk.leg for test in tests]),
        table=table,
        field_weights=weights,
        measured_N=measured,
        sensor_sd_N=sensor,
        limitations=tuple(_limitations(specimens, paths, past)),
    )


def _tests(specimens: Sequence[Specimen], paths: Mapping[int, Path]) -> list[MountedTest]:
    """Gather replicates that went the same way; each with the first that it agrees with."""
    tests: list[MountedTest] = []
    for group in replicate_groups(specimens):
        alike: list[list[int]] = []
        for place in group:
            if place not in paths:
                continue
            for others in alike:
                first = others[0]
                same_gauge = np.isclose(
                    specimens[place].gauge_mm, specimens[first].gauge_mm, rtol=2e-3
                )
                if same_gauge and agree(paths[first], paths[place]):
                    others.append(place)
                    break
            else:
                alike.append([place])
        tests += [_test(specimens, paths, places) for places in alike]
    return sorted(tests, key=lambda test: test.places[0])


def _test(
    specimens: Sequence[Specimen], paths: Mapping[int, Path], places: Sequence[int]
) -> MountedTest:
    members = [paths[place] for place in places]
    end = min(path.legs[0].end_mm for path in members)
    frames: tuple[float, ...] = ()
    for place in places:
        seen = specimens[place].strain_field
        if seen is not None and specimens[place].profile is not None:
            travels = frame_travels_mm(seen, paths[place], end)
            if len(travels):
                middle = int(np.argmin(np.abs(travels - 0.5 * travels[-1])))
                frames = tuple(sorted({float(travels[i]) / end for i in (middle, -1)}))
                break
    walk = walk_of(members, frames)
    return MountedTest(tuple(places), walk, mean_times_s(members, walk), frames)


def _measured(
    specimens: Sequence[Specimen], tests: Iterable[MountedTest], paths: Mapping[int, Path]
) -> tuple[FloatArray, FloatArray]:
    """Return each specimen's force on its test's steps, and the noise of its record."""
    tests = list(tests)
    forces = np.full((len(specimens), len(tests[0].time_s)), np.nan)
    sensor = np.zeros(len(specimens))
    for test in tests:
        group = [specimens[place] for place in test.places]
        at = np.linspace(0.0, group[0].gauge_mm, 65)
        mean = mean_section_mm2(group, at)
        for place, specimen in zip(test.places, group, strict=True):
            own = specimen.section_mm2(at)
            # In series the compliances add up, so the ratio that counts is of 1 / area.
            ratio = 1.0 if own is None else float(np.mean(1.0 / own) / np.mean(1.0 / mean))
            forces[place] = ratio * forces_N(paths[place], test.walk)
    for place, specimen in enumerate(specimens):
        sensor[place] = _sensor_sd_N(specimen.force_N)
    return forces, sensor


def _sensor_sd_N(force_N: FloatArray) -> float:
    """Return the noise of a force; of a coarse one, that of rounding, if more."""
    noise = noise_sd(force_N)
    steps = np.diff(np.unique(force_N))
    if not len(steps):
        return noise
    digit = float(np.min(steps))
    multiples = steps / digit
    rounded = np.abs(multiples - np.round(multiples)) < 1e-3 * multiples
    return max(noise, digit / np.sqrt(12.0)) if rounded.all() else noise


def _break_strain(palette: Palette, coordinate: FloatArray) -> FloatArray:
    return np.interp(
        coordinate,
        [m.coordinate for m in palette.materials],
        [m.elongation_at_break for m in palette.materials],
    )


def _coupon_limit_mm(specimen: Specimen, palette: Palette) -> float:
    strain = STRAIN_MOST
    if specimen.material is not None:
        strain = min(strain, BREAK_SHARE * palette.resolve(specimen.material).elongation_at_break)
    return strain * specimen.gauge_mm


def _bar_limits_mm(setup: Setup, prediction: Prediction, palette: Palette) -> dict[int, float]:
    """Return, of bars in which a slice is strained too far, the travel up to which none is."""
    most = np.minimum(STRAIN_MOST, BREAK_SHARE * _break_strain(palette, setup.coordinate))
    over = prediction.strain > most * (1.0 + 1e-6)
    limits = {}
    for number in np.flatnonzero(setup.is_bar).tolist():
        here = slice(int(setup.first_slice[number]), int(setup.first_slice[number + 1]))
        late = np.flatnonzero(over[:, here].any(axis=1))
        if len(late):
            limits[number] = float(setup.travel_mm[number, : late[0]].max())
    return limits


def _shorter(one: Path, other: Path) -> bool:
    return len(one.legs) < len(other.legs) or one.legs != other.legs


def _limitations(
    specimens: Sequence[Specimen], paths: Mapping[int, Path], past: set[int]
) -> Iterable[str]:
    def ids(places: Iterable[int]) -> str:
        return named([specimens[place].id for place in sorted(places)])

    lost = set(range(len(specimens))) - set(paths)
    if lost:
        yield f"{ids(lost)}: no loading of enough points; left out"
    broken = {place for place, path in paths.items() if path.broken}
    if broken:
        yield f"{ids(broken)}: broke; only what came before is compared"
    if past & set(paths):
        yield (
            f"{ids(past & set(paths))}: compared up to a strain of {STRAIN_MOST:g} and "
            f"{BREAK_SHARE:g} times the elongation at break only, and in so many legs as steps "
            "can resolve"
        )
    bare = {
        place
        for place in paths
        if specimens[place].section_mm2(np.array([0.5 * specimens[place].gauge_mm])) is None
    }
    if bare:
        yield f"{ids(bare)}: the section is unknown; it is taken to be 1 mm2"
