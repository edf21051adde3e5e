"""A whole campaign: design, cause, curves, noise, and the account of what was hidden."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from benchmarks.withheld.reality.base_law import BaseLaw, fit_base_law
from benchmarks.withheld.reality.bench import Bench, FloatArray, mount
from benchmarks.withheld.reality.confounded import Scenario
from benchmarks.withheld.reality.design import Design, draw_design
from benchmarks.withheld.reality.effects import Set
from benchmarks.withheld.reality.fields import USUAL, Camera, field_detectability, measured_strain
from benchmarks.withheld.reality.noise import CAREFUL, Handling, Scatter, measured_force
from benchmarks.withheld.reality.palette_file import PaletteFile, fitted_palette
from benchmarks.withheld.reality.sets import SETS
from benchmarks.withheld.reality.sizing import Hidden, force_N, hide, hide_cancelling, mounted_with
from benchmarks.withheld.reality.solver import solve
from benchmarks.withheld.reality.strength import Yardstick, level_excess, relative_excess
from benchmarks.withheld.reality.tiers import TIERS, draw_causes, scenario_of

__all__ = [
    "Campaign",
    "Lab",
    "by_number",
    "make_campaign",
    "measured_in",
    "mounted_groups",
    "open_lab",
    "seen_fields",
]

_STREAMS = ("design", "scatter", "noise", "field", "truth", "names")
_ANY = 99  # stands for "whatever the tier" and "whatever the index" in the seeds


@dataclass(frozen=True)
class Campaign:
    """What the lab hands over, and what it does not.

    Attributes
    ----------
    time_s, displacement_mm, force_N
        As measured, (S, T), by `design.number`.
    fields
        (specimen number, times, positions, strains (times, positions)) of the graded bars.
    facet_mm
        As the campaign states it; None where it does not.
    palette_toml
        The palette with the lab's own calibration uncertainty.
    truth
        What is sealed; ready for JSON.
    """

    name: str
    design: Design
    specimen_ids: tuple[str, ...]
    time_s: FloatArray
    displacement_mm: FloatArray
    force_N: FloatArray
    fields: tuple[tuple[int, FloatArray, FloatArray, FloatArray], ...]
    facet_mm: float | None
    palette_toml: str
    truth: dict[str, Any]


@dataclass(frozen=True)
class Lab:
    """A campaign before anything is measured: what is tested, and what is true of it.

    Attributes
    ----------
    given
        The palette as the campaign has it.
    benches
        Coupons, bars, without what is hidden.
    plain_N
        What ideal sensors would show without what is hidden, by specimen number.
    rng
        The campaign's streams, each where it stands.
    """

    palette: PaletteFile
    given: PaletteFile
    set_name: Set
    tier: str
    index: int
    design: Design
    scenario: Scenario | None
    scatter: Scatter
    law: BaseLaw
    benches: tuple[Bench, ...]
    plain_N: FloatArray
    by: Yardstick
    hidden: tuple[Hidden, ...]
    camera: Camera
    handling: Handling
    rng: dict[str, np.random.Generator]


def open_lab(
    palette: PaletteFile,
    set_name: Set,
    tier: str,
    count: int,
    seed: int,
    index: int,
    camera: Camera = USUAL,
    handling: Handling = CAREFUL,
) -> Lab:
    """Draw the campaign number `index` of a seed: design, scatter, law and cause."""
    rng = _streams(set_name, tier, seed, index)
    rules, kind = SETS[set_name], TIERS[tier]
    design = draw_design(palette, rules.levels, count, rng["design"])
    turn = index + int(rng["turns"].integers(1000))
    scenario = scenario_of(tier, turn)
    if scenario is not None:
        design = scenario.restrict(design, rules.levels, palette.strain_rate_per_s)
    scatter = rules.draw_scatter(rng["scatter"], kind.scatter_factor, kind.freedom)
    if kind.level_scatter is not None:
        scatter = replace(scatter, specimen=float(rng["labs"].uniform(*kind.level_scatter)))
    if kind.sensor_share is not None:
        share = float(rng["labs"].uniform(*kind.sensor_share))
        scatter = replace(scatter, slope=0.0, wander=0.0, sensor_share=share)
    law = fit_base_law(palette, rules.network, rules.largest_misfit)
    grades = len(law.coordinates)
    law = law.shifted(
        scatter.calibration * rng["scatter"].normal(size=grades),
        scatter.tilt * rng["scatter"].normal(size=grades),
    )
    given = palette
    if kind.fitted:
        given = fitted_palette(palette, law.stress_MPa, scatter.specimen, rng["labs"])
    benches = mounted_groups(palette, design, law)
    plain = force_N(benches)
    by = Yardstick.of(benches, scatter, plain)
    causes = draw_causes(tier, set_name, design, scenario, turn, rng["truth"])
    if kind.negligible:
        # From a third to two thirds of what specimens scatter by.
        share = float(rng["labs"].uniform(0.3, 0.7))
        causes = tuple(replace(cause, size=share * scatter.specimen) for cause in causes)
    if tier == "cancelling":
        hidden: Sequence[Hidden] = hide_cancelling(benches, (causes[0], causes[1]), plain, by)
    else:
        hidden = [hide(benches, cause, plain, by) for cause in causes]
    return Lab(
        palette=palette,
        given=given,
        set_name=set_name,
        tier=tier,
        index=index,
        design=design,
        scenario=scenario,
        scatter=scatter,
        law=law,
        benches=benches,
        plain_N=plain,
        by=by,
        hidden=tuple(hidden),
        camera=camera,
        handling=handling,
        rng=rng,
    )


def make_campaign(
    palette: PaletteFile,
    set_name: Set,
    tier: str,
    count: int,
    seed: int,
    index: int,
    camera: Camera = USUAL,
    handling: Handling = CAREFUL,
) -> Campaign:
    """Make the campaign number `index` of a seed.

    Design and noise come from streams that do not depend on the tier: campaigns of one seed and
    index differ in what is hidden and in nothing else (but the confounded tier's design, and the
    heavy noise of the tiers that are about it).
    """
    return measured_in(open_lab(palette, set_name, tier, count, seed, index, camera, handling))


def measured_in(lab: Lab) -> Campaign:
    """Measure a lab's specimens; once, as that takes its streams further."""
    palette, set_name, tier, index = lab.palette, lab.set_name, lab.tier, lab.index
    rules, design, scatter, hidden = SETS[set_name], lab.design, lab.scatter, lab.hidden
    ideal = force_N(lab.benches, hidden)
    travel, time_s = by_number(lab.benches)
    share = travel / travel.max(axis=1, keepdims=True)
    measured = measured_force(ideal, share, design, scatter, lab.rng["noise"])
    if TIERS[tier].stray:
        one = int(lab.rng["labs"].integers(len(design)))
        ln_factor = lab.rng["labs"].choice((-1.0, 1.0)) * lab.rng["labs"].uniform(0.8, 1.6)
        measured[one] *= np.exp(ln_factor)
    published = mounted_groups(palette, design, fit_base_law(lab.given, rules.network, 0.0))
    before = force_N(published)
    return Campaign(
        name=f"{int(lab.rng['names'].integers(16**10)):010x}",
        design=design,
        specimen_ids=_specimen_ids(len(design), lab.rng["names"]),
        time_s=time_s,
        displacement_mm=lab.handling.written_mm(travel, design.gauge_mm, lab.rng["handling"]),
        force_N=measured,
        fields=seen_fields(lab, lab.benches, hidden, lab.rng["field"]),
        facet_mm=lab.camera.facet_mm if lab.camera.stated else None,
        palette_toml=lab.given.calibrated(scatter.calibration),
        truth={
            "set": set_name,
            "tier": tier,
            "index": index,
            "design": lab.scenario.name if lab.scenario else "full",
            **_account(lab, ideal),
            "class": [[i] for i in lab.scenario.confounded] if lab.scenario else _own_class(hidden),
            "gap": _gap(measured, before, force_N(published, hidden) if hidden else before, ideal),
            "scatter": asdict(scatter),
        },
    )


