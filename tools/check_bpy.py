"""Check that Blender's Python package loads; if not, name the system packages that are missing.

The wheels of bpy bring most of what they need, but not the libraries of the X window system and OpenGL, which they
are linked to even where no window is ever opened.
"""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
import tempfile
from pathlib import Path

# Debian's (and Ubuntu's) package of each library that bpy 4.5 and 5.2 are linked to and don't bring.
DEBIAN_PACKAGES = {
    "libGL.so.1": "libgl1",
    "libICE.so.6": "libice6",
    "libSM.so.6": "libsm6",
    "libX11.so.6": "libx11-6",
    "libXext.so.6": "libxext6",
    "libXfixes.so.3": "libxfixes3",
    "libXi.so.6": "libxi6",
    "libXrender.so.1": "libxrender1",
    "libXxf86vm.so.1": "libxxf86vm1",
    "libgomp.so.1": "libgomp1",
    "libstdc++.so.6": "libstdc++6",
    "libuuid.so.1": "libuuid1",
    "libxkbcommon.so.0": "libxkbcommon0",
}


def missing_libraries(ldd_output: str) -> list[str]:
    """Return the names of the libraries that the output of `ldd` reports as not found, each once, in its order."""
    lines = (line.strip() for line in ldd_output.splitlines())
    return list(dict.fromkeys(line.split(" =>")[0] for line in lines if line.endswith("=> not found")))


def install_advice(libraries: list[str]) -> str:
    """Return a text that says which Debian packages to install for missing libraries."""
    packages = sorted({DEBIAN_PACKAGES[name] for name in libraries if name in DEBIAN_PACKAGES})
    others = [name for name in libraries if name not in DEBIAN_PACKAGES]
    lines = [f"bpy needs shared libraries that this machine lacks: {', '.join(libraries)}"]
    if packages:
        lines.append(f"On Debian or Ubuntu: sudo apt install {' '.join(packages)}")
    if others:
        lines.append(f"Not in our list, look for the packages that hold: {', '.join(others)}")
    return "\n".join(lines)


def import_error() -> str:
    """Try to import bpy in a separate process; return its error message, or an empty string if it loads."""
    with tempfile.TemporaryDirectory() as folder:
        answer = subprocess.run(
            [sys.executable, "-c", "import os, bpy; os._exit(0)"],  # bpy's own way out can crash
            env={**os.environ, "BLENDER_USER_RESOURCES": folder},
            capture_output=True,
            text=True,
            check=False,
        )
    if answer.returncode == 0:
        return ""
    return answer.stderr.strip() or f"it ended with code {answer.returncode}"


def main() -> int:
    """Return 0 if bpy loads; otherwise print what to do and return 1."""
    error = import_error()
    if not error:
        return 0
    spec = importlib.util.find_spec("bpy")
    binary = Path(spec.origin).with_suffix(".so") if spec and spec.origin else None
    if binary and binary.exists() and sys.platform.startswith("linux"):
        answer = subprocess.run(["ldd", str(binary)], capture_output=True, text=True, check=False)
        if libraries := missing_libraries(answer.stdout):
            print(install_advice(libraries))
            return 1
    print(f"bpy does not load: {error}")
    return 1


if __name__ == "__main__":
    sys.exit(main())
