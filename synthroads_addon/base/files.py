"""Reading text files, and writing a job's files so that nothing half-written ever stands under its final name."""

import errno
import os
import shutil
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from itertools import takewhile
from pathlib import Path

from .errors import InputError, MissingFileError, OutputError, nearest_name
from .scratch.folders import ASIDE, NEW, REPORT, names_to_move, record_folder, scratch_folder
from .scratch.locks import LockHeldError, exclusive

PRESETS = Path(__file__).parents[1] / "presets"
"""Folder of the shipped data: classes, materials, signs, devices, scenarios, recipes, assets."""


def read_text(path: str | os.PathLike[str], kind: str, need: str = "", encoding: str = "utf-8") -> str:
    """Return the content of a text file.

    Args:
        path: of the file.
        kind: what is said where it is no text, e.g. ``must be JSON in UTF-8``.
        need: what is said before the system's own words where it can't be read, e.g. ``an axis file is needed here``.
        encoding: ``utf-8-sig`` takes a byte order mark as well.

    Raises:
        MissingFileError: the file doesn't exist or cannot be read.
        InputError: it is no text.
    """
    name = os.fspath(path)
    with _told_faults(name, need, kind):
        return Path(name).read_text(encoding=encoding)


def read_bytes(path: str | os.PathLike[str], need: str = "") -> bytes:
    """Return the content of any file; MissingFileError and ``need`` as in `read_text`."""
    with _told_faults(os.fspath(path), need):
        return Path(path).read_bytes()


def decoded(content: bytes, path: str | os.PathLike[str], kind: str, encoding: str = "utf-8") -> str:
    """Return the text that a file's content is, with its own line ends; InputError and arguments as in `read_text`."""
    with _told_faults(os.fspath(path), kind=kind):
        return content.decode(encoding)


@contextmanager
def _told_faults(name: str, need: str = "", kind: str = "") -> Iterator[None]:
    """Context in which a file is read: what goes wrong is told as `read_text` tells it."""
    try:
        yield
        return
    except OSError as error:
        if isinstance(error, FileNotFoundError) and not need:
            raise MissingFileError(name, None, "no such file") from None
        reason = os.strerror(error.errno or 0)
    except UnicodeDecodeError:
        raise InputError(name, None, kind) from None
    except ValueError as error:  # no name of a file: it holds a null byte
        reason = str(error)
    raise MissingFileError(name, None, f"{need or 'cannot be read'} ({reason})")


def preset_names(folder: Path, ending: str = ".json") -> list[str]:
    """Return the sorted names of the presets in a folder, which are its files of an ending."""
    return sorted(path.stem for path in folder.glob(f"*{ending}"))


def preset_path(folder: Path, name_or_file: str, field: str, endings: Sequence[str] = (".json",)) -> Path:
    """Return the file of a preset of this name, else the named file; InputError if it has no such ending.

    Args:
        folder: of the presets.
        name_or_file: a preset's name, or a file.
        field: what the message calls it.
        endings: that a file may have; the presets have the first.

    Raises:
        InputError: it is neither a preset's name nor has such an ending.
    """
    names = preset_names(folder, endings[0])
    if name_or_file in names:
        return folder / f"{name_or_file}{endings[0]}"
    if Path(name_or_file).suffix.lower() not in endings:
        kinds = " or ".join(ending for ending in endings if ending != ".yml")
        allowed = f"must be a {kinds} file or one of {', '.join(names)}{nearest_name(name_or_file, names)}"
        raise InputError(field, name_or_file, allowed)
    return Path(name_or_file)


def change_stamp(path: str, need: str) -> tuple[int, int]:
    """Return when a file was last changed (ns) and its size (bytes), by which its change is noticed.

    Raises:
        MissingFileError: it doesn't exist; ``need`` is said before the system's own words.
    """
    try:
        status = Path(path).stat()
    except (OSError, ValueError) as error:  # ValueError: its name holds a null byte
        raise MissingFileError(path, None, f"{need} ({getattr(error, 'strerror', None) or error})") from None
    return status.st_mtime_ns, status.st_size


def files_below(folder: Path) -> Iterator[Path]:
    """Yield every file below a folder, also by way of links to folders; each folder is entered once, links last.

    A link to a folder that is entered already, such as one above it, leads nowhere new and is left out.
    """
    entered_folders: set[str] = set()
    folders_to_enter = [folder]
    while folders_to_enter:
        for current, folders, files in os.walk(folders_to_enter.pop(0)):
            real_path = os.path.realpath(current)
            if real_path in entered_folders:
                folders.clear()
                continue
            entered_folders.add(real_path)
            folders.sort()
            folders_to_enter += [path for path in (Path(current, name) for name in folders) if path.is_symlink()]
            yield from (Path(current, name) for name in sorted(files))


