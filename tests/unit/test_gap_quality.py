"""Faults in a campaign's data, one by one, and what they are called."""

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from planner.formats.units import UnitOf
from planner.gap import quality
from planner.gap.campaign import Campaign, Specimen, StrainField
from planner.gap.diagnosis import QualityProblem
from planner.gap.observations import ObservationModel
from planner.materials.laws import make_law
from planner.numerics import FloatArray
from planner.printers import load_printer

PALETTE = load_printer("connex3").palette()
POUND_N = 4.4482216


def specimen(
    k: int,
    material: str = "FLX9760",
    *,
    protocol: str = "monotonic",
    gain: float = 1.0,
    points: int = 200,
    **changes: Any,
) -> Specimen:
    """A specimen of 3 % scatter and 0.1 % noise, pulled to strain 0.5 at 1 mm/s."""
    rng = np.random.default_rng(k)
    ramp = np.linspace(0.0, 12.5, points)
    time, travel = ramp, ramp
    if protocol == "cyclic":
        time = np.linspace(0.0, 50.0, 2 * points)
        travel = 12.5 * (1.0 - np.abs(1.0 - time / 12.5 % 2.0))
    elif protocol == "relaxation":
        time = np.linspace(0.0, 50.0, 2 * points)
        travel = np.minimum(time, 12.5)
    bare = Specimen(
        f"S{k}", time, travel, travel, 25.0, material=material, width_mm=6.0, thickness_mm=2.0,
        rate_mm_s=1.0, temperature_C=23.0, protocol=protocol, batch="A",
    )  # fmt: skip
    law = make_law(PALETTE.resolve(material).law)
    force = 12.0 * law.nominal_stress_MPa(1.0 + np.maximum(bare.strain, 1e-9))
    force = gain * force * np.exp(0.03 * rng.normal())
    force = force + 1e-3 * force.max() * rng.normal(size=len(force))
    return replace(bare, force_N=force, **changes)


def campaign(*specimens: Specimen) -> Campaign:
    return Campaign("faulty", "connex3", PALETTE, specimens)


def examine(of: Campaign) -> tuple[QualityProblem, ...]:
    return quality.examine(of, ObservationModel(of))


def base(**changes: Any) -> list[Specimen]:
    """Three replicates of two materials."""
    return [specimen(k, m, **changes) for m, ks in (("FLX9760", (0, 1, 2)), ("FLX9740", (3, 4, 5)))
            for k in ks]  # fmt: skip


def found(specimens: list[Specimen], kind: str) -> tuple[QualityProblem, ...]:
    problems = examine(campaign(*specimens))
    assert {p.kind for p in problems} <= {kind}
    return problems


def kinds_of(*specimens: Specimen) -> set[str]:
    return {p.kind for p in examine(campaign(*specimens))}


@pytest.mark.parametrize("protocol", ["monotonic", "cyclic", "relaxation"])
def test_nothing_is_wrong_with_what_is_right(protocol: str) -> None:
    assert examine(campaign(*base(protocol=protocol))) == ()


@pytest.mark.parametrize("points", [12, 100])
@pytest.mark.parametrize("cycles", [5, 10, 20, 50])
def test_many_cycles_are_a_cyclic_test_at_its_speed(cycles: int, points: int) -> None:
    """Cycles of 25 s, whose force comes back to 0 each time and falls by half in all."""

    def cycled(k: int) -> Specimen:
        s = specimen(k, protocol="cyclic")
        time = np.linspace(0.0, 25.0 * cycles, points * cycles)
        phase = time % 25.0
        force = np.interp(phase, s.time_s, s.force_N) * (1.0 - 0.5 * time / time[-1])
        travel = 12.5 * (1.0 - np.abs(1.0 - time / 12.5 % 2.0))
        return replace(s, time_s=time, displacement_mm=travel, force_N=force)

    assert examine(campaign(*(cycled(k) for k in range(3)))) == ()
    as_monotonic = [replace(cycled(k), protocol="monotonic") for k in range(3)]
    assert [p.kind for p in examine(campaign(*as_monotonic))] == ["protocol"] * 3


