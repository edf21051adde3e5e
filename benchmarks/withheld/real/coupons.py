"""From published stress and strain to specimens, and from a reference subset to a palette."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.interpolate import PchipInterpolator

from planner.gap.campaign import Specimen
from planner.materials.characterise import Curve
from planner.materials.palette_study import fit
from planner.materials.study import Study
from planner.numerics import FloatArray
from planner.palette import Palette, Reference

__all__ = [
    "GAUGE_MM",
    "THICKNESS_MM",
    "WIDTH_MM",
    "coupon",
    "fitted_palette",
    "folder_of",
    "median_rate",
]

WIDTH_MM, THICKNESS_MM, GAUGE_MM = 10.0, 2.0, 50.0
"""Assumed where stress and strain alone are published: they cancel."""

_MARGIN = 1.01


def folder_of(data: Path, name: str) -> Path:
    """Return the folder of a source, in the data's own or one below.

    Raises
    ------
    OSError
        There is none.
    """
    found = next((path for path in (data / name, *data.glob(f"*/{name}")) if path.is_dir()), None)
    if found is None:
        raise OSError(f"{data}: no folder {name} there")
    return found


def coupon(
    id: str,
    material: str,
    time_s: FloatArray,
    strain: FloatArray,
    stress_MPa: FloatArray,
    **more: object,
) -> Specimen:
    """Return a specimen whose force and travel follow from nominal stress and strain.

    A first point at rest is added where there is none. Size is the assumed one unless given.
    """
    size = {"width_mm": WIDTH_MM, "thickness_mm": THICKNESS_MM, "gauge_mm": GAUGE_MM}
    columns = {**size, **more}
    gauge, area = columns["gauge_mm"], columns["width_mm"] * columns["thickness_mm"]  # type: ignore[operator]
    if time_s[0] > 0.0 and strain[0] != 0.0:
        time_s, strain, stress_MPa = (
            np.concatenate([[0.0], c]) for c in (time_s, strain, stress_MPa)
        )
    return Specimen(
        id=id,
        material=material,
        time_s=time_s,
        displacement_mm=gauge * strain,  # type: ignore[operator]
        force_N=area * stress_MPa,
        **columns,  # type: ignore[arg-type]  # columns by name
    )


def median_rate(time_s: FloatArray, strain: FloatArray) -> float:
    """Return the median strain rate of the steps that move, in 1/s."""
    rate = np.abs(np.diff(strain) / np.diff(time_s))
    return float(np.median(rate[rate > 1e-3 * rate.max()]))


def fitted_palette(
    name: str,
    curves: Mapping[str, Sequence[tuple[FloatArray, FloatArray]]],
    reference: Reference,
    source: str,
) -> Palette:
    """Fit planner's own laws to loading curves (strain, nominal stress in MPa) by material.

    Raises
    ------
    ValueError
        The laws cross, so that no palette can hold them.
    """
    groups = {
        material: tuple(
            Curve(f"{material}-{number}", strain, stress, material=material)
            for number, (strain, stress) in enumerate(given, start=1)
        )
        for material, given in curves.items()
    }
    study = fit(Study(groups, {}, ()), name=name)
    if study.problem is not None:
        raise ValueError(f"{name}: {study.problem}")
    # None of the tests went to break: the laws hold as far as any of a material's curves goes
    reach = {m: max(float(strain[-1]) for strain, _ in given) for m, given in curves.items()}
    materials = tuple(
        replace(m, elongation_at_break=float(f"{_MARGIN * reach[m.id]:.4g}"))
        for m in study.palette.materials
    )
    return replace(study.palette, materials=materials, reference=reference, source=source)


def evenly(
    strain: FloatArray, *stresses: FloatArray, points: int = 80
) -> tuple[FloatArray, list[FloatArray]]:
    """Return stresses read off a figure at uneven strains at even ones, monotone between."""
    at = np.linspace(strain[0], strain[-1], points)
    return at, [PchipInterpolator(strain, stress)(at) for stress in stresses]
