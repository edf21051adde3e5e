"""A camera on graded bars: what its facets see, and that campaigns without any effect show none."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from planner.errors import FileError
from planner.gap.campaign import Campaign, Specimen, StrainField
from planner.gap.campaign_folder import read_campaign, write_campaign
from planner.gap.evidence.problem import Problem
from planner.gap.noise import likeliest_facet, likeliest_sides
from planner.gap.observations import SIDES, Bins, ObservationModel, seen_shares
from planner.gap.virtual import single_tests, synthetic_campaign, virtual_specimen
from planner.numerics import FloatArray
from planner.palette import load_palette
from planner.simulation.bar import ProfileDesign
from planner.simulation.bar_solver import Setup, law_tables, predict

PALETTE = load_palette(
    Path(__file__).parents[2] / "printers/connex3/palettes/connex3-tango-vero.toml"
)
GAUGE_MM = 32.0
EDGES = np.linspace(0.0, GAUGE_MM, 17)
SOFT, HARD = 0.1, 0.9
LAMELLAE = ProfileDesign(
    "lamellae", np.repeat(EDGES, 2)[1:-1], np.repeat(np.where(np.arange(16) % 2, HARD, SOFT), 2)
)
BLOCKS = ProfileDesign(
    "blocks", [0.0, 10.0, 10.0, 22.0, 22.0, 32.0], [SOFT, SOFT, HARD, HARD, SOFT, SOFT]
)
SAID = len(SIDES) // 2  # places where they are said to be
RAMP = ProfileDesign("ramp", [0.0, GAUGE_MM], [SOFT, HARD])


def specimen(id: str, batch: str = "A", **more: object) -> Specimen:
    return virtual_specimen(
        PALETTE, id=id, strain=0.3, camera=True, width_mm=6.0, thickness_mm=3.0, batch=batch, **more
    )


def planned(spacing_mm: float, facet_mm: float | None) -> Campaign:
    """Two replicates of coupons and of bars, seen at multiples of the spacing, steps among them."""
    x = np.arange(spacing_mm, GAUGE_MM - 0.5 * spacing_mm, spacing_mm)
    specimens = []
    for batch in "AB":
        for design in (LAMELLAE, BLOCKS, RAMP):
            bar = specimen(f"{design.name}-{batch}", batch, gauge_mm=GAUGE_MM, profile=design)
            time = bar.strain_field.time_s
            seen = StrainField(time, x, np.zeros((len(time), len(x))), facet_mm)
            specimens.append(replace(bar, strain_field=seen))
        for material in ("TangoPlus", "FLX9760", "FLX9795"):
            specimens.append(
                specimen(f"{material}-{batch}", batch, gauge_mm=25.0, material=material)
            )
    return Campaign("clean", "connex3", PALETTE, tuple(specimens))


def with_fields(campaign: Campaign, changed) -> Campaign:
    return replace(
        campaign,
        specimens=tuple(
            s if s.strain_field is None else replace(s, strain_field=changed(s.strain_field))
            for s in campaign.specimens
        ),
    )


@cache
def clean(spacing_mm: float, facet_mm: float, *, stated: bool, seed: int = 1) -> Campaign:
    """A campaign without any effect, by planner's own model."""
    rng = np.random.default_rng(seed)
    made = synthetic_campaign(planned(spacing_mm, facet_mm), [], rng)
    return made if stated else with_fields(made, lambda f: replace(f, facet_mm=None))


def problem_of(campaign: Campaign) -> Problem:
    return Problem(campaign, ObservationModel(campaign), [])


@cache
def clean_problem(spacing_mm: float, facet_mm: float, *, stated: bool) -> Problem:
    return problem_of(clean(spacing_mm, facet_mm, stated=stated))


def surprise(problem: Problem) -> FloatArray:
    """How far each local strain lies from what all others and the nuisances make of it, in sd."""
    table, noise = problem.table, problem.noise
    covariance = problem.calibration @ problem.calibration.T
    for rows, block in zip(noise.rows, noise.blocks, strict=True):
        covariance[rows, rows] += block
    field = table.is_field
    inverse = np.linalg.inv(covariance[np.ix_(field, field)])
    return (inverse @ problem.residual[field]) / np.sqrt(np.diagonal(inverse))


