"""Correcting a palette by a diagnosis: what changes, by how much, and what must not."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import manifold3d as m3
import numpy as np
import pytest

import planner
from planner.cli import run
from planner.errors import FileError, PaletteError, UnknownNameError
from planner.gap.campaign import stated
from planner.gap.correct import (
    Correction,
    _Case,
    _Factors,
    _intervals_sd,
    _parted_sd,
    _refitted,
    _working_strain,
    correct,
)
from planner.gap.diagnose import levels_tested
from planner.gap.diagnosis import Diagnosis, FoundEffect, Gap
from planner.gap.effect import StatedEffect
from planner.gap.effects import EFFECTS, effects_for
from planner.grading.profile import Profile
from planner.materials.laws import make_law
from planner.materials.mixtures import CoefficientModel
from planner.palette import (
    LawParameters,
    Palette,
    Reference,
    Uncertainty,
    encode_palette,
    load_palette,
    parse_palette,
)
from planner.report.gap_page import write_diagnosis

PALETTE = Path(__file__).parents[2] / "printers/connex3/palettes/connex3-tango-vero.toml"
OWN = Reference()
WARM = Reference(temperature_C=33.0)
AWAY = Reference(0.34, 33.0, 24.0, 100.0, "z")
TEST_EFFECTS = [
    "force-offset", "force-scale", "grip-slack", "grip-slip", "machine-compliance", "strain-scale",
]  # fmt: skip
DESIGN_EFFECTS = ["cross-section", "interface-bleed", "skin"]


@pytest.fixture(scope="module")
def palette() -> Palette:
    return load_palette(PALETTE)


def diagnosed(
    palette: Palette,
    *effects: FoundEffect,
    verdict: str | None = None,
    tested: dict[str, tuple[float | str, ...]] | None = None,
) -> Diagnosis:
    return Diagnosis(
        campaign="lab", palette=palette.name, palette_sha256=palette.sha256, specimens=30,
        tests=15, verdict=verdict or "+".join(e.id for e in effects), ranking=(), same_class=(),
        not_testable=(), where=(), gap=Gap(0.2, 0.03, 0.02, 0.95, None, None, None, ""),
        effect=effects, remainder=(), data_quality=(), next_experiments=(), detectable=(),
        limitations=(), recalibration={"FLX9760": (0.08, 0.02)}, tested=tested or {},
    )  # fmt: skip


def corrected(
    palette: Palette, diagnosis: Diagnosis, at: Reference = OWN, **options: bool
) -> Correction:
    return correct(
        diagnosis, palette=palette, temperature_C=at.temperature_C, soak_h=at.soak_h,
        rate_per_s=at.strain_rate_per_s, age_days=at.age_days, orientation=at.orientation,
        **options,
    )  # fmt: skip


def found(id: str, form: str | None = None, **values: float) -> FoundEffect:
    effect = EFFECTS[id]
    chosen = effect.forms[0] if form is None else next(f for f in effect.forms if f.name == form)
    all_ = {p.name: p.usual for p in chosen.parameters} | values
    ends = {name: (0.9 * value, 1.1 * value) for name, value in all_.items()}
    return FoundEffect(id, chosen.name, all_, ends, {p.name: p.unit for p in chosen.parameters})


def stresses(palette: Palette, strain: float) -> np.ndarray:
    return np.array(
        [float(make_law(m.law).nominal_stress_MPa(1.0 + strain)) for m in palette.materials]
    )


@pytest.mark.parametrize(
    ("effect", "conditions", "factor"),
    [
        (found("temperature", slope=0.03), WARM, np.exp(-0.3)),
        (found("rate", "power-law", rise=0.2), Reference(strain_rate_per_s=0.34), np.exp(0.2)),
        (found("orientation", "build-direction", change=-0.1), AWAY, np.exp(-0.1)),
        (
            found("moisture", "root-time", softening=0.2, saturation=24.0),
            Reference(soak_h=24.0),
            1.0 - 0.2 * np.tanh(1.0),
        ),
    ],
)
def test_an_even_factor_multiplies_every_law(palette, effect, conditions, factor) -> None:
    """The equations of the forms, by hand; 9 digits of a file, terms of either sign take some."""
    made = corrected(palette, diagnosed(palette, effect), conditions)
    assert made.corrected == (effect.id,)
    for strain in (0.01, 0.1, 0.4):
        ratio = stresses(made.palette, strain) / stresses(palette, strain)
        assert ratio == pytest.approx(np.full(len(ratio), factor), rel=1e-6)
    assert max(made.misfit.values()) < 1e-9


def test_a_forms_details_are_corrected_for_as_well(palette) -> None:
    rubbery = found("temperature", "any-course", slope=0.03, entropy=1.0)
    after = corrected(palette, diagnosed(palette, rubbery), WARM).palette
    # 0.03 for each of 10 K, and stress in proportion to the absolute temperature.
    factor = np.exp(-0.3) * (273.15 + 33.0) / (273.15 + 23.0)
    np.testing.assert_allclose(stresses(after, 0.2), factor * stresses(palette, 0.2), rtol=2e-3)


def test_ids_and_all_but_the_law_stay(palette) -> None:
    made = corrected(palette, diagnosed(palette, found("temperature")), WARM).palette
    for old, new in zip(palette.materials, made.materials, strict=True):
        kept = ("id", "aliases", "coordinate", "density_g_cm3", "colour", "elongation_at_break")
        assert all(getattr(old, name) == getattr(new, name) for name in kept)
        assert new.law.model == old.law.model
        assert new.modulus_log_sd >= old.modulus_log_sd
    own = palette.reference
    assert made.reference == replace(own, temperature_C=33.0)
    assert "gap correct" in made.source
    assert "campaign lab" in made.source


def test_the_interval_of_the_effect_widens_that_of_the_print(palette) -> None:
    """A slope of 0.03 +- 10 % at 10 K: ln factor +- 0.03 at 90 %, a deviation of 0.03 / 1.645."""
    effect = found("temperature", slope=0.03)
    made = corrected(palette, diagnosed(palette, effect), WARM).palette
    for old, new in zip(palette.materials, made.materials, strict=True):
        assert new.modulus_log_sd == pytest.approx(
            np.hypot(old.modulus_log_sd, 0.03 / 1.644854), rel=1e-6
        )


def test_deviations_at_strains_are_widened_and_stay(palette) -> None:
    """They went, and intervals by `modulus_log_sd` alone shrank where the law is least sure."""
    sure = Uncertainty(3, strain=(0.0, 0.5), log_sd=(0.4, 0.2))
    known = replace(
        palette, materials=tuple(replace(m, uncertainty=sure) for m in palette.materials)
    )
    made = corrected(known, diagnosed(known, found("temperature", slope=0.03)), WARM).palette
    for new in made.materials:
        assert new.uncertainty is not None
        assert new.uncertainty.strain == sure.strain
        wider = np.hypot(sure.log_sd, 0.03 / 1.644854)
        assert new.uncertainty.log_sd == pytest.approx(wider, rel=1e-6)


def test_a_mixture_off_by_a_share_takes_the_law_of_that_mixture(palette) -> None:
    """A shift of 5 % of the range: the law between two grades, which no Ogden law is to 1 %."""
    effect = found("composition-offset", "constant", shift=0.05)
    made = corrected(palette, diagnosed(palette, effect))
    at = palette.materials[3].coordinate + 0.05 * 1.5
    wanted = CoefficientModel(palette).modulus_MPa(at, 0.1)
    got = CoefficientModel(made.palette).modulus_MPa(palette.materials[3].coordinate, 0.1)
    assert float(got) == pytest.approx(float(wanted), rel=0.01)
    assert max(made.misfit.values()) < 0.01


@pytest.mark.parametrize("form", ["prony", "graded-prony", "fractional"])
def test_a_relaxing_law_is_stiffer_pulled_faster_and_its_own_at_its_own_rate(palette, form) -> None:
    effect = found("rate", form)
    faster = corrected(palette, diagnosed(palette, effect), Reference(strain_rate_per_s=0.34))
    assert all(1.0 < factor < 1.3 for factor in faster.factor.values())
    assert max(faster.misfit.values()) < 0.03  # in shape a relaxing pull is no Ogden law
    assert corrected(palette, diagnosed(palette, effect)).corrected == ()


@pytest.mark.parametrize("id", TEST_EFFECTS)
def test_what_is_the_tests_fault_leaves_the_palette(palette, id) -> None:
    made = corrected(palette, diagnosed(palette, found(id)), AWAY)
    assert made.palette is palette
    assert made.corrected == ()
    assert any("the print was right, the measurement was off" in note for note in made.notes)


@pytest.mark.parametrize("id", [*DESIGN_EFFECTS, "softening", "permanent-set"])
def test_what_no_palette_can_hold_is_said(palette, id) -> None:
    for form in EFFECTS[id].forms:
        made = corrected(palette, diagnosed(palette, found(id, form.name)), AWAY)
        assert made.palette is palette
        assert any(note.startswith(id) for note in made.notes)


def test_an_oversize_is_answered_with_the_figure_to_draw(palette) -> None:
    effect = found("cross-section", "all-sides", oversize=0.1)
    notes = corrected(palette, diagnosed(palette, effect)).notes
    assert any("draw width and thickness each 0.10 mm smaller" in note for note in notes)


def test_of_a_pair_the_palettes_part_is_corrected(palette) -> None:
    both = diagnosed(palette, found("force-scale"), found("temperature", slope=0.03))
    made = corrected(palette, both, WARM)
    assert made.corrected == ("temperature",)
    assert made.left == ("force-scale",)
    assert made.factor["FLX9760"] == pytest.approx(np.exp(-0.3), rel=1e-9)


def test_recalibration_moves_one_materials_level(palette) -> None:
    made = corrected(palette, diagnosed(palette, verdict="none"), recalibrate=True)
    assert made.corrected == ("recalibration",)
    ratio = stresses(made.palette, 0.1) / stresses(palette, 0.1)
    place = [m.id for m in palette.materials].index("FLX9760")
    expected = np.ones(len(ratio))
    expected[place] = np.exp(0.08)
    assert ratio == pytest.approx(expected, rel=1e-6)


def test_a_ladder_that_would_cross_is_refused(palette) -> None:
    """FLX9770 is 1.7 times FLX9760: a factor of e on the softer one crosses."""
    form = next(f for f in effects_for(palette)["material-law"].forms if "FLX9760 f" in f.name)
    effect = FoundEffect("material-law", form.name, {"log_factor": 1.0}, {}, {})
    with pytest.raises(PaletteError, match="unfit to plan with"):
        corrected(palette, diagnosed(palette, effect))


def test_a_form_of_another_palette_is_refused(palette) -> None:
    effect = FoundEffect("material-law", "Agilus factor", {"log_factor": 0.1}, {}, {})
    with pytest.raises(FileError, match="Agilus factor"):
        corrected(palette, diagnosed(palette, effect))


def test_an_effect_that_there_is_not_is_refused(palette) -> None:
    effect = FoundEffect("temperatur", "exponential", {"slope": 0.03}, {}, {})
    with pytest.raises(UnknownNameError, match="temperatur: no such effect; did you mean"):
        corrected(palette, diagnosed(palette, effect))


def test_a_verdict_that_looks_like_none_says_so(palette) -> None:
    alike = replace(diagnosed(palette, found("temperature")), same_class=(("temperature",), ()))
    notes = corrected(palette, alike, WARM).notes
    assert any("cannot tell temperature from none" in note for note in notes)


@pytest.fixture
def written(tmp_path: Path, palette: Palette) -> Callable[..., Path]:
    def write(*effects: FoundEffect) -> Path:
        path = tmp_path / "diagnosis.json"
        path.write_bytes(diagnosed(palette, *effects).json())
        return tmp_path

    return write


def test_the_command_writes_a_palette_that_reads_back(written, palette, tmp_path, capsys) -> None:
    folder = written(found("temperature", slope=0.03))
    out = tmp_path / "warm.toml"
    assert run(["gap", "correct", str(folder), "--temperature-C", "33", "-o", str(out)]) == 0
    told, made_ids = capsys.readouterr().out, {m.id for m in load_palette(out).materials}
    assert "temperature" in told
    # A grade is the same number as in the list of materials.
    assert run(["materials", "--palette", str(out)]) == 0
    rows = [
        {r[0]: r[2:6] for r in map(str.split, out.splitlines()) if r and r[0] in made_ids}
        for out in (told, capsys.readouterr().out)
    ]
    assert rows[0] == rows[1] != {}
    data = out.read_bytes()
    made = parse_palette(data, name="warm")
    assert encode_palette(made) == data
    assert made.reference.temperature_C == 33.0
    again = ["gap", "correct", str(folder), "--temperature-C", "33", "-o", str(out), "--force"]
    assert run(again) == 0
    assert out.read_bytes() == data


def test_the_command_writes_nothing_where_nothing_is_to_correct(written, tmp_path, capsys) -> None:
    out = tmp_path / "same.toml"
    for effect in (found("force-scale"), found("temperature")):
        assert run(["gap", "correct", str(written(effect)), "-o", str(out)]) == 1
        assert not out.exists()
    assert "nothing was written" in capsys.readouterr().out


@pytest.mark.parametrize(
    "arguments",
    [
        ["--orientation", "w"],
        ["--temperature-C", "1e9"],
        ["--rate-per-s", "0"],
        ["--thickness-mm", "-1"],
        ["--palette", "missing.toml"],
    ],
)
def test_bad_input_is_one_line_and_no_file(written, tmp_path, capsys, arguments) -> None:
    folder = written(found("temperature"))
    out = tmp_path / "none.toml"
    assert run(["gap", "correct", str(folder), *arguments, "-o", str(out)]) == 2
    assert not out.exists()
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


def test_another_palette_of_that_name_is_not_taken_unasked(palette, tmp_path, capsys) -> None:
    other = replace(diagnosed(palette, found("temperature")), palette_sha256="0" * 64)
    path = tmp_path / "diagnosis.json"
    path.write_bytes(other.json())
    assert run(["gap", "correct", str(path), "--temperature-C", "33"]) == 2
    assert "--palette" in capsys.readouterr().err


def test_a_diagnosis_carries_its_palette(palette, tmp_path, capsys) -> None:
    """A lab's own palette need not be named again; one that was changed since is not believed."""
    stiffer = tuple(replace(m, law=m.law.stiffened(1.1)) for m in palette.materials)
    own = replace(palette, name="lab", materials=stiffer).known_by("1" * 64)
    diagnosis = replace(diagnosed(own, found("temperature")), own_palette=own)
    folder, out = write_diagnosis(diagnosis, tmp_path / "diagnosis"), tmp_path / "warm.toml"
    command = ["gap", "correct", str(folder), "--temperature-C", "33", "-o", str(out), "--force"]
    assert run(command) == 0
    at_once = correct(diagnosis, temperature_C=33.0).palette
    # A palette's file has nine digits.
    assert stresses(load_palette(out), 0.1) == pytest.approx(stresses(at_once, 0.1), rel=1e-7)
    assert run([*command, "--palette", str(folder / "palette.toml")]) == 0
    assert "byte for byte" not in capsys.readouterr().err
    (folder / "palette.toml").write_bytes(encode_palette(palette))
    assert run(command) == 2
    assert "--palette" in capsys.readouterr().err


