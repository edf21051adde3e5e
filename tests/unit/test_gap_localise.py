"""Where a gap lies: made along one axis of a synthetic campaign, found there, and nowhere else."""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
import scipy.linalg
import scipy.stats
from scipy.sparse import csr_array

from planner.gap.campaign import Campaign, Specimen
from planner.gap.diagnosis import Location
from planner.gap.localise import Whitening, _groups, localise
from planner.gap.noise import SpecimenNoise
from planner.gap.observations import FeatureTable
from planner.numerics import FloatArray
from planner.printers import load_printer
from planner.simulation.bar import ProfileDesign

PALETTE = load_printer("connex3").palette()
GRADES = ("FLX9740", "FLX9750", "FLX9760", "FLX9770", "FLX9785")
LEVEL, SLOPE, WANDER, OWN, FIELD = 0.03, 0.012, 0.006, 0.003, 0.03
CALIBRATION, BATCH = 0.05, 0.012
STRAINS = np.array([0.03, 0.06, 0.1, 0.16, 0.23, 0.32, 0.41, 0.5])
RAMP = np.linspace(0.0, 10.0, 9)[1:]
STEP_BAR = ProfileDesign(
    "B2", np.array([0.0, 12.5, 12.5, 25.0]), np.array([1.0, 1.0, 4.0, 4.0]) / 6.0
)


@dataclass(frozen=True)
class Case:
    """A campaign, its features, and the noise that they have."""

    campaign: Campaign
    table: FeatureTable
    noise: SpecimenNoise
    shared: FloatArray
    log_sd: float

    @property
    def whitening(self) -> Whitening:
        return Whitening(self.noise, self.noise.whiten(self.shared), self.log_sd)

    def value(self, column: str) -> FloatArray:
        """A column's numbers, one a feature; NaN where unknown."""
        of = [getattr(s, column, s.covariates.get(column)) for s in self.campaign.specimens]
        return np.array([np.nan if v is None else v for v in of], dtype=float)[self.table.specimen]

    def text(self, column: str) -> Any:
        of = [getattr(s, column, s.covariates.get(column)) for s in self.campaign.specimens]
        return np.array([str(v) for v in of])[self.table.specimen]

    @property
    def force(self) -> FloatArray:
        """One for a force, zero for a local strain."""
        return (~self.table.is_field).astype(float)

    def scatter(self, rng: np.random.Generator, *, scale: float = 1.0, df: float = 0) -> FloatArray:
        """Noise as declared; with `df`, each specimen's own of Student's t and unit variance."""
        pieces = []
        for block in self.noise.blocks:
            own = np.linalg.cholesky(block) @ rng.standard_normal(len(block))
            if df:
                own *= np.sqrt((df - 2.0) / rng.chisquare(df))
            pieces.append(scale * own)
        return np.concatenate(pieces) + self.shared @ rng.standard_normal(self.shared.shape[1])

    def where(self, residual: FloatArray) -> tuple[Location, ...]:
        return localise(self.campaign, self.table, residual, self.whitening)


def specimen(number: int, material: str | None = "FLX9760", **changes: Any) -> Specimen:
    conditions: dict[str, Any] = {
        "rate_mm_s": 1.0, "temperature_C": 23.0, "soak_h": 0.0, "age_days": 9.0,
        "orientation": "x", "protocol": "monotonic", "batch": "AB"[number % 2],
        "width_mm": 6.0, "thickness_mm": 2.0,
    } | changes  # fmt: skip
    return Specimen(f"S{number}", RAMP, RAMP, RAMP, 25.0, material=material, **conditions)


def star(replicates: int = 3, **covariates: Callable[[int], Any]) -> list[Specimen]:
    """Five grades at the reference and three away from it in one condition each, by threes."""
    tests: list[dict[str, Any]] = [{"material": grade} for grade in GRADES]
    tests += [{"temperature_C": t} for t in (15.0, 33.0)]
    tests += [{"rate_mm_s": 20.0}, {"protocol": "cyclic"}, {"protocol": "relaxation"}]
    found: list[Specimen] = []
    for test in tests:
        for _ in range(replicates):
            k = len(found)
            further = {name: of(k) for name, of in covariates.items()}
            found.append(specimen(k, **test, covariates=further))
    return found


