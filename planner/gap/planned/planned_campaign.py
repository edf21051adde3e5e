"""A campaign that is yet to be measured: its list of specimens, each on its protocol's path."""

from dataclasses import replace
from pathlib import Path
from typing import cast

from planner.errors import FileError
from planner.formats.tensile import Specimen as Row
from planner.formats.tensile import read_specimens
from planner.gap.campaign import Campaign
from planner.gap.campaign_file import palette_of, read_campaign_file
from planner.gap.campaign_reader import CURVES, SPECIMENS, read_campaign
from planner.gap.planned.lone_test import nominal_record
from planner.gap.planned.planned_specimen import HOLD_S, planned_specimen, planned_strain
from planner.gap.profile_design import ProfileDesign, read_profile
from planner.gap.specimen import Orientation, Protocol, Specimen
from planner.gap.specimen_columns import check_headings, covariates_of
from planner.palette import Palette

__all__ = ["read_plan_of_campaign"]


def read_plan_of_campaign(
    path: str | Path, palette: Palette, *, printer: str = "connex3", camera: bool = False
) -> Campaign:
    """Read which specimens are to be tested: a specimens.csv, or a campaign's folder.

    A folder's own palette counts. Where it has curves, their specimens go the ways that they
    went; else each goes that of its protocol, as far as a column `to_strain` says, or
    `planned_strain`. Forces are stand-ins.

    Parameters
    ----------
    palette, printer
        Of a list without campaign.toml.
    camera
        Whether bars are seen along their axis.

    Raises
    ------
    FileError
        A file that is missing or cannot be understood, or a specimen without its sizes.
    PaletteError, UnknownNameError
        The palette, or a material that it does not have.
    """
    path = Path(path)
    if path.is_file():
        return _listed(path, path.stem, palette, printer, camera)
    file = read_campaign_file(path)
    own = palette_of(file, path)
    if _has_curves(path):
        campaign = read_campaign(path, own)
        return replace(campaign, specimens=tuple(_retraced(campaign)))
    return _listed(path / SPECIMENS, file.name, own, file.printer, camera)


def _has_curves(folder: Path) -> bool:
    if any(row.file for row in read_specimens(folder / SPECIMENS)):
        return True
    try:
        lines = (folder / CURVES).read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return False
    return sum(bool(line.strip()) for line in lines) > 1


def _retraced(campaign: Campaign) -> list[Specimen]:
    """Return the specimens on the ways they went, without their sensors' noise."""
    found = []
    for place, specimen in enumerate(campaign.specimens):
        record = nominal_record(campaign, place)
        if record is None:
            continue
        time, travel, shift_s = record
        seen = specimen.strain_field
        found.append(
            replace(
                specimen,
                time_s=time,
                displacement_mm=travel,
                force_N=travel / specimen.gauge_mm,
                strain_field=None if seen is None else replace(seen, time_s=seen.time_s - shift_s),
            )
        )
    if not found:
        raise FileError(
            f"campaign {campaign.name}: no specimen loads over enough points to be followed; "
            f"give its {SPECIMENS} alone, and each goes the way of its protocol"
        )
    return found


def _listed(file: Path, name: str, palette: Palette, printer: str, camera: bool) -> Campaign:
    rows = read_specimens(file)
    notes = tuple(check_headings(rows, file.name))
    covariates = covariates_of(rows)
    designs = [_design(row, file, palette) for row in rows]
    strain = planned_strain(
        palette, [row.material for row in rows if row.material], [d for d in designs if d]
    )
    specimens = []
    for row, design in zip(rows, designs, strict=True):
        own = covariates[row.specimen]
        specimens.append(
            planned_specimen(
                palette,
                id=row.specimen,
                gauge_mm=_gauge_mm(row, design, file),
                strain=_figure(own.get("to_strain"), strain, row, file, "to_strain"),
                hold_s=_figure(own.get("hold_s"), HOLD_S, row, file, "hold_s"),
                camera=camera,
                material=palette.resolve(row.material).id if row.material else None,
                profile=design,
                width_mm=_size(row, "width_mm", design, file),
                thickness_mm=_size(row, "thickness_mm", design, file),
                measured_width_mm=row.measured_width_mm,
                measured_thickness_mm=row.measured_thickness_mm,
                rate_mm_s=row.rate_mm_s,
                temperature_C=row.temperature_C,
                soak_h=row.soak_h,
                age_days=row.age_days,
                orientation=cast("Orientation | None", row.orientation or None),
                protocol=cast("Protocol | None", row.protocol or None),
                batch=row.batch or None,
                covariates=own,
            )
        )
    return Campaign(
        name=name,
        printer=printer,
        palette=palette,
        specimens=tuple(specimens),
        covariates=tuple(rows[0].covariates),
        remarks=notes,
    )


def _design(row: Row, file: Path, palette: Palette) -> ProfileDesign | None:
    if not row.profile:
        return None
    return read_profile(file.parent / row.profile, palette=palette, gauge_mm=row.gauge_mm)[0]


def _gauge_mm(row: Row, design: ProfileDesign | None, file: Path) -> float:
    gauge = row.gauge_mm if design is None else design.length_mm
    if gauge is None:
        raise FileError(f"{file.name}, specimen {row.specimen}: no gauge_mm; give the gauge length")
    return gauge


def _size(row: Row, name: str, design: ProfileDesign | None, file: Path) -> float | None:
    size: float | None = getattr(row, name)
    known = (
        size or getattr(row, f"measured_{name}") or (design and getattr(design, name) is not None)
    )
    if not known:
        raise FileError(f"{file.name}, specimen {row.specimen}: no {name}; give the section")
    return size


def _figure(value: str | float | None, otherwise: float, row: Row, file: Path, name: str) -> float:
    if value is None:
        return otherwise
    if isinstance(value, str) or not value > 0.0:
        raise FileError(
            f"{file.name}, specimen {row.specimen}: {name} is {value!r}; it must be above 0, or "
            "empty"
        )
    return value
