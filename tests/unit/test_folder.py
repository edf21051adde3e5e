"""Output folders are whole or absent, and nothing foreign is ever replaced."""

import errno
import os
import re
import shutil
from pathlib import Path

import pytest

from planner.errors import OutputError
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
        if "replaced" in str(path):
            raise OSError(errno.EBUSY, "Device or resource busy")
        original(path, **options)

    monkeypatch.setattr(shutil, "rmtree", refuse)
    with pytest.raises(OutputError, match=r"is written, but .*busy.*; delete .*\.out\.replaced"):
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


@pytest.mark.parametrize("fails", [1, 2])
def test_failing_rename_restores_the_earlier_folder(tmp_path, monkeypatch, fails):
    """Of the two renames of a replacement, the first or the second fails."""
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


def test_stale_scratch_is_not_touched(tmp_path):
    """A killed run may have left its scratch folder; another run may be using it."""
    (tmp_path / ".out.partial").mkdir()
    write(tmp_path / "out")
    assert names(tmp_path) == [".out.partial", "out"]
