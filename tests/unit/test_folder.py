"""Output folders are whole or absent, and nothing foreign is ever replaced."""

import errno
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from planner.errors import OutputError
from planner.formats import outputs as files
from planner.formats.outputs import (
    SEAL,
    check_absent,
    check_target,
    claimed,
    files_within,
    new_folder,
    seal,
    write_whole,
)


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def content(folder):
    """Read every file; of a record the text that it was written with."""
    found = {
        str(path.relative_to(folder)): path.read_text()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }
    return {
        name: json.loads(text)["text"] if name == "plan.json" else text
        for name, text in found.items()
    }


def record(text, **more):
    return json.dumps({"text": text, **more})


def write(target, text="new", beside=(), **options):
    with new_folder(target, **options) as scratch:
        (scratch / "stl").mkdir()
        (scratch / "stl" / "a.stl").write_text(text)
        for name in beside:
            (scratch / name).write_text(text)
        (scratch / "plan.json").write_text(record(text))


def test_folder_appears_whole(tmp_path):
    target = tmp_path / "out"
    with new_folder(target) as scratch:
        (scratch / "plan.json").write_text(record("x"))
        assert scratch.parent == tmp_path  # a sibling: renaming does not copy
        assert not target.exists()
    assert content(target) == {"plan.json": "x"}
    assert names(tmp_path) == ["out"]


def test_permissions_are_those_of_any_folder(tmp_path):
    write(tmp_path / "out")
    (tmp_path / "plain").mkdir()
    assert (tmp_path / "out").stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_earlier_output_needs_force(tmp_path):
    write(tmp_path / "out", "old")
    with pytest.raises(OutputError, match="exists already; replace it with `force`"):
        write(tmp_path / "out")
    assert content(tmp_path / "out")["plan.json"] == "old"
    write(tmp_path / "out", force=True)
    assert content(tmp_path / "out") == {"plan.json": "new", "stl/a.stl": "new"}
    assert names(tmp_path) == ["out"]


@pytest.mark.parametrize("force", [False, True])
def test_foreign_folder_stays(tmp_path, force):
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "text.txt").write_text("years of work")
    with pytest.raises(OutputError, match=r"holds no plan\.json"):
        write(tmp_path / "thesis", force=force)
    assert content(tmp_path / "thesis") == {"text.txt": "years of work"}


STRANGERS = (
    "notes.txt", "stl/readme.md", "photos/a.stl", "stl/old/a.stl", "HOWTO.md.bak", "a.stl",
    "stl/z.stl", "mine.3mf", "profile.csv", "report.html", "plan.html", ".hidden",
)  # fmt: skip


@pytest.mark.parametrize("stranger", STRANGERS)
def test_what_others_put_into_a_plan_stays(tmp_path, stranger):
    target = tmp_path / "out"
    write(target, "old")
    (target / stranger).parent.mkdir(exist_ok=True)
    (target / stranger).write_text("mine")
    before = content(target)
    with pytest.raises(OutputError, match="exists already"):
        write(target)
    assert content(target) == before
    assert check_target(target, force=True) == (stranger,)
    write(target, force=True)
    assert content(target) == {"plan.json": "new", "stl/a.stl": "new", stranger: "mine"}
    assert names(tmp_path) == ["out"]


def test_links_and_empty_folders_of_others_stay(tmp_path):
    target = tmp_path / "out"
    write(target, "old")
    (tmp_path / "elsewhere").mkdir()
    (target / "part.3mf").symlink_to(tmp_path / "elsewhere")
    (target / "gone").symlink_to("nowhere")
    (target / "photos").mkdir()
    os.mkfifo(target / "pipe")
    assert check_target(target, force=True) == ("gone", "part.3mf", "photos/", "pipe")
    write(target, force=True)
    assert (target / "part.3mf").readlink() == tmp_path / "elsewhere"
    assert (target / "gone").is_symlink()
    assert (target / "photos").is_dir()
    assert (target / "pipe").is_fifo()


