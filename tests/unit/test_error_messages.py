"""Messages of errors: one line that a terminal shows at a glance, whatever of a file they quote."""

from pathlib import Path

import pytest

import planner
from planner.errors import FileError, PlannerError
from planner.formats.field_file import read_point_table
from planner.gap.campaign_folder import read_campaign

LONG = 10_000
SIX_ROWS = 480


def test_a_usual_message_stays_as_it_is():
    message = f"palette {'deep/' * 30}lab.toml: material 'A': E_MPa is '50 µm'; write a number"
    assert str(FileError(message)) == message


def test_place_and_advice_stay_where_a_long_word_is_quoted():
    message = str(FileError(f"a.csv, line 7: {'x' * LONG} is no number; repair or remove the line"))
    assert len(message) < 200
    assert message.startswith("a.csv, line 7: xxx")
    assert message.endswith("xxx is no number; repair or remove the line")


def test_place_and_advice_stay_where_many_words_are_quoted():
    message = str(FileError(f"a.csv, line 7: {'1 2 3 ' * LONG}; repair or remove the line"))
    assert len(message) == SIX_ROWS
    assert message.startswith("a.csv, line 7: 1 2 3")
    assert message.endswith("; repair or remove the line")


def test_a_message_is_one_printable_line():
    message = str(FileError("a.csv: column 'x\ny\t\x1b[31m\udcff z' is unknown"))
    assert message == "a.csv: column 'x y \\x1b[31m\\udcff z' is unknown"


def long_cell(folder: Path, name: str, text: str) -> Path:
    (folder / name).write_text(text.replace("LONG", "x" * LONG), encoding="utf-8")
    return folder / name


def campaign(folder: Path, **files: str) -> None:
    usual = {
        "campaign": 'schema = 1\nname = "a"\nprinter = "connex3"\npalette = "connex3-tango-vero"\n',
        "specimens": "specimen,material,gauge_mm,width_mm,thickness_mm\nS1,FLX9760,25,6,3\n",
        "curves": "specimen,time_s,displacement_mm,force_N\nS1,0,0,0\nS1,1,1,2\n",
    }
    for name, ending in (("campaign", "toml"), ("specimens", "csv"), ("curves", "csv")):
        long_cell(folder, f"{name}.{ending}", files.get(name, usual[name]))
    read_campaign(folder)


@pytest.mark.parametrize(
    "files",
    [
        {"campaign": 'schema = 1\nname = "a"\nLONG = 2\nprinter = "connex3"\n'},
        {"campaign": 'schema = 1\nname = "a"\nprinter = "LONG"\npalette = "x"\n'},
        {"specimens": "specimen,material,gauge_mm\nS1,LONG,25\n"},
        {"specimens": "specimen,material,gauge_mm\nS1,FLX9760,LONG\n"},
        {"specimens": "specimen,material,orientation\nLONG,FLX9760,LONG\n"},
        {"specimens": "LONG,material,gauge_mm\nS1,FLX9760,25\n"},
        {"curves": "specimen,time_s,displacement_mm,force_N\nS1,0,0,LONG\n"},
        {"curves": "LONG,LONG,LONG\n1,2,3\n4,5,6\n"},
    ],
)
def test_a_campaign_is_refused_in_six_rows(files, tmp_path):
    with pytest.raises(PlannerError) as told:
        campaign(tmp_path, **files)
    assert len(str(told.value)) <= SIX_ROWS


@pytest.mark.parametrize(
    "text",
    [
        "x_mm,y_mm,z_mm,value\n1,2,3,LONG\n",
        f"x_mm,y_mm,z_mm,value\n{'1,' * LONG}\n",
        "LONG,y_mm,z_mm,value\n1,2,3,4\n",
        f"x_mm,y_mm,z_mm,{'a b,' * LONG}\n1,2,3,4\n",
    ],
)
def test_points_are_refused_in_six_rows(text, tmp_path):
    with pytest.raises(FileError) as told:
        read_point_table(long_cell(tmp_path, "points.csv", text))
    assert len(str(told.value)) <= SIX_ROWS


def test_a_palette_is_refused_in_six_rows(tmp_path):
    with pytest.raises(FileError) as told:
        planner.load_palette(long_cell(tmp_path, "p.toml", 'schema = 1\n"LONG" = 1\n'))
    assert len(str(told.value)) <= SIX_ROWS
