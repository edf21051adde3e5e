"""Rewrite the tables of agilus-numbers.md: ``python docs/explanation/agilus_numbers.py``."""

import math
from pathlib import Path

from thesis_numbers import with_tables

from planner.materials.mixtures import CoefficientModel
from planner.palette import parse_palette
from printers.connex3.agilus import Reading, load_sources, rigid_readings, rubber_readings
from printers.connex3.derive_agilus import PALETTE, rubber_votes

PAGE = Path(__file__).parent / "agilus-numbers.md"
SOURCES = load_sources()
RUBBERS, RIGID = rubber_readings(SOURCES), rigid_readings(SOURCES)
MODEL = CoefficientModel(parse_palette(PALETTE.read_bytes(), name=PALETTE.stem))


def figure(value: float) -> str:
    """Return three digits, without an exponent."""
    return f"{round(value, -1):.0f}" if value >= 1000.0 else f"{value:.3g}"


def span(low: float, high: float) -> str:
    """Return one figure, or two where they differ."""
    ends = figure(low), figure(high)
    return ends[0] if ends[0] == ends[1] else " to ".join(ends)


def linked(reading: Reading) -> str:
    """Return the source, as a link where it has an address of its own."""
    web = reading.address.startswith("http")
    return f"[{reading.source}]({reading.address})" if web else reading.source


def tables() -> dict[str, list[list[str]]]:
    """Return the page's tables by name: a heading row, then the rows."""
    readings = [["source", "material", "Shore A", "MPa", "over Gent's", "the source's mean"]]
    votes = rubber_votes(RUBBERS)
    for r in RUBBERS:
        vote = f"{math.exp(votes[r.source]):.2f}"
        readings.append(
            [
                linked(r),
                r.material,
                f"{r.shore_A:g}",
                span(r.low_MPa, r.high_MPa),
                f"{r.of_gent:.2f}",
                vote,
            ]
        )
    rigid = [["source", "material", "MPa"]]
    rigid += [[linked(r), r.material, span(r.low_MPa, r.high_MPa)] for r in RIGID]
    grades = [["grade", "Shore A", "at 10 %, MPa", "95 %", "readings of that hardness", "break"]]
    for entry, material in zip(SOURCES.material, MODEL.palette.materials, strict=True):
        low, high = MODEL.modulus_interval_MPa(material.coordinate, SOURCES.test.at_strain)
        hardness = f"{entry.shore_A:g}" if material.deformation == "elastic" else ""
        found = [r for r in RUBBERS if abs(r.shore_A - entry.shore_A) <= 3.0] if hardness else RIGID
        ends = [r.low_MPa for r in found] + [r.high_MPa for r in found]
        grades.append(
            [
                material.id,
                hardness,
                figure(float(MODEL.modulus_MPa(material.coordinate, SOURCES.test.at_strain))),
                span(float(low), float(high)),
                span(min(ends), max(ends)),
                f"{100 * material.elongation_at_break:.0f} %",
            ]
        )
    stamp, time_s = SOURCES.stamp, SOURCES.test.time_s
    voxels = [["Agilus30 by volume", *(f"{t} °C" for t in (20, 23, 26))]]
    for mixture in stamp.relaxation:
        voxels.append(
            [
                f"{100 * mixture.agilus_share:.3g} %",
                *(figure(mixture.secant_MPa(time_s, t, stamp.wlf)) for t in (20.0, 23.0, 26.0)),
            ]
        )
    return {"readings": readings, "rigid": rigid, "grades": grades, "voxels": voxels}


if __name__ == "__main__":
    text = with_tables(PAGE.read_text(encoding="utf-8"), tables())
    PAGE.write_text(text, encoding="utf-8", newline="\n")
