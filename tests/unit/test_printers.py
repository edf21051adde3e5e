"""Printers are found by entry point, and a plugin's faults are named."""

import dataclasses
from pathlib import Path

import pytest

from planner.errors import PaletteError, UnknownNameError
from planner.printers import installed_printers, load_printer, load_profile
from planner.testing import check_printer

PALETTE = """
schema = 1
name = "myjet-soft"
kind = "palette"
[[material]]
id = "Soft"
coordinate = 0.0
elongation_at_break = 1.0
density_g_cm3 = 1.1
law = { model = "neo-hookean", mu_MPa = 0.2 }
[[material]]
id = "Hard"
coordinate = 1.0
elongation_at_break = 0.2
density_g_cm3 = 1.2
deformation = "plastic"
law = { model = "linear", modulus_MPa = 900.0 }
"""

PROFILE = """
schema = 1
name = "myjet"
title = "MyJet 3000"
tray_mm = [300.0, 200.0, 150.0]
pixel_mm = [0.042, 0.084]
layer_mm = 0.027
minimum_wall_mm = 0.6
minimum_feature_mm = 0.5
base_resins = ["A", "B"]
support = "S"
palettes = ["myjet-soft"]
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "palettes").mkdir()
    (tmp_path / "palettes" / "myjet-soft.toml").write_text(PALETTE)
    (tmp_path / "printer.toml").write_text(PROFILE)
    (tmp_path / "job_notes.md").write_text("# Print it\n")
    return tmp_path


def test_connex3_is_installed_and_passes_its_check() -> None:
    assert "connex3" in installed_printers()
    machine = load_printer("connex3")
    check_printer(machine)
    assert machine.tray_mm == (490.0, 390.0, 200.0)
    assert (machine.pixel_mm, machine.layer_mm) == ((0.042, 0.042), 0.030)
    assert machine.minimum_wall_mm == 0.6
    assert len(machine.palette().materials) == 10


def test_a_profile_of_files_is_a_printer(folder: Path) -> None:
    check_printer(load_profile(folder))


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"tray_mm": (0.0, 1.0, 1.0)}, "tray_mm"),
        ({"layer_mm": 0.0}, "layer_mm"),
        ({"base_resins": ()}, "base_resins"),
        ({"palettes": ()}, "palettes is empty"),
        ({"operator_names": {"Soft": ""}}, "operator_name"),
    ],
)
def test_the_check_names_what_is_wrong(folder: Path, change: dict, reason: str) -> None:
    machine = dataclasses.replace(load_profile(folder), **change)
    with pytest.raises(AssertionError, match=reason):
        check_printer(machine)


def test_the_check_names_what_is_missing() -> None:
    with pytest.raises(AssertionError, match=r"lacks.*tray_mm"):
        check_printer(object())


def test_a_key_that_is_no_key_is_named(folder: Path) -> None:
    (folder / "printer.toml").write_text(PROFILE + "colour = 'red'\n")
    with pytest.raises(PaletteError, match="colour"):
        load_profile(folder)


def test_unknown_printer_and_palette() -> None:
    with pytest.raises(UnknownNameError, match="did you mean connex3"):
        load_printer("connx3")
    with pytest.raises(UnknownNameError, match="it has connex3-tango-vero"):
        load_printer("connex3").palette("agilus")
