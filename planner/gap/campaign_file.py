"""campaign.toml: the campaign's name, its printer and its palette."""

import tomllib
from pathlib import Path
from typing import Literal

import msgspec

from planner.errors import FileError
from planner.palette import Palette, load_palette
from planner.printers import printer as load_printer

__all__ = ["CampaignFile", "palette_of", "read_campaign_file"]

CAMPAIGN = "campaign.toml"


class CampaignFile(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """The content of campaign.toml."""

    schema: Literal[1]
    name: str
    printer: str
    palette: str | None = None
    notes: str = ""


def read_campaign_file(folder: Path) -> CampaignFile:
    """Read campaign.toml in a folder.

    Raises
    ------
    FileError
        The folder or file is missing, is no TOML, or breaks the schema; the message names the
        key.
    """
    path = folder / CAMPAIGN
    if not folder.is_dir():
        raise FileError(f"{folder}: no such folder; give the folder of a campaign")
    try:
        data = path.read_bytes()
    except OSError as error:
        raise FileError(
            f"{path}: cannot be read ({error.strerror or error}); a campaign's folder has a "
            "campaign.toml with schema, name, printer and palette"
        ) from error
    try:
        return msgspec.convert(tomllib.loads(data.decode("utf-8")), CampaignFile)
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise FileError(f"{CAMPAIGN}: not a TOML file: {error}") from error
    except msgspec.ValidationError as error:
        known = ", ".join(CampaignFile.__struct_fields__)
        raise FileError(f"{CAMPAIGN}: {error}; its keys are {known}") from error


def palette_of(file: CampaignFile, folder: Path) -> Palette:
    """Load the palette that campaign.toml names: a file beside it, or one of the printer's.

    Raises
    ------
    FileError
        It names none.
    PaletteError, UnknownNameError
        The file breaks its schema, or the printer or its palette is not installed.
    """
    if file.palette is None:
        raise FileError(
            f'{CAMPAIGN}: no palette; write palette = "palette.toml", or a palette\'s name'
        )
    beside = folder / file.palette
    if file.palette.endswith(".toml") or beside.is_file():
        return load_palette(beside)
    return load_printer(file.printer).palette(file.palette)
