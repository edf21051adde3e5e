"""The thesis against itself: moduli and areas of its Table 3.1, laws of its Table 3.2.

S. Hemleben, M.S. thesis, Oregon State University, 2017; the curves were not published. Each grade
is given the simplest curve that has its printed modulus at rest, its printed area and its printed
elongation at break.
"""

import numpy as np
from scipy.optimize import brentq

from benchmarks.withheld.real.coupons import coupon
from planner.gap.campaign import Campaign
from planner.numerics import FloatArray
from planner.printers import load_printer
from printers.connex3.thesis import Published, load_thesis

__all__ = ["stand_in", "thesis"]

GAUGE_MM, RATE_MM_S = 29.4, 1.0
POINTS = 60


def thesis() -> Campaign:
    """Give the seven elastomers of Table 3.1 as specimens; the palette is the printer's own."""
    machine = load_printer("connex3")
    palette = machine.palette("connex3-tango-vero")
    reference = palette.reference
    rate_per_s = reference.strain_rate_per_s or RATE_MM_S / GAUGE_MM
    specimens = []
    for published in load_thesis().elastomers:
        strain = np.linspace(0.0, published.elongation_at_break, POINTS + 1)
        specimens.append(
            coupon(
                published.id,
                published.id,
                strain / rate_per_s,
                strain,
                stand_in(published, strain),
                gauge_mm=RATE_MM_S / rate_per_s,
                rate_mm_s=RATE_MM_S,
                temperature_C=reference.temperature_C,
                soak_h=reference.soak_h,
                age_days=reference.age_days,
                orientation=reference.orientation,
                protocol="monotonic",
            )
        )
    notes = (
        "Stand-in curves with the modulus, area and elongation of Table 3.1; the shape between is "
        "assumed."
    )
    return Campaign("thesis", machine.name, palette, tuple(specimens), notes=notes)


def stand_in(published: Published, strain: FloatArray) -> FloatArray:
    """Return nominal stress in MPa with the printed modulus at rest and the printed area.

    Where the straight line to the break has less than the area, a cubic term adds the rest; where
    it has more, the stress saturates exponentially.
    """
    modulus, area = published.youngs_modulus_MPa, published.toughness_MJ_m3
    end = published.elongation_at_break
    more = area - 0.5 * modulus * end**2
    if more >= 0.0:
        return modulus * strain + 4.0 * more / end**4 * strain**3

    def excess(knee: float) -> float:
        return float(modulus * knee * (end - knee * -np.expm1(-end / knee)) - area)

    knee = brentq(excess, 1e-6 * end, 1e3 * end)
    return modulus * knee * -np.expm1(-strain / knee)
