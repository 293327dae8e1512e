"""Compiled kernels: their files by platform, loaded if they are of the source that lies beside them."""

from __future__ import annotations

import ctypes
import hashlib
import platform
import re
import sys
from pathlib import Path

FOLDER = Path(__file__).parent
"""Where each kernel's source lies, and beside it what was compiled from it."""
_SYSTEMS = {"linux": ("linux", "so"), "win32": ("windows", "dll"), "darwin": ("macos", "dylib")}
_MACHINES = {"x86_64": "x64", "amd64": "x64", "aarch64": "arm64", "arm64": "arm64"}


_INCLUDED = re.compile(r'^#include "(.+)"$', re.MULTILINE)


class NoKernelError(Exception):
    """A kernel can't be used on this machine; the message says why, as part of a sentence."""


def load_kernel(name: str, folder: Path = FOLDER) -> ctypes.CDLL:
    """Return the library of a kernel for this platform; its functions let go of Python's lock.

    Raises:
        NoKernelError: there is none, it doesn't load, or it was compiled from another source.
    """
    system, suffix = _SYSTEMS.get(sys.platform, (sys.platform, "so"))
    machine = _MACHINES.get(platform.machine().lower(), platform.machine().lower())
    path = folder / f"{name}-{system}-{machine}.{suffix}"
    if not path.exists():
        raise NoKernelError(f"{path.name} isn't installed")
    try:
        library = ctypes.CDLL(str(path))
        library.synthroads_source.restype = ctypes.c_char_p
        built_from = library.synthroads_source().decode()
    except (OSError, AttributeError, UnicodeDecodeError) as error:
        raise NoKernelError(f"{path.name} can't be loaded ({error})") from error
    if built_from != source_digest(folder / f"{name}.c"):
        raise NoKernelError(f"{path.name} is of another version: install SynthRoads again")
    return library


def source_digest(source: Path) -> str:
    """Return the SHA-256 of a kernel's source and of the project's files that it includes, one after the other.

    tools/build_kernels.py puts the same digest into what it compiles.
    """
    pending, included = [source], list[Path]()
    while pending:
        path = pending.pop(0)
        if path not in included:
            included.append(path)
            names = _INCLUDED.findall(path.read_text(encoding="utf-8"))
            pending += [(path.parent / name).resolve() for name in names]
    return hashlib.sha256(b"".join(path.read_bytes() for path in included)).hexdigest()
