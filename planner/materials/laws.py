"""Constitutive laws in uniaxial tension: what planning evaluates and what a fit seeks."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from planner.errors import ArgumentError, UnknownNameError, check_known
from planner.numerics import FloatArray
from planner.palette import LAW_PARAMETERS, LawParameters

__all__ = [
    "FARTHEST",
    "LOWEST_STRETCH",
    "Columns",
    "Law",
    "Linear",
    "NeoHookean",
    "Ogden",
    "SeparableLaw",
    "Yeoh",
    "Yielding",
    "above_zero",
    "candidate_laws",
    "first_invariant",
    "make_law",
    "positive_stretch",
    "secant_modulus_MPa",
    "stability",
]


# ------------------------------------------------------------------------------------------------
# What every constitutive law can do, in uniaxial tension of an incompressible material.


class Law(Protocol):
    """A uniaxial law: nominal stress as a function of stretch.

    Stretch is length over rest length, so engineering strain is ``stretch - 1``; nominal
    (engineering) stress is force over the area at rest, Cauchy stress over ``stretch``.
    """

    @abstractmethod
    def nominal_stress_MPa(self, stretch: ArrayLike) -> FloatArray:
        """Return the nominal stress, of the shape of `stretch`."""

    @abstractmethod
    def tangent_MPa(self, stretch: ArrayLike) -> FloatArray:
        """Return the derivative of the nominal stress by the stretch, of the same shape."""


Columns: TypeAlias = tuple[FloatArray, FloatArray]
"""phi and dphi/da, shape (s, n, p) each; the latter is empty (s, n, 0) when q = 0."""


class SeparableLaw(Law, ABC):
    """A law as a fit sees it: a sum of columns, ``P(stretch) = sum_j c_j phi_j(stretch; a_j)``.

    Linear in the coefficients c, and nonlinear at most in one parameter a_j a column: variable
    projection solves for c exactly and searches over a alone. What follows the stress is of the
    model and its number of terms, whatever the parameters of the law that is asked.

    Attributes
    ----------
    model
        The law's name in a palette file.
    """

    model: ClassVar[str]

    @property
    def name(self) -> str:
        """The model with its number of terms where there is a choice, as "ogden-2"."""
        several = len(FITTED_MODELS[self.model]) > 1
        return f"{self.model}-{self.columns}" if several else self.model

    @property
    @abstractmethod
    def columns(self) -> int:
        """Number p of columns, each with one linear coefficient."""

    @property
    def nonlinear(self) -> int:
        """Number q of nonlinear parameters: 0, or one a column (q = p)."""
        return 0

    def bounds(self, stretch_max: float) -> FloatArray:
        """Return low and high of each nonlinear parameter, shape (q, 2)."""
        return np.empty((0, 2))

    def start(self, fraction: FloatArray, stretch_max: float) -> FloatArray:
        """Map points of the unit cube, shape (s, q), to starts within the bounds; one if q = 0."""
        return np.empty((1, 0))

    @abstractmethod
    def evaluate(self, stretch: FloatArray, a: FloatArray, *, planar: bool = False) -> Columns:
        """Return columns and their derivatives by their own parameter.

        Parameters
        ----------
        stretch
            Shape (n,).
        a
            Nonlinear parameters of s candidates, shape (s, q).
        planar
            Of planar loading (pure shear, width held) instead of uniaxial. Equibiaxial loading
            to l is uniaxial loading to l^-2, with stress -P(l^-2) / l^3.

        """

    def divisor(self, a: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return what the coefficients are divided by to give file parameters, and its slope.

        Shape (s, p) each: the file's coefficient is c / divisor(a).
        """
        shape = (len(a), self.columns)
        return np.ones(shape), np.zeros(shape)

    @abstractmethod
    def parameters(self, a: FloatArray, c: FloatArray) -> dict[str, tuple[float, ...]]:
        """Return the parameters under a palette file's names.

        Parameters
        ----------
        a
            Nonlinear parameters, shape (q,).
        c
            The file's coefficients, shape (p,).
        """


