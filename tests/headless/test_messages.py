"""Messages of a command besides its result: with and without `--quiet` and `--verbose`, in a terminal and elsewhere."""

from __future__ import annotations

import argparse
import json
import os
import re
import struct
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from headless.commands import Outcome, command, run
from headless.progress import INTERVAL, _Rate, progress_bar
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.progress import Stage
from synthroads_addon.cloud.formats.registry import open_writer
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario
from tests.helpers.clouds.random_points import make_points

ROOT = Path(__file__).resolve().parents[2]
LINE = re.compile(r"(.+): (\d+) % after (\d+) s(?:, about (\d+) (s|min|hours) left)?(?: \((.+)\))?")


# --- results that are written to no file -----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """A cloud, a road that keeps the rules, and a data set that lost a file."""
    folder = tmp_path_factory.mktemp("files")
    with open_writer(folder / "cloud.laz", 25832, np.array([294_000.0, 5_628_000.0, 180.0]), 5e8) as writer:
        writer.write(make_points(500))
    road = sample_road(RoadScenario(length=100.0), 1)
    (folder / "road.json").write_text(road.to_json())
    lost = {"name": "a-01", "split": "train", "seed": 1, "status": "done"}
    lost["files"] = {"scenes/a-01/cloud.laz": {"bytes": 5, "sha256": "0" * 64}}
    manifest = {"title": "t", "generator": "g", "recipe_sha256": "0" * 64, "complete": True, "scenes": [lost]}
    (folder / "manifest.json").write_text(json.dumps(manifest))
    return {path.name: str(path) for path in folder.iterdir()} | {"folder": str(folder)}


PRINTED = {
    "parameters": ("parameters", ["--length", "50"], 0, '"RoadParameters"'),
    "several parameters": ("parameters", ["--length", "50", "--count", "2"], 0, '"seed":2'),
    "rules": ("check", ["{road.json}"], 0, "no violations"),
    "figures of a cloud": ("cloud", ["info", "{cloud.laz}"], 0, "500 points"),
    "expected intensities": ("calibrate", ["--material", "asphalt"], 0, "asphalt: reflectivity"),
    "faults of a data set": ("dataset", ["x", "--output", "{folder}", "--verify"], 3, "a-01/cloud.laz is missing"),
}


