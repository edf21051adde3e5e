"""Which specimens a campaign tests: one full design for every truth.

A third of the conditions leaves the reference in each factor, in an arrangement that keeps the
factors as uncorrelated as a few hundred shuffles can. Each condition is printed once in every
replicate, and each replicate in another batch. Graded bars stand at reference conditions.
"""

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.withheld.reality.palette_file import PaletteFile
from benchmarks.withheld.reality.profiles import Profile, draw_profiles

__all__ = ["Design", "Levels", "draw_design", "three_digits"]

FloatArray = NDArray[np.float64]
StringArray = NDArray[np.str_]

_SHUFFLES = 300


@dataclass(frozen=True)
class Levels:
    """What the factors may be; the first of each is the reference, the palette's own."""

    strain_rate_factors: tuple[float, ...]
    temperatures_C: tuple[float, ...]
    soaks_h: tuple[float, ...]
    ages_days: tuple[float, ...]
    sections_mm: tuple[tuple[float, float], ...] = ((6.0, 3.0), (10.0, 3.0), (6.0, 1.5), (4.0, 4.0))
    gauges_mm: tuple[float, ...] = (25.0, 40.0)


@dataclass(frozen=True)
class Design:
    """The specimens, one entry of each array a specimen.

    Attributes
    ----------
    material
        A palette id, or "" for a graded bar.
    profile
        Index into `profiles`, or -1 for a coupon.
    coordinate
        Of the coupon's material; NaN for a bar.
    number
        Place in the campaign, so that a subset still knows which specimens it holds.
    condition
        Specimens that are replicates of each other share it.
    """

    number: NDArray[np.int64]
    material: StringArray
    coordinate: FloatArray
    profile: NDArray[np.int64]
    condition: NDArray[np.int64]
    width_mm: FloatArray
    thickness_mm: FloatArray
    gauge_mm: FloatArray
    rate_mm_s: FloatArray
    temperature_C: FloatArray
    soak_h: FloatArray
    age_days: FloatArray
    orientation: StringArray
    protocol: StringArray
    batch: StringArray
    operator: StringArray
    tray_x_mm: FloatArray
    profiles: tuple[Profile, ...]

    def __len__(self) -> int:
        return len(self.material)

    def take(self, rows: NDArray[np.int64] | NDArray[np.bool_]) -> "Design":
        """Return the chosen specimens, in that order."""
        columns = {
            f.name: getattr(self, f.name)[rows] for f in fields(self) if f.name != "profiles"
        }
        return replace(self, **columns)

    @property
    def strain_rate_per_s(self) -> FloatArray:
        """Return the crosshead's rate over the gauge length."""
        return self.rate_mm_s / self.gauge_mm


