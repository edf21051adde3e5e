"""What the operator reads beside the files: the printer's steps, and what is true of this plan."""

import math
from collections.abc import Sequence

import numpy as np

from planner.formats.markdown import as_words
from planner.grading.coupons import coupon_volume_mm3
from planner.grading.profile import StiffnessScale
from planner.mesh.mesh import Mesh
from planner.plan import Finding
from planner.printers import Printer
from planner.voxels.columns import voxelize

__all__ = ["job_notes", "tray_notes"]


def job_notes(
    machine: Printer,
    scale: StiffnessScale,
    *,
    tray: Sequence[str],
    resins: Sequence[str],
    findings: Sequence[Finding],
    warnings: Sequence[str],
) -> str:
    """Return the printer's how-to (Markdown), with what of it depends on palette and part.

    Parameters
    ----------
    tray
        Of `tray_notes`.
    resins
        What the plan's materials are jetted from.
    findings
        What will not come out as planned; told as they are.
    warnings
        What to know of the stiffness of the materials used.
    """
    palette = scale.palette
    lines = [
        machine.job_notes().rstrip(),
        "",
        "## This plan",
        "",
        f"- Resins to load: {', '.join(f'**{as_words(resin)}**' for resin in resins)}; support "
        f"{as_words(machine.support)}.",
        *(f"- {said}" for said in tray),
        f"- Palette {as_words(palette.name)}: {as_words(_conditions(scale))}.",
        *(f"- {_sentence(warning)}" for warning in warnings),
    ]
    if findings:
        lines += ["", "What will not come out as planned:", ""]
        lines += [f"- {_sentence(found.message)}" for found in findings]
    return "\n".join(lines) + "\n"


def tray_notes(machine: Printer, placed: Mesh, coupons: int) -> list[str]:
    """Return what the job takes of the printer, a sentence each.

    Parameters
    ----------
    placed
        The part as it lies in the files, z up.
    coupons
        How many test coupons lie beside it.
    """
    height_mm = float(np.ptp(placed.bounds_mm[:, 2]))
    layers = math.ceil(height_mm / machine.layer_mm - 1e-6)
    support_mm3 = _beneath_mm3(placed)
    said = [
        f"Height as the part lies in the files, z up: {height_mm:.4g} mm, {layers} layers of "
        f"{1000.0 * machine.layer_mm:g} um.",
        f"Support that fills what is open beneath the part: about {support_mm3 / 1000.0:#.2g} cm3 "
        f"of {as_words(machine.support)}; the printer's software says how much it adds around it.",
    ]
    if coupons:
        said.append(
            f"{coupons} test coupons, one of each material, {coupon_volume_mm3() / 1000.0:.1f} cm3 "
            "each, lie beside the part: insert the STL files of `coupons/` into the same assembly, "
            "give each the material of its name, and pull them when the part is tested; "
            "`coupons/specimens.csv` lists them."
        )
    return said


_COLUMNS_ACROSS = 256  # of the longest side: as coarse as the figure that is told


def _beneath_mm3(placed: Mesh) -> float:
    """Return the open volume under a part's roofs, down to the part or to the tray."""
    columns = voxelize(placed, float(np.ptp(placed.bounds_mm, axis=0).max()) / _COLUMNS_ACROSS)
    filled = np.flatnonzero(np.diff(columns.offsets))
    roofs = columns.stop[columns.offsets[filled + 1] - 1]
    open_voxels = int(roofs.sum(dtype=np.int64)) - columns.voxels
    return open_voxels * columns.grid.voxel_mm3


def _conditions(scale: StiffnessScale) -> str:
    """Say how the palette's materials were measured."""
    reference = scale.palette.reference
    soaked = "after {:g} h in water" if reference.soak_h else "without soaking"
    stated = (
        ("at {:g} degC", reference.temperature_C),
        ("at a strain rate of {:g} per s", reference.strain_rate_per_s),
        ("{:g} days after printing", reference.age_days),
        (soaked, reference.soak_h),
        ("with the gauge along {} of the tray", reference.orientation),
    )
    said = ", ".join(text.format(value) for text, value in stated if value is not None)
    if not said:
        return "it does not say how its materials were measured"
    return f"its materials were measured {said}; otherwise they are stiffer or softer"


def _sentence(text: str) -> str:
    text = as_words(text)
    return text[:1].upper() + text[1:] + ("" if text.endswith(".") else ".")
