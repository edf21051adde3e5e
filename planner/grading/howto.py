"""What the operator gets beside the shells: the how-to of this plan, and test coupons."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import PurePosixPath

import numpy as np

from planner.errors import ArgumentError
from planner.formats.mesh_file import encode_stl
from planner.formats.tables import encode_csv
from planner.glance import as_words, counted
from planner.grading.profile import StiffnessScale
from planner.mesh.mesh import Mesh
from planner.numerics import FloatArray
from planner.plan import Plan, Shell
from planner.printers import Printer
from planner.voxels.columns import voxelize

__all__ = ["with_howto"]


def with_howto(
    plan: Plan,
    placed: Mesh,
    machine: Printer,
    scale: StiffnessScale,
    warnings: Sequence[str],
    *,
    coupons: bool,
) -> Plan:
    """Return a plan with the printer's how-to (Markdown), and test coupons where they are asked.

    Parameters
    ----------
    placed
        The part as it lies in the files, z up.
    warnings
        What to know of the stiffness of the materials used.

    Raises
    ------
    ArgumentError
        The tray does not hold the coupons beside the part.
    """
    laid = _coupons_beside(plan.shells, placed.bounds_mm, machine) if coupons else {}
    resins = plan.shells[0].properties["base_resins"].split(", ")
    lines = [
        machine.job_notes().rstrip(),
        "",
        "## This plan",
        "",
        f"- Resins to load: {', '.join(f'**{as_words(resin)}**' for resin in resins)}; support "
        f"{as_words(machine.support)}.",
        *(f"- {said}" for said in _tray_notes(machine, placed, len(plan.shells) if laid else 0)),
        f"- Palette {as_words(scale.palette.name)}: {as_words(_conditions(scale))}.",
        *(f"- {_sentence(warning)}" for warning in warnings),
    ]
    if plan.findings:
        lines += ["", "What will not come out as planned:", ""]
        lines += [f"- {_sentence(found.message)}" for found in plan.findings]
    return replace(plan, notes="\n".join(lines) + "\n", coupons=laid)


def _tray_notes(machine: Printer, placed: Mesh, coupons: int) -> list[str]:
    """Return what the job takes of the printer, with so many test coupons, a sentence each."""
    height_mm = float(np.ptp(placed.bounds_mm[:, 2]))
    layers = max(math.ceil(height_mm / machine.layer_mm - 1e-3), 1)  # files round to float32
    support_mm3 = _beneath_mm3(placed)
    said = [
        f"Height as the part lies in the files, z up: {height_mm:.4g} mm, "
        f"{counted(layers, 'layer')} of {1000.0 * machine.layer_mm:g} um.",
        f"Support that fills what is open beneath the part: about {support_mm3 / 1000.0:#.2g} cm3 "
        f"of {as_words(machine.support)}; the printer's software says how much it adds around it.",
    ]
    if coupons:
        each_cm3 = _coupon_mesh().volume_mm3 / 1000.0
        said.append(
            f"{coupons} test coupons, one of each material, {each_cm3:.1f} "
            "cm3 each, lie beside the part: insert the STL files of `coupons/` into the same "
            "assembly, give each the material of its name, and pull them when the part is tested; "
            "`coupons/specimens.csv` lists them."
        )
    return said


_COLUMNS_ACROSS = 256  # of the longest side: as coarse as the figure that is told


def _beneath_mm3(placed: Mesh) -> float:
    """Return the open volume under a part's roofs, down to the part or to the tray."""
    columns = voxelize(placed, float(np.ptp(placed.bounds_mm, axis=0).max()) / _COLUMNS_ACROSS)
    roofs = columns.stop[columns.offsets[np.flatnonzero(np.diff(columns.offsets)) + 1] - 1]
    return (int(roofs.sum(dtype=np.int64)) - columns.voxels) * columns.grid.voxel_mm3


def _conditions(scale: StiffnessScale) -> str:
    """Say how the palette's materials were measured."""
    reference = scale.palette.reference
    stated = (
        ("at {:g} degC", reference.temperature_C),
        ("at a strain rate of {:g} per s", reference.strain_rate_per_s),
        ("{:g} days after printing", reference.age_days),
        ("after {:g} h in water" if reference.soak_h else "without soaking", reference.soak_h),
        ("with the gauge along {} of the tray", reference.orientation),
    )
    said = ", ".join(text.format(value) for text, value in stated if value is not None)
    if not said:
        return "it does not say how its materials were measured"
    return f"its materials were measured {said}; otherwise they are stiffer or softer"


def _sentence(text: str) -> str:
    text = as_words(text)
    return text[:1].upper() + text[1:] + ("" if text.endswith(".") else ".")


# ------------------------------------------------------------------------------------------------
# Test coupons beside a part on the tray: one of each material, printed in the same job.


