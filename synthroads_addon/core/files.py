"""Writing a job's files so that nothing half-written ever stands under its final name."""

from __future__ import annotations

import errno
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from .errors import OutputError


@contextmanager
def output_folder(target: Path, names: Iterable[str], overwrite: bool) -> Iterator[Path]:
    """Yield a temporary folder inside ``target``; at the end its files are moved into ``target``.

    When the work fails or is stopped, the temporary folder is removed and ``target`` is as it was.

    Args:
        target: folder for the files; made if it isn't there.
        names: the files that will be written, to find out early if one is already there.
        overwrite: whether files of these names may be replaced; other files in the folder are never touched.

    Raises:
        OutputError: a file is already there, or the folder can't be made or written, or the disk is full.
    """
    made = not target.exists()
    present = [name for name in names if (target / name).exists()]
    if present and not overwrite:
        raise OutputError("--output", str(target), f"already holds {present[0]}; --overwrite replaces it")
    try:
        target.mkdir(parents=True, exist_ok=True)
        temporary = Path(tempfile.mkdtemp(prefix=".partial-", dir=target))
    except OSError as error:
        raise OutputError("--output", str(target), f"cannot be written ({error.strerror})") from None
    try:
        yield temporary
        for path in sorted(temporary.iterdir()):
            path.replace(target / path.name)
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EACCES, errno.EROFS):
            raise OutputError("--output", str(target), f"cannot be written ({error.strerror})") from None
        raise
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
        if made and target.exists() and not any(target.iterdir()):
            target.rmdir()
