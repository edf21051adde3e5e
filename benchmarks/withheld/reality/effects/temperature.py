"""Temperature: softer when warm, on the flank of the glass transition.

Size: relative drop of the modulus per kelvin at the palette's temperature, for the softest grade;
harder grades lose less.
"""

import numpy as np

from benchmarks.withheld.reality.bench import Bench, FloatArray
from benchmarks.withheld.reality.design import Design
from benchmarks.withheld.reality.effects.form import Effect, Form, Shape, number

__all__ = ["EFFECT"]

_ZERO_C_K = 273.15


def _warmer_K(bench: Bench) -> FloatArray:
    return (bench.design.temperature_C - bench.palette.temperature_C)[:, None]


def _less_when_hard(bench: Bench) -> FloatArray:
    return 1.0 - 0.5 * np.clip(bench.coordinate, 0.0, 1.5)


def _exponential(bench: Bench, size: float, shape: Shape) -> Bench:
    return bench.stiffened(np.exp(-size * _less_when_hard(bench) * _warmer_K(bench)))


def _wlf(bench: Bench, size: float, shape: Shape) -> Bench:
    c2_K = number(shape, "c2_K")
    warmer = _warmer_K(bench)
    log_shift = warmer / (1.0 + warmer / c2_K)
    return bench.stiffened(np.exp(-size * _less_when_hard(bench) * log_shift))


def _arrhenius(bench: Bench, size: float, shape: Shape) -> Bench:
    plateau = number(shape, "plateau")
    cold_K = bench.palette.temperature_C + _ZERO_C_K
    slope = size * _less_when_hard(bench) / (1.0 - plateau)
    thermal = slope * cold_K**2 * (1.0 / (_warmer_K(bench) + cold_K) - 1.0 / cold_K)
    return bench.stiffened(plateau + (1.0 - plateau) * np.exp(thermal))


def _sigmoid(bench: Bench, size: float, shape: Shape) -> Bench:
    width_K = number(shape, "width_K")
    centre_K = number(shape, "centre_K") + 6.0 * bench.coordinate

    def transition(warmer: FloatArray | float) -> FloatArray:
        return np.tanh((warmer - centre_K) / width_K)

    steepness = (1.0 - transition(0.0) ** 2) / width_K
    drop = size * _less_when_hard(bench) / steepness
    return bench.stiffened(np.exp(-drop * (transition(_warmer_K(bench)) - transition(0.0))))


def _hyperbolic(bench: Bench, size: float, shape: Shape) -> Bench:
    """The modulus is inverse to what it gives more, kelvin by kelvin."""
    change = size * _less_when_hard(bench) * _warmer_K(bench)
    return bench.stiffened(1.0 / np.maximum(1.0 + change, 0.25))


def _nearing(bench: Bench, size: float, shape: Shape) -> Bench:
    """Each mixture's transition lies above: hardly any when cold, ever more when warm."""
    scale_K = number(shape, "scale_K") * (1.0 + 0.5 * bench.coordinate)
    drop = size * _less_when_hard(bench) * scale_K * np.expm1(_warmer_K(bench) / scale_K)
    return bench.stiffened(np.exp(-drop))


def _draw_wlf(rng: np.random.Generator, design: Design) -> Shape:
    return {"c2_K": float(rng.uniform(50.0, 110.0))}


def _draw_arrhenius(rng: np.random.Generator, design: Design) -> Shape:
    return {"plateau": float(rng.uniform(0.1, 0.35))}


def _draw_sigmoid(rng: np.random.Generator, design: Design) -> Shape:
    return {"width_K": float(rng.uniform(14.0, 25.0)), "centre_K": float(rng.uniform(-10.0, 6.0))}


def _draw_scale(rng: np.random.Generator, design: Design) -> Shape:
    return {"scale_K": float(rng.uniform(12.0, 40.0))}


EFFECT = Effect(
    "temperature",
    stage=1,
    where=("temperature_C",),
    library={
        "development": (Form("exponential", 0.003, 0.05, _exponential),),
        "validation": (Form("hyperbolic", 0.004, 0.05, _hyperbolic),),
        "final": (Form("wlf", 0.004, 0.07, _wlf, _draw_wlf),),
    },
    other={
        "development": (Form("arrhenius", 0.003, 0.05, _arrhenius, _draw_arrhenius),),
        "validation": (Form("nearing", 0.004, 0.05, _nearing, _draw_scale),),
        "final": (Form("sigmoid", 0.004, 0.06, _sigmoid, _draw_sigmoid),),
    },
)
