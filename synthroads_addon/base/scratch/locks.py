"""Locks of open files, which the system frees when their process ends, however it ends."""

from __future__ import annotations

import errno
import os
import sys

_TAKEN = (errno.EWOULDBLOCK, errno.EAGAIN, errno.EACCES, errno.EDEADLK)


def try_lock(descriptor: int) -> bool | None:
    """Lock an open file against other processes, without waiting.

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