def test_a_file_system_without_second_names_gets_copies(tmp_path, monkeypatch):
    def refuse(*given, **options):
        raise OSError(errno.EPERM, "Operation not permitted")

    write(tmp_path / "out", "old")
    (tmp_path / "out" / "notes.txt").write_text("mine")
    monkeypatch.setattr(os, "link", refuse)
    write(tmp_path / "out", force=True)
    assert content(tmp_path / "out")["notes.txt"] == "mine"


@pytest.mark.parametrize("changed", ["stl/a.stl", "HOWTO.md"])
def test_what_was_changed_since_is_not_replaced(tmp_path, changed):
    target = tmp_path / "out"
    write(target, "old", beside=["HOWTO.md"])
    (target / changed).write_text("mine")
    with pytest.raises(OutputError, match=f"{re.escape(changed)} was changed since planner wrote"):
        write(target, force=True)
    assert content(target)[changed] == "mine"


def test_what_is_in_the_way_of_a_new_file_stays(tmp_path):
    """It was no part of the earlier plan; the new one has a file of its name."""
    target = tmp_path / "out"
    write(target, "old")
    (target / "HOWTO.md").write_text("mine")
    with pytest.raises(OutputError, match=r"HOWTO\.md is in the way"):
        write(target, force=True, beside=["HOWTO.md"])
    assert content(target) == {"plan.json": "old", "stl/a.stl": "old", "HOWTO.md": "mine"}
    (target / "HOWTO.md").unlink()
    (target / "HOWTO.md").mkdir()
    (target / "HOWTO.md" / "deep").write_text("mine")
    with pytest.raises(OutputError, match=r"HOWTO\.md/deep is in the way"):
        write(target, force=True, beside=["HOWTO.md"])
    assert names(tmp_path) == ["out"]


@pytest.mark.parametrize("found", ["no JSON", "[]", '{"schema": 1}', '{"files_sha256": ["a"]}'])
def test_a_record_that_lists_nothing_replaces_nothing(tmp_path, found):
    write(tmp_path / "out")
    (tmp_path / "out" / "plan.json").write_text(found)
    with pytest.raises(OutputError, match=r"plan\.json does not list the folder's files"):
        check_target(tmp_path / "out", force=True)


def test_a_page_made_later_is_known_by_its_seal(tmp_path):
    target = tmp_path / "out"
    write(target, "old")
    page = b"<html>" + SEAL.encode() + b"<body>"
    (target / "plan.html").write_bytes(seal(page))
    assert check_target(target, force=True) == ()
    (target / "plan.html").write_bytes(seal(page).replace(b"body", b"main"))
    assert check_target(target, force=True) == ("plan.html",)
    (target / "plan.html").rename(target / "kept.html")  # a sealed page of another name is no part
    (target / "kept.html").write_bytes(seal(page))
    assert check_target(target, force=True) == ("kept.html",)


def test_the_record_lists_the_other_files(tmp_path):
    write(tmp_path / "out", beside=["HOWTO.md"])
    listed = json.loads((tmp_path / "out" / "plan.json").read_text())["files_sha256"]
    of = hashlib.sha256(b"new").hexdigest()
    assert listed == {"HOWTO.md": of, "stl/a.stl": of}


def test_all_that_planner_writes_is_replaced(tmp_path):
    target = tmp_path / "out"
    write(target, "old", beside=["part.3mf", "HOWTO.md", "stl/b.stl"])
    write(target, force=True)
    assert content(target) == {"plan.json": "new", "stl/a.stl": "new"}


def test_what_comes_while_writing_stays(tmp_path, monkeypatch):
    """While the new folder is filled, or between the last look at the earlier one and its end."""
    target = tmp_path / "out"
    write(target, "old")
    original = files._take_name

    def late(*given, **options):
        (target / "late").mkdir()
        (target / "late" / "notes.txt").write_text("mine")
        original(*given, **options)

    monkeypatch.setattr(files, "_take_name", late)
    with new_folder(target, force=True) as scratch:
        (scratch / "plan.json").write_text(record("new"))
        (target / "notes.txt").write_text("mine")
    assert content(target) == {"notes.txt": "mine", "late/notes.txt": "mine", "plan.json": "new"}
    assert names(tmp_path) == ["out"]


