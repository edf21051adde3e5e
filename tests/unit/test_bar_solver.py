"""The solver of bars against closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from planner.errors import PaletteError
from planner.materials.laws import make_law
from planner.materials.mixtures import CoefficientModel
from planner.palette import LawParameters, Material, Palette, Reference
from planner.simulation.bar_solver import (
    RELAXATION_TIMES_s,
    Setup,
    instantaneous,
    law_tables,
    predict,
    unaltered,
)

GAUGE_MM = 40.0
AREA_mm2 = 30.0
NODES = np.linspace(0.0, 1.0, 21)


def material(id, coordinate, model, elongation=1.2, **parameters):
    return Material(id, coordinate, elongation, 1.1, LawParameters(model, parameters))


SOFT = material("soft", 0.0, "ogden", mu_MPa=(0.26, 0.42), alpha=(-1.5, 1.5))
FIRM = material("firm", 0.5, "yeoh", c_MPa=(0.9, -0.12, 0.03))
HARD = material("hard", 1.0, "linear", 0.1, modulus_MPa=(900.0,))
LINEAR = material("linear", 0.0, "linear", modulus_MPa=(2.0,))
PALETTE = Palette("three", (SOFT, FIRM, HARD))
LAWS = law_tables(PALETTE)
LINEAR_LAWS = law_tables(Palette("one", (LINEAR,)))


def stress_MPa(coordinate, strain, laws=LAWS):
    return laws.stress_and_tangent_MPa(coordinate, strain)[0]


def setup(travel_mm, *, time_s=None, coordinates=((0.0,),), lengths=None, **changes):
    """A rigid machine that pulls one test a tuple of coordinates through `travel_mm`."""
    travel = np.atleast_2d(travel_mm)
    travel = np.broadcast_to(travel, (len(coordinates), travel.shape[1])).copy()
    P, T = travel.shape
    counts = [len(c) for c in coordinates]
    S = sum(counts)
    length = [np.full(n, GAUGE_MM / n) for n in counts] if lengths is None else lengths
    ones, first_slice = np.ones(P), np.concatenate([[0], np.cumsum(counts)])
    plain = Setup(
        reference=Reference(),
        palette_coordinate=np.array([0.0, 1.0]),
        first_slice=first_slice,
        time_s=np.broadcast_to(
            np.arange(T, dtype=float) if time_s is None else time_s, (P, T)
        ).copy(),
        travel_mm=travel,
        rate_per_s=0.03 * ones,
        temperature_C=23.0 * ones,
        soak_h=0.0 * ones,
        age_days=ones,
        width_mm=10.0 * ones,
        thickness_mm=3.0 * ones,
        gauge_mm=GAUGE_MM * ones,
        orientation=np.zeros(P, dtype=int),
        designs=(None,) * P,
        x_mm=np.zeros(S),
        coordinate=np.concatenate([np.array(c, dtype=float) for c in coordinates]),
        length_mm=np.concatenate(length),
        area_mm2=np.full(S, AREA_mm2),
        **unaltered(first_slice, T),
    )
    return plain.with_(**changes)


def there_and_back(strains, points=41):
    """Travel through turning points of strain, from rest."""
    ways = [np.linspace(a, b, points)[1:] for a, b in zip((0.0, *strains), strains, strict=False)]
    return GAUGE_MM * np.concatenate([[0.0], *ways])


def test_tables_are_the_laws():
    strain = np.linspace(0.0, 1.15, 777)
    for m in (SOFT, FIRM):
        stress = stress_MPa(m.coordinate, strain)
        # Cubics on 600 intervals leave the laws' ln(secant) off by about 1e-11.
        np.testing.assert_allclose(stress, make_law(m.law).nominal_stress_MPa(1 + strain), 1e-9)
    model = CoefficientModel(PALETTE)
    inside = strain[strain < 0.2]  # the hard material's law is followed to twice its 0.1
    blend = stress_MPa(0.73, inside)
    np.testing.assert_allclose(blend, model.nominal_stress_MPa(0.73, 1 + inside), 1e-9)


def test_tables_reach_as_far_as_laws_are_followed():
    """A tape that stretches to ten times its length."""
    tape = material("tape", 0.0, "ogden", 9.0, mu_MPa=(0.08, 1e-5), alpha=(1.6, 6.0))
    laws = law_tables(Palette("p", (tape, FIRM)))
    strain = np.concatenate([np.linspace(0.0, 0.1, 101), np.linspace(0.1, 18.0, 777)])
    wanted = make_law(tape.law).nominal_stress_MPa(1.0 + strain)
    # As fine as up to 3, where the laws' ln(secant) are off by 1e-11.
    np.testing.assert_allclose(stress_MPa(0.0, strain, laws), wanted, rtol=1e-9, atol=1e-15)
    travel = np.linspace(0.0, 9.0 * GAUGE_MM, 64)
    force = predict(setup(travel), laws).force_N[0]
    law = make_law(tape.law).nominal_stress_MPa(1.0 + travel / GAUGE_MM)
    np.testing.assert_allclose(force, AREA_mm2 * law, rtol=1e-8, atol=1e-9)


def test_compressed_coupon_is_its_law_and_its_force_is_negative():
    rubber = material("rubber", 0.0, "yeoh", c_MPa=(0.17, -0.004, 4e-4))
    travel = np.linspace(0.0, 0.7 * GAUGE_MM, 64)
    pushed = setup(travel, pushed=np.ones(1, dtype=bool), offset_N=np.ones((1, 64)))
    found = predict(pushed, law_tables(Palette("p", (rubber,))))
    law = make_law(rubber.law).nominal_stress_MPa(1.0 - travel / GAUGE_MM)
    np.testing.assert_allclose(found.force_N[0], AREA_mm2 * law + 1.0, rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(found.strain[:, 0], -travel / GAUGE_MM, atol=1e-9)


def test_a_law_that_falls_in_compression_goes_on_straight():
    """Ogden's, with a term that turns its stress at a strain of -0.33."""
    turning = material("t", 0.0, "ogden", mu_MPa=(1.24, 2.03), alpha=(-1.5, 1.5))
    law, laws = make_law(turning.law), law_tables(Palette("p", (turning,)))
    travel = GAUGE_MM * np.linspace(0.0, 0.7, 64)
    force = predict(setup(travel, pushed=np.ones(1, dtype=bool)), laws).force_N[0]
    stress = law.nominal_stress_MPa(1.0 - travel / GAUGE_MM)
    sound = travel < 0.3 * GAUGE_MM
    assert stress.argmin() < 40  # of the law itself
    np.testing.assert_allclose(force[sound], AREA_mm2 * stress[sound], rtol=1e-8, atol=1e-9)
    assert (np.diff(force) < 0.0).all()
    # A second difference holds the solver's tolerance, 1e-10 of the force, four times.
    np.testing.assert_allclose(np.diff(force[-20:], 2), 0.0, atol=4e-10 * np.abs(force).max())