_COUPONS = "coupons/"
"""Where they are in a plan's folder."""

# ASTM D638-14, figure 1, type IV, at most 4 mm thick: lengths in mm.
_LENGTH, _GRIP_WIDTH, _WIDTH, _NARROW, _THICKNESS = 115.0, 19.0, 6.0, 33.0, 4.0
_INNER_RADIUS, _OUTER_RADIUS = 14.0, 25.0
_ARC_STEPS = 16  # chords 7 um inside the arcs
_APART = 5.0  # chosen: room for a spatula


def _coupons_beside(
    shells: Sequence[Shell], bounds_mm: FloatArray, machine: Printer
) -> dict[str, bytes]:
    """Lay a tensile coupon of each shell's material flat beside a part, gauge along x.

    They are in the coordinates of the part's bounds, (2, 3). Returned are an STL a coupon by its
    path in the plan's folder, and the list of specimens to fill in.
    """
    low_mm, high_mm = bounds_mm.tolist()
    x, y = low_mm[0], high_mm[1] + _APART
    coupon = _coupon_mesh()
    files: dict[str, bytes] = {}
    rows: list[list[str | float]] = [
        ["specimen", "material", "width_mm", "thickness_mm", "gauge_mm", "orientation"]
    ]
    for shell in shells:
        if y + _GRIP_WIDTH - low_mm[1] > machine.tray_mm[1]:
            x, y = max(x + _LENGTH, high_mm[0]) + _APART, low_mm[1]
        if x + _LENGTH - low_mm[0] > machine.tray_mm[0] or machine.tray_mm[1] < _GRIP_WIDTH:
            raise ArgumentError(
                f"`coupons`: {len(shells)} coupons of {_LENGTH:g} x {_GRIP_WIDTH:g} mm do not fit "
                f"beside the part on the tray of {machine.title}; leave `coupons` out, and print "
                "them in a job of their own"
            )
        placed = coupon.vertices.astype(np.float32) + np.array([x, y, low_mm[2]], dtype=np.float32)
        name = PurePosixPath(shell.file).name.replace("__", "__coupon_", 1)
        files[_COUPONS + name] = encode_stl(
            placed, coupon.faces, f"coupon {shell.operator_name} unit=mm"
        )
        rows.append([shell.material, shell.material, _WIDTH, _THICKNESS, _NARROW, "x"])
        y += _GRIP_WIDTH + _APART
    return {**files, f"{_COUPONS}specimens.csv": encode_csv(rows)}


def _coupon_mesh() -> Mesh:
    """Return a closed dumbbell whose corner of least coordinates is the origin."""
    x, half = _outline()
    n = len(x)
    across = np.stack([-half, half], axis=1)[:, :, None] + _GRIP_WIDTH / 2
    corners = np.empty((n, 2, 2, 3))  # station, side, bottom and top
    corners[..., 0], corners[..., 1], corners[..., 2] = x[:, None, None], across, [0.0, _THICKNESS]
    # The four corners of a station, counter-clockwise as seen from its end.
    ring = np.array([0, 2, 3, 1])
    at = 4 * np.arange(n - 1)[:, None]
    a, b = at + ring, at + np.roll(ring, -1)
    walls = np.stack([a, a + 4, b + 4, a, b + 4, b], axis=-1).reshape(-1, 3)
    first = np.array([[0, 2, 3], [0, 3, 1]])
    last = (first + 4 * (n - 1))[:, ::-1]
    faces = np.concatenate([walls, first, last])[:, ::-1]
    return Mesh(corners.reshape(-1, 3), faces.astype(np.int32))


def _outline() -> tuple[FloatArray, FloatArray]:
    """Return stations along the coupon and its half width there."""
    y_inner = _WIDTH / 2 + _INNER_RADIUS
    y_outer = _GRIP_WIDTH / 2 - _OUTER_RADIUS
    x_inner = _NARROW / 2
    x_outer = x_inner + math.sqrt((_INNER_RADIUS + _OUTER_RADIUS) ** 2 - (y_inner - y_outer) ** 2)
    bend = math.atan2(y_outer - y_inner, x_outer - x_inner)  # where the arcs touch
    up = np.linspace(-math.pi / 2, bend, _ARC_STEPS)
    over = np.linspace(bend + math.pi, math.pi / 2, _ARC_STEPS)[1:]
    arcs = ((x_inner, y_inner, _INNER_RADIUS, up), (x_outer, y_outer, _OUTER_RADIUS, over))
    x = np.concatenate([*(at + r * np.cos(turn) for at, _, r, turn in arcs), [_LENGTH / 2]])
    half = np.concatenate([*(y + r * np.sin(turn) for _, y, r, turn in arcs), [_GRIP_WIDTH / 2]])
    return np.concatenate([-x[::-1], x]) + _LENGTH / 2, np.concatenate([half[::-1], half])
