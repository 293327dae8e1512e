"""Judges that belong to no environment: they are installed into ``build/judges``, each into a folder of its own."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

BUILD = Path(__file__).resolve().parents[2] / "build" / "judges"
_LONGEST = 600.0
"""Seconds after which an installation is given up."""


def install(folder: Path, *commands: Sequence[str]) -> None:
    """Run commands that fill a folder, whose path is to stand in them as ``{}``; it appears only if all succeed.

    Nothing is raised where one fails, as without a network or a tool: the judge isn't here then.
    """
    partial = folder.with_name(f".{folder.name}.{os.getpid()}")
    partial.mkdir(parents=True)
    try:
        for command in commands:
            words = [word.format(partial) for word in command]
            subprocess.run(words, check=True, capture_output=True, timeout=_LONGEST)
        shutil.rmtree(folder, ignore_errors=True)
        partial.rename(folder)
    except (OSError, subprocess.SubprocessError) as fault:
        said = getattr(fault, "stderr", None) or b""
        print(f"{folder.name} could not be installed: {fault}\n{said.decode(errors='replace')[-1000:]}")
    finally:
        shutil.rmtree(partial, ignore_errors=True)
