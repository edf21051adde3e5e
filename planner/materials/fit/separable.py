"""Laws as a fit sees them: a sum of columns, each linear in one coefficient.

Every law of the palette is ``P(stretch) = sum_j c_j phi_j(stretch; a_j)``: linear in the
coefficients c, and nonlinear at most in one parameter a_j a column. Variable projection solves
for c exactly and searches over a alone.
"""

from collections.abc import Mapping
from typing import Protocol

import numpy as np

from planner.arrays import FloatArray
from planner.errors import ArgumentError

__all__ = [
    "FITTED_MODELS",
    "LARGEST_ALPHA",
    "Martins",
    "NeoHookean",
    "Ogden",
    "SeparableLaw",
    "Yeoh",
    "candidate_laws",
]

LARGEST_ALPHA = 30.0
"""Bound of the Ogden exponents: beyond it a term is nothing but a step at the last point."""

LARGEST_TERMS = 3
"""Ogden terms tried; a fourth is never identified by one mode of deformation."""


class SeparableLaw(Protocol):
    """A law as columns."""

    @property
    def model(self) -> str:
        """The law's name in a palette file."""
        ...

    @property
    def columns(self) -> int:
        """Number p of columns, each with one linear coefficient."""
        ...

    @property
    def nonlinear(self) -> int:
        """Number q of nonlinear parameters: 0, or one a column (q = p)."""
        ...

    def bounds(self, stretch_max: float) -> FloatArray:
        """Return low and high of each nonlinear parameter, shape (q, 2)."""
        ...

    def start(self, fraction: FloatArray, stretch_max: float) -> FloatArray:
        """Map points of the unit cube, shape (s, q), to starts within the bounds."""
        ...

    def evaluate(self, stretch: FloatArray, a: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return columns and their derivatives by their own parameter.

        Parameters
        ----------
        stretch
            Shape (n,).
        a
            Nonlinear parameters of s candidates, shape (s, q).

        Returns
        -------
        tuple of ndarray
            phi and dphi/da, shape (s, n, p) each; the latter is empty (s, n, 0) when q = 0.
        """
        ...

    def divisor(self, a: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return what the coefficients are divided by to give file parameters, and its slope.

        Shape (s, p) each: the file's coefficient is c / divisor(a).
        """
        ...

    def parameters(self, a: FloatArray, c: FloatArray) -> dict[str, tuple[float, ...]]:
        """Return the parameters under a palette file's names.

        Parameters
        ----------
        a
            Nonlinear parameters, shape (q,).
        c
            The file's coefficients, shape (p,).
        """
        ...


class NeoHookean:
    """P = mu (l - l^-2)."""

    model = "neo-hookean"
    columns = 1
    nonlinear = 0

    def bounds(self, stretch_max: float) -> FloatArray:
        """Return no bounds: the law is linear in mu."""
        return np.empty((0, 2))

    def start(self, fraction: FloatArray, stretch_max: float) -> FloatArray:
        """Return the empty start."""
        return fraction[:, :0]

    def evaluate(self, stretch: FloatArray, a: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the column l - l^-2."""
        return _linear(_uniaxial(stretch)[:, None], a)

    def divisor(self, a: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return one: the file holds the coefficients themselves."""
        shape = (len(a), self.columns)
        return np.ones(shape), np.zeros(shape)

    def parameters(self, a: FloatArray, c: FloatArray) -> dict[str, tuple[float, ...]]:
        """Return mu in MPa."""
        return {"mu_MPa": (float(c[0]),)}


class Yeoh:
    """P = 2 (l - l^-2) (c1 + 2 c2 (I1 - 3) + 3 c3 (I1 - 3)^2), I1 = l^2 + 2/l."""

    model = "yeoh"
    columns = 3
    nonlinear = 0

    def bounds(self, stretch_max: float) -> FloatArray:
        """Return no bounds: the law is linear in c1, c2, c3."""
        return np.empty((0, 2))

    def start(self, fraction: FloatArray, stretch_max: float) -> FloatArray:
        """Return the empty start."""
        return fraction[:, :0]

    def evaluate(self, stretch: FloatArray, a: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the columns of c1, c2 and c3."""
        invariant = _first_invariant(stretch)[:, None] ** np.arange(3)
        return _linear(2.0 * _uniaxial(stretch)[:, None] * np.arange(1, 4) * invariant, a)

    def divisor(self, a: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return one: the file holds the coefficients themselves."""
        shape = (len(a), self.columns)
        return np.ones(shape), np.zeros(shape)

    def parameters(self, a: FloatArray, c: FloatArray) -> dict[str, tuple[float, ...]]:
        """Return c1, c2, c3 in MPa."""
        return {"c_MPa": tuple(float(v) for v in c)}


class Ogden:
    """P = sum_i mu_i (l^(alpha_i - 1) - l^(-alpha_i/2 - 1)).

    The coefficients are the terms' shares E_i = 1.5 mu_i alpha_i of the initial modulus, which
    keeps the columns finite and apart from zero where an alpha goes through zero.
    """

    model = "ogden"

    def __init__(self, terms: int) -> None:
        self.columns = self.nonlinear = terms

    def bounds(self, stretch_max: float) -> FloatArray:
        """Return -LARGEST_ALPHA, LARGEST_ALPHA for each exponent."""
        return np.tile([-LARGEST_ALPHA, LARGEST_ALPHA], (self.nonlinear, 1))

    def start(self, fraction: FloatArray, stretch_max: float) -> FloatArray:
        """Spread starts denser near zero, where rubbers lie; sorted, for terms can be swapped."""
        t = 2.0 * fraction - 1.0
        return np.sort(LARGEST_ALPHA * t * np.abs(t), axis=1)

    def evaluate(self, stretch: FloatArray, a: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (l^(a-1) - l^(-a/2-1)) / (1.5 a) and its derivative by a.

        With x = ln l and h = 0.75 a x it is exp(a x / 4) x / l * sinh(h) / h.
        """
        x = np.log(stretch)[None, :, None]
        quarter = 0.25 * a[:, None, :] * x
        root = np.exp(quarter)
        # The one exponential serves both: exp(h) is its cube.
        h = 3.0 * quarter
        up = root * root * root
        down = 1.0 / up
        square = h * h
        small = square < 1e-4
        safe = np.where(small, 1.0, h)
        quotient = np.where(
            small, 1.0 + square * (1.0 / 6.0 + square / 120.0), 0.5 * (up - down) / safe
        )
        slope = np.where(
            small, h * (1.0 / 3.0 + square / 30.0), (0.5 * (up + down) - quotient) / safe
        )
        scale = root * (x / stretch[None, :, None])
        phi = scale * quotient
        return phi, x * (0.25 * phi + 0.75 * scale * slope)

    def divisor(self, a: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return 1.5 alpha: E_i = 1.5 mu_i alpha_i."""
        return 1.5 * a, np.full_like(a, 1.5)

    def parameters(self, a: FloatArray, c: FloatArray) -> dict[str, tuple[float, ...]]:
        """Return mu in MPa and alpha."""
        return {"mu_MPa": tuple(float(v) for v in c), "alpha": tuple(float(v) for v in a)}


class Martins:
    """P = 2 (l - l^-2) c1 c2 exp(c1 (I1 - 3)) + 2 (l - 1) c3 c4 exp(c3 (l - 1)^2).

    The coefficients are the products c1 c2 and c3 c4.
    """

    model = "martins"
    columns = 2
    nonlinear = 2
    _REACH = (1e-3, 12.0)
    """Bounds of the arguments of the two exponentials at the largest stretch."""

    def bounds(self, stretch_max: float) -> FloatArray:
        """Return the bounds of c1 and c3, both positive."""
        invariant = _first_invariant(np.array([stretch_max]))[0]
        largest = np.array([[invariant], [(stretch_max - 1.0) ** 2]])
        out: FloatArray = np.array(self._REACH) / np.maximum(largest, 1e-6)
        return out

    def start(self, fraction: FloatArray, stretch_max: float) -> FloatArray:
        """Spread starts evenly in the logarithm."""
        low, high = np.log(self.bounds(stretch_max)).T
        out: FloatArray = np.exp(low + fraction * (high - low))
        return out

    def evaluate(self, stretch: FloatArray, a: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the two columns and their derivatives by c1 and c3."""
        front = np.stack([2.0 * _uniaxial(stretch), 2.0 * (stretch - 1.0)], axis=-1)
        inner = np.stack([_first_invariant(stretch), (stretch - 1.0) ** 2], axis=-1)
        phi = front * np.exp(a[:, None, :] * inner)
        return phi, phi * inner

    def divisor(self, a: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return c1 and c3: the coefficients are c1 c2 and c3 c4."""
        return a, np.ones_like(a)

    def parameters(self, a: FloatArray, c: FloatArray) -> dict[str, tuple[float, ...]]:
        """Return c1 and c3, and c2 and c4 in MPa."""
        return {
            "c1": (float(a[0]),),
            "c2_MPa": (float(c[0]),),
            "c3": (float(a[1]),),
            "c4_MPa": (float(c[1]),),
        }


FITTED_MODELS: Mapping[str, tuple[SeparableLaw, ...]] = {
    "neo-hookean": (NeoHookean(),),
    "ogden": tuple(Ogden(n) for n in range(1, LARGEST_TERMS + 1)),
    "yeoh": (Yeoh(),),
    "martins": (Martins(),),
}
"""The laws that can be fitted, in each number of terms that is tried."""


def candidate_laws(model: str) -> tuple[SeparableLaw, ...]:
    """Return what ``--law`` stands for: one model in all its numbers of terms, or "all".

    Raises
    ------
    ArgumentError
        No such model.
    """
    if model == "all":
        return tuple(law for laws in FITTED_MODELS.values() for law in laws)
    if model not in FITTED_MODELS:
        raise ArgumentError(
            f"law {model!r}: no such law; choose one of {', '.join(FITTED_MODELS)}, all"
        )
    return FITTED_MODELS[model]


def _uniaxial(stretch: FloatArray) -> FloatArray:
    """Return l - l^-2, exact near one."""
    strain = stretch - 1.0
    out: FloatArray = strain * (stretch * stretch + stretch + 1.0) / (stretch * stretch)
    return out


def _first_invariant(stretch: FloatArray) -> FloatArray:
    """Return I1 - 3 in uniaxial tension, exact near one."""
    strain = stretch - 1.0
    out: FloatArray = strain * strain * (stretch + 2.0) / stretch
    return out


def _linear(phi: FloatArray, a: FloatArray) -> tuple[FloatArray, FloatArray]:
    shape = (len(a), *phi.shape)
    return np.broadcast_to(phi, shape), np.empty((*shape[:2], 0))
