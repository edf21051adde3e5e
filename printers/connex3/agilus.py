"""What others measured on Agilus30, on Vero and on rubbers like it, brought to one test."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files

import msgspec
import numpy as np

from planner.materials.laws import NeoHookean, make_law, secant_modulus_MPa
from planner.materials.mixtures import gent_modulus_MPa
from planner.numerics import FloatArray
from planner.palette import parse_palette
from printers.connex3.derive import PALETTE
from printers.connex3.thesis import load_thesis

__all__ = [
    "Conditions",
    "Entry",
    "Reading",
    "Relaxation",
    "Sources",
    "Stated",
    "load_sources",
    "rigid_readings",
    "rubber_readings",
]


class Conditions(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """The test that all readings are brought to."""

    at_strain: float
    strain_rate_per_s: float
    temperature_C: float

    @property
    def time_s(self) -> float:
        """How long the pull to `at_strain` takes."""
        return self.at_strain / self.strain_rate_per_s


class Stated(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """What a source prints of one material: several figures, or the ends of a range."""

    source: str
    address: str
    material: str
    modulus_MPa: list[float]
    shore_A: float = math.nan
    at_strain: float = math.nan


class _Shaken(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    source: str
    address: str
    material: str
    shore_A: float
    master_curve_C: float
    master_curve: list[tuple[float, float]]
    at_1_Hz: list[tuple[float, float]]


class Entry(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """A material of the palette; one without a hardness is rigid, and yields at its strength."""

    id: str
    aliases: list[str]
    elongation_at_break: float
    colour: str
    shore_A: float = math.nan
    density_g_cm3: float = math.nan
    strength_MPa: tuple[float, float] = (math.nan, math.nan)


class Relaxation(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """A Prony series: shares `g` of the modulus at once relax with times `tau_s`.

    Attributes
    ----------
    agilus_share
        Share of Agilus30 by volume, the rest VeroUltraWhite.
    reference_C
        Temperature that the times hold at; others by WLF above it, by Arrhenius below.
    """

    agilus_share: float
    long_term_MPa: float
    reference_C: float
    arrhenius_K: float
    g: list[float]
    tau_s: list[float]

    def secant_MPa(self, time_s: float, temperature_C: float, wlf: Sequence[float]) -> float:
        """Return the secant modulus at the end of a pull of constant rate that lasts `time_s`.

        The mean of the relaxation modulus over the pull: linear viscoelasticity.
        """
        kelvin, above = 273.15, temperature_C - self.reference_C
        log_shift = (
            -wlf[0] * above / (wlf[1] + above)
            if above >= 0.0
            else self.arrhenius_K
            * (1.0 / (temperature_C + kelvin) - 1.0 / (self.reference_C + kelvin))
        )
        g, tau = np.array(self.g), np.array(self.tau_s) * 10.0**log_shift
        at_once = self.long_term_MPa / (1.0 - g.sum())
        left = g * tau / time_s * -np.expm1(-time_s / tau)
        return float(self.long_term_MPa + at_once * left.sum())


class _Stamp(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    source: str
    address: str
    wlf: tuple[float, float]
    density_g_cm3: Mapping[str, float]
    relaxation: list[Relaxation]


class Sources(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """``agilus.toml``."""

    schema: int
    source: str
    test: Conditions
    pulled: list[Stated]
    shaken: _Shaken
    rigid: list[Stated]
    material: list[Entry]
    stamp: _Stamp


@dataclass(frozen=True, slots=True)
class Reading:
    """What a source says of one material, brought to the test.

    Attributes
    ----------
    low, high
        Ends, where the source gives several figures or bounds.
    shore_A
        Nominal hardness; of a rigid material nan.
    """

    source: str
    address: str
    material: str
    low_MPa: float
    high_MPa: float
    modulus_MPa: float
    shore_A: float = math.nan

    @property
    def of_gent(self) -> float:
        """The modulus over the one that Gent's relation gives for the hardness."""
        return self.modulus_MPa / gent_modulus_MPa(self.shore_A)


def load_sources() -> Sources:
    """Read ``agilus.toml``."""
    text = (files("printers.connex3") / "agilus.toml").read_bytes()
    return msgspec.toml.decode(text, type=Sources)


def rubber_readings(sources: Sources) -> list[Reading]:
    """Return what each source says of a rubber of known hardness, at the test.

    Stated secants at another strain follow the neo-Hookean law's bend; stated rates are not
    known well enough to allow for. Relaxation gives the secant of a pull at the test's rate and
    temperature. A storage modulus is taken at the frequency 1 / (2 π t) of the pull's time t. The
    Tango ladder is the other palette's: its laws hold at the test already.
    """
    test, stamp, shaken = sources.test, sources.stamp, sources.shaken
    agilus = stamp.relaxation[0].secant_MPa(test.time_s, test.temperature_C, stamp.wlf)
    at_20_C = _between(shaken.master_curve, 1.0 / (2.0 * math.pi * test.time_s))
    cooler, warmer = (_between(shaken.at_1_Hz, t) for t in (20.0, test.temperature_C))
    at_test = at_20_C * warmer / cooler
    tango = parse_palette(PALETTE.read_bytes(), name=PALETTE.stem)
    laws = {p.id: make_law(tango.resolve(p.id).law) for p in load_thesis().elastomers[1:]}
    moduli = {name: float(secant_modulus_MPa(law, test.at_strain)) for name, law in laws.items()}
    ladder = "Hemleben 2017", f"printers/connex3/palettes/{PALETTE.name}"
    return [
        *(_stated(entry, _bend(entry.at_strain, test)) for entry in sources.pulled),
        _one(stamp.source, stamp.address, "Agilus30 Black", agilus, 30.0),
        _one(shaken.source, shaken.address, shaken.material, at_test, shaken.shore_A),
        *(_one(*ladder, name, modulus, float(name[-2:])) for name, modulus in moduli.items()),
    ]


def rigid_readings(sources: Sources) -> list[Reading]:
    """Return what each source says of Vero: stated moduli, and relaxation at 2 % strain.

    2 %, as Vero yields at a few per cent and has no modulus at the test's strain.
    """
    test, stamp = sources.test, sources.stamp
    time_s = 0.02 / test.strain_rate_per_s
    vero = stamp.relaxation[-1].secant_MPa(time_s, test.temperature_C, stamp.wlf)
    return [
        *(_stated(entry, 1.0) for entry in sources.rigid),
        _one(stamp.source, stamp.address, "VeroUltraWhite", vero),
    ]


def _bend(strain: float, test: Conditions) -> float:
    """Return a neo-Hookean secant at the test's strain over the one at `strain`."""
    there, stated = secant_modulus_MPa(NeoHookean(1.0), [test.at_strain, strain])
    return float(there / stated)


def _stated(entry: Stated, factor: float) -> Reading:
    moduli: FloatArray = factor * np.array(entry.modulus_MPa)
    return Reading(
        entry.source,
        entry.address,
        entry.material,
        float(moduli.min()),
        float(moduli.max()),
        float(np.exp(np.log(moduli).mean())),
        entry.shore_A,
    )


def _one(
    source: str, address: str, material: str, modulus_MPa: float, shore_A: float = math.nan
) -> Reading:
    return Reading(source, address, material, modulus_MPa, modulus_MPa, modulus_MPa, shore_A)


def _between(points: Sequence[tuple[float, float]], place: float) -> float:
    """Return the modulus at a place between points, straight in its logarithm."""
    x, y = np.array(points).T
    return float(np.exp(np.interp(place, x, np.log(y))))
