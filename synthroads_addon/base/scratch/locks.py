"""Locks of files, and which process something belongs to: written down so that another can tell if it still lives.

The system frees the lock of an open file when its process ends, however it ends; some file systems know none.
"""

import errno
import json
import os
import socket
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path

from ..named_paths import path_inside

_TAKEN = (errno.EWOULDBLOCK, errno.EAGAIN, errno.EACCES, errno.EDEADLK)


def try_lock(descriptor: int) -> bool | None:
    """Lock an open file without waiting and return whether that worked; None if its file system knows no locks.

    Returns:
        True if it is locked now, False if another process has locked it, None if its file system knows no locks (as
        Lustre and some NFS mounts don't): then nothing is known.
    """
    try:
        if sys.platform == "win32":
            import msvcrt  # only Windows has it

            os.lseek(descriptor, 0, os.SEEK_SET)  # it locks a byte at the file's place, which must be one for all
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        else:
            import fcntl  # Windows has none

            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        return False if error.errno in _TAKEN else None
    return True


@dataclass(frozen=True)
class Owner:
    """Identity of a process, by which another one on this or another machine knows it again.

    Attributes:
        host: name of the machine.
        boot: id of the machine's boot; empty where the system tells none.
        pid: number of the process.
        start: when it started, in clock ticks since the boot; 0 where the system doesn't tell. A number that was given
            to another process after the owner's end has another start.
        locked: whether the file that says so is locked as long as the owner lives.
        space: namespace of the number, which containers have of their own; empty where the system tells none.
    """

    host: str
    boot: str
    pid: int
    start: int
    locked: bool = False
    space: str = ""

    def to_json(self) -> str:
        """Return the process's identity as one line of JSON."""
        return json.dumps(asdict(self)) + "\n"


def read_owner(text: str) -> Owner | None:
    """Return the process that a text of `Owner.to_json` names; None where the text is damaged or cut off."""
    try:
        owner = Owner(**json.loads(text))
    except (ValueError, TypeError):
        return None
    kinds = {"host": str, "boot": str, "pid": int, "start": int, "locked": bool, "space": str}
    return owner if all(isinstance(getattr(owner, name), kind) for name, kind in kinds.items()) else None


def this_process(locked: bool = False) -> Owner:
    """Return the identity of the calling process."""
    pid = os.getpid()
    return Owner(socket.gethostname(), _boot_id(), pid, _start_of(pid) or 0, locked, _space())


def is_dead(owner: Owner, lock: bool | None) -> bool:
    """Return whether a process is known to have ended; False where that can't be told.

    Args:
        owner: the process.
        lock: whether its file's lock could be taken; None where the file system has no locks.
    """
    if lock is False:
        return False
    # One kernel, if in another container: it frees locks itself.
    if owner.locked and lock and owner.boot and owner.boot == _boot_id():
        return True
    if owner.host != socket.gethostname():
        return False
    if owner.boot != _boot_id():
        return True
    if owner.space and owner.space != _space():  # another container of the same name: its numbers aren't ours
        return False
    start = _start_of(owner.pid)
    return start is None or start != owner.start


@cache
def _boot_id() -> str:
    """Return the id of the machine's boot; empty where the system tells none. Cached."""
    try:
        return Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
    except OSError:  # not Linux
        return ""


def _space() -> str:
    """Return the process-number namespace of this process; empty where the system tells none."""
    try:
        return str(Path("/proc/self/ns/pid").readlink())
    except OSError:  # not Linux
        return ""


def _start_of(pid: int) -> int | None:
    """Return the start of a process in ticks since the boot, 0 where the system doesn't tell; None if it has ended."""
    if sys.platform == "linux":
        try:
            after_name = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace").rpartition(")")[2]
        except OSError:
            return None
        fields = after_name.split()
        return None if fields[0] in "ZX" else int(fields[19])
    if sys.platform == "win32":  # asking for a process by a signal would end it there
        return 0
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return None
    except PermissionError:  # another user's
        pass
    return 0


class LockHeldError(Exception):
    """Raised where a lock file is held, or may be, by another process.

    Attributes:
        owner: the process, as far as the file says so.
        certain: whether it is known to live; on a file system without locks nothing is known of another machine's.
    """

    def __init__(self, owner: Owner | None, certain: bool) -> None:
        super().__init__(owner, certain)
        self.owner, self.certain = owner, certain


@contextmanager
def exclusive(path: Path, *, keep: bool = True) -> Iterator[None]:
    """Hold a lock file while the context lasts; the system frees it if the process ends.

    Args:
        path: of the file.
        keep: whether it stays, empty; else it is removed.

    Raises:
        LockHeldError: another process holds it, or may do so.
        OSError: it can't be written.
        InputError: it is a link that leads out of its folder.
    """
    path_inside(path.parent, path.name, path, follow=True)
    with path.open("a+", encoding="utf-8") as file:
        lock, owner = try_lock(file.fileno()), None
        if lock and not keep and not _is_at(path, file.fileno()):
            raise LockHeldError(None, certain=True)  # its owner removed it just now, and another may have it
        with suppress(OSError):  # Windows lets nobody read what is locked
            file.seek(0)
            owner = read_owner(file.read())
        if lock is False or (lock is None and owner is not None and not is_dead(owner, None)):
            certain = lock is False or (owner is not None and owner.host == this_process().host)
            raise LockHeldError(owner, certain)
        file.truncate(0)
        file.write(this_process(lock is True).to_json())
        file.flush()
        try:
            yield
        finally:
            with suppress(OSError):
                file.truncate(0)
            if not keep:
                with suppress(OSError):  # Windows removes no file that is open
                    path.unlink()


def _is_at(path: Path, descriptor: int) -> bool:
    """Return whether an open file is the one that a path names."""
    try:
        return os.path.samestat(path.stat(), os.fstat(descriptor))
    except OSError:
        return False