def test_a_rest_of_the_earlier_plan_is_told(tmp_path, monkeypatch):
    """Another program may hold its files open, as on network drives."""
    target = tmp_path / "out"
    write(target, "old")
    original = shutil.rmtree

    def refuse(path, **options):
        if not options:
            raise OSError(errno.EBUSY, "Device or resource busy")
        original(path, **options)

    monkeypatch.setattr(shutil, "rmtree", refuse)
    with pytest.raises(OutputError, match=r"is written, but .*busy.*; delete .*\.out\.partial"):
        write(target, force=True)
    assert content(target)["plan.json"] == "new"


@pytest.mark.parametrize("force", [False, True])
def test_empty_folder_is_filled(tmp_path, force):
    (tmp_path / "out").mkdir()
    write(tmp_path / "out", force=force)
    assert "plan.json" in content(tmp_path / "out")


def test_a_file_in_the_way(tmp_path):
    (tmp_path / "file").write_text("x")
    with pytest.raises(OutputError, match="is a file"):
        check_target(tmp_path / "file", force=True)
    with pytest.raises(OutputError, match="file cannot be written into"):
        check_target(tmp_path / "file" / "out")


def test_missing_folders_are_made_and_gone_again_where_nothing_was_written(tmp_path):
    write(tmp_path / "a" / "b" / "out")
    assert "plan.json" in content(tmp_path / "a" / "b" / "out")
    with pytest.raises(KeyboardInterrupt), new_folder(tmp_path / "a" / "c" / "d" / "out"):
        raise KeyboardInterrupt
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["b"]


def test_link_keeps_pointing(tmp_path):
    write(tmp_path / "real", "old")
    (tmp_path / "link").symlink_to("real")
    write(tmp_path / "link", force=True)
    assert (tmp_path / "link").is_symlink()
    assert content(tmp_path / "real")["plan.json"] == "new"


def test_loop_of_links(tmp_path):
    (tmp_path / "a").symlink_to("b")
    (tmp_path / "b").symlink_to("a")
    with pytest.raises(OutputError):
        write(tmp_path / "a")


@pytest.mark.parametrize("earlier", [False, True])
@pytest.mark.parametrize(
    ("stop", "raised"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), OutputError),
        (PermissionError(errno.EACCES, "Permission denied"), OutputError),
        (KeyboardInterrupt(), KeyboardInterrupt),
        (RuntimeError("bug"), RuntimeError),
    ],
)
def test_nothing_is_left_behind(tmp_path, earlier, stop, raised):
    target = tmp_path / "out"
    if earlier:
        write(target, "old")
    before = sorted(str(p) for p in tmp_path.rglob("*"))

    def write_half():
        with new_folder(target, force=True) as scratch:
            (scratch / "half").write_text("x")
            raise stop

    with pytest.raises(raised) as caught:
        write_half()
    if raised is OutputError:
        assert stop.strerror in str(caught.value)
    assert sorted(str(p) for p in tmp_path.rglob("*")) == before


def test_a_replacement_is_one_step(tmp_path, monkeypatch):
    """No moment without the earlier folder or the new one: killed then, a run would lose both."""
    target = tmp_path / "out"
    write(target, "old")
    monkeypatch.setattr(files, "_exchange_in_steps", lambda *paths: pytest.fail("in steps"))
    write(target, force=True)
    assert content(target)["plan.json"] == "new"


def test_a_system_that_cannot_replace_in_one_step(tmp_path, monkeypatch):
    target = tmp_path / "out"
    write(target, "old")
    monkeypatch.setattr(files, "_exchange", lambda *paths: False)
    write(target, force=True)
    assert content(target)["plan.json"] == "new"
    assert names(tmp_path) == ["out"]