def positive_stretch(stretch: ArrayLike) -> FloatArray:
    """Return stretches as an array.

    Raises
    ------
    ArgumentError
        A stretch is not above 0 and finite.
    """
    advice = "; stretch is 1 at rest, 1 + engineering strain"
    return above_zero(stretch, "stretch {:g}: it must be above 0 and finite" + advice)


def above_zero(values: ArrayLike, otherwise: str) -> FloatArray:
    """Return values as an array; `otherwise` is what is said of the first one that is not.

    Raises
    ------
    ArgumentError
        A value is not above 0 and finite.
    """
    array = np.asarray(values, dtype=np.float64)
    allowed = (array > 0.0) & (array < np.inf)
    if not allowed.all():
        raise ArgumentError(otherwise.format(array[~allowed].flat[0]))
    return array


# ------------------------------------------------------------------------------------------------
# The laws: equation and source, stress and tangent, and columns for a fit.


_LARGEST_ALPHA = 30.0
"""Bound of the Ogden exponents: beyond it a term is nothing but a step at the last point."""

_SMALLEST_ALPHA = -10.0
"""Their lower bound: at stretch 0.6 a term of this exponent alone is 25 times as stiff as a
neo-Hookean one of the same initial modulus, so that a sound law has next to none of it."""

_MARTINS_REACH = (1e-3, 12.0)
"""Bounds of the arguments of Martins' two exponentials at the largest stretch."""

_LARGEST_EXPONENT = 600.0
"""At stretches far beyond the tests: its power of e, some 1e260, can still be weighed."""


@dataclass(frozen=True, slots=True)
class Linear:
    """Hooke's law, P = E (λ - 1), for grades of which only Young's modulus is known.

    Its secant modulus is E at every strain.
    """

    modulus_MPa: float

    model = "linear"

    def nominal_stress_MPa(self, stretch: ArrayLike) -> FloatArray:
        """Return E (λ - 1)."""
        return self.modulus_MPa * (positive_stretch(stretch) - 1.0)

    def tangent_MPa(self, stretch: ArrayLike) -> FloatArray:
        """Return E."""
        return np.full_like(positive_stretch(stretch), self.modulus_MPa)


@dataclass(frozen=True, slots=True)
class Yielding:
    """P = H e + (E - H) e / (1 + x^n)^(1/n), x = (E - H) |e| / Y, e = λ - 1: a plastic that yields.

    A line of slope E at rest bends into P = Y + H e, the sharper the larger n. The tangent
    H + (E - H) (1 + x^n)^(-1/n - 1) is positive everywhere; compression mirrors tension (Richard
    and Abbott, J. Eng. Mech. Div. ASCE 101, 1975; with n = 2 Menegotto and Pinto's curve).

    Parameters
    ----------
    modulus_MPa
        E, Young's modulus.
    flow_MPa
        Y, where the line behind the yield meets zero strain.
    hardening_MPa
        H, the slope behind the yield; 0 or more, below E.
    sharpness
        n, above 0.
    """

    modulus_MPa: float
    flow_MPa: float
    hardening_MPa: float
    sharpness: float

    model = "yielding"

    def __post_init__(self) -> None:
        bends = 0.0 <= self.hardening_MPa < self.modulus_MPa
        if not (bends and self.flow_MPa > 0.0 and self.sharpness > 0.0):
            raise ArgumentError(
                "law 'yielding': flow_MPa and sharpness must be above 0, and hardening_MPa from 0 "
                f"to below modulus_MPa; they are {self.flow_MPa:g}, {self.sharpness:g}, "
                f"{self.hardening_MPa:g} and {self.modulus_MPa:g}"
            )

    def nominal_stress_MPa(self, stretch: ArrayLike) -> FloatArray:
        """Return H e + (E - H) e / (1 + x^n)^(1/n)."""
        strain = positive_stretch(stretch) - 1.0
        bent = np.exp(-self._log_bend(strain) / self.sharpness)
        return strain * (self.hardening_MPa + (self.modulus_MPa - self.hardening_MPa) * bent)

    def tangent_MPa(self, stretch: ArrayLike) -> FloatArray:
        """Return H + (E - H) (1 + x^n)^(-1/n - 1)."""
        strain = positive_stretch(stretch) - 1.0
        bent = np.exp(-self._log_bend(strain) * (1.0 / self.sharpness + 1.0))
        return np.asarray(self.hardening_MPa + (self.modulus_MPa - self.hardening_MPa) * bent)

    def _log_bend(self, strain: FloatArray) -> FloatArray:
        """Return ln(1 + x^n), whatever the size of x."""
        with np.errstate(divide="ignore"):
            log_x = np.log((self.modulus_MPa - self.hardening_MPa) / self.flow_MPa * np.abs(strain))
        return np.asarray(np.logaddexp(0.0, self.sharpness * log_x))


