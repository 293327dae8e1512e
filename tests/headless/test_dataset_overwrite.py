"""A data set in the place of another: the old one goes as a whole, what is the user's stays, and a crash harms neither.

The scenes are made by a stand-in that writes small files: no Blender.
"""

from __future__ import annotations

import json
import os
import shutil
import statistics
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from headless.commands import command
from synthroads_addon.base.errors import InputError, OutputError
from synthroads_addon.base.scratch import locks
from synthroads_addon.base.scratch.locks import this_process
from synthroads_addon.dataset import manifest as manifest_module
from synthroads_addon.dataset.manifest import (
    RECORDS,
    Manifest,
    SceneEntry,
    append_record,
    faults,
    file_entries,
    read_manifest,
    write_manifest,
)
from synthroads_addon.dataset.recipe import Recipe
from synthroads_addon.jobs.dataset import run as run_module
from synthroads_addon.jobs.dataset.processes import Outcome
from synthroads_addon.jobs.dataset.run import DatasetRun
from synthroads_addon.jobs.dataset.scene import published_folders
from synthroads_addon.jobs.dataset.scene_files import DONE, FILES

OLD = {"title": "Old", "seed": 1, "layouts": ["pointcept"], "groups": [{"name": "a", "scenes": 3}]}
NEW = {"title": "New", "seed": 2, "layouts": ["pointcept"], "groups": [{"name": "b", "scenes": 2}]}


def make(folder: Path, recipe: dict[str, Any], **options: Any) -> None:
    """Make a data set of small files."""
    DatasetRun(Recipe.from_dict(recipe), folder, **options).run(small_scenes)


def small_scenes(folders: list[str]) -> Iterator[Outcome]:
    for task_folder in map(Path, folders):
        folder = task_folder / "attempt-1"
        folder.mkdir()
        shutil.copy(task_folder / "task.json", folder)
        task = json.loads((folder / "task.json").read_text())
        name, files = task["name"], folder / FILES
        for path in (f"scenes/{name}/cloud.laz", f"pointcept/classes-5/train/{name}-n00e00/coord.npy"):
            (files / path).parent.mkdir(parents=True)
            (files / path).write_text(f"{task['scenario']['seed']} {path}")
        done = {"points": 5, "length": 10.0, "classes": {"ground": 5}, "files": file_entries(files)}
        done["folders"] = [path.relative_to(files).as_posix() for path in published_folders(files)]
        (folder / DONE).write_text(json.dumps(done))
        (folder / "report.json").write_text("{}")
        yield Outcome(folder)


def content(folder: Path) -> dict[str, bytes]:
    """Return every file of a data set, but its lock."""
    files = [path for path in folder.rglob("*") if path.is_file() and path.name != ".lock"]
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


def folders(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_dir()}


@pytest.fixture
def old(tmp_path: Path) -> Path:
    make(tmp_path / "set", OLD)
    return tmp_path / "set"


@pytest.fixture
def fresh(tmp_path: Path) -> Path:
    """The new set where nothing was before."""
    make(tmp_path / "fresh", NEW)
    return tmp_path / "fresh"


def test_the_new_set_is_as_if_nothing_had_been_there(old: Path, fresh: Path) -> None:
    with pytest.raises(OutputError, match="--resume continues it, --overwrite replaces it"):
        make(old, NEW)
    make(old, NEW, overwrite=True)
    assert content(old) == content(fresh)
    assert folders(old) == folders(fresh)
    make(old, NEW, overwrite=True)
    assert content(old) == content(fresh), "and once more, of the same recipe"


def test_what_is_not_the_sets_stays(old: Path, fresh: Path) -> None:
    own = {"notes.txt": b"1", "scenes/mine/cloud.laz": b"2", "logs/mine.txt": b"3", "pointcept/classes-5/train/x": b"4"}
    own |= {"pointcept/classes-5/train/mine/coord.npy": b"5", "semantickitti/classes-5/sequences/99/a": b"6"}
    for name, data in own.items():
        (old / name).parent.mkdir(parents=True, exist_ok=True)
        (old / name).write_bytes(data)
    make(old, NEW, overwrite=True)
    assert content(old) == content(fresh) | own
    make(old, NEW, resume=True)
    assert content(old) == content(fresh) | own


@pytest.mark.parametrize("place", ["scenes/a-02/notes.txt", "pointcept/classes-5/train/a-01-n00e00/sub/notes.txt"])
def test_a_file_of_ones_own_among_a_scenes_is_named_and_nothing_is_touched(old: Path, place: str) -> None:
    (old / place).parent.mkdir(exist_ok=True)
    (old / place).write_text("mine")
    before = content(old)
    with pytest.raises(OutputError, match=f"holds {place}, not a part of the data set; move it away"):
        make(old, NEW, overwrite=True)
    assert content(old) == before
    assert not faults(old, read_manifest(old).scenes)


