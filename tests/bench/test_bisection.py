"""Bars for which Newton's method fails: bisection finds their equilibrium."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.withheld.reality import solver
from benchmarks.withheld.reality.base_law import fit_base_law
from benchmarks.withheld.reality.bench import mount
from benchmarks.withheld.reality.bisection import equilibrium
from benchmarks.withheld.reality.campaign import make_campaign
from benchmarks.withheld.reality.design import draw_design
from benchmarks.withheld.reality.palette_file import read_palette
from benchmarks.withheld.reality.sets import SETS

ROOT = Path(__file__).parents[2]
PALETTE = read_palette(
    (ROOT / "printers/connex3/palettes/connex3-tango-vero.toml").read_text(encoding="utf-8")
)
FloatArray = NDArray[np.float64]


def test_springs_in_series_with_a_linear_frame() -> None:
    stiffness_N = np.array([[2.0, 50.0, 0.4], [900.0, 1.0, 3.0]])
    length_mm = np.array([[1.0, 2.0, 3.0], [4.0, 0.5, 0.25]])
    compliance_mm_N = np.array([0.01, 0.2])
    travel_mm = np.array([0.3, -0.02])
    force, strain = equilibrium(
        lambda e: stiffness_N * e, lambda f: compliance_mm_N * f, travel_mm, length_mm
    )
    exact = travel_mm / (np.sum(length_mm / stiffness_N, axis=1) + compliance_mm_N)
    # 50 halvings leave rounding alone
    assert force == pytest.approx(exact, rel=1e-11)
    assert strain == pytest.approx(exact[:, None] / stiffness_N, rel=1e-9)


def test_bisection_agrees_with_newton(monkeypatch: pytest.MonkeyPatch) -> None:
    design = draw_design(PALETTE, SETS["final"].levels, 20, np.random.default_rng(1))
    bench = mount(PALETTE, design.take(design.profile >= 0), fit_base_law(PALETTE, "gent", 0.01))
    motion = bench.motion
    short = replace(
        motion, time_s=motion.time_s[:, :3], displacement_mm=motion.displacement_mm[:, :3]
    )
    bench = replace(
        bench,
        motion=short,
        lost_mm=bench.lost_mm[:, :3],
        compliance_mm=lambda force: (0.02 * force, np.full_like(force, 0.02)),
    )
    newton = solver.solve(bench)
    monkeypatch.setattr(solver, "_TOLERANCE_MM", 0.0)
    halved = solver.solve(bench)
    # Newton's method stops at 1e-9 mm of 0.1 mm travel
    assert halved.force_N == pytest.approx(newton.force_N, rel=1e-6)
    assert halved.strain == pytest.approx(newton.strain, rel=1e-5, abs=1e-8)


def test_a_campaign_of_which_newton_misses_a_row(monkeypatch: pytest.MonkeyPatch) -> None:
    """Softening of bars whose hardest elements hardly strain in the first row."""
    called = 0

    def counted(*given: Any) -> tuple[FloatArray, FloatArray]:
        nonlocal called
        called += 1
        return equilibrium(*given)

    monkeypatch.setattr(solver, "equilibrium", counted)
    campaign = make_campaign(PALETTE, "development", "library", 60, 555, 2)
    assert called
    # Forces of the bars rise by some 2 N in the first rows, evenly but for noise of some 0.05 N
    bars = campaign.design.profile >= 0
    bend = np.diff(campaign.force_N[bars, :5], n=2, axis=1)
    assert np.abs(bend).max() < 0.25 * np.abs(campaign.force_N[bars, 4]).max()
