"""The command line as its users meet it: exit codes, what goes where, and what errors say."""

import inspect
import json
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest
import trimesh

import planner
from planner.cli import run


@pytest.fixture
def finger(samples: Path) -> str:
    return str(samples / "finger.stl")


@pytest.fixture(autouse=True)
def _in_scratch_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def graded(finger_plan: planner.Plan) -> Path:
    """What `grade finger.stl --from Tango --to Vero --axis x` writes."""
    return finger_plan.write("finger-graded")


GRADIENT = ["--from", "Tango", "--to", "Vero", "--axis", "x"]


def test_version(capsys) -> None:
    assert run(["--version"]) == 0
    assert capsys.readouterr().out == f"planner {planner.__version__}\n"


def test_every_command_has_help_with_an_example(capsys) -> None:
    import typer

    from planner.cli import app
    from planner.cli.output import _documented as documented

    commands = typer.main.get_command(app).commands  # type: ignore[attr-defined]
    assert {"grade", "invert", "materials", "check", "diff", "printers", "gap"} <= set(commands)
    below = {f"gap {name}": command for name, command in commands["gap"].commands.items()}
    for name, command in {**commands, **below}.items():
        assert f"planner {name}" in (command.callback.__doc__ or ""), name
        assert run([*name.split(), "--help"]) == 0
        assert all(p.help for p in command.params), name
        function = inspect.unwrap(command.callback)
        assert documented(function)[1].keys() <= inspect.signature(function).parameters.keys(), name


def test_grade_then_check_then_diff(finger: str, capsys) -> None:
    assert run(["grade", finger, *GRADIENT]) in (0, 1)
    out = capsys.readouterr().out
    assert "TangoPlus" in out
    assert "wrote finger-graded" in out
    assert run(["check", "finger-graded"]) == 0
    assert "is sound" in capsys.readouterr().out
    assert run(["grade", finger, *GRADIENT, "--bands", "5", "-o", "five", "--quiet"]) in (0, 1)
    assert capsys.readouterr().out == ""
    assert run(["diff", "finger-graded", "finger-graded/plan.json"]) == 0
    assert run(["diff", "finger-graded", "five"]) == 1


def test_json_is_one_document_and_the_plan(finger: str, capsys) -> None:
    run(["grade", finger, *GRADIENT, "--json"])
    printed = capsys.readouterr()
    written = json.loads(Path("finger-graded/plan.json").read_text())
    assert set(written.pop("files_sha256")) > {"finger.3mf", "plan.html"}
    assert json.loads(printed.out) == written
    assert printed.err == ""


def test_dry_run_writes_nothing(finger: str) -> None:
    run(["grade", finger, *GRADIENT, "--dry-run"])
    assert list(Path().iterdir()) == []


def test_existing_output_needs_force(finger: str, graded: Path, capsys) -> None:
    before = Path("finger-graded/plan.json").stat().st_mtime_ns
    assert run(["grade", finger, *GRADIENT]) == 2
    assert "--force" in capsys.readouterr().err
    assert Path("finger-graded/plan.json").stat().st_mtime_ns == before
    assert run(["grade", finger, *GRADIENT, "--force", "--quiet"]) in (0, 1)