def alike(specimens: Sequence[Specimen]) -> list[int]:
    keys = [
        (s.material, s.profile and s.profile.name, s.rate_mm_s, s.temperature_C, s.soak_h,
         s.age_days, s.orientation, s.protocol, s.width_mm)
        for s in specimens
    ]  # fmt: skip
    return [keys.index(k) for k in keys]


def case_of(specimens: Sequence[Specimen], *, log_sd: float = 0.15) -> Case:
    """Eight forces in loading; four more on the way back, or in the hold; strains along bars."""
    rows: dict[str, list[float]] = {k: [] for k in ("specimen", "branch", "strain", "time", "x")}
    for i, s in enumerate(specimens):
        figures = [(0, e, e * 25.0, np.nan) for e in STRAINS]
        if s.protocol == "cyclic":
            figures += [(1, e, 25.0, np.nan) for e in STRAINS[6:1:-1]]
        if s.protocol == "relaxation":
            figures += [(3, 0.5, t, np.nan) for t in (1.0, 3.0, 10.0, 30.0, 100.0)]
        if s.profile is not None:
            figures += [(4, e, e * 25.0, x) for e in (0.25, 0.5) for x in np.arange(1.0, 25.0, 2.0)]
        for name, column in zip(
            ("branch", "strain", "time", "x"), zip(*figures, strict=True), strict=True
        ):
            rows[name] += column
        rows["specimen"] += [i] * len(figures)
    of = np.array(rows["specimen"])
    n = len(of)
    big = np.full(n, 100.0)
    table = FeatureTable(
        of, *2 * [np.array(alike(specimens))[of]], np.zeros(n, int), np.array(rows["branch"]),
        np.array(rows["strain"]), np.array(rows["time"]), np.array(rows["x"]), np.ones(n),
        np.arcsinh(big / 2.0), big, np.zeros(n), np.zeros((n, 0)),
    )  # fmt: skip
    further = tuple(dict.fromkeys(name for s in specimens for name in s.covariates))
    return Case(
        Campaign("synthetic", "connex3", PALETTE, tuple(specimens), further), table,
        noise_of(table), shared_of(specimens, table), log_sd,
    )  # fmt: skip


def noise_of(table: FeatureTable) -> SpecimenNoise:
    ends = [0, *(np.flatnonzero(np.diff(table.specimen)) + 1).tolist(), len(table)]
    slices = tuple(slice(a, b) for a, b in itertools.pairwise(ends))
    blocks = []
    for rows in slices:
        h = (~table.is_field[rows]).astype(float)
        place = np.linspace(0.0, 1.0, len(h))
        tilt = h * (table.strain[rows] / 0.5 - 0.5)
        away = np.abs(np.subtract.outer(place, place)) / 0.15
        block = LEVEL**2 * np.outer(h, h) + SLOPE**2 * np.outer(tilt, tilt)
        block += WANDER**2 * np.outer(h, h) * np.exp(-away)
        blocks.append(block + np.diag(np.where(h > 0.0, OWN, FIELD) ** 2))
    roots = tuple(np.linalg.inv(np.linalg.cholesky(block)) for block in blocks)
    root = csr_array(scipy.linalg.block_diag(*roots))
    return SpecimenNoise(slices, tuple(blocks), root, np.zeros((len(table), 0)))


def shared_of(specimens: Sequence[Specimen], table: FeatureTable) -> FloatArray:
    force = ~table.is_field
    kinds = [s.material or s.profile.name for s in specimens]  # type: ignore[union-attr]
    batches = [s.batch for s in specimens]
    columns = [
        sd * (np.array(names)[table.specimen] == name) * force
        for names, sd in ((kinds, CALIBRATION), (batches, BATCH))
        for name in dict.fromkeys(names)
    ]
    return np.stack(columns, axis=1)


def tray_x_mm(k: int) -> float:
    return float(k * 37 % 30) * 10.0


def operator(k: int) -> str:
    return "PQR"[k * 7 % 3]


STAR = case_of(star(operator=operator, tray_x_mm=tray_x_mm))
BARS = case_of(
    [*star(), *(specimen(30 + k, None, profile=STEP_BAR, width_mm=6.0) for k in range(3))]
)


def named(places: Sequence[Location], axis: str) -> Location:
    return next(p for p in places if p.axis == axis)


def bleed(case: Case) -> FloatArray:
    """Strain moved from the soft side of the step to the stiff one, over some 2 mm."""
    away = np.where(case.table.is_field, case.table.x_mm - 12.5, 0.0) / 2.0
    gap: FloatArray = -0.25 * away * np.exp(-0.5 * away**2)
    return gap


