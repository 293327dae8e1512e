"""Scratch folders: removed at the end of the work, and after a process that couldn't do so by the next one's.

Each has a lock file that names its owner. A folder whose owner is known to be dead is removed by the next process that
makes one beside it.
"""

import os
import re
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from ..errors import OutputError
from ..named_paths import is_inside
from .locks import is_dead, read_owner, this_process, try_lock

LOCK = ".owner.json"
"""File in each scratch folder that names the process which works in it, and is locked by it."""
NEW, ASIDE = "new", "old"
"""Folders in a scratch folder whose files belong beside it: those that are moved there, and those that stood there
before. The second is made when all new files are whole, and so says that the move has begun."""
REPORT = "report.json"
"""File that is moved to its place last: where it stands, the others stand too."""
_IN_OUTPUT, _IN_SYSTEM = ".partial-", "synthroads-"
_NAME = re.compile(rf"({re.escape(_IN_OUTPUT)}|{_IN_SYSTEM})\d+-[a-z0-9_]{{8}}")
_VARIABLES = ("TMPDIR", "TEMP", "TMP")
_NO_LINK = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
"""Flags by which no link is followed, and a pipe that somebody put there not waited for."""
_UNREADABLE = 60.0
"""Age, s, at which a lock file without an owner is one whose process was killed in the moment of writing it."""
_mine: dict[Path, int] = {}
"""This process's scratch folders that still stand, and the descriptors of their locks."""
_calls_left: dict[Path, int] = {}
"""How often scratch folders are still made in a folder until it is listed again."""
_ENTRIES_PER_CALL = 50
"""Entries of a folder that are listed, on average, for each scratch folder that is made in it."""
_journal: int | None = None
"""Descriptor of the file that names the folders which this process makes, for one that outlives it."""


@contextmanager
def scratch_folder(parent: Path | None = None) -> Iterator[Path]:
    """Yield a new folder that is removed at the end, and first remove what dead processes have left beside it.

    Args:
        parent: folder in which it is made, under a hidden name; the system's folder for temporary files if None.

    Raises:
        OSError: it can't be made.
    """
    place = Path(tempfile.gettempdir()) if parent is None else parent
    _look_for_leftovers(place)
    folder = _make_folder(place, _IN_SYSTEM if parent is None else _IN_OUTPUT)
    try:
        yield folder
    finally:
        if _is_ours(folder):  # and not in a process that was forked meanwhile
            _remove(folder)


@contextmanager
def temporary_files_in_scratch() -> Iterator[None]:
    """Have this process, the libraries in it and its children put their temporary files into a scratch folder.

    Blender's own, for one, which it leaves behind where it is killed. Where none can be made, all stays as it is.
    """
    with ExitStack() as stack:
        with suppress(OSError):
            folder = stack.enter_context(scratch_folder())
            former_settings = {name: os.environ.get(name) for name in _VARIABLES}, tempfile.tempdir
            stack.callback(_use_for_temporary_files, *former_settings)
            _use_for_temporary_files(dict.fromkeys(_VARIABLES, str(folder)), str(folder))
        yield


def _use_for_temporary_files(variables: dict[str, str | None], folder: str | None) -> None:
    """Set the environment's variables (None: take away) and Python's folder for temporary files."""
    for name, value in variables.items():
        if value is None:
            os.environ.pop(name, None)
        else:
            os.environ[name] = value
    tempfile.tempdir = folder


def temporary_folder_error(folder: Path, error: Exception) -> OutputError:
    """Return the error that says that something couldn't be written to a temporary folder."""
    reason, place = getattr(error, "strerror", None) or "is the disk or the memory full?", folder
    while _NAME.fullmatch(place.name):
        place = place.parent
    return OutputError("temporary folder", str(place), f"cannot be written ({reason}); TMPDIR names another")


def _look_for_leftovers(parent: Path) -> None:
    """Remove a folder's leftovers, but in a full folder only at each so manyth call, as it is listed for that.

    Work that puts a thousand files into one folder would list it a thousand times.
    """
    calls_left = _calls_left.pop(parent, 0)
    if calls_left := calls_left - 1 if calls_left else remove_leftovers(parent) // _ENTRIES_PER_CALL:
        _calls_left[parent] = calls_left


def remove_leftovers(parent: Path) -> int:
    """Remove the scratch folders in a folder whose owners are known to be dead; doesn't raise.

    Returns:
        the number of entries that the folder has.
    """
    count, candidates = 0, []
    with suppress(OSError), os.scandir(parent) as entries:
        for entry in entries:
            count += 1
            if _NAME.fullmatch(entry.name) and entry.is_dir(follow_symlinks=False):
                candidates.append(Path(entry.path))
    for folder in candidates:
        if folder not in _mine:
            with suppress(OSError):  # the others' turn comes all the same
                _remove_leftover(folder)
    return count


