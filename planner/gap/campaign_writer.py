"""Write a campaign's folder, as `read_campaign` reads it."""

import csv
import io
import json
from collections.abc import Iterable, Sequence
from pathlib import Path

from planner.arrays import FloatArray
from planner.formats.folder import new_folder
from planner.formats.palette_toml import encode_palette
from planner.gap.campaign import Campaign
from planner.gap.profile_design import ProfileDesign
from planner.gap.specimen import Specimen

__all__ = ["SIGNIFICANT_DIGITS", "specimens_csv", "write_campaign"]

SIGNIFICANT_DIGITS = 9
"""Figures are rounded to this: finer than any measurement, coarser than the last bits in which
mathematical libraries of different machines differ."""

_NUMBERS = (
    "width_mm", "thickness_mm", "measured_width_mm", "measured_thickness_mm", "gauge_mm",
    "rate_mm_s", "temperature_C", "soak_h", "age_days",
)  # fmt: skip
_TEXTS = ("orientation", "protocol", "batch")


def specimens_csv(campaign: Campaign) -> bytes:
    """Return the list of specimens as a file's bytes; designs of bars as profiles/NAME.csv."""
    profiles, _ = _profile_files(campaign.specimens)
    return _table(_specimen_rows(campaign, profiles)).encode()


def write_campaign(campaign: Campaign, folder: str | Path, *, measured: bool = True) -> Path:
    """Write campaign.toml, palette.toml, specimens.csv, curves.csv, fields.csv and profiles.

    The folder is whole or absent. Reading it gives the campaign back, figures to
    `SIGNIFICANT_DIGITS`; writing that again gives the same bytes. Limitations are not written:
    reading finds them again.

    Parameters
    ----------
    measured
        False leaves out what is yet to be measured: curves.csv has its heading alone.

    Raises
    ------
    OutputError
        The folder exists and is not empty, or cannot be written.
    """
    _, designs = _profile_files(campaign.specimens)
    with new_folder(folder) as scratch:
        (scratch / "palette.toml").write_bytes(encode_palette(campaign.palette))
        _write(scratch / "campaign.toml", _campaign_toml(campaign))
        (scratch / "specimens.csv").write_bytes(specimens_csv(campaign))
        curves = campaign.specimens if measured else ()
        _write(scratch / "curves.csv", _table(_curve_rows(curves)))
        if measured and any(s.strain_field is not None for s in campaign.specimens):
            _write(scratch / "fields.csv", _table(_field_rows(campaign.specimens)))
        if designs:
            (scratch / "profiles").mkdir()
        for name, design in designs.items():
            _write(scratch / name, _table(_profile_rows(design)))
    return Path(folder)


def _campaign_toml(campaign: Campaign) -> str:
    pairs = {"name": campaign.name, "printer": campaign.printer, "palette": "palette.toml"}
    if campaign.notes:
        pairs["notes"] = campaign.notes
    # JSON's strings are TOML's, but for DEL, which JSON lets through.
    lines = [
        f"{key} = {json.dumps(value, ensure_ascii=False)}".replace("\x7f", "\\u007f")
        for key, value in pairs.items()
    ]
    return "\n".join(["schema = 1", *lines]) + "\n"


def _specimen_rows(campaign: Campaign, profiles: Sequence[str]) -> Iterable[Sequence[str]]:
    yield ("specimen", "material", "profile", *_NUMBERS, *_TEXTS, *campaign.covariates)
    for s, profile in zip(campaign.specimens, profiles, strict=True):
        yield (
            s.id,
            s.material or "",
            profile,
            *(_cell(getattr(s, name)) for name in (*_NUMBERS, *_TEXTS)),
            *(_cell(s.covariates.get(name)) for name in campaign.covariates),
        )


def _curve_rows(specimens: Sequence[Specimen]) -> Iterable[Sequence[str]]:
    yield ("specimen", "time_s", "displacement_mm", "force_N")
    for s in specimens:
        for values in zip(s.time_s, s.displacement_mm, s.force_N, strict=True):
            yield (s.id, *map(_number, values))


def _field_rows(specimens: Sequence[Specimen]) -> Iterable[Sequence[str]]:
    yield ("specimen", "time_s", "x_mm", "strain")
    for s in specimens:
        if s.strain_field is None:
            continue
        places = [_number(x) for x in s.strain_field.x_mm]
        for time, strains in zip(s.strain_field.time_s, s.strain_field.strain, strict=True):
            at = _number(time)
            for x, strain in zip(places, strains, strict=True):
                yield (s.id, at, x, _number(strain))


def _profile_files(
    specimens: Sequence[Specimen],
) -> tuple[list[str], dict[str, ProfileDesign]]:
    """Name a file for each specimen's design ("" without), equal designs sharing one."""
    names: list[str] = []
    designs: dict[str, ProfileDesign] = {}
    texts: dict[str, str] = {}
    for s in specimens:
        if s.profile is None:
            names.append("")
            continue
        text = _table(_profile_rows(s.profile))
        number, name = 1, f"profiles/{s.profile.name}.csv"
        while texts.setdefault(name, text) != text:
            number += 1
            name = f"profiles/{s.profile.name}-{number}.csv"
        designs[name] = s.profile
        names.append(name)
    return names, designs


def _profile_rows(design: ProfileDesign) -> Iterable[Sequence[str]]:
    columns: dict[str, FloatArray] = {
        name: values
        for name in ("x_mm", "coordinate", "width_mm", "thickness_mm")
        if (values := getattr(design, name)) is not None
    }
    yield tuple(columns)
    for values in zip(*columns.values(), strict=True):
        yield tuple(map(_number, values))


def _table(rows: Iterable[Sequence[str]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8", newline="\n")


def _cell(value: str | float | None) -> str:
    if value is None:
        return ""
    return value if isinstance(value, str) else _number(value)


def _number(value: float) -> str:
    return f"{value + 0.0:.{SIGNIFICANT_DIGITS}g}"
