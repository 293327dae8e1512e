"""A USD file tried in a process of its own, as its library ends the process where a file is damaged.

Run by `foreign` with runpy: PATH is the file, IMPORTER the name of Blender's operator, and FOLDERS are those in which
everything must lie that it, or a layer that it names, names. The first address that leads elsewhere is printed, and
nothing is imported then: composing the scene would read it. Nothing of this package is imported: Blender as a program
doesn't know it.
"""

from __future__ import annotations

import json
import os
import sys
from importlib import import_module
from pathlib import Path

import bpy

OUTSIDE = "names a file outside: "
"""Text before the layer and the address, which are printed as JSON."""
INSIDE = "names no file outside"
"""Text that is printed where there is no such address."""
_LAYERS = (".usd", ".usda", ".usdc", ".usdz")


def address_outside(path: str, folders: list[str]) -> tuple[str, str] | None:
    """Return the first layer and its address of something that is there and lies in none of some folders; None else.

    Args:
        path: of the root layer.
        folders: real paths.
    """
    for site in Path(bpy.utils.resource_path("LOCAL")).glob("python/lib/python*/site-packages"):
        sys.path.append(str(site))  # where Blender is a Python package, its own packages aren't on the path
    layers, tools = import_module("pxr.Sdf"), import_module("pxr.UsdUtils")
    waiting, seen = [path], {path}
    while waiting:
        here = waiting.pop()
        try:
            layer, named = layers.Layer.FindOrOpen(here), tools.ExtractExternalReferences(here)
        except Exception:  # pxr's own, of a layer that is damaged or isn't there: it names nothing
            layer, named = None, ()
        for address in (each for some in named for each in some if layer is not None and each):
            if address.replace("\\", "/").startswith("//"):  # another machine's
                return here, address
            name = layers.ComputeAssetPathRelativeToLayer(layer, address)
            file = name.partition("[")[0]
            place = Path(os.path.realpath(Path(file).parent if "<UDIM>" in file else file))
            if os.path.lexists(place) and not any(place.is_relative_to(folder) for folder in folders):
                return here, address
            if file.lower().endswith(_LAYERS) and name not in seen:
                seen.add(name)
                waiting.append(name)
    return None


def _say(line: str) -> None:
    """Print a line at once: the import that comes may end the process."""
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def try_file(path: str, importer: str, folders: list[str]) -> None:
    """Import a file, or print what it names outside of some folders."""
    address = address_outside(path, folders)
    if address is not None:
        _say(OUTSIDE + json.dumps(address))
        return
    _say(INSIDE)
    module, name = importer.split(".")
    getattr(getattr(bpy.ops, module), name)(filepath=path)


if __name__ == "__main__":
    given = globals()
    try_file(given["PATH"], given["IMPORTER"], given["FOLDERS"])