@contextmanager
def output_folder(target: Path, names: Iterable[str], overwrite: bool) -> Iterator[Path]:
    """Yield a temporary folder inside ``target``; at the end its files are moved into ``target``.

    When the work fails or is stopped, the temporary folder is removed and ``target`` is as it was. ``report.json``,
    where there is one, is moved last and one that is there is removed first: where it stands, all that it tells of
    stands as well, even after a power cut.

    Args:
        target: folder for the files; made if it isn't there.
        names: the files that will be written, to find out early if one is already there.
        overwrite: whether files of these names may be replaced; other files in the folder are never touched.

    Raises:
        OutputError: a file is already there, or the folder can't be made or written, or the disk is full.
    """
    existing_names = [name for name in names if (target / name).exists()]
    if existing_names and not overwrite:
        raise OutputError("--output", str(target), f"already holds {existing_names[0]}; --overwrite replaces it")
    with ExitStack() as stack:
        try:
            stack.enter_context(made_folder(target))
            scratch = stack.enter_context(scratch_folder(target))
            (work := scratch / NEW).mkdir()
        except OSError as error:
            raise OutputError("--output", str(target), f"cannot be written ({error.strerror})") from None
        try:
            yield work
            _move_all(work, target, scratch / ASIDE)
        except OSError as error:
            if error.errno in _UNWRITABLE:
                raise OutputError("--output", str(target), f"cannot be written ({error.strerror})") from None
            raise


_UNWRITABLE = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EACCES, errno.EPERM, errno.EROFS, errno.EIO)
"""Errors of the system that say that a place can't be written to."""
_NO_SYNC = (errno.EINVAL, errno.ENOSYS, errno.ENOTSUP)
"""Errors of file systems that can't be told to write to the disk."""


