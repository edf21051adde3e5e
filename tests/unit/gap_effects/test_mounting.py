"""Grips, machine, section and sensors: effects of how a specimen is made, held and measured."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from planner.gap.effects import EFFECTS
from planner.simulation.bar import ProfileDesign
from planner.simulation.bar_solver import Setup

Make = Callable[..., Setup]
Apply = Callable[..., Setup]
Bars = dict[str, ProfileDesign]


def test_slack_is_travel_lost_first(coupons: Make, applied: Apply) -> None:
    travel = np.array([[0.0, 0.05, 0.5, 2.0, 10.0, 2.0, 0.05, 0.0]])
    before = coupons(1, steps=8, travel_mm=travel)
    for name in ("dead-travel", "seating", "taking-up"):
        lost = applied("grip-slack", name, before, slack=0.5, length=0.1).lost_mm[0]
        assert lost[0] == 0.0
        assert np.all(np.diff(lost[:5]) > 0.0)
        # Taken up within 1e-4 at twenty times the slack.
        assert lost[4] == pytest.approx(0.5, rel=1e-4)
    # The rounder the corner, the later it is taken up.
    rounded = [
        applied("grip-slack", "rounded", before, slack=0.5, sharpness=p).lost_mm[0, 2]
        for p in (1.0, 2.0, 4.0)
    ]
    assert rounded == pytest.approx([0.5 * 2.0 ** (-1.0 / p) for p in (1.0, 2.0, 4.0)])
    assert applied("grip-slack", "dead-travel", before, slack=0.5).lost_mm[0, -1] == 0.0
    assert applied("grip-slack", "seating", before, slack=0.5).lost_mm[0, -1] > 0.49


def test_slip_and_compliance_are_travel_lost_by_load(coupons: Make, applied: Apply) -> None:
    before = coupons()
    slip = applied("grip-slip", "threshold", before, slip=0.02, hold=5.0)
    assert set(slip.slip_mm_N) == {0.02}
    assert set(slip.slip_from_N) == {5.0}
    power = applied("grip-slip", "power", before, slip=0.3, power=2.0)
    np.testing.assert_allclose(power.slip_mm_N * 20.0**power.slip_power, 0.3)
    linear = applied("machine-compliance", "linear", before, compliance=0.02)
    assert set(linear.compliance_mm_N) == {0.02}
    assert set(linear.joint_share) == {0.0}
    wide = applied("machine-compliance", "stiffening", before, joints=4.0, closing=2.0)
    assert set(wide.joint_share) == {4.0}
    np.testing.assert_allclose(wide.joint_N, 15.0 * np.exp(2.4))


def test_oversize_tells_more_of_thin_parts(coupons: Make, applied: Apply) -> None:
    before = coupons(2, thickness_mm=np.array([1.0, 4.0]), width_mm=np.array([6.0, 6.0]))
    ratios = {
        name: applied("cross-section", name, before, oversize=0.1).area_mm2 / 12.0
        for name in ("all-sides", "thickness", "width")
    }
    np.testing.assert_allclose(ratios["thickness"], (1.1, 1.025))
    np.testing.assert_allclose(ratios["width"], 6.1 / 6.0)
    np.testing.assert_allclose(ratios["all-sides"], ratios["width"] * ratios["thickness"])
    rounded = applied("cross-section", "rounded", before, radius=0.2).area_mm2
    # 0.2 mm is well below the half thickness of 2 mm: the limit there is felt by 5e-5.
    assert rounded[1] / 12.0 == pytest.approx(1.0 - (4.0 - np.pi) * 0.04 / 24.0, abs=1e-6)


def test_a_designs_own_width_counts(setup: Make, bars: Bars, applied: Apply) -> None:
    taper = replace(bars["step"], width_mm=np.array([4.0, 6.0, 6.0, 8.0]))
    before = setup(taper)
    after = applied("cross-section", "width", before, oversize=0.1)
    width = np.interp(before.x_mm, taper.x_mm, taper.width_mm)
    np.testing.assert_allclose(after.area_mm2, 12.0 * (1.0 + 0.1 / width))


def test_skin_is_layers_side_by_side(coupons: Make, applied: Apply) -> None:
    thick = coupons(2, thickness_mm=np.array([0.2, 4.0]))
    for sign in (1.0, -1.0):
        b = sign * 0.5
        after = applied("skin", "faces", thick, log_stiffness=b, depth=0.2)
        # Skins of 0.2 mm leave 3.6 of 4 mm; of 0.2 mm in all they leave next to nothing.
        assert np.exp(after.log_factor[1]) == pytest.approx(0.9 + 0.1 * np.exp(b), rel=1e-6)
        assert after.log_factor[0] == pytest.approx(b, abs=0.01)
    around = applied("skin", "all-sides", thick, log_stiffness=0.5, depth=0.2).log_factor
    only = applied("skin", "faces", thick, log_stiffness=0.5, depth=0.2).log_factor
    assert around[1] > only[1] > 0.0


def test_sensors_show_another_force_or_strain(coupons: Make, applied: Apply) -> None:
    before = coupons()
    gain = applied("force-scale", "gain", before, log_gain=0.1)
    np.testing.assert_allclose(gain.gain, np.exp(0.1))
    warm = applied("force-scale", "warming-up", before, log_gain=0.1, time=3.0).gain
    crept = applied("force-scale", "creeping", before, log_gain=0.1, time=3.0).gain
    np.testing.assert_allclose(warm * crept, np.exp(0.1))
    np.testing.assert_allclose(np.log(crept), 0.1 * (1.0 - np.exp(-before.time_s / 3.0)))
    form = EFFECTS["force-scale"].form("pound-force")
    assert form is not None
    pounds = form.size
    assert pounds.low < np.log(4.4482216) < pounds.high
    drift = applied("force-offset", "drifting", before, drift=0.6, since=20.0)
    np.testing.assert_allclose(drift.offset_N, 0.01 * (before.time_s + 20.0))
    fading = applied("force-offset", "fading", before, offset=-0.5, time=3.0).offset_N
    assert np.all(fading[:, 0] == -0.5)
    assert np.all(np.diff(fading, axis=1) > 0.0)
    factor = applied("strain-scale", "factor", before, log_factor=-0.1)
    np.testing.assert_allclose(factor.travel_factor, np.exp(-0.1))
    gauges = replace(before, gauge_mm=np.linspace(10.0, 60.0, 6))
    ends = applied("strain-scale", "ends", gauges, length=5.0)
    np.testing.assert_allclose(gauges.gauge_mm / ends.travel_factor, gauges.gauge_mm + 5.0)
