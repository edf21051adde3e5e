"""The thesis' published figures, as data."""

from dataclasses import dataclass
from importlib.resources import files

import msgspec

__all__ = ["Published", "Thesis", "load_thesis"]


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
