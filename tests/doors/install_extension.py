"""Install and enable extensions from their zips, as Preferences > Install from Disk does, and keep the preferences.

    BLENDER_USER_RESOURCES=FOLDER python install_extension.py ZIP [ZIP ...]

It needs Blender's Python with `bpy` and nothing else. It prints what came of it as JSON.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

import bpy


def main() -> int:
    """Install the zips named by the arguments; return 1 if one of them isn't enabled afterwards."""
    for archive in sys.argv[1:]:
        bpy.ops.extensions.package_install_files(filepath=archive, repo="user_default", enable_on_install=True)
    bpy.ops.wm.save_userpref()
    enabled = sorted(bpy.context.preferences.addons.keys())
    own = Path(os.environ["BLENDER_USER_RESOURCES"]).resolve()
    brought = {
        name: own in Path(module.__file__).resolve().parents
        for name, module in sys.modules.items()
        if name in ("numpy", "scipy", "pyproj", "pydantic", "embreex", "laspy", "rasterio") and module.__file__
    }
    print(json.dumps({"enabled": enabled, "brought": brought}))
    wanted = {f"bl_ext.user_default.{Path(archive).name.partition('-')[0]}" for archive in sys.argv[1:]}
    return 0 if wanted <= set(enabled) else 1


if __name__ == "__main__":
    code = main()
    sys.stdout.flush()
    os._exit(code)  # without Blender's teardown, which can crash
