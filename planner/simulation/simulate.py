"""Pull a plan, a graded bar or a coupon, and report force, strains and what breaks."""

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from planner.errors import (
    ArgumentError,
    FileError,
    UnknownNameError,
    as_count,
    as_number,
    check_known,
    positive,
)
from planner.formats.files import json_of
from planner.formats.tables import encode_csv
from planner.glance import counted, html_of, one_line, outcome, plotted
from planner.materials.laws import FARTHEST
from planner.materials.mixtures import CoefficientModel
from planner.numerics import BoolArray, FloatArray, IntArray, normal_quantile
from planner.palette import Material, Palette
from planner.plan import Plan, read_plan
from planner.printers import Printer, palette_of
from planner.simulation.bar import Bar, plan_palette
from planner.simulation.bar_solver import LawTables, PulledBars, law_tables, predict, unaltered

__all__ = ["Simulation", "called", "loading_path", "log_sds", "simulate", "simulate_bar"]


# ------------------------------------------------------------------------------------------------
# What the crosshead does: displacement over time.


_PROTOCOLS = ("monotonic", "cyclic", "relaxation")
_HOLD_s = 100.0
_COUPON_MM = (6.0, 4.0, 33.0)
"""Width, thickness and gauge length where none are stated: ASTM D638, type IV."""

_FIRST_HOLD = 1e-3  # of the hold: relaxation is read on a logarithmic scale of time


class LoadingPath(NamedTuple):
    """Displacement of the crosshead at times, (steps,) each, from rest at time 0."""

    time_s: FloatArray
    displacement_mm: FloatArray


def loading_path(
    protocol: str,
    *,
    to_displacement_mm: float,
    rate_mm_s: float,
    steps: int = 100,
    cycles: int = 1,
    hold_s: float = _HOLD_s,
) -> LoadingPath:
    """Return the path of a protocol.

    Parameters
    ----------
    protocol
        ``monotonic``: up at constant rate. ``cyclic``: up and down, `cycles` times.
        ``relaxation``: up, then held for `hold_s` at times that are evenly spaced in their
        logarithm.
    steps
        Load steps of each leg; the start is one more.

    Raises
    ------
    ArgumentError
        An unknown protocol, or a figure outside what it may be.
    """
    for name, value in (("`rate_mm_s`", rate_mm_s), ("`hold_s`", hold_s)):
        positive(value, name)
    steps, cycles = as_count(steps, "`steps`", 10_000), as_count(cycles, "`cycles`", 10_000)
    check_known(protocol, _PROTOCOLS, f"`protocol` {protocol}: no such protocol; {{}}it may be")
    up = np.linspace(0.0, to_displacement_mm, steps + 1)
    ramp_s = up / rate_mm_s
    if protocol == "monotonic":
        return LoadingPath(ramp_s, up)
    if protocol == "cyclic":
        turns = np.concatenate([up[1:], up[-2::-1]])
        displacement = np.concatenate([up[:1], np.tile(turns, cycles)])
        time = np.linspace(0.0, 2.0 * cycles * float(ramp_s[-1]), len(displacement))
        return LoadingPath(time, displacement)
    time = np.append(ramp_s, ramp_s[-1] + np.geomspace(_FIRST_HOLD * hold_s, hold_s, steps))
    return LoadingPath(time, np.append(up, np.full(steps, up[-1])))


# ------------------------------------------------------------------------------------------------
# An elastic bar under its path: the solver's bars, with no effect.


_TOLERANCE = 1e-11
_SLACK = 1e-9  # of the reach: a step just at it is within


class _Pulled(NamedTuple):
    """The states that were reached, and how far slices may go.

    Attributes
    ----------
    strain, stress_MPa, tangent_MPa : (steps, n)
        Of each slice; steps may be fewer than were asked for.
    break_strain : (n,)
        Elongation at break, linear in the coordinate between grades.
    strain_limit : (n,)
        `FARTHEST` times `break_strain`, or less where a law's stress ceases to rise.
    reach_mm : float
        Displacement at which the first slice is at its limit; infinite where the path stays below.
    stopped_at : int or None
        That slice.
    """

    strain: FloatArray
    stress_MPa: FloatArray
    tangent_MPa: FloatArray
    break_strain: FloatArray
    strain_limit: FloatArray
    reach_mm: float
    stopped_at: int | None