# ------------------------------------------------------------------------------------------------
# Use beyond what was tested.


TESTED = {
    "temperature_C": (23.0, 40.0), "strain_rate_per_s": (0.034, 0.34), "orientation": ("x", "y"),
    "age_days": (9.0,), "material": ("TangoPlus", "FLX9760"),
}  # fmt: skip


@cache
def at_temperature(temperature_C: float, **more: float) -> Correction:
    palette, effect = load_palette(PALETTE), found("temperature", slope=0.0435)
    diagnosis = diagnosed(palette, effect, tested=TESTED)
    return correct(diagnosis, palette=palette, temperature_C=temperature_C, **more)


def test_the_farther_from_the_tests_the_less_sure_and_it_is_said() -> None:
    made = {at: at_temperature(at) for at in (33.0, 45.0, 60.0, 90.0)}
    sds = np.array([[c.log_sd[m] for m in ("TangoPlus", "FLX9760")] for c in made.values()])
    assert (np.diff(sds, axis=0) > 0.0).all()
    # Among the tests: the slope's interval, 0.0435 / 1.645, and forms that may be off by twice
    # the closure's own error, 0.03.
    assert (sds[0] < np.hypot(0.0435 / 1.645, 2.0 * 0.03)).all()
    said = {at: [n for n in c.notes if "lies beyond the tested" in n] for at, c in made.items()}
    assert said[33.0] == []
    assert made[33.0].ok
    for at in (45.0, 60.0, 90.0):
        assert len(said[at]) == 1
        assert said[at][0].startswith(f"{at:g} degC lies beyond the tested 23 to 40 degC")
    # By kelvin the stress falls to 0.054 of it; by WLF with 30 K it is four times that.
    assert sds[-1].min() > 0.5
    assert not made[90.0].ok
    assert "which grade meets a target here is a guess" in made[90.0].findings[0]


