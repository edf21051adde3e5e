"""Output folders are whole or absent, and nothing foreign is ever replaced."""

import errno
import os
import re
import shutil
from pathlib import Path

import pytest

from planner.errors import OutputError
from planner.formats import files
from planner.formats.files import check_target, new_folder


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def content(folder):
    return {
        str(path.relative_to(folder)): path.read_text()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def write(target, text="new", **options):
    with new_folder(target, **options) as scratch:
        (scratch / "stl").mkdir()
        (scratch / "stl" / "a.stl").write_text(text)
        (scratch / "plan.json").write_text(text)


def test_folder_appears_whole(tmp_path):
    target = tmp_path / "out"
    with new_folder(target) as scratch:
        (scratch / "plan.json").write_text("x")
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


@pytest.mark.parametrize("force", [False, True])
@pytest.mark.parametrize(
    ("stranger", "named"),
    [
        ("notes.txt", "notes.txt"),
        ("stl/readme.md", "stl/readme.md"),
        ("photos/a.stl", "photos/, photos/a.stl"),
        ("stl/old/a.stl", "stl/old/, stl/old/a.stl"),
        ("HOWTO.md.bak", "HOWTO.md.bak"),
        ("a.stl", "a.stl"),
        (".hidden", ".hidden"),
    ],
)
def test_what_others_put_into_a_plan_stays(tmp_path, stranger, named, force):
    target = tmp_path / "out"
    write(target, "old")
    (target / stranger).parent.mkdir(exist_ok=True)
    (target / stranger).write_text("mine")
    before = content(target)
    with pytest.raises(OutputError, match=f"holds {re.escape(named)}, which planner did not write"):
        write(target, force=force)
    assert content(target) == before
    assert names(tmp_path) == ["out"]


def test_a_file_named_stl_is_no_plan_file(tmp_path):
    write(tmp_path / "out")
    shutil.rmtree(tmp_path / "out" / "stl")
    (tmp_path / "out" / "stl").write_text("mine")
    with pytest.raises(OutputError, match="holds stl, which"):
        check_target(tmp_path / "out", force=True)


def test_a_link_in_a_plan_is_no_plan_file(tmp_path):
    target = tmp_path / "out"
    write(target, "old")
    (tmp_path / "elsewhere").mkdir()
    (target / "part.3mf").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(OutputError, match=r"holds part\.3mf, which"):
        check_target(target, force=True)


def test_many_strangers_are_counted(tmp_path):
    write(tmp_path / "out")
    for number in range(8):
        (tmp_path / "out" / f"{number}.txt").write_text("mine")
    with pytest.raises(OutputError, match=r"0\.txt, .*4\.txt and 3 more, which"):
        check_target(tmp_path / "out", force=True)


def test_all_that_planner_writes_is_replaced(tmp_path):
    target = tmp_path / "out"
    write(target, "old")
    for own in ("part.3mf", "HOWTO.md", "report.html", "stl/b.stl"):
        (target / own).write_text("old")
    write(target, force=True)
    assert content(target) == {"plan.json": "new", "stl/a.stl": "new"}


def test_what_comes_while_writing_stays(tmp_path):
    target = tmp_path / "out"
    write(target, "old")

    def write_slowly():
        with new_folder(target, force=True) as scratch:
            (scratch / "plan.json").write_text("new")
            (target / "notes.txt").write_text("mine")

    with pytest.raises(OutputError, match=r"notes\.txt"):
        write_slowly()
    assert content(target) == {"notes.txt": "mine", "plan.json": "old", "stl/a.stl": "old"}
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


def test_file_and_missing_parent(tmp_path):
    (tmp_path / "file").write_text("x")
    with pytest.raises(OutputError, match="is a file"):
        check_target(tmp_path / "file", force=True)
    with pytest.raises(OutputError, match="there is no folder"):
        check_target(tmp_path / "no" / "out")


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
        (scratch / "plan.json").write_text("first")
        write(tmp_path / "out", "second")
        assert names(tmp_path) == [".other.partial-4194302", scratch.name, "out"]
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
    (tmp_path / "plan").mkdir()
    (tmp_path / "plan/plan.json").write_text("earlier")

    def write():
        with new_folder(tmp_path / "plan", force=True) as scratch:
            (scratch / "plan.json").write_text("new")
            shutil.rmtree(scratch)
            (scratch / "stl").mkdir(parents=True)  # as whoever writes into a folder of it does

    with pytest.raises(OutputError, match=r"has been removed; nothing was written"):
        write()
    assert (tmp_path / "plan/plan.json").read_text() == "earlier"
    assert [path.name for path in tmp_path.iterdir()] == ["plan"]