def test_tables_go_on_rising_beyond_a_laws_end():
    falling = material("f", 0.0, "yeoh", c_MPa=(1.0, -0.6, 0.01))  # falls from 0.6 or so
    laws = law_tables(Palette("p", (falling,)))
    stress = stress_MPa(0.0, np.linspace(0.0, 3.0, 500), laws)
    assert laws.sound_strain[0] < laws.strain_step * laws.cubics.shape[1]
    assert np.isfinite(stress).all()
    assert (np.diff(stress) > 0).all()


def test_materials_whose_stiffness_crosses_have_tables():
    crossing = Palette("p", (FIRM, material("b", 0.8, "ogden", mu_MPa=(0.5,), alpha=(4.0,))))
    assert [*CoefficientModel(crossing).remarks()]  # crosses, and says so
    assert np.isfinite(stress_MPa(0.65, 0.5, law_tables(crossing)))


def test_law_that_is_not_stress_free_is_refused():
    odd = LawParameters(
        "ogden-thesis",
        {"c": (0.06, 1.5, 0.8, 0.5, 0.5, -0.5), "strain_min": (0.2,), "strain_max": (0.9,)},
    )
    with pytest.raises(PaletteError, match="'odd'"):
        law_tables(Palette("p", (Material("odd", 0.0, 0.9, 1.1, odd),)))


def test_coupon_is_its_law():
    travel = np.linspace(0.0, 0.9 * GAUGE_MM, 64)
    force = predict(setup(travel), LAWS).force_N[0]
    law = make_law(SOFT.law).nominal_stress_MPa(1.0 + travel / GAUGE_MM)
    np.testing.assert_allclose(force, AREA_mm2 * law, rtol=1e-8, atol=1e-9)


