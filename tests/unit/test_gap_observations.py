"""The observation model of a campaign: segments, shared tests, steps, slices and features."""

import subprocess
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import find_peaks
from scipy.special import ndtr

from planner.errors import FileError
from planner.gap.campaign import Campaign, Specimen, StrainField
from planner.gap.campaign_folder import read_campaign, write_campaign
from planner.gap.diagnose import prepared
from planner.gap.effects import EFFECTS
from planner.gap.observations import BRANCHES, ObservationModel
from planner.gap.segments import _turns, path_of
from planner.materials.laws import make_law
from planner.numerics import FloatArray
from planner.palette import LawParameters, Material, Palette, Reference
from planner.simulation.bar import ProfileDesign, slice_edges_mm
from planner.simulation.bar_solver import law_tables, predict

WARM_LAB = Path(__file__).parents[2] / "samples" / "warm-lab"

PALETTE = Palette(
    "two",
    (
        Material("soft", 0.0, 0.9, 1.1, LawParameters("neo-hookean", {"mu_MPa": (0.6,)})),
        Material("firm", 1.0, 0.5, 1.1, LawParameters("neo-hookean", {"mu_MPa": (4.0,)})),
    ),
    Reference(0.03, 23.0, 0.0, 9.0, "x"),
)
LAWS = law_tables(PALETTE)


def stress_MPa(coordinate, strain):
    return LAWS.stress_and_tangent_MPa(coordinate, strain)[0]


GAUGE_MM = 40.0
NOISE_N = 0.02
STEPPED = ProfileDesign("stepped", [0.0, 15.0, 15.0, 25.0, 25.0, 40.0], [0, 0, 1, 1, 0, 0])
SMOOTH = ProfileDesign("smooth", [0.0, 40.0], [0.0, 1.0])

PULL = ((0.0, 0.0), (12.0, 12.0))
CYCLE = ((0.0, 0.0), (5.0, 5.0), (9.0, 1.0), (18.0, 10.0), (27.0, 1.0))
HOLD = ((0.0, 0.0), (8.0, 8.0), (308.0, 8.0))