@pytest.mark.parametrize("stated", [True, pytest.param(False, marks=pytest.mark.slow)])
@pytest.mark.parametrize("facet_mm", [0.0, 0.6, 1.2, 3.0])
@pytest.mark.parametrize("spacing_mm", [1.0, pytest.param(0.5, marks=pytest.mark.slow)])
def test_a_clean_campaign_has_no_bias_at_steps(spacing_mm, facet_mm, stated) -> None:
    problem = clean_problem(spacing_mm, facet_mm, stated=stated)
    far = surprise(problem)
    # 120 figures and more, whose deviations share nuisances: a mean square of 1 is known to some
    # 15 %, and of such a number 4 deviations are passed once in 100.
    assert np.mean(far**2) == pytest.approx(1.0, abs=0.3)
    assert np.abs(far).max() < 4.0
    # The camera's own deviations, as they were drawn: 0.004 and 3 %, each known to some 30 %.
    scatter = problem.scatter
    assert 0.0027 < scatter.field < 0.006
    assert 0.018 < scatter.field_relative < 0.05


@pytest.mark.parametrize(("facet_mm", "number"), [(0.0, 0), (0.6, 1), (1.2, 2), (3.0, 5)])
def test_the_likeliest_facet_is_the_nearest(facet_mm, number) -> None:
    """Of six lengths to 3.2 mm; laws are exact here, so that steps tell."""
    model = ObservationModel(clean(0.7, facet_mm, stated=False))
    weight, table = model.field_weights.weight, model.table
    prediction = predict(model.setup, model.laws)
    strains = model.seen(prediction, weight[:, SAID])
    stiffer = 1.1 * strains
    assert likeliest_facet(table, np.stack([strains, stiffer])) == number
    sides = likeliest_sides(table, model.seen(prediction, weight))
    assert np.abs(sides[number] - SAID).max() <= 1  # 0.2 mm, where facets blur steps over 3 mm


def test_places_on_steps_are_seen_on_the_side_where_they_lie() -> None:
    """Half a millimetre to the left, of the first bar's places alone."""
    campaign = clean(1.0, 1.2, stated=True)
    first, *others = campaign.specimens
    moved = replace(first.strain_field, x_mm=first.strain_field.x_mm + 0.5)
    aside = replace(campaign, specimens=(replace(first, strain_field=moved), *others))
    model = ObservationModel(aside)
    seen = model.seen(predict(model.setup, model.laws), model.field_weights.weight)
    sides = likeliest_sides(model.table, seen)[0]
    of_first = model.table.specimen[model.table.is_field] == 0
    aside_mm = 0.01 * GAUGE_MM * SIDES[sides]
    np.testing.assert_allclose(aside_mm[of_first], -0.5, atol=0.11)
    # The others lie where they are said to; but a ramp, which has no steps, is moved to the next of
    # `SIDES` in one draw of four (5 of 16, counted over eight seeds).
    ramps = [n for n, s in enumerate(aside.specimens) if "ramp" in s.id]
    on_ramp = np.isin(model.table.specimen[model.table.is_field], ramps)
    np.testing.assert_allclose(aside_mm[~of_first & ~on_ramp], 0.0, atol=0.01)
    np.testing.assert_allclose(aside_mm[on_ramp], 0.0, atol=0.22)


def test_a_replicate_without_camera_counts_for_the_forces() -> None:
    seen = clean_problem(1.0, 1.2, stated=True)
    first, *others = seen.campaign.specimens
    blind = replace(seen.campaign, specimens=(replace(first, strain_field=None), *others))
    freedom = [problem.scatter.degrees_of_freedom for problem in (seen, problem_of(blind))]
    assert freedom == [6, 6]


def setup_of(design: ProfileDesign) -> Setup:
    bar = specimen("B", gauge_mm=GAUGE_MM, profile=design)
    campaign = Campaign("c", "connex3", PALETTE, (bar,))
    return single_tests(campaign, [0], bar.time_s[None], bar.displacement_mm[None])