def test_what_others_read_is_corrected_as_the_law_is_and_written_so(palette, tmp_path) -> None:
    """By the same factor, strain by strain: refitted to 5 %, where a law is refitted."""
    made = at_temperature(33.0)
    planner.write_palette(made.palette, tmp_path / "warm.toml")
    written = load_palette(tmp_path / "warm.toml")
    with_readings = [m.id for m in palette.materials if m.readings]
    assert with_readings
    for id in with_readings:
        old, new = palette.resolve(id), written.resolve(id)
        assert len(new.readings) == len(old.readings)
        strain = np.linspace(0.2, 1.0, 5) * min(old.elongation_at_break, 0.1)
        for before, after in zip(old.readings, new.readings, strict=True):
            found, wanted = (
                make_law(b.law).nominal_stress_MPa(1.0 + strain)
                / make_law(a.law).nominal_stress_MPa(1.0 + strain)
                for a, b in ((before, after), (old, new))
            )
            np.testing.assert_allclose(found, wanted, rtol=0.05)
            assert np.all(found < 0.9)
            assert after.modulus_log_sd > before.modulus_log_sd


def test_the_plan_is_as_unsure_as_the_correction() -> None:
    near, far = (planner.list_materials(palette=at_temperature(at).palette) for at in (33.0, 90.0))
    widths = [np.log([high / low for low, high in s.intervals_MPa]) for s in (near, far)]
    assert (widths[1] > 2.0 * widths[0]).all()


