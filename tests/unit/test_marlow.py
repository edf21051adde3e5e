"""Marlow's law: the palette's own curve in tension, and stable in every mode for all grades."""

import dataclasses

import numpy as np
import pytest

from planner.errors import PaletteError
from planner.materials.laws import FARTHEST
from planner.materials.marlow import marlow_table, uniaxial_strain
from planner.materials.mixtures import CoefficientModel
from planner.palette import LawParameters
from planner.printers import palette_of
from planner.simulation.element import law_at

PALETTES = ("connex3-tango-vero", "connex3-tango-vero-extensometer")
GRADES = [(name, k) for name in PALETTES for k in range(10)]
POISSON = 0.5  # where Young's modulus is thrice the shear modulus, as of the palette's curves


@pytest.fixture(scope="module")
def tables():
    models = {name: CoefficientModel(palette_of(palette=name)) for name in PALETTES}
    return {name: (model, marlow_table(model, poisson=POISSON)) for name, model in models.items()}


def at(table, coordinate, invariant):
    """W' and dW'/dI1 of a mixture at values of I1."""
    (below,), (share,) = table.places(np.array([coordinate]))
    x = np.sqrt(np.maximum(invariant - 3.0, 1e-20))
    law = law_at.py_func  # kernels alone call the compiled one
    log, over_x, _ = np.array(
        [law(table.log_slope_MPa, table.step, below, share, one) for one in x]
    ).T
    return np.exp(log), np.exp(log) * over_x / (2.0 * x)


def uniaxial_MPa(table, coordinate, stretch):
    slope, _ = at(table, coordinate, stretch**2 + 2.0 / stretch)
    return 2.0 * slope * (stretch - stretch**-2.0)


def test_a_strain_is_found_from_its_invariant():
    strain = np.concatenate([[0.0], np.geomspace(1e-7, 5.0, 40)])
    stretch = 1.0 + strain
    # (I1 - 3) as a product: as a difference it has no digits near rest.
    x = strain * np.sqrt((strain + 3.0) / stretch)
    np.testing.assert_allclose(uniaxial_strain(x), strain, rtol=1e-13)


@pytest.mark.parametrize(("name", "grade"), GRADES)
def test_in_tension_it_is_the_palettes_curve(tables, name, grade):
    model, table = tables[name]
    material = model.palette.materials[grade]
    stretch = 1.0 + np.linspace(1e-4, material.elongation_at_break, 60)
    wanted = model.nominal_stress_MPa(material.coordinate, stretch)
    found = uniaxial_MPa(table, material.coordinate, stretch)
    # Cubics at 1025 places hold a smooth law; one that yields bends within a few of them.
    yields = material.law.model == "yielding"
    np.testing.assert_allclose(found, wanted, rtol=3e-4 if yields else 1e-6)


@pytest.mark.parametrize(("name", "grade"), GRADES)
def test_every_grade_is_stable_in_every_mode(tables, name, grade):
    """The tangent over logarithmic strains of no volume is positive, to twice the break.

    In uniaxial tension and compression, equibiaxial and planar tension, and at random between:
    with s the squared stretches it is 4 W'' s s + 4 W' diag(s), on the plane of no volume.
    """
    model, table = tables[name]
    material = model.palette.materials[grade]
    e = np.log(1.0 + FARTHEST * material.elongation_at_break) * np.linspace(0.01, 1.0, 25)
    one = np.ones_like(e)
    modes = [(e, -0.5 * e), (-e, 0.5 * e), (e, e), (e, 0.0 * one)]
    draws = e[-1] * np.random.default_rng(1).uniform(-1.0, 1.0, (2, 100))
    first, second = np.concatenate([*(np.stack(mode) for mode in modes), draws], axis=1)
    square = np.exp(2.0 * np.stack([first, second, -first - second], axis=1))
    slope, curvature = at(table, material.coordinate, square.sum(axis=1))
    full = curvature[:, None, None] * square[:, :, None] * square[:, None, :]
    full[:, range(3), range(3)] += slope[:, None] * square
    plane = np.linalg.svd(np.ones((1, 3)))[2][1:]
    lows = np.linalg.eigvalsh(plane @ full @ plane.T)[:, 0]
    assert (lows / slope).min() > 0.0


def test_between_grades_it_is_near_the_mixtures_own_curve(tables):
    """Planning interpolates laws' coefficients or stresses, the table ln W': a few per cent."""
    model, table = tables["connex3-tango-vero"]
    for coordinate in np.linspace(0.05, 1.45, 15):
        strain = 0.5 * float(table.break_at(np.array([coordinate]))[0])
        wanted = float(model.nominal_stress_MPa(coordinate, 1.0 + strain))
        found = uniaxial_MPa(table, coordinate, np.array([1.0 + strain]))[0]
        assert found == pytest.approx(wanted, rel=0.03)


def test_youngs_modulus_at_rest_is_kept_for_every_poissons_ratio(tables):
    model, _ = tables["connex3-tango-vero"]
    table = marlow_table(model, poisson=0.3)
    young = 2.0 * 1.3 * table.shear_modulus_MPa(model.coordinates)
    np.testing.assert_allclose(young, model.modulus_MPa(model.coordinates, 0.0), rtol=1e-9)


def test_the_energy_is_the_work_of_a_tensile_test(tables):
    model, table = tables["connex3-tango-vero"]
    for k, material in enumerate(model.palette.materials):
        node = int(np.argmin(np.abs(table.coordinate - material.coordinate)))
        strain = material.elongation_at_break
        x = np.sqrt(strain**2 * (strain + 3.0) / (1.0 + strain))
        places = table.step * np.arange(table.energy_MPa.shape[1])
        stored = x**2 * np.interp(x, places, table.energy_MPa[node])
        steps = np.linspace(0.0, strain, 4001)
        stress = model.nominal_stress_MPa(model.coordinates[k], 1.0 + steps)
        work = np.sum(0.5 * np.diff(steps) * (stress[1:] + stress[:-1]))
        # The trapezium over 1025 steps, and the straight line between two.
        assert stored == pytest.approx(work, rel=1e-3)


def test_a_law_that_ceases_to_rise_is_refused_by_name():
    palette = palette_of()
    falling = dataclasses.replace(
        palette.materials[0],
        law=LawParameters("ogden", {"mu_MPa": (0.2, -0.007), "alpha": (2.0, 6.0)}),
    )
    materials = (falling, *palette.materials[1:])
    model = CoefficientModel(dataclasses.replace(palette, materials=materials))
    with pytest.raises(PaletteError, match=r"TangoPlus.*ceases to rise.*before its break"):
        marlow_table(model, poisson=0.49)