def test_a_step_is_seen_as_a_step() -> None:
    """Exact where strain is constant on both sides: of a facet, what lies on either side."""
    setup = setup_of(BLOCKS)
    strain = predict(setup, law_tables(PALETTE)).strain[-1]
    soft, hard = strain[0], strain[len(strain) // 2]
    x = np.array([5.0, 9.99, 10.0, 10.01, 10.2, 16.0, 31.9])
    of_facets = [0.0, 0.59 / 1.2, 0.5, 0.61 / 1.2, 0.8 / 1.2, 1.0, 0.0]
    for facet, shares in ((0.0, [0.0, 0.0, 0.5, 1.0, 1.0, 1.0, 0.0]), (1.2, of_facets)):
        seen = seen_shares(setup, 0, x, facet) @ strain
        np.testing.assert_allclose(seen, soft + np.array(shares) * (hard - soft), rtol=1e-9)


def test_a_slope_is_seen_as_a_slope() -> None:
    """Not as the slices that it is cut into, 1 mm long."""
    setup = setup_of(RAMP)
    x = np.linspace(1.0, GAUGE_MM - 1.0, 50)
    for facet in (0.0, 1.0):
        np.testing.assert_allclose(seen_shares(setup, 0, x, facet) @ setup.x_mm, x, atol=1e-3)


@pytest.mark.parametrize("facet_mm", [0.0, 0.8, None])
def test_shares_of_a_bin_add_up_to_one_and_bins_are_means_of_places(facet_mm) -> None:
    setup = setup_of(LAMELLAE)
    x = np.array([-0.3, 0.4, 1.7, 2.0, 3.0, 5.0, 9.0, 9.5, 30.0, 31.0, 32.4])
    bins = Bins(StrainField(np.array([1.0]), x, np.zeros((1, 11)), facet_mm), setup, 0)
    np.testing.assert_allclose(bins.shares.sum(axis=3), 1.0)
    assert bins.places.tolist() == [4, 4, 3]
    np.testing.assert_allclose(bins.x_mm, [np.mean(x[:4]), np.mean(x[4:8]), np.mean(x[8:])])
    of_places = seen_shares(setup, 0, x[4:8], facet_mm or 0.0)
    np.testing.assert_allclose(bins.shares[0, SAID, 1], of_places.mean(axis=0))


def test_places_that_lie_aside_are_no_scatter_of_the_camera() -> None:
    """By half a millimetre, either way from replicate to replicate: 1.5 % of the gauge."""
    true = clean_problem(1.0, 1.2, stated=True)
    sides = iter([0.25, 0.25, 0.25, -0.25, -0.25, -0.25])
    aside = with_fields(true.campaign, lambda f: replace(f, x_mm=f.x_mm + next(sides)))
    moved = problem_of(aside)
    assert moved.scatter.field_relative < 1.2 * true.scatter.field_relative
    assert np.mean(surprise(moved) ** 2) < 1.3


def test_frames_between_those_of_a_replicate_are_no_bias() -> None:
    """A replicate that was seen at other times has the same strains at the same travel."""
    campaign = clean(1.0, 1.2, stated=True)
    first = next(s for s in campaign.specimens if s.strain_field is not None)
    seen = first.strain_field
    frames = np.linspace(0.06, 1.0, 24) * seen.time_s[-1]
    strain = np.stack([np.interp(frames, seen.time_s, at) for at in seen.strain.T], axis=1)
    other = replace(first, id="again", strain_field=replace(seen, time_s=frames, strain=strain))
    table = ObservationModel(replace(campaign, specimens=(first, other))).table
    one, again = (table.measured[table.is_field & (table.specimen == k)] for k in (0, 1))
    np.testing.assert_allclose(again, one, atol=0.004)


def test_a_facet_length_is_written_and_read(tmp_path: Path) -> None:
    campaign = clean(1.0, 1.2, stated=True)
    bars = [s for s in campaign.specimens if s.strain_field is not None]
    unknown = replace(bars[1], strain_field=replace(bars[1].strain_field, facet_mm=None))
    mixed = replace(campaign, specimens=(bars[0], unknown))
    again = read_campaign(write_campaign(mixed, tmp_path / "c")).specimens
    assert [s.strain_field.facet_mm for s in again] == [1.2, None]


@pytest.mark.parametrize(
    ("cells", "message"),
    [
        (("0.8", "0.9"), "line 3: facet_mm is 0.9; give the specimen's facets one length"),
        (("", "0.9"), "line 3: facet_mm is 0.9; give"),
        (("-1", "-1"), "line 2: facet_mm is -1; give"),
        (("40", "40"), "line 2: facet_mm is 40, more than the gauge's 32 mm"),
        (("x", "1"), "line 2, column 'facet_mm': 'x' is no finite number"),
    ],
)
def test_an_impossible_facet_is_refused(cells, message, tmp_path: Path) -> None:
    folder = write_campaign(clean(1.0, 1.2, stated=True), tmp_path / "c")
    rows = [f"SIM-ramp-A,1.0,{x},0.1,{facet}" for x, facet in zip((5, 9), cells, strict=True)]
    text = "\n".join(["specimen,time_s,x_mm,strain,facet_mm", *rows]) + "\n"
    (folder / "fields.csv").write_text(text)
    with pytest.raises(FileError, match=message):
        read_campaign(folder)
