"""Trial import of a USD file in a separate process, as USD's library ends the process if a file is damaged.

Run by `foreign` with runpy: PATH is the file, IMPORTER the name of Blender's operator, and FOLDERS are the folders that
must contain all files that it, or one of its layers, refers to. The first reference to a file elsewhere is printed, and
nothing is imported then: composing the scene would read that file. Nothing of this package is imported, as Blender as a
program can't find it.
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
"""Text that is printed if there is no such address."""
_LAYERS = (".usd", ".usda", ".usdc", ".usdz")


def address_outside(path: str, folders: list[str]) -> tuple[str, str] | None:
    """Return (layer, address) of the first reference to an existing file outside of some folders; None without one.

    Args:
        path: path of the root layer.
        folders: real paths of the folders.
    """
    for site in Path(bpy.utils.resource_path("LOCAL")).glob("python/lib/python*/site-packages"):
        sys.path.append(str(site))  # where Blender is a Python package, its own packages aren't on the path
    sdf, usd_utils = import_module("pxr.Sdf"), import_module("pxr.UsdUtils")
    queue, queued_layers = [path], {path}
    while queue:
        layer_path = queue.pop()
        try:
            layer, references = sdf.Layer.FindOrOpen(layer_path), usd_utils.ExtractExternalReferences(layer_path)
        except Exception:  # pxr's own exceptions: a damaged or missing layer refers to nothing
            layer, references = None, ()
        for address in (
            reference
            for kind_references in references
            for reference in kind_references
            if layer is not None and reference
        ):
            if address.replace("\\", "/").startswith("//"):  # a file on another machine
                return layer_path, address
            name = sdf.ComputeAssetPathRelativeToLayer(layer, address)
            file = name.partition("[")[0]
            place = Path(os.path.realpath(Path(file).parent if "<UDIM>" in file else file))
            if os.path.lexists(place) and not any(place.is_relative_to(folder) for folder in folders):
                return layer_path, address
            if file.lower().endswith(_LAYERS) and name not in queued_layers:
                queued_layers.add(name)
                queue.append(name)
    return None


def _say(line: str) -> None:
    """Print a line at once, as the import that follows may end the process."""
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def try_file(path: str, importer: str, folders: list[str]) -> None:
    """Import a file, or print its first reference to a file outside of some folders."""
    address = address_outside(path, folders)
    if address is not None:
        _say(OUTSIDE + json.dumps(address))
        return
    _say(INSIDE)
    module, name = importer.split(".")
    getattr(getattr(bpy.ops, module), name)(filepath=path)


if __name__ == "__main__":
    script_globals = globals()
    try_file(script_globals["PATH"], script_globals["IMPORTER"], script_globals["FOLDERS"])
