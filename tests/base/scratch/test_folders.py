"""Scratch folders: gone at the end of the work, after a killed process with the next one's; no others are touched."""

from __future__ import annotations

import errno
import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import pytest

from synthroads_addon.base.errors import OutputError
from synthroads_addon.base.files import output_folder
from synthroads_addon.base.scratch import folders, locks
from synthroads_addon.base.scratch.folders import (
    LOCK,
    remove_scratch_folders,
    scratch_folder,
    temporary_files_in_scratch,
)
from synthroads_addon.base.scratch.locks import Owner, is_dead, read_owner, this_process, try_lock
from tests.helpers.files.listed_folders import listed_entries

linux = pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
ROOT = Path(__file__).resolve().parents[3]
KILLED = """
import os, pathlib, signal, sys
from synthroads_addon.base.scratch.folders import scratch_folder
with scratch_folder(pathlib.Path(sys.argv[1])) as folder:
    (folder / "big").write_bytes(b"0" * 1000)
    (folder / "deep").mkdir()
    os.kill(os.getpid(), signal.SIGKILL)
"""


def left_by(content: Owner | str | None, parent: Path, age: float = 0.0) -> Path:
    """Make a scratch folder as another process would have left it; its lock file is `age` seconds old."""
    folder = parent / ".partial-4711-abcdefgh"
    folder.mkdir()
    (folder / "points").write_text("half")
    if content is not None:
        (folder / LOCK).write_text(content if isinstance(content, str) else content.to_json())
        os.utime(folder / LOCK, (time.time() - age,) * 2)
    return folder


def next_run(parent: Path) -> None:
    with scratch_folder(parent):
        pass


def test_a_folder_names_its_owner_and_is_removed_at_the_end(tmp_path: Path) -> None:
    with scratch_folder(tmp_path) as folder:
        assert folder.parent == tmp_path
        told = read_owner((folder / LOCK).read_text())
        assert told is not None
        assert (told.pid, told.host) == (os.getpid(), this_process().host)
        (folder / "a").mkdir()
        (folder / "a" / "b").write_text("c")
    assert list(tmp_path.iterdir()) == []


@linux
def test_the_next_run_removes_what_a_killed_process_left_and_not_what_a_living_one_has(tmp_path: Path) -> None:
    subprocess.run([sys.executable, "-c", KILLED, str(tmp_path)], cwd=ROOT, check=False)
    (left,) = tmp_path.iterdir()
    assert (left / "big").exists()
    with scratch_folder(tmp_path) as living:
        assert not left.exists()
        next_run(tmp_path)
        code = "import pathlib, sys; from synthroads_addon.base.scratch.folders import remove_leftovers as r; "
        code += "r(pathlib.Path(sys.argv[1]))"
        subprocess.run([sys.executable, "-c", code, str(tmp_path)], cwd=ROOT, check=True)
        assert living.exists()
    assert list(tmp_path.iterdir()) == []


def test_what_no_process_of_ours_left_stays(tmp_path: Path) -> None:
    mine = [tmp_path / name for name in (".partial-mine", "synthroads-pictures", "other")]
    for folder in mine:
        folder.mkdir()
    (full := tmp_path / ".partial-12-abcdefgh").mkdir()
    (full / "a.txt").write_text("of a user who likes such names")
    next_run(tmp_path)
    assert sorted(tmp_path.iterdir()) == sorted([*mine, full])


@linux
@pytest.mark.parametrize(
    ("changes", "dead"),
    [
        ({}, False),
        ({"start": 1}, True),  # the number is another process's now
        ({"pid": 2**22 + 5}, True),
        ({"boot": "another"}, True),
        ({"host": "another"}, False),  # it may live: nothing is known of it
        ({"host": "another", "boot": "another"}, False),
        ({"pid": 2**22 + 5, "space": "pid:[1]"}, False),  # another container's number
        ({"pid": 2**22 + 5, "space": ""}, True),  # written before there were any
    ],
)
def test_an_owner_without_locks_is_known_by_its_number_and_start(
    changes: dict[str, object], dead: bool, tmp_path: Path
) -> None:
    folder = left_by(replace(this_process(), **changes), tmp_path)  # type: ignore[arg-type]
    next_run(tmp_path)
    assert folder.exists() != dead


@linux
def test_an_owner_in_another_container_is_known_by_its_lock(tmp_path: Path) -> None:
    """Containers of one machine have other names and count processes anew, but one kernel frees their locks."""
    folder = left_by(replace(this_process(locked=True), host="container", pid=1, start=5), tmp_path)
    with (folder / LOCK).open("r+") as lock:
        assert try_lock(lock.fileno())
        next_run(tmp_path)
        assert folder.exists()
    next_run(tmp_path)
    assert not folder.exists()