def test_a_material_is_the_less_sure_the_farther_it_lies_from_those_tested(palette) -> None:
    made = at_temperature(33.0)
    ids = [m.id for m in palette.materials]
    beyond = [made.log_sd[id] for id in ids[ids.index("FLX9760") :]]
    assert all(np.diff(beyond) > 0.0)
    assert beyond[-1] > 3.0 * beyond[0]
    assert any("FLX9740, FLX9750: not tested for this, but between" in n for n in made.notes)
    assert any("VeroWhitePlus: beyond what was tested (TangoPlus to" in n for n in made.notes)


def test_a_condition_that_no_effect_was_found_of_is_told_where_it_was_not_tested() -> None:
    faster = at_temperature(33.0, rate_per_s=3.4)
    assert any(
        n.startswith("a strain rate of 3.4 per s lies beyond the tested 0.034 to 0.34 per s")
        and "not known" in n
        for n in faster.notes
    )
    within = at_temperature(33.0, rate_per_s=0.1)
    assert not any("strain rate" in n for n in within.notes)


def test_a_direction_that_was_not_tested_is_told(palette) -> None:
    effect = found("orientation", "swath-direction", change=-0.1)
    made = correct(diagnosed(palette, effect, tested=TESTED), palette=palette, orientation="y")
    assert not any("lies beyond" in n for n in made.notes)
    effect = found("orientation", "three-way", change=-0.1, part=0.5)
    made = correct(diagnosed(palette, effect, tested=TESTED), palette=palette, orientation="z")
    assert any(n.startswith("orientation z lies beyond the tested x and y") for n in made.notes)


