"""No command writes over what it reads, over what others wrote, or onto what is no file."""

import hashlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import planner
from planner.cli import run

SAMPLES = Path(__file__).resolve().parents[2] / "samples"


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plans")
    made = planner.grade(SAMPLES / "dogbone.stl", from_="Tango", to="Vero", bands=2)
    return made.write(folder / "plan", page=planner.plan_page(made))


@pytest.fixture
def here(tmp_path, monkeypatch, plan):
    """A working directory with one of each that commands read."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(plan, "plan")
    shutil.copy(SAMPLES / "dogbone.stl", "bar.stl")
    shutil.copytree(SAMPLES / "tensile", "tensile")
    palette = planner.load_printer("connex3").palette()
    planner.write_palette(palette, "pal.toml")
    Path("diag").mkdir()
    Path("diag/diagnosis.json").write_text('{"files_sha256": {}}')
    Path("profile.csv").write_text("position,modulus_MPa\n0,1\n1,10\n")
    Path("plan/profile.csv").write_text("position,modulus_MPa\n0,1\n1,10\n")
    return tmp_path


def content(folder):
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


ENDS = ["--from", "Tango", "--to", "Vero"]
SHELL = "plan/stl/dogbone__01_FLX9760.stl"
READS = (
    "characterise tensile -o tensile/specimens.csv",
    "characterise tensile/specimens.csv -o tensile/rigid-1.csv",
    "characterise tensile/rigid-1.csv --figure f.svg -o tensile/specimens.csv",
    "fit tensile -o tensile/rigid-1.csv",
    "fit tensile --palette pal.toml -o pal.toml",
    "fit tensile --palette pal.toml -o sub/../pal.toml",
    "fit tensile --palette pal.toml -o soft.toml",
    "fit tensile --palette pal.toml -o hard.toml",
    "simulate plan -o plan/plan.json",
    f"simulate plan --fix x=min --load x=max:0,0,1N --deformed {SHELL}",
    "simulate FLX9760 --palette pal.svg --figure pal.svg",
    "export bar.stl --material Vero --to vtu -o bar.stl",
    "compare plan plan -o plan/plan.json --no-open",
    "materials --palette pal.svg --figure pal.svg",
    "gap correct diag -o diag/diagnosis.json",
    f"grade {SHELL} {' '.join(ENDS)} -o plan",
    f"grade bar.stl {' '.join(ENDS)} --profile plan/profile.csv -o plan",
    f"grade bar.stl {' '.join(ENDS)} --field distance:plan/profile.csv -o plan",
    "grade bar.stl --like plan -o plan",
)


@pytest.mark.parametrize("words", READS)
def test_a_result_never_replaces_what_a_command_reads(here, words, capsys):
    shutil.copy("pal.toml", "pal.svg")
    (here / "soft.toml").symlink_to("pal.toml")
    os.link("pal.toml", "hard.toml")
    (here / "sub").mkdir()
    before = content(here)
    assert run([*words.split(), "--force"]) == 2
    told = capsys.readouterr().err
    assert "the command reads " in told
    assert told.count("\n") == 1
    assert content(here) == before


@pytest.mark.parametrize(
    "words",
    [
        "simulate plan -o out.csv --field {here}/out.csv",
        "simulate plan -o out.csv --field ./out.csv",
        "fit tensile -o lab/laws.csv --tables lab",
        "characterise tensile -o link.svg --figure out.svg",
    ],
)
def test_two_results_are_two_files(here, words, capsys):
    (here / "link.svg").symlink_to("out.svg")
    (here / "lab").mkdir()
    assert run([*words.format(here=here).split(), "--force"]) == 2
    assert "name one place" in capsys.readouterr().err


def test_force_keeps_what_others_put_there_and_names_it(here, capsys):
    strangers = ("mine.3mf", "stl/mine.stl", "profile.csv", "report.html")
    for name in strangers:
        Path("plan", name).write_text("mine")
    words = ["grade", "bar.stl", *ENDS, "--bands", "3", "-o", "plan", "--force"]
    assert run(words) in (0, 1)
    assert (
        "plan keeps mine.3mf, profile.csv, report.html and stl/mine.stl" in capsys.readouterr().err
    )
    assert all(Path("plan", name).read_text() == "mine" for name in strangers)
    assert len(planner.read_plan("plan").regions) == 3
    assert len(list(Path("plan/stl").iterdir())) == 4


@pytest.mark.parametrize("name", [SHELL, "plan/HOWTO.md", "plan/plan.html"])
def test_force_leaves_what_was_changed_since(here, name, capsys):
    Path(name).write_text("mine")
    assert run(["grade", "bar.stl", *ENDS, "-o", "plan", "--force"]) == 2
    told = capsys.readouterr().err
    assert f"{Path(name).relative_to('plan')} was changed since planner wrote it" in told
    assert Path(name).read_text() == "mine"


def test_view_replaces_no_page_of_others(here, capsys):
    Path("plan/plan.html").write_text("mine")
    assert run(["view", "plan", "--no-open"]) == 2
    assert "was not written by planner" in capsys.readouterr().err
    assert Path("plan/plan.html").read_text() == "mine"
    Path("plan/plan.html").unlink()
    assert run(["view", "plan", "--no-open"]) == 0
    assert run(["grade", "bar.stl", *ENDS, "--bands", "3", "-o", "plan", "--force"]) in (0, 1)


@pytest.mark.parametrize("force", [[], ["--force"]])
def test_pipes_and_devices_are_no_outputs(here, force, capsys):
    os.mkfifo("pipe.svg")
    for words in (
        ["materials", "--figure", "pipe.svg"],
        ["fit", "tensile", "-o", "/dev/null"],
        ["characterise", "tensile", "-o", "pipe.svg"],
    ):
        assert run([*words, *force]) == 2
        assert "is a device or a pipe" in capsys.readouterr().err
    assert Path("pipe.svg").is_fifo()
    assert run(["grade", "bar.stl", *ENDS, "-o", "pipe.svg", *force]) == 2
    assert "is a file" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["-", "/dev/stdout"])
def test_a_result_goes_down_a_pipe(here, name, capsys):
    def said(*words):
        command = [sys.executable, "-m", "planner", "characterise", "tensile", *words]
        return subprocess.run(command, capture_output=True, check=False)

    assert run(["characterise", "tensile", "-o", "table.csv"]) == 0
    piped = said("-o", name)
    assert piped.returncode == 0
    assert piped.stdout == Path("table.csv").read_bytes()
    assert b"TangoPlus" in piped.stderr or b"material" in piped.stderr
    capsys.readouterr()
    assert run(["characterise", "tensile", "-o", name, "--json"]) == 2
    assert "--json prints there" in capsys.readouterr().err


@pytest.mark.parametrize(
    "words",
    [
        ["grade", "/dev/zero", *ENDS],
        ["grade", "pipe.stl", *ENDS],
        ["materials", "--palette", "pipe.toml"],
        ["characterise", "pipe.csv"],
        ["grade", "bar.stl", *ENDS, "--profile", "pipe.csv"],
        ["check", "pipes"],
    ],
)
def test_pipes_and_devices_are_no_inputs(here, words, capsys):
    """A pipe that nobody writes into would be waited for."""
    Path("pipes").mkdir()
    for name in ("pipe.stl", "pipe.toml", "pipe.csv", "pipes/plan.json"):
        os.mkfifo(name)
    assert run(words) == 2
    told = capsys.readouterr().err
    assert "pipe" in told
    assert told.count("\n") == 1


def test_what_does_not_fit_into_memory_is_told_with_its_size(here, capsys):
    with Path("large.stl").open("wb") as file:
        file.truncate(10**13)
    assert run(["grade", "large.stl", *ENDS]) == 2
    assert "large.stl: holds 1e+04 GB, too much for the " in capsys.readouterr().err


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("tray_mm", "[490.0, 0.0, 200.0]"),
        ("tray_mm", "[490.0, 1e400, 200.0]"),
        ("layer_mm", "-0.03"),
        ("pixel_mm", "[nan, 0.04]"),
    ],
)
def test_a_printer_has_sizes(tmp_path, key, value):
    import printers.connex3

    folder = Path(printers.connex3.__file__).parent
    text = (folder / "printer.toml").read_text()
    lines = [f"{key} = {value}" if line.startswith(key) else line for line in text.splitlines()]
    (tmp_path / "printer.toml").write_text("\n".join(lines))
    from planner.errors import PaletteError
    from planner.printers import load_profile

    with pytest.raises(PaletteError, match=rf"Expected `float` [<>]=? .* - at `\$\.{key}"):
        load_profile(tmp_path)
