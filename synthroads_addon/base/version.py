"""The version of SynthRoads, and the name under which it signs what it writes."""

from functools import cache
from pathlib import Path


@cache
def version() -> str:
    """Return the version from `blender_manifest.toml`: in the package in the extension, above it in a checkout."""
    import tomllib  # hardly anything asks for the version
    from importlib import metadata

    package_folder = Path(__file__).parents[1]
    for folder in (package_folder, package_folder.parent):
        manifest = folder / "blender_manifest.toml"
        if manifest.is_file():
            return str(tomllib.loads(manifest.read_text(encoding="utf-8"))["version"])
    return metadata.version("synthroads")


def generator() -> str:
    """Return the program and its version, as in "SynthRoads 1.0.0"."""
    return f"SynthRoads {version()}"