def _pull(bar: Bar, model: CoefficientModel, displacement_mm: FloatArray) -> _Pulled:
    """Pull a bar through displacements of its ends, none below 0, as far as its laws go.

    Raises
    ------
    ArgumentError
        A coordinate is outside the palette.
    """
    lower, upper, t = model.bracket(bar.coordinate)
    upper, breaks = np.where(t > 0.0, upper, lower), model.breaks
    break_strain = (1.0 - t) * breaks[lower] + t * breaks[upper]
    # A blend may go beyond twice the break of the one of its grades that breaks first. The grades
    # beside those that are used count for the slopes there.
    near = slice(max(int(lower.min()) - 1, 0), int(upper.max()) + 2)
    laws = law_tables(
        replace(model.palette, materials=model.palette.materials[near]),
        strain_end=FARTHEST * float(breaks[np.unique([lower, upper])].max()),
        farthest=math.inf,
        chosen=True,
    )
    rising = np.zeros(len(breaks))
    rising[near] = laws.sound_strain
    limit = np.minimum(FARTHEST * break_strain, np.minimum(rising[lower], rising[upper]))

    def beyond(travel_mm: float) -> float:
        """Return how far the first slice is past its limit, as a share of that."""
        strain, _, _ = _states(bar, laws, np.array([travel_mm]))
        return float(np.max(strain / limit)) - 1.0

    most, reach, stopped_at = float(displacement_mm.max()), math.inf, None
    if beyond(most) > 0.0:
        from scipy.optimize import brentq

        reach = float(brentq(beyond, 0.0, most, xtol=1e-12 * most))
    out = displacement_mm > reach * (1.0 + _SLACK)
    if out.any():
        displacement_mm = displacement_mm[: int(np.argmax(out))]
        strain, _, _ = _states(bar, laws, np.array([reach]))
        stopped_at = int(np.argmax(strain / limit))
    return _Pulled(*_states(bar, laws, displacement_mm), break_strain, limit, reach, stopped_at)


