"""One process at a time: a lock file that others respect, on file systems without locks as well."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from .locks import try_lock
from .owner import Owner, is_dead, read_owner, this_process


class TakenError(Exception):
    """A lock file is another process's.

    Attributes:
        owner: the process, as far as the file says so.
        certain: whether it is known to live; on a file system without locks nothing is known of another machine's.
    """

    def __init__(self, owner: Owner | None, certain: bool) -> None:
        super().__init__(owner, certain)
        self.owner, self.certain = owner, certain


@contextmanager
def exclusive(path: Path) -> Iterator[None]:
    """Hold a lock file; it goes with the process however that ends. The file itself stays, empty.

    Raises:
        TakenError: another process holds it, or may do so.
        OSError: it can't be written.
    """
    with path.open("a+", encoding="utf-8") as file:
        lock, owner = try_lock(file.fileno()), None
        with suppress(OSError):  # Windows lets nobody read what is locked
            file.seek(0)
            owner = read_owner(file.read())
        if lock is False or (lock is None and owner is not None and not is_dead(owner, None)):
            certain = lock is False or (owner is not None and owner.host == this_process().host)
            raise TakenError(owner, certain)
        file.truncate(0)
        file.write(this_process(lock is True).to_json())
        file.flush()
        try:
            yield
        finally:
            with suppress(OSError):
                file.truncate(0)