def test_factor_and_tilt_multiply_the_stress():
    travel = np.linspace(0.0, 20.0, 64)
    e = travel / GAUGE_MM
    plain = predict(setup(travel), LAWS).force_N[0]
    bent = setup(travel, log_factor=np.array([0.3]), log_tilt=np.array([-0.2]))
    expected = plain * np.exp(0.3 - 0.2 * np.tanh((e - 0.15) / 0.2))
    np.testing.assert_allclose(predict(bent, LAWS).force_N[0], expected, rtol=1e-8, atol=1e-9)


def test_bar_at_small_strain_is_springs_in_series():
    coordinates = np.linspace(0.0, 1.0, 33)
    found = predict(setup([0.0, 1e-6 * GAUGE_MM], coordinates=(coordinates,)), LAWS)
    secant = stress_MPa(coordinates, 1e-7) / 1e-7
    springs = 1e-6 * GAUGE_MM / np.sum(GAUGE_MM / 33 / (AREA_mm2 * secant))
    # Stiffness changes by about the strain of the softest slice, 2e-6, over the step.
    assert found.force_N[0, 1] == pytest.approx(springs, rel=1e-5)
    assert np.mean(found.strain[1]) == pytest.approx(1e-6, rel=1e-9)


def test_a_bars_slices_bear_one_force_by_their_laws():
    coordinates = 0.5 + 0.45 * np.sin(np.linspace(0.0, 7.0, 40))
    area = AREA_mm2 * (1.0 + 0.3 * np.cos(np.linspace(0.0, 5.0, 40)))
    travel = np.linspace(0.0, 0.15 * GAUGE_MM, 64)
    found = predict(setup(travel, coordinates=(coordinates,), area_mm2=area), LAWS)
    law = CoefficientModel(PALETTE).nominal_stress_MPa(coordinates, 1.0 + found.strain)
    force = np.broadcast_to(found.force_N[0][:, None], law.shape)
    np.testing.assert_allclose(area * law, force, rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(found.strain.mean(axis=1) * GAUGE_MM, travel, atol=1e-8)


def test_relaxing_ramp_and_hold_of_one_exponential():
    share, term, rate, ramp_s = 0.4, 5, 0.02, 10.0
    tau = RELAXATION_TIMES_s[term]
    time = np.concatenate([np.linspace(0.0, ramp_s, 9), ramp_s + np.geomspace(0.01, 200.0, 40)])
    strain = rate * np.minimum(time, ramp_s)
    relaxing = np.zeros((1, len(RELAXATION_TIMES_s)))
    relaxing[0, term] = share
    held = setup(strain * GAUGE_MM, time_s=time, relaxing=relaxing)
    viscous = 2.0 * share * rate * tau * (1.0 - np.exp(-np.minimum(time, ramp_s) / tau))
    viscous *= np.exp(-np.maximum(time - ramp_s, 0.0) / tau)
    stress = 2.0 * (1.0 - share) * strain + viscous
    # The law is linear, so the recursion is exact; 1e-10 is where Newton's method stops.
    force = predict(held, LINEAR_LAWS).force_N[0]
    np.testing.assert_allclose(force, AREA_mm2 * stress, rtol=1e-8, atol=1e-9)


def test_relaxation_converges_with_the_square_of_the_step():
    relaxing = np.full((1, len(RELAXATION_TIMES_s)), 0.05)

    def at_end(steps):
        time = np.linspace(0.0, 30.0, steps + 1)
        pulled = setup(0.8 * GAUGE_MM * time / 30.0, time_s=time, relaxing=relaxing)
        return predict(pulled, LAWS).force_N[0, -1]

    fine = at_end(1024)
    errors = [abs(at_end(n) / fine - 1.0) for n in (16, 32, 64)]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.1)
    assert errors[2] < 1e-4  # 64 steps are what a test has


