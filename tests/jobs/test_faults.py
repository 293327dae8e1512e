"""Faults from outside: a full disk, no place to write, Ctrl-C, a killed process. Nothing half-written, no traceback."""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from synthroads_addon.cloud.formats.registry import open_cloud
from synthroads_addon.road.parameters import read_parameters
from synthroads_addon.sampling.road import sample_road
from synthroads_addon.scenario.road import RoadScenario

pytestmark = [
    pytest.mark.any_blender,
    pytest.mark.skipif(sys.platform != "linux", reason="limits and signals as Linux has them"),
]

ROOT = Path(__file__).resolve().parents[2]
SMALL = {
    "fidelity": "draft",
    "road.length": 40,
    "road.half_width": 20,
    "scan.lines_per_second": 50,
    "scan.platform.speed": 20,
    "colour.source": '"material"',
}
SETTINGS = [word for name, value in SMALL.items() for word in ("--set", f"{name}={value}")]
SQUARE = "v -20 -20 0\nv 20 -20 0\nv 20 20 0\nv -20 20 0\nf 1 2 3 4\n"


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("inputs")
    (folder / "road.json").write_text(sample_road(RoadScenario(length=60.0), 1).to_json())
    (folder / "yard.obj").write_text(SQUARE)
    return folder


def command(name: str, inputs: Path, output: Path) -> list[str]:
    """Return a command that writes to a folder."""
    scan = ["--height", "30", "--set", "scan.lines_per_second=50", "--rays", "1"]
    arguments = {
        "generate": ["--scenario", "rq31-600m-even", *SETTINGS],
        "scan": [str(inputs / "yard.obj"), "--up", "z", *scan],
        "twin": [str(inputs / "road.json")],
    }[name]
    return [sys.executable, "-m", f"headless.{name}", *arguments, "--quiet", "--output", str(output)]


NAMES = ("generate", "scan", "twin")


def files(folder: Path) -> dict[str, bytes]:
    """Return the finished files of a folder."""
    there = [path for path in folder.glob("*") if path.is_file()] if folder.exists() else []
    return {path.name: path.read_bytes() for path in there}


def check_whole(folder: Path) -> None:
    """See that each file that stands under its final name can be read to its end."""
    for name in files(folder):
        path = folder / name
        if path.suffix in (".json", ".geojson"):
            json.loads(path.read_text())
        if name == "parameters.json":
            read_parameters(path)
        if path.suffix == ".laz":
            with open_cloud(path) as cloud:
                assert sum(len(block) for block in cloud.blocks()) == cloud.header.count
        if path.suffix == ".ifc":
            assert path.read_text().rstrip().endswith("END-ISO-10303-21;")
        if path.suffix == ".xodr":
            assert path.read_text().rstrip().endswith("</OpenDRIVE>")
        if path.suffix == ".png":
            assert path.read_bytes().endswith(b"IEND\xaeB`\x82")


# --- no room, no place ----------------------------------------------------------------------------------------------


@contextmanager
def small_disk(folder: Path, kilobytes: int) -> Iterator[Path]:
    """Yield a folder on a disk of its own, if this user may mount one."""
    folder.mkdir()
    options = ["-t", "tmpfs", "-o", f"size={kilobytes}k", "tmpfs", str(folder)]
    if subprocess.run(["mount", *options], capture_output=True, check=False).returncode != 0:
        pytest.skip("may not mount a disk")
    try:
        yield folder
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=True)


def refused(done: subprocess.CompletedProcess[str]) -> None:
    assert done.returncode == 2, done.stderr
    assert "Traceback" not in done.stderr
    assert len(done.stderr.splitlines()) == 1, done.stderr
    assert "cannot be written" in done.stderr


def ran(arguments: list[str], before: Callable[[], None] | None = None) -> subprocess.CompletedProcess[str]:
    return subprocess.run(arguments, cwd=ROOT, capture_output=True, text=True, preexec_fn=before, check=False)