def specimen(id, corners=PULL, *, rng=None, rows=240, material="soft", factor=1.0, **more):
    """A coupon that follows its law, and a sensor that does not quite."""
    at, places = np.array(corners).T
    time = np.linspace(at[0], at[-1], rows)
    if len(corners) == 3 and corners[1][1] == corners[2][1]:
        ramp = np.linspace(0.0, at[1], rows // 2)
        time = np.concatenate([ramp, at[1] + np.geomspace(0.05, at[2] - at[1], rows - rows // 2)])
    travel = np.interp(time, at, places)
    coordinate = PALETTE.resolve(material).coordinate
    force = factor * 30.0 * stress_MPa(coordinate, np.maximum(travel, 0.0) / GAUGE_MM)
    if rng is not None:
        force = force + NOISE_N * rng.normal(size=rows)
    known = {"width_mm": 10.0, "thickness_mm": 3.0, "rate_mm_s": 1.0, "temperature_C": 23.0} | more
    return Specimen(id, time, travel, force, GAUGE_MM, material=material, **known)


def bar(id, design, *, rng, field=False):
    """A bar that follows the forward model, seen by a camera of 1 mm spacing."""
    blank = specimen(id)
    blank = replace(blank, material=None, profile=design)
    model = ObservationModel(Campaign("c", "p", PALETTE, (blank,)))
    found = predict(model.setup, LAWS)
    steps_s = model.setup.time_s[0]
    force = np.interp(blank.time_s, steps_s, found.force_N[0])
    seen = None
    if field:
        x = np.arange(1.0, 39.5, 1.0)
        frames = np.linspace(1.5, 12.0, 8)
        edges = slice_edges_mm(design)
        along = np.concatenate([[0.0], np.cumsum(np.diff(edges))])
        strain = []
        for time in frames:
            now = [np.interp(time, steps_s, s) for s in found.strain.T]
            reached = np.concatenate([[0.0], np.cumsum(now * np.diff(edges))])
            ends = np.interp([x - 0.5, x + 0.5], along, reached)
            strain.append(ends[1] - ends[0])
        noise = 1e-4 * rng.normal(size=(8, len(x)))
        seen = StrainField(frames, x, np.array(strain) + noise, facet_mm=1.0)
    noisy = force + NOISE_N * rng.normal(size=len(force))
    return replace(blank, force_N=noisy, strain_field=seen)


def cycled(id, cycles, *, seed=0, rows_a_cycle=60, lost=0.3, **more):
    """A rubber under cycles to a strain of 0.5: it softens, loses energy and keeps a set of 0.03.

    Its force comes back to 0 each time; in the last cycle `lost` of the first peak is gone.
    """
    half_s, strain, left = 20.0, 0.5, 0.03
    time = np.linspace(0.0, 2.0 * half_s * cycles, rows_a_cycle * cycles)
    up = (time / half_s) % 2.0 < 1.0
    travel = half_s * (1.0 - np.abs(1.0 - (time / half_s) % 2.0))
    virgin = time < half_s
    felt = np.where(virgin, travel / GAUGE_MM, np.maximum(travel / GAUGE_MM - left, 0.0))
    share = travel / (strain * GAUGE_MM)
    softened = 1.0 - np.where(virgin, 0.0, 0.3 * (1.0 - share))
    hysteresis = 1.0 - np.where(up, 0.0, 0.25 * np.sin(np.pi * share))
    fatigue = 1.0 - lost * np.floor(time / (2.0 * half_s)) / cycles
    force = 30.0 * stress_MPa(0.0, felt) * softened * hysteresis * fatigue
    force = force + 2.0 * NOISE_N * np.random.default_rng(seed).normal(size=len(time))
    known = {"width_mm": 10.0, "thickness_mm": 3.0, "rate_mm_s": 1.0, "temperature_C": 23.0} | more
    return Specimen(id, time, travel, force, GAUGE_MM, material="soft", protocol="cyclic", **known)


def campaign(*specimens):
    return Campaign("bench", "printer", PALETTE, specimens)


@pytest.fixture(scope="module")
def mixed():
    rng = np.random.default_rng(3)
    return campaign(
        specimen("P1", rng=rng, batch="A"),
        specimen("C1", CYCLE, rng=rng, protocol="cyclic"),
        bar("B1", STEPPED, rng=rng, field=True),
        specimen("P2", rng=rng, batch="B"),
        specimen("R1", HOLD, rng=rng, protocol="relaxation"),
        specimen("F1", rng=rng, material="firm", temperature_C=None),
        specimen("C2", CYCLE, rng=rng, protocol="cyclic"),
    )


@pytest.fixture(scope="module")
def model(mixed):
    return ObservationModel(mixed)


def test_replicates_share_a_test_whatever_their_batch(model):
    assert model.tests == ((0, 3), (1, 6), (2,), (4,), (5,))
    assert model.test_of.tolist() == [0, 1, 2, 0, 3, 4, 1]
    assert model.limitations == ()


def test_segments_are_found(mixed):
    paths = [path_of(mixed.specimens[place]) for place in (0, 1, 4)]
    kinds = [[segment.kind for segment in path.segments] for path in paths]
    back_and_forth = ["loading", "unloading", "reloading", "unloading"]
    assert kinds == [["loading"], back_and_forth, ["loading", "hold"]]
    ends = [segment.end_mm for segment in paths[1].segments]
    # Turns lie between rows; the lines on both sides meet at the turn.
    np.testing.assert_allclose(ends, [5.0, 1.0, 10.0, 1.0], atol=1e-6)
    ends = [segment.end_s for segment in paths[2].segments]
    np.testing.assert_allclose(ends, [8.0, 308.0], atol=1e-6)


def test_steps_go_from_rest_through_all_segments(model):
    setup = model.setup
    assert setup.time_s.shape == setup.travel_mm.shape == (5, 64)
    assert (setup.time_s[:, 0] == 0.0).all()
    assert (setup.travel_mm[:, 0] == 0.0).all()
    assert (np.diff(setup.time_s, axis=1) > 0.0).all()
    turns = np.array([5.0, 9.0, 18.0, 27.0])
    counts = np.diff(np.searchsorted(setup.time_s[1], turns + 1e-6))
    assert counts.min() >= 6
    since = setup.time_s[3] - 8.0
    since = since[since > 1e-6]
    # Even in the logarithm of time, but for halves of strides that features' steps leave.
    strides = np.diff(np.log1p(since / 0.3))
    assert strides.max() < 2.5 * strides.min()
    assert since[0] < 0.01 * since[-1]


def test_covariates_are_the_records_or_unknown(model):
    setup = model.setup
    np.testing.assert_allclose(setup.rate_per_s, 1.0 / GAUGE_MM, rtol=1e-6)
    assert setup.temperature_C.tolist() == [23.0] * 5
    assert setup.soak_h.tolist() == [0.0] * 5  # the reference's, and not known
    assert setup.age_days.tolist() == [9.0] * 5
    assert setup.orientation.tolist() == [0] * 5
    # So that an effect of any of these does nothing there.
    for form in (
        EFFECTS[id].forms[0] for id in ("temperature", "moisture", "ageing", "orientation")
    ):
        after = form.apply(setup, {p.name: p.usual for p in form.parameters})
        np.testing.assert_allclose(after.log_factor, 0.0, atol=1e-15)
    printed_z = replace(PALETTE, reference=replace(PALETTE.reference, orientation="z"))
    upright = ObservationModel(Campaign("c", "p", printed_z, (specimen("a"),)))
    assert upright.setup.orientation.tolist() == [2]
    assert [design is not None for design in setup.designs] == [False, False, True, False, False]


def test_features_lie_on_the_curves_within_noise(model):
    raw = model.predicted(predict(model.setup, model.laws))
    table = model.table
    assert np.bincount(table.specimen).tolist()[:2] == [9, 19]
    assert (np.diff(table.specimen) >= 0).all()
    force = ~table.is_field & (table.step > 0)  # a record's start is as it was read
    # Local parabolas even out some noise; 4.5 deviations of 80 figures are passed once in 2000.
    assert np.abs(raw - table.measured_raw)[force].max() < 4.5 * NOISE_N
    assert np.std((raw - table.measured_raw)[force]) < 0.8 * NOISE_N
    # The camera's noise is 1e-4 a place, three places a bin; what is left is interpolation.
    assert np.abs(raw - table.measured_raw)[table.is_field].max() < 5e-4
    np.testing.assert_allclose(model.sensor_sd_N[:, 0], NOISE_N, rtol=0.4)


def test_features_by_branch(model):
    table = model.table
    branches = [
        Counter(BRANCHES[b] for b in table.branch[table.specimen == place]) for place in range(7)
    ]
    # With the record's start.
    assert branches[0] == {"loading": 9}
    assert branches[1] == {"loading": 7, "unloading": 8, "reloading": 4}
    assert branches[4] == {"loading": 9, "hold": 5}
    fields = branches[2]["field"]
    assert fields == 2 * 13  # of 39 places three a bin, at two instants
    held = table.time_s[(table.specimen == 4) & (table.branch == BRANCHES.index("hold"))]
    assert held[-1] == pytest.approx(300.0, rel=1e-3)  # since the hold began
    steps = model.setup.travel_mm[table.test, table.step] / GAUGE_MM
    np.testing.assert_allclose(table.strain, steps)


def test_evenly_strained_bars_are_seen_evenly(model):
    table = model.table
    prediction = predict(model.setup, model.laws)
    even = replace(prediction, strain=np.full_like(prediction.strain, 0.123))
    np.testing.assert_allclose(model.predicted(even)[table.is_field], 0.123)
    np.testing.assert_allclose(model.seen(even, model.field_weights.weight), 0.123)


def test_written_and_read_campaign_is_the_same(mixed, model, tmp_path):
    again = ObservationModel(read_campaign(write_campaign(mixed, tmp_path / "c")))
    assert again.tests == model.tests
    # Nine digits are written, of forces whose features a difference of noisy rows can magnify.
    np.testing.assert_allclose(again.table.measured, model.table.measured, atol=1e-5)


def test_pulls_to_different_ends_share_the_way_up_to_the_shortest():
    ends = [campaign(specimen("a"), specimen("b", ((0.0, 0.0), (end, end)))) for end in (9.0, 4.0)]
    near, far = map(ObservationModel, ends)
    assert near.tests == ((0, 1),)
    assert near.setup.travel_mm[0, -1] == pytest.approx(9.0)
    assert far.tests == ((0,), (1,))


def test_another_pace_is_another_test():
    slow = specimen("b", ((0.0, 0.0), (24.0, 12.0)))  # declared 1 mm/s, went at 0.5
    found = ObservationModel(campaign(specimen("a"), slow))
    assert found.tests == ((0,), (1,))
    np.testing.assert_allclose(found.setup.rate_per_s * GAUGE_MM, [1.0, 0.5], rtol=1e-6)


def test_measured_gauges_are_replicates_at_the_same_strains():
    rng = np.random.default_rng(8)
    gauges = (26.1, 25.7, 26.4)
    whole = [specimen(f"{g}", rng=rng) for g in gauges]
    specimens = [
        replace(s, gauge_mm=g, displacement_mm=s.displacement_mm * g / GAUGE_MM)
        for s, g in zip(whole, gauges, strict=True)
    ]
    found = ObservationModel(campaign(*specimens))
    assert found.tests == ((0, 1, 2),)
    assert found.setup.gauge_mm.tolist() == [26.1]
    assert found.setup.travel_mm[0, -1] == pytest.approx(26.1 * 12.0 / GAUGE_MM)
    # Local parabolas even out some noise; four deviations of the difference of two.
    np.testing.assert_allclose(found.measured_N[1:], found.measured_N[[0, 0]], atol=5.7 * NOISE_N)
    raw = found.predicted(predict(found.setup, LAWS))
    assert np.abs(raw - found.table.measured_raw).max() < 4.5 * NOISE_N
    other = replace(specimens[0], id="c", gauge_mm=30.0)
    assert len(ObservationModel(campaign(*specimens, other)).tests) == 2


def test_measured_sections_are_replicates_at_the_same_stress():
    """Cut or printed ones differ by some per cent: each was a condition of its own."""
    rng = np.random.default_rng(8)
    sections = ((6.0, 2.0), (6.3, 1.93), (5.85, 2.08))
    whole = [specimen(f"{w}", rng=rng) for w, _ in sections]
    drawn = whole[0].width_mm * whole[0].thickness_mm
    specimens = [
        replace(s, width_mm=w, thickness_mm=t, force_N=s.force_N * w * t / drawn)
        for s, (w, t) in zip(whole, sections, strict=True)
    ]
    found = ObservationModel(campaign(*specimens))
    assert found.tests == found.replicates == ((0, 1, 2),)
    # Forces of all are of their mean section.
    np.testing.assert_allclose(found.measured_N[1:], found.measured_N[[0, 0]], atol=6 * NOISE_N)
    raw = found.predicted(predict(found.setup, LAWS))
    assert np.abs(raw - found.table.measured_raw).max() < 5 * NOISE_N
    other = replace(specimens[0], id="c", thickness_mm=4.0, force_N=2.0 * specimens[0].force_N)
    assert len(ObservationModel(campaign(*specimens, other)).tests) == 2


def told(column, cells):
    """Six specimens of each of two materials, and a further column."""
    made = [specimen(f"{m}{k}", material=m) for m in ("soft", "firm") for k in range(6)]
    return [replace(s, covariates={column: cell}) for s, cell in zip(made, cells, strict=True)]


@pytest.mark.parametrize(
    ("cells", "sizes"),
    [
        (["A", "B"] * 6, [3, 3, 3, 3]),  # a treatment
        ([10.0, 20.0, 30.0] * 4, [2] * 6),  # a setting
        (["A"] * 6 + ["B"] * 6, [6, 6]),  # goes with the material anyway
        ([f"S{k}" for k in range(12)], [6, 6]),  # serial numbers
        ([40.0 + 0.7 * k for k in range(12)], [6, 6]),  # humidity as it was
        ([f"slot {k}" for k in range(6)] * 2, [6, 6]),  # one place of the tray each
        (["A"] * 5 + ["B"] + ["A"] * 6, [5, 1, 6]),
    ],
)
def test_a_further_column_that_was_repeated_tells_replicates_apart(cells, sizes):
    found = ObservationModel(campaign(*told("column", cells)))
    # What nothing predicts otherwise is one test of the forward model all the same.
    assert [len(test) for test in found.tests] == [6, 6]
    assert sorted(map(len, found.replicates)) == sorted(sizes)
    alike = [np.unique(found.table.specimen[found.table.replicates == k]).tolist()
             for k in range(len(sizes))]  # fmt: skip
    assert [tuple(places) for places in alike] == list(found.replicates)


def test_measured_sections_are_allowed_for():
    thick = specimen("b", factor=1.1, measured_width_mm=11.0, measured_thickness_mm=3.0)
    found = ObservationModel(campaign(specimen("a"), thick))
    assert found.tests == ((0, 1),)
    assert found.setup.area_mm2.tolist() == [pytest.approx(31.5)]
    np.testing.assert_allclose(found.measured_N[0], found.measured_N[1], rtol=1e-9, atol=1e-9)
    assert found.setup.width_mm.tolist() == [10.0]


def test_only_what_came_before_a_break_counts():
    whole = specimen("a", rng=np.random.default_rng(0))
    force = np.where(whole.time_s > 8.0, 0.02 * whole.force_N, whole.force_N)
    broken = ObservationModel(campaign(replace(whole, force_N=force)))
    assert 7.8 < broken.setup.travel_mm[0, -1] <= 8.0
    assert any("a: broke" in sentence for sentence in broken.limitations)


@pytest.mark.parametrize("at", [1, 50, 120, 236, 238, 239])
def test_a_spike_does_not_spoil_what_is_compared(at):
    clean = specimen("a", rng=np.random.default_rng(0))
    force = np.array(clean.force_N)
    force[at] = 60.0
    spoilt = ObservationModel(campaign(replace(clean, force_N=force)))
    whole = ObservationModel(campaign(clean))
    assert spoilt.limitations == ()
    assert spoilt.table.step.tolist() == whole.table.step.tolist()
    # Of the last row is missed what force rises in one step, 0.06 N.
    np.testing.assert_allclose(spoilt.table.measured_raw, whole.table.measured_raw, atol=0.08)


def test_what_breaks_before_a_stop_broke():
    whole = specimen("a", rng=np.random.default_rng(0))
    force = np.where(whole.time_s > 8.0, 0.0, whole.force_N)
    force[-3:] = 3.0, 12.0, 25.0
    path = path_of(replace(whole, force_N=force))
    assert path.broken
    assert 7.8 < path.segments[-1].end_mm <= 8.0


def test_a_coarse_travel_is_one_loading():
    fine = specimen("a", ((0.0, 0.0), (15.0, 0.25)), rng=np.random.default_rng(0))
    coarse = replace(fine, displacement_mm=np.round(fine.displacement_mm / 0.005) * 0.005)
    found, expected = (ObservationModel(campaign(one)) for one in (coarse, fine))
    assert [segment.kind for segment in path_of(coarse).segments] == ["loading"]
    # Half a digit of travel, in a force that rises by 47 N/mm near rest.
    raw = expected.table.measured_raw
    np.testing.assert_allclose(found.table.measured_raw, raw, atol=0.0025 * 47.0 + NOISE_N)


def test_strain_beyond_the_laws_is_left_out():
    far = ObservationModel(campaign(specimen("a", ((0.0, 0.0), (48.0, 48.0)))))
    assert far.setup.travel_mm[0, -1] == pytest.approx(1.3 * 0.9 * GAUGE_MM)
    firm = ObservationModel(campaign(specimen("a", ((0.0, 0.0), (48.0, 48.0)), material="firm")))
    assert firm.setup.travel_mm[0, -1] == pytest.approx(1.3 * 0.5 * GAUGE_MM)
    rng = np.random.default_rng(1)
    graded = bar("a", SMOOTH, rng=rng)
    stretched = replace(graded, displacement_mm=graded.displacement_mm * 3.0)
    found = ObservationModel(campaign(stretched))
    strain = predict(found.setup, found.laws).strain
    assert strain.max() <= 1.3 * 0.9 + 1e-6
    assert found.setup.travel_mm[0, -1] < 36.0
    assert all(len(m.limitations) == 1 for m in (far, firm, found))


def test_tapes_are_compared_as_far_as_their_laws_are_followed():
    stretches = replace(PALETTE.materials[0], elongation_at_break=6.0)
    tape = replace(PALETTE, materials=(stretches, PALETTE.materials[1]))
    rng = np.random.default_rng(6)
    far = specimen("a", ((0.0, 0.0), (300.0, 300.0)), rows=900)
    law = make_law(stretches.law).nominal_stress_MPa(1.0 + far.strain)
    far = replace(far, force_N=30.0 * law + NOISE_N * rng.normal(size=900))
    blank = replace(far, id="b", material=None, profile=STEPPED)
    found = ObservationModel(Campaign("c", "p", tape, (far, blank)))
    assert found.setup.travel_mm[0, -1] == pytest.approx(300.0)
    raw = found.predicted(predict(found.setup, found.laws))
    assert np.abs(raw - found.table.measured_raw)[found.table.test == 0].max() < 4.5 * NOISE_N
    strain = predict(found.setup, found.laws).strain
    assert 3.0 < strain.max() <= 1.3 * 6.0 + 1e-6


def test_noise_of_the_travel_makes_no_turns():
    rng = np.random.default_rng(2)
    for corners in (PULL, CYCLE, HOLD):
        clean = specimen("a", corners, rows=600)
        shaken = replace(clean, displacement_mm=clean.displacement_mm + 0.02 * rng.normal(size=600))
        kinds = [[segment.kind for segment in path_of(s).segments] for s in (clean, shaken)]
        assert kinds[0] == kinds[1]


def test_turns_are_the_peaks_and_valleys_of_scipy_that_are_prominent_enough():
    rng = np.random.default_rng(3)
    turned = 0
    for number in range(600):
        steps = rng.normal(size=rng.integers(1, 60))
        # Rounded coarsely, places are met twice, and stay the same for a while.
        travel = np.round(np.cumsum(steps), (0, 1, 12)[number % 3])
        least = float(rng.choice([0.3, 1.0, 2.5]))
        found = [
            find_peaks(way * travel, prominence=least, plateau_size=1)[1]["left_edges"]
            for way in (1.0, -1.0)
        ]
        wanted = np.unique(np.concatenate([[0], *found]))
        after = np.abs(travel[wanted[-1] :] - travel[wanted[-1]])
        end = [wanted[-1] + after.argmax()] if after.any() else []
        assert _turns(travel, least).tolist() == [*wanted, *end]
        turned += len(wanted) > 1
    assert turned > 300


def test_a_diagnosis_waits_for_no_package_that_it_does_not_use():
    script = (
        "import sys\nfrom pathlib import Path\nimport planner\n"
        f"planner.diagnose(Path({str(WARM_LAB)!r}))\n"
        "assert not {'scipy.signal', 'scipy.interpolate', 'scipy.stats'} & sys.modules.keys()"
    )
    subprocess.run([sys.executable, "-c", script], check=True)


def test_waiting_before_the_test_and_preload_are_taken_off():
    waiting = specimen("a", ((0.0, 0.0), (6.0, 0.0), (18.0, 12.0)))
    preload = specimen("b", ((0.0, 0.4), (11.6, 12.0)))
    for one in (waiting, preload):
        found = ObservationModel(campaign(one)).setup
        assert (found.time_s[0, 0], found.travel_mm[0, 0]) == (0.0, 0.0)
        # A wait is a rest within 0.4 % of the travel, so its end is known to as much.
        assert found.time_s[0, -1] == pytest.approx(12.0, abs=0.06)


def test_hold_after_a_ramp_of_two_rows_still_counts():
    time = np.concatenate([[0.0, 0.5], 0.5 + np.geomspace(0.2, 100.0, 60)])
    travel = np.minimum(8.0 * time / 0.5, 8.0)
    force = 30.0 * stress_MPa(0.0, travel / GAUGE_MM)
    fast = replace(specimen("a"), time_s=time, displacement_mm=travel, force_N=force)
    found = ObservationModel(campaign(fast))
    assert [BRANCHES[b] for b in found.table.branch] == 2 * ["loading"] + 5 * ["hold"]


def test_a_hold_that_steps_half_way_is_one_hold():
    """As many rows before the step as behind it: their median lies between, near none of them."""
    held = specimen("a", HOLD, rows=101)
    travel = np.array(held.displacement_mm)
    top = np.flatnonzero(travel >= 8.0)
    assert len(top) % 2 == 0
    travel[top[len(top) // 2] :] = 8.015
    kinds = [s.kind for s in path_of(replace(held, displacement_mm=travel)).segments]
    assert kinds == ["loading", "hold"]


@pytest.mark.parametrize("rows_a_cycle", [16, 60, 401])
@pytest.mark.parametrize("cycles", [2, 5, 10, 12, 13, 20, 50])
def test_first_and_last_cycles_are_compared_however_many_there_are(cycles, rows_a_cycle):
    one = cycled("a", cycles, rows_a_cycle=rows_a_cycle)
    path = path_of(one)
    assert not path.broken
    kinds = [segment.kind for segment in path.segments]
    assert kinds == ["loading", "unloading", *["reloading", "unloading"] * (len(kinds) // 2 - 1)]
    assert sum(s.cycles for s in path.segments if s.kind == "reloading") == cycles - 1
    assert len(kinds) == min(2 * cycles, 24)
    found = ObservationModel(campaign(one, cycled("b", cycles, seed=1, rows_a_cycle=rows_a_cycle)))
    assert found.tests == ((0, 1),)
    times, table = found.setup.time_s[0], found.table
    assert times[-1] == pytest.approx(40.0 * cycles, rel=0.015)
    step = table.step[(table.specimen == 0) & (table.branch == BRANCHES.index("reloading"))]
    # The last cycle begins 40 s before the end.
    assert (times[step] > 40.0 * (cycles - 1) - 0.5).all()
    first = table.step[(table.specimen == 0) & (table.branch == BRANCHES.index("unloading"))]
    assert ((times[first] < 40.5) | (times[first] > times[step[-1]])).all()
    on_grid = np.interp(times, one.time_s, one.force_N)
    # On the record, but for the corner, which lies between rows; 8 rows make a coarse way.
    below = step[:-1]
    assert np.abs(found.measured_N[0] - on_grid)[below].max() < 0.02 * on_grid.max()
    said = [sentence for sentence in found.limitations if "cycles" in sentence]
    assert len(said) == len(found.limitations) == (cycles > 12)


def test_a_specimen_that_breaks_in_its_seventh_cycle_broke():
    one = cycled("a", 10)
    gone = np.where(one.time_s > 6 * 40.0 + 12.0, 0.1, 1.0)
    for factor in (gone, np.where(one.time_s > 6 * 40.0, 0.0, 1.0)):
        path = path_of(replace(one, force_N=factor * one.force_N))
        assert path.broken
        assert path.segments[-1].end_s == pytest.approx(246.0, abs=7.0)


def test_nothing_to_compare_is_refused():
    noise = np.random.default_rng(4).normal(size=240)
    idle = replace(specimen("a"), displacement_mm=0.01 * noise)
    with pytest.raises(FileError, match="no specimen loads"):
        ObservationModel(campaign(idle))
    partly = ObservationModel(campaign(specimen("b"), idle))
    assert partly.test_of.tolist() == [0, -1]
    assert "specimen a: no loading" in partly.limitations[0]
    assert np.isnan(partly.measured_N[1]).all()


def test_unknown_section_is_one_and_said():
    bare = specimen("a", width_mm=None, thickness_mm=None)
    found = ObservationModel(campaign(bare))
    assert found.setup.area_mm2.tolist() == [1.0]
    assert found.setup.width_mm.tolist() == [1.0]
    assert "section is unknown" in found.limitations[0]


@pytest.mark.parametrize("blur_mm", [0.1, 0.25, 0.5, 0.8])
def test_slices_of_many_steps_are_fine_enough_for_bleeding(blur_mm: float):
    """Stripes of 2 mm, eight times as stiff as the others: compliance to half a usual scatter."""
    steps = np.arange(2.0, 32.0, 2.0)
    x = np.sort(np.concatenate([[0.0, 32.0], steps, steps]))
    edges = slice_edges_mm(ProfileDesign("s", x, np.arange(len(x)) // 2 % 2))

    def compliance(edges: FloatArray) -> float:
        middle = 0.5 * (edges[1:] + edges[:-1])
        far = (middle[:, None] - steps) / blur_mm
        mixture = ndtr(far) @ (-1.0) ** np.arange(len(steps))
        return float(np.sum(np.diff(edges) * np.exp(-np.log(8.0) * mixture)))

    assert compliance(edges) == pytest.approx(compliance(np.linspace(0.0, 32.0, 20_001)), rel=0.015)


def test_slices_are_fine_at_steps_and_few():
    edges = slice_edges_mm(STEPPED)
    assert len(edges) <= 129
    assert {15.0, 25.0} <= set(edges.tolist())
    for place in (15.0, 25.0):
        at = int(np.flatnonzero(edges == place)[0])
        sizes = np.diff(edges)
        assert max(sizes[at - 1], sizes[at]) < 0.06
        np.testing.assert_allclose(sizes[at + 1 : at + 4] / sizes[at : at + 3], 2.0, atol=0.35)
    many = np.repeat(np.arange(0.0, 41.0, 2.0), 2)[1:-1]
    striped = ProfileDesign("s", many, np.arange(len(many)) // 2 % 2)
    assert len(slice_edges_mm(striped)) <= 129
    ramp = ProfileDesign("r", [0.0, 19.995, 20.005, 40.0], [0.0, 0.0, 1.0, 1.0])
    steep = slice_edges_mm(ramp)
    assert np.abs(steep - 20.0).min() < 1e-9
    assert np.diff(steep).min() < 0.06
    assert np.diff(slice_edges_mm(SMOOTH)).min() > 0.5  # no step


def test_slices_are_fine_enough_for_force_and_strain():
    found = ObservationModel(campaign(bar("a", SMOOTH, rng=np.random.default_rng(5))))
    setup = found.setup
    n = 4000
    fine = setup.with_(
        first_slice=np.array([0, n]),
        x_mm=(np.arange(n) + 0.5) * GAUGE_MM / n,
        length_mm=np.full(n, GAUGE_MM / n),
        coordinate=(np.arange(n) + 0.5) / n,
        area_mm2=np.full(n, 30.0),
        **{
            name: np.zeros(n)
            for name in ("log_factor", "log_tilt", "softening", "set_share", "fatigue")
        },
        relaxing=np.zeros((n, setup.relaxing.shape[1])),
    )
    coarse = predict(setup, found.laws).force_N
    np.testing.assert_allclose(coarse, predict(fine, found.laws).force_N, rtol=5e-4, atol=1e-9)


@pytest.mark.parametrize("rows", [40, 240, 3000])
def test_each_force_has_the_noise_of_the_rows_that_it_is_read_from(rows: int) -> None:
    """Of the parabola through them, as many specimens show; at rest that of one row."""
    rng = np.random.default_rng(rows)
    clean = Campaign("c", "p", PALETTE, (specimen("a", rows=rows),))
    noisy = tuple(specimen(f"s{k}", rng=rng, rows=rows) for k in range(80))
    model = ObservationModel(Campaign("c", "p", PALETTE, noisy))
    off = model.measured_N - ObservationModel(clean).measured_N
    said = NOISE_N * model.sensor_sd_N / model.sensor_sd_N[:, :1]
    assert said[0, 0] == NOISE_N
    assert said[0, -1] < said[0, 0]
    # Of 80 figures a deviation is off by 8 %: four of these, and a quarter of it for the mean.
    found = np.sqrt(np.mean((off / said) ** 2, axis=0))
    np.testing.assert_allclose(found, 1.0, atol=0.32)
    assert found.mean() == pytest.approx(1.0, abs=0.08)


def test_replicates_show_the_noise_of_their_load_cell() -> None:
    """What a prediction is off by is the same for all of them: it is no part of their noise."""
    rng = np.random.default_rng(6)
    levels = np.exp(0.03 * rng.normal(size=30))
    made = tuple(
        specimen(f"s{k}", rng=rng, factor=factor, material=("soft", "firm")[k % 2])
        for k, factor in enumerate(levels)
    )
    problem, *_ = prepared(Campaign("c", "p", PALETTE, made))
    # Of 30 records with nine forces each the factor is known to some 5 %.
    assert problem.scatter.sensor == pytest.approx(1.0, abs=0.2)
    assert problem.scatter.specimen == pytest.approx(0.03, rel=0.4)


# ------------------------------------------------------------------------------------------------
# A factor on forces.


@pytest.mark.parametrize("factor", [1e-3, 0.85, 1.0, 1.2, 4.4482, 1e3])
def test_a_factor_is_a_constant_times_the_chord_and_noise_is_none(factor: float) -> None:
    """Where forces are below the noise of the load cell, their ratio to prediction is no factor."""
    model = ObservationModel(campaign(specimen("A"), specimen("B", CYCLE)))
    table, raw = model.table, model.predicted(model.alone)
    exact = replace(table, measured_raw=factor * raw, measured=table.transformed(factor * raw))
    chord = exact.chord(raw)
    # Sums over a specimen's rows round at 1e-16, and so does the difference that is divided.
    rise = np.log(factor) * chord
    np.testing.assert_allclose(exact.measured - exact.transformed(raw), rise, atol=1e-9)
    if factor < 0.1:  # all of it is below the noise here
        return
    noise = 0.3 * table.floor * np.random.default_rng(1).normal(size=len(table))
    noisy = replace(exact, measured_raw=factor * raw + noise)
    # The sum over a test's forces knows its level to a share of a per cent.
    np.testing.assert_allclose(noisy.chord(raw), chord, atol=0.02)