def test_drop_outs_at_the_turns_hide_no_unloading() -> None:
    """Two cycles, the force read as nothing for a row in ten and wherever the crosshead turns."""

    def twice(k: int) -> Specimen:
        s = specimen(k, protocol="cyclic")
        time = np.linspace(0.0, 50.0, 801)
        force = np.interp(time % 25.0, s.time_s, s.force_N)
        travel = 12.5 * (1.0 - np.abs(1.0 - time / 12.5 % 2.0))
        lost = (np.arange(801) % 10 == k) | (travel > 12.49)
        return replace(s, time_s=time, displacement_mm=travel, force_N=np.where(lost, 0.0, force))

    assert "protocol" not in kinds_of(*(twice(k) for k in range(3)))


def test_a_declared_rate_is_held_against_time() -> None:
    specimens = base()
    specimens[1] = replace(specimens[1], rate_mm_s=60.0)
    (problem,) = found(specimens, "rate")
    assert problem.specimen == "S1"
    assert "at 1 mm/s by its time channel, 60 mm/s is declared; mm/s and mm/min" in problem.problem
    (whole,) = found([replace(s, rate_mm_s=2.0) for s in base()], "rate")
    assert whole.specimen is None
    counted = [replace(s, rate_mm_s=2.0, time_recorded=False) for s in base()]
    assert found(counted, "rate") == ()


@pytest.mark.parametrize("protocol", ["monotonic", "cyclic", "relaxation"])
@pytest.mark.parametrize(("level_N", "noise_N"), [(0.37, 0.0), (0.37, 0.01), (0.0, 0.01)])
def test_a_dead_load_cell_is_named_and_its_replicate_is_not(
    protocol: str, level_N: float, noise_N: float
) -> None:
    live, dead = specimen(0, protocol=protocol), specimen(1, protocol=protocol)
    noise = noise_N * np.random.default_rng(5).normal(size=len(dead.force_N))
    (problem,) = found([live, replace(dead, force_N=level_N + noise)], "dead")
    assert problem.specimen == "S1"
    level = float(problem.problem.partition("stays at ")[2].partition(" N")[0])
    assert level == pytest.approx(level_N, abs=0.01)  # one deviation of the noise


def test_a_noisy_cell_is_not_dead() -> None:
    """Noise of a fifth of the peak: the load still rises by 5 of its deviations."""
    s = specimen(0)
    noise = 0.2 * s.force_N.max() * np.random.default_rng(1).normal(size=len(s.force_N))
    assert "dead" not in kinds_of(replace(s, force_N=s.force_N + noise))


def test_a_protocol_is_held_against_the_crosshead() -> None:
    cases: list[tuple[str, str, str]] = [
        ("cyclic", "monotonic", "unloaded by 100 %"),
        ("relaxation", "monotonic", "held for 7"),
        ("monotonic", "cyclic", "never unloaded"),
        ("monotonic", "relaxation", "held for 0 %"),
    ]
    for true, declared, words in cases:
        odd = replace(specimen(1, protocol=true), protocol=declared)
        (problem,) = [p for p in examine(campaign(odd)) if p.kind == "protocol"]
        assert words in problem.problem


def test_the_way_back_of_broken_grips_is_no_unloading() -> None:
    s = specimen(0)
    time = np.concatenate([s.time_s, s.time_s[-1] + s.time_s[1:]])
    travel = np.concatenate([s.displacement_mm, s.displacement_mm[-2::-1]])
    force = np.concatenate([s.force_N, np.zeros(len(s.force_N) - 1)])
    broken = replace(s, time_s=time, displacement_mm=travel, force_N=force)
    assert examine(campaign(broken)) == ()


def test_a_declared_amplitude_is_held_against_travel() -> None:
    specimens = [replace(s, covariates={"to_strain": 0.5}) for s in base(protocol="cyclic")]
    assert found(specimens, "amplitude") == ()
    specimens[2] = replace(specimens[2], covariates={"to_strain": 0.4})
    (problem,) = found(specimens, "amplitude")
    assert problem.specimen == "S2"
    # The peak of 12.5 mm lies between two points, half a step of 0.13 mm away at most.
    assert re.fullmatch(r"travels to 12\.[45]\d* mm, where 10 mm is declared", problem.problem)


def test_an_amplitude_unlike_its_replicates_is_named() -> None:
    specimens = base(protocol="cyclic")
    short = specimens[2]
    specimens[2] = replace(short, displacement_mm=0.7 * short.displacement_mm)
    kinds = {p.kind: p.specimen for p in examine(campaign(*specimens))}
    assert kinds["amplitude"] == "S2"


