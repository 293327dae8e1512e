"""The one line that a command prints for an error which isn't a defect of ours."""

import errno

from synthroads_addon.base.errors import InputError
from synthroads_addon.base.process.end_signals import MAPPING_FAILED

EXTRAS = {
    **dict.fromkeys(("matplotlib", "skimage", "sklearn", "torch"), ("ml",)),
    "ifcopenshell": ("twin",),
    "pye57": ("e57",),
    "py4dgeo": ("changes",),
    "osmium": ("maps",),
    "pyogrio": ("maps", "twin"),
    **dict.fromkeys(("cryptography", "dask", "dask_jobqueue", "distributed"), ("cluster",)),
    **dict.fromkeys(("ml_dtypes", "onnx", "onnxruntime", "onnxscript"), ("onnx",)),
    **dict.fromkeys(("bpy", "mathutils", "shtab"), ("blender",)),
}
"""Name by which a package is imported -> extras of ours that bring it; all others come with SynthRoads itself."""
_MEMORY_SIGNS = (
    *("can't allocate memory", "annot allocate memory", "out of memory", "can't start new thread", "bad_alloc"),
    MAPPING_FAILED,
)
"""Parts of the errors by which libraries in other languages tell that memory is short."""
_SHOWN = 80
"""Characters that are shown of a name that is too long."""
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EROFS)


def error_line(error: Exception) -> str | None:
    """Return the line printed for an error, or None if it is a defect of ours, which is raised."""
    if isinstance(error, InputError):
        return f"error: {error}"
    if isinstance(error, ModuleNotFoundError):
        return missing_package(error)
    reason = _name_fault(error) or _shortage_reason(error)
    return reason and f"error: {reason}"


def missing_package(error: ModuleNotFoundError) -> str:
    """Return the error line for a package that isn't installed; re-raises the error of a module of our own."""
    name = (error.name or "").partition(".")[0]
    if name in ("", "headless", "ml", "synthroads_addon"):
        raise error
    requirement = f"synthroads[{EXTRAS[name][0]}]" if name in EXTRAS else "synthroads"
    within = "install and enable the SynthRoads extension in Blender, or " if name not in EXTRAS else ""
    return f"error: the package {name} is missing: {within}run pip install '{requirement}'"


def _name_fault(error: Exception) -> str | None:
    """Return the reason if an error means that the system takes no name as long as one that was given, else None."""
    if not isinstance(error, OSError) or error.errno != errno.ENAMETOOLONG:
        return None
    name = str(error.filename or "a file")
    short_name = name if len(name) <= _SHOWN else f"{name[:_SHOWN]}..."
    return f"{short_name!r} is no name of a file: the system takes none as long ({len(name):,} characters)"


def _shortage_reason(error: Exception) -> str | None:
    """Return the reason if an error means that memory, disk space or file handles ran out, else None."""
    text = " ".join(str(error).split())
    is_full = isinstance(error, MemoryError) or getattr(error, "errno", None) == errno.ENOMEM
    if is_full or any(sign in text for sign in _MEMORY_SIGNS):
        return f"too little memory ({text[:200] or 'it is full'}); nothing was left half-written"
    if isinstance(error, OSError) and error.errno in (errno.EMFILE, errno.ENFILE):
        return f"{error.filename or 'a file'} cannot be opened ({error.strerror}); ulimit -n raises the limit"
    if isinstance(error, OSError) and error.errno in _NO_ROOM:
        name = error.filename or "a temporary file"
        return f"{name} cannot be written ({error.strerror}); TMPDIR names another folder"
    return None