def test_strict_writes_nothing_when_something_was_found(finger: str, capsys) -> None:
    Path("wish.csv").write_text("position,modulus_MPa\n0,0.001\n1,100\n")
    arguments = ["grade", finger, "--profile", "wish.csv", "--axis", "x"]
    assert run([*arguments, "--strict"]) == 1
    assert "out of reach" in capsys.readouterr().err
    assert not Path("finger-graded").exists()
    assert run([*arguments, "--quiet"]) == 1
    assert Path("finger-graded/plan.json").exists()


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["--from", "Tango"], "both ends"),
        (["--from", "Tango", "--to", "Tango"], "one material"),
        (["--from", "Tnago", "--to", "Vero"], "did you mean"),
        (["--from", "FLX97", "--to", "Vero"], "ambiguous"),
        ([*GRADIENT, "--bands", "0"], "--bands 0"),
        ([*GRADIENT, "--bands", "9000"], "thinner than a layer"),
        ([*GRADIENT, "--at-strain", "10"], "10 % is 0.1"),
        ([*GRADIENT, "--at-strain", "-0.1"], "from 0"),
        ([*GRADIENT, "--profile", "lgo"], "did you mean log"),
        ([*GRADIENT, "--blend", "mixed"], "nearest"),
        ([*GRADIENT, "--unit", "inches2"], "unit"),
        ([*GRADIENT, "--printer", "conex3"], "did you mean connex3"),
        ([*GRADIENT, "--palette", "nothing.toml"], "cannot be read"),
        ([*GRADIENT, "--palette", "connex3-tango-verp"], "did you mean connex3-tango-vero"),
        ([*GRADIENT, "-o", "/dev/null/below"], "folder"),
        (["--from", "Tango", "--to", "Vero", "--axis", "w"], "axis"),
        (["--from", "Tango", "--to", "Vero", "--axis", "0,0,0"], "axis"),
        (["--profile", "none.csv"], "cannot be read"),
        (["--bands", "many"], "--bands 'many': it must be a whole number"),
        ([*GRADIENT, "--at-strain", "20%"], "--at-strain '20%': it must be a number"),
        (["--bnads", "3"], "--bands"),
    ],
)
def test_bad_usage_is_one_line_and_writes_nothing(
    finger: str, capsys, arguments: list[str], reason: str
) -> None:
    assert run(["grade", finger, *arguments]) == 2
    printed = capsys.readouterr()
    assert reason in printed.err
    assert printed.err.startswith("planner: ")
    assert printed.err.count("\n") == 1
    assert printed.out == ""
    assert list(Path().iterdir()) == []


def test_invert(capsys) -> None:
    assert run(["invert", "--modulus", "1.2", "--json"]) == 0
    (result,) = json.loads(capsys.readouterr().out)["results"]
    blend = result["blend"]
    assert blend["modulus_MPa"] == pytest.approx(1.2, rel=1e-9)
    assert 0.0 < blend["fraction"] < 1.0
    assert blend["modulus_interval_MPa"][0] < 1.2 < blend["modulus_interval_MPa"][1]


@pytest.mark.parametrize(("modulus", "nearest"), [("0.001", "TangoPlus"), ("9e9", "VeroWhitePlus")])
def test_invert_out_of_reach_names_the_nearest(capsys, modulus: str, nearest: str) -> None:
    assert run(["invert", "-m", modulus, "--json"]) == 1
    (result,) = json.loads(capsys.readouterr().out)["results"]
    assert not result["reachable"]
    assert result["nearest"]["material"] == nearest
    assert run(["invert", "-m", modulus]) == 1
    assert "out of reach" in capsys.readouterr().err


@pytest.mark.parametrize("modulus", ["0", "-1", "nan", "inf", "soft"])
def test_invert_refuses_what_is_no_modulus(capsys, modulus: str) -> None:
    assert run(["invert", f"--modulus={modulus}"]) == 2
    assert "modulus" in capsys.readouterr().err


