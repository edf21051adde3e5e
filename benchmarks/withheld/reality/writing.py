"""A campaign's folder, as the contract (section 4) has it."""

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from benchmarks.withheld.reality.campaign import Campaign

__all__ = ["campaign_files", "write_campaign"]

_COLUMNS = (
    *("specimen", "material", "profile", "width_mm", "thickness_mm", "gauge_mm", "rate_mm_s"),
    *("temperature_C", "soak_h", "age_days", "orientation", "protocol", "batch"),
    *("operator", "tray_x_mm"),
)


def write_campaign(campaign: Campaign, folder: Path) -> None:
    """Write the campaign's files into a new folder."""
    for name, text in campaign_files(campaign).items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8", newline="")


def campaign_files(campaign: Campaign) -> Mapping[str, str]:
    """Return the files' texts by name; specimens stand in the order of their random ids."""
    order = np.argsort(campaign.specimen_ids)
    design = campaign.design
    rows = []
    for i in order:
        bar = design.profile[i] >= 0
        rows.append(
            [
                campaign.specimen_ids[i],
                design.material[i],
                f"profiles/P{design.profile[i] + 1}.csv" if bar else "",
                *(f"{column[i]:g}" for column in (design.width_mm, design.thickness_mm)),
                *(f"{column[i]:g}" for column in (design.gauge_mm, design.rate_mm_s)),
                *(f"{column[i]:g}" for column in (design.temperature_C, design.soak_h)),
                f"{design.age_days[i]:g}",
                *(str(c[i]) for c in (design.orientation, design.protocol, design.batch)),
                design.operator[i],
                f"{design.tray_x_mm[i]:g}",
            ]
        )
    files = {
        "campaign.toml": (
            f'schema = 1\nname = "{campaign.name}"\nprinter = "connex3"\npalette = "palette.toml"\n'
        ),
        "palette.toml": campaign.palette_toml,
        "specimens.csv": _csv(_COLUMNS, rows),
        "curves.csv": _lines("specimen,time_s,displacement_mm,force_N", _curve_rows(campaign)),
    }
    if campaign.fields:
        head = "specimen,time_s,x_mm,strain" + ("" if campaign.facet_mm is None else ",facet_mm")
        files["fields.csv"] = _lines(head, _field_rows(campaign))
    for number in np.unique(design.profile[design.profile >= 0]):
        profile = design.profiles[number]
        points = zip(profile.x_mm, profile.coordinate, strict=True)
        files[f"profiles/P{number + 1}.csv"] = _lines(
            "x_mm,coordinate", (f"{x:.3f},{m:.6f}" for x, m in points)
        )
    return files


def _curve_rows(campaign: Campaign) -> Iterable[str]:
    for i in np.argsort(campaign.specimen_ids):
        name = campaign.specimen_ids[i]
        columns = (campaign.time_s[i], campaign.displacement_mm[i], campaign.force_N[i])
        for time_s, displacement_mm, force_N in zip(*(c.tolist() for c in columns), strict=True):
            yield f"{name},{time_s:.4f},{displacement_mm:.4f},{force_N + 0.0:.4f}"


def _field_rows(campaign: Campaign) -> Iterable[str]:
    facet = "" if campaign.facet_mm is None else f",{campaign.facet_mm:g}"
    fields = sorted(campaign.fields, key=lambda f: campaign.specimen_ids[f[0]])
    for number, times_s, positions_mm, strains in fields:
        name = campaign.specimen_ids[number]
        for time_s, row in zip(times_s.tolist(), strains.tolist(), strict=True):
            for x_mm, strain in zip(positions_mm.tolist(), row, strict=True):
                yield f"{name},{time_s:.4f},{x_mm:.3f},{strain:.5f}{facet}"


def _lines(head: str, rows: Iterable[str]) -> str:
    return "\n".join([head, *rows]) + "\n"


def _csv(head: Sequence[str], rows: list[list[str]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerows([head, *rows])
    return text.getvalue()
