"""Material law: one grade is not what the palette says.

Size: largest relative change of its secant modulus up to strain 0.35; the sign is drawn.
"""

from dataclasses import replace

import numpy as np

from benchmarks.withheld.reality.base_law import STRAINS, BaseLaw
from benchmarks.withheld.reality.bench import Bench, FloatArray
from benchmarks.withheld.reality.design import Design
from benchmarks.withheld.reality.effects.form import Effect, Form, Shape, number, sign

__all__ = ["EFFECT"]

_END_STRAIN = 0.35


def _changed(bench: Bench, size: float, shape: Shape, course: FloatArray) -> Bench:
    """Change the grade's secant moduli by `course`, at most 1 up to the end strain."""
    change = 1.0 + number(shape, "sign") * size * course
    at = np.isclose(bench.law.coordinates, number(shape, "coordinate"))
    log_secant = bench.law.log_secant_MPa + np.where(at[:, None], np.log(change), 0.0)
    return replace(bench, law=BaseLaw(bench.law.coordinates, log_secant))


def _factor(bench: Bench, size: float, shape: Shape) -> Bench:
    return _changed(bench, size, shape, np.ones_like(STRAINS))


def _tilted(bench: Bench, size: float, shape: Shape) -> Bench:
    return _changed(bench, size, shape, 0.5 + 0.5 * np.minimum(STRAINS / _END_STRAIN, 1.0))


def _initial(bench: Bench, size: float, shape: Shape) -> Bench:
    """The yielding phase is off: much at the start, little later."""
    fade = np.exp(-STRAINS / number(shape, "fade_strain"))
    return _changed(bench, size, shape, 0.3 + 0.7 * fade)


def _late(bench: Bench, size: float, shape: Shape) -> Bench:
    """The chains lock earlier or later: nothing at the start, all at the end."""
    scaled = np.minimum(STRAINS / _END_STRAIN, 1.0)
    return _changed(bench, size, shape, scaled ** number(shape, "power"))


def _waning(bench: Bench, size: float, shape: Shape) -> Bench:
    return _changed(bench, size, shape, 1.0 - 0.6 * np.minimum(STRAINS / _END_STRAIN, 1.0))


def _knee(bench: Bench, size: float, shape: Shape) -> Bench:
    """The two phases meet elsewhere: most about the knee of the curve."""
    away = (STRAINS - number(shape, "knee_strain")) / 0.1
    return _changed(bench, size, shape, 0.3 + 0.7 / (1.0 + away**2))


def _draw(rng: np.random.Generator, design: Design) -> Shape:
    coordinates = np.unique(design.coordinate[design.profile < 0])
    return {"sign": sign(rng), "coordinate": float(rng.choice(coordinates))}


def _draw_initial(rng: np.random.Generator, design: Design) -> Shape:
    return {**_draw(rng, design), "fade_strain": float(rng.uniform(0.08, 0.2))}


def _draw_late(rng: np.random.Generator, design: Design) -> Shape:
    return {**_draw(rng, design), "power": float(rng.uniform(0.6, 1.1))}


def _draw_knee(rng: np.random.Generator, design: Design) -> Shape:
    return {**_draw(rng, design), "knee_strain": float(rng.uniform(0.08, 0.22))}


EFFECT = Effect(
    "material-law",
    stage=1,
    where=("material",),
    library={
        "development": (Form("factor", 0.06, 0.4, _factor, _draw),),
        "validation": (Form("waning", 0.07, 0.4, _waning, _draw),),
        "final": (Form("tilted", 0.08, 0.45, _tilted, _draw),),
    },
    other={
        "development": (Form("initial", 0.08, 0.45, _initial, _draw_initial),),
        "validation": (Form("knee", 0.08, 0.4, _knee, _draw_knee),),
        "final": (Form("late", 0.08, 0.3, _late, _draw_late),),
    },
)