@pytest.mark.slow
@pytest.mark.parametrize("kilobytes", [8, 60, 160])
@pytest.mark.parametrize("name", NAMES)
def test_a_disk_that_is_full(name: str, kilobytes: int, inputs: Path, tmp_path: Path) -> None:
    with small_disk(tmp_path / "disk", kilobytes) as disk:
        refused(ran(command(name, inputs, disk / "out")))
        assert files(disk / "out") == {}
        assert not (disk / "out").exists()


@pytest.mark.slow
@pytest.mark.parametrize("kilobytes", [60, 400])
def test_a_folder_for_temporary_files_that_is_full(
    kilobytes: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While images are rendered."""
    images = [word if word != 'colour.source="material"' else 'colour.source="images"' for word in SETTINGS]
    arguments = [sys.executable, "-m", "headless.generate", *images, "--quiet", "--output", str(tmp_path / "out")]
    with small_disk(tmp_path / "disk", kilobytes) as disk:
        monkeypatch.setenv("TMPDIR", str(disk))
        done = ran(arguments)
        refused(done)
        assert str(disk) in done.stderr
        assert list(disk.iterdir()) == []
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("error", "says"),
    [
        ("MemoryError('Unable to allocate 537. TiB')", "error: too little memory (Unable to allocate 537. TiB)"),
        ('RuntimeError("DefaultCPUAllocator: can\'t allocate memory: 8 bytes")', "error: too little memory (Default"),
        ('RuntimeError("can\'t start new thread")', "error: too little memory (can't start new thread); nothing"),
        ("OSError(28, 'No space left on device', '/tmp/x')", "error: /tmp/x cannot be written (No space left"),
    ],
)
def test_a_machine_that_is_too_small_is_told_in_a_line(error: str, says: str) -> None:
    code = "import argparse; from headless.commands import leave, run\n"
    code += f"def work(arguments):\n    raise {error}\n"
    code += "leave(lambda: run(work, argparse.Namespace(json=False, quiet=False)))"
    done = ran([sys.executable, "-c", code])
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1), done.stderr
    assert done.stderr.startswith(says)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_too_little_memory_at_any_moment(
    name: str, inputs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whichever stage it is that wants more: Blender crashes in some of them, or the system ends the process."""
    (temporary := tmp_path / "temporary").mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))
    codes = []
    for megabytes in (150, 180, 210, 250, 500, 800, 1100, 1300, 1400, 1500, 1600, 1700, 1800, 1900):

        def limit() -> None:
            size = megabytes << 20  # noqa: B023
            resource.setrlimit(resource.RLIMIT_AS, (size, size))

        done = ran(command(name, inputs, tmp_path / "out"), limit)
        codes.append(done.returncode)
        assert "Traceback" not in done.stderr, (megabytes, done.stderr)
        assert list(temporary.iterdir()) == [], megabytes
        if done.returncode == 0:
            break
        assert (done.returncode, len(done.stderr.splitlines())) == (2, 1), (megabytes, done.stderr)
        assert not (tmp_path / "out").exists(), megabytes
    assert codes.count(2) >= 2, codes