@pytest.mark.parametrize(
    ("factor", "words"),
    [
        (1 / POUND_N, "lbf taken for N"),
        (POUND_N, "N taken for lbf"),
        (1 / 9.80665, "kgf taken for N"),
        (145.0377, "psi taken for MPa"),
        (1e-3, "kN taken for N"),
    ],
)
def test_another_unit_of_force_is_named_for_one_and_for_all(factor: float, words: str) -> None:
    specimens = base()
    specimens[4] = replace(specimens[4], force_N=specimens[4].force_N * factor)
    (problem,) = found(specimens, "units")
    assert problem.specimen == "S4"
    assert words in problem.problem
    (whole,) = found([replace(s, force_N=s.force_N * factor) for s in base()], "units")
    assert whole.specimen is None
    assert words in whole.problem


def test_a_batch_in_pounds_is_told_from_the_batch_that_is_right() -> None:
    specimens = [*base(), *(replace(s, id=f"{s.id}b", batch="B") for s in base(gain=1 / POUND_N))]
    specimens = [replace(s, force_N=s.force_N * (1.0 + 0.01 * i)) for i, s in enumerate(specimens)]
    problems = found(specimens, "units")
    assert {p.specimen for p in problems} == {f"S{k}b" for k in range(6)}


def test_a_single_is_judged_by_the_trend_of_the_others() -> None:
    """Thirteen temperatures, one specimen each, a load that falls by 2 % a kelvin."""
    temperatures = np.linspace(10.0, 40.0, 13)
    specimens = [
        specimen(k, gain=float(np.exp(-0.02 * (t - 23.0))), temperature_C=float(t))
        for k, t in enumerate(temperatures)
    ]
    assert found(specimens, "units") == ()
    specimens[6] = replace(specimens[6], force_N=specimens[6].force_N / POUND_N)
    (problem,) = found(specimens, "units")
    assert problem.specimen == "S6"


def test_a_material_off_all_others_is_named_as_a_whole() -> None:
    materials = ("FLX9740", "FLX9750", "FLX9760", "FLX9770", "FLX9785")
    specimens = [
        specimen(3 * m + k, name, gain=1 / POUND_N if name == "FLX9770" else 1.0)
        for m, name in enumerate(materials)
        for k in range(3)
    ]
    problems = found(specimens, "units")
    assert {p.specimen for p in problems} == {"S9", "S10", "S11"}
    assert all("or its law is off" in p.problem for p in problems)


def test_a_real_effect_is_no_unit() -> None:
    """Hot specimens five times softer, as soft grades are: replicates share it."""
    hot = [replace(s, id=f"{s.id}h", temperature_C=50.0) for s in base(gain=1 / POUND_N)]
    assert found([*base(), *hot], "units") == ()


def test_travel_in_inches_is_told_from_force_by_the_declared_rate() -> None:
    specimens = [replace(s, displacement_mm=s.displacement_mm / 25.4) for s in base()]
    problems = examine(campaign(*specimens))
    (travel,) = [p for p in problems if p.kind == "travel"]
    assert travel.specimen is None
    assert "inches taken for mm" in travel.problem
    (rate,) = [p for p in problems if p.kind == "rate"]
    assert "mm and inches" in rate.problem


def test_strain_in_per_cent_read_as_travel_is_no_unit_of_force() -> None:
    """Of a gauge of 25 mm travel is 4 times what it was, and loads look like pounds."""
    read = [replace(s, displacement_mm=s.displacement_mm * 100.0 / s.gauge_mm) for s in base()]
    (travel,) = [p for p in examine(campaign(*read)) if p.kind == "travel"]
    assert "as if per cent of the gauge length taken for mm" in travel.problem
    assert travel.unit_of == UnitOf("travel", "0.25")
    # Of bars of several lengths no one unit mends them all.
    lengths = [
        replace(s, gauge_mm=s.gauge_mm * (1.0 + 0.1 * (k % 2))) for k, s in enumerate(base())
    ]
    read = [replace(s, displacement_mm=s.displacement_mm * 100.0 / s.gauge_mm) for s in lengths]
    (travel,) = [p for p in examine(campaign(*read)) if p.kind == "travel"]
    assert travel.unit_of is None
    # Of a gauge of 100 mm per cent are mm: what is off then is the force.
    long = [replace(s, gauge_mm=100.0, displacement_mm=4.0 * s.displacement_mm) for s in base()]
    pounds = [replace(s, rate_mm_s=4.0, force_N=s.force_N / POUND_N) for s in long]
    (units,) = [p for p in examine(campaign(*pounds)) if p.kind == "units"]
    assert "lbf taken for N" in units.problem


