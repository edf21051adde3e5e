"""Make the synthetic tensile study in this folder: three materials, three specimens each.

Nothing here was measured. The curves come from the formulas below with seeded noise, so that
commands and tests have something to read of which the truth is known. The soft material's files
are laid out as Mark-10 MESURgauge writes them, the medium one's as Instron Bluehill, the rigid
one's as plain CSV.

Run it with the folder to write to, this one by default: python samples/tensile/make_study.py
"""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

WIDTH_MM, THICKNESS_MM, GAUGE_MM, RATE_MM_S = 3.0, 2.0, 15.0, 1.0
PERIOD_S = {"soft": 0.1, "medium": 0.1, "rigid": 0.02}
SOFT_MU_MPA, SOFT_BREAK = 0.2, 1.6  # neo-Hookean, Young's modulus 3 mu = 0.6 MPa
MEDIUM_MU_MPA, MEDIUM_ALPHA, MEDIUM_BREAK = 1.2, 3.0, 0.7  # Ogden, 1.5 mu alpha = 5.4 MPa
RIGID_MODULUS_MPA, RIGID_YIELD_MPA, RIGID_BREAK, RIGID_TOE = 400.0, 30.0, 0.25, 0.008
SPREAD = 0.04  # of stiffness between specimens
NOISE_N = {"soft": 0.02, "medium": 0.05, "rigid": 0.4}

NOTICE = "synthetic data; not measured"


def soft(strain: Array) -> Array:
    """Nominal stress of an incompressible neo-Hookean bar in tension."""
    stretch = 1.0 + strain
    return SOFT_MU_MPA * (stretch - stretch**-2.0)


def medium(strain: Array) -> Array:
    """Nominal stress of a one-term Ogden bar in tension."""
    stretch, a = 1.0 + strain, MEDIUM_ALPHA
    return MEDIUM_MU_MPA * (stretch ** (a - 1.0) - stretch ** (-a / 2.0 - 1.0))


def rigid(strain: Array) -> Array:
    """Nominal stress with a quadratic toe, a line, a rounded yield and a slow fall behind it."""
    x = np.where(strain < 2 * RIGID_TOE, strain**2 / (4 * RIGID_TOE), strain - RIGID_TOE)
    line, knee = RIGID_MODULUS_MPA * x, 0.7 * RIGID_YIELD_MPA
    width = RIGID_YIELD_MPA - knee
    rounded = np.where(line < knee, line, knee + width * np.tanh((line - knee) / width))
    return rounded - 25.0 * np.maximum(x - 0.13, 0.0)


def record(
    material: str, law: Callable[[Array], Array], at_break: float, rng: np.random.Generator
) -> tuple[Array, Array, Array]:
    """Time (s), displacement (mm) and force (N) up to break, and the broken specimen's tail."""
    at_break *= 1.0 + SPREAD * rng.standard_normal()
    time = np.arange(0.0, at_break * GAUGE_MM / RATE_MM_S + 0.8, PERIOD_S[material])
    displacement = RATE_MM_S * time
    strain = displacement / GAUGE_MM
    stiffness = 1.0 + SPREAD * rng.standard_normal()
    force = stiffness * law(strain) * WIDTH_MM * THICKNESS_MM
    force = np.where(strain <= at_break, force, 0.0) + NOISE_N[material] * rng.standard_normal(
        len(time)
    )
    return time, displacement, force


def mark10(columns: tuple[Array, Array, Array]) -> str:
    """Lay a record out as MESURgauge does: units in the head, tab-separated."""
    lines = [NOTICE, "Units: N", "Readings: Continuous", "X-Axis: Travel", "Travel Unit: mm",
             "Reading\tLoad\tTravel\tTime"]  # fmt: skip
    rows = zip(*columns, strict=True)
    lines += [f"{n}\t{f:.3f}\t{d:.3f}\t{t:.3f}" for n, (t, d, f) in enumerate(rows, start=1)]
    return "\r\n".join(lines) + "\r\n"


def bluehill(columns: tuple[Array, Array, Array], name: str) -> str:
    """Lay a record out as Bluehill does: parameters, headings, a row of units, all quoted."""
    lines = [
        f'"General : Comment","{NOTICE}"',
        f'"General : Specimen label","{name}"',
        f'"Dimension : Width","{WIDTH_MM:.2f}","mm"',
        f'"Dimension : Thickness","{THICKNESS_MM:.2f}","mm"',
        "",
        '"Time","Extension","Load"',
        '"(s)","(mm)","(kN)"',
    ]
    rows = zip(*columns, strict=True)
    lines += [f'"{t:.3f}","{d:.4f}","{f / 1000:.7f}"' for t, d, f in rows]
    return "\r\n".join(lines) + "\r\n"


def plain(columns: tuple[Array, Array, Array]) -> str:
    """Lay a record out as plain CSV with units in the headings, inches and pounds."""
    rows = zip(*columns, strict=True)
    lines = ["Time (s),Position (in),Load (lbf)"]
    lines += [f"{t:.3f},{d / 25.4:.6f},{f / 4.4482216152605:.5f}" for t, d, f in rows]
    return "\n".join(lines) + "\n"


def study() -> dict[str, str]:
    """Return the texts of the study by file name."""
    rng = np.random.default_rng(20170814)
    files = {}
    rows = [
        "specimen,material,file,width_mm,thickness_mm,gauge_mm,rate_mm_s,temperature_C,"
        "orientation,protocol,coordinate,comment"
    ]
    for material, law, at_break, suffix, coordinate in (
        ("soft", soft, SOFT_BREAK, ".txt", 0.0),
        ("medium", medium, MEDIUM_BREAK, ".csv", 0.5),
        ("rigid", rigid, RIGID_BREAK, ".csv", 1.5),
    ):
        for number in (1, 2, 3):
            name = f"{material}-{number}"
            columns = record(material, law, at_break, rng)
            text = {
                "soft": mark10(columns),
                "medium": bluehill(columns, name),
                "rigid": plain(columns),
            }[material]
            files[name + suffix] = text
            rows.append(
                f"{name},SYN-{material},{name}{suffix},{WIDTH_MM:g},{THICKNESS_MM:g},"
                f"{GAUGE_MM:g},{RATE_MM_S:g},23,x,monotonic,{coordinate:g},{NOTICE}"
            )
    files["specimens.csv"] = "\n".join(rows) + "\n"
    return files


def main() -> None:
    """Write the study."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent
    for name, text in study().items():
        (folder / name).write_text(text, encoding="utf-8", newline="")


if __name__ == "__main__":
    main()
