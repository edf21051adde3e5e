"""The bench's mechanics against closed forms, its silence without an effect, its bookkeeping."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.withheld.reality.base_law import STRAINS, BaseLaw, fit_base_law
from benchmarks.withheld.reality.bench import Bench, mount
from benchmarks.withheld.reality.campaign import make_campaign
from benchmarks.withheld.reality.confounded import ELSEWHERE, SCENARIOS
from benchmarks.withheld.reality.design import Design, draw_design
from benchmarks.withheld.reality.effects import EFFECTS
from benchmarks.withheld.reality.noise import measured_force
from benchmarks.withheld.reality.palette_file import read_palette
from benchmarks.withheld.reality.sets import SETS
from benchmarks.withheld.reality.sizing import Hidden, force_N
from benchmarks.withheld.reality.solver import solve
from benchmarks.withheld.reality.strength import Yardstick, level_excess, relative_excess
from benchmarks.withheld.reality.tiers import Cause

ROOT = Path(__file__).parents[2]
PALETTE = read_palette(
    (ROOT / "printers/connex3/palettes/connex3-tango-vero.toml").read_text(encoding="utf-8")
)


def designed(set_name: str = "development", count: int = 30, seed: int = 1) -> Design:
    return draw_design(PALETTE, SETS[set_name].levels, count, np.random.default_rng(seed))


def linear_law(softest_MPa: float = 1.0, hardest_MPa: float = 10.0) -> BaseLaw:
    at = np.array([0.0, 1.0])
    log = np.log(np.array([softest_MPa, hardest_MPa]))
    return BaseLaw(at, np.repeat(log[:, None], len(STRAINS), axis=1))


def bars(law: BaseLaw) -> Bench:
    design = designed()
    return mount(PALETTE, design.take(design.profile >= 0), law)


def coupons(law: BaseLaw, protocol: str) -> Bench:
    design = designed()
    chosen = (design.profile < 0) & (design.protocol == protocol)
    return mount(PALETTE, design.take(chosen), law)


def test_a_bar_of_linear_materials_is_springs_in_series() -> None:
    bench = bars(linear_law())
    modulus = 10.0**bench.coordinate
    compliance = np.sum(bench.element_mm / modulus, axis=1) / bench.area_mm2
    expected = bench.motion.displacement_mm / compliance[:, None]
    response = solve(bench)
    # The solver stops at 1e-9 mm of some 3 mm travel
    assert response.force_N == pytest.approx(expected, rel=1e-7, abs=1e-7)
    stretched = np.sum(response.strain * bench.element_mm[:, None, :], axis=2)
    assert stretched == pytest.approx(bench.motion.displacement_mm, abs=1e-7)


@pytest.mark.parametrize("network", ["eight-chain", "gent"])
def test_the_base_law_stays_within_its_stated_misfit_of_the_palette(network: str) -> None:
    law = fit_base_law(PALETTE, network, 0.01)
    at = STRAINS[2:]
    for grade, log_secant in zip(PALETTE.grades, law.log_secant_MPa, strict=True):
        inside = at <= 0.9 * grade.break_strain
        misfit = np.exp(log_secant[2:]) * at / grade.stress_MPa(at) - 1.0
        assert np.sqrt(np.mean(misfit[inside] ** 2)) < 0.0105
        assert np.abs(misfit[inside]).max() < 0.05
        assert (np.diff(STRAINS * np.exp(log_secant)) > 0).all()
    between = law.secant_MPa(np.linspace(0.0, 1.0, 61))
    assert (np.diff(between, axis=0) > 0).all()


def test_memory_of_one_exponential_is_the_closed_form() -> None:
    """Ramp at rate r then hold, palette's curve E strain, G = g + (1 - g) exp(-t / tau).

    The palette's pull at rate R made that curve of the law
    s = E (strain / g - (1 / g - 1) (1 - exp(-k strain)) / k), k = g / (R tau): creep is
    J = 1 / g - (1 / g - 1) exp(-g t / tau). Another ramp leaves g s + (1 - g) m of it, with
    m = E r (tau (1 - exp(-t / tau)) / g
    - (1 / g - 1) (exp(-k r t) - exp(-t / tau)) / (1 / tau - k r)), which fades in the hold.
    """
    plain = coupons(linear_law(2.0, 2.0), "relaxation")
    g, tau = 0.6, 5.0
    bench = replace(
        plain,
        relaxation=lambda t: g + (1.0 - g) * np.exp(-t / tau),
        memory_share=np.ones_like(plain.coordinate),
    )
    force = solve(bench).force_N
    k, more = g / (PALETTE.strain_rate_per_s * tau), 1.0 / g - 1.0
    for row in range(len(force)):
        time = bench.motion.time_s[row]
        strain = bench.motion.displacement_mm[row] / bench.design.gauge_mm[row]
        end = time[np.argmax(strain)]
        r = strain.max() / end
        t = np.minimum(time, end)
        law = strain / g - more * -np.expm1(-k * strain) / k
        fading = tau * -np.expm1(-t / tau) / g
        fading -= more * (np.exp(-k * r * t) - np.exp(-t / tau)) / (1.0 / tau - k * r)
        memory = r * fading * np.exp((t - time) / tau)
        exact = 2.0 * bench.area_mm2[row] * (g * law + (1.0 - g) * memory)
        # Rows are a fortieth of the ramp, the law's own cells finer
        assert np.abs(force[row] - exact).max() < 3e-4 * exact.max()


def test_nothing_hidden_is_the_palette_within_the_scatter() -> None:
    """Whitened by what was drawn, the levels of 300 specimens are standard normal."""
    scores, rms = [], []
    for index in range(10):
        campaign = make_campaign(PALETTE, "development", "none", 30, 31, index)
        scatter = campaign.truth["scatter"]
        design = campaign.design
        law = fit_base_law(PALETTE, "eight-chain", 0.0)
        groups = (design.profile < 0, design.profile >= 0)
        model = force_N([mount(PALETTE, design.take(g), law) for g in groups])
        level = np.mean(relative_excess(campaign.force_N, model), axis=1)
        shares = ("specimen", "batch", "calibration")
        sd = np.sqrt(sum(scatter[s] ** 2 for s in shares))
        scores.append(level / sd)
        rms.append(campaign.truth["gap"]["before"] / sd)
        assert campaign.truth["effects"] == []
        assert campaign.truth["snr"] == 0.0
    # Some 4 grades and 2 batches a campaign are shared: about 60 independent values in 10
    assert 0.75 < np.std(scores) < 1.3
    assert abs(np.mean(scores)) < 0.4
    # Normalised by the peak, curves count about half
    assert 0.3 < np.mean(rms) < 1.1


def test_heavy_tails_and_scatter_are_what_their_tiers_say() -> None:
    noisy = {
        tier: [make_campaign(PALETTE, "final", tier, 20, 2, i).truth["scatter"] for i in range(2)]
        for tier in ("none", "none-t4", "none-scatter")
    }
    for nominal, heavy, wide in zip(*noisy.values(), strict=True):
        assert wide["specimen"] == pytest.approx(1.6 * nominal["specimen"])
        assert (nominal["freedom"], heavy["freedom"]) == (0, 4)
    scatter = SETS["final"].draw_scatter(np.random.default_rng(1), 1.0, 4)
    design = designed("final", 120)
    force = np.full((120, 121), 20.0)
    drawn = [
        np.log(measured_force(force, force / 20.0 - 0.5, design, scatter, rng).mean(axis=1) / 20.0)
        for rng in map(np.random.default_rng, range(30))
    ]
    level = (np.concatenate(drawn) - np.mean(drawn)) / np.std(drawn)
    # A normal's kurtosis is 3, with a standard error of 0.08 for 3,600 draws
    assert np.mean(level**4) > 3.5


def test_the_signal_to_noise_ratio_is_that_of_the_generalised_least_squares_amplitude() -> None:
    """Over noise alone, the amplitude of the excess's pattern scatters by one over the SNR."""
    design = designed()
    scatter = replace(
        SETS["development"].draw_scatter(np.random.default_rng(5), 1.0, 0), calibration=0.0
    )
    law = fit_base_law(PALETTE, "eight-chain", 0.0)
    benches = tuple(
        mount(PALETTE, design.take(g), law) for g in (design.profile < 0, design.profile >= 0)
    )
    plain = force_N(benches)
    by = Yardstick.of(benches, scatter, plain)
    form = EFFECTS["ageing"].library["development"][0]
    cause = Cause(EFFECTS["ageing"], form, {"sign": 1.0}, 0.0)
    pattern = level_excess(relative_excess(force_N(benches, [Hidden(cause, 0.1)]), plain))
    weights = np.linalg.solve(by.level, pattern)
    amplitudes = []
    for seed in range(400):
        rng = np.random.default_rng(seed)
        measured = measured_force(plain, by.travel, design, scatter, rng)
        level = np.mean(relative_excess(measured, plain), axis=1)
        amplitudes.append(level @ weights / (pattern @ weights))
    # 400 draws give a standard deviation to 3.5 %; sensors' noise and rounding are left out
    assert np.std(amplitudes) == pytest.approx(1.0 / by.snr(pattern), rel=0.12)