PLANTED: dict[str, tuple[str, Case, Callable[[Case], FloatArray], str]] = {
    "temperature": (
        "temperature_C", STAR, lambda c: -0.02 * (c.value("temperature_C") - 23.0) * c.force,
        "at 33 °C (3 specimens)",
    ),
    "rate": (
        "rate_mm_s", STAR, lambda c: 0.25 * (c.value("rate_mm_s") > 5.0) * c.force, "at 20 mm/s",
    ),
    "unclaimed text": (
        "operator", STAR, lambda c: -0.15 * (c.text("operator") == "Q") * c.force,
        "below prediction where operator is Q (10 specimens)",
    ),
    "unclaimed number": (
        "tray_x_mm", STAR, lambda c: 0.0006 * c.value("tray_x_mm") * c.force,
        "where tray_x_mm is 200 to 290 (10 specimens)",
    ),
    "material": (
        "material", STAR, lambda c: 0.5 * (c.text("material") == "FLX9770") * c.force,
        "above prediction in FLX9770 (3 specimens)",
    ),
    "slack": ("strain", STAR, lambda c: -0.003 / c.table.strain, "% below at strains up to 0.1"),
    "gain": ("strain", STAR, lambda c: 0.25 * c.force, "alike at all strains"),
    "softening": ("branch", STAR, lambda c: -0.2 * (c.table.branch == 1), "in unloading"),
    "relaxation": (
        "time", STAR, lambda c: -0.06 * (c.table.branch == 3) * np.log(c.table.time_s),
        "after 30 s of the hold",
    ),
    "unit": (
        "specimen", STAR, lambda c: np.log(4.448) * np.isin(c.table.specimen, (4, 11)),
        "times its replicates",
    ),
    "bleed": ("position", BARS, bleed, "along bar B2, at the step from FLX9740 to FLX9770"),
}  # fmt: skip


@pytest.mark.parametrize("kind", PLANTED)
def test_what_is_planted_along_an_axis_is_found_there(kind: str) -> None:
    axis, case, gap, words = PLANTED[kind]
    places = case.where(gap(case) + case.scatter(np.random.default_rng(7)))
    first = places[0]
    assert first.axis == axis
    assert first.p < 0.01
    # Sizes are chosen three scatters and more above noise: at least half of the excess is theirs,
    # less what the material's calibration may pass for.
    assert first.share > 0.5
    low, high = first.share_interval
    assert 0.0 <= low <= first.share <= high <= 1.0
    assert words in first.detail


def test_a_sentence_has_the_gaps_size() -> None:
    gap = 0.2 * (STAR.value("temperature_C") == 15.0) * STAR.force
    gap = gap - 0.1 * (STAR.value("temperature_C") == 33.0) * STAR.force
    # exp(0.2) = 1.221, exp(-0.1) = 0.905; no noise.
    assert named(STAR.where(gap), "temperature_C").detail == (
        "force 22 % above prediction at 15 °C (3 specimens), 9.5 % below at 33 °C (3 specimens)"
    )


def test_a_column_may_be_called_anything() -> None:
    case = case_of(star(**{"tray {x}": tray_x_mm}))
    gap = 0.0006 * np.array([tray_x_mm(k) for k in range(30)])[case.table.specimen] * case.force
    found = named(case.where(gap), "tray {x}")
    assert "where tray {x} is 200 to 290 (10 specimens)" in found.detail


@pytest.mark.parametrize(
    ("scale", "df"), [(1.0, 0), (1.0, 4), (1.6, 0)], ids=["normal", "t4", "scatter understated"]
)
def test_false_alarms_are_one_in_twenty_at_most(scale: float, df: float) -> None:
    case, rng = case_of(star()[:18]), np.random.default_rng(11)
    runs = 60
    alarms = sum(
        min(p.p for p in case.where(case.scatter(rng, scale=scale, df=df))) <= 0.05
        for _ in range(runs)
    )
    # Family-wise 5 %: a correct rate exceeds this bound once in a thousand.
    assert alarms <= scipy.stats.binom.ppf(0.999, runs, 0.05)


def test_a_usual_error_of_calibration_is_no_material() -> None:
    off = CALIBRATION * (STAR.text("material") == "FLX9770") * STAR.force
    assert named(STAR.where(off), "material").p > 0.5


