"""Made-up fingers whose effect is withheld: campaigns of whole parts, bent and stretched.

What the fingers really do is the solid solved anew, with other laws at every condition: nothing of
it comes of the shares that the diagnosis goes by. Courses of the effects are none of its forms.
Solving takes ten minutes, so that `tests/data/fingers` holds what it gives: responses, and forces
over displacements; `python -m benchmarks.withheld.fingers PLAN` solves anew and diagnoses.
"""

import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.interpolate import PchipInterpolator

from planner.gap.campaign import Campaign, PartTest, Specimen
from planner.gap.diagnose import diagnose
from planner.materials.marlow import MarlowTable, marlow_table
from planner.materials.mixtures import CoefficientModel
from planner.numerics import FloatArray, IntArray
from planner.palette import load_palette
from planner.simulation.loads import LoadCase
from planner.simulation.part import open_solid
from planner.simulation.part_response import PartResponse
from planner.simulation.response import followed, loaded_part, response_of

ROOT = Path(__file__).resolve().parents[2]
PALETTE = ROOT / "printers/connex3/palettes/connex3-tango-vero.toml"
FOLDER = ROOT / "tests/data/fingers"

LOADED = {
    "stretched": ("x=max", "x=min: -6,0,0 mm"),
    "bent": ("x=max", "x=min: 0,0,-10 mm"),
    "pressed": ("z=min", "z>17: 0,0,-1 mm"),
}
"""What holds it, and what moves."""

CELL_MM = 4.0
STEPS = (0.02, 0.1, 0.25, 0.5, 0.75, 1.0)

TEMPERATURES_C = (15.0, 23.0, 32.0)
RATES_mm_s = (0.1, 1.0, 10.0)
USUAL_mm_s = 1.0
EFFECTS = ("temperature", "machine-compliance", "rate")


# ------------------------------------------------------------------------------------------------
# What the fingers really do.


def softer(coordinate: FloatArray, temperature_C: float) -> FloatArray:
    """Change of ln stress by a glass transition that lies the higher the harder the mixture."""
    middle_C, width_K = 10.0 + 30.0 * coordinate, 22.0
    fallen = [np.tanh((t - middle_C) / width_K) for t in (temperature_C, 23.0)]
    return np.asarray(-0.45 * (fallen[0] - fallen[1]))


def stiffer(coordinate: FloatArray, rate_per_s: FloatArray) -> FloatArray:
    """Change of ln stress where a point is strained at a rate: Cowper and Symonds' law."""
    power, scale = 0.25, 0.35 + 0.25 * coordinate
    now, then = ((r / 0.1) ** power for r in (np.maximum(rate_per_s, 1e-6), 0.034))
    return np.asarray(np.log1p(scale * now) - np.log1p(scale * then))


def lost_mm(force_N: FloatArray) -> FloatArray:
    """Travel that frame and grips take."""
    return 0.004 * force_N + 0.15 * -np.expm1(-force_N / 25.0)


@dataclass(frozen=True, slots=True, eq=False)
class _Scaled(MarlowTable):
    """Laws of which every point has its own multiple; blocks of nodes, one a multiple."""

    below: IntArray
    share: FloatArray

    def places(self, coordinate: FloatArray) -> tuple[IntArray, FloatArray]:
        return self.below, self.share


_MULTIPLES = 33


def _scaled(table: MarlowTable, coordinate: FloatArray, change: FloatArray) -> MarlowTable:
    """Return laws by a change of ln stress at each point, (Q,), to a thirty-second of its range."""
    levels = np.linspace(change.min(), change.max() + 1e-9, _MULTIPLES)
    level = np.rint((change - levels[0]) / (levels[1] - levels[0])).astype(np.int64)
    below, share = table.places(coordinate)
    nodes = len(table.coordinate)
    tables = np.concatenate([table.log_slope_MPa] * _MULTIPLES)
    tables[..., 0] += np.repeat(levels, nodes)[:, None]
    energy = np.concatenate([table.energy_MPa * np.exp(v) for v in levels])
    return _Scaled(
        np.tile(table.coordinate, _MULTIPLES), table.step, tables, energy,
        np.tile(table.break_strain, _MULTIPLES), below + nodes * level, share,
    )  # fmt: skip


# ------------------------------------------------------------------------------------------------
# Solve the fingers anew, with the laws that they really have.


