"""A command whose process the system ends: one line, exit code 2 where memory is short, nothing left."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

pytestmark = [
    pytest.mark.smoke,
    pytest.mark.skipif(sys.platform != "linux", reason="signals and limits as Linux has them"),
]

ROOT = Path(__file__).resolve().parents[2]
COMMAND = """
import sys; sys.argv = ["-m"]
import argparse, ctypes, os, pathlib, signal, time
from headless.commands import leave, run
from synthroads_addon.base.files import output_folder
from synthroads_addon.base.scratch.opened_file import being_opened

def work(arguments):
    with output_folder(pathlib.Path("out"), [], False) as folder:
        (folder / "half").write_bytes(bytes(1000))
        ACTION
    return 0, {}, "done"

leave(lambda: run(work, argparse.Namespace(json=False, quiet=False)))
"""
EMBREE = "os.write(2, b'ERROR CAUGHT IN EMBREE\\nERROR: Unknown error\\nMESSAGE: pthread_create has failed\\n'); "
OPENING = "with being_opened(pathlib.Path('scene.blend')): "
CRASHED = "Blender crashed as it opened it (SIGSEGV); the file is damaged, or of another Blender: save it anew"
SPEAK = "os.write(2, b'Warning: a\\nterminate called after throwing an instance of bad_alloc\\n what()\\n'); "


def ran(action: str, folder: Path, limit: Callable[[], None] | None = None) -> tuple[int, str]:
    """Run a command in a folder; return its exit code and what it said on standard error."""
    (folder / "temporary").mkdir()
    environment = {**os.environ, "TMPDIR": str(folder / "temporary"), "PYTHONPATH": str(ROOT)}
    code = COMMAND.replace("ACTION", action)
    command = [sys.executable, "-c", code]
    done = subprocess.run(
        command, cwd=folder, env=environment, stderr=subprocess.PIPE, text=True, preexec_fn=limit, check=False
    )
    return done.returncode, done.stderr


def nothing_is_left(folder: Path) -> bool:
    return [path.name for path in folder.rglob("*")] == ["temporary"]


@pytest.mark.parametrize(
    ("action", "code", "says"),
    [
        ("os.kill(os.getpid(), signal.SIGKILL)", 2, "error: too little memory (the work was ended by SIGKILL); "),
        (SPEAK + "os.abort()", 2, "Warning: a\nerror: too little memory (the work was ended by SIGABRT); "),
        (EMBREE + "ctypes.string_at(0)", 2, "error: too little memory (the work was ended by SIGSEGV); "),
        (
            OPENING + "ctypes.string_at(0)",
            2,
            f"error: scene.blend: {CRASHED}; ",
        ),
        (OPENING + "pass\n        ctypes.string_at(0)", 1, "error: a defect of a library ended the work (SIGSEGV); "),
        ("ctypes.string_at(0)", 1, "error: a defect of a library ended the work (SIGSEGV); "),
    ],
)
def test_an_end_by_the_system_is_a_line_and_leaves_nothing(action: str, code: int, says: str, tmp_path: Path) -> None:
    said = f"{says}nothing was left half-written\n"
    assert ran(action, tmp_path) == (code, said)
    assert nothing_is_left(tmp_path)


def limit_memory() -> None:
    resource.setrlimit(resource.RLIMIT_AS, (400 << 20, 400 << 20))


def test_a_crash_where_memory_is_limited_is_its_shortage(tmp_path: Path) -> None:
    said = "error: too little memory (the work was ended by SIGSEGV); nothing was left half-written\n"
    assert ran("ctypes.string_at(0)", tmp_path, limit_memory) == (2, said)


def test_a_command_is_not_begun_where_hardly_any_memory_is_left(tmp_path: Path) -> None:
    """Linear algebra would wait for its memory for ever."""

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (180 << 20, 180 << 20))

    code, said = ran("pass", tmp_path, limit)
    assert (code, len(said.splitlines())) == (2, 1), said
    assert said.startswith("error: too little memory ("), said
    assert nothing_is_left(tmp_path)


def test_what_libraries_say_is_heard_at_once_and_to_the_end(tmp_path: Path) -> None:
    assert ran("os.write(2, b'a library\\n'); time.sleep(0.2)", tmp_path) == (0, "a library\n")
    (tmp_path / "other").mkdir()
    last = "os.write(2, b'terminate called? no, all is well\\n')"
    assert ran(last, tmp_path / "other") == (0, "terminate called? no, all is well\n")


def test_the_work_ends_with_its_command(tmp_path: Path) -> None:
    """Killed, it can't tell it."""
    code = COMMAND.replace("ACTION", "print(os.getpid(), file=sys.stderr, flush=True); time.sleep(60.0)")
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    with subprocess.Popen(
        [sys.executable, "-c", code], cwd=tmp_path, env=environment, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stderr is not None
        work = int(process.stderr.readline())
        assert work != process.pid
        process.send_signal(signal.SIGKILL)
        for _ in range(100):
            state = Path(f"/proc/{work}/stat")
            if not state.exists() or state.read_text().rpartition(")")[2].split()[0] == "Z":
                return
            time.sleep(0.05)
    pytest.fail("it is still at work")
