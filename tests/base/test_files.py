"""Output folders: nothing half-written, nothing of the user's touched."""

import errno
import os
import sys
from pathlib import Path

import pytest

from synthroads_addon.base.errors import OutputError
from synthroads_addon.base.files import check_file_target, files_below, made_folder, output_folder, write_file
from synthroads_addon.base.scratch import folders
from synthroads_addon.base.scratch.folders import ASIDE, record_folders_in, remove_recorded_folders, scratch_folder


def test_files_appear_at_the_end(tmp_path: Path) -> None:
    target = tmp_path / "out"
    with output_folder(target, ["a.txt"], overwrite=False) as folder:
        (folder / "a.txt").write_text("new")
        assert not (target / "a.txt").exists()
    assert sorted(p.name for p in target.iterdir()) == ["a.txt"]


def test_stopped_work_leaves_nothing(tmp_path: Path) -> None:
    def stopped() -> None:
        with output_folder(tmp_path / "out", ["a.txt"], False) as folder:
            (folder / "a.txt").write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stopped()
    assert list(tmp_path.iterdir()) == []


def test_work_that_is_stopped_while_its_files_appear_leaves_all_of_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    replace, stops = Path.replace, ["first"]

    def stopped(self: Path, target: Path) -> Path:
        moved = replace(self, target)
        if stops:
            stops.pop()
            raise KeyboardInterrupt
        return moved

    def work() -> None:
        with output_folder(tmp_path / "out", [], False) as folder:
            for name in ("a.txt", "b.txt", "c.txt"):
                (folder / name).write_text(name)

    monkeypatch.setattr(Path, "replace", stopped)
    with pytest.raises(KeyboardInterrupt):
        work()
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["a.txt", "b.txt", "c.txt"]


