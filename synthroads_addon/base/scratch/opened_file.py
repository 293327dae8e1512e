"""Which file Blender is opening, kept where it outlasts a crash: some damaged ones end the whole process."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_note: int | None = None
"""Descriptor of the file that holds the name of the file which is being opened."""


def note_opened_file_in(descriptor: int) -> None:
    """Have `being_opened` note names in an open file from now on."""
    global _note
    _note = descriptor


def noted_file(descriptor: int) -> str:
    """Return the name of the file that a dead process was opening, by its note; empty if it opened none."""
    return os.fsdecode(os.pread(descriptor, os.fstat(descriptor).st_size, 0))


@contextmanager
def being_opened(path: Path) -> Iterator[None]:
    """Context in which a file is being opened by what may crash on it."""
    if _note is None:
        yield
        return
    os.pwrite(_note, os.fsencode(path), 0)
    try:
        yield
    finally:
        os.ftruncate(_note, 0)
