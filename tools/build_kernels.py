"""Compile the scan's kernels (C) into libraries: when the package is built or installed, and by hand.

    python tools/build_kernels.py [--platform linux-x64|windows-x64|macos-arm64|all] [--output-dir DIR]

The compiler is Zig's, from the package `ziglang`: one for all platforms, on any. What it makes needs no other library,
neither C's. Wheels hold the libraries of all platforms, and stay the same for all of them; a checkout that is installed
has its own platform's, an extension that of its zip. The same source and compiler give the same bytes.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import platform
import re
import subprocess
import sys
import tempfile
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

try:
    from hatchling.builders.hooks.plugin.interface import BuildHookInterface
except ImportError:  # by hand, outside of a build
    BuildHookInterface = object  # type: ignore[assignment,misc]

ROOT = Path(__file__).resolve().parent.parent
KERNELS = ROOT / "synthroads_addon" / "scanning" / "kernels"
KEPT = ROOT / "build" / "kernels"
"""Folder that keeps what was compiled: a checkout is installed into many environments, from the same source."""
TARGETS = {
    # glibc's version is that of the wheels of embreex; the kernels call nothing of it.
    "linux-x64": ("x86_64-linux-gnu.2.17", "so"),
    "windows-x64": ("x86_64-windows-gnu", "dll"),
    "macos-arm64": ("aarch64-macos.11.0", "dylib"),
}
"""Zig's name of each platform for which there is Embree 4 by `embreex`, and the ending of its libraries."""
_OPTIONS = (
    *("-shared", "-nostdlib", "-s", "-fPIC", "-O2", "-std=c11", "-Wall", "-Wextra", "-Werror"),
    # No operation becomes another than the source has, and no loop a call of the C library.
    *("-ffp-contract=off", "-fno-sanitize=all", "-fno-builtin", "-fno-math-errno"),
)


_INCLUDED = re.compile(r'^#include "(.+)"$', re.MULTILINE)


class KernelError(Exception):
    """A kernel can't be compiled; the message says why."""


def this_platform() -> str:
    """Return the name of this machine's platform, as in `TARGETS` if it is there."""
    system = {"linux": "linux", "win32": "windows", "darwin": "macos"}.get(sys.platform, sys.platform)
    machine = platform.machine().lower()
    return f"{system}-{ {'x86_64': 'x64', 'amd64': 'x64', 'aarch64': 'arm64'}.get(machine, machine) }"


def build_kernels(target: str, folder: Path = KERNELS, kept_folder: Path | None = None) -> list[Path]:
    """Compile all kernels for a platform into a folder; return the paths of their libraries.

    Args:
        target: name of the platform, as in `TARGETS`.
        folder: for the libraries.
        kept_folder: of libraries that were compiled before, of which those of the same source, options and compiler
            are taken, and where new ones are added; None compiles all.

    Raises:
        KernelError: the compiler isn't installed, or fails.
    """
    if find_spec("ziglang") is None:
        raise KernelError("the compiler isn't installed: pip install 'ziglang>=0.17,<0.18'")
    triple, suffix = TARGETS[target]
    sources = sorted(KERNELS.glob("*.c"))
    return [_library(source, triple, folder / f"{source.stem}-{target}.{suffix}", kept_folder) for source in sources]


def _library(source: Path, triple: str, library: Path, kept_folder: Path | None) -> Path:
    """Write a source's library, compiled now or before, and return its path."""
    if kept_folder is None:
        return _write(library, _compile(source, triple, library.name))
    ingredients = (source_digest(source), source.name, triple, *_OPTIONS, library.name, version("ziglang"))
    kept_file = kept_folder / f"{hashlib.sha256(repr(ingredients).encode()).hexdigest()}-{library.name}"
    if not kept_file.is_file():
        _write(kept_file, _compile(source, triple, library.name))
    return _write(library, kept_file.read_bytes())


def _write(path: Path, content: bytes) -> Path:
    """Write a file so that it is there whole or not at all, in place of one that may be loaded; return its path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial_file = path.with_name(f"{path.name}.part-{os.getpid()}")
    partial_file.write_bytes(content)
    partial_file.replace(path)  # where the old one is loaded, it stays as it is
    return path


def _compile(source: Path, triple: str, name: str) -> bytes:
    """Return the library of a source for one of Zig's platforms, under a name, as bytes."""
    digest = source_digest(source)
    with tempfile.TemporaryDirectory(prefix="synthroads-") as cache:
        library = Path(cache) / name
        command = [sys.executable, "-m", "ziglang", "cc", "-target", triple, *_OPTIONS, f'-DSOURCE="{digest}"']
        if name.endswith(".dylib"):  # its name is written into it, else with the folder where it was made
            command.append(f"-Wl,-install_name,@rpath/{name}")
        environment = {**os.environ, "ZIG_GLOBAL_CACHE_DIR": cache, "ZIG_LOCAL_CACHE_DIR": cache}
        # By a relative path, so that no path of this machine gets in.
        answer = subprocess.run(
            [*command, source.name, "-o", str(library)],
            cwd=source.parent,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        if answer.returncode != 0:
            raise KernelError(f"{source.name} wasn't compiled for {triple}:\n{answer.stdout}{answer.stderr}")
        return library.read_bytes()


def source_digest(source: Path) -> str:
    """Return the SHA-256 of a source and of what it includes of its own, as `scanning.kernels.library` has it."""
    files_to_read, files_read = [source], list[Path]()
    while files_to_read:
        path = files_to_read.pop(0)
        if path not in files_read:
            files_read.append(path)
            names = _INCLUDED.findall(path.read_text(encoding="utf-8"))
            files_to_read += [(path.parent / name).resolve() for name in names]
    return hashlib.sha256(b"".join(path.read_bytes() for path in files_read)).hexdigest()


class KernelHook(BuildHookInterface):
    """Hook of hatchling that compiles the kernels: for all platforms into wheels, for its own where it is edited."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile before the files are gathered; what can't be compiled is left out, with a warning.

        Args:
            version: `standard` or `editable`.
            build_data: of hatchling.
        """
        targets = list(TARGETS) if version == "standard" else [this_platform()]
        for target in targets:
            if target not in TARGETS:
                continue
            try:
                build_kernels(target, kept_folder=KEPT)
            except KernelError as error:
                self.app.display_warning(f"SynthRoads works without its kernels, and slower: {error}")


def main() -> int:
    """Compile for the chosen platforms; return 0, or 1 if that failed."""
    parser = argparse.ArgumentParser(description="Compile the scan's kernels.")
    platforms, own_platform = [*TARGETS, "all"], this_platform()
    parser.add_argument("--platform", choices=platforms, default=own_platform, help="default: the current one")
    parser.add_argument("--output-dir", type=Path, default=KERNELS, metavar="DIR", help="default: beside the source")
    options = parser.parse_args()
    try:
        for target in TARGETS if options.platform == "all" else [options.platform]:
            for path in build_kernels(target, options.output_dir, KEPT):
                print(path)
    except KernelError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
