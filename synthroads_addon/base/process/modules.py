"""Processes that run a module of ours by its name, wherever the package lies."""

import os
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

_PACKAGE = __name__.removesuffix(".base.process.modules")
_ROOT = str(Path(__file__).parents[3])


_launcher: Callable[[str], list[str]] | None = None


def launch_modules_by(launcher: Callable[[str], list[str]] | None) -> None:
    """Have modules run by another program than this process's Python, such as a Blender; None for Python again.

    Args:
        launcher: returns the beginning of a command that runs a module, by its full name; arguments follow it.
    """
    global _launcher
    _launcher = launcher


def module_command(name: str) -> list[str]:
    """Return the beginning of a command that runs a module of this package, such as ``jobs.dataset.scene_process``.

    The working folder isn't searched: what is called like a module of Python or of ours there is not taken for it. It
    must be run in `module_environment`.
    """
    if _launcher is not None:
        return _launcher(f"{_PACKAGE}.{name}")
    return [sys.executable, "-P", "-m", f"{_PACKAGE}.{name}"]


def module_environment() -> Mapping[str, str]:
    """Return the variables of a process that finds this package, before others of its name."""
    paths = [_ROOT, os.environ.get("PYTHONPATH", "")]
    return os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, paths))}
