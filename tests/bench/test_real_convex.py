"""The plain mechanism that real data are compared with: what it was made to find, it finds."""

import numpy as np
import pytest

from benchmarks.withheld.real.convex_fit import convex_errors, hereditary, left_out_errors
from benchmarks.withheld.real.coupons import (
    GAUGE_MM,
    THICKNESS_MM,
    WIDTH_MM,
    coupon,
    fitted_palette,
)
from planner.gap.campaign import Campaign, Specimen
from planner.numerics import FloatArray
from planner.palette import Reference

MODULUS_MPA, SHARE = 1.5, 0.6
"""Of a neo-Hookean block of which a share relaxes."""

ON_GRID_S, BETWEEN_S = 10.0, 7.0
"""Times of relaxing: one that the fit has, one between two of them."""

RATES_PER_S = (0.01, 0.03, 0.1, 0.3, 1.0)
REFERENCE_PER_S = 0.03


def stress(time_s: FloatArray, strain: FloatArray, relaxing_s: float) -> FloatArray:
    """Return the block's nominal stress in MPa, each step's elastic stress decaying since."""
    elastic = MODULUS_MPA / 3.0 * ((1.0 + strain) - (1.0 + strain) ** -2.0)
    middle = 0.5 * (time_s[1:] + time_s[:-1])
    age = time_s[:, None] - middle
    fallen = np.exp(-np.maximum(age, 0.0) / relaxing_s)
    left = np.where(age > 0.0, 1.0 - SHARE + SHARE * fallen, 0.0)
    found: FloatArray = left @ np.diff(elastic)
    return found


def pulled(rate_per_s: float, relaxing_s: float, *, protocol: str = "cyclic") -> Specimen:
    """Up to twice its length and, unless it is monotonic, back by half."""
    up = np.linspace(0.0, 1.0, 1001)
    strain: FloatArray = up if protocol == "monotonic" else np.concatenate([up, up[-2:499:-1]])
    time_s = np.arange(len(strain), dtype=np.float64) * 1e-3 / rate_per_s
    return coupon(
        f"{protocol}-{rate_per_s:g}", "block", time_s, strain, stress(time_s, strain, relaxing_s),
        rate_mm_s=rate_per_s * GAUGE_MM, protocol=protocol,
    )  # fmt: skip


def campaign(relaxing_s: float) -> Campaign:
    """Five rates; the palette's law is a slower loading's."""
    slow = pulled(REFERENCE_PER_S, relaxing_s, protocol="monotonic")
    area = WIDTH_MM * THICKNESS_MM
    palette = fitted_palette(
        "p",
        {"block": [(slow.strain[20::20], slow.force_N[20::20] / area)]},
        Reference(strain_rate_per_s=REFERENCE_PER_S),
        "made up",
    )
    return Campaign("c", "none", palette, tuple(pulled(rate, relaxing_s) for rate in RATES_PER_S))


@pytest.mark.parametrize(("relaxing_s", "most"), [(ON_GRID_S, 1e-3), (BETWEEN_S, 0.03)])
def test_a_prony_block_is_predicted_at_rates_left_out(relaxing_s: float, most: float) -> None:
    """Nearly exactly with its own time; with neighbours' as sums of exponentials imitate one."""
    by_condition, by_rate = convex_errors(campaign(relaxing_s))
    assert by_condition < most
    # every rate is a condition of its own here
    assert by_rate == pytest.approx(by_condition)


def test_hereditary_integrals_are_exact_for_a_ramp_and_a_hold() -> None:
    """Without relaxation the shape itself; held, each decays with its own time."""
    time_s = np.concatenate([np.linspace(0.0, 1.0, 33), np.linspace(2.0, 50.0, 31)])[None]
    strain = np.minimum(0.5 * time_s, 0.5)
    h = hereditary(time_s, strain).reshape(1, 64, 5, 8)
    stretch = 1.0 + strain
    np.testing.assert_allclose(h[..., 2, 0], 0.5 * (stretch - stretch**-2.0), rtol=1e-12)
    fallen = np.exp(-(time_s[0, 40] - time_s[0, 33]) / 10.0)
    np.testing.assert_allclose(h[0, 40, :, 4], h[0, 33, :, 4] * fallen, rtol=1e-12)


def test_what_is_left_out_takes_no_part() -> None:
    """Where all is left out there is the palette's own curve, which tells nothing of rates."""
    made = campaign(ON_GRID_S)
    alone = left_out_errors(made, RATES_PER_S)
    together = left_out_errors(made, ["all"] * len(RATES_PER_S))
    assert (together > 10.0 * alone).all()