def _streams(set_name: Set, tier: str, seed: int, index: int) -> dict[str, np.random.Generator]:
    tier_number, set_number = list(TIERS).index(tier), list(SETS).index(set_name)
    streams = {}
    for number, stream in enumerate(_STREAMS):
        of_tier = tier_number if stream in ("truth", "names") else _ANY
        streams[stream] = _generator(seed, set_number, index, number, of_tier)
    streams["labs"] = _generator(seed, set_number, index, len(_STREAMS) + 1, tier_number)
    streams["handling"] = _generator(seed, set_number, index, len(_STREAMS) + 2, _ANY)
    # Where the turns of a tier start; one for all its campaigns
    streams["turns"] = _generator(seed, set_number, _ANY, len(_STREAMS), tier_number)
    return streams


def _generator(seed: int, *key: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))


def mounted_groups(palette: PaletteFile, design: Design, law: BaseLaw) -> tuple[Bench, ...]:
    """Mount coupons and bars, each kind that there is."""
    groups = (design.profile < 0, design.profile >= 0)
    return tuple(mount(palette, design.take(group), law) for group in groups if group.any())


def by_number(benches: Sequence[Bench]) -> tuple[FloatArray, FloatArray]:
    """Return travel and time of the benches' specimens in the order of their numbers."""
    order = np.concatenate([b.design.number for b in benches]).argsort()
    travel = np.concatenate([b.motion.displacement_mm for b in benches])[order]
    return travel, np.concatenate([b.motion.time_s for b in benches])[order]


