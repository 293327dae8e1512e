"""The environments of users in which the tests of the doors run commands; the session `doors` makes them."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import pytest

VARIABLE = "SYNTHROADS_DOORS"
"""Environment variable that says where they are: JSON by name, an interpreter or folder each."""


@cache
def places() -> dict[str, Any]:
    """Return where the environments are: `demo`, `bare`, `wheel`, `extras` by name, and the folder `zips`.

    ``every_line`` says whether all lines are run in them, or those alone that Blender's release matters to;
    ``every_door`` whether all is run that there is, as by `make doors`.
    """
    if VARIABLE not in os.environ:
        pytest.fail(f"{VARIABLE} isn't set: `nox -s doors` makes the environments and runs these tests")
    found: dict[str, Any] = json.loads(os.environ[VARIABLE])
    return found


def run(
    python: str, *words: str | Path, folder: Path, variables: Mapping[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """Run an environment's interpreter, or a command beside it, in a folder, with nothing of the tests' own around it.

    Args:
        python: the interpreter.
        words: its arguments; where the first names a command of the environment's, that one and its arguments.
        folder: working folder.
        variables: of the process, beside those that every process has.
    """
    own = {"PYTHONPATH", "PYTHONHOME", "VIRTUAL_ENV", "BLENDER_USER_RESOURCES", "PYTEST_CURRENT_TEST", VARIABLE}
    kept = {name: value for name, value in os.environ.items() if name not in own}
    command = Path(python).parent / words[0]  # the path of a script as it is
    call = [command, *words[1:]] if command.is_file() and command.suffix != ".py" else [python, *words]
    return subprocess.run(
        [str(word) for word in call],
        cwd=folder,
        env={**kept, **(variables or {})},
        capture_output=True,
        text=True,
        check=False,
        timeout=900.0,
        stdin=subprocess.DEVNULL,
    )
