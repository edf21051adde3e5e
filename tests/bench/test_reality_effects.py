"""Each effect of the bench does what its physics says, where it says, and no more."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.withheld.reality.base_law import STRAINS, fit_base_law
from benchmarks.withheld.reality.bench import Bench, mount
from benchmarks.withheld.reality.design import Design, draw_design
from benchmarks.withheld.reality.effects import EFFECTS, UNCLAIMED, Effect, Form
from benchmarks.withheld.reality.palette_file import read_palette
from benchmarks.withheld.reality.sets import SETS
from benchmarks.withheld.reality.sizing import Hidden, force_N
from benchmarks.withheld.reality.solver import solve
from benchmarks.withheld.reality.tiers import Cause

ROOT = Path(__file__).parents[2]
PALETTE = read_palette(
    (ROOT / "printers/connex3/palettes/connex3-tango-vero.toml").read_text(encoding="utf-8")
)
ALL: dict[str, Effect] = {**EFFECTS, **UNCLAIMED}
FORMS = [
    (set_name, effect.id, kind, number)
    for set_name in SETS
    for effect in ALL.values()
    for kind in ("library", "other")
    for number in range(len(getattr(effect, kind)[set_name]))
]
Mask = NDArray[np.bool_]


@cache
def laboratory(set_name: str) -> tuple[Design, tuple[Bench, ...], NDArray[np.float64]]:
    rules = SETS[set_name]
    design = draw_design(PALETTE, rules.levels, 60, np.random.default_rng(2))
    law = fit_base_law(PALETTE, rules.network, rules.largest_misfit)
    groups = (design.profile < 0, design.profile >= 0)
    benches = tuple(mount(PALETTE, design.take(g), law) for g in groups)
    return design, benches, force_N(benches)


def change(set_name: str, effect: Effect, form: Form, size: float) -> NDArray[np.float64]:
    """Return force with the effect over force without, less 1; rows with any force at all."""
    design, benches, plain = laboratory(set_name)
    cause = Cause(effect, form, form.draw(np.random.default_rng(3), design), 0.0)
    changed = force_N(benches, [Hidden(cause, size)])
    return changed[:, 8:] / plain[:, 8:] - 1.0


ACTS_ON: dict[str, Callable[[Design], Mask]] = {
    "ageing": lambda d: d.age_days != 9.0,
    "cross-section": lambda d: d.width_mm > 0.0,
    "force-offset": lambda d: d.width_mm > 0.0,
    "grip-slack": lambda d: d.width_mm > 0.0,
    "grip-slip": lambda d: d.width_mm > 0.0,
    "interface-bleed": lambda d: d.profile >= 0,
    "machine-compliance": lambda d: d.width_mm > 0.0,
    "moisture": lambda d: d.soak_h > 0.0,
    "operator": lambda d: d.operator == "B",
    "orientation": lambda d: d.orientation != "x",
    "permanent-set": lambda d: d.protocol == "cyclic",
    "skin": lambda d: d.width_mm > 0.0,
    "softening": lambda d: d.protocol == "cyclic",
    "strain-scale": lambda d: d.width_mm > 0.0,
    "temperature": lambda d: d.temperature_C != 23.0,
    "tray": lambda d: d.width_mm > 0.0,
}
STIFFER: dict[str, int] = {
    "cross-section": 1,
    "grip-slack": -1,
    "grip-slip": -1,
    "machine-compliance": -1,
    "moisture": -1,
    "permanent-set": -1,
    "softening": -1,
}


@pytest.mark.parametrize(("set_name", "effect_id", "kind", "number"), FORMS)
def test_an_effect_acts_where_it_should_and_nowhere_else(
    set_name: str, effect_id: str, kind: str, number: int
) -> None:
    effect = ALL[effect_id]
    form = getattr(effect, kind)[set_name][number]
    design, _, _ = laboratory(set_name)
    small, large = (change(set_name, effect, form, size) for size in (form.low, form.high))
    assert np.isfinite(large).all()
    assert np.abs(large).max() > np.abs(small).max() > 1e-4 or form.low == form.high
    if effect_id in ACTS_ON:
        acts = ACTS_ON[effect_id](design)
        # Bars at rest meet the solver's tolerance: 1e-9 mm of at least 0.2 mm travel
        assert np.abs(large[~acts]).max(initial=0.0) < 1e-7
        assert (np.abs(large[acts]).max(axis=1) > 1e-4).mean() > 0.7
    if effect_id in STIFFER:
        # Slip by jerks and set may leave a row where it was, within the solver's tolerance
        direction = STIFFER[effect_id] * large
        loading = design.protocol == "monotonic"
        assert direction[loading].min() > -1e-6
        assert direction.mean() > 0.0


def single(effect_id: str, kind: str, set_name: str) -> tuple[Effect, Form]:
    return EFFECTS[effect_id], getattr(EFFECTS[effect_id], kind)[set_name][0]


CASES = [(kind, set_name) for kind in ("library", "other") for set_name in SETS]


@pytest.mark.parametrize("effect_id", ["rate", "temperature", "moisture", "ageing", "orientation"])
@pytest.mark.parametrize(("kind", "set_name"), CASES)
def test_a_pull_at_the_reference_finds_the_palettes_curve(
    kind: str, set_name: str, effect_id: str
) -> None:
    _, form = single(effect_id, kind, set_name)
    design, _, _ = laboratory(set_name)
    coupons = design.take(design.profile < 0)
    reference = replace(
        coupons,
        protocol=np.full(len(coupons), "monotonic"),
        orientation=np.full(len(coupons), PALETTE.orientation),
        rate_mm_s=PALETTE.strain_rate_per_s * coupons.gauge_mm,
        temperature_C=np.full(len(coupons), PALETTE.temperature_C),
        soak_h=np.full(len(coupons), PALETTE.soak_h),
        age_days=np.full(len(coupons), PALETTE.age_days),
    )
    rules = SETS[set_name]
    law = fit_base_law(PALETTE, rules.network, rules.largest_misfit)
    bench = mount(PALETTE, reference, law)
    plain = solve(bench).force_N[:, 1:]
    # Relaxation is steep at the start, which the rows of a curve resolve to half a permille
    allowed = 1e-3 if effect_id == "rate" else 1e-12
    for seed, size in enumerate((form.low, 0.5 * (form.low + form.high), form.high)):
        shape = form.draw(np.random.default_rng(seed), design)
        force = solve(form.apply(bench, size, shape)).force_N[:, 1:]
        assert np.abs(force / plain - 1.0).max() < allowed


@pytest.mark.parametrize(("kind", "set_name"), CASES)
def test_rate_stiffens_by_what_is_known_of_these_elastomers(kind: str, set_name: str) -> None:
    """Stress times 1 to 2 a decade, and holds fade."""
    effect, form = single("rate", kind, set_name)
    design, _, _ = laboratory(set_name)
    level = change(set_name, effect, form, form.high)
    pulled = design.profile < 0
    decades = np.log10(design.strain_rate_per_s / PALETTE.strain_rate_per_s)
    first_pull = np.log10(1.0 + level[:, 10])
    for sign in (-1, 1):
        other = pulled & (sign * decades > 0.3)
        per_decade = 10 ** (first_pull[other] / decades[other])
        assert per_decade.min() > 1.0
        assert per_decade.max() < 2.0
    held = level[(design.protocol == "relaxation") & (design.profile < 0)]
    assert (np.diff(held[:, 45:], axis=1) <= 1e-9).all()
    assert held[:, -1].max() < -0.03


@pytest.mark.parametrize(("kind", "set_name"), CASES)
def test_temperature_has_its_size_as_slope_at_the_reference(kind: str, set_name: str) -> None:
    effect, form = single("temperature", kind, set_name)
    size = form.low
    design, _, _ = laboratory(set_name)
    warmer = design.temperature_C - 23.0
    level = np.log1p(change(set_name, effect, form, size)[:, 60])
    moved = (np.abs(warmer) > 0) & (np.abs(warmer) <= 12.0)
    slope = -level[moved] / warmer[moved]
    # Harder grades have half of the size; the flank bends by less than half over 12 K
    assert (slope > 0.3 * size).all()
    assert (slope < 1.5 * size).all()


@pytest.mark.parametrize(("kind", "set_name"), CASES)
def test_water_softens_up_to_its_size_more_when_thin_and_long(kind: str, set_name: str) -> None:
    effect, form = single("moisture", kind, set_name)
    design, _, _ = laboratory(set_name)
    lost = -change(set_name, effect, form, form.high)[:, 60]
    assert lost.max() <= form.high + 1e-9
    longest = design.soak_h == design.soak_h.max()
    shorter = (design.soak_h > 0.0) & ~longest
    assert lost[longest].mean() > lost[shorter].mean()
    same = design.soak_h == design.soak_h[shorter][0]
    thickness = design.thickness_mm[same]
    if kind == "library" and len(set(thickness)) > 1:
        order = np.argsort(thickness)
        assert (np.diff(lost[same][order]) <= 1e-6).all()


@pytest.mark.parametrize(("kind", "set_name"), CASES)
def test_softening_spares_first_loading_and_meets_it_again(kind: str, set_name: str) -> None:
    effect, form = single("softening", kind, set_name)
    design, benches, plain = laboratory(set_name)
    coupons = benches[0]
    cause = Cause(effect, form, form.draw(np.random.default_rng(3), design), 0.0)
    soft = force_N(benches, [Hidden(cause, form.high)])
    cyclic = np.flatnonzero((design.protocol == "cyclic") & (design.profile < 0))
    row = int(np.flatnonzero(coupons.design.number == cyclic[0])[0])
    travel = coupons.motion.displacement_mm[row]
    largest = np.maximum.accumulate(travel)
    new = travel >= largest
    assert soft[cyclic][:, new] == pytest.approx(plain[cyclic][:, new], rel=1e-6)
    lost = 1.0 - soft[cyclic][:, ~new] / plain[cyclic][:, ~new]
    assert lost.min() >= -1e-9
    assert 0.3 * form.high < lost.max() <= form.high + 1e-6
    # One row below the turn the loss has only begun
    turn = int(np.flatnonzero(~new)[0])
    assert lost[:, 0].max() < lost.max()
    assert not new[turn]


@pytest.mark.parametrize(("kind", "set_name"), CASES)
def test_set_leaves_its_share_of_the_largest_strain(kind: str, set_name: str) -> None:
    effect, form = single("permanent-set", kind, set_name)
    design, benches, _ = laboratory(set_name)
    size = 0.1
    cause = Cause(effect, form, form.draw(np.random.default_rng(3), design), 0.0)
    force = force_N(benches, [Hidden(cause, size)])
    for number in np.flatnonzero((design.protocol == "cyclic") & (design.profile < 0)):
        travel = benches[0].motion.displacement_mm[benches[0].design.number == number][0]
        last = slice(int(np.argmax(travel)), None)
        strain = travel[last] / design.gauge_mm[number]
        # The last unloading starts at 0.3, the sizes' own strain; harder mixtures may keep 1.4x
        zero = np.interp(0.0, force[number][last][::-1], strain[::-1])
        expected = size * 0.3
        assert 0.5 * expected < zero < 1.5 * expected


def test_frame_and_grips_take_travel_and_nothing_else() -> None:
    """With linear compliance the specimen is stretched by travel less C F, exactly."""
    effect, form = single("machine-compliance", "library", "final")
    _, benches, _ = laboratory("final")
    coupons = benches[0]
    force = force_N(benches, [Hidden(Cause(effect, form, {}, 0.0), 0.02)])[coupons.design.number]
    pulled = coupons.design.protocol == "monotonic"
    strain = (coupons.motion.displacement_mm - 0.02 * force) / coupons.design.gauge_mm[:, None]
    secant = coupons.law.secant_MPa(coupons.coordinate[:, 0])
    for row in np.flatnonzero(pulled):
        stress = strain[row] * np.interp(strain[row], STRAINS, secant[row])
        expected = stress * coupons.area_mm2[row]
        assert force[row] == pytest.approx(expected, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize(("kind", "set_name"), CASES)
def test_slip_takes_its_travel_from_the_first_row_on(kind: str, set_name: str) -> None:
    """Loaded, a specimen is stretched by travel less the slip of its own force."""
    _, form = single("grip-slip", kind, set_name)
    design, benches, _ = laboratory(set_name)
    shape = form.draw(np.random.default_rng(3), design)
    bench = form.apply(benches[0], form.high, shape)
    assert bench.slip_mm is not None
    response = solve(bench)
    secant = bench.law.secant_MPa(bench.coordinate[:, 0])
    for row in (1, 2, 20):  # loading in every protocol
        force = response.force_N[:, row]
        slipped, _ = bench.slip_mm(force)
        strain = (bench.motion.displacement_mm[:, row] - slipped) / bench.design.gauge_mm
        stress = strain * np.array(
            [np.interp(e, STRAINS, s) for e, s in zip(strain, secant, strict=True)]
        )
        # The solver stops at 1e-9 mm of 0.07 mm travel or more
        assert force == pytest.approx(stress * bench.area_mm2, rel=1e-6, abs=1e-7)


def test_oversize_and_gain_and_unit_have_their_numbers() -> None:
    design, benches, plain = laboratory("development")
    effect, form = single("cross-section", "library", "development")
    level = force_N(benches, [Hidden(Cause(effect, form, {}, 0.0), 0.2)])[:, 60] / plain[:, 60]
    expected = (1.0 + 0.2 / design.width_mm) * (1.0 + 0.2 / design.thickness_mm)
    assert level == pytest.approx(expected, rel=1e-9)
    pounds = EFFECTS["force-scale"].library["final"][1]
    level = change("final", EFFECTS["force-scale"], pounds, pounds.low)[:, 60]
    wrong = level > 1.0
    assert level[wrong] == pytest.approx(3.4482216, rel=1e-6)
    assert level[~wrong] == pytest.approx(0.0, abs=1e-9)
    assert 0.1 < wrong.mean() < 0.45


def test_bleed_changes_bars_with_boundaries_and_not_ramps() -> None:
    effect, form = single("interface-bleed", "library", "development")
    design, _, _ = laboratory("development")
    level = np.abs(change("development", effect, form, 0.5)).max(axis=1)
    kinds = np.array([design.profiles[p].kind if p >= 0 else "" for p in design.profile])
    assert level[kinds == "lamellae"].min() > 5.0 * level[kinds == "ramp"].max()


def test_an_off_grade_changes_its_own_coupons_only() -> None:
    design, _, _ = laboratory("final")
    for kind in ("library", "other"):
        effect, form = single("material-law", kind, "final")
        cause_shape = form.draw(np.random.default_rng(3), design)
        level = np.abs(change("final", effect, form, 0.2)).max(axis=1)
        own = np.isclose(design.coordinate, float(cause_shape["coordinate"]))
        coupons = design.profile < 0
        assert level[own].min() > 0.05
        assert level[own].max() < 0.2 + 1e-6
        assert level[coupons & ~own].max() < 1e-9