def remove_scratch_folders() -> None:
    """Remove the scratch folders of this process that still stand, before it ends without unwinding its stack."""
    for folder in filter(_is_ours, list(_mine)):
        _remove(folder)


def record_folders_in(descriptor: int) -> None:
    """Have each scratch and output folder that this process makes from now on named in an open file."""
    global _journal
    _journal = descriptor


def record_folder(folder: Path) -> None:
    """Append the path of a folder that was just made to the file of `record_folders_in`, if there is one."""
    if _journal is not None:
        _write(_journal, os.fsencode(folder.absolute()) + b"\0")


def _write(descriptor: int, data: bytes) -> None:
    """Write all of some bytes to an open file, of which the system may take only a part where there is little room."""
    while data:
        data = data[os.write(descriptor, data) :]


def remove_recorded_folders(descriptor: int) -> None:
    """Remove the folders that a dead process named in an open file: scratch folders, and others if empty."""
    paths = os.pread(descriptor, os.fstat(descriptor).st_size, 0).split(b"\0")[:-1]
    for folder in (Path(os.fsdecode(path)) for path in reversed(paths)):
        with suppress(OSError):
            if _NAME.fullmatch(folder.name):
                _remove_leftover(folder)
            else:
                folder.rmdir()


def _is_ours(folder: Path) -> bool:
    """Return whether this process made a scratch folder, and not the one that it was forked from."""
    return folder.name.split("-")[1] == str(os.getpid())


def _make_folder(parent: Path, prefix: str) -> Path:
    """Return a new scratch folder with its lock file, tried anew where an empty one was taken for a leftover."""
    while True:
        folder = Path(tempfile.mkdtemp(prefix=f"{prefix}{os.getpid()}-", dir=parent))
        try:
            record_folder(folder)
            lock = os.open(folder / LOCK, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o644)
        except FileNotFoundError:
            continue
        except OSError:
            folder.rmdir()
            raise
        _mine[folder] = lock
        try:
            _write(lock, this_process(try_lock(lock) is True).to_json().encode())
        except OSError:  # the disk is full
            _remove(folder)
            raise
        return folder


def _remove(folder: Path) -> None:
    """Remove a folder that is this process's by now: its lock last, so that it is a leftover if this is cut off."""
    if not _finish_move(folder):
        return
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if entry.is_dir(follow_symlinks=False):
                shutil.rmtree(entry.path, ignore_errors=True)
            elif entry.name != LOCK:
                with suppress(OSError):
                    Path(entry.path).unlink()
    lock = _mine.get(folder)
    if lock is not None:
        with suppress(OSError):
            os.close(lock)
    shutil.rmtree(folder, ignore_errors=True)
    _mine.pop(folder, None)  # not before: where this is cut off `remove_scratch_folders` goes on with it


def names_to_move(folder: Path) -> list[str]:
    """Return the names of what is in a folder in the order in which it is moved: `REPORT` last."""
    return sorted((path.name for path in folder.glob("*")), key=lambda name: (name == REPORT, name))


def _finish_move(folder: Path) -> bool:
    """Finish a scratch folder's move that was cut off; return whether the folder may go: no old file is in it alone.

    Nothing is moved, and the folder stays, where links in it lead elsewhere: it isn't as a move leaves it.
    """
    aside_folder, target = folder / ASIDE, folder.parent
    if not folder.name.startswith(_IN_OUTPUT) or not aside_folder.is_dir():
        return True
    if not all(is_inside(folder, name, follow=True) for name in (NEW, ASIDE)):
        return False
    for name in names_to_move(folder / NEW):
        with suppress(OSError):
            (folder / NEW / name).replace(target / name)
    for name in names_to_move(aside_folder):
        with suppress(OSError):
            if not (target / name).exists():
                (aside_folder / name).replace(target / name)
    return all((target / name).exists() for name in names_to_move(aside_folder))


def _remove_leftover(folder: Path) -> None:
    """Remove a folder if its owner is dead, or if it is empty: its owner was killed before it named itself."""
    try:
        lock = os.open(folder / LOCK, os.O_RDWR | _NO_LINK)
    except FileNotFoundError:
        with suppress(OSError):
            folder.rmdir()
        return
    except OSError:
        return
    try:
        is_owner_dead = _owner_is_dead(lock)
        if is_owner_dead:
            _remove(folder)
    finally:
        os.close(lock)
    if is_owner_dead:  # Windows removes no file that is open
        _remove(folder)


def _owner_is_dead(lock: int) -> bool:
    """Return whether the process that an open lock file names is known to have ended."""
    lock_taken = try_lock(lock)
    owner = read_owner(os.read(lock, 4096).decode(errors="replace"))
    if owner is None:
        age = time.time() - os.fstat(lock).st_mtime  # noqa: TID251 - files are dated by the wall clock
        return lock_taken is not False and age > _UNREADABLE
    return is_dead(owner, lock_taken)
