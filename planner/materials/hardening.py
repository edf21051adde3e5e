"""A tensile curve that bends over as an elastic-plastic law that hardens, for solvers."""

import numpy as np

from planner.numerics import FloatArray

__all__ = ["hardening"]


# Solvers without Marlow's law have J2 plasticity of large strains (J. C. Simo, Comput. Methods
# Appl. Mech. Eng. 66 (1988) 199): with the elastic left Cauchy-Green tensor b, its volume taken
# out, tau = mu dev(b), and b follows the motion less the plastic flow along dev(b). In a tensile
# test with t = tr(b), q = tau / mu and the logarithmic strain h, its volume taken out,
#
#     dt = 2 q dh,   dq = (t + q) dh - t da,   a the plastic strain,
#
# so that a curve of stress fixes the plastic strain at each stress, whatever its form. While the
# load grows, such a law is the curve itself; unloading it differs.

_STEPS = 4000

_NOTHING = 1e-5
"""Numerical: a plastic strain that no test shows; below it the curve is elastic."""


def hardening(
    strain: FloatArray, stress_MPa: FloatArray, modulus_MPa: float, poisson: float
) -> FloatArray | None:
    """Return true stress in MPa and plastic strain of a tensile curve, (n, 2), the first 0.

    Parameters
    ----------
    strain, stress_MPa : (n,)
        Engineering strains, rising from above 0, and nominal stresses.
    modulus_MPa, poisson
        At rest.

    Returns
    -------
    ndarray or None
        None of a curve that is nowhere softer than the elastic law, or stiffens faster.
    """
    e = float(strain[-1]) * np.linspace(0.0, 1.0, _STEPS + 1) ** 2
    first = np.concatenate([[0.0], strain])
    tau = (1.0 + e) * np.interp(e, first, np.concatenate([[0.0], stress_MPa]))
    mu = modulus_MPa / (2.0 * (1.0 + poisson))
    bulk = modulus_MPa / (3.0 * (1.0 - 2.0 * poisson))
    q, steps = tau / mu, np.diff(np.log1p(e) - tau / (9.0 * bulk))
    middle = 0.5 * (q[1:] + q[:-1])
    t = 3.0 + np.cumsum(2.0 * middle * steps) - middle * steps
    plastic = np.cumsum((1.0 + middle / t) * steps - np.diff(q) / t)
    rows = np.stack([(1.0 + strain) * stress_MPa, np.interp(strain, e[1:], plastic)], axis=1)
    elastic = int(np.argmax(rows[:, 1] > _NOTHING)) - 1
    rows = rows[max(elastic, 0) :]
    rows[0, 1] = 0.0
    if not (np.diff(rows, axis=0) > 0.0).all():
        return None
    # A sheet stretched in two directions flows twice as far as a bar before it is as long.
    last = rows[-1] + (rows[-1] - rows[-2]) * rows[-1, 1] / (rows[-1, 1] - rows[-2, 1])
    return np.vstack([rows, last])