def test_reloading_rejoins_the_virgin_curve():
    strains = (0.3, 0.0, 0.5)
    path = there_and_back(strains)
    table = np.outer(1.0 - NODES**2, NODES)
    coordinates = ((0.0,), (0.0, 0.2, 0.4))
    virgin = setup(path, coordinates=coordinates)
    marked = virgin.with_(
        softening=np.full(4, 0.5), softening_table=table, set_share=np.full(4, 1.0),
        set_table=0.2 * NODES,
    )  # fmt: skip
    before, after = predict(virgin, LAWS).force_N, predict(marked, LAWS).force_N
    first, way_back, again = slice(0, 41), slice(42, 81), path > 0.3 * GAUGE_MM + 1e-9
    # On a pull no slice of a bar goes back, so that below the peak only the way back is marked.
    np.testing.assert_allclose(after[:, first], before[:, first], rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(after[:, again], before[:, again], rtol=1e-8, atol=1e-9)
    assert (after[:, way_back] < before[:, way_back] - 1e-6).all()


def test_set_and_softening_follow_their_equations():
    path = there_and_back((0.4, 0.0))
    left = 0.25 * 0.2 * 0.4
    set_only = setup(path, set_share=np.array([0.25]), set_table=0.2 * NODES)
    way_back = slice(41, 81)
    e = path[way_back] / GAUGE_MM
    bearing = e > left
    felt = (e - left) * 0.4 / (0.4 - left)
    force = predict(set_only, LAWS).force_N[0, way_back]
    expected = AREA_mm2 * stress_MPa(0.0, felt[bearing])
    np.testing.assert_allclose(force[bearing], expected, rtol=1e-7, atol=1e-9)
    # In compression a strip buckles: far less force than its stiffness would give.
    assert -0.5 * expected[0] < force[~bearing].min() < 0.0
    table = np.outer(1.0 - NODES, NODES)
    soft = setup(path, softening=np.array([0.6]), softening_table=table)
    factor = 1.0 - 0.6 * (1.0 - e / 0.4) * 0.4
    expected = AREA_mm2 * stress_MPa(0.0, e) * factor
    np.testing.assert_allclose(
        predict(soft, LAWS).force_N[0, way_back], expected, rtol=1e-7, atol=1e-8
    )


def test_every_reload_wears_the_stress_and_adds_to_the_set():
    path = there_and_back((0.4, 0.0, 0.4, 0.0))
    reloads = np.clip(np.arange(161.0) - 80.0, 0.0, 40.0)[None, :] / 40.0
    e = path / GAUGE_MM
    worn = setup(path, reloads=reloads, fatigue=np.array([0.1]))
    plain = predict(setup(path), LAWS).force_N
    np.testing.assert_allclose(
        predict(worn, LAWS).force_N, plain * (1.0 + reloads) ** -0.1, rtol=1e-7, atol=1e-8
    )
    growing = setup(path, reloads=reloads, set_share=np.array([0.5]), set_table=0.2 * NODES,
                    set_growth=0.6)  # fmt: skip
    again = slice(121, 160)  # the last way back, reloaded once
    left = 0.1 * 0.4 * (1.0 + 0.6 * np.log(2.0))
    bearing = e[again] > left
    felt = (e[again][bearing] - left) * 0.4 / (0.4 - left)
    np.testing.assert_allclose(
        predict(growing, LAWS).force_N[0, again][bearing], AREA_mm2 * stress_MPa(0.0, felt),
        rtol=1e-7, atol=1e-9,
    )  # fmt: skip


def test_slack_shifts_the_curve():
    travel = np.linspace(0.0, 12.0, 61)
    slack = setup(travel, lost_mm=np.minimum(travel, 1.0)[None, :])
    plain = predict(setup(np.maximum(travel - 1.0, 0.0)), LAWS).force_N
    np.testing.assert_allclose(predict(slack, LAWS).force_N, plain, rtol=1e-9, atol=1e-9)


def test_travel_factor_gain_and_offset():
    travel = np.linspace(0.0, 12.0, 25)
    scaled = setup(travel, travel_factor=np.array([0.9]), gain=np.full((1, 25), 4.448),
                   offset_N=np.full((1, 25), -0.3))  # fmt: skip
    plain = predict(setup(0.9 * travel), LAWS).force_N
    np.testing.assert_allclose(predict(scaled, LAWS).force_N, 4.448 * plain - 0.3, rtol=1e-12)


def test_compliance_is_a_spring_in_series():
    travel = np.linspace(0.0, 8.0, 30)
    stiff = 2.0 * AREA_mm2 / GAUGE_MM
    soft = setup(travel, compliance_mm_N=np.array([0.05]))
    force = predict(soft, LINEAR_LAWS).force_N[0]
    np.testing.assert_allclose(force, stiff * travel / (1.0 + 0.05 * stiff), rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("joints", [0.0, 0.7, 10.0])
def test_losses_and_elongations_add_up_to_the_travel(joints):
    path = there_and_back((0.3, -0.02, 0.4))
    coordinates = (np.linspace(0.0, 0.9, 20),)
    loose = setup(
        path, coordinates=coordinates, compliance_mm_N=np.array([0.05]),
        joint_share=np.array([joints]), joint_N=np.array([3.0]), slip_mm_N=np.array([0.08]),
        slip_from_N=np.array([5.0]), slip_power=np.array([1.5]), set_share=np.full(20, 0.5),
        set_table=0.2 * NODES,
    )  # fmt: skip
    found = predict(loose, LAWS)
    force = found.force_N[0]
    machine = 0.05 * (force + joints * 3.0 * np.sign(force) * np.log1p(abs(force) / 3.0))
    most = np.maximum.accumulate(np.maximum(force, 0.0))
    slip = 0.08 * np.maximum(most - 5.0, 0.0) ** 1.5
    assert force.max() > 5.0  # so that it does slip
    np.testing.assert_allclose(found.strain @ loose.length_mm + machine + slip, path, atol=1e-7)


def test_travel_taken_for_inches_goes_on_straight():
    """A strain of 0.3 is then one of 7.62, far beyond the tables, in equilibrium all the same."""
    strain = np.linspace(0.0, 25.4 * 0.3, 64)
    found = predict(setup(GAUGE_MM * strain, coordinates=((0.0,), (0.0, 0.25))), LAWS)
    alone = AREA_mm2 * stress_MPa(0.0, strain[1:])
    assert found.force_N[0, 1:] == pytest.approx(alone, rel=1e-8)
    soft, firm = AREA_mm2 * stress_MPa(np.array([[0.0], [0.25]]), found.strain[1:, 1:].T)
    assert firm == pytest.approx(soft, rel=1e-8)
    assert found.strain[:, 1:].mean(axis=1) == pytest.approx(strain, abs=1e-8)


def test_more_travel_than_the_slices_can_take_stays_finite():
    wild = setup(
        there_and_back((30.0, -5.0)), coordinates=((0.0, 1.0),), log_tilt=np.array([-3.0, 3.0])
    )
    found = predict(wild, LAWS)
    assert np.isfinite(found.force_N).all()
    assert np.isfinite(found.strain).all()


def test_pushed_mixtures_and_instantaneous_ones_lie_on_the_cubic_through_their_laws():
    """Rubbers whose stress relaxes to a part of each their own: what is shown is the law again."""
    stiffness = {0.0: 0.2, 0.3: 0.3, 0.5: 0.9, 1.0: 1.4}
    rubbers = [
        material(f"r{m}", m, "yeoh", c_MPa=(c, -0.03 * c, 0.02 * c)) for m, c in stiffness.items()
    ]
    palette = Palette("p", tuple(rubbers))
    laws = law_tables(palette)
    travel = np.linspace(0.0, 0.5 * GAUGE_MM, 64)
    coordinates = [(0.1,), (0.4,), (0.8,), (1.0,)]
    pushed = setup(travel, coordinates=coordinates, pushed=np.ones(4, dtype=bool))
    stretch = 1.0 - travel[1:] / GAUGE_MM
    shown = np.stack([make_law(m.law).nominal_stress_MPa(stretch) for m in rubbers])
    cubic = PchipInterpolator(laws.coordinate, np.log(-shown), axis=0)
    expected = -AREA_mm2 * np.exp(cubic([m for (m,) in coordinates]))
    np.testing.assert_allclose(predict(pushed, laws).force_N[:, 1:], expected, rtol=1e-8)
    # Of laws that are 1 / (1 - share) times as stiff at once, the slopes are those of the new ones.
    share = np.array([0.1, 0.5, 0.2, 0.4])
    relaxing = np.zeros((8, len(RELAXATION_TIMES_s)))
    relaxing[:, 0] = np.tile(share, 2)
    slow = instantaneous(laws, relaxing, 1e-6)  # its 0.01 s are over before a test begins
    strain = 0.25
    of_grades = stress_MPa(laws.coordinate, strain, laws) / (1.0 - share)
    cubic = PchipInterpolator(laws.coordinate, np.log(of_grades))
    # 1e-5: what relaxes is behind by its time, 1e-8 of strain.
    found = stress_MPa(np.array([0.1, 0.4, 0.8]), strain, slow)
    np.testing.assert_allclose(found, np.exp(cubic([0.1, 0.4, 0.8])), rtol=1e-5)


def test_one_law_alone_is_as_instantaneous_as_among_others():
    """What relaxes at its own rate: the same law, to rounding, with other materials beside it."""
    rubbers = [material(f"r{m}", m, "yeoh", c_MPa=(0.2 + m, 0.0, 0.0)) for m in (0.0, 1.0)]
    laws = law_tables(Palette("p", tuple(rubbers)))
    first = {"coordinate": laws.coordinate[:1], "place": laws.place[:1]}
    alone = replace(laws, **first, cubics=laws.cubics[[0, 2]])
    relaxing = np.zeros((4, len(RELAXATION_TIMES_s)))
    relaxing[:, 5:8] = 0.2
    both = instantaneous(laws, relaxing, 0.01)
    for ways in (1, 2):
        one = replace(alone, cubics=alone.cubics[:ways])
        found = instantaneous(one, relaxing[:ways], 0.01)
        strain = np.linspace(0.1, 0.6, 6)
        expected = stress_MPa(np.zeros(6), strain, both)
        np.testing.assert_allclose(stress_MPa(np.zeros(6), strain, found), expected, rtol=1e-12)
        assert np.all(expected > 1.2 * stress_MPa(np.zeros(6), strain, laws))


@pytest.mark.parametrize(
    "name",
    ["log_factor", "log_tilt", "relaxing", "softening", "set_share", "fatigue", "length_mm",
     "area_mm2", "coordinate", "reloads", "lost_mm", "offset_N", "gain", "slip_mm_N",
     "slip_from_N", "compliance_mm_N", "travel_factor"],
)  # fmt: skip
@pytest.mark.parametrize("where", [0, -1])
def test_tests_that_are_the_same_in_a_former_prediction_are_taken_from_it(name, where):
    path = there_and_back((0.3, 0.05, 0.4), points=15)
    softening = np.full((21, 21), 0.3)
    softening[-1] = 0.0  # at the largest strain so far, which the path comes back to
    tables = {"softening_table": softening, "set_table": np.full(21, 0.2)}
    plain = setup(path, coordinates=((0.1, 0.6), (0.3,), (0.7,)), **tables)
    former = predict(plain, LAWS)
    value = getattr(plain, name).copy()
    value[where] += 0.1 / value[where].size
    changed = plain.with_(**{name: value})
    fresh, found = predict(changed, LAWS), predict(changed, LAWS, like=former)
    same = [where != 0, False, where != -1]
    np.testing.assert_array_equal(found.force_N[same], former.force_N[same])
    # Newton's method starts from the former one, and ends within its tolerance of 1e-10.
    np.testing.assert_allclose(found.force_N, fresh.force_N, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(found.strain, fresh.strain, rtol=1e-9, atol=1e-9)
    # A prediction that says something else shows which tests were not followed again.
    other = replace(former, borne_N=former.borne_N + 1e6)
    taken = (predict(changed, LAWS, like=other).force_N > 1e5).all(axis=1)
    of_load_cell = name in ("gain", "offset_N")  # which the specimens do not feel
    assert taken.tolist() == [of_load_cell or where == -1, True, of_load_cell or where == 0]


@pytest.mark.parametrize("name", ["reference_relaxing", "pushed", "reference_rate_per_s"])
def test_laws_of_instantaneous_stress_are_taken_from_a_former_prediction_where_they_are_its(name):
    shares = np.full((len(LAWS.coordinate), 15), 0.02)
    plain = setup(there_and_back((0.3, 0.05), points=15), coordinates=((0.1,), (0.3,)))
    plain = plain.with_(relaxing=np.full((2, 15), 0.02), reference_relaxing=shares)
    former = predict(plain, LAWS)
    again = plain.with_(reference_relaxing=shares.copy(), gain=1.1 * plain.gain)
    assert predict(again, LAWS, like=former).curves is former.curves
    others = {
        "reference_relaxing": 0.5 * shares,
        "pushed": np.array([False, True]),
        "reference_rate_per_s": 2.0 * plain.reference_rate_per_s,
    }
    changed = plain.with_(**{name: others[name]})
    found = predict(changed, LAWS, like=former)
    assert found.curves is not former.curves
    np.testing.assert_allclose(found.force_N, predict(changed, LAWS).force_N, rtol=1e-9)


def test_tables_and_laws_that_change_change_every_test():
    plain = setup(there_and_back((0.3, 0.05), points=15), coordinates=((0.1,), (0.3,)))
    plain = plain.with_(softening=np.full(2, 0.5), relaxing=np.full((2, 15), 0.02))
    for changes in (
        {"softening_table": np.full((21, 21), 0.3)},
        {"reference_relaxing": np.full((len(LAWS.coordinate), 15), 0.02)},
    ):
        fresh = predict(plain.with_(**changes), LAWS)
        found = predict(plain.with_(**changes), LAWS, like=predict(plain, LAWS))
        np.testing.assert_allclose(found.force_N, fresh.force_N, rtol=1e-9)
        assert (fresh.force_N != predict(plain, LAWS).force_N).any(axis=1).all()