def _specimen_ids(count: int, rng: np.random.Generator) -> tuple[str, ...]:
    numbers = rng.choice(9000, size=count, replace=False) + 1000
    return tuple(f"S{n}" for n in numbers)


def seen_fields(
    lab: Lab, benches: Sequence[Bench], hidden: Sequence[Hidden], rng: np.random.Generator
) -> tuple[tuple[int, FloatArray, FloatArray, FloatArray], ...]:
    """Return what the camera sees of the bars, as `Campaign.fields` has it."""
    fields = []
    for bench in benches:
        if not (bench.design.profile >= 0).any():
            continue
        with_effect = mounted_with(bench, hidden)
        seen = measured_strain(with_effect, solve(with_effect).strain, lab.camera, rng)
        fields += [(int(n), *of_it) for n, of_it in zip(bench.design.number, seen, strict=True)]
    return tuple(fields)


def _account(lab: Lab, ideal: FloatArray) -> dict[str, Any]:
    plain, by = lab.plain_N, lab.by
    causes = []
    for item in lab.hidden:
        alone = ideal if len(lab.hidden) == 1 else force_N(lab.benches, [item])
        causes.append(
            {
                "effect": item.cause.effect.id,
                "form": item.cause.form.name,
                "size": item.size,
                "shape": dict(item.cause.shape),
                "where": list(item.cause.effect.where),
                "snr_wanted": item.cause.wanted_snr,
                "field_detectability": _field_detectability(lab, item),
                **_visibility(relative_excess(alone, plain), by),
            }
        )
    together = causes[0] if len(causes) == 1 else _visibility(relative_excess(ideal, plain), by)
    if TIERS[lab.tier].negligible:
        causes = []
    return {
        "effects": sorted(str(c["effect"]) for c in causes),
        "causes": causes,
        **{name: together[name] for name in ("snr", "detectability", "excess_rms")},
    }


def _visibility(excess: FloatArray, by: Yardstick) -> dict[str, Any]:
    return {
        "snr": by.snr(level_excess(excess)),
        "detectability": by.detectability(excess),
        "excess_rms": float(np.sqrt(np.mean(excess**2))),
    }


def _field_detectability(lab: Lab, item: Hidden) -> float:
    bars = [b for b in lab.benches if (b.design.profile >= 0).any()]
    return max(
        (
            field_detectability(
                b, solve(mounted_with(b, [item])).strain, solve(b).strain, lab.camera
            )
            for b in bars
        ),
        default=0.0,
    )


def _own_class(hidden: Sequence[Hidden]) -> list[list[str]]:
    return [sorted(h.cause.effect.id for h in hidden)] if hidden else []


def _gap(
    measured: FloatArray, published: FloatArray, with_effect: FloatArray, ideal: FloatArray
) -> dict[str, float]:
    """Return the normalised RMS errors of force: of the palette, with the effect, and of noise."""
    peak = np.abs(measured).max(axis=1, keepdims=True)
    before, after, noise = (
        float(np.sqrt(np.mean(((measured - model) / peak) ** 2)))
        for model in (published, with_effect, ideal)
    )
    return {"before": before, "with_true_effect": after, "noise": noise}