class _FirstInvariant(SeparableLaw):
    """An energy W of J = I1 - 3 = λ² + 2/λ - 3, P = W'(J) dJ/dλ; and fibres along the load."""

    @abstractmethod
    def energy_slopes_MPa(self, j: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return W' and W''."""

    def fibre_MPa(self, stretch: FloatArray) -> tuple[FloatArray | float, FloatArray | float]:
        """Return the fibres' stress and tangent."""
        return 0.0, 0.0

    def nominal_stress_MPa(self, stretch: ArrayLike) -> FloatArray:
        """Return W'(J) dJ/dλ, and the fibres' stress."""
        stretch = positive_stretch(stretch)
        slope, _ = self.energy_slopes_MPa(stretch**2 + 2.0 / stretch - 3.0)
        return 2.0 * (stretch - stretch**-2) * slope + self.fibre_MPa(stretch)[0]

    def tangent_MPa(self, stretch: ArrayLike) -> FloatArray:
        """Return W''(J) (dJ/dλ)² + W'(J) d²J/dλ², and the fibres' tangent."""
        stretch = positive_stretch(stretch)
        slope, curvature = self.energy_slopes_MPa(stretch**2 + 2.0 / stretch - 3.0)
        front = 2.0 * (stretch - stretch**-2)
        tangent = curvature * front**2 + slope * (2.0 + 4.0 * stretch**-3)
        return tangent + self.fibre_MPa(stretch)[1]


class _Polynomial(_FirstInvariant):
    """One in powers of J, linear in its parameters, which are the coefficients of a fit."""

    symbol: ClassVar[str]
    unit: ClassVar[float]
    """Of dW/dJ, of which a parameter of 1 has one half."""

    def evaluate(self, stretch: FloatArray, a: FloatArray, *, planar: bool = False) -> Columns:
        """Return the columns, which are those of every candidate."""
        front, invariant = _front_and_invariant(stretch, planar)
        powers = np.arange(self.columns)
        phi = self.unit * front[:, None] * (powers + 1) * invariant[:, None] ** powers
        shape = (len(a), *phi.shape)
        return np.broadcast_to(phi, shape), np.empty((*shape[:2], 0))

    def parameters(self, a: FloatArray, c: FloatArray) -> dict[str, tuple[float, ...]]:
        """Return the coefficients in MPa."""
        return {self.symbol: tuple(float(v) for v in c)}


@dataclass(frozen=True, slots=True)
class NeoHookean(_Polynomial):
    """Gaussian chains: W = μ/2 (I1 - 3), P = μ (λ - 1/λ²), with I1 = λ² + 2/λ.

    μ is the shear modulus, E0 = 3 μ (Treloar, The Physics of Rubber Elasticity, 1975).
    """

    mu_MPa: float

    model, symbol, unit = "neo-hookean", "mu_MPa", 1.0
    columns = 1

    def energy_slopes_MPa(self, j: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return μ/2 and 0."""
        return np.full_like(j, 0.5 * self.mu_MPa), np.zeros_like(j)


@dataclass(frozen=True, slots=True)
class Yeoh(_Polynomial):
    """W = c1 J + c2 J² + c3 J³ with J = I1 - 3 = λ² + 2/λ - 3.

    P = dW/dλ = 2 (λ - 1/λ²) (c1 + 2 c2 J + 3 c3 J²); the shear modulus is 2 c1, E0 = 6 c1
    (Yeoh, Rubber Chem. Technol. 66, 1993). The form with λ² - 1/λ in front is the Cauchy stress
    λ P of the same energy.
    """

    c_MPa: tuple[float, float, float]

    model, symbol, unit = "yeoh", "c_MPa", 2.0
    columns = 3

    def energy_slopes_MPa(self, j: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return c1 + 2 c2 J + 3 c3 J² and its derivative."""
        c1, c2, c3 = self.c_MPa
        return c1 + j * (2.0 * c2 + 3.0 * c3 * j), 2.0 * c2 + 6.0 * c3 * j


@dataclass(frozen=True, slots=True)
class Ogden(SeparableLaw):
    """W = Σ μi/αi (λ^αi + 2 λ^(-αi/2) - 3), P = Σ μi (λ^(αi-1) - λ^(-αi/2-1)).

    Twice the shear modulus is Σ μi αi, so E0 = 3/2 Σ μi αi (Ogden, Proc. R. Soc. A 326, 1972).

    Parameters
    ----------
    mu_MPa, alpha
        One of each a term; no alpha is 0.

    A fit's coefficients are the terms' shares E_i = 1.5 mu_i alpha_i of the initial modulus, which
    keeps the columns finite and apart from zero where an alpha goes through zero.
    """

    mu_MPa: tuple[float, ...]
    alpha: tuple[float, ...]

    model = "ogden"

    @property
    def columns(self) -> int:
        """Return the number of terms."""
        return len(self.alpha)

    nonlinear = columns

    def nominal_stress_MPa(self, stretch: ArrayLike) -> FloatArray:
        """Return Σ μi (λ^(αi-1) - λ^(-αi/2-1))."""
        stretch = positive_stretch(stretch)
        stress = np.zeros_like(stretch)
        for mu, a in zip(self.mu_MPa, self.alpha, strict=True):
            stress = stress + mu * (stretch ** (a - 1.0) - stretch ** (-a / 2.0 - 1.0))
        return stress

    def tangent_MPa(self, stretch: ArrayLike) -> FloatArray:
        """Return Σ μi ((αi-1) λ^(αi-2) + (αi/2+1) λ^(-αi/2-2))."""
        stretch = positive_stretch(stretch)
        tangent = np.zeros_like(stretch)
        for mu, a in zip(self.mu_MPa, self.alpha, strict=True):
            along, across = stretch ** (a - 2.0), stretch ** (-a / 2.0 - 2.0)
            tangent = tangent + mu * ((a - 1.0) * along + (a / 2.0 + 1.0) * across)
        return tangent

    def bounds(self, stretch_max: float) -> FloatArray:
        """Return the bounds of each exponent."""
        return np.tile([_SMALLEST_ALPHA, _LARGEST_ALPHA], (self.nonlinear, 1))

    def start(self, fraction: FloatArray, stretch_max: float) -> FloatArray:
        """Spread starts denser near zero, where rubbers lie; sorted, for terms can be swapped."""
        below = np.sqrt(-_SMALLEST_ALPHA)
        t = -below + fraction * (below + np.sqrt(_LARGEST_ALPHA))
        return np.sort(t * np.abs(t), axis=1)

    def evaluate(self, stretch: FloatArray, a: FloatArray, *, planar: bool = False) -> Columns:
        """Return (l^(a-1) - l^(-m a-1)) / (1.5 a) and its derivative by a; m is 1/2, planar 1.

        With x = ln l and h = (1 + m) a x / 2 it is, but for a factor, exp((1 - m) a x / 2) x / l *
        sinh(h) / h.
        """
        x = np.log(stretch)[None, :, None]
        ax = a[:, None, :] * x
        if planar:
            h, root = ax, np.ones_like(ax)
            up = np.exp(h)
        else:
            h, root = 0.75 * ax, np.exp(0.25 * ax)
            # The one exponential serves both: exp(h) is its cube.
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
        scale = root * ((4.0 / 3.0 if planar else 1.0) * x / stretch[None, :, None])
        phi = scale * quotient
        along, across = (0.0, 1.0) if planar else (0.25, 0.75)
        return phi, x * (along * phi + across * scale * slope)

    def divisor(self, a: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return 1.5 alpha: E_i = 1.5 mu_i alpha_i."""
        return 1.5 * a, np.full_like(a, 1.5)

    def parameters(self, a: FloatArray, c: FloatArray) -> dict[str, tuple[float, ...]]:
        """Return mu in MPa and alpha."""
        return {"mu_MPa": tuple(float(v) for v in c), "alpha": tuple(float(v) for v in a)}


@dataclass(frozen=True, slots=True)
class Martins(_FirstInvariant):
    """Exponential matrix and fibre: W = c2 (exp(c1 J) - 1) + c4 (exp(c3 (λ-1)²) - 1).

    J = I1 - 3 = λ² + 2/λ - 3. With g = λ - 1/λ²,
    P = 2 c1 c2 g exp(c1 J) + 2 c3 c4 (λ-1) exp(c3 (λ-1)²), and E0 = 6 c1 c2 + 2 c3 c4
    (Martins, Natal Jorge & Ferreira, Strain 42, 2006, who print the Cauchy stress λ P; the
    numbering is that of Hemleben's eq. 3.6). A fit's coefficients are the products c1 c2 and c3 c4.
    """

    c1: float
    c2_MPa: float
    c3: float
    c4_MPa: float

    model = "martins"
    columns = 2
    nonlinear = 2

    def energy_slopes_MPa(self, j: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return those of the matrix: c1 c2 exp(c1 J) and c1 times that."""
        slope = self.c1 * self.c2_MPa * np.exp(self.c1 * j)
        return slope, self.c1 * slope

    def fibre_MPa(self, stretch: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the fibre's stress and tangent."""
        square = (stretch - 1.0) ** 2
        slope = 2.0 * self.c3 * self.c4_MPa * np.exp(self.c3 * square)
        return slope * (stretch - 1.0), slope * (1.0 + 2.0 * self.c3 * square)

    def bounds(self, stretch_max: float) -> FloatArray:
        """Return the bounds of c1 and c3, both positive."""
        strain = np.array([stretch_max - 1.0])
        largest = np.stack([first_invariant(strain), strain**2])
        return np.asarray(np.array(_MARTINS_REACH) / np.maximum(largest, 1e-6))

    def start(self, fraction: FloatArray, stretch_max: float) -> FloatArray:
        """Spread starts evenly in the logarithm."""
        low, high = np.log(self.bounds(stretch_max)).T
        return np.asarray(np.exp(low + fraction * (high - low)))

    def evaluate(self, stretch: FloatArray, a: FloatArray, *, planar: bool = False) -> Columns:
        """Return the two columns and their derivatives by c1 and c3."""
        matrix, invariant = _front_and_invariant(stretch, planar)
        front = np.stack([2.0 * matrix, 2.0 * (stretch - 1.0)], axis=-1)
        inner = np.stack([invariant, (stretch - 1.0) ** 2], axis=-1)
        phi = front * np.exp(np.minimum(a[:, None, :] * inner, _LARGEST_EXPONENT))
        return phi, phi * inner

    def divisor(self, a: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return c1 and c3: the coefficients are c1 c2 and c3 c4."""
        return a, np.ones_like(a)

    def parameters(self, a: FloatArray, c: FloatArray) -> dict[str, tuple[float, ...]]:
        """Return c1 and c3, and c2 and c4 in MPa."""
        values = (a[0], c[0], a[1], c[1])
        return {k: (float(v),) for k, v in zip(LAW_PARAMETERS["martins"], values, strict=True)}


def _front_and_invariant(stretch: FloatArray, planar: bool) -> tuple[FloatArray, FloatArray]:
    """Return half of dI1/dl, l - l^-2 or planar l - l^-3, and I1 - 3, exact near one."""
    strain = stretch - 1.0
    if planar:
        square = stretch * stretch
        front = strain * (stretch + 1.0) * (square + 1.0) / (square * stretch)
        return front, (strain * (stretch + 1.0) / stretch) ** 2
    front = strain * (stretch * stretch + stretch + 1.0) / (stretch * stretch)
    return front, first_invariant(strain)


def first_invariant(strain: FloatArray) -> FloatArray:
    """Return I1 - 3 of tensile strains, exact near rest."""
    return np.asarray(strain * strain * (strain + 3.0) / (1.0 + strain))


# ------------------------------------------------------------------------------------------------
# Laws by name: of a palette's parameters, and for a fit.


_LAWS: Mapping[str, Callable[..., Law]] = {
    law.model: law for law in (Linear, Yielding, NeoHookean, Yeoh, Ogden, Martins)
}


def make_law(parameters: LawParameters) -> Law:
    """Return the law that a palette's parameters describe.

    Raises
    ------
    ArgumentError
        No law is called so, or it is one that is published and not planned with.
    """
    model = parameters.model
    check_known(model, _LAWS, f"law {model!r}: {{}}it must be one of")
    lengths, given = LAW_PARAMETERS[model], parameters.parameters
    return _LAWS[model](**{k: v[0] if lengths[k] == 1 else v for k, v in given.items()})


FITTED_MODELS: Mapping[str, tuple[SeparableLaw, ...]] = {
    "neo-hookean": (NeoHookean(1.0),),
    "ogden": tuple(Ogden((1.0,) * n, (2.0,) * n) for n in (1, 2, 3)),
    "yeoh": (Yeoh((1.0, 0.0, 0.0)),),
    "martins": (Martins(1.0, 1.0, 1.0, 1.0),),
}
"""The laws that can be fitted, in each number of terms that is tried, with any parameters.

A fourth Ogden term is never identified by one mode of deformation."""


def candidate_laws(name: str) -> tuple[SeparableLaw, ...]:
    """Return what ``--law`` stands for: a model in all its numbers of terms, one of them, or "all".

    Raises
    ------
    UnknownNameError
        No such law.
    """
    every = tuple(law for laws in FITTED_MODELS.values() for law in laws)
    known = {**FITTED_MODELS, **{law.name: (law,) for law in every}, "all": every}
    wanted = str(name).strip().casefold()
    check_known(wanted, known, f"law {name!r}: no such law; {{}}choose one of", UnknownNameError)
    return known[wanted]


# ------------------------------------------------------------------------------------------------
# One measure of stiffness for soft and rigid grades alike: the secant modulus.


_SMALL_STRAIN = 1e-5


def secant_modulus_MPa(law: Law, strain: ArrayLike) -> FloatArray:
    """Return nominal stress over engineering strain, P(1 + strain) / strain.

    At strain 0 this is the initial modulus: one measure for soft and rigid grades alike.

    Raises
    ------
    ArgumentError
        A strain is not above -1 and finite.
    """
    strain = np.asarray(strain, dtype=np.float64)
    stretch = positive_stretch(1.0 + strain)
    # Near rest the quotient loses digits; the tangent midway is the secant to second order.
    small = np.abs(strain) < _SMALL_STRAIN
    secant = law.nominal_stress_MPa(stretch) / np.where(small, 1.0, stretch - 1.0)
    return np.where(small, law.tangent_MPa(1.0 + strain / 2.0), secant)


# ------------------------------------------------------------------------------------------------
# How far a law is stable (Drucker): in tension and compression, in three loadings.
#
# With e the principal logarithmic strains, e1 + e2 + e3 = 0, and W the energy, a further small
# strain in any direction, across the load too, does positive work where the second derivative
#
#     H = [[h1 + h3, h3], [h3, h2 + h3]]   (for W = w(e1) + w(e2) + w(e3), h = w'')
#
# by (e1, e2) is positive definite (D. C. Drucker, J. Appl. Mech. 26, 1959; it is what Abaqus asks
# too). A term of Ogden's has h = mu alpha l^alpha; an energy of I1 has h = 4 W' l^2 and, besides,
# 4 W'' g g^T with g = (l1^2 - l3^2, l2^2 - l3^2). Martins' fibre lies along the first direction;
# across it, in equibiaxial loading, the matrix has to be stable by itself. The loadings are, with
# l the stretch,
#
#     uniaxial      l, l^-1/2, l^-1/2     equibiaxial   l, l, l^-2     planar   l, 1, 1/l.
#
# In uniaxial loading nominal stress is asked to rise too, which in tension is more: a pulled bar
# then has one answer.


_SOUND_POINTS = 400
"""Stretches looked at on either side of rest. Numerical: 0.001 to 0.003 apart."""

FARTHEST = 2.0
"""A law is followed to this many times the elongation at break. Chosen: to break it is measured,
from there to here a specimen stronger than the mean may still hold, beyond it nothing is known."""

LOWEST_STRETCH = 0.6
"""Compression that a law is to be sound to: the inner side of a finger that bends to a radius of
1.25 times its thickness, with the neutral fibre in the middle."""

_LOADINGS: Mapping[str, tuple[float, float]] = {
    "uniaxial": (-0.5, -0.5), "planar": (0.0, -1.0), "equibiaxial": (1.0, -2.0),
}  # fmt: skip
"""The powers of the stretch by which the second and third directions stretch."""


@dataclass(frozen=True, slots=True)
class Soundness:
    """Between which stretches a law is stable, by loading.

    Attributes
    ----------
    asked
        The stretches looked at: lowest and highest.
    sound
        Lowest and highest stretch about rest, of each loading that the law can be asked of.
    """

    asked: tuple[float, float]
    sound: Mapping[str, tuple[float, float]]

    @property
    def limits(self) -> tuple[str, ...]:
        """The loadings that end before they were asked to, as "uniaxial 0.6 to 1.68"."""
        return tuple(
            f"{loading} {low:.3g} to {high:.3g}"
            for loading, (low, high) in self.sound.items()
            if (low, high) != self.asked
        )


def stability(law: Law, strain_max: float) -> Soundness:
    """Return between which stretches a law is sound, in each loading it says anything of.

    They are looked at from `LOWEST_STRETCH` up.

    A law is sound where it is stable in Drucker's sense, and its nominal stress rises in uniaxial
    loading. Laws without an energy (linear, yielding) are asked for the latter alone: they tell
    nothing of other loadings.

    Parameters
    ----------
    strain_max
        Up to which tension is looked at: the elongation at break, or the working strain.
    """
    low, high = asked = (LOWEST_STRETCH, 1.0 + strain_max)
    told = _LOADINGS if isinstance(law, Ogden | _FirstInvariant) else ("uniaxial",)
    ends = {one: (_sound_end(law, one, low), _sound_end(law, one, high)) for one in told}
    return Soundness(asked, ends)


def _sound_end(law: Law, loading: str, asked: float) -> float:
    """Return how far from rest a law is sound in a loading, towards the stretch asked for."""
    stretch = np.geomspace(1.0, asked, _SOUND_POINTS + 1)
    sound = np.ones(len(stretch), dtype=bool)
    if isinstance(law, Ogden | _FirstInvariant):
        for h11, h22, h12 in _second_derivatives_MPa(law, stretch, _LOADINGS[loading]):
            sound &= (h11 > 0.0) & (h11 * h22 > h12 * h12)
    if loading == "uniaxial":
        sound &= law.tangent_MPa(stretch) > 0.0
    return asked if sound.all() else float(stretch[max(int(np.argmin(sound)) - 1, 0)])


def _second_derivatives_MPa(
    law: Ogden | _FirstInvariant, stretch: FloatArray, powers: tuple[float, float]
) -> list[tuple[FloatArray, FloatArray, FloatArray]]:
    """Return H11, H22 and H12 of the energy; of Martins' without its fibre too."""
    second, third = (stretch**power for power in powers)
    squares = np.stack([stretch, second, third]) ** 2
    if isinstance(law, Ogden):
        terms = zip(law.mu_MPa, law.alpha, strict=True)
        h = sum((mu * a * squares ** (a / 2.0) for mu, a in terms), np.zeros_like(squares))
        return [(h[0] + h[2], h[1] + h[2], h[2])]
    slope, curvature = law.energy_slopes_MPa(squares.sum(axis=0) - 3.0)
    h = 4.0 * slope * squares
    g1, g2 = squares[0] - squares[2], squares[1] - squares[2]
    bend = 4.0 * curvature
    found = (h[0] + h[2] + bend * g1 * g1, h[1] + h[2] + bend * g2 * g2, h[2] + bend * g1 * g2)
    if not isinstance(law, Martins):
        return [found]
    stress, tangent = law.fibre_MPa(stretch)
    along = stretch * (stress + stretch * tangent)
    return [(found[0] + along, *found[1:]), found]