@pytest.mark.slow
@pytest.mark.parametrize("output", ["scene", "cloud", "previews", "parameters"])
@pytest.mark.parametrize("size", [100, 3000])
def test_files_that_may_not_grow(
    output: str, size: int, inputs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The limit that a user has for a single file, for each kind of file."""
    # Python would leave torn bytecode behind, which nothing imports any more.
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

    done = ran([*command("generate", inputs, tmp_path / "out"), "--set", f'outputs=["{output}"]'], limit)
    refused(done)
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_a_data_set_on_a_full_disk_tells_so_and_is_continued(tmp_path: Path) -> None:
    recipe = tmp_path / "recipe.yaml"
    changes = {name: str(value).strip('"') if isinstance(value, str) else value for name, value in SMALL.items()}
    recipe.write_text(json.dumps({"title": "t", "set": changes, "groups": [{"name": "a", "scenes": 2}]}))
    arguments = [sys.executable, "-m", "headless.dataset", str(recipe), "--quiet", "--output"]
    with small_disk(tmp_path / "disk", 12) as disk:
        refused(ran([*arguments, str(disk / "set")]))
    with small_disk(tmp_path / "larger", 60) as disk:
        done = ran([*arguments, str(disk / "set")])
        assert done.returncode in (2, 3), done.stderr
        assert "Traceback" not in done.stderr
        assert not list(disk.glob("set/scenes/*"))
        subprocess.run(["mount", "-o", "remount,size=60m", str(disk)], check=True)
        assert ran([*arguments, str(disk / "set"), "--resume"]).returncode == 0
        assert len(list(disk.glob("set/scenes/*"))) == 2


@pytest.mark.parametrize("name", NAMES)
def test_an_output_below_a_file(name: str, inputs: Path, tmp_path: Path) -> None:
    """Not even root can write there."""
    (tmp_path / "file").write_text("mine")
    refused(ran(command(name, inputs, tmp_path / "file" / "out")))
    assert (tmp_path / "file").read_text() == "mine"


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_a_disk_that_is_read_only(name: str, inputs: Path, tmp_path: Path) -> None:
    with small_disk(tmp_path / "disk", 1000) as disk:
        subprocess.run(["mount", "-o", "remount,ro", str(disk)], check=True)
        refused(ran(command(name, inputs, disk / "out")))


# --- stopped --------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def whole(inputs: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[float, dict[str, bytes]]]:
    """How long each command takes, s, and what it writes."""
    found = {}
    for name in NAMES:
        folder = tmp_path_factory.mktemp("whole") / "out"
        begin = time.monotonic()
        assert ran(command(name, inputs, folder)).returncode == 0
        found[name] = time.monotonic() - begin, files(folder)
    return found


def stopped(arguments: list[str], after: float, sign: signal.Signals) -> tuple[int, str]:
    """Run a command and send it a signal after some seconds; return its exit code and what it said."""
    hearing = ["env", "--default-signal=INT,HUP", *arguments]  # a shell's background jobs are deaf to interrupts
    with subprocess.Popen(hearing, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        time.sleep(after)
        process.send_signal(sign)
        _, said = process.communicate(timeout=60)
    return process.returncode, said


def loaded() -> float:
    """Return after how many seconds Python has come to a command's own code."""
    begin = time.monotonic()
    subprocess.run([sys.executable, "-c", "import headless"], cwd=ROOT, check=True)
    return time.monotonic() - begin


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_interrupted_at_any_moment_it_says_so_and_leaves_nothing(
    name: str, inputs: Path, whole: dict[str, tuple[float, dict[str, bytes]]], tmp_path: Path
) -> None:
    seconds, complete = whole[name]
    rng, codes = np.random.default_rng(5), []
    for number in range(8):
        output = tmp_path / f"out{number}"
        begin = min(1.5 * loaded(), 0.9 * seconds)
        code, said = stopped(command(name, inputs, output), float(rng.uniform(begin, seconds)), signal.SIGINT)
        codes.append(code)
        if code == 0:  # the machine has become faster meanwhile
            seconds *= 0.8
        assert code in (0, 130), (code, said)
        assert "Traceback" not in said, said
        if code == 130:
            assert said.splitlines()[-1] == "interrupted; nothing was left half-written"
            assert not output.exists() or files(output).keys() == complete.keys()
            assert not list(output.glob(".*"))
    assert codes.count(130) >= 4, codes


def test_a_command_that_is_still_loading_ends_quietly() -> None:
    """As soon as there is Python code of ours, whatever is being imported."""
    code = "import sys; sys.argv = ['-m']; import headless; raise KeyboardInterrupt"
    done = ran([sys.executable, "-c", code])
    assert (done.returncode, done.stderr) == (130, "interrupted; nothing was left half-written\n")
    code = "import sys; sys.argv = ['other']; import headless; raise ValueError('mine')"
    done = ran([sys.executable, "-c", code])
    assert (done.returncode, "ValueError: mine" in done.stderr) == (1, True)


WAITING = """
import sys; sys.argv = ["-m"]
import argparse, sys, tempfile, time
from headless.commands import leave, run

def work(arguments):
    tempfile.mkdtemp()
    print("at work", file=sys.stderr, flush=True)
    for _ in range(200):  # Python sees a signal that comes just as it falls asleep when it wakes
        time.sleep(0.1)

leave(lambda: run(work, argparse.Namespace(json=False, quiet=False)))
"""


@pytest.mark.parametrize("sign", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_each_end_from_outside_is_one_line_and_leaves_nothing(sign: signal.Signals, tmp_path: Path) -> None:
    """A container that is stopped, Slurm, a connection that is lost; some send their signal twice."""
    environment = {**os.environ, "TMPDIR": str(tmp_path), "PYTHONPATH": str(ROOT)}
    hearing = ["env", "--default-signal=INT,TERM,HUP", sys.executable, "-c", WAITING]
    with subprocess.Popen(hearing, env=environment, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        assert process.stderr.readline() == "at work\n"
        assert len(list(tmp_path.iterdir())) == 1
        for _ in range(2):
            process.send_signal(sign)
        _, said = process.communicate(timeout=30)
    assert (process.returncode, said) == (130, "interrupted; nothing was left half-written\n")
    assert list(tmp_path.iterdir()) == []


def test_a_command_that_nohup_began_goes_on_without_its_terminal(tmp_path: Path) -> None:
    code = WAITING.replace("range(200)", "range(3)").replace("\nleave(", "    return 0, {}, 'done'\n\nleave(")
    with subprocess.Popen(
        ["env", "--ignore-signal=HUP", sys.executable, "-c", code], cwd=ROOT, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stderr is not None
        process.stderr.readline()
        process.send_signal(signal.SIGHUP)
        assert process.wait(timeout=30) == 0


@pytest.mark.parametrize("kind", ["RuntimeError", "ModuleNotFoundError"])
def test_an_interrupt_that_a_library_turns_into_another_error(kind: str) -> None:
    """As parts written in other languages do while they are loaded."""
    code = f"""
import sys; sys.argv = ["-m"]
import argparse, os, signal, time
from headless.commands import leave, run

def work(arguments):
    try:
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(1.0)
    except KeyboardInterrupt:
        raise {kind}("not to be seen")

leave(lambda: run(work, argparse.Namespace(json=False, quiet=False)))
"""
    done = ran(["env", "--default-signal=INT", sys.executable, "-c", code])
    assert (done.returncode, done.stderr) == (130, "interrupted; nothing was left half-written\n")


@pytest.mark.slow
def test_an_interrupt_in_a_callback_of_blender_reaches_the_command() -> None:
    """Blender's operators print what is raised in Python that they call, and go on."""
    code = """
import sys; sys.argv = ["-m"]
import argparse, os, signal, time
from headless.commands import leave, run

operators = {}
text = "def call(action):\\n    try:\\n        action()\\n    except BaseException:\\n        pass\\n"
exec(compile(text, os.path.join("somewhere", "modules", "bpy", "ops.py"), "exec"), operators)

def callback():
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(0.01)

def work(arguments):
    operators["call"](callback)
    time.sleep(5.0)
    return 0, {}, "swallowed"

leave(lambda: run(work, argparse.Namespace(json=False, quiet=False)))
"""
    done = ran(["env", "--default-signal=INT", sys.executable, "-c", code])
    assert (done.returncode, done.stderr) == (130, "interrupted; nothing was left half-written\n")