def test_the_report_is_the_mark_that_all_is_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An old one goes before anything else, the new one comes last; each file is on the disk before it has its name."""
    replace, sync, done = Path.replace, os.fsync, []

    def moved(self: Path, target: Path) -> Path:
        done.append(f"{self.name} {'away' if target.parent.name == 'old' else 'there'}")
        return replace(self, target)

    def synced(descriptor: int) -> None:
        done.append(f"{Path(f'/proc/self/fd/{descriptor}').readlink().name} synced")
        sync(descriptor)

    names = ["a.txt", "report.json", "z.txt"]
    for name in names:
        (tmp_path / name).write_text("old")
    monkeypatch.setattr(Path, "replace", moved)
    if Path("/proc/self/fd").exists():
        monkeypatch.setattr(os, "fsync", synced)
    with output_folder(tmp_path, names, True) as folder:
        for name in names:
            (folder / name).write_text("new")
    moves = [line for line in done if not line.endswith("synced")]
    assert moves[0] == "report.json away"
    assert moves[-1] == "report.json there"
    assert {name: (tmp_path / name).read_text() for name in names} == dict.fromkeys(names, "new")
    assert sorted(path.name for path in tmp_path.iterdir()) == names
    if Path("/proc/self/fd").exists():
        assert sorted(done[:3]) == [f"{name} synced" for name in names]
        assert done[-3:] == [f"{tmp_path.name} synced", "report.json there", f"{tmp_path.name} synced"]


@pytest.mark.parametrize("at", range(5))
def test_where_one_file_cannot_be_moved_all_stands_as_it_was(
    at: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    replace, calls = Path.replace, []

    def moved(self: Path, target: Path) -> Path:
        calls.append(self.name)
        if len(calls) == at + 1:
            raise OSError(errno.ENOSPC, "No space left on device")
        return replace(self, target)

    for name in ("b.txt", "c.txt", "report.json"):
        (tmp_path / name).write_text("old")
    monkeypatch.setattr(Path, "replace", moved)

    def work() -> None:
        with output_folder(tmp_path, [], True) as folder:
            for name in ("a.txt", "b.txt", "report.json"):
                (folder / name).write_text("new")

    with pytest.raises(OutputError, match="No space"):
        work()
    there = {path.name: path.read_text() for path in tmp_path.iterdir()}
    assert there == {"b.txt": "old", "c.txt": "old", "report.json": "old"}


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
@pytest.mark.parametrize("moves", range(8))
def test_a_move_that_was_killed_is_finished_by_the_next_work(tmp_path: Path, moves: int) -> None:
    """Killed after each of its moves: three old files go aside, four new ones come in."""
    for name in ("a.txt", "b.txt", "report.json"):
        (tmp_path / name).write_text("old")
    child = os.fork()
    if child == 0:
        replace, done = Path.replace, []

        def killed(self: Path, target: Path) -> Path:
            if len(done) == moves:
                os._exit(9)
            done.append(target)
            return replace(self, target)

        Path.replace = killed  # type: ignore[method-assign, assignment]
        with output_folder(tmp_path, [], overwrite=True) as folder:
            for name in ("a.txt", "b.txt", "c.txt", "report.json"):
                (folder / name).write_text("new")
        os._exit(0)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == (9 if moves < 7 else 0)
    with output_folder(tmp_path, [], overwrite=True):
        pass
    texts = {path.name: path.read_text() for path in tmp_path.iterdir()}
    assert texts == dict.fromkeys(("a.txt", "b.txt", "c.txt", "report.json"), "new")


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_what_was_aside_is_put_back_where_the_new_file_is_gone(tmp_path: Path) -> None:
    child = os.fork()
    if child == 0:
        with scratch_folder(tmp_path) as folder:
            (folder / ASIDE).mkdir()
            (folder / ASIDE / "a.txt").write_text("old")
            os._exit(9)
    os.waitpid(child, 0)
    with output_folder(tmp_path, [], overwrite=True):
        pass
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"a.txt": "old"}


def test_present_files_need_overwrite_and_others_stay(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("old")
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(OutputError, match="--overwrite"), output_folder(tmp_path, ["a.txt"], False):
        pass
    with output_folder(tmp_path, ["a.txt"], True) as folder:
        (folder / "a.txt").write_text("new")
    assert (tmp_path / "a.txt").read_text() == "new"
    assert (tmp_path / "mine.txt").read_text() == "mine"


def test_a_file_in_the_way_is_named(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("a file")
    with pytest.raises(OutputError, match="--output"), output_folder(tmp_path / "out" / "x", [], False):
        pass


def test_full_disk_is_one_clear_line(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="No space left"), output_folder(tmp_path / "out", [], False):
        raise OSError(errno.ENOSPC, "No space left on device")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("fault", [KeyboardInterrupt, OSError])
def test_a_file_whose_writing_is_stopped_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fault: type[BaseException]
) -> None:
    def stopped(descriptor: int) -> None:
        raise fault

    (tmp_path / "a.txt").write_text("old")
    monkeypatch.setattr(os, "fsync", stopped)
    with pytest.raises((KeyboardInterrupt, OutputError)):
        write_file(tmp_path / "a.txt", b"new", overwrite=True)
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]
    assert (tmp_path / "a.txt").read_text() == "old"


def test_folders_that_are_links_are_entered_once(tmp_path: Path) -> None:
    """Scenes of a data set may lie on another disk; a link that leads back, or to what was there, adds nothing."""
    here, there = tmp_path / "set", tmp_path / "disk"
    for folder in (here / "a", there / "b" / "deep"):
        folder.mkdir(parents=True)
        (folder / "cloud.laz").touch()
    (here / "b").symlink_to(there / "b", target_is_directory=True)
    (there / "b" / "loop").symlink_to(here, target_is_directory=True)
    (here / "0-again").symlink_to(here / "a", target_is_directory=True)
    (here / "gone").symlink_to(there / "no-such", target_is_directory=True)
    found = [path.relative_to(here).as_posix() for path in files_below(here)]
    assert found == ["gone", "a/cloud.laz", "b/deep/cloud.laz"]


@pytest.mark.skipif(sys.platform != "linux", reason="a process of its own does the work on Linux alone")
def test_after_a_kill_no_folder_that_was_made_for_files_is_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(folders, "_journal", None)  # is put back afterwards
    (tmp_path / "mine").mkdir()
    record_folders_in(journal := os.memfd_create("journal"))
    places = [tmp_path / "new" / "deep", tmp_path / "mine" / "new"]
    entered = [made_folder(place) for place in places]
    for place, context in zip(places, entered, strict=True):
        context.__enter__()  # and never left: the process is killed in it
        assert place.is_dir()
    remove_recorded_folders(journal)
    os.close(journal)
    assert [path.name for path in tmp_path.rglob("*")] == ["mine"]


def test_a_file_target_is_judged_without_making_anything(tmp_path: Path) -> None:
    (tmp_path / "there.txt").write_text("mine")
    check_file_target(tmp_path / "new" / "deep" / "a.txt", ending=".txt")
    check_file_target(tmp_path / "there.txt", overwrite=True)
    cases = {
        tmp_path / "a.png": "must end in .txt",
        tmp_path: "must end in .txt",
        tmp_path / "there.txt": "is there already; --overwrite replaces it",
        tmp_path / "there.txt" / "a.txt": "cannot be written",
    }
    for path, message in cases.items():
        with pytest.raises(OutputError, match=message):
            check_file_target(path, ending=".txt")
    with pytest.raises(OutputError, match="is a folder"):
        check_file_target(tmp_path, overwrite=True)
    assert [path.name for path in tmp_path.iterdir()] == ["there.txt"]