@pytest.mark.parametrize("fails", [2, 3])
def test_failing_rename_restores_the_earlier_folder(tmp_path, monkeypatch, fails):
    """The first rename meets the earlier folder; of the two after it one fails."""
    monkeypatch.setattr(files, "_exchange", lambda *paths: False)
    target = tmp_path / "out"
    write(target, "old")
    original, calls = Path.rename, []

    def rename(self, to):
        calls.append(self)
        if len(calls) == fails:
            raise OSError(errno.EBUSY, "Device or resource busy")
        return original(self, to)

    monkeypatch.setattr(Path, "rename", rename)
    with pytest.raises(OutputError, match="busy"):
        write(target, force=True)
    assert content(target)["plan.json"] == "old"
    assert names(tmp_path) == ["out"]


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="root may write anywhere")
def test_unwritable_parent(tmp_path):
    tmp_path.chmod(0o500)
    try:
        with pytest.raises(OutputError, match="ermission"):
            write(tmp_path / "out")
    finally:
        tmp_path.chmod(0o700)


def test_unwritable_parent_for_anyone(tmp_path, monkeypatch):
    def refuse(self, *args, **options):
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(Path, "mkdir", refuse)
    with pytest.raises(OutputError, match="Permission denied"), new_folder(tmp_path / "out"):
        pytest.fail("the body must not run")


def test_what_others_call_alike_is_not_touched(tmp_path):
    (tmp_path / ".out.partial").mkdir()
    (tmp_path / ".out.partial-mine").mkdir()
    write(tmp_path / "out")
    assert names(tmp_path) == [".out.partial", ".out.partial-mine", "out"]


def test_what_a_killed_run_left_is_removed_and_a_living_ones_stays(tmp_path):
    for name in (".out.partial-4194300", ".out.partial-4194301-2", ".other.partial-4194302"):
        (tmp_path / name / "stl").mkdir(parents=True)
    (tmp_path / ".out.partial-4194303").write_text("half")
    with new_folder(tmp_path / "out") as scratch:  # of the run that lives
        (scratch / "plan.json").write_text(record("first"))
        write(tmp_path / "out", "second")
        lock = ".out.partial-0"
        assert names(tmp_path) == [".other.partial-4194302", lock, scratch.name, "out"]
        shutil.rmtree(tmp_path / "out")
    assert content(tmp_path / "out") == {"plan.json": "first"}
    assert names(tmp_path) == [".other.partial-4194302", "out"]


@pytest.mark.parametrize("force", [False, True])
def test_of_two_runs_one_wins_whole(tmp_path, force):
    """The second one ends between the first one's last look at the target and its rename."""
    target = tmp_path / "out"
    original = files._take_name

    def overtaken(*given, **options):
        files._take_name = original
        write(target, "second")
        original(*given, **options)

    files._take_name = overtaken
    try:
        if force:
            write(target, "first", force=True)
        else:
            with pytest.raises(OutputError, match="another run has written it meanwhile"):
                write(target, "first")
    finally:
        files._take_name = original
    won = "first" if force else "second"
    assert content(target) == {"plan.json": won, "stl/a.stl": won}
    assert names(tmp_path) == ["out"]


def test_two_writers_of_one_file_do_not_mix(tmp_path, monkeypatch):
    """Each has a scratch of its own; the last one to end has the file."""
    target, original = tmp_path / "page.html", Path.write_bytes

    def slowly(self, data):
        if data == b"first":
            files.write_whole(target, b"second")
        return original(self, data)

    monkeypatch.setattr(Path, "write_bytes", slowly)
    files.write_whole(target, b"first")
    assert target.read_bytes() == b"first"
    assert names(tmp_path) == ["page.html"]


def test_what_a_killed_run_left_within_a_plan_is_no_stranger(tmp_path):
    write(tmp_path / "out", "old")
    (tmp_path / "out" / ".plan.html.partial-4194300").write_text("half")
    write(tmp_path / "out", force=True)
    assert content(tmp_path / "out") == {"plan.json": "new", "stl/a.stl": "new"}