def test_an_old_diagnosis_that_does_not_say_what_was_tested_is_told_of(palette) -> None:
    made = corrected(palette, diagnosed(palette, found("temperature", slope=0.03)), WARM)
    assert any("diagnose the campaign again" in n for n in made.notes)


def test_forms_of_one_parameter_alone_cannot_part_where_they_are_one(palette) -> None:
    """At the tests themselves the form found is the truth: what differs there weighs little."""
    effect = next(e for e in EFFECTS.values() if e.id == "temperature")
    one = StatedEffect(effect, effect.forms[0], {"slope": 0.0435})
    own = stated(Reference(), palette.reference)
    tests = [
        (palette.materials[0], replace(own, temperature_C=at)) for at in (23.0, 30.0, 40.0, 60.0)
    ]
    far = [_working_strain(material) for material, _ in (*tests, *tests)]
    case = _Case(palette, diagnosed(palette), own, own, (6.0, 3.0))
    factors = _Factors(case, [*tests, *tests], far, 24)
    parted = _parted_sd(factors, one, len(tests), sd=0.01)
    # Two of the deviations that a form may have at each test.
    assert (parted < 0.02).all()


def test_the_command_says_how_far_from_the_tests(palette, tmp_path, capsys) -> None:
    path = tmp_path / "diagnosis.json"
    effect = found("temperature", slope=0.0435)
    path.write_bytes(diagnosed(palette, effect, tested=TESTED).json())
    hot = ["gap", "correct", str(path), "--temperature-C", "90", "-o", str(tmp_path / "hot.toml")]
    assert run(hot) == 1
    told = capsys.readouterr()
    assert "warning: 90 degC lies beyond the tested 23 to 40 degC" in told.err
    assert "finding: TangoPlus" in told.err
    assert max(len(line.rstrip()) for line in told.out.splitlines()[:-1]) <= 80
    warm = [*hot[:4], "33", "-o", str(tmp_path / "warm.toml")]
    assert run(warm) == 0


