"""How often data that is right is called wrong, and how often a planted fault is found.

Campaigns are drawn at random over designs, sizes, protocols, sampling and noise, and they have a
gap: materials off the laws, rate, temperature and batch effects, hysteresis, relaxation. None of
that is a fault of the data.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from planner.gap import quality
from planner.gap.campaign import Campaign, Specimen
from planner.gap.diagnosis import QualityProblem
from planner.gap.observations import ObservationModel
from planner.materials.laws import make_law
from planner.numerics import FloatArray
from planner.printers import load_printer
from planner.simulation.bar import ProfileDesign

PALETTE = load_printer("connex3").palette()
ELASTIC = [m for m in PALETTE.materials if m.deformation == "elastic"]
Generator = np.random.Generator


def travel(protocol: str, peak: float, rate: float, rng: Generator) -> tuple[Any, Any, Any]:
    """Times, travel, and the strain history's loading share: 1 on loading, lower on unloading."""
    n = int(rng.integers(60, 400))
    if protocol == "monotonic":
        time = np.linspace(0.0, peak / rate, n)
        return time, rate * time, np.ones(n)
    if protocol == "relaxation":
        ramp = np.linspace(0.0, peak / rate, n // 2)
        decades = rng.uniform(1.0, 2.5)
        hold = ramp[-1] * (1.0 + np.logspace(-2, decades, n - len(ramp)))
        fading = 1.0 - 0.15 * np.log10(1.0 + (hold - ramp[-1]) / ramp[-1] * 20.0)
        time = np.concatenate([ramp, hold])
        return time, np.minimum(rate * time, peak), np.concatenate([np.ones(len(ramp)), fading])
    cycles = int(rng.integers(2, 5))
    time = np.linspace(0.0, 2.0 * cycles * peak / rate, n)
    phase = time * rate / peak
    up = phase % 2.0 < 1.0
    first = phase < 1.0
    factor = np.where(first, 1.0, np.where(up, 0.9, 0.75))
    return time, peak * (1.0 - np.abs(1.0 - phase % 2.0)), factor


def examine(of: Campaign) -> tuple[QualityProblem, ...]:
    return quality.examine(of, ObservationModel(of))


def stress_MPa(piece: Any, strain: FloatArray) -> FloatArray:
    """Of a material by its law; of a bar, slices as springs of their secants at the mean strain."""
    if not isinstance(piece, ProfileDesign):
        return make_law(piece.law).nominal_stress_MPa(1.0 + strain)
    laws = [make_law(m.law) for m in PALETTE.materials]
    logs = np.log([law.nominal_stress_MPa(1.0 + strain) / strain for law in laws])
    at = piece.at((np.arange(200) + 0.5) / 200.0 * piece.length_mm)
    along = [np.interp(at, [m.coordinate for m in PALETTE.materials], log) for log in logs.T]
    return strain / np.mean(np.exp(-np.array(along)), axis=1)


def clean(rng: Generator, *, tails: bool = False) -> Campaign:
    """Draw a campaign without a fault; `tails` makes the scatter of specimens Student's t4."""
    picked = rng.choice(len(ELASTIC), int(rng.integers(1, 5)), replace=False)
    pieces: list[Any] = [ELASTIC[i] for i in sorted(picked)]
    if rng.random() < 0.4:
        x = np.linspace(0.0, 40.0, 9)
        ends = rng.uniform(0.0, 1.0, 2)
        pieces.append(ProfileDesign("bar", x, np.linspace(*ends, 9)))
    rates = rng.choice([[1.0], [0.1, 1.0], [0.05, 0.5, 5.0]][rng.integers(3)], 3)
    temperatures = [[23.0], [15.0, 23.0, 40.0]][rng.integers(2)]
    protocols = [["monotonic"], ["monotonic", "cyclic"], ["relaxation"]][rng.integers(3)]
    replicates, batches = int(rng.integers(1, 5)), int(rng.integers(1, 4))
    gain = rng.normal(0.0, 0.2)
    per_decade, per_kelvin = rng.uniform(0.0, 0.5), rng.uniform(-0.05, 0.0)
    batch_gain = rng.normal(0.0, 0.03, batches)
    law_error = rng.normal(0.0, 0.2, len(pieces))
    scatter = np.exp(rng.uniform(np.log(0.01), np.log(0.09), len(pieces)))
    noise, resolution = 10.0 ** rng.uniform(-4, -2.3), 10.0 ** rng.uniform(-5, -2.7)
    specimens: list[Specimen] = []
    for p, piece in enumerate(pieces):
        conditions = {(r, t, q) for r in rates for t in temperatures for q in protocols}
        for rate, temperature, protocol in sorted(conditions):
            if rng.random() < 0.3 and specimens:
                continue
            coupon = not isinstance(piece, ProfileDesign)
            reach = piece.elongation_at_break if coupon else 0.5
            if protocol != "monotonic":
                reach *= 0.6
            for k in range(replicates):
                gauge = 25.0 if coupon else 40.0
                ends = reach * (rng.uniform(0.8, 1.1) if protocol == "monotonic" else 1.0)
                time, moved, factor = travel(protocol, ends * gauge, rate, rng)
                bare = Specimen(
                    id=f"S{len(specimens):03d}",
                    time_s=time,
                    displacement_mm=moved,
                    force_N=moved,
                    gauge_mm=gauge,
                    material=piece.id if coupon else None,
                    profile=None if coupon else piece,
                    width_mm=6.0,
                    thickness_mm=2.0,
                    measured_width_mm=6.0 + rng.normal(0.15, 0.05) if rng.random() < 0.7 else None,
                    rate_mm_s=rate,
                    temperature_C=temperature,
                    orientation="x",
                    protocol=protocol,  # type: ignore[arg-type]  # one of the three
                    batch=f"B{k % batches}",
                )
                draw = rng.standard_t(4) / np.sqrt(2.0) if tails else rng.normal()
                level = gain + law_error[p] + batch_gain[k % batches] + scatter[p] * draw
                level += per_decade * np.log10(rate) + per_kelvin * (temperature - 23.0)
                strain = np.maximum(bare.strain, 1e-6)
                bent = rng.normal(0.0, 0.3 * scatter[p]) * (strain / reach - 0.5)
                area = 6.15 * 2.0
                force = area * stress_MPa(piece, strain)
                force = force * factor * np.exp(level + bent)
                top = float(force.max())
                force = force + top * noise * rng.normal(size=len(force))
                if protocol == "monotonic" and rng.random() < 0.3:
                    force[-int(rng.integers(1, 6)) :] = rng.normal(0.0, top * noise)
                step = top * resolution
                specimens.append(
                    replace(
                        bare,
                        force_N=np.round(force / step) * step,
                        displacement_mm=moved + rng.normal(0.0, 2e-3, len(moved)),
                    )
                )
    return Campaign("drawn", "connex3", PALETTE, tuple(specimens))


def alarms(seeds: range, **options: bool) -> list[tuple[int, QualityProblem]]:
    return [
        (seed, problem)
        for seed in seeds
        for problem in examine(clean(np.random.default_rng(seed), **options))
    ]


def with_specimen(campaign: Campaign, at: int, **changes: Any) -> Campaign:
    specimens = list(campaign.specimens)
    specimens[at] = replace(specimens[at], **changes)
    return replace(campaign, specimens=tuple(specimens))


Fault = Callable[[Campaign, Generator], tuple[Campaign, tuple[int, ...]] | None]


def force_unit(factor: float, *, every: bool = False) -> Fault:
    """A force factor on one specimen that has replicates, or on all."""

    def plant(campaign: Campaign, rng: Generator) -> tuple[Campaign, tuple[int, ...]] | None:
        specimens = list(campaign.specimens)
        groups = [g for g in campaign.replicates() if len(g) > 1]
        if not every and not groups:
            return None
        chosen = [s.id for s in specimens] if every else [groups[0][0].id]
        at = [i for i, s in enumerate(specimens) if s.id in chosen]
        for i in at:
            specimens[i] = replace(specimens[i], force_N=specimens[i].force_N * factor)
        return replace(campaign, specimens=tuple(specimens)), tuple(at)

    return plant


def batch_unit(campaign: Campaign, rng: Generator) -> tuple[Campaign, tuple[int, ...]] | None:
    """All of one batch in lbf: half or a third of each group of replicates."""
    at = tuple(i for i, s in enumerate(campaign.specimens) if s.batch == "B1")
    if not at or all(len(g) < 2 for g in campaign.replicates()):
        return None
    for i in at:
        force = campaign.specimens[i].force_N / 4.448222
        campaign = with_specimen(campaign, i, force_N=force)
    return campaign, at


def one(change: Callable[[Specimen, Generator], dict[str, Any] | None]) -> Fault:
    """Change a specimen drawn at random."""

    def plant(campaign: Campaign, rng: Generator) -> tuple[Campaign, tuple[int, ...]] | None:
        at = int(rng.integers(len(campaign.specimens)))
        changes = change(campaign.specimens[at], rng)
        return None if changes is None else (with_specimen(campaign, at, **changes), (at,))

    return plant


def inch_travel(campaign: Campaign, rng: Generator) -> tuple[Campaign, tuple[int, ...]]:
    for i, s in enumerate(campaign.specimens):
        campaign = with_specimen(campaign, i, displacement_mm=s.displacement_mm / 25.4)
    return campaign, tuple(range(len(campaign.specimens)))


def clipped(s: Specimen, rng: Generator) -> dict[str, Any] | None:
    """Cut a fifth to a half of the peak off, where at least 10 points are there."""
    limit = float(s.force_N.max()) * rng.uniform(0.5, 0.8)
    over = s.force_N > limit
    edges = np.flatnonzero(np.diff(np.concatenate([[0], over.astype(int), [0]])))
    if np.max(edges[1::2] - edges[::2]) < 10:
        return None
    return {"force_N": np.minimum(s.force_N, limit)}


def spiked(s: Specimen, rng: Generator) -> dict[str, Any]:
    force = s.force_N.copy()
    force[int(rng.integers(10, len(force) - 10))] += rng.choice([-1, 1]) * 0.3 * force.max()
    return {"force_N": force}


def slipped(s: Specimen, rng: Generator) -> dict[str, Any] | None:
    """Take a tenth to a third of a pull's travel from the specimen, at once and half way."""
    if s.protocol != "monotonic":
        return None
    n, share = len(s.force_N), rng.uniform(0.1, 0.3)
    at = int(rng.integers(n // 2, 3 * n // 4))
    lost_mm = np.where(np.arange(n) < at, 0.0, share * s.displacement_mm[at])
    way = np.maximum(s.displacement_mm - lost_mm, 0.0)
    return {"force_N": np.interp(way, s.displacement_mm, s.force_N)}


def dropped(s: Specimen, rng: Generator) -> dict[str, Any]:
    n = len(s.time_s)
    begin = int(rng.integers(5, n // 2))
    keep = np.ones(n, dtype=bool)
    keep[begin : begin + max(8, n // 10)] = False
    names = ("time_s", "displacement_mm", "force_N")
    return {name: getattr(s, name)[keep] for name in names}


def relabelled(s: Specimen, rng: Generator) -> dict[str, Any]:
    other = {"monotonic": "cyclic", "cyclic": "monotonic", "relaxation": "monotonic"}
    return {"protocol": other[str(s.protocol)]}


def scaled(factor: float) -> Fault:
    """A specimen with at least two replicates off by a factor that is no unit's."""

    def plant(campaign: Campaign, rng: Generator) -> tuple[Campaign, tuple[int, ...]] | None:
        group = next((g for g in campaign.replicates() if len(g) > 2), None)
        if group is None or len({s.batch for s in group}) > 1:
            return None
        at = [s.id for s in campaign.specimens].index(group[0].id)
        force = campaign.specimens[at].force_N * factor
        return with_specimen(campaign, at, force_N=force), (at,)

    return plant


def copied(campaign: Campaign, rng: Generator) -> tuple[Campaign, tuple[int, ...]] | None:
    if len(campaign.specimens) < 2:
        return None
    first = campaign.specimens[0]
    at = len(campaign.specimens) - 1
    record = {n: getattr(first, n) for n in ("time_s", "displacement_mm", "force_N")}
    return with_specimen(campaign, at, **record), (at,)


FAULTS: Mapping[str, tuple[str, Fault]] = {
    "one specimen, lbf for N": ("units", force_unit(1 / 4.448222)),
    "one specimen, kgf for N": ("units", force_unit(1 / 9.80665)),
    "one specimen, kN for N": ("units", force_unit(1e-3)),
    "one specimen, psi for MPa": ("units", force_unit(145.0377)),
    "a batch, lbf for N": ("units", batch_unit),
    "all, lbf for N": ("units", force_unit(1 / 4.448222, every=True)),
    "all, kN for N": ("units", force_unit(1e-3, every=True)),
    "all, travel in inches": ("travel", inch_travel),
    "rate off by 30 %": ("rate", one(lambda s, _: {"rate_mm_s": (s.rate_mm_s or 0) * 1.3})),
    "rate in mm/min": ("rate", one(lambda s, _: {"rate_mm_s": (s.rate_mm_s or 0) * 60})),
    "another protocol": ("protocol", one(relabelled)),
    "clipped force": ("clipped", one(clipped)),
    "spike of 30 %": ("spike", one(spiked)),
    "slip in the grips": ("fall", one(slipped)),
    "tenth of the points lost": ("dropout", one(dropped)),
    "copied curve": ("duplicate", copied),
    "width in inches": ("size", one(lambda s, _: {"width_mm": 6 / 25.4})),
    "one of 3 or 4 is 1.5 times": ("outlier", scaled(1.5)),
    "one of 3 or 4 is 2 times": ("outlier", scaled(2.0)),
    "one of 3 or 4 is 2.8 times": ("outlier", scaled(2.8)),
}


def detection(name: str, seeds: range) -> tuple[int, int, int]:
    """Number found in every planted place, found with others named wrongly, and planted."""
    kind, fault = FAULTS[name]
    found = wrong = planted = 0
    for seed in seeds:
        rng = np.random.default_rng(seed)
        spoiled = fault(clean(rng), rng)
        if spoiled is None:
            continue
        campaign, places = spoiled
        planted += 1
        named = {p.specimen for p in examine(campaign) if p.kind == kind}
        expected = {campaign.specimens[i].id for i in places}
        whole = len(expected) == len(campaign.specimens)
        found += expected <= named or (whole and named == {None})
        wrong += bool(named - expected - {None}) or (None in named and not whole)
    return found, wrong, planted


@pytest.mark.parametrize(
    "seeds",
    [pytest.param(range(20), marks=pytest.mark.slow),
     pytest.param(range(20, 60), marks=pytest.mark.long)],
)  # fmt: skip
def test_clean_campaigns_are_clean(seeds: range) -> None:
    """None of sixty: were one in twenty called wrong, that had a chance of 0.95^60 = 5 %."""
    assert alarms(seeds) == []


@pytest.mark.parametrize("name", FAULTS)
def test_planted_faults_are_found(name: str) -> None:
    """Of eight: what is found in 84 % of campaigns is in at least five with a chance of 97 %."""
    few = "one of 3 or 4" in name  # campaigns that have such replicates
    found, wrong, planted = detection(name, range(5000, 5020 if few else 5008))
    assert planted >= 1
    assert wrong <= 1
    if not few:
        assert found >= 0.6 * planted


@pytest.mark.long
@pytest.mark.parametrize("name", FAULTS)
def test_planted_faults_are_found_in_many_campaigns(name: str) -> None:
    """The table in the reference: 84 % and more, but where scatter hides what is no unit."""
    found, wrong, planted = detection(name, range(5000, 5200))
    assert wrong <= 0.05 * planted
    if "one of 3 or 4" not in name:
        assert found >= 0.84 * planted


@pytest.mark.long
@pytest.mark.parametrize("tails", [False, True])
def test_false_alarms_of_many_clean_campaigns(tails: bool) -> None:
    """One per cent of two thousand campaigns."""
    assert len({seed for seed, _ in alarms(range(20_000, 22_000), tails=tails)}) <= 20
