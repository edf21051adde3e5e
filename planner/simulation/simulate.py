"""Pull a bar and see: planner.simulate."""

from pathlib import Path

from planner.errors import ArgumentError
from planner.materials.coefficients import CoefficientModel
from planner.palette import Material, Palette
from planner.plan import Plan
from planner.printers import Printer
from planner.simulation.bar import Bar
from planner.simulation.equilibrium import solve
from planner.simulation.findings import findings, yield_notes
from planner.simulation.protocol import LoadingPath, loading_path
from planner.simulation.response import elastic_response
from planner.simulation.result import Simulation
from planner.simulation.source import D638_TYPE_IV, Section, open_source
from planner.simulation.uncertainty import force_interval_N

__all__ = ["simulate", "simulate_bar"]

_UNKNOWN_RATE_PER_S = 0.01
_MOST_STRAIN = 10.0
_MOST_STATES = 20_000_000  # slices times steps: half a GB


def simulate(
    source: str | Path | Plan | Material | Bar,
    *,
    to_strain: float = 0.3,
    rate_mm_s: float | None = None,
    protocol: str = "monotonic",
    steps: int = 100,
    cycles: int = 1,
    hold_s: float = 100.0,
    slices: int = 400,
    between_mm: tuple[float, float] | None = None,
    width_mm: float = D638_TYPE_IV.width_mm,
    thickness_mm: float = D638_TYPE_IV.thickness_mm,
    gauge_mm: float = D638_TYPE_IV.gauge_mm,
    level: float = 0.95,
    printer: str | Printer | None = None,
    palette: str | Path | Palette | None = None,
) -> Simulation:
    """Predict force against displacement of a printed bar, and the strain along it.

    Parameters
    ----------
    source
        Path of a plan.json, its folder or a profile (``.csv``); a material's name; or a `Plan`,
        `Material` or `Bar`.
    to_strain
        Largest displacement over the bar's length at rest.
    rate_mm_s
        Speed of the crosshead; by default the palette's reference strain rate times the length.
        The palette's laws are elastic, so it sets the times alone.
    protocol
        ``monotonic``, ``cyclic`` (up and down, `cycles` times) or ``relaxation`` (held for
        `hold_s`).
    steps
        Load steps of each leg.
    slices
        Slices over a plan's axis or a profile; a coupon is one.
    between_mm
        Only what lies between these places along the axis.
    width_mm, thickness_mm, gauge_mm
        Size of a material's coupon; width and thickness also of a profile that has none.
    level
        Probability that the interval of the force holds a print's.
    printer, palette
        By name, file or value; by default those of the plan, else the Connex3 and its own.

    Returns
    -------
    Simulation
        `Simulation.ok` is false when a print would break or the strain is out of reach.

    Raises
    ------
    PlannerError
        Bad input, with what to do about it.
    """
    if not 0.0 < to_strain <= _MOST_STRAIN:
        raise ArgumentError(
            f"--to-strain {to_strain:g}: it must be above 0 and at most {_MOST_STRAIN:g}; strains "
            "are fractions, so 30 % is 0.3"
        )
    if not 1 <= slices <= 10_000:
        raise ArgumentError(f"--slices {slices}: it must be a whole number from 1 to 10000")
    opened = open_source(
        source,
        palette=palette,
        printer=printer,
        slices=slices,
        section=Section(width_mm, thickness_mm, gauge_mm),
        between_mm=between_mm,
    )
    gauge = opened.bar.gauge_mm
    speed, notes = _rate(rate_mm_s, opened.palette, gauge)
    if rate_mm_s is not None or protocol != "monotonic":
        notes = (*notes, "the palette's laws are elastic: rate and time change no force")
    path = loading_path(
        protocol,
        to_displacement_mm=to_strain * gauge,
        rate_mm_s=speed,
        steps=steps,
        cycles=cycles,
        hold_s=hold_s,
    )
    return simulate_bar(
        opened.bar,
        opened.palette,
        path,
        name=opened.name,
        protocol=protocol,
        rate_mm_s=speed,
        level=level,
        notes=(*opened.notes, *notes),
    )


def simulate_bar(
    bar: Bar,
    palette: Palette,
    path: LoadingPath,
    *,
    name: str = "bar",
    protocol: str = "monotonic",
    rate_mm_s: float,
    level: float = 0.95,
    notes: tuple[str, ...] = (),
) -> Simulation:
    """Take a bar along any path: composition, law, section, equilibrium, in this order.

    Raises
    ------
    ArgumentError
        A coordinate outside the palette, a level that is not between 0 and 1, or slices times
        steps beyond 20 million.
    PaletteError
        The palette's stiffness does not rise with the coordinate.
    """
    states = len(path.time_s) * len(bar.coordinate)
    if states > _MOST_STATES:
        raise ArgumentError(
            f"{len(bar.coordinate)} slices over {len(path.time_s)} steps make {states} states; up "
            "to 20 million are possible: take fewer --slices, --steps or --cycles"
        )
    model = CoefficientModel(palette)
    response = elastic_response(model, bar.coordinate)
    reached = solve(bar, response, path.displacement_mm)
    count = len(reached.force_N)
    return Simulation(
        name=name,
        palette=palette,
        bar=bar,
        protocol=protocol,
        rate_mm_s=rate_mm_s,
        to_strain=float(path.displacement_mm.max()) / bar.gauge_mm,
        level=level,
        time_s=path.time_s[:count],
        displacement_mm=path.displacement_mm[:count],
        force_N=reached.force_N,
        force_interval_N=force_interval_N(bar, model, reached, level),
        strain=reached.strain,
        stress_MPa=reached.stress_MPa,
        break_strain=response.break_strain,
        findings=findings(bar, model, response, path, reached),
        notes=(*notes, *yield_notes(bar, model, reached)),
    )


def _rate(
    rate_mm_s: float | None, palette: Palette, gauge_mm: float
) -> tuple[float, tuple[str, ...]]:
    if rate_mm_s is not None:
        return rate_mm_s, ()
    per_s = palette.reference.strain_rate_per_s
    if per_s is not None and per_s > 0.0:
        return per_s * gauge_mm, ()
    return _UNKNOWN_RATE_PER_S * gauge_mm, (
        f"palette {palette.name} names no strain rate; times are those of "
        f"{_UNKNOWN_RATE_PER_S:g} /s",
    )