def test_of_columns_that_go_together_the_true_one_is_among_the_first_two() -> None:
    """Age goes with temperature in two specimens of three, as batches printed on a day do."""
    specimens = [
        specimen(
            k, GRADES[k % 5], temperature_C=(23.0, 33.0, 15.0)[k // 5 % 3],
            age_days=9.0 if k // 5 % 3 < 2 or k % 7 == 0 else 30.0,
        )
        for k in range(30)
    ]  # fmt: skip
    case, rng, found = case_of(specimens), np.random.default_rng(3), 0
    gap = -0.008 * (case.value("temperature_C") - 23.0) * case.force
    for _ in range(10):
        places = case.where(gap + case.scatter(rng))
        found += "temperature_C" in [p.axis for p in places[:2]]
        assert "age_days" not in places[0].axis
    assert found == 10


def test_two_replicates_a_level_are_enough() -> None:
    specimens = [
        specimen(k, GRADES[k % 3], temperature_C=(23.0, 33.0)[k // 3 % 2], batch="A")
        for k in range(12)
    ]
    case = case_of(specimens)
    gap = -0.2 * (case.value("temperature_C") > 30.0) * case.force
    first = case.where(gap + case.scatter(np.random.default_rng(2)))[0]
    assert first.axis == "temperature_C"
    assert first.p < 0.01
    assert "batch" not in [p.axis for p in case.where(gap)]  # one level only


def test_unknown_cells_are_left_out_of_their_axis() -> None:
    specimens = star(operator=operator)
    specimens = [replace(s, temperature_C=None) if i % 4 == 0 else s
                 for i, s in enumerate(specimens)]  # fmt: skip
    specimens[1] = replace(specimens[1], covariates={"operator": None})
    specimens[2] = replace(specimens[2], covariates={})
    case = case_of(specimens)
    unknown = np.isnan(case.value("temperature_C"))
    gap = np.where(unknown, 0.0, -0.02 * (case.value("temperature_C") - 23.0)) * case.force
    first = case.where(gap + case.scatter(np.random.default_rng(5)))[0]
    assert first.axis == "temperature_C"


def test_no_comparison_no_places() -> None:
    single = case_of([specimen(0)])
    assert single.where(np.full(len(single.table), 0.3)) == ()
    pair = case_of([specimen(0, batch="A"), specimen(1, batch="A")])
    assert {p.axis for p in pair.where(np.zeros(len(pair.table)))} == {"strain", "specimen"}


def test_labels_of_single_specimens_are_no_axis() -> None:
    specimens = [replace(s, covariates={"note": f"n{i}"}) for i, s in enumerate(star())]
    case = case_of(specimens)
    assert "note" not in [p.axis for p in case.where(np.zeros(len(case.table)))]


def test_whitened_noise_is_white() -> None:
    """White by the covariance itself: W C W' = I."""
    covariance = STAR.shared @ STAR.shared.T + scipy.linalg.block_diag(*STAR.noise.blocks)
    matrix = STAR.whitening(np.eye(len(STAR.table)))
    # Rounding times the covariance's condition, some 1e5.
    np.testing.assert_allclose(matrix @ covariance @ matrix.T, np.eye(len(matrix)), atol=1e-9)


@pytest.mark.parametrize("count", [4, 12])
@pytest.mark.parametrize(
    ("first", "step"), [(1.7e9, 60.0), (20_260_605.0, 1.0), (2024.1, 0.001), (23.0, 1.5)]
)
def test_a_column_reads_apart_wherever_it_begins(first: float, step: float, count: int) -> None:
    """Seconds since 1970, dates and years are told by what sets them apart, as are small numbers.

    Levels where there are few, thirds else; each number of it names one place of the column.
    """
    cells = [first + step * (k // 2) for k in range(2 * count)]
    groups = list(_groups("a column of its own", cells))
    assert sum(int(members.sum()) for _, members in groups) == len(cells)
    assert len(groups) == (4 if count == 4 else 3)
    said = [float(number) for label, _ in groups for number in label.split(" to ")]
    assert said == sorted(set(said))
    assert not any("e" in label for label, _ in groups)
    for label, members in groups:
        ends = [cells[k] for k in np.flatnonzero(members)]
        # To half of the step at least.
        assert float(label.split(" to ")[0]) == pytest.approx(ends[0], abs=0.51 * step)