def test_a_folder_removed_while_it_is_written_is_not_taken_for_whole(tmp_path):
    write(tmp_path / "plan", "earlier")
    before = content(tmp_path / "plan")

    def write_anew():
        with new_folder(tmp_path / "plan", force=True) as scratch:
            (scratch / "plan.json").write_text(record("new"))
            shutil.rmtree(scratch)
            (scratch / "stl").mkdir(parents=True)  # as whoever writes into a folder of it does

    with pytest.raises(OutputError, match=r"has been removed; nothing was written"):
        write_anew()
    assert content(tmp_path / "plan") == before
    assert [path.name for path in tmp_path.iterdir()] == ["plan"]


# One run at a time; only files are files.


def claimed_elsewhere(target):
    """Start a process that claims a target until it is told to end."""
    code = (
        "import sys; from planner.formats.outputs import claimed\n"
        "with claimed(sys.argv[1]): print(flush=True); sys.stdin.read()"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code, str(target)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    process.stdout.readline()
    return process


@pytest.mark.parametrize("kill", [False, True])
def test_a_target_belongs_to_one_run(tmp_path, kill):
    with claimed_elsewhere(tmp_path / "out") as other:
        with pytest.raises(OutputError, match="another run is writing it"):
            write_whole(tmp_path / "out", b"mine")
        with pytest.raises(OutputError, match="another run is writing it"):
            write(tmp_path / "out")
        if kill:
            other.kill()
        else:
            other.stdin.close()
        other.wait()
    write_whole(tmp_path / "out", b"mine")
    assert names(tmp_path) == ["out"]


def test_a_claim_holds_within_its_process(tmp_path):
    with claimed(tmp_path / "out"), claimed(tmp_path / "x" / ".." / "out") as target:
        write_whole(target, b"mine")
    assert names(tmp_path) == ["out"]


def test_a_file_that_comes_meanwhile_is_not_replaced(tmp_path):
    with claimed(tmp_path / "out.csv", force=False):
        (tmp_path / "out.csv").write_text("mine")
        with pytest.raises(OutputError, match="exists already"):
            write_whole(tmp_path / "out.csv", b"new")
    assert (tmp_path / "out.csv").read_text() == "mine"


@pytest.mark.parametrize("force", [False, True])
def test_pipes_devices_and_folders_are_no_files(tmp_path, force):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    for path in (tmp_path / "pipe", "/dev/null"):
        with pytest.raises(OutputError, match="is a device or a pipe"):
            check_absent(path, force=force)
        with pytest.raises(OutputError, match="is a device or a pipe"):
            write_whole(path, b"x")
        with pytest.raises(OutputError, match="is a file"):
            check_target(path, force=force)
    with pytest.raises(OutputError, match="is a folder"):
        write_whole(tmp_path / "folder", b"x")
    assert (tmp_path / "pipe").is_fifo()


def test_links_to_files_are_followed(tmp_path):
    (tmp_path / "real.csv").write_text("old")
    (tmp_path / "link.csv").symlink_to("real.csv")
    write_whole(tmp_path / "link.csv", b"new")
    assert (tmp_path / "link.csv").is_symlink()
    assert (tmp_path / "real.csv").read_bytes() == b"new"


def test_a_link_to_nothing_needs_force(tmp_path):
    (tmp_path / "link").symlink_to("real")
    with pytest.raises(OutputError, match="a link to real, where nothing is"):
        check_absent(tmp_path / "link", force=False)
    with pytest.raises(OutputError, match="a link to real, where nothing is"):
        check_target(tmp_path / "link")
    write_whole(tmp_path / "link", b"new")
    assert (tmp_path / "real").read_bytes() == b"new"


def test_what_a_folder_holds_to_read(tmp_path):
    write(tmp_path / "plan")
    (tmp_path / "plan" / "mine.csv").write_text("no part of it")
    (tmp_path / "lab.csv").write_text("x")
    (tmp_path / "profiles").mkdir()
    (tmp_path / "profiles" / "a.csv").write_text("x")
    found = {path.relative_to(tmp_path).as_posix() for path in files_within(tmp_path)}
    assert found == {"lab.csv", "profiles/a.csv"}
    found = {path.relative_to(tmp_path).as_posix() for path in files_within(tmp_path / "plan")}
    assert found == {"plan/plan.json", "plan/stl/a.stl"}