def test_printers_and_materials(capsys) -> None:
    assert run(["printers", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["printers"][0]["name"] == "connex3"
    assert run(["materials", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["materials"]
    moduli = [row["modulus_MPa"] for row in rows]
    assert len(rows) == 10
    assert moduli == sorted(moduli)


def test_check_finds_an_altered_shell(graded: Path, capsys) -> None:
    shell = sorted(Path("finger-graded/stl").iterdir())[0]
    data = bytearray(shell.read_bytes())
    data[200] ^= 0x10
    shell.write_bytes(data)
    assert run(["check", "finger-graded"]) == 1
    assert shell.name in capsys.readouterr().err
    shell.unlink()
    assert run(["check", "finger-graded"]) == 1
    assert "missing" in capsys.readouterr().err
    assert run(["check", "."]) == 2


def test_an_internal_error_is_70_and_says_so(monkeypatch, capsys) -> None:
    def broken(*_: object, **__: object) -> None:
        raise ZeroDivisionError("nought")

    monkeypatch.setattr("planner.grading.invert.invert", broken)
    assert run(["invert", "-m", "1"]) == 70
    assert "bug in planner" in capsys.readouterr().err


def test_an_interrupt_is_130(monkeypatch, capsys) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("planner.grading.invert.invert", interrupted)
    assert run(["invert", "-m", "1"]) == 130
    assert "interrupted" in capsys.readouterr().err


def test_commands_compute_as_all_processors_do() -> None:
    # Where a processor has AVX-512, numpy and BLAS have other functions for it, with other digits.
    code = (
        "import contextlib; from planner.cli import main\n"
        "with contextlib.suppress(SystemExit): main(['invert', '-m', '1.2', '--quiet'])\n"
        "from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__\n"
        "from threadpoolctl import threadpool_info\n"
        "print([n for n in __cpu_dispatch__ if __cpu_features__[n] and n != 'X86_V3'])\n"
        "print({i['architecture'] for i in threadpool_info() if i['user_api'] == 'blas'})\n"
    )
    told = ("NPY_DISABLE_CPU_FEATURES", "OPENBLAS_CORETYPE")
    environment = {name: value for name, value in os.environ.items() if name not in told}
    found = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment
    ).stdout.splitlines()
    assert found[-2] == "[]"
    cpu = Path("/proc/cpuinfo")
    if cpu.exists() and " avx2 " in cpu.read_text(encoding="utf-8"):
        assert found[-1] == "{'Haswell'}"


def test_help_imports_no_numpy() -> None:
    code = (
        "import sys, contextlib; from planner.cli import main\n"
        "with contextlib.suppress(SystemExit): main(['--help'])\n"
        "sys.exit(any(m in sys.modules for m in ('numpy', 'scipy', 'numba', 'trimesh')))"
    )
    done = subprocess.run([sys.executable, "-c", code], stdout=subprocess.DEVNULL, check=False)
    assert done.returncode == 0


def test_no_colour_and_no_control_codes_off_a_terminal(finger: str) -> None:
    environment = {**os.environ, "FORCE_COLOR": "", "NO_COLOR": "1"}
    done = subprocess.run(
        [sys.executable, "-m", "planner", "materials"],
        capture_output=True,
        check=True,
        env=environment,
    )
    assert b"\x1b" not in done.stdout
    assert b"VeroWhitePlus" in done.stdout


@pytest.mark.parametrize("width", [80, pytest.param(140, marks=pytest.mark.slow)])
def test_no_figure_is_cut_short_on_a_narrow_terminal(finger: str, width: int) -> None:
    """Under a terminal of its own, as a user has it."""
    import pty

    parent, child = pty.openpty()
    environment = {**os.environ, "COLUMNS": str(width), "TERM": "xterm", "NO_COLOR": "1"}
    command = [sys.executable, "-m", "planner", "grade", finger, *GRADIENT, "--dry-run"]
    process = subprocess.Popen(
        command, stdout=child, stderr=subprocess.DEVNULL, stdin=child, env=environment
    )
    os.close(child)
    text = b""
    while True:
        try:
            block = os.read(parent, 4096)
        except OSError:  # Linux's way of saying that the other end is closed
            break
        if not block:
            break
        text += block
    assert process.wait() in (0, 1)
    os.close(parent)
    lines = text.decode().splitlines()
    assert "…" not in text.decode()
    row = next(line for line in lines if "VeroWhitePlus" in line)
    assert "340" in row
    assert len(row.rstrip()) <= width


@pytest.mark.parametrize("arguments", [["--help"], ["materials"], ["materials", "--json"]])
def test_a_reader_that_goes_away_is_no_failure(arguments: list[str]) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run(
        [sys.executable, "-m", "planner", *arguments],
        stdout=writer,
        stderr=subprocess.PIPE,
        encoding="utf-8",
        check=False,
    )
    os.close(writer)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
@pytest.mark.parametrize("arguments", [["materials"], ["materials", "--json"], ["--help"]])
def test_a_full_output_is_bad_input(arguments: list[str]) -> None:
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "planner", *arguments],
            stdout=full,
            stderr=subprocess.PIPE,
            encoding="utf-8",
            check=False,
        )
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "No space left" in done.stderr


def test_an_interrupt_within_a_compiled_loop_is_130(monkeypatch, capsys) -> None:
    def interrupted(*_: object, **__: object) -> None:
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt as error:
            raise SystemError("returned a result with an exception set") from error

    monkeypatch.setattr("planner.grading.invert.invert", interrupted)
    assert run(["invert", "-m", "1"]) == 130
    assert "interrupted" in capsys.readouterr().err


def test_names_that_a_terminal_cannot_show_are_escaped() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "planner", "check", "f\u00ecnger \u624b"],
        env={**os.environ, "PYTHONIOENCODING": "ascii"},
        capture_output=True,
        check=False,
    )
    assert done.returncode == 2
    assert rb"f\xecnger \u624b: no such file or folder" in done.stderr


