"""SynthRoads: synthetic motorway scenes, scanned by simulated laser scanners.

Importing this package needs no Blender; `register` and `unregister`, which Blender calls, import what they need.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path


@cache
def version() -> str:
    """Return the version from `blender_manifest.toml`: beside this file in the extension, above it in a checkout."""
    import tomllib

    here = Path(__file__).parent
    for folder in (here, here.parent):
        manifest = folder / "blender_manifest.toml"
        if manifest.is_file():
            return str(tomllib.loads(manifest.read_text(encoding="utf-8"))["version"])
    from importlib.metadata import version as installed

    return installed("synthroads")


def register() -> None:
    """Register the extension's classes with Blender."""
    from . import ui

    ui.register()


def unregister() -> None:
    """Remove the extension's classes from Blender."""
    from . import ui

    ui.unregister()