def test_a_campaign_says_what_it_tested() -> None:
    campaign = planner.read_campaign(Path(__file__).parents[2] / "samples/warm-lab")
    tested, changed = levels_tested(campaign)
    assert changed == {
        "temperature_C": ("TangoPlus", "FLX9760"),
        "soak_h": ("TangoPlus", "FLX9760"),
        "strain_rate_per_s": ("TangoPlus", "FLX9760"),
    }
    assert tested["temperature_C"] == (23.0, 40.0)
    assert tested["soak_h"] == (0.0, 4.0, 72.0)
    assert tested["material"] == ("TangoPlus", "FLX9760")
    assert tested["orientation"] == ("x",)
    # Two pulls, and a hold of 240 s that shows what a pull as long would.
    assert tested["strain_rate_per_s"] == pytest.approx((0.3 / 249.0, 0.034, 0.34), rel=0.01)


# ------------------------------------------------------------------------------------------------
# The loop: the correction changes the print.


def test_a_corrected_palette_moves_the_cuts_and_the_target_is_met(palette, tmp_path) -> None:
    """A bar for 33 °C, graded for 23 °C and then like that plan with the corrected palette.

    The true moduli fall by exp(-0.435). The first plan's bands are then too soft by that all
    along; the second's miss the target by half a step between grades, as any plan does.
    """
    bar = m3.Manifold.cube([40.0, 8.0, 6.0]).to_mesh()
    part = (np.asarray(bar.vert_properties[:, :3]), np.asarray(bar.tri_verts))
    first = planner.grade(part, from_="Tango", to="FLX9795", palette=palette)
    made = at_temperature(33.0)
    second = planner.grade(part, like=first, palette=made.palette)
    true = planner.list_materials(palette=made.palette)
    target = Profile("same", (0.0, 1.0), first.gradient.profile["moduli_MPa"], "log")

    def missed(plan: planner.Plan) -> float:
        """Mean of ln true modulus over target, along the part."""
        u = (np.arange(400) + 0.5) / 400
        printed = [next(r.material for r in plan.regions if r.field[0] <= at <= r.field[1])
                   for at in u]  # fmt: skip
        got = np.array([true.modulus_of(m) for m in printed])
        return float(np.mean(np.log(got / target.modulus_MPa(u))))

    assert second.gradient.profile["moduli_MPa"] == first.gradient.profile["moduli_MPa"]
    cuts = {r.material: r.field[1] for r in first.regions[:-1]}
    moved = [r.field[1] - cuts[r.material] for r in second.regions[:-1]]
    low, high = first.gradient.profile["moduli_MPa"]
    assert moved == pytest.approx([-0.435 / np.log(high / low)] * len(moved), abs=1e-6)
    assert missed(first) == pytest.approx(-0.435, abs=0.1)
    assert abs(missed(second)) < 0.1


