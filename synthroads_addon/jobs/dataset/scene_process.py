"""One scene of a data set in a process of its own: ``python -m synthroads_addon.jobs.dataset.scene_process TASK N``.

It ends when whoever began it does: its standard input is then closed.
"""

import json
import os
import sys
import threading
from pathlib import Path

from ...base.process.end_signals import EXIT_CODE, handle_end_signals
from ...base.process.leave import leave
from ...base.scratch.folders import remove_scratch_folders
from .scene_files import FAILED

if __name__ == "__main__":
    handle_end_signals()


def main() -> int:
    """Make the scene of the task file in ``sys.argv``; return the exit code, 2 if the scenario can't be met."""
    # Late: whatever ends the process while these are loaded is told in a line as well.
    from ...base.errors import InputError
    from ...base.schema import read_json
    from ...dataset.manifest import write_atomically
    from .scene import make_scene

    path = Path(sys.argv[1])
    threading.Thread(target=_end_with_parent, daemon=True).start()
    try:
        make_scene(read_json(path), path.parent, int(sys.argv[2]))
    except InputError as error:
        message = str(error).replace(str(path.parent), "")
        of_scenario = type(error) is InputError  # and not a file that is missing or can't be written
        write_atomically(path.parent / FAILED, json.dumps({"error": message, "of_scenario": of_scenario}))
        return 2
    return 0


def _end_with_parent() -> None:
    """Block until standard input is closed, as when the parent ends; then end the process as interrupted."""
    sys.stdin.buffer.read()
    remove_scratch_folders()
    os._exit(EXIT_CODE)


if __name__ == "__main__":
    leave(main)  # the data set's run tries again what the system ends
