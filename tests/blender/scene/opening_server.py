"""Opens scenes, each in a copy of this process: for each path on standard input a line that says what came of it.

Copies, since loading Blender takes longer than opening a small file; of a process that has done nothing before, since
a copy lacks the threads of Blender's that have been at work, and would wait for them for ever.
"""

from __future__ import annotations

import os
import resource
import signal
import sys
import tempfile
from pathlib import Path

from headless.supervision import crash_line
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.scratch.opened_file import note_opened_file_in, noted_file
from synthroads_addon.blender.scene.foreign import open_scene

PEAK_MB = 1500
SECONDS = 20
ANSWER = "answer: "
"""Begins the lines that are answers, among those that Blender prints."""


def opened(path: Path) -> str:
    """Open a scene; return "opened", "refused" or, in other words, what is wrong with how it ended."""
    try:
        open_scene(path)
        said = "opened"
    except InputError as error:
        said = "refused" if str(error).isprintable() else f"not one line: {error!r}"
    except BaseException as error:
        said = f"{type(error).__name__}: {error}"
    if resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3 > PEAK_MB:
        said = "took too much memory"
    return " ".join(said.split())[:500]


def opened_in_a_copy(path: Path) -> str:
    """Open a scene in a copy of this process, which is ended if it takes too long; return what came of it."""
    with tempfile.TemporaryFile() as note:
        return _opened_in_a_copy(path, note.fileno())


def _opened_in_a_copy(path: Path, note: int) -> str:
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        note_opened_file_in(note)
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
        resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
        signal.alarm(10 * SECONDS)  # one that waits takes no processor time
        os.write(write, opened(path).encode())
        os._exit(0)
    os.close(write)
    said = os.read(read, 1000).decode()
    os.close(read)
    _, status = os.waitpid(child, 0)
    if status == 0:
        return said
    # Blender itself crashes on some of its own files: a command's supervisor says so in a line that names the file.
    line = crash_line(os.WTERMSIG(status), noted_file(note)) if path.suffix == ".blend" else None
    return "refused" if line and path.name in line and line.count("\n") == 1 else f"ended by {status}"


if __name__ == "__main__":
    for line in sys.stdin:
        print(f"{ANSWER}{opened_in_a_copy(Path(line.rstrip()))}", flush=True)
