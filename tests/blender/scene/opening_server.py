"""Opens scenes, each in a copy of this process: for each path on standard input a line that says what came of it.

Copies, since loading Blender takes longer than opening a small file; of a process that has done nothing before, since
a copy lacks the threads of Blender's that have been at work, and would wait for them for ever.
"""

from __future__ import annotations

import os
import resource
import signal
import sys
from pathlib import Path

from synthroads_addon.base.errors import InputError
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
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
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
    return said if status == 0 else f"ended by {status}"


if __name__ == "__main__":
    for line in sys.stdin:
        print(f"{ANSWER}{opened_in_a_copy(Path(line.rstrip()))}", flush=True)