def test_travel_of_one_in_inches_is_named_where_its_law_bends() -> None:
    """To a strain of 2 the load is off by less than 25.4; the declared rate says inches."""
    palette = load_printer("connex3").palette("connex3-agilus-vero")
    law = make_law(palette.resolve("Agilus30").law)
    alike = [specimen(k, gauge_mm=6.25) for k in range(6)]
    stress = law.nominal_stress_MPa(1.0 + np.maximum(alike[0].strain, 1e-9))
    force = [12.0 * s.force_N[-1] / alike[0].force_N[-1] * stress for s in alike]
    specimens = [
        replace(s, material="Agilus30", force_N=f) for s, f in zip(alike, force, strict=True)
    ]
    specimens[1] = replace(specimens[1], displacement_mm=specimens[1].displacement_mm / 25.4)
    of = Campaign("faulty", "connex3", palette, tuple(specimens))
    (problem,) = examine(of)  # nor is the rate told of again
    assert (problem.specimen, problem.kind) == ("S1", "travel")
    assert problem.unit_of == UnitOf("travel", "in", ("S1",))


@pytest.mark.parametrize("share", [0.03, -0.05])
def test_a_zero_of_its_own_is_named_and_one_that_all_share_is_not(share: float) -> None:
    def shifted(s: Specimen) -> Specimen:
        return replace(s, force_N=s.force_N + share * s.force_N.max())

    first, *others = base()
    (problem,) = found([shifted(first), *others], "zero")
    assert problem.specimen == "S0"
    assert "was the cell zeroed?" in problem.problem
    alike = [replace(s, force_N=s.force_N + 0.5) for s in base()]
    assert "zero" not in kinds_of(*alike)
    # Where a record begins on the way, a force is no zero.
    begun = replace(first, **{n: getattr(first, n)[20:] for n in ("time_s", "displacement_mm")},
                    force_N=first.force_N[20:])  # fmt: skip
    assert "zero" not in kinds_of(begun, *others)


def test_a_strain_field_in_per_cent_is_named() -> None:
    s = specimen(0)
    strain = np.outer([0.0, 25.0, 50.0], [1.0, 1.0])
    measured = StrainField(np.array([0.0, 6.0, 12.5]), np.array([5.0, 20.0]), strain)
    (problem,) = found([replace(s, strain_field=measured)], "units")
    assert "per cent" in problem.problem


def test_an_outlier_is_judged_by_its_replicates() -> None:
    specimens = base()
    specimens[1] = replace(specimens[1], force_N=specimens[1].force_N * 2.5)
    (problem,) = found(specimens, "outlier")
    assert problem.specimen == "S1"
    # 150 %, and three per cent of scatter between it and the others.
    assert re.match(r"load is \+1[45]\d % off that of its 2 replicates", problem.problem)


def test_of_two_that_differ_neither_is_blamed_alone() -> None:
    materials = ("FLX9740", "FLX9750", "FLX9760", "FLX9770", "FLX9785")
    specimens = [specimen(2 * m + k, n) for m, n in enumerate(materials) for k in range(2)]
    specimens[4] = replace(specimens[4], force_N=specimens[4].force_N * 2.5)
    problems = found(specimens, "outlier")
    assert {p.specimen for p in problems} == {"S4", "S5"}
    assert all("cannot be told" in p.problem for p in problems)


def test_scatter_of_an_eighth_is_no_outlier() -> None:
    specimens = base()
    specimens[1] = replace(specimens[1], force_N=specimens[1].force_N * 1.12)
    assert found(specimens, "outlier") == ()


def test_force_at_the_load_cells_limit_is_named() -> None:
    specimens = base()
    limit = 0.7 * float(specimens[0].force_N.max())
    specimens[0] = replace(specimens[0], force_N=np.minimum(specimens[0].force_N, limit))
    (problem,) = [p for p in examine(campaign(*specimens)) if p.kind == "clipped"]
    assert problem.specimen == "S0"
    assert f"stands at {limit:.4g} N" in problem.problem


def test_a_coarse_resolution_is_no_clipping() -> None:
    s = specimen(0, points=400)
    step = float(s.force_N.max()) / 20.0
    assert kinds_of(replace(s, force_N=np.round(s.force_N / step) * step)) == set()