def test_a_place_that_the_new_set_needs_and_somebody_has_is_named(old: Path) -> None:
    (old / "scenes" / "b-01").mkdir()
    (old / "scenes" / "b-01" / "mine.txt").touch()
    before = content(old)
    with pytest.raises(OutputError, match="holds scenes/b-01, not a part of a scene; move it away"):
        make(old, NEW, overwrite=True)
    assert content(old) == before


@pytest.mark.parametrize("text", [None, "{}", '{"name": "a web page", "icons": []}', "no JSON"])
def test_a_folder_that_no_data_set_made_is_refused(tmp_path: Path, text: str | None) -> None:
    (tmp_path / "set" / "scenes" / "a-01").mkdir(parents=True)
    (tmp_path / "set" / "scenes" / "a-01" / "cloud.laz").write_text("mine")
    if text is not None:
        (tmp_path / "set" / "manifest.json").write_text(text)
    before = content(tmp_path / "set")
    with pytest.raises(InputError, match="holds other files" if text is None else "manifest.json"):
        make(tmp_path / "set", NEW, overwrite=True)
    assert content(tmp_path / "set") == before


@pytest.mark.parametrize("name", ["../mine", "/tmp/mine", "scenes/../../mine", "scenes", "scenes/a-01/x", "mine/x"])
def test_a_manifest_that_names_places_of_others_is_refused(old: Path, name: str) -> None:
    data = json.loads((old / "manifest.json").read_text())
    data["scenes"][0]["folders"] = [name]
    (old / "manifest.json").write_text(json.dumps(data))
    (old.parent / "mine").mkdir()
    before = content(old.parent)
    with pytest.raises(InputError, match="is not a folder of a data set"):
        make(old, NEW, overwrite=True)
    data["scenes"][0]["name"] = "../../mine"
    (old / "manifest.json").write_text(json.dumps(data))
    with pytest.raises(InputError, match="can't be the name of a scene"):
        make(old, NEW, overwrite=True)
    assert content(old.parent).keys() == before.keys()


def test_of_a_scene_that_is_a_link_the_link_alone_goes(old: Path, fresh: Path, tmp_path: Path) -> None:
    (old / "scenes" / "a-01").rename(tmp_path / "elsewhere")
    (old / "scenes" / "a-01").symlink_to(tmp_path / "elsewhere", target_is_directory=True)
    (tmp_path / "elsewhere" / "mine.txt").touch()
    assert not faults(old, read_manifest(old).scenes), "it counts as a folder does"
    make(old, OLD, resume=True)
    assert (old / "scenes" / "a-01").is_symlink()
    make(old, NEW, overwrite=True)
    assert content(old) == content(fresh)
    assert {path.name for path in (tmp_path / "elsewhere").iterdir()} == {"cloud.laz", "mine.txt"}


def test_a_link_at_a_place_of_a_scene_that_is_missing_is_replaced(old: Path, tmp_path: Path) -> None:
    """As where a run was killed before the manifest named the scene."""
    whole = content(old)
    data = json.loads((old / "manifest.json").read_text())
    del data["scenes"][0]
    (old / "manifest.json").write_text(json.dumps(data))
    (old / "scenes" / "a-01").rename(tmp_path / "elsewhere")
    (old / "scenes" / "a-01").symlink_to(tmp_path / "elsewhere", target_is_directory=True)
    make(old, OLD, resume=True)
    assert content(old) == whole
    assert (tmp_path / "elsewhere" / "cloud.laz").is_file()


class Crash(BaseException):
    """The machine has lost its power."""


def crashing(what: Callable[..., Any], after: int) -> Callable[..., Any]:
    """Return a function that works some times and then crashes for good."""
    return raising(what, after, Crash)


def raising(what: Callable[..., Any], after: int, fault: type[BaseException]) -> Callable[..., Any]:
    """Return a function that works some times and then raises a fault."""
    calls: list[int] = []

    def called(*arguments: Any, **options: Any) -> Any:
        calls.append(1)
        if len(calls) > after:
            raise fault
        return what(*arguments, **options)

    return called


CRASHES = [("begin_removal", 0), ("finish_removal", 1), *(("write_atomically", after) for after in (0, 1))]
CRASHES += [("remove", after) for after in (0, 1, 5)]
CRASHES += [*(("write_manifest", after) for after in (0, 1, 2)), *(("append_record", after) for after in (0, 1))]
"""Where it crashes: in which function, after how many calls."""