def draw_design(
    palette: PaletteFile, levels: Levels, count: int, rng: np.random.Generator
) -> Design:
    """Draw a campaign of `count` specimens, at least 20."""
    if count < 20:
        raise ValueError(f"{count} specimens: a campaign of the bench takes at least 20")
    replicates = 2 if count < 60 else 3
    bars = min(5, max(2, round(0.2 * count / replicates)))
    coupons = -(-(count - bars * replicates) // replicates)
    grades = np.sort(rng.choice(len(palette.grades), min(4, len(palette.grades)), replace=False))
    profiles = draw_profiles(palette, bars, rng)

    rate, temperature, soak, age, orientation, section, gauge, protocol, grade = _arrange(
        [
            _column(levels.strain_rate_factors, coupons, 0.35, rng),
            _column(levels.temperatures_C, coupons, 0.35, rng),
            _column(levels.soaks_h, coupons, 0.35, rng),
            _column(levels.ages_days, coupons, 0.35, rng),
            _column((0, 1, 2), coupons, 0.35, rng),
            _column(range(len(levels.sections_mm)), coupons, 0.5, rng),
            _column(levels.gauges_mm, coupons, 0.4, rng),
            _column((0, 1, 2), coupons, 0.55, rng),
            _column(grades, coupons, 1.0 - 1.0 / len(grades), rng),
        ],
        rng,
    )
    section_mm = np.array(levels.sections_mm)[section.astype(int)]
    reference = np.ones(bars)
    conditions = Design(
        number=np.arange(coupons + bars),
        material=np.array([palette.grades[int(g)].id for g in grade] + [""] * bars),
        coordinate=np.array(
            [palette.grades[int(g)].coordinate for g in grade] + [np.nan] * bars, dtype=np.float64
        ),
        profile=np.r_[np.full(coupons, -1), np.arange(bars)],
        condition=np.arange(coupons + bars),
        width_mm=np.r_[section_mm[:, 0], reference * levels.sections_mm[0][0]],
        thickness_mm=np.r_[section_mm[:, 1], reference * levels.sections_mm[0][1]],
        gauge_mm=np.r_[gauge, [p.length_mm for p in profiles]],
        rate_mm_s=np.zeros(coupons + bars),
        temperature_C=np.r_[temperature, reference * levels.temperatures_C[0]],
        soak_h=np.r_[soak, reference * levels.soaks_h[0]],
        age_days=np.r_[age, reference * levels.ages_days[0]],
        orientation=np.array(["x", "y", "z"])[np.r_[orientation, 0 * reference].astype(int)],
        protocol=np.array(["monotonic", "cyclic", "relaxation"])[
            np.r_[protocol, np.arange(bars) % 2].astype(int)
        ],
        batch=np.full(coupons + bars, "B0"),
        operator=np.full(coupons + bars, "A"),
        tray_x_mm=np.zeros(coupons + bars),
        profiles=profiles,
    )
    factor = np.r_[rate, reference * levels.strain_rate_factors[0]]
    rate_mm_s = three_digits(factor * palette.strain_rate_per_s * conditions.gauge_mm)
    conditions = replace(conditions, rate_mm_s=rate_mm_s)

    rows = np.concatenate(
        [np.arange(coupons, coupons + bars)] * replicates + [np.arange(coupons)] * replicates
    )[:count]
    replicate = np.concatenate(
        [np.repeat(np.arange(replicates), bars), np.repeat(np.arange(replicates), coupons)]
    )[:count]
    batch = (replicate + conditions.condition[rows]) % replicates
    tray = rng.permutation(np.linspace(20.0, 470.0, count)).round(0)
    return replace(
        conditions.take(rows),
        number=np.arange(count),
        batch=np.array([f"B{b + 1}" for b in batch]),
        operator=np.array(["A", "B"])[rng.permutation(np.arange(count) % 2)],
        tray_x_mm=tray,
    )


def _column(
    levels: tuple[float, ...] | range | NDArray[np.int64],
    count: int,
    share_off: float,
    rng: np.random.Generator,
) -> FloatArray:
    """Return a factor's values: the first level, and the others evenly in `share_off` of rows."""
    off = np.asarray(levels[1:], dtype=np.float64)
    n_off = max(len(off), round(share_off * count))
    values = np.full(count, float(levels[0]))
    values[:n_off] = np.resize(rng.permutation(off), n_off)
    return values


def _arrange(columns: list[FloatArray], rng: np.random.Generator) -> list[FloatArray]:
    """Return the columns, each shuffled so that the largest correlation is small.

    The departure from the reference aliases two factors as much as its direction: both count.
    """
    table = np.array(columns)
    reference = table[:, -1:]
    own = np.arange(len(table))
    best, lowest = table, np.inf
    for _ in range(_SHUFFLES):
        shuffled = rng.permuted(table, axis=1)
        correlation = np.corrcoef(np.vstack([shuffled, shuffled != reference]))
        np.fill_diagonal(correlation, 0.0)
        correlation[own, own + len(own)] = correlation[own + len(own), own] = 0.0
        worst = float(np.abs(correlation).max())
        if worst < lowest:
            best, lowest = shuffled, worst
    return list(best)


def three_digits(values: FloatArray) -> FloatArray:
    """Round as a list of specimens states rates."""
    return np.array([float(f"{v:.3g}") for v in values])