def test_a_yield_plateau_is_no_clipping() -> None:
    """Force that levels off slowly, without noise, and stays."""
    s = specimen(0)
    force = 30.0 * np.tanh(s.strain / 0.05)
    assert "clipped" not in kinds_of(replace(s, force_N=np.round(force, 4)))


def test_a_slip_in_the_grips_is_named() -> None:
    """From half way on the specimen is stretched by 1.5 mm less than the crosshead moves."""
    specimens = base()
    s = specimens[3]
    slipped_mm = np.where(np.arange(len(s.force_N)) < 100, 0.0, 1.5)
    force = np.interp(s.displacement_mm - slipped_mm, s.displacement_mm, s.force_N)
    specimens[3] = replace(s, force_N=force)
    (problem,) = found(specimens, "fall")
    assert problem.specimen == "S3"
    assert (
        f"falls by {force[99] - force[100]:.4g} N at strain {s.strain[99]:.3g}" in problem.problem
    )


def test_a_break_at_the_end_and_a_slow_fall_are_no_slip() -> None:
    """A record may hold a few points behind the break; a yield point takes some strain to pass."""
    s = specimen(0)
    force = s.force_N.copy()
    force[-5:] = 0.0
    assert "fall" not in kinds_of(replace(s, force_N=force))
    yielding = (
        30.0 * (1.0 - 0.3 / (1.0 + np.exp(-(s.strain - 0.3) / 0.02))) * np.tanh(s.strain / 0.05)
    )
    assert "fall" not in kinds_of(replace(s, force_N=yielding))


def test_copies_are_named() -> None:
    specimens = base()
    first = specimens[0]
    specimens[5] = replace(specimens[5], displacement_mm=first.displacement_mm,
                           force_N=first.force_N)  # fmt: skip
    (problem,) = [p for p in examine(campaign(*specimens)) if p.kind == "duplicate"]
    assert problem.specimen == "S5"
    assert "specimen S0" in problem.problem


def test_sizes_in_inches_and_measured_sizes_are_held_against_sense() -> None:
    specimens = base()
    specimens[3] = replace(specimens[3], measured_width_mm=2.0)
    (problem,) = [p for p in examine(campaign(*specimens)) if p.kind == "size"]
    assert problem.specimen == "S3"
    assert "measured width is 2 mm, nominal 6 mm" in problem.problem
    inches = [replace(s, thickness_mm=2.0 / 25.4) for s in base()]
    (whole,) = [p for p in examine(campaign(*inches)) if p.kind == "size"]
    assert whole.specimen is None
    assert "inches?" in whole.problem
    oversize = [replace(s, measured_thickness_mm=2.3) for s in base()]
    assert not [p for p in examine(campaign(*oversize)) if p.kind == "size"]


def test_lost_points_and_spikes_are_named() -> None:
    specimens = base()
    keep = np.r_[0:80, 100:200]
    s = specimens[0]
    specimens[0] = replace(s, time_s=s.time_s[keep], displacement_mm=s.displacement_mm[keep],
                           force_N=s.force_N[keep])  # fmt: skip
    force = specimens[1].force_N.copy()
    force[60:62] = 0.0
    specimens[1] = replace(specimens[1], force_N=force)
    kinds = {p.kind: p for p in examine(campaign(*specimens))}
    assert set(kinds) == {"dropout", "spike"}
    assert kinds["dropout"].specimen == "S0"
    # From point 79 to point 100 of 200 over 12.5 s.
    assert f"the longest {21 * 12.5 / 199:.3g} s" in kinds["dropout"].problem
    assert kinds["spike"].specimen == "S1"
    assert "in force_N, the first of 0 at" in kinds["spike"].problem


def part(s: Specimen, rows: Any) -> Specimen:
    return replace(s, time_s=s.time_s[rows], displacement_mm=s.displacement_mm[rows],
                   force_N=s.force_N[rows])  # fmt: skip


@pytest.mark.parametrize(
    "rows",
    [
        np.r_[0, 40:200],  # nothing for the first fifth
        np.r_[0, 100:200],
        np.r_[100:200],  # no first half
        np.linspace(0, 199, 8).astype(int),
        np.r_[0:7, 199],  # seven points, and the end
        np.r_[0, 193:200],
    ],
)
def test_sparse_and_uneven_records_are_no_outliers(rows: Any) -> None:
    specimens = base()
    specimens[1] = part(specimens[1], rows)
    assert kinds_of(*specimens) <= {"dropout"}
    assert kinds_of(*(part(s, rows) for s in base())) <= {"dropout"}