def _states(
    bar: Bar, laws: LawTables, displacement_mm: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return strain, nominal stress and tangent of each slice at each step, (steps, n) each."""
    if len(bar.coordinate) == 1:  # nothing to solve, and no solver to wait for
        strain = displacement_mm[:, None] / bar.gauge_mm
        return strain, *laws.stress_and_tangent_MPa(bar.coordinate, strain)
    all_slices = np.array([0, len(bar.coordinate)])
    steps = len(displacement_mm)
    bars = PulledBars(
        first_slice=all_slices,
        time_s=np.zeros((1, steps)),
        travel_mm=displacement_mm[None, :],
        length_mm=bar.length_mm,
        area_mm2=bar.area_mm2,
        coordinate=bar.coordinate,
        **unaltered(all_slices, steps),
    )
    found = predict(bars, laws, tolerance=_TOLERANCE)
    still = displacement_mm == 0.0
    found.strain[still], found.force_N[0, still] = 0.0, 0.0
    stress = found.force_N[0][:, None] / bar.area_mm2
    return found.strain, stress, laws.stress_and_tangent_MPa(bar.coordinate, found.strain)[1]


# ------------------------------------------------------------------------------------------------
# Where a bar breaks, cannot follow, or is stretched past what its laws know.


_YIELD_STRAIN = 0.02
"""Rigid photopolymers leave Hooke's line at 2 to 3 %, where a palette's law knows no yield."""


@dataclass(frozen=True, slots=True)
class BreakFinding:
    """Something that a print would not do as simulated, and where.

    Attributes
    ----------
    kind
        ``break``: a slice passes its elongation at break. ``unreachable``: the path ends early.
    x_mm
        Ends of the stretch of the bar that it concerns.
    gauge_strain
        Of the whole bar, when it happens first.
    """

    kind: str
    message: str
    x_mm: tuple[float, float]
    gauge_strain: float


def _break_findings(
    bar: Bar, model: CoefficientModel, path: LoadingPath, reached: _Pulled
) -> tuple[BreakFinding, ...]:
    """Report every stretch of slices that breaks, the first to break first, and an early end."""
    found = []
    gauge_strain = path.displacement_mm / bar.gauge_mm
    beyond = reached.strain > reached.break_strain
    marked = np.concatenate([[False], beyond.any(axis=0), [False]])
    for start, stop in np.flatnonzero(np.diff(marked)).reshape(-1, 2).tolist():
        step = int(np.argmax(beyond[:, start:stop].any(axis=1)))
        excess = reached.strain[step] / reached.break_strain
        first = start + int(np.argmax(excess[start:stop]))
        limit = float(reached.break_strain[first])
        # The first step is at rest, where nothing is beyond.
        last = slice(step - 1, step + 1)
        at = float(np.interp(limit, reached.strain[last, first], gauge_strain[last]))
        begin, end = float(bar.edges_mm[start]), float(bar.edges_mm[stop])
        spread = f" (in the end for all of {begin:.4g} .. {end:.4g} mm)" if stop > start + 1 else ""
        name = called(model, float(bar.coordinate[first]))
        said = (
            f"{name} at {bar.x_mm[first]:.4g} mm passes its elongation at break, {limit:.3g}, at a "
            f"strain of {at:.3g} of the bar; a print would break there, and what follows is "
            f"extrapolated{spread}"
        )
        found.append(BreakFinding("break", said, (begin, end), at))
    found.sort(key=lambda finding: finding.gauge_strain)
    if reached.stopped_at is not None:
        k = reached.stopped_at
        wanted, got = float(gauge_strain.max()), reached.reach_mm / bar.gauge_mm
        limit, breaks = float(reached.strain_limit[k]), float(reached.break_strain[k])
        why = (
            f"{FARTHEST:g} times its elongation at break, and its law is not known further"
            if limit >= FARTHEST * breaks
            else "where the stress of its law ceases to rise"
        )
        said = (
            f"a strain of {wanted:.3g} is out of reach: at {got:.3g}, "
            f"{called(model, float(bar.coordinate[k]))} at {bar.x_mm[k]:.4g} mm is strained by "
            f"{limit:.3g}, {why}"
        )
        ends = float(bar.edges_mm[k]), float(bar.edges_mm[k + 1])
        found.append(BreakFinding("unreachable", said, ends, got))
    return tuple(found)


def _yield_notes(bar: Bar, model: CoefficientModel, reached: _Pulled) -> Iterator[str]:
    """Say which rigid grades without a yield are strained past where Hooke's law is known."""
    lower, _, _ = model.bracket(bar.coordinate)
    most = reached.strain.max(axis=0, initial=0.0)
    for k in np.unique(lower).tolist():
        material = model.palette.materials[k]
        strain = float(most[lower == k].max())
        line = material.deformation == "plastic" and material.law.model == "linear"
        if line and strain > _YIELD_STRAIN:
            yield (
                f"{material.id} is known by Young's modulus alone and is strained by {strain:.3g}; "
                f"such grades yield from about {_YIELD_STRAIN:g}, so the force is an upper bound"
            )


def called(model: CoefficientModel, coordinate: float) -> str:
    """Return what a coordinate is called: a grade, or the blend of the two beside it."""
    lower, upper, t = model.bracket(coordinate)
    softer, harder = (model.palette.materials[int(k)].id for k in (lower, upper))
    return softer if t == 0.0 else f"the blend of {softer} and {harder} at m = {coordinate:.4g}"


# ------------------------------------------------------------------------------------------------
# Simulation: what a bar does under load, and its files.


@dataclass(frozen=True, slots=True, eq=False)
class Simulation:
    """Force and displacement of a bar's ends, and the strain along it.

    Attributes
    ----------
    name
        What was pulled: a part's file, a profile's, or a material.
    bar
        Its slices: ``x_mm``, ``length_mm``, ``area_mm2``, ``coordinate``, (n,) each.
    time_s, displacement_mm, force_N : (steps,)
        Steps that lie out of reach are left out.
    force_interval_N : (steps, 2)
        Holds the force of a print with probability `level`.
    strain, stress_MPa : (steps, n)
        Engineering strain and nominal stress of each slice.
    break_strain : (n,)
        Elongation at break of each slice.
    findings
        Where a print would break or the path ends early.
    notes
        What was assumed, one sentence each.
    """

    name: str
    palette: Palette
    bar: Bar
    protocol: str
    rate_mm_s: float
    to_strain: float
    level: float
    time_s: FloatArray
    displacement_mm: FloatArray
    force_N: FloatArray
    force_interval_N: FloatArray
    strain: FloatArray
    stress_MPa: FloatArray
    break_strain: FloatArray
    findings: tuple[BreakFinding, ...] = ()
    notes: tuple[str, ...] = ()

    _repr_html_ = html_of
    plot = plotted

    @one_line
    def __repr__(self) -> str:
        return (
            f"{self.name}: {self.protocol} to strain {self.to_strain:g}, "
            f"{counted(len(self.force_N), 'step')}, {counted(len(self.bar.coordinate), 'slice')}, "
            f"{self.force_N.max():.4g} N at most; " + outcome((len(self.findings), "finding"))
        )

    @property
    def ok(self) -> bool:
        """Whether the whole path is reached and nothing breaks on it."""
        return not self.findings

    @property
    def gauge_strain(self) -> FloatArray:
        """Displacement over the bar's length at rest, (steps,)."""
        return self.displacement_mm / self.bar.gauge_mm

    @property
    def beyond_break(self) -> BoolArray:
        """Steps from the first break on, which are extrapolated, (steps,)."""
        return np.logical_or.accumulate((self.strain > self.break_strain).any(axis=1))

    @property
    def _steps(self) -> dict[str, FloatArray | BoolArray]:
        low, high = self.force_interval_N.T
        return {
            "time_s": self.time_s,
            "displacement_mm": self.displacement_mm,
            "gauge_strain": self.gauge_strain,
            "force_N": self.force_N,
            "force_low_N": low,
            "force_high_N": high,
            "beyond_break": self.beyond_break,
        }

    def document(self) -> dict[str, Any]:
        """Return the simulation as JSON holds it."""
        names = ("x_mm", "length_mm", "area_mm2", "coordinate")
        slices = {name: getattr(self.bar, name).tolist() for name in names}
        return {
            "schema": 1,
            "source": self.name,
            "palette": {"name": self.palette.name, "sha256": self.palette.sha256},
            "protocol": self.protocol,
            "rate_mm_s": self.rate_mm_s,
            "to_strain": self.to_strain,
            "gauge_mm": self.bar.gauge_mm,
            "level": self.level,
            "steps": {name: values.tolist() for name, values in self._steps.items()},
            "slices": {**slices, "break_strain": self.break_strain.tolist()},
            "strain": self.strain.tolist(),
            "findings": [dataclasses.asdict(finding) for finding in self.findings],
            "notes": list(self.notes),
        }

    json = json_of

    def csv(self) -> bytes:
        """Return the curve as CSV, one row a step."""
        steps = {name: np.asarray(values, float).tolist() for name, values in self._steps.items()}
        names = sorted(steps, key=lambda name: name in ("gauge_strain", "beyond_break"))
        return encode_csv([names, *zip(*(steps[name] for name in names), strict=True)])

    def field_csv(self) -> bytes:
        """Return the strain along the bar as CSV: time_s, x_mm, strain of each step and slice."""
        steps, n = self.strain.shape
        time, x = np.repeat(self.time_s, n), np.tile(self.bar.x_mm, steps)
        rows = np.stack([time, x, self.strain.ravel()], axis=1).tolist()
        return encode_csv([("time_s", "x_mm", "strain"), *rows])


# ------------------------------------------------------------------------------------------------
# What is to be pulled: a plan, a profile file, a material's coupon, or a bar as it is.


def _bar_of(
    source: object, palette: Palette, slices: int, width_mm: float, thickness_mm: float,
    gauge_mm: float,
) -> tuple[str, Bar]:  # fmt: skip
    """Return the name and the bar of all but a plan."""
    if isinstance(source, Bar):
        return "bar", source
    for name, size in (("width", width_mm), ("thickness", thickness_mm), ("gauge", gauge_mm)):
        positive(size, f"`{name}_mm`")
    if not isinstance(source, Material):
        path = Path(str(source))
        if path.suffix.casefold() == ".csv":
            return path.name, Bar.read(
                path, palette, slices=slices, width_mm=width_mm, thickness_mm=thickness_mm
            )
        if path.is_file():
            raise FileError(
                f"{path}: is no plan and no profile; give a plan.json or its folder (planner grade "
                "makes one), a profile (.csv), or a material; or say how a mesh is held and loaded "
                "with `fix` and `load`"
            )
        try:
            source = palette.resolve(str(source))
        except UnknownNameError as error:
            raise UnknownNameError(f"{error}; nor is {path} a file or folder") from error
    ends, area = np.array([0.0, gauge_mm]), np.array([width_mm * thickness_mm])
    return source.id, Bar(ends, np.array([source.coordinate]), area)


# ------------------------------------------------------------------------------------------------
# How far a print's force may lie from the predicted one, from the palette's uncertainty.


_STRAINS = 65  # at which the variance between grades is taken; it varies slowly


def _force_interval_N(
    bar: Bar, model: CoefficientModel, reached: _Pulled, level: float
) -> FloatArray:
    """Return the interval that holds a print's force with probability `level`, (steps, 2).

    Let the stress of slice i be s_i times the law's, ln s_i normal with standard deviation d_i.
    At given displacement, to first order,

        d ln F = Σ w_i d ln s_i,  w_i = l_i P_i / T_i / Σ l P / T,

    with length l, nominal stress P and tangent T; the weights add up to 1. d_i is that of
    `CoefficientModel.modulus_interval_MPa`: the grades' own, other readings' reach included, and
    between grades the bridge's, not cut where both grades' intervals end. All
    d_i are taken to go together, so that the standard deviation of ln F is Σ w_i d_i. Whatever
    their correlation, it is not larger.

    Raises
    ------
    ArgumentError
        A level that is not between 0 and 1.
    """
    level = as_number(level, "`level`", (0.0, 1.0))
    weight = bar.length_mm * reached.stress_MPa / reached.tangent_MPa
    total = weight.sum(axis=1, keepdims=True)
    weight = weight / np.where(total > 0.0, total, 1.0)
    normal = normal_quantile(level)
    sds = log_sds(model, bar.coordinate, reached.strain, normal)
    force_N = bar.area_mm2[0] * reached.stress_MPa[:, 0]
    ends = [
        force_N * np.exp(sign * normal * np.sum(weight * sd, axis=1))
        for sign, sd in zip((-1.0, 1.0), sds, strict=True)
    ]
    return np.stack(ends, axis=1)


def log_sds(
    model: CoefficientModel, coordinate: FloatArray, strain: FloatArray, normal: float
) -> tuple[FloatArray, FloatArray]:
    """Return the standard deviations of ln(stress), downwards and upwards, at coordinates (n,).

    Parameters
    ----------
    strain : (..., n)
        Of each coordinate.
    normal
        Deviations at which other readings' reach is included.
    """
    known = np.linspace(0.0, model.strain_limit, _STRAINS)
    variance = np.interp(strain, known, model.wiener_variance(known))
    beside = model.bracket(coordinate)[:2]
    down, up = (
        model.log_sd(
            coordinate, variance, *(_of_slices(strain, known, own, grade) for grade in beside)
        )
        for own in model.own_log_sds(known, normal)
    )
    return down, up


def _of_slices(
    strain: FloatArray, known: FloatArray, rows: FloatArray, grade: IntArray
) -> FloatArray:
    """Return at the strains of slices, (..., n), what is known of the grade of each, (n,)."""
    out = np.empty_like(strain)
    for k in np.unique(grade).tolist():
        out[..., grade == k] = np.interp(strain[..., grade == k], known, rows[k])
    return out


# ------------------------------------------------------------------------------------------------
# Pull a bar and see: planner.simulate_bar; or load a whole part: planner.simulate.


_UNKNOWN_RATE_PER_S = 0.01
_MOST_STRAIN = 10.0
_MOST_STATES = 20_000_000  # slices times steps: half a GB


def simulate(source: Any, **options: Any) -> Any:
    """Pull a printed bar, or load a whole part where it is said how it is held and loaded.

    Parameters
    ----------
    source
        As `simulate_bar` and `simulate_part` take it.
    options
        Those of `simulate_bar`; or the fields of one `LoadCase`, as ``fix`` and ``load``, and
        options of `simulate_part`.

    Returns
    -------
    Simulation or PartSimulation

    Raises
    ------
    PlannerError
        Bad input, with what to do about it.
    TypeError
        An option of the other of the two.

    Examples
    --------
    >>> pulled = planner.simulate("FLX9760", to_strain=0.2)  # doctest: +SKIP
    >>> bent = planner.simulate(
    ...     "finger-graded", fix="x=max", load="x=min: 0,0,-0.5 N"
    ... )  # doctest: +SKIP
    """
    from planner.simulation.loads import LoadCase
    from planner.simulation.part import simulate_part

    given = {f.name: options.pop(f.name) for f in fields(LoadCase) if f.name in options}
    if not given:
        return simulate_bar(source, **options)
    return simulate_part(source, LoadCase(**given), **options)[0]


def simulate_bar(
    source: str | Path | Plan | Material | Bar,
    *,
    to_strain: float = 0.3,
    rate_mm_s: float | None = None,
    protocol: str = "monotonic",
    steps: int = 100,
    cycles: int = 1,
    hold_s: float = _HOLD_s,
    slices: int = 400,
    between_mm: tuple[float, float] | None = None,
    width_mm: float = _COUPON_MM[0],
    thickness_mm: float = _COUPON_MM[1],
    gauge_mm: float = _COUPON_MM[2],
    level: float = 0.95,
    printer: str | Printer | None = None,
    palette: str | Path | Palette | None = None,
) -> Simulation:
    """Pull a printed bar along its axis: slices across it share one force.

    What comes out is force against displacement, and the strain along it.

    Parameters
    ----------
    source
        Path of a plan.json, its folder or a profile (``.csv``); a material's name; or a `Plan`,
        just made or read back, a `Material` or a `Bar`.
    to_strain
        Largest displacement over the bar's length at rest.
    rate_mm_s
        Speed of the crosshead; by default the palette's reference strain rate times the length.
        The palette's laws are elastic, so it sets the times alone.
    protocol
        ``monotonic``, ``cyclic`` (up and down) or ``relaxation`` (held).
    steps
        Load steps of each leg.
    cycles
        Of the cyclic protocol.
    hold_s
        How long relaxation holds.
    slices
        Slices over a plan's axis or a profile, 10 or more: fewer miss how its section changes. A
        coupon is one.
    between_mm
        Only what lies between these places along the axis.
    width_mm, thickness_mm, gauge_mm
        Size of a material's coupon, by default the narrow section of ASTM D638's type IV; width
        and thickness also of a profile that has none.
    level
        Probability that an interval holds what a print does.
    printer, palette
        By name, file or value; by default those of the plan, else the Connex3 and its own.

    Returns
    -------
    Simulation
        Its ``ok`` is false when a print would break, or the strain is out of reach.

    Raises
    ------
    PlannerError
        Bad input, with what to do about it.

    Examples
    --------
    >>> result = planner.simulate_bar("FLX9760", to_strain=0.2)  # doctest: +SKIP
    >>> round(float(result.force_N[-1]), 2)  # doctest: +SKIP
    8.38
    """
    if not 0.0 < as_number(to_strain, "`to_strain`") <= _MOST_STRAIN:
        raise ArgumentError(
            f"`to_strain` {to_strain:g}: it must be above 0 and at most {_MOST_STRAIN:g}; strains "
            "are fractions, so 30 % is 0.3"
        )
    slices = as_count(slices, "`slices`", 10_000, least=10)
    path = source if isinstance(source, (str, Path)) else ""
    if path and (Path(path).suffix.casefold() == ".json" or Path(path).is_dir()):
        source = read_plan(path)
    notes: tuple[str, ...] = ()
    if isinstance(source, Plan):
        name = source.part.file
        chosen, notes = plan_palette(source, palette, printer)
        bar = Bar.of_plan(source, chosen, slices=slices, between_mm=between_mm)
        if (width_mm, thickness_mm, gauge_mm) != _COUPON_MM:
            notes += ("the sizes stated are a coupon's, and change nothing: the plan has its own",)
        if float(np.sqrt(bar.area_mm2.max())) > bar.gauge_mm:
            notes += (
                "the part is wider than it is long along the gradient: sections do not stay plane, "
                "and forces are a rough guide",
            )
    else:
        chosen = palette_of(palette, printer)
        name, whole = _bar_of(source, chosen, slices, width_mm, thickness_mm, gauge_mm)
        bar = Bar.between(whole.edges_mm, whole.coordinate, whole.area_mm2, between_mm)
    speed = rate_mm_s
    if speed is None:
        speed = (chosen.reference.strain_rate_per_s or _UNKNOWN_RATE_PER_S) * bar.gauge_mm
        if not chosen.reference.strain_rate_per_s:
            notes += (
                f"palette {chosen.name} names no strain rate; times are those of "
                f"{_UNKNOWN_RATE_PER_S:g} /s",
            )
    if rate_mm_s is not None or protocol != "monotonic":
        notes += ("the palette's laws are elastic: rate and time change no force",)
    end = to_strain * bar.gauge_mm
    way = loading_path(
        protocol, to_displacement_mm=end, rate_mm_s=speed, steps=steps, cycles=cycles, hold_s=hold_s
    )
    of_protocols = ("cycles", cycles, 1, "cyclic"), ("hold_s", hold_s, _HOLD_s, "relaxation")
    for option, value, usual, of in of_protocols:
        if value != usual and protocol != of:
            raise ArgumentError(f"`{option}` {value:g}: it goes with `protocol` {of}")
    states = len(way.time_s) * len(bar.coordinate)
    if states > _MOST_STATES:
        raise ArgumentError(
            f"{len(bar.coordinate)} slices over {len(way.time_s)} steps make {states} states; up "
            "to 20 million are possible: take fewer `slices`, `steps` or `cycles`"
        )
    model = CoefficientModel(chosen)
    reached = _pull(bar, model, way.displacement_mm)
    count = len(reached.strain)
    return Simulation(
        name=name,
        palette=chosen,
        bar=bar,
        protocol=protocol,
        rate_mm_s=speed,
        to_strain=to_strain,
        level=level,
        time_s=way.time_s[:count],
        displacement_mm=way.displacement_mm[:count],
        force_N=bar.area_mm2[0] * reached.stress_MPa[:, 0],
        force_interval_N=_force_interval_N(bar, model, reached, level),
        strain=reached.strain,
        stress_MPa=reached.stress_MPa,
        break_strain=reached.break_strain,
        findings=_break_findings(bar, model, way, reached),
        notes=(*notes, *_yield_notes(bar, model, reached)),
    )