def test_a_law_is_fitted_again_in_its_own_number_of_terms(palette) -> None:
    """A fifth softer at large strains than at small ones: four terms follow to 1e-4."""
    terms = {"mu_MPa": (0.2, 0.1, 0.05, 0.02), "alpha": (1.5, 2.5, 3.5, -1.0)}
    material = replace(palette.materials[0], law=LawParameters("ogden", terms))
    strain = np.linspace(0.01, 0.7, 60)
    made = _refitted(material, strain, -0.2 * np.tanh(strain))
    assert len(made.material.law.parameters["alpha"]) == 4
    assert made.misfit < 1e-4


def test_errors_that_go_together_are_not_added_up(palette) -> None:
    """Slope and constant of WLF: the sum of both changes, their difference, or the root of squares.

    So a form of many parameters that stand in for one another is as sure as the tests, where they
    are. The bound is what the two changes miss by that they are finite.
    """
    own = stated(Reference(), palette.reference)
    case = _Case(palette, diagnosed(palette), own, replace(own, temperature_C=60.0), (6.0, 3.0))
    factors = _Factors(case, [(palette.materials[0], case.use)], [0.1], 24)
    one = found("temperature", "wlf", slope=0.03, constant=50.0, peak=0.0)
    one = replace(one, interval={**one.interval, "peak": (0.0, 0.0)})
    effect = EFFECTS["temperature"]
    stated_effect = StatedEffect(effect, effect.form("wlf"), dict(one.parameters))

    def sd(**changes) -> float:
        return float(_intervals_sd(factors, [replace(one, **changes)], [stated_effect])[0])

    slope, constant = (
        sd(interval={**one.interval, other: (one.parameters[other],) * 2})
        for other in ("constant", "slope")
    )
    together = {by: ((1.0, by, 0.0), (by, 1.0, 0.0), (0.0, 0.0, 1.0)) for by in (-1.0, 0.0, 1.0)}
    found_sd = [sd(correlation=rows) for rows in together.values()]
    wanted = [slope - constant, np.hypot(slope, constant), slope + constant]
    np.testing.assert_allclose(found_sd, wanted, rtol=1e-3)
    assert sd() == pytest.approx(wanted[1], rel=1e-3)


def test_a_material_that_was_not_tested_there_is_told_by_those_that_were(palette) -> None:
    """Its tests at the palette's own temperature say nothing of another."""
    ids = ("TangoPlus", "FLX9760", "FLX9785")
    tested = {"temperature_C": (23.0, 40.0), "material": ids}
    diagnosis = diagnosed(palette, found("temperature", slope=0.03), tested=tested)
    changed = replace(diagnosis, changed={"temperature_C": ids[:2]})
    all_, some = (correct(d, palette=palette, temperature_C=40.0) for d in (diagnosis, changed))
    assert some.log_sd["FLX9785"] > 1.5 * all_.log_sd["FLX9785"]
    assert some.log_sd["TangoPlus"] == all_.log_sd["TangoPlus"]
    assert any("FLX9785" in n and "beyond what was tested (TangoPlus to FLX9760)" in n
               for n in some.notes)  # fmt: skip
    assert not any(n.startswith("FLX9785") for n in all_.notes)