@pytest.mark.parametrize(("digit_mm", "end_mm"), [(0.005, 0.1), (0.005, 0.25), (0.02, 0.25)])
def test_a_coarse_travel_is_neither_held_nor_slow(digit_mm: float, end_mm: float) -> None:
    """A rigid grade pulled by a quarter of a millimetre and less at 1 mm/min."""

    def coarse(k: int) -> Specimen:
        time = np.linspace(0.0, 60.0 * end_mm, 200)
        s = specimen(k, "RGD8430", rate_mm_s=1.0 / 60.0)
        force = 100.0 * time / time[-1] * (1.0 + 0.01 * k)
        travel = np.round(time / 60.0 / digit_mm) * digit_mm
        return replace(s, time_s=time, displacement_mm=travel, force_N=force)

    one = coarse(1)
    np.testing.assert_allclose(one.travel_mm, one.time_s / 60.0, atol=0.51 * digit_mm)
    assert kinds_of(*(coarse(k) for k in range(3))) <= {"units"}


@pytest.mark.parametrize("digit_s", [0.1, 1.0])
def test_a_speed_within_what_rounded_times_allow_is_the_declared_one(digit_s: float) -> None:
    """19 steps of 0.66 of the clock's."""
    s = specimen(0, points=20)
    factor = 0.66 * digit_s * 19.0 / s.time_s[-1]
    times = np.round(factor * s.time_s / digit_s) * digit_s
    first = np.flatnonzero(np.diff(times, prepend=-1.0))
    one = part(replace(s, time_s=s.time_s, rate_mm_s=1.0 / factor), first)
    assert kinds_of(replace(one, time_s=times[first])) == set()
    assert kinds_of(replace(one, time_s=2.0 * times[first])) == {"rate"}


@pytest.mark.parametrize("at", [1, 3, 60, 197, 198])
def test_a_spike_is_named_as_such_and_nothing_else(at: int) -> None:
    specimens = base()
    force = specimens[1].force_N.copy()
    force[at] = 5.0 * force.max()
    specimens[1] = replace(specimens[1], force_N=force)
    (problem,) = found(specimens, "spike")
    assert f"of {force[at]:.4g} at" in problem.problem


@pytest.mark.parametrize("broke", [False, True])
def test_a_force_that_leaps_at_the_end_met_a_stop(broke: bool) -> None:
    specimens = base()
    force = specimens[1].force_N.copy()
    force[90:] = 0.0 if broke else force[90:]
    force[-3:] += [3.0, 12.0, 25.0]
    specimens[1] = replace(specimens[1], force_N=force)
    problems = {p.kind: p.problem for p in examine(campaign(*specimens))}
    assert set(problems) == ({"fall", "spike"} if broke else {"spike"})
    assert "at its end" in problems["spike"]


def test_turns_breaks_and_denser_sampling_are_neither_spikes_nor_gaps() -> None:
    def record(time: FloatArray, force: FloatArray) -> Specimen:
        travel = np.interp(time, [time[0], time[-1]], [0.0, 12.5])
        s = specimen(0, rate_mm_s=None, protocol=None)
        return replace(s, time_s=time, displacement_mm=travel, force_N=force)

    wave = np.abs(np.linspace(-3.0, 3.0, 121) % 2.0 - 1.0)
    broken = np.concatenate([np.linspace(0.0, 5.0, 60), np.zeros(20)])
    even = np.arange(200.0)
    oddities = {"spike", "dropout"}
    assert not kinds_of(record(even[:121], wave)) & oddities
    assert not kinds_of(record(even[:80], broken)) & oddities
    leaping = record(even[:80], np.where(np.arange(80) == 40, 1.0, broken))
    (problem,) = [p for p in examine(campaign(leaping)) if p.kind == "spike"]
    assert "of 1 at 40 s" in problem.problem
    denser = np.concatenate([np.linspace(0, 1, 50), np.linspace(2, 40, 20)])
    for time in (denser, np.logspace(-2, 2, 60)):
        assert not kinds_of(record(time, time)) & oddities


def test_problems_of_the_whole_campaign_come_first() -> None:
    specimens = [replace(s, rate_mm_s=2.0) for s in base()]
    specimens[0] = replace(specimens[0], measured_width_mm=2.0)
    problems = examine(campaign(*specimens))
    assert problems[0].specimen is None
    assert problems == examine(campaign(*specimens))
