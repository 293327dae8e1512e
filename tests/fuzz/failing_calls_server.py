"""Runs commands, each in a copy of this process in which one call that changes a file fails: a line of JSON for each.

Copies, since loading Blender and PyTorch takes longer than a small job does.
"""

from __future__ import annotations

import ctypes
import json
import os
import resource
import signal
import sys
import tempfile
from pathlib import Path
from typing import Any

from headless.commands import command, leave, module_of

SECONDS = 60
LIBRARY = ctypes.CDLL(None)


def run(case: dict[str, Any]) -> None:
    """Run a command and end the process with its exit code."""
    folder, name = Path(case["folder"]), case["argv"][0]
    said = os.open(case["said"], os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    os.dup2(said, 1)
    os.dup2(said, 2)
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
    os.environ |= {"TMPDIR": str(folder / "tmp"), "FAIL_AT": str(case["at"]), "FAIL_BELOW": str(folder)}
    tempfile.tempdir = None
    LIBRARY.fail_at(ctypes.c_long(case["at"]), str(folder).encode())
    leave(lambda: command(name, case["argv"][1:]))


def load(names: list[str]) -> None:
    """Load what commands load when they run."""
    for name in names:
        module_of(name)
    if "generate" in names:
        import synthroads_addon.blender.model.build
        import synthroads_addon.jobs.generate  # noqa: F401
    if "train" in names:
        import ml.tasks
        import ml.training_loop  # noqa: F401


def main() -> None:
    """Answer each case with the exit code, negative for a signal, until the input ends."""
    load(sys.argv[1:])
    for line in sys.stdin:
        case = json.loads(line)
        child = os.fork()
        if child == 0:
            signal.signal(signal.SIGINT, signal.default_int_handler)
            run(case)
        _, status = os.waitpid(child, 0)
        print(json.dumps(os.waitstatus_to_exitcode(status)), flush=True)


if __name__ == "__main__":
    main()
