"""Characteristics as files: a CSV table, one row a material, and a JSON document."""

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from planner.errors import OutputError
from planner.materials.characterise import MaterialCharacteristics, Spread

__all__ = ["characteristics_csv", "characteristics_document", "write_characteristics"]

_DIGITS = 9


def characteristics_csv(materials: Sequence[MaterialCharacteristics]) -> str:
    """Return the table: material, specimens, deformation, then mean, sd, cv and 95 % interval.

    The columns of a figure `modulus_MPa` are modulus_MPa, modulus_sd_MPa, modulus_cv,
    modulus_low_MPa, modulus_high_MPa and modulus_n (how many specimens have the figure: a
    secant beyond break is none). Numbers have nine significant digits; an empty cell means unknown.
    """
    names = list(dict.fromkeys(name for m in materials for name in m.spreads))
    header = ["material", "specimens", "deformation"]
    for name in names:
        header += _columns(name)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    for material in materials:
        row = [material.material, str(material.n), material.deformation.kind]
        for name in names:
            row += _cells(material.spreads.get(name))
        writer.writerow(row)
    return text.getvalue()


def characteristics_document(
    materials: Sequence[MaterialCharacteristics], notes: Sequence[str]
) -> dict[str, Any]:
    """Return the figures of materials and specimens as plain values, unrounded."""
    return {
        "schema": 1,
        "materials": [
            {
                "material": m.material,
                "deformation": m.deformation.kind,
                "deformation_reason": m.deformation.reason,
                "specimens_agree": m.agree,
                "figures": {
                    name: {
                        "mean": s.mean,
                        "sd": s.sd,
                        "cv": s.cv,
                        "interval": None if s.interval is None else [*s.interval],
                        "n": s.n,
                    }
                    for name, s in m.spreads.items()
                },
                "specimens": [
                    {
                        "specimen": c.specimen,
                        "modulus_MPa": c.modulus_MPa,
                        "modulus_uncompensated_MPa": c.modulus_uncompensated_MPa,
                        "linear_strain": [*c.linear_strain],
                        "toe_strain": c.toe_strain,
                        "toughness_MJ_m3": c.toughness_MJ_m3,
                        "elongation_at_break": c.elongation_at_break,
                        "strength_MPa": c.strength_MPa,
                        "secant_MPa": {f"{k:g}": v for k, v in c.secant_MPa.items()},
                        "yield_strain": c.yield_strain,
                        "deformation": c.deformation.kind,
                    }
                    for c in m.specimens
                ],
            }
            for m in materials
        ],
        "notes": [*notes, *(note for m in materials for c in m.specimens for note in c.notes)],
    }


def write_characteristics(
    materials: Sequence[MaterialCharacteristics], path: str | Path, *, force: bool = False
) -> None:
    """Write the CSV table, whole or not at all.

    Raises
    ------
    OutputError
        The file is there already and `force` is false, or cannot be written.
    """
    path = Path(path)
    if path.exists() and not force:
        raise OutputError(f"{path}: exists already; replace it with --force, or name another file")
    partial = path.with_name(f".{path.name}.partial")
    try:
        partial.write_text(characteristics_csv(materials), encoding="utf-8", newline="")
        partial.replace(path)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise OutputError(
            f"{path}: cannot be written ({error.strerror or error}); choose another place"
        ) from error


def _columns(name: str) -> list[str]:
    stem, unit = name, ""
    for ending in ("_MPa", "_MJ_m3"):
        if name.endswith(ending):
            stem, unit = name.removesuffix(ending), ending
    return [name, f"{stem}_sd{unit}", f"{stem}_cv", f"{stem}_low{unit}", f"{stem}_high{unit}",
            f"{stem}_n"]  # fmt: skip


def _cells(figure: Spread | None) -> list[str]:
    if figure is None:
        return ["", "", "", "", "", "0"]
    low, high = (None, None) if figure.interval is None else figure.interval
    return [
        *("" if v is None else f"{v:.{_DIGITS}g}" for v in (figure.mean, figure.sd, figure.cv)),
        *("" if v is None else f"{v:.{_DIGITS}g}" for v in (low, high)),
        str(figure.n),
    ]