@pytest.mark.parametrize(
    ("text", "age", "stays"), [("", 1.0, True), ("", 100.0, False), ('{"pid": "x"}', 100.0, False)]
)
def test_a_process_killed_while_it_named_itself_leaves_nothing_for_long(
    text: str, age: float, stays: bool, tmp_path: Path
) -> None:
    folder = left_by(text, tmp_path, age)
    next_run(tmp_path)
    assert folder.exists() == stays


def test_a_process_killed_before_it_named_itself_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / ".partial-4711-abcdefgh").mkdir()
    next_run(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_new_folder_that_another_takes_for_a_leftover_is_made_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make, taken = tempfile.mkdtemp, ["once"]

    def made(**options: str) -> str:
        name = make(**options)
        if taken:
            taken.pop()
            Path(name).rmdir()
        return name

    monkeypatch.setattr(folders.tempfile, "mkdtemp", made)
    with scratch_folder(tmp_path) as folder:
        assert (folder / LOCK).exists()


def test_a_full_disk_leaves_no_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(descriptor: int, content: bytes) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(folders.os, "write", full)
    with pytest.raises(OSError, match="No space"), scratch_folder(tmp_path):
        pass
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("room", [0, 20, 80, 100])
def test_a_limit_on_the_size_of_files_leaves_no_folder(
    room: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The file that names the folders, and the lock, take as many bytes as there is room for, and fail after that."""
    write, limited = os.write, {}

    def limited_write(descriptor: int, data: bytes) -> int:
        left = room - limited.get(descriptor, 0)
        if left <= 0:
            raise OSError(errno.EFBIG, os.strerror(errno.EFBIG))
        limited[descriptor] = limited.get(descriptor, 0) + min(left, len(data))
        return write(descriptor, data[:left])

    journal = os.open(tmp_path / "journal", os.O_RDWR | os.O_CREAT)
    monkeypatch.setattr(folders, "_journal", journal)
    monkeypatch.setattr(os, "write", limited_write)
    target = tmp_path / ("out" * 10)
    with pytest.raises(OutputError, match="File too large"), output_folder(target, [], overwrite=False):
        pytest.fail("there was no room for a lock")
    os.close(journal)
    assert [path.name for path in tmp_path.iterdir()] == ["journal"]


def test_before_the_process_ends_at_once_its_folders_go(tmp_path: Path) -> None:
    with scratch_folder(tmp_path) as folder:
        remove_scratch_folders()
        assert not folder.exists()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_a_forked_process_leaves_the_folders_of_its_parent(tmp_path: Path) -> None:
    with scratch_folder(tmp_path) as folder:
        child = os.fork()
        if child == 0:
            remove_scratch_folders()
            os._exit(0)
        os.waitpid(child, 0)
        assert folder.exists()


def test_temporary_files_of_the_process_and_its_children_are_in_one_scratch_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    before = os.environ.get("TMPDIR")
    with temporary_files_in_scratch():
        (folder,) = tmp_path.iterdir()
        assert tempfile.gettempdir() == str(folder)
        code = "import tempfile; print(tempfile.mkdtemp())"
        told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
        assert Path(told.strip()).parent == folder
    assert (os.environ.get("TMPDIR"), tempfile.tempdir) == (before, str(tmp_path))
    assert list(tmp_path.iterdir()) == []
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "nowhere"))
    with temporary_files_in_scratch():
        assert os.environ.get("TMPDIR") == before


def test_a_system_without_boot_ids_still_knows_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(locks, "_boot_id", lambda: "")
    monkeypatch.setattr(locks, "_start_of", lambda pid: 0 if pid == os.getpid() else None)
    mine = this_process()
    assert not is_dead(mine, None)
    assert is_dead(replace(mine, pid=mine.pid + 1), None)
    assert json.loads(mine.to_json())["boot"] == ""


def test_a_removal_that_is_cut_off_is_ended_before_the_process_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As by a second signal."""
    tree, cuts = folders.shutil.rmtree, ["once"]

    def cut(folder: Path, ignore_errors: bool) -> None:
        if cuts:
            cuts.pop()
            raise KeyboardInterrupt
        tree(folder, ignore_errors=ignore_errors)

    monkeypatch.setattr(folders.shutil, "rmtree", cut)
    with pytest.raises(KeyboardInterrupt), scratch_folder(tmp_path):
        pass
    remove_scratch_folders()
    assert list(tmp_path.iterdir()) == []


def test_a_full_folder_is_listed_by_each_process_but_not_for_each_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for number in range(1000):
        (tmp_path / f"{number}").touch()
    left = left_by(replace(this_process(), pid=2**22 + 5), tmp_path)
    listed = listed_entries(monkeypatch)
    for _ in range(200):
        next_run(tmp_path)
    assert not left.exists()
    assert sum(listed) <= 200 * 60
    assert len(listed) > 1, "it is listed again after a while"
