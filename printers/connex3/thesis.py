"""The thesis' published figures, as data, and its law as printed: to reproduce it, not to plan."""

from dataclasses import dataclass
from importlib.resources import files

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from planner.numerics import FloatArray

__all__ = ["Published", "Thesis", "literal_tangent_MPa", "load_thesis"]


@dataclass(frozen=True, slots=True)
class Published:
    """One grade's rows of Tables 3.1 and 3.2.

    Attributes
    ----------
    c
        Coefficients c1 to c6 of eq. 3.8, or empty for a rigid grade.
    """

    id: str
    youngs_modulus_MPa: float
    toughness_MJ_m3: float
    elongation_at_break: float
    c: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class Thesis:
    """The grades from soft to hard, and the quadratics (q2, q1, q0) of c1 to c6."""

    materials: tuple[Published, ...]
    quadratics: tuple[tuple[float, float, float], ...]
    source: str

    def coordinate(self, published: Published) -> float:
        """Return m = k/6, k counting the grades from soft to hard."""
        return self.materials.index(published) / 6.0

    @property
    def elastomers(self) -> tuple[Published, ...]:
        """The grades with a curve."""
        return tuple(p for p in self.materials if p.c)


def load_thesis() -> Thesis:
    """Read ``thesis.toml``."""
    text = (files("printers.connex3") / "thesis.toml").read_bytes()
    document = msgspec.toml.decode(text)
    return Thesis(
        materials=msgspec.convert(document["material"], tuple[Published, ...]),
        quadratics=msgspec.convert(
            document["quadratics"]["rows"], tuple[tuple[float, float, float], ...]
        ),
        source=document["source"],
    )


# ------------------------------------------------------------------------------------------------
# The slope of eq. 3.8, whose stress is in `planner.materials.algorithm_one`.


def literal_tangent_MPa(c: ArrayLike, strain: ArrayLike, order: int = 1) -> FloatArray:
    """Return the derivative of eq. 3.8 by the strain, of order 1 or 2.

    Parameters
    ----------
    c, strain
        As `planner.materials.algorithm_one.literal_stress_MPa`.
    """
    c = np.asarray(c, dtype=np.float64)
    x = np.asarray(strain, dtype=np.float64)
    slope: FloatArray = np.zeros(np.broadcast_shapes(c.shape[:-1], x.shape))
    for i in (0, 2, 4):
        a, b = c[..., i], c[..., i + 1]
        up, down = a * b, a * b * 2.0 ** (b - 2.0)
        if order == 1:
            slope = slope + up * x ** (b - 1.0) + down * x ** (-b / 2.0 - 1.0)
        else:
            slope = slope + up * (b - 1.0) * x ** (b - 2.0)
            slope = slope - down * (b / 2.0 + 1.0) * x ** (-b / 2.0 - 2.0)
    return slope