@contextmanager
def made_folder(folder: Path) -> Iterator[None]:
    """Context in which a folder is there, and those above it; of those that it makes, empty ones go at the end.

    If the process is killed, its supervisor removes the empty ones.

    Raises:
        OSError: it can't be made.
    """
    missing_folders = list(takewhile(lambda path: not _is_there(path), (folder, *folder.parents)))
    for path in reversed(missing_folders):
        record_folder(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield
    finally:
        for path in missing_folders:
            with suppress(OSError):
                path.rmdir()


@contextmanager
def writable_folder(folder: Path, field: str = "--output", shown_path: Path | None = None) -> Iterator[None]:
    """Context of `made_folder` in which the folder can be written to.

    Args:
        folder: for files.
        field: what the caller calls the path, for the message.
        shown_path: the path that the message names; the folder if None.

    Raises:
        OutputError: it can't be made or written to.
    """
    with ExitStack() as stack:
        try:
            stack.enter_context(made_folder(folder))
            with scratch_folder(folder):
                pass
        except OSError as error:
            raise OutputError(field, str(shown_path or folder), f"cannot be written ({error.strerror})") from None
        yield


@contextmanager
def folder_at_work(folder: Path, lock: str, *, keep: bool = True) -> Iterator[None]:
    """Context of `made_folder` in which no other process is at work in the folder, by a lock file in it.

    Args:
        folder: for a run's files.
        lock: name of the lock file.
        keep: whether the lock file stays, empty; else it goes at the end, and the folder too if it holds nothing else.

    Raises:
        OutputError: another process is at work in it, or it can't be made or written to.
        InputError: the lock file is a link that leads out of the folder.
    """
    with ExitStack() as stack:
        try:
            stack.enter_context(made_folder(folder))
            stack.enter_context(exclusive(folder / lock, keep=keep))
        except LockHeldError as taken:
            raise OutputError("--output", str(folder), _lock_text(taken, folder / lock)) from None
        except OSError as error:
            raise OutputError("--output", str(folder), f"cannot be written ({error.strerror})") from None
        yield


def _lock_text(held_lock: LockHeldError, lock: Path) -> str:
    """Return the error text for a folder whose lock another run holds, or may hold."""
    owner = f": process {held_lock.owner.pid} of {held_lock.owner.host}" if held_lock.owner else ""
    if held_lock.certain:
        return f"another run is at work in it{owner}"
    return f"another run may be at work in it{owner} (its disk knows no locks); if that has ended, remove {lock}"


def check_file_target(path: Path, field: str = "--output", overwrite: bool = False, ending: str = "") -> None:
    """Raise an `OutputError` for a file that can't be written, before the work: a temporary folder is made and removed.

    Args:
        path: of the file; its folder needn't be there, and isn't made.
        field: what the caller calls the path, for the message; empty where nobody gave it: the file is named then.
        overwrite: whether a file that is there may be replaced.
        ending: that its name must have, e.g. ``.geojson``; any if empty.
    """
    if ending and path.suffix.lower() != ending:
        raise OutputError(field, str(path), f"must end in {ending}")
    if _is_there(path) and path.is_dir():
        raise OutputError(field, str(path), "is a folder; name a file")
    if _is_there(path) and not overwrite:
        remedy = "--overwrite replaces it" + ("" if field else ", --output names another file")
        raise OutputError(*_named(field, path), f"is there already; {remedy}")
    check_folder_target(path.parent, field, path)


def path_beside(file: Path, name: str, field: str) -> Path:
    """Return the path of a name in the folder of a file.

    Args:
        file: that somebody named; it needn't be there.
        name: of the other one.
        field: what the user calls the file, for the message.

    Raises:
        InputError: it is the name of a folder as such: empty, a dot or a slash.
    """
    if not file.name:
        raise InputError(field, str(file), "must name a file")
    return file.with_name(name)


def _is_there(path: Path) -> bool:
    """Return whether a path exists, as far as this process may know."""
    try:
        return path.exists()
    except OSError:  # a folder above it can't be entered
        return False


def check_folder_target(folder: Path, field: str = "--output", shown_path: Path | None = None) -> None:
    """Raise an `OutputError` if nothing can be written to a folder, or to the nearest one above it that is there.

    Args:
        folder: for files; it needn't be there, and isn't made.
        field: what the caller calls the path, for the message; empty where nobody gave it.
        shown_path: the path that the message names; the folder if None.
    """
    existing_folder = next(path for path in (folder, *folder.absolute().parents) if _is_there(path))
    try:
        with scratch_folder(existing_folder):
            pass
    except OSError as error:
        remedy = "" if field else "; --output names another place"
        raise OutputError(
            *_named(field, shown_path or folder), f"cannot be written ({error.strerror}){remedy}"
        ) from None


def _named(field: str, path: Path) -> tuple[str, str | None]:
    """Return field and value by which an error names a path: that which nobody gave is the field itself."""
    return (field, str(path)) if field else (str(path), None)


def _move_all(source: Path, target: Path, aside_folder: Path) -> None:
    """Move a folder's files to their places, all or none.

    Where the user stops the work meanwhile all are moved all the same, as a part of them fits nothing; where one can't
    be moved, those that stood there before are put back.
    """
    for path in source.rglob("*"):
        if path.is_file():
            sync_file(path)
    names = names_to_move(source)
    aside_folder.mkdir()  # from now on the move is finished by the next process if this one is killed
    interrupt: KeyboardInterrupt | None = None
    while True:
        try:
            _move_once(names, source, target, aside_folder)
            break
        except KeyboardInterrupt as signal:
            interrupt = signal
        except OSError:
            _put_back(names, source, target, aside_folder)
            raise
    if interrupt is not None:
        raise interrupt


def _move_once(names: list[str], source: Path, target: Path, aside_folder: Path) -> None:
    """Move what isn't moved yet: old reports away first, new ones in last."""
    for name in reversed(names):
        if (source / name).exists() and (target / name).exists():
            (target / name).replace(aside_folder / name)
    sync_folder(target)
    for name in names:
        if (source / name).exists():
            if name == REPORT:
                sync_folder(target)
            (source / name).replace(target / name)
    sync_folder(target)


def _put_back(names: list[str], source: Path, target: Path, aside_folder: Path) -> None:
    """Undo what `_move_once` did, as far as that is possible."""
    for name in names:
        with suppress(OSError):
            if not (source / name).exists():
                (target / name).replace(source / name)
        with suppress(OSError):
            if (aside_folder / name).exists():
                (aside_folder / name).replace(target / name)
    shutil.rmtree(source, ignore_errors=True)  # what is still aside is put back by whoever removes the folder


def sync_file(path: Path) -> None:
    """Write a file's content from the system's buffers to the disk (fsync), so that it survives a power cut."""
    with path.open("rb+") as file:
        _sync(file.fileno())


def sync_folder(folder: Path) -> None:
    """Write a folder's names from the system's buffers to the disk (fsync), where the system can."""
    if os.name == "nt":  # it opens no folders
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        _sync(descriptor)
    finally:
        os.close(descriptor)


def _sync(descriptor: int) -> None:
    """Write an open file's buffers to the disk, where the file system can."""
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in _NO_SYNC:
            raise


def write_file(path: Path, content: bytes, field: str = "--output", overwrite: bool = False) -> None:
    """Write one file atomically, by renaming one from a temporary folder beside it; it is on the disk by then.

    Args:
        path: of the file; its folder is made if it isn't there.
        content: of the file.
        field: what the caller calls the path, for the message.
        overwrite: whether a file that is there may be replaced.

    Raises:
        OutputError: it is there already, or it can't be written.
    """
    if path.exists() and not overwrite:
        raise OutputError(field, str(path), "is there already; --overwrite replaces it")
    try:
        with made_folder(path.parent), scratch_folder(path.parent) as folder:
            temporary = folder / path.name
            temporary.write_bytes(content)
            sync_file(temporary)
            temporary.replace(path)
            sync_folder(path.parent)
    except OSError as error:
        raise OutputError(field, str(path), f"cannot be written ({error.strerror})") from None