@pytest.mark.parametrize("draws", [range(3), pytest.param(range(3, 6), marks=pytest.mark.long)])
@pytest.mark.parametrize("set_name", SETS)
def test_effects_are_as_visible_as_was_drawn_unless_their_range_ends(
    set_name: str, draws: range
) -> None:
    for index in draws:
        truth = make_campaign(PALETTE, set_name, "other", 30, 17, index).truth
        (cause,) = truth["causes"]
        effect = EFFECTS[cause["effect"]]
        form = next(f for f in effect.other[set_name] if f.name == cause["form"])
        assert form.low <= cause["size"] <= form.high
        assert truth["gap"]["noise"] < 0.15
        if form.low < cause["size"] < form.high:
            assert cause["snr"] == pytest.approx(cause["snr_wanted"], rel=0.25)


def test_cancelling_effects_leave_less_than_either() -> None:
    shares = []
    for index in range(6):
        truth = make_campaign(PALETTE, "final", "cancelling", 30, 6, index).truth
        first, second = (cause["excess_rms"] for cause in truth["causes"])
        shares.append(truth["excess_rms"] / np.hypot(first, second))
    # Effects that knew nothing of each other would leave 1
    assert max(shares) < 0.9
    assert np.mean(shares) < 0.7


@pytest.mark.parametrize("index", range(len(ELSEWHERE)))
@pytest.mark.parametrize("set_name", SETS)
def test_a_lab_elsewhere_has_no_test_at_the_palettes_condition(set_name: str, index: int) -> None:
    campaign = make_campaign(PALETTE, set_name, "elsewhere", 30, 6, index)
    design, truth = campaign.design, campaign.truth
    levels = SETS[set_name].levels
    column, own = {
        "all-warm": (design.temperature_C, levels.temperatures_C[0]),
        "all-slow": (design.strain_rate_per_s, PALETTE.strain_rate_per_s),
        "all-soaked": (design.soak_h, levels.soaks_h[0]),
        "all-old": (design.age_days, levels.ages_days[0]),
    }[truth["design"]]
    assert np.ptp(column) <= 0.01 * column.max()  # rates are rounded to three digits
    assert not np.any(np.abs(column / own - 1.0) < 0.1) if own else np.all(column > 0.0)
    assert set(truth["effects"]) <= {i for (i,) in truth["class"]}


@pytest.mark.parametrize("scenario", SCENARIOS, ids=lambda s: s.name)
@pytest.mark.parametrize("set_name", SETS)
def test_members_of_a_class_make_the_same_pattern(set_name: str, scenario: object) -> None:
    """Cosine of the members' excess above 0.95 (of gap-design's classes), in every design."""
    rules = SETS[set_name]
    law = fit_base_law(PALETTE, rules.network, rules.largest_misfit)
    for seed in range(3):
        design = scenario.restrict(designed(set_name, 30, seed), rules.levels, 0.034)  # type: ignore[attr-defined]
        benches = (mount(PALETTE, design, law),)
        plain = force_N(benches)
        patterns = []
        for member in scenario.members:  # type: ignore[attr-defined]
            form = member.find()
            shape = {**form.draw(np.random.default_rng(1), design), **member.fixed}
            cause = Cause(EFFECTS[member.effect], form, shape, 0.0)
            size = form.low + 0.2 * (form.high - form.low)
            excess = relative_excess(force_N(benches, [Hidden(cause, size)]), plain).ravel()
            patterns.append(excess / np.linalg.norm(excess))
        cosines = np.array(patterns) @ np.array(patterns).T
        assert cosines.min() > 0.95
