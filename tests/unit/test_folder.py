"""Output folders are whole or absent, and nothing foreign is ever replaced."""

import errno
import os
from pathlib import Path

import pytest

from planner.errors import OutputError
from planner.formats.folder import check_target, new_folder


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
    with pytest.raises(OutputError, match="exists already; replace it with --force"):
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