def solve(plan: Path, folder: Path) -> None:
    """Write responses and truths into a folder.

    Parameters
    ----------
    plan
        ``planner grade samples/finger.stl --axis x --from FLX9740 --to FLX9785``.
    """
    palette = load_palette(PALETTE)
    table = marlow_table(CoefficientModel(palette))
    folder.mkdir(parents=True, exist_ok=True)
    solid = open_solid(plan, None, None, None, palette)
    truths: dict[str, list[list[float]]] = {}
    for name, (fix, move) in LOADED.items():
        part = loaded_part(solid, LoadCase(fix=fix, move=move), cell_mm=CELL_MM)
        moved = followed(part, table, STEPS)
        response = replace(response_of(part, moved, log_sd=0.02), name=f"finger {name}")
        (folder / f"{name}.json").write_bytes(response.encode())
        changes = {f"{name}, {at:g} C": softer(part.coordinate, at) for at in TEMPERATURES_C}
        for rate in RATES_mm_s:
            # Points are strained in the proportion in which they are at last.
            own = moved.strain[-1] * rate / moved.displacement_mm[-1]
            changes[f"{name}, {rate:g} mm/s"] = stiffer(part.coordinate, own)
        for condition, change in changes.items():
            found = followed(part, _scaled(table, part.coordinate, change), STEPS, sensitive=False)
            curve = (found.displacement_mm, found.force_N)
            truths[condition] = [[float(f"{v:.7g}") for v in row] for row in curve]
            print(condition, truths[condition][1][-1], flush=True)
    text = json.dumps(truths, indent=1)
    (folder / "truths.json").write_text(text + "\n", encoding="utf-8")


# ------------------------------------------------------------------------------------------------
# Campaigns of them.


SCATTER, SENSOR = 0.025, 0.001
"""From finger to finger, of ln force; and of the load cell, of the largest force."""

BATCH, SLOPE, WANDER, WAVES = 0.4, 0.4, 0.1, 6
"""Of the scatter: what a batch has in common, tilts, and comes and goes in waves along a curve."""

REPLICATES = 3


def campaign(effect: str, seed: int) -> Campaign:
    """Return a campaign of fingers at all temperatures and rates with one effect at work."""
    rng = np.random.default_rng(seed)
    palette = load_palette(PALETTE)
    truths = json.loads((FOLDER / "truths.json").read_text(encoding="utf-8"))
    specimens, batches = [], rng.standard_normal(2)
    for name, (fix, move) in LOADED.items():
        response = PartResponse.read(FOLDER / f"{name}.json")
        part = PartTest(response, fix, move)
        end_mm = 0.97 * float(response.displacement_mm[-1])
        conditions = [(t, USUAL_mm_s) for t in TEMPERATURES_C]
        conditions += [(23.0, rate) for rate in RATES_mm_s if rate != USUAL_mm_s]
        for number, (at, rate) in enumerate(conditions * REPLICATES):
            travel = np.linspace(0.0, end_mm, 150)
            force = _force(truths, name, effect, at, rate, travel)
            level, slope = rng.standard_normal(2)
            place = travel / end_mm
            waves = rng.standard_normal(WAVES) @ np.cos(np.pi * np.outer(np.arange(WAVES), place))
            parts = (level + BATCH * batches[number % 2], SLOPE * slope * (place - 0.5))
            force = force * np.exp(SCATTER * (sum(parts) + WANDER * waves))
            force = force + SENSOR * force.max() * rng.standard_normal(len(force))
            specimens.append(
                Specimen(
                    id=f"{name[0].upper()}{number:02d}", time_s=travel / rate,
                    displacement_mm=travel, force_N=force, gauge_mm=response.gauge_mm, part=part,
                    rate_mm_s=rate, temperature_C=at, soak_h=0.0, age_days=9.0, orientation="x",
                    protocol="monotonic", batch="AB"[number % 2],
                )
            )  # fmt: skip
    return Campaign(f"fingers, {effect} withheld", "connex3", palette, tuple(specimens))


def _force(
    truths: Mapping[str, Sequence[Sequence[float]]], name: str, effect: str, temperature_C: float,
    rate_mm_s: float, travel_mm: FloatArray,
) -> FloatArray:  # fmt: skip
    """Return what a finger really bears at what the crosshead travels."""
    condition = f"{name}, 23 C"
    if effect == "temperature":
        condition = f"{name}, {temperature_C:g} C"
    elif effect == "rate":
        condition = f"{name}, {rate_mm_s:g} mm/s"
    at, force = np.array(truths[condition])
    # Force over travel is smooth at rest.
    stiffness = PchipInterpolator(at, force / at)
    moved = np.maximum(np.linspace(0.0, float(at[-1]), 2000), 0.0)
    bears = moved * stiffness(np.maximum(moved, at[0]))
    crosshead = moved + (lost_mm(bears) if effect == "machine-compliance" else 0.0)
    return np.asarray(np.interp(travel_mm, crosshead, bears))


if __name__ == "__main__":
    if len(sys.argv) > 1:
        solve(Path(sys.argv[1]), FOLDER)
    for hidden in EFFECTS:
        found = diagnose(campaign(hidden, 1))
        ranking = ", ".join(f"{h.name} {h.probability:.2f}" for h in found.ranking[:4])
        print(f"{hidden}: {found.verdict} ({ranking}); {found.gap}")
