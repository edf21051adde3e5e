"""TOML that Python itself cannot hold is refused like any other that is none."""

import pytest

from planner.errors import FileError, PaletteError
from planner.formats.files import decode_toml
from planner.palette import load_palette
from planner.printers import load_profile
from planner.simulation.loads import read_cases


@pytest.mark.parametrize(
    "data", [b"a = \xff", b"a = 1 2", b"a = " + 5000 * b"9", b"a = " + 20_000 * b"["]
)
def test_what_is_no_toml_is_refused_by_every_reader(data, tmp_path):
    with pytest.raises(FileError, match=r"x\.toml: not a TOML file"):
        decode_toml(data, "x.toml")
    (tmp_path / "printer.toml").write_bytes(data)
    for read, error in ((load_palette, PaletteError), (read_cases, FileError)):
        with pytest.raises(error, match=r"printer\.toml: not a TOML file"):
            read(tmp_path / "printer.toml")
    with pytest.raises(PaletteError, match=r"printer\.toml: not a TOML file"):
        load_profile(tmp_path)