@pytest.mark.parametrize(("place", "after"), CRASHES)
@pytest.mark.parametrize("goes_on", ["resume", "overwrite"])
def test_after_a_crash_no_scene_that_the_manifest_names_is_missing(
    old: Path, fresh: Path, place: str, after: int, goes_on: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    home = manifest_module if place == "remove" else run_module
    before = content(old)
    with monkeypatch.context() as patched:
        patched.setattr(home, place, crashing(getattr(home, place), after))
        patched.setattr(DatasetRun, "_abandon", lambda self: None)  # nobody cleans up
        with pytest.raises(Crash):
            make(old, NEW, overwrite=True)
    manifest = read_manifest(old)
    assert not faults(old, manifest.scenes)
    if manifest.title == "Old":
        assert {name: data for name, data in content(old).items() if name != manifest_module.REPLACED} == before
        make(old, OLD, resume=True)
        assert content(old) == before
        goes_on = "overwrite"
    make(old, NEW, **{goes_on: True})
    assert content(old) == content(fresh)
    assert folders(old) == folders(fresh)


def test_nothing_is_removed_where_the_scheduler_does_not_answer(
    old: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("synthroads_addon.jobs.dataset.cluster._ANSWER", 1.0)
    recipe = tmp_path / "new.json"
    recipe.write_text(json.dumps(NEW))
    before = content(old)
    words = [str(recipe), "--output", str(old), "--overwrite", "--scheduler", "tcp://127.0.0.1:1"]
    assert command("dataset", words) == 2
    assert "no scheduler answers there" in capsys.readouterr().err
    assert content(old) == before


def test_a_scene_is_recorded_when_it_is_done_and_what_stands_is_told_at_any_time(tmp_path: Path) -> None:
    """Also to whoever reads the folder meanwhile; a record that isn't whole counts for nothing."""
    folder, seen = tmp_path / "set", []

    def watched(folders: list[str]) -> Iterator[Outcome]:
        for outcome in small_scenes(folders):
            seen.append([scene.name for scene in read_manifest(folder).scenes])
            yield outcome

    DatasetRun(Recipe.from_dict(OLD), folder).run(watched)
    assert seen == [[], ["a-01"], ["a-01", "a-02"]]
    assert not (folder / RECORDS).exists()
    whole = content(folder)
    scenes = read_manifest(folder).scenes
    data = json.loads((folder / "manifest.json").read_text())
    (folder / "manifest.json").write_text(json.dumps({**data, "scenes": data["scenes"][:1], "complete": False}))
    append_record(folder, scenes[1])
    with (folder / RECORDS).open("a") as file:
        file.write(json.dumps(scenes[2].to_dict())[:-9])
    assert [scene.name for scene in read_manifest(folder).scenes] == ["a-01", "a-02"]
    make(folder, OLD, resume=True)
    assert content(folder) == whole


@pytest.mark.parametrize(
    ("fault", "recorded", "stand"), [(KeyboardInterrupt, False, 3), (KeyboardInterrupt, True, 3), (OSError, False, 2)]
)
def test_a_run_that_is_stopped_leaves_whole_scenes_and_nothing_else(
    tmp_path: Path, fault: type[BaseException], recorded: bool, stand: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before or after it records its third scene, whose folders are in their places; or that can't be recorded."""
    folder = tmp_path / "set"

    def stopped(folder: Path, entry: SceneEntry) -> None:
        if recorded or entry.name != "a-03":
            append_record(folder, entry)
        if entry.name == "a-03":
            raise fault

    with monkeypatch.context() as patched:
        patched.setattr(run_module, "append_record", stopped)
        with pytest.raises((KeyboardInterrupt, OutputError)):
            make(folder, OLD)
    names = ["a-01", "a-02", "a-03"][:stand]
    scenes = read_manifest(folder).scenes
    assert [scene.name for scene in scenes] == names
    assert not faults(folder, scenes)
    assert sorted(path.name for path in (folder / "scenes").iterdir()) == names
    assert {path.name for path in folder.glob(".*")} == {".lock"}
    make(folder, OLD, resume=True)
    make(tmp_path / "whole", OLD)
    assert content(folder) == content(tmp_path / "whole")


def test_a_run_that_is_killed_before_its_first_scene_can_be_resumed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Killed before its recipe stands in the folder, and with a manifest that was being written."""
    folder = tmp_path / "set"
    with monkeypatch.context() as patched:
        patched.setattr(run_module, "write_atomically", raising(run_module.write_atomically, 0, KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            make(folder, OLD)
    make(folder, OLD, resume=True)
    other = tmp_path / "other"
    other.mkdir()
    (other / ".manifest.json.part").write_text('{"type"')
    make(other, OLD)
    assert content(folder) == content(other)


def test_the_manifest_is_written_twice_however_many_scenes_there_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written: list[int] = []

    def counted(folder: Path, manifest: Manifest) -> None:
        written.append(len(manifest.scenes))
        write_manifest(folder, manifest)

    monkeypatch.setattr(run_module, "write_manifest", counted)
    make(tmp_path / "set", {**OLD, "groups": [{"name": "a", "scenes": 5}]})
    assert written == [0, 5]


def written() -> int:
    """Return how many bytes this process has written into files so far."""
    return int(Path("/proc/self/io").read_text().split("wchar:")[1].split()[0])


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/io").exists(), reason="bytes that were written are counted in /proc")
def test_the_last_quarter_of_a_thousand_scenes_costs_no_more_than_the_first(tmp_path: Path) -> None:
    """In time of the processor and in bytes: by the clock it depends on what else the machine and its disk do."""
    costs: dict[str, list[float]] = {"seconds": [], "bytes": []}

    def measured(folders: list[str]) -> Iterator[Outcome]:
        for outcome in small_scenes(folders):
            begun, before = time.process_time(), written()
            yield outcome
            costs["bytes"].append(written() - before)
            costs["seconds"].append(time.process_time() - begun)

    recipe = {**OLD, "groups": [{"name": "a", "scenes": 1000}]}
    DatasetRun(Recipe.from_dict(recipe), tmp_path / "set").run(measured)
    for name, each in costs.items():
        first, last = (statistics.median(each[begin : begin + 250]) for begin in (0, 750))
        print(f"{name} of a scene: {first:g} in the first quarter, {last:g} in the last")
        assert last <= 1.5 * first, name


def test_the_cost_of_thousands_of_scenes_is_worked_out_from_a_finished_set(old: Path) -> None:
    """Three scenes within half an hour on two cores; each has two files of some bytes."""
    from studies.costs.dataset import costs

    os.utime(old / "recipe.json", (0.0, 1000.0))
    os.utime(old / "manifest.json", (0.0, 2800.0))
    table = {name: figures for name, *figures in costs(old, 30_000, 2)}
    assert table["core hours"] == ["0.333", "10,000"]
    assert table["files"] == ["2", "60,000"]
    size = sum(path.stat().st_size for path in old.glob("scenes/*/*")) / 3
    assert size > 0.0
    assert table["`scenes/`"] == ["0 MB", f"{size * 30_000 / 1e9:,.0f} GB"]
    assert table["`manifest.json`"][1] == f"{(old / 'manifest.json').stat().st_size * 1e4 / 1e9:.2f} GB"


def test_a_disk_without_locks_still_keeps_another_run_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As Lustre and some NFS mounts are: not every fault of a lock is another run."""
    monkeypatch.setattr(locks, "try_lock", lambda descriptor: None)
    folder = tmp_path / "set"

    def disturbed(folders: list[str]) -> Iterator[Outcome]:
        with pytest.raises(OutputError, match=f"another run is at work in it: process {os.getpid()} of "):
            make(folder, OLD, resume=True)
        yield from small_scenes(folders)

    DatasetRun(Recipe.from_dict(OLD), folder).run(disturbed)
    (folder / ".lock").write_text(replace(this_process(), host="node7").to_json())
    with pytest.raises(OutputError, match=r"another run may be at work in it: process \d+ of node7 .*remove .*\.lock"):
        make(folder, OLD, resume=True)
    (folder / ".lock").write_text(replace(this_process(), pid=2**22 + 5).to_json())
    make(folder, OLD, resume=True)


@pytest.mark.parametrize("other", ["--resume", "--verify"])
def test_what_contradicts_it_is_refused_by_name(old: Path, other: str, capsys: pytest.CaptureFixture[str]) -> None:
    before = content(old)
    assert command("dataset", ["small-roads", "--output", str(old), "--overwrite", other]) == 2
    assert capsys.readouterr().err == f"error: --overwrite: can't be given with {other}, which keeps existing scenes\n"
    assert content(old) == before


def test_the_command_replaces_a_set(
    old: Path, fresh: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("synthroads_addon.jobs.dataset.make.local_processes", lambda jobs: small_scenes)
    recipe = tmp_path / "new.json"
    recipe.write_text(json.dumps(NEW))
    assert command("dataset", [str(recipe), "--output", str(old)]) == 2
    assert "--overwrite replaces it" in capsys.readouterr().err
    assert command("dataset", [str(recipe), "--output", str(old), "--overwrite"]) == 0
    assert "2 of 2 scenes, 10 points" in capsys.readouterr().out
    assert content(old) == content(fresh)