@pytest.mark.parametrize("name", PRINTED)
def test_a_result_that_goes_to_no_file_is_printed_with_quiet_as_well(
    name: str, files: dict[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    words, arguments, code, wanted = PRINTED[name]
    filled = [re.sub(r"\{(.+)\}", lambda found: files[found[1]], argument) for argument in arguments]
    assert command(words, filled) == code
    loud = capsys.readouterr()
    assert wanted in loud.out
    assert command(words, [*filled, "--quiet"]) == code
    assert capsys.readouterr() == (loud.out, "")


@pytest.mark.parametrize("option", ["--output", "--plot"])
def test_what_is_said_of_files_is_not_printed_with_quiet(
    option: str, files: dict[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if option == "--plot":
        pytest.importorskip("matplotlib")
        words = ("calibrate", ["--material", "asphalt", "--plot", str(tmp_path / "plot.png")])
    else:
        words = ("cloud", ["convert", files["cloud.laz"], "--output", str(tmp_path / "cloud.ply")])
    assert command(words[0], [*words[1], "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")
    assert list(tmp_path.iterdir())


# --- scenes that failed ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("flags", "said"), [(["--quiet"], ""), (["--json"], "{"), ([], "0 of 2 scenes, 0 points\n")])
def test_scenes_that_failed_are_told_on_standard_error(
    flags: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def failing(folder: Path, threads: int, stopping: Any) -> int:
        (folder / "log.txt").touch()
        (folder / "failed.json").write_text(json.dumps({"error": "no road fits"}))
        return 2

    monkeypatch.setattr("synthroads_addon.jobs.dataset.processes._run_process", failing)
    recipe = tmp_path / "recipe.json"
    recipe.write_text(json.dumps({"title": "t", "groups": [{"name": "a", "scenes": 2}]}))
    assert command("dataset", [str(recipe), "--output", str(tmp_path / "set"), *flags]) == 3
    out, err = capsys.readouterr()
    assert sorted(err.splitlines()) == ["failed: a-01: no road fits", "failed: a-02: no road fits"]
    assert out.startswith(said)
    assert (out == "") == ("--quiet" in flags)
    if "--json" in flags:
        assert [scene["status"] for scene in json.loads(out)["scenes"]] == ["failed", "failed"]


# --- progress --------------------------------------------------------------------------------------------------------


def flags(**given: bool) -> argparse.Namespace:
    return argparse.Namespace(**{"quiet": False, "json": False, "verbose": False, **given})


class Clock:
    """A clock that work moves on."""

    now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    """Time that passes only where a test says so; lines are shown at once."""
    made = Clock()
    monkeypatch.setattr("headless.progress.PATIENCE", 0.0)
    monkeypatch.setattr("headless.progress.time.perf_counter", made)
    return made


def work(clock: Clock, steps: list[tuple[str, float, float]]) -> Callable[[argparse.Namespace], Outcome]:
    """Return a command that tells of stages and shares and takes some seconds after each."""

    def action(arguments: argparse.Namespace) -> Outcome:
        progress = progress_bar(arguments)
        for stage, share, seconds in steps:
            progress(stage, share)
            clock.now += seconds
        return 0, {"done": True}, "done"

    return action


STEPS = [("model", 0.0, 3.0), ("scan", 0.0, 4.0), ("scan", 0.4, 4.0), ("scan", 0.5, 2.5), ("scan", 0.9, 1.0)]
STEPS += [("model", 0.0, 1.0), ("scan", 1.0, 0.0)]  # as a road that is made by section has them again


def test_outside_a_terminal_progress_is_lines(clock: Clock, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(work(clock, STEPS), flags()) == 0
    out, err = capsys.readouterr()
    assert out == "done\n"
    assert err.splitlines() == ["model: 0 % after 0 s", "scan: 0 % after 3 s", "scan: 90 % after 14 s, about 1 s left"]


def test_at_most_one_line_in_ten_seconds_of_a_stage(clock: Clock, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(work(clock, [("training", step / 5000, 0.05) for step in range(5000)]), flags()) == 0
    matches = [LINE.fullmatch(line) for line in capsys.readouterr().err.splitlines()]
    seconds = np.array([int(found[3]) for found in matches if found])
    assert len(matches) == len(seconds) == 25
    assert np.diff(seconds).min() >= INTERVAL - 1.0


def test_the_json_of_a_result_stays_pure(clock: Clock, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(work(clock, STEPS), flags(json=True)) == 0
    out, err = capsys.readouterr()
    assert json.loads(out) == {"done": True}
    assert len(err.splitlines()) == 3


def test_with_quiet_there_is_no_progress(clock: Clock, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(work(clock, STEPS), flags(quiet=True, output="x")) == 0
    assert capsys.readouterr() == ("", "")


def test_what_is_soon_over_shows_no_progress(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(work(Clock(), STEPS), flags()) == 0
    assert capsys.readouterr() == ("done\n", "")


def test_what_was_held_back_is_shown_once_it_takes_longer(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("headless.progress.PATIENCE", 0.2)

    def action(arguments: argparse.Namespace) -> Outcome:
        progress = progress_bar(arguments)
        progress("scenes", 0.0)
        deadline = time.perf_counter() + 20.0
        while not (said := capsys.readouterr().err) and time.perf_counter() < deadline:
            time.sleep(0.05)
        return 0, {}, said

    assert run(action, flags()) == 0
    assert capsys.readouterr().out == "scenes: 0 % after 0 s\n\n"


def silent_work(seconds: float, *told: tuple[str, float]) -> Callable[[argparse.Namespace], Outcome]:
    """Return a command that tells of stages and shares, and then nothing for some seconds."""

    def action(arguments: argparse.Namespace) -> Outcome:
        progress = progress_bar(arguments) if told else None
        for stage, share in told:
            assert progress is not None
            progress(stage, share)
        time.sleep(seconds)
        return 0, {}, "done"

    return action


@pytest.mark.parametrize("told", [(), (("model", 0.3),)])
def test_work_that_tells_nothing_for_long_still_has_its_lines(
    told: tuple[tuple[str, float], ...], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("headless.progress.PATIENCE", 0.0)
    monkeypatch.setattr("headless.progress.INTERVAL", 0.2)
    assert run(silent_work(1.1, *told), flags(command="gallery")) == 0
    lines = capsys.readouterr().err.splitlines()
    assert 3 <= len(lines) <= 6 + len(told)
    wanted = r"model: 30 % after \d+ s" if told else r"gallery: at work after \d+ s"
    assert all(re.fullmatch(wanted, line) for line in lines), lines


def test_the_heartbeat_ends_with_the_command_and_keeps_quiet_if_asked(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("headless.progress.PATIENCE", 0.0)
    monkeypatch.setattr("headless.progress.INTERVAL", 0.1)
    assert run(silent_work(0.3), flags(quiet=True, output="x", command="gallery")) == 0
    assert capsys.readouterr() == ("", "")
    assert run(silent_work(0.0), flags(command="gallery")) == 0
    time.sleep(0.4)
    assert capsys.readouterr().err == ""


def test_the_time_that_is_left_follows_from_what_was_done(clock: Clock, capsys: pytest.CaptureFixture[str]) -> None:
    steady = [("scan", share / 100, 6.0) for share in range(0, 101, 10)]
    whole = [("path", 0.0, 30.0), ("views", 0.4, 30.0), ("judging", 0.8, 0.0)]  # shares of all, under several names
    assert run(work(clock, [*steady, ("files", 0.0, 11.0), *whole]), flags()) == 0
    found = [LINE.fullmatch(line) for line in capsys.readouterr().err.splitlines()]
    left = {(line[1], int(line[2])): line[4] and int(line[4]) for line in found if line}
    assert len(left) == len(found)
    assert left["scan", 0] is None
    assert left["scan", 20] == pytest.approx(48, abs=1)
    assert left["scan", 80] == pytest.approx(12, abs=1)
    assert left["files", 0] is None
    assert left["views", 40] == pytest.approx(45, abs=1)
    assert left["judging", 80] == pytest.approx(15, abs=1)


def test_what_was_spent_in_silence_is_no_longer_left() -> None:
    rate = _Rate()
    rate.add(0.0, "scan", 0.0)
    rate.add(100.0, "scan", 0.5)
    assert [rate.left(now) for now in (100.0, 160.0, 300.0)] == [100.0, 40.0, 0.0]


def test_a_stages_details_stand_behind_it(clock: Clock, capsys: pytest.CaptureFixture[str]) -> None:
    steps: list[tuple[str, float, float]] = [
        (Stage("training", f"epoch {number + 1} of 20, loss {1 / (number + 1):.3g}"), number / 20, 6.0)
        for number in range(4)
    ]
    assert run(work(clock, steps), flags()) == 0
    said = capsys.readouterr().err.splitlines()
    assert said == [
        "training: 0 % after 0 s (epoch 1 of 20, loss 1)",
        "training: 10 % after 12 s, about 108 s left (epoch 3 of 20, loss 0.333)",
    ]


@pytest.mark.skipif(sys.platform == "win32", reason="has no such terminals")
def test_in_a_terminal_progress_is_a_bar_and_messages_stand_above_it() -> None:
    code = """
import argparse, time
from headless.commands import run
from headless.messages import logger
from headless.progress import progress_bar

def action(arguments):
    progress = progress_bar(arguments)
    progress("scan", 0.4)
    time.sleep(0.3)
    progress("scan", 0.5)
    logger.error("failed: a-01")
    return 0, {}, "done"

run(action, argparse.Namespace(quiet=False, json=True, verbose=False))
"""
    import fcntl
    import termios

    ours, theirs = os.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 100, 0, 0))
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, stderr=theirs, stdout=subprocess.PIPE, check=True)
    os.close(theirs)
    shown = os.read(ours, 65536).decode()
    os.close(ours)
    assert done.stdout == b"{}\n"
    assert re.search(r"scan: +█+.* 50 %", shown)
    assert not LINE.search(shown.replace("\r", "\n"))
    assert "\rfailed: a-01\r\n" in shown, "on a line of its own"
    assert re.search(r"\r *\r$", shown), "nothing is left of the bar"


# --- details ---------------------------------------------------------------------------------------------------------


def test_verbose_tells_versions_settings_and_times(clock: Clock, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(work(clock, STEPS[:3]), flags(verbose=True, fidelity="draft")) == 0
    out, err = capsys.readouterr()
    assert out == "done\n"
    first, packages, arguments, *rest = err.splitlines()
    assert re.match(r"SynthRoads \S+, Python 3\.\d+\.\d+, ", first)
    assert f"numpy {np.__version__}" in packages
    assert json.loads(arguments.removeprefix("arguments: "))["fidelity"] == "draft"
    told = [line for line in rest if not LINE.fullmatch(line)]
    assert told == [
        "stage model: begins",
        "stage model: took 3.00 s",
        "stage scan: begins",
        "stage scan: took 8.00 s",
        "all: took 11.00 s",
    ]
    assert len(rest) - len(told) == 2


def test_a_command_shows_its_settings_with_verbose(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recipe = tmp_path / "recipe.json"
    recipe.write_text(json.dumps({"title": "t", "seed": 77, "groups": [{"name": "a", "scenes": 1}]}))
    (tmp_path / "set").mkdir()
    (tmp_path / "set" / "mine.txt").touch()  # it is refused, after the settings are shown
    for flag in ("-v", "--verbose"):
        assert command("dataset", [str(recipe), "-o", str(tmp_path / "set"), flag]) == 2
        lines = capsys.readouterr().err.splitlines()
        (shown,) = [line for line in lines if line.startswith("recipe: ")]
        assert json.loads(shown.removeprefix("recipe: "))["seed"] == 77
        assert lines[-1].startswith("error: ")
    assert command("dataset", [str(recipe), "-o", str(tmp_path / "set")]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_quiet_and_verbose_contradict_each_other(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        command("parameters", ["--quiet", "--verbose"])
    assert stopped.value.code == 2
    assert "-v/--verbose: not allowed with argument -q/--quiet" in capsys.readouterr().err


@pytest.mark.parametrize("verbose", [False, True])
def test_warnings_of_libraries_are_details(verbose: bool, capsys: pytest.CaptureFixture[str]) -> None:
    """So what was wrong stays a single line, whatever NumPy has said of the numbers before."""

    def work(_: argparse.Namespace) -> Outcome:
        with np.errstate(invalid="warn"):
            np.array([np.inf]) - np.array([np.inf])
        raise InputError("a.laz", None, "has no points")

    assert run(work, argparse.Namespace(json=False, quiet=False, verbose=verbose)) == 2
    lines = capsys.readouterr().err.splitlines()
    assert lines[-1] == "error: a.laz: has no points"
    assert any("RuntimeWarning: invalid value" in line for line in lines) == verbose
    assert verbose or len(lines) == 1