def test_an_error_is_one_line_though_libraries_hold_what_it_was_about(tmp_path) -> None:
    """Solids of manifold3d in the frames of an error would be told as leaks."""
    spheres = [trimesh.creation.icosphere(2, radius) for radius in (10.0, 20.0)]
    trimesh.util.concatenate(spheres).export(tmp_path / "nested.stl")
    command = [sys.executable, "-m", "planner", "grade", str(tmp_path / "nested.stl"), "--from"]
    done = subprocess.run([*command, "Tango", "--to", "Vero"], capture_output=True, check=False)
    assert done.returncode == 2
    assert b"--bodies" in done.stderr
    assert done.stderr.count(b"\n") == 1


def test_a_folder_is_not_written_to_standard_output(tmp_path, samples, capsys) -> None:
    ends = ["--from", "Tango", "--to", "Vero"]
    assert run(["grade", str(samples / "finger.stl"), *ends, "-o", "-"]) == 2
    assert "--output -: a folder is written" in capsys.readouterr().err


def test_a_mesh_in_place_of_a_plan_is_named(samples, capsys) -> None:
    assert run(["check", str(samples / "finger.stl")]) == 2
    assert "a mesh and no plan; give the folder" in capsys.readouterr().err


def test_a_broken_plugin_is_named_and_the_others_work(monkeypatch, capsys) -> None:
    from importlib.metadata import EntryPoint

    import planner.printers as printers

    real = printers.installed_printers()
    broken = EntryPoint("broken", "no_such_module:PRINTER", "planner.printers")
    monkeypatch.setattr(printers, "entry_points", lambda group: [*real.values(), broken])
    assert run(["printers"]) == 1
    printed = capsys.readouterr()
    assert "connex3" in printed.out
    assert "no_such_module" in printed.err


def test_tolerance_is_a_number(graded: Path, capsys) -> None:
    for tolerance in ("-1", "nan", "inf"):
        assert run(["diff", "finger-graded", "finger-graded", f"--tolerance={tolerance}"]) == 2
        assert "--tolerance" in capsys.readouterr().err


def test_sigterm_ends_a_compiled_loop_within_three_seconds() -> None:
    """The loop, of days, never comes back to Python to hear of it."""
    code = (
        "import planner.cli as cli\n"
        "from planner.numerics import kernel\n"
        "@kernel\n"
        "def spin(count):\n"
        "    total = 0\n"
        "    for i in range(count):\n"
        "        total ^= i * i % 7\n"
        "    return total\n"
        "spin(10)\n"
        "cli.run = lambda arguments: print('spins', flush=True) or spin(10**15)\n"
        "cli.main()\n"
    )
    took_s = []
    while not took_s or (min(took_s) > 3.0 and len(took_s) < 4):  # others may keep the machine busy
        with subprocess.Popen(
            [sys.executable, "-c", code], stdout=subprocess.PIPE, text=True
        ) as ran:
            assert ran.stdout is not None
            assert ran.stdout.readline() == "spins\n"
            began = time.monotonic()
            ran.terminate()
            assert ran.wait(60.0) == 143
            took_s.append(time.monotonic() - began)
    assert min(took_s) <= 3.0


def test_a_file_whose_name_begins_with_a_dash(finger: str, capsys, monkeypatch, tmp_path) -> None:
    """It is taken for an option; what is said, and what is proposed next, has ./ before it."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(finger, "-part.stl")
    assert run(["grade", "-part.stl", "--from", "Tango", "--to", "Vero"]) == 2
    assert "No such option: -p; write ./-part.stl (see" in capsys.readouterr().err
    assert run(["grade", "./-part.stl", "--from", "Tango", "--to", "Vero"]) == 0
    (proposed,) = re.findall(r"next: planner (check \S+);", capsys.readouterr().out)
    assert run(proposed.split()) == 0
