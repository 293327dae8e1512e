"""`Owner`: which process something belongs to, written down so that another process can tell whether it still lives."""

from __future__ import annotations

import json
import os
import socket
import sys
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path


@dataclass(frozen=True)
class Owner:
    """A process, as another one on this or another machine knows it again.

    Attributes:
        host: name of the machine.
        boot: id of the machine's boot; empty where the system tells none.
        pid: number of the process.
        start: when it started, in clock ticks since the boot; 0 where the system doesn't tell. A number that was given
            to another process after the owner's end has another start.
        locked: whether the file that says so is locked as long as the owner lives.
    """

    host: str
    boot: str
    pid: int
    start: int
    locked: bool = False

    def to_json(self) -> str:
        """Return the owner as one line of JSON."""
        return json.dumps(asdict(self)) + "\n"


def read_owner(text: str) -> Owner | None:
    """Return the owner that a text of `Owner.to_json` names; None where it is damaged or not whole."""
    try:
        owner = Owner(**json.loads(text))
    except (ValueError, TypeError):
        return None
    kinds = {"host": str, "boot": str, "pid": int, "start": int, "locked": bool}
    return owner if all(isinstance(getattr(owner, name), kind) for name, kind in kinds.items()) else None


def this_process(locked: bool = False) -> Owner:
    """Return the process that asks."""
    pid = os.getpid()
    return Owner(socket.gethostname(), _boot_id(), pid, _start_of(pid) or 0, locked)


def is_dead(owner: Owner, lock: bool | None) -> bool:
    """Return whether an owner is known to have ended; where that can't be told, it hasn't.

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
    start = _start_of(owner.pid)
    return start is None or start != owner.start


@cache
def _boot_id() -> str:
    try:
        return Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
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
